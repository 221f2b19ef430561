"""Copies a folder's FMUs with the library that FMPy compiles of their sources, in place of those they have.

    python tests/fmu/compile_sources.py FROM TO [Debug]

With `CARGO_TARGET_DIR` at the copies, the tests of the native libraries test these. FMPy does not compile
FMUs for Scheduled Execution: the command of their `sources/README.txt` does."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory

from fmpy import platform_tuple, read_model_description


def copy_without_libraries(fmu: Path, to: Path) -> None:
    """Copies an FMU but for its libraries."""
    to.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(fmu) as archive, zipfile.ZipFile(to, "w", zipfile.ZIP_DEFLATED) as copy:
        for name in archive.namelist():
            if not name.startswith("binaries/"):
                copy.writestr(name, archive.read(name))


def compile_sources(fmu: Path, to: Path, configuration: str = "Release") -> None:
    """Copies one FMU."""
    copy_without_libraries(fmu, to)
    description = read_model_description(to)
    if description.coSimulation or description.modelExchange:
        scripts = Path(sys.executable).parent
        environment = {
            "PATH": os.pathsep.join([str(scripts), os.environ["PATH"]]),
            "CMAKE_BUILD_PARALLEL_LEVEL": str(os.cpu_count()),
        }
        command = [scripts / "fmpy", "compile", to, "--configuration", configuration, "--all-warnings"]
        command.append("--warning-as-error")
        subprocess.run(command, env={**os.environ, **environment}, check=True)
    else:
        compile_by_hand(to)
    with zipfile.ZipFile(to) as archive:
        assert any(name.startswith("binaries/") for name in archive.namelist())


def compile_by_hand(fmu: Path) -> None:
    """Adds the library that the first command of the sources' README makes, not optimized."""
    with TemporaryDirectory() as folder, zipfile.ZipFile(fmu, "a") as archive:
        sources = Path(folder) / "sources"
        archive.extractall(folder, [name for name in archive.namelist() if name.startswith("sources/")])
        readme = (sources / "README.txt").read_text()
        command = next(line for line in readme.splitlines() if line.startswith("    gcc "))
        subprocess.run(f"{command} -O0 -Wall -Wextra -Werror", shell=True, cwd=sources, check=True)
        (library,) = sources.glob("*.so")
        archive.write(library, f"binaries/{platform_tuple}/{library.name}")


if __name__ == "__main__":
    source, target = map(Path, sys.argv[1:3])
    fmus = sorted(source.rglob("*.fmu"))
    assert fmus, f"{source} has no FMUs"
    copies = [target / fmu.relative_to(source) for fmu in fmus]
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        list(threads.map(lambda fmu, copy: compile_sources(fmu, copy, *sys.argv[3:]), fmus, copies))
