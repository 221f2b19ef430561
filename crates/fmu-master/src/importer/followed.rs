//! Continuous inputs in Model Exchange that follow functions of time between communication points and events.

use anyhow::{Result, bail};
use fmu_solve::display::Seconds;

use super::selection::{Misfit, Selection};

/// The course that inputs follow: smooth from one jump to the next.
pub trait Course {
    /// The values of the inputs at a time (s), those before a jump if it is at that time, on the stretch that begins at
    /// `from` (s) after a jump.
    fn values(&self, from: f64, time: f64, values: &mut [f64]);

    /// The time of the next jump after a time (s).
    fn next_jump(&self, after: f64) -> Option<f64>;
}

/// The inputs of an instance that follow a course.
pub struct Followed {
    pub selection: Selection,
    course: Box<dyn Course>,
    /// Where the stretch of the course begins (s).
    pub from: f64,
    /// What the inputs are set to.
    pub set: Vec<f64>,
    pub values: Vec<f64>,
}

impl Followed {
    pub fn new(selection: Selection, course: Box<dyn Course>) -> Self {
        let count = selection.names().len();
        Self {
            selection,
            course,
            from: f64::NEG_INFINITY,
            set: vec![f64::NAN; count],
            values: vec![0.0; count],
        }
    }

    /// The time of the next jump (s).
    pub fn next_jump(&self) -> Option<f64> {
        self.course.next_jump(self.from)
    }

    /// Forgets what the inputs are set to.
    pub fn forget(&mut self) {
        self.set.fill(f64::NAN);
    }

    /// Computes the values for a time (s). Returns whether any is new.
    pub fn compute(&mut self, time: f64) -> Result<bool> {
        self.course.values(self.from, time, &mut self.values);
        if let Err(Misfit { position, reason }) = self.selection.fit(&mut self.values) {
            bail!("{} at {} s: {reason}", self.selection.names()[position], Seconds(time));
        }
        let mut pairs = self.values.iter().zip(&self.set);
        Ok(pairs.any(|(value, set)| value.to_bits() != set.to_bits()))
    }
}
