"""Invalid arguments: an Error that names them and changes nothing.

After each refused call the instance continues, bit for bit, like one without it, and after fmi2Reset like a
new one: `unharmed` checks this.
"""

from __future__ import annotations

import faulthandler
import math
import sys
from collections.abc import Callable
from ctypes import byref, c_int, c_size_t, c_void_p
from typing import Any

import pytest
from fmi2 import (
    ARRAYS,
    EMPTY,
    FUNCTIONS,
    STEP,
    Fmu,
    Instance,
    Status,
    c_type_of,
    integers,
    numbers_in,
    reals,
    references,
    strings,
)
from fmpy.model_description import ScalarVariable
from life import Life, differences

Live = Callable[..., Life]
Make = Callable[..., Instance]
Check = Callable[[Life], None]

SETTABLE = pytest.mark.parametrize("state", ["instantiated", "Initialization Mode", "stepComplete"])
"""The states in which values can be set."""

NOT_FINITE = [math.nan, math.inf, -math.inf]

SET_UP = "fmi2SetupExperiment"
DO_STEP = "fmi2DoStep"
DERIVATIVES = "fmi2SetRealInputDerivatives"


def settable(fmu: Fmu, kind: str, causality: str | None = None) -> list[ScalarVariable]:
    """The variables of a type that can be set before initialization: inputs, parameters, start values."""
    names = fmu.named(lambda v: v.causality == "input" or v.initial in ("exact", "approx"))
    variables = [fmu.variables[name] for name in names if fmu.variables[name].type == kind]
    return [v for v in variables if causality in (None, v.causality)]


# Steps and times


@pytest.mark.parametrize(
    "size",
    [0.0, -0.0, -STEP, -1e-300, *NOT_FINITE, 1e-18, 5e-324, 1.8e308 / 2, 1e300, 1e18, 1e9],
)
def test_the_size_of_a_step(live: Live, unharmed: Check, size: float) -> None:
    """Section 4.2.2: the size must be greater than 0, and the step must end at tc + h, which is still tc for
    a size that is lost in rounding. A step that would take years is refused at once; otherwise the test times
    out."""
    life = live("stepComplete")
    faulthandler.dump_traceback_later(1.0, exit=True, file=sys.__stderr__)
    life.refuses(DO_STEP, life.time, size, 1, names=["communicationStepSize"], numbers=[size])
    faulthandler.cancel_dump_traceback_later()
    unharmed(life)


@pytest.mark.parametrize("off", [*NOT_FINITE, STEP, -STEP, 1e-3 * STEP, -1e-3 * STEP, 1e9])
def test_the_start_of_a_step(live: Live, unharmed: Check, off: float) -> None:
    """Section 4.2.2: the step starts at the end of the last one."""
    life = live("stepComplete")
    begin = life.time + off
    life.refuses(DO_STEP, begin, STEP, 1, names=["currentCommunicationPoint"], numbers=[begin, life.time])
    unharmed(life)


def test_the_first_step_begins_at_the_start_time(make: Make) -> None:
    """Section 4.2.2."""
    instance = make().initialize(3.0)
    instance.refuses(DO_STEP, 0.0, STEP, 1, names=["currentCommunicationPoint"], numbers=[0.0, 3.0])
    assert instance.step(3.0, STEP) == Status.OK


@pytest.mark.parametrize("start_time", [0.0, -7.3, 1e5])
@pytest.mark.parametrize("clock", ["products", "sums", "nanoseconds"])
def test_the_rounding_of_communication_points(make: Make, start_time: float, clock: str) -> None:
    """Masters compute communication points as i * h, as a sum, or from integer nanoseconds. The rounding
    error is accepted after 25,000 steps; another exporter refuses its 23,042nd."""
    size = 0.0007
    instance = make().initialize(start_time)
    begin, sizes = start_time, round(size * 1e9)
    for index in range(25_000):
        assert instance.step(begin, size) == Status.OK, instance.messages
        if clock == "products":
            begin = start_time + (index + 1) * size
        elif clock == "sums":
            begin += size
        else:
            begin = (round(start_time * 1e9) + (index + 1) * sizes) / 1e9
    assert instance.get("time") == pytest.approx(begin, rel=1e-12)


