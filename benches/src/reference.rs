//! The straightforward right-hand side to compare the plant with, and the simplest integration: the classical
//! Runge-Kutta method at 1/2400 s.
//!
//! The equations are those of `src/plant/`, which names their sources, in plain numbers: no derivatives, nothing
//! kept from one evaluation to the next, no outputs. The test below compares both, so that they do not drift
//! apart.

use std::f64::consts::PI;

use boost_fmu::plant::variables::{
    ActuatorParameters, CompressorParameters, Inputs, Parameters, ShaftParameters, States, TurbineParameters,
};

/// The step of the Runge-Kutta method in s.
const STEP: f64 = 1.0 / 2400.0;
/// Pressures (Pa) are at least this.
const LOWEST_PRESSURE: f64 = 1.0;

/// An ideal gas.
#[derive(Clone, Copy)]
struct Gas {
    constant: f64,
    specific_heat: f64,
    ratio: f64,
    isentropic_exponent: f64,
}

impl Gas {
    fn pressure_rate(&self, temperature: f64, volume: f64, mass_flow: f64) -> f64 {
        self.constant * temperature / volume * mass_flow
    }
}

/// The flow function of an opening.
#[derive(Clone, Copy)]
struct Orifice {
    gas: Gas,
    factor: f64,
    critical_ratio: f64,
    linear_ratio: f64,
    linear_slope: f64,
}

impl Orifice {
    fn new(gas: Gas, linear_ratio: f64) -> Self {
        let mut orifice = Self {
            gas,
            factor: 2.0 * gas.ratio / (gas.ratio - 1.0),
            critical_ratio: (2.0 / (gas.ratio + 1.0)).powf(1.0 / gas.isentropic_exponent),
            linear_ratio,
            linear_slope: 0.0,
        };
        orifice.linear_slope = orifice.isentropic(linear_ratio) / (1.0 - linear_ratio);
        orifice
    }

    fn isentropic(&self, pressure_ratio: f64) -> f64 {
        let temperature_ratio = pressure_ratio.powf(self.gas.isentropic_exponent);
        pressure_ratio / temperature_ratio * (self.factor * (1.0 - temperature_ratio)).sqrt()
    }

    fn downhill(&self, area: f64, (pressure, temperature): (f64, f64), downstream: f64) -> f64 {
        let ratio = downstream / pressure;
        let flow = if ratio > self.linear_ratio {
            self.linear_slope * (1.0 - ratio)
        } else {
            self.isentropic(ratio.max(self.critical_ratio))
        };
        area * (pressure / (self.gas.constant * temperature).sqrt()) * flow
    }

    /// The flow from the first to the second side, each with its pressure and temperature.
    #[allow(clippy::float_cmp, reason = "an area of exactly 0 is a shut opening")]
    fn flow(&self, area: f64, first: (f64, f64), second: (f64, f64)) -> f64 {
        if area == 0.0 {
            0.0
        } else if first.0 >= second.0 {
            self.downhill(area, first, second.0)
        } else {
            -self.downhill(area, second, first.0)
        }
    }
}

/// The operating point of a compressor or turbine.
struct Turbomachine {
    mass_flow: f64,
    outlet_temperature: f64,
    power: f64,
}

/// The plant's parameters, and the constants that follow from them.
#[derive(Clone)]
pub struct Reference {
    parameters: Parameters,
    air: Gas,
    exhaust_gas: Gas,
    vacuum_orifice: Orifice,
    air_orifice: Orifice,
    exhaust_orifice: Orifice,
}

