"""Model Exchange with an importer that goes to the limits of the rules (FMI 2.0.5, chapter 3): what is not
finite, time and state events, and what is read between them."""

from __future__ import annotations

import math
from collections.abc import Callable
from ctypes import byref
from typing import Any

import pytest
from fmpy.fmi2 import fmi2ModelExchange

from fmu.exporter.importer import STEP, EventInfo, Instance, Status, reals
from fmu.exporter.test_panics import NOT_FINITE
from fmu.master import Fmu

pytestmark = [pytest.mark.quick, pytest.mark.compiled]

Make = Callable[..., Instance]

VECTORS = {
    "Derivatives": "nx",
    "EventIndicators": "ni",
    "ContinuousStates": "nx",
    "NominalsOfContinuousStates": "nx",
}
"""What there are arrays of, and the argument with the number of elements."""


def initialized(make: Make, start_time: float = 0.0, logging_on: bool = False, **parameters: Any) -> Instance:
    """An instance in Event Mode after its initialization. `events__end=1.0` sets `events.end`."""
    instance = make(fmu_type=fmi2ModelExchange, logging_on=logging_on)
    assert instance.set({name.replace("__", "."): value for name, value in parameters.items()}) == Status.OK
    return instance.initialize(start_time)


def finish_event(instance: Instance) -> list[EventInfo]:
    """Iterates an event, and continues in Continuous-Time Mode."""
    infos = [instance.new_discrete_states()]
    while infos[-1].newDiscreteStatesNeeded:
        infos.append(instance.new_discrete_states())
    instance.ok("fmi2EnterContinuousTimeMode")
    return infos


def have_event(instance: Instance, time: float | None = None) -> list[EventInfo]:
    """An event, at a time."""
    if time is not None:
        instance.ok("fmi2SetTime", time)
    instance.ok("fmi2EnterEventMode")
    return finish_event(instance)


def running(make: Make, **arguments: Any) -> Instance:
    """An instance in Continuous-Time Mode."""
    instance = initialized(make, **arguments)
    finish_event(instance)
    return instance


def everything(instance: Instance) -> list[Any]:
    """All values and vectors."""
    return [*map(instance.get, instance.fmu.variables), *map(instance.vector, VECTORS)]


# Failing models


def arguments_of(function: str) -> list[Any]:
    """Valid arguments."""
    count = 3 if function == "fmi2GetEventIndicators" else 2
    vector = [reals(*[0.0] * count), count]
    if function in ("fmi2GetDerivatives", "fmi2GetEventIndicators", "fmi2GetContinuousStates"):
        return vector
    return [byref(EventInfo())] if function == "fmi2NewDiscreteStates" else []


def before_failure(make: Make, place: str, manner: str, function: str) -> Instance:
    """An instance that fails in a function."""
    if function == "fmi2ExitInitializationMode":
        instance = make(fmu_type=fmi2ModelExchange)
        instance.enter()
    else:
        # A tick is due.
        instance = initialized(make, events__period=0.25)
    return instance.choose(fault__place=place, fault__manner=manner)


@pytest.mark.parametrize("manner", NOT_FINITE)
def test_an_indicator_that_is_not_finite(make: Make, manner: str) -> None:
    """It has no sign: between events the solver is asked for a shorter step."""
    for logging_on in (False, True):
        instance = initialized(make, logging_on=logging_on).choose(
            fault__place="event_indicators", fault__manner=manner
        )
        instance.ok("fmi2EnterContinuousTimeMode")
        before = len(instance.messages)
        assert instance.call("fmi2GetEventIndicators", reals(0.0, 0.0, 0.0), 3) == Status.DISCARD
        # Section 2.1.3: a message in debug mode only.
        messages = [(m.status, m.text) for m in instance.messages[before:]]
        told = f"fmi2GetEventIndicators: the indicator full is {NOT_FINITE[manner]} at 0 s"
        assert messages == ([(Status.DISCARD, told)] if logging_on else [])


