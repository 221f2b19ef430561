//! The inputs during a communication step: values, with the derivatives that
//! `fmi2SetRealInputDerivatives` gave (FMI 2.0.5, section 4.2.1), kept within min and max.

use crate::model::{Error, Inputs};
use crate::persistence::{Archive, Persistent};

/// The highest order of an input derivative that is taken.
pub const MAX_ORDER: usize = 8;

/// The inputs as functions of the time since the step's begin.
#[derive(Clone, Debug)]
pub struct InputSignal<I> {
    /// The inputs at the step's begin, within their bounds.
    bounded: I,
    /// By Real input: the value as it was set.
    set: Box<[f64]>,
    /// By Real input: the derivatives of order 1, 2, ….
    derivatives: Box<[[f64; MAX_ORDER]]>,
    /// The highest order of which any input has a derivative; 0 when all are constant.
    order: usize,
    /// By Real input: its slope at the end of the last step, 0 where it was set since.
    slopes: Box<[f64]>,
    /// Whether any of these is not 0.
    sloped: bool,
    /// By Real input: the value that it reached at the end of the last step, before it was bounded.
    reached: Box<[f64]>,
    /// The inputs at the end of the last step, within their bounds.
    end: I,
    /// Whether those of the end are the latest: nothing was set since they moved away from what was set.
    moved: bool,
}

impl<I: Inputs> InputSignal<I> {
    /// Inputs that hold their values.
    pub fn constant(inputs: I) -> Self {
        let mut signal = Self {
            set: (0..I::REALS.len()).map(|position| inputs.real(position)).collect(),
            reached: vec![0.0; I::REALS.len()].into_boxed_slice(),
            end: inputs.clone(),
            moved: false,
            bounded: inputs,
            derivatives: vec![[0.0; MAX_ORDER]; I::REALS.len()].into_boxed_slice(),
            order: 0,
            slopes: vec![0.0; I::REALS.len()].into_boxed_slice(),
            sloped: false,
        };
        signal.bound_all();
        signal
    }

    /// The inputs at the step's begin.
    #[must_use]
    pub fn initial(&self) -> &I {
        &self.bounded
    }

    /// Whether all inputs hold their values through the step.
    #[must_use]
    pub fn is_constant(&self) -> bool {
        self.order == 0
    }

    /// The inputs at a time (s) after the step's begin: the Taylor polynomial of each.
    #[must_use]
    pub fn at(&self, offset: f64) -> I {
        let mut inputs = self.bounded.clone();
        if self.order > 0 {
            for (position, &value) in self.set.iter().enumerate() {
                let rise = self.rise(position, offset);
                if rise != 0.0 {
                    inputs.set_real(position, bound::<I>(position, value + rise));
                }
            }
        }
        inputs
    }

    /// By how much the Real input at a position differs from what was set, at a time (s) after the step's
    /// begin.
    fn rise(&self, position: usize, offset: f64) -> f64 {
        let derivatives = &self.derivatives[position];
        // Horner's scheme: τ/1·(d1 + τ/2·(d2 + …)).
        (0..self.order).rev().fold(0.0, |sum, order| offset / (order + 1) as f64 * (derivatives[order] + sum))
    }

    /// Takes a new value of a Real input; its derivatives are forgotten. Answers whether it is held at a
    /// bound.
    #[allow(clippy::float_cmp, reason = "a value that is not bounded is the same")]
    pub(crate) fn set_value(&mut self, position: usize, value: f64) -> bool {
        let bounded = bound::<I>(position, value);
        self.set[position] = value;
        self.bounded.set_real(position, bounded);
        self.slopes[position] = 0.0;
        self.moved = false;
        if self.order > 0 {
            self.derivatives[position] = [0.0; MAX_ORDER];
            self.find_order();
        }
        bounded != value
    }

    /// Takes the values of the inputs that are not Real.
    pub(crate) fn set_others(&mut self, inputs: &I) {
        self.moved = false;
        self.bounded.clone_from(inputs);
        self.bound_all();
    }

    fn bound_all(&mut self) {
        for (position, &value) in self.set.iter().enumerate() {
            self.bounded.set_real(position, bound::<I>(position, value));
        }
    }

    /// Sets the derivative of an order (from 1 to [`MAX_ORDER`]) of a Real input, in its unit by s to the order.
    ///
    /// # Panics
    /// When there is no input at the position or the order is another.
    pub fn set_derivative(&mut self, position: usize, order: usize, value: f64) {
        self.derivatives[position][order - 1] = value;
        self.find_order();
    }

