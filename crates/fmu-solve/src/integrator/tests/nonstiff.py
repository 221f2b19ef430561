"""Prints what SciPy's DOP853 ends at, and takes, for the nonstiff systems of `tests.rs`: constants there."""

import numpy as np
from scipy.integrate import solve_ivp

TOLERANCES = [1e-4, 1e-6, 1e-8, 1e-10]


def pleiades(_, state):
    x, y, u, v = np.split(state, 4)
    across, up = x - x[:, None], y - y[:, None]
    cubes = (across**2 + up**2) ** 1.5
    np.fill_diagonal(cubes, 1.0)
    masses = np.arange(1, 8)
    return np.concatenate([u, v, (masses * across / cubes).sum(1), (masses * up / cubes).sum(1)])


def arenstorf(_, state):
    x, y, u, v = state
    moon = 0.012277471
    earth = 1.0 - moon
    to_earth, to_moon = ((x + moon) ** 2 + y**2) ** 1.5, ((x - earth) ** 2 + y**2) ** 1.5
    pull = earth * (x + moon) / to_earth + moon * (x - earth) / to_moon
    return [u, v, x + 2 * v - pull, y - 2 * u - y * (earth / to_earth + moon / to_moon)]


def lorenz(_, state):
    x, y, z = state
    return [10 * (y - x), x * (28 - z) - y, x * y - 8 / 3 * z]


STARS = [3, 3, -1, -3, 2, -2, 2, 3, -3, 2, 0, 0, -4, 4] + [0] * 5 + [1.75, -1.5, 0, 0, 0, -1.25, 1, 0, 0]
for name, rates, start, end in [
    ("PLEIADES", pleiades, STARS, 3.0),
    ("ARENSTORF", arenstorf, [0.994, 0.0, 0.0, -2.0015851063790825], 17.065216560157964),
    ("LORENZ", lorenz, [1.0, 1.0, 1.0], 10.0),
]:

    def solve(tolerance, rates=rates, start=start, end=end):
        return solve_ivp(rates, (0, end), np.array(start, float), "DOP853", rtol=tolerance, atol=tolerance)

    exact = solve(1e-13).y[:, -1]
    print(name, [float(state) for state in exact])
    for tolerance in TOLERANCES:
        found = solve(tolerance)
        error = max(abs(found.y[:, -1] - exact) / (1 + abs(exact)))
        print(f"    ({error:.2e}, {found.nfev}),")
