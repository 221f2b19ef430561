"""Solves the systems of the built-in integrator's rows, which are given, by SciPy and by CVODE, and prints a
table for each: work against error."""

import csv
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from sksundae.cvode import CVODE

EQUATIONS = Path(__file__).parents[2] / "crates/fmu-export/tests/equations"
sys.path.append(str(EQUATIONS))

from reference import SYSTEMS, System  # noqa: E402

TITLES = {
    "decay": "Exponential decay to 3 s",
    "van_der_pol_1": "Van der Pol, μ = 1, to 20 s",
    "bouncing_ball": "Bouncing ball to 2 s, four bounces",
    "robertson": "Robertson to 4·10⁵ s",
    "van_der_pol_1000": "Van der Pol, μ = 1000, to 2000 s",
    "hires": "HIRES to 321.8122 s",
}
STIFF = {"robertson", "van_der_pol_1000", "hires"}


class Counted:
    """A function that counts its calls."""

    def __init__(self, function):
        self.function = function
        self.calls = 0

    def __call__(self, *arguments):
        self.calls += 1
        return self.function(*arguments)


class Ball:
    """The ball that bounces, with the parameters of bouncing_ball.json."""

    RESTITUTION, GRAVITY = 0.7, 9.81
    SYSTEM = System(lambda _, x: [x[1], -Ball.GRAVITY], lambda _, x: [[0, 1], [0, 0]], [1.0, 0.0], 1.0, [2.0])

    @staticmethod
    def height(_, x):
        return x[0]

    @staticmethod
    def bounced(x):
        return [0.0, -Ball.RESTITUTION * x[1]]

    @staticmethod
    def solution(end):
        """Its flight after the last bounce before an end."""
        speed = (2 * Ball.GRAVITY) ** 0.5
        time = speed / Ball.GRAVITY
        while True:
            speed *= Ball.RESTITUTION
            if time + 2 * speed / Ball.GRAVITY > end:
                flight = end - time
                return [speed * flight - Ball.GRAVITY * flight**2 / 2, speed - Ball.GRAVITY * flight]
            time += 2 * speed / Ball.GRAVITY


# What `solve_ivp` takes an event by.
Ball.height.terminal, Ball.height.direction = True, -1


def by_scipy(method, system, end, tolerance, bounces):
    """The states at the end, calls of the rates and of the Jacobian, steps."""
    rates, jacobian = Counted(system.rates), Counted(system.jacobian)
    options = {"jac": jacobian} if method in {"Radau", "BDF", "LSODA"} else {}
    time, states, steps = 0.0, system.start, 0
    while time < end:
        part = solve_ivp(
            rates,
            (time, end),
            states,
            method,
            events=Ball.height if bounces else None,
            rtol=tolerance,
            atol=tolerance * system.nominal,
            # A first step beyond the next bounce would hide it: at its begin, the ball is on the ground.
            first_step=1e-3 if bounces else None,
            **options,
        )
        if not part.success:
            raise RuntimeError(part.message)
        time, states, steps = part.t[-1], part.y[:, -1], steps + len(part.t) - 1
        if part.status == 1:
            states = Ball.bounced(states)
    return states, rates.calls, jacobian.calls, f"{steps}"


def by_cvode(_, system, end, tolerance, bounces):
    """As `by_scipy`, by CVODE's BDF."""
    rates, jacobian = Counted(system.rates), Counted(system.jacobian)

    def set_rates(time, states, result):
        result[:] = rates(time, states)

    def set_jacobian(time, states, _, matrix):
        matrix[:] = jacobian(time, states)

    def set_height(time, states, result):
        result[0] = Ball.height(time, states)

    set_height.terminal, set_height.direction = [True], [-1]
    solver = CVODE(
        set_rates,
        rtol=tolerance,
        atol=tolerance * system.nominal,
        jacfn=set_jacobian,
        max_num_steps=1_000_000,
        **({"eventsfn": set_height, "num_events": 1} if bounces else {}),
    )
    time, states = 0.0, system.start
    while time < end:
        part = solver.solve([time, end], states)
        if not part.success:
            raise RuntimeError(part.message)
        time, states = part.t[-1], part.y[-1]
        if time < end:
            states = Ball.bounced(states)
    return states, rates.calls, jacobian.calls


SOLVERS = {
    "CVODE (BDF)": by_cvode,
    "Radau": by_scipy,
    "BDF": by_scipy,
    "LSODA": by_scipy,
    "DOP853": by_scipy,
}


def cell(states, reference, nominal, work):
    """The largest error, relative to a state and its nominal value together, and the work."""
    reference = np.array(reference)
    error = max(abs(states - reference) / (abs(reference) + nominal))
    rates, jacobians, *steps = work
    return ", ".join([f"{error:.0e}: {rates} f, {jacobians} J", *steps])


def main(path):
    own = defaultdict(list)
    with open(path, newline="") as file:
        for name, *numbers in csv.reader(file):
            own[name].append(numbers)
    references = {}
    with open(EQUATIONS / "solutions.csv", newline="") as file:
        for name, time, *states in csv.reader(file):
            references[name, float(time)] = [float(state) for state in states]
    for name, title in TITLES.items():
        bounces = name == "bouncing_ball"
        system = Ball.SYSTEM if bounces else SYSTEMS[name]
        end = 4e5 if name == "robertson" else system.times[-1]
        reference = Ball.solution(end) if bounces else references[name, end]
        print(f"\n| {title} |", *(f"{row[0].replace('0.0001', '1e-4')} |" for row in own[name]))
        print("|---" * (1 + len(own[name])) + "|")
        cells = []
        for _, rates, jacobians, *states in own[name]:
            states = np.array([float(state) for state in states])
            cells.append(cell(states, reference, system.nominal, (rates, jacobians)))
        print("| built in |", " | ".join(cells), "|")
        for method, solve in SOLVERS.items():
            if method == "DOP853" and name in STIFF:
                continue
            cells = []
            for tolerance, *_ in own[name]:
                states, *work = solve(method, system, end, float(tolerance), bounces)
                cells.append(cell(states, reference, system.nominal, work))
            print(f"| {method} |", " | ".join(cells), "|")


if __name__ == "__main__":
    main(sys.argv[1])
