"""What both FMUs answer to numbers and arguments that nobody can compute with: an Error that names them and
changes nothing.

After each refused call the instance goes on, bit for bit, as one that never got it, and after fmi2Reset as
a fresh one: that is what `unharmed` checks.
"""

from __future__ import annotations

import faulthandler
import math
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from ctypes import byref, c_char_p, c_int, c_size_t, c_void_p
from typing import Any

import pytest
from c_interface import FUNCTIONS, Status
from conftest import PROBED, Check, Live, RecordProperty
from fmpy.model_description import ScalarVariable
from life import (
    ARRAYS,
    COURSES,
    FAILING,
    STEP,
    Life,
    c_type_of,
    differences,
    integers,
    numbers_in,
    reals,
    references,
)
from master import WARNING, Fmu

NAMES = list(COURSES)
BOTH = pytest.mark.parametrize("name", NAMES)

SETTABLE = pytest.mark.parametrize("state", ["instantiated", "Initialization Mode", "stepComplete"])
"""The states in which values can be set."""

NO_NUMBERS = [math.nan, math.inf, -math.inf]

SET_UP = "fmi2SetupExperiment"
DO_STEP = "fmi2DoStep"
DERIVATIVES = "fmi2SetRealInputDerivatives"


@contextmanager
def at_once() -> Iterator[None]:
    """What is done inside is done within a second. A call into the library that hangs cannot be
    interrupted: it ends the process, with a traceback that says where."""
    faulthandler.dump_traceback_later(10.0, exit=True, file=sys.__stderr__)
    begin = time.monotonic()
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()
    assert time.monotonic() - begin < 1.0


def settable(fmu: Fmu, kind: str) -> list[ScalarVariable]:
    """The variables of a type that can be set before initialization: inputs, parameters, start values."""
    return [
        v
        for v in fmu.variables.values()
        if v.type == kind and (v.causality == "input" or v.initial in ("exact", "approx"))
    ]


def items(variable: ScalarVariable) -> list[int]:
    """The values of an enumeration."""
    return [int(item.value) for item in variable.declaredType.items]


# Steps and times


@BOTH
@pytest.mark.parametrize("size", [0.0, -0.0, -STEP, -1e-300, *NO_NUMBERS, 1e-18, 5e-324])
def test_a_step_that_is_none(live: Live, unharmed: Check, name: str, size: float) -> None:
    """Section 4.2.2: the size must be greater than 0, and the step must end at tc + h, which is still tc for
    a size that is lost in rounding."""
    life = live(name, "stepComplete")
    life.refuses(DO_STEP, life.time, size, 1, names=["communicationStepSize"], numbers=[size])
    unharmed(life)


@BOTH
@pytest.mark.parametrize("size", [1.8e308 / 2, 1e300, 1e18, 1e9])
def test_a_step_without_an_end(live: Live, unharmed: Check, name: str, size: float) -> None:
    """Whoever mistypes a step is told so at once, instead of waiting for years."""
    life = live(name, "stepComplete")
    with at_once():
        life.refuses(DO_STEP, life.time, size, 1, names=["communicationStepSize"], numbers=[size])
    unharmed(life)


@BOTH
@pytest.mark.parametrize("off", [*NO_NUMBERS, STEP, -STEP, 1e-3 * STEP, -1e-3 * STEP, 1e9])
def test_a_step_from_elsewhere(live: Live, unharmed: Check, name: str, off: float) -> None:
    """Section 4.2.2: the step begins where the last one ended."""
    life = live(name, "stepComplete")
    begin = life.time + off
    life.refuses(DO_STEP, begin, STEP, 1, names=["currentCommunicationPoint"], numbers=[begin, life.time])
    unharmed(life)


@BOTH
def test_the_first_step_begins_at_the_start_time(live: Live, name: str) -> None:
    """Section 4.2.2."""
    life = live(name, "Initialization Mode", start_time=3.0)
    assert life.caller.call("fmi2ExitInitializationMode") == Status.OK
    life.state = "stepComplete"
    life.refuses(DO_STEP, 0.0, STEP, 1, names=["currentCommunicationPoint"], numbers=[0.0, 3.0])
    assert life.step() == Status.OK


