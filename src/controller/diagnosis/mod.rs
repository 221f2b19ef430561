//! Diagnosis: whether measurements are plausible and actuators respond, with limp-home if they do not.
//!
//! | finding | when | limp-home |
//! |---|---|---|
//! | boost sensor implausible | see [`boost_sensor`] | the reference model's pressure replaces the measurement |
//! | loop not answering | boost, far from its reference, does not follow a moving virtual duty; or the integral term drifts | least boost once boost stays above its reference by 20 kPa |
//! | tank not filling | the pressure does not fall with the pump on | none: the pump stays on, and see [`actuator_reach`](super::actuator_reach) |
//! | tank sensor implausible | out of range | pump timed |
//! | supply sensor implausible | out of range | the voltage that the last plausible ones lead to |
//!
//! A limp-home must never make it worse than no diagnosis would: each one acts on an effect that it removes, not on a
//! cause that it supposes.
//!
//! The bounds follow from plant physics, as `modelDescription/controller.json` explains. Each finding ends with its
//! cause, except where limp-home removes the evidence: least boost, and an offset that shows at key-on alone, last until
//! the next initialization.

mod answer;
mod boost_sensor;
mod evidence;
mod filling;
mod freeze_frame;

use core::fmt;

use fmu_export::display::Rounded;
use fmu_export::{Context, Error, Persistent};

use self::answer::{Answer, Verdict};
use self::boost_sensor::{BoostSensor, Expectation};
use self::evidence::{Confirmed, STEADY_SPEED};
use self::filling::Filling;
use self::freeze_frame::FreezeFrame;
use super::actuator_inverse;
use super::law::Correction;
use super::schedule::{OperatingPoint, Schedule};
use super::variables::{
    ControlMode, DiagnosisLocals, DiagnosisParameters, Inputs, Locals, Outputs, Parameters, Real,
};
use crate::elementary::{larger, smaller};

pub use self::answer::Asked;

/// How far boost must stay above its reference (Pa), unanswered, for least boost: as a driver notices it, and above what
/// least boost costs him.
pub const OVERBOOST: Real = 20e3;
/// The fastest drift of a sensor (Pa/s) that counts as one: a throttle moves faster.
const FASTEST_DRIFT: Real = 2e3;

/// The share of its authority by which a drift moves the integral term: the rest is left to the correction that a
/// healthy engine needs, from which the drift starts.
const DRIFT: Real = 0.5;

/// The code of each finding.
pub const BOOST_SENSOR: i32 = 1;
const LOOP: i32 = 2;
const TANK_FILLING: i32 = 4;
const TANK_SENSOR: i32 = 8;
const SUPPLY_SENSOR: i32 = 16;

/// What a warning says of each finding.
const TEXTS: [(i32, &str); 5] = [
    (BOOST_SENSOR, "boost sensor implausible"),
    (LOOP, "boost does not respond to the duty"),
    (TANK_FILLING, "vacuum tank does not fill"),
    (TANK_SENSOR, "tank pressure sensor implausible"),
    (SUPPLY_SENSOR, "supply voltage sensor implausible"),
];

/// What was found, as sums of codes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Persistent)]
pub struct Findings {
    found: i32,
    enabled: i32,
}

impl Findings {
    /// Whether a code is found.
    pub fn has(self, code: i32) -> bool {
        self.found & code != 0
    }

    /// Whether a code is enabled.
    fn enables(self, code: i32) -> bool {
        self.enabled & code != 0
    }

    /// Lets only these codes be found.
    fn enable(&mut self, codes: i32) {
        self.enabled = codes;
        self.found &= codes;
    }

    /// Says whether a code is found, if it is enabled.
    fn set(&mut self, code: i32, is_found: bool) {
        if is_found && self.enables(code) {
            self.found |= code;
        } else {
            self.found &= !code;
        }
    }

    /// Warns of new findings.
    fn warn_since(self, before: Self, inputs: &Inputs, context: &mut Context<'_>) {
        for (code, what) in TEXTS {
            if self.has(code) && !before.has(code) {
                context.warn(format_args!("{what}; {}", Measurements(inputs)));
            }
        }
    }
}

/// The measurements shown in a warning.
struct Measurements<'a>(&'a Inputs);