def test_a_next_event_that_is_no_time(make: Make) -> None:
    """Not-a-number is an Error, after which initialization can be repeated; infinity is never."""
    for function in ("fmi2ExitInitializationMode", "fmi2NewDiscreteStates"):
        instance = make(fmu_type=fmi2ModelExchange)
        instance.enter()
        if function == "fmi2NewDiscreteStates":
            instance.ok("fmi2ExitInitializationMode")
        instance.choose(fault__place="next_event", fault__manner="not_a_number")
        for _ in range(2):
            instance.refuses(function, *arguments_of(function), names=["event"], numbers=[math.nan, 0.0])
        instance.choose(fault__manner="infinity").ok(function, *arguments_of(function))
        assert instance.new_discrete_states().nextEventTimeDefined == 0


@pytest.mark.parametrize("logging_on", [False, True])
def test_states_without_derivatives(make: Make, logging_on: bool) -> None:
    """A solver that tries them is asked for a shorter step; with other states it continues."""
    instance, other = running(make, logging_on=logging_on), running(make)
    before = len(instance.messages)
    instance.set_states(0.0, 1e200)
    assert instance.call("fmi2GetDerivatives", reals(0.0, 0.0), 2) == Status.DISCARD
    assert instance.call(*instance.getting("der(motion.position)")) == Status.DISCARD
    texts = [
        "fmi2GetDerivatives: the derivative of motion.position is -inf at 0 s",
        "fmi2GetReal: the variable der(motion.position) is -inf",
    ]
    messages = [(m.status, m.text) for m in instance.messages[before:]]
    assert messages == ([(Status.DISCARD, text) for text in texts] if logging_on else [])
    # An event there has no result.
    instance.ok("fmi2EnterEventMode")
    instance.refuses(
        *instance.getting("der(motion.position)"), names=["der(motion.position)"], numbers=[-math.inf]
    )
    instance.ok("fmi2EnterContinuousTimeMode")
    for each in (instance, other):
        each.set_states(0.0, 0.5)
    assert everything(instance) == everything(other)


# What is read


def test_values_follow_what_is_set(make: Make) -> None:
    """fmi2SetTime, fmi2SetContinuousStates and fmi2SetXXX invalidate what was computed (section 3.2.1)."""
    instance = running(make)
    assert everything(instance)
    instance.ok("fmi2SetTime", 0.5)
    assert (instance.get("time"), instance.get("events.clock")) == (0.5, 0.5)
    instance.set_states(2.0, 0.5)
    assert instance.get("position") == 0.5
    assert instance.get("output") == 3.0
    assert instance.vector("Derivatives") == [1.0, -0.25]
    assert instance.set({"rate": 3.0, "drive": 1.0}) == Status.OK
    assert instance.vector("Derivatives") == [3.0, 0.75]
    assert instance.get("output") == 5.0
    # Section 3.2.3, note 5: a state as a variable.
    assert instance.set({"motion.position": -1.0}) == Status.OK
    assert instance.vector("ContinuousStates") == [2.0, -1.0]
    assert instance.vector("Derivatives") == [3.0, 0.0]
    assert [indicator > 0 for indicator in instance.vector("EventIndicators")] == [True, False, True]
    # In the state `terminated`, too, where the solution at the end is read.
    instance.set_states(7.0, 1.0)
    instance.ok("fmi2Terminate")
    assert (instance.get("output"), instance.get("position")) == (10.0, 1.0)
    assert instance.vector("Derivatives") == [3.0, 0.0]


def test_a_solver_tries_states_beyond_their_bounds(make: Make, fmu: Fmu) -> None:
    """By fmi2SetReal as by fmi2SetContinuousStates."""
    instance = running(make)
    beyond = 2.0 * float(fmu.variables["tank.level"].max)
    assert instance.set({"tank.level": beyond}) == Status.OK
    assert instance.vector("ContinuousStates") == [beyond, 0.0]
    instance.set_states(-beyond, 0.0)
    assert instance.get("tank.level") == -beyond


