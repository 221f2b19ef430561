"""The functions of FMI 2.0 and 3.0 as the standards' headers declare them, called through ctypes.

Importers such as FMPy protect their users from null pointers, calls out of order and values that are not
finite; here they reach the library. FMPy brings the headers.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from ctypes import (
    CDLL,
    CFUNCTYPE,
    POINTER,
    Structure,
    byref,
    c_bool,
    c_char,
    c_char_p,
    c_double,
    c_int,
    c_size_t,
    c_uint32,
    c_void_p,
)
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple, Self

import fmpy
import fmpy.fmi2
import fmpy.fmi3
from fmpy.fmi2 import fmi2CoSimulation
from fmpy.fmi2 import fmi2EventInfo as EventInfo
from fmpy.fmi3 import fmi3LogMessageCallback as LOGGER
from fmpy.model_description import ScalarVariable

from fmu.master import Fmu

STEP = 0.125
"""Exact in binary, so that the model's level is computed without rounding."""

MODEL_EXCHANGE, CO_SIMULATION = "ModelExchange", "CoSimulation"
EVENT_MODE = "CoSimulation with Event Mode"
SCHEDULED_EXECUTION = "ScheduledExecution"


class Status(IntEnum):
    """`fmi2Status` and `fmi3Status`."""

    OK = 0
    WARNING = 1
    DISCARD = 2
    ERROR = 3
    FATAL = 4
    PENDING = 5


class Message(NamedTuple):
    """A logged message."""

    status: int
    category: str
    text: str


LOGGER_2 = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, c_char_p)
"""`fmi2CallbackLogger`, with the one variadic argument that the format "%s" reads. On the 64-bit platforms
whose binaries run here, a pointer is passed to a variadic function as to any other."""


class CallbackFunctions(Structure):
    """`fmi2CallbackFunctions`."""

    _fields_ = [
        ("logger", LOGGER_2),
        ("allocate_memory", c_void_p),
        ("free_memory", c_void_p),
        ("step_finished", c_void_p),
        ("component_environment", c_void_p),
    ]


TYPES = {
    **vars(fmpy.fmi2),
    **vars(fmpy.fmi3),
    "size_t": c_size_t,
    # FMPy's type fixes the logger's type; ours takes any address.
    "fmi2CallbackFunctions": CallbackFunctions,
    "fmi3Byte": c_char,
    "fmi3Binary": c_void_p,
}
"""FMPy's, by their names in the standards' headers."""


class Parameter(NamedTuple):
    """A parameter of a function, as the header declares it."""

    type: Any
    name: str
    is_pointer: bool


def declared(version: int) -> dict[str, tuple[Any, list[Parameter]]]:
    """The functions of a version's header: the type of the result and the parameters of each."""
    header = Path(fmpy.__file__).parent / "c-code" / f"fmi{version}FunctionTypes.h"
    text = re.sub(r"/\*.*?\*/", "", header.read_text(), flags=re.DOTALL)
    functions = {}
    for result, name, parameters in re.findall(
        r"typedef\s+(\w[\w\s]*?\*?)\s*\b(fmi\d\w+)TYPE\s*\(([^)]*)\)\s*;", text
    ):
        found = []
        for parameter in parameters.split(","):
            match = re.fullmatch(r"\s*(?:const\s+)?(\w+)\s*(\*?)\s*(\w*)(\[\])?\s*", parameter)
            if match and match[1] != "void":
                found.append(Parameter(TYPES[match[1]], match[3], bool(match[2] or match[4])))
        of_result = {"void": None, "const char*": c_char_p}
        functions[name] = (of_result[result] if result in of_result else TYPES[result], found)
    return functions


DECLARED = {version: declared(version) for version in (2, 3)}
assert [len(DECLARED[version]) for version in (2, 3)] == [44, 75], "the functions of the standard's headers"
FUNCTIONS = DECLARED[2] | DECLARED[3]

