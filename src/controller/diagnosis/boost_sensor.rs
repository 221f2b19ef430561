//! Whether measured boost pressure is plausible.
//!
//! | implausible | confirmed | plausible again |
//! |---|---|---|
//! | out of range | after `confirmation_time` | yes |
//! | changes faster than any engine's | at once | yes |
//! | constant to the last bit, though the duty should have moved boost by `answer_error` | at once | yes |
//! | constant while engine speed changes (off by default) | after `confirmation_time` | yes |
//! | other than ambient pressure before the engine runs | after `confirmation_time` | no |
//!
//! A measurement is plausible again once it has changed and stayed near the expected boost pressure.

use fmu_export::Persistent;

use super::evidence::{Confirmed, MEMORY, STEADY_SPEED};
use crate::controller::lag::Lag;
use crate::controller::schedule::OperatingPoint;
use crate::controller::variables::{Inputs, Parameters, Real};
use crate::elementary::{larger, smaller};

/// Below this engine speed (rpm) an engine does not run by itself: it idles above, and a starter turns it slower.
pub const ENGINE_RUNS_FROM: Real = 500.0;

/// How long a measurement must be near the expected pressure to be plausible again (s): longer than a shaft takes to
/// settle, so that it does not only pass by.
const RECOVERY: Real = 3.0;

/// The change of the duty (%) that friction can keep from the rod: twice 2 N, the stickiest actuator's in `parameters/`,
/// on its membrane of 15 cm², at 0.9 kPa/%.
const STICTION: Real = 3.0;

/// How far the duty must have moved boost under a constant measurement, beyond `answer_error`, over the smallest change
/// that the sensor has shown: how far feedback and friction let the duty wander within a step of a coarse
/// analog-to-digital converter.
const WANDERING: Real = 25.0;

/// How many times slower than `actuator_lag` an actuator may be.
const SLOW_ACTUATOR: Real = 3.0;

/// What the check compares a measurement with.
#[derive(Clone, Copy, Debug)]
pub struct Expectation<'a, const COLUMNS: usize> {
    /// The operating point in the schedule.
    pub operating_point: OperatingPoint<'a, COLUMNS>,
    /// The virtual duty (%) at the last sample, at least the one at which the wastegate lifts off.
    pub duty: Real,
    /// The engine speed (rpm).
    pub engine_speed: Real,
}

/// The memory of the check.
#[allow(clippy::struct_excessive_bools, reason = "what was found and what is seen are independent")]
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct BoostSensor {
    range: Confirmed,
    signal: Signal,
    constant: Constant,
    slow_speed: Lag,
    at_key_on: KeyOn,
    /// Found, and not yet plausible again.
    is_implausible: bool,
    /// Whether the last measurement was out of range.
    is_outside: bool,
    /// How long the measurement has been near the expected pressure (s), and whether it has changed meanwhile.
    near: Real,
    has_changed: bool,
    /// Whether the sensor was just found by what it showed for long, so that the integral term followed it.
    has_misled: bool,
}

impl BoostSensor {
    /// Judges a sample's measurement by itself.
    pub fn check(&mut self, parameters: &Parameters, inputs: &Inputs) {
        let &Parameters { sample_time, ref diagnosis, .. } = parameters;
        let plausible = diagnosis.boost_pressure_min..=diagnosis.boost_pressure_max;
        self.is_outside = !plausible.contains(&inputs.boost_pressure);
        self.range.sample(self.is_outside, diagnosis.confirmation_time, sample_time);
        if self.is_outside {
            self.signal.last = None;
        } else {
            self.is_implausible |= self.signal.is_impossible(parameters, inputs);
        }
        self.is_implausible |= self.range.holds;
        self.has_misled |= self.at_key_on.sample(parameters, inputs);
    }

    /// Judges a measurement by the duty that acted on it.
    pub fn check_movement<const COLUMNS: usize>(
        &mut self,
        parameters: &Parameters,
        expectation: Expectation<'_, COLUMNS>,
    ) {
        let before = self.slow_speed.sample(parameters.sample_time, MEMORY, expectation.engine_speed);
        // While engine speed changes, the duty moves to hold the pressure.
        let is_steady = (expectation.engine_speed - before).abs() <= STEADY_SPEED;
        if self.signal.is_constant() && !self.is_outside && is_steady {
            let due = parameters.diagnosis.answer_error + WANDERING * self.signal.resolution();
            let is_stuck = self.constant.should_have_moved(parameters, expectation, due);
            self.has_misled |= is_stuck && !self.is_implausible;
            self.is_implausible |= is_stuck;
        } else {
            self.constant = Constant { duty_before: self.constant.duty, ..Constant::default() };
        }
        self.constant.duty = Some(expectation.duty);
    }

