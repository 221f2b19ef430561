//! The inputs during a communication step: values, with the derivatives set by `fmi2SetRealInputDerivatives` (FMI
//! 2.0.5, section 4.2.1), limited to min and max.

use core::mem;

use fmu_abi::floating_point::in_default_environment;
use fmu_solve::Error;
use fmu_solve::persistence::{Archive, Persistent};

/// The highest accepted order of an input derivative.
pub const MAX_ORDER: usize = 8;

/// The limits of a Real input.
#[derive(Clone, Copy, Debug)]
pub struct RealInput {
    /// The smallest value passed to the model.
    pub min: f64,
    /// The largest value passed to the model.
    pub max: f64,
}

/// The input variables of a model.
pub trait Inputs: Clone + core::fmt::Debug + PartialEq + Persistent + Send + Sync + 'static {
    /// The Real inputs, by position.
    const REALS: &'static [RealInput];
    /// The value of the Real input at a position.
    fn real(&self, position: usize) -> f64;
    /// Sets each Real input to the value for its position.
    fn set_reals(&mut self, value: impl Fn(usize) -> f64);
    /// Sets the Real input at a position.
    fn set_real(&mut self, position: usize, value: f64) {
        let before = self.clone();
        self.set_reals(|other| if other == position { value } else { before.real(other) });
    }
}

/// The inputs as functions of the time since the step's start.
#[allow(clippy::struct_excessive_bools, reason = "each is a fact of its own")]
#[derive(Clone, Debug)]
pub struct InputSignal<I> {
    /// The inputs at the step's start, within their bounds, as of [`InputSignal::update`].
    bounded: I,
    /// Whether `bounded` is up to date.
    updated: bool,
    /// The Real inputs, by position.
    reals: Box<[RealSignal]>,
    /// The highest derivative order of any input; 0 when all inputs are constant.
    order: usize,
    /// Whether any input had a slope at the end of the last step.
    sloped: bool,
    /// The inputs at the end of the last step, within their bounds.
    end: I,
    /// Whether `end` is current: the inputs had derivatives in the last step, and none has been set since.
    moved: bool,
    /// Whether an input has moved in the last step, or been set to another value since.
    changed: bool,
}

/// One Real input.
#[derive(Clone, Copy, Debug)]
struct RealSignal {
    /// The value as set.
    set: f64,
    /// The slope at the end of the last step; 0 if the input has been set since.
    slope: f64,
    /// The unbounded value at the end of the last step.
    reached: f64,
    /// Whether the set value is out of bounds.
    outside: bool,
    /// Whether a derivative was ignored.
    derivative_ignored: bool,
    /// The derivatives of order 1, 2, ….
    derivatives: [f64; MAX_ORDER],
}

crate::persistent!(RealSignal { set, slope, reached, outside, derivative_ignored, derivatives });

impl RealSignal {
    fn constant(value: f64) -> Self {
        Self {
            set: value,
            slope: 0.0,
            reached: 0.0,
            outside: false,
            derivative_ignored: false,
            derivatives: [0.0; MAX_ORDER],
        }
    }

    /// The change since the step's start, at a time (s) after it, with derivatives up to an order.
    fn rise(&self, order: usize, offset: f64) -> f64 {
        // Horner's scheme: τ/1·(d1 + τ/2·(d2 + …)).
        (0..order).rev().fold(0.0, |sum, order| offset / (order + 1) as f64 * (self.derivatives[order] + sum))
    }

    /// The slope at a time (s) after the step's start, with derivatives up to an order.
    fn slope_at(&self, order: usize, offset: f64) -> f64 {
        // Horner's scheme: d1 + τ/1·(d2 + τ/2·(d3 + …)).
        (0..order).rev().fold(0.0, |sum, order| self.derivatives[order] + offset / (order + 1) as f64 * sum)
    }
}

impl<I: Inputs> InputSignal<I> {
    /// Constant inputs.
    pub fn constant(inputs: I) -> Self {
        let mut signal = Self {
            reals: (0..I::REALS.len()).map(|position| RealSignal::constant(inputs.real(position))).collect(),
            end: inputs.clone(),
            moved: false,
            bounded: inputs,
            updated: false,
            order: 0,
            sloped: false,
            changed: true,
        };
        signal.update(false);
        signal
    }

    /// The inputs at the step's start.
    #[must_use]
    pub fn initial(&self) -> &I {
        &self.bounded
    }

    /// Whether all inputs are constant during the step.
    #[must_use]
    pub fn is_constant(&self) -> bool {
        self.order == 0
    }

