//! A plant on the bench: parameters set, initialized, stepped by a master; and the order of states, inputs and outputs
//! in the independent reference implementation.

use std::ops::{Deref, DerefMut};

use boost_fmu::plant::BoostPlant;
use boost_fmu::plant::variables::{InitializationMode, Inputs, Outputs, Parameters, States, Variables};
use fmu_export::Simulation;

#[derive(Clone)]
pub struct Bench(Simulation<BoostPlant>);

impl Deref for Bench {
    type Target = Simulation<BoostPlant>;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl DerefMut for Bench {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}

impl Bench {
    /// A plant with changed parameters and start values, initialized at time 0.
    pub fn new(inputs: Inputs, change: impl FnOnce(&mut Parameters, &mut States)) -> Self {
        let mut bench = Self(Simulation::default());
        let Variables { inputs: of_bench, parameters, start, .. } = &mut bench.variables;
        *of_bench = inputs;
        change(parameters, start);
        bench.initialize();
        bench
    }

    /// A plant with a running start, with its tank frozen or not.
    pub fn running(inputs: Inputs, frozen: bool) -> Self {
        Self::new(inputs, |parameters, _| {
            parameters.initialization.mode = InitializationMode::Running;
            parameters.tank.frozen = frozen;
        })
    }

    /// A plant that starts from states.
    pub fn given(inputs: Inputs, states: States) -> Self {
        Self::new(inputs, |parameters, start| {
            parameters.initialization.mode = InitializationMode::Given;
            *start = states;
        })
    }

    pub fn initialize(&mut self) {
        self.0.initialize().expect("initialization succeeds");
    }

    /// One communication step with constant inputs.
    pub fn step(&mut self, size: f64) {
        self.0.step(size).expect("the step succeeds");
    }

    /// Communication steps of 12.5 ms.
    pub fn run(&mut self, duration: f64) {
        let begin = self.time;
        let mut count = 0.0;
        while count * 0.0125 < duration - 1e-9 {
            count += 1.0;
            let end = begin + count * 0.0125;
            self.step(end - self.time);
        }
    }

    /// The largest rate of change (1/s) of a state relative to its full scale, except for the tank.
    pub fn restlessness(&self) -> f64 {
        reference_states(&self.variables.derivatives)
            .iter()
            .zip(FULL_SCALES)
            .skip(1)
            .map(|(rate, scale)| (rate / scale).abs())
            .fold(0.0, f64::max)
    }

    pub fn is_finite(&self) -> bool {
        let outputs = reference_outputs(&self.variables);
        self.variables.states.to_array().iter().chain(&outputs).all(|x| x.is_finite())
    }
}

/// The full scale of each state, in the reference's order.
pub const FULL_SCALES: [f64; 16] =
    [3.5e4, 1e5, 1e-2, 0.1, 0.2, 100.0, 1e5, 2e5, 2e5, 2e5, 2e5, 2e5, 1.5e5, 1e5, 2e4, 1e4];

/// The full scale of each output, in the reference's order.
pub const OUTPUT_FULL_SCALES: [f64; 20] = [
    2e5, 100.0, 1e5, 3.5e4, 400.0, 0.2, 2e5, 1e5, 2e5, 1.5e5, 1200.0, 1200.0, 0.2, 0.2, 0.2, 1e5, 1200.0,
    0.2, 0.2, 1.0,
];

/// States in the reference's order, which has no measured voltage.
pub fn reference_states(states: &States) -> [f64; 16] {
    [
        states.tank.pressure,
        states.actuator.chamber_pressure,
        states.actuator.position,
        states.actuator.velocity,
        states.actuator.friction_force,
        states.valve.plunger_duty,
        states.air_filter.pressure,
        states.lp_compressor.outlet_pressure,
        states.hp_compressor.outlet_pressure,
        states.intercooler.outlet_pressure,
        states.intake_manifold.pressure,
        states.exhaust_manifold.pressure,
        states.interstage_exhaust.pressure,
        states.exhaust.pressure,
        states.hp_shaft.speed,
        states.lp_shaft.speed,
    ]
}

/// The inverse of [`reference_states`].
pub fn states_of(reference: &[f64]) -> States {
    let mut states = States::default();
    let [
        tank,
        chamber,
        position,
        velocity,
        friction,
        plunger,
        p_af,
        p_1,
        p_2,
        p_ic,
        p_im,
        p_em,
        p_it,
        p_t,
        w_hp,
        w_lp,
    ] = *<&[f64; 16]>::try_from(reference).expect("16 states");
    states.tank.pressure = tank;
    states.actuator.chamber_pressure = chamber;
    states.actuator.position = position;
    states.actuator.velocity = velocity;
    states.actuator.friction_force = friction;
    states.valve.plunger_duty = plunger;
    states.air_filter.pressure = p_af;
    states.lp_compressor.outlet_pressure = p_1;
    states.hp_compressor.outlet_pressure = p_2;
    states.intercooler.outlet_pressure = p_ic;
    states.intake_manifold.pressure = p_im;
    states.exhaust_manifold.pressure = p_em;
    states.interstage_exhaust.pressure = p_it;
    states.exhaust.pressure = p_t;
    states.hp_shaft.speed = w_hp;
    states.lp_shaft.speed = w_lp;
    states
}

/// The states in the first line of a reference's trace.
pub fn initial_states(line: Option<&str>) -> States {
    states_of(&numbers(line.and_then(|line| line.strip_prefix("# x0: ")).expect("the initial states"), ' '))
}

/// Inputs from the reference's order.
pub fn inputs_of(reference: &[f64]) -> Inputs {
    let [pwm, voltage, pump, speed, throttle, lp_wastegate, bypass, surge_valve, pressure, temperature] =
        *<&[f64; 10]>::try_from(reference).expect("10 inputs");
    Inputs {
        hp_wastegate_pwm: pwm,
        vacuum_pump: pump,
        lp_wastegate,
        hp_bypass: bypass,
        surge_valve,
        throttle,
        supply_voltage: voltage,
        engine_speed: speed,
        ambient_pressure: pressure,
        ambient_temperature: temperature,
    }
}

/// The reference's outputs, some of which are locals here, in its order.
pub fn reference_outputs(variables: &Variables) -> [f64; 20] {
    let outputs: &Outputs = &variables.outputs;
    let locals = &variables.locals;
    [
        outputs.boost_pressure,
        100.0 * outputs.hp_wastegate_position,
        outputs.actuator_pressure,
        outputs.tank_pressure,
        outputs.engine_torque,
        outputs.air_mass_flow,
        outputs.hp_turbo_speed,
        outputs.lp_turbo_speed,
        outputs.exhaust_manifold_pressure,
        outputs.interstage_exhaust_pressure,
        outputs.exhaust_temperature,
        outputs.charge_temperature,
        locals.hp_compressor.mass_flow,
        locals.lp_compressor.mass_flow,
        locals.hp_wastegate_port.mass_flow,
        locals.valve.pressure,
        locals.hp_compressor.outlet_temperature,
        locals.lp_turbine.mass_flow,
        locals.hp_turbine.mass_flow,
        locals.cylinders.volumetric_efficiency,
    ]
}

/// Numbers separated by a character; other texts (a header) are skipped.
pub fn numbers(line: &str, separator: char) -> Vec<f64> {
    line.split(separator).filter_map(|word| word.trim().parse().ok()).collect()
}
