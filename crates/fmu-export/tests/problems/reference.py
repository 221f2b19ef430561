"""The problems a second time, and their solutions: prints solutions.csv, or of it the closed forms and the
problems that are named. A line has a problem's name, how much a perturbation grows, and the states at the
end, of large problems every 49th. Solutions that are no closed forms are by SciPy's DOP853 or Radau. Run with
SciPy 1.17.1."""

import sys

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.sparse import csc_array, diags_array, eye_array, kron

#: Of large problems, every such state is printed, from all rows and columns of a square; the fewest
#: states of a large problem, and of one that is solved at a lesser tolerance.
STRIDE, LARGE, MANY = 49, 1000, 200
#: Perturbations, relative to a state and its nominal value, begin at so many times of a solution, or of a
#: stiff one.
PERTURBATION, BEGINNINGS, FEW = 1e-7, 20, 3


def pleiades(_, states):
    x, y, *velocities = states.reshape(4, 7)
    masses = np.arange(1, 8)
    dx, dy = x - x[:, None], y - y[:, None]
    cubes = (dx**2 + dy**2 + np.eye(7)) ** 1.5
    return np.concatenate([*velocities, (dx / cubes) @ masses, (dy / cubes) @ masses])


#: Of each reaction: its coefficient, what goes in and what comes out, as Verwer lists them.
REACTIONS = [
    *((0.35, [1], [2, 3]), (26.6, [2, 4], [1]), (1.23e4, [5, 2], [6, 1]), (8.6e-4, [7], [5, 5, 8])),
    *((8.2e-4, [7], [8]), (1.5e4, [7, 6], [8, 5]), (1.3e-4, [9], [10, 8, 5]), (2.4e4, [9, 6], [11])),
    *(
        (1.65e4, [11, 2], [10, 12, 1]),
        (9e3, [11, 1], [13]),
        (0.022, [13], [11, 1]),
        (1.2e4, [10, 2], [14, 1]),
    ),
    *((1.88, [14], [7, 5]), (1.63e4, [1, 6], [15]), (4.8e6, [3], [4]), (3.5e-4, [4], [16])),
    *((0.0175, [4], [3]), (1e8, [16], [6, 6]), (4.44e11, [16], [3]), (1240.0, [17, 6], [18, 5])),
    *((2.1, [19], [2]), (5.78, [19], [1, 3]), (0.0474, [1, 4], [19]), (1780.0, [19, 1], [20])),
    (3.12, [20], [1, 19]),
]


def pollution(_, states):
    rates = np.zeros(20)
    for coefficient, ingoing, outgoing in REACTIONS:
        speed = coefficient * np.prod([states[species - 1] for species in ingoing])
        for species in ingoing:
            rates[species - 1] -= speed
        for species in outgoing:
            rates[species - 1] += speed
    return rates


def oregonator(_, y):
    a, b, c = y
    return [77.27 * (b + a * (1 - 8.375e-6 * a - b)), (c - (1 + a) * b) / 77.27, 0.161 * (a - c)]


def arenstorf(_, states):
    x, y, vx, vy = states
    moon = 0.012277471
    of_earth = ((x + moon) ** 2 + y**2) ** 1.5
    of_moon = ((x - 1 + moon) ** 2 + y**2) ** 1.5
    ax = x + 2 * vy - (1 - moon) * (x + moon) / of_earth - moon * (x - 1 + moon) / of_moon
    return [vx, vy, ax, y - 2 * vx - (1 - moon) * y / of_earth - moon * y / of_moon]


def lorenz(_, states):
    x, y, z = states
    return [10 * (y - x), x * (28 - z) - y, x * y - 8 / 3 * z]


PLACES = np.arange(32) / 31


def spread():
    """The Laplacian of the Brusselator's mirrored grid, by the pairs of concentrations in a cell."""
    line = diags_array([np.ones(31), -2 * np.ones(32), np.ones(31)], offsets=[-1, 0, 1]).tolil()
    line[0, 1] = line[-1, -2] = 2
    plane = kron(line, eye_array(32)) + kron(eye_array(32), line)
    return csc_array(0.02 * 31**2 * kron(plane, eye_array(2)))


SPREAD = spread()


def brusselator(_, states):
    u, v = states[::2], states[1::2]
    reaction = np.stack([1 + u**2 * v - 4.4 * u, 3.4 * u - u**2 * v], axis=1).ravel()
    return SPREAD @ states + reaction