def test_a_solver_tries_inputs_beyond_their_bounds(make: Make) -> None:
    """CasADi's differences around an input that is at its bound: a warning would be a failed evaluation."""
    instance = running(make)
    assert instance.set({"rate": 10.0}) == Status.OK
    at_bound = instance.vector("Derivatives")
    for value in [10.001, 9.999, 10.001]:
        assert instance.set({"rate": value}) == Status.OK
        assert (instance.vector("Derivatives") == at_bound) == (value > 10.0)
    assert instance.set({"drive": -1e9}) == Status.OK
    rate, drive = instance.messages
    assert ("rate" in rate.text, rate.status) == (True, Status.WARNING)
    assert ("drive" in drive.text, drive.status) == (True, Status.WARNING)


def test_an_importer_sets_what_it_cannot_change(make: Make) -> None:
    """FMPy sets discrete inputs between events, CasADi tunable parameters: their own values are no change."""
    instance = running(make)
    others = {"pulse": 1.0, "settings.low": -2.0, "settings.doubled": 1, "settings.label": b"b"}
    assert instance.set({name: instance.get(name) for name in others}) == Status.OK
    for name, value in others.items():
        assert instance.set({name: value}) == Status.ERROR
        assert name in instance.messages[-1].text
        assert "Continuous-Time Mode" in instance.messages[-1].text


def test_the_initial_event_mode(make: Make) -> None:
    """Section 3.1: what is read there is right before fmi2NewDiscreteStates, and inputs can still be set."""
    instance = initialized(make, motion__start=2, motion__position=0.5, tank__level=2.0)
    assert instance.vector("ContinuousStates") == [2.0, 0.5]
    assert instance.vector("NominalsOfContinuousStates") == [1.0, 1.0]
    assert instance.vector("Derivatives") == [1.0, -0.25]
    assert instance.get("tank.full") == 1
    assert instance.set({"pulse": 1.0, "gear": 2, "drive": 1.0}) == Status.OK
    assert instance.vector("Derivatives") == [2.0, -1.25]
    assert finish_event(instance)[0].valuesOfContinuousStatesChanged == 0
    assert instance.vector("Derivatives") == [2.0, -1.25]


def test_a_solver_goes_back(make: Make) -> None:
    """Probes ahead leave nothing behind."""
    instance, other = (running(make, events__period=0.25, events__wall=0.5) for _ in range(2))
    for time in (0.125, 10.0, 0.0625):
        instance.ok("fmi2SetTime", time)
        instance.set_states(-time, 100.0 * time)
        for quantity in VECTORS:
            instance.vector(quantity)
    for each in (instance, other):
        each.ok("fmi2SetTime", 0.03125)
        each.set_states(0.5, 0.25)
    assert everything(instance) == everything(other)
    assert instance.snapshot() == other.snapshot()


# Time events


@pytest.mark.parametrize("start_time", [0.0, -7.25, 1e5])
def test_ticks(make: Make, start_time: float) -> None:
    """The first is due at the start, in the initial Event Mode; each announces the next, and does so again at
    every event in between."""
    instance = initialized(make, start_time, events__period=0.25)
    for tick in range(20):
        due = start_time + tick * 0.25
        infos = finish_event(instance) if tick == 0 else have_event(instance, due)
        assert instance.get("events.ticks") == tick + 1
        assert instance.get("events.last") == due
        for time in (due, due + 0.0625, due + 0.125):
            if time > due:
                infos = have_event(instance, time)
            assert len(infos) == 1
            assert infos[0].nextEventTimeDefined
            assert infos[0].nextEventTime == due + 0.25
    assert instance.get("events.had") == 20


def test_an_event_without_a_cause_changes_nothing(make: Make) -> None:
    instance = running(make, events__period=0.25, events__wall=0.5)
    for time, states in [(0.0625, [0.25, 0.125]), (0.125, [0.5, 0.25]), (0.125, [0.5, 0.25])]:
        instance.ok("fmi2SetTime", time)
        instance.set_states(*states)
        before = everything(instance)
        (info,) = have_event(instance)
        assert [getattr(info, name) for name, _ in EventInfo._fields_] == [0, 0, 0, 0, 1, 0.25]
        assert everything(instance) == before
    assert instance.get("events.had") == 1


