"""The FMUs with libraries for all platforms, by Wine and QEMU; `tests/platforms/run` builds them."""

from __future__ import annotations

import os
import struct
from pathlib import Path

NAMES = ["BoostController", "BoostPlant"]

BUILT = [
    ("BoostPlant", 2),
    *(("BoostController", int(version)) for version in os.environ.get("FMI_VERSIONS", "2").split(",")),
]
"""The FMUs for all platforms that `tests/platforms/run` builds, and their version of FMI."""


def file_of(exported: Path, name: str, version: int) -> Path:
    """Where `release/build` writes an FMU."""
    return (exported if version == 2 else exported / "fmi3") / f"{name}.fmu"


def thin(universal: bytes) -> list[bytes]:
    """The libraries in a universal one of macOS: its header has processor, kind, place, size and alignment of
    each."""
    magic, count = struct.unpack_from(">II", universal)
    assert magic == 0xCAFEBABE
    entries = [struct.unpack_from(">5I", universal, 8 + 20 * index) for index in range(count)]
    return [universal[offset : offset + size] for _, _, offset, size, _ in entries]