def test_the_rounding_of_short_steps_late_in_a_run(make: Make) -> None:
    """A millionth of the step is less than the time's rounding."""
    start_time, size = 1e6, 1e-5
    instance = make().initialize(start_time)
    begin = start_time
    for _ in range(100):
        assert instance.step(begin, size) == Status.OK, instance.messages
        begin = math.nextafter(begin + size, math.inf)


# The experiment


@pytest.mark.parametrize("is_set_up", [False, True])
@pytest.mark.parametrize(
    ("arguments", "named", "numbers"),
    [
        *(([0, 0.0, value, 0, 0.0], "startTime", [value]) for value in NOT_FINITE),
        *(([0, 0.0, 0.0, 1, value], "stopTime", [value]) for value in (math.nan, -math.inf)),
        ([0, 0.0, 5.0, 1, 4.999], "stopTime", [4.999, 5.0]),
        ([0, 0.0, 0.0, 1, -1.0], "stopTime", [-1.0]),
        *(([1, value, 0.0, 0, 0.0], "tolerance", [value]) for value in NOT_FINITE),
    ],
    ids=str,
)
def test_an_experiment_that_is_refused(
    live: Live, unharmed: Check, is_set_up: bool, arguments: list[Any], named: str, numbers: list[float]
) -> None:
    """Section 2.1.6. An earlier setup stays valid; without one, initialization is still refused."""
    life = live()
    if is_set_up:
        life.set_up()
    life.refuses(SET_UP, *arguments, names=[named], numbers=numbers)
    unharmed(life)


@pytest.mark.parametrize(
    ("arguments", "first_step"),
    [
        ([0, math.nan, 0.0, 0, math.nan], Status.OK),
        ([0, -1.0, 0.0, 0, -1.0], Status.OK),
        ([0, 0.0, 0.0, 1, 0.0], Status.ERROR),
        ([0, 0.0, 0.0, 1, math.inf], Status.OK),
    ],
    ids=str,
)
def test_an_experiment_that_is_accepted(make: Make, arguments: list[Any], first_step: Status) -> None:
    """Section 2.1.6: undefined arguments are ignored. An experiment may have no length, and an infinite stop
    time is the same as none."""
    instance = make()
    instance.ok(SET_UP, *arguments)
    instance.ok("fmi2EnterInitializationMode")
    instance.ok("fmi2ExitInitializationMode")
    assert instance.step(0.0, STEP) == first_step


@pytest.mark.parametrize("tolerance", [0.0, -0.0, -1e-4])
def test_a_tolerance_that_is_not_above_zero(live: Live, tolerance: float) -> None:
    """Some masters pass 0 if their users give none. It is ignored, with a warning."""
    life, without = live(start_time=0.0), live(start_time=0.0)
    assert life.call(SET_UP, 1, tolerance, 0.0, 0, 0.0) == Status.WARNING
    (message,) = life.messages
    assert message.status == Status.WARNING
    assert SET_UP in message.text
    assert tolerance in numbers_in(message.text)
    life.is_set_up = True
    without.set_up()
    assert differences(life.go_on(), without.go_on()) == []


@pytest.mark.parametrize("start_time", [1e6, -1e6, 1e9])
def test_a_late_start(live: Live, fmu: Fmu, start_time: float) -> None:
    """Nothing else of the model depends on time, so that all other values are as from 0."""
    early, late = live("stepComplete", start_time=0.0), live("stepComplete", start_time=start_time)
    for _ in range(20):
        assert early.step_on() == late.step_on() == Status.OK
    for name in fmu.variables:
        expected = (
            start_time + early.steps_done * STEP if name in ("time", "events.clock") else early.get(name)
        )
        assert late.get(name) == expected, name


