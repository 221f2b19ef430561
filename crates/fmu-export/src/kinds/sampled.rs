//! Sampled models, such as digital controllers: sample k is at `startTime + k · period`, whatever the importer's
//! steps. With several clocks, each has its own samples, in FMI 3.0 when the importer activates it (FMI 3.0.2, section
//! 2.2.8).
//!
//! Samples are counted in integers, so they do not drift in long experiments. A sample at a communication point belongs
//! to the step that starts there; `time.rs` knows which times are the same.

use fmu_solve::display::Shown;
use fmu_solve::{Error, Event, Events, Stop, Stops, due_until};

use crate::kinds::audit::check_calculated_parameters;
use crate::kinds::{Fmu, InputsOf, Model, Serves, Step, calculate_parameters};
use crate::model::clock::Clock;
use crate::model::context::Context;
use crate::model::description::Version;
use crate::model::sampled::{Sample, Sampled, Samples, check_parameters, same_time};
use crate::model::variables::{Accessed as _, Described as _, Numbered};

/// The most samples in one step, which must end: a day at 100 Hz has 8.64 million.
const MOST_SAMPLES: f64 = 1e7;

/// A sampled model as the runtime sees it: in Model Exchange each sample is an event.
#[derive(Clone, Debug, Default)]
pub struct SampledModel<S> {
    /// The sampled model.
    pub sampled: S,
    /// Those of the period; clocks count their own.
    samples: Samples,
}

crate::persistent!(<S: Sampled> SampledModel<S> { sampled, samples });

impl<S: Sampled> Fmu for SampledModel<S> {
    type Model = Self;
}

/// The next sample.
struct Due {
    /// The sample's time in s.
    time: f64,
    /// The least time from the last sample to this one, in s.
    period: f64,
    /// The time from which the sample's time is counted, in s.
    origin: f64,
    /// The position of the clock that ticks, if there are any.
    clock: Option<usize>,
}

impl Due {
    /// How much earlier another sample may be, in s, to be at the same time.
    fn rounding(&self) -> f64 {
        same_time(self.time, self.origin, self.period)
    }

    /// The sample at the time of the one before, `last`, if that is the same.
    fn join(self, last: &mut f64) -> Self {
        // Samples of a period are apart.
        let is_same = self.clock.is_some() && self.time <= *last + self.rounding();
        *last = if is_same { *last } else { self.time };
        Self { time: *last, ..self }
    }
}

impl<S: Sampled> SampledModel<S> {
    /// Whether the importer activates the clocks. In FMI 2.0 they are time events.
    const IS_ACTIVATED: bool =
        S::Variables::HAS_CLOCKS && matches!(S::Variables::DESCRIPTION.version, Version::Three);

    /// The clocks whose samples need no importer: position and state, by priority.
    fn uniform_clocks(variables: &S::Variables) -> impl Iterator<Item = (usize, &Clock)> {
        let clocks = S::Variables::CLOCKS.iter().enumerate();
        let uniform = clocks.filter(|(_, clock)| clock.interval_variability.is_uniform());
        uniform.filter_map(|(position, _)| Some((position, variables.clock(position)?)))
    }

    /// The sample period in s; with clocks, the shortest.
    fn period(variables: &S::Variables) -> f64 {
        if !S::Variables::HAS_CLOCKS {
            return S::period(variables);
        }
        let intervals = Self::uniform_clocks(variables).filter_map(|(_, clock)| clock.interval());
        intervals.fold(f64::INFINITY, f64::min)
    }

    /// The next sample of the period.
    fn next_of_period(&self) -> Due {
        let Samples { origin, period, .. } = self.samples;
        Due { time: self.samples.next().time, period, origin, clock: None }
    }

    /// Takes the period, which may have changed by a time in s.
    #[inline]
    fn retime(&mut self, variables: &S::Variables, now: f64) {
        if !S::Variables::HAS_CLOCKS && S::period(variables).to_bits() != self.samples.period.to_bits() {
            self.samples.take_period(S::period(variables), now);
        }
    }

