"""The interface of plant and controller, on which users rely who replace one of them."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from fmpy.model_description import ScalarVariable
from master import Fmu


@dataclass
class Row:
    """The promised attributes of a variable."""

    name: str
    unit: str | None
    start: float | None
    minimum: float | None
    maximum: float | None
    variability: str


PLANT_INPUTS = [
    Row("hp_wastegate_pwm", "%", 40, 0, 100, "discrete"),
    Row("vacuum_pump", "1", 0, 0, 1, "discrete"),
    Row("lp_wastegate", "1", 0, 0, 1, "continuous"),
    Row("hp_bypass", "1", 0, 0, 1, "continuous"),
    Row("surge_valve", "1", 0, 0, 1, "continuous"),
    Row("throttle", "1", 1, 0, 1, "continuous"),
    Row("supply_voltage", "V", 12, 0, 32, "continuous"),
    Row("engine_speed", "rpm", 1500, 0, 8000, "continuous"),
    Row("ambient_pressure", "Pa", 101325, 5e4, 1.1e5, "continuous"),
    Row("ambient_temperature", "K", 298, 230, 330, "continuous"),
]

PLANT_OUTPUTS = {
    "boost_pressure": "Pa",
    "tank_pressure": "Pa",
    "actuator_pressure": "Pa",
    "intake_manifold_pressure": "Pa",
    "exhaust_manifold_pressure": "Pa",
    "interstage_exhaust_pressure": "Pa",
    "hp_wastegate_position": "1",
    "supply_voltage_measured": "V",
    "engine_torque": "N.m",
    "air_mass_flow": "kg/s",
    "hp_turbo_speed": "rpm",
    "lp_turbo_speed": "rpm",
    "exhaust_temperature": "K",
    "charge_temperature": "K",
}

PLANT_STATES = [
    "tank.pressure",
    "actuator.chamber_pressure",
    "actuator.position",
    "actuator.velocity",
    "actuator.friction_force",
    "valve.plunger_duty",
    "air_filter.pressure",
    "lp_compressor.outlet_pressure",
    "hp_compressor.outlet_pressure",
    "intercooler.outlet_pressure",
    "intake_manifold.pressure",
    "exhaust_manifold.pressure",
    "interstage_exhaust.pressure",
    "exhaust.pressure",
    "hp_shaft.speed",
    "lp_shaft.speed",
    "supply_sensor.voltage",
]

CONTROLLER_INPUTS = [
    Row("boost_reference", "Pa", 125000, 0, 1e6, "continuous"),
    Row("boost_pressure", "Pa", 101325, 0, 1e6, "continuous"),
    Row("tank_pressure", "Pa", 32500, 0, 2e5, "continuous"),
    Row("supply_voltage_measured", "V", 12, 0, 32, "continuous"),
    Row("engine_speed", "rpm", 1500, 0, 8000, "continuous"),
    Row("wastegate_reference", "1", 0, 0, 1, "continuous"),
    Row("pwm_reference", "%", 40, 0, 100, "continuous"),
    Row("ambient_pressure", "Pa", 0, 0, 1.1e5, "continuous"),
    Row("ambient_temperature", "K", 0, 0, 330, "continuous"),
    Row("hp_turbo_speed", "rpm", 0, 0, 1e6, "continuous"),
]

CONTROLLER_OUTPUTS = {
    "hp_wastegate_pwm": "%",
    "vacuum_pump": "1",
    "lp_wastegate": "1",
    "hp_bypass": "1",
    "surge_valve": "1",
    "fault_code": "1",
}

CONTROLLER_DIAGNOSTICS = {
    "feedforward_pwm": ("Real", "%"),
    "proportional_term": ("Real", "%"),
    "integral_term": ("Real", "%"),
    "derivative_term": ("Real", "%"),
    "unsaturated_pwm": ("Real", "%"),
    "reference_model_pressure": ("Real", "Pa"),
    "voltage_compensation": ("Real", "1"),
    "saturated": ("Boolean", None),
    "sample_count": ("Integer", None),
}

CONTROLLER_PARAMETERS = [
    Row("sample_time", "s", 0.0125, 1e-3, 1, "fixed"),
    Row("nominal_voltage", "V", 12, 1, 48, "tunable"),
    Row("lambda", "s", 0.3, 1e-3, 100, "tunable"),
    Row("derivative_filter", "1", 8, 1, 100, "tunable"),
    Row("pwm_min", "%", 25, 0, 100, "tunable"),
    Row("pwm_max", "%", 75, 0, 100, "tunable"),
    Row("boost_limit", "Pa", 240000, 5e4, 1e6, "tunable"),
    Row("tank_pressure_on", "Pa", 35000, 1e3, 1.2e5, "tunable"),
    Row("tank_pressure_off", "Pa", 30000, 1e3, 1.2e5, "tunable"),
    Row("lp_wastegate_close_below", "rpm", 2000, 0, 8000, "tunable"),
    Row("lp_wastegate_open_above", "rpm", 3500, 0, 8000, "tunable"),
    Row("stage_hysteresis", "rpm", 100, 0, 1000, "tunable"),
    Row("low_pressure_gain", "1/Pa", 2e-5, 0, 1e-2, "tunable"),
    Row("low_pressure_integral_time", "s", 1.5, 1e-3, 100, "tunable"),
]

ENUMERATIONS = {
    ("BoostPlant", "initialization.mode"): (["settled", "running", "given"], "settled"),
    ("BoostController", "mode"): (["boost", "position", "open_loop"], "boost"),
    ("BoostController", "structure"): (["model_reference", "paper"], "model_reference"),
}


def check(variable: ScalarVariable, row: Row, causality: str) -> None:
    """Compares a variable with the promised attributes."""

    def number(text: str | None) -> float | None:
        return None if text is None else float(text)

    found = Row(
        variable.name,
        variable.unit,
        number(variable.start),
        number(variable.min),
        number(variable.max),
        variable.variability,
    )
    assert found == row
    assert variable.causality == causality
    assert variable.type == "Real"


@pytest.mark.parametrize(
    ("name", "rows"),
    [("BoostPlant", PLANT_INPUTS), ("BoostController", CONTROLLER_INPUTS)],
)
def test_inputs(fmus: dict[str, Fmu], name: str, rows: list[Row]) -> None:
    assert fmus[name].named("input") == [row.name for row in rows]
    for row in rows:
        check(fmus[name].variables[row.name], row, "input")


@pytest.mark.parametrize(
    ("name", "units", "variability"),
    [
        ("BoostPlant", PLANT_OUTPUTS, "continuous"),
        ("BoostController", CONTROLLER_OUTPUTS, "discrete"),
    ],
)
def test_outputs(fmus: dict[str, Fmu], name: str, units: dict[str, str], variability: str) -> None:
    fmu = fmus[name]
    assert {n: fmu.variables[n].unit for n in fmu.named("output")} == units
    assert {fmu.variables[n].variability for n in units} == {variability}
    assert {fmu.variables[n].type for n in units} == {"Real"}


def test_controller_diagnostics(controller_fmu: Fmu) -> None:
    for name, (kind, unit) in CONTROLLER_DIAGNOSTICS.items():
        variable = controller_fmu.variables[name]
        assert (variable.type, variable.unit) == (kind, unit), name
        assert (variable.causality, variable.variability) == ("local", "discrete"), name


@pytest.mark.parametrize("row", CONTROLLER_PARAMETERS, ids=lambda row: row.name)
def test_controller_parameter(controller_fmu: Fmu, row: Row) -> None:
    check(controller_fmu.variables[row.name], row, "parameter")


def test_voltage_compensation_is_a_tunable_switch(controller_fmu: Fmu) -> None:
    variable = controller_fmu.variables["compensate_voltage"]
    found = (variable.type, variable.variability, variable.causality, variable.start)
    assert found == ("Boolean", "tunable", "parameter", "true")


def test_schedule_and_inverse_of_the_actuator(controller_fmu: Fmu) -> None:
    """The grid is always 16 x 7; grid points are fixed, the maps tunable."""
    units = {"feedforward": "%", "gain": "Pa/%", "time_constant": "s", "delay": "s"}
    promised = {f"schedule.engine_speed[{j}]": ("rpm", "fixed") for j in range(1, 8)}
    promised |= {f"schedule.boost_reference[{i}]": ("Pa", "fixed") for i in range(1, 17)}
    promised |= {
        f"schedule.{name}[{i},{j}]": (unit, "tunable")
        for name, unit in units.items()
        for i in range(1, 17)
        for j in range(1, 8)
    }
    found = {
        name: (variable.unit, variable.variability)
        for name, variable in controller_fmu.variables.items()
        if name.startswith("schedule.")
    }
    assert found == promised

    inverse = {name for name in controller_fmu.variables if name.startswith("actuator_inverse.")}
    assert inverse == {
        *(f"actuator_inverse.pressure_coefficient[{i}]" for i in range(1, 5)),
        *(f"actuator_inverse.spring_{part}" for part in ("preload", "stiffness", "hardening")),
        "actuator_inverse.membrane_area",
        "actuator_inverse.stroke",
        "actuator_inverse.ambient_pressure",
    }
    assert {controller_fmu.variables[name].variability for name in inverse} == {"tunable"}


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


@pytest.mark.parametrize(("key", "promised"), ENUMERATIONS.items(), ids=lambda v: str(v[1]))
def test_enumerations(fmus: dict[str, Fmu], key: tuple[str, str], promised: tuple[list[str], str]) -> None:
    items, start = promised
    variable = fmus[key[0]].variables[key[1]]
    found = {int(item.value): item.name for item in variable.declaredType.items}
    assert found == dict(enumerate(items, start=1))
    assert found[int(variable.start)] == start
    assert (variable.causality, variable.variability) == ("parameter", "fixed")


def test_plant_states(plant_fmu: Fmu) -> None:
    """The states and their derivatives exist by name; all except the tank's pressure are guesses."""
    assert plant_fmu.states() == sorted(
        PLANT_STATES, key=lambda name: plant_fmu.variables[name].valueReference
    )
    for name in PLANT_STATES:
        state = plant_fmu.variables[name]
        assert (state.causality, state.variability) == ("local", "continuous"), name
        assert state.initial == ("exact" if name == "tank.pressure" else "approx"), name
        derivative = plant_fmu.variables[f"der({name})"]
        assert derivative.derivative is state, name


