//! Diagnosis: whether measurements are plausible and actuators respond, with limp-home if they do not.
//!
//! | finding | when | limp-home |
//! |---|---|---|
//! | boost sensor implausible | out of range, or faster than the engine can be; optionally, constant while engine speed changes | feedforward alone |
//! | loop not answering | boost, far from its reference, does not follow a moving virtual duty | least boost |
//! | tank not filling | the pressure does not fall with the pump on | pump off; least boost once the vacuum is too weak |
//! | tank sensor implausible | out of range | pump timed |
//! | supply sensor implausible | out of range | compensation as at nominal voltage |
//!
//! The bounds follow from plant physics, as `modelDescription/controller.json` explains. Findings about boost and tank
//! filling latch until the next initialization, since limp-home removes the evidence; a sensor back in range is used
//! again.

use std::fmt;

use fmu_export::display::Rounded;
use fmu_export::{Context, Error, Persistent};

use super::actuator_inverse;
use super::schedule::{OperatingPoint, Schedule};
use super::variables::{
    ControlMode, DiagnosisLocals, DiagnosisParameters, Inputs, Locals, Outputs, Parameters,
};
use crate::elementary::larger;

/// The time constant (s) of the virtual duty and the reference before a demand: longer than the duty's response to a
/// reference step, shorter than the time between a driver's steps.
const MEMORY: f64 = 1.0;
/// The change of engine speed (rpm) within which the loop is judged: beyond it, the duty moves to hold the pressure.
const STEADY_SPEED: f64 = 100.0;
/// The sum of duty changes (%) up to which the duty counts as constant: 1 % more empties 0.9 kPa of the actuator
/// chamber into the tank, 40 Pa there with 45 cm³ and 1 l, so this at most 0.08 kPa, or 0.24 kPa with a chamber three
/// times as large.
const RESTING_TRAVEL: f64 = 2.0;
/// How long the duty must be constant (s) before tank pressure is judged: the longest filling of the chamber.
const CHAMBER_SETTLES: f64 = 0.75;

/// What was found.
#[allow(clippy::struct_excessive_bools, reason = "the findings are independent of each other")]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Persistent)]
pub struct Findings {
    pub boost_sensor_implausible: bool,
    pub loop_not_answering: bool,
    pub tank_not_filling: bool,
    pub tank_sensor_implausible: bool,
    pub supply_sensor_implausible: bool,
}

