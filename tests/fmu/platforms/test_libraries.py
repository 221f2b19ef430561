"""The exports, imports and sizes of the libraries for each platform, read from their files on any machine."""

from __future__ import annotations

import hashlib
import re
import struct
import zipfile
from pathlib import Path

import lief
import pytest

from fmu.exporter.importer import COMMON, DECLARED, OF_CO_SIMULATION
from fmu.platforms import BUILT, file_of, thin

pytestmark = pytest.mark.platforms

FUNCTIONS = {2: COMMON + OF_CO_SIMULATION, 3: [*DECLARED[3]]}
"""Those of an FMU for co-simulation alone, which are all in FMI 3.0."""

LARGEST_LIBRARY = {2: 800_000, 3: 700_000}
"""Bytes, for each processor; the plant is larger than the controller, which alone is built as FMI 3.0."""

LARGEST_FMU = 2_200_000

PLATFORMS = {
    2: {
        "aarch64-darwin": "dylib",
        "aarch64-linux": "so",
        "darwin64": "dylib",
        "linux64": "so",
        "win64": "dll",
    },
    3: {
        "aarch64-darwin": "dylib",
        "aarch64-linux": "so",
        "x86_64-darwin": "dylib",
        "x86_64-linux": "so",
        "x86_64-windows": "dll",
    },
}
"""The folders in each version of FMI, and the suffix of the library."""

UNIVERSAL = {2: "darwin64", 3: "x86_64-darwin"}
"""The folder of the library for both of macOS' processors."""

WINDOWS = {
    "KERNEL32.dll",
    "msvcrt.dll",
    "ntdll.dll",
    # Waits on an address, from Windows 8 on.
    "api-ms-win-core-synch-l1-2-0.dll",
}
"""In every Windows; no run-time library of a compiler."""

LINUX = {
    "libc.so.6",
    "libm.so.6",
    "libdl.so.2",
    "libpthread.so.0",
    "ld-linux-aarch64.so.1",
    "ld-linux-x86-64.so.2",
}
"""Of glibc; no libgcc_s, no libstdc++."""

OLDEST_GLIBC = (2, 17)

EACH = pytest.mark.parametrize(("name", "version"), BUILT)


def read(exported: Path, name: str, version: int, platform: str) -> bytes:
    with zipfile.ZipFile(file_of(exported, name, version)) as archive:
        return archive.read(f"binaries/{platform}/{name}.{PLATFORMS[version][platform]}")


def on_system(version: int, system: str) -> list[str]:
    """The folders of an operating system, by the suffix of its libraries."""
    return [folder for folder, suffix in PLATFORMS[version].items() if suffix == system]


@EACH
def test_every_platform_is_there_and_listed(exported: Path, name: str, version: int) -> None:
    with zipfile.ZipFile(file_of(exported, name, version)) as archive:
        entries = archive.namelist()
        text = archive.read("documentation/platforms.txt").decode()
    libraries = [entry for entry in entries if entry.startswith("binaries/")]
    assert libraries == [
        f"binaries/{folder}/{name}.{suffix}" for folder, suffix in PLATFORMS[version].items()
    ]
    # A test below checks the version of glibc.
    lines = [re.sub(r"glibc [0-9.]+", "glibc", line) for line in text.splitlines()[2:]]
    formats = {
        "aarch64-darwin": "Mach-O for aarch64, macOS 11.0 or later",
        "aarch64-linux": "ELF for aarch64, glibc or later",
        UNIVERSAL[version]: "Mach-O for aarch64 and x86-64, macOS 11.0 or later",
        on_system(version, "so")[-1]: "ELF for x86-64, glibc or later",
        on_system(version, "dll")[0]: "PE for x86-64",
    }
    assert [line.split("; ")[0] for line in lines] == [f"{key}: {formats[key]}" for key in PLATFORMS[version]]


@EACH
def test_they_are_small(exported: Path, name: str, version: int) -> None:
    sizes = {platform: len(read(exported, name, version, platform)) for platform in PLATFORMS[version]}
    # The universal one holds one for each processor.
    universal = UNIVERSAL[version]
    sizes[universal] = max(map(len, thin(read(exported, name, version, universal))))
    whole = file_of(exported, name, version).stat().st_size
    print(f"{name}, FMI {version}.0: {sizes}, the FMU {whole} bytes")
    assert max(sizes.values()) < LARGEST_LIBRARY[version]
    assert whole < LARGEST_FMU


