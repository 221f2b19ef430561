//! A communication step of a model of equations: the integrator and the events of the model in turn.

use fmu_solve::event_loop::{self, EventLoop, Hybrid, MOST_TRIALS, MOST_TRIALS_AN_EVENT};
use fmu_solve::integrator::{Span, Tolerance, Trials};
use fmu_solve::search::{self, Trajectory};
use fmu_solve::{Error, Events, Stop, Stops, time};

use super::equated::{Equated, Place};
use super::{Integrate, Integrated, Origin};
use crate::kinds::equations::{Equations, evaluate_values};
use crate::kinds::{InputsOf, Model as _, Step};
use crate::model::context::Context;
use crate::model::variables::{Accessed, Described as _, Numbered as _};
use crate::panics;

/// How many trials and events more a communication step may take for each time as long as the longest internal step.
const TRIALS_A_LONGEST_STEP: f64 = 50.0;
/// The most communication steps that an internal step goes beyond its end: more would save nothing.
const MOST_AHEAD: f64 = 1000.0;

impl<E: Equations, I: Integrate<E>> Integrated<E, I> {
    /// Advances through a communication step, or to an earlier stop.
    pub(super) fn advance<const STOPS: bool>(
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
}

/// A communication step of a model.
struct Evolution<'a, 'c, E: Equations, I> {
    model: &'a mut Integrated<E, I>,
    variables: &'a mut E::Variables,
    step: &'a Step<'a, <E::Variables as Accessed>::Inputs>,
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
                        Err(failure.error(
                            model.time,
                            &E::Variables::state_name(failure.state),
                            self.tolerance,
                        ))
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
        Error::new(format!("{}: {cause}", event_loop::abandoned(step.start, model.time, most_trials)))
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
