"""The cost of a gradient in CasADi: with an FMU's adjoint derivatives, its Jacobian and finite differences,
and with a model in CasADi symbols.

python examples/optimal_control/gradient_cost.py VAN_DER_POL.fmu

prints the two tables of docs/masters.md: the gradient of the weighted right-hand side with respect to states
and inputs, and of the fastest step's objective with respect to all valves. The argument is the template
van_der_pol, exported as FMI 3.0 for Model Exchange.
"""

import sys
import time
from functools import partial

import casadi as ca
import numpy as np
from casadi_plant import load, voltage
from cosimulation import END_KPA, STEP
from fastest_step import SAMPLES, Shooting

CALLS = 2000
"""In one call of a mapped function, to exclude Python."""

DIFFERENCE = 1e-6
"""Relative, of finite differences."""


def timed(call, repeat=5):
    """The shortest time (s) of some calls, and their result."""
    times = []
    for _ in range(repeat):
        begin = time.perf_counter()
        result = call()
        times.append(time.perf_counter() - begin)
    return min(times), result


def ways(model, x, u):
    """Functions for the weighted sum of a model's derivatives, and its gradient in three ways."""
    states, inputs, weights = (ca.MX.sym("", count) for count in (len(x), len(u), len(x)))
    both, value = ca.vertcat(states, inputs), model(states, inputs)
    by_state, by_input = model.jacobian()(states, inputs, ca.DM(len(x), 1))
    differences = []
    for at, unit in zip([*x, *u], np.eye(len(x) + len(u)), strict=True):
        step = DIFFERENCE * max(abs(at), 1.0)
        moved = ca.vertsplit(both + step * unit, [0, len(x), len(x) + len(u)])
        differences.append(ca.dot(weights, model(*moved) - value) / step)
    results = (
        ca.dot(weights, value),
        ca.jtimes(value, both, weights, True),
        ca.horzcat(by_state, by_input).T @ weights,
        ca.vertcat(*differences),
    )
    return [ca.Function("way", [states, inputs, weights], [result]) for result in results]


def right_hand_sides(van_der_pol):
    """Models by their names, with states and inputs to evaluate at."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u", 0)
    derivatives = ca.vertcat(x[1], (1 - x[0] ** 2) * x[1] - x[0])
    symbolic = ca.Function("symbolic", [x, u], [derivatives])
    exported = ca.DaeBuilder("van_der_pol", van_der_pol).create("exported", ["x", "u"], ["ode"])
    plant = load(["supply_voltage", "lp_wastegate"])
    point = [2.0, 0.5], []
    return {
        "Van der Pol, CasADi's symbols": (symbolic, *point),
        "Van der Pol, FMU": (exported, *point),
        "BoostPlant, FMU": (plant.derivatives, plant.start, [voltage(40.0), 0.1]),
    }


def print_right_hand_sides(van_der_pol):
    print("| right-hand side | itself | adjoint | Jacobian | finite differences | their error |")
    print("|---|---|---|---|---|---|")
    for name, (model, x, u) in right_hand_sides(van_der_pol).items():
        functions = ways(model, x, u)
        point = [np.reshape(each, (-1, 1)) for each in (x, u, np.ones(len(x)))]
        repeated = [np.tile(each, (1, CALLS)) for each in point]
        times = [timed(partial(each.map(CALLS), *repeated))[0] / CALLS for each in functions]
        adjoint, jacobian, differences = (each(*point).full() for each in functions[1:])
        scale = np.max(np.abs(adjoint))
        assert np.max(np.abs(jacobian - adjoint)) < 1e-12 * scale
        error = np.max(np.abs(differences - adjoint)) / scale
        print(f"| {name} |" + "".join(f" {1e6 * each:.1f} µs |" for each in times) + f" {error:.0e} |")


def print_objective(engine_speed=1500.0, start=(44.0, 0.0)):
    shooting = Shooting(engine_speed, start)
    # The duty moves: at rest, friction and valve are at kinks, with different derivatives on either side.
    valves = np.vstack([0.35 + 0.05 * np.sin(np.arange(SAMPLES) / 7), np.full(SAMPLES, 0.1)])
    symbols = ca.MX.sym("valves", 2, SAMPLES)
    row, unit = shooting.boost
    error = shooting.trajectory(shooting.start, symbols)[row, :] * unit - END_KPA
    value = ca.Function("value", [symbols], [STEP * ca.sumsqr(error)])
    adjoint = ca.Function("adjoint", [symbols], [ca.gradient(value(symbols), symbols)])

    def by_jacobians():
        states, boost, _ = shooting.simulate(valves)
        by_boost, _ = shooting.sensitivities(states, valves)
        return 2 * STEP * by_boost.T @ (boost - END_KPA)

    def by_differences():
        base = float(value(valves))
        moved = (valves + DIFFERENCE * each.reshape(SAMPLES, 2).T for each in np.eye(valves.size))
        return np.array([(float(value(each)) - base) / DIFFERENCE for each in moved])

    simulation, _ = timed(lambda: value(valves))
    exact = by_jacobians()
    print(f"\n| objective of the fastest step, {valves.size} valves | time | in simulations | error |")
    print("|---|---|---|---|")
    print(f"| itself: one simulation | {1e3 * simulation:.0f} ms | 1 | |")
    for name, call, repeat in (
        ("adjoint", lambda: adjoint(valves).full().ravel("F"), 5),
        ("Jacobians, with those of the shaft", by_jacobians, 5),
        ("finite differences", by_differences, 1),
    ):
        taken, found = timed(call, repeat)
        off = np.max(np.abs(found - exact)) / np.max(np.abs(exact))
        print(f"| {name} | {1e3 * taken:.0f} ms | {taken / simulation:.0f} | {off:.0e} |")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    print_right_hand_sides(sys.argv[1])
    print_objective()
