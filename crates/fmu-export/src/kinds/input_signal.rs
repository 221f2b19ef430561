//! The inputs during a communication step: values, with the derivatives set by `fmi2SetRealInputDerivatives` (FMI
//! 2.0.5, section 4.2.1), limited to min and max.

use core::marker::PhantomData;
use core::mem;

use fmu_abi::floating_point::in_default_environment;
use fmu_solve::Error;
use fmu_solve::persistence::{Archive, Persistent};

use crate::model::inputs::{Inputs, bound, is_within};

/// The highest accepted order of an input derivative.
pub const MAX_ORDER: usize = 8;

/// The inputs as functions of the time since the step's start: the values that the importer has set, with derivatives.
///
/// The model's variables hold what the model computes with: these values within their bounds, and after a step with
/// derivatives those at its end, until the next step begins or an input is set.
#[derive(Clone, Debug)]
pub struct InputSignal<I> {
    /// The Real inputs, by position.
    reals: Box<[RealSignal]>,
    /// The highest derivative order of any input; 0 when all inputs are constant.
    order: usize,
    /// Whether any input had a slope at the end of the last step.
    sloped: bool,
    /// How many values, as set, are out of bounds.
    outside: usize,
    /// Whether the inputs are those at the end of a step with derivatives, and none has been set since.
    moved: bool,
    /// Whether an input has moved in the last step, or been set to another value since.
    changed: bool,
    inputs: PhantomData<fn() -> I>,
}

/// One Real input.
#[derive(Clone, Copy, Debug, Default)]
struct RealSignal {
    /// The value as set.
    set: f64,
    /// The slope at the end of the last step; 0 if the input has been set since.
    slope: f64,
    /// The unbounded value at the end of the last step.
    reached: f64,
    /// Whether the value, as set, is out of bounds.
    is_outside: bool,
    /// Whether a derivative was ignored.
    derivative_ignored: bool,
    /// The derivatives of order 1, 2, ….
    derivatives: [f64; MAX_ORDER],
}

crate::persistent!(RealSignal { set, slope, reached, is_outside, derivative_ignored, derivatives });

impl RealSignal {
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
    pub fn constant(inputs: &I) -> Self {
        let mut signal = Self {
            reals: (0..I::REALS.len())
                .map(|position| {
                    let set = inputs.real(position);
                    RealSignal { set, is_outside: !is_within::<I>(position, set), ..RealSignal::default() }
                })
                .collect(),
            order: 0,
            sloped: false,
            outside: 0,
            moved: false,
            changed: true,
            inputs: PhantomData,
        };
        signal.count_outside();
        signal
    }

    /// Whether all inputs are constant during the step.
    #[must_use]
    pub fn is_constant(&self) -> bool {
        self.order == 0
    }

    /// Moves inputs to a time (s) after the step's start, by their Taylor polynomials and within their bounds.
    pub fn move_to(&self, offset: f64, inputs: &mut I) {
        if self.order > 0 {
            inputs.set_reals(|position| {
                let real = &self.reals[position];
                bound::<I>(position, real.set + real.rise(self.order, offset))
            });
        }
    }