    /// Whether all inputs keep the values that they had at the end of the last step.
    pub(crate) fn is_kept(&self) -> bool {
        self.order == 0 && !self.changed
    }

    /// Declares that all inputs have the values that they had at the end of the last step.
    #[doc(hidden)]
    #[must_use]
    pub fn kept(self) -> Self {
        Self { changed: false, ..self }
    }

    /// The inputs at a time (s) after the step's start, by their Taylor polynomials.
    #[must_use]
    pub fn at(&self, offset: f64) -> I {
        let mut inputs = self.bounded.clone();
        self.move_to(offset, &mut inputs);
        inputs
    }

    /// Overwrites inputs with those at a time (s) after the step's start.
    pub(crate) fn set_at(&self, offset: f64, inputs: &mut I) {
        inputs.clone_from(&self.bounded);
        self.move_to(offset, inputs);
    }

    /// Overwrites inputs with the values that the importer has set, within their bounds or not.
    pub(crate) fn copy_set(&self, inputs: &mut I) {
        inputs.clone_from(&self.bounded);
        inputs.set_reals(|position| self.reals[position].set);
    }

    fn move_to(&self, offset: f64, inputs: &mut I) {
        if self.order > 0 {
            inputs.set_reals(|position| {
                let real = &self.reals[position];
                bound::<I>(position, real.set + real.rise(self.order, offset))
            });
        }
    }

    /// The input slopes at a time (s) after the step's start; 0 where a bound limits an input.
    pub(crate) fn slopes_at(&self, offset: f64) -> I {
        let mut slopes = self.bounded.clone();
        slopes.set_reals(|position| {
            let real = &self.reals[position];
            let is_free = is_within::<I>(position, real.set + real.rise(self.order, offset));
            if is_free { real.slope_at(self.order, offset) } else { 0.0 }
        });
        slopes
    }

    /// Sets a Real input and clears its derivatives. Returns whether it has just left its bounds.
    pub(crate) fn set_value(&mut self, position: usize, value: f64) -> bool {
        let real = &mut self.reals[position];
        let outside = !is_within::<I>(position, value);
        let has_left = outside && !real.outside;
        real.outside = outside;
        real.set = value;
        real.slope = 0.0;
        self.updated = false;
        self.moved = false;
        if self.order > 0 {
            self.forget_derivatives(position);
        }
        has_left
    }

    /// Separate from [`InputSignal::set_value`], which stays fast without derivatives.
    #[cold]
    fn forget_derivatives(&mut self, position: usize) {
        self.reals[position].derivatives = [0.0; MAX_ORDER];
        // Compares numbers that may be subnormal.
        in_default_environment(|| self.find_order());
    }

    /// Sets the inputs that are not Real, one of which has changed.
    pub(crate) fn set_others(&mut self, inputs: &I) {
        self.changed = true;
        self.bounded.clone_from(inputs);
        self.updated = false;
        self.moved = false;
    }

    /// Updates the inputs at the step's start, once for all values set by the importer; `watches` for changes.
    #[inline]
    pub(crate) fn update(&mut self, watches: bool) {
        if !self.updated {
            self.take_set(watches);
        }
    }

    /// Apart from [`Self::update`], so that steps without new values inline the test alone.
    fn take_set(&mut self, watches: bool) {
        let value = |position: usize| bound::<I>(position, self.reals[position].set);
        if watches {
            let is_kept = |position| self.bounded.real(position).to_bits() == f64::to_bits(value(position));
            self.changed |= !(0..I::REALS.len()).all(is_kept);
        }
        self.bounded.set_reals(value);
        self.updated = true;
    }

    /// Sets a derivative of a Real input, of an order from 1 to [`MAX_ORDER`], in the input's unit per s^order.
    ///
    /// # Panics
    /// When the position has no input or the order is out of range.
    pub fn set_derivative(&mut self, position: usize, order: usize, value: f64) {
        self.reals[position].derivatives[order - 1] = value;
        self.find_order();
    }

    /// Records that a derivative of a Real input is ignored. Returns whether it is the first.
    pub(crate) fn ignore_derivative(&mut self, position: usize) -> bool {
        !mem::replace(&mut self.reals[position].derivative_ignored, true)
    }

    /// Ends a step of a size (s): clears the derivatives.
    pub(crate) fn end_step(&mut self, size: f64) {
        self.moved = self.order > 0;
        self.changed = self.moved;
        if self.moved || self.sloped {
            self.note_end(size);
        }
    }