@BOTH
@pytest.mark.parametrize("start_time", [0.0, -7.3, 1e5])
@pytest.mark.parametrize("clock", ["products", "sums", "nanoseconds"])
def test_the_rounding_of_communication_points(live: Live, name: str, start_time: float, clock: str) -> None:
    """Masters compute communication points as i * h, by adding up, or from integer nanoseconds. None of
    them is off by more than rounding after 25,000 steps; a peer's exporter refuses its 23,042nd."""
    size = 0.0007
    life = live(name, "instantiated")
    life.caller.initialize(start_time)
    begin, step, sizes = start_time, life.caller.step, round(size * 1e9)
    for index in range(25_000):
        assert step(begin, size) == Status.OK, life.caller.messages
        if clock == "products":
            begin = start_time + (index + 1) * size
        elif clock == "sums":
            begin += size
        else:
            begin = (round(start_time * 1e9) + (index + 1) * sizes) / 1e9
    assert life.get("time") == pytest.approx(begin, rel=1e-12)


# The experiment


@BOTH
@pytest.mark.parametrize("set_up", [False, True])
@pytest.mark.parametrize(
    ("arguments", "named", "numbers"),
    [
        *(([0, 0.0, value, 0, 0.0], "startTime", [value]) for value in NO_NUMBERS),
        *(([0, 0.0, 0.0, 1, value], "stopTime", [value]) for value in (math.nan, -math.inf)),
        ([0, 0.0, 5.0, 1, 4.999], "stopTime", [4.999, 5.0]),
        ([0, 0.0, 0.0, 1, -1.0], "stopTime", [-1.0]),
        *(([1, value, 0.0, 0, 0.0], "tolerance", [value]) for value in NO_NUMBERS),
    ],
    ids=str,
)
def test_an_experiment_that_is_none(
    live: Live,
    unharmed: Check,
    name: str,
    set_up: bool,
    arguments: list[Any],
    named: str,
    numbers: list[float],
) -> None:
    """Section 2.1.6. Refused as if it had not been tried: what was set up before holds, and initialization
    goes on waiting for an experiment where there was none."""
    life = live(name)
    if set_up:
        assert life.setup() == Status.OK
    life.refuses(SET_UP, *arguments, names=[named], numbers=numbers)
    unharmed(life)


@BOTH
@pytest.mark.parametrize(
    "arguments",
    [
        [0, math.nan, 0.0, 0, math.nan],
        [0, -1.0, 0.0, 0, -1.0],
        [0, 0.0, 0.0, 1, 0.0],
        [0, 0.0, 0.0, 1, math.inf],
    ],
    ids=str,
)
def test_an_experiment_that_is_one(live: Live, name: str, arguments: list[Any]) -> None:
    """Section 2.1.6: what is not defined is meaningless, whatever it is. An experiment may be of no length,
    and an infinite stop time is as good as none."""
    life = live(name)
    assert life.caller.call(SET_UP, *arguments) == Status.OK
    assert life.caller.call("fmi2EnterInitializationMode") == Status.OK
    assert life.caller.call("fmi2ExitInitializationMode") == Status.OK
    assert life.step() == (Status.ERROR if arguments[3:] == [1, 0.0] else Status.OK)


@BOTH
@pytest.mark.parametrize("tolerance", [0.0, -0.0, -1e-4])
def test_a_tolerance_that_is_not_above_zero(live: Live, name: str, tolerance: float) -> None:
    """Masters whose users give none pass 0. With a warning, everything goes on as without."""
    life, without = live(name), live(name)
    assert life.caller.call(SET_UP, 1, tolerance, 0.0, 0, 0.0) == Status.WARNING
    (message,) = life.caller.messages
    assert message.status == WARNING
    assert SET_UP in message.text
    assert tolerance in numbers_in(message.text)
    life.set_up = True
    assert without.setup() == Status.OK
    assert differences(life.go_on(), without.go_on()) == []


@BOTH
@pytest.mark.parametrize("start_time", [1e6, -1e6, 1e9])
def test_a_late_start(live: Live, fmus: dict[str, Fmu], name: str, start_time: float) -> None:
    """Neither model depends on time itself, so that all but time is as from 0. At 1e9 s a step of 1/80 s is
    100,000 units in the last place of the time."""
    early, late = live(name, "stepComplete"), live(name, "stepComplete", start_time=start_time)
    for _ in range(20):
        assert early.step() == late.step() == Status.OK
    for variable in fmus[name].variables:
        if variable == "time":
            assert late.get(variable) == start_time + early.steps_done * STEP
        else:
            assert early.get(variable) == late.get(variable), variable


