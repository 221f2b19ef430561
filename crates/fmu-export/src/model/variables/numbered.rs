//! A model's variables over any number type, by which equations are evaluated, differentiated and recorded; and its states
//! by position.

use fmu_solve::Number;

use super::{Accessed, Described};
use crate::model::description::{Dependencies, ValueReference};

/// The numbers among a model's variables.
pub trait Numbered: Described + Accessed + Sized {
    /// The variables over another number type.
    type Of<T: Number>;
    /// What [`Equations::evaluate`](crate::Equations::evaluate) reads and computes, over a number type.
    type Evaluation<'a, T: Number + 'a>;
    /// The parameters over a number type.
    type Parameters<T: Number>;
    /// What follows from parameters only, over a number type: calculated parameters, and locals whose variability is
    /// `fixed` or `tunable`; `()` if there are none.
    type CalculatedParameters<T: Number>;

    /// The variables as seen by an evaluation: read-only ones by shared references.
    fn evaluation<'a, T: Number + 'a>(variables: &'a mut Self::Of<T>) -> Self::Evaluation<'a, T>;

    /// Calls a function to calculate what follows from the parameters only. A no-op if nothing does.
    fn calculate_parameters<T: Number>(
        variables: &mut Self::Of<T>,
        calculate: impl FnOnce(&Self::Parameters<T>, &mut Self::CalculatedParameters<T>),
    ) {
        let _ = (variables, calculate);
    }

    /// Variables whose Reals are all 0: a direction in which nothing changes.
    fn zero() -> Self;

    /// The direction in which the states move with their derivatives; nothing else changes.
    #[must_use]
    fn along_derivatives(&self) -> Self;

    /// The variables over another number type: each number computed from this one's and the other's.
    fn combined<T: Number>(&self, other: &Self, number: impl FnMut(f64, f64) -> T) -> Self::Of<T>;

    /// The reverse of [`Numbered::combined`]: each number computed from one of another number type, and from
    /// another's.
    fn collected<T: Number>(numbers: &Self::Of<T>, other: &Self, number: impl FnMut(T, f64) -> f64) -> Self;

    /// Calls a function with the position of each state and its value.
    fn each_state<T: Number>(variables: &Self::Of<T>, function: impl FnMut(usize, T));

    /// Calls a function with the position of each state and its derivative.
    fn each_derivative<T: Number>(variables: &Self::Of<T>, function: impl FnMut(usize, T));

    /// Sets each state by its position.
    fn set_states<T: Number>(variables: &mut Self::Of<T>, state: impl Fn(usize) -> T);

    /// The first state outside the range in which the equations are valid: its position and value.
    #[must_use]
    fn first_beyond(&self) -> Option<(usize, f64)>
    where
        Self: Numbered<Of<f64> = Self>,
    {
        let mut strict = Self::STRICT_STATES.iter().peekable();
        let mut beyond = None;
        if strict.len() > 0 {
            Self::each_state(self, |state, value: f64| {
                if let Some((states, min, max)) = strict.peek()
                    && states.contains(&state)
                {
                    if !(min..=max).contains(&&value) {
                        beyond = beyond.or(Some((state, value)));
                    }
                    strict.next_if(|(states, _, _)| states.end == state + 1);
                }
            });
        }
        beyond
    }

    /// Variables in which each number is its place, counted from 1 in the order in which all functions visit them.
    #[must_use]
    fn places() -> Self
    where
        Self: Numbered<Of<f64> = Self>,
    {
        let (zero, mut count) = (Self::zero(), 0.0);
        zero.combined(&zero, |_, _| {
            count += 1.0;
            count
        })
    }

    /// Whether the derivative of a state reads a state, according to the model's JSON.
    #[must_use]
    fn derivative_reads(derivative: usize, state: usize) -> bool
    where
        Self: Numbered<Of<f64> = Self>,
    {
        let places = Self::places();
        let (mut of_derivative, mut of_state) = (0.0, 0.0);
        Self::each_derivative(&places, |position, place| {
            of_derivative = if position == derivative { place } else { of_derivative };
        });
        Self::each_state(&places, |position, place| {
            of_state = if position == state { place } else { of_state };
        });
        let is_at =
            |reference: ValueReference, place: f64| places.real(reference).to_bits() == place.to_bits();
        let mut declared = Self::DEPENDENCIES.iter().flat_map(Dependencies::each);
        let reads = declared.find(|(unknown, _)| is_at(*unknown, of_derivative));
        reads.is_none_or(|(_, mut knowns)| knowns.any(|known| is_at(known, of_state)))
    }

    /// Variables with weights in place of Real ones, each of which occurs once, and 0 elsewhere. For
    /// [`Stepper::differentiate_backwards`](crate::Stepper::differentiate_backwards).
    #[cfg(not(target_os = "none"))]
    #[must_use]
    fn weights(references: &[ValueReference], weights: &[f64]) -> Self
    where
        Self: Numbered<Of<f64> = Self>,
    {
        let places = Self::places();
        let place = |&reference: &ValueReference| places.real(reference);
        let mut weights: Vec<_> = references.iter().map(place).zip(weights.iter().copied()).collect();
        weights.sort_by(|(one, _), (other, _)| one.total_cmp(other));
        let mut weights = weights.into_iter().peekable();
        places.combined(&places, |here, _| {
            weights.next_if(|(place, _)| *place <= here).map_or(0.0, |(_, weight)| weight)
        })
    }
}
