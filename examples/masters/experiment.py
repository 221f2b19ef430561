"""The experiment of every master in this folder: the boost reference steps of the paper's Fig. 13."""

STEP = 1 / 80
"""The communication step (s): the controller's sample time."""
STEPS = 124 * 80
COMMANDS = ["hp_wastegate_pwm", "vacuum_pump", "lp_wastegate", "hp_bypass", "surge_valve"]
"""From the controller to the plant."""
MEASUREMENTS = ["boost_pressure", "tank_pressure", "supply_voltage_measured", "hp_turbo_speed"]
"""From the plant to the controller."""

KILOPASCALS = {
    0: 125,
    5: 135,
    15: 150,
    25: 170,
    38: 185,
    52: 170,
    64: 150,
    76: 135,
    88: 125,
    100: 145,
    112: 125,
}
"""The reference from each of these times (s)."""


def boost_reference(step):
    """The reference (Pa) in a step, by number."""
    return 1e3 * [kilopascals for time, kilopascals in KILOPASCALS.items() if time * 80 <= step][-1]


def report(rows):
    """Prints the overshoot of boost pressure, the first value of each row."""
    up = down = 0.0
    begins = [80 * time for time in KILOPASCALS][1:]
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
