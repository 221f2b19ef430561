//! Models of equations as an importer sees them. In co-simulation the built-in integrator steps from event to event and
//! handles the events; in Model Exchange the importer does. Dual numbers give derivatives.

mod derivatives;
mod equated;
mod events;
mod evolution;
mod integrate;

use core::{fmt, mem};

use fmu_solve::integrator::Integrator;
use fmu_solve::{Dual, Error, Event, Events, Recorded, Stop, Stops, Tape};

use self::equated::{Equated, Place};
pub use self::integrate::Integrate;

use crate::kinds::audit::first_discrete_difference;
use crate::kinds::equations::{Equations, calculate_parameters, evaluate_values};
use crate::kinds::input_signal::InputSignal;
use crate::kinds::{Fmu, InputsOf, Model, Serves, Step, assert_double_precision};
use crate::model::context::Context;
use crate::model::description::{Causality, DataType};
use crate::model::inputs::Inputs as _;
use crate::model::variables::{Accessed, Described as _, Numbered};

/// From where a communication step can be integrated again, and where a failed one is left: its start, or the last event
/// in it.
#[derive(Debug, Default)]
struct Origin {
    /// Whether there is a step in progress.
    is_used: bool,
    /// The start of the step, the time since then, and the time as events and equations see it, all in s.
    start: f64,
    elapsed: f64,
    time: f64,
    states: Vec<f64>,
}

impl Origin {
    fn set(&mut self, start: f64, (elapsed, time): (f64, f64), states: &[f64]) {
        (self.is_used, self.start, self.elapsed, self.time) = (true, start, elapsed, time);
        self.states.clear();
        self.states.extend_from_slice(states);
    }
}

/// A model of equations as a [`Model`], with the built-in integrator for co-simulation.
///
/// The integrator controls the error per step: that of each state, relative to the state and its `nominal` (default
/// 1), is at most the tolerance of the importer, else of the JSON, else [`DEFAULT_TOLERANCE`](crate::DEFAULT_TOLERANCE).
#[derive(Debug)]
pub struct Integrated<E: Equations, I = Integrator> {
    /// The model of equations.
    pub equations: E,
    integrator: I,
    /// The present time in s.
    time: f64,
    /// The time since the step's start, over which states are integrated: late in an experiment, rounding of the
    /// absolute time may exceed the step.
    elapsed: f64,
    /// The time in s between two points that are searched for events, where indicators change faster than states.
    look: f64,
    events: Events,
    /// The step in progress, which does not belong to a clone.
    origin: Origin,
    /// Memory for the states as an array, which does not belong to a clone.
    states: Vec<f64>,
    /// The number of events after which tests have checked the evaluation.
    audited: u32,
    /// The time in s and the inputs of the last evaluation, if the variables are still its results.
    evaluated: Option<(f64, <E::Variables as Accessed>::Inputs)>,
}

impl<E: Equations, I: Integrate<E>> Clone for Integrated<E, I> {
    fn clone(&self) -> Self {
        Self {
            equations: self.equations.clone(),
            integrator: self.integrator.clone(),
            events: self.events.clone(),
            origin: Origin::default(),
            states: vec![],
            evaluated: self.evaluated.clone(),
            ..*self
        }
    }

    fn clone_from(&mut self, source: &Self) {
        let Self {
            equations,
            integrator,
            time,
            elapsed,
            look,
            events,
            origin: _,
            states: _,
            audited: _,
            evaluated,
        } = self;
        equations.clone_from(&source.equations);
        integrator.clone_from(&source.integrator);
        (*time, *elapsed, *look) = (source.time, source.elapsed, source.look);
        events.clone_from(&source.events);
        evaluated.clone_from(&source.evaluated);
    }
}

impl<E: Equations, I: Integrate<E>> Default for Integrated<E, I> {
    fn default() -> Self {
        const {
            assert!(
                E::Variables::CLOCKS.is_empty(),
                "a model of `Equations` has no variables of the type Clock, because its integrator finds the events, \
                 not the importer: `next_event` says when its samples are due, and `event` computes them"
            );
        }
        const {
            assert!(
                I::FINDS_EVENTS || E::Variables::EVENT_INDICATORS.is_empty(),
                "a model integrated by `TwoRates` has time events, but no event indicators"
            );
        }
        Self {
            equations: E::default(),
            integrator: I::new(),
            time: 0.0,
            elapsed: 0.0,
            look: f64::INFINITY,
            events: Events::new(E::Variables::EVENT_INDICATORS.len()),
            origin: Origin::default(),
            states: vec![],
            audited: 0,
            evaluated: None,
        }
    }
}

