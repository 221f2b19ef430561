//! The integration of a system over an interval of time, in steps of [`rosenbrock`](super::rosenbrock) with error
//! control, and the memory from one interval to the next.

use std::cell::Cell;

use fmu_export::Error;
use fmu_export::persistence::{Archive, Persistent};

use super::Trial;
use super::rosenbrock::{Begin, Linearization};
use super::step_size::{StepSize, largest_error, relative_error};
use crate::elementary::power;

/// The shortest step in s; the integration fails if it is rejected.
const SMALLEST_STEP: f64 = 1e-9;
/// The difference in time for numerical derivatives, relative to the step.
pub(super) const TIME_DIFFERENCE: f64 = 1e-3;
/// The linearization is discarded after an input jump that changes the slopes by more than this many tolerances over
/// the proposed step.
const JUMP_RENEWS: f64 = 100.0;
/// The first step after a jump is shortened by a power of the ratio to this many tolerances: a long step would damp the
/// fast modes excited by the jump without showing in its error estimate.
#[derive(Clone, Copy, Debug)]
pub struct JumpLaw {
    /// The smallest change, in tolerances, that shortens the step.
    pub tolerances: f64,
    /// The exponent of the ratio.
    pub exponent: f64,
}

/// The error control of a system.
#[derive(Clone, Copy, Debug)]
pub struct Rules<const N: usize> {
    /// The states' names.
    pub names: [&'static str; N],
    /// The full scale of each state, for the error of a step.
    pub error_scales: [f64; N],
    /// The magnitude of each state, for the differences of linearizations.
    pub magnitudes: [f64; N],
    /// The lower limit of each state. A step below it is rejected.
    pub least: [f64; N],
    /// The share of the tolerance for the error of a single step.
    pub share: f64,
    /// How the first step after a jump of the inputs is shortened.
    pub jump: JumpLaw,
    /// The longest step in s.
    pub longest_step: f64,
    /// The most steps with the same linearization.
    pub linearization_serves: u32,
}

/// A failed integration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntegrationFailure {
    /// The time reached in s.
    pub time: f64,
    /// The name of the state whose error is too large.
    pub state: &'static str,
}

/// The remaining number of trial steps, which bounds the time of an integration.
#[derive(Debug)]
pub struct Budget(Cell<f64>);

impl Budget {
    /// A budget of this many trials.
    pub fn new(trials: f64) -> Self {
        Self(Cell::new(trials))
    }

    /// Counts a trial, and returns whether it is allowed.
    fn spend(&self) -> bool {
        self.0.set(self.0.get() - 1.0);
        self.0.get() > 0.0
    }
}

/// An interval of time.
#[derive(Clone, Copy, Debug)]
pub struct Interval<'a> {
    /// In s.
    pub from: f64,
    /// In s.
    pub to: f64,
    /// The allowed error of the states, relative to their full scales.
    pub tolerance: f64,
    /// For this interval and those after it.
    pub budget: &'a Budget,
}

impl Interval<'_> {
    /// Whether the integration stops after a step that was accepted or rejected.
    fn is_given_up(&self, steps: &StepSize, taken: bool) -> bool {
        !self.budget.spend() || !taken && steps.next < SMALLEST_STEP
    }
}

/// The memory of a system from one interval to the next, which only saves work.
#[derive(Clone, Copy, Debug)]
pub struct StepMemory<const STATES: usize, const INPUTS: usize> {
    /// The length of the next step in s.
    pub step: f64,
    /// The linear equations of the steps.
    pub linearization: Linearization<STATES>,
    /// The derivatives at the end of the last interval, …
    slopes: [f64; STATES],
    /// … and their inputs; NaN if there are none.
    inputs: [f64; INPUTS],
}

impl<const STATES: usize, const INPUTS: usize> Persistent for StepMemory<STATES, INPUTS> {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let Self { step, linearization, slopes, inputs } = self;
        step.persist(archive)?;
        linearization.persist(archive)?;
        slopes.persist(archive)?;
        inputs.persist(archive)
    }
}

impl<const STATES: usize, const INPUTS: usize> StepMemory<STATES, INPUTS> {
    /// An empty memory, with the length of the first step in s.
    pub fn new(first_step: f64) -> Self {
        Self {
            step: first_step,
            linearization: Linearization::default(),
            slopes: [0.0; STATES],
            inputs: [f64::NAN; INPUTS],
        }
    }