@pytest.mark.parametrize("end", [0.0, 1e3])
def test_a_tick_comes_a_little_early(make: Make, end: float) -> None:
    """Importers' times are rounded, by a few units in the last place. The model gets the time that it has
    announced, once, though it is asked for the next event at an earlier one: here also for the end, which it
    computes from the time alone."""
    parameters = {"events__period": 0.25, "events__echoes": 2, "events__end": end}
    instance = running(make, start_time=1e3 - 0.25, **parameters)
    assert instance.get("events.ticks") == 1
    instance.ok("fmi2SetTime", 1e3 - 20 * math.ulp(1e3))
    instance.ok("fmi2EnterEventMode")
    infos = [instance.new_discrete_states() for _ in range(4)]
    assert [info.newDiscreteStatesNeeded for info in infos] == [1, 1, 0, 0]
    assert {info.nextEventTime for info in infos} == {1e3 + 0.25}
    assert [info.terminateSimulation for info in infos] == [int(end > 0)] * 4
    assert (instance.get("events.ticks"), instance.get("events.had")) == (2, 6)
    assert instance.get("events.last") == 1e3
    # Earlier than by rounding, it is not due.
    instance = running(make, start_time=1e3 - 0.25, **parameters)
    assert have_event(instance, 1e3 - 200 * math.ulp(1e3))[0].nextEventTime == 1e3
    assert instance.get("events.ticks") == 1


def test_an_event_long_before_the_last_one(make: Make) -> None:
    """Of an importer that goes back in time: the model is asked for what is next after it."""
    instance = running(make, events__period=0.25, events__end=0.2)
    have_event(instance, 0.25)
    assert have_event(instance, 0.125)[-1].nextEventTime == 0.2


def test_short_ticks_late_in_time(make: Make) -> None:
    """At 1e6 s, a millionth of a second is 8590 units in the last place: it is told from the next one."""
    start_time, period = 1e6, 1e-6
    instance = running(make, start_time=start_time, events__period=period)
    for tick in range(1, 20):
        due = start_time + tick * period
        assert have_event(instance, due - period / 2)[0].nextEventTime == due
        assert instance.get("events.ticks") == tick
        (info,) = have_event(instance, due)
        assert info.nextEventTime == start_time + (tick + 1) * period
        assert (instance.get("events.ticks"), instance.get("events.last")) == (tick + 1, due)


def test_a_tick_comes_late(make: Make) -> None:
    """An importer that goes past events has all of them at once, each with its time."""
    instance = running(make, events__period=0.25)
    infos = have_event(instance, 1.125)
    assert [(info.newDiscreteStatesNeeded, info.nextEventTime) for info in infos] == [
        (1, 0.5),
        (1, 0.75),
        (1, 1.0),
        (0, 1.25),
    ]
    assert (instance.get("events.ticks"), instance.get("events.last")) == (5, 1.0)


def test_events_that_hardly_leave_their_time(make: Make) -> None:
    """An importer would handle them for hours: one warning names the indicator that has them."""
    period = 1e-13
    instance = initialized(make, 1.0, events__period=period)
    info, warned = EventInfo(), []
    for count in range(3000):
        status = instance.call("fmi2NewDiscreteStates", byref(info))
        assert status in (Status.OK, Status.WARNING)
        warned += [count] * (status == Status.WARNING)
        instance.ok("fmi2EnterContinuousTimeMode")
        instance.ok("fmi2SetTime", info.nextEventTime)
        instance.ok("fmi2EnterEventMode")
    # The first one is at the start; each after it is the next in the row.
    assert warned == [1000]
    (message,) = instance.messages
    assert "1000 events in a row" in message.text
    assert "time events" in message.text


