"""Makes the experiments of this folder: all ten inputs of the plant are random, and an independent
implementation of its equations computes the reference with SciPy's DOP853 at a tolerance of 1e-11.

    python tests/data/experiments/make.py [--out FOLDER | --check] [NUMBER ...]

It writes the files, here or in another folder, or checks the existing ones.

The equations are those of src/plant/, which has their sources, transcribed as they are read there; the
parameters are read from modelDescription/plant.json. Needs Python 3.11 and SciPy; an experiment takes about
half a minute.

For each experiment there are two files. `NN_inputs.csv`: for each input its values over time, linear between
the points; the plant sees the value at the begin of each communication step of 12.5 ms. `NN_reference.csv`:
the initial states, then states and outputs every 0.1 s, in the order of tests/plant/bench.rs.
"""

import argparse
import json
import math
import random
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

from scipy.integrate import DOP853

FOLDER = Path(__file__).parent
STEP = 0.0125
DURATION = 20.0
ROW = 8
TOLERANCE = 1e-11

# The inputs in the reference's order, each with the range in which it moves.
INPUTS = {
    "hp_wastegate_pwm": (0.0, 100.0),
    "supply_voltage": (9.0, 15.0),
    "vacuum_pump": (0.0, 1.0),
    "engine_speed": (800.0, 6000.0),
    "throttle": (0.15, 1.0),
    "lp_wastegate": (0.0, 1.0),
    "hp_bypass": (0.0, 1.0),
    "surge_valve": (0.0, 1.0),
    "ambient_pressure": (7e4, 1.08e5),
    "ambient_temperature": (250.0, 320.0),
}
# The full scale of each state.
SCALES = [3.5e4, 1e5, 1e-2, 0.1, 0.2, 100.0, 1e5, 2e5, 2e5, 2e5, 2e5, 2e5, 1.5e5, 1e5, 2e4, 1e4]


def parameters():
    """The start values of all parameters by name."""
    model = json.loads((FOLDER / "../../../modelDescription/plant.json").read_text())
    found = {}
    for component in model["components"]:
        starts = component.get("start", {})
        variables = component.get("variables")
        if variables is None:
            types = {kind["name"]: kind["variables"] for kind in model["component_types"]}
            variables = types[component["type"]]
        for variable in variables:
            if variable["causality"] == "parameter":
                name = f"{component['name']}.{variable['name']}"
                found[name] = starts.get(variable["name"], variable.get("start"))
    return found


def points_of(seed):
    """Points (time, value) of each input: constant values, jumps and ramps."""
    chance = random.Random(seed)
    points = {}
    for name, (least, most) in INPUTS.items():

        def value(name=name, least=least, most=most):
            if name == "vacuum_pump":
                return float(chance.random() < 0.5)
            if name == "surge_valve" and chance.random() < 0.7:
                return 0.0
            return float(f"{chance.uniform(least, most):.4g}")

        now = value()
        points[name] = [(0.0, now)]
        # Between communication points, so that rounding of times has no effect.
        time = 0.5 * STEP
        while time < DURATION:
            time += math.floor(chance.uniform(0.2, 3.0) / STEP) * STEP
            points[name].append((round(time, 5), now))
            now = value()
            if name != "vacuum_pump" and chance.random() < 0.5:
                time += math.floor(chance.uniform(0.1, 2.0) / STEP) * STEP
            points[name].append((round(time, 5), now))
    return points


def value_at(points, time):
    """The value of an input: linear between its points, the later one of two at the same time."""
    for (start, first), (end, last) in pairwise(points):
        if start <= time < end:
            return first + (last - first) * (time - start) / (end - start)
    return points[-1][1]


def smooth_max(a, b, width):
    return 0.5 * (a + b + math.sqrt((a - b) ** 2 + width**2))


def root(x, width):
    return x / (x * x + width * width) ** 0.25


