"""The systems without events, and their solutions: prints solutions.csv, by SciPy's Radau at a relative
tolerance of 1e-12. Run with SciPy 1.17.1. That of HIRES agrees at its last time with the one that Hairer and
Wanner publish, which a Taylor series in 30 digits gives as well."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp


@dataclass
class System:
    """States from a start, their rates and Jacobian, and the times of the printed solution."""

    rates: Callable
    jacobian: Callable
    start: list
    nominal: float
    times: list


def decay():
    return System(lambda _, x: [-x[0]], lambda _, x: [[-1.0]], [1.0], 1.0, [3.0])


def van_der_pol(mu, times):
    def rates(_, x):
        return [x[1], mu * (1 - x[0] ** 2) * x[1] - x[0]]

    def jacobian(_, x):
        return [[0, 1], [-2 * mu * x[0] * x[1] - 1, mu * (1 - x[0] ** 2)]]

    return System(rates, jacobian, [2.0, 0.0], 1.0, times)


def robertson():
    def rates(_, y):
        slow, fast, back = 0.04 * y[0], 3e7 * y[1] ** 2, 1e4 * y[1] * y[2]
        return [back - slow, slow - back - fast, fast]

    def jacobian(_, y):
        a, b = 1e4 * y[2], 1e4 * y[1]
        return [[-0.04, a, b], [0.04, -a - 6e7 * y[1], -b], [0, 6e7 * y[1], 0]]

    return System(rates, jacobian, [1.0, 0.0, 0.0], 1e-5, [0.4, 40.0, 4e3, 4e5, 4e7, 4e9, 4e11])


def hires():
    # By rows: what each rate takes of each state, but for the reaction of y[5] with y[7].
    linear = np.array(
        [
            [-1.71, 0.43, 8.32, 0, 0, 0, 0, 0],
            [1.71, -8.75, 0, 0, 0, 0, 0, 0],
            [0, 0, -10.03, 0.43, 0.035, 0, 0, 0],
            [0, 8.32, 1.71, -1.12, 0, 0, 0, 0],
            [0, 0, 0, 0, -1.745, 0.43, 0.43, 0],
            [0, 0, 0, 0.69, 1.71, -0.43, 0.69, 0],
            [0, 0, 0, 0, 0, 0, -1.81, 0],
            [0, 0, 0, 0, 0, 0, 1.81, 0],
        ]
    )
    reaction = np.array([0, 0, 0, 0, 0, -280, 280, -280])
    constant = np.array([0.0007, 0, 0, 0, 0, 0, 0, 0])

    def rates(_, y):
        return linear @ y + reaction * (y[5] * y[7]) + constant

    def jacobian(_, y):
        of_both = np.zeros(8)
        of_both[5], of_both[7] = y[7], y[5]
        return linear + np.outer(reaction, of_both)

    # The last time is that of the collections of test problems, which give the solution there.
    return System(rates, jacobian, [1, 0, 0, 0, 0, 0, 0, 0.0057], 1e-3, [5.0, 50.0, 321.8122])


SYSTEMS = {
    "decay": decay(),
    "van_der_pol_1": van_der_pol(1.0, [5.0, 10.0, 15.0, 20.0]),
    "van_der_pol_1000": van_der_pol(1000.0, [500.0, 1000.0, 1500.0, 2000.0]),
    "robertson": robertson(),
    "hires": hires(),
}


def main():
    for name, system in SYSTEMS.items():
        solution = solve_ivp(
            system.rates,
            (0, system.times[-1]),
            system.start,
            "Radau",
            system.times,
            jac=system.jacobian,
            rtol=1e-12,
            atol=1e-14 * system.nominal,
        )
        for time, states in zip(system.times, solution.y.T, strict=True):
            print(name, time, *(f"{state:.12e}" for state in states), sep=",")


if __name__ == "__main__":
    main()
