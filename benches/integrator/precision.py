"""Prints the table of docs/integrator.md that compares the built-in integrator with CVODE at equal error,
from what the program `integrator` of the benchmarks measured.
"""

import csv
import sys
from collections import defaultdict
from statistics import median

import numpy as np

BUILT_IN = "built in"
WAYS = "Free", "Stop", "Restart"
#: Of the problems' errors, half decades.
ERRORS = 10.0 ** -np.arange(3, 9.1, 0.5)


def front(points):
    """The errors and times, both as logarithms, that no other tolerance betters in both: errors ascend."""
    kept = []
    for error, seconds in sorted(points):
        if not kept or seconds < kept[-1][1]:
            kept.append((error, seconds))
    return np.log(kept).T


def times(points):
    """The times at the errors, by interpolation between tolerances. A loosest one that errs less serves, too;
    beyond the tightest one there are none. And up to which error not the loosest one serves."""
    if not points:
        return np.full_like(ERRORS, np.nan), 0.0
    errors, seconds = front(points)
    return np.exp(np.interp(np.log(ERRORS), errors, seconds, left=np.nan)), np.exp(errors[-1])


def main(path):
    curves = defaultdict(list)
    with open(path, newline="") as file:
        for problem, steps, way, solver, _, error, seconds in csv.reader(file):
            curves[problem, int(steps), way, solver].append((float(error), max(float(seconds), 1e-9)))
    solvers = defaultdict(list)
    for problem, _, _, solver in curves:
        if solver not in [BUILT_IN, *solvers[problem]]:
            solvers[problem].append(solver)
    columns = [(steps, way) for steps in (10, 1000) for way in WAYS]
    heads = [f"{way.lower()}, {steps:,}" for steps, way in columns]
    print("\n| |", " | ".join(["CVODE", *heads, "a hundredth"]), "|")
    print("|---" * (3 + len(columns)) + "|")
    for problem, of_cvode in solvers.items():
        cells = []
        for steps, way in columns:
            # Where steps end at the points without need, they may go past them here.
            own, largest = times(curves[problem, steps, "Free" if way == "Stop" else way, BUILT_IN])
            others = [times(curves[problem, steps, way, solver]) for solver in of_cvode]
            largest = max(largest, *(largest for _, largest in others))
            ratios = own / np.fmin.reduce([seconds for seconds, _ in others])
            ratios = ratios[~np.isnan(ratios) & (largest >= ERRORS)]
            cells.append(f"{median(ratios):.2g} ({max(ratios):.2g})" if len(ratios) else "")
        # Tolerances are a tenth apart.
        seconds = [seconds for _, seconds in curves[problem, 10, "Free", BUILT_IN]]
        growth = max(later / earlier for earlier, later in zip(seconds, seconds[2:], strict=False))
        print(f"| {problem} | {', '.join(of_cvode)} |", " | ".join([*cells, f"{growth:.2g}"]), "|")


if __name__ == "__main__":
    main(sys.argv[1])
