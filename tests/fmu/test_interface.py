"""The interface of plant and controller, on which users rely who replace one of them.

`PYTHONPATH=tests python -m fmu.test_interface` writes promised.txt after an intended change,
such as a new variable.
"""

from __future__ import annotations

import re
from itertools import groupby
from pathlib import Path

import pytest
from fmpy import read_model_description
from fmpy.model_description import ScalarVariable

from fmu.master import Fmu

pytestmark = pytest.mark.quick

PROMISED = Path(__file__).with_name("promised.txt")


def has_promised_start(variable: ScalarVariable) -> bool:
    """Those of numbers in components are calibrated."""
    is_setting = variable.causality == "parameter" and "." not in variable.name
    return is_setting or variable.causality == "input" or variable.type != "Real"


def attributes(variable: ScalarVariable) -> str:
    """What is promised of a variable but its name and value reference."""
    items = variable.declaredType.items if variable.type == "Enumeration" else []
    known = {
        "": f"{variable.causality} {variable.variability} {variable.initial or ''}".strip(),
        "type ": "|".join(f"{item.value}={item.name}" for item in items) or variable.type,
        "unit ": variable.unit,
        "from ": variable.min,
        "to ": variable.max,
        "start ": variable.start if has_promised_start(variable) else None,
        "derivative of ": variable.derivative and variable.derivative.name,
    }
    return ", ".join(f"{key}{value}" for key, value in known.items() if value is not None)


def interface(variables: list[ScalarVariable]) -> list[str]:
    """A line for each variable, and one for all elements of an array."""
    lines = []
    for (_, has), group in groupby(variables, lambda v: (re.sub(r"\[.*", "[", v.name), attributes(v))):
        first, *rest = group
        name = f"{first.name}..{rest[-1].name.partition('[')[2]}" if rest else first.name
        assert [v.valueReference for v in rest] == [first.valueReference + 1 + i for i in range(len(rest))]
        lines.append(f"{first.valueReference} {name}: {has}")
    return lines


def test_the_variables_are_those_that_are_promised(fmus: dict[str, Fmu]) -> None:
    found = []
    for name, fmu in fmus.items():
        found += [name, *interface(fmu.description.modelVariables)]
    assert found == PROMISED.read_text().splitlines()


def test_the_controllers_actuator_is_the_plants(fmus: dict[str, Fmu]) -> None:
    """Position control inverts the plant of this repository."""
    plant, controller = fmus["BoostPlant"].variables, fmus["BoostController"].variables
    pairs = {f"valve.pressure_coefficient[{i}]": f"pressure_coefficient[{i}]" for i in range(1, 5)}
    names = ["spring_preload", "spring_stiffness", "spring_hardening", "membrane_area", "stroke"]
    pairs |= {f"actuator.{name}": name for name in names}
    for mine, its in pairs.items():
        assert float(plant[mine].start) == float(controller[f"actuator_inverse.{its}"].start), mine
    ambient = controller["actuator_inverse.ambient_pressure"].start
    assert float(plant["ambient_pressure"].start) == float(ambient)


def test_no_loop_through_the_measurements(fmus: dict[str, Fmu]) -> None:
    """Measurements are states, and commands change at samples: there is no algebraic loop."""
    plant = {unknown.variable.name: unknown for unknown in fmus["BoostPlant"].description.outputs}
    for name in ["boost_pressure", "tank_pressure", "supply_voltage_measured"]:
        reads = plant[name].dependencies
        assert reads is not None, "absent dependencies mean all"
        assert [variable.name for variable in reads if variable.causality == "input"] == [], name
    outputs = fmus["BoostController"].description.outputs
    assert {unknown.variable.name: unknown.dependencies for unknown in outputs} == {
        name: [] for name in fmus["BoostController"].named("output")
    }


def test_initial_system_of_both_has_no_loop(fmus: dict[str, Fmu]) -> None:
    """A master that exchanges values in initialization can order the FMUs.

    Pressures settle at the controller's outputs, which depend on the measured supply but on no pressure.
    """
    initial = {
        name: {
            unknown.variable.name: {variable.name for variable in unknown.dependencies}
            for unknown in fmu.description.initialUnknowns
        }
        for name, fmu in fmus.items()
    }
    commands = set(fmus["BoostController"].named("output"))
    for output in commands:
        reads = initial["BoostController"][output]
        assert not {"boost_pressure", "tank_pressure"} & reads, output
    assert "boost_reference" in initial["BoostController"]["hp_wastegate_pwm"]
    assert not (commands - {"vacuum_pump"}) & initial["BoostPlant"]["supply_voltage_measured"]
    assert "hp_wastegate_pwm" in initial["BoostPlant"]["boost_pressure"]
    assert "tank.pressure" not in initial["BoostPlant"]


@pytest.mark.parametrize("name", ["BoostPlant", "BoostController"])
def test_capabilities(fmus: dict[str, Fmu], name: str) -> None:
    simulation = fmus[name].description.coSimulation
    assert simulation.modelIdentifier == name == fmus[name].description.modelName
    for capability in [
        "canHandleVariableCommunicationStepSize",
        "canGetAndSetFMUstate",
        "canInterpolateInputs",
    ]:
        assert getattr(simulation, capability), capability
    for shortcoming in [
        "needsExecutionTool",
        "canBeInstantiatedOnlyOncePerProcess",
        "canRunAsynchronuously",
    ]:
        assert not getattr(simulation, shortcoming), shortcoming
    assert simulation.canNotUseMemoryManagementFunctions


@pytest.mark.parametrize("name", ["BoostPlant", "BoostController"])
def test_every_variable_is_described(fmus: dict[str, Fmu], name: str) -> None:
    for variable in fmus[name].description.modelVariables:
        assert variable.description, variable.name
        assert variable.type != "Real" or variable.unit, f"{variable.name} has no unit"


if __name__ == "__main__":
    with PROMISED.open("w") as file:
        for name in ("BoostPlant", "BoostController"):
            variables = read_model_description(f"target/fmu/{name}.fmu").modelVariables
            print(name, *interface(variables), sep="\n", file=file)
