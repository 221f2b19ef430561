"""A small co-simulation master on FMPy's raw interface.

Variables are accessed by name, through arrays that are allocated once, so that a run at 1 kHz takes seconds.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from ctypes import Array, byref, c_double, c_int, c_uint32
from pathlib import Path
from typing import NamedTuple

import numpy as np
from fmpy import (
    calloc,
    extract,
    free,
    platform,
    platform_tuple,
    read_model_description,
    sharedLibraryExtension,
)
from fmpy.fmi2 import (
    FMU2Model,
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.fmi3 import FMU3Slave
from fmpy.logging import addLoggerProxy
from fmpy.model_description import ScalarVariable

Value = float | int | bool | str
Signal = Callable[[float], float]

WARNING, ERROR = 1, 3
"""Statuses of the standard."""


class Message(NamedTuple):
    """A logged message."""

    status: int
    category: str
    text: str


_LOGS: defaultdict[int | None, list[Message]] = defaultdict(list)
"""The messages of each instance, by its componentEnvironment; FMPy's own instances have none."""


def _log(environment: int | None, _: bytes, status: int, category: bytes, message: bytes) -> None:
    _LOGS[environment].append(Message(status, category.decode(), message.decode()))


_LOGGER = fmi2CallbackLoggerTYPE(_log)
"""A common one: FMPy's proxy, which formats the messages, keeps only the last logger."""


