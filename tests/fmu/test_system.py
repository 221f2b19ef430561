"""Boost.ssp: the system of both FMUs, by System Structure and Parameterization 1.0 and by the tools'
requirements."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from zipfile import ZipFile

import pytest
from fmpy.ssp.ssd import ns, read_ssd, validate_tree
from lxml import etree

from fmu.master import Fmu

STRUCTURES = ["SystemStructure.ssd", "Components.ssd"]

START_VALUES = "resources/Boost_start_values.ssv"
"""Of the inputs of the system."""


@pytest.fixture(scope="session")
def package(exported: Path) -> Path:
    """The package that the export wrote."""
    return exported / "Boost.ssp"


@pytest.fixture(params=STRUCTURES)
def structure(request: pytest.FixtureRequest, package: Path) -> etree._Element:
    """The root of each system structure in the package."""
    with ZipFile(package) as archive:
        return etree.fromstring(archive.read(request.param))


def connections(structure: etree._Element) -> set[tuple[str | None, str, str | None, str]]:
    """Component and connector at both ends of each connection; none for the system itself."""
    attributes = ("startElement", "startConnector", "endElement", "endConnector")
    found = [
        tuple(connection.get(name) for name in attributes)
        for connection in structure.iterfind(".//ssd:Connection", ns)
    ]
    assert len(set(found)) == len(found)
    return set(found)


def test_package_holds_the_exported_fmus(package: Path, exported: Path) -> None:
    with ZipFile(package) as archive:
        assert archive.testzip() is None
        fmus = [f"resources/{name}.fmu" for name in ("BoostController", "BoostPlant")]
        assert archive.namelist() == [*STRUCTURES, START_VALUES, *fmus]
        for fmu in fmus:
            assert archive.read(fmu) == (exported / Path(fmu).name).read_bytes()


def test_structures_are_valid(structure: etree._Element) -> None:
    """By the schema of the standard."""
    validate_tree(structure, "SystemStructureDescription.xsd")


def test_start_values_are_valid(package: Path) -> None:
    """By the schema of the standard."""
    with ZipFile(package) as archive:
        validate_tree(etree.fromstring(archive.read(START_VALUES)), "SystemStructureParameterValues.xsd")


def test_structures_have_different_names(package: Path) -> None:
    """They are variants of one package (section 3)."""
    with ZipFile(package) as archive:
        names = [etree.fromstring(archive.read(path)).get("name") for path in STRUCTURES]
    assert names == ["Boost", "BoostComponents"]


def test_everything_is_connected_by_equal_names(package: Path, fmus: dict[str, Fmu]) -> None:
    with ZipFile(package) as archive:
        system, components = (etree.fromstring(archive.read(path)) for path in STRUCTURES)
    expected = set()
    for giver, taker in (("BoostController", "BoostPlant"), ("BoostPlant", "BoostController")):
        given = fmus[giver].named("output")
        for name in fmus[taker].named("input"):
            if name in given:
                expected.add((giver, name, taker, name))
            else:
                expected.add((None, name, taker, name))
        expected |= {(giver, name, None, name) for name in given}
    assert connections(system) == expected
    assert connections(components) == {connection for connection in expected if None not in connection}


def test_connectors_are_the_connected_variables(structure: etree._Element, fmus: dict[str, Fmu]) -> None:
    """FMPy needs a connection of every listed input. Units are the FMUs', with the same definitions."""
    ends = {end for start_end in connections(structure) for end in (start_end[:2], start_end[2:])}
    units = {
        unit.get("name"): dict(unit.find("ssc:BaseUnit", ns).attrib)
        for unit in structure.iterfind("ssd:Units/ssc:Unit", ns)
    }
    listed = set()
    for component in structure.iterfind(".//ssd:Component", ns):
        fmu = fmus[component.get("name")]
        assert component.get("source") == f"resources/{component.get('name')}.fmu"
        for connector in component.iterfind("ssd:Connectors/ssd:Connector", ns):
            listed.add((component.get("name"), connector.get("name")))
            variable = fmu.variables[connector.get("name")]
            assert connector.get("kind") == variable.causality
            unit = connector.find("ssc:Real", ns).get("unit")
            assert unit == variable.unit
            base = next(known.baseUnit for known in fmu.description.unitDefinitions if known.name == unit)
            for name in ("kg", "m", "s", "A", "K", "mol", "cd", "rad", "offset"):
                assert float(units[unit].get(name, 0)) == getattr(base, name)
            assert float(units[unit].get("factor", 1)) == base.factor
    connected = {end for end in ends if end[0] is not None}
    # Without connectors of the system, the user sets inputs of the environment.
    assert connected <= listed
    for connector in structure.iterfind("ssd:System/ssd:Connectors/ssd:Connector", ns):
        assert (None, connector.get("name")) in ends


