"""The life of an instance by the states of FMI 2.0.5, sections 3.2.3 and 4.2.4: how to reach each state, and
the rest of the life from there, recorded to the last bit.

An instance that refused a call must continue like one without it.
"""

from __future__ import annotations

from collections.abc import Mapping
from ctypes import byref, c_int
from dataclasses import dataclass
from typing import Any

from fmi2 import CO_SIMULATION, MODEL_EXCHANGE, STEP, EventInfo, Fmu, Instance, Library, Status, c_type_of

STATES = {
    CO_SIMULATION: [
        "instantiated",
        "Initialization Mode",
        "stepComplete",
        "stepFailed",
        "terminated",
        "error",
    ],
    MODEL_EXCHANGE: [
        "instantiated",
        "Initialization Mode",
        "Event Mode",
        "Continuous-Time Mode",
        "terminated",
        "error",
    ],
}
"""The states of an instance: with synchronous steps, section 4.2.4 without those of asynchronous ones."""

LIVES = [(fmu_type, state) for fmu_type, states in STATES.items() for state in states]
"""Each interface with each of its states."""

Record = list[tuple[str, object]]
"""Values, each with its variable and time."""


@dataclass(frozen=True)
class Course:
    """Values to set, so that no part of an instance's memory has its default."""

    parameters: Mapping[str, Any]
    inputs: Mapping[str, Any]
    """In Initialization Mode."""
    pending: Mapping[str, Any]
    """Inputs that are set before the next step, in stepComplete, Event Mode or Continuous-Time Mode."""
    slopes: Mapping[str, float]
    """Their derivatives for this step, in co-simulation."""
    later: Mapping[str, Any]
    """Inputs of the second half of a run."""


COURSE = Course(
    parameters={
        "settings.high": 50.0,
        "settings.first": 7,
        "settings.doubled": 1,
        "settings.label": b"label",
        "settings.table[1,2]": 0.5,
        "settings.table[2,1]": 0.5,
        "tank.gain": 2.0,
        "tank.level": 0.25,
        "motion.start": 2,
        "motion.position": 0.5,
        "events.period": 2 * STEP,
        "events.echoes": 3,
        "events.wall": 0.0625,
    },
    inputs={"rate": 1.5, "drive": 0.5, "lift": 1, "note": b"first", "gear": 2},
    pending={"rate": 2.0, "pulse": 0.5, "lift": 2},
    slopes={"rate": 3.0},
    later={"rate": -1.0, "drive": 1.0, "lift": 0, "enabled": 0, "note": b"later", "gear": 1},
)