impl Reference {
    /// The plant with its parameters.
    #[must_use]
    pub fn new(parameters: &Parameters) -> Self {
        let gas = |constant: f64, specific_heat: f64, ratio: f64| Gas {
            constant,
            specific_heat,
            ratio,
            isentropic_exponent: (ratio - 1.0) / ratio,
        };
        let (a, e) = (&parameters.air, &parameters.exhaust_gas);
        let air = gas(a.gas_constant, a.specific_heat, a.heat_capacity_ratio);
        let exhaust_gas = gas(e.gas_constant, e.specific_heat, e.heat_capacity_ratio);
        let linear_ratio = parameters.restrictions.linear_pressure_ratio;
        Self {
            parameters: *parameters,
            air,
            exhaust_gas,
            vacuum_orifice: Orifice::new(air, parameters.valve.linear_pressure_ratio),
            air_orifice: Orifice::new(air, linear_ratio),
            exhaust_orifice: Orifice::new(exhaust_gas, linear_ratio),
        }
    }

    /// Advances the states by a duration in s.
    pub fn advance(&self, states: &mut States, inputs: &Inputs, duration: f64) {
        // The count fits; the factor allows for rounding in the duration.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let count = (duration / STEP - 1e-6).ceil().max(1.0) as u32;
        let step = duration / f64::from(count);
        let mut x = states.to_array();
        let slopes =
            |x: [f64; States::COUNT]| self.right_hand_side(&States::from_array(x), inputs).to_array();
        let moved = |x: &[f64; States::COUNT], k: &[f64; States::COUNT], duration: f64| {
            std::array::from_fn(|i| x[i] + duration * k[i])
        };
        for _ in 0..count {
            let k1 = slopes(x);
            let k2 = slopes(moved(&x, &k1, 0.5 * step));
            let k3 = slopes(moved(&x, &k2, 0.5 * step));
            let k4 = slopes(moved(&x, &k3, step));
            for i in 0..States::COUNT {
                x[i] += step / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
            }
        }
        *states = States::from_array(x);
    }