_OF_EACH = [*DECLARED[2]]
_FIRST = [_OF_EACH.index(name) for name in ("fmi2EnterEventMode", "fmi2SetRealInputDerivatives")]
COMMON, OF_CO_SIMULATION = _OF_EACH[: _FIRST[0]], _OF_EACH[_FIRST[1] :]
OF_MODEL_EXCHANGE = _OF_EACH[_FIRST[0] : _FIRST[1]]
"""Those of FMI 2.0; the header has them one after the other."""


class Library:
    """A loaded library, its functions as attributes with the types of the standard."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.handle = CDLL(str(path))
        for name, (result, parameters) in FUNCTIONS.items():
            if hasattr(self.handle, name):
                function = getattr(self.handle, name)
                function.restype = result
                function.argtypes = [POINTER(of) if is_pointer else of for of, _, is_pointer in parameters]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.handle, name)


def array(of: Any, *values: Any) -> Any:
    """An array of C."""
    return (of * len(values))(*values)


def reals(*values: float) -> Any:
    """An array of fmi2Real."""
    return array(c_double, *values)


def integers(*values: int) -> Any:
    """An array of fmi2Integer or fmi2Boolean."""
    return array(c_int, *values)


def strings(*values: bytes | str | None) -> Any:
    """An array of fmi2String."""
    return array(c_char_p, *(value.encode() if isinstance(value, str) else value for value in values))


def buffer(data: bytes) -> Any:
    """Bytes, as C takes them."""
    return (c_char * len(data)).from_buffer_copy(data)


def numbers_in(text: str) -> list[float]:
    """The numbers in a message, however they are written."""
    pattern = r"(?<![\w.])-?(?:\d+(?:\.\d+)?(?:[eE][-+]?\d+)?|inf|NaN)(?![\w])"
    return [float(number) for number in re.findall(pattern, text)]


class AnyInstance:
    """An instance, called function by function, and its messages.

    `messages` grows as the logger is called; `component` is None when there is no instance.
    """

    component = None
    version: int

    def __init__(self, library: Library) -> None:
        self.library = library
        self.messages: list[Message] = []

    def arguments(self, function: str, **values: Any) -> list[Any]:
        """A value for each parameter after the instance: a given one, otherwise 0, memory for pointers."""
        parameters = FUNCTIONS[function][1]
        is_of_instance = bool(parameters) and parameters[0].name in ("c", "instance")
        return [
            values[name] if name in values else (of * 16)() if is_pointer else of()
            for of, name, is_pointer in parameters[is_of_instance:]
        ]

    def call(self, function: str, *arguments: Any) -> Status:
        """Calls a function on the instance."""
        return Status(getattr(self.library, function)(self.component, *arguments))

    def ok(self, function: str, *arguments: Any, **values: Any) -> list[Any]:
        """A call that must succeed, with these arguments or otherwise with `arguments`, which it returns."""
        passed = list(arguments) or self.arguments(function, **values)
        status = self.call(function, *passed)
        assert status == Status.OK, f"{function} returns {status.name}: {self.messages}"
        return passed

    def refuses(
        self, function: str, *arguments: Any, names: Iterable[str] = (), numbers: Iterable[float] = ()
    ) -> str:
        """A call is an Error with exactly one message, which has the function, the names and the numbers.
        Returns the message without the function."""
        before = len(self.messages)
        status = self.call(function, *arguments)
        messages = self.messages[before:]
        assert status == Status.ERROR, f"{function} returns {status.name}: {messages}"
        assert [message[:2] for message in messages] == [(3, "logStatusError")], messages
        text = messages[0].text
        assert text.startswith(f"{function}: "), text
        for name in names:
            assert re.search(rf"(?<![\w.]){re.escape(name)}(?!\w)", text), f"{name!r} is not in: {text}"
        named = numbers_in(text)
        for number in numbers:
            is_named = any(map(math.isnan, named)) if math.isnan(number) else number in named
            assert is_named, f"{number!r} is not in: {text}"
        return text.removeprefix(f"{function}: ")

    def of_state(self, action: str) -> str:
        """The name of a function of saved states; FMI 3.0 capitalizes otherwise."""
        if self.version == 2:
            return f"fmi2{action}"
        return f"fmi3{action.replace('DeSerialize', 'Deserialize').replace('FMUstate', 'FMUState')}"

    def save(self) -> c_void_p:
        """Saves the present state."""
        state = c_void_p()
        self.ok(self.of_state("GetFMUstate"), byref(state))
        return state

    def serialize(self, state: c_void_p) -> bytes:
        """The bytes of a saved state."""
        size = c_size_t()
        self.ok(self.of_state("SerializedFMUstateSize"), state, byref(size))
        room = (c_char * size.value)()
        self.ok(self.of_state("SerializeFMUstate"), state, room, size)
        return bytes(room)

    def snapshot(self) -> bytes:
        """The bytes of the present state."""
        state = self.save()
        data = self.serialize(state)
        self.ok(self.of_state("FreeFMUstate"), byref(state))
        return data

    def deserialize(self, data: bytes) -> c_void_p:
        """The state with these bytes."""
        state = c_void_p()
        self.ok(self.of_state("DeSerializeFMUstate"), buffer(data), len(data), byref(state))
        return state

    def restore(self, data: bytes) -> None:
        """Continues from a serialized state."""
        state = self.deserialize(data)
        self.ok(self.of_state("SetFMUstate"), state)
        self.ok(self.of_state("FreeFMUstate"), byref(state))
        assert state.value is None

    def free(self) -> None:
        """Frees the instance, once."""
        if self.component:
            getattr(self.library, f"fmi{self.version}FreeInstance")(self.component)
            self.component = None


ARRAYS = {"Real": reals, "Integer": integers, "Boolean": integers, "String": strings}
EMPTY = {"Real": 0.0, "Integer": 0, "Boolean": 0, "String": None}


def c_type_of(variable: ScalarVariable) -> str:
    """The type in the names of the functions that get and set a variable: section 2.2.7 has enumerations
    go through those of Integer."""
    return "Integer" if variable.type == "Enumeration" else variable.type


class Instance(AnyInstance):
    """An instance of FMI 2.0."""

    version = 2

    def __init__(
        self,
        fmu: Fmu,
        library: Library,
        *,
        name: bytes | None = b"instance",
        guid: bytes | None = b"right",
        fmu_type: int = fmi2CoSimulation,
        resource_location: bytes | None = None,
        environment: int | None = None,
        logging_on: bool = False,
    ) -> None:
        super().__init__(library)
        self.fmu = fmu
        self.names_and_environments: list[tuple[bytes, int | None]] = []
        self.callbacks = CallbackFunctions(LOGGER_2(self._log), None, None, None, environment)
        guid = fmu.guid.encode() if guid == b"right" else guid
        self.component = library.fmi2Instantiate(
            name, fmu_type, guid, resource_location, byref(self.callbacks), 0, int(logging_on)
        )

    def _log(
        self, environment: int | None, name: bytes, status: int, category: bytes, fmt: bytes, text: bytes
    ) -> None:
        self.names_and_environments.append((name, environment))
        # A message must be an argument, not the format.
        assert fmt == b"%s"
        self.messages.append(Message(status, category.decode(), text.decode()))

    def set_up(
        self, start_time: float = 0.0, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        """`fmi2SetupExperiment`."""
        of_tolerance, of_stop = ((value is not None, value or 0.0) for value in (tolerance, stop_time))
        self.ok("fmi2SetupExperiment", *of_tolerance, start_time, *of_stop)

    def enter(self, start_time: float = 0.0, stop_time: float | None = None, **experiment: float) -> None:
        """Brings a new instance into Initialization Mode."""
        self.set_up(start_time, stop_time, **experiment)
        self.ok("fmi2EnterInitializationMode")

    def initialize(
        self, start_time: float = 0.0, stop_time: float | None = None, **experiment: float
    ) -> Self:
        """Initializes a new instance."""
        self.enter(start_time, stop_time, **experiment)
        self.ok("fmi2ExitInitializationMode")
        return self

    def settings(self, values: Mapping[str, Any]) -> tuple[str, Any, int, Any]:
        """The function that sets variables of one type, and its arguments."""
        (kind,) = {c_type_of(self.fmu.variables[name]) for name in values}
        return f"fmi2Set{kind}", self.fmu.references(*values), len(values), ARRAYS[kind](*values.values())

    def getting(self, *names: str) -> tuple[str, Any, int, Any]:
        """The function that gets variables of one type, and its arguments."""
        (kind,) = {c_type_of(self.fmu.variables[name]) for name in names}
        values = ARRAYS[kind](*[EMPTY[kind]] * len(names))
        return f"fmi2Get{kind}", self.fmu.references(*names), len(names), values

    def set(self, values: Mapping[str, Any]) -> Status:
        """Sets variables; returns the worst status."""
        by_kind: dict[str, dict[str, Any]] = {}
        for name, value in values.items():
            by_kind.setdefault(c_type_of(self.fmu.variables[name]), {})[name] = value
        return max((self.call(*self.settings(of_kind)) for of_kind in by_kind.values()), default=Status.OK)

    def choose(self, **items: str) -> Self:
        """Sets the enumerations of a component, `component__variable="item"`."""
        for name, chosen in items.items():
            name = name.replace("__", ".")
            declared = self.fmu.variables[name].declaredType.items
            value = next(int(item.value) for item in declared if item.name == chosen)
            assert self.set({name: value}) == Status.OK
        return self

    def get(self, name: str) -> Any:
        """The value of a variable, which must be readable."""
        function, vr, count, values = self.getting(name)
        self.ok(function, vr, count, values)
        return values[0]

    def outputs(self) -> list[Any]:
        """The values of all outputs."""
        return [self.get(name) for name in self.fmu.named("output")]

    def set_derivative(self, name: str, order: int, value: float) -> Status:
        """`fmi2SetRealInputDerivatives` of one input."""
        arguments = (self.fmu.references(name), 1, integers(order), reals(value))
        return self.call("fmi2SetRealInputDerivatives", *arguments)

    def step(self, time: float, size: float) -> Status:
        """`fmi2DoStep`."""
        return self.call("fmi2DoStep", time, size, 1)

    def run(self, steps: int, size: float = STEP) -> list[Any]:
        """Steps from 0; the outputs."""
        for index in range(steps):
            assert self.step(index * size, size) == Status.OK
        return self.outputs()

    def end(self) -> tuple[float, bool]:
        """The time that the last step reached, and whether the model asked for the end (section 4.2.3)."""
        time, terminated = c_double(), c_int(7)
        self.ok("fmi2GetRealStatus", 2, byref(time))
        self.ok("fmi2GetBooleanStatus", 3, byref(terminated))
        assert terminated.value in (0, 1)
        return time.value, bool(terminated.value)

    def vector(self, quantity: str) -> list[float]:
        """What Model Exchange has an array of, such as `Derivatives`."""
        count = len(self.fmu.description.derivatives)
        if quantity == "EventIndicators":
            count = self.fmu.description.numberOfEventIndicators
        values = reals(*[math.nan] * count)
        self.ok(f"fmi2Get{quantity}", values, count)
        assert all(map(math.isfinite, values)), f"{quantity}: {list(values)}"
        return list(values)

    def set_states(self, *states: float) -> None:
        """`fmi2SetContinuousStates`."""
        self.ok("fmi2SetContinuousStates", reals(*states), len(states))

    def new_discrete_states(self) -> EventInfo:
        """`fmi2NewDiscreteStates`."""
        info = EventInfo(*[7] * 5, math.nan)
        self.ok("fmi2NewDiscreteStates", byref(info))
        for name, kind in EventInfo._fields_:
            assert kind is c_double or getattr(info, name) in (0, 1), name
        assert info.nominalsOfContinuousStatesChanged == 0
        assert not info.nextEventTimeDefined or math.isfinite(info.nextEventTime)
        return info


class Instance3(AnyInstance):
    """An instance of FMI 3.0, whose variables go by their value references."""

    version = 3

    def __init__(self, library: Library, token: str, interface: str, **arguments: Any) -> None:
        super().__init__(library)
        if interface == EVENT_MODE:
            interface, arguments = CO_SIMULATION, {"eventModeUsed": True} | arguments

        def log(_environment: int, status: int, category: bytes, text: bytes) -> None:
            self.messages.append(Message(status, category.decode(), text.decode()))

        self._logger = LOGGER(log)
        values = {
            "instanceName": b"instance",
            "instantiationToken": token.encode(),
            "logMessage": self._logger,
        } | arguments
        name = f"fmi3Instantiate{interface}"
        self.component = getattr(library, name)(*self.arguments(name, **values))

    def initialize(self, start_time: float = 0.0) -> None:
        """Up to the end of initialization."""
        self.ok("fmi3EnterInitializationMode", startTime=start_time)
        self.ok("fmi3ExitInitializationMode")

    def get(self, kind: str, references: list[int], size: int | None = None) -> list[Any]:
        """The values of variables, in all of `size` elements."""
        size = len(references) if size is None else size
        values = (TYPES[f"fmi3{kind}"] * size)()
        self.ok(f"fmi3Get{kind}", array(c_uint32, *references), len(references), values, size)
        return list(values)

    def set(self, kind: str, references: list[int], values: list[Any]) -> Status:
        """Sets variables."""
        content = array(TYPES[f"fmi3{kind}"], *values)
        return self.call(
            f"fmi3Set{kind}", array(c_uint32, *references), len(references), content, len(values)
        )

    def step(self, time: float, size: float) -> tuple[Status, tuple[bool, bool, bool, float]]:
        """A step, with what it returns."""
        flags = [c_bool(True), c_bool(True), c_bool(True)]
        reached = c_double()
        status = self.call("fmi3DoStep", time, size, True, *map(byref, flags), byref(reached))
        return status, (*(flag.value for flag in flags), reached.value)

    def update(self) -> tuple[list[bool], float | None]:
        """`fmi3UpdateDiscreteStates`: the first four flags, and the next event's time if there is one."""
        flags = [c_bool(True) for _ in range(5)]
        next_time = c_double()
        self.ok("fmi3UpdateDiscreteStates", *map(byref, flags), byref(next_time))
        return [flag.value for flag in flags[:4]], next_time.value if flags[4] else None

    def derivatives(
        self, kind: str, unknowns: list[int], knowns: list[int], seeds: list[float]
    ) -> tuple[Status, list[float]]:
        """`fmi3GetDirectionalDerivative` or `fmi3GetAdjointDerivative`."""
        found = reals(*[9.0] * len(unknowns if kind == "Directional" else knowns))
        lists = [argument for of in (unknowns, knowns) for argument in (array(c_uint32, *of), len(of))]
        status = self.call(f"fmi3Get{kind}Derivative", *lists, reals(*seeds), len(seeds), found, len(found))
        return status, list(found)

    def activate(self, clock: int, time: float) -> None:
        """`fmi3ActivateModelPartition`."""
        self.ok("fmi3ActivateModelPartition", clock, time)

    def interval(self, clock: int) -> tuple[float, int]:
        """The interval of a clock, and its qualifier."""
        interval, qualifier = reals(-1.0), integers(-1)
        self.ok("fmi3GetIntervalDecimal", array(c_uint32, clock), 1, interval, qualifier)
        return interval[0], qualifier[0]

    def shift(self, clock: int) -> float:
        """The shift of a clock."""
        shift = reals(-1.0)
        self.ok("fmi3GetShiftDecimal", array(c_uint32, clock), 1, shift)
        return shift[0]
