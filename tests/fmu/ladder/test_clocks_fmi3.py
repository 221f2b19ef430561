"""The template of clocks in all interfaces, against Reference-FMUs' Clocks (reference/)."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from ctypes import c_double, c_int, c_uint32
from pathlib import Path
from xml.etree import ElementTree
from zipfile import ZipFile

import fmpy
import pytest
from fmpy.fmi3 import (
    FMU3Model,
    FMU3ScheduledExecution,
    FMU3Slave,
    fmi3ClockUpdateCallback,
    fmi3LockPreemptionCallback,
    fmi3LogMessageCallback,
    fmi3UnlockPreemptionCallback,
    printLogMessage,
)
from fmpy.validation import validate_fmu

from fmu.ladder import FMUS

REFERENCE = Path(__file__).parent / "reference"
FOLDER = FMUS.parents[1] / "ladder-fmi3"
PATHS = {
    "events": FOLDER / "fmu" / "fmi3" / "Clocks.fmu",
    "scheduled": FOLDER / "scheduled" / "fmi3" / "Clocks.fmu",
}
CLOCK1, CLOCK2, CLOCK3, OUT_CLOCK = 1001, 1002, 1003, 1005
INPUT2 = 2006
COLUMNS = {
    "inClock1Ticks": 2001,
    "inClock2Ticks": 2002,
    "inClock3Ticks": 2003,
    "totalInClockTicks": 2004,
    "result2": 2005,
    "output3": 2007,
}
CHANGED = 2
"""`fmi3IntervalChanged`."""

Row = dict[str, int]


def theirs() -> list[Row]:
    """The results of Reference-FMUs' library, with the times at which it was activated."""
    with (REFERENCE / "Clocks_out.csv").open() as file:
        return [{name: int(value) for name, value in row.items()} for row in csv.DictReader(file)]


def ticks_of_clock2(time: int) -> bool:
    """`inClock2` ticks at 0, 1, 8 and 9 s, after the input was set to the time plus 1."""
    return time % 8 in (0, 1)


@pytest.fixture(params=PATHS)
def path(request: pytest.FixtureRequest) -> Path:
    path = PATHS[request.param]
    assert path.is_file(), f"{path} is missing: bash tests/run exports it"
    return path


def test_the_description_is_that_of_the_reference_fmu(path: Path) -> None:
    """Names, value references and attributes of variables, and what they depend on; a default that is written
    out is the same."""
    assert validate_fmu(path) == []
    with ZipFile(path) as archive:
        ours = ElementTree.fromstring(archive.read("modelDescription.xml"))
    reference = ElementTree.parse(REFERENCE / "Clocks.fmi3.xml").getroot()

    def variables(root: ElementTree.Element, *left_out: str) -> list[tuple[str, dict[str, object]]]:
        found = []
        for variable in root.findall("ModelVariables/*"):
            attributes: dict[str, object] = {
                "initial": "calculated",
                "variability": "discrete",
            } | variable.attrib
            for name in ("description", "unit", "initial", *left_out):
                attributes.pop(name, None)
            if "intervalDecimal" in attributes:
                attributes["intervalDecimal"] = float(variable.attrib["intervalDecimal"])
            found.append((variable.tag, attributes))
        return found

    def structure(root: ElementTree.Element) -> list[tuple[str, str | None, str | None]]:
        entries = root.findall("ModelStructure/*")
        return [(entry.tag, entry.get("valueReference"), entry.get("dependencies")) for entry in entries]

    # Section 2.4.4: priorities are for Scheduled Execution, the reference's only interface.
    left_out = () if ours.find("ScheduledExecution") is not None else ("priority",)
    assert variables(ours) == variables(reference, *left_out)
    # At the start nothing is computed from anything, which the reference leaves open.
    *expected, (*unknown, _) = structure(reference)
    assert structure(ours) == [*expected, (*unknown, "")]


def interval(fmu: FMU3Model | FMU3Slave | FMU3ScheduledExecution) -> tuple[float, int]:
    intervals, qualifiers = (c_double * 1)(), (c_int * 1)()
    fmu.getIntervalDecimal((c_uint32 * 1)(CLOCK3), intervals, qualifiers)
    return intervals[0], qualifiers[0]


