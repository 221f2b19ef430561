//! What the cases of a study go through: random quantities, and the experiment that they give.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use fmu_master::scenario::Signal;
use fmu_run::Range;

use super::fault::{self, Fault};
use super::names::help;

/// The communication step (s): the controller's sample time.
pub const STEP: f64 = 0.0125;
/// Time from the start to the first event (s), when judging starts: a plant that differs from the controller's maps
/// starts off its reference.
pub const SETTLING: f64 = 5.0;
/// Time between changes of reference or engine speed (s).
const HOLD: f64 = 5.0;
/// Time from the end of the last ramp to the end (s).
const END: f64 = 6.0;
/// Time for a large step (s): the longest settling of the plant's turbochargers.
const LONG_HOLD: f64 = 8.0;
/// Time at rest with noise (s): half the capacity of the tank, which the noise drains.
const REST: f64 = 300.0;
/// Time in which the pump evacuates an empty tank (s), at a leakage of the valve as large as possible.
const EVACUATION: f64 = 150.0;
/// When the reference steps in a case with a fault, and when that ends (s).
const FAULTY_STEP: f64 = 20.0;
const FAULTY_END: f64 = 100.0;
/// The range of references, to which steps are limited (Pa).
const REFERENCES: (f64, f64) = (115e3, 215e3);
/// Noise on engine speed (rpm) and supply voltage (V), as a crankshaft wheel and a converter of 8 bits have.
const NOISE_BESIDE_BOOST: [(&str, f64); 2] = [("engine_speed", 10.0), ("supply_voltage_measured", 0.2)];
/// The largest noise on boost pressure (Pa).
const BOOST_NOISE: f64 = 100.0;

/// What the cases of a study go through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Situation {
    /// Two ramps of engine speed, two reference steps of up to 20 kPa, a supply step, noise on boost
    #[default]
    Ramps,
    /// The same cases, with noise on engine speed and supply, too
    NoisyRamps,
    /// Two reference steps of 20 to 60 kPa at one engine speed
    Steps,
    /// Throttle and reference rise together, by up to 50 kPa
    TipIn,
    /// Nothing moves for 300 s, with noise on boost, engine speed and supply
    Rest,
    /// The engine starts with its vacuum tank at ambient pressure
    EmptyTank,
    /// A fault at 10 s, and a reference step at 20 s, with and without limp-home
    Faults,
}

/// A random quantity: name in the results' columns, unit and range.
pub type Quantity = (&'static str, &'static str, Range);

const fn range(name: &'static str, unit: &'static str, from: f64, to: f64) -> Quantity {
    (name, unit, Range { from, to, is_logarithmic: false })
}

const fn logarithmic(name: &'static str, unit: &'static str, from: f64, to: f64) -> Quantity {
    (name, unit, Range { from, to, is_logarithmic: true })
}

/// The supply voltage, between the extremes of the paper's Fig. 14.
const fn supply(name: &'static str) -> Quantity {
    range(name, "V", 11.1, 13.5)
}

/// 0 to 3000 m of altitude.
const PRESSURE: Quantity = range("ambient_pressure", "Pa", 70e3, 101_325.0);
/// -20 to 40 degrees Celsius.
const TEMPERATURE: Quantity = range("ambient_temperature", "K", 253.15, 313.15);
const NOISE: Quantity = range("noise", "Pa", 0.0, BOOST_NOISE);
const SUPPLY: Quantity = supply("supply_voltage");
const SPEED: Quantity = range("engine_speed", "rpm", 1000.0, 5500.0);
const REFERENCE: Quantity = range("boost_reference", "Pa", REFERENCES.0, 185e3);
/// Whether the shaft's speed is measured: from a half on.
const MEASURES_SHAFT: Quantity = range("measures_shaft", "1", 0.0, 1.0);

