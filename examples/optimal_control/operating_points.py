"""The steady states with the least exhaust pressure for a boost: a small nonlinear program for each, over all valves."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from fastest_step import DUTY_RANGE
from plant import KRPM, load, voltage

SHAFT_LIMIT = 210.0  # krpm

HELD = ["tank.pressure", "actuator.velocity", "actuator.friction_force"]
"""What a steady state does not determine: the tank, a rod at rest, and its friction."""

BALANCED_ELSEWHERE = ["tank.pressure", "actuator.position", "actuator.friction_force"]
"""Their derivatives are those of the tank, or are zero for a rod at rest."""


@dataclass
class Point:
    """An optimum: valves (duty in %, openings), kPa and krpm."""

    valves: list[float]
    exhaust_pressure: float
    boost: float
    shaft: float


class OperatingPoints:
    """Solves for one point after another, each from the one before."""

    def __init__(self):
        inputs = ["supply_voltage", "lp_wastegate", "hp_bypass", "engine_speed"]
        plant = load(inputs, supply_voltage=voltage(40.0))
        self.plant, count = plant, len(plant.states)
        at = {name: i for i, name in enumerate(plant.states)}
        self.boost = at["intercooler.outlet_pressure"]
        self.shaft, self.exhaust = at["hp_shaft.speed"], at["exhaust_manifold.pressure"]
        x, valves, engine_speed = ca.MX.sym("x", count), ca.MX.sym("valves", 3), ca.MX.sym("engine_speed")
        given = ca.vertcat(voltage(100 * valves[0]), valves[1:], engine_speed)
        balances = [i for name, i in at.items() if name not in BALANCED_ELSEWHERE]
        self.solver = ca.nlpsol(
            "operating_point",
            "ipopt",
            {
                "x": ca.vertcat(x, valves),
                "p": engine_speed,
                "f": x[self.exhaust],
                "g": ca.vertcat(plant.derivatives(x, given)[balances], x[self.boost]),
            },
            {
                # The second derivatives jump where the valve of the chamber is at rest.
                "ipopt.hessian_approximation": "limited-memory",
                # No valve beyond its bounds, not even by 1e-8, which Ipopt allows otherwise.
                "ipopt.bound_relax_factor": 0.0,
                "ipopt.print_level": 0,
                "ipopt.sb": "yes",
                "print_time": False,
                "error_on_fail": True,
            },
        )
        self.lowest = np.append(np.full(count, -np.inf), [DUTY_RANGE[0] / 100, 0, 0])
        self.highest = np.append(np.full(count, np.inf), [DUTY_RANGE[1] / 100, 1, 1])
        for name in HELD:
            self.lowest[at[name]] = self.highest[at[name]] = plant.start[at[name]]
        self.highest[self.shaft] = SHAFT_LIMIT / KRPM / plant.nominal[self.shaft]
        self.guess = np.append(plant.start, [0.4, 0.0, 0.0])

    def solve(self, engine_speed, boost):
        """At an engine speed (rpm) and a boost (kPa)."""
        balanced = np.zeros(self.solver.size1_in("lbg"))
        balanced[-1] = boost * 1e3 / self.plant.nominal[self.boost]
        found = self.solver(
            x0=self.guess, p=engine_speed, lbx=self.lowest, ubx=self.highest, lbg=balanced, ubg=balanced
        )
        self.guess = found["x"].full().ravel()
        x = self.guess[:-3] * self.plant.nominal
        return Point(
            valves=list(self.guess[-3:] * [100, 1, 1]),
            exhaust_pressure=x[self.exhaust] / 1e3,
            boost=x[self.boost] / 1e3,
            shaft=x[self.shaft] * KRPM,
        )
