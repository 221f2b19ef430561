"""The FMUs of the ladder, with both interfaces: `bash tests/run` makes them with `cargo fmu new` and
exports."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from importer import Instance

ROOT = Path(__file__).resolve().parents[4]
FMUS = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "ladder" / "fmu"


@pytest.fixture(scope="session")
def fmu() -> Callable[[str], Path]:
    """The FMU of a model."""

    def fmu(model: str) -> Path:
        path = FMUS / f"{model}.fmu"
        assert path.is_file(), f"{path} is missing: bash tests/run exports it"
        return path

    return fmu


@pytest.fixture
def instance(fmu: Callable[[str], Path], tmp_path: Path) -> Iterator[Callable[..., Instance]]:
    """Makes initialized instances in the second importer, each of its own copy of the library, and frees them
    after the test."""
    made: list[Instance] = []
    folders = (tmp_path / str(number) for number in itertools.count())

    def instance(model: str, kind: int, **arguments: object) -> Instance:
        made.append(Instance(fmu(model), next(folders), kind, **arguments))
        return made[-1]

    yield instance
    for one in made:
        one.free()