const RAMPS: [Quantity; 13] = [
    PRESSURE,
    TEMPERATURE,
    supply("supply_voltage_1"),
    supply("supply_voltage_2"),
    NOISE,
    range("engine_speed_1", "rpm", 2000.0, 5500.0),
    range("engine_speed_2", "rpm", 2000.0, 5500.0),
    range("engine_speed_3", "rpm", 2000.0, 5500.0),
    logarithmic("ramp_rate_1", "rpm/s", 250.0, 2000.0),
    logarithmic("ramp_rate_2", "rpm/s", 250.0, 2000.0),
    range("boost_reference_1", "Pa", REFERENCES.0, REFERENCES.1),
    // The largest step of the paper's Fig. 13.
    range("reference_step_1", "Pa", -20e3, 20e3),
    range("reference_step_2", "Pa", -20e3, 20e3),
];

const STEPS: [Quantity; 8] = [
    PRESSURE,
    TEMPERATURE,
    SUPPLY,
    NOISE,
    range("engine_speed", "rpm", 1500.0, 5500.0),
    range("boost_reference", "Pa", REFERENCES.0, 155e3),
    range("step_up", "Pa", 20e3, 60e3),
    range("step_down", "Pa", 20e3, 60e3),
];

const TIP_IN: [Quantity; 8] = [
    PRESSURE,
    TEMPERATURE,
    SUPPLY,
    NOISE,
    range("engine_speed", "rpm", 1500.0, 5500.0),
    range("throttle", "1", 0.2, 0.6),
    range("boost_reference", "Pa", REFERENCES.0, 135e3),
    range("reference_step", "Pa", 20e3, 50e3),
];

const REST_OR_START: [Quantity; 6] = [PRESSURE, TEMPERATURE, SUPPLY, NOISE, SPEED, REFERENCE];

const FAULTS: [Quantity; 9] = [
    PRESSURE,
    TEMPERATURE,
    SUPPLY,
    SPEED,
    range("boost_reference", "Pa", 125e3, 175e3),
    range("reference_step", "Pa", -20e3, 20e3),
    range("fault_share", "1", 0.0, 1.0),
    range("stuck_position", "1", 0.0, 1.0),
    MEASURES_SHAFT,
];

/// What happens in a case, on whatever plant.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// Pressure (Pa) and temperature (K).
    pub ambient: [f64; 2],
    pub supply: Signal,
    pub engine_speed: Signal,
    pub throttle: Signal,
    pub reference: Signal,
    /// The noise on measurements: the controller's input, and its standard deviation.
    pub noise: Vec<(&'static str, f64)>,
    /// The vacuum tank's pressure at the start (Pa), if not the plant's.
    pub tank_pressure: Option<f64>,
    /// Whether the engine has just started, instead of being at rest for the inputs at the start.
    pub starts_running: bool,
    pub measures_shaft: bool,
    pub fault: Option<Fault>,
    /// When reference or engine speed start to change (s).
    pub events: Vec<Event>,
    pub stop_time: f64,
}

/// A change of the reference or of engine speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    pub begin: f64,
    /// The end of a ramp; for a step, its start.
    pub end: f64,
    pub is_step: bool,
}

impl Event {
    fn step(begin: f64) -> Self {
        Self { begin, end: begin, is_step: true }
    }

    fn ramp(begin: f64, end: f64) -> Self {
        Self { begin, end, is_step: false }
    }
}

/// A multiple of the communication step.
fn whole(time: f64) -> f64 {
    (time / STEP).round() * STEP
}

impl Experiment {
    /// Nothing moves, at an ambient pressure (Pa) and temperature (K), supply voltage (V) and engine speed (rpm), with noise
    /// on boost pressure (Pa) and a reference (Pa).
    pub fn at_rest(ambient: [f64; 2], supply: f64, speed: f64, noise: f64, reference: f64) -> Self {
        Self {
            ambient,
            supply: Signal::Constant(supply),
            engine_speed: Signal::Constant(speed),
            throttle: Signal::Constant(1.0),
            reference: Signal::Constant(reference),
            noise: vec![("boost_pressure", noise)],
            tank_pressure: None,
            starts_running: false,
            measures_shaft: true,
            fault: None,
            events: vec![],
            stop_time: REST,
        }
    }
}

