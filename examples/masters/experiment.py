"""The experiment of every master in this folder: the boost reference steps of the paper's Fig. 13."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCENARIO = tomllib.loads((ROOT / "boost/lab/scenarios/figure_13.toml").read_text())
STEP = SCENARIO["step"]
"""The communication step (s): the controller's sample time."""

STEPS = round(SCENARIO["stop_time"] / STEP)

COMMANDS = ["hp_wastegate_pwm", "vacuum_pump", "lp_wastegate", "hp_bypass", "surge_valve"]
"""From the controller to the plant."""

MEASUREMENTS = ["boost_pressure", "tank_pressure", "supply_voltage_measured", "hp_turbo_speed"]
"""From the plant to the controller."""

REFERENCES = {round(time / STEP): pascals for time, pascals in SCENARIO["inputs"]["boost_reference"]["steps"]}
"""The reference (Pa) from each of these steps."""


def boost_reference(step):
    """The reference (Pa) in a step, by number."""
    return [pascals for begin, pascals in REFERENCES.items() if begin <= step][-1]


def report(rows):
    """Prints the overshoot of boost pressure, the first value of each row."""
    up = down = 0.0
    begins = [*REFERENCES][1:]
    for begin, end in zip(begins, [*begins[1:], STEPS], strict=True):
        reference = boost_reference(begin)
        boost = [row[0] for row in rows[begin:end]]
        if reference > boost_reference(begin - 1):
            up = max(up, max(boost) - reference)
        else:
            down = max(down, reference - min(boost))
    print(
        f"overshoot {up / 1e3:.2f} kPa up, {down / 1e3:.2f} kPa down; at the end {rows[-1][0] / 1e3:.2f} kPa"
    )
