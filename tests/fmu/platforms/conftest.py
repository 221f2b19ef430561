"""The FMUs with libraries for all platforms, and the programs that run foreign ones."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import pytest

from fmu import TARGET
from fmu.c_loop import FLAGS, SOURCE
from fmu.master import Fmu
from fmu.platforms import NAMES

WINE = {"wine64": "/usr/lib/wine/wine64", "wineserver": "/usr/lib/wine/wineserver64"}
"""Debian's folder for them, which is not in the PATH."""


@pytest.fixture(scope="session")
def exported() -> Path:
    """The folder that `release/build` wrote to."""
    folder = TARGET / "platforms"
    assert folder.is_dir(), "build first: bash release/build"
    return folder


@pytest.fixture(scope="session")
def folder() -> Iterator[Path]:
    """A folder that every user can read, unlike those of pytest."""
    with TemporaryDirectory(prefix="platforms-") as name:
        folder = Path(name)
        folder.chmod(0o755)
        yield folder


@pytest.fixture(scope="session")
def fmus(exported: Path, folder: Path) -> dict[str, Fmu]:
    """Both FMUs, extracted."""
    return {name: Fmu(exported / f"{name}.fmu", folder / name) for name in NAMES}


@pytest.fixture(scope="session")
def wine(folder: Path) -> Iterator[Path]:
    """A folder with a `wine64` that does not run as root: FMPy's server takes any file that it may open as
    one that its client has closed."""
    programs, prefix = folder / "programs", folder / "wine"
    programs.mkdir()
    prefix.mkdir()
    as_user = ""
    if os.geteuid() == 0:
        shutil.chown(prefix, "nobody", "nogroup")
        as_user = "setpriv --reuid nobody --regid nogroup --clear-groups"
    environment = f"env HOME={prefix} WINEPREFIX={prefix} WINEDEBUG=-all"
    for name, program in WINE.items():
        command = programs / name
        command.write_text(f'#!/bin/sh\nexec {as_user} {environment} {program} "$@"\n')
        command.chmod(0o755)
    # Initializes the prefix.
    subprocess.run([programs / "wine64", "wineboot", "--init"], check=True, capture_output=True, timeout=300)
    yield programs
    # Ends remaining processes, if any, and waits for them.
    subprocess.run([programs / "wineserver", "--kill"], check=False)
    subprocess.run([programs / "wineserver", "--wait"], check=True)


class Runner(NamedTuple):
    """The compiler and emulator of a platform."""

    compiler: list[str]
    run: list[str]
    suffix: str


@pytest.fixture(scope="session")
def runners(wine: Path) -> dict[str, Runner]:
    """By platform."""
    zig = [str(TARGET / "release-tools" / "bin" / "python"), "-m", "ziglang", "cc"]
    return {
        "linux64": Runner([os.environ.get("CC", "cc")], [], ""),
        "win64": Runner(
            ["x86_64-w64-mingw32-gcc", "-D__USE_MINGW_ANSI_STDIO=1"], [str(wine / "wine64")], ".exe"
        ),
        "aarch64-linux": Runner(
            [*zig, "-target", "aarch64-linux-gnu.2.17"],
            # Debian's folder for the libraries of the other processor.
            ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"],
            "",
        ),
    }


@pytest.fixture(scope="session")
def host(runners: dict[str, Runner], folder: Path) -> Callable[[str], list[str]]:
    """Compiles the master in C for a platform; returns the command that runs it."""

    def build(platform: str) -> list[str]:
        runner = runners[platform]
        program = folder / f"loop-{platform}{runner.suffix}"
        libraries = [] if platform == "win64" else ["-ldl"]
        subprocess.run([*runner.compiler, *FLAGS, SOURCE, "-o", program, *libraries], check=True)
        return [*runner.run, str(program)]

    return build