impl Findings {
    fn all(self) -> [(bool, &'static str); 5] {
        [
            (self.boost_sensor_implausible, "boost sensor implausible"),
            (self.loop_not_answering, "boost does not respond to the duty"),
            (self.tank_not_filling, "vacuum tank does not fill"),
            (self.tank_sensor_implausible, "tank pressure sensor implausible"),
            (self.supply_sensor_implausible, "supply voltage sensor implausible"),
        ]
    }

    /// The sum of 1, 2, 4, 8 and 16 for the findings in order.
    fn code(self) -> f64 {
        self.all().iter().rev().fold(0.0, |code, &(found, _)| 2.0 * code + f64::from(u8::from(found)))
    }

    pub fn publish(self, locals: &mut Locals, outputs: &mut Outputs) {
        outputs.fault_code = self.code();
        locals.diagnosis = DiagnosisLocals {
            boost_sensor_implausible: self.boost_sensor_implausible,
            loop_not_answering: self.loop_not_answering,
            tank_not_filling: self.tank_not_filling,
            tank_sensor_implausible: self.tank_sensor_implausible,
            supply_sensor_implausible: self.supply_sensor_implausible,
        };
    }

    /// Warns of new findings.
    pub fn warn_since(self, before: Self, inputs: &Inputs, context: &mut Context<'_>) {
        for ((found, what), (was_found, _)) in self.all().into_iter().zip(before.all()) {
            if found && !was_found {
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
    FeedforwardAlone,
    /// All valves set for least boost.
    LeastBoost,
}

/// The memory of the diagnosis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct Diagnosis {
    boost_range: Confirmed,
    boost_signal: Signal,
    tank_range: Confirmed,
    supply_range: Confirmed,
    answer: Answer,
    filling: Filling,
    findings: Findings,
    /// Elapsed time of the timed pump cycle (s).
    pump_time: f64,
}

impl Diagnosis {
    pub fn findings(&self) -> Findings {
        self.findings
    }

    /// Judges a sample's measurements individually.
    pub fn check_sensors(&mut self, parameters: &Parameters, inputs: &Inputs) {
        let &Parameters { sample_time, nominal_voltage, ref diagnosis, .. } = parameters;
        let confirm = |range: &mut Confirmed, value: f64, least: f64, most: f64| {
            let is_outside = !(least..=most).contains(&value);
            range.sample(is_outside, diagnosis.confirmation_time, sample_time);
            is_outside
        };
        let (least, most) = (diagnosis.tank_pressure_min, diagnosis.tank_pressure_max);
        confirm(&mut self.tank_range, inputs.tank_pressure, least, most);
        let (least, most) = (diagnosis.supply_share_min, diagnosis.supply_share_max);
        confirm(
            &mut self.supply_range,
            inputs.supply_voltage_measured,
            least * nominal_voltage,
            most * nominal_voltage,
        );
        self.findings.tank_sensor_implausible = self.tank_range.holds;
        self.findings.supply_sensor_implausible = self.supply_range.holds;
        if parameters.mode == ControlMode::Boost {
            let (least, most) = (diagnosis.boost_pressure_min, diagnosis.boost_pressure_max);
            let is_outside = confirm(&mut self.boost_range, inputs.boost_pressure, least, most);
            let is_impossible = if is_outside {
                self.boost_signal = Signal::default();
                false
            } else {
                self.boost_signal.is_impossible(parameters, inputs)
            };
            self.findings.boost_sensor_implausible |= self.boost_range.holds || is_impossible;
        }
    }

    /// How the boost loop is to be closed.
    pub fn boost_control(&self, parameters: &Parameters, inputs: &Inputs) -> BoostControl {
        let Findings { boost_sensor_implausible, loop_not_answering, tank_not_filling, .. } = self.findings;
        let vacuum_is_lost =
            tank_not_filling && inputs.tank_pressure > parameters.diagnosis.vacuum_lost_above;
        if !parameters.diagnosis.limp_home || parameters.mode != ControlMode::Boost {
            BoostControl::Closed
        } else if loop_not_answering || vacuum_is_lost {
            BoostControl::LeastBoost
        } else if boost_sensor_implausible {
            BoostControl::FeedforwardAlone
        } else {
            BoostControl::Closed
        }
    }

    /// Whether the pump is to run, given the relay's command.
    pub fn pump(&mut self, parameters: &Parameters, relay: bool) -> bool {
        let &Parameters { sample_time, ref diagnosis, .. } = parameters;
        if !diagnosis.limp_home {
            relay
        } else if self.findings.tank_sensor_implausible {
            let runs = self.pump_time < diagnosis.pump_run_time;
            self.pump_time += sample_time;
            if self.pump_time >= diagnosis.pump_cycle_time {
                self.pump_time = 0.0;
            }
            runs
        } else {
            self.pump_time = 0.0;
            relay && !self.findings.tank_not_filling
        }
    }

    /// The supply voltage (V) to compensate for.
    pub fn supply_voltage(&self, parameters: &Parameters, measured: Option<f64>) -> Option<f64> {
        let is_ignored = parameters.diagnosis.limp_home && self.findings.supply_sensor_implausible;
        measured.filter(|_| !is_ignored)
    }

    /// Judges whether the tank fills with these commands.
    pub fn check_filling(&mut self, parameters: &Parameters, inputs: &Inputs, outputs: &Outputs) {
        if outputs.vacuum_pump > 0.0 && !self.tank_range.holds {
            let fails = self.filling.fails(parameters, outputs.hp_wastegate_pwm, inputs.tank_pressure);
            self.findings.tank_not_filling |= fails;
        } else {
            self.filling = Filling::default();
        }
    }

    /// Judges whether boost responds to the virtual duty (%) commanded for a reference (Pa), if a schedule gives the
    /// expected response. All pressures are at reference conditions; `day` corresponds to a fixed pressure here.
    pub fn check_answer<const COLUMNS: usize>(
        &mut self,
        parameters: &Parameters,
        inputs: &Inputs,
        schedule: Option<Schedule<'_, COLUMNS>>,
        reference: f64,
        virtual_duty: f64,
        day: f64,
    ) {
        let fails = match schedule {
            Some(schedule) if !self.findings.boost_sensor_implausible => {
                self.answer.sample_day(day, parameters.diagnosis.answer_error);
                self.answer.fails(parameters, inputs, schedule, reference, virtual_duty)
            }
            _ => {
                self.answer = Answer::default();
                false
            }
        };
        self.findings.loop_not_answering |= fails;
    }
}

/// A condition that changes once it has been observed changed for some time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
struct Confirmed {
    holds: bool,
    /// How long it has been observed otherwise (s).
    seen_otherwise: f64,
}

impl Confirmed {
    fn sample(&mut self, seen: bool, confirmation_time: f64, sample_time: f64) {
        if seen == self.holds {
            self.seen_otherwise = 0.0;
            return;
        }
        self.seen_otherwise += sample_time;
        if self.seen_otherwise >= confirmation_time {
            *self = Self { holds: seen, seen_otherwise: 0.0 };
        }
    }
}

/// The boost measurement since its last change. A master with steps longer than samples holds measurements, so their
/// next change spans all that time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
struct Signal {
    /// Boost pressure (Pa) and engine speed (rpm) at the last change.
    last: Option<[f64; 2]>,
    /// Time since then (s).
    age: f64,
}

impl Signal {
    /// Whether boost pressure changes faster, or stays more constant, than any engine's.
    fn is_impossible(&mut self, parameters: &Parameters, inputs: &Inputs) -> bool {
        let &Inputs { boost_pressure, engine_speed, .. } = inputs;
        let limits = &parameters.diagnosis;
        self.age += parameters.sample_time;
        let Some([last, speed]) = self.last else {
            *self = Self { last: Some([boost_pressure, engine_speed]), age: 0.0 };
            return false;
        };
        if boost_pressure.to_bits() == last.to_bits() {
            return self.age >= limits.confirmation_time
                && (engine_speed - speed).abs() >= limits.constant_over_speed;
        }
        let change = (boost_pressure - last).abs();
        let is_too_fast = change > limits.boost_gradient_max * self.age;
        *self = Self { last: Some([boost_pressure, engine_speed]), age: 0.0 };
        is_too_fast
    }
}

/// Whether boost responds to the virtual duty.
///
/// While boost is far from its reference, the duty should move it to the pressure of that duty in the schedule, with
/// the schedule's time constant. A working loop moves at least a little that way. One that cannot reach its reference,
/// as in thin air, responded when its duty moved there, and is not judged. Nor is low boost under a reference that did
/// not rise: a shut throttle lowers boost just as a stuck wastegate would.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
struct Answer {
    /// Virtual duty (%) and reference (Pa), filtered; none before the first sample.
    before: Option<[f64; 2]>,
    demand: Option<Demand>,
    /// `day` at the start of the judgement: a fixed pressure's equivalent at reference conditions (Pa).
    day: f64,
}

/// The time since boost is far from its reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
struct Demand {
    /// Above 0 if more boost is demanded.
    sign: f64,
    /// The boost pressure (Pa) farthest from the reference.
    farthest: f64,
    /// The engine speed (rpm) at the start.
    engine_speed: f64,
    /// The reference (Pa) before.
    reference_before: f64,
    /// The schedule's pressure (Pa) for the duty before.
    held_before: f64,
    /// How far boost should have moved (Pa).
    expected: f64,
    has_answered: bool,
    /// How long it has failed to move although it should have (s).
    unanswered: f64,
}

impl Answer {
    /// Restarts the judgement if a fixed pressure's equivalent `day` (Pa) has changed by a bound (Pa): the reference
    /// moved at reference conditions, though not here.
    fn sample_day(&mut self, day: f64, bound: f64) {
        if (day - self.day).abs() >= bound {
            *self = Self { day, ..Self::default() };
        }
    }

    fn fails<const COLUMNS: usize>(
        &mut self,
        parameters: &Parameters,
        inputs: &Inputs,
        schedule: Schedule<'_, COLUMNS>,
        reference: f64,
        virtual_duty: f64,
    ) -> bool {
        let &Inputs { boost_pressure, engine_speed, .. } = inputs;
        let &Parameters { sample_time, diagnosis: ref limits, .. } = parameters;
        // A smaller change moves no wastegate.
        let virtual_duty = actuator_inverse::effective_duty(&parameters.actuator_inverse, virtual_duty);
        let now = [virtual_duty, reference];
        let before = self.before.unwrap_or(now);
        let share = sample_time / larger(MEMORY, sample_time);
        self.before = Some([0, 1].map(|i| before[i] + share * (now[i] - before[i])));

        let error = reference - boost_pressure;
        if error.abs() < limits.answer_error {
            self.demand = None;
            return false;
        }
        let here = OperatingPoint::new(schedule, boost_pressure, engine_speed);
        let lasting = self.demand.filter(|demand| {
            demand.sign * error > 0.0 && (engine_speed - demand.engine_speed).abs() <= STEADY_SPEED
        });
        let demand = self.demand.insert(lasting.unwrap_or_else(|| Demand {
            sign: error.signum(),
            farthest: boost_pressure,
            engine_speed,
            reference_before: before[1],
            held_before: here.pressure_held_by(before[0]),
            ..Demand::default()
        }));
        let local = here.local_model();
        let lag = larger(local.time_constant + local.delay, sample_time);
        let goal = here.pressure_held_by(virtual_duty) - demand.held_before;
        demand.expected += sample_time / lag * (goal - demand.expected);

        let expected = demand.sign * demand.expected;
        let moved = larger(demand.sign * (boost_pressure - demand.farthest), 0.0);
        demand.farthest = boost_pressure - demand.sign * moved;
        let may_be_throttled = error > 0.0 && reference - demand.reference_before < limits.answer_error;
        if expected < limits.answer_error || may_be_throttled {
            demand.unanswered = 0.0;
            return false;
        }
        demand.has_answered |= moved >= limits.answer_movement;
        demand.unanswered = if demand.has_answered { 0.0 } else { demand.unanswered + sample_time };
        demand.unanswered >= limits.answer_time
    }
}

/// Whether the pump lowers tank pressure.
///
/// A moving valve fills the tank with the actuator's air, so the rate is judged while the duty is constant. This is the
/// compensated duty, which also shows supply steps, since these move the valve until they are measured. If it is never
/// constant, as with measurement noise, the pump is judged failed after running long without regaining a lost vacuum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
struct Filling {
    /// From when the pump was switched on.
    run: Span,
    /// From when the duty became constant.
    rest: Span,
    /// The duty (%) at the last sample.
    duty: f64,
    /// The sum of its changes (%) since then.
    travel: f64,
}

/// A time (s) and the tank pressure (Pa) from which it should fall.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
struct Span {
    time: f64,
    from: f64,
}

impl Filling {
    fn fails(&mut self, parameters: &Parameters, duty: f64, tank_pressure: f64) -> bool {
        let &Parameters { sample_time, ref diagnosis, .. } = parameters;
        let begin = Span { time: 0.0, from: tank_pressure };
        if self.run.time == 0.0 {
            (self.run, self.rest) = (begin, begin);
        }
        self.travel += (duty - self.duty).abs();
        self.duty = duty;
        if self.travel > RESTING_TRAVEL {
            (self.rest, self.travel) = (begin, 0.0);
        }
        self.run.time += sample_time;
        self.rest.time += sample_time;
        if self.rest.time <= CHAMBER_SETTLES {
            self.rest.from = tank_pressure;
        }
        let judged = self.rest.time - CHAMBER_SETTLES;
        let mut fails = false;
        if judged >= diagnosis.filling_time {
            fails = self.rest.from - tank_pressure < diagnosis.filling_rate_min * judged;
            (self.rest, self.travel) = (Span { time: CHAMBER_SETTLES, ..begin }, 0.0);
        }
        if self.run.time >= diagnosis.longest_run {
            fails |= tank_pressure >= larger(self.run.from, diagnosis.vacuum_lost_above);
            self.run = begin;
        }
        fails
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
            return Err(Error::new(format!(
                "diagnosis.{} is {}{unit} and must be below diagnosis.{}, which is {}{unit}",
                lower.0, lower.1, upper.0, upper.1
            )));
        }
    }
    Ok(())
}