class Scheduled(FMU3ScheduledExecution):
    """FMPy's own does nothing when it is told of clocks."""

    def instantiate_with(self, update: Callable[[int], None]) -> None:
        self.callbacks = fmi3LogMessageCallback(printLogMessage), fmi3ClockUpdateCallback(update)
        self.locks = fmi3LockPreemptionCallback(), fmi3UnlockPreemptionCallback()
        self.component = self.fmi3InstantiateScheduledExecution(
            b"clocks", self.guid.encode(), b"", False, False, None, *self.callbacks, *self.locks
        )


@pytest.fixture
def made(path: Path, tmp_path: Path) -> Iterator[Callable[[type], object]]:
    fmus = []

    def make(kind: type) -> object:
        fmus.append(
            kind(
                instanceName="clocks",
                guid=fmpy.read_model_description(path).guid,
                modelIdentifier="Clocks",
                unzipDirectory=fmpy.extract(path, tmp_path / kind.__name__),
            )
        )
        return fmus[-1]

    yield make
    for fmu in fmus:
        fmu.freeInstance()


@pytest.mark.parametrize("path", ["scheduled"], indirect=True)
def test_scheduled_execution_has_the_reference_results(made: Callable[[type], Scheduled]) -> None:
    """As their example scs_synchronous.c schedules it."""
    fmu = made(Scheduled)
    told = {"out_clock": 0, "countdown": 0}

    def update(_environment: int) -> None:
        told["out_clock"] += fmu.getClock([OUT_CLOCK])[0]
        told["countdown"] += interval(fmu) == (0.0, CHANGED)

    fmu.instantiate_with(update)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    for expected in theirs():
        time = expected.pop("time")
        fmu.activateModelPartition(CLOCK1, time)
        if ticks_of_clock2(time):
            fmu.setInt32([INPUT2], [time + 1])
            fmu.activateModelPartition(CLOCK2, time)
        if told["countdown"]:
            fmu.activateModelPartition(CLOCK3, time)
            told["countdown"] = 0
        found = dict(zip(COLUMNS, fmu.getInt32(list(COLUMNS.values())), strict=True))
        assert found | {"outClockTicks": told["out_clock"]} == expected, time


@pytest.mark.parametrize("path", ["events"], indirect=True)
@pytest.mark.parametrize("kind", [FMU3Slave, FMU3Model])
def test_event_mode_has_the_reference_results(
    made: Callable[[type], FMU3Slave | FMU3Model], kind: type
) -> None:
    """With events at the same times, at which several clocks tick at once."""
    fmu = made(kind)
    fmu.instantiate(**{"eventModeUsed": True} if kind is FMU3Slave else {})
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    out_clock_ticks = 0

    def tick(clocks: list[int]) -> int:
        fmu.setClock(clocks, [True] * len(clocks))
        (ticks,) = fmu.getClock([OUT_CLOCK])
        fmu.updateDiscreteStates()
        assert fmu.getClock([*clocks, OUT_CLOCK]) == [False] * (len(clocks) + 1)
        return ticks

    for expected in theirs():
        time = expected.pop("time")
        if ticks_of_clock2(time):
            fmu.setInt32([INPUT2], [time + 1])
            out_clock_ticks += tick([CLOCK2, CLOCK1])
        else:
            out_clock_ticks += tick([CLOCK1])
        while interval(fmu) == (0.0, CHANGED):
            out_clock_ticks += tick([CLOCK3])
        found = dict(zip(COLUMNS, fmu.getInt32(list(COLUMNS.values())), strict=True))
        assert found | {"outClockTicks": out_clock_ticks} == expected, time
        if kind is FMU3Slave:
            fmu.enterStepMode()
            assert fmu.doStep(time, 1.0)[3] == time + 1.0
        else:
            fmu.enterContinuousTimeMode()
            fmu.setTime(time + 1.0)
        fmu.enterEventMode()
