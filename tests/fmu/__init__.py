"""The tests in Python: of the FMUs in FMPy and other masters, of pages in a browser, and of the commands.

pyproject.toml has the markers by which tests/run selects tests. A module that is a command runs in the folder
of the repository, by `PYTHONPATH=tests python -m fmu.NAME`.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
"""The repository."""

TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).absolute()
"""The folder of cargo's builds and the exported FMUs."""

Run = Callable[..., subprocess.CompletedProcess[str]]
"""Runs a command with arguments."""


def csv_lines(path: Path) -> list[str]:
    """A CSV file's lines without the row of units."""
    return [line for line in path.read_text().splitlines(keepends=True) if not line.startswith("#")]