@pytest.mark.parametrize("start_time", [1e16, -1e16, 1e300, -1.7e308])
def test_a_start_time_that_no_step_changes(make: Make, start_time: float) -> None:
    """A finite time, at which an experiment may start, but the step is lost in its rounding."""
    instance = make().initialize(start_time)
    for _ in range(2):
        instance.refuses(DO_STEP, start_time, STEP, 1, names=["communicationStepSize"], numbers=[STEP])
    assert instance.get("time") == start_time


def test_steps_to_the_stop_time(make: Make) -> None:
    """Section 2.1.6: a step past stopTime is an Error, except for rounding."""
    stop_time = 0.3
    instance = make().initialize(0.0, stop_time)
    begin, size = 0.0, 0.1
    for _ in range(2):
        assert instance.step(begin, size) == Status.OK
        begin += size
    instance.refuses(DO_STEP, begin, 0.11, 1, names=["stopTime"], numbers=[stop_time])
    # 0.1 + 0.1 + 0.1 is more than 0.3.
    assert begin + size > stop_time
    assert instance.step(begin, size) == Status.OK
    for beyond in (size, 1e-3):
        instance.refuses(DO_STEP, begin + size, beyond, 1, names=["stopTime"], numbers=[stop_time])


def test_a_step_past_the_stop_time(live: Live, unharmed: Check) -> None:
    """Afterwards a step to the stop time succeeds."""
    stop_time = 2.0 + 20 * STEP
    life = live("stepComplete", stop_time=stop_time)
    life.refuses(DO_STEP, life.time, 18 * STEP, 1, names=["stopTime"], numbers=[stop_time])
    unharmed(life)


# Values


@SETTABLE
def test_a_value_that_is_not_finite(live: Live, unharmed: Check, fmu: Fmu, state: str) -> None:
    """In every Real variable that can be set in the state; other elements of the call, before or after it,
    are not set."""
    life = live(state)
    in_state = {
        "instantiated": lambda v: True,
        "Initialization Mode": lambda v: v.causality == "input" or v.initial == "exact",
        "stepComplete": lambda v: v.causality == "input" or v.variability == "tunable",
    }[state]
    inputs = [v.name for v in settable(fmu, "Real", "input")]
    for variable in filter(in_state, settable(fmu, "Real")):
        before, after = [name for name in inputs if name != variable.name][:2]
        for value in NOT_FINITE:
            values = {before: 0.25, variable.name: value, after: 0.75}
            life.refuses(*life.settings(values), names=[variable.name], numbers=[value])
    unharmed(life)


@pytest.mark.parametrize("kind", ["Real", "Integer", "Enumeration"])
def test_the_range_of_a_parameter(live: Live, unharmed: Check, fmu: Fmu, kind: str) -> None:
    """Every parameter, start value and input that is not Real: min and max are accepted, the next number
    beyond is refused. Without bounds the largest numbers are accepted; items have the values from 1 on."""
    life = live()
    tried = 0
    for variable in settable(fmu, kind):
        if (kind, variable.causality) == ("Real", "input"):
            continue
        least, most = variable.min, variable.max
        if kind == "Enumeration":
            items = [int(item.value) for item in variable.declaredType.items]
            assert items == list(range(1, len(items) + 1))
            least, most = items[0], items[-1]
        before = life.getting(variable.name)[3][0]
        before = life.course.parameters.get(variable.name, variable.start) or before
        before = float(before) if kind == "Real" else int(before)
        for bound, away in [(least, -math.inf), (most, math.inf)]:
            largest = math.copysign(1.5e308 if kind == "Real" else 2**31 - 1, away)
            if bound is None:
                assert life.set({variable.name: largest}) == Status.OK
            elif kind == "Real":
                assert life.set({variable.name: float(bound)}) == Status.OK, life.messages
                for value in [math.nextafter(float(bound), away), largest]:
                    setting = life.settings({variable.name: value})
                    life.refuses(*setting, names=[variable.name], numbers=[value, float(bound)])
            else:
                assert life.set({variable.name: int(bound)}) == Status.OK, life.messages
                for value in [int(bound) + int(math.copysign(1, away)), int(largest)]:
                    setting = life.settings({variable.name: value})
                    life.refuses(*setting, names=[variable.name], numbers=[value])
            assert life.set({variable.name: before}) == Status.OK
            tried += 1
    assert tried >= 4
    unharmed(life)


