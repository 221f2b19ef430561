"""`cargo fmu simulate` on systems of FMUs from other tools, against FMPy or a closed form.

No package that pip finds has a system. Those of careless FMUs are in
crates/cargo-fmu/tests/running/systems.rs.
"""

from __future__ import annotations

import csv
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest

from fmu import csv_lines
from fmu.master import Fmu, Instance
from fmu.test_other_makers import read, simulate_of_cargo
from fmu.test_validate import OPEN_MODELICA, REFERENCE

SSP = "http://ssp-standard.org/SSP1/SystemStructure"

NAMESPACES = f'xmlns:ssd="{SSP}Description" xmlns:ssc="{SSP}Common" xmlns:ssv="{SSP}ParameterValues"'

STEP = 1 / 32


def simulate(system: Path, *arguments: str) -> dict[str, np.ndarray]:
    """The record of a run to its end, with nothing on standard error."""
    out = system.with_suffix(".csv")
    done = simulate_of_cargo(system, "--step", str(STEP), "--tolerance", "none", *arguments, "--out", out)
    assert (done.returncode, done.stderr) == (0, "")
    return read(out)


def connectors(kinds: dict[str, tuple[str, str]]) -> str:
    """Connectors, each with its kind and its type."""
    found = (
        f'<ssd:Connector name="{name}" kind="{kind}">{data_type}</ssd:Connector>'
        for name, (kind, data_type) in kinds.items()
    )
    return f"<ssd:Connectors>{''.join(found)}</ssd:Connectors>"


def parameters(values: dict[str, str]) -> str:
    """A parameter set in the structure."""
    found = (f'<ssv:Parameter name="{name}">{value}</ssv:Parameter>' for name, value in values.items())
    return (
        "<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>"
        f'<ssv:ParameterSet version="2.0" name="own"><ssv:Parameters>{"".join(found)}</ssv:Parameters>'
        "</ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>"
    )


def component(name: str, own: str = "") -> str:
    return f'<ssd:Component name="{name}" source="resources/{name}.fmu">{own}</ssd:Component>'


def connection(start: str, end: str, transformation: str = "") -> str:
    """Between two connectors, of the system itself where no element precedes."""
    attributes = []
    for side, place in (("start", start), ("end", end)):
        element, _, connector = place.rpartition("/")
        attributes += [f'{side}Element="{element}"'] if element else []
        attributes.append(f'{side}Connector="{connector}"')
    return f"<ssd:Connection {' '.join(attributes)}>{transformation}</ssd:Connection>"


def system(name: str, own: str, elements: list[str], connections: list[str]) -> str:
    return (
        f'<ssd:System name="{name}">{own}<ssd:Elements>{"".join(elements)}</ssd:Elements>'
        f"<ssd:Connections>{''.join(connections)}</ssd:Connections></ssd:System>"
    )


def pack(path: Path, fmus: dict[str, Path], root: str, definitions: str = "") -> Path:
    """A package of a system."""
    structure = (
        f'<ssd:SystemStructureDescription {NAMESPACES} version="2.0" name="any">{root}{definitions}'
        '<ssd:DefaultExperiment startTime="0" stopTime="2"/></ssd:SystemStructureDescription>'
    )
    with ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", structure)
        for name, fmu in fmus.items():
            archive.write(fmu, f"resources/{name}.fmu")
    return path


def entries(kind: str, entries: dict[str, str]) -> str:
    """A transformation by a table."""
    found = (f'<ssc:MapEntry source="{source}" target="{target}"/>' for source, target in entries.items())
    return f"<ssc:{kind}MappingTransformation>{''.join(found)}</ssc:{kind}MappingTransformation>"


TYPES = {
    "Float64_continuous": ("Real", "2.5", 2.5),
    "Float64_discrete": ("Float64", "-3.25", -3.25),
    "Int32": ("Integer", "7", 7.0),
    "Boolean": ("Boolean", "true", 1.0),
    "Enumeration": ("Enumeration", "Option 2", 2.0),
}
"""The types that both versions have, each with a value as in a parameter set and as a number."""

SIZED = {"Float32_continuous": ("Float32", "0.375", 0.375)} | {
    f"{name}{size}": (f"{name}{size}", str(size), float(size))
    for name in ("Int", "UInt")
    for size in (8, 16, 32, 64)
}
"""Those of FMI 3.0."""