def test_ticks_that_are_changed(make: Make) -> None:
    """A tunable parameter that is set at an event changes the announcement."""
    instance = running(make, events__period=0.25)
    instance.ok("fmi2SetTime", 0.125)
    instance.ok("fmi2EnterEventMode")
    assert instance.set({"events.period": 0.5}) == Status.OK
    assert instance.new_discrete_states().nextEventTime == 0.5
    assert instance.set({"events.period": 0.0}) == Status.OK
    assert instance.new_discrete_states().nextEventTimeDefined == 0
    assert instance.set({"settings.low": 5.0}) == Status.OK
    for function in ("fmi2NewDiscreteStates", "fmi2EnterContinuousTimeMode"):
        names = ["settings.low", "settings.high"]
        instance.refuses(function, *arguments_of(function), names=names, numbers=[5.0, 1.0])
    assert instance.set({"settings.low": 0.0}) == Status.OK
    finish_event(instance)


# State events

ULP = math.ulp(1.0)


@pytest.mark.parametrize("start", [0.5, 1.5])
@pytest.mark.parametrize("off", [0.0, ULP, -ULP, 1e-13, -1e-13, 1e-12, -1e-12, 2e-12, -2e-12, 1e-9, -1e-9])
def test_at_the_crossing(make: Make, start: float, off: float) -> None:
    """Importers enter Event Mode at, or a little before or after, z = 0. z is never 0 after an event; the
    branch is the one of its sign, changes at the event and not before, and the next event at the same place
    has no cause."""
    instance = running(make, tank__level=start)
    was_full = start > 1.0
    assert instance.get("tank.full") == was_full
    instance.set_states(1.0 + off, 0.0)
    is_full = 1.0 + off > 1.0
    seen = instance.vector("EventIndicators")[0]
    assert seen != 0
    if abs(off) >= 1e-9:
        assert (seen > 0) == is_full
    # Between events relations are frozen.
    assert instance.get("tank.full") == was_full
    infos = have_event(instance)
    assert instance.get("tank.full") == is_full
    assert instance.get("events.had") == int(is_full != was_full)
    assert [info.valuesOfContinuousStatesChanged for info in infos] == [0]
    for _ in range(3):
        left = instance.vector("EventIndicators")[0]
        assert left != 0
        assert (left > 0) == is_full
        have_event(instance)
    assert instance.get("events.had") == int(is_full != was_full)


def test_no_chatter(make: Make) -> None:
    """An importer that finds crossings by bisection, to the last bit of the time: one event for each, of the
    level 1 + sin(t), and a time of it after the last one."""
    instance = running(make)
    crossings, time = [], 0.0

    def is_positive(at: float) -> bool:
        instance.ok("fmi2SetTime", at)
        instance.set_states(1.0 + math.sin(at), 0.0)
        indicator = instance.vector("EventIndicators")[0]
        assert indicator != 0
        return indicator > 0

    while time < 20.0:
        side, end = is_positive(time), time + 0.25
        if is_positive(end) != side:
            before, after = time, end
            while before < (middle := (before + after) / 2) < after:
                before, after = (before, middle) if is_positive(middle) != side else (middle, after)
            assert is_positive(after) != side
            had = instance.get("events.had")
            have_event(instance)
            assert instance.get("events.had") == had + 1
            crossings.append(after)
            end = after
        time = end
    # Those at the start and at each multiple of pi; z is shifted by 1e-12 at slopes of 1.
    assert crossings == pytest.approx([k * math.pi for k in range(7)], abs=2e-12)
    assert instance.get("events.had") == 7