@BOTH
@pytest.mark.parametrize("start_time", [1e15, -1e15, 1e300, -1.7e308])
def test_a_start_that_no_step_leaves(live: Live, name: str, start_time: float) -> None:
    """Such a time is a number, so that an experiment may begin there; but its last place is worth more than
    the step."""
    life = live(name)
    assert life.caller.call(SET_UP, 0, 0.0, start_time, 0, 0.0) == Status.OK
    assert life.caller.call("fmi2EnterInitializationMode") == Status.OK
    assert life.caller.call("fmi2ExitInitializationMode") == Status.OK
    for _ in range(2):
        life.refuses(DO_STEP, start_time, STEP, 1, names=["communicationStepSize"], numbers=[STEP])
    assert life.get("time") == start_time


@BOTH
def test_steps_to_the_stop_time(live: Live, name: str) -> None:
    """Section 2.1.6: past stopTime is an Error; the last step may come to it with rounding."""
    stop_time = 0.3
    life = live(name, "instantiated", stop_time=stop_time)
    life.caller.initialize(0.0, stop_time)
    begin, size = 0.0, 0.1
    for _ in range(2):
        assert life.caller.step(begin, size) == Status.OK
        begin += size
    life.refuses(DO_STEP, begin, 0.11, 1, names=["stopTime"], numbers=[stop_time])
    # 0.1 + 0.1 + 0.1 is more than 0.3.
    assert begin + size > stop_time
    assert life.caller.step(begin, size) == Status.OK
    life.refuses(DO_STEP, begin + size, size, 1, names=["stopTime"], numbers=[stop_time])
    life.refuses(DO_STEP, begin + size, 1e-3, 1, names=["stopTime"], numbers=[stop_time])


@BOTH
def test_a_step_past_the_stop_time(live: Live, unharmed: Check, name: str) -> None:
    """Refused, it leaves the way to the stop time open."""
    life = live(name, "stepComplete", stop_time=20 * STEP)
    life.refuses(DO_STEP, life.time, 18 * STEP, 1, names=["stopTime"], numbers=[20 * STEP])
    unharmed(life)


# Values


@BOTH
@SETTABLE
def test_what_is_no_number(
    live: Live, unharmed: Check, fmus: dict[str, Fmu], record_property: RecordProperty, name: str, state: str
) -> None:
    """In every Real variable that can be set in the state; and nothing of the other elements of the call is
    set, whether they come before or after."""
    life = live(name, state)
    fmu = fmus[name]
    variables = [
        v
        for v in settable(fmu, "Real")
        if v.causality == "input"
        or state == "instantiated"
        or (state == "Initialization Mode" and v.initial == "exact")
        or (v.causality == "parameter" and v.variability == "tunable")
    ]
    assert len(variables) >= len(fmu.named("input"))
    others = [variable for variable in variables if variable.causality == "input"]
    for variable in variables:
        before, after = [other for other in others if other is not variable][:2]
        for value in NO_NUMBERS:
            values = {before.name: 0.25, variable.name: value, after.name: 0.75}
            life.refuses(*life.settings(values), names=[variable.name], numbers=[value])
    unharmed(life)
    record_property(PROBED, ("values that are not finite", len(NO_NUMBERS) * len(variables)))


@BOTH
def test_the_range_of_a_parameter(
    live: Live, unharmed: Check, fmus: dict[str, Fmu], record_property: RecordProperty, name: str
) -> None:
    """Every parameter and start value: as far as min and max, and not by a unit in the last place beyond."""
    fmu = fmus[name]
    life = live(name)
    count = 0
    for variable in settable(fmu, "Real"):
        if variable.causality == "input":
            continue
        present = life.course.parameters.get(variable.name, float(variable.start))
        for bound, away in [(variable.min, -math.inf), (variable.max, math.inf)]:
            if bound is None:
                # What has no bound takes the largest numbers.
                assert life.set({variable.name: math.copysign(1e308, away)}) == Status.OK
                assert life.set({variable.name: present}) == Status.OK
                continue
            bound = float(bound)
            assert life.set({variable.name: bound}) == Status.OK, life.caller.messages
            assert life.set({variable.name: present}) == Status.OK
            for value in [math.nextafter(bound, away), math.copysign(1.5e308, away)]:
                setting = life.settings({variable.name: value})
                life.refuses(*setting, names=[variable.name], numbers=[value, bound])
                count += 1
    unharmed(life)
    record_property(PROBED, ("values outside their range", count))


@BOTH
def test_every_parameter_has_a_range(fmus: dict[str, Fmu], name: str) -> None:
    """So that what is tried of ranges is tried of every parameter; an Integer one would need its own try."""
    parameters = [v for v in fmus[name].variables.values() if v.causality == "parameter"]
    assert {v.type for v in parameters} == {"Real", "Boolean", "Enumeration"}
    without = [v.name for v in parameters if v.type == "Real" and None in (v.min, v.max)]
    assert without == []