TRANSFORMED = {
    "Float64_discrete": ('<ssc:LinearTransformation factor="2" offset="1"/>', -5.5),
    "Int32": (entries("Integer", {"7": "11"}), 11.0),
    "Boolean": (entries("Boolean", {"true": "false", "false": "true"}), 0.0),
    "Enumeration": (entries("Enumeration", {"Option 2": "Option 1"}), 1.0),
}
"""What happens to some between two FMUs."""


@pytest.mark.parametrize(("version", "types"), [(2, TYPES), (3, SIZED | TYPES)])
def test_signals_of_all_types_pass_through_two_fmus(
    other_makers: Path, tmp_path: Path, version: int, types: dict[str, tuple[str, str, float]]
) -> None:
    """The system's inputs have their values by a parameter set."""
    fmu = other_makers / REFERENCE / f"fmi{version}" / "Feedthrough.fmu"
    inputs = connectors(dict.fromkeys(types, ("input", "")))
    values = {name: f'<ssv:{kind} value="{value}"/>' for name, (kind, value, _) in types.items()}
    connections = [connection(name, f"one/{name}_input") for name in types]
    connections += [
        connection(f"one/{name}_output", f"two/{name}_input", TRANSFORMED.get(name, ("",))[0])
        for name in types
    ]
    root = system("root", inputs + parameters(values), [component("one"), component("two")], connections)
    found = simulate(pack(tmp_path / "types.ssp", {"one": fmu, "two": fmu}, root))
    for name, (_, _, number) in types.items():
        _, transformed = TRANSFORMED.get(name, ("", number))
        for element, value in (("one", number), ("two", transformed)):
            column = found[f"{element}:{name}_output"]
            assert len(column) == 65
            assert (column[1:] == value).all(), (element, name)


@pytest.mark.parametrize("version", [2, 3])
def test_texts_pass_through_two_fmus(other_makers: Path, tmp_path: Path, version: int) -> None:
    fmu = other_makers / REFERENCE / f"fmi{version}" / "Feedthrough.fmu"
    own = connectors({"text": ("input", "<ssc:String/>")}) + parameters(
        {"text": '<ssv:String value="Größe 5"/>'}
    )
    connections = [
        connection("text", "one/String_input"),
        connection("one/String_output", "two/String_input"),
    ]
    root = system("root", own, [component("one"), component("two")], connections)
    package = pack(tmp_path / "texts.ssp", {"one": fmu, "two": fmu}, root)
    out = tmp_path / "out.csv"
    done = simulate_of_cargo(package, "--record", "one:String_output,two:String_output", "--out", out)
    assert (done.returncode, done.stderr) == (0, "")
    names, *rows = csv.reader(csv_lines(out))
    assert names == ["time", "one:String_output", "two:String_output"]
    assert len(rows) == 501
    assert all(texts == ["Größe 5"] * 2 for _, *texts in rows[1:])


def test_arrays_pass_through_two_fmus(other_makers: Path, tmp_path: Path) -> None:
    """Where A, B and C are zero, y = D·u, and D turns the elements by one place; in the second one it is the
    identity."""
    fmu = other_makers / REFERENCE / "fmi3" / "StateSpace.fmu"
    square = '<ssv:Dimension size="3"/><ssv:Dimension size="3"/>'
    zero = f'<ssv:Float64 value="{" ".join(["0"] * 9)}"/>{square}'
    values = {f"{name}.{matrix}": zero for name in ("one", "two") for matrix in "ABC"}
    values["one.D"] = f'<ssv:Float64 value="0 1 0 0 0 1 1 0 0"/>{square}'
    values["u"] = '<ssv:Float64 value="5 6 7"/><ssv:Dimension size="3"/>'
    own = connectors({"u": ("input", '<ssc:Float64/><ssd:Dimension size="3"/>')}) + parameters(values)
    connections = [connection("u", "one/u"), connection("one/y", "two/u")]
    root = system("root", own, [component("one"), component("two")], connections)
    found = simulate(pack(tmp_path / "arrays.ssp", {"one": fmu, "two": fmu}, root))
    for element in ("one", "two"):
        for index, value in enumerate([6, 7, 5], 1):
            assert (found[f"{element}:y[{index}]"] == value).all(), (element, index)
    scalar = other_makers / REFERENCE / "fmi3" / "Feedthrough.fmu"
    root = root.replace(connections[1], connection("one/y", "two/Float64_continuous_input"))
    done = simulate_of_cargo(pack(tmp_path / "sizes.ssp", {"one": fmu, "two": scalar}, root))
    assert "one.y has 3 elements, two.Float64_continuous_input 1" in done.stderr