class Plant:
    """The plant's equations over lists of states and inputs in the reference's order."""

    def __init__(self):
        p = parameters()
        self.p = p
        self.air = self.gas("air")
        self.exhaust = self.gas("exhaust_gas")
        self.psi_valve = self.flow_function(self.air[2], p["valve.linear_pressure_ratio"])
        linear = p["restrictions.linear_pressure_ratio"]
        self.psi_air = self.flow_function(self.air[2], linear)
        self.psi_exhaust = self.flow_function(self.exhaust[2], linear)

    def gas(self, name):
        return tuple(
            self.p[f"{name}.{quantity}"]
            for quantity in ("gas_constant", "specific_heat", "heat_capacity_ratio")
        )

    @staticmethod
    def flow_function(gamma, linear):
        critical = (2 / (gamma + 1)) ** (gamma / (gamma - 1))

        def isentropic(ratio):
            fall = ratio ** ((gamma - 1) / gamma)
            return ratio ** (1 / gamma) * math.sqrt(2 * gamma / (gamma - 1) * (1 - fall))

        slope = isentropic(linear) / (1 - linear)

        def psi(ratio):
            return slope * (1 - ratio) if ratio > linear else isentropic(max(ratio, critical))

        return psi

    @staticmethod
    def restriction(psi, gas_constant, area, p1, t1, p2, t2):
        if p1 >= p2:
            return area * p1 / math.sqrt(gas_constant * t1) * psi(p2 / p1)
        return -area * p2 / math.sqrt(gas_constant * t2) * psi(p1 / p2)

    def resistance(self, name, p1, t1, p2, t2):
        difference = p1 - p2
        pressure, temperature = (p1, t1) if difference >= 0 else (p2, t2)
        factor = math.sqrt(pressure / (self.p[f"{name}.flow_resistance"] * temperature))
        return factor * root(difference, self.p[f"{name}.linear_pressure"])

    def compressor(self, name, p1, t1, p2, speed):
        p, (gas_constant, cp, gamma) = self.p, self.air
        diameter = p[f"{name}.diameter"]
        tip = (0.5 * diameter * speed) ** 2
        rise = t1 * ((p2 / p1) ** ((gamma - 1) / gamma) - 1)
        head = tip - 2 * cp * rise / p[f"{name}.peak_head_coefficient"]
        along = p[f"{name}.peak_flow_coefficient"] * root(head, p[f"{name}.head_smoothing"])
        flow = p1 / (gas_constant * t1) * math.pi / 4 * diameter**2 * along
        off = along / math.sqrt(tip + 100) / p[f"{name}.peak_efficiency_flow_coefficient"] - 1
        best = p[f"{name}.peak_efficiency"]
        efficiency = smooth_max(best * (1 - off**2), p[f"{name}.minimum_efficiency"], 0.02)
        warmer = smooth_max(rise, 0, 1) / efficiency
        return flow, t1 + warmer, smooth_max(flow, 0, 1e-4) * cp * warmer

    def turbine(self, name, p1, t1, p2, speed):
        p, (_, cp, gamma) = self.p, self.exhaust
        ratio = p2 / p1
        drive = 1 - ratio ** p[f"{name}.flow_exponent"]
        flow = p[f"{name}.flow_capacity"] * p1 / math.sqrt(t1) * root(drive, p[f"{name}.flow_smoothing"])
        fall = smooth_max(cp * t1 * (1 - ratio ** ((gamma - 1) / gamma)), 0, 100)
        speed_ratio = 0.5 * p[f"{name}.diameter"] * speed / math.sqrt(2 * fall)
        off = speed_ratio / p[f"{name}.peak_efficiency_speed_ratio"] - 1
        best = p[f"{name}.peak_efficiency"]
        efficiency = smooth_max(best * (1 - off**2), p[f"{name}.minimum_efficiency"], 0.02)
        return flow, t1 - efficiency * fall / cp, smooth_max(flow, 0, 1e-5) * fall * efficiency

    def area(self, name):
        return self.p[f"{name}.area"] * self.p[f"{name}.discharge_coefficient"]

    @staticmethod
    def mixed(flow1, t1, flow2, t2, width):
        a, b = smooth_max(flow1, 0, width), smooth_max(flow2, 0, width)
        return (a * t1 + b * t2) / (a + b)

    def evaluate(self, x, u):
        """The states' derivatives, and the outputs."""
        p = self.p
        (ra, _, _), (re, cpe, ge) = self.air, self.exhaust
        pwm, voltage, pump, speed, throttle, lpwg, bypass, surge, p_amb, t_amb = u
        p_tank, p_act, position, velocity, friction, duty = x[:6]
        p_af, p_1, p_2, p_ic, p_im, p_em, p_it, p_t, w_hp, w_lp = x[6:]

        # Actuation.
        effective = max(voltage - p["pump.voltage_drop"] * pump, 0)
        scaled = pwm * (effective / p["valve.nominal_voltage"]) ** p["valve.voltage_exponent"]
        d_duty = (min(max(scaled, 0), 100) - duty) / p["valve.time_constant"]
        k1, k2, k3, k4 = p["valve.pressure_coefficient"]
        target = min(k1 * duty**3 + k2 * duty**2 + k3 * duty + k4, p_amb)
        z = (p_act - target) / p["valve.proportional_band"]
        share = abs(z) / math.sqrt(1 + z * z)
        tank_area = p["valve.tank_area"] * share if z >= 0 else 0.0
        ambient_area = p["valve.ambient_area"] * share if z < 0 else 0.0
        l1, l2, l3 = p["valve.leakage_coefficient"]
        leak_area = p["valve.leakage_area_scale"] * max(l1 * duty**2 + l2 * duty + l3, 0)
        vacuum = self.psi_valve
        to_tank = self.restriction(vacuum, ra, tank_area, p_act, t_amb, p_tank, t_amb)
        from_ambient = self.restriction(vacuum, ra, ambient_area, p_amb, t_amb, p_act, t_amb)
        leak = self.restriction(vacuum, ra, leak_area, p_amb, t_amb, p_tank, t_amb)
        d_tank = ra * t_amb / p["tank.volume"] * (leak + to_tank - p["pump.mass_flow"] * pump)
        membrane = p["actuator.membrane_area"]
        volume = p["actuator.chamber_volume"] - membrane * position
        d_act = (ra * t_amb * (from_ambient - to_tank) + p_act * membrane * velocity) / volume
        stroke = p["actuator.stroke"]
        stop, depth = 0.0, -position if position < 0 else position - stroke
        if depth > 0:
            damped = p["actuator.stop_damping"] * velocity * min(depth / p["actuator.stop_damping_depth"], 1)
            stop = p["actuator.stop_stiffness"] * (position if position < 0 else depth) + damped
        spring = p["actuator.spring_preload"] + p["actuator.spring_stiffness"] * position
        spring += p["actuator.spring_hardening"] * position**7
        force = (p_amb - p_act) * membrane + p["actuator.exhaust_area"] * (p_em - p_it)
        force -= spring + stop + friction + p["actuator.damping"] * velocity
        coulomb = p["actuator.coulomb_friction"]
        d_friction = p["actuator.friction_stiffness"] * (velocity - abs(velocity) * friction / coulomb)

        # Air path.
        w_af = self.resistance("air_filter", p_amb, t_amb, p_af, t_amb)
        w_lc, t_1, power_lc = self.compressor("lp_compressor", p_af, t_amb, p_1, w_lp)
        w_hc, t_2, power_hc = self.compressor("hp_compressor", p_1, t_1, p_2, w_hp)
        open_area = bypass * self.area("hp_bypass_port")
        w_bp = self.restriction(self.psi_air, ra, open_area, p_1, t_1, p_2, t_2)
        t_2m = self.mixed(w_hc, t_2, w_bp, t_1, 1e-4)
        w_ic = self.resistance("intercooler", p_2, t_2m, p_ic, t_2m)
        t_ic = t_2m - p["intercooler.effectiveness"] * (t_2m - t_amb)
        open_area = surge * self.area("surge_valve_port")
        w_sv = self.restriction(self.psi_air, ra, open_area, p_ic, t_ic, p_1, t_1)
        open_area = throttle * p["throttle_body.area"]
        w_th = self.restriction(self.psi_air, ra, open_area, p_ic, t_ic, p_im, t_ic)

        # Cylinders.
        ratio = p["cylinders.compression_ratio"]
        filling = p["cylinders.volumetric_efficiency_factor"]
        filling *= max(ratio - (p_em / p_im) ** (1 / ge), 0) / (ratio - 1)
        displacement = p["cylinders.displacement"]
        w_ac = filling * displacement * speed / 120 * p_im / (ra * t_ic)
        fuel = w_ac / p["cylinders.stoichiometric_air_fuel_ratio"]
        w_e = w_ac + fuel
        t_e = p["cylinders.exhaust_temperature_offset"] + p["cylinders.exhaust_temperature_slope"] * w_e
        cooling = math.exp(-p["exhaust_manifold.heat_transfer"] / (w_e * cpe + 1e-3))
        t_em = t_amb + (t_e - t_amb) * cooling

        # Exhaust.
        w_ht, t_ht, power_ht = self.turbine("hp_turbine", p_em, t_em, p_it, w_hp)
        opening = min(max(position / stroke, 0), 1)
        open_area = self.area("hp_wastegate_port") * opening**2
        w_wg = self.restriction(self.psi_exhaust, re, open_area, p_em, t_em, p_it, t_em)
        t_it = self.mixed(w_ht, t_ht, w_wg, t_em, 1e-5)
        w_lt, t_lt, power_lt = self.turbine("lp_turbine", p_it, t_it, p_t, w_lp)
        open_area = lpwg * self.area("lp_wastegate_port")
        w_lw = self.restriction(self.psi_exhaust, re, open_area, p_it, t_it, p_t, t_it)
        t_t = self.mixed(w_lt, t_lt, w_lw, t_it, 1e-5)
        w_es = self.resistance("exhaust", p_t, t_t, p_amb, t_amb)

        def shaft(name, w, power_turbine, power_compressor):
            power = power_turbine - power_compressor * min(max(w, 0) / 100, 1)
            inertia = p[f"{name}.inertia"]
            return power / (inertia * smooth_max(w, 0, 100)) - p[f"{name}.bearing_damping"] * w / inertia

        rates = [
            d_tank,
            d_act,
            velocity,
            force / p["actuator.mass"],
            d_friction,
            d_duty,
            ra * t_amb / p["air_filter.volume"] * (w_af - w_lc),
            ra * t_1 / p["lp_compressor.outlet_volume"] * (w_lc - w_hc - w_bp + w_sv),
            ra * t_2m / p["hp_compressor.outlet_volume"] * (w_hc + w_bp - w_ic),
            ra * t_ic / p["intercooler.volume"] * (w_ic - w_th - w_sv),
            ra * t_ic / p["intake_manifold.volume"] * (w_th - w_ac),
            re * t_em / p["exhaust_manifold.volume"] * (w_e - w_ht - w_wg),
            re * t_it / p["interstage_exhaust.volume"] * (w_ht + w_wg - w_lt - w_lw),
            re * t_t / p["exhaust.volume"] * (w_lt + w_lw - w_es),
            shaft("hp_shaft", w_hp, power_ht, power_hc),
            shaft("lp_shaft", w_lp, power_lt, power_lc),
        ]

        # Torque.
        cycles = max(speed, 1) / 120
        boost = max(p_im / 1e5 - 1, 0)
        loss = max(1 - p["cylinders.ignition_retard_loss"] * boost**2, 0)
        work = fuel / cycles * p["cylinders.lower_heating_value"] * p["cylinders.indicated_efficiency"] * loss
        piston = 2 * p["cylinders.stroke"] * speed / 60
        load = p["cylinders.mean_effective_pressure_offset"]
        load = max(load + p["cylinders.mean_effective_pressure_slope"] * p_im, 0)
        motored = (0.464 + 0.0072 * piston**1.8) * p["cylinders.friction_boost_layout"] * 1e5
        fmep = p["cylinders.friction_auxiliary_factor"] * (motored + 0.0215 * load)
        fmep *= math.sqrt(0.075 / p["cylinders.bore"])
        torque = (work - displacement * (p_em - p_im) - displacement * fmep) / (4 * math.pi)
        rpm = 30 / math.pi
        outputs = [p_ic, 100 * opening, p_act, p_tank, torque, w_ac, w_hp * rpm, w_lp * rpm, p_em, p_it]
        outputs += [t_em, t_ic, w_hc, w_lc, w_wg, target, t_2, w_lt, w_ht, filling]
        return rates, outputs