impl Situation {
    /// All random quantities except plant parameters.
    pub fn quantities(self) -> &'static [Quantity] {
        match self {
            Self::Ramps | Self::NoisyRamps => &RAMPS,
            Self::Steps => &STEPS,
            Self::TipIn => &TIP_IN,
            Self::Rest | Self::EmptyTank => &REST_OR_START,
            Self::Faults => &FAULTS,
        }
    }

    /// What happens, in a few words.
    pub fn description(self) -> String {
        help(&self)
    }

    /// The experiment for values of the quantities.
    pub fn experiment(self, values: &[f64]) -> Experiment {
        match self {
            Self::Ramps => ramps(values),
            Self::NoisyRamps => {
                let mut experiment = ramps(values);
                experiment.noise.extend(NOISE_BESIDE_BOOST);
                experiment
            }
            Self::Steps => steps(values),
            Self::TipIn => tip_in(values),
            Self::Rest => rest(values),
            Self::EmptyTank => empty_tank(values),
            Self::Faults => faults(values),
        }
    }

    /// Whether a better control of a case can be searched: around a change, of a sound engine.
    pub fn is_searched(self) -> bool {
        self.is_benchmarked() && self != Self::Rest
    }

    /// Whether boost is judged by a control that knows the plant. With a fault or without vacuum no control holds the
    /// reference: boost is judged only where it is too high.
    pub fn is_benchmarked(self) -> bool {
        !matches!(self, Self::EmptyTank | Self::Faults)
    }
}

/// The values of a situation's quantities.
fn values<const COUNT: usize>(values: &[f64]) -> [f64; COUNT] {
    values.try_into().expect("a value for each of the situation's quantities")
}

fn ramps(drawn: &[f64]) -> Experiment {
    let [
        pressure,
        temperature,
        supply_1,
        supply_2,
        noise,
        speed_1,
        speed_2,
        speed_3,
        rates @ ..,
        first,
        step_1,
        step_2,
    ] = values::<13>(drawn);
    let speeds = [speed_1, speed_2, speed_3];
    let limited = |reference: f64| reference.clamp(REFERENCES.0, REFERENCES.1);
    let references = [first, limited(first + step_1), limited(limited(first + step_1) + step_2)];
    let duration = |ramp: usize| whole((speeds[ramp + 1] - speeds[ramp]).abs() / rates[ramp]).max(STEP);
    let ramp_1 = SETTLING + HOLD;
    let ramp_1_end = ramp_1 + duration(0);
    let ramp_2 = ramp_1_end + HOLD;
    let ramp_2_end = ramp_2 + duration(1);
    let second_step = whole(0.5 * (ramp_2 + ramp_2_end));
    Experiment {
        supply: Signal::Steps(vec![(0.0, supply_1), (whole(ramp_1_end + 0.5 * HOLD), supply_2)]),
        engine_speed: Signal::Lines(vec![
            (ramp_1, speed_1),
            (ramp_1_end, speed_2),
            (ramp_2, speed_2),
            (ramp_2_end, speed_3),
        ]),
        reference: Signal::Steps(vec![
            (0.0, references[0]),
            (SETTLING, references[1]),
            (second_step, references[2]),
        ]),
        events: vec![
            Event::step(SETTLING),
            Event::ramp(ramp_1, ramp_1_end),
            Event::ramp(ramp_2, ramp_2_end),
            Event::step(second_step),
        ],
        stop_time: whole(ramp_2_end + END),
        ..Experiment::at_rest([pressure, temperature], supply_1, speed_1, noise, references[0])
    }
}

fn steps(drawn: &[f64]) -> Experiment {
    let [pressure, temperature, supply, noise, speed, first, up, down] = values::<8>(drawn);
    let second = (first + up).min(REFERENCES.1);
    let third = (second - down).max(REFERENCES.0);
    let [begin, back] = [SETTLING, SETTLING + LONG_HOLD];
    Experiment {
        reference: Signal::Steps(vec![(0.0, first), (begin, second), (back, third)]),
        events: vec![Event::step(begin), Event::step(back)],
        stop_time: back + LONG_HOLD,
        ..Experiment::at_rest([pressure, temperature], supply, speed, noise, first)
    }
}