    /// Forgives an implausible measurement (Pa) that has been near the expected pressure (Pa).
    pub fn recover(&mut self, parameters: &Parameters, measured: Real, expected: impl FnOnce() -> Real) {
        let is_near = || (measured - expected()).abs() < parameters.diagnosis.answer_error;
        if !self.is_implausible || self.is_outside || !is_near() {
            (self.near, self.has_changed) = (0.0, false);
            return;
        }
        self.near += parameters.sample_time;
        self.has_changed |= !self.signal.is_constant();
        if self.has_changed && self.near >= RECOVERY {
            self.is_implausible = false;
        }
    }

    /// Whether the sensor was found, since the last call, after the integral term had followed it.
    pub fn take_misled(&mut self) -> bool {
        core::mem::take(&mut self.has_misled)
    }

    /// Whether the measurement is plausible and changed at this sample.
    pub fn is_alive(&self) -> bool {
        self.is_usable() && !self.signal.is_constant()
    }

    /// Whether the sensor has been found implausible.
    pub fn is_implausible(&self) -> bool {
        self.is_implausible || self.at_key_on.is_off
    }

    /// Whether the measurement may be used: an outlier is not, even before it is confirmed.
    pub fn is_usable(&self) -> bool {
        !self.is_outside && !self.is_implausible()
    }
}

/// The boost measurement since its last change. A master with steps longer than samples holds measurements, so their
/// next change spans all that time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
struct Signal {
    /// Boost pressure (Pa) and engine speed (rpm) at the last change.
    last: Option<[Real; 2]>,
    /// Time since the last change (s).
    age: Real,
    /// The smallest change (Pa).
    smallest_change: Option<Real>,
}

impl Signal {
    /// The smallest change that the sensor has shown (Pa), 0 before the first.
    fn resolution(&self) -> Real {
        self.smallest_change.unwrap_or(0.0)
    }

    /// Whether the measurement is that of the sample before, to the last bit.
    fn is_constant(&self) -> bool {
        self.age > 0.0
    }

    /// Whether boost pressure changes faster, or stays more constant, than any engine's.
    fn is_impossible(&mut self, parameters: &Parameters, inputs: &Inputs) -> bool {
        let &Inputs { boost_pressure, engine_speed, .. } = inputs;
        let limits = &parameters.diagnosis;
        self.age += parameters.sample_time;
        let Some([last, speed]) = self.last else {
            (self.last, self.age) = (Some([boost_pressure, engine_speed]), 0.0);
            return false;
        };
        if boost_pressure.to_bits() == last.to_bits() {
            return self.age >= limits.confirmation_time
                && (engine_speed - speed).abs() >= limits.constant_over_speed;
        }
        let change = (boost_pressure - last).abs();
        let is_too_fast = change > limits.boost_gradient_max * self.age;
        (self.last, self.age) = (Some([boost_pressure, engine_speed]), 0.0);
        self.smallest_change =
            Some(self.smallest_change.map_or(change, |smallest| smaller(smallest, change)));
        is_too_fast
    }
}

/// How far the duty should have moved boost pressure since the measurement became constant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
struct Constant {
    /// The virtual duty (%) at the last sample, and before the measurement's last change, to which it responded.
    duty: Option<Real>,
    duty_before: Option<Real>,
    /// The movement since then (Pa), with the actuator's lag, and with the engine's.
    asked: Real,
    expected: Real,
}

impl Constant {
    fn should_have_moved<const COLUMNS: usize>(
        &mut self,
        parameters: &Parameters,
        expectation: Expectation<'_, COLUMNS>,
        due_movement: Real,
    ) -> bool {
        let Expectation { operating_point, duty, .. } = expectation;
        let before = *self.duty_before.get_or_insert(duty);
        let due = operating_point.pressure_held_by(duty) - operating_point.pressure_held_by(before);
        let sample_time = parameters.sample_time;
        let lag = SLOW_ACTUATOR * parameters.actuator_lag;
        self.asked += sample_time / larger(lag, sample_time) * (due - self.asked);
        self.expected += operating_point.share_of_lag(sample_time) * (self.asked - self.expected);
        (duty - before).abs() >= STICTION && self.expected.abs() >= due_movement
    }
}

/// Before the engine runs, boost pressure is ambient pressure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
struct KeyOn {
    has_run: bool,
    /// How long the sensors have disagreed (s).
    disagree: Real,
    is_off: bool,
}

impl KeyOn {
    /// Judges a sample. Returns whether the sample confirms an offset.
    fn sample(&mut self, parameters: &Parameters, inputs: &Inputs) -> bool {
        self.has_run |= inputs.engine_speed >= ENGINE_RUNS_FROM;
        if self.has_run || self.is_off || !inputs.measures_ambient_pressure() {
            return false;
        }
        let limits = &parameters.diagnosis;
        let is_off = (inputs.boost_pressure - inputs.ambient_pressure).abs() > limits.ambient_error;
        self.disagree = if is_off { self.disagree + parameters.sample_time } else { 0.0 };
        self.is_off = self.disagree >= limits.confirmation_time;
        self.is_off
    }
}
