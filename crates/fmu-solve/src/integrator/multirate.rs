//! Integration of a system in two parts, each with its own steps.
//!
//! The fast part does not depend on the slow one and leads in small steps. The slow part follows in large ones, with cubic
//! interpolation between the fast steps.
//!
//! Both use [`ROS34PW2`](super::ROS34PW2) with a Jacobian from difference quotients that serves many steps; steps of about
//! the same length share the inverse of their matrix. The compiler knows the number of states, so a step costs little more
//! than its evaluations.

mod course;
mod differences;
mod fast_step;
mod parts;

use core::array;

use super::system::{StepFailure, Tolerance, TwoParts};
use super::{Integrator, Trials};
use crate::error::Error;
use crate::persistence::{Archive, Persistent};

use course::{Course, STAGES};
use fast_step::{FastStep, Stages};
use parts::{MOST_AHEAD, Parts, split};

/// Integrates the first states, `FAST` in number, ahead of the other ones, `SLOW` in number.
#[derive(Clone, Debug)]
pub struct TwoRates<const FAST: usize, const SLOW: usize> {
    fast: Course<FAST>,
    slow: Course<SLOW>,
    /// The derivatives of the slow slopes with respect to each fast state, as old as the slow Jacobian.
    coupling: [[f64; SLOW]; FAST],
    /// Whether the slow slopes may depend on each fast state.
    drives: [bool; FAST],
    /// The fast part's steps that the slow part still needs; none between steps.
    ahead: Vec<FastStep<FAST>>,
    /// The stages of the fast part's last trial.
    stages: Stages<FAST>,
    /// The integrator of all states, for coupled parts.
    together: Integrator,
    /// The position of the state with which the last step failed.
    decisive: usize,
}

impl<const FAST: usize, const SLOW: usize> Persistent for TwoRates<FAST, SLOW> {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let Self { fast, slow, coupling, drives: _, ahead: _, stages: _, together, decisive: _ } = self;
        fast.persist(archive)?;
        slow.persist(archive)?;
        coupling.persist(archive)?;
        together.persist(archive)
    }
}

impl<const FAST: usize, const SLOW: usize> TwoRates<FAST, SLOW> {
    /// The integrator of a system with this many states.
    ///
    /// # Panics
    /// When both parts together have another number of states.
    #[must_use]
    pub fn new<S: TwoParts>(size: usize) -> Self {
        assert_eq!(size, FAST + SLOW, "the numbers of states of `TwoRates`");
        Self {
            fast: Course::new(S::range),
            slow: Course::new(|state| S::range(FAST + state)),
            coupling: [[0.0; SLOW]; FAST],
            drives: array::from_fn(|state| S::drives(state, FAST..FAST + SLOW)),
            ahead: vec![],
            stages: [[[0.0; FAST]; 2]; STAGES - 1],
            together: Integrator::new(size),
            decisive: 0,
        }
    }

    /// Jumps are noticed by the derivatives.
    pub fn restart(&mut self) {
        self.together.restart();
    }

    /// Has the Jacobians renewed before the next step.
    pub fn discard_jacobian(&mut self) {
        (self.fast.serves, self.slow.serves) = (0, 0);
        self.together.discard();
    }

    /// Takes all steps to the end, and returns it.
    ///
    /// # Errors
    /// When even the shortest step misses the tolerance.
    pub fn step<S: TwoParts>(
        &mut self,
        system: &mut S,
        (time, end): (f64, f64),
        states: &[f64],
        tolerance: &Tolerance<'_>,
        trials: Trials<'_>,
    ) -> Result<f64, StepFailure> {
        if system.is_coupled() {
            let reached = self.together.step(system, (time, end), states, tolerance, trials.count);
            self.decisive = self.together.decisive_state();
            return reached;
        }
        let Self { fast, slow, coupling, drives, ahead, stages, .. } = self;
        ahead.clear();
        let (mut fast_slopes, mut slow_slopes) = ([0.0; FAST], [0.0; SLOW]);
        system.present_derivatives(split(&mut fast_slopes, &mut slow_slopes));
        let scale = |state: usize| tolerance.scale::<S>(state, states[state]);
        let (fast_states, slow_states) =
            (array::from_fn(|i| states[i]), array::from_fn(|i| states[FAST + i]));
        fast.begin::<S>((time, end), fast_states, fast_slopes, scale);
        slow.begin::<S>((time, end), slow_states, slow_slopes, |i| scale(FAST + i));
        ahead.reserve(MOST_AHEAD);
        let mut parts = Parts { system, fast, drives, ahead, stages, end, trials };
        while slow.time < end {
            if let Err(failure) = parts.step_slow(slow, coupling) {
                self.decisive = failure.state;
                return Err(failure);
            }
        }
        Ok(end)
    }

    /// The states at the end of the last step, or, where the parts are coupled, within it.
    pub fn states_at<S: TwoParts>(&mut self, system: &mut S, time: f64, states: &mut [f64]) {
        if system.is_coupled() {
            self.together.states_at(system, time, states);
        } else {
            states[..FAST].copy_from_slice(&self.fast.states);
            states[FAST..].copy_from_slice(&self.slow.states);
        }
    }

    /// Takes the derivatives at the end of the last step.
    pub fn end_step<S: TwoParts>(&mut self, system: &S) {
        system.present_derivatives(split(&mut self.fast.slopes, &mut self.slow.slopes));
    }

    /// The position of the state whose error determined the length of the last trial.
    #[must_use]
    pub fn decisive_state(&self) -> usize {
        self.decisive
    }
}