    /// The next sample. Of clocks that tick at once, the first is that with the highest priority, and the time that of the
    /// earliest.
    fn next_sample(&self, variables: &S::Variables) -> Option<Due> {
        if !S::Variables::HAS_CLOCKS {
            return Some(self.next_of_period());
        }
        let period = Self::period(variables);
        let ticks = || {
            let clocks = Self::uniform_clocks(variables);
            clocks.filter_map(|(position, clock)| Some((position, clock.next(self.samples.origin)?)))
        };
        let time = ticks().map(|(_, time)| time).fold(f64::INFINITY, f64::min);
        let due = Due { time, period, origin: self.samples.origin, clock: None };
        let latest = time + due.rounding();
        let (position, _) = ticks().find(|(_, time)| *time <= latest)?;
        Some(Due { clock: Some(position), ..due })
    }

    /// Computes a sample.
    fn compute(
        &mut self,
        Due { time, clock, .. }: Due,
        variables: &mut S::Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        context.at(time);
        let Some(position) = clock else {
            let sample = Sample { number: self.samples.executed, time };
            self.samples.executed += 1;
            return self.sampled.sample(sample, variables, context);
        };
        let set = |variables: &mut S::Variables, ticks| {
            if let Some(clock) = variables.clock_mut(position) {
                clock.ticks = ticks;
            }
        };
        set(variables, true);
        let computed = self.tick(time, variables, context);
        set(variables, false);
        computed
    }

    /// Prepares the clocks.
    fn start_clocks(variables: &mut S::Variables) -> Result<(), Error> {
        for (position, description) in S::Variables::CLOCKS.iter().enumerate() {
            let Some(clock) = variables.clock_mut(position) else { continue };
            clock.restart();
            if Self::IS_ACTIVATED {
                continue;
            }
            let Some(variable) = S::Variables::description(description.value_reference) else { continue };
            clock.checked_interval(variable.name(), description.interval_variability)?;
            clock.checked_shift(variable.name())?;
        }
        Ok(())
    }
}

impl<S: Sampled> Model for SampledModel<S> {
    type Variables = S::Variables;
    const SERVES: Serves = Serves::ALL;
    const LONGEST_STEP: f64 = S::LONGEST_STEP;
    const TAKES_PARAMETERS: bool = S::Variables::HAS_CALCULATED_PARAMETERS;

    fn check_parameters(variables: &Self::Variables) -> Result<(), Error> {
        check_parameters::<S>(variables)
    }

    fn initialize(
        &mut self,
        variables: &mut Self::Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let (origin, period) = (context.experiment.start_time, S::period(variables));
        *self = Self { samples: Samples::new(origin, period), ..Self::default() };
        // The clock of the period, in Scheduled Execution only.
        if !S::Variables::HAS_CLOCKS
            && let Some(clock) = variables.clock_mut(0)
        {
            clock.set_interval(period);
        }
        calculate_parameters(self, variables);
        self.sampled.initialize(variables, context)?;
        check_calculated_parameters(variables, |variables| calculate_parameters(self, variables))?;
        self.sampled.refresh(origin, variables);
        Self::start_clocks(variables)?;
        let period = Self::period(variables);
        if !Self::IS_ACTIVATED && period < f64::EPSILON * origin.abs() {
            return Err(Error::new(format!(
                "the sample period is {} s, which is lost in the rounding of the start time {} s",
                Shown(period),
                Shown(origin)
            )));
        }
        Ok(())
    }

    fn calculate_parameters(
        &self,
        parameters: &<Self::Variables as Numbered>::Parameters<f64>,
        calculated: &mut <Self::Variables as Numbered>::CalculatedParameters<f64>,
    ) {
        self.sampled.calculate_parameters(parameters, calculated);
    }