@SETTABLE
def test_an_input_outside_its_range(live: Live, fmu: Fmu, state: str) -> None:
    """Sensors and solvers overshoot: the nearest bound is used, with one warning until the input has
    returned. Every Real input, at both bounds."""
    for variable in settable(fmu, "Real", "input"):
        name, least, most = variable.name, float(variable.min), float(variable.max)
        outside = [(v, least) for v in (math.nextafter(least, -math.inf), least - 1.0, -1e308)]
        outside += [(v, most) for v in (math.nextafter(most, math.inf), most + 1.0, 1e308)]
        for value, bound in outside:
            beyond, at = live(state), live(state)
            assert beyond.set({name: value}) == Status.WARNING
            assert beyond.set({name: value}) == Status.OK
            assert at.set({name: bound}) == Status.OK
            records = []
            for life in (beyond, at):
                if state == "instantiated":
                    life.enter(life.start_time)
                if state != "stepComplete":
                    life.ok("fmi2ExitInitializationMode")
                for _ in range(3):
                    assert life.step_on() == Status.OK
                records.append([r for r in life.values("in the end") if not r[0].startswith(f"{name},")])
            assert records[0] == records[1], name
            (warning,) = beyond.messages
            assert warning.status == Status.WARNING
            assert name in warning.text
            assert at.messages == []
            # It returns, and leaves its range again; a new instance warns as well.
            assert beyond.set({name: bound}) == Status.OK
            assert beyond.set({name: value}) == Status.WARNING
            assert beyond.call("fmi2Reset") == Status.OK
            assert beyond.set({name: value}) == Status.WARNING
            assert [name in message.text for message in beyond.messages] == [True] * 3
            beyond.free()
            at.free()


def test_an_input_outside_its_range_in_steps_that_are_rolled_back(make: Make) -> None:
    """PyFMI and CasADi take any status but OK for a failure. An importer that has saved a state tries values:
    each input is logged once, however often the importer goes back and tries again."""
    instance, at = make().initialize(), make().initialize()
    saved = instance.save()
    for value in [11.0, 12.0, 5.0, 11.0]:
        assert instance.set({"rate": value, "drive": 1e9}) == Status.OK
        assert instance.step(0.0, STEP) == Status.OK
        instance.ok("fmi2SetFMUstate", saved)
    first, second = instance.messages
    assert (first.status, "rate" in first.text) == (Status.WARNING, True)
    assert (second.status, "drive" in second.text) == (Status.WARNING, True)
    assert instance.set({"rate": 11.0}) == at.set({"rate": 10.0}) == Status.OK
    assert instance.run(3) == at.run(3)
    assert len(instance.messages) == 2
    instance.ok("fmi2Reset")
    assert instance.set({"rate": 11.0}) == Status.WARNING


def test_parameters_that_contradict_each_other(live: Live, unharmed: Check) -> None:
    """Masters set parameters one by one, so that the contradiction is reported at the end of initialization,
    and between steps by the next step. After a correction the instance continues."""
    for state, function in [("Initialization Mode", "fmi2ExitInitializationMode"), ("stepComplete", DO_STEP)]:
        life = live(state)
        arguments = [life.time, STEP, 1] if function == DO_STEP else []
        assert life.set({"settings.low": 60.0}) == Status.OK
        for _ in range(2):
            names = ["settings.low", "settings.high"]
            life.refuses(function, *arguments, names=names, numbers=[60.0, 50.0])
        assert life.set({"settings.low": -1.0}) == Status.OK
        unharmed(life)


def test_start_values_without_a_derivative(live: Live, like_a_new_one: Check) -> None:
    """Finite start values with an infinite derivative: reported at the end of initialization, and again when
    it is repeated. With other values it succeeds."""
    life = live()
    assert life.set({"motion.position": 1e200}) == Status.OK
    life.enter(life.start_time)
    for _ in range(2):
        names, numbers = ["der(motion.position)"], [-math.inf, life.start_time]
        life.refuses("fmi2ExitInitializationMode", names=names, numbers=numbers)
    life.ok("fmi2Reset")
    like_a_new_one(life)


