"""The fastest boost step: direct shooting with the plant's Jacobians.

The valves are constant in each controller sample. They minimize the integral of the squared boost error, with
a small penalty on their moves, while the high-pressure shaft stays below a limit. Each iteration simulates
the plant, linearizes it along the trajectory and solves a quadratic program (Gauss-Newton) in a trust region.

Every iterate is thus a trajectory of the plant. With collocation and multiple shooting it is not, and Ipopt
did not converge: the plant has kinks, such as the wastegate rod's stops.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from casadi_plant import KRPM, load, voltage
from cosimulation import END_KPA, STEP

HORIZON = 2.0  # s
SAMPLES = round(HORIZON / STEP)

SUBSTEPS = 10
"""Runge-Kutta steps per sample, of 1.25 ms: stable up to 1.7 ms, since the fastest time constant is 0.6 ms.
Boost is within 0.01 kPa of the co-simulation, the shaft within 0.01 krpm."""

DUTY_RANGE = 25.0, 75.0
"""In %: the controller's."""

MOVES = 4.0
"""kPa2.s for a valve move over its whole range in one sample; the error is some 1000 kPa2.s."""

BEYOND = 40.0
"""kPa2.s per krpm above the limit, or kPa beyond the tolerance at the end: more than a violation could
gain."""

END_TOLERANCE = 0.1  # kPa
RELATIVE_TOLERANCE = 1e-4
"""Converged if a step would reduce the objective by less."""

ITERATIONS = 60
"""At most."""


@dataclass
class Step:
    """An optimum: valves at each sample (duty in %, opening), boost (kPa) and shaft (krpm) after it."""

    valves: np.ndarray
    boost: np.ndarray
    shaft: np.ndarray
    objective: float
    iterations: int


class Shooting:
    """Boost and shaft as a function of the valves, one row each: duty (0 to 1), low-pressure wastegate."""

    def __init__(self, engine_speed, start):
        plant = load(
            ["supply_voltage", "lp_wastegate"],
            engine_speed=engine_speed,
            supply_voltage=voltage(start[0]),
            lp_wastegate=start[1],
        )
        self.start = plant.start
        self.boost = plant.row("intercooler.outlet_pressure", 1e-3)
        self.shaft = plant.row("hp_shaft.speed", KRPM)
        x, valves = ca.MX.sym("x", len(self.start)), ca.MX.sym("valves", 2)
        slopes, length = [], STEP / SUBSTEPS
        for weight in (0, length / 2, length / 2, length):
            at = x + weight * slopes[-1] if slopes else x
            slopes.append(plant.derivatives(at, ca.vertcat(voltage(100 * valves[0]), valves[1])))
        first, second, third, fourth = slopes
        after = x + length / 6 * (first + 2 * (second + third) + fourth)
        substep = ca.Function("substep", [x, valves], [after])
        end = x
        for _ in range(SUBSTEPS):
            end = substep(end, valves)
        self.sample = ca.Function("sample", [x, valves], [end])
        self.trajectory = self.sample.mapaccum(SAMPLES)
        self.jacobians = self.sample.jacobian().map(SAMPLES)

    def simulate(self, valves):
        """States, boost and shaft at the end of each sample."""
        states = self.trajectory(self.start, valves).full()
        return states, *(states[row] * unit for row, unit in (self.boost, self.shaft))

    def sensitivities(self, states, valves):
        """Jacobian of boost and shaft after each sample with respect to all valves, sample by sample."""
        begins = np.column_stack([self.start, states[:, :-1]])
        jacobians = self.jacobians(begins, valves, ca.DM(*states.shape))
        by_state, by_valves = (blocks.full() for blocks in jacobians)
        count = len(self.start)
        sensitivity = np.zeros((count, valves.size))
        boost, shaft = np.zeros((2, SAMPLES, valves.size))
        for k in range(SAMPLES):
            sensitivity = by_state[:, count * k : count * (k + 1)] @ sensitivity
            sensitivity[:, 2 * k : 2 * k + 2] = by_valves[:, 2 * k : 2 * k + 2]
            for rows, (row, unit) in ((boost, self.boost), (shaft, self.shaft)):
                rows[k] = sensitivity[row] * unit
        return boost, shaft


def fastest_step(engine_speed, start, limit):
    """From settled valves (duty in %, opening) to END_KPA, with the shaft below a limit (krpm)."""
    shooting = Shooting(engine_speed, start)
    before = np.array([start[0] / 100, start[1]])
    lowest = np.tile([DUTY_RANGE[0] / 100, 0.0], SAMPLES)
    highest = np.tile([DUTY_RANGE[1] / 100, 1.0], SAMPLES)
    moves = np.eye(2 * SAMPLES) - np.eye(2 * SAMPLES, k=-2)
    offset = np.concatenate([before, np.zeros(2 * SAMPLES - 2)])

    def objective(boost, shaft, values):
        moved = moves @ values - offset
        beyond = max(0.0, np.max(shaft) - limit, abs(boost[-1] - END_KPA) - END_TOLERANCE)
        return STEP * np.sum((boost - END_KPA) ** 2) + MOVES * moved @ moved + BEYOND * beyond

    # All valves, and the limit violations.
    size, rows = 2 * SAMPLES + 1, SAMPLES + 2
    dense = {"h": ca.Sparsity.dense(size, size), "a": ca.Sparsity.dense(rows, size)}
    program = ca.conic("program", "daqp", dense)
    values = np.tile(before, SAMPLES)
    states, boost, shaft = shooting.simulate(values.reshape(-1, 2).T)
    best, radius, linear = objective(boost, shaft, values), 0.1, None
    for iteration in range(1, ITERATIONS + 1):
        linear = linear or shooting.sensitivities(states, values.reshape(-1, 2).T)
        by_boost, by_shaft = linear
        error, moved = boost - END_KPA, moves @ values - offset
        hessian = np.zeros((size, size))
        hessian[:-1, :-1] = 2 * (STEP * by_boost.T @ by_boost + MOVES * moves.T @ moves)
        hessian[-1, -1] = 1e-6
        gradient = np.append(2 * (STEP * by_boost.T @ error + MOVES * moves.T @ moved), BEYOND)
        constraints = np.full((rows, size), -1.0)
        constraints[:, :-1] = np.vstack([by_shaft, by_boost[-1], -by_boost[-1]])
        solution = program(
            h=hessian,
            g=gradient,
            a=constraints,
            lba=-np.inf,
            uba=np.append(limit - shaft, [END_TOLERANCE - error[-1], END_TOLERANCE + error[-1]]),
            lbx=np.append(np.maximum(lowest - values, -radius), 0),
            ubx=np.append(np.minimum(highest - values, radius), np.inf),
        )
        step = solution["x"].full()[:-1, 0]
        expected = best - objective(boost + by_boost @ step, shaft + by_shaft @ step, values + step)
        if expected < RELATIVE_TOLERANCE * best:
            return Step(values.reshape(-1, 2) * [100, 1], boost, shaft, best, iteration)
        tried = np.clip(values + step, lowest, highest)
        result = shooting.simulate(tried.reshape(-1, 2).T)
        gain = best - objective(*result[1:], tried)
        if gain > 0.05 * expected:
            values, (states, boost, shaft), best, linear = tried, result, best - gain, None
        if gain > 0.7 * expected:
            radius *= 2
        elif gain < 0.3 * expected:
            radius = np.max(np.abs(step)) / 3
    raise RuntimeError(
        f"no optimum at {engine_speed} rpm in {ITERATIONS} iterations: a step still gains {expected} kPa2.s"
    )
