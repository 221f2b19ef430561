"""An importer of FMI 2.0 that shares no code with FMPy: the C functions by ctypes, co-simulation by
fmi2DoStep, and Model Exchange by the pseudocode of the standard (FMI 2.0.5, section 3.2.4) around SciPy's
Radau or DOP853, with state events located in their dense output."""

from __future__ import annotations

import ctypes
import zipfile
from collections.abc import Callable, Sequence
from ctypes import CFUNCTYPE, POINTER, byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scipy.integrate import DOP853, Radau

MODEL_EXCHANGE, CO_SIMULATION = 0, 1
OK, WARNING, DISCARD = 0, 1, 2
LAST_SUCCESSFUL_TIME, TERMINATED = 2, 3

Logger = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, c_char_p)
"""The exporter passes its messages as the argument of the format `%s`."""


class Callbacks(ctypes.Structure):
    _fields_ = [
        ("logger", Logger),
        ("allocate", CFUNCTYPE(c_void_p, c_size_t, c_size_t)),
        ("free", CFUNCTYPE(None, c_void_p)),
        ("step_finished", c_void_p),
        ("environment", c_void_p),
    ]


class EventInfo(ctypes.Structure):
    _fields_ = [
        ("new_discrete_states_needed", c_int),
        ("terminate_simulation", c_int),
        ("nominals_changed", c_int),
        ("states_changed", c_int),
        ("next_event_time_defined", c_int),
        ("next_event_time", c_double),
    ]


class Failed(Exception):
    """A function returned fmi2Discard, fmi2Error or fmi2Fatal."""

    def __init__(self, function: str, status: int, messages: list[str]):
        super().__init__(f"fmi2{function}: status {status}: {'; '.join(messages)}")
        self.status = status


