//! What integrates the states of a model in co-simulation: all with the same steps, or its two parts each with their own.

use core::fmt;

use super::equated::Equated;
use crate::equations::{Equations, Multirate};
use crate::integrator::{Integrator, StepFailure, Tolerance, Trials, TwoRates};
use crate::persistence::Persistent;
use crate::variables::Variables as _;

/// An integrator of the model `E`.
pub trait Integrate<E: Equations>: Clone + fmt::Debug + Persistent + Send + Sync + 'static {
    /// Whether [`Integrate::states_at`] gives states within a step, where events are searched.
    const FINDS_EVENTS: bool;
    /// An integrator of the model's states.
    fn new() -> Self;
    /// Prepares for a jump.
    fn restart(&mut self);
    /// Has the Jacobian renewed before the next step.
    fn discard_jacobian(&mut self);
    /// Takes a step from `states` between two times in s, shortened until its error meets the tolerance. Returns the time
    /// at which it ends.
    ///
    /// # Errors
    /// When even the shortest step misses the tolerance.
    fn step(
        &mut self,
        system: &mut Equated<'_, E>,
        times: (f64, f64),
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

    fn new() -> Self {
        Self::new(E::Variables::STATE_NOMINALS.len())
    }

    fn restart(&mut self) {
        self.restart();
    }

    fn discard_jacobian(&mut self) {
        self.discard_jacobian();
    }

    fn step(
        &mut self,
        system: &mut Equated<'_, E>,
        times: (f64, f64),
        states: &[f64],
        tolerance: &Tolerance<'_>,
        trials: Trials<'_>,
    ) -> Result<f64, StepFailure> {
        self.step(system, times, states, tolerance, trials.count)
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

    fn new() -> Self {
        Self::new::<Equated<'_, E>>(E::Variables::STATE_NOMINALS.len())
    }

    fn restart(&mut self) {
        self.restart();
    }

    fn discard_jacobian(&mut self) {
        self.discard_jacobian();
    }

    fn step(
        &mut self,
        system: &mut Equated<'_, E>,
        times: (f64, f64),
        states: &[f64],
        tolerance: &Tolerance<'_>,
        trials: Trials<'_>,
    ) -> Result<f64, StepFailure> {
        self.step(system, times, states, tolerance, trials)
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
