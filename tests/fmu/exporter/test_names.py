"""Names that other tools write, in FMPy: each variable is found by its own, whatever Rust makes of it."""

from __future__ import annotations

import csv
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

from fmu import ROOT, TARGET, Run

DECLARATION = ROOT / "crates" / "fmu-export" / "tests" / "names-model" / "model.json"

VARIABLES = json.loads(DECLARATION.read_text())["variables"]

PARAMETERS = [variable["name"] for variable in VARIABLES if variable["causality"] == "parameter"]

SUMMED = ["in", "type", "self", "größe", "a[2].b", "a.b.c"]


@pytest.fixture(params=["names.fmu", "fmi3/names.fmu"])
def file(request: pytest.FixtureRequest) -> Path:
    return TARGET / "names-model" / request.param


@pytest.mark.quick
@pytest.mark.compiled
@pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange"])
def test_each_variable_has_its_own_name(file: Path, interface: str) -> None:
    assert len(PARAMETERS) == 60
    start_values = {name: 100.0 + number for number, name in enumerate(PARAMETERS)}
    inputs = {"u": 3.0, "x": 7.0, "gear": -4}
    is_array = file.parent.name == "fmi3"
    outputs = ["sum of some", "'y [2]'.v", "state [1]", "gear out"]
    arrays = (
        ["arr.in", "arr.out"] if is_array else [f"arr.{end}[{i}]" for end in ("in", "out") for i in (1, 2, 3)]
    )
    result = simulate_fmu(
        str(file),
        fmi_type=interface,
        start_values={**start_values, **inputs},
        output=[*PARAMETERS, "parameter.'in'", *outputs, *arrays],
        relative_tolerance=1e-8,
    )
    last = result[-1]
    assert {name: last[name] for name in PARAMETERS} == start_values
    assert last["parameter.'in'"] == start_values["in"]
    assert last["sum of some"] == sum(start_values[name] for name in SUMMED)
    assert last["gear out"] == -4
    assert last["'y [2]'.v"] == last["state [1]"]
    # A lag of 1 s after 1 s; the solvers' errors are some tens of their tolerance.
    assert last["'y [2]'.v"] == pytest.approx(3.0 * (1.0 - math.exp(-1.0)), abs=1e-6)
    assert np.hstack([last[name] for name in arrays]).tolist() == 2 * [7.0, 14.0, 21.0]


@pytest.mark.quick
@pytest.mark.compiled
@pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange"])
def test_components_in_components_have_their_own_values(file: Path, interface: str) -> None:
    """Two sections, each with a wall: the second takes heat from the first one's wall, and overrides its
    type's start values."""
    result = simulate_fmu(
        str(file),
        fmi_type=interface,
        start_values={"u": 3.0, "Plant.'#1'.Section[2].sensor.bias": 0.25},
        output=[
            "Plant.'#1'.Section[1].wall.C",
            "Plant.'#1'.Section[2].wall.C",
            "Plant.'#1'.Section[1].sensor.reading",
            "Plant.'#1'.Section[2].sensor.reading",
        ],
        relative_tolerance=1e-8,
    )
    capacities = {
        (row["Plant.'#1'.Section[1].wall.C"], row["Plant.'#1'.Section[2].wall.C"]) for row in result
    }
    assert capacities == {(2.0, 4.0)}
    # 2 T' = 2 u - T, and 4 S' = 3 T - S, from 0 on. The solvers' errors are some tens of their tolerance.
    first, second = (
        result["Plant.'#1'.Section[1].sensor.reading"],
        result["Plant.'#1'.Section[2].sensor.reading"],
    )
    decay = np.exp(-result["time"] / 4.0)
    assert first == pytest.approx(6.0 * (1.0 - decay**2), abs=1e-6)
    assert second == pytest.approx(0.25 + 18.0 * (1.0 - decay) ** 2, abs=1e-6)


@pytest.mark.quick
def test_components_in_components_depend_on_what_they_read(file: Path) -> None:
    description = read_model_description(file, validate=True)
    # Parameters are knowns only in FMI 3.0.
    known = {
        unknown.variable.name: [
            dependency.name for dependency in unknown.dependencies if dependency.causality != "parameter"
        ]
        for unknown in [*description.outputs, *description.derivatives]
        if unknown.variable.name.startswith(("Plant.", "der(Plant."))
    }
    assert known == {
        "Plant.'#1'.Section[1].sensor.reading": ["Plant.'#1'.Section[1].wall.T"],
        "Plant.'#1'.Section[2].sensor.reading": ["Plant.'#1'.Section[2].wall.T"],
        "der(Plant.'#1'.Section[1].wall.T)": ["u", "Plant.'#1'.Section[1].wall.T"],
        "der(Plant.'#1'.Section[2].wall.T)": ["Plant.'#1'.Section[1].wall.T", "Plant.'#1'.Section[2].wall.T"],
    }