def test_fmus_of_open_modelica_are_coupled_as_fmpy_couples_them(other_makers: Path, tmp_path: Path) -> None:
    """A force moves a mass with spring and damper, whose position is added to the system's input in mm; both
    are in a system within. To the last bit: both call the same code at the same times."""
    names = ("Mass_Damper", "add", "ramp")
    fmus = {name: other_makers / OPEN_MODELICA / "linux" / f"{name}.fmu" for name in names}
    bases = {"mm": 'm="1" factor="0.001"', "m": 'm="1"', "kN": 'kg="1" m="1" s="-2" factor="1000"'}
    units = (f'<ssc:Unit name="{name}"><ssc:BaseUnit {base}/></ssc:Unit>' for name, base in bases.items())
    force = connectors({"out": ("output", '<ssc:Real unit="kN"/>')})
    motion = system(
        "motion",
        connectors({"p": ("input", '<ssc:Real unit="m"/>')}),
        [component("Mass_Damper"), component("add"), component("ramp", force)],
        [
            connection("ramp/out", "Mass_Damper/f", '<ssc:LinearTransformation factor="0.5" offset="-20"/>'),
            connection("p", "add/u1"),
            connection("Mass_Damper/y", "add/u2"),
        ],
    )
    values = {
        "p": '<ssv:Real value="250"/>',
        "motion.Mass_Damper.damper.d": '<ssv:Real value="40" unit="N.s/m"/>',
        "motion.ramp.ramp.height": '<ssv:Real value="0.75"/>',
    }
    own = connectors({"p": ("input", '<ssc:Real unit="mm"/>')}) + parameters(values)
    root = system("root", own, [motion], [connection("p", "motion/p")])
    package = pack(tmp_path / "motion.ssp", fmus, root, f"<ssd:Units>{''.join(units)}</ssd:Units>")
    found = simulate(package)

    mass, total, ramp = (Instance(Fmu(fmu, tmp_path / name)) for name, fmu in fmus.items())
    mass.begin({"damper.d": 40.0})
    total.begin({"u1": 0.25})
    ramp.begin({"ramp.height": 0.75})

    def move() -> None:
        mass.set({"f": 0.5 * (1000 * ramp.get("out")) - 20})

    def add() -> None:
        total.set({"u2": mass.get("y")})

    def row() -> list[float]:
        return [mass.get("y"), total.get("y"), ramp.get("out")]

    for _ in range(3):
        move()
        add()
    for instance in (mass, total, ramp):
        instance.slave.exitInitializationMode()
    rows = [row()]
    for time in found["time"][:-1]:
        move()
        mass.slave.doStep(time, STEP)
        add()
        total.slave.doStep(time, STEP)
        ramp.slave.doStep(time, STEP)
        rows.append(row())
    assert len(rows) == 65
    for name, column in zip(
        ("motion.Mass_Damper:y", "motion.add:y", "out"), zip(*rows, strict=True), strict=True
    ):
        assert np.ptp(column) > 0.001, name
        assert np.array_equal(found[name], column), name


def test_names_with_dots_are_those_of_elements_or_of_variables(other_makers: Path, tmp_path: Path) -> None:
    """Sums, (2·12 + 4) + 3·0.5. Their gains are named add.k1 and add.k2; one element is named add.add, and
    add.add.u2 could be a local variable of the other."""
    fmu = other_makers / OPEN_MODELICA / "linux" / "add.fmu"
    values = {
        "add.u1": '<ssv:Real value="12"/>',
        "add.add.k1": '<ssv:Integer value="2"/>',
        "add.u2": '<ssv:Float64 value="4"/>',
        "add.add.add.k2": '<ssv:Real value="3"/>',
        "add.add.u2": '<ssv:Real value="0.5"/>',
    }
    elements = [component("add"), component("add.add")]
    connections = [connection("add/y", "add.add/u1")]
    root = system("root", parameters(values), elements, connections)
    found = simulate(pack(tmp_path / "dots.ssp", {"add": fmu, "add.add": fmu}, root))
    assert (found["add:y"] == 28).all()
    assert (found["add.add:y"] == 29.5).all()