    /// Ends a step of a size (s): the derivatives are forgotten.
    pub(crate) fn end_step(&mut self, size: f64) {
        self.moved = self.order > 0;
        if self.moved || self.sloped {
            self.note_end(size);
        }
    }

    /// Notes the inputs and their slopes at the end of a step of a size (s).
    fn note_end(&mut self, size: f64) {
        for (position, &value) in self.set.iter().enumerate() {
            self.reached[position] = value + self.rise(position, size);
        }
        self.find_end();
        for (slope, derivatives) in self.slopes.iter_mut().zip(&self.derivatives) {
            // Horner's scheme: d1 + h/1·(d2 + h/2·(d3 + …)).
            *slope = (0..self.order)
                .rev()
                .fold(0.0, |sum, order| derivatives[order] + size / (order + 1) as f64 * sum);
        }
        self.find_sloped();
        self.derivatives.fill([0.0; MAX_ORDER]);
        self.order = 0;
    }

    /// The inputs that belong to the present values: those of the end of the last step, or what was set
    /// since.
    pub(crate) fn latest(&self) -> &I {
        if self.moved { &self.end } else { &self.bounded }
    }

    /// The slope of the Real input at a position: that of the derivatives which were set for the next
    /// step, otherwise that with which the last step ended. 0 for an input that is held at a bound.
    pub(crate) fn slope(&self, position: usize) -> f64 {
        let derivatives = &self.derivatives[position];
        let is_set = derivatives.iter().any(|&derivative| derivative != 0.0);
        let slope = if is_set { derivatives[0] } else { self.slopes[position] };
        if self.is_free(position) { slope } else { 0.0 }
    }

    /// Whether the Real input at a position is not held at a bound, as of the latest values.
    pub(crate) fn is_free(&self, position: usize) -> bool {
        let input = &I::REALS[position];
        let value = if self.moved { self.reached[position] } else { self.set[position] };
        (input.min..=input.max).contains(&value)
    }

    fn find_end(&mut self) {
        self.end.clone_from(&self.bounded);
        for (position, &value) in self.reached.iter().enumerate() {
            self.end.set_real(position, bound::<I>(position, value));
        }
    }

    fn find_order(&mut self) {
        self.order = (0..MAX_ORDER)
            .rev()
            .find(|&order| self.derivatives.iter().any(|derivatives| derivatives[order] != 0.0))
            .map_or(0, |order| order + 1);
    }

    fn find_sloped(&mut self) {
        self.sloped = self.slopes.iter().any(|&slope| slope != 0.0);
    }
}

/// All but what follows from the rest.
impl<I: Inputs> Persistent for InputSignal<I> {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let Self { bounded, set, derivatives, slopes, reached, moved, end: _, order: _, sloped: _ } = self;
        bounded.persist(archive)?;
        set.persist(archive)?;
        derivatives.persist(archive)?;
        slopes.persist(archive)?;
        reached.persist(archive)?;
        moved.persist(archive)?;
        self.find_end();
        self.find_order();
        self.find_sloped();
        Ok(())
    }
}

/// The nearest value that the input at a position may have.
fn bound<I: Inputs>(position: usize, value: f64) -> f64 {
    let input = &I::REALS[position];
    value.clamp(input.min, input.max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::RealInput;

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

        fn set_real(&mut self, position: usize, value: f64) {
            self.values[position] = value;
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
    fn what_counts_after_a_ramp_is_the_value_that_it_reached() {
        let mut signal = ramped();
        assert_eq!(*signal.latest(), Two { values: [1.0, 0.25] });
        assert!(!signal.is_free(0) && signal.slope(0) == 0.0, "held at its bound now");
        assert!(signal.is_free(1) && (signal.slope(1) + 1.25).abs() < f64::EPSILON, "no longer held");
        // Whatever is set next, the values are those that were set.
        signal.set_value(1, 1.5);
        assert_eq!(*signal.latest(), Two { values: [0.5, 1.0] });
        assert!(signal.is_free(0) && !signal.is_free(1));
    }

    #[test]
    fn an_archive_keeps_what_a_ramp_reached() {
        let mut archive = Archive::writing();
        ramped().persist(&mut archive).unwrap();
        let bytes = archive.into_bytes();
        let mut restored = InputSignal::constant(Two { values: [0.0, 0.0] });
        restored.persist(&mut Archive::reading(&bytes)).unwrap();
        assert_eq!(*restored.latest(), Two { values: [1.0, 0.25] });
        assert!(!restored.is_free(0) && restored.is_free(1));
    }
}