impl fmt::Display for Measurements<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Inputs { boost_pressure, tank_pressure, supply_voltage_measured, engine_speed, .. } = self.0;
        write!(
            formatter,
            "boost_pressure = {} kPa, tank_pressure = {} kPa, supply_voltage_measured = {} V, engine_speed = {} rpm",
            Rounded(boost_pressure / 1e3),
            Rounded(tank_pressure / 1e3),
            Rounded(*supply_voltage_measured),
            Rounded(*engine_speed)
        )
    }
}

/// How the loop of mode boost is closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoostControl {
    Closed,
    /// The reference model's pressure replaces the measurement.
    WithoutMeasurement,
    /// All valves set for least boost.
    LeastBoost,
}

/// What the law did at a sample, in mode boost.
#[derive(Clone, Copy, Debug)]
pub struct Done {
    pub asked: Asked,
    /// The virtual duty (%).
    pub duty: Real,
    pub correction: Correction,
    /// Whether the tank has been full since the start.
    pub tank_has_filled: bool,
}

/// The memory of the diagnosis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct Diagnosis {
    boost_sensor: BoostSensor,
    tank_range: Confirmed,
    supply_range: Confirmed,
    /// Whether the last supply voltage was out of range.
    supply_is_outside: bool,
    answer: Answer,
    drift: Drift,
    filling: Filling,
    findings: Findings,
    /// Whether boost stayed above its reference, unanswered.
    exceeds: bool,
    /// The codes judged at this sample.
    judged: i32,
    /// Elapsed time of the timed pump cycle (s).
    pump_time: Real,
    frame: FreezeFrame,
}

impl Diagnosis {
    pub fn findings(&self) -> Findings {
        self.findings
    }

    /// Judges a sample's measurements individually.
    pub fn check_sensors(&mut self, parameters: &Parameters, inputs: &Inputs) {
        let &Parameters { sample_time, nominal_voltage, ref diagnosis, .. } = parameters;
        self.findings.enable(diagnosis.enabled_codes);
        let confirm = |range: &mut Confirmed, value: Real, least: Real, most: Real| {
            let is_outside = value <= least || value > most;
            range.sample(is_outside, diagnosis.confirmation_time, sample_time);
            is_outside
        };
        let (least, most) = (diagnosis.tank_pressure_min, diagnosis.tank_pressure_max);
        confirm(&mut self.tank_range, inputs.tank_pressure, least, most);
        let (least, most) = (diagnosis.supply_share_min, diagnosis.supply_share_max);
        let voltage = inputs.supply_voltage_measured;
        self.supply_is_outside =
            confirm(&mut self.supply_range, voltage, least * nominal_voltage, most * nominal_voltage);
        self.findings.set(TANK_SENSOR, self.tank_range.holds);
        self.findings.set(SUPPLY_SENSOR, self.supply_range.holds);
        self.judged = TANK_SENSOR | SUPPLY_SENSOR;
        if parameters.mode == ControlMode::Boost {
            self.boost_sensor.check(parameters, inputs);
            self.findings.set(BOOST_SENSOR, self.boost_sensor.is_implausible());
            self.judged |= BOOST_SENSOR;
        }
    }

    /// How the boost loop is to be closed.
    pub fn boost_control(&self, parameters: &Parameters) -> BoostControl {
        if !parameters.diagnosis.limp_home || parameters.mode != ControlMode::Boost {
            BoostControl::Closed
        } else if self.exceeds {
            BoostControl::LeastBoost
        } else if self.findings.enables(BOOST_SENSOR) && !self.boost_sensor.is_usable() {
            BoostControl::WithoutMeasurement
        } else {
            BoostControl::Closed
        }
    }

    /// Whether the boost sensor was just found to have misled the integral term.
    pub fn boost_sensor_misled(&mut self) -> bool {
        self.boost_sensor.take_misled()
    }

    /// Whether the integral term learns from this sample: the engine runs, and the boost sensor is alive.
    pub fn learns(&self, inputs: &Inputs) -> bool {
        inputs.engine_speed >= boost_sensor::ENGINE_RUNS_FROM && self.boost_sensor.is_alive()
    }

