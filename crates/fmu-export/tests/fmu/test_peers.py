"""Calls that break the rules, with this exporter and another one.

Each case runs in another process, since some crash. The output has the table. The other exporter is
PythonFMU; its column is an observation, not a requirement.
"""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable
from ctypes import byref, memset, sizeof
from pathlib import Path

from fmi2 import (
    CO_SIMULATION,
    FUNCTIONS,
    LOGGER,
    CallbackFunctions,
    Fmu,
    Instance,
    Library,
    reals,
    references,
)
from pythonfmu.builder import FmuBuilder

PEER = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

class Lag(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.voltage, self.gain, self.voltage_lagged = 1.0, 2.0, 0.0
        self.register_variable(Real("voltage", causality=Fmi2Causality.input))
        self.register_variable(
            Real("gain", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable)
        )
        self.register_variable(Real("voltage_lagged", causality=Fmi2Causality.output))

    def do_step(self, time, size):
        self.voltage_lagged += size * (self.gain * self.voltage - self.voltage_lagged)
        return True
"""
"""A model for PythonFMU."""


def instance_of(fmu: Fmu, library: Library, **arguments) -> Instance:
    """An instance with its resources, unless the arguments differ."""
    resources = (fmu.folder / "resources").as_uri().encode()
    return Instance(fmu, library, **{"resource_location": resources, **arguments})


def made(**arguments) -> Callable[[Fmu, Library], str]:
    """Whether fmi2Instantiate makes an instance."""

    def case(fmu: Fmu, library: Library) -> str:
        return "accepted" if instance_of(fmu, library, **arguments).component else "NULL"

    return case


def stepped(time: float, size: float, prepare: Callable[[Instance], object]) -> Callable[[Fmu, Library], str]:
    """The status of fmi2DoStep after a preparation."""

    def case(fmu: Fmu, library: Library) -> str:
        instance = instance_of(fmu, library)
        prepare(instance)
        return instance.step(time, size).name

    return case


def logged(logger: bool, overwritten: bool) -> Callable[[Fmu, Library], str]:
    """The result of an error without a logger, or with overwritten callbacks."""

    def case(fmu: Fmu, library: Library) -> str:
        messages: list[int] = []
        function = LOGGER(lambda *arguments: messages.append(arguments[2])) if logger else LOGGER(0)
        callbacks = CallbackFunctions(function, None, None, None, None)
        resources = (fmu.folder / "resources").as_uri().encode()
        arguments = (b"case", CO_SIMULATION, fmu.guid.encode(), resources, byref(callbacks), 0, 0)
        component = library.fmi2Instantiate(*arguments)
        if overwritten:
            memset(byref(callbacks), 0xEE, sizeof(callbacks))
        library.fmi2SetReal(component, references(2**31), 1, reals(1.0))
        return "logs" if messages else "accepted" if component else "NULL"

    return case


def not_a_number(fmu: Fmu, library: Library) -> str:
    """The status of setting a parameter to NaN."""
    parameter = fmu.named(lambda v: v.causality == "parameter" and v.type == "Real")[0]
    return instance_of(fmu, library).set({parameter: math.nan}).name


def symbols(_: Fmu, library: Library) -> str:
    """The number of exported symbols beyond the standard's."""
    command = ["nm", "-D", "--defined-only", str(library.path)]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    return str(len([line for line in lines if line.split()[-1] not in FUNCTIONS]))


def declared(fmu: Fmu, _: Library) -> str:
    """Whether dependencies, units and display units are declared."""
    reals = [v for v in fmu.description.modelVariables if v.type == "Real"]
    has = (
        all(unknown.dependencies is not None for unknown in fmu.description.outputs),
        all(v.unit for v in reals),
        any(v.displayUnit for v in reals),
    )
    return " / ".join("yes" if one else "no" for one in has)


def ready(instance: Instance) -> None:
    """An instance that can be stepped."""
    instance.initialize()


def terminated(instance: Instance) -> None:
    """One that was terminated."""
    instance.initialize().ok("fmi2Terminate")


CASES: dict[str, tuple[Callable[[Fmu, Library], str], str]] = {
    "wrong GUID": (made(guid=b"{00000000-0000-0000-0000-000000000000}"), "NULL"),
    "NULL instance name": (made(name=None), "NULL"),
    "NULL GUID": (made(guid=None), "NULL"),
    "NULL resource location": (made(resource_location=None), "accepted"),
    "NULL logger": (logged(logger=False, overwritten=False), "accepted"),
    "callbacks struct overwritten later": (logged(logger=True, overwritten=True), "logs"),
    "fmi2DoStep with h = 0": (stepped(0.0, 0.0, ready), "ERROR"),
    "fmi2DoStep with h < 0": (stepped(0.0, -0.1, ready), "ERROR"),
    "fmi2DoStep with h = NaN": (stepped(0.0, math.nan, ready), "ERROR"),
    "fmi2DoStep with h = 1e300": (stepped(0.0, 1e300, ready), "ERROR"),
    "fmi2DoStep before initialization": (stepped(0.0, 0.1, lambda _: None), "ERROR"),
    "fmi2DoStep after fmi2Terminate": (stepped(0.0, 0.1, terminated), "ERROR"),
    "fmi2DoStep past stopTime": (stepped(0.0, 2.0, lambda i: i.initialize(stop_time=1.0)), "ERROR"),
    "parameter that is NaN": (not_a_number, "ERROR"),
    "foreign global symbols": (symbols, "0"),
    "declares dependencies / units / display units": (declared, "yes / yes / yes"),
}
"""The cases, with the results of this exporter."""


def outcome(path: Path, case: str, folder: Path) -> str:
    """The result of a case, in another process."""
    command = [sys.executable, __file__, str(path), case, str(folder)]
    try:
        result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    except subprocess.TimeoutExpired:
        return "hangs"
    if result.returncode < 0:
        return "crash"
    assert result.returncode == 0, result.stderr
    return result.stdout.strip()


def test_the_table(fmu: Fmu, tmp_path: Path) -> None:
    (tmp_path / "lag.py").write_text(PEER)
    FmuBuilder.build_FMU(tmp_path / "lag.py", dest=tmp_path)
    lines = ["| case | this exporter | PythonFMU |", "|---|---|---|"]
    seen = {}
    for case in CASES:
        folders = [tmp_path / f"{len(lines)}-{number}" for number in (1, 2)]
        paths = zip([fmu.path, tmp_path / "Lag.fmu"], folders, strict=True)
        seen[case], of_peer = [outcome(path, case, folder) for path, folder in paths]
        lines.append(f"| {case} | {seen[case]} | {of_peer} |")
    print("\n".join(lines))
    assert seen == {case: expected for case, (_, expected) in CASES.items()}


if __name__ == "__main__":
    tried = Fmu(Path(sys.argv[1]), Path(sys.argv[3]))
    print(CASES[sys.argv[2]][0](tried, Library(tried.library, tried.functions)))
