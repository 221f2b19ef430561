"""Broken copies of the FMUs, to see that the checks can fail."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path


def copy_with(source: Path, target: Path, pattern: str, replacement: str) -> Path:
    """Copies an FMU with the first match of a pattern in its description replaced."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for entry in old.infolist():
            content = old.read(entry)
            if entry.filename == "modelDescription.xml":
                edited, count = re.subn(pattern, replacement, content.decode(), count=1)
                assert count == 1, f"nothing in {source} matches {pattern}"
                content = edited.encode()
            new.writestr(entry, content)
    return target


def edit(fmu: Path, pattern: str, replacement: str) -> None:
    """Replaces all matches of a pattern in the description of an FMU."""
    with zipfile.ZipFile(fmu) as archive:
        contents = {entry.filename: archive.read(entry) for entry in archive.infolist()}
    edited = re.sub(pattern, replacement, contents["modelDescription.xml"].decode())
    contents["modelDescription.xml"] = edited.encode()
    with zipfile.ZipFile(fmu, "w") as archive:
        for name, content in contents.items():
            archive.writestr(name, content)
