//! Whether the pump lowers tank pressure.
//!
//! A moving valve fills the tank with the actuator's air, so the rate is judged while the duty is constant. This is the
//! compensated duty, which also shows supply steps, since these move the valve until they are measured. If it is never
//! constant, as with measurement noise, the pump is judged failed after running long without regaining a lost vacuum.

use fmu_export::Persistent;

use crate::controller::variables::{Parameters, Real};
use crate::elementary::larger;

/// The sum of duty changes (%) up to which the duty counts as constant: 1 % more empties 0.9 kPa of the actuator
/// chamber into the tank, 40 Pa there with 45 cm³ and 1 l, so this at most 0.08 kPa, or 0.24 kPa with a chamber three
/// times as large.
const RESTING_TRAVEL: Real = 2.0;
/// How long the duty must be constant (s) before tank pressure is judged: the longest filling of the chamber.
const CHAMBER_SETTLES: Real = 0.75;

/// The memory of the judgement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct Filling {
    /// The span from when the pump was switched on.
    run: Span,
    /// The span from when the duty became constant.
    rest: Span,
    /// The duty (%) at the last sample.
    duty: Real,
    /// The sum of the duty's changes (%) since `rest` began.
    travel: Real,
}

/// A time (s) and the tank pressure (Pa) from which it should fall.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
struct Span {
    time: Real,
    from: Real,
}

impl Filling {
    /// Judges a sample with the pump on, from the duty (%) and the tank pressure (Pa).
    pub fn fails(&mut self, parameters: &Parameters, duty: Real, tank_pressure: Real) -> bool {
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
