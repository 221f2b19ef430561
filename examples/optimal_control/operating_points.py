"""The operating points with the lowest exhaust pressure for a boost: a nonlinear program for each."""

import casadi as ca
import numpy as np
from casadi_plant import KRPM, load, voltage
from fastest_step import DUTY_RANGE

SHAFT_LIMIT = 210.0  # krpm

HELD = ["tank.pressure", "actuator.velocity", "actuator.friction_force"]
"""At their start values: the tank's, and 0 for a rod at rest."""

BALANCED_ELSEWHERE = ["tank.pressure", "actuator.position", "actuator.friction_force"]
"""Derivatives excluded from the conditions: the tank fills slowly, and the other two are 0 for a rod at
rest."""


class OperatingPoints:
    """Solves for one point after another, each starting from the previous one."""

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
                # Second derivatives jump at rest, where the chamber valve changes sides.
                "ipopt.hessian_approximation": "limited-memory",
                # Otherwise Ipopt evaluates 1e-8 beyond the bounds, outside the inputs' ranges.
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
        """The valves at an engine speed (rpm) and a boost (kPa): duty (%), low-pressure wastegate, bypass."""
        balanced = np.zeros(self.solver.size1_in("lbg"))
        balanced[-1] = boost * 1e3 / self.plant.nominal[self.boost]
        found = self.solver(
            x0=self.guess, p=engine_speed, lbx=self.lowest, ubx=self.highest, lbg=balanced, ubg=balanced
        )
        self.guess = found["x"].full().ravel()
        return self.guess[-3:] * [100, 1, 1]
