"""Optimal control of the plant with CasADi, compared with BoostController.

python examples/optimal_control/optimal_control.py [--plot FILE]

Two optima: the fastest boost step below a high-pressure shaft speed limit, and the operating points with the
lowest exhaust pressure. They are found with the plant's Model Exchange FMU and applied to its co-simulation
FMU.
"""

import argparse

import numpy as np
from cosimulation import END_KPA, MEASURED, START_KPA, STEP, apply, closed_loop, plant_at
from fastest_step import HORIZON, SAMPLES, fastest_step
from operating_points import OperatingPoints

SHAFT_LIMITS = {1500: 130.0, 2500: 145.0}
"""krpm by engine speed. The 210 krpm that this shaft may reach do not limit these steps: without a limit the
optima reach 135 and 175 krpm. At rest at 170 kPa it turns at 124 and 130 krpm."""

REST = 800
"""Samples (10 s) in which the loop comes to rest."""

SETTLED_KPA = 0.5

ENGINE_SPEEDS = range(1500, 5001, 250)  # rpm
BOOSTS = 125, 150, 170  # kPa


def settled_after(boost):
    """The time from which boost (kPa) stays within SETTLED_KPA of its final value."""
    return (np.max(np.nonzero(np.abs(boost - END_KPA) > SETTLED_KPA)) + 1) * STEP


def steps():
    """For each engine speed, measurements and valves, starting at rest: BoostController's, the optimum's."""
    found = {}
    for engine_speed, limit in SHAFT_LIMITS.items():
        references = [START_KPA * 1e3] * REST + [END_KPA * 1e3] * 2 * REST
        measured, valves = map(np.array, zip(*closed_loop(engine_speed, references), strict=True))
        measured, valves = measured[REST - 1 :], valves[REST - 1 :]
        optimum = fastest_step(engine_speed, valves[0, :2], limit)
        bypass = np.full(SAMPLES, valves[0, 2])
        opened = np.vstack([valves[0], np.column_stack([optimum.valves, bypass])])
        applied = np.array(apply(engine_speed, opened))
        found[engine_speed] = {"BoostController": (measured, valves), "optimum": (applied, opened)}
        for name, (rows, _) in found[engine_speed].items():
            boost, shaft = rows[:, 0] / 1e3, rows[:, 1] / 1e3
            print(
                f"{engine_speed} rpm, {name}: within {SETTLED_KPA} kPa after {settled_after(boost):.2f} s; "
                f"{boost[SAMPLES]:.1f} kPa at {HORIZON:.0f} s; shaft up to {max(shaft):.1f} krpm"
            )
    return found


def operating_points():
    """For each boost, the same at rest, by engine speed."""
    found = {}
    for boost in BOOSTS:
        points, optima, controlled = OperatingPoints(), [], []
        for engine_speed in ENGINE_SPEEDS:
            valves = points.solve(engine_speed, boost)
            optima.append((plant_at(engine_speed, valves).get(MEASURED), valves))
            controlled.append(closed_loop(engine_speed, [boost * 1e3] * REST)[-1])
        found[boost] = {
            name: tuple(map(np.array, zip(*rows, strict=True)))
            for name, rows in (("BoostController", controlled), ("optimum", optima))
        }
        saved = (found[boost]["BoostController"][0] - found[boost]["optimum"][0])[:, 2] / 1e3
        print(
            f"{boost} kPa: exhaust pressure up to {max(saved):.1f} kPa below that with "
            f"BoostController, most at {ENGINE_SPEEDS[np.argmax(saved)]} rpm"
        )
    return found


def plot(file, steps, points):
    """Draws both steps, and the operating points over engine speed."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    plt.rcParams.update({"font.size": 10, "axes.spines.top": False, "axes.spines.right": False})
    plt.rcParams.update(
        {"axes.grid": True, "grid.color": "0.9", "axes.axisbelow": True, "legend.frameon": False}
    )
    figure, panels = plt.subplots(3, 3, figsize=(12, 7), sharex="col")
    time = np.arange(SAMPLES + 1) * STEP
    for column, (engine_speed, step) in zip(panels.T, steps.items(), strict=False):
        for (name, (measured, valves)), color in zip(step.items(), ("0.45", "tab:blue"), strict=True):
            boost, shaft = measured[: SAMPLES + 1, :2].T / 1e3
            column[0].plot(time, boost, color=color, lw=1.8, label=name)
            column[1].plot(time, shaft, color=color, lw=1.8)
            for opening, style, valve in ((valves[:, 0], "-", "HP"), (100 * valves[:, 1], ":", "LP")):
                column[2].stairs(
                    opening[1 : SAMPLES + 1],
                    time,
                    baseline=None,
                    color=color,
                    lw=1.2,
                    ls=style,
                    label=f"{valve}, {name}",
                )
        column[0].set_title(f"step to {END_KPA:.0f} kPa at {engine_speed} rpm", fontsize=10)
        column[1].axhline(SHAFT_LIMITS[engine_speed], color="tab:red", lw=0.8, label="limit")
        column[2].set(xlabel="time (s)", xlim=(0, time[-1]), ylim=(-3, 103))
    for (boost, kinds), color in zip(points.items(), ("tab:blue", "tab:orange", "tab:green"), strict=True):
        for (name, (measured, valves)), style in zip(kinds.items(), ("--", "-"), strict=True):
            label = f"{boost} kPa" if name == "optimum" else None
            for axes, quantity in zip(
                panels[:, 2], (measured[:, 2] / 1e3, 100 * measured[:, 3], 100 * valves[:, 1]), strict=True
            ):
                axes.plot(ENGINE_SPEEDS, quantity, style, color=color, lw=1.5, label=label)
    panels[0, 2].set_title("least exhaust pressure (dashed: BoostController)", fontsize=10)
    panels[2, 2].set(xlabel="engine speed (rpm)", xlim=(ENGINE_SPEEDS[0], ENGINE_SPEEDS[-1]))
    for axes, label in (
        (panels[0, 0], "boost pressure (kPa)"),
        (panels[1, 0], "HP shaft (krpm)"),
        (panels[2, 0], "duty, opening (%)"),
        (panels[0, 2], "exhaust pressure (kPa)"),
        (panels[1, 2], "HP wastegate (%)"),
        (panels[2, 2], "LP wastegate (%)"),
    ):
        axes.set_ylabel(label)
    panels[0, 0].legend(loc="lower right")
    panels[1, 0].legend(loc="lower right")
    panels[2, 0].legend(loc="upper right")
    panels[0, 2].legend(loc="upper left")
    figure.align_ylabels()
    figure.tight_layout()
    figure.savefig(file, dpi=80, metadata={"Software": None} if str(file).endswith(".png") else None)
    print(f"wrote {file}")


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("--plot", metavar="FILE", help="plot both to a PNG or SVG file")
    file = arguments.parse_args().plot
    optima = steps(), operating_points()
    if file:
        plot(file, *optima)
