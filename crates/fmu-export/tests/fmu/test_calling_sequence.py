"""The order of calls: which function may be called in which state (FMI 2.0.5, sections 3.2.3 and 4.2.4).

`calling_sequence_model_exchange.csv` and `calling_sequence.csv` are the tables of these sections, cell by
cell. A number in a cell is a condition, mostly on the variable, by the notes below the table.
"""

from __future__ import annotations

import csv
import dataclasses
from collections.abc import Callable
from ctypes import byref, c_char, c_char_p, c_double, c_int, c_size_t, c_void_p
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from fmi2 import (
    ARRAYS,
    CO_SIMULATION,
    COMMON,
    FUNCTIONS,
    MODEL_EXCHANGE,
    OF_CO_SIMULATION,
    OF_MODEL_EXCHANGE,
    STEP,
    EventInfo,
    Fmu,
    Instance,
    Status,
    c_type_of,
    integers,
    reals,
    strings,
)
from fmpy.model_description import ScalarVariable
from life import COURSE, LIVES, STATES, Course, Life, Record, differences


def table(name: str) -> dict[str, dict[str, str]]:
    """A table by function and state: blank if the call is not allowed."""
    with open(Path(__file__).parents[1] / name, newline="") as file:
        return {row.pop("function"): row for row in csv.DictReader(file)}


TABLES = {
    CO_SIMULATION: table("calling_sequence.csv"),
    MODEL_EXCHANGE: table("calling_sequence_model_exchange.csv"),
}

INTERFACES = {CO_SIMULATION: "Co-Simulation", MODEL_EXCHANGE: "Model Exchange"}
"""Their names in messages."""

NO_INSTANCE = "start/end"
NEVER = ["stepInProgress", "stepCanceled", "fatal"]
"""States of asynchronous steps, and of errors that affect every instance."""

RETURNS = {
    "fmi2GetStatus": Status.DISCARD,
    "fmi2GetIntegerStatus": Status.DISCARD,
    "fmi2GetStringStatus": Status.DISCARD,
}
"""Section 4.2.3: fmi2Discard for status information of asynchronous steps, and for the type without a status;
the time of the last step and whether the slave ends the simulation are available."""

INQUIRED = {"fmi2GetTypesPlatform": b"default", "fmi2GetVersion": b"2.0"}
"""Section 2.1.4: functions without an instance."""

CHANGING = [
    "fmi2SetupExperiment",
    "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode",
    "fmi2Terminate",
    "fmi2Reset",
    "fmi2SetReal",
    "fmi2SetInteger",
    "fmi2SetBoolean",
    "fmi2SetString",
    "fmi2SetFMUstate",
    "fmi2SetRealInputDerivatives",
    "fmi2DoStep",
    "fmi2EnterEventMode",
    "fmi2NewDiscreteStates",
    "fmi2EnterContinuousTimeMode",
    "fmi2SetTime",
    "fmi2SetContinuousStates",
]
"""Functions after which an instance does not continue as before."""

DO_STEP_STATUS, PENDING_STATUS, LAST_SUCCESSFUL_TIME, TERMINATED = range(4)
"""`fmi2StatusKind`."""


def is_input(variable: ScalarVariable) -> bool:
    """Whether a variable is an input; inputs have no `initial`, even if a reader of the XML sets it."""
    return variable.causality == "input"


def is_input_or_tunable(variable: ScalarVariable) -> bool:
    """Whether a variable may change between steps, or at events."""
    return is_input(variable) or (variable.causality == "parameter" and variable.variability == "tunable")


CONDITIONS: dict[str, Callable[[ScalarVariable], bool]] = {
    "1": lambda v: v.variability != "constant" and v.initial in ("exact", "approx"),
    "3": lambda v: is_input(v) or (v.variability != "constant" and v.initial == "exact"),
    "4": is_input_or_tunable,
    "5": lambda v: (is_input(v) and v.variability == "continuous") or v.name in CONTINUOUS_STATES,
    "6": is_input_or_tunable,
}
"""The notes below the tables on setting variables, by their numbers."""

CONTINUOUS_STATES = ["tank.level", "motion.position"]


