"""The order of calls: which function may be called in which state (FMI 2.0.5, section 4.2.4).

`tests/data/calling_sequence.csv` is the table of that section, cell by cell. A number in a cell is a
condition on the variable, by the notes below the table.
"""

from __future__ import annotations

import csv
import dataclasses
import math
from collections.abc import Callable
from ctypes import byref, c_char, c_char_p, c_double, c_int, c_size_t, c_void_p
from typing import Any

import pytest
from c_interface import FUNCTIONS, Status
from conftest import PROBED, ROOT, Check, Live, RecordProperty
from fmpy.model_description import ScalarVariable, Unknown
from life import (
    ARRAYS,
    COURSES,
    FAILING,
    STATES,
    STEP,
    Life,
    c_type_of,
    differences,
    integers,
    reals,
    references,
)
from master import Fmu

NAMES = ["BoostPlant", "BoostController"]


def _table() -> dict[str, dict[str, str]]:
    with open(ROOT / "tests/data/calling_sequence.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    return {row.pop("function"): row for row in rows}


TABLE = _table()
"""By function and state: blank where the call is not allowed."""

NO_INSTANCE = "start/end"
NEVER = ["stepInProgress", "stepFailed", "stepCanceled", "fatal"]
"""States that belong to steps in the background or discarded, and to errors that harm every instance."""

REACHED = [(name, state) for name in NAMES for state in STATES if state != "error" or name in FAILING]
"""Every state that an instance of each FMU can be in."""

CAPABILITIES = {
    "fmi2GetFMUstate": "canGetAndSetFMUstate",
    "fmi2SetFMUstate": "canGetAndSetFMUstate",
    "fmi2FreeFMUstate": "canGetAndSetFMUstate",
    "fmi2SerializedFMUstateSize": "canSerializeFMUstate",
    "fmi2SerializeFMUstate": "canSerializeFMUstate",
    "fmi2DeSerializeFMUstate": "canSerializeFMUstate",
    "fmi2GetDirectionalDerivative": "providesDirectionalDerivative",
    "fmi2SetRealInputDerivatives": "canInterpolateInputs",
    "fmi2GetRealOutputDerivatives": "maxOutputDerivativeOrder",
}
"""The attribute of the XML that tells whether the FMU has a function (section 4.3.1)."""

ANSWERS = {
    "fmi2GetStatus": Status.DISCARD,
    "fmi2GetRealStatus": Status.OK,
    "fmi2GetIntegerStatus": Status.DISCARD,
    "fmi2GetBooleanStatus": Status.OK,
    "fmi2GetStringStatus": Status.DISCARD,
}
"""Section 4.2.3: fmi2Discard for what only a step in the background has, and for the type of which there is
no status; the time of the last step and whether the slave ends the simulation are known."""

INQUIRED = {"fmi2GetTypesPlatform": b"default", "fmi2GetVersion": b"2.0"}
"""Section 2.1.4: what is known without an instance."""

CHANGING = [
    "fmi2Instantiate",
    "fmi2FreeInstance",
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
]
"""What an instance does not go on from as if nothing had been called."""

DO_STEP_STATUS, PENDING_STATUS, LAST_SUCCESSFUL_TIME, TERMINATED = range(4)
"""`fmi2StatusKind`."""


def is_input(variable: ScalarVariable) -> bool:
    """Whether a variable is an input; those have no `initial`, whatever a reader of the XML fills in."""
    return variable.causality == "input"


CONDITIONS: dict[str, Callable[[ScalarVariable], bool]] = {
    "1": lambda v: v.variability != "constant" and v.initial in ("exact", "approx") and not is_input(v),
    "3": lambda v: is_input(v) or (v.variability != "constant" and v.initial == "exact"),
    "6": lambda v: is_input(v) or (v.causality == "parameter" and v.variability == "tunable"),
}
"""The notes below the table on setting variables, by their numbers."""


def settable(variable: ScalarVariable, state: str) -> bool:
    """Whether the table lets a variable be set in a state, and beyond it what masters need: they set inputs
    before initialization too (libcosim, PyFMI and cofmupy do), which note 1 does not list."""
    condition = TABLE[f"fmi2Set{c_type_of(variable)}"][state]
    if condition == "1" and is_input(variable):
        return True
    return bool(condition) and CONDITIONS[condition](variable)


def another_value(variable: ScalarVariable) -> Any:
    """A value within the range of a variable, which is not its start value."""
    if variable.type == "Real":
        start = float(variable.start or 0.0)
        most = math.inf if variable.max is None else float(variable.max)
        return math.nextafter(start, -math.inf if start == most else math.inf)
    if variable.type == "Boolean":
        return int(variable.start != "true")
    if variable.type == "Enumeration":
        items = [int(item.value) for item in variable.declaredType.items]
        return next(item for item in items if item != int(variable.start))
    return int(variable.start or 0) + 1


def unknown_and_known(fmu: Fmu, unknowns: list[Unknown]) -> tuple[int, int]:
    """The value references of a Real unknown and of a Real input that it depends on; of any input where
    none depends on one."""
    inputs = [v for v in fmu.variables.values() if is_input(v) and v.type == "Real"]
    for unknown in unknowns:
        for known in unknown.dependencies or []:
            if known in inputs and unknown.variable.type == "Real":
                return unknown.variable.valueReference, known.valueReference
    return unknowns[0].variable.valueReference, inputs[0].valueReference


def arguments_of(life: Life, function: str) -> list[Any]:
    """Good arguments for a function, other than what the instance was given before. What a function needs
    to be called before is called."""
    caller, description = life.caller, life.fmu.description
    kind = function.removeprefix("fmi2Get").removeprefix("fmi2Set")
    if kind in ("Real", "Integer", "Boolean", "String"):
        variables = [v for v in life.fmu.variables.values() if c_type_of(v) == kind]
        if function.startswith("fmi2Get"):
            chosen = variables
        else:
            # Where no variable of the type may be set, the forbidden call has one that might elsewhere.
            chosen = [v for v in variables if settable(v, life.state)]
            if not TABLE[function][life.state]:
                chosen = [v for v in variables if settable(v, "instantiated")]
        if not chosen:
            return [None, 0, None]
        values = [another_value(v) for v in chosen]
        return [references(*(v.valueReference for v in chosen)), len(chosen), ARRAYS[kind](*values)]
    if function == "fmi2SetDebugLogging":
        return [1, 1, (c_char_p * 1)(b"logStatusError")]
    if function == "fmi2SetupExperiment":
        return [1, 1e-5, 5.0, 1, 6.0]
    if function == "fmi2EnterInitializationMode":
        if life.state == "instantiated":
            assert life.setup() == Status.OK
        return []
    if function == "fmi2DoStep":
        return [life.time, 0.001, 1]
    if function == "fmi2GetFMUstate":
        return [byref(c_void_p())]
    if function == "fmi2SetFMUstate":
        return [caller.save()]
    if function == "fmi2FreeFMUstate":
        return [byref(caller.save())]
    if function == "fmi2SerializedFMUstateSize":
        return [caller.save(), byref(c_size_t())]
    if function == "fmi2SerializeFMUstate":
        state, size = caller.save(), c_size_t(1)
        if description.coSimulation.canSerializeFMUstate:
            assert caller.call("fmi2SerializedFMUstateSize", state, byref(size)) == Status.OK
        return [state, (c_char * size.value)(), size]
    if function == "fmi2DeSerializeFMUstate":
        content = b"\0"
        if description.coSimulation.canSerializeFMUstate:
            content = caller.serialize(caller.save())
        return [(c_char * len(content))(*content), len(content), byref(c_void_p())]
    if function == "fmi2GetDirectionalDerivative":
        initializing = life.state == "Initialization Mode"
        unknowns = description.initialUnknowns if initializing else description.outputs
        unknown, known = unknown_and_known(life.fmu, unknowns)
        return [references(unknown), 1, references(known), 1, reals(1.0), reals(0.0)]
    if function == "fmi2SetRealInputDerivatives":
        (name,) = life.course.slopes
        return [references(life.reference(name)), 1, integers(1), reals(7.0)]
    if function == "fmi2GetRealOutputDerivatives":
        output = description.outputs[0].variable.valueReference
        return [references(output), 1, integers(1), reals(0.0)]
    status_arguments = {
        "fmi2GetStatus": [DO_STEP_STATUS, byref(c_int())],
        "fmi2GetRealStatus": [LAST_SUCCESSFUL_TIME, byref(c_double())],
        "fmi2GetIntegerStatus": [LAST_SUCCESSFUL_TIME, byref(c_int())],
        "fmi2GetBooleanStatus": [TERMINATED, byref(c_int())],
        "fmi2GetStringStatus": [PENDING_STATUS, byref(c_char_p())],
    }
    return status_arguments.get(function, [])


def has(fmu: Fmu, function: str) -> bool:
    """Whether the FMU declares to have a function."""
    capability = CAPABILITIES.get(function)
    return capability is None or bool(getattr(fmu.description.coSimulation, capability))


def test_the_table_is_of_all_functions_and_states(fmus: dict[str, Fmu]) -> None:
    assert list(TABLE) == list(FUNCTIONS)
    for function, cells in TABLE.items():
        assert list(cells) == [NO_INSTANCE, *STATES[:3], *NEVER[:3], *STATES[3:], "fatal"], function
    used = {cell for cells in TABLE.values() for cell in cells.values()}
    assert used == {"", "x", "2", "7", "8", *CONDITIONS}
    for fmu in fmus.values():
        # Steps in the background would bring the states of NEVER with them.
        assert not fmu.description.coSimulation.canRunAsynchronuously


@pytest.mark.parametrize("name", NAMES)
def test_a_life_shows_whatever_an_instance_remembers(live: Live, name: str) -> None:
    """What is compared below differs when anything of the course was not set, or was lost."""
    course = COURSES[name]
    whole = live(name, "stepComplete").go_on()
    assert differences(live(name, "stepComplete").go_on(), whole) == []
    for forgotten in ("parameters", "inputs", "pending", "slopes", "later"):
        lesser = dataclasses.replace(course, **{forgotten: {}})
        life = live(name, "stepComplete", course=lesser)
        output = {f"{output}, at {(life.steps_done + 6) * STEP}" for output in life.fmu.named("output")}
        told = {difference.split(": ")[0] for difference in differences(life.go_on(), whole)}
        assert told, forgotten
        if forgotten != "later":
            assert told & output, forgotten


@pytest.mark.parametrize("function", TABLE)
@pytest.mark.parametrize(("name", "state"), REACHED)
def test_a_function_in_a_state(
    live: Live, unharmed: Check, record_property: RecordProperty, name: str, state: str, function: str
) -> None:
    """With good arguments: works where it is allowed, otherwise an Error that names function and state and
    changes nothing."""
    life = live(name, state)
    library = life.caller.library
    record_property(PROBED, ("pairs of function and state", 1))
    if function in INQUIRED:
        assert TABLE[function][state] == "x"
        assert getattr(library, function)() == INQUIRED[function]
    elif function == "fmi2Instantiate":
        # It takes no instance, so that what the table forbids cannot be called: it makes another one, which
        # is in its own state (canBeInstantiatedOnlyOncePerProcess is false).
        assert TABLE[function][state] == ""
        assert live(name).caller.component not in (None, life.caller.component)
    elif function == "fmi2FreeInstance":
        assert TABLE[function][state] == "x"
        before = list(life.caller.messages)
        life.caller.free()
        assert life.caller.messages == before
        return
    elif not TABLE[function][state]:
        life.refuses(function, *arguments_of(life, function), names=[state])
    elif not has(life.fmu, function):
        life.refuses(function, *arguments_of(life, function), names=[CAPABILITIES[function]])
    else:
        arguments = arguments_of(life, function)
        before = list(life.caller.messages)
        assert life.caller.call(function, *arguments) == ANSWERS.get(function, Status.OK)
        assert life.caller.messages == before
        if function in CHANGING:
            return
    unharmed(life)


@pytest.mark.parametrize("function", TABLE)
@pytest.mark.parametrize("name", NAMES)
def test_a_function_without_an_instance(
    live: Live, record_property: RecordProperty, name: str, function: str
) -> None:
    """Before fmi2Instantiate and after fmi2FreeInstance there is no instance: NULL in its place is an Error,
    of which no logger can be told; freeing it is ignored (section 2.1.5). A pointer that was freed is not
    tried: nobody can answer for what it points to."""
    life = live(name)
    record_property(PROBED, ("pairs of function and state", 1))
    result, types = FUNCTIONS[function]
    if TABLE[function][NO_INSTANCE]:
        # Either of an FMU or of an instance that does not exist yet: `live` has made one.
        assert function in INQUIRED or (function == "fmi2Instantiate" and life.caller.component)
        assert types == [] or function == "fmi2Instantiate"
        return
    answer = getattr(life.caller.library, function)(None, *arguments_of(life, function))
    assert answer == (None if result is None else Status.ERROR)
    assert life.caller.messages == []


@pytest.mark.parametrize("name", NAMES)
def test_initialization_needs_an_experiment(live: Live, unharmed: Check, name: str) -> None:
    """Section 2.1.6: fmi2SetupExperiment must be called before fmi2EnterInitializationMode."""
    life = live(name)
    life.refuses("fmi2EnterInitializationMode", names=["fmi2SetupExperiment"])
    unharmed(life)


@pytest.mark.parametrize("name", NAMES)
def test_an_experiment_may_be_set_up_anew(live: Live, name: str) -> None:
    """Section 2.1.6: "at least once"; the last one holds."""
    life = live(name)
    assert life.caller.call("fmi2SetupExperiment", 0, 0.0, 5.0, 1, 6.0) == Status.OK
    assert life.caller.call("fmi2SetupExperiment", 0, 0.0, 2.0, 0, 0.0) == Status.OK
    assert life.caller.call("fmi2EnterInitializationMode") == Status.OK
    assert life.caller.call("fmi2ExitInitializationMode") == Status.OK
    assert life.get("time") == 2.0
    assert life.caller.step(2.0, 10.0) == Status.OK


@pytest.mark.parametrize("state", ["instantiated", "Initialization Mode", "stepComplete"])
@pytest.mark.parametrize("name", NAMES)
def test_which_variables_can_be_set(
    live: Live,
    unharmed: Check,
    fmus: dict[str, Fmu],
    record_property: RecordProperty,
    name: str,
    state: str,
) -> None:
    """Notes 1, 3 and 6, for every variable."""
    refusing = live(name, state)
    for variable in fmus[name].variables.values():
        setting = refusing.settings({variable.name: another_value(variable)})
        if not settable(variable, state):
            refusing.refuses(*setting, names=[variable.name, state])
            continue
        life = live(name, state)
        value = another_value(variable)
        assert life.caller.call(*setting) == Status.OK, life.caller.messages
        if state == "instantiated":
            life.setup()
            assert life.caller.call("fmi2EnterInitializationMode") == Status.OK
        # Section 4.2.4 asks for a step between setting and getting in stepComplete, the other way masters
        # cannot tell what they set: it is tolerated.
        if not (variable.initial == "approx" and not is_input(variable)):
            assert life.get(variable.name) == value, variable.name
        life.caller.free()
    unharmed(refusing)
    record_property(PROBED, ("variables set in a state", len(fmus[name].variables)))


def test_start_values_of_states_are_taken(live: Live, fmus: dict[str, Fmu]) -> None:
    """Note 1, `initial="approx"`: what was set is a guess, which holds where the initialization is told to
    start from it."""
    fmu = fmus["BoostPlant"]
    guesses = [v for v in fmu.variables.values() if v.initial == "approx"]
    assert len(guesses) > 10
    life = live("BoostPlant")
    mode = fmu.variables["initialization.mode"]
    (given,) = [int(item.value) for item in mode.declaredType.items if item.name == "given"]
    assert life.set({mode.name: given}) == Status.OK
    for variable in guesses:
        assert life.set({variable.name: another_value(variable)}) == Status.OK
    life.setup()
    assert life.caller.call("fmi2EnterInitializationMode") == Status.OK
    for variable in guesses:
        assert life.get(variable.name) == another_value(variable)


@pytest.mark.parametrize(("name", "state"), [pair for pair in REACHED if pair[1] != "instantiated"])
def test_every_variable_can_be_got(
    live: Live, unharmed: Check, fmus: dict[str, Fmu], record_property: RecordProperty, name: str, state: str
) -> None:
    """Note 2 allows outputs and InitialUnknowns in Initialization Mode; every variable can be got, because
    masters such as libcosim read all of them there. In the state `error` (note 7) the values are for
    debugging, but can be got."""
    life = live(name, state)
    before = list(life.caller.messages)
    variables = fmus[name].variables
    for variable in variables.values():
        assert math.isfinite(life.get(variable.name)), variable.name
    assert life.get("time") == life.time
    assert life.caller.messages == before
    unharmed(life)
    record_property(PROBED, ("variables got in a state", len(variables)))


@pytest.mark.parametrize("name", NAMES)
def test_the_status_of_the_last_step(live: Live, name: str) -> None:
    """Section 4.2.3: the time that was reached, and that the slave does not want to end the simulation."""
    life = live(name, "stepComplete")
    time, terminated = c_double(), c_int(7)
    for _ in range(2):
        assert life.caller.call("fmi2GetRealStatus", LAST_SUCCESSFUL_TIME, byref(time)) == Status.OK
        assert time.value == life.time
        assert life.caller.call("fmi2GetBooleanStatus", TERMINATED, byref(terminated)) == Status.OK
        assert terminated.value == 0
        assert life.step() == Status.OK


@pytest.mark.parametrize("name", FAILING)
def test_an_error_is_left_by_a_saved_state(live: Live, name: str) -> None:
    """Section 2.1.3: after an Error a state that was saved before it can be set, and the instance goes on
    from there as one that never failed, bit for bit."""
    life, untouched = live(name), live(name)
    for one in (life, untouched):
        assert one.set(one.course.failing_parameters) == Status.OK
        one.caller.initialize()
        assert one.step() == Status.OK
    saved = life.caller.save()
    assert life.set(life.course.failing_inputs) == Status.OK
    assert life.step() == Status.ERROR
    life.refuses("fmi2DoStep", life.time, 0.001, 1, names=["error"])
    assert life.caller.call("fmi2SetFMUstate", saved) == Status.OK
    assert life.caller.call("fmi2FreeFMUstate", byref(saved)) == Status.OK
    for one in (life, untouched):
        assert one.step() == Status.OK
    assert life.values("later") == untouched.values("later")