    /// Whether the pump is to run, given the relay's command.
    pub fn pump(&mut self, parameters: &Parameters, relay: bool) -> bool {
        let &Parameters { sample_time, ref diagnosis, .. } = parameters;
        if !diagnosis.limp_home || !self.findings.has(TANK_SENSOR) {
            self.pump_time = 0.0;
            return relay;
        }
        let runs = self.pump_time < diagnosis.pump_run_time;
        self.pump_time += sample_time;
        if self.pump_time >= diagnosis.pump_cycle_time {
            self.pump_time = 0.0;
        }
        runs
    }

    /// The tank pressure (Pa), if its measurement is plausible.
    pub fn tank_pressure(&self, inputs: &Inputs) -> Option<Real> {
        self.tank_range.is_sound().then_some(inputs.tank_pressure)
    }

    /// Whether the supply voltage is replaced: an outlier is, even before it is confirmed.
    pub fn replaces_supply_voltage(&self, parameters: &Parameters) -> bool {
        parameters.diagnosis.limp_home && self.findings.enables(SUPPLY_SENSOR) && self.supply_is_outside
    }

    /// Judges whether the tank fills with these commands.
    pub fn check_filling(&mut self, parameters: &Parameters, inputs: &Inputs, outputs: &Outputs) {
        let mut fails = self.findings.has(TANK_FILLING);
        if outputs.vacuum_pump > 0.0 && !self.tank_range.holds {
            fails |= self.filling.fails(parameters, outputs.hp_wastegate_pwm, inputs.tank_pressure);
            self.judged |= TANK_FILLING;
        } else {
            self.filling = Filling::default();
        }
        self.findings.set(TANK_FILLING, fails && inputs.tank_pressure >= parameters.tank_pressure_off);
    }

    /// Judges the loop and, by the duty, the boost sensor; `here` are measured boost pressure (Pa) and engine speed
    /// (rpm) at the conditions of the schedule, if there is one that gives the expected response, and
    /// `expected_measurement` is the pressure (Pa) that the law expects to measure.
    pub fn check_loop<const COLUMNS: usize>(
        &mut self,
        parameters: &Parameters,
        inputs: &Inputs,
        schedule: Option<Schedule<'_, COLUMNS>>,
        here: (Real, Real),
        done: &Done,
        expected_measurement: impl FnOnce() -> Real,
    ) {
        let engine_runs = inputs.engine_speed >= boost_sensor::ENGINE_RUNS_FROM;
        let Some(schedule) = schedule.filter(|_| engine_runs) else {
            self.answer = Answer::default();
            return;
        };
        let operating_point = OperatingPoint::new(schedule, here.0, here.1);
        // A smaller change moves no wastegate.
        let duty = actuator_inverse::effective_duty(&parameters.actuator_inverse, done.duty);
        self.boost_sensor.check_movement(
            parameters,
            Expectation { operating_point, duty, engine_speed: inputs.engine_speed },
        );
        self.boost_sensor.recover(parameters, inputs.boost_pressure, expected_measurement);
        self.findings.set(BOOST_SENSOR, self.boost_sensor.is_implausible());

        if !self.boost_sensor.is_usable() || !self.supply_range.is_sound() || !done.tank_has_filled {
            (self.answer, self.drift) = (Answer::default(), Drift::default());
        } else {
            self.judged |= LOOP;
            let error = done.asked.reference - here.0;
            match self.answer.judge(parameters, here, operating_point, done.asked, duty) {
                Verdict::Unknown => {}
                Verdict::Answers => self.findings.set(LOOP, false),
                Verdict::Fails => {
                    self.findings.set(LOOP, true);
                    self.exceeds |= error <= -OVERBOOST && self.findings.enables(LOOP);
                }
            }
            // The shaft's limit is not the driver's.
            let is_tracking = error.abs() < parameters.diagnosis.answer_error
                && done.asked.by_driver <= done.asked.reference;
            // An engine that cannot follow, on the seat or elsewhere, winds the term up, too.
            let follows = error.abs() < parameters.diagnosis.answer_movement && duty <= done.duty;
            let point = (is_tracking && follows).then_some([inputs.engine_speed, done.asked.by_driver]);
            if self.drift.sample(parameters, done.correction, point, is_tracking) {
                self.findings.set(LOOP, true);
            }
        }
    }