@BOTH
def test_the_items_of_an_enumeration(
    live: Live, unharmed: Check, fmus: dict[str, Fmu], record_property: RecordProperty, name: str
) -> None:
    """Items have the values from 1 on; there is no other."""
    life = live(name)
    enumerations = settable(fmus[name], "Enumeration")
    assert enumerations
    count = 0
    for variable in enumerations:
        values = items(variable)
        assert values == list(range(1, len(values) + 1))
        for value in [*values, int(variable.start)]:
            assert life.set({variable.name: value}) == Status.OK
        for value in [0, -1, len(values) + 1, 2**31 - 1, -(2**31)]:
            life.refuses(*life.settings({variable.name: value}), names=[variable.name], numbers=[value])
            count += 1
    unharmed(life)
    record_property(PROBED, ("values outside their range", count))


def _outside(variable: ScalarVariable) -> list[tuple[float, float]]:
    """Values outside the range of an input, each with the nearest bound."""
    least, most = float(variable.min), float(variable.max)
    return [
        (math.nextafter(least, -math.inf), least),
        (least - 1.0, least),
        (-1e308, least),
        (math.nextafter(most, math.inf), most),
        (1.5 * most, most),
        (1e308, most),
    ]


@BOTH
@SETTABLE
def test_an_input_outside_its_range(
    live: Live, fmus: dict[str, Fmu], record_property: RecordProperty, name: str, state: str
) -> None:
    """Sensors and solvers overshoot: the nearest bound is used, with one warning until the input has
    returned. Every input, on both sides."""
    fmu = fmus[name]
    inputs = fmu.named("input")
    count = 0
    for variable in map(fmu.variables.__getitem__, inputs):
        for value, bound in _outside(variable):
            outside, inside = live(name, state), live(name, state)
            assert outside.set({variable.name: value}) == Status.WARNING
            assert outside.set({variable.name: value}) == Status.OK
            assert inside.set({variable.name: bound}) == Status.OK
            records = []
            for life in (outside, inside):
                if life.state == "instantiated":
                    assert life.setup() == Status.OK
                    assert life.caller.call("fmi2EnterInitializationMode") == Status.OK
                if life.state != "stepComplete":
                    assert life.caller.call("fmi2ExitInitializationMode") in (Status.OK, Status.WARNING)
                for _ in range(3):
                    assert life.step() == Status.OK
                records.append(
                    [r for r in life.values("in the end") if not r[0].startswith(f"{variable.name},")]
                )
            assert records[0] == records[1], variable.name
            warnings = [m.text for m in outside.caller.messages if m.status == WARNING]
            (warning, *of_the_model) = warnings
            assert variable.name in warning
            assert of_the_model == [m.text for m in inside.caller.messages if m.status == WARNING]
            # It has returned, and leaves again; a fresh instance has not heard of it either.
            assert outside.set({variable.name: bound}) == Status.OK
            assert outside.set({variable.name: value}) == Status.WARNING
            assert variable.name in outside.caller.messages[-1].text
            assert outside.caller.call("fmi2Reset") == Status.OK
            assert outside.set({variable.name: value}) == Status.WARNING
            assert variable.name in outside.caller.messages[-1].text
            count += 1
            outside.caller.free()
            inside.caller.free()
    record_property(PROBED, ("inputs outside their range", count))


# Parameters that contradict each other

Contradiction = tuple[str, dict[str, float], list[str]]

TUNABLE_CONTRADICTIONS: list[Contradiction] = [
    ("BoostController", {"tank_pressure_on": 30e3}, ["tank_pressure_on", "tank_pressure_off"]),
    ("BoostController", {"tank_pressure_off": 36e3}, ["tank_pressure_on", "tank_pressure_off"]),
    ("BoostController", {"pwm_min": 80.0}, ["pwm_min", "pwm_max"]),
    ("BoostController", {"pwm_max": 20.0}, ["pwm_min", "pwm_max"]),
    (
        "BoostController",
        {"lp_wastegate_close_below": 3500.0},
        ["lp_wastegate_close_below", "lp_wastegate_open_above"],
    ),
    (
        "BoostController",
        {"lp_wastegate_open_above": 100.0},
        ["lp_wastegate_close_below", "lp_wastegate_open_above"],
    ),
    ("BoostController", {"schedule.gain[3,2]": 0.0}, ["schedule.gain[3,2]"]),
    ("BoostController", {"schedule.gain[16,7]": 100.0}, ["schedule.gain[1,1]", "schedule.gain[16,7]"]),
]
"""Values, and the parameters that the message names."""

