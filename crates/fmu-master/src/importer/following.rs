//! Setting the inputs of an instance that follow a course.

use std::mem;

use anyhow::Result;

use super::calls::Calls;
use super::followed::{Course, Followed};
use super::instance::Instance;
use super::selection::Selection;

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
