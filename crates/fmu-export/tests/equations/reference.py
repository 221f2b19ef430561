"""Prints solutions.csv: Van der Pol's oscillator and Robertson's reaction by SciPy's Radau at a relative tolerance of
1e-12. Run with SciPy 1.17.1."""

import numpy as np
from scipy.integrate import solve_ivp


def van_der_pol(mu):
    def rates(_, x):
        return [x[1], mu * (1 - x[0] ** 2) * x[1] - x[0]]

    def jacobian(_, x):
        return [[0, 1], [-2 * mu * x[0] * x[1] - 1, mu * (1 - x[0] ** 2)]]

    return rates, jacobian


def robertson(_, y):
    slow, fast, back = 0.04 * y[0], 3e7 * y[1] ** 2, 1e4 * y[1] * y[2]
    return [back - slow, slow - back - fast, fast]


def robertson_jacobian(_, y):
    a, b = 1e4 * y[2], 1e4 * y[1]
    return [[-0.04, a, b], [0.04, -a - 6e7 * y[1], -b], [0, 6e7 * y[1], 0]]


def show(name, rates, jacobian, start, times, scale):
    solution = solve_ivp(
        rates, (0, times[-1]), start, "Radau", times, jac=jacobian, rtol=1e-12, atol=1e-14 * np.array(scale)
    )
    for time, states in zip(times, solution.y.T, strict=True):
        print(name, time, *(f"{state:.12e}" for state in states), sep=",")


show("van_der_pol_1", *van_der_pol(1.0), [2.0, 0.0], [5.0, 10.0, 15.0, 20.0], [1.0, 1.0])
show("van_der_pol_1000", *van_der_pol(1000.0), [2.0, 0.0], [500.0, 1000.0, 1500.0, 2000.0], [1.0, 1.0])
times = [0.4, 40.0, 4e3, 4e5, 4e7, 4e9, 4e11]
show("robertson", robertson, robertson_jacobian, [1.0, 0.0, 0.0], times, [1.0, 1e-5, 1.0])