CONTRADICTIONS: list[Contradiction] = [
    *TUNABLE_CONTRADICTIONS,
    (
        "BoostController",
        {"schedule.engine_speed[3]": 1000.0},
        ["schedule.engine_speed[2]", "schedule.engine_speed[3]"],
    ),
    (
        "BoostController",
        {"schedule.boost_reference[16]": 0.0},
        ["schedule.boost_reference[15]", "schedule.boost_reference[16]"],
    ),
    (
        "BoostPlant",
        {"actuator.coulomb_friction": 0.19},
        ["actuator.friction_stiffness", "actuator.coulomb_friction"],
    ),
    (
        "BoostPlant",
        {"actuator.friction_stiffness": 400.1},
        ["actuator.friction_stiffness", "actuator.coulomb_friction"],
    ),
    (
        "BoostPlant",
        {"actuator.chamber_volume": 15e-6},
        ["actuator.chamber_volume", "actuator.membrane_area", "actuator.stroke"],
    ),
    (
        "BoostPlant",
        {"air.gas_constant": 1000.0, "air.specific_heat": 1000.0},
        ["air.gas_constant", "air.specific_heat"],
    ),
    (
        "BoostPlant",
        {"exhaust_gas.gas_constant": 500.0, "exhaust_gas.specific_heat": 500.0},
        ["exhaust_gas.gas_constant", "exhaust_gas.specific_heat"],
    ),
]


def present(life: Life, values: Mapping[str, float]) -> dict[str, float]:
    """What variables have been set to, or their start values."""
    start = {name: float(life.fmu.variables[name].start) for name in values}
    return {name: life.course.parameters.get(name, start[name]) for name in values}


@pytest.mark.parametrize(("name", "values", "named"), CONTRADICTIONS, ids=str)
def test_parameters_that_contradict_each_other(
    live: Live, unharmed: Check, name: str, values: dict[str, float], named: list[str]
) -> None:
    """Masters set parameters one by one, so that the contradiction is told at the end of initialization.
    Put right, the instance goes on."""
    life = live(name, "Initialization Mode")
    good = present(life, values)
    assert life.set(values) == Status.OK
    for _ in range(2):
        life.refuses("fmi2ExitInitializationMode", names=named, numbers=list(values.values()))
    assert life.set(good) == Status.OK
    unharmed(life)


@pytest.mark.parametrize(("name", "values", "named"), TUNABLE_CONTRADICTIONS, ids=str)
def test_tunable_parameters_that_contradict_each_other(
    live: Live,
    unharmed: Check,
    fmus: dict[str, Fmu],
    name: str,
    values: dict[str, float],
    named: list[str],
) -> None:
    """Between steps, the next one tells; put right, it is made."""
    assert {fmus[name].variables[variable].variability for variable in values} == {"tunable"}
    life = live(name, "stepComplete")
    good = present(life, values)
    assert life.set(values) == Status.OK
    for _ in range(2):
        life.refuses(DO_STEP, life.time, STEP, 1, names=named, numbers=list(values.values()))
    assert life.set(good) == Status.OK
    unharmed(life)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("BoostController", {"tank_pressure_on": math.nextafter(30e3, math.inf)}),
        ("BoostController", {"pwm_min": math.nextafter(80.0, 0.0)}),
        ("BoostController", {"lp_wastegate_close_below": math.nextafter(3500.0, 0.0)}),
        ("BoostController", {"schedule.gain[3,2]": -1e-3}),
        ("BoostController", {"schedule.engine_speed[3]": 1500.001}),
        # The default sits on the limit of 2000 1/m as well.
        ("BoostPlant", {"actuator.coulomb_friction": 0.19, "actuator.friction_stiffness": 380.0}),
        ("BoostPlant", {"actuator.chamber_volume": 15.01e-6}),
        ("BoostPlant", {"air.gas_constant": 999.0, "air.specific_heat": 1000.0}),
    ],
    ids=str,
)
def test_parameters_that_just_agree(live: Live, name: str, values: dict[str, float]) -> None:
    """The other side of each contradiction."""
    life = live(name, "Initialization Mode")
    assert life.set(values) == Status.OK
    assert life.caller.call("fmi2ExitInitializationMode") in (Status.OK, Status.WARNING)
    assert life.step() == Status.OK, life.caller.messages


