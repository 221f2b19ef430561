"""`cargo fmu merge` and `boost-fmu export --binary` with real libraries of every platform."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path

import pytest

from fmu import ROOT, TARGET
from fmu.platforms import NAMES, thin

pytestmark = pytest.mark.platforms

COMMAND = TARGET / "release" / "boost-fmu"

LIST = "documentation/platforms.txt"


def write(path: Path, files: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return path


@pytest.mark.parametrize("name", NAMES)
def test_fmus_of_single_platforms_merge_into_the_same_bytes(
    exported: Path, tmp_path: Path, name: str
) -> None:
    """As if each had been built on a separate machine, and for macOS one for each processor."""
    with zipfile.ZipFile(exported / f"{name}.fmu") as archive:
        files = {entry: archive.read(entry) for entry in archive.namelist()}
    common = {entry: content for entry, content in files.items() if not entry.startswith("binaries/")}
    # Only the list differs.
    del common[LIST]
    libraries = []
    for entry, content in files.items():
        if entry.startswith("binaries/darwin64/"):
            libraries += [(entry, library) for library in thin(content)]
        elif entry.startswith("binaries/"):
            libraries.append((entry, content))
    assert len(libraries) == 6
    parts = [
        write(tmp_path / f"{index}.fmu", common | {entry: content})
        for index, (entry, content) in enumerate(libraries)
    ]
    # The systems in which they were run are kept.
    lines = [line.partition("; run: ") for line in files[LIST].decode().splitlines()]
    runs = [f"--ran={line.split(':')[0]}={run}" for line, found, run in lines if found]
    merged = tmp_path / "merged.fmu"
    for order in [parts, parts[::-1]]:
        subprocess.run(
            [TARGET / "release" / "cargo-fmu", "merge", *order, *runs, "--out", merged],
            check=True,
            capture_output=True,
        )
        assert merged.read_bytes() == (exported / f"{name}.fmu").read_bytes()


def test_libraries_of_another_machine_are_packed(exported: Path, tmp_path: Path) -> None:
    """Each in the FMU that has its GUID; one with another GUID in none."""
    binaries, libraries = [], {}
    for name in NAMES:
        with zipfile.ZipFile(exported / f"{name}.fmu") as archive:
            libraries[name] = archive.read(f"binaries/win64/{name}.dll")
            guid = archive.read("modelDescription.xml").split(b'guid="')[1].split(b'"')[0]
        library = tmp_path / f"{name}.dll"
        library.write_bytes(libraries[name])
        binaries.append(f"--binary=win64={library}")
    export = [COMMAND, "export", "--out", tmp_path / "out"]
    subprocess.run([*export, *binaries], cwd=ROOT, check=True, capture_output=True)
    for name, content in libraries.items():
        with zipfile.ZipFile(tmp_path / "out" / f"{name}.fmu") as archive:
            assert archive.read(f"binaries/win64/{name}.dll") == content
            assert f"binaries/linux64/{name}.so" in archive.namelist()
            assert "win64: PE for x86-64; only built" in archive.read(LIST).decode().splitlines()

    def refusal(*options: str) -> str:
        result = subprocess.run([*export, *options], cwd=ROOT, capture_output=True, text=True, check=False)
        assert result.returncode == 2
        return result.stderr

    assert f"{NAMES[0]} already has one" in refusal(binaries[0], binaries[0])
    library.write_bytes(libraries[name].replace(guid, guid[::-1]))
    assert "it was not built from the description of BoostController or BoostPlant" in refusal(binaries[1])
