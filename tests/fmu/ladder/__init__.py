"""The templates of `cargo fmu new` as FMUs, against closed forms, solutions that SciPy computes without them,
and Reference-FMUs' results (reference/). `bash tests/run` makes and exports them."""

from __future__ import annotations

from pathlib import Path

from fmu import TARGET

FMUS = TARGET / "ladder" / "fmu"
STEPPERS = TARGET / "steppers" / "fmu"


def exported(model: str, folder: Path) -> Path:
    """The FMU of a model."""
    path = folder / f"{model}.fmu"
    assert path.is_file(), f"{path} is missing: bash tests/run exports it"
    return path