    /// The states' derivatives.
    #[must_use]
    #[allow(clippy::too_many_lines)] // One line a flow, one a balance.
    pub fn right_hand_side(&self, states: &States, inputs: &Inputs) -> States {
        let p = &self.parameters;
        let ambient = (inputs.ambient_pressure, inputs.ambient_temperature);
        let p_tank = states.tank.pressure.max(LOWEST_PRESSURE);
        let p_act = states.actuator.chamber_pressure.max(LOWEST_PRESSURE);
        let p_af = states.air_filter.pressure.max(LOWEST_PRESSURE);
        let p_1 = states.lp_compressor.outlet_pressure.max(LOWEST_PRESSURE);
        let p_2 = states.hp_compressor.outlet_pressure.max(LOWEST_PRESSURE);
        let p_ic = states.intercooler.outlet_pressure.max(LOWEST_PRESSURE);
        let p_im = states.intake_manifold.pressure.max(LOWEST_PRESSURE);
        let p_em = states.exhaust_manifold.pressure.max(LOWEST_PRESSURE);
        let p_it = states.interstage_exhaust.pressure.max(LOWEST_PRESSURE);
        let p_t = states.exhaust.pressure.max(LOWEST_PRESSURE);
        let (w_hp, w_lp) = (states.hp_shaft.speed, states.lp_shaft.speed);
        let (position, velocity) = (states.actuator.position, states.actuator.velocity);
        let mut rates = States::default();

        // Supply and solenoid valve.
        let voltage = (inputs.supply_voltage - p.pump.voltage_drop * inputs.vacuum_pump).max(0.0);
        rates.supply_sensor.voltage =
            (voltage - states.supply_sensor.voltage) / p.supply_sensor.time_constant;
        let duty = self.commanded_duty(inputs.hp_wastegate_pwm, voltage);
        let u = states.valve.plunger_duty;
        rates.valve.plunger_duty = (duty - u) / p.valve.time_constant;
        let [k1, k2, k3, k4] = p.valve.pressure_coefficient;
        let target = (((k1 * u + k2) * u + k3) * u + k4).min(ambient.0);
        let deviation = (p_act - target) / p.valve.proportional_band;
        let opening = deviation / (1.0 + deviation * deviation).sqrt();
        let [l1, l2, l3] = p.valve.leakage_coefficient;
        let leakage_area = p.valve.leakage_area_scale * ((l1 * u + l2) * u + l3).max(0.0);
        let (chamber, tank) = ((p_act, ambient.1), (p_tank, ambient.1));
        let to_tank = self.vacuum_orifice.flow(p.valve.tank_area * opening.max(0.0), chamber, tank);
        let from_ambient =
            self.vacuum_orifice.flow(p.valve.ambient_area * (-opening).max(0.0), ambient, chamber);
        let leakage = self.vacuum_orifice.flow(leakage_area, ambient, tank);

        // Vacuum tank and actuator.
        let pumped = p.pump.mass_flow * inputs.vacuum_pump * ((p_tank - 10.0) / 990.0).clamp(0.0, 1.0);
        rates.tank.pressure = if p.tank.frozen {
            0.0
        } else {
            self.air.pressure_rate(ambient.1, p.tank.volume, leakage + to_tank - pumped)
        };
        let a = &p.actuator;
        let volume = (a.chamber_volume - a.membrane_area * position).max(1e-3 * a.chamber_volume);
        let inflow = self.air.constant * ambient.1 * (from_ambient - to_tank);
        rates.actuator.chamber_pressure = (inflow + p_act * a.membrane_area * velocity) / volume;
        rates.actuator.position = velocity;
        let friction = states.actuator.friction_force;
        let spring = a.spring_preload + a.spring_stiffness * position + a.spring_hardening * position.powi(7);
        let open = (ambient.0 - p_act) * a.membrane_area + a.exhaust_area * (p_em - p_it)
            - spring
            - stop_force(a, position, velocity);
        rates.actuator.velocity = (open - friction - a.damping * velocity) / a.mass;
        rates.actuator.friction_force = friction_rate(a, friction, velocity);

        // Air path.
        let air_filter = resistance_flow(
            (p.air_filter.flow_resistance, p.air_filter.linear_pressure),
            ambient,
            (p_af, ambient.1),
        );
        let lpc = self.compress(&p.lp_compressor, (p_af, ambient.1), p_1, w_lp);
        let between = (p_1, lpc.outlet_temperature);
        let hpc = self.compress(&p.hp_compressor, between, p_2, w_hp);
        let port = &p.hp_bypass_port;
        let bypass = self.air_orifice.flow(
            inputs.hp_bypass * port.area * port.discharge_coefficient,
            between,
            (p_2, hpc.outlet_temperature),
        );
        let t_2m = mixed_temperature(
            (hpc.mass_flow, hpc.outlet_temperature),
            (bypass, lpc.outlet_temperature),
            1e-4,
        );
        let intercooler = resistance_flow(
            (p.intercooler.flow_resistance, p.intercooler.linear_pressure),
            (p_2, t_2m),
            (p_ic, t_2m),
        );
        let t_ic = t_2m - p.intercooler.effectiveness * (t_2m - ambient.1);
        let port = &p.surge_valve_port;
        let surge_valve = self.air_orifice.flow(
            inputs.surge_valve * port.area * port.discharge_coefficient,
            (p_ic, t_ic),
            between,
        );
        let throttle =
            self.air_orifice.flow(inputs.throttle * p.throttle_body.area, (p_ic, t_ic), (p_im, t_ic));

        // Cylinders.
        let c = &p.cylinders;
        let residual = (p_em / p_im).powf(1.0 / self.exhaust_gas.ratio);
        let filling = c.volumetric_efficiency_factor * (c.compression_ratio - residual).max(0.0)
            / (c.compression_ratio - 1.0);
        let density = p_im / (self.air.constant * t_ic);
        let air = filling * c.displacement * inputs.engine_speed / 120.0 * density;
        let burnt = air + air / c.stoichiometric_air_fuel_ratio;
        let t_valves = c.exhaust_temperature_offset + c.exhaust_temperature_slope * burnt;

        // Exhaust.
        let heat_capacity_flow = burnt.max(0.0) * self.exhaust_gas.specific_heat + 1e-3;
        let cooling = (-p.exhaust_manifold.heat_transfer / heat_capacity_flow).exp();
        let t_em = ambient.1 + (t_valves - ambient.1) * cooling;
        let hpt = self.expand(&p.hp_turbine, (p_em, t_em), p_it, w_hp);
        let flap = (position / a.stroke).clamp(0.0, 1.0);
        let port = &p.hp_wastegate_port;
        let hp_wastegate = self.exhaust_orifice.flow(
            flap * flap * port.area * port.discharge_coefficient,
            (p_em, t_em),
            (p_it, t_em),
        );
        let t_it = mixed_temperature((hpt.mass_flow, hpt.outlet_temperature), (hp_wastegate, t_em), 1e-5);
        let lpt = self.expand(&p.lp_turbine, (p_it, t_it), p_t, w_lp);
        let port = &p.lp_wastegate_port;
        let lp_wastegate = self.exhaust_orifice.flow(
            inputs.lp_wastegate * port.area * port.discharge_coefficient,
            (p_it, t_it),
            (p_t, t_it),
        );
        let t_t = mixed_temperature((lpt.mass_flow, lpt.outlet_temperature), (lp_wastegate, t_it), 1e-5);
        let exhaust =
            resistance_flow((p.exhaust.flow_resistance, p.exhaust.linear_pressure), (p_t, t_t), ambient);

        // The balances of the volumes and the shafts.
        let (gas, exhaust_gas) = (&self.air, &self.exhaust_gas);
        rates.air_filter.pressure =
            gas.pressure_rate(ambient.1, p.air_filter.volume, air_filter - lpc.mass_flow);
        rates.lp_compressor.outlet_pressure = gas.pressure_rate(
            lpc.outlet_temperature,
            p.lp_compressor.outlet_volume,
            lpc.mass_flow - hpc.mass_flow - bypass + surge_valve,
        );
        rates.hp_compressor.outlet_pressure =
            gas.pressure_rate(t_2m, p.hp_compressor.outlet_volume, hpc.mass_flow + bypass - intercooler);
        rates.intercooler.outlet_pressure =
            gas.pressure_rate(t_ic, p.intercooler.volume, intercooler - throttle - surge_valve);
        rates.intake_manifold.pressure = gas.pressure_rate(t_ic, p.intake_manifold.volume, throttle - air);
        rates.exhaust_manifold.pressure =
            exhaust_gas.pressure_rate(t_em, p.exhaust_manifold.volume, burnt - hpt.mass_flow - hp_wastegate);
        rates.interstage_exhaust.pressure = exhaust_gas.pressure_rate(
            t_it,
            p.interstage_exhaust.volume,
            hpt.mass_flow + hp_wastegate - lpt.mass_flow - lp_wastegate,
        );
        rates.exhaust.pressure =
            exhaust_gas.pressure_rate(t_t, p.exhaust.volume, lpt.mass_flow + lp_wastegate - exhaust);
        rates.hp_shaft.speed = acceleration(&p.hp_shaft, w_hp, hpt.power, hpc.power);
        rates.lp_shaft.speed = acceleration(&p.lp_shaft, w_lp, lpt.power, lpc.power);
        rates
    }

