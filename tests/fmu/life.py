"""The life of an instance by the states of FMI 2.0.5, section 4.2.4: how each state is reached, and how an
instance goes on from there, recorded to the last bit.

An instance that refused a call must go on as one that never got it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from ctypes import c_double, c_int, c_uint
from dataclasses import dataclass, field
from typing import Any

from c_interface import Caller, Status
from fmpy.model_description import ScalarVariable
from master import ERROR, Fmu

STEP = 1 / 80

STATES = ["instantiated", "Initialization Mode", "stepComplete", "terminated", "error"]
"""The states of an instance that computes its steps at once: section 4.2.4 without those of a step in the
background or discarded."""


@dataclass(frozen=True)
class Course:
    """What is set on the way, so that nothing an instance remembers is at its default."""

    parameters: Mapping[str, float]
    inputs: Mapping[str, float]
    """In Initialization Mode."""
    pending: Mapping[str, float]
    """Inputs that are set before the next step, in stepComplete."""
    slopes: Mapping[str, float]
    """Their derivatives for this step."""
    later: Mapping[str, float]
    """Inputs of the second half of a run."""
    failing_parameters: Mapping[str, float] = field(default_factory=dict)
    """Parameters within their ranges, with which a step fails …"""
    failing_inputs: Mapping[str, float] = field(default_factory=dict)
    """… as soon as these inputs are set."""


COURSES = {
    "BoostPlant": Course(
        parameters={"tank.volume": 5e-4, "valve.time_constant": 0.01},
        inputs={"engine_speed": 1800.0, "hp_wastegate_pwm": 55.0},
        pending={"engine_speed": 1850.0, "vacuum_pump": 1.0},
        slopes={"engine_speed": 300.0},
        later={"engine_speed": 1700.0, "throttle": 0.9, "hp_wastegate_pwm": 45.0},
        # Friction that jumps as the rod turns back, to a hundred millionth: no step is short enough. At rest
        # until ambient pressure moves the rod.
        failing_parameters={"solver.relative_tolerance": 1e-8, "actuator.friction_exponent": 0.0},
        failing_inputs={"ambient_pressure": 5e4},
    ),
    # A sample of the controller is arithmetic on bounded values, whatever its parameters and inputs are
    # within their ranges: no step fails.
    "BoostController": Course(
        parameters={"lambda": 0.5, "pwm_max": 80.0},
        inputs={"engine_speed": 1800.0, "boost_reference": 140e3},
        pending={"boost_pressure": 120e3, "boost_reference": 150e3},
        slopes={"boost_pressure": 20e3},
        later={"engine_speed": 1700.0, "boost_pressure": 145e3, "tank_pressure": 36e3},
    ),
}
"""By the FMU's name."""

FAILING = [name for name, course in COURSES.items() if course.failing_parameters]
"""The FMUs of which a step can fail, so that they can be in the state `error`."""


def c_type_of(variable: ScalarVariable) -> str:
    """The type in the names of the functions that get and set a variable: section 2.2.7 has enumerations
    go through those of Integer."""
    return "Integer" if variable.type == "Enumeration" else variable.type


def references(*values: int) -> Any:
    """An array of value references."""
    return (c_uint * len(values))(*values)


def reals(*values: float) -> Any:
    """An array of fmi2Real."""
    return (c_double * len(values))(*values)


def integers(*values: int) -> Any:
    """An array of fmi2Integer or fmi2Boolean."""
    return (c_int * len(values))(*values)


ARRAYS: dict[str, Callable[..., Any]] = {"Real": reals, "Integer": integers, "Boolean": integers}


def numbers_in(text: str) -> list[float]:
    """The numbers in a message, however they are written."""
    return [
        float(number)
        for number in re.findall(r"(?<![\w.])-?(?:\d+(?:\.\d+)?(?:[eE][-+]?\d+)?|inf|NaN)(?![\w])", text)
    ]


Record = list[tuple[str, object]]
"""Values, each with what it is of and when."""


