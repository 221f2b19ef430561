"""Arguments at the limits of what is allowed, in FMI 2.0: what follows from them.

That invalid ones are refused, and change nothing, is tested in Rust (tests/importer).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from ctypes import byref, c_int
from typing import Any

import pytest

from fmu.exporter.importer import STEP, Instance, Status, integers, numbers_in, reals, strings
from fmu.master import Fmu

pytestmark = [pytest.mark.quick, pytest.mark.compiled]

Make = Callable[..., Instance]

SET_UP = "fmi2SetupExperiment"
DO_STEP = "fmi2DoStep"
DERIVATIVES = "fmi2SetRealInputDerivatives"


# Steps and times


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


@pytest.mark.parametrize("stop_time", [4.999, -1.0])
def test_a_stop_time_before_the_start_time(make: Make, stop_time: float) -> None:
    """Section 2.1.6. An earlier setup stays valid."""
    instance = make()
    instance.set_up(5.0, 6.0)
    before = instance.snapshot()
    instance.refuses(SET_UP, 0, 0.0, 5.0, 1, stop_time, names=["stopTime"], numbers=[stop_time, 5.0])
    assert instance.snapshot() == before


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
def test_a_tolerance_that_is_not_above_zero(make: Make, tolerance: float) -> None:
    """Some masters pass 0 if their users give none. It is ignored, with a warning."""
    instance, without = make(), make()
    assert instance.call(SET_UP, 1, tolerance, 0.0, 0, 0.0) == Status.WARNING
    (message,) = instance.messages
    assert message.status == Status.WARNING
    assert SET_UP in message.text
    assert tolerance in numbers_in(message.text)
    without.set_up()
    assert instance.snapshot() == without.snapshot()


def test_an_experiment_may_be_set_up_again(make: Make) -> None:
    """Section 2.1.6: "at least once"; the last one is valid."""
    instance = make()
    instance.set_up(5.0, 6.0)
    instance.initialize(2.0)
    assert instance.get("time") == 2.0
    assert instance.step(2.0, 10.0) == Status.OK


@pytest.mark.parametrize("start_time", [1e6, -1e6, 1e9])
def test_a_late_start(make: Make, fmu: Fmu, start_time: float) -> None:
    """Nothing else of the model depends on time, so that all other values are as from 0."""
    early, late = make().initialize(), make().initialize(start_time)
    for index in range(20):
        assert early.step(index * STEP, STEP) == late.step(start_time + index * STEP, STEP) == Status.OK
    for name in fmu.variables:
        expected = start_time + 20 * STEP if name in ("time", "events.clock") else early.get(name)
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


def test_the_status_of_the_last_step(make: Make) -> None:
    """Section 4.2.3: the current time, and that the slave does not end the simulation."""
    instance = make().initialize(2.0)
    for index in range(2):
        time = 2.0 + index * STEP
        assert instance.end() == (time, False)
        assert instance.step(time, STEP) == Status.OK
    # The memory for a status may hold any number: it is not read, and not written when discarded.
    status = c_int(77)
    assert instance.call("fmi2GetStatus", 0, byref(status)) == Status.DISCARD
    assert status.value == 77


# Values


def test_the_model_has_one_of_everything(fmu: Fmu) -> None:
    """So that tests of all variables test each kind."""
    types = {"Real", "Integer", "Boolean", "String", "Enumeration"}
    for causality in ("input", "output", "parameter"):
        assert {fmu.variables[name].type for name in fmu.named(causality)} == types, causality
    assert {(v.causality, v.variability) for v in fmu.variables.values()} == {
        ("independent", "continuous"),
        ("parameter", "fixed"),
        ("parameter", "tunable"),
        ("calculatedParameter", "fixed"),
        *(((c, v)) for c in ("input", "output", "local") for v in ("discrete", "continuous")),
    }
    assert {v.initial for v in fmu.variables.values()} >= {"exact", "approx", "calculated"}


@pytest.mark.parametrize("name", ["rate", "drive"])
def test_an_input_outside_its_range(make: Make, fmu: Fmu, name: str) -> None:
    """Sensors and solvers overshoot: the nearest bound is used, with one warning until the input has
    returned."""
    least, most = float(fmu.variables[name].min), float(fmu.variables[name].max)
    outside = [(v, least) for v in (math.nextafter(least, -math.inf), least - 1.0, -1e308)]
    outside += [(v, most) for v in (math.nextafter(most, math.inf), most + 1.0, 1e308)]
    for value, bound in outside:
        beyond, at = make(), make()
        assert beyond.set({name: value}) == Status.WARNING
        assert beyond.set({name: value}) == Status.OK
        assert at.set({name: bound}) == Status.OK
        assert beyond.initialize().run(3) == at.initialize().run(3)
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


@pytest.mark.parametrize("state", ["Initialization Mode", "stepComplete"])
def test_parameters_that_contradict_each_other(make: Make, state: str) -> None:
    """Masters set parameters one by one, so that the contradiction is reported at the end of initialization,
    and between steps by the next step. After a correction the instance continues."""
    instance = make()
    instance.enter()
    call: list[Any] = ["fmi2ExitInitializationMode"]
    if state == "stepComplete":
        instance.ok(*call)
        call = [DO_STEP, 0.0, STEP, 1]
    assert instance.set({"settings.low": 60.0}) == Status.OK
    for _ in range(2):
        instance.refuses(*call, names=["settings.low", "settings.high"], numbers=[60.0, 1.0])
    assert instance.set({"settings.low": -1.0}) == Status.OK
    instance.ok(*call)


def test_start_values_without_a_derivative(make: Make) -> None:
    """Finite start values with an infinite derivative: reported at the end of initialization, and again when
    it is repeated."""
    instance = make().choose(motion__start="given")
    assert instance.set({"motion.position": 1e200}) == Status.OK
    instance.enter(2.0)
    for _ in range(2):
        names, numbers = ["der(motion.position)"], [-math.inf, 2.0]
        instance.refuses("fmi2ExitInitializationMode", names=names, numbers=numbers)
    instance.ok("fmi2Reset")
    instance.initialize()


@pytest.mark.parametrize(("start", "expected"), [("given", 0.75), ("at_rest", 0.0)])
def test_start_values_of_states(make: Make, start: str, expected: float) -> None:
    """Section 4.2.4, note 1, `initial="approx"`: the start value is a guess, which the initialization may
    use. If it does not, there is one warning, which is not repeated by another instance that goes on from
    there."""
    instance, other = make().choose(motion__start=start), make()
    assert instance.set({"motion.position": 0.75, "tank.level": 0.5}) == Status.OK
    instance.enter()
    warned = [] if start == "given" else ["at 0 s: the start value of motion.position is not used"]
    instance.call(*instance.getting("motion.position"))
    other.restore(instance.snapshot())
    for each in (instance, other):
        for rate in (1.0, 2.0):
            assert each.set({"rate": rate}) == Status.OK
            assert each.get("motion.position") == expected
        assert each.get("tank.level") == 0.5
    assert [message.text for message in instance.messages] == warned
    assert other.messages == []


def test_warnings_of_initialization_do_not_accumulate(make: Make) -> None:
    """An importer that tries thousands of values gets a warning for each; one that alternates between two,
    once."""
    instance = make()
    instance.enter()

    def initialized(number: int) -> Status:
        assert instance.set({"note": b"warning %4d" % number}) == Status.OK
        return instance.call(*instance.getting("output"))

    assert [initialized(number) for number in range(100)] == [Status.WARNING] * 100
    before = len(instance.snapshot())
    assert [initialized(number) for number in range(100, 2000)] == [Status.WARNING] * 1900
    assert len(instance.snapshot()) == before
    assert [initialized(number) for number in [1997, 1998, 1999] * 3] == [Status.OK] * 9
    assert len(instance.messages) == 2000


def test_white_space_is_what_was_declared(make: Make, fmu: Fmu) -> None:
    """In attributes of XML, by the numbers of its characters."""
    variables = {variable.name: variable for variable in fmu.description.modelVariables}
    assert variables["text"].description == "label and note,\r\n\tin this order"
    assert variables["settings.label"].start == "a\t<b>"
    assert make().initialize().get("settings.label") == b"a\t<b>"


def test_texts(make: Make) -> None:
    """Strings are copied, and results stay valid until the next call (section 2.1.7)."""
    instance = make().initialize()
    text = "Prüfstand 増圧機 %s#1#".encode() * 1000
    values = strings(bytes(text))
    instance.ok("fmi2SetString", instance.fmu.references("note"), 1, values)
    values[0] = b"something else"
    assert instance.get("note") == text
    assert instance.get("text") == b"a\t<b> " + text


# Input derivatives


def test_an_input_derivative_that_is_refused(make: Make, fmu: Fmu) -> None:
    """Section 4.2.1: orders from 1 on, of Real inputs. Orders above 8 are not supported."""
    instance = make().initialize()
    before = instance.snapshot()
    cases = [("rate", order) for order in (0, -1, 9, 2**31 - 1, -(2**31))]
    others = [v.name for v in fmu.variables.values() if v.type == "Real" and v.causality != "input"]
    cases += [(name, 1) for name in others]
    for name, order in cases:
        # A valid one before it is not set either.
        arguments = [fmu.references("rate", name), 2, integers(2, order), reals(3.0, 1.0)]
        instance.refuses(DERIVATIVES, *arguments, names=[name])
    assert instance.snapshot() == before


def test_the_derivative_of_a_discrete_input(make: Make, fmu: Fmu) -> None:
    """Masters that extrapolate set them for all inputs: those of discrete inputs are ignored, with one
    warning."""
    instance, without = make().initialize(), make().initialize()
    assert instance.set_derivative("pulse", 1, 0.0) == Status.OK
    assert instance.set_derivative("pulse", 1, 7.0) == Status.WARNING
    assert instance.set_derivative("pulse", 2, -7.0) == Status.OK
    (message,) = instance.messages
    assert message.status == Status.WARNING
    assert "pulse" in message.text
    instance.refuses(DERIVATIVES, fmu.references("pulse"), 1, integers(0), reals(1.0), names=["pulse"])
    assert instance.run(3) == without.run(3)


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


def test_an_input_reads_as_it_was_set(make: Make) -> None:
    """An importer gets the value that it has set, although the model computes with another: the nearest
    bound, and after a step the end of the input's Taylor series. Setting any input goes back to the values as
    set, from which the next step begins."""
    instance = make().initialize()
    assert instance.set({"rate": 12.0, "drive": 0.5}) == Status.WARNING
    assert [instance.get("rate"), instance.get("drive"), instance.get("output")] == [12.0, 0.5, 10.0]
    assert instance.set({"rate": 8.0}) == Status.OK
    assert instance.set_derivative("rate", 1, -4.0) == Status.OK
    assert instance.step(0.0, 1.0) == Status.OK
    level = instance.get("tank.level")
    assert level == 6.0
    assert [instance.get("rate"), instance.get("output")] == [8.0, level + 4.0]
    saved = instance.save()
    for _ in range(2):
        assert instance.set({"drive": 0.25}) == Status.OK
        assert [instance.get("rate"), instance.get("output")] == [8.0, level + 8.0]
        assert instance.step(1.0, 1.0) == Status.OK
        assert instance.get("tank.level") == level + 8.0
        instance.ok("fmi2SetFMUstate", saved)
        assert [instance.get("rate"), instance.get("output")] == [8.0, level + 4.0]


def test_setting_an_input_clears_its_derivatives(make: Make) -> None:
    """In section 4.2.1 derivatives are set after the value."""
    instance = make().initialize()
    assert instance.set_derivative("rate", 1, 100.0) == Status.OK
    assert instance.set({"rate": 1.0}) == Status.OK
    assert instance.step(0.0, 1.0) == Status.OK
    assert instance.get("tank.level") == 1.0