def settable(variable: ScalarVariable, state: str, fmu_type: int = CO_SIMULATION) -> bool:
    """Whether the table allows a variable to be set in a state. Beyond note 1, inputs can be set before
    initialization, as libcosim, PyFMI and cofmupy do."""
    condition = TABLES[fmu_type][f"fmi2Set{c_type_of(variable)}"][state]
    if condition == "1" and is_input(variable):
        return True
    return bool(condition) and CONDITIONS[condition](variable)


def another_value(variable: ScalarVariable) -> Any:
    """A value within the range of a variable, other than its start value."""
    if variable.type == "Real":
        return float(variable.start or 0.0) + 0.125
    if variable.type == "Boolean":
        return int(variable.start != "true")
    if variable.type == "String":
        return f"not {variable.start}".encode()
    if variable.type == "Enumeration":
        return 3 - int(variable.start or 1) if int(variable.start or 1) < 3 else 1
    return int(variable.start or 0) + 1


def arguments_of(life: Life, function: str) -> list[Any]:
    """Valid arguments for a function, other than the instance's present ones. Required earlier calls are
    made."""
    fmu = life.fmu
    kind = function.removeprefix("fmi2Get").removeprefix("fmi2Set")
    if kind in ARRAYS:
        variables = [v for v in fmu.variables.values() if c_type_of(v) == kind]
        if function.startswith("fmi2Get"):
            return list(life.getting(*(v.name for v in variables))[1:])
        # If none may be set, the forbidden call sets one that may be set in other states.
        state = life.state if TABLES[life.fmu_type][function][life.state] else "instantiated"
        values = {v.name: another_value(v) for v in variables if settable(v, state, life.fmu_type)}
        return list(life.settings(values)[1:])
    if function == "fmi2EnterInitializationMode" and life.state == "instantiated":
        life.set_up()
    if function in ("fmi2SerializeFMUstate", "fmi2DeSerializeFMUstate"):
        state = life.save()
        data = life.serialize(state)
        room = (c_char * len(data)).from_buffer_copy(data)
        return [state, room, len(data)] if "fmi2Ser" in function else [room, len(data), byref(c_void_p())]
    output = [fmu.references("output"), 1]
    return {
        "fmi2SetDebugLogging": lambda: [1, 1, strings(b"logStatusError")],
        "fmi2SetupExperiment": lambda: [1, 1e-5, 5.0, 1, 6.0],
        "fmi2DoStep": lambda: [life.time, 0.001, 1],
        "fmi2GetFMUstate": lambda: [byref(c_void_p())],
        "fmi2SetFMUstate": lambda: [life.save()],
        "fmi2FreeFMUstate": lambda: [byref(life.save())],
        "fmi2SerializedFMUstateSize": lambda: [life.save(), byref(c_size_t())],
        "fmi2GetDirectionalDerivative": lambda: [*output, fmu.references("rate"), 1, reals(1.0), reals(0.0)],
        "fmi2SetRealInputDerivatives": lambda: [fmu.references("rate"), 1, integers(1), reals(7.0)],
        "fmi2GetRealOutputDerivatives": lambda: [*output, integers(1), reals(0.0)],
        "fmi2GetStatus": lambda: [DO_STEP_STATUS, byref(c_int())],
        "fmi2GetRealStatus": lambda: [LAST_SUCCESSFUL_TIME, byref(c_double())],
        "fmi2GetIntegerStatus": lambda: [LAST_SUCCESSFUL_TIME, byref(c_int())],
        "fmi2GetBooleanStatus": lambda: [TERMINATED, byref(c_int())],
        "fmi2GetStringStatus": lambda: [PENDING_STATUS, byref(c_char_p())],
        "fmi2NewDiscreteStates": lambda: [byref(EventInfo())],
        "fmi2CompletedIntegratorStep": lambda: [1, byref(c_int()), byref(c_int())],
        "fmi2SetTime": lambda: [life.time + 0.001],
        "fmi2SetContinuousStates": lambda: [reals(0.3, 0.4), 2],
        "fmi2GetDerivatives": lambda: [reals(0.0, 0.0), 2],
        "fmi2GetEventIndicators": lambda: [reals(0.0, 0.0, 0.0), 3],
        "fmi2GetContinuousStates": lambda: [reals(0.0, 0.0), 2],
        "fmi2GetNominalsOfContinuousStates": lambda: [reals(0.0, 0.0), 2],
    }.get(function, list)()


