"""The export: the same bytes each time."""

from __future__ import annotations

import hashlib
import os
import subprocess
from pathlib import Path

from conftest import TARGET


def test_export_is_reproducible(root: Path, tmp_path: Path) -> None:
    """The same sources give the same bytes, also when cargo compiles them again."""

    def export(folder: str) -> dict[str, str]:
        out = tmp_path / folder
        command = [TARGET / "debug" / "boost-fmu", "export", "--out", str(out)]
        subprocess.run(command, cwd=root, check=True, capture_output=True)
        return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in out.iterdir()}

    first = export("first")
    for source in ["build.rs", "src/lib.rs", *root.glob("crates/*/src/lib.rs")]:
        os.utime(root / source)
    assert export("second") == first
    assert sorted(first) == ["Boost.ssp", "BoostController.fmu", "BoostPlant.fmu"]
