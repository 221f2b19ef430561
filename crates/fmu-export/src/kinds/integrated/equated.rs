//! A model's equations as the system that the integrator steps.

use core::ops::Range;

use fmu_solve::integrator::{Directions, Method, Part, Pattern, System, TwoParts};
use fmu_solve::time::rounding;
use fmu_solve::{Dual, Recorded, Tape};

use crate::kinds::Step;
use crate::kinds::equations::{Equations, Multirate, duals, evaluate, evaluate_values};
use crate::kinds::input_signal::InputSignal;
use crate::model::variables::{Accessed, Described as _, Numbered as _};
use crate::panics;

/// Where variables were evaluated: so long after the step's start, and at which time, both in s.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) elapsed: f64,
    pub(super) time: f64,
}

impl Place {
    /// The place of variables that are not the results of one evaluation.
    pub(super) const NONE: Self = Self { elapsed: f64::NAN, time: f64::NAN };
}

/// A model's equations with the inputs of a step.
pub struct Equated<'a, E: Equations> {
    equations: &'a E,
    variables: &'a mut E::Variables,
    inputs: &'a InputSignal<<E::Variables as Accessed>::Inputs>,
    /// The start of the step in s.
    start: f64,
    /// Where the variables were evaluated last.
    place: &'a mut Place,
}

impl<'a, E: Equations> Equated<'a, E> {
    pub(super) fn new(
        equations: &'a E,
        variables: &'a mut E::Variables,
        step: &Step<'a, <E::Variables as Accessed>::Inputs>,
        place: &'a mut Place,
    ) -> Self {
        Self { equations, variables, inputs: step.inputs, start: step.start, place }
    }

    /// Whether the variables are already the results at a place and these states: a step ends with an evaluation where its
    /// end is asked for, and the next one begins there.
    fn is_at(&self, Place { elapsed, time }: Place, states: impl Fn(usize) -> f64) -> bool {
        // The time that the last step has reached may differ by more from the start of this one than by rounding.
        let mut is_same = self.place.elapsed.to_bits() == elapsed.to_bits()
            && (!E::Variables::DEPENDS_ON_TIME || (self.place.time - time).abs() <= rounding(time));
        if is_same {
            E::Variables::each_state(self.variables, |state, value: f64| {
                is_same &= value.to_bits() == states(state).to_bits();
            });
        }
        is_same
    }

    fn set(&mut self, elapsed: f64, states: impl Fn(usize) -> f64) {
        *self.place = Place::NONE;
        if !self.inputs.is_constant() {
            self.inputs.move_to(elapsed, self.variables.inputs_mut());
        }
        E::Variables::set_states(self.variables, states);
    }

    /// Evaluates at a time in s, and so long after the start.
    pub(super) fn evaluate(&mut self, elapsed: f64, time: f64, states: impl Fn(usize) -> f64) {
        let place = Place { elapsed, time };
        if !self.is_at(place, &states) {
            self.set(elapsed, states);
            evaluate_values(self.equations, time, self.variables);
            *self.place = place;
        }
    }

    /// The derivatives of the last evaluation.
    pub(super) fn present_rates(&self, rates: &mut [f64]) {
        E::Variables::each_derivative(self.variables, |state, rate| rates[state] = rate);
    }

    /// Whether the derivatives depend on the states alone.
    fn is_autonomous(&self) -> bool {
        !E::Variables::DEPENDS_ON_TIME && self.inputs.is_constant()
    }

    /// Records an evaluation on an empty tape. Returns the states on it, the first numbers there, and their derivatives.
    fn record<'t>(
        &mut self,
        elapsed: f64,
        states: &[f64],
        tape: &'t Tape,
    ) -> (Vec<Recorded<'t>>, Vec<Recorded<'t>>) {
        self.set(elapsed, |state| states[state]);
        let constant = |value: f64, _| Recorded::from(value);
        let mut recorded = self.variables.combined(self.variables, constant);
        let states: Vec<_> = states.iter().map(|&state| tape.variable(state)).collect();
        E::Variables::set_states(&mut recorded, |state| states[state]);
        evaluate(self.equations, Recorded::from(self.start + elapsed), &mut recorded);
        let mut rates = states.clone();
        E::Variables::each_derivative(&recorded, |row, rate| rates[row] = rate);
        (states, rates)
    }
}