impl<E: Equations, I: Integrate<E>> Fmu for Integrated<E, I> {
    type Model = Self;
}

/// Saves what does not belong to a step in progress.
impl<E: Equations, I: Integrate<E>> crate::Persistent for Integrated<E, I> {
    fn persist(&mut self, archive: &mut fmu_solve::persistence::Archive<'_>) -> Result<(), Error> {
        self.equations.persist(archive)?;
        self.integrator.persist(archive)?;
        self.time.persist(archive)?;
        self.look.persist(archive)?;
        self.events.persist(archive)
    }
}

impl<E: Equations, I: Integrate<E>> Model for Integrated<E, I> {
    type Variables = E::Variables;
    const SERVES: Serves = Serves { scheduled_execution: false, ..Serves::ALL };
    const LONGEST_STEP: f64 = E::LONGEST_STEP;
    const LOOKS_AHEAD: bool = I::LOOKS_AHEAD;

    fn check_parameters(variables: &Self::Variables) -> Result<(), Error> {
        const { assert_double_precision::<E::Variables>() };
        E::check_parameters(variables)
    }

    fn initialize(
        &mut self,
        variables: &mut Self::Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let mut marked = variables.clone();
        marked.mark_calculated(true);
        let has_discrete = first_discrete_difference(variables, &marked).is_some();
        self.start(variables, context)?;
        if has_discrete {
            // Once more, from other values: what nothing sets differs.
            let mut silence = |_: &'static str, _: fmt::Arguments<'_>| {};
            let mut context = context.with_log(&mut silence);
            Self::default().start(&mut marked, &mut context)?;
            if let Some(variable) = first_discrete_difference(variables, &marked) {
                return Err(Error::new(format!(
                    "nothing sets {} at the start: do so in `prepare`, `evaluate` or the initial event, or give it a \
                     \"start\" with \"initial\": \"exact\" in the JSON",
                    variable.name()
                )));
            }
        }
        Ok(())
    }

    fn step(
        &mut self,
        variables: &mut Self::Variables,
        step: &Step<'_, InputsOf<Self>>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        self.advance::<false>(variables, step, Stops::NONE, context).map(|_| ())
    }

    fn refresh(&mut self, time: f64, variables: &mut Self::Variables) {
        self.evaluated = None;
        evaluate_values(&self.equations, time, variables);
    }

    fn calculate_parameters(
        &self,
        parameters: &<Self::Variables as Numbered>::Parameters<f64>,
        calculated: &mut <Self::Variables as Numbered>::CalculatedParameters<f64>,
    ) {
        self.equations.calculate_parameters(parameters, calculated);
    }

    fn take_parameters(&mut self, variables: &Self::Variables) {
        self.restored(variables);
        self.integrator.discard();
    }

    fn restored(&mut self, variables: &Self::Variables) {
        self.evaluated = None;
        self.equations.take_parameters(variables);
    }

    fn differentiate(
        &self,
        time: Dual,
        variables: &Self::Variables,
        direction: &Self::Variables,
    ) -> Result<Self::Variables, Error> {
        Ok(self.derivatives(time, variables, direction, |_| {}))
    }

    fn differentiate_initialization(
        &self,
        start_time: Dual,
        variables: &Self::Variables,
        direction: &Self::Variables,
    ) -> Result<Self::Variables, Error> {
        self.equations.check_start()?;
        let mut started = variables.clone();
        started.states_from_start();
        Ok(self.derivatives(start_time, &started, direction, |variables| {
            self.equations.initialize::<Dual>(variables);
        }))
    }

    fn differentiate_backwards(
        &self,
        time: f64,
        variables: &Self::Variables,
        weights: &Self::Variables,
        by_parameters: bool,
        tape: &mut Tape,
    ) -> Result<Self::Variables, Error> {
        // The knowns; the rest is constant.
        let mut known = E::Variables::zero();
        if by_parameters {
            for (reference, variable) in E::Variables::described() {
                if variable.causality == Causality::Parameter && variable.data_type == DataType::Real {
                    known.set_real(reference, 1.0);
                }
            }
        }
        known.inputs_mut().set_reals(|_| 1.0);
        E::Variables::set_states(&mut known, |_| 1.0);
        Ok(self.derivatives_backwards(time, variables, &known, weights, tape, |_| {}))
    }

