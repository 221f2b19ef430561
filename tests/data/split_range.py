"""The law of the strategy `split_range` at reference conditions, transcribed from the controller's page.

Prints split_range.csv again: its inputs, and the outputs that this transcription computes with the
controller's maps.
"""

from __future__ import annotations

import bisect
import csv
import json
import math
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
SAMPLE_TIME = 0.0125
# The duty at which the wastegate lifts off, by bisection of the paper's eqs. (4) and (7).
LIFT_OFF = 28.817807269357402
# Of a fast ramp of engine speed: its rate (rpm/s), and how long it makes the feedback firm (s).
FAST_RAMP, FADING_TIME = 1000, 2


def starts() -> dict[str, object]:
    description = json.loads((ROOT / "modelDescription/controller.json").read_text())
    found = {variable["name"]: variable.get("start") for variable in description["variables"]}
    for component in description["components"]:
        for variable in component["variables"]:
            found[f"{component['name']}.{variable['name']}"] = variable.get("start")
    return found


P = starts()
SPEEDS, ROWS = P["range_schedule.engine_speed"], P["range_schedule.boost_reference"]


def clip(value: float, least: float, most: float) -> float:
    return min(max(value, least), most)


def place(axis: list[float], value: float) -> tuple[int, float]:
    value = clip(value, axis[0], axis[-1])
    index = min(bisect.bisect_right(axis, value), len(axis) - 1) - 1
    return index, (value - axis[index]) / (axis[index + 1] - axis[index])


def table(name: str, pressure: float, speed: float) -> float:
    values = P[f"range_schedule.{name}"]
    (i, a), (j, b) = place(ROWS, pressure), place(SPEEDS, speed)
    below = (1 - b) * values[i][j] + b * values[i][j + 1]
    above = (1 - b) * values[i + 1][j] + b * values[i + 1][j + 1]
    return (1 - a) * below + a * above


def extrapolated(pressure: float, speed: float) -> float:
    edge = clip(pressure, ROWS[0], ROWS[-1])
    return table("virtual_duty", edge, speed) + (pressure - edge) / table("gain", edge, speed)


def rho(value: float, begin: float, end: float) -> float:
    return clip((value - begin) / (end - begin), 0, 1)


class Lag:
    def __init__(self) -> None:
        self.value: float | None = None

    def __call__(self, time_constant: float, signal: float) -> float:
        before = signal if self.value is None else self.value
        self.value = before + SAMPLE_TIME / (time_constant + SAMPLE_TIME) * (signal - before)
        return self.value


def longer(memory: float) -> float:
    return min(memory + 1, 0.4 / SAMPLE_TIME)


class Level:
    def __init__(self) -> None:
        self.value = self.memory = 0.0

    def __call__(self, noise: float, response: float, signal: float) -> float:
        error = signal - self.value
        self.memory = 1 - response / SAMPLE_TIME if abs(error) > noise else longer(self.memory)
        self.value += error / max(self.memory, 1)
        return self.value


class Line:
    def __init__(self) -> None:
        self.value: float | None = None
        self.rate = self.memory = self.mean_error = 0.0

    def __call__(self, noise: float, response: float, signal: float) -> tuple[float, float]:
        expected = (signal if self.value is None else self.value) + SAMPLE_TIME * self.rate
        error = signal - expected
        share = SAMPLE_TIME / response
        self.mean_error += share * (error - self.mean_error)
        slowly = (2 - share) * self.mean_error**2 > share * noise**2
        complete = self.memory >= 0.4 / SAMPLE_TIME
        bends = self.value is None or abs(error) > noise or (complete and slowly)
        self.mean_error = 0.0 if bends else self.mean_error
        self.memory = max(response / SAMPLE_TIME, 2) if bends else longer(self.memory)
        share = self.memory * (self.memory + 1)
        self.value = expected + (4 * self.memory - 2) / share * error
        self.rate += 6 / share * error / SAMPLE_TIME
        return self.value, self.rate