def test_the_table_is_of_all_functions_and_states(fmu: Fmu) -> None:
    assert list(TABLES[CO_SIMULATION]) == [*COMMON, *OF_CO_SIMULATION]
    # The table has the getters in another order than the header.
    assert set(TABLES[MODEL_EXCHANGE]) == {*COMMON, *OF_MODEL_EXCHANGE}
    for fmu_type, never in [(CO_SIMULATION, NEVER), (MODEL_EXCHANGE, ["fatal"])]:
        for function, cells in TABLES[fmu_type].items():
            assert set(cells) == {NO_INSTANCE, *STATES[fmu_type], *never}, function
    used = {cell for table in TABLES.values() for cells in table.values() for cell in cells.values()}
    assert used == {"", "x", "2", "7", "8", *CONDITIONS}
    # Asynchronous steps would add the states of NEVER.
    assert not fmu.description.coSimulation.canRunAsynchronuously


def test_the_model_has_one_of_everything(fmu: Fmu) -> None:
    """So that tests of all variables test each kind."""
    types = {"Real", "Integer", "Boolean", "String", "Enumeration"}
    for causality in ("input", "output", "parameter"):
        names = fmu.named(lambda v, causality=causality: v.causality == causality)
        assert {fmu.variables[name].type for name in names} == types, causality
    found = {(v.causality, v.variability) for v in fmu.variables.values()}
    assert found == {
        ("independent", "continuous"),
        ("parameter", "fixed"),
        ("parameter", "tunable"),
        ("calculatedParameter", "fixed"),
        *(((c, v)) for c in ("input", "output", "local") for v in ("discrete", "continuous")),
    }
    assert {v.initial for v in fmu.variables.values()} >= {"exact", "approx", "calculated"}
    assert fmu.named(lambda v: v.name.startswith("settings.table[")) == [
        f"settings.table[{i},{j}]" for i in (1, 2) for j in (1, 2)
    ]
    assert [u.variable.name for u in fmu.description.derivatives] == [
        "der(tank.level)",
        "der(motion.position)",
    ]
    assert fmu.description.numberOfEventIndicators == 3
    variables = ElementTree.parse(fmu.folder / "modelDescription.xml").iter("ScalarVariable")
    assert [v.get("name") for v in variables if v[0].get("reinit") == "true"] == CONTINUOUS_STATES
    assert fmu.description.modelExchange.canGetAndSetFMUstate
    simulation = fmu.description.coSimulation
    assert simulation.canGetAndSetFMUstate
    assert simulation.canSerializeFMUstate
    assert simulation.canInterpolateInputs
    assert simulation.providesDirectionalDerivative
    assert simulation.maxOutputDerivativeOrder == 1


WITHOUT_EFFECT = {CO_SIMULATION: ["events.period", "events.echoes", "events.wall"], MODEL_EXCHANGE: []}
"""Parameters of the course."""