    fn step(
        &mut self,
        variables: &mut Self::Variables,
        step: &Step<'_, InputsOf<Self>>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        self.retime(variables, step.start);
        let mut last = f64::NEG_INFINITY;
        while let Some(due) = self.next_sample(variables) {
            // Mostly it is so long after the end that rounding does not matter.
            if due.time >= step.end() || due.time >= step.instant_of_end().begin(due.period) {
                break;
            }
            check_number(&due, step.end())?;
            let due = due.join(&mut last);
            // A sample that rounding places before the step uses the inputs at its start.
            let offset = due.time - step.start;
            step.inputs.move_to(if offset > 0.0 { offset } else { 0.0 }, variables.inputs_mut());
            self.compute(due, variables, context)?;
            self.retime(variables, last);
        }
        Ok(())
    }

    fn refresh(&mut self, time: f64, variables: &mut Self::Variables) {
        self.retime(variables, time);
        self.sampled.refresh(time, variables);
    }

    fn tick(
        &mut self,
        time: f64,
        variables: &mut Self::Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        // Inputs come first, of which only one ticks.
        let positions = 0..S::Variables::CLOCKS.len();
        let ticks = |&position: &usize| variables.clock(position).is_some_and(Clock::ticks);
        let clock = positions.into_iter().find(ticks).and_then(|position| variables.clock_mut(position));
        let number = clock.map_or(0, Clock::count);
        self.sampled.sample(Sample { number, time }, variables, context)
    }

    fn next_event(&self, _time: f64, variables: &Self::Variables) -> Option<f64> {
        if Self::IS_ACTIVATED {
            return None;
        }
        self.next_sample(variables).map(|due| due.time)
    }

    fn event(
        &mut self,
        event: &Event<'_>,
        variables: &mut Self::Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        if !event.is_due {
            return Ok(());
        }
        let mut last = event.time;
        let is_same = |due: &Due| due.time <= event.time + due.rounding();
        while let Some(due) = self.next_sample(variables).filter(is_same) {
            self.compute(due.join(&mut last), variables, context)?;
            self.retime(variables, last);
        }
        Ok(())
    }

    fn step_to_event(
        &mut self,
        variables: &mut Self::Variables,
        step: &Step<'_, InputsOf<Self>>,
        mut events: Option<&mut Events>,
        stops: Stops,
        context: &mut Context<'_>,
    ) -> Result<Option<Stop>, Error> {
        if Self::IS_ACTIVATED {
            return Ok(None);
        }
        let end = step.instant_of_end();
        let mut last = f64::NEG_INFINITY;
        self.retime(variables, step.start);
        while let Some(sample) = self.next_sample(variables) {
            // A sample at the end of a step belongs to the next one, unless it is an event of this one.
            let Some(due) = due_until(&end, Some(sample.time), sample.time - sample.period) else { break };
            let due = if due > step.start { due } else { step.start };
            if stops.events.has(due, end.time) {
                return Ok(Some(Stop::Event(due)));
            } else if due >= end.time {
                return Ok(None);
            } else if stops.internal_steps && due > step.start {
                return Ok(Some(Stop::InternalStep(due)));
            }
            check_number(&sample, end.time)?;
            let sample = sample.join(&mut last);
            self.compute(sample, variables, context)?;
            self.retime(variables, last);
            if context.end.is_some() {
                break;
            }
            if let Some(events) = &mut events {
                let next = self.next_sample(variables).map(|due| due.time);
                events.set_next(next, last, false)?;
            }
        }
        Ok(None)
    }
}

/// Rejects a step until a time in s that has too many samples, of which this is the first.
fn check_number(due: &Due, until: f64) -> Result<(), Error> {
    let are_few = until - due.time <= MOST_SAMPLES * due.period;
    if are_few { Ok(()) } else { Err(too_many_samples(due.time, until, due.period)) }
}

#[cold]
fn too_many_samples(first: f64, until: f64, period: f64) -> Error {
    Error::new(format!(
        "the step has {:.3e} samples, from {} s on, one every {} s; at most {MOST_SAMPLES:e} are computed per step",
        (until - first) / period,
        Shown(first),
        Shown(period)
    ))
}