def make(number, folder):
    """Writes the two files of an experiment into a folder."""
    plant, points = Plant(), points_of(number)
    # Full precision below the full scale, where the tolerance of the states is an absolute one.
    inputs_at = {
        count: [value_at(points[name], count * STEP) for name in INPUTS]
        for count in range(round(DURATION / STEP))
    }
    p_amb = inputs_at[0][8]
    states = [32500.0, p_amb, 0.0, 0.0, 0.0, 0.0, p_amb - 200, p_amb, p_amb + 500, p_amb, 0.98 * p_amb]
    states += [p_amb + 1e4, p_amb + 4e3, p_amb + 800, 6000.0, 2500.0]
    rows, first_step = [f"# x0: {' '.join(map(repr, states))}"], 1e-5
    for count, inputs in inputs_at.items():
        end = (count + 1) * STEP
        solver = DOP853(
            lambda _, x, inputs=inputs: plant.evaluate(x, inputs)[0],
            count * STEP,
            states,
            end,
            first_step=min(first_step, STEP / 2),
            rtol=TOLERANCE,
            atol=[TOLERANCE * scale for scale in SCALES],
        )
        while solver.status == "running":
            solver.step()
            first_step = solver.step_size if solver.t < end else first_step
        assert solver.status == "finished", solver.status
        states = list(map(float, solver.y))
        if (count + 1) % ROW == 0:
            outputs = plant.evaluate(states, inputs)[1]
            rows.append(",".join(f"{value:.10g}" for value in [end, *states, *outputs]))
    (folder / f"{number:02}_reference.csv").write_text("\n".join(rows) + "\n")
    lines = [f"{name},{time:.10g},{value:.10g}" for name in INPUTS for time, value in points[name]]
    (folder / f"{number:02}_inputs.csv").write_text("\n".join(lines) + "\n")