@pytest.mark.parametrize(
    ("fmu_type", "state"), [(CO_SIMULATION, "stepComplete"), (MODEL_EXCHANGE, "Event Mode")]
)
def test_a_life_shows_the_whole_memory(live: Callable[..., Life], fmu_type: int, state: str) -> None:
    """The records differ if any value of the course was not set, or was lost."""

    def lived(course: Course) -> Record:
        return live(state, fmu_type=fmu_type, course=course).go_on()

    whole = lived(COURSE)
    assert differences(lived(COURSE), whole) == []
    for part in ("parameters", "inputs", "pending", "slopes", "later"):
        if part == "slopes" and fmu_type == MODEL_EXCHANGE:
            continue
        # Without motion.start the start value of motion.position is not used, as the test of that shows.
        for forgotten in getattr(COURSE, part).keys() - {"motion.start", *WITHOUT_EFFECT[fmu_type]}:
            values = {name: v for name, v in getattr(COURSE, part).items() if name != forgotten}
            record = lived(dataclasses.replace(COURSE, **{part: values}))
            others = [d for d in differences(record, whole) if not d.startswith(f"{forgotten}, ")]
            assert others, f"{part}: {forgotten}"


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize(("fmu_type", "state"), LIVES)
def test_a_function_in_a_state(
    live: Callable[..., Life], unharmed: Callable[[Life], None], fmu_type: int, state: str, function: str
) -> None:
    """With valid arguments it succeeds if it is allowed; otherwise it is an Error that names function and
    state and changes nothing. So is a function of the other interface, and the message names the instance's.
    """
    life = live(state, fmu_type=fmu_type)
    before = list(life.messages)
    allowed = TABLES[fmu_type].get(function, {}).get(state)
    if function in INQUIRED:
        assert allowed == "x"
        assert getattr(life.library, function)() == INQUIRED[function]
    elif function == "fmi2Instantiate":
        # It has no instance argument, and makes another one with its own state
        # (canBeInstantiatedOnlyOncePerProcess is false).
        assert allowed == ""
        assert live().component not in (None, life.component)
    elif function == "fmi2FreeInstance":
        assert allowed == "x"
        life.free()
        assert life.messages == before
        return
    elif function not in TABLES[fmu_type]:
        life.refuses(function, *arguments_of(life, function), names=[INTERFACES[fmu_type]])
    elif not allowed or (function, allowed) == ("fmi2SetTime", "8"):
        # The model has continuous states: note 8 does not hold for it.
        life.refuses(function, *arguments_of(life, function), names=[state])
    else:
        assert life.call(function, *arguments_of(life, function)) == RETURNS.get(function, Status.OK)
        assert life.messages == before
        if function in CHANGING:
            return
    unharmed(life)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_a_function_without_an_instance(live: Callable[..., Life], function: str) -> None:
    """Before fmi2Instantiate and after fmi2FreeInstance there is no instance: NULL is an Error that no logger
    can receive; freeing it is ignored (section 2.1.5). A freed pointer is not tried: its memory may be
    reused."""
    life = live()
    result, types = FUNCTIONS[function]
    if any(table.get(function, {}).get(NO_INSTANCE) for table in TABLES.values()):
        # Functions without an instance, or fmi2Instantiate, which `live` has called.
        assert function in INQUIRED or (function == "fmi2Instantiate" and life.component)
        assert types == [] or function == "fmi2Instantiate"
        return
    # Those of Model Exchange are called with the arguments of an instance that has them.
    arguments = arguments_of(
        live(fmu_type=MODEL_EXCHANGE if function in OF_MODEL_EXCHANGE else CO_SIMULATION), function
    )
    status = getattr(life.library, function)(None, *arguments)
    assert status == (None if result is None else Status.ERROR)
    assert life.messages == []


def test_initialization_needs_an_experiment(live: Callable[..., Life], unharmed) -> None:
    """Section 2.1.6: fmi2SetupExperiment must be called before fmi2EnterInitializationMode."""
    life = live()
    life.refuses("fmi2EnterInitializationMode", names=["fmi2SetupExperiment"])
    unharmed(life)


def test_an_experiment_may_be_set_up_again(make: Callable[..., Instance]) -> None:
    """Section 2.1.6: "at least once"; the last one is valid."""
    instance = make()
    instance.set_up(5.0, 6.0)
    instance.initialize(2.0)
    assert instance.get("time") == 2.0
    assert instance.step(2.0, 10.0) == Status.OK


