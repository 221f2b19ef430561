"""What an importer without manners gets, from these FMUs and from one of another exporter.

Each case runs in a process of its own, since some end in a crash. The run's summary shows the table, and how
much the other tests try.

The other exporter is PythonFMU, which installs beside FMPy. Its column is what was seen, not a demand.
"""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable
from ctypes import byref, c_double, c_uint, memset, sizeof
from pathlib import Path

import pytest
from c_interface import (
    CO_SIMULATION,
    FUNCTIONS,
    LOGGER,
    CallbackFunctions,
    Caller,
    Library,
    Status,
    library_path,
)
from conftest import PROBED, SUMMARY, TARGET
from master import Fmu
from pythonfmu.builder import FmuBuilder
from test_memory import CYCLES
from test_threads import THREADS

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


class Probe:
    """One FMU under one case."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.fmu = Fmu(path, folder)
        self.library = Library(library_path(self.fmu))
        self.guid = self.fmu.description.guid
        self.resources = (Path(self.fmu.folder) / "resources").as_uri().encode()

    def caller(self, guid: str | None, name: bytes | None = b"probe") -> Caller:
        return Caller(self.library, guid, name, resource_location=self.resources)

    def made(self, caller: Caller) -> str:
        return "accepted" if caller.component else "NULL"

    def ready(self, stop_time: float | None = None) -> Caller:
        return self.caller(self.guid).initialize(stop_time=stop_time)

    def wrong_guid(self) -> str:
        return self.made(self.caller("{00000000-0000-0000-0000-000000000000}"))

    def null_name(self) -> str:
        return self.made(self.caller(self.guid, None))

    def null_guid(self) -> str:
        return self.made(self.caller(None))

    def null_resource_location(self) -> str:
        return self.made(Caller(self.library, self.guid, resource_location=None))

    def instance_with(self, callbacks: CallbackFunctions) -> int | None:
        arguments = (b"probe", CO_SIMULATION, self.guid.encode(), self.resources, byref(callbacks), 0, 0)
        return self.library.fmi2Instantiate(*arguments)

    def null_logger(self) -> str:
        component = self.instance_with(CallbackFunctions(LOGGER(0), None, None, None, None))
        if not component:
            return "NULL"
        self.library.fmi2SetReal(component, (c_uint * 1)(2**31), 1, (c_double * 1)(1.0))
        return "accepted"

    def overwritten_callbacks(self) -> str:
        logged: list[int] = []
        logger = LOGGER(lambda environment, name, status, category, fmt, text: logged.append(status))
        callbacks = CallbackFunctions(logger, None, None, None, None)
        component = self.instance_with(callbacks)
        memset(byref(callbacks), 0xEE, sizeof(callbacks))
        self.library.fmi2SetReal(component, (c_uint * 1)(2**31), 1, (c_double * 1)(1.0))
        return "logs" if logged else "logs nothing"

    def step_of(self, size: float) -> str:
        return self.ready().step(0.0, size).name

    def step_before_initialization(self) -> str:
        return self.caller(self.guid).step(0.0, 0.1).name

    def step_after_terminate(self) -> str:
        caller = self.ready()
        assert caller.call("fmi2Terminate") == Status.OK
        return caller.step(0.0, 0.1).name

    def step_past_stop_time(self) -> str:
        return self.ready(stop_time=1.0).step(0.0, 2.0).name

    def parameter_that_is_no_number(self) -> str:
        caller = self.caller(self.guid)
        variables = self.fmu.description.modelVariables
        parameter = next(v for v in variables if v.causality == "parameter" and v.type == "Real")
        return caller.set_reals([parameter.valueReference], [math.nan]).name

    def symbols(self) -> str:
        command = ["nm", "-D", "--defined-only", str(self.library.path)]
        lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
        return str(len([line for line in lines if line.split()[-1] not in FUNCTIONS]))

    def declared(self) -> str:
        description = self.fmu.description
        dependencies = all(unknown.dependencies is not None for unknown in description.outputs)
        reals = [v for v in description.modelVariables if v.type == "Real"]
        units = all(v.unit for v in reals)
        display_units = any(v.displayUnit for v in reals)
        return " / ".join("yes" if has else "no" for has in (dependencies, units, display_units))


CASES: dict[str, tuple[Callable[[Probe], str], str]] = {
    "wrong GUID": (Probe.wrong_guid, "NULL"),
    "NULL instance name": (Probe.null_name, "NULL"),
    "NULL GUID": (Probe.null_guid, "NULL"),
    "NULL resource location": (Probe.null_resource_location, "accepted"),
    "NULL logger": (Probe.null_logger, "accepted"),
    "callbacks struct overwritten later": (Probe.overwritten_callbacks, "logs"),
    "fmi2DoStep with h = 0": (lambda probe: probe.step_of(0.0), "ERROR"),
    "fmi2DoStep with h < 0": (lambda probe: probe.step_of(-0.1), "ERROR"),
    "fmi2DoStep with h = NaN": (lambda probe: probe.step_of(math.nan), "ERROR"),
    "fmi2DoStep with h = 1e300": (lambda probe: probe.step_of(1e300), "ERROR"),
    "fmi2DoStep before initialization": (Probe.step_before_initialization, "ERROR"),
    "fmi2DoStep after fmi2Terminate": (Probe.step_after_terminate, "ERROR"),
    "fmi2DoStep past stopTime": (Probe.step_past_stop_time, "ERROR"),
    "parameter that is NaN": (Probe.parameter_that_is_no_number, "ERROR"),
    "foreign global symbols": (Probe.symbols, "0"),
    "declares dependencies / units / display units": (Probe.declared, "yes / yes / yes"),
}
"""What is tried, and what these FMUs answer."""


def outcome(path: Path, case: str, folder: Path) -> str:
    """What comes of a case, in a process of its own."""
    command = [sys.executable, __file__, str(path), case, str(folder)]
    try:
        result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    except subprocess.TimeoutExpired:
        return "hangs"
    if result.returncode < 0:
        return "crash"
    assert result.returncode == 0, result.stderr
    return result.stdout.strip()


@pytest.fixture(scope="module")
def peer(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An FMU that PythonFMU made."""
    folder = tmp_path_factory.mktemp("peer")
    (folder / "lag.py").write_text(PEER)
    FmuBuilder.build_FMU(folder / "lag.py", dest=folder)
    return folder / "Lag.fmu"


