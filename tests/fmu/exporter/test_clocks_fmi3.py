"""Clocks of each kind (FMI 3.0.2, sections 2.2.8, 2.3.5 and 5.2) in Co-Simulation with Event Mode, Model
Exchange and Scheduled Execution."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from ctypes import (
    addressof,
    c_bool,
    c_double,
    c_int,
    c_size_t,
    c_uint8,
    c_uint32,
    c_uint64,
    c_void_p,
)
from typing import Any

import pytest
from fmpy.fmi3 import fmi3ClockUpdateCallback, fmi3LockPreemptionCallback, fmi3UnlockPreemptionCallback

from fmu.exporter.importer import (
    CO_SIMULATION,
    EVENT_MODE,
    MODEL_EXCHANGE,
    SCHEDULED_EXECUTION,
    Instance3,
    Status,
    array,
)
from fmu.exporter.test_fmi3 import CLOCKED, CLOCKED_SCHEDULED, libraries, make

pytestmark = [pytest.mark.quick, pytest.mark.compiled]

__all__ = ["libraries", "make"]

CONSTANT, SAMPLE, GIVEN, TUNED, ADAPTED, PULSE, ALARM, TRIGGER, THIRD = range(11, 20)
DATA = 44
PERIODIC = [CONSTANT, SAMPLE, GIVEN, TUNED, ADAPTED]
AMOUNT, LEVEL, SAMPLE_TIME, DELAY, TUNED_TIME = range(21, 26)
SUM, COUNT, ORDER, LAST, LAST_SUM = range(31, 36)
NOT_YET_KNOWN, UNCHANGED, CHANGED = range(3)
"""`fmi3IntervalQualifier`."""
WITH_EVENTS = pytest.mark.parametrize("interface", [EVENT_MODE, MODEL_EXCHANGE])


@pytest.fixture
def new(make: Callable[..., Instance3]) -> Iterator[Callable[..., Instance3]]:
    """Makes instances of the clocked model."""

    def new(interface: str, state: str = "instantiated", **arguments: Any) -> Instance3:
        model = CLOCKED_SCHEDULED if interface == SCHEDULED_EXECUTION else CLOCKED
        return make(interface, state, model, **arguments)

    return new


def set_clock(instance: Instance3, clock: int, value: bool = True) -> Status:
    return instance.call("fmi3SetClock", array(c_uint32, clock), 1, array(c_bool, value))


def get_clock(instance: Instance3, clock: int) -> bool:
    values = array(c_bool, False)
    assert instance.call("fmi3GetClock", array(c_uint32, clock), 1, values) == Status.OK, instance.messages
    return values[0]


def set_time(instance: Instance3, what: str, clock: int, time: float) -> Status:
    return instance.call(f"fmi3Set{what}Decimal", array(c_uint32, clock), 1, array(c_double, time))


def order(instance: Instance3) -> list[str]:
    """The clocks in the order in which they ticked."""
    (text,) = instance.get("String", [ORDER])
    return text.decode().split()


def refused(instance: Instance3, status: Status, reason: str) -> bool:
    """Whether a call was refused for a reason."""
    return status == Status.ERROR and reason in instance.messages[-1].text


@WITH_EVENTS
def test_a_tick_is_computed_when_a_value_is_asked_for_and_kept_by_the_update(
    new: Callable[..., Instance3], interface: str
) -> None:
    """Until fmi3UpdateDiscreteStates the importer may set inputs again: the tick is recomputed, once."""
    instance = new(interface, "event")
    assert set_clock(instance, TRIGGER) == Status.OK
    assert get_clock(instance, TRIGGER)
    assert instance.get("Int32", [SUM, COUNT]) == [1, 1]
    for amount in (2, 5):
        assert instance.set("Int32", [AMOUNT], [amount]) == Status.OK
        assert instance.get("Int32", [SUM, COUNT]) == [amount, 1]
    instance.update()
    assert not get_clock(instance, TRIGGER)
    assert instance.get("Int32", [SUM, COUNT]) == [5, 1]
    # A triggered clock may tick again in the same event.
    assert set_clock(instance, TRIGGER) == Status.OK
    instance.update()
    assert instance.get("Int32", [SUM, COUNT, LAST_SUM]) == [10, 2, 5]


@WITH_EVENTS
def test_clocks_tick_in_the_order_of_their_priority(new: Callable[..., Instance3], interface: str) -> None:
    instance = new(interface, "event")
    for clock in (SAMPLE, ALARM, PULSE, ADAPTED, TUNED, GIVEN, TRIGGER, CONSTANT):
        assert set_clock(instance, clock) == Status.OK
    instance.update()
    expected = ["constant", "trigger", "given", "tuned", "adapted", "pulse", "alarm", "sample"]
    assert order(instance) == expected


@WITH_EVENTS
def test_a_tick_is_taken_back(new: Callable[..., Instance3], interface: str) -> None:
    """Section 2.3.5: the state is as before, and clocks that ticked because of it do not."""
    instance = new(interface, "event")
    for _ in range(2):
        assert set_clock(instance, TRIGGER) == Status.OK
        instance.update()
    assert set_clock(instance, TRIGGER) == Status.OK
    assert get_clock(instance, THIRD)
    assert set_clock(instance, TRIGGER, False) == Status.OK
    assert not get_clock(instance, THIRD)
    assert instance.get("Int32", [SUM, COUNT]) == [2, 2]
    instance.update()
    assert instance.get("Int32", [SUM, COUNT]) == [2, 2]
    assert set_clock(instance, CONSTANT) == Status.OK
    assert refused(instance, set_clock(instance, CONSTANT, False), "canBeDeactivated is false")


@WITH_EVENTS
@pytest.mark.parametrize("clock", PERIODIC)
def test_a_periodic_clock_ticks_once_in_an_event(
    new: Callable[..., Instance3], interface: str, clock: int
) -> None:
    instance = new(interface, "event")
    leave = "fmi3EnterStepMode" if interface == EVENT_MODE else "fmi3EnterContinuousTimeMode"
    for _ in range(2):
        assert set_clock(instance, clock) == Status.OK
        instance.update()
        instance.ok(leave)
        instance.ok("fmi3EnterEventMode")
    assert instance.get("Int32", [COUNT]) == [2]
    assert set_clock(instance, clock) == Status.OK
    instance.update()
    assert refused(instance, set_clock(instance, clock), "is periodic, and has ticked in this event")


@WITH_EVENTS
def test_an_output_ticks_until_the_update(new: Callable[..., Instance3], interface: str) -> None:
    instance = new(interface, "event")
    for count in range(1, 7):
        assert set_clock(instance, TRIGGER) == Status.OK
        assert get_clock(instance, THIRD) == get_clock(instance, THIRD) == (count % 3 == 0)
        instance.update()
        assert not get_clock(instance, THIRD)
    assert refused(instance, set_clock(instance, THIRD), "third is not an input")


@pytest.mark.parametrize(
    ("interface", "state"),
    [(EVENT_MODE, "event"), (EVENT_MODE, "step"), (MODEL_EXCHANGE, "event"), (MODEL_EXCHANGE, "continuous")],
)
def test_what_belongs_to_a_clock_is_set_while_it_ticks(
    new: Callable[..., Instance3], interface: str, state: str
) -> None:
    for kind, reference, value in [("Int32", AMOUNT, 2), ("Float64", LEVEL, 2.0)]:
        instance = new(interface, state)
        assert instance.get(kind, [reference]) == [0.0 if kind == "Float64" else 1]
        status = instance.set(kind, [reference], [value])
        name = "amount" if kind == "Int32" else "level"
        assert refused(instance, status, f"the variable {name} can be set only while its clock ticks")
    instance = new(interface, "event")
    assert set_clock(instance, ALARM) == Status.OK
    assert instance.set("Float64", [LEVEL], [3.0]) == Status.OK
    assert refused(instance, instance.set("Int32", [AMOUNT], [2]), "its clock ticks")


def test_intervals_and_shifts_before_the_start(new: Callable[..., Instance3]) -> None:
    """As declared, from parameters, and set by the importer."""
    for interface in (EVENT_MODE, MODEL_EXCHANGE, SCHEDULED_EXECUTION):
        instance = new(interface, "initialization")
        assert [instance.interval(clock)[0] for clock in PERIODIC] == [0.125, 0.25, 0.5, 0.5, 2.0]
        assert [instance.shift(clock) for clock in PERIODIC] == [0.375, 0.0, 0.125, 0.0, 0.0]
        assert instance.interval(PULSE) == (0.125, CHANGED)
        assert instance.interval(PULSE) == (0.125, UNCHANGED)
        assert instance.interval(ALARM) == (0.0, NOT_YET_KNOWN)
        assert instance.set("Float64", [SAMPLE_TIME, DELAY], [0.0125, 0.75]) == Status.OK
        assert instance.interval(SAMPLE) == (0.0125, CHANGED)
        assert instance.interval(SAMPLE) == (0.0125, UNCHANGED)
        assert instance.shift(SAMPLE) == 0.75
        for clock in (GIVEN, ADAPTED):
            assert set_time(instance, "Interval", clock, 0.1) == Status.OK
            assert set_time(instance, "Shift", clock, 0.3) == Status.OK
            assert (instance.interval(clock)[0], instance.shift(clock)) == (0.1, 0.3)
        instance.ok("fmi3ExitInitializationMode")
        assert instance.interval(SAMPLE) == (0.0125, UNCHANGED)


@pytest.mark.parametrize(
    ("what", "clock", "time", "reason"),
    [
        ("Interval", CONSTANT, 1.0, "the interval of the clock constant cannot be set"),
        ("Interval", SAMPLE, 1.0, "the interval of the clock sample cannot be set"),
        ("Interval", TUNED, 1.0, "the interval of the clock tuned cannot be set"),
        ("Interval", PULSE, 1.0, "the interval of the clock pulse cannot be set"),
        ("Interval", ALARM, 1.0, "the interval of the clock alarm cannot be set"),
        ("Interval", TRIGGER, 1.0, "the clock trigger is triggered"),
        ("Interval", THIRD, 1.0, "the clock third is triggered"),
        ("Interval", GIVEN, 0.0, "0 s for the interval of the clock given"),
        ("Shift", GIVEN, -1.0, "-1 s for the shift of the clock given"),
        ("Shift", CONSTANT, 1.0, "the shift of the clock constant cannot be set"),
        ("Shift", ALARM, 1.0, "the shift of the clock alarm cannot be set"),
    ],
)
def test_times_that_are_not_set(
    new: Callable[..., Instance3], what: str, clock: int, time: float, reason: str
) -> None:
    instance = new(SCHEDULED_EXECUTION, "initialization")
    assert refused(instance, set_time(instance, what, clock, time), reason)


@pytest.mark.parametrize("interface", [EVENT_MODE, MODEL_EXCHANGE, SCHEDULED_EXECUTION])
def test_intervals_of_tunable_clocks_change(new: Callable[..., Instance3], interface: str) -> None:
    state = "activation" if interface == SCHEDULED_EXECUTION else "event"
    instance = new(interface, state)
    assert instance.interval(TUNED) == (0.5, CHANGED)
    assert instance.set("Float64", [TUNED_TIME], [0.75]) == Status.OK
    assert instance.interval(TUNED) == (0.75, CHANGED)
    assert instance.interval(TUNED) == (0.75, UNCHANGED)
    assert set_time(instance, "Interval", ADAPTED, 0.25) == Status.OK
    assert instance.interval(ADAPTED)[0] == 0.25
    assert refused(instance, set_time(instance, "Interval", GIVEN, 0.25), "the clock given cannot be set")


def test_fractions(new: Callable[..., Instance3]) -> None:
    instance = new(MODEL_EXCHANGE, "initialization")
    clocks = array(c_uint32, CONSTANT, GIVEN, ALARM)
    counters, resolutions, qualifiers = (c_uint64 * 3)(), (c_uint64 * 3)(), (c_int * 3)()
    arguments = (counters, resolutions)
    assert instance.call("fmi3GetIntervalFraction", clocks, 3, *arguments, qualifiers) == Status.OK
    assert (list(counters), list(resolutions)) == ([1, 1, 0], [8, 2, 1])
    assert list(qualifiers) == [CHANGED, CHANGED, NOT_YET_KNOWN]
    given = array(c_uint32, GIVEN)
    third = (array(c_uint64, 1), array(c_uint64, 3))
    for what in ("Interval", "Shift"):
        assert instance.call(f"fmi3Set{what}Fraction", given, 1, *third) == Status.OK
    assert instance.call("fmi3GetShiftFraction", clocks, 2, *arguments) == Status.OK
    assert (list(counters)[:2], list(resolutions)[:2]) == ([3, 1], [8, 3])
    assert instance.call("fmi3GetIntervalFraction", given, 1, *arguments, qualifiers) == Status.OK
    assert (counters[0], resolutions[0]) == (1, 3)
    status = instance.call("fmi3SetIntervalFraction", given, 1, third[0], array(c_uint64, 0))
    assert refused(instance, status, "a resolution is 0")
    instance = new(MODEL_EXCHANGE, "initialization")
    status = instance.call("fmi3GetIntervalFraction", array(c_uint32, TUNED), 1, *arguments, qualifiers)
    assert refused(instance, status, "the clock tuned has no fractions")


@WITH_EVENTS
def test_aperiodic_clocks(new: Callable[..., Instance3], interface: str) -> None:
    instance = new(interface, "event")
    assert instance.interval(PULSE) == (0.125, CHANGED)
    assert set_clock(instance, PULSE) == Status.OK
    instance.update()
    assert instance.interval(PULSE) == (0.125, CHANGED)
    assert set_clock(instance, TRIGGER) == Status.OK
    assert instance.set("Int32", [AMOUNT], [11]) == Status.OK
    assert instance.interval(ALARM) == (0.0, CHANGED)
    instance.update()
    assert instance.interval(ALARM) == (0.0, UNCHANGED)
    # After no time: at once, in the same event.
    assert set_clock(instance, ALARM) == Status.OK
    instance.update()
    assert instance.interval(ALARM) == (0.0, NOT_YET_KNOWN)
    assert set_clock(instance, PULSE) == Status.OK
    instance.update()
    assert instance.interval(PULSE) == (0.5, CHANGED)
    status = instance.call("fmi3GetShiftDecimal", array(c_uint32, PULSE), 1, array(c_double, 0.0))
    assert status == Status.ERROR


def test_event_mode_is_needed(libraries: dict[str, Any]) -> None:
    library, token = libraries[CLOCKED]
    instance = Instance3(library, token, CO_SIMULATION)
    assert instance.component is None
    assert "eventModeUsed is false, but this FMU has clocks" in instance.messages[0].text


@WITH_EVENTS
def test_a_state_within_an_event_is_carried_into_another_instance(
    new: Callable[..., Instance3], interface: str
) -> None:
    """What was computed of ticks is recomputed there."""
    instance, other = new(interface, "event"), new(interface)
    assert set_clock(instance, TRIGGER) == Status.OK
    assert instance.set("Int32", [AMOUNT], [3]) == Status.OK
    assert instance.get("Int32", [SUM]) == [3]
    content = instance.snapshot()
    instance.update()
    other.restore(content)
    assert get_clock(other, TRIGGER)
    assert other.set("Int32", [AMOUNT], [4]) == Status.OK
    assert other.get("Int32", [SUM, COUNT]) == [4, 1]
    other.update()
    assert set_clock(other, TRIGGER) == Status.OK
    assert other.get("Int32", [SUM, COUNT, LAST_SUM]) == [8, 2, 4]


@WITH_EVENTS
@pytest.mark.parametrize("is_asked_for", [False, True])
def test_ticks_take_place_before_the_end_and_not_before_an_error(
    new: Callable[..., Instance3], interface: str, is_asked_for: bool
) -> None:
    """Whether or not a value was requested, and in an instance that resumes from the state within it."""
    for function, status, total in (
        ("fmi3Terminate", Status.OK, 1),
        ("fmi3ExitInitializationMode", Status.ERROR, 0),
    ):
        instance, other = new(interface, "event"), new(interface)
        assert set_clock(instance, TRIGGER) == Status.OK
        if is_asked_for:
            assert instance.get("Int32", [SUM]) == [1]
        content = instance.snapshot()
        other.restore(content)
        for each in (instance, other):
            assert each.call(function) == status
            assert each.get("Int32", [SUM, COUNT]) == [total, total]
        assert instance.snapshot() == other.snapshot()


@WITH_EVENTS
def test_a_warning_of_a_tick_is_given_once(new: Callable[..., Instance3], interface: str) -> None:
    instance = new(interface, "event", loggingOn=True)
    # The third says at the same time what the second said.
    for tick, amount in enumerate([-1, -2, -2], start=1):
        assert set_clock(instance, TRIGGER) == Status.OK
        assert instance.set("Int32", [AMOUNT], [amount]) == Status.OK
        references, values = array(c_uint32, SUM), array(c_int, 0)
        # The model declares no `warnings`, so that the message has the status, not the call.
        assert instance.call("fmi3GetInt32", references, 1, values, 1) == Status.OK
        # It is recomputed.
        assert instance.set("Float64", [LEVEL], [1.0]) == Status.OK
        instance.get("Int32", [SUM])
        instance.update()
        told = ["at 0 s: the amount is -1", "at 0 s: the amount is -2"]
        assert [message.text for message in instance.messages] == told[:tick]
        assert {message.status for message in instance.messages} == {Status.WARNING}


@WITH_EVENTS
def test_a_tick_ends_the_simulation_or_fails(new: Callable[..., Instance3], interface: str) -> None:
    instance = new(interface, "event")
    assert set_clock(instance, TRIGGER) == Status.OK
    assert instance.set("Int32", [AMOUNT], [100]) == Status.OK
    instance.get("Int32", [SUM])
    assert instance.set("Int32", [AMOUNT], [1]) == Status.OK
    assert instance.update()[0] == [False, False, False, False], "taken back"
    assert set_clock(instance, TRIGGER) == Status.OK
    assert instance.set("Int32", [AMOUNT], [100]) == Status.OK
    assert instance.update()[0] == [False, True, False, False]
    instance = new(interface, "event")
    assert set_clock(instance, TRIGGER) == Status.OK
    assert instance.set("Int32", [AMOUNT], [101]) == Status.OK
    references, values = array(c_uint32, SUM), array(c_int, 0)
    status = instance.call("fmi3GetInt32", references, 1, values, 1)
    assert refused(instance, status, "the amount is too large")


def test_the_importer_is_told_of_clocks(new: Callable[..., Instance3]) -> None:
    """Section 5.2.2: fmi3GetClock answers once that a clock ticks, and the interval is new once. The importer
    may preempt the call meanwhile: the locks are free."""
    told: list[tuple[bool, tuple[float, int]]] = []
    locks: list[str] = []
    instance: list[Instance3] = []

    def update(_environment: int) -> None:
        assert locks.count("lock") == locks.count("unlock")
        told.append((get_clock(instance[0], THIRD), instance[0].interval(ALARM)))
        assert not get_clock(instance[0], THIRD)
        # Of a task with a higher priority.
        if len(told) == 1:
            instance[0].activate(CONSTANT, 2.0)

    callbacks = {
        "clockUpdate": fmi3ClockUpdateCallback(update),
        "lockPreemption": fmi3LockPreemptionCallback(lambda: locks.append("lock")),
        "unlockPreemption": fmi3UnlockPreemptionCallback(lambda: locks.append("unlock")),
    }
    instance.append(new(SCHEDULED_EXECUTION, "activation", **callbacks))
    assert instance[0].set("Int32", [AMOUNT], [12]) == Status.OK
    instance[0].activate(TRIGGER, 0.0)
    assert told == [(False, (1.0, CHANGED))]
    assert order(instance[0]) == ["trigger", "constant"]
    instance[0].activate(SAMPLE, 0.0)
    assert told[1:] == [(True, (1.0, UNCHANGED))]
    instance[0].activate(ALARM, 1.0)
    assert told[2:] == []
    # Times of different clocks are their own.
    instance[0].activate(SAMPLE, 0.5)
    assert locks.count("lock") == locks.count("unlock")


def test_functions_of_the_whole_fmu_wait_for_the_partitions(new: Callable[..., Instance3]) -> None:
    """Section 5.2.1: fmi3GetFMUState must not be called while a partition runs."""
    statuses: list[Status] = []
    instance: list[Instance3] = []

    def update(_environment: int) -> None:
        statuses.append(instance[0].call("fmi3GetFMUState", instance[0].arguments("fmi3GetFMUState")[0]))

    callback = fmi3ClockUpdateCallback(update)
    instance.append(new(SCHEDULED_EXECUTION, "activation", clockUpdate=callback))
    for time in (0.0, 1.0, 2.0):
        instance[0].activate(CONSTANT, time)
    assert statuses == [Status.ERROR]
    assert "while a model partition runs" in instance[0].messages[-1].text


def test_a_call_that_fails_while_the_importer_is_told(new: Callable[..., Instance3]) -> None:
    """Compiled sources have no memory for this binary, and stop in both calls; a native library has."""
    value = (c_uint8 * 20_000_000)()
    sizes, values = array(c_size_t, len(value)), array(c_void_p, addressof(value))
    statuses: list[Status] = []
    instance: list[Instance3] = []

    def update(_environment: int) -> None:
        for _ in range(2):
            statuses.append(instance[0].call("fmi3SetBinary", array(c_uint32, DATA), 1, sizes, values, 1))

    callback = fmi3ClockUpdateCallback(update)
    instance.append(new(SCHEDULED_EXECUTION, "activation", clockUpdate=callback))
    for time in (0.0, 1.0, 2.0):
        instance[0].call("fmi3ActivateModelPartition", CONSTANT, time)
    assert statuses in ([Status.ERROR] * 2, [Status.OK] * 2)
    instance[0].ok("fmi3Reset")
    instance[0].initialize()
    instance[0].activate(CONSTANT, 0.0)
    assert order(instance[0]) == ["constant"]


def test_partitions_and_times_that_are_refused(new: Callable[..., Instance3]) -> None:
    instance = new(SCHEDULED_EXECUTION, "activation")
    instance.activate(CONSTANT, 1.0)
    instance.activate(TRIGGER, 1.0)
    instance.activate(SAMPLE, 0.5)
    status = instance.call("fmi3ActivateModelPartition", CONSTANT, 1.0)
    assert refused(instance, status, "the last activation was at 1")
    instance = new(SCHEDULED_EXECUTION, "activation")
    status = instance.call("fmi3ActivateModelPartition", THIRD, 1.0)
    assert refused(instance, status, "the clock third is not an input")
    instance = new(SCHEDULED_EXECUTION, "activation")
    intervals, qualifiers = array(c_double, 0.0), array(c_int, 0)
    status = instance.call("fmi3GetIntervalDecimal", array(c_uint32, ALARM), 1, intervals, qualifiers)
    assert refused(instance, status, "is available in Clock Update Mode")
    instance = new(SCHEDULED_EXECUTION, "activation")
    status = instance.call("fmi3GetClock", array(c_uint32, CONSTANT), 1, array(c_bool, False))
    assert refused(instance, status, "the clock constant is an input")