# Value references


@BOTH
@pytest.mark.parametrize("direction", ["Get", "Set"])
@pytest.mark.parametrize("kind", ["Real", "Integer", "Boolean", "String"])
def test_value_references_that_are_none_of_the_type(
    live: Live,
    unharmed: Check,
    fmus: dict[str, Fmu],
    record_property: RecordProperty,
    name: str,
    direction: str,
    kind: str,
) -> None:
    """Section 2.1.2: a wrong value reference is an Error. There are value references of no variable, and of
    variables of another type; nothing of the other elements is got or set."""
    life = live(name, "Initialization Mode")
    function = f"fmi2{direction}{kind}"
    variables = fmus[name].variables.values()
    good = [v for v in variables if c_type_of(v) == kind and (v.initial == "exact" or direction == "Get")][:1]
    array = ARRAYS.get(kind, lambda *values: (c_char_p * len(values))(*[b"text"] * len(values)))
    wrong = [(r, str(r)) for r in (max(v.valueReference for v in variables) + 1, 2**31, 2**32 - 1)]
    wrong += [(v.valueReference, v.name) for v in variables if c_type_of(v) != kind]
    for reference, named in wrong:
        vr = references(*(v.valueReference for v in good), reference)
        values = array(*[1] * len(vr))
        before = bytes(values)
        life.refuses(function, vr, len(vr), values, names=[named])
        assert bytes(values) == before
    unharmed(life)
    record_property(PROBED, ("wrong value references", len(wrong)))


# Null pointers


def _with_null(life: Life) -> list[tuple[str, list[Any], list[Any]]]:
    """For each function with arrays: its arguments with one element in each array, and with none. None
    stands for an array here."""
    (slope,) = life.course.slopes
    vr = references(life.reference(slope))
    calls: list[tuple[str, list[Any], list[Any]]] = []
    for kind, element in {**ARRAYS, "String": lambda *_: (c_char_p * 1)(b"text")}.items():
        variables = [v for v in life.fmu.variables.values() if c_type_of(v) == kind and v.initial == "exact"]
        one = references(*(v.valueReference for v in variables[:1] or [life.fmu.variables[slope]]))
        for direction in ("Get", "Set"):
            calls.append((f"fmi2{direction}{kind}", [one, 1, element(1)], [None, 0, None]))
    calls.append(("fmi2SetDebugLogging", [1, 1, (c_char_p * 1)(b"logEvents")], [0, 0, None]))
    calls.append((DERIVATIVES, [vr, 1, integers(1), reals(1.0)], [None, 0, None, None]))
    simulation = life.fmu.description.coSimulation
    output = references(life.fmu.description.outputs[0].variable.valueReference)
    if simulation.maxOutputDerivativeOrder:
        arguments = [output, 1, integers(1), reals(0.0)]
        calls.append(("fmi2GetRealOutputDerivatives", arguments, [None, 0, None, None]))
    if simulation.providesDirectionalDerivative:
        arguments = [output, 1, vr, 1, reals(1.0), reals(0.0)]
        calls.append(("fmi2GetDirectionalDerivative", arguments, [None, 0, None, 0, None, None]))
    return calls


@BOTH
def test_arrays_that_are_null(
    live: Live, unharmed: Check, record_property: RecordProperty, name: str
) -> None:
    """Fine where they have no elements, and an Error where they have one."""
    life = live(name, "stepComplete")
    count = 0
    for function, arguments, empty in _with_null(life):
        assert life.caller.call(function, *empty) == Status.OK, life.caller.messages
        types = FUNCTIONS[function][1][1:]
        for position, argument in enumerate(arguments):
            if isinstance(argument, int):
                continue
            assert types[position] not in (c_int, c_size_t)
            null = [*arguments[:position], None, *arguments[position + 1 :]]
            life.refuses(function, *null, names=["NULL"])
            count += 1
    unharmed(life)
    record_property(PROBED, ("null pointers", count))


@BOTH
def test_pointers_to_results_that_are_null(
    live: Live, unharmed: Check, record_property: RecordProperty, name: str
) -> None:
    """The status of a step, and states (section 2.1.8)."""
    life = live(name, "stepComplete")
    calls = [
        *((f"fmi2Get{kind}Status", [2, None]) for kind in ("", "Real", "Integer", "String")),
        ("fmi2GetBooleanStatus", [3, None]),
        ("fmi2GetFMUstate", [None]),
        ("fmi2SetFMUstate", [None]),
    ]
    for function, arguments in calls:
        life.refuses(function, *arguments, names=["NULL"])
    unharmed(life)
    record_property(PROBED, ("null pointers", len(calls)))


