"""Broken copies of the FMUs, to see that the checks can fail."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path


def copy_with(source: Path, target: Path, pattern: str, replacement: str, *, most: int = 1) -> Path:
    """Copies an FMU with matches of a pattern in its description replaced: the first ones, or with 0 all."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for entry in old.infolist():
            content = old.read(entry)
            if entry.filename == "modelDescription.xml":
                edited, count = re.subn(pattern, replacement, content.decode(), count=most)
                assert count > 0, f"nothing in {source} matches {pattern}"
                content = edited.encode()
            new.writestr(entry, content)
    return target
