"""Draws the curves of the FMUs' documentation from the exported FMUs.

python examples/documentation_curves.py [--out FOLDER]
"""

import argparse
import textwrap
from pathlib import Path

from fmpy import read_csv, simulate_fmu

WIDTH, LEFT, RIGHT = 880, 46, 8
"""The picture's width and the margins left and right of the curves, in drawn units."""

COLORS = {"first": "#0b6bcb", "second": "#c2560c", "third": "#6b7684"}
"""Of the curves, unless the page sets its own for light and dark mode."""


class Axis:
    """An axis: values to drawn units, with a line at each tick."""

    def __init__(self, values, ticks, begin, end):
        self.low, self.high = values
        self.begin, self.end = begin, end
        self.ticks = range(self.low, self.high + 1, ticks)

    def place(self, value):
        """The position of a value, to a tenth of a unit."""
        share = (value - self.low) / (self.high - self.low)
        return f"{self.begin + share * (self.end - self.begin):.1f}".removesuffix(".0")


def draw(time, *panels):
    """An SVG of curves over time, in stacked panels.

    Each panel has a height, the range of its values, ticks, and curves: a name with its unit, a class, and
    values.
    """
    x = Axis((0, round(time[-1])), 20 if time[-1] > 50 else 2, LEFT, WIDTH - RIGHT)
    lines, top = [], 0
    for height, values, ticks, curves in panels:
        bottom = top + 22 + height
        y = Axis(values, ticks, bottom, top + 22)
        lines.append('<g class="grid" stroke="currentColor" color="#d9dfe6">')
        lines += [f'<path d="M{LEFT} {y.place(tick)}H{WIDTH - RIGHT}"/>' for tick in y.ticks]
        lines.append('</g><g text-anchor="end" fill="currentColor">')
        lines += [f'<text x="{LEFT - 6}" y="{y.place(tick)}" dy="4">{tick}</text>' for tick in y.ticks]
        lines.append("</g>")
        label = LEFT
        for name, kind, samples in curves:
            color = f'class="{kind}" color="{COLORS[kind]}"'
            lines.append(f'<text {color} fill="currentColor" x="{label}" y="{top + 14}">{name}</text>')
            label += 7 * len(name) + 20
            points = " ".join(f"{x.place(t)} {y.place(v)}" for t, v in zip(time, samples, strict=True))
            path = "\n".join(textwrap.wrap(f"M{points}", 108))
            lines.append(f'<path {color} stroke="currentColor" stroke-width="1.6" fill="none" d="{path}"/>')
        top = bottom + 8
    lines.append('<g text-anchor="middle" fill="currentColor">')
    lines += [f'<text x="{x.place(tick)}" y="{top + 10}">{tick}</text>' for tick in x.ticks]
    lines.append(f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{top + 28}">time (s)</text></g>')
    head = f'viewBox="0 0 {WIDTH} {top + 32}" font-family="sans-serif" font-size="12"'
    return "\n".join([f'<svg xmlns="http://www.w3.org/2000/svg" {head}>', *lines, "</svg>\n"])


def plant(inputs, *names):
    """Every fourth sample of the plant with an input file: time and the named variables."""
    result = simulate_fmu(
        "target/fmu/BoostPlant.fmu",
        stop_time=20.0,
        output_interval=0.0125,
        input=read_csv(Path(__file__).parent / inputs),
        output=names,
    )[::4]
    return [result[name] for name in ("time", *names)]


def duty_step():
    """Duty steps: wastegate and boost pressure follow."""
    names = "boost_pressure", "hp_wastegate_pwm", "hp_wastegate_position"
    time, boost, duty, position = plant("duty_step.csv", *names)
    opening = ("wastegate's opening (%)", "second", 100 * position)
    return draw(
        time,
        (150, (100, 180), 20, [("boost pressure (kPa)", "first", boost / 1e3)]),
        (110, (20, 80), 20, [("duty (%)", "third", duty), opening]),
    )


def voltage_dip():
    """A supply voltage dip at constant duty."""
    names = "boost_pressure", "hp_wastegate_position", "valve.voltage"
    time, boost, position, voltage = plant("voltage_dip.csv", *names)
    return draw(
        time,
        (150, (120, 145), 5, [("boost pressure (kPa)", "first", boost / 1e3)]),
        (90, (35, 55), 5, [("wastegate's opening (%)", "second", 100 * position)]),
        (50, (11, 12), 1, [("supply voltage (V)", "third", voltage)]),
    )


def boost_steps():
    """The closed loop over reference steps, every tenth sample of the other example."""
    from closed_loop import rows

    time, reference, boost, duty = zip(*rows[::10], strict=True)
    pressures = [
        ("reference (kPa)", "third", [p / 1e3 for p in reference]),
        ("boost pressure (kPa)", "first", [p / 1e3 for p in boost]),
    ]
    return draw(time, (190, (110, 190), 20, pressures), (90, (20, 60), 10, [("duty (%)", "second", duty)]))


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(description=__doc__)
    folder = Path(__file__).parents[1] / "modelDescription" / "documentation"
    arguments.add_argument("--out", metavar="FOLDER", type=Path, default=folder, help="where to write")
    out = arguments.parse_args().out
    for curves in (duty_step, voltage_dip, boost_steps):
        (out / f"{curves.__name__}.svg").write_text(curves())