    #[allow(clippy::float_cmp, reason = "exactly 1 needs no power")]
    fn commanded_duty(&self, duty: f64, voltage: f64) -> f64 {
        let valve = &self.parameters.valve;
        let relative = voltage / valve.nominal_voltage;
        let gain =
            if valve.voltage_exponent == 1.0 { relative } else { relative.powf(valve.voltage_exponent) };
        (duty * gain).clamp(0.0, 100.0)
    }

    fn compress(
        &self,
        c: &CompressorParameters,
        (pressure, temperature): (f64, f64),
        outlet_pressure: f64,
        speed: f64,
    ) -> Turbomachine {
        let specific_heat = self.air.specific_heat;
        let tip_speed_squared = (0.5 * c.diameter * speed).powi(2);
        let rise = temperature * ((outlet_pressure / pressure).powf(self.air.isentropic_exponent) - 1.0);
        let flow_speed_squared = tip_speed_squared - 2.0 * specific_heat * rise / c.peak_head_coefficient;
        let flow_speed = c.peak_flow_coefficient * signed_root(flow_speed_squared, c.head_smoothing);
        let area = 0.25 * PI * c.diameter * c.diameter;
        let mass_flow = pressure / (self.air.constant * temperature) * area * flow_speed;
        let flow_coefficient = flow_speed / (tip_speed_squared + 100.0).sqrt();
        let off_peak = flow_coefficient / c.peak_efficiency_flow_coefficient - 1.0;
        let efficiency =
            smooth_max(c.peak_efficiency * (1.0 - off_peak * off_peak), c.minimum_efficiency, 0.02);
        let actual_rise = smooth_max(rise, 0.0, 1.0) / efficiency;
        Turbomachine {
            mass_flow,
            outlet_temperature: temperature + actual_rise,
            power: smooth_max(mass_flow, 0.0, 1e-4) * specific_heat * actual_rise,
        }
    }