def test_tank_may_be_frozen_and_released(plant_fmu: Fmu) -> None:
    variable = plant_fmu.variables["tank.frozen"]
    assert (variable.type, variable.variability, variable.start) == ("Boolean", "tunable", "false")


def test_no_loop_through_the_measurements(fmus: dict[str, Fmu]) -> None:
    """Measurements are states, and commands change at samples: there is no algebraic loop."""
    plant = {unknown.variable.name: unknown for unknown in fmus["BoostPlant"].description.outputs}
    for name in ["boost_pressure", "tank_pressure", "supply_voltage_measured"]:
        reads = plant[name].dependencies
        assert reads is not None, "absent dependencies mean all"
        assert [variable.name for variable in reads if variable.causality == "input"] == [], name
    outputs = fmus["BoostController"].description.outputs
    assert {unknown.variable.name: unknown.dependencies for unknown in outputs} == {
        name: [] for name in CONTROLLER_OUTPUTS
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
    for output in CONTROLLER_OUTPUTS:
        reads = initial["BoostController"][output]
        assert not {"boost_pressure", "tank_pressure"} & reads, output
    assert "boost_reference" in initial["BoostController"]["hp_wastegate_pwm"]
    commands = set(CONTROLLER_OUTPUTS) - {"vacuum_pump"}
    assert not commands & initial["BoostPlant"]["supply_voltage_measured"]
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
