"""The commands in the documents, and a folder to run them in."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

from fmu import ROOT, TARGET


def blocks(document: str, language: str) -> list[str]:
    """The fenced blocks of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", document, re.DOTALL | re.MULTILINE)


def lines(document: str) -> list[str]:
    """The lines for a shell."""
    return [line for block in blocks(document, "sh") for line in block.splitlines()]


def clone(exported: Path, folder: Path) -> Path:
    """Prepares a folder like the repository's, with cargo's target folder linked.

    The commands write only into it.
    """
    fmus = folder / "target" / "fmu"
    fmus.mkdir(parents=True)
    for file in exported.iterdir():
        (fmus / file.name).symlink_to(file)
    for name in ("examples", "parameters"):
        (folder / name).symlink_to(ROOT / name)
    (folder / "docs").mkdir()
    return folder


def run(line: str, folder: Path, **environment: str) -> str:
    """Runs a line with this Python's commands and `cargo fmu` first; returns its output."""
    # The built command, since there is no package for cargo in the folder.
    line = line.replace("cargo run -- ", f"{TARGET.resolve() / 'debug' / 'boost-fmu'} ")
    programs = [Path(sys.executable).parent, TARGET.resolve() / "debug"]
    path = os.pathsep.join([*map(str, programs), os.environ["PATH"]])
    done = subprocess.run(
        shlex.split(line),
        cwd=folder,
        env={**os.environ, "PATH": path, "MPLBACKEND": "Agg", **environment},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
