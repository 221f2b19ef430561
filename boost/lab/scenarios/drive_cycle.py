"""Generates drive_cycle.csv for drive_cycle.toml: engine speed, boost reference and throttle of a drive.

A synthetic drive, not a regulated cycle: a 1600 kg car in town, on a country road and on a motorway, at the
speeds in SPEEDS with constant acceleration between them. Engine torque follows from mass, rolling and air
resistance, and the gear; the boost reference rises with it by 0.55 kPa/(N.m), from 115 kPa at 60 N.m up to
190 kPa, roughly like the plant's. Upshifts are at 4200 rpm under load and 2400 rpm without, downshifts at
1600 rpm; a shift takes 0.4 s, during which engine speed moves to the new gear's and the driver lifts off. The
throttle is open above 60 N.m; below, it shuts in proportion, to 0.12 when coasting.
"""

from itertools import pairwise
from pathlib import Path

STEP = 0.1
CHANGE = 0.4
# (time in s, speed in km/h), with constant acceleration between.
SPEEDS = [(0, 30), (5, 30), (12, 60), (20, 60), (24, 35), (30, 35), (38, 85), (52, 85), (58, 115), (66, 115)]
SPEEDS += [(78, 160), (90, 160), (98, 120), (110, 120), (117, 145), (125, 145), (140, 70), (150, 70)]
MASS, ROLLING, AIR = 1600.0, 200.0, 0.42
WHEEL_RADIUS = 0.31
RATIOS = [13.5, 8.3, 5.7, 4.2, 3.35, 2.75]
IDLE = 1000.0


def at(time: float) -> tuple[float, float]:
    """Speed (m/s) and acceleration (m/s2)."""
    for (begin, before), (end, after) in pairwise(SPEEDS):
        if time <= end:
            slope = (after - before) / (end - begin) / 3.6
            return before / 3.6 + slope * (time - begin), slope
    return SPEEDS[-1][1] / 3.6, 0.0


def main() -> None:
    gear, changed, rpm_before = 1, -CHANGE, 0.0
    lines = ["time,engine_speed,boost_reference,throttle"]
    for step in range(round(SPEEDS[-1][0] / STEP) + 1):
        time = step * STEP
        speed, acceleration = at(time)
        force = MASS * acceleration + ROLLING + AIR * speed * speed

        def engine(chosen: int, speed: float = speed) -> float:
            return max(IDLE, speed / WHEEL_RADIUS * RATIOS[chosen] * 60 / 6.2832)

        if time - changed > 3 * CHANGE:
            up_at = 4200 if acceleration > 0.5 else 2400
            wanted = (
                gear + (engine(gear) > up_at and gear + 1 < len(RATIOS)) - (engine(gear) < 1600 and gear > 0)
            )
            if wanted != gear:
                changed, rpm_before, gear = time, engine(gear), wanted
        share = min(1.0, (time - changed) / CHANGE)
        rpm = rpm_before + share * (engine(gear) - rpm_before)
        torque = force * WHEEL_RADIUS / RATIOS[gear] if share == 1.0 else 0.0
        reference = min(190.0, max(115.0, 115.0 + 0.55 * (torque - 60.0)))
        throttle = min(1.0, max(0.12, torque / 60.0))
        lines.append(f"{time:.1f},{rpm:.0f},{1e3 * reference:.0f},{throttle:.2f}")
    Path(__file__).with_suffix(".csv").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