def brusselator_jacobian(_, states):
    u, v = states[::2], states[1::2]
    blocks = np.zeros((1024, 2, 2))
    blocks[:, 0, 0], blocks[:, 0, 1] = 2 * u * v - 4.4, u**2
    blocks[:, 1, 0], blocks[:, 1, 1] = 3.4 - 2 * u * v, -(u**2)
    cells = 2 * np.arange(1024)
    rows = cells[:, None, None] + np.array([[0, 0], [1, 1]])
    columns = cells[:, None, None] + np.array([[0, 1], [0, 1]])
    return SPREAD + csc_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(2048, 2048))


def dense_matrices():
    places = np.arange(200)
    return 10 ** (4 * places / 199 - 1), 0.005 / (1 + abs(places - places[:, None]))


DECAYS, WEIGHTS = dense_matrices()


def dense(_, states):
    return -DECAYS * states + WEIGHTS @ states**2


def dense_jacobian(_, states):
    return -np.diag(DECAYS) + 2 * WEIGHTS * states


FREQUENCIES = np.sin(3.0 * np.arange(100))


def kuramoto(_, states):
    return FREQUENCIES + 1.5 / 100 * np.sin(states - states[:, None]).sum(axis=1)


def pendulums(_, states):
    angles, speeds = states[::2], states[1::2]
    torques = -9.81 * np.sin(angles)
    torques[1:] += 5 * (angles[:-1] - angles[1:])
    torques[:-1] += 5 * (angles[1:] - angles[:-1])
    return np.stack([speeds, torques], axis=1).ravel()


def swinging():
    """The start of the pendulums."""
    return np.stack([1.5 * np.cos(0.4 * np.arange(20)), np.zeros(20)], axis=1).ravel()


def random(place):
    """A pseudo-random number from 0 to 1, by SplitMix64."""
    mask = 2**64 - 1
    bits = (place + 1) * 0x9E3779B97F4A7C15 & mask
    bits = (bits ^ bits >> 30) * 0xBF58476D1CE4E5B9 & mask
    bits = (bits ^ bits >> 27) * 0x94D049BB133111EB & mask
    return ((bits ^ bits >> 31) >> 11) / 2**53


def conductances():
    """Of the network: the flow into each node by temperatures."""
    matrix = np.zeros((300, 300))
    for link in range(900):
        one, other = link % 300, (link + 1) % 300 if link < 300 else int(random(5000 + link) * 300)
        conductance = 0.1 * 100 ** random(9000 + link)
        ends = np.ix_([one, other], [one, other])
        matrix[ends] += conductance * np.array([[-1, 1], [1, -1]]) if one != other else 0.0
    return matrix


CONDUCTANCES = conductances()
PER_CAPACITY = 10 ** (-4 * np.array([random(20_000 + node) for node in range(300)]))
HEATING = np.where(np.arange(300) % 10 == 0, 50.0, 0.0)


def network(_, states):
    return PER_CAPACITY * (CONDUCTANCES @ states - 1.134e-9 * (states**4 - 293.15**4) + HEATING)


def network_jacobian(_, states):
    return PER_CAPACITY[:, None] * (CONDUCTANCES - np.diag(4 * 1.134e-9 * states**3))


def heat():
    """The solution in the eigenvectors of the differences."""

    def wave(number):
        return np.sin(np.pi * number * np.arange(1, 51) / 51), 4 * 51**2 * np.sin(np.pi * number / 102) ** 2

    (one, slow), (two, faster), (three, fast) = map(wave, (1, 2, 3))
    first = np.outer(one, one) * np.exp(-2 * slow * 0.1)
    return (first + 0.5 * np.outer(two, three) * np.exp(-(faster + fast) * 0.1)).ravel()


def chain():
    """The solution in the eigenvectors of the differences, each of which swings by itself."""
    motion = np.zeros((1000, 2))
    for number, amplitude in (1, 1.0), (5, 0.2):
        wave = np.sin(np.pi * number * np.arange(1, 1001) / 1001)
        stiffness = 4 * 1001**2 * np.sin(np.pi * number / 2002) ** 2
        swing = expm(2.0 * np.array([[0, 1], [-stiffness, -0.001 * stiffness]]))
        motion += np.outer(wave, amplitude * swing[:, 0])
    return motion.ravel()


def converter():
    """The solution by the exponential of each interval between two events, which is linear."""
    states = np.array([0.0, 0.0, 1.0])
    for source, share in [(24.0, 0.4), (0.0, 0.6)] * 100:
        rates = np.array([[0, -1e4, source * 1e4], [1e4, -5e3, 0], [0, 0, 0]])
        states = expm(rates * share * 1e-4) @ states
    return states[:2]


