"""The values beside which the exporter's tables are tested."""

from __future__ import annotations

import subprocess
import sys

from fmu import ROOT


def test_values_are_what_scipy_prints() -> None:
    folder = ROOT / "crates" / "fmu-solve" / "tests" / "tables"
    printed = subprocess.run(
        [sys.executable, folder / "reference.py"], capture_output=True, text=True, check=True
    )
    assert printed.stdout == (folder / "values.csv").read_text()