    /// Stores the inputs and their slopes at the end of a step of a size (s).
    fn note_end(&mut self, size: f64) {
        for real in &mut self.reals {
            // A slope that has been cleared since does not count: a restored state does not have it.
            if self.moved {
                real.reached = real.set + real.rise(self.order, size);
            }
            real.slope = real.slope_at(self.order, size);
            real.derivatives = [0.0; MAX_ORDER];
        }
        self.order = 0;
        self.find_end();
        self.find_sloped();
    }

    /// The current inputs: those at the end of the last step, or the values set since.
    pub(crate) fn latest(&self) -> &I {
        if self.moved { &self.end } else { &self.bounded }
    }

    /// The slope of a Real input: from the derivatives for the next step, otherwise at the end of the last step. 0 at
    /// a bound.
    pub(crate) fn slope(&self, position: usize) -> f64 {
        let real = &self.reals[position];
        let is_set = real.derivatives.iter().any(|&derivative| derivative != 0.0);
        let slope = if is_set { real.derivatives[0] } else { real.slope };
        if self.is_free(position) { slope } else { 0.0 }
    }

    /// Whether no bound limits a Real input's current value.
    pub(crate) fn is_free(&self, position: usize) -> bool {
        let real = &self.reals[position];
        is_within::<I>(position, if self.moved { real.reached } else { real.set })
    }

    fn find_end(&mut self) {
        self.end.clone_from(&self.bounded);
        self.end.set_reals(|position| bound::<I>(position, self.reals[position].reached));
    }

    fn find_order(&mut self) {
        self.order = (0..MAX_ORDER)
            .rev()
            .find(|&order| self.reals.iter().any(|real| real.derivatives[order] != 0.0))
            .map_or(0, |order| order + 1);
    }

    fn find_sloped(&mut self) {
        self.sloped = self.reals.iter().any(|real| real.slope != 0.0);
    }
}

/// Reading recomputes derived fields.
impl<I: Inputs> Persistent for InputSignal<I> {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        self.update(true);
        let Self { bounded, updated: _, reals, moved, changed, end: _, order: _, sloped: _ } = self;
        bounded.persist(archive)?;
        reals.persist(archive)?;
        moved.persist(archive)?;
        changed.persist(archive)?;
        self.find_end();
        self.find_order();
        self.find_sloped();
        Ok(())
    }
}

/// Whether a value is within the bounds of the Real input at a position.
fn is_within<I: Inputs>(position: usize, value: f64) -> bool {
    let input = &I::REALS[position];
    (input.min..=input.max).contains(&value)
}

/// The nearest value within the bounds of the Real input at a position.
fn bound<I: Inputs>(position: usize, value: f64) -> f64 {
    let input = &I::REALS[position];
    value.clamp(input.min, input.max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Debug, PartialEq)]
    struct Two {
        values: [f64; 2],
    }

    crate::persistent!(Two { values });

    impl Inputs for Two {
        const REALS: &'static [RealInput] = &[RealInput { min: 0.0, max: 1.0 }; 2];

        fn real(&self, position: usize) -> f64 {
            self.values[position]
        }

        fn set_reals(&mut self, value: impl Fn(usize) -> f64) {
            self.values = [value(0), value(1)];
        }
    }

    /// Both inputs ramp over a step of 1 s: the first out of its range, the second into it.
    fn ramped() -> InputSignal<Two> {
        let mut signal = InputSignal::constant(Two { values: [0.5, 1.5] });
        signal.set_derivative(0, 1, 2.0);
        signal.set_derivative(1, 1, -1.25);
        signal.end_step(1.0);
        signal
    }

    #[test]
    fn the_end_of_a_ramp_is_the_current_value() {
        let mut signal = ramped();
        assert_eq!(*signal.latest(), Two { values: [1.0, 0.25] });
        assert!(!signal.is_free(0) && signal.slope(0) == 0.0, "limited by its bound now");
        assert!(signal.is_free(1) && (signal.slope(1) + 1.25).abs() < f64::EPSILON, "no longer limited");
        // Setting any value restores the set values.
        assert!(signal.set_value(1, 1.5));
        signal.update(true);
        assert_eq!(*signal.latest(), Two { values: [0.5, 1.0] });
        assert!(signal.is_free(0) && !signal.is_free(1));
    }

    #[test]
    fn an_archive_keeps_the_end_of_a_ramp() {
        let mut archive = Archive::writing();
        ramped().persist(&mut archive).unwrap();
        let bytes = archive.into_bytes();
        let mut restored = InputSignal::constant(Two { values: [0.0, 0.0] });
        restored.persist(&mut Archive::reading(&bytes)).unwrap();
        assert_eq!(*restored.latest(), Two { values: [1.0, 0.25] });
        assert!(!restored.is_free(0) && restored.is_free(1));
    }
}