def test_which_events_change_states(make: Make) -> None:
    """A tick adds the lift to the level; at the wall the motion begins again, and has a second event at once,
    as the indicator returns. The last call says it of the whole event, as importers like the standard's
    example (section 3.2.4) look at that alone. Where no state changes, none is announced, or importers would
    loop."""
    instance = initialized(make, events__period=0.25, events__wall=0.5)
    assert [info.valuesOfContinuousStatesChanged for info in finish_event(instance)] == [0]
    instance.ok("fmi2SetTime", 0.25)
    instance.ok("fmi2EnterEventMode")
    assert instance.set({"lift": 2}) == Status.OK
    assert [info.valuesOfContinuousStatesChanged for info in finish_event(instance)] == [1, 1]
    assert instance.vector("ContinuousStates") == [2.0, 0.0]
    # The level passed settings.high, too.
    assert instance.get("tank.full") == 1
    instance.set_states(2.0, 0.75)
    instance.ok("fmi2EnterEventMode")
    infos = [instance.new_discrete_states() for _ in range(3)]
    assert [info.newDiscreteStatesNeeded for info in infos] == [1, 0, 0]
    assert [info.valuesOfContinuousStatesChanged for info in infos] == [1, 1, 0]
    instance.ok("fmi2EnterContinuousTimeMode")
    assert instance.vector("ContinuousStates") == [2.0, 0.0]
    assert instance.get("events.hits") == 1
    assert [info.valuesOfContinuousStatesChanged for info in have_event(instance)] == [0]
    # An event that an importer leaves too early leaves nothing to the next one.
    instance.set_states(2.0, 0.75)
    instance.ok("fmi2EnterEventMode")
    assert instance.new_discrete_states().newDiscreteStatesNeeded
    instance.ok("fmi2EnterContinuousTimeMode")
    assert [info.valuesOfContinuousStatesChanged for info in have_event(instance)] == [0]


# Event iteration and the end


def test_an_event_that_makes_others(make: Make) -> None:
    for echoes in (0, 1, 2, 500):
        instance = initialized(make, events__period=0.25, events__echoes=echoes)
        infos = finish_event(instance)
        assert [info.newDiscreteStatesNeeded for info in infos] == [1] * echoes + [0]
        assert {info.nextEventTime for info in infos} == {0.25}
        assert (instance.get("events.had"), instance.get("events.ticks")) == (echoes + 1, 1)


def test_an_event_that_makes_others_tells_its_time_once(make: Make) -> None:
    """And again after it is taken back."""
    instance = initialized(make, events__period=0.25, events__echoes=3, note=b"told", logging_on=True)

    def told() -> list[str]:
        return [message.text for message in instance.messages if message.text.endswith("told")]

    finish_event(instance)
    assert told() == ["at 0 s: told"]
    state = instance.save()
    for count in (1, 2):
        have_event(instance, 0.25)
        assert told()[1:] == ["at 0.25 s: told"] * count
        instance.ok("fmi2SetFMUstate", state)


def test_an_event_that_does_not_end(make: Make) -> None:
    """An Error that names the indicator, instead of an importer that waits for ever."""
    instance = initialized(make, events__period=0.25, events__echoes=-1)
    for _ in range(1000):
        assert instance.new_discrete_states().newDiscreteStatesNeeded
    text = instance.refuses("fmi2NewDiscreteStates", byref(EventInfo()), names=["echo"], numbers=[1000, 0.0])
    assert "full" not in text
    instance.refuses("fmi2NewDiscreteStates", byref(EventInfo()), names=["error"])
    # The limit is one for each event.
    instance = initialized(make, events__period=0.25, events__echoes=600)
    for tick in range(4):
        assert len(finish_event(instance) if tick == 0 else have_event(instance, tick * 0.25)) == 601


@pytest.mark.parametrize("logging_on", [False, True])
def test_the_model_asks_for_the_end(make: Make, logging_on: bool) -> None:
    """Section 3.2.2: terminateSimulation, and a message that explains it; also from a restored state."""
    instance = running(make, events__end=0.5, logging_on=logging_on)
    before = len(instance.messages)
    assert have_event(instance, 0.25)[0].nextEventTime == 0.5
    (info,) = have_event(instance, 0.5)
    assert (info.terminateSimulation, info.nextEventTimeDefined) == (1, 0)
    texts = [message.text for message in instance.messages[before:]]
    told = "fmi2NewDiscreteStates: the model requests the end of the simulation at 0.5 s"
    assert texts == ([told] if logging_on else [])
    other = make(fmu_type=fmi2ModelExchange)
    other.restore(instance.snapshot())
    for each in (instance, other):
        each.ok("fmi2EnterEventMode")
        assert each.new_discrete_states().terminateSimulation
        each.ok("fmi2Terminate")
        assert each.get("time") == 0.5