class Life:
    """An instance of an FMU on its way through the states."""

    def __init__(
        self,
        caller: Caller,
        fmu: Fmu,
        *,
        start_time: float = 0.0,
        stop_time: float | None = None,
        course: Course | None = None,
    ) -> None:
        self.caller, self.fmu = caller, fmu
        self.course = course or COURSES[fmu.description.modelName]
        self.start_time, self.stop_time = start_time, stop_time
        self.state = "instantiated"
        self.set_up = False
        self.steps_done = 0

    @property
    def time(self) -> float:
        """The communication point that was reached."""
        return self.start_time + self.steps_done * STEP

    def reference(self, name: str) -> int:
        """The value reference of a variable."""
        return self.fmu.variables[name].valueReference

    def settings(self, values: Mapping[str, Any]) -> tuple[str, Any, int, Any]:
        """The function that sets variables, which are of one type, and its arguments."""
        (kind,) = {c_type_of(self.fmu.variables[name]) for name in values}
        vr = references(*map(self.reference, values))
        return f"fmi2Set{kind}", vr, len(values), ARRAYS[kind](*values.values())

    def set(self, values: Mapping[str, Any]) -> Status:
        """Sets variables of one type, if any."""
        if not values:
            return Status.OK
        return self.caller.call(*self.settings(values))

    def get(self, name: str) -> Any:
        """The value of a variable, which must be readable."""
        kind = c_type_of(self.fmu.variables[name])
        value = ARRAYS[kind](0)
        vr = references(self.reference(name))
        assert self.caller.call(f"fmi2Get{kind}", vr, 1, value) == Status.OK, self.caller.messages
        return value[0]

    def setup(self) -> Status:
        """`fmi2SetupExperiment`."""
        stop_defined = int(self.stop_time is not None)
        status = self.caller.call(
            "fmi2SetupExperiment", 0, 0.0, self.start_time, stop_defined, self.stop_time or 0.0
        )
        self.set_up = True
        return status

    def step(self, length: int = 1) -> Status:
        """`fmi2DoStep` from where the last one ended, of a number of samples of the controller."""
        status = self.caller.step(self.time, length * STEP)
        self.steps_done += length * (status == Status.OK)
        return status

    def set_pending(self) -> None:
        """Inputs and derivatives for the next step, which are lost or used up by nothing but it."""
        assert self.set(self.course.pending) == Status.OK
        vr = references(*map(self.reference, self.course.slopes))
        slopes = reals(*self.course.slopes.values())
        orders = integers(*[1] * len(slopes))
        answer = self.caller.call("fmi2SetRealInputDerivatives", vr, len(slopes), orders, slopes)
        assert answer == Status.OK

    def reach(self, state: str) -> Life:
        """Brings a fresh instance into a state."""
        fails = state == "error"
        parameters = self.course.failing_parameters if fails else self.course.parameters
        assert self.set(parameters) == Status.OK
        position = STATES.index(state)
        self.state = state
        if position == 0:
            return self
        assert self.setup() == Status.OK
        assert self.caller.call("fmi2EnterInitializationMode") == Status.OK
        if not fails:
            assert self.set(self.course.inputs) == Status.OK
        if position == 1:
            return self
        assert self.caller.call("fmi2ExitInitializationMode") == Status.OK
        for _ in range(3):
            assert self.step() == Status.OK
        if state == "error":
            assert self.set(self.course.failing_inputs) == Status.OK
            assert self.step() == Status.ERROR
            return self
        self.set_pending()
        if state == "terminated":
            assert self.caller.call("fmi2Terminate") == Status.OK
        return self

    def values(self, where: str) -> Record:
        """Every value, bit for bit."""
        record: Record = []
        for kind, array in ARRAYS.items():
            variables = [v for v in self.fmu.variables.values() if c_type_of(v) == kind]
            vr = references(*(v.valueReference for v in variables))
            values = array(*[0] * len(vr))
            self._answers(Status.OK, f"fmi2Get{kind}", vr, len(vr), values)
            record += [
                (f"{variable.name}, {where}", bytes(array(value)))
                for variable, value in zip(variables, values, strict=True)
            ]
        return record

    def _answers(self, status: Status, function: str, *arguments: Any) -> None:
        """A call answers as it must."""
        assert self.caller.call(function, *arguments) == status, (function, self.caller.messages)

    def _steps(self, *lengths: int) -> Record:
        for length in lengths:
            assert self.step(length) == Status.OK, self.caller.messages
        return self.values(f"at {self.time}")

    def go_on(self) -> Record:
        """Lives the rest of the life, to the state `terminated` where that can be reached."""
        first = len(self.caller.messages)
        record: Record = []
        reached = STATES.index(self.state)
        if reached == 0:
            if not self.set_up:
                # Section 2.1.6: not without fmi2SetupExperiment.
                self._answers(Status.ERROR, "fmi2EnterInitializationMode")
                assert self.setup() == Status.OK
            self._answers(Status.OK, "fmi2EnterInitializationMode")
        if reached <= 1:
            record += self.values("in Initialization Mode")
            self._answers(Status.OK, "fmi2ExitInitializationMode")
        if reached <= 2:
            # The slopes of inputs reach the controller by the samples after a step's first.
            record += self._steps(4)
            record += self._steps(1, 1)
            assert self.set(self.course.later) == Status.OK
            record += self._steps(1, 1, 1)
            self._answers(Status.OK, "fmi2Terminate")
        if self.state == "error":
            assert self.step() == Status.ERROR
        record += self.values("in the end")
        record.append(("messages", self.caller.messages[first:]))
        return record

    def live_anew(self) -> Record:
        """A whole life with the defaults, from the state `instantiated`."""
        self.state, self.set_up, self.steps_done = "instantiated", False, 0
        self.start_time, self.stop_time = 0.0, None
        return self.go_on()

    def refuses(
        self, function: str, *arguments: Any, names: Iterable[str] = (), numbers: Iterable[float] = ()
    ) -> None:
        """A call is an Error with exactly one message, which names the function, what else is given, and
        the numbers."""
        before = len(self.caller.messages)
        status = self.caller.call(function, *arguments)
        messages = self.caller.messages[before:]
        assert status == Status.ERROR, f"{function} answers {status.name}: {messages}"
        assert [message.status for message in messages] == [ERROR], messages
        text = messages[0].text
        for name in [function, *names]:
            assert re.search(rf"(?<![\w.]){re.escape(name)}(?!\w)", text), f"{name!r} is not in: {text}"
        named = numbers_in(text)
        for number in numbers:
            is_named = any(map(math.isnan, named)) if math.isnan(number) else number in named
            assert is_named, f"{number!r} is not in: {text}"


def differences(record: Record, expected: Record) -> list[str]:
    """What is not the same in two records."""
    if [what for what, _ in record] != [what for what, _ in expected]:
        return ["the records are of different lives"]
    return [
        f"{what}: {answer!r} instead of {other!r}"
        for (what, answer), (_, other) in zip(record, expected, strict=True)
        if answer != other
    ]
