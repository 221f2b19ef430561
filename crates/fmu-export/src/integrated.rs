//! Models of equations as an importer sees them. In co-simulation the built-in integrator steps from event to event and
//! handles the events; in Model Exchange the importer does. Dual numbers give derivatives.

mod equated;
mod integrate;

use core::{fmt, mem};

use fmu_solve::display::Seconds;
use fmu_solve::event_loop::{EventLoop, Hybrid, MOST_TRIALS_AN_EVENT};
use fmu_solve::integrator::{Integrator, Span, StepFailure, Tolerance, Trials};
use fmu_solve::search::{self, Trajectory};
use fmu_solve::{Dual, Error, Event, Events, MOST_ITERATIONS, Recorded, Stop, Stops, Tape, time};

use self::equated::{Equated, Place};
pub use self::integrate::Integrate;

use crate::audit::{check_calculated_parameters, check_evaluation, first_discrete_difference};
use crate::context::Context;
use crate::description::{Causality, DataType};
use crate::equations::{Equations, VariablesOf, calculate_parameters, duals, evaluate, evaluate_values};
use crate::inputs::{InputSignal, Inputs as _};
use crate::model::{Fmu, InputsOf, Model, Serves, Step};
use crate::panics;
use crate::variables::Variables;

/// The most trials and events in a hundredth of a communication step, which must end …
const MOST_TRIALS: u32 = 100_000;
/// … and how many more for each time as long as the longest internal step.
const TRIALS_A_LONGEST_STEP: f64 = 50.0;
/// The most events after which tests evaluate twice: later ones, as of a fast clock, repeat the branches.
const MOST_AUDITED: u32 = 1000;
/// The most communication steps that an internal step goes beyond its end: more would save nothing.
const MOST_AHEAD: f64 = 1000.0;

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
    evaluated: Option<(f64, <E::Variables as Variables>::Inputs)>,
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
        E::check_parameters(variables)
    }

    fn initialize(
        &mut self,
        variables: &mut Self::Variables,
        inputs: &InputsOf<Self>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let mut marked = variables.clone();
        marked.mark_calculated(true);
        let has_discrete = first_discrete_difference(variables, &marked).is_some();
        with_inputs(variables, inputs, |variables| self.start(variables, context))?;
        if has_discrete {
            // Once more, from other values: what nothing sets differs.
            let mut silence = |_: &'static str, _: fmt::Arguments<'_>| {};
            let mut context = context.with_log(&mut silence);
            with_inputs(&mut marked, inputs, |marked| Self::default().start(marked, &mut context))?;
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
        with_inputs(variables, step.inputs.initial(), |variables| {
            self.advance::<false>(variables, step, Stops::NONE, context)
        })
        .map(|_| ())
    }

    fn refresh(&mut self, time: f64, variables: &mut Self::Variables, inputs: &InputsOf<Self>) {
        self.evaluated = None;
        with_inputs(variables, inputs, |variables| evaluate_values(&self.equations, time, variables));
    }

    fn calculate_parameters(
        &self,
        parameters: &<Self::Variables as Variables>::Parameters<f64>,
        calculated: &mut <Self::Variables as Variables>::CalculatedParameters<f64>,
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
        inputs: &InputsOf<Self>,
        direction: &Self::Variables,
    ) -> Result<Self::Variables, Error> {
        Ok(self.derivatives(time, variables, inputs, direction, |_| {}))
    }

    fn differentiate_initialization(
        &self,
        start_time: Dual,
        variables: &Self::Variables,
        inputs: &InputsOf<Self>,
        direction: &Self::Variables,
    ) -> Result<Self::Variables, Error> {
        self.equations.check_start()?;
        let mut started = variables.clone();
        started.states_from_start();
        Ok(self.derivatives(start_time, &started, inputs, direction, |variables| {
            self.equations.initialize::<Dual>(variables);
        }))
    }

    fn differentiate_backwards(
        &self,
        time: f64,
        variables: &Self::Variables,
        inputs: &InputsOf<Self>,
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
        Ok(self.derivatives_backwards(time, variables, inputs, &known, weights, tape, |_| {}))
    }

    fn differentiate_initialization_backwards(
        &self,
        start_time: f64,
        variables: &Self::Variables,
        inputs: &InputsOf<Self>,
        weights: &Self::Variables,
        tape: &mut Tape,
    ) -> Result<Self::Variables, Error> {
        self.equations.check_start()?;
        let mut started = variables.clone();
        started.states_from_start();
        let known = started.combined(&started, |_, _| 1.0);
        let mut derivatives =
            self.derivatives_backwards(start_time, &started, inputs, &known, weights, tape, |variables| {
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

    fn event_indicators(
        &self,
        time: f64,
        variables: &mut Self::Variables,
        inputs: &InputsOf<Self>,
        indicators: &mut [f64],
    ) {
        with_inputs(variables, inputs, |variables| {
            self.equations.event_indicators(time, variables, indicators);
        });
    }

    fn next_event(&self, time: f64, variables: &mut Self::Variables, inputs: &InputsOf<Self>) -> Option<f64> {
        with_inputs(variables, inputs, |variables| self.equations.next_event(time, variables))
    }

    fn event(
        &mut self,
        event: &Event<'_>,
        variables: &mut Self::Variables,
        inputs: &InputsOf<Self>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        self.evaluated = None;
        with_inputs(variables, inputs, |variables| {
            self.equations.event(event, variables, context)?;
            self.evaluate_after_event(event.time, variables)
        })
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
        let result = with_inputs(variables, step.inputs.initial(), |variables| {
            self.advance::<true>(variables, step, stops, context)
        });
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
        inputs.copy_set(variables.inputs_mut());
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

    /// The derivatives of the calculated variables along a direction, with states already initialized.
    fn derivatives(
        &self,
        time: Dual,
        variables: &E::Variables,
        inputs: &InputsOf<Self>,
        direction: &E::Variables,
        initialize: impl FnOnce(&mut VariablesOf<E, Dual>),
    ) -> E::Variables {
        let (mut variables, mut direction) = (variables.clone(), direction.clone());
        variables.inputs_mut().clone_from(inputs);
        direction.states_from_start();
        let mut duals = duals(&variables, &direction, &Dual::new);
        calculate_parameters::<E, Dual>(&self.equations, &mut duals);
        initialize(&mut duals);
        evaluate(&self.equations, time, &mut duals);
        E::Variables::collected(&duals, &direction, |dual: Dual, _| dual.derivative)
    }

    /// The derivatives of a weighted sum of calculated variables with respect to the knowns, with states already
    /// initialized.
    #[allow(clippy::too_many_arguments, reason = "those of its callers")]
    fn derivatives_backwards<'t>(
        &self,
        time: f64,
        variables: &E::Variables,
        inputs: &InputsOf<Self>,
        known: &E::Variables,
        weights: &E::Variables,
        tape: &'t mut Tape,
        initialize: impl FnOnce(&mut VariablesOf<E, Recorded<'t>>),
    ) -> E::Variables {
        tape.clear();
        let tape = &*tape;
        let mut variables = variables.clone();
        variables.inputs_mut().clone_from(inputs);
        let is_known = |known: f64| known != 0.0;
        let mut recorded = variables.combined(known, |value, known| {
            if is_known(known) { tape.variable(value) } else { Recorded::from(value) }
        });
        calculate_parameters::<E, Recorded<'_>>(&self.equations, &mut recorded);
        initialize(&mut recorded);
        evaluate(&self.equations, Recorded::from(time), &mut recorded);
        let _ = E::Variables::collected(&recorded, weights, |number: Recorded<'_>, weight| {
            tape.weigh(number, weight);
            0.0
        });
        tape.go_back();
        let mut derivatives = tape.derivatives_in_order();
        variables
            .combined(known, |_, known| if is_known(known) { derivatives.next().unwrap_or(0.0) } else { 0.0 })
    }

    /// Advances through a communication step, or to an earlier stop.
    fn advance<const STOPS: bool>(
        &mut self,
        variables: &mut E::Variables,
        step: &Step<'_, InputsOf<Self>>,
        stops: Stops,
        context: &mut Context<'_>,
    ) -> Result<Option<Stop>, Error> {
        // Where the importer's number for the time reached is off by rounding, indicators must not go back.
        if self.time.to_bits() != step.start.to_bits() && !time::goes_on(self.time, step.start, step.size) {
            self.time = step.start;
        }
        let begin = self.time;
        self.elapsed = 0.0;
        let end = step.instant_of_end();
        let tolerance = (E::INTEGRATION.tolerance)(variables, context.experiment.tolerance);
        let mut states = self.take_states();
        let evaluated = self.evaluated.take();
        let mut is_evaluated = evaluated
            .as_ref()
            .is_some_and(|(time, inputs)| time.to_bits() == begin.to_bits() && inputs == variables.inputs());
        E::Variables::each_state(variables, |state, value: f64| {
            is_evaluated &= states[state].to_bits() == value.to_bits();
            states[state] = value;
        });
        // The importer may have changed inputs and tunable parameters since the last step.
        let asked = if is_evaluated {
            Ok(())
        } else {
            evaluate_values(&self.equations, begin, variables);
            self.ask_again(variables, end.rounding())
        };
        // Inputs with derivatives are those of a moment later.
        let place = Place { elapsed: if step.inputs.is_constant() { 0.0 } else { f64::NAN }, time: begin };
        self.origin.set(step.start, (0.0, begin), &states);
        let crossed = asked.and_then(|()| self.find_changes(variables));
        // Where inputs change at each step, a step beyond its end would be in vain.
        let looks_ahead = I::LOOKS_AHEAD && step.inputs.is_kept();
        if !looks_ahead {
            self.integrator.forget_ahead();
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let most_trials = MOST_TRIALS
            .saturating_add((step.size / E::INTEGRATION.longest_step * TRIALS_A_LONGEST_STEP) as u32);
        let event_loop =
            EventLoop::new((step.start, step.size, end), E::INTEGRATION.samples_inputs, most_trials);
        let mut evolution = Evolution {
            model: self,
            variables,
            step,
            tolerance,
            states: &mut states,
            context,
            begin,
            looks_ahead,
            place,
            last_cause: None,
        };
        let stop =
            crossed.and_then(|crossed| event_loop.after(crossed).go_on::<STOPS, _>(&mut evolution, stops));
        let is_over = evolution.context.end.is_some();
        self.states = states;
        if stop.is_err() {
            self.leave_step(variables, step.inputs);
        }
        self.origin.is_used = false;
        self.integrator.shift(self.elapsed);
        let stop = stop?;
        if stop.is_none() && !is_over {
            // Later by rounding if the last event was due there.
            self.time = if self.time > end.time { self.time } else { end.time };
            // Large inputs are copied into existing memory.
            let (_, mut inputs) = evaluated.unwrap_or_else(|| (self.time, variables.inputs().clone()));
            inputs.clone_from(variables.inputs());
            self.evaluated = Some((self.time, inputs));
        }
        Ok(stop)
    }

    fn check_calculated_parameters(&self, variables: &E::Variables) -> Result<(), Error> {
        check_calculated_parameters(variables, |variables| {
            calculate_parameters::<E, f64>(&self.equations, variables);
        })
    }

    fn check_evaluation(&self, variables: &E::Variables) -> Result<(), Error> {
        check_evaluation(variables, &|variables| evaluate(&self.equations, self.time, variables))?;
        check_evaluation(variables, &|variables| evaluate_values(&self.equations, self.time, variables))
    }

    /// Evaluates after an event, whose branch may omit a variable.
    fn evaluate_after_event(&self, time: f64, variables: &mut E::Variables) -> Result<(), Error> {
        variables.forget_continuous();
        evaluate_values(&self.equations, time, variables);
        if variables.has_finite_results() { Ok(()) } else { self.check_branch(time, variables) }
    }

    /// What the branch of an event omits, if it does: a variable may be infinite, or not a number, for another reason.
    #[cold]
    fn check_branch(&self, time: f64, variables: &E::Variables) -> Result<(), Error> {
        check_evaluation(variables, &|variables| evaluate_values(&self.equations, time, variables))
            .map_err(|omitted| Error::new(format!("after the event at {} s, {omitted}", Seconds(time))))
    }

    /// Finds which indicators have changed since the last event. Returns whether any has.
    fn find_changes(&mut self, variables: &E::Variables) -> Result<bool, Error> {
        let Self { equations, events, time, .. } = self;
        events.find_changes(*time, E::Variables::EVENT_INDICATORS, |indicators| {
            equations.event_indicators(*time, variables, indicators);
        })
    }

    /// Asks when the next time event is due, which changed inputs and parameters may have moved, unless it is now,
    /// within a `rounding` (s).
    fn ask_again(&mut self, variables: &E::Variables, rounding: f64) -> Result<(), Error> {
        let now = self.events.time(self.time, rounding);
        if self.events.due(now, rounding).is_some() {
            return Ok(());
        }
        let next = self.equations.next_event(now, variables);
        self.events.move_next(next, now)
    }

    /// Handles an event now, and those that it causes at once; `due` is the time in s of a time event.
    fn happen(
        &mut self,
        variables: &mut E::Variables,
        is_initial: bool,
        due: Option<f64>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let time = due.unwrap_or(self.time);
        // What has been evaluated must not go back by rounding.
        self.time = self.time.max(time);
        context.at(time);
        let mut event = Event { time, is_initial, is_due: due.is_some(), indicators: &[] };
        for _ in 0..MOST_ITERATIONS {
            event.indicators = self.events.changed();
            self.equations.event(&event, variables, context)?;
            if cfg!(debug_assertions) && self.audited < MOST_AUDITED {
                // Tests of a model check each of its branches.
                self.audited += 1;
                self.check_calculated_parameters(variables)?;
                self.check_evaluation(variables)?;
            }
            self.evaluate_after_event(self.time, variables)?;
            self.events.accept();
            if !self.find_changes(variables)? {
                self.events.check_limits(self.time, E::Variables::EVENT_INDICATORS, E::Variables::LIMITS)?;
                self.integrator.restart();
                let next = self.equations.next_event(time, variables);
                return self.events.set_next(next, time, is_initial);
            }
            event = Event { time, is_initial: false, is_due: false, indicators: &[] };
        }
        Err(self.events.endless(self.time, E::Variables::EVENT_INDICATORS))
    }

    #[cold]
    fn not_integrable(&self, failure: StepFailure, tolerance: f64) -> Error {
        Error::new(format!(
            "the states cannot be integrated beyond {} s: the error of {} stays above the tolerance \
             {tolerance:?}, or its derivative is not finite",
            Seconds(self.time),
            E::Variables::state_name(failure.state)
        ))
    }
}

/// Computes with inputs clamped to their bounds.
fn with_inputs<V: Variables, R>(
    variables: &mut V,
    inputs: &V::Inputs,
    compute: impl FnOnce(&mut V) -> R,
) -> R {
    // As set, they are within their bounds: nothing to keep, so that large arrays are not copied to new memory.
    let set = (variables.inputs() != inputs).then(|| mem::replace(variables.inputs_mut(), inputs.clone()));
    let result = compute(variables);
    match set {
        Some(set) => *variables.inputs_mut() = set,
        None => variables.inputs_mut().clone_from(inputs),
    }
    result
}

/// A communication step of a model.
struct Evolution<'a, 'c, E: Equations, I> {
    model: &'a mut Integrated<E, I>,
    variables: &'a mut E::Variables,
    step: &'a Step<'a, <E::Variables as Variables>::Inputs>,
    tolerance: f64,
    states: &'a mut [f64],
    context: &'a mut Context<'c>,
    /// The time reached at the step's start (s).
    begin: f64,
    /// Whether the integrator may go beyond the step's end.
    looks_ahead: bool,
    /// Where the variables were evaluated last.
    place: Place,
    /// The first indicator that caused the last event.
    last_cause: Option<usize>,
}

#[allow(clippy::inline_always, reason = "as `EventLoop`")]
impl<E: Equations, I: Integrate<E>> Evolution<'_, '_, E, I> {
    /// Why steps may be short in vain.
    const OF_TIME: &'static str = if E::Variables::DEPENDS_ON_TIME {
        ""
    } else {
        "; or the equations depend on time, which no 'reads' in the JSON lists (`check_dependencies` finds this)"
    };

    /// What a step of the integrator to a target, in s since the start, may cover.
    #[inline(always)]
    fn span(&self, target: f64) -> Span {
        let mut span = Span::from((self.model.elapsed, target));
        if I::LOOKS_AHEAD && self.looks_ahead {
            let last = self.model.events.next.into_iter().chain(self.context.experiment.stop_time);
            let last = last.fold(f64::INFINITY, f64::min) - self.step.start;
            let last = last.min(target + MOST_AHEAD * self.step.size);
            // Times of events are rounded as absolute times are, which may be more than a step.
            let rounding = self.step.instant_of_end().rounding();
            span.rounding = if target < self.step.size { rounding } else { 0.0 };
            span.limit = if last > target + rounding { last } else { target };
        }
        span
    }

    /// The errors that a step of the integrator may make.
    #[inline(always)]
    fn limits(&self) -> Tolerance<'static> {
        let nominals = E::INTEGRATION.error_scales.unwrap_or(E::Variables::STATE_NOMINALS);
        Tolerance { relative: self.tolerance, nominals }
    }

    /// Goes to a place in a step that may go beyond it. Returns whether the equations there are what the step lets expect.
    fn agrees_at(&mut self, elapsed: f64) -> bool {
        let agrees = panics::attempt(|| {
            // The dense output may leave a strict bound that no stage has left.
            self.go_to(elapsed).is_ok() && self.variables.first_beyond().is_none() && {
                let limits = self.limits();
                let Self { model, variables, step, place, .. } = self;
                let system = Equated::new(&model.equations, variables, step, place);
                model.integrator.agrees(&system, elapsed, &limits)
            }
        });
        agrees.unwrap_or(false)
    }

    /// Goes back to where the integration of this communication step began, and from there not beyond its end: what lies
    /// between the last point and this one was missed.
    #[cold]
    fn go_back(&mut self) {
        let Self { model, states, .. } = self;
        model.integrator.forget_ahead();
        self.looks_ahead = false;
        let Origin { elapsed, states: origin, .. } = &model.origin;
        model.elapsed = *elapsed;
        states.copy_from_slice(origin);
    }
}

#[allow(clippy::inline_always, reason = "as `EventLoop`")]
impl<E: Equations, I: Integrate<E>> Hybrid for Evolution<'_, '_, E, I> {
    type Error = Error;

    #[inline(always)]
    fn next_event(&self) -> Option<f64> {
        self.model.events.next
    }

    #[inline(always)]
    fn last_event(&self) -> f64 {
        self.model.events.last()
    }

    #[inline(always)]
    fn time(&self) -> f64 {
        self.model.time
    }

    #[inline(always)]
    fn elapsed(&self) -> f64 {
        self.model.elapsed
    }

    #[inline(always)]
    fn integrate(&mut self, target: f64, trials: Trials<'_>) -> Result<bool, Error> {
        let Trials { count, most } = trials;
        loop {
            let span = self.span(target);
            let limits = self.limits();
            let Self { model, variables, step, states, place, .. } = self;
            let mut system = Equated::new(&model.equations, variables, step, place);
            let counted = Trials { count: &mut *count, most };
            let reached = match model.integrator.step(&mut system, span, states, &limits, counted) {
                Ok(reached) => reached,
                Err(failure) => {
                    model.time = step.start + failure.time;
                    return if *count <= most {
                        Err(model.not_integrable(failure, self.tolerance))
                    } else {
                        Ok(false)
                    };
                }
            };
            let crossed = if !E::Variables::EVENT_INDICATORS.is_empty() {
                let start = step.start;
                search::first_event(self, start, (span.begin, reached), count)?
            } else if !(I::LOOKS_AHEAD && self.looks_ahead) {
                self.go_to(reached)?
            } else if self.agrees_at(reached) {
                false
            } else {
                self.go_back();
                continue;
            };
            let Self { model, variables, step, place, .. } = self;
            model.integrator.end_step(&Equated::new(&model.equations, variables, step, place));
            return Ok(crossed);
        }
    }

    #[inline(always)]
    fn handle(&mut self, due: Option<f64>) -> Result<bool, Error> {
        let Self { model, variables, step, states, context, last_cause, place, .. } = self;
        *last_cause = model.events.first_changed();
        model.happen(variables, false, due, context)?;
        if context.end.is_some() {
            return Ok(false);
        }
        E::Variables::each_state(&**variables, |state, value| states[state] = value);
        model.origin.set(step.start, (model.elapsed, model.time), states);
        *place = Place { elapsed: model.elapsed, time: model.time };
        Ok(true)
    }

    #[cold]
    fn abandoned(&self, most_trials: u32, events: u32) -> Error {
        let Self { model, step, tolerance, last_cause, .. } = self;
        let cause = if events > most_trials / MOST_TRIALS_AN_EVENT {
            let what =
                last_cause.map_or("time events", |indicator| E::Variables::EVENT_INDICATORS[indicator]);
            format!("{events} of them are events, which come ever faster, the last caused by {what}")
        } else {
            let what = if E::Variables::STATE_NOMINALS.is_empty() {
                "an event indicator".to_owned()
            } else {
                E::Variables::state_name(model.integrator.decisive_state())
            };
            format!(
                "{what} changes too fast for a step this long, or for the tolerance {tolerance:?}{}",
                Self::OF_TIME
            )
        };
        Error::new(format!(
            "the step from {} s was abandoned at {} s after {most_trials} trials and events: {cause}",
            Seconds(step.start),
            Seconds(model.time)
        ))
    }
}

#[allow(clippy::inline_always, reason = "as `first_event`")]
impl<E: Equations, I: Integrate<E>> Trajectory for Evolution<'_, '_, E, I> {
    type Error = Error;

    #[inline(always)]
    fn events(&mut self) -> &mut Events {
        &mut self.model.events
    }

    #[inline(always)]
    fn look(&mut self) -> &mut f64 {
        &mut self.model.look
    }

    #[inline(always)]
    fn go_to(&mut self, elapsed: f64) -> Result<bool, Error> {
        let Self { model, variables, step, states, begin, place, .. } = self;
        model.elapsed = elapsed;
        let time = if elapsed < step.size { step.start + elapsed } else { step.end() };
        model.time = if time > *begin { time } else { *begin };
        let mut system = Equated::new(&model.equations, variables, step, place);
        model.integrator.states_at(&mut system, elapsed, states);
        system.evaluate(elapsed, model.time, |state| states[state]);
        model.find_changes(variables)
    }
}