# Value references


@pytest.mark.parametrize("direction", ["Get", "Set"])
@pytest.mark.parametrize("kind", ARRAYS)
def test_a_wrong_value_reference(live: Live, unharmed: Check, fmu: Fmu, direction: str, kind: str) -> None:
    """Section 2.1.2: a wrong value reference is an Error. Either it belongs to no variable, or to one of
    another type; the other elements are not read or set."""
    life = live("Initialization Mode")
    variables = fmu.variables.values()
    good = next(v.valueReference for v in variables if c_type_of(v) == kind and v.initial == "exact")
    wrong = [(r, str(r)) for r in (len(fmu.variables), 2**31, 2**32 - 1)]
    wrong += [(v.valueReference, v.name) for v in variables if c_type_of(v) != kind]
    for reference, named in wrong:
        values = ARRAYS[kind](*[b"text" if kind == "String" else 1] * 2)
        before = bytes(values)
        life.refuses(f"fmi2{direction}{kind}", references(good, reference), 2, values, names=[named])
        assert bytes(values) == before
    unharmed(life)


# Null pointers


def test_arrays_that_are_null(live: Live, unharmed: Check, fmu: Fmu) -> None:
    """Accepted with no elements, and an Error with one."""
    life = live("stepComplete")
    rate, output = fmu.references("rate"), fmu.references("output")
    one_of = {"Real": "rate", "Integer": "lift", "Boolean": "enabled", "String": "note"}
    calls: dict[str, list[Any]] = {
        f"fmi2{direction}{kind}": [fmu.references(name), 1, ARRAYS[kind](EMPTY[kind])]
        for kind, name in one_of.items()
        for direction in ("Get", "Set")
    }
    calls["fmi2SetDebugLogging"] = [0, 1, strings(b"logEvents")]
    calls[DERIVATIVES] = [rate, 1, integers(1), reals(1.0)]
    calls["fmi2GetRealOutputDerivatives"] = [output, 1, integers(1), reals(0.0)]
    calls["fmi2GetDirectionalDerivative"] = [output, 1, rate, 1, reals(1.0), reals(0.0)]
    assert len(calls) == 12
    for function, arguments in calls.items():
        life.ok(function, *(0 if isinstance(argument, int) else None for argument in arguments))
        types = FUNCTIONS[function][1][1:]
        for position, argument in enumerate(arguments):
            if isinstance(argument, int):
                continue
            assert types[position] not in (c_int, c_size_t)
            null = [*arguments[:position], None, *arguments[position + 1 :]]
            life.refuses(function, *null, names=["NULL"])
    unharmed(life)


def test_pointers_to_results_that_are_null(live: Live, unharmed: Check) -> None:
    """The status of a step, and states (section 2.1.8)."""
    life = live("stepComplete")
    calls = [
        *((f"fmi2Get{kind}Status", [2, None]) for kind in ("", "Real", "Integer", "String")),
        ("fmi2GetBooleanStatus", [3, None]),
        ("fmi2GetFMUstate", [None]),
        ("fmi2SetFMUstate", [None]),
    ]
    for function, arguments in calls:
        life.refuses(function, *arguments, names=["NULL"])
    unharmed(life)


def test_freeing_a_null_state_is_ignored(live: Live, unharmed: Check) -> None:
    """Section 2.1.8: "If a null pointer is provided, the call is ignored"."""
    life = live("stepComplete")
    life.ok("fmi2FreeFMUstate", None)
    state = c_void_p()
    life.ok("fmi2FreeFMUstate", byref(state))
    assert state.value is None
    unharmed(life)


