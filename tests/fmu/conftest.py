"""The exported FMUs, and instances of them that are freed after each test."""

from __future__ import annotations

import os
import subprocess
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from c_interface import Caller, Library, Status, library_path
from life import Life, Record, differences
from master import Fmu, Instance

ROOT = Path(__file__).resolve().parents[2]
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
"""Where cargo puts what it builds, and the export its FMUs."""

Make = Callable[[], Instance]
Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository."""
    return ROOT


@pytest.fixture(scope="session")
def exported() -> Path:
    """The folder that `cargo run --release -- export` wrote to."""
    folder = TARGET / "fmu"
    assert folder.is_dir(), "export first: cargo run --release -- export"
    return folder


@pytest.fixture(scope="session")
def boost_fmu() -> Callable[..., subprocess.CompletedProcess[str]]:
    """Runs the command that exported the FMUs, in a folder."""
    command = TARGET / "release" / "boost-fmu"

    def run(*arguments: str | Path, folder: Path) -> subprocess.CompletedProcess[str]:
        line = [command, *arguments]
        return subprocess.run(line, cwd=folder, capture_output=True, text=True, check=False)

    return run


Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="session")
def laboratory() -> Path:
    """The laboratory's command."""
    command = TARGET / "release" / "boost-lab"
    assert command.is_file(), "build first: cargo build --release --package boost-lab"
    return command


@pytest.fixture(scope="session")
def lab(laboratory: Path) -> Run:
    """Runs the laboratory's command, with more variables of the environment where they are given."""

    def run(*arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [laboratory, *arguments],
            env={**os.environ, **environment},
            capture_output=True,
            text=True,
            check=False,
        )

    return run


@pytest.fixture(scope="session")
def plant_fmu(exported: Path, tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    """The plant, extracted."""
    return Fmu(exported / "BoostPlant.fmu", tmp_path_factory.mktemp("plant"))


@pytest.fixture(scope="session")
def controller_fmu(exported: Path, tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    """The controller, extracted."""
    return Fmu(exported / "BoostController.fmu", tmp_path_factory.mktemp("controller"))


@pytest.fixture(scope="session")
def fmus(plant_fmu: Fmu, controller_fmu: Fmu) -> dict[str, Fmu]:
    """Both, by name."""
    return {"BoostPlant": plant_fmu, "BoostController": controller_fmu}


@pytest.fixture
def make() -> Iterator[Callable[[Fmu], Instance]]:
    """Makes instances and frees them in the end."""
    made: list[Instance] = []

    def make(fmu: Fmu) -> Instance:
        made.append(Instance(fmu))
        return made[-1]

    yield make
    for instance in made:
        instance.free()


@pytest.fixture
def plant(make: Callable[[Fmu], Instance], plant_fmu: Fmu) -> Make:
    """Makes an instance of the plant."""
    return lambda: make(plant_fmu)


@pytest.fixture
def controller(make: Callable[[Fmu], Instance], controller_fmu: Fmu) -> Make:
    """Makes an instance of the controller."""
    return lambda: make(controller_fmu)


@pytest.fixture(scope="session")
def libraries(fmus: dict[str, Fmu]) -> dict[str, Library]:
    """The loaded libraries of both FMUs, by name."""
    return {name: Library(library_path(fmu)) for name, fmu in fmus.items()}


@pytest.fixture
def call(fmus: dict[str, Fmu], libraries: dict[str, Library]) -> Iterator[Callable[..., Caller]]:
    """Makes instances, by the FMU's name, that are called function by function; frees them in the end."""
    made: list[Caller] = []

    def make(name: str, **arguments) -> Caller:
        made.append(Caller(libraries[name], fmus[name].description.guid, **arguments))
        return made[-1]

    yield make
    for caller in made:
        caller.free()


Live = Callable[..., Life]
Check = Callable[[Life], None]
RecordProperty = Callable[[str, object], None]


@pytest.fixture
def live(call: Callable[..., Caller], fmus: dict[str, Fmu]) -> Live:
    """Brings an instance of an FMU, by its name, into a state."""

    def make(name: str, state: str = "instantiated", **experiment) -> Life:
        return Life(call(name), fmus[name], **experiment).reach(state)

    return make


@pytest.fixture(scope="session")
def records() -> dict[tuple, Record]:
    """How instances go on that no call was kept from, by the FMU, the state and the experiment."""
    return {}


@pytest.fixture
def like_a_fresh_one(
    call: Callable[..., Caller], fmus: dict[str, Fmu], records: dict[tuple, Record]
) -> Check:
    """Checks that an instance lives, after fmi2Reset, as a fresh one: each value bit for bit, each status and
    each message."""

    def check(life: Life) -> None:
        name = life.fmu.description.modelName
        key = (name, "fresh")
        if key not in records:
            records[key] = Life(call(name), fmus[name]).live_anew()
        assert life.caller.call("fmi2Reset") == Status.OK
        assert differences(life.live_anew(), records[key]) == []

    return check


@pytest.fixture
def unharmed(live: Live, like_a_fresh_one: Check, records: dict[tuple, Record]) -> Check:
    """Checks that an instance goes on as one that never got a refused call, bit for bit; and then that it
    can be reset."""

    def check(life: Life) -> None:
        name = life.fmu.description.modelName
        experiment = {"start_time": life.start_time, "stop_time": life.stop_time}
        key = (name, life.state, life.set_up, *experiment.values())
        if key not in records:
            untouched = live(name, life.state, **experiment)
            if life.set_up and not untouched.set_up:
                untouched.setup()
            records[key] = untouched.go_on()
        assert differences(life.go_on(), records[key]) == []
        like_a_fresh_one(life)

    return check


def pytest_configure(config: pytest.Config) -> None:
    """What fails in a logger that is written in Python fails the test."""
    config.addinivalue_line("filterwarnings", "error::pytest.PytestUnraisableExceptionWarning")


PROBED = "probed"
"""The name under which tests record how many of what they tried."""


SUMMARY = "summary"
"""The name under which a test records what the run's summary shows."""


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Says how much the tests tried, by what they recorded; in one process or several."""
    counts: Counter[str] = Counter()
    for report in terminalreporter.getreports("passed"):
        for name, value in report.user_properties if report.when == "call" else []:
            if name == PROBED:
                what, count = value
                counts[what] += count
            elif name == SUMMARY:
                terminalreporter.write_line(value)
    for what, count in sorted(counts.items()):
        terminalreporter.write_line(f"probed: {count} {what}")