@pytest.mark.parametrize("manner", NOT_FINITE)
def test_an_end_at_no_time(make: Make, manner: str) -> None:
    """An Error wherever the model asks for it; initialization can be repeated."""
    text = f"the model requests the end at {NOT_FINITE[manner]} s"
    instance = before_failure(make, "end", manner, "fmi2ExitInitializationMode")
    assert instance.refuses("fmi2ExitInitializationMode") == text
    instance.choose(fault__place="nowhere").ok("fmi2ExitInitializationMode")
    assert instance.new_discrete_states().terminateSimulation == 0
    instance = before_failure(make, "end", manner, "fmi2NewDiscreteStates")
    assert instance.refuses("fmi2NewDiscreteStates", byref(EventInfo())) == text
    instance.refuses("fmi2EnterContinuousTimeMode", names=["error"])
    instance = make().initialize().choose(fault__place="end", fault__manner=manner)
    assert instance.refuses("fmi2DoStep", 0.0, STEP, 1) == text
    instance.refuses("fmi2DoStep", 0.0, STEP, 1, names=["error"])


def test_a_step_to_the_end_of_the_model(make: Make) -> None:
    """Section 4.2.1, co-simulation: fmi2Discard, the time that was reached, and that the slave ends the
    simulation."""
    instance = make(logging_on=True)
    assert instance.set({"events.end": 1.5 * STEP}) == Status.OK
    instance.initialize()
    assert instance.step(0.0, STEP) == Status.OK
    assert instance.step(STEP, STEP) == Status.DISCARD
    told = f"fmi2DoStep: the model requests the end of the simulation at {1.5 * STEP} s"
    assert (instance.messages[-1].status, instance.messages[-1].text) == (Status.DISCARD, told)
    assert instance.end() == (1.5 * STEP, True)


@pytest.mark.parametrize("late", [-1e-10, 0.0, 1e-10])
@pytest.mark.parametrize("begin", [STEP, 0.0])
def test_an_end_that_is_off_by_rounding(make: Make, begin: float, late: float) -> None:
    """The time that was reached is not before the step's start and not after its end."""
    instance = make().initialize()
    assert instance.step(0.0, STEP) == Status.OK
    assert instance.set({"events.end": begin + STEP + late}) == Status.OK
    assert instance.step(STEP, STEP) == Status.DISCARD
    assert instance.end()[0] == min(max(begin + STEP + late, STEP), 2 * STEP)


def test_an_end_before_the_first_step(make: Make) -> None:
    """The model asks for it in initialization."""
    instance = make()
    assert instance.set({"events.end": 0.5}) == Status.OK
    instance.initialize(start_time=1.0)
    assert instance.step(1.0, STEP) == Status.DISCARD
    assert instance.end() == (1.0, True)


def test_saved_within_an_event(make: Make) -> None:
    """Between two iterations, the first of which has changed a state: from the handle and from bytes the same
    ones follow, and the last one says so."""
    instance = running(make, events__period=0.25, events__echoes=3)
    instance.ok("fmi2SetTime", 0.25)
    instance.ok("fmi2EnterEventMode")
    assert instance.set({"lift": 2}) == Status.OK
    instance.new_discrete_states()
    state = instance.save()
    data = instance.serialize(state)
    ends = []
    for restore in (None, state, data):
        if restore is state:
            instance.ok("fmi2SetFMUstate", state)
        elif restore is data:
            instance.restore(data)
        infos = finish_event(instance)
        assert [info.newDiscreteStatesNeeded for info in infos] == [1, 1, 0]
        assert [info.valuesOfContinuousStatesChanged for info in infos] == [1, 1, 1]
        ends.append((instance.snapshot(), everything(instance)))
    assert ends[0] == ends[1] == ends[2]
