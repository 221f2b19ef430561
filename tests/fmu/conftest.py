"""The exported FMUs, and instances of them that are freed after each test."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from c_interface import Caller, Library, library_path
from master import Fmu, Instance

ROOT = Path(__file__).resolve().parents[2]
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
"""Where cargo puts what it builds, and the export its FMUs."""

Make = Callable[[], Instance]


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