@pytest.mark.parametrize(
    ("fmu_type", "state"),
    [(fmu_type, state) for fmu_type, state in LIVES if TABLES[fmu_type]["fmi2SetReal"][state]],
)
def test_which_variables_can_be_set(
    live: Callable[..., Life], unharmed, fmu: Fmu, fmu_type: int, state: str
) -> None:
    """Notes 1, 3, 4, 5 and 6, for every variable."""
    refusing = live(state, fmu_type=fmu_type)
    for variable in fmu.variables.values():
        value = another_value(variable)
        setting = refusing.settings({variable.name: value})
        if not settable(variable, state, fmu_type):
            if (
                state == "Continuous-Time Mode"
                and (is_input(variable) or variable.variability == "tunable")
                and refusing.get(variable.name) == value
            ):
                # FMPy sets discrete inputs there, CasADi tunable parameters, to the values that they have.
                refusing.ok(*setting)
                continue
            refusing.refuses(*setting, names=[variable.name, state])
            continue
        life = live(state, fmu_type=fmu_type)
        life.ok(*setting)
        if state == "instantiated":
            life.enter()
        # Section 4.2.4 requires a step between setting and getting in stepComplete. Getting without it is
        # tolerated, so that masters can read the values they set.
        if variable.name != "fault.place":
            assert life.get(variable.name) == value, variable.name
        life.free()
    unharmed(refusing)


@pytest.mark.parametrize(("start", "expected"), [("given", 0.75), ("at_rest", 0.0)])
def test_start_values_of_states(make: Callable[..., Instance], start: str, expected: float) -> None:
    """Note 1, `initial="approx"`: the start value is a guess, which the initialization may use. If it does
    not, there is one warning."""
    instance = make().choose(motion__start=start)
    assert instance.set({"motion.position": 0.75, "tank.level": 0.5}) == Status.OK
    instance.enter()
    warned = [] if start == "given" else ["the start value of motion.position is not used"]
    for rate in (1.0, 2.0):
        assert instance.set({"rate": rate}) == Status.OK
        instance.call(*instance.getting("motion.position"))
        assert instance.get("motion.position") == expected
    assert instance.get("tank.level") == 0.5
    assert [message.text for message in instance.messages] == warned


@pytest.mark.parametrize(("fmu_type", "state"), [life for life in LIVES if life[1] != "instantiated"])
def test_every_variable_can_be_read(
    live: Callable[..., Life], unharmed, fmu: Fmu, fmu_type: int, state: str
) -> None:
    """Note 2 allows outputs and InitialUnknowns in Initialization Mode; every variable can be read, because
    masters such as libcosim read all of them there. In the state `error` (note 7) the values are for
    debugging, but can be read."""
    life = live(state, fmu_type=fmu_type)
    before = list(life.messages)
    for name in fmu.variables:
        life.get(name)
    assert life.get("time") == life.time
    assert life.messages == before
    unharmed(life)


def test_the_status_of_the_last_step(live: Callable[..., Life]) -> None:
    """Section 4.2.3: the current time, and that the slave does not end the simulation."""
    life = live("stepComplete")
    time, terminated = c_double(), c_int(7)
    for _ in range(2):
        life.ok("fmi2GetRealStatus", LAST_SUCCESSFUL_TIME, byref(time))
        assert time.value == life.time
        life.ok("fmi2GetBooleanStatus", TERMINATED, byref(terminated))
        assert terminated.value == 0
        assert life.step_on() == Status.OK
    # The memory for a status may hold any number: it is not read, and not written when discarded.
    status = c_int(77)
    assert life.call("fmi2GetStatus", DO_STEP_STATUS, byref(status)) == Status.DISCARD
    assert status.value == 77


def test_a_saved_state_leads_out_of_an_error(make: Callable[..., Instance]) -> None:
    """Section 2.1.3: after an Error a state saved before it can be set, and the instance continues from there
    like one without the error, bit for bit."""
    untouched, failed = make().initialize(), make().initialize()
    for instance in (untouched, failed):
        assert instance.step(0.0, STEP) == Status.OK
    saved = failed.save()
    failed.choose(fault__place="step", fault__manner="error")
    failed.refuses("fmi2DoStep", STEP, STEP, 1, names=["the model's own error"])
    failed.refuses("fmi2DoStep", STEP, STEP, 1, names=["error"])
    failed.ok("fmi2SetFMUstate", saved)
    failed.ok("fmi2FreeFMUstate", byref(saved))
    for instance in (untouched, failed):
        assert instance.step(STEP, STEP) == Status.OK
    assert failed.snapshot() == untouched.snapshot()