impl<E: Multirate> TwoParts for Equated<'_, E> {
    fn drives(state: usize, slow: Range<usize>) -> bool {
        slow.into_iter().any(|derivative| E::Variables::derivative_reads(derivative, state))
    }

    #[inline]
    fn part_derivatives(
        &mut self,
        part: Part,
        elapsed: f64,
        states: impl Fn(usize) -> f64,
        derivatives: impl FnMut(usize, f64),
    ) {
        self.set(elapsed, states);
        let time = self.start + elapsed;
        self.equations.evaluate_part(part, time, E::Variables::evaluation(self.variables));
        E::Variables::each_derivative(self.variables, derivatives);
    }

    fn present_derivatives(&self, derivatives: impl FnMut(usize, f64)) {
        E::Variables::each_derivative(self.variables, derivatives);
    }

    fn is_coupled(&self) -> bool {
        self.equations.is_coupled(self.variables)
    }

    fn is_autonomous(&self) -> bool {
        self.is_autonomous()
    }

    fn range(state: usize) -> [f64; 2] {
        let strict = E::Variables::STRICT_STATES.iter().find(|(states, ..)| states.contains(&state));
        strict.map_or([f64::NEG_INFINITY, f64::INFINITY], |&(_, min, max)| [min, max])
    }
}

impl<E: Equations> System for Equated<'_, E> {
    const METHOD: &'static Method = E::INTEGRATION.method;
    const TOLERANCE_IS_ABSOLUTE: bool = E::INTEGRATION.error_scales.is_some();
    const LONGEST_STEP: f64 = E::INTEGRATION.longest_step;
    const MAY_BE_SPARSE: bool = E::Variables::STATE_NOMINALS.len() > Self::METHOD.most_dense();

    fn zero(&self) -> f64 {
        self.start
    }

    fn count_from(&mut self, zero: f64) {
        (self.start, *self.place) = (zero, Place::NONE);
    }

    fn attempt<T>(trial: impl FnOnce() -> T) -> Option<T> {
        panics::attempt(trial)
    }

    fn derivatives(&mut self, elapsed: f64, states: &[f64], derivatives: &mut [f64]) {
        let place = Place { elapsed, time: self.start + elapsed };
        let is_new = !self.is_at(place, |state| states[state]);
        if is_new {
            self.set(elapsed, |state| states[state]);
        }
        if self.variables.first_beyond().is_some() {
            // The integrator takes a shorter step.
            return derivatives.fill(f64::NAN);
        }
        if is_new {
            evaluate_values(self.equations, place.time, self.variables);
            *self.place = place;
        }
        E::Variables::each_derivative(self.variables, |state, rate| derivatives[state] = rate);
    }

    fn linearize(
        &mut self,
        elapsed: f64,
        states: &[f64],
        directions: &impl Directions,
        products: &mut [f64],
        by_time: &mut [f64],
    ) {
        self.set(elapsed, |state| states[state]);
        let time = self.start + elapsed;
        let is_autonomous = self.is_autonomous();
        if is_autonomous {
            by_time.fill(0.0);
            if directions.count() == 0 {
                return;
            }
        }
        let mut numbers = duals(self.variables, self.variables, &|value, _| Dual::from(value));
        let count = directions.count();
        for direction in 0..count {
            E::Variables::set_states(&mut numbers, |state| {
                Dual::new(states[state], directions.component(direction, state))
            });
            evaluate(self.equations, Dual::from(time), &mut numbers);
            E::Variables::each_derivative(&numbers, |row, rate: Dual| {
                products[row * count + direction] = rate.derivative;
            });
        }
        if is_autonomous {
            return;
        }
        if !self.inputs.is_constant() {
            let mut direction = E::Variables::zero();
            self.inputs.slopes_at(elapsed, direction.inputs_mut());
            numbers = duals(self.variables, &direction, &Dual::new);
        }
        E::Variables::set_states(&mut numbers, |state| Dual::from(states[state]));
        evaluate(self.equations, Dual::new(time, 1.0), &mut numbers);
        E::Variables::each_derivative(&numbers, |row, rate: Dual| by_time[row] = rate.derivative);
    }

    fn gradients(
        &mut self,
        elapsed: f64,
        states: &[f64],
        rows: &[usize],
        mut take: impl FnMut(usize, &dyn Fn(usize) -> f64),
    ) {
        let mut tape = Tape::new();
        tape.clear();
        let (states, rates) = self.record(elapsed, states, &tape);
        for &row in rows {
            tape.differentiate(rates[row], states.len());
            take(row, &|column| tape.derivative(states[column]));
        }
    }

    fn pattern(&mut self, elapsed: f64, states: &[f64]) -> Pattern {
        let mut tape = Tape::new();
        tape.clear();
        let (_, rates) = self.record(elapsed, states, &tape);
        tape.pattern(&rates)
    }
}