fn tip_in(drawn: &[f64]) -> Experiment {
    let [pressure, temperature, supply, noise, speed, throttle, reference, step] = values::<8>(drawn);
    let begin = SETTLING + HOLD;
    Experiment {
        throttle: Signal::Steps(vec![(0.0, throttle), (begin, 1.0)]),
        reference: Signal::Steps(vec![(0.0, reference), (begin, reference + step)]),
        events: vec![Event::step(begin)],
        stop_time: begin + LONG_HOLD,
        ..Experiment::at_rest([pressure, temperature], supply, speed, noise, reference)
    }
}

fn rest(drawn: &[f64]) -> Experiment {
    let [pressure, temperature, supply, noise, speed, reference] = values::<6>(drawn);
    let mut experiment = Experiment::at_rest([pressure, temperature], supply, speed, noise, reference);
    experiment.noise.extend(NOISE_BESIDE_BOOST);
    experiment
}

fn empty_tank(drawn: &[f64]) -> Experiment {
    let [pressure, temperature, supply, noise, speed, reference] = values::<6>(drawn);
    Experiment {
        tank_pressure: Some(pressure),
        starts_running: true,
        stop_time: EVACUATION,
        ..Experiment::at_rest([pressure, temperature], supply, speed, noise, reference)
    }
}

fn faults(drawn: &[f64]) -> Experiment {
    let [pressure, temperature, supply, speed, reference, step, kind, position, shaft] = values::<9>(drawn);
    let fault = Fault::drawn(kind, reference, position);
    Experiment {
        // Noise would hide that a sensor is stuck.
        noise: vec![],
        supply: fault.supply(supply),
        reference: Signal::Steps(vec![(0.0, reference), (FAULTY_STEP, reference + step)]),
        tank_pressure: Some(fault::PUMP_NEAR),
        measures_shaft: shaft >= 0.5,
        fault: Some(fault),
        stop_time: FAULTY_END,
        ..Experiment::at_rest([pressure, temperature], supply, speed, 0.0, reference)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Judging starts at rest, and boost has time to settle after the last event.
    #[test]
    fn experiments_begin_at_rest_and_end_after_their_events() {
        for situation in Situation::value_variants() {
            for place in [0.0, 0.3, 0.5, 0.99] {
                let quantities = situation.quantities().iter();
                let values: Vec<_> = quantities.map(|(.., range)| range.at(place)).collect();
                let experiment = situation.experiment(&values);
                let [first, last] = [f64::min, f64::max]
                    .map(|of| experiment.events.iter().map(|event| event.begin).reduce(of));
                assert!(first.is_none_or(|time| time >= SETTLING), "{situation:?}");
                assert!(last.is_none_or(|time| time + 2.0 < experiment.stop_time), "{situation:?}");
                let steps = experiment.stop_time / STEP;
                assert!((steps - steps.round()).abs() < 1e-6, "{situation:?} ends between steps");
                assert_eq!(situation == &Situation::Faults, experiment.fault.is_some());
                assert!(!situation.description().is_empty());
            }
        }
    }

    #[test]
    fn each_fault_is_drawn() {
        let kinds = fault::FaultKind::value_variants();
        for (index, kind) in kinds.iter().enumerate() {
            let fault = Fault::drawn((index as f64 + 0.5) / kinds.len() as f64, 150e3, 0.3);
            assert_eq!(fault.kind, *kind);
            assert!(!kind.name().is_empty());
            let changes =
                |signal: &Signal| signal.at(0.0).to_bits() != signal.at(fault::BEGIN + 2.0).to_bits();
            let signals = fault.signals.iter().map(|(_, signal)| signal.clone()).chain([fault.supply(12.0)]);
            assert_eq!(signals.filter(changes).count(), 1, "{kind:?}");
        }
        assert_eq!(Fault::drawn(1.0, 150e3, 0.3).kind, kinds[kinds.len() - 1]);
    }
}