class Life(Instance):
    """An instance that goes from state to state."""

    def __init__(
        self,
        fmu: Fmu,
        library: Library,
        *,
        fmu_type: int = CO_SIMULATION,
        start_time: float = 2.0,
        stop_time: float | None = None,
        course: Course = COURSE,
    ) -> None:
        super().__init__(fmu, library, fmu_type=fmu_type)
        self.start_time, self.stop_time, self.course = start_time, stop_time, course
        self.state = "instantiated"
        self.is_set_up = False
        self.steps_done = 0
        self.next_event: float | None = None

    @property
    def time(self) -> float:
        """The current communication point, or time of the integration."""
        return self.start_time + self.steps_done * STEP

    def set_up(self, *arguments) -> None:
        super().set_up(*(arguments or (self.start_time, self.stop_time)))
        self.is_set_up = True

    def step_on(self, length: int = 1) -> Status:
        """`fmi2DoStep` from the end of the last one."""
        status = self.step(self.time, length * STEP)
        self.steps_done += length * (status == Status.OK)
        return status

    def finish_event(self) -> Record:
        """Iterates the event, and continues in Continuous-Time Mode."""
        record: Record = []
        again = True
        while again:
            info = self.new_discrete_states()
            again = info.new_discrete_states_needed
            assert not info.terminate_simulation
            record.append((f"event at {self.time}", [getattr(info, name) for name, _ in EventInfo._fields_]))
            assert len(record) < 100
        self.next_event = info.next_event_time if info.next_event_time_defined else None
        self.ok("fmi2EnterContinuousTimeMode")
        return record

    def integrate(self, steps: int) -> Record:
        """Steps of explicit Euler, each with the event at its end."""
        record: Record = []
        for _ in range(steps):
            pairs = zip(self.vector("ContinuousStates"), self.vector("Derivatives"), strict=True)
            states = [state + STEP * derivative for state, derivative in pairs]
            before = [indicator > 0 for indicator in self.vector("EventIndicators")]
            self.steps_done += 1
            self.ok("fmi2SetTime", self.time)
            self.set_states(*states)
            indicators = self.vector("EventIndicators")
            self.ok("fmi2CompletedIntegratorStep", 1, byref(c_int()), byref(c_int()))
            is_due = self.next_event is not None and self.time >= self.next_event
            if is_due or [indicator > 0 for indicator in indicators] != before:
                self.ok("fmi2EnterEventMode")
                record += self.finish_event()
            for quantity in ("ContinuousStates", "Derivatives", "EventIndicators"):
                record.append((f"{quantity} at {self.time}", [v.hex() for v in self.vector(quantity)]))
        return record

    def reach(self, state: str) -> Life:
        """Brings a new instance into a state."""
        self.state = state
        assert self.set(self.course.parameters) == Status.OK
        if state == "instantiated":
            return self
        self.enter(self.start_time, self.stop_time)
        assert self.set(self.course.inputs) == Status.OK
        if state == "Initialization Mode":
            return self
        self.ok("fmi2ExitInitializationMode")
        if self.fmu_type == MODEL_EXCHANGE:
            self._exchange(state)
        else:
            self._simulate(state)
        if state == "terminated":
            self.ok("fmi2Terminate")
        return self

    def _simulate(self, state: str) -> None:
        for _ in range(3):
            assert self.step_on() == Status.OK
        if state == "error":
            self.choose(fault__place="step", fault__manner="error")
            assert self.step_on() == Status.ERROR
            return
        if state == "stepFailed":
            self.steps_done += 1
            assert self.set({"events.end": self.time}) == Status.OK
            assert self.step(self.time - STEP, 2 * STEP) == Status.DISCARD
            return
        assert self.set(self.course.pending) == Status.OK
        for name, slope in self.course.slopes.items():
            assert self.set_derivative(name, 1, slope) == Status.OK

    def _exchange(self, state: str) -> None:
        self.finish_event()
        self.integrate(3)
        if state in ("Event Mode", "error"):
            # At a tick.
            self.steps_done += 1
            self.ok("fmi2SetTime", self.time)
            self.ok("fmi2EnterEventMode")
        if state == "error":
            self.choose(fault__place="event", fault__manner="error")
            assert self.call("fmi2NewDiscreteStates", byref(EventInfo())) == Status.ERROR
            return
        continuous = self.fmu.named(lambda v: v.variability == "continuous")
        possible = {n: v for n, v in self.course.pending.items() if state == "Event Mode" or n in continuous}
        assert self.set(possible) == Status.OK

    def values(self, where: str) -> Record:
        """Every value, bit for bit."""
        record: Record = []
        for kind in ("Real", "Integer", "Boolean", "String"):
            names = self.fmu.named(lambda v, kind=kind: c_type_of(v) == kind)
            function, vr, count, values = self.getting(*names)
            self.ok(function, vr, count, values)
            exact = float.hex if kind == "Real" else lambda value: value
            record += [(f"{n}, {where}", exact(value)) for n, value in zip(names, values, strict=True)]
        return record

    def _steps(self, *lengths: int) -> Record:
        for length in lengths:
            assert self.step_on(length) == Status.OK, self.messages
        return self.values(f"at {self.time}")

    def go_on(self) -> Record:
        """The rest of the life, to the state `terminated` if that can be reached."""
        first = len(self.messages)
        record: Record = []
        if self.state == "instantiated":
            if not self.is_set_up:
                # Section 2.1.6: not without fmi2SetupExperiment.
                assert self.call("fmi2EnterInitializationMode") == Status.ERROR
                self.set_up()
            self.ok("fmi2EnterInitializationMode")
        if self.state in ("instantiated", "Initialization Mode"):
            record += self.values("in Initialization Mode")
            self.ok("fmi2ExitInitializationMode")
        if self.state not in ("terminated", "error"):
            record += self._run() if self.fmu_type == CO_SIMULATION else self._integration()
            self.ok("fmi2Terminate")
        if self.state == "error":
            refused = self.step_on() if self.fmu_type == CO_SIMULATION else self.call("fmi2EnterEventMode")
            assert refused == Status.ERROR
        record += self.values("in the end")
        record.append(("messages", self.messages[first:]))
        return record

    def _run(self) -> Record:
        if self.state == "stepFailed":
            return self.values("after the end")
        record = self._steps(4)
        record += self._steps(1, 1)
        assert self.set(self.course.later) == Status.OK
        return record + self._steps(1, 1, 1)

    def _integration(self) -> Record:
        record = self.values("before")
        if self.state != "Continuous-Time Mode":
            record += self.finish_event()
        record += self.integrate(5)
        record += self.values(f"at {self.time}")
        self.ok("fmi2EnterEventMode")
        assert self.set(self.course.later) == Status.OK
        record += self.finish_event()
        return record + self.integrate(4) + self.values(f"at {self.time}")

    def live_anew(self) -> Record:
        """A whole life with the defaults, from the state `instantiated`."""
        self.state, self.is_set_up, self.steps_done, self.next_event = "instantiated", False, 0, None
        self.start_time, self.stop_time = 0.0, None
        return self.go_on()

    def take_the_place_of(self, other: Life) -> Life:
        """Continues as another instance would, whose state this one has been given."""
        self.state, self.is_set_up, self.steps_done = other.state, other.is_set_up, other.steps_done
        self.next_event = other.next_event
        return self


def differences(record: Record, expected: Record) -> list[str]:
    """The differences of two records."""
    if [what for what, _ in record] != [what for what, _ in expected]:
        return ["the records are of different lives"]
    return [
        f"{what}: {value!r} instead of {other!r}"
        for (what, value), (_, other) in zip(record, expected, strict=True)
        if value != other
    ]
