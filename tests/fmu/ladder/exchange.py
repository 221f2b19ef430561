"""Model Exchange by the pseudocode of the standard (FMI 2.0.5, section 3.2.4) around SciPy's Radau or
DOP853, with state events located in their dense output."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from ctypes import byref, c_int
from pathlib import Path

import numpy as np
from importer import Fmu, Instance, Library
from scipy.integrate import DOP853, Radau


class Exchange(Instance):
    """An instance of an FMU with its resources, after initialization: for co-simulation, or with a solver."""

    def __init__(
        self,
        path: Path,
        folder: Path,
        kind: int,
        start_values: Mapping[str, object] | None = None,
        start_time: float = 0.0,
        tolerance: float | None = None,
        resources: bytes | None = b"",
    ):
        fmu = Fmu(path, folder)
        if resources == b"":
            resources = (fmu.folder / "resources").resolve().as_uri().encode()
        super().__init__(fmu, Library(fmu.library), fmu_type=kind, resource_location=resources)
        assert self.component, self.messages
        self.state_count = len(fmu.description.derivatives)
        self.indicator_count = fmu.description.numberOfEventIndicators
        self.steps = 0
        for name, value in (start_values or {}).items():
            self.ok(*self.settings({name: value}))
        self.initialize(start_time, tolerance=tolerance)

    def go_to(self, time: float, states: np.ndarray) -> None:
        self.ok("fmi2SetTime", time)
        if self.state_count:
            self.set_states(*states)

    def derivatives(self, time: float, states: np.ndarray) -> np.ndarray:
        self.go_to(time, states)
        return np.array(self.vector("Derivatives"))

    def indicators(self, time: float, states: np.ndarray) -> np.ndarray:
        """Whether each event indicator is positive."""
        if not self.indicator_count:
            return np.zeros(0, bool)
        self.go_to(time, states)
        return np.array(self.vector("EventIndicators")) > 0

    def handle_event(self) -> bool:
        """Event iteration, and back to Continuous-Time Mode. Returns whether the simulation continues."""
        needed = True
        while needed:
            self.info = self.new_discrete_states()
            needed = self.info.newDiscreteStatesNeeded
            if self.info.terminateSimulation:
                return False
        self.ok("fmi2EnterContinuousTimeMode")
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
                self.ok("fmi2Terminate")
                return time
            time = self.integrate(time, times[-1], pending, at, method, rtol)
            is_due = self.info.nextEventTimeDefined and time >= self.info.nextEventTime
            if is_due or self.has_crossed:
                self.ok("fmi2EnterEventMode")
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
        until = min(stop, self.info.nextEventTime) if self.info.nextEventTimeDefined else stop
        states = np.array(self.vector("ContinuousStates") if self.state_count else [])
        before = self.indicators(time, states)
        if not self.state_count:
            self.pass_on(pending, until, lambda _: states, at)
            self.go_to(until, states)
            return until
        atol = rtol * np.array(self.vector("NominalsOfContinuousStates"))
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
            self.ok("fmi2CompletedIntegratorStep", 1, byref(event), byref(ends))
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


__all__ = ["DOP853", "Exchange", "Radau"]
