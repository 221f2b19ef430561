"""A master for Model Exchange, on FMPy's raw interface and its CVode.

Each FMU has a solver of its own. They are coupled at events: what the controller passes to the plant changes
at its samples alone, and it has no states.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from fmpy.fmi2 import FMU2Model
from fmpy.sundials import CVodeSolver

from fmu.master import Fmu, Instance, Value

EARLY = 1e-9
"""Times that are nearer than this, relatively, are the same: a solver's are computed with rounding."""


class NoInputs:
    """What FMPy's solver sets in its root function: nothing, as inputs are constant between events."""

    def apply(self, time: float) -> None:
        """Sets nothing."""


class Exchange(Instance):
    """An instance for Model Exchange, and the solver of its states."""

    def __init__(self, fmu: Fmu, tolerance: float = 1e-6) -> None:
        super().__init__(fmu, kind=FMU2Model)
        self.tolerance = tolerance
        self.time = 0.0
        self.next_event = np.inf
        self.terminates = False
        self.calls = dict.fromkeys(["derivatives", "events", "roots"], 0)
        self.states = fmu.description.numberOfContinuousStates
        self.indicators = fmu.description.numberOfEventIndicators
        self.solver: Any = None

    def go(self) -> Exchange:
        """Begins after the initialization: the event at the start, and the solver."""
        self._iterate()
        self.slave.enterContinuousTimeMode()
        if self.states:
            self.solver = self._solver()
        return self

    def _solver(self) -> CVodeSolver:
        model = self.slave

        def derivatives(values: Any, count: int) -> None:
            self.calls["derivatives"] += 1
            model.fmi2GetDerivatives(model.component, values, count)

        return CVodeSolver(
            nx=self.states,
            nz=self.indicators,
            get_x=lambda values, count: model.fmi2GetContinuousStates(model.component, values, count),
            set_x=lambda values, count: model.fmi2SetContinuousStates(model.component, values, count),
            get_dx=derivatives,
            get_z=self.get_indicators,
            get_nominals=lambda values, count: model.fmi2GetNominalsOfContinuousStates(
                model.component, values, count
            ),
            set_time=model.setTime,
            input=NoInputs(),
            startTime=self.time,
            relativeTolerance=self.tolerance,
            maxNumSteps=100_000,
        )

    def get_indicators(self, values: Any, count: int) -> None:
        """What the solver finds the roots of."""
        self.slave.fmi2GetEventIndicators(self.slave.component, values, count)

    def _iterate(self) -> None:
        needed = True
        while needed:
            needed, self.terminates, _, _, has_next, next_time = self.slave.newDiscreteStates()
            self.next_event = next_time if has_next else np.inf
            assert self.next_event > self.time, "the next event must be ahead"

    def event(self, change: Callable[[], object] = lambda: None) -> None:
        """An event now, in which `change` may set inputs."""
        self.calls["events"] += 1
        self.slave.enterEventMode()
        change()
        self._iterate()
        self.slave.enterContinuousTimeMode()
        if self.solver:
            self.solver.reset(self.time)

    def advance(self, end: float) -> None:
        """Integrates to a time, with the events before it; one that is due then is left to the caller."""
        while self.time < end:
            target = min(end, self.next_event)
            has_root = False
            if self.solver:
                has_root, _, self.time = self.solver.step(self.time, target)
            else:
                self.time = target
            self.slave.setTime(self.time)
            self.calls["roots"] += has_root
            if has_root or (self.is_due() and self.time < end):
                self.event()

    def is_due(self) -> bool:
        """Whether the time event that was announced is reached."""
        return self.next_event <= self.time * (1.0 + EARLY)

    def begin(
        self,
        values: Mapping[str, Value] | None = None,
        start_time: float = 0.0,
        stop_time: float | None = None,
        tolerance: float | None = None,
    ) -> Exchange:
        self.time = start_time
        super().begin(values, start_time, stop_time, tolerance)
        return self