def test_how_much_is_tried(record_property: Callable[[str, object], None]) -> None:
    """What tests count that have no summary of their own: those in Rust leave it in cargo's target folder."""
    fuzzed = {path.name: int(path.read_text()) for path in (TARGET / "tmp" / "fuzz").iterdir()}
    for what in ("sequences", "calls", "serialized states"):
        counts = [fuzzed[f"{name}-{what}"] for name in ("BoostPlant", "BoostController")]
        assert min(counts) >= 100, what
        record_property(PROBED, (f"random {what}", sum(counts)))
    record_property(PROBED, ("cycles of load, run and unload of each FMU", CYCLES))
    record_property(PROBED, ("threads at once", THREADS))


def test_the_table(
    exported: Path, peer: Path, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    paths = [exported / "BoostPlant.fmu", exported / "BoostController.fmu", peer]
    lines = ["| case | BoostPlant | BoostController | FMU of PythonFMU |", "|---|---|---|---|"]
    wrong = []
    for case, (_, expected) in CASES.items():
        seen = [outcome(path, case, tmp_path / f"{len(lines)}-{i}") for i, path in enumerate(paths)]
        lines.append(f"| {case} | {' | '.join(seen)} |")
        if seen[:2] != [expected, expected]:
            wrong.append(f"{case}: {expected} expected, not {seen[:2]}")
    record_property(SUMMARY, "\n".join(lines))
    assert not wrong


if __name__ == "__main__":
    run, _ = CASES[sys.argv[2]]
    print(run(Probe(Path(sys.argv[1]), Path(sys.argv[3]))))