def test_variables_have_what_their_types_say(file: Path, cargo_fmu: Run) -> None:
    """FMI 2.0.5, section 2.2.7: for the runner, and for FMPy, which leaves it to its users."""
    variables = {
        variable.name: variable for variable in read_model_description(file, validate=True).modelVariables
    }
    reading, bias = (
        variables["Plant.'#1'.Section[1].sensor.reading"],
        variables["Plant.'#1'.Section[1].sensor.bias"],
    )
    assert (reading.unit, reading.displayUnit, reading.min, reading.nominal) == (None, "K", None, "20.0")
    declared = reading.declaredType
    assert declared is bias.declaredType
    assert (declared.name, declared.quantity) == ("wärmer um [K]", "TemperatureDifference")
    assert (declared.unit, declared.displayUnit, declared.relativeQuantity) == ("K", "degC", True)
    assert (declared.min, declared.nominal, declared.unbounded) == ("-1.0", "10.0", "true")
    known = {
        variable["name"]: variable
        for variable in json.loads(cargo_fmu("info", file, "--format=json").stdout)["variables"]
    }
    shown = {key: known["Plant.'#1'.Section[1].sensor.reading"][key] for key in ("unit", "min", "max")}
    assert shown == {"unit": "K", "min": "-1.0", "max": "1000000.0"}
    # The least value of the type is that of its variables, in the model, too.
    refused = cargo_fmu("simulate", file, "--set=Plant.'#1'.Section[1].sensor.bias=-2")
    assert refused.returncode != 0
    assert "-2 K is not within -1..inf K" in refused.stderr


@pytest.mark.quick
def test_fmpy_finds_nothing(file: Path) -> None:
    found = validate_fmu(str(file))
    if file.parent.name == "fmi3":
        # It takes an alias for another unknown; in FMI 3.0 an `<Alias>` is a name of its variable
        # (section 2.4.7), whose value reference is in the list.
        message = found.pop()
        assert message.startswith("ModelStructure/InitialUnknowns does not contain the expected set")
        expected, actual = (set(names.split(", ")) for names in re.findall(r"\{(.*?)\}", message))
        assert expected - actual == {"arr.out"}
    assert not found


@pytest.mark.quick
def test_aliases_are_of_the_same_variable_and_no_unknowns(file: Path) -> None:
    description = read_model_description(file, validate=True)
    assert description.variableNamingConvention == "flat"
    variables = {variable.name: variable for variable in description.modelVariables}
    is_fmi3 = file.parent.name == "fmi3"
    of_array = ("arr.out", "arr.in") if is_fmi3 else ("arr.out[2]", "arr.in[2]")
    pairs = [("parameter.'in'", "in"), ("state [1]", "'y [2]'.v"), of_array]
    for alias, name in pairs:
        assert variables[alias].valueReference == variables[name].valueReference
        # FMPy shows an alias of FMI 3.0 as a copy of its variable.
        assert is_fmi3 or (variables[alias].causality, variables[alias].start) == ("local", None)
    unknowns = [*description.outputs, *description.derivatives, *description.initialUnknowns]
    assert {unknown.variable.name for unknown in unknowns}.isdisjoint(alias for alias, _ in pairs)


def test_the_runner_takes_each_name(file: Path, cargo_fmu: Run, tmp_path: Path) -> None:
    """Also those with what separates names and values on its command line: commas within quotes."""
    out = tmp_path / "names.csv"
    wanted = {name: 100.0 + number for number, name in enumerate(PARAMETERS)}
    values = [f"--set={name}={value}" for name, value in wanted.items()]
    # A comma outside of quotes separates the names of --record.
    recorded = [*(name for name in PARAMETERS if name != "a,b"), "a,b"]
    patterns = ",".join([*recorded[:-1], "a*b"])
    done = cargo_fmu("simulate", file, "--tolerance", "none", *values, f"--record={patterns}", "--out", out)
    assert (done.returncode, done.stderr) == (0, "")
    with out.open(encoding="utf-8", newline="") as text:
        rows = list(csv.reader(text))
    assert rows[0] == ["time", *recorded]
    assert [float(cell) for cell in rows[-1][1:]] == [wanted[name] for name in recorded]