    fn differentiate_initialization_backwards(
        &self,
        start_time: f64,
        variables: &Self::Variables,
        weights: &Self::Variables,
        tape: &mut Tape,
    ) -> Result<Self::Variables, Error> {
        self.equations.check_start()?;
        let mut started = variables.clone();
        started.states_from_start();
        let known = started.combined(&started, |_, _| 1.0);
        let mut derivatives =
            self.derivatives_backwards(start_time, &started, &known, weights, tape, |variables| {
                self.equations.initialize::<Recorded<'_>>(variables);
            });
        // A start value acts directly and through its state.
        let mut by_state = vec![0.0; E::Variables::STATE_NOMINALS.len()];
        E::Variables::each_state(&derivatives, |state, derivative: f64| by_state[state] = derivative);
        derivatives.states_from_start();
        E::Variables::each_state(&derivatives, |state, derivative: f64| by_state[state] += derivative);
        E::Variables::set_states(&mut derivatives, |state| by_state[state]);
        Ok(derivatives)
    }

    fn event_indicators(&self, time: f64, variables: &Self::Variables, indicators: &mut [f64]) {
        self.equations.event_indicators(time, variables, indicators);
    }

    fn next_event(&self, time: f64, variables: &Self::Variables) -> Option<f64> {
        self.equations.next_event(time, variables)
    }

    fn event(
        &mut self,
        event: &Event<'_>,
        variables: &mut Self::Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        self.evaluated = None;
        self.equations.event(event, variables, context)?;
        self.evaluate_after_event(event.time, variables)
    }

    fn step_to_event(
        &mut self,
        variables: &mut Self::Variables,
        step: &Step<'_, InputsOf<Self>>,
        mut events: Option<&mut Events>,
        stops: Stops,
        context: &mut Context<'_>,
    ) -> Result<Option<Stop>, Error> {
        if let Some(events) = &mut events {
            mem::swap(&mut self.events, events);
        }
        let result = self.advance::<true>(variables, step, stops, context);
        if let Some(events) = events {
            mem::swap(&mut self.events, events);
        }
        result
    }

    fn enter_step_mode(&mut self) {
        self.integrator.restart();
    }

    #[cold]
    fn leave_step(&mut self, variables: &mut Self::Variables, inputs: &InputSignal<InputsOf<Self>>) {
        if !mem::take(&mut self.origin.is_used) {
            return;
        }
        let Self { equations, origin: Origin { start, elapsed, time, states, .. }, .. } = self;
        let step = Step::new(*start, *elapsed, inputs);
        Equated::new(equations, variables, &step, &mut { Place::NONE })
            .evaluate(*elapsed, *time, |state| states[state]);
        inputs.restart(variables.inputs_mut());
    }
}

impl<E: Equations, I: Integrate<E>> Integrated<E, I> {
    fn take_states(&mut self) -> Vec<f64> {
        let mut states = mem::take(&mut self.states);
        states.resize(E::Variables::STATE_NOMINALS.len(), 0.0);
        states
    }

    /// Computes everything at the start time.
    fn start(&mut self, variables: &mut E::Variables, context: &mut Context<'_>) -> Result<(), Error> {
        self.clone_from(&Self { time: context.experiment.start_time, ..Self::default() });
        // `prepare` does not see what an earlier initialization calculated.
        variables.mark_calculated_parameters(false);
        self.equations.prepare(variables, context)?;
        calculate_parameters::<E, f64>(&self.equations, variables);
        self.equations.take_parameters(variables);
        variables.states_from_start();
        self.equations.initialize::<f64>(variables);
        self.check_calculated_parameters(variables)?;
        self.check_evaluation(variables)?;
        evaluate_values(&self.equations, self.time, variables);
        let Self { equations, events, time, .. } = self;
        events.begin(*time, E::Variables::EVENT_INDICATORS, |indicators| {
            equations.event_indicators(*time, variables, indicators);
        })?;
        self.happen(variables, true, None, context)
    }
}