@BOTH
def test_a_state_that_is_null_is_freed_already(live: Live, unharmed: Check, name: str) -> None:
    """Section 2.1.8: "If a null pointer is provided, the call is ignored"."""
    life = live(name, "stepComplete")
    assert life.caller.call("fmi2FreeFMUstate", None) == Status.OK
    state = c_void_p()
    assert life.caller.call("fmi2FreeFMUstate", byref(state)) == Status.OK
    assert state.value is None
    unharmed(life)


@BOTH
def test_a_handle_that_is_no_state(live: Live, unharmed: Check, name: str) -> None:
    """Freed, another FMU's, or anything else (section 2.1.8): refused by its name, and followed by
    nothing."""
    life = live(name, "stepComplete")
    other = live(next(other for other in NAMES if other != name))
    freed = life.caller.save()
    wrong = [c_void_p(freed.value), other.caller.save(), c_void_p(4096), c_void_p(life.caller.component)]
    assert life.caller.call("fmi2FreeFMUstate", byref(freed)) == Status.OK
    for handle in wrong:
        life.refuses("fmi2SetFMUstate", handle, names=["FMUstate"])
        for function in ("fmi2GetFMUstate", "fmi2FreeFMUstate"):
            there = c_void_p(handle.value)
            life.refuses(function, byref(there), names=["FMUstate"])
            assert there.value == handle.value
    unharmed(life)
    assert other.caller.call("fmi2SetFMUstate", wrong[1]) == Status.OK
    unharmed(other)


@BOTH
def test_strings_that_are_null(live: Live, unharmed: Check, fmus: dict[str, Fmu], name: str) -> None:
    """A category of the log and a value; no FMU has a String variable to set."""
    life = live(name, "Initialization Mode")
    null = (c_char_p * 2)(b"logEvents", None)
    life.refuses("fmi2SetDebugLogging", 1, 2, null, names=["NULL"])
    assert "String" not in {v.type for v in fmus[name].variables.values()}
    vr = references(life.reference("time"))
    life.refuses("fmi2SetString", vr, 1, (c_char_p * 1)(None), names=["NULL"])
    unharmed(life)


@BOTH
def test_a_category_of_the_log_that_there_is_not(live: Live, unharmed: Check, name: str) -> None:
    """Section 2.1.5: the categories are those of the XML. The one before it is not switched on either."""
    life = live(name, "Initialization Mode")
    categories = (c_char_p * 2)(b"logEvents", b"logNothing")
    life.refuses("fmi2SetDebugLogging", 1, 2, categories, names=["logNothing"])
    unharmed(life)


# Input derivatives


@BOTH
@SETTABLE
def test_derivatives_that_are_none(
    live: Live, unharmed: Check, fmus: dict[str, Fmu], record_property: RecordProperty, name: str, state: str
) -> None:
    """Section 4.2.1: orders from 1 on, of Real inputs. Orders above 8 are not taken."""
    life = live(name, state)
    (slope,) = life.course.slopes
    good = life.reference(slope)
    cases = [(slope, order, 1.0) for order in (0, -1, 9, 2**31 - 1, -(2**31))]
    cases += [(slope, 1, value) for value in NO_NUMBERS]
    for variable in fmus[name].variables.values():
        if variable.causality != "input":
            cases.append((variable.name, 1, 0.5))
    for variable, order, value in cases:
        # With one before that is right: it is not taken either.
        vr = references(good, life.reference(variable))
        arguments = [vr, 2, integers(2, order), reals(3.0, value)]
        numbers = [] if math.isfinite(value) else [value]
        life.refuses(DERIVATIVES, *arguments, names=[variable], numbers=numbers)
    for reference in (len(fmus[name].variables), 2**31, 2**32 - 1):
        arguments = [references(reference), 1, integers(1), reals(1.0)]
        life.refuses(DERIVATIVES, *arguments, names=[str(reference)])
    unharmed(life)
    record_property(PROBED, ("input derivatives that are none", len(cases) + 3))


