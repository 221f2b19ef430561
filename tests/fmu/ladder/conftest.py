"""The FMUs of the ladder, with both interfaces: `bash tests/run` makes them with `cargo fmu new` and
exports."""

from __future__ import annotations

import itertools
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[4]
sys.path.append(str(ROOT / "crates" / "fmu-export" / "tests" / "fmu"))

from exchange import Exchange  # noqa: E402

FMUS = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "ladder" / "fmu"


def exported(model: str, folder: Path) -> Path:
    """The FMU of a model."""
    path = folder / f"{model}.fmu"
    assert path.is_file(), f"{path} is missing: bash tests/run exports it"
    return path


@pytest.fixture(scope="session", params=[FMUS, FMUS / "fmi3"], ids=["fmi2", "fmi3"])
def fmu(request: pytest.FixtureRequest) -> Callable[[str], Path]:
    """The FMU of a model, in both versions of FMI; `bash tests/run rest` exports and tests FMI 3.0."""
    return lambda model: exported(model, request.param)


@pytest.fixture(scope="session")
def fmu2() -> Callable[[str], Path]:
    """The FMU of a model, of FMI 2.0."""
    return lambda model: exported(model, FMUS)


@pytest.fixture
def instance(fmu2: Callable[[str], Path], tmp_path: Path) -> Iterator[Callable[..., Exchange]]:
    """Makes initialized instances of FMI 2.0 in the importer of the exporter's tests, each from a separate
    copy of the library, and frees them after the test."""
    made: list[Exchange] = []
    folders = (tmp_path / str(number) for number in itertools.count())

    def instance(model: str, kind: int, **arguments: object) -> Exchange:
        made.append(Exchange(fmu2(model), next(folders), kind, **arguments))
        return made[-1]

    yield instance
    for one in made:
        one.free()
