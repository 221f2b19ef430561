"""The parameter sets in parameters/: valid, with an effect, and bound in Boost.ssp."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess
from zipfile import ZipFile

import pytest
from fmpy.ssp.ssd import ParameterSet, ns, read_ssd, read_ssv, validate_tree
from lxml import etree

from fmu import ROOT, TARGET
from fmu.experiments import BOOST_STEPS, BOOST_STEPS_END, ON_TOLERANCE, Steps, couple, staircase
from fmu.master import Fmu, Make, Value

SETS = sorted(path.stem for path in (ROOT / "parameters").iterdir())

Run = Callable[..., CompletedProcess[str]]


def file(name: str) -> Path:
    return ROOT / "parameters" / f"{name}.ssv"


def values(parameters: ParameterSet) -> dict[str, Value]:
    """The values of a set by name, as the master sets them."""
    return {
        parameter.name: float(parameter.value) if parameter.type == "Real" else parameter.value
        for parameter in parameters.parameters
    }


@pytest.mark.parametrize("name", SETS)
def test_set_is_valid_and_changes_its_fmu(name: str, fmus: dict[str, Fmu]) -> None:
    root = etree.parse(file(name)).getroot()
    validate_tree(root, "SystemStructureParameterValues.xsd")
    assert root.get("name") == name
    assert root.get("description")
    parameters = root.findall("ssv:Parameters/ssv:Parameter", ns)
    assert parameters
    for parameter in parameters:
        (fmu,) = (fmu for fmu in fmus.values() if parameter.get("name") in fmu.variables)
        variable = fmu.variables[parameter.get("name")]
        assert variable.causality == "parameter"
        if variable.type == "Real":
            assert float(parameter[0].get("value")) != float(variable.start)
            assert parameter[0].get("unit") == variable.unit


FRICTION = {"sticky_actuator": (700, 700), "stiff_sticky_actuator": (2300, 3000)}
"""Overshoot up and down (Pa) of the reference solution, if friction limits the feedback."""


@pytest.mark.parametrize("name", [name for name in SETS if name != "paper_structure"])
def test_controller_is_robust_to_another_plant(name: str, plant: Make, controller: Make) -> None:
    """The steps of Fig. 13 on plants that it is not tuned for: the overshoot of the reference solution."""
    record = couple(
        plant(),
        controller(),
        plant_values=values(read_ssv(file(name))),
        inputs={"boost_reference": staircase(*BOOST_STEPS)},
    ).run(BOOST_STEPS_END)
    steps = Steps(record, BOOST_STEPS, BOOST_STEPS_END)
    print(steps.summary())
    up, down = FRICTION.get(name, (900, 900))
    assert max(steps.up) <= up + ON_TOLERANCE
    assert max(steps.down) <= down + ON_TOLERANCE


@pytest.mark.parametrize("name", ["paper_structure", "narrow_valve"])
def test_set_is_bound_to_its_fmu(name: str, boost_fmu: Run, exported: Path, tmp_path: Path) -> None:
    """At the component, in its FMU's names and units, and the FMUs are unchanged."""
    arguments = ["--plant", exported / "BoostPlant.fmu", "--controller", exported / "BoostController.fmu"]
    done = boost_fmu("ssp", *arguments, "--parameters", file(name), folder=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    package = tmp_path / "Boost.ssp"
    bound = {
        component.name: [set.source for set in component.parameterBindings]
        for component in read_ssd(package).system.elements
    }
    owner = "BoostController" if name == "paper_structure" else "BoostPlant"
    assert bound == {"BoostController": [], "BoostPlant": [], owner: [f"resources/{name}.ssv"]}
    with ZipFile(package) as archive, ZipFile(exported / "Boost.ssp") as without:
        for path in without.namelist():
            assert archive.read(path) == without.read(path) or path.endswith(".ssd")
    given, packed = read_ssv(file(name)), read_ssv(package, f"resources/{name}.ssv")
    assert values(packed) == values(given)
    assert [parameter.unit for parameter in packed.parameters] == [
        parameter.unit for parameter in given.parameters
    ]


SSV = """<?xml version="1.0"?>
<ssv:ParameterSet version="1.0" name="wrong" xmlns:ssv="{namespace}" xmlns:ssc="{common}">
  <ssv:Parameters>{parameters}</ssv:Parameters>
  <ssv:Units><ssc:Unit name="ml"><ssc:BaseUnit m="3" factor="1e-6"/></ssc:Unit></ssv:Units>
</ssv:ParameterSet>"""


def write(path: Path, *parameters: tuple[str, str]) -> Path:
    """A parameter set of names and the elements of their values."""
    texts = [f'<ssv:Parameter name="{name}"><ssv:{text}/></ssv:Parameter>' for name, text in parameters]
    path.write_text(
        SSV.format(namespace=ns["ssv"], common=ns["ssc"], parameters="".join(texts)), encoding="utf-8"
    )
    return path


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ([("tank.volume", 'Real value="NaN"')], "tank.volume cannot be used: NaN m3 is not within"),
        ([("tank.volume", 'Real value="1" unit="N"')], "the unit N does not convert to m3"),
        ([("tank.volume", 'Real value="1" unit="gallon"')], "the unit 'gallon' is not known"),
        ([("tank.volume", 'Real value="much"')], "the parameter tank.volume: 'much' is not a number"),
        ([("lambda", 'Real value="1"'), ("lambda", 'Real value="2"')], "the parameter lambda occurs twice"),
        (
            [("lambda", 'Real value="1"'), ("tank.volume", 'Real value="1"')],
            "lambda is BoostController's and tank.volume is BoostPlant's; a set is for one of them",
        ),
        ([], "it has no parameters"),
    ],
)
def test_wrong_set_is_refused_by_name(
    parameters: list[tuple[str, str]], message: str, boost_fmu: Run, exported: Path, tmp_path: Path
) -> None:
    arguments = ["--plant", exported / "BoostPlant.fmu", "--controller", exported / "BoostController.fmu"]
    wrong = write(tmp_path / "wrong.ssv", *parameters)
    done = boost_fmu("ssp", *arguments, "--parameters", wrong, folder=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert not (tmp_path / "Boost.ssp").exists()


def test_units_are_converted(boost_fmu: Run, exported: Path, tmp_path: Path) -> None:
    """Into the FMU's, since masters use the numbers without conversion."""
    arguments = ["--plant", exported / "BoostPlant.fmu", "--controller", exported / "BoostController.fmu"]
    milliliters = write(tmp_path / "tank.ssv", ("tank.volume", 'Real value="1500" unit="ml"'))
    assert boost_fmu("ssp", *arguments, "--parameters", milliliters, folder=tmp_path).returncode == 0
    (parameter,) = read_ssv(tmp_path / "Boost.ssp", "resources/tank.ssv").parameters
    # Up to the rounding of one multiplication.
    assert float(parameter.value) == pytest.approx(1.5e-3, rel=2e-16)
    assert parameter.unit == "m3"


@pytest.mark.parametrize("name", ["BoostPlant", "BoostController"])
def test_defaults_are_written_to_be_edited(
    name: str, boost_fmu: Run, exported: Path, fmus: dict[str, Fmu], tmp_path: Path
) -> None:
    """Every parameter once, with its start value, ready to be bound. An edited file is kept."""
    write = [TARGET / "debug" / "cargo-fmu", "parameters", exported / f"{name}.fmu"]
    done = subprocess.run(write, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    written = tmp_path / f"{name}.ssv"
    validate_tree(etree.parse(written).getroot(), "SystemStructureParameterValues.xsd")
    parameters = {parameter.name: parameter for parameter in read_ssv(written).parameters}
    assert list(parameters) == fmus[name].named("parameter")
    for parameter in parameters.values():
        variable = fmus[name].variables[parameter.name]
        assert parameter.type == variable.type
        if variable.type == "Real":
            assert float(parameter.value) == float(variable.start)
        elif variable.type == "Enumeration":
            (item,) = (item for item in variable.declaredType.items if item.value == variable.start)
            assert parameter.value == item.name
        else:
            assert parameter.value == variable.start

    arguments = ["--plant", exported / "BoostPlant.fmu", "--controller", exported / "BoostController.fmu"]
    assert boost_fmu("ssp", *arguments, "--parameters", written, folder=tmp_path).returncode == 0
    written.write_text("edited", encoding="utf-8")
    again = subprocess.run(write, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert again.returncode == 2
    assert f"{name}.ssv already exists" in again.stderr
    assert written.read_text(encoding="utf-8") == "edited"