    fn expand(
        &self,
        t: &TurbineParameters,
        (pressure, temperature): (f64, f64),
        outlet_pressure: f64,
        speed: f64,
    ) -> Turbomachine {
        let gas = &self.exhaust_gas;
        let pressure_ratio = outlet_pressure / pressure;
        let drive = 1.0 - pressure_ratio.powf(t.flow_exponent);
        let mass_flow =
            t.flow_capacity * pressure / temperature.sqrt() * signed_root(drive, t.flow_smoothing);
        let isentropic =
            gas.specific_heat * temperature * (1.0 - pressure_ratio.powf(gas.isentropic_exponent));
        let enthalpy = smooth_max(isentropic, 0.0, 100.0);
        let speed_ratio = 0.5 * t.diameter * speed / (2.0 * enthalpy).sqrt();
        let off_peak = speed_ratio / t.peak_efficiency_speed_ratio - 1.0;
        let efficiency =
            smooth_max(t.peak_efficiency * (1.0 - off_peak * off_peak), t.minimum_efficiency, 0.02);
        Turbomachine {
            mass_flow,
            outlet_temperature: temperature - efficiency * enthalpy / gas.specific_heat,
            power: smooth_max(mass_flow, 0.0, 1e-5) * enthalpy * efficiency,
        }
    }
}

fn smooth_max(a: f64, b: f64, width: f64) -> f64 {
    let distance = a - b;
    0.5 * (a + b + (distance * distance + width * width).sqrt())
}

fn signed_root(x: f64, width: f64) -> f64 {
    x / (x * x + width * width).sqrt().sqrt()
}

fn mixed_temperature(first: (f64, f64), second: (f64, f64), width: f64) -> f64 {
    let a = smooth_max(first.0, 0.0, width);
    let b = smooth_max(second.0, 0.0, width);
    (a * first.1 + b * second.1) / (a + b)
}

fn resistance_flow((resistance, linear_pressure): (f64, f64), first: (f64, f64), second: (f64, f64)) -> f64 {
    let difference = first.0 - second.0;
    let (pressure, temperature) = if difference >= 0.0 { first } else { second };
    (pressure / (resistance * temperature)).sqrt() * signed_root(difference, linear_pressure)
}

fn stop_force(a: &ActuatorParameters, position: f64, velocity: f64) -> f64 {
    let damped = |depth: f64| a.stop_damping * velocity * (depth / a.stop_damping_depth).min(1.0);
    if position < 0.0 {
        a.stop_stiffness * position + damped(-position)
    } else if position > a.stroke {
        let depth = position - a.stroke;
        a.stop_stiffness * depth + damped(depth)
    } else {
        0.0
    }
}