def test_a_string_that_is_null(live: Live, unharmed: Check, fmu: Fmu) -> None:
    """A log category or a value; the other elements have no effect."""
    life = live("Initialization Mode")
    life.refuses("fmi2SetDebugLogging", 1, 2, strings(b"logEvents", None), names=["NULL"])
    vr = fmu.references("settings.label", "note")
    life.refuses("fmi2SetString", vr, 2, strings(b"other", None), names=["NULL"])
    unharmed(life)


def test_text_that_is_not_utf_8(live: Live, unharmed: Check) -> None:
    """Section 2.1.7 requires UTF-8."""
    life = live("Initialization Mode")
    life.refuses(*life.settings({"note": b"\xff\xfe"}), names=["UTF-8"])
    unharmed(life)


def test_texts(make: Make) -> None:
    """Strings are copied, and results stay valid until the next call (section 2.1.7)."""
    instance = make().initialize()
    text = "Prüfstand 増圧機 %s#1#".encode() * 1000
    values = strings(bytes(text))
    instance.ok("fmi2SetString", instance.fmu.references("note"), 1, values)
    values[0] = b"something else"
    assert instance.get("note") == text
    assert instance.get("text") == b"a <b> " + text


# Input derivatives


@SETTABLE
def test_an_input_derivative_that_is_refused(live: Live, unharmed: Check, fmu: Fmu, state: str) -> None:
    """Section 4.2.1: orders from 1 on, of Real inputs. Orders above 8 are not supported."""
    life = live(state)
    cases = [("rate", order, 1.0) for order in (0, -1, 9, 2**31 - 1, -(2**31))]
    cases += [("rate", 1, value) for value in NOT_FINITE]
    cases += [(v.name, 1, 0.5) for v in fmu.variables.values() if (v.causality, v.type) != ("input", "Real")]
    for name, order, value in cases:
        # A valid one before it is not set either.
        arguments = [fmu.references("rate", name), 2, integers(2, order), reals(3.0, value)]
        numbers = [] if math.isfinite(value) else [value]
        life.refuses(DERIVATIVES, *arguments, names=[name], numbers=numbers)
    for reference in (len(fmu.variables), 2**31, 2**32 - 1):
        life.refuses(DERIVATIVES, references(reference), 1, integers(1), reals(1.0), names=[str(reference)])
    unharmed(life)


@SETTABLE
def test_the_derivative_of_a_discrete_input(live: Live, unharmed: Check, fmu: Fmu, state: str) -> None:
    """Masters that extrapolate set them for all inputs: those of discrete inputs are ignored, with one
    warning."""
    life, without = live(state), live(state)
    assert life.set_derivative("pulse", 1, 0.0) == Status.OK
    assert life.set_derivative("pulse", 1, 7.0) == Status.WARNING
    assert life.set_derivative("pulse", 2, -7.0) == Status.OK
    (message,) = life.messages
    assert message.status == Status.WARNING
    assert "pulse" in message.text
    life.refuses(DERIVATIVES, fmu.references("pulse"), 1, integers(0), reals(1.0), names=["pulse"])
    assert differences(life.go_on()[:-1], without.go_on()[:-1]) == []


def test_input_derivatives_of_every_order(make: Make) -> None:
    """Section 4.2.1: derivatives make a Taylor series, of the orders 1 to 8, for one step."""
    for order in range(1, 9):
        instance = make().initialize()
        assert instance.set_derivative("rate", order, float(math.factorial(order))) == Status.OK
        assert instance.step(0.0, 1.0) == Status.OK
        # 1 + t^order at the midpoints of both halves.
        assert instance.get("tank.level") == 1.0 + (0.25**order + 0.75**order) / 2
        assert instance.step(1.0, 1.0) == Status.OK
        assert instance.get("tank.level") == 2.0 + (0.25**order + 0.75**order) / 2


def test_setting_an_input_clears_its_derivatives(make: Make) -> None:
    """In section 4.2.1 derivatives are set after the value."""
    instance = make().initialize()
    assert instance.set_derivative("rate", 1, 100.0) == Status.OK
    assert instance.set({"rate": 1.0}) == Status.OK
    assert instance.step(0.0, 1.0) == Status.OK
    assert instance.get("tank.level") == 1.0