class Controller:
    def __init__(self) -> None:
        self.speed, self.voltage, self.measured, self.asked = Line(), Level(), Lag(), Lag()
        self.firmness = self.integral = self.derivative = 0.0
        self.model = self.before = self.delayed = self.gain = self.bypass = None
        self.pump = 0.0

    def holding(self, speed: float, rate: float) -> float:
        if rate == 0:
            return table("virtual_duty", self.model, speed)
        shut, free = P["allocation.bypass_shut_below"], P["allocation.bypass_free_above"]
        bypass = self.bypass or 0.0
        sensitive = max(speed, shut + bypass * (free - shut)) if speed < free and bypass > 0 else speed
        if rate < 0:
            shut, free = P["allocation.low_pressure_shut_below"], P["allocation.low_pressure_free_above"]
            sensitive = max(sensitive, min(speed + free - shut, free))
        shift = 0.0
        for _ in range(3):
            sensitivity = table("speed_sensitivity", self.model + shift, sensitive)
            shift = P["speed_feedforward.share"] * sensitivity * rate
        return extrapolated(clip(self.model + shift, 0, 1e6), speed)

    def sample(
        self, reference: float, boost: float, voltage: float, tank: float, speed: float
    ) -> list[float]:
        if self.model is None:
            self.model = self.before = boost
        lag = P["actuator_lag"]
        model_lambda = 2 * lag
        speed, rate = self.speed(P["measurement.engine_speed_noise"], lag, speed)
        voltage = self.voltage(P["measurement.supply_voltage_noise"], lag, voltage)
        self.firmness = max(clip(abs(rate) / FAST_RAMP, 0, 1), self.firmness - SAMPLE_TIME / FADING_TIME)
        limits = P["range_schedule.boost_limit"]
        index, share = place(SPEEDS, speed)
        limit = (1 - share) * limits[index] + share * limits[index + 1]
        demand = self.asked(P["reference_lambda"] - model_lambda, min(reference, P["boost_limit"]))
        r = min(demand, limit)

        compensation = P["nominal_voltage"] / max(voltage, 6)
        start, span, shape = (P[f"allocation.low_pressure_{name}"] for name in ["start", "span", "shape"])
        shut, free = P["allocation.low_pressure_shut_below"], P["allocation.low_pressure_free_above"]
        most = start + span / (1 + shape) if speed > shut else min(P["pwm_max"], 100 / compensation)

        time_constant = table("time_constant", r, speed)
        delay = table("delay", r, speed)
        # The gain at rest is at most 4 %/kPa.
        at_rest = max(P["feedback_lambda"], time_constant / (4e-3 * abs(table("gain", r, speed))) - delay / 2)
        feedback_lambda = at_rest + self.firmness * (lag - at_rest)
        filter_time = max(feedback_lambda - lag, 0)
        measurement = self.measured(filter_time, boost)
        delay += filter_time
        integral_gain = 1 / (table("gain", r, speed) * (delay / 2 + feedback_lambda))
        integral_time = time_constant + delay / 2
        gain = integral_time * integral_gain
        derivative_time = time_constant * delay / (delay + 2 * time_constant) + self.firmness * lag
        ratio = max(derivative_time / SAMPLE_TIME, 1)
        pole = derivative_time / (derivative_time + ratio * SAMPLE_TIME)
        self.derivative = pole * self.derivative - gain * ratio * pole * (measurement - self.before)
        self.before = measurement

        model_gain = table("gain", self.model, speed)
        slope = model_gain / table("time_constant", self.model, speed)
        if self.gain is not None:
            self.integral *= (self.gain / model_gain) ** P["integral_exponent"]
        self.gain = model_gain
        holding = self.holding(speed, rate)
        asked = holding + (r - self.model) / model_lambda / slope
        feedforward = clip(asked, max(P["pwm_min"], LIFT_OFF), most)
        error = 0.0 if self.delayed is None else self.delayed - measurement
        delayed = self.model if self.delayed is None else self.delayed
        self.delayed = delayed + SAMPLE_TIME / max(delay, SAMPLE_TIME) * (self.model - delayed)
        self.model += SAMPLE_TIME * (feedforward - holding) * slope

        unlimited = feedforward + gain * error + self.integral + self.derivative
        duty = clip(unlimited, P["pwm_min"], most)
        tracking_time = max(math.sqrt(integral_time * derivative_time), 4 * SAMPLE_TIME)
        self.integral += SAMPLE_TIME * integral_gain * error
        self.integral += SAMPLE_TIME / tracking_time * (duty - unlimited)

        beyond = duty - start
        curve = 0.0 if beyond <= 0 else 1.0 if beyond >= span else min(shape * beyond / (span - beyond), 1)
        bypass = rho(speed, P["allocation.bypass_shut_below"], P["allocation.bypass_free_above"])
        bypass *= rho(duty, P["allocation.bypass_start"], P["allocation.bypass_end"])
        before = bypass if self.bypass is None else self.bypass
        alone = bypass < before and duty <= start
        time = P["allocation.bypass_closing_time" if alone else "allocation.bypass_opening_time"]
        self.bypass = before + SAMPLE_TIME / time * (bypass - before)
        if tank > P["tank_pressure_on"]:
            self.pump = 1.0
        elif tank < P["tank_pressure_off"]:
            self.pump = 0.0
        valve = min(min(duty, P["pwm_max"]) * compensation, 100)
        return [valve, rho(speed, shut, free) * curve, self.bypass, self.pump]


def main() -> None:
    with (Path(__file__).parent / "split_range.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(rows[0])
    controller = None
    for row in rows[1:]:
        if int(row[1]) == 0:
            controller = Controller()
        reference, boost, voltage, tank, speed = map(float, row[2:7])
        outputs = controller.sample(reference, boost, voltage, tank, speed)
        writer.writerow([*row[:7], *map(repr, outputs)])


if __name__ == "__main__":
    main()
