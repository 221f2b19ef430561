"""Prints how FMUs for co-simulation of FMI 3.0 respond to calls that break the rules: the exporter's test
model, one of PythonFMU3, and those that are named. Each case runs in another process, since some crash.

    PYTHONPATH=tests target/venv/bin/python benches/first-fmu/peers.py FMU...

That the exporter responds as it should is tested in crates/fmu-export/tests/importer.
"""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from ctypes import c_double, c_uint32
from functools import cached_property
from pathlib import Path

import fmpy

from fmu import TARGET
from fmu.exporter.importer import CO_SIMULATION, DECLARED, LOGGER, Instance3, Library

PEER = """
from pythonfmu3 import Fmi3Causality, Fmi3Slave, Fmi3StepResult, Fmi3Status, Fmi3Variability, Float64

class Lag(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.voltage, self.gain, self.voltage_lagged = 0.0, 1.0, 2.0, 0.0
        self.register_variable(
            Float64("time", causality=Fmi3Causality.independent, variability=Fmi3Variability.continuous)
        )
        self.register_variable(Float64("voltage", causality=Fmi3Causality.input, start=1.0))
        self.register_variable(
            Float64("gain", causality=Fmi3Causality.parameter, variability=Fmi3Variability.tunable, start=2.0)
        )
        self.register_variable(Float64("voltage_lagged", causality=Fmi3Causality.output))

    def do_step(self, time, size):
        self.voltage_lagged += size * (self.gain * self.voltage - self.voltage_lagged)
        return Fmi3StepResult(status=Fmi3Status.ok)
"""
"""A model for PythonFMU3."""

ENVIRONMENT = 0x1234


class Fmu:
    """An extracted FMU, whose library is loaded on first use."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.description = fmpy.read_model_description(path, validate=False)
        fmpy.extract(path, folder)
        (self.binary,) = (folder / "binaries").glob("x86_64-linux/*.so")
        self.resources = f"{folder / 'resources'}/".encode()

    @cached_property
    def library(self) -> Library:
        """The functions."""
        return Library(self.binary)

    def instance(self, **arguments: object) -> Instance3:
        """An instance with its resources, unless the arguments differ."""
        token = self.description.instantiationToken
        return Instance3(self.library, token, CO_SIMULATION, **{"resourcePath": self.resources, **arguments})

    def parameter(self) -> int:
        """A parameter that is a number."""
        return next(
            v.valueReference
            for v in self.description.modelVariables
            if v.type == "Float64" and v.causality == "parameter" and not v.dimensions
        )


def instantiated(**arguments: object) -> Callable[[Fmu], str]:
    """Whether fmi3InstantiateCoSimulation makes an instance."""
    return lambda fmu: "accepted" if fmu.instance(**arguments).component else "NULL"


def stepped(
    time: float, size: float, prepare: Callable[[Instance3], object] = Instance3.initialize
) -> Callable[[Fmu], str]:
    """The status of fmi3DoStep after a preparation."""

    def case(fmu: Fmu) -> str:
        instance = fmu.instance()
        prepare(instance)
        return instance.step(time, size)[0].name

    return case


def ended(instance: Instance3) -> None:
    """Initialized up to a stop time of 1 s."""
    instance.ok("fmi3EnterInitializationMode", stopTimeDefined=True, stopTime=1.0)
    instance.ok("fmi3ExitInitializationMode")


def terminated(instance: Instance3) -> None:
    """Initialized and terminated."""
    instance.initialize()
    instance.ok("fmi3Terminate")


def failed(instance: Instance3) -> None:
    """Initialized, and then called wrongly."""
    instance.initialize()
    instance.call("fmi3ExitInitializationMode")


def not_a_number(fmu: Fmu) -> str:
    """The status of setting a parameter to NaN."""
    return fmu.instance().set("Float64", [fmu.parameter()], [math.nan]).name


def wrong_size(fmu: Fmu) -> str:
    """The status of getting one variable into an array of three values."""
    instance, values = fmu.instance(), (c_double * 3)()
    instance.initialize()
    return instance.call("fmi3GetFloat64", (c_uint32 * 1)(fmu.parameter()), 1, values, 3).name


def environment(fmu: Fmu) -> str:
    """What the logger gets for the instance's environment, of an error."""
    seen: list[int | None] = []
    logger = LOGGER(lambda environment, *_: seen.append(environment))
    instance = fmu.instance(logMessage=logger, instanceEnvironment=ENVIRONMENT, loggingOn=True)
    instance.call("fmi3ExitInitializationMode")
    if not seen:
        return "no message"
    return "the importer's" if set(seen) == {ENVIRONMENT} else "another"


