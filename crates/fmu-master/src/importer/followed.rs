//! Continuous inputs in Model Exchange that follow functions of time between communication points and events.

use std::mem;

use anyhow::{Result, bail};
use fmu_export::display::Seconds;

use super::calls::Calls;
use super::instance::Instance;
use super::selection::{Misfit, Selection};

/// What inputs follow. It is smooth from one of its jumps to the next.
pub trait Course {
    /// The values of the inputs at a time (s), those before a jump if it is at that time, on the stretch that begins at
    /// `from` (s) after a jump.
    fn values(&self, from: f64, time: f64, values: &mut [f64]);

    /// The time of the next jump after a time (s).
    fn next_jump(&self, after: f64) -> Option<f64>;
}

/// The inputs of an instance that follow a course.
pub struct Followed {
    selection: Selection,
    course: Box<dyn Course>,
    /// Where the stretch of the course begins (s).
    from: f64,
    /// What the inputs are set to.
    set: Vec<f64>,
    values: Vec<f64>,
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
    fn compute(&mut self, time: f64) -> Result<bool> {
        self.course.values(self.from, time, &mut self.values);
        if let Err(Misfit { position, reason }) = self.selection.fit(&mut self.values) {
            bail!("{} at {} s: {reason}", self.selection.names()[position], Seconds(time));
        }
        let mut pairs = self.values.iter().zip(&self.set);
        Ok(pairs.any(|(value, set)| value.to_bits() != set.to_bits()))
    }
}

impl Calls {
    /// Sets the inputs that follow a course to its values at a time (s), if these are new.
    pub fn follow(&mut self, time: f64) -> Result<()> {
        let Some(mut followed) = self.followed.take() else { return Ok(()) };
        let result = followed.compute(time).and_then(|is_new| {
            if is_new {
                self.warn_of_no_numbers(followed.selection.names(), &followed.values);
                self.write(&mut followed.selection, &followed.values)?;
                mem::swap(&mut followed.set, &mut followed.values);
            }
            Ok(())
        });
        self.followed = Some(followed);
        result
    }

    /// Begins a stretch of the course at a time (s), after a jump.
    pub fn begin_stretch(&mut self, time: f64) -> Result<()> {
        if let Some(followed) = &mut self.followed {
            followed.from = time;
        }
        self.follow(time)
    }

    /// The next jump of what inputs follow (s).
    pub fn next_jump(&self) -> Option<f64> {
        self.followed.as_ref()?.next_jump()
    }
}

impl Instance {
    /// Lets continuous inputs follow a course in Model Exchange, from now on, when it is not initialized.
    pub(crate) fn let_follow(&mut self, selection: Selection, course: Box<dyn Course>) -> Result<()> {
        self.refuse_other(&selection)?;
        self.calls.followed = Some(Followed::new(selection, course));
        Ok(())
    }

    /// Sets the inputs that follow a course to its values at a time (s), before initialization.
    pub(crate) fn begin_to_follow(&mut self, time: f64) -> Result<()> {
        let Some(mut followed) = self.calls.followed.take() else { return Ok(()) };
        followed.from = time;
        let result = followed.compute(time).and_then(|_| {
            self.write_fitted(&mut followed.selection, &followed.values)?;
            followed.set.copy_from_slice(&followed.values);
            Ok(())
        });
        self.calls.followed = Some(followed);
        result
    }
}
