//! Whether boost responds to the virtual duty.
//!
//! While boost is far from its reference, the duty should move it to the pressure of that duty in the schedule, with
//! the schedule's time constant. A working loop moves at least a little that way. One that cannot reach its reference,
//! as in thin air, responded when its duty moved there, and is not judged. Nor is low boost under a driver's reference
//! that did not rise: a shut throttle lowers boost just as a stuck wastegate would, and the shaft's limit moves the
//! reference by itself.

use fmu_export::Persistent;

use super::evidence::{MEMORY, STEADY_SPEED};
use crate::controller::schedule::OperatingPoint;
use crate::controller::variables::{Parameters, Real};
use crate::elementary::larger;

/// What the loop is asked for, at reference conditions.
#[derive(Clone, Copy, Debug)]
pub struct Asked {
    /// The driver's reference (Pa).
    pub by_driver: Real,
    /// The reference within the shaft's limit (Pa).
    pub reference: Real,
    /// By how much a fixed pressure is higher at reference conditions (Pa): it moves with ambient conditions.
    pub day_shift: Real,
}

/// What a sample shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    Unknown,
    /// Boost went where it was asked to go.
    Answers,
    Fails,
}

/// The memory of the judgement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct Answer {
    /// Virtual duty (%) and the driver's reference (Pa), filtered; none before the first sample.
    before: Option<[Real; 2]>,
    demand: Option<Demand>,
    /// [`Asked::day_shift`] and the engine speed (rpm) at the start of the judgement.
    day_shift: Real,
    engine_speed: Real,
}

/// The time since boost is far from its reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
struct Demand {
    /// Above 0 if more boost is demanded.
    sign: Real,
    /// The boost pressure (Pa) farthest from the reference.
    farthest: Real,
    /// The driver's reference (Pa) before.
    reference_before: Real,
    /// The schedule's pressure (Pa) for the duty before.
    held_before: Real,
    /// How far boost should have moved (Pa).
    expected: Real,
    has_answered: bool,
    /// How long boost has failed to move although it should have (s).
    unanswered: Real,
}

impl Answer {
    /// Judges a sample with a boost pressure (Pa) at an engine speed (rpm), both at reference conditions, and a virtual
    /// duty (%), at least the one at which the wastegate lifts off.
    pub fn judge<const COLUMNS: usize>(
        &mut self,
        parameters: &Parameters,
        (boost_pressure, engine_speed): (Real, Real),
        here: OperatingPoint<'_, COLUMNS>,
        asked: Asked,
        virtual_duty: Real,
    ) -> Verdict {
        let &Parameters { sample_time, diagnosis: ref limits, .. } = parameters;
        // The reference moved at reference conditions, though not here; or a ramp moved the duty. What was before does not
        // count.
        let is_steady = (engine_speed - self.engine_speed).abs() <= STEADY_SPEED;
        if !is_steady || (asked.day_shift - self.day_shift).abs() >= limits.answer_error {
            *self = Self { day_shift: asked.day_shift, engine_speed, ..Self::default() };
        }
        let now = [virtual_duty, asked.by_driver];
        let before = self.before.unwrap_or(now);
        let share = sample_time / larger(MEMORY, sample_time);
        self.before = Some([0, 1].map(|i| before[i] + share * (now[i] - before[i])));

        let error = asked.reference - boost_pressure;
        if error.abs() < limits.answer_error {
            let arrives =
                |demand: Demand| demand.has_answered && demand.sign * demand.expected >= limits.answer_error;
            let has_arrived = self.demand.take().is_some_and(arrives);
            return if has_arrived { Verdict::Answers } else { Verdict::Unknown };
        }
        let lasting = self.demand.filter(|demand| demand.sign * error > 0.0);
        let demand = self.demand.insert(lasting.unwrap_or_else(|| Demand {
            sign: error.signum(),
            farthest: boost_pressure,
            reference_before: before[1],
            held_before: here.pressure_held_by(before[0]),
            ..Demand::default()
        }));
        let goal = here.pressure_held_by(virtual_duty) - demand.held_before;
        demand.expected += here.share_of_lag(sample_time) * (goal - demand.expected);

        let expected = demand.sign * demand.expected;
        let moved = larger(demand.sign * (boost_pressure - demand.farthest), 0.0);
        demand.farthest = boost_pressure - demand.sign * moved;
        let may_be_throttled = error > 0.0 && asked.by_driver - demand.reference_before < limits.answer_error;
        if expected < limits.answer_error || may_be_throttled {
            demand.unanswered = 0.0;
            return Verdict::Unknown;
        }
        demand.has_answered |= moved >= limits.answer_movement;
        demand.unanswered = if demand.has_answered { 0.0 } else { demand.unanswered + sample_time };
        if demand.unanswered >= limits.answer_time { Verdict::Fails } else { Verdict::Unknown }
    }
}