def restored(fmu: Fmu) -> str:
    """Whether a saved and serialized state leads back."""
    instance = fmu.instance()
    instance.initialize()
    outputs = [
        v.valueReference
        for v in (unknown.variable for unknown in fmu.description.outputs)
        if v.type == "Float64" and not v.dimensions
    ]
    before, content = instance.get("Float64", outputs), instance.snapshot()
    instance.step(0.0, 0.125)
    instance.ok("fmi3SetFMUState", instance.deserialize(content))
    return "yes" if instance.get("Float64", outputs) == before else "no"


def event_mode(fmu: Fmu) -> str:
    """Whether an instance with Event Mode is made where the FMU does not declare it."""
    if fmu.description.coSimulation.hasEventMode:
        return "declared"
    return instantiated(eventModeUsed=True)(fmu)


def crashes(fmu: Fmu) -> str:
    """How many functions crash or hang after initialization, with zeros and memory for arguments."""
    count = 0
    for function in CALLED:
        # Some libraries bring a language's runtime, which must not be loaded before.
        child = os.fork()
        if not child:
            signal.alarm(10)
            instance = fmu.instance()
            instance.initialize()
            instance.call(function, *instance.arguments(function))
            os._exit(0)
        count += os.WIFSIGNALED(os.waitpid(child, 0)[1])
    return str(count)


CALLED = sorted(
    name for name, (_, parameters) in DECLARED[3].items() if parameters and parameters[0].name == "instance"
)

CASES: dict[str, Callable[[Fmu], str]] = {
    "wrong instantiation token": instantiated(instantiationToken=b"{00000000}"),
    "NULL instance name": instantiated(instanceName=None),
    "NULL instantiation token": instantiated(instantiationToken=None),
    "NULL resource path": instantiated(resourcePath=None),
    "NULL logger": instantiated(logMessage=LOGGER(0)),
    "Event Mode, not declared": event_mode,
    "environment that the logger gets": environment,
    "fmi3DoStep with h = 0": stepped(0.0, 0.0),
    "fmi3DoStep with h < 0": stepped(0.0, -0.1),
    "fmi3DoStep with h = NaN": stepped(0.0, math.nan),
    "fmi3DoStep before initialization": stepped(0.0, 0.1, lambda _: None),
    "fmi3DoStep after fmi3Terminate": stepped(0.0, 0.1, terminated),
    "fmi3DoStep after an error": stepped(0.0, 0.1, failed),
    "fmi3DoStep past stopTime": stepped(0.0, 2.0, ended),
    "parameter that is NaN": not_a_number,
    "one variable, three values": wrong_size,
    "a serialized state leads back": restored,
    f"of {len(CALLED)} functions, those that crash": crashes,
}


def outcome(path: Path, case: str) -> str:
    """The result of a case, in another process."""
    command = [sys.executable, __file__, "case", str(path), case]
    try:
        result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    except subprocess.TimeoutExpired:
        return "hangs"
    if result.returncode < 0:
        return "crash"
    if result.returncode > 0:
        print(f"{path.name}, {case}: {result.stderr}")
        return "exception"
    return result.stdout.strip().splitlines()[-1]


def outcomes(path: Path) -> dict[str, str]:
    """The results of all cases."""
    return {case: outcome(path, case) for case in CASES}


def table(columns: dict[str, dict[str, str]]) -> str:
    """The results as Markdown."""
    lines = [f"| case | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|"]
    for case in next(iter(columns.values())):
        lines.append(f"| {case} | {' | '.join(results[case] for results in columns.values())} |")
    return "\n".join(lines)


def main() -> None:
    from pythonfmu3.builder import FmuBuilder

    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "lag.py").write_text(PEER)
        FmuBuilder.build_FMU(Path(folder) / "lag.py", dest=folder)
        columns = {
            "fmu-export": TARGET / "test-model" / "cs,me" / "fmi3" / "TestModel.fmu",
            "PythonFMU3": Path(folder) / "Lag.fmu",
            **{path: Path(path) for path in sys.argv[1:]},
        }
        print(table({name: outcomes(path) for name, path in columns.items()}))


if __name__ == "__main__" and sys.argv[1:2] == ["case"]:
    with tempfile.TemporaryDirectory() as folder:
        print(CASES[sys.argv[3]](Fmu(Path(sys.argv[2]), Path(folder))), flush=True)
        # Some libraries crash at the end of the process, which is not what is tried.
        os._exit(0)
elif __name__ == "__main__":
    main()