def test_inputs_of_the_system_start_as_the_fmus_do(package: Path, fmus: dict[str, Fmu]) -> None:
    system = read_ssd(package).system
    (binding,) = system.parameterBindings
    assert binding.source == START_VALUES
    (parameters,) = binding.parameterValues
    inputs = [connector.name for connector in system.connectors if connector.kind == "input"]
    assert [parameter.name for parameter in parameters.parameters] == inputs
    for parameter in parameters.parameters:
        # The controller's own start value of the ambient means that it is not measured.
        takers = ["BoostPlant"] if parameter.name.startswith("ambient_") else fmus
        variables = [
            fmus[taker].variables[parameter.name]
            for taker in takers
            if parameter.name in fmus[taker].variables
        ]
        assert variables
        for variable in variables:
            assert (float(parameter.value), parameter.unit) == (float(variable.start), variable.unit)


def test_requirements_of_omsimulator(structure: etree._Element) -> None:
    """Requirements of its importers (Model.cpp, System.cpp and ComponentFMUCS.cpp of version 3 for Lua,
    utils.py for Python); it cannot be installed from a registry."""
    prefixes = {"ssd", "ssc", "ssv", "oms"}
    assert prefixes <= set(structure.nsmap)

    def children(element: etree._Element) -> set[str]:
        return {etree.QName(child).localname for child in element}

    assert children(structure) <= {"System", "Units", "Enumerations", "DefaultExperiment"}
    (system,) = structure.iterfind("ssd:System", ns)
    known = {"Connectors", "ElementGeometry", "ParameterBindings", "Elements", "Connections", "Annotations"}
    assert children(system) <= known
    for component in system.iterfind("ssd:Elements/ssd:Component", ns):
        assert component.get("type") == "application/x-fmu-sharedlibrary"
        assert children(component) <= {"Connectors", "ElementGeometry", "ParameterBindings"}
    # The first annotation of the system selects co-simulation and the step.
    annotation = system.find("ssd:Annotations/ssc:Annotation", ns)
    assert annotation.get("type") == "org.openmodelica"
    oms = {"oms": structure.nsmap["oms"]}
    master = annotation.find("oms:Annotations/oms:SimulationInformation/oms:FixedStepMaster", oms)
    # Its schema (oms.xsd) requires the tolerance, as an xs:decimal; without one it passes 0 to the FMUs.
    attributes = {"description": "oms-ma", "stepSize": "0.0125", "relativeTolerance": "0.0001"}
    assert dict(master.attrib) == attributes
    # The importer for Python fails on units in a binding: the values are in a file.
    assert structure.find(".//ssd:ParameterValues", ns) is None


Point = tuple[float, float]


class Drawing:
    """The diagram of a structure, in mm."""

    def __init__(self, structure: etree._Element) -> None:
        self.rectangles: dict[str | None, tuple[float, ...]] = {}
        self.places: dict[tuple[str | None, str], Point] = {}
        components = structure.findall(".//ssd:Component", ns)
        for component in components:
            geometry = component.find("ssd:ElementGeometry", ns)
            corners = tuple(float(geometry.get(name)) for name in ("x1", "y1", "x2", "y2"))
            self.rectangles[component.get("name")] = corners
        # The components span the canvas (section 5.4.5).
        columns = list(zip(*self.rectangles.values(), strict=True))
        self.rectangles[None] = (min(columns[0]), min(columns[1]), max(columns[2]), max(columns[3]))
        for element in (structure.find("ssd:System", ns), *components):
            name = element.get("name") if element in components else None
            x1, y1, x2, y2 = self.rectangles[name]
            for connector in element.iterfind("ssd:Connectors/ssd:Connector", ns):
                geometry = connector.find("ssd:ConnectorGeometry", ns)
                x, y = float(geometry.get("x")), float(geometry.get("y"))
                assert (x in (0, 1) and 0 < y < 1) or (y in (0, 1) and 0 < x < 1), "on an edge"
                self.places[name, connector.get("name")] = (x1 + x * (x2 - x1), y1 + y * (y2 - y1))
        self.lines: list[list[Point]] = []
        for connection in structure.iterfind(".//ssd:Connection", ns):
            start = self.places[connection.get("startElement"), connection.get("startConnector")]
            end = self.places[connection.get("endElement"), connection.get("endConnector")]
            geometry = connection.find("ssd:ConnectionGeometry", ns)
            corners = [map(float, geometry.get(name).split()) for name in ("pointsX", "pointsY")]
            self.lines.append([start, *zip(*corners, strict=True), end])


def test_diagram_is_readable(structure: etree._Element) -> None:
    """Lines are horizontal or vertical and cross no component; connectors of an element do not overlap."""
    drawing = Drawing(structure)
    rounding = 1e-9
    for line in drawing.lines:
        for (xa, ya), (xb, yb) in pairwise(line):
            assert abs(xa - xb) < rounding or abs(ya - yb) < rounding
            for name, (x1, y1, x2, y2) in drawing.rectangles.items():
                left, right, below, above = min(xa, xb), max(xa, xb), min(ya, yb), max(ya, yb)
                beside = right <= x1 + rounding or left >= x2 - rounding
                apart = above <= y1 + rounding or below >= y2 - rounding
                assert name is None or beside or apart, f"a line runs through {name}"
    places = [(name, *map(round, place)) for (name, _), place in drawing.places.items()]
    assert len(set(places)) == len(places)
