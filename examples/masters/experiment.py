"""What every master of this folder runs: the steps of the boost reference of the paper's Fig. 13."""

STEP = 1 / 80
"""From one communication point to the next (s): the controller's sample time."""
STEPS = 124 * 80
COMMANDS = ["hp_wastegate_pwm", "vacuum_pump", "lp_wastegate", "hp_bypass"]
"""What the controller puts out and the plant takes."""
MEASUREMENTS = ["boost_pressure", "tank_pressure", "supply_voltage_measured"]
"""What the plant puts out and the controller takes."""

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
"""The reference from each of these times (s) on."""


def boost_reference(step):
    """The reference (Pa) in a step, by its number."""
    return 1e3 * [kilopascals for time, kilopascals in KILOPASCALS.items() if time * 80 <= step][-1]


def report(rows):
    """Prints how far boost pressure, the first of what each step reached, went past the reference."""
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