def cells(size):
    """The start of the Brusselator."""
    v, u = np.meshgrid(1 + 5 * size, 0.5 + size)
    return np.stack([u.ravel(), v.ravel()], axis=1).ravel()


PLEIADES = np.zeros(28)
PLEIADES[:14] = [3, 3, -1, -3, 2, -2, 2, 3, -3, 2, 0, 0, -4, 4]
PLEIADES[[19, 20, 24, 25]] = [1.75, -1.5, -1.25, 1]
POLLUTION = np.zeros(20)
POLLUTION[[1, 3, 6, 7, 8, 16]] = [0.2, 0.04, 0.1, 0.3, 0.01, 0.007]
ARENSTORF = np.array([0.994, 0, 0, -2.00158510637908252240537862224])

#: Rates, start, end, nominal value, method and Jacobian of those that SciPy solves.
SOLVED = {
    "pleiades": (pleiades, PLEIADES, 3.0, 1.0, "DOP853", None),
    "pollution": (pollution, POLLUTION, 60.0, 1e-3, "Radau", None),
    "oregonator": (oregonator, np.array([1.0, 2, 3]), 360.0, 1.0, "Radau", None),
    "arenstorf": (arenstorf, ARENSTORF, 17.0652165601579625588917206249, 1.0, "DOP853", None),
    "lorenz": (lorenz, np.ones(3), 10.0, 1.0, "DOP853", None),
    "brusselator": (brusselator, cells(PLACES), 7.5, 1.0, "Radau", brusselator_jacobian),
    "dense": (dense, 1 + 0.5 * np.cos(np.arange(200)), 10.0, 1.0, "Radau", dense_jacobian),
    "kuramoto": (kuramoto, 3 * np.sin(7.0 * np.arange(100)), 20.0, 1.0, "DOP853", None),
    "pendulums": (pendulums, swinging(), 10.0, 1.0, "DOP853", None),
    "network": (network, np.full(300, 293.15), 3600.0, 1.0, "Radau", network_jacobian),
}
#: Those with a closed form. Their perturbations decay.
CLOSED = {"heat": heat, "chain": chain, "converter": converter}


def solve(problem, begin, start, tolerance):
    rates, _, end, nominal, method, jacobian = problem
    options = {"jac": jacobian} if jacobian else {}
    solved = solve_ivp(
        rates,
        (begin, end),
        start,
        method,
        rtol=tolerance,
        atol=tolerance * nominal,
        dense_output=True,
        **options,
    )
    if not solved.success:
        raise RuntimeError(solved.message)
    return solved


def growth(problem, solution, tolerance):
    """By how much the end changes, relative to a perturbation on the way to it: the largest ratio."""
    _, start, end, nominal, method, _ = problem
    random = np.random.default_rng(1)
    last, largest = solution.y[:, -1], 1.0
    beginnings = FEW if method == "Radau" else BEGINNINGS
    for begin in np.linspace(0, end, beginnings, endpoint=False):
        states = solution.sol(begin)
        size = PERTURBATION * (abs(states) + nominal)
        ends = [
            solve(problem, begin, states + sign * size, tolerance).y[:, -1]
            for sign in (0.0, random.choice([-1.0, 1.0], len(start)))
        ]
        change = max(abs(ends[1] - ends[0]) / (abs(last) + nominal))
        largest = max(largest, change / PERTURBATION)
    return largest


def row(name, growth_of_errors, states):
    kept = states[::STRIDE] if len(states) >= LARGE else states
    print(name, f"{growth_of_errors:.1e}", *(f"{state:.12e}" for state in kept), sep=",", flush=True)


def main():
    for name, closed in CLOSED.items():
        row(name, 1.0, closed())
    for name in sys.argv[1:] or SOLVED:
        problem = SOLVED[name]
        _, start, _, _, method, _ = problem
        many = len(start) >= MANY
        # Radau's Newton iteration does not converge below; many states would take hours there.
        tolerance = 1e-13 if method == "DOP853" else 1e-10 if many else 1e-12
        solution = solve(problem, 0.0, start, tolerance)
        found = growth(problem, solution, 1e-9 if method == "Radau" else 1e-12)
        # A closed orbit returns to its start.
        row(name, found, start if name == "arenstorf" else solution.y[:, -1])


if __name__ == "__main__":
    main()