    /// Sets a derivative of a Real input, of an order from 1 to [`MAX_ORDER`], in the input's unit per s^order.
    ///
    /// # Panics
    /// When the position has no input or the order is out of range.
    pub fn set_derivative(&mut self, position: usize, order: usize, value: f64) {
        self.reals[position].derivatives[order - 1] = value;
        self.find_order();
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

    /// Whether the variables hold other inputs than those that the importer has set.
    #[inline]
    pub(crate) fn differs(&self) -> bool {
        self.moved || self.outside > 0
    }

    /// The value of a Real input as the importer has set it, within its bounds or not.
    pub(crate) fn set(&self, position: usize) -> f64 {
        self.reals[position].set
    }

    /// Takes a value of a Real input, whose derivatives it clears. Returns the nearest value within the input's bounds, and
    /// whether it has just left them.
    #[inline]
    pub(crate) fn take(&mut self, position: usize, value: f64) -> (f64, bool) {
        let bounded = bound::<I>(position, value);
        let is_outside = bounded.to_bits() != value.to_bits();
        let real = &mut self.reals[position];
        self.changed |= real.set.to_bits() != value.to_bits();
        real.set = value;
        real.slope = 0.0;
        let has_left = is_outside && !real.is_outside;
        if is_outside != real.is_outside {
            real.is_outside = is_outside;
            self.count_outside();
        }
        if self.order > 0 {
            self.forget_derivatives(position);
        }
        (bounded, has_left)
    }

    /// Separate from [`InputSignal::take`], which stays fast without derivatives.
    #[cold]
    fn forget_derivatives(&mut self, position: usize) {
        self.reals[position].derivatives = [0.0; MAX_ORDER];
        // Compares numbers that may be subnormal.
        in_default_environment(|| self.find_order());
    }

    /// An input that is not Real has changed.
    pub(crate) fn note_change(&mut self) {
        self.changed = true;
    }

    /// Moves inputs from the end of a step with derivatives back to the values that the importer has set.
    #[inline]
    pub(crate) fn go_back(&mut self, inputs: &mut I) {
        if self.moved {
            self.moved = false;
            self.restart(inputs);
        }
    }

    /// Sets inputs to those at the step's start.
    #[cold]
    pub(crate) fn restart(&self, inputs: &mut I) {
        inputs.set_reals(|position| bound::<I>(position, self.reals[position].set));
    }

    /// The input slopes at a time (s) after the step's start; 0 where a bound limits an input.
    pub(crate) fn slopes_at(&self, offset: f64, slopes: &mut I) {
        slopes.set_reals(|position| {
            let real = &self.reals[position];
            let is_free = is_within::<I>(position, real.set + real.rise(self.order, offset));
            if is_free { real.slope_at(self.order, offset) } else { 0.0 }
        });
    }

    /// Records that a derivative of a Real input is ignored. Returns whether it is the first.
    pub(crate) fn ignore_derivative(&mut self, position: usize) -> bool {
        !mem::replace(&mut self.reals[position].derivative_ignored, true)
    }

    /// Ends a step of a size (s): moves the inputs to its end, and clears the derivatives.
    pub(crate) fn end_step(&mut self, size: f64, inputs: &mut I) {
        self.moved = self.order > 0;
        self.changed = self.moved;
        if self.moved || self.sloped {
            self.note_end(size, inputs);
        }
    }

    /// Stores the inputs and their slopes at the end of a step of a size (s).
    fn note_end(&mut self, size: f64, inputs: &mut I) {
        self.move_to(size, inputs);
        for real in &mut self.reals {
            // A slope that has been cleared since does not count: a restored state does not have it.
            if self.moved {
                real.reached = real.set + real.rise(self.order, size);
            }
            real.slope = real.slope_at(self.order, size);
            real.derivatives = [0.0; MAX_ORDER];
        }
        self.order = 0;
        self.find_sloped();
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

    fn find_order(&mut self) {
        self.order = (0..MAX_ORDER)
            .rev()
            .find(|&order| self.reals.iter().any(|real| real.derivatives[order] != 0.0))
            .map_or(0, |order| order + 1);
    }

    fn find_sloped(&mut self) {
        self.sloped = self.reals.iter().any(|real| real.slope != 0.0);
    }

    #[cold]
    fn count_outside(&mut self) {
        self.outside = self.reals.iter().filter(|real| real.is_outside).count();
    }
}

/// Reading recomputes derived fields.
impl<I: Inputs> Persistent for InputSignal<I> {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let Self { reals, moved, changed, order: _, sloped: _, outside: _, inputs: _ } = self;
        reals.persist(archive)?;
        moved.persist(archive)?;
        changed.persist(archive)?;
        self.find_order();
        self.find_sloped();
        self.count_outside();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::inputs::RealInput;

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
    fn ramped() -> (InputSignal<Two>, Two) {
        let mut inputs = Two { values: [0.5, 1.5] };
        let mut signal = InputSignal::constant(&inputs);
        signal.restart(&mut inputs);
        assert_eq!(inputs.values.map(f64::to_bits), [0.5, 1.0].map(f64::to_bits));
        signal.set_derivative(0, 1, 2.0);
        signal.set_derivative(1, 1, -1.25);
        signal.end_step(1.0, &mut inputs);
        (signal, inputs)
    }

    #[test]
    fn the_end_of_a_ramp_is_the_current_value() {
        let (mut signal, mut inputs) = ramped();
        assert_eq!(inputs, Two { values: [1.0, 0.25] });
        assert!(!signal.is_free(0) && signal.slope(0) == 0.0, "limited by its bound now");
        assert!(signal.is_free(1) && (signal.slope(1) + 1.25).abs() < f64::EPSILON, "no longer limited");
        assert!(signal.differs());
        // Setting any value restores the set values.
        signal.go_back(&mut inputs);
        assert_eq!(signal.take(1, 1.75), (1.0, false), "it was out of its range, as set");
        assert_eq!(inputs, Two { values: [0.5, 1.0] });
        assert!(signal.is_free(0) && !signal.is_free(1) && signal.differs());
        assert_eq!(signal.take(1, 0.75), (0.75, false));
        assert!(!signal.differs());
        assert_eq!(signal.take(1, 1.5), (1.0, true));
        assert!(signal.differs());
    }

    /// Whatever is set, and whenever steps end: the inputs are the values as set, or those at the end of a step, within their
    /// bounds.
    #[test]
    fn inputs_are_what_was_set_or_reached_within_bounds() {
        // Knuth's MMIX generator (The Art of Computer Programming, volume 2, section 3.3.4).
        let mut random = 1_u64;
        let mut below = |most: u64| {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 33) % most
        };
        let mut inputs = Two { values: [0.5, 0.5] };
        let mut signal = InputSignal::constant(&inputs);
        let (mut set, mut slopes, mut reached) = ([0.5; 2], [0.0; 2], None::<[f64; 2]>);
        for number in 0..10_000 {
            let (position, value) = (usize::from(below(2) == 1), below(13) as f64 * 0.25 - 1.0);
            match below(4) {
                0 | 1 => {
                    signal.go_back(&mut inputs);
                    let (bounded, _) = signal.take(position, value);
                    inputs.values[position] = bounded;
                    (set[position], slopes[position], reached) = (value, 0.0, None);
                }
                2 => {
                    signal.set_derivative(position, 1, value);
                    slopes[position] = value;
                }
                _ => {
                    signal.go_back(&mut inputs);
                    signal.end_step(0.5, &mut inputs);
                    let end = [0, 1].map(|at| set[at] + 0.5 * slopes[at]);
                    (reached, slopes) = (slopes.iter().any(|slope| *slope != 0.0).then_some(end), [0.0; 2]);
                }
            }
            let expected = reached.unwrap_or(set).map(|value| value.clamp(0.0, 1.0));
            assert_eq!(inputs.values.map(f64::to_bits), expected.map(f64::to_bits), "{number}");
            assert_eq!([0, 1].map(|at| signal.set(at).to_bits()), set.map(f64::to_bits), "{number}");
            let is_outside = set.iter().any(|value| !(0.0..=1.0).contains(value));
            assert_eq!(signal.differs(), reached.is_some() || is_outside, "{number}");
        }
    }

    #[test]
    fn an_archive_keeps_the_end_of_a_ramp() {
        let mut archive = Archive::writing();
        ramped().0.persist(&mut archive).unwrap();
        let bytes = archive.into_bytes();
        let mut restored = InputSignal::constant(&Two { values: [0.0, 0.0] });
        restored.persist(&mut Archive::reading(&bytes)).unwrap();
        assert!(!restored.is_free(0) && restored.is_free(1) && restored.differs());
        let mut inputs = Two { values: [1.0, 0.25] };
        restored.go_back(&mut inputs);
        assert_eq!(inputs, Two { values: [0.5, 1.0] });
    }
}