def rows_of(folder, number):
    """The numbers of an experiment's reference: the initial states, then row by row."""
    head, *lines = (folder / f"{number:02}_reference.csv").read_text().splitlines()
    words = [head.removeprefix("# x0:").split(), *(line.split(",") for line in lines)]
    return [[float(word) for word in row] for row in words]


def check(number):
    """Fails if a new run of an experiment differs from the stored one.

    The inputs are the same bytes. The reference may differ by the rounding of another processor, of another
    version of SciPy or of the system's mathematics: by 1e-6 of the largest value of a column, a hundredth of
    the tolerance of the plant's tests (1e-4). OpenBLAS's kernels for two processors (OPENBLAS_CORETYPE) moved
    the friction of experiment 2 by 2e-7.
    """
    with TemporaryDirectory() as name:
        made = Path(name)
        make(number, made)
        inputs = f"{number:02}_inputs.csv"
        if (made / inputs).read_bytes() != (FOLDER / inputs).read_bytes():
            raise SystemExit(f"{inputs} is not what {Path(__file__).name} makes")
        (start, *rows), (kept_start, *kept) = rows_of(made, number), rows_of(FOLDER, number)
    file = f"{number:02}_reference.csv"
    if start != kept_start or [len(row) for row in rows] != [len(row) for row in kept]:
        raise SystemExit(f"{file} has other initial states or rows than {Path(__file__).name} makes")
    columns = zip(zip(*rows, strict=True), zip(*kept, strict=True), strict=True)
    for column, (ours, theirs) in enumerate(columns):
        scale = max(map(abs, theirs)) or 1.0
        worst = max(abs(a - b) for a, b in zip(ours, theirs, strict=True)) / scale
        if not worst <= 1e-6:
            raise SystemExit(f"{file}: column {column} differs by {worst:.1e} of its largest value")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--out", type=Path, default=FOLDER, help="the folder to write to")
    where.add_argument("--check", action="store_true", help="compare with the stored files instead")
    parser.add_argument("numbers", type=int, nargs="*", default=range(1, 11))
    options = parser.parse_args()
    for number in options.numbers:
        if options.check:
            check(number)
        else:
            make(number, options.out)
        print(f"experiment {number}")
