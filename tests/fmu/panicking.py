"""Builds the model of `tests/panicking-fmu`, which fails where and how it is told."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from zipfile import ZipFile

from fmpy import platform, sharedLibraryExtension


def build(root: Path) -> tuple[Path, Path]:
    """The library, made if need be, and the folder of its description.

    Cargo says where they are: the build script's folder has a name that only cargo knows.
    """
    command = [os.environ.get("CARGO", "cargo"), "rustc", "--locked", "--quiet"]
    command += ["--package", "panicking-fmu", "--crate-type", "cdylib", "--message-format", "json"]
    lines = subprocess.run(command, cwd=root, check=True, stdout=subprocess.PIPE, text=True).stdout
    library = folder = None
    for message in map(json.loads, lines.splitlines()):
        if "panicking-fmu" not in message.get("package_id", ""):
            continue
        if message["reason"] == "build-script-executed":
            folder = Path(message["out_dir"]) / "Panicking"
        elif message["reason"] == "compiler-artifact":
            made = [Path(file) for file in message["filenames"] if file.endswith(sharedLibraryExtension)]
            library = made[0] if made else library
    assert library is not None
    assert folder is not None
    return library, folder


def package(root: Path, path: Path) -> Path:
    """Writes the model as an FMU."""
    library, folder = build(root)
    with ZipFile(path, "w") as archive:
        archive.write(folder / "modelDescription.xml", "modelDescription.xml")
        archive.write(library, f"binaries/{platform}/Panicking{sharedLibraryExtension}")
    return path