#[allow(clippy::float_cmp, reason = "exactly 1 needs no power")]
fn friction_rate(a: &ActuatorParameters, friction_force: f64, velocity: f64) -> f64 {
    let margin = 1.0 - friction_force / a.coulomb_friction * velocity.signum();
    let share = if a.friction_exponent == 1.0 {
        margin
    } else {
        margin.abs().powf(a.friction_exponent).copysign(margin)
    };
    a.friction_stiffness * share * velocity
}

fn acceleration(shaft: &ShaftParameters, speed: f64, turbine_power: f64, compressor_power: f64) -> f64 {
    let net_power = turbine_power - compressor_power * (speed / 100.0).clamp(0.0, 1.0);
    net_power / (shaft.inertia * smooth_max(speed, 0.0, 100.0))
        - shaft.bearing_damping * speed / shaft.inertia
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::{Bench, FULL_SCALES, inputs_of, numbers, reference_states, states_of};
    use crate::random::Random;

    /// Compares the right-hand side with the plant's, which its initialization calculates.
    ///
    /// The tolerance of 1e-9 allows for another order of operations, as in the plant's own tests; 1e-9 of the full
    /// scale per second is added, for rates that are differences of nearly equal flows.
    fn assert_equal(case: &str, states: States, inputs: Inputs) {
        let expected = Bench::given(inputs, states).variables.derivatives;
        let found = Reference::new(&Parameters::default()).right_hand_side(&states, &inputs);
        let pairs = reference_states(&found).into_iter().zip(reference_states(&expected)).zip(FULL_SCALES);
        for (i, ((found, expected), scale)) in pairs.enumerate() {
            let tolerance = 1e-9 * (expected.abs() + scale);
            assert!((found - expected).abs() <= tolerance, "{case}[{i}] is {found:e}, not {expected:e}");
        }
        let voltage = (found.supply_sensor.voltage, expected.supply_sensor.voltage);
        assert!((voltage.0 - voltage.1).abs() <= 1e-9 * voltage.1.abs(), "{case}: {voltage:?}");
    }

    #[test]
    fn the_right_hand_side_is_the_plants_at_the_golden_points() {
        let golden = |case: &str, quantity: &str| {
            let heading = format!("{case} {quantity} ");
            let mut rows = include_str!("../../tests/data/golden.txt").lines();
            numbers(rows.find_map(|line| line.strip_prefix(&heading)).expect("the case exists"), ' ')
        };
        for case in ["G1", "G2", "G3"] {
            assert_equal(case, states_of(&golden(case, "x")), inputs_of(&golden(case, "u")));
        }
    }

    #[test]
    fn the_right_hand_side_is_the_plants_at_random_points() {
        let mut random = Random(1);
        for point in 0..1000 {
            // From a stopped engine to beyond full load, in any combination.
            let states = states_of(&[
                random.between(5e2, 6e4),
                random.between(2e4, 1.1e5),
                random.between(-1e-4, 1.01e-2),
                random.between(-0.1, 0.1),
                random.between(-0.25, 0.25),
                random.between(0.0, 100.0),
                random.between(8e4, 1.1e5),
                random.between(8e4, 2e5),
                random.between(8e4, 3e5),
                random.between(8e4, 3e5),
                random.between(2e4, 3e5),
                random.between(9e4, 4e5),
                random.between(9e4, 3e5),
                random.between(9e4, 2e5),
                random.between(0.0, 2e4),
                random.between(0.0, 1.2e4),
            ]);
            let inputs = inputs_of(&[
                random.between(0.0, 100.0),
                random.between(8.0, 15.0),
                random.between(0.0, 1.0),
                random.between(0.0, 6000.0),
                random.between(0.0, 1.0),
                random.between(0.0, 1.0),
                random.between(0.0, 1.0),
                random.between(0.0, 1.0),
                random.between(8e4, 1.1e5),
                random.between(2.4e2, 3.2e2),
            ]);
            assert_equal(&format!("point {point}"), states, inputs);
        }
    }
}