class Fmu:
    """An extracted FMU."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.path = path
        self.description = read_model_description(path)
        self.folder = Path(extract(path, folder))
        of = self.description
        self.guid = of.guid
        self.is_fmi3 = of.fmiVersion.startswith("3.")
        interface = of.coSimulation or of.modelExchange or of.scheduledExecution
        binaries = self.folder / "binaries" / (platform_tuple if self.is_fmi3 else platform)
        self.library = binaries / (interface.modelIdentifier + sharedLibraryExtension)
        self.variables: dict[str, ScalarVariable] = {
            variable.name: variable for variable in self.description.modelVariables
        }

    def references(self, *names: str) -> Array[c_uint32]:
        """The value references of variables."""
        return (c_uint32 * len(names))(*(self.variables[name].valueReference for name in names))

    def named(self, causality: str) -> list[str]:
        """The names of the variables of a causality, in their order."""
        variables = self.description.modelVariables
        return [v.name for v in variables if v.causality == causality]

    def states(self) -> list[str]:
        """The names of the continuous-time states, in their order."""
        unknowns = self.description.derivatives
        return [unknown.variable.derivative.name for unknown in unknowns]


class Instance:
    """An instance of an FMU, for co-simulation or Model Exchange, with its messages."""

    def __init__(
        self, fmu: Fmu, name: str | None = None, kind: type[FMU2Slave | FMU2Model] = FMU2Slave
    ) -> None:
        self.fmu = fmu
        self.messages: list[Message] = []
        self.slave = kind(
            guid=fmu.description.guid,
            modelIdentifier=fmu.description.coSimulation.modelIdentifier,
            unzipDirectory=str(fmu.folder),
            instanceName=name or fmu.description.modelName,
        )
        callbacks = fmi2CallbackFunctions()
        callbacks.logger = _LOGGER
        callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        callbacks.componentEnvironment = id(self)
        addLoggerProxy(byref(callbacks))
        _LOGS[id(self)] = self.messages
        self.slave.instantiate(callbacks=callbacks, loggingOn=True)

    def warnings(self) -> list[str]:
        """The texts of the warnings so far."""
        return [m.text for m in self.messages if m.status == WARNING]

    def set(self, values: Mapping[str, Value]) -> None:
        """Sets variables; an enumeration's value may be its item's name."""
        for name, value in values.items():
            variable = self.fmu.variables[name]
            if variable.type == "Enumeration" and isinstance(value, str):
                items = variable.declaredType.items
                value = next(int(item.value) for item in items if item.name == value)
            getattr(self.slave, f"set{self.type_of(variable)}")([variable.valueReference], [value])

    def get(self, name: str) -> Value:
        """The value of one variable."""
        variable = self.fmu.variables[name]
        return getattr(self.slave, f"get{self.type_of(variable)}")([variable.valueReference])[0]

    def type_of(self, variable: ScalarVariable) -> str:
        """The type in the names of the functions that get and set a variable."""
        return "Integer" if variable.type == "Enumeration" else variable.type

    def reals(self, names: Iterable[str]) -> np.ndarray:
        """The values of Real variables."""
        return Reals(self, list(names)).get().copy()

    def get_reals(self, references: Array[c_uint32], values: Array[c_double]) -> None:
        """Gets Real variables."""
        self.slave.fmi2GetReal(self.slave.component, references, len(references), values)

    def set_reals(self, references: Array[c_uint32], values: Array[c_double]) -> None:
        """Sets Real variables."""
        self.slave.fmi2SetReal(self.slave.component, references, len(references), values)

    def begin(
        self,
        values: Mapping[str, Value] | None = None,
        start_time: float = 0.0,
        stop_time: float | None = None,
        tolerance: float | None = None,
    ) -> Instance:
        """Sets start values and enters the initialization mode."""
        self.slave.setupExperiment(startTime=start_time, stopTime=stop_time, tolerance=tolerance)
        self.set(values or {})
        self.slave.enterInitializationMode()
        return self

    def start(self, values: Mapping[str, Value] | None = None, **experiment) -> Instance:
        """Sets start values and initializes."""
        self.begin(values, **experiment)
        self.slave.exitInitializationMode()
        return self

    def free(self) -> None:
        """Frees the instance, once."""
        if self.slave.component is not None:
            self.slave.freeInstance()
            self.slave.component = None


class Instance3(Instance):
    """An instance of an FMU of FMI 3.0, for co-simulation."""

    def __init__(self, fmu: Fmu, name: str | None = None) -> None:
        self.fmu = fmu
        self.messages = messages = []
        self.slave = FMU3Slave(
            guid=fmu.description.guid,
            modelIdentifier=fmu.description.coSimulation.modelIdentifier,
            unzipDirectory=str(fmu.folder),
            instanceName=name or fmu.description.modelName,
        )

        def log(_: int, status: int, category: bytes, message: bytes) -> None:
            messages.append(Message(status, category.decode(), message.decode()))

        self.slave.instantiate(loggingOn=True, logMessage=log)

    def type_of(self, variable: ScalarVariable) -> str:
        return "Int64" if variable.type == "Enumeration" else variable.type

    def get_reals(self, references: Array[c_uint32], values: Array[c_double]) -> None:
        self.slave.fmi3GetFloat64(self.slave.component, references, len(references), values, len(values))

    def set_reals(self, references: Array[c_uint32], values: Array[c_double]) -> None:
        self.slave.fmi3SetFloat64(self.slave.component, references, len(references), values, len(values))

    def begin(
        self,
        values: Mapping[str, Value] | None = None,
        start_time: float = 0.0,
        stop_time: float | None = None,
        tolerance: float | None = None,
    ) -> Instance:
        self.set(values or {})
        self.slave.enterInitializationMode(startTime=start_time, stopTime=stop_time, tolerance=tolerance)
        return self


Make = Callable[[], Instance]
"""Makes an instance."""


class Reals:
    """Real variables of an instance, in arrays that are allocated once."""

    def __init__(self, instance: Instance, names: list[str]) -> None:
        self.instance = instance
        self.count = len(names)
        self.references = instance.fmu.references(*names)
        self.orders = (c_int * self.count)(*([1] * self.count))
        self.memory = (c_double * self.count)()
        self.values = np.frombuffer(self.memory)

    def get(self) -> np.ndarray:
        """Gets the values, always in the same array."""
        self.instance.get_reals(self.references, self.memory)
        return self.values

    def set(self, values: np.ndarray | Iterable[float]) -> None:
        """Sets the values."""
        self.values[:] = values
        self.instance.set_reals(self.references, self.memory)

    def set_derivatives(self, values: np.ndarray | Iterable[float]) -> None:
        """Sets the first derivatives, of inputs."""
        self.values[:] = values
        slave = self.instance.slave
        slave.fmi2SetRealInputDerivatives(
            slave.component, self.references, self.count, self.orders, self.memory
        )


class Wires:
    """A connection of two instances: the outputs and inputs of equal names."""

    def __init__(self, source: Instance, target: Instance) -> None:
        inputs = set(target.fmu.named("input"))
        names = [name for name in source.fmu.named("output") if name in inputs]
        self.names = names
        self.source, self.target = Reals(source, names), Reals(target, names)

    def transfer(self) -> None:
        """Transfers the values."""
        self.target.set(self.source.get())


class Record(dict[str, np.ndarray]):
    """Variables and time at the communication points, by name."""

    def at(self, time: float) -> dict[str, float]:
        """The values at a communication point."""
        row = int(np.argmin(np.abs(self["time"] - time)))
        assert abs(self["time"][row] - time) < 1e-6, f"{time} s was not recorded"
        return {name: column[row] for name, column in self.items()}

    def between(self, start: float, end: float) -> Record:
        """The part from a time to another, both included."""
        time = self["time"]
        rows = (time >= start - 1e-9) & (time <= end + 1e-9)
        return Record({name: column[rows] for name, column in self.items()})


class Master:
    """Steps instances in their order, each with the others' latest outputs.

    `inputs` are signals over time, constant during a step, for each instance that has an input of the name.
    `clock` gives the communication points by their numbers, as some masters compute them in another way.
    """

    def __init__(
        self,
        instances: list[Instance],
        step: float,
        *,
        start_time: float = 0.0,
        inputs: Mapping[str, Signal] | None = None,
        at_once: bool = False,
        clock: Callable[[int], float] | None = None,
        also: Mapping[Instance, list[str]] | None = None,
    ) -> None:
        self.instances, self.step, self.start_time = instances, step, start_time
        self.at_once, self.clock = at_once, clock
        self.steps_done = 0
        self.wires = {
            target: [Wires(source, target) for source in instances if source is not target]
            for target in instances
        }
        self.signals = [
            (Reals(instance, [name]), signal)
            for name, signal in (inputs or {}).items()
            for instance in instances
            if name in instance.fmu.named("input")
        ]
        self.names: list[str] = []
        self.recorded: list[Reals] = []
        for instance in instances:
            names = instance.fmu.named("output") + (also or {}).get(instance, [])
            self.names += names
            self.recorded.append(Reals(instance, names))

    @property
    def time(self) -> float:
        """The current communication point."""
        if self.clock:
            return self.clock(self.steps_done)
        return self.start_time + self.steps_done * self.step

    def initialize(self) -> Master:
        """Exchanges values in initialization mode and leaves it.

        Twice, because a plant that settles at the controller's outputs returns a measured supply, which
        changes these.
        """
        self._apply(self.start_time)
        for _ in range(2):
            for wires in self.wires.values():
                for wire in wires:
                    wire.transfer()
        for instance in self.instances:
            instance.slave.exitInitializationMode()
        return self

    def _apply(self, time: float) -> None:
        for reals, signal in self.signals:
            value = signal(time)
            if value != reals.values[0]:
                reals.set([value])

    def _take(self, instance: Instance) -> None:
        for wire in self.wires[instance]:
            wire.transfer()

    def run(self, stop_time: float) -> Record:
        """Steps to a time; returns the record with its start and end."""
        count = round((stop_time - self.time) / self.step)
        table = np.empty((count + 1, 1 + len(self.names)))
        table[0] = self._row()
        for index in range(1, count + 1):
            time = self.time
            step = self.clock(self.steps_done + 1) - time if self.clock else self.step
            self._apply(time)
            if self.at_once:
                for instance in self.instances:
                    self._take(instance)
                for instance in self.instances:
                    instance.slave.doStep(time, step)
            else:
                for instance in self.instances:
                    self._take(instance)
                    instance.slave.doStep(time, step)
            self.steps_done += 1
            table[index] = self._row()
        return Record(zip(["time", *self.names], table.T, strict=True))

    def _row(self) -> list[float]:
        return [self.time, *(value for reals in self.recorded for value in reals.get())]
