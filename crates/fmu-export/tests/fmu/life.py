"""The life of an instance by the states of FMI 2.0.5, section 4.2.4: how to reach each state, and the rest of
the life from there, recorded to the last bit.

An instance that refused a call must continue like one without it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fmi2 import STEP, Fmu, Instance, Library, Status, c_type_of

STATES = ["instantiated", "Initialization Mode", "stepComplete", "terminated", "error"]
"""The states of an instance with synchronous steps: section 4.2.4 without those of asynchronous or discarded
steps."""

Record = list[tuple[str, object]]
"""Values, each with its variable and time."""


@dataclass(frozen=True)
class Course:
    """Values to set, so that no part of an instance's memory has its default."""

    parameters: Mapping[str, Any]
    inputs: Mapping[str, Any]
    """In Initialization Mode."""
    pending: Mapping[str, Any]
    """Inputs that are set before the next step, in stepComplete."""
    slopes: Mapping[str, float]
    """Their derivatives for this step."""
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
        start_time: float = 2.0,
        stop_time: float | None = None,
        course: Course = COURSE,
    ) -> None:
        super().__init__(fmu, library)
        self.start_time, self.stop_time, self.course = start_time, stop_time, course
        self.state = "instantiated"
        self.is_set_up = False
        self.steps_done = 0

    @property
    def time(self) -> float:
        """The current communication point."""
        return self.start_time + self.steps_done * STEP

    def set_up(self, *arguments) -> None:
        super().set_up(*(arguments or (self.start_time, self.stop_time)))
        self.is_set_up = True

    def step_on(self, length: int = 1) -> Status:
        """`fmi2DoStep` from the end of the last one."""
        status = self.step(self.time, length * STEP)
        self.steps_done += length * (status == Status.OK)
        return status

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
        for _ in range(3):
            assert self.step_on() == Status.OK
        if state == "error":
            self.choose(fault__place="step", fault__manner="error")
            assert self.step_on() == Status.ERROR
            return self
        assert self.set(self.course.pending) == Status.OK
        for name, slope in self.course.slopes.items():
            assert self.set_derivative(name, 1, slope) == Status.OK
        if state == "terminated":
            self.ok("fmi2Terminate")
        return self

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
        reached = STATES.index(self.state)
        if reached == 0:
            if not self.is_set_up:
                # Section 2.1.6: not without fmi2SetupExperiment.
                assert self.call("fmi2EnterInitializationMode") == Status.ERROR
                self.set_up()
            self.ok("fmi2EnterInitializationMode")
        if reached <= 1:
            record += self.values("in Initialization Mode")
            self.ok("fmi2ExitInitializationMode")
        if reached <= 2:
            record += self._steps(4)
            record += self._steps(1, 1)
            assert self.set(self.course.later) == Status.OK
            record += self._steps(1, 1, 1)
            self.ok("fmi2Terminate")
        if self.state == "error":
            assert self.step_on() == Status.ERROR
        record += self.values("in the end")
        record.append(("messages", self.messages[first:]))
        return record

    def live_anew(self) -> Record:
        """A whole life with the defaults, from the state `instantiated`."""
        self.state, self.is_set_up, self.steps_done = "instantiated", False, 0
        self.start_time, self.stop_time = 0.0, None
        return self.go_on()


def differences(record: Record, expected: Record) -> list[str]:
    """The differences of two records."""
    if [what for what, _ in record] != [what for what, _ in expected]:
        return ["the records are of different lives"]
    return [
        f"{what}: {value!r} instead of {other!r}"
        for (what, value), (_, other) in zip(record, expected, strict=True)
        if value != other
    ]