@EACH
def test_linux(exported: Path, name: str, version: int) -> None:
    for platform in on_system(version, "so"):
        library = lief.ELF.parse(list(read(exported, name, version, platform)))
        assert sorted(symbol.name for symbol in library.exported_symbols) == sorted(FUNCTIONS[version])
        assert set(library.libraries) <= LINUX
        versions = {
            tuple(map(int, auxiliary.name.removeprefix("GLIBC_").split(".")))
            for requirement in library.symbols_version_requirement
            for auxiliary in requirement.get_auxiliary_symbols()
            if auxiliary.name.startswith("GLIBC_")
        }
        assert versions
        assert max(versions) <= OLDEST_GLIBC


@EACH
def test_windows(exported: Path, name: str, version: int) -> None:
    (platform,) = on_system(version, "dll")
    library = lief.PE.parse(list(read(exported, name, version, platform)))
    assert sorted(entry.name for entry in library.get_export().entries) == sorted(FUNCTIONS[version])
    assert {imported.name for imported in library.imports} <= WINDOWS


@EACH
@pytest.mark.parametrize("processors", [["X86_64", "ARM64"], ["ARM64"]])
def test_macos(exported: Path, name: str, version: int, processors: list[str]) -> None:
    """Not run here: checks of the file."""
    is_universal = len(processors) > 1
    content = read(exported, name, version, UNIVERSAL[version] if is_universal else "aarch64-darwin")
    files = thin(content) if is_universal else [content]
    # They are valid as long as their container.
    holders = [lief.MachO.parse(list(file)) for file in files]
    libraries = [holder.at(0) for holder in holders]
    assert [library.header.cpu_type.name for library in libraries] == processors
    for file, library in zip(files, libraries, strict=True):
        assert library.header.file_type == lief.MachO.Header.FILE_TYPE.DYLIB
        exports = [symbol.name for symbol in library.exported_symbols]
        assert sorted(exports) == sorted(f"_{function}" for function in FUNCTIONS[version])
        # Its own name first: not a path of the machine that built it.
        dependencies = [dependency.name for dependency in library.libraries]
        assert dependencies == [f"@rpath/lib{name}.dylib", "/usr/lib/libSystem.B.dylib"]
        assert library.build_version.platform == lief.MachO.BuildVersion.PLATFORMS.MACOS
        assert list(library.build_version.minos)[:2] == [11, 0]
        # Apple Silicon requires a signature.
        if library.header.cpu_type == lief.MachO.Header.CPU_TYPE.ARM64:
            check_signature(file, library)


def check_signature(file: bytes, library: lief.MachO.Binary) -> None:
    """The signature has the hash of each page of the file (Apple's cs_blobs.h; big-endian). A library that is
    changed after linking, as by removing symbols, must be signed again."""
    signature = bytes(library.code_signature.content)
    magic, _, count = struct.unpack_from(">3I", signature)
    assert magic == 0xFADE0CC0
    slots = dict(struct.unpack_from(">2I", signature, 12 + 8 * index) for index in range(count))
    directory = signature[slots[0] :]
    magic, _, _, _, hashes, _, _, pages, limit, size, kind, _, page = struct.unpack_from(">9I4B", directory)
    assert (magic, size, kind) == (0xFADE0C02, 32, 2), "a code directory of SHA-256"
    assert limit == library.code_signature.data_offset
    assert pages == -(-limit // 2**page)
    for index in range(pages):
        content = file[index * 2**page : min((index + 1) * 2**page, limit)]
        expected = directory[hashes + 32 * index : hashes + 32 * (index + 1)]
        assert hashlib.sha256(content).digest() == expected, f"page {index}"


@EACH
def test_the_universal_library_holds_the_other_one(exported: Path, name: str, version: int) -> None:
    universal = read(exported, name, version, UNIVERSAL[version])
    assert read(exported, name, version, "aarch64-darwin") in universal
