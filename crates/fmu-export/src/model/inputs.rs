//! The input variables of a model, and the bounds within which it receives them.

use fmu_solve::persistence::Persistent;

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

/// Whether a value is within the bounds of the Real input at a position.
pub(crate) fn is_within<I: Inputs>(position: usize, value: f64) -> bool {
    let input = &I::REALS[position];
    (input.min..=input.max).contains(&value)
}

/// The nearest value within the bounds of the Real input at a position.
#[inline]
pub(crate) fn bound<I: Inputs>(position: usize, value: f64) -> f64 {
    let input = &I::REALS[position];
    value.clamp(input.min, input.max)
}
