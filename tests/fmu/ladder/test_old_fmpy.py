"""`cargo fmu export --no-type-descriptions`, for FMPy below 0.3.24."""

from __future__ import annotations

import os
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from zipfile import ZipFile

import pytest

from fmu.ladder.test_simulate import package, run

OLD = "0.3.23"

SIMULATE = """
import sys, fmpy
print(fmpy.__version__)
name = "Enumeration_output"
result = fmpy.simulate_fmu(sys.argv[1], output=[name], start_values={"Enumeration_input": 2})
print(result[name][-1])
"""


@pytest.fixture(scope="module")
def old_fmpy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for PYTHONPATH; what FMPy needs is the tests'."""
    folder = tmp_path_factory.mktemp("fmpy")
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-compile", "--no-deps"]
    subprocess.run([*install, "--target", folder, f"fmpy=={OLD}"], check=True)
    return folder


def attributes(fmu: Path) -> list[tuple[str, dict[str, str]]]:
    """Each element of the description."""
    with ZipFile(fmu) as archive:
        return [
            (e.tag, dict(e.attrib))
            for e in ElementTree.fromstring(archive.read("modelDescription.xml")).iter()
        ]


def test_an_old_fmpy_reads_types_without_descriptions(old_fmpy: Path, tmp_path: Path) -> None:
    options = package("feedthrough_3", "for_old_fmpy", tmp_path)
    fmus, done = {}, {}
    for name, flags in {"described": [], "bare": ["--no-type-descriptions"]}.items():
        out = tmp_path / name
        run("export", "--profile", "dev", "--out", out, *flags, **options)
        fmus[name] = out / "fmi3" / "for_old_fmpy.fmu"
        done[name] = subprocess.run(
            [sys.executable, "-c", SIMULATE, fmus[name]],
            env={**os.environ, "PYTHONPATH": str(old_fmpy)},
            capture_output=True,
            text=True,
            check=False,
        )
    assert done["bare"].stdout.split() == [OLD, "2"], done["bare"].stderr
    assert "TypeError" in done["described"].stderr
    # Nothing else is left out.
    described, bare = (attributes(fmus[name]) for name in ("described", "bare"))
    for tag, found in described:
        if tag == "EnumerationType":
            assert found.pop("description")
    assert bare == described