    /// Sets the outputs and local variables at a time (s), and warns of new findings.
    pub fn publish(
        &mut self,
        before: Findings,
        time: f64,
        inputs: &Inputs,
        (locals, outputs): (&mut Locals, &mut Outputs),
        context: &mut Context<'_>,
    ) {
        let findings = self.findings;
        #[allow(clippy::cast_lossless, reason = "`Real` may be `f32`")]
        let code = findings.found as Real;
        outputs.fault_code = code;
        if findings.found != 0 {
            self.frame.take(findings.found, time, inputs, outputs.hp_wastegate_pwm);
        }
        self.frame.publish(locals);
        locals.diagnosis = DiagnosisLocals {
            boost_sensor_implausible: findings.has(BOOST_SENSOR),
            loop_not_answering: findings.has(LOOP),
            tank_not_filling: findings.has(TANK_FILLING),
            tank_sensor_implausible: findings.has(TANK_SENSOR),
            supply_sensor_implausible: findings.has(SUPPLY_SENSOR),
            judged_codes: self.judged,
        };
        findings.warn_since(before, inputs, context);
    }
}

/// How far the integral term has moved slowly, as it follows a sensor's drift.
///
/// A throttle that shuts moves it as far, though within seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
struct Drift {
    /// The pressure that the integral term corrected at the last sample (Pa).
    before: Real,
    /// The sum of the integral term's slow changes since it corrected little, or boost was far from its reference (Pa).
    slow: Real,
    /// The sum of the integral term's slow changes at one operating point (Pa), where an engine needs none.
    at_point: Real,
    /// The engine speed (rpm) and the driver's reference (Pa) of the operating point; none while boost does not follow.
    point: Option<[Real; 2]>,
    /// How long the integral term has been at its limit (s).
    exhausted_for: Real,
}

impl Drift {
    /// Whether the term moved slowly, by [`DRIFT`] of its authority at one operating point or to its limit, for
    /// `answer_time`.
    fn sample(
        &mut self,
        parameters: &Parameters,
        correction: Correction,
        point: Option<[Real; 2]>,
        is_tracking: bool,
    ) -> bool {
        let &Parameters { sample_time, integral_authority, ref diagnosis, .. } = parameters;
        let Correction { pressure, is_exhausted } = correction;
        let most = FASTEST_DRIFT * sample_time;
        let change = smaller(larger(pressure - self.before, -most), most);
        self.before = pressure;
        self.slow += change;
        if pressure.abs() < diagnosis.answer_error || !is_tracking {
            self.slow = 0.0;
        }
        self.at_point += change;
        let stays = self.point.zip(point).is_some_and(|(before, now)| {
            (now[0] - before[0]).abs() <= STEADY_SPEED && (now[1] - before[1]).abs() < diagnosis.answer_error
        });
        if !stays {
            (self.at_point, self.point) = (0.0, point);
        }
        self.exhausted_for = if is_exhausted && is_tracking { self.exhausted_for + sample_time } else { 0.0 };
        let is_at_limit = self.exhausted_for >= diagnosis.answer_time;
        let far = DRIFT * integral_authority;
        self.at_point.abs() >= far || is_at_limit && self.slow.abs() >= far
    }
}

/// Rejects bounds without a range between them.
pub fn check(parameters: &DiagnosisParameters) -> Result<(), Error> {
    let p = parameters;
    for (lower, upper, unit) in [
        (("boost_pressure_min", p.boost_pressure_min), ("boost_pressure_max", p.boost_pressure_max), " Pa"),
        (("tank_pressure_min", p.tank_pressure_min), ("tank_pressure_max", p.tank_pressure_max), " Pa"),
        (("supply_share_min", p.supply_share_min), ("supply_share_max", p.supply_share_max), ""),
        (("pump_run_time", p.pump_run_time), ("pump_cycle_time", p.pump_cycle_time), " s"),
    ] {
        if lower.1 >= upper.1 {
            return Err(Error::new(format_args!(
                "diagnosis.{} is {}{unit} and must be below diagnosis.{}, which is {}{unit}",
                lower.0, lower.1, upper.0, upper.1
            )));
        }
    }
    Ok(())
}
