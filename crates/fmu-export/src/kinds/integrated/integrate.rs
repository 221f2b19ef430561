//! What integrates the states of a model in co-simulation: all with the same steps, or its two parts each with their own.

use core::fmt;

use fmu_solve::integrator::{Integrator, Span, StepFailure, Tolerance, Trials, TwoRates};
use fmu_solve::persistence::Persistent;

use super::equated::Equated;
use crate::kinds::equations::{Equations, Multirate};
use crate::model::variables::Described as _;

/// An integrator of the model `E`.
pub trait Integrate<E: Equations>: Clone + fmt::Debug + Persistent + Send + Sync + 'static {
    /// Whether [`Integrate::states_at`] gives states within a step, where events are searched.
    const FINDS_EVENTS: bool;
    /// Whether a step may go beyond the end that is asked for.
    const LOOKS_AHEAD: bool;
    /// An integrator of the model's states.
    fn new() -> Self;
    /// Prepares for a jump.
    fn restart(&mut self);
    /// Forgets what rests on the present parameters.
    fn discard(&mut self);
    /// Forgets a step beyond the present time.
    fn forget_ahead(&mut self) {}
    /// Whether the present derivatives, at a time (s) in a step that went beyond, are what it lets expect.
    fn agrees(&mut self, system: &Equated<'_, E>, time: f64, tolerance: &Tolerance<'_>) -> bool {
        let _ = (system, time, tolerance);
        true
    }
    /// Has times count from another zero (s).
    fn shift(&mut self, zero: f64) {
        let _ = zero;
    }
    /// Takes a step from `states`, shortened until its error meets the tolerance, unless the last one already went beyond.
    /// Returns the time (s) up to which the states are known.
    ///
    /// # Errors
    /// When even the shortest step misses the tolerance.
    fn step(
        &mut self,
        system: &mut Equated<'_, E>,
        span: Span,
        states: &[f64],
        tolerance: &Tolerance<'_>,
        trials: Trials<'_>,
    ) -> Result<f64, StepFailure>;
    /// The states at a time in s in the last step.
    fn states_at(&mut self, system: &mut Equated<'_, E>, time: f64, states: &mut [f64]);
    /// Takes the derivatives at the end of the last step.
    fn end_step(&mut self, system: &Equated<'_, E>);
    /// The position of the state whose error determined the length of the last trial.
    fn decisive_state(&self) -> usize;
}

impl<E: Equations> Integrate<E> for Integrator {
    const FINDS_EVENTS: bool = true;
    const LOOKS_AHEAD: bool = E::Variables::EVENT_INDICATORS.is_empty();

    fn new() -> Self {
        Self::new(E::Variables::STATE_NOMINALS.len())
    }

    fn restart(&mut self) {
        self.restart();
    }

    fn discard(&mut self) {
        self.discard();
    }

    fn forget_ahead(&mut self) {
        self.forget_ahead();
    }

    fn agrees(&mut self, system: &Equated<'_, E>, time: f64, tolerance: &Tolerance<'_>) -> bool {
        self.agrees::<Equated<'_, E>>(time, tolerance, |rates| system.present_rates(rates))
    }

    fn shift(&mut self, zero: f64) {
        self.shift(zero);
    }

    fn step(
        &mut self,
        system: &mut Equated<'_, E>,
        span: Span,
        states: &[f64],
        tolerance: &Tolerance<'_>,
        trials: Trials<'_>,
    ) -> Result<f64, StepFailure> {
        self.step(system, span, states, tolerance, trials.count)
    }

    fn states_at(&mut self, system: &mut Equated<'_, E>, time: f64, states: &mut [f64]) {
        self.states_at(system, time, states);
    }

    fn end_step(&mut self, _system: &Equated<'_, E>) {}

    fn decisive_state(&self) -> usize {
        self.decisive_state()
    }
}

impl<E: Multirate, const FAST: usize, const SLOW: usize> Integrate<E> for TwoRates<FAST, SLOW> {
    const FINDS_EVENTS: bool = false;
    const LOOKS_AHEAD: bool = false;

    fn new() -> Self {
        Self::new::<Equated<'_, E>>(E::Variables::STATE_NOMINALS.len())
    }

    fn restart(&mut self) {
        self.restart();
    }

    fn discard(&mut self) {
        self.discard_jacobian();
    }

    fn step(
        &mut self,
        system: &mut Equated<'_, E>,
        span: Span,
        states: &[f64],
        tolerance: &Tolerance<'_>,
        trials: Trials<'_>,
    ) -> Result<f64, StepFailure> {
        self.step(system, (span.begin, span.end), states, tolerance, trials)
    }

    fn states_at(&mut self, system: &mut Equated<'_, E>, time: f64, states: &mut [f64]) {
        self.states_at(system, time, states);
    }

    fn end_step(&mut self, system: &Equated<'_, E>) {
        self.end_step(system);
    }

    fn decisive_state(&self) -> usize {
        self.decisive_state()
    }
}