class Instance:
    """An instance of an FMU, after initialization."""

    def __init__(
        self,
        fmu: Path,
        folder: Path,
        kind: int,
        start_values: dict[str, object] | None = None,
        start_time: float = 0.0,
        tolerance: float | None = None,
        resources: bytes | None = b"",
    ):
        with zipfile.ZipFile(fmu) as archive:
            archive.extractall(folder)
        root = ElementTree.parse(folder / "modelDescription.xml").getroot()
        variables = root.findall("ModelVariables/ScalarVariable")
        self.variables = {v.get("name"): (int(v.get("valueReference")), v[0].tag) for v in variables}
        self.state_count = len(root.findall("ModelStructure/Derivatives/Unknown"))
        self.indicator_count = int(root.get("numberOfEventIndicators", "0"))
        self.messages: list[str] = []
        self.info = EventInfo()
        self.steps = self.evaluations = 0
        interface = root.find("ModelExchange" if kind == MODEL_EXCHANGE else "CoSimulation")
        name = interface.get("modelIdentifier")
        self.library = ctypes.CDLL(str(folder / "binaries" / "linux64" / f"{name}.so"))
        libc = ctypes.CDLL(None)
        libc.calloc.restype = c_void_p
        self.callbacks = Callbacks(
            Logger(lambda *message: self.messages.append(message[5].decode())),
            ctypes.cast(libc.calloc, Callbacks._fields_[1][1]),
            ctypes.cast(libc.free, Callbacks._fields_[2][1]),
        )
        if resources == b"":
            resources = (folder / "resources").resolve().as_uri().encode()
        instantiate = self.library.fmi2Instantiate
        instantiate.restype = c_void_p
        instantiate.argtypes = [c_char_p, c_int, c_char_p, c_char_p, POINTER(Callbacks), c_int, c_int]
        guid = root.get("guid").encode()
        self.component = c_void_p(
            instantiate(name.encode(), kind, guid, resources, byref(self.callbacks), 0, 0)
        )
        assert self.component.value, self.messages
        for variable, value in (start_values or {}).items():
            self.set(variable, value)
        times = c_double(start_time), c_int(0), c_double(0.0)
        self.call("SetupExperiment", c_int(tolerance is not None), c_double(tolerance or 0.0), *times)
        self.call("EnterInitializationMode")
        self.call("ExitInitializationMode")

    def call(self, function: str, *arguments: object) -> None:
        status = getattr(self.library, f"fmi2{function}")(self.component, *arguments)
        if status not in (OK, WARNING):
            raise Failed(function, status, self.messages)

    def get(self, variable: str) -> object:
        reference, kind = self.variables[variable]
        kind = "Integer" if kind == "Enumeration" else kind
        value = {"Real": c_double, "String": c_char_p}.get(kind, c_int)()
        self.call(f"Get{kind}", byref(c_uint(reference)), c_size_t(1), byref(value))
        return value.value.decode() if kind == "String" else value.value

    def set(self, variable: str, value: object) -> None:
        reference, kind = self.variables[variable]
        kind = "Integer" if kind == "Enumeration" else kind
        text = value.encode() if isinstance(value, str) else value
        value = {"Real": c_double, "String": c_char_p}.get(kind, c_int)(text)
        self.call(f"Set{kind}", byref(c_uint(reference)), c_size_t(1), byref(value))

    def reals(self, function: str, count: int) -> np.ndarray:
        values = (c_double * count)()
        self.call(function, values, c_size_t(count))
        return np.array(values)

    # Co-simulation

    def do_step(self, time: float, size: float) -> None:
        self.call("DoStep", c_double(time), c_double(size), c_int(1))

    def end(self) -> tuple[float, bool]:
        """After a discarded step: the time that was reached, and whether the model asked for the end."""
        time, terminated = c_double(), c_int()
        self.call("GetRealStatus", c_int(LAST_SUCCESSFUL_TIME), byref(time))
        self.call("GetBooleanStatus", c_int(TERMINATED), byref(terminated))
        return time.value, bool(terminated.value)

    # Model Exchange

    def go_to(self, time: float, states: np.ndarray) -> None:
        self.call("SetTime", c_double(time))
        if self.state_count:
            count = self.state_count
            self.call("SetContinuousStates", (c_double * count)(*states), c_size_t(count))

    def derivatives(self, time: float, states: np.ndarray) -> np.ndarray:
        self.evaluations += 1
        self.go_to(time, states)
        return self.reals("GetDerivatives", self.state_count)

    def indicators(self, time: float, states: np.ndarray) -> np.ndarray:
        """Whether each event indicator is positive."""
        if not self.indicator_count:
            return np.zeros(0, bool)
        self.go_to(time, states)
        return self.reals("GetEventIndicators", self.indicator_count) > 0

    def handle_event(self) -> bool:
        """Event iteration, and back to Continuous-Time Mode. Whether the simulation goes on."""
        self.info.new_discrete_states_needed = 1
        while self.info.new_discrete_states_needed:
            self.call("NewDiscreteStates", byref(self.info))
            if self.info.terminate_simulation:
                return False
        self.call("EnterContinuousTimeMode")
        return True

    def exchange(
        self,
        times: Sequence[float],
        at: Callable[[float], None],
        method: type = Radau,
        rtol: float = 1e-10,
        at_event: Callable[[float], None] = lambda time: None,
    ) -> float:
        """Simulates to the last of the times. `at` is called at each of them, where variables can be read,
        and `at_event` after each event. Returns the time that was reached."""
        time, pending = times[0], list(times)
        goes_on = self.handle_event()
        at_event(time)
        while True:
            while pending and pending[0] <= time:
                at(pending.pop(0))
            if not goes_on or not pending:
                self.call("Terminate")
                return time
            time = self.integrate(time, times[-1], pending, at, method, rtol)
            is_due = self.info.next_event_time_defined and time >= self.info.next_event_time
            if is_due or self.has_crossed:
                self.call("EnterEventMode")
                goes_on = self.handle_event()
                at_event(time)

    def integrate(
        self,
        time: float,
        stop: float,
        pending: list[float],
        at: Callable[[float], None],
        method: type,
        rtol: float,
    ) -> float:
        """Integrates up to the next event, or the end. Returns the time that was reached."""
        self.has_crossed = False
        until = min(stop, self.info.next_event_time) if self.info.next_event_time_defined else stop
        states = self.reals("GetContinuousStates", self.state_count) if self.state_count else np.zeros(0)
        before = self.indicators(time, states)
        if not self.state_count:
            self.pass_on(pending, until, lambda _: states, at)
            self.go_to(until, states)
            return until
        atol = rtol * self.reals("GetNominalsOfContinuousStates", self.state_count)
        solver = method(self.derivatives, time, states, until, rtol=rtol, atol=atol)
        while solver.status == "running":
            begin = solver.t
            solver.step()
            assert solver.status != "failed", f"SciPy's solver failed at {solver.t} s"
            self.steps += 1
            dense = solver.dense_output()
            end = self.first_change(begin, solver.t, dense, before)
            self.pass_on(pending, end, dense, at)
            self.go_to(end, solver.y if end == solver.t else dense(end))
            event, ends = c_int(), c_int()
            self.call("CompletedIntegratorStep", c_int(1), byref(event), byref(ends))
            assert (event.value, ends.value) == (0, 0), "no model of the ladder has step events"
            if self.has_crossed:
                return end
        return solver.t

    def first_change(
        self, begin: float, end: float, dense: Callable[[float], np.ndarray], before: np.ndarray
    ) -> float:
        """The first time in a step at which an event indicator has changed, otherwise its end."""

        def changed(time: float) -> bool:
            return bool((self.indicators(time, dense(time)) != before).any())

        # A step may cross twice: it is searched in eight places.
        left = begin
        for place in np.linspace(begin, end, 9)[1:]:
            if changed(place):
                break
            left = place
        else:
            return end
        self.has_crossed, right = True, place
        while left < (middle := left + 0.5 * (right - left)) < right:
            left, right = (left, middle) if changed(middle) else (middle, right)
        return right

    def pass_on(
        self,
        pending: list[float],
        end: float,
        dense: Callable[[float], np.ndarray],
        at: Callable[[float], None],
    ) -> None:
        """Calls `at` for the times before the end of a step."""
        while pending and pending[0] < end:
            time = pending.pop(0)
            self.go_to(time, dense(time))
            at(time)

    def free(self) -> None:
        self.library.fmi2FreeInstance(self.component)


__all__ = ["CO_SIMULATION", "DISCARD", "DOP853", "MODEL_EXCHANGE", "Failed", "Instance", "Radau"]