    /// The derivatives at the end of the last interval, if they belong to these inputs.
    pub fn slopes(&self, inputs: &[f64; INPUTS]) -> Option<[f64; STATES]> {
        let is_same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits();
        self.inputs.iter().zip(inputs).all(is_same).then_some(self.slopes)
    }

    /// Adapts to a jump of the slopes since the last interval.
    pub fn adapt_to_jump(&mut self, course: &mut Course<'_, STATES>) {
        if self.inputs[0].is_nan() {
            return;
        }
        let (length, _) = course.next();
        let jump = std::array::from_fn(|i| length * (course.slopes[i] - self.slopes[i]));
        let jump = relative_error(&course.states, &jump, &course.weights);
        if jump > JUMP_RENEWS {
            self.linearization.discard();
        }
        let law = course.rules.jump;
        if jump > law.tolerances {
            course.steps.next = length * power(law.tolerances / jump, law.exponent);
        }
    }

    /// Remembers the end of an interval.
    pub fn end(&mut self, course: &Course<'_, STATES>, inputs: [f64; INPUTS]) {
        (self.step, self.slopes, self.inputs) = (course.steps.next, course.slopes, inputs);
    }
}

/// The integration of a system within an interval.
#[derive(Debug)]
pub struct Course<'a, const N: usize> {
    pub interval: Interval<'a>,
    rules: &'a Rules<N>,
    /// The reciprocals of the tolerances.
    weights: [f64; N],
    /// The step size control.
    pub steps: StepSize,
    /// The time reached.
    pub time: f64,
    /// The states at this time.
    pub states: [f64; N],
    /// Their derivatives.
    pub slopes: [f64; N],
}

impl<'a, const N: usize> Course<'a, N> {
    /// A course that starts at states with their derivatives.
    pub fn new(
        interval: Interval<'a>,
        first_step: f64,
        rules: &'a Rules<N>,
        (states, slopes): ([f64; N], [f64; N]),
    ) -> Self {
        Self {
            interval,
            rules,
            weights: rules.error_scales.map(|scale| (scale * interval.tolerance * rules.share).recip()),
            steps: StepSize::new(first_step, rules.longest_step),
            time: interval.from,
            states,
            slopes,
        }
    }

    /// The length of the next step in s, and the time at which it ends.
    pub fn next(&self) -> (f64, f64) {
        let left = self.interval.to - self.time;
        let length = self.steps.within(left);
        (length, if length >= left { self.interval.to } else { self.time + length })
    }

    /// The start of the next step.
    pub fn begin<'b>(&'b self, drift: &'b [f64; N]) -> Begin<'b, N> {
        Begin { time: self.time, states: &self.states, slopes: &self.slopes, drift }
    }

    /// The partial derivatives with respect to time at the start of a step of a length.
    pub fn drift(
        &self,
        derivatives: impl FnOnce(f64, &[f64; N]) -> [f64; N],
        length: f64,
        is_constant: bool,
    ) -> [f64; N] {
        if is_constant {
            return [0.0; N];
        }
        let difference = TIME_DIFFERENCE * length;
        let later = derivatives(self.time + difference, &self.states);
        std::array::from_fn(|i| (later[i] - self.slopes[i]) / difference)
    }

    /// Accepts or rejects a step. Without a trial, its linear equations had no solution.
    pub fn settle(
        &mut self,
        trial: Option<Trial<N>>,
        length: f64,
        end: f64,
    ) -> Result<bool, IntegrationFailure> {
        let (states, mut errors) =
            trial.map_or((self.states, [f64::INFINITY; N]), |trial| (trial.states, trial.error));
        for ((error, state), least) in errors.iter_mut().zip(&states).zip(&self.rules.least) {
            if state < least {
                *error = f64::INFINITY;
            }
        }
        let error = relative_error(&states, &errors, &self.weights);
        let taken = self.steps.judge(length, error);
        if self.interval.is_given_up(&self.steps, taken) {
            let state = self.rules.names[largest_error(&states, &errors, &self.weights)];
            return Err(IntegrationFailure { time: self.time, state });
        }
        if let Some(trial) = trial
            && taken
        {
            (self.time, self.states, self.slopes) = (end, trial.states, trial.slopes);
        }
        Ok(taken)
    }
}
