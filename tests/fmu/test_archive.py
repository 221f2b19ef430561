"""The exported files: valid, small, and with the standard's functions only."""

from __future__ import annotations

import re
import subprocess
import tomllib
import zipfile
from pathlib import Path

import pytest
from fmpy import __file__ as fmpy_file
from lxml import etree

from fmu.master import Fmu

pytestmark = pytest.mark.quick

NAMES = ["BoostPlant", "BoostController"]

LARGEST = 540_000
"""Bytes of an FMU."""


def test_the_terminals_connect_plant_and_controller(fmus: dict[str, Fmu]) -> None:
    """Both have a terminal of the same name, whose members are what one gives and the other takes."""
    file = Path(fmpy_file).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"
    schema = etree.XMLSchema(etree.parse(file))
    members = {}
    for name, fmu in fmus.items():
        document = etree.parse(fmu.folder / "terminalsAndIcons" / "terminalsAndIcons.xml")
        schema.assertValid(document)
        (terminal,) = document.iter("Terminal")
        assert (terminal.get("name"), terminal.get("matchingRule")) == ("boost", "bus")
        members[name] = {member.get("memberName"): member.get("variableName") for member in terminal}
    plant, controller = (fmus[name] for name in NAMES)
    exchanged = {*controller.named("output")} & {*plant.named("input")}
    exchanged |= {*plant.named("output")} & {*controller.named("input")}
    assert members["BoostPlant"] == members["BoostController"] == {name: name for name in exchanged}


@pytest.mark.parametrize("name", NAMES)
def test_library_defines_the_standards_functions_only(fmus: dict[str, Fmu], name: str) -> None:
    library = fmus[name].folder / "binaries" / "linux64" / f"{name}.so"
    command = ["nm", "-D", "--defined-only", str(library)]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    header = (Path(fmpy_file).parent / "c-code" / "fmi2Functions.h").read_text()
    parts = re.split("Functions for FMI2 for (?:Model Exchange|Co-Simulation)", header)
    functions = [set(re.findall(r"^ *FMI2_Export \w+ +(\w+);", part, re.MULTILINE)) for part in parts]
    *_, common, exchange, simulation = functions
    assert {line.split()[-1] for line in lines} == common | simulation
    assert (len(common | simulation), len(exchange)) == (34, 10)


@pytest.mark.parametrize("name", NAMES)
def test_fmu_is_small(exported: Path, name: str) -> None:
    assert (exported / f"{name}.fmu").stat().st_size < LARGEST


@pytest.mark.parametrize("name", NAMES)
def test_archive_is_tidy(exported: Path, name: str) -> None:
    """Only folders that the standard names, each entry once, in the same order and of one date."""
    with zipfile.ZipFile(exported / f"{name}.fmu") as archive:
        assert archive.testzip() is None
        entries = archive.infolist()
    names = [entry.filename for entry in entries]
    assert len(names) == len(set(names))
    assert {n.split("/")[0] for n in names} <= {
        "modelDescription.xml",
        "binaries",
        "documentation",
        "resources",
        "model.png",
        "terminalsAndIcons",
    }
    assert f"binaries/linux64/{name}.so" in names
    assert len({entry.date_time for entry in entries}) == 1
    assert {entry.compress_type for entry in entries} <= {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}


COPYRIGHT = "Copyright (c) 2026 The boost-fmu developers"
"""Of all packages linked into the libraries."""


@pytest.mark.parametrize("name", NAMES)
def test_licenses_are_those_of_what_is_linked(root: Path, exported: Path, name: str) -> None:
    """Section 2.3: license.txt is the entry point. It lists each linked package, as in the lock file, with
    its license texts. The notices of Rust's standard library are in the same folder."""
    with zipfile.ZipFile(exported / f"{name}.fmu") as archive:
        folder = "documentation/licenses/"
        names = [path.removeprefix(folder) for path in archive.namelist() if path.startswith(folder)]
        text = archive.read(f"{folder}license.txt").decode()
        (notices,) = (path for path in names if path != "license.txt")
        # A crate of the standard library with code in every library.
        assert b"hashbrown" in archive.read(f"{folder}{notices}")
    listed = dict(re.findall(r"^- (\S+) (\d\S*): ", text, re.MULTILINE))
    package = {"BoostPlant": "plant-fmu", "BoostController": "controller-fmu"}[name]
    assert listed.keys() == {package, "fmu-abi", "fmu-export", "fmu-solve", "fmu-terms", "boost-fmu"}
    locked = tomllib.loads((root / "Cargo.lock").read_text())["package"]
    assert listed.items() <= {(known["name"], known["version"]) for known in locked}
    sections = {owner: section for owners, section in parts(text) for owner in owners}
    for crate, version in listed.items():
        texts = [section for owner, section in sections.items() if owner.startswith(f"{crate} {version}, ")]
        assert any(COPYRIGHT in section for section in texts)
        assert any("Version 2.0, January 2004" in section for section in texts)
    own = sections[f"boost-fmu {listed['boost-fmu']}, LICENSE-MIT"]
    assert own == (root / "LICENSE-MIT").read_text().strip()


def parts(text: str) -> list[tuple[list[str], str]]:
    """The texts in license.txt by their owners."""
    _, *pieces = text.split(80 * "-" + "\n")
    pairs = zip(pieces[::2], pieces[1::2], strict=True)
    return [(owners.splitlines(), section.strip()) for owners, section in pairs]
