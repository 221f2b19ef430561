"""Optimal control of the plant with CasADi, beside BoostController: the fastest step of boost under a limit of the
high-pressure shaft, and the operating points with the least exhaust pressure.

python examples/optimal_control/optimal_control.py [--plot FILE]

The optima are found with the plant's Model Exchange FMU and applied to its co-simulation FMU.
"""

import argparse

import numpy as np
from cosimulation import END_KPA, START_KPA, STEP, apply, closed_loop, plant_at, MEASURED
from fastest_step import SAMPLES, fastest_step
from operating_points import OperatingPoints

SHAFT_LIMITS = {1500: 130.0, 2500: 145.0}
"""krpm by engine speed. Up to 170 kPa the 210 krpm that this shaft may reach limit nothing; these leave 5 % and 11 % above
what 170 kPa need at rest, and without them the optima reach 136 and 180 krpm."""

REST = 800
"""Samples (10 s) in which the loop comes to rest."""

SETTLED_KPA = 0.5

ENGINE_SPEEDS = range(1500, 5001, 250)  # rpm
BOOSTS = 125, 150, 170  # kPa


def settled_after(boost):
    """The time from which on boost (kPa) stays within SETTLED_KPA of the end."""
    return (np.max(np.nonzero(np.abs(boost - END_KPA) > SETTLED_KPA)) + 1) * STEP


def steps():
    """By engine speed: the optimum, what it does in co-simulation, and the loop with BoostController."""
    found = {}
    for engine_speed, limit in SHAFT_LIMITS.items():
        references = [START_KPA * 1e3] * REST + [END_KPA * 1e3] * 2 * REST
        measured, valves = (np.array(rows) for rows in zip(*closed_loop(engine_speed, references), strict=True))
        start = valves[REST - 1]
        optimum = fastest_step(engine_speed, start[:2], limit)
        opened = np.column_stack([optimum.valves, np.full(SAMPLES, start[2])])
        applied = np.array(apply(engine_speed, start, opened))
        found[engine_speed] = start, optimum, applied, measured[REST:], valves[REST:]
        boost, shaft = applied[:, 0] / 1e3, applied[:, 1] / 1e3
        print(
            f"{engine_speed} rpm: within {SETTLED_KPA} kPa after {settled_after(boost):.2f} s, "
            f"BoostController after {settled_after(measured[REST:, 0] / 1e3):.2f} s; "
            f"shaft up to {max(shaft):.2f} krpm (limit {limit:.0f}), BoostController "
            f"{max(measured[REST:, 1]) / 1e3:.2f} krpm; {boost[-1]:.2f} kPa at the end; "
            f"{optimum.iterations} iterations"
        )
    return found


def operating_points():
    """By boost (kPa), a row for each engine speed: what is measured at the optimum and with BoostController, the valves of
    both."""
    found = {}
    for boost in BOOSTS:
        points, rows = OperatingPoints(), []
        for engine_speed in ENGINE_SPEEDS:
            optimum = points.solve(engine_speed, boost)
            reached = plant_at(engine_speed, optimum.valves).get(MEASURED)
            measured, valves = closed_loop(engine_speed, [boost * 1e3] * REST)[-1]
            rows.append([reached, measured, [*optimum.valves, 0], [*valves, 0]])
        found[boost] = rows = np.array(rows)
        saved = (rows[:, 1, 2] - rows[:, 0, 2]) / 1e3
        print(
            f"{boost} kPa: exhaust pressure up to {max(saved):.1f} kPa below BoostController's, "
            f"at {ENGINE_SPEEDS[np.argmax(saved)]} rpm; boost in co-simulation within "
            f"{np.max(np.abs(rows[:, 0, 0] / 1e3 - boost)):.3f} kPa"
        )
    return found


def plot(file, steps, points):
    """Draws both steps, and the operating points over engine speed."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    plt.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    figure, panels = plt.subplots(3, 3, figsize=(12, 7.5), sharex="col", sharey=False)
    time = np.arange(SAMPLES + 1) * STEP
    for column, (engine_speed, (start, optimum, applied, measured, valves)) in zip(panels.T, steps.items(), strict=False):
        begin = [START_KPA, applied[0, 1] / 1e3]
        opened = np.column_stack([optimum.valves, np.zeros(SAMPLES)])
        for own, rows, commands, color, label in (
            (True, measured[:SAMPLES], valves[:SAMPLES], "0.45", "BoostController"),
            (False, applied, opened, "tab:blue", "optimum"),
        ):
            width = 1.2 if own else 1.8
            for axes, first, quantity in zip(column, begin, rows.T[:2] / 1e3, strict=False):
                axes.plot(time, np.append(first, quantity), color=color, lw=width, label=label)
            commands = np.vstack([start, commands])
            column[2].step(time, commands[:, 0], where="pre", color=color, lw=width, label=f"high pressure, {label}")
            column[2].step(time, 100 * commands[:, 1], where="pre", color=color, lw=width, ls=":", label="low pressure")
        column[0].axhline(END_KPA, color="0.7", lw=0.8)
        column[0].set_title(f"{engine_speed} rpm", fontsize=10)
        column[1].axhline(SHAFT_LIMITS[engine_speed], color="tab:red", lw=0.8, label="limit")
        column[2].set(xlabel="time (s)", xlim=(0, time[-1]), ylim=(-3, 103))
    for axes, label in zip(panels[:, 0], ("boost pressure (kPa)", "high-pressure shaft (krpm)", "wastegates: duty, opening (%)"), strict=True):
        axes.set_ylabel(label)
    for (boost, rows), color in zip(points.items(), ("tab:blue", "tab:orange", "tab:green"), strict=True):
        for kind, style in ((1, "--"), (0, "-")):
            label = f"{boost} kPa" if kind == 0 else None
            panels[0, 2].plot(ENGINE_SPEEDS, rows[:, kind, 2] / 1e3, style, color=color, label=label)
            panels[1, 2].plot(ENGINE_SPEEDS, 100 * rows[:, kind, 3], style, color=color)
            panels[2, 2].plot(ENGINE_SPEEDS, 100 * rows[:, 2 + kind, 1], style, color=color)
    panels[0, 2].set(title="least exhaust pressure", ylabel="exhaust pressure (kPa)")
    panels[1, 2].set(ylabel="high-pressure wastegate (%)")
    panels[2, 2].set(ylabel="low-pressure wastegate (%)", xlabel="engine speed (rpm)", xlim=(1500, 5000))
    panels[0, 2].title.set_fontsize(10)
    for axes in panels.flat:
        axes.grid(color="0.9")
        axes.set_axisbelow(True)
    panels[0, 0].legend(loc="lower right", frameon=False)
    panels[1, 0].legend(loc="lower right", frameon=False)
    panels[0, 2].legend(loc="upper left", frameon=False)
    panels[2, 0].legend(loc="upper right", frameon=False)
    figure.align_ylabels()
    figure.tight_layout()
    figure.savefig(file, dpi=90, metadata={"Software": None} if str(file).endswith(".png") else None)
    print(f"wrote {file}")


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--plot", metavar="FILE", help="draw both into a PNG or SVG file")
    file = arguments.parse_args().plot
    found = steps(), operating_points()
    if file:
        plot(file, *found)
