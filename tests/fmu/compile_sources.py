"""Copies a folder's FMUs with the library that FMPy compiles of their sources, in place of those they have.

    python tests/fmu/compile_sources.py FROM TO [Debug]

With `CARGO_TARGET_DIR` at the copies, the tests of the native libraries test these."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path


def compile_sources(fmu: Path, to: Path, configuration: str = "Release") -> None:
    """Copies one FMU."""
    to.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(fmu) as archive, zipfile.ZipFile(to, "w", zipfile.ZIP_DEFLATED) as copy:
        for name in archive.namelist():
            if not name.startswith("binaries/"):
                copy.writestr(name, archive.read(name))
    scripts = Path(sys.executable).parent
    path = os.pathsep.join([str(scripts), os.environ["PATH"]])
    command = [scripts / "fmpy", "compile", to, "--configuration", configuration, "--all-warnings"]
    command.append("--warning-as-error")
    subprocess.run(command, env={**os.environ, "PATH": path}, check=True)
    with zipfile.ZipFile(to) as archive:
        assert any(name.startswith("binaries/") for name in archive.namelist())


if __name__ == "__main__":
    source, target = map(Path, sys.argv[1:3])
    fmus = sorted(source.rglob("*.fmu"))
    assert fmus, f"{source} has no FMUs"
    for fmu in fmus:
        compile_sources(fmu, target / fmu.relative_to(source), *sys.argv[3:])