@SETTABLE
def test_derivatives_of_discrete_inputs(live: Live, fmus: dict[str, Fmu], state: str) -> None:
    """Masters that extrapolate set them for all inputs: one that is discrete holds its value, with one
    warning. (The controller's inputs are all continuous.)"""
    fmu = fmus["BoostPlant"]
    discrete = [v for v in fmu.variables.values() if (v.causality, v.variability) == ("input", "discrete")]
    assert {v.name for v in discrete} == {"hp_wastegate_pwm", "vacuum_pump"}
    life, without = live("BoostPlant", state), live("BoostPlant", state)
    for variable in discrete:
        vr = references(variable.valueReference)
        assert life.caller.call(DERIVATIVES, vr, 1, integers(1), reals(0.0)) == Status.OK
        before = len(life.caller.messages)
        assert life.caller.call(DERIVATIVES, vr, 1, integers(1), reals(7.0)) == Status.WARNING
        assert life.caller.call(DERIVATIVES, vr, 1, integers(2), reals(-7.0)) == Status.OK
        (message,) = life.caller.messages[before:]
        assert message.status == WARNING
        assert variable.name in message.text
        life.refuses(DERIVATIVES, vr, 1, integers(0), reals(1.0), names=[variable.name])
    records = []
    for one in (life, without):
        if one.state == "instantiated":
            assert one.setup() == Status.OK
            assert one.caller.call("fmi2EnterInitializationMode") == Status.OK
        if one.state != "stepComplete":
            assert one.caller.call("fmi2ExitInitializationMode") == Status.OK
        for _ in range(3):
            assert one.step() == Status.OK
        records.append(one.values("in the end"))
    assert records[0] == records[1]


@BOTH
def test_derivatives_of_every_order_that_is_taken(live: Live, name: str) -> None:
    """Section 4.2.1. The controller takes no sample of the end of a step, so that its step is of several."""
    life, other = live(name, "stepComplete"), live(name, "stepComplete")
    (slope,) = life.course.slopes
    vr = references(life.reference(slope))
    for order in range(1, 9):
        value = reals(1e3 * math.factorial(order))
        assert life.caller.call(DERIVATIVES, vr, 1, integers(order), value) == Status.OK
    for one in (life, other):
        assert one.caller.step(one.time, 5 * STEP) == Status.OK
    assert life.values("") != other.values("")


# Steps that fail


@pytest.mark.parametrize("name", FAILING)
def test_a_step_that_cannot_be_completed(
    live: Live, unharmed: Check, fmus: dict[str, Fmu], name: str
) -> None:
    """The step is an Error that names a state and the time; so is every further one, until fmi2Reset. (With
    states that stop being finite: see test_panics.py.)"""
    life = live(name, "error")
    (message,) = life.caller.messages
    first, last = life.time, life.time + STEP
    states = [state for state in fmus[name].states() if f" {state} " in message.text]
    assert len(states) == 1, message.text
    assert any(first <= number <= last for number in numbers_in(message.text))
    for _ in range(2):
        life.refuses(DO_STEP, life.time, STEP, 1, names=["error"])
    assert life.get("time") == first
    unharmed(life)


@pytest.mark.parametrize("name", FAILING)
def test_start_values_that_lead_nowhere(
    live: Live, like_a_fresh_one: Check, fmus: dict[str, Fmu], name: str
) -> None:
    """Finite start values of which the model makes no numbers, told when initialization ends. It can be
    tried again: with another way to initialize it succeeds."""
    life = live(name)
    modes = fmus[name].variables["initialization.mode"].declaredType.items
    given, settled = (
        next(int(item.value) for item in modes if item.name == wanted) for wanted in ("given", "settled")
    )

    def fail() -> None:
        assert life.set({"initialization.mode": given}) == Status.OK
        assert life.set({"hp_shaft.speed": 1e200, "actuator.velocity": 1e200}) == Status.OK
        assert life.setup() == Status.OK
        assert life.caller.call("fmi2EnterInitializationMode") == Status.OK
        for _ in range(2):
            life.refuses(
                "fmi2ExitInitializationMode",
                names=["der(lp_compressor.outlet_pressure)"],
                numbers=[math.nan, life.start_time],
            )

    def succeed() -> None:
        assert life.set({"initialization.mode": settled}) == Status.OK
        # The start values are not used, of which there is a warning.
        assert life.caller.call("fmi2ExitInitializationMode") == Status.WARNING
        assert life.caller.messages[-1].status == WARNING
        assert "actuator.velocity, hp_shaft.speed" in life.caller.messages[-1].text
        assert life.step() == Status.OK

    fail()
    succeed()
    like_a_fresh_one(life)
    # Nor has a fresh instance been warned.
    assert life.caller.call("fmi2Reset") == Status.OK
    fail()
    life.steps_done = 0
    succeed()
