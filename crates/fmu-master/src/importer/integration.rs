//! Integrates FMUs of Model Exchange with the exporter's integrator, from event to event.

use anyhow::{Error, Result, anyhow, bail};
use fmu_export::display::Seconds;
use fmu_export::event_loop::{EventLoop, Hybrid};
use fmu_export::fmi2::c_types::ValueReference;
use fmu_export::integrator::{Directions, Integrator, System, Tolerance, Trials};
use fmu_export::search::{Trajectory, first_event};
use fmu_export::{DEFAULT_TOLERANCE, Events, Stops};
use fmu_io::terminal::number;

use super::c_boundary::Vector;
use super::calls::Calls;
use super::derivative_check::{DerivativeCheck, Use};
use super::event_mode::EventMode;
use super::messages::is_discarded;

/// The most trials and events in a communication step, which must end.
const MOST_TRIALS: u32 = 100_000;

/// The solution of an instance's equations up to now.
#[derive(Clone)]
pub struct Integration {
    integrator: Integrator,
    /// The signs of the event indicators.
    events: Events,
    /// The longest time between two points that are searched for events (s).
    look: f64,
    /// The time of the last event or step (s).
    time: f64,
    states: Vec<f64>,
    nominals: Vec<f64>,
    equations: Equations,
}

/// What evaluates an FMU's equations.
#[derive(Clone)]
struct Equations {
    /// The references of the derivatives and of the states, arrays as a whole.
    derivatives: Vec<ValueReference>,
    states: Vec<ValueReference>,
    /// A direction of the states, or states near those of interest.
    direction: Vec<f64>,
    /// Derivatives there.
    along: Vec<f64>,
    /// Derivatives at the states of interest.
    here: Vec<f64>,
    indicators: Vec<f64>,
    check: DerivativeCheck,
}

impl Equations {
    /// The Jacobian by the FMU's directional derivatives, by rows.
    fn direct(&mut self, calls: &mut Calls, jacobian: &mut [f64]) -> Result<()> {
        let Self { derivatives: of, states: by, direction, along, .. } = self;
        let count = along.len();
        for column in 0..count {
            direction.fill(0.0);
            direction[column] = 1.0;
            let called = calls.handle.directional_derivative(of, by, direction, along);
            calls.check(&[], called)?;
            for (row, along) in along.iter().enumerate() {
                jacobian[row * count + column] = *along;
            }
        }
        Ok(())
    }

    /// The same by differences, about a time (s) and states with nominal values.
    fn difference(
        &mut self,
        calls: &mut Calls,
        time: f64,
        (states, nominals): (&[f64], &[f64]),
        jacobian: &mut [f64],
    ) -> Result<()> {
        let Self { direction: moved, along, here, .. } = self;
        let count = along.len();
        for column in 0..count {
            moved.copy_from_slice(states);
            moved[column] += f64::EPSILON.sqrt() * states[column].abs().max(nominals[column]);
            evaluate(calls, time, moved, along)?;
            let change = moved[column] - states[column];
            for (row, (along, here)) in along.iter().zip(&*here).enumerate() {
                jacobian[row * count + column] = (along - here) / change;
            }
        }
        Ok(())
    }
}

impl Integration {
    /// Starts after the initialization, at its time (s), with the initial event.
    pub fn begin(calls: &mut Calls, events: &mut EventMode, time: f64) -> Result<Self> {
        let indicators = calls.fmu.description().number_of_event_indicators()?;
        let size = calls.fmu.states.len();
        let mut derivatives: Vec<_> = calls.fmu.states.iter().map(|state| state.derivative).collect();
        let mut states: Vec<_> = calls.fmu.states.iter().map(|state| state.reference).collect();
        derivatives.dedup();
        states.dedup();
        let mut begun = Self {
            integrator: Integrator::new(size),
            events: Events::new(indicators),
            look: f64::INFINITY,
            time,
            states: vec![0.0; size],
            nominals: vec![1.0; size],
            equations: Equations {
                derivatives,
                states,
                direction: vec![0.0; size],
                along: vec![0.0; size],
                here: vec![0.0; size],
                indicators: vec![0.0; indicators],
                check: DerivativeCheck::new(size),
            },
        };
        begun.handle(calls, events, time, true)?;
        Ok(begun)
    }

    /// Handles an event at a time (s). If `is_sharp`, the solution may bend there and the integrator restarts; otherwise
    /// only inputs changed.
    fn handle(&mut self, calls: &mut Calls, events: &mut EventMode, time: f64, is_sharp: bool) -> Result<()> {
        events.handle(calls, time, 0.0)?;
        self.time = time;
        let before = &mut self.equations.direction;
        before.copy_from_slice(&self.states);
        calls.get_vector(Vector::States, &mut self.states)?;
        if is_sharp || *before != self.states {
            self.integrator.restart();
        }
        calls.get_vector(Vector::Nominals, &mut self.nominals)?;
        for nominal in &mut self.nominals {
            *nominal = if *nominal == 0.0 || !nominal.is_finite() { 1.0 } else { nominal.abs() };
        }
        read_indicators(calls, &mut self.equations.indicators, time)?;
        let Self { events, equations, .. } = self;
        Ok(events.begin(time, &[], |indicators| indicators.copy_from_slice(&equations.indicators))?)
    }

    /// Steps from a time (s) by a size (s).
    pub fn step(&mut self, calls: &mut Calls, events: &mut EventMode, start: f64, size: f64) -> Result<()> {
        let end = start + size;
        let relative = calls.handle.tolerance.get().unwrap_or(DEFAULT_TOLERANCE);
        if events.is_entered() {
            self.handle(calls, events, self.time, false)?;
        }
        // The last event may have been handled a little late.
        let place = (self.time - start).max(0.0);
        let mut evolution =
            Evolution { integration: self, calls, event_mode: events, start, size, place, relative };
        EventLoop::new((start, size, end), false, MOST_TRIALS)
            .go_on::<false, _>(&mut evolution, Stops::NONE)?;
        calls.handle.time.set(Some(end));
        Ok(())
    }
}

/// A communication step, from event to event.
struct Evolution<'a> {
    integration: &'a mut Integration,
    calls: &'a mut Calls,
    event_mode: &'a mut EventMode,
    /// The communication step, and the present place in it (s).
    start: f64,
    size: f64,
    place: f64,
    /// The tolerance.
    relative: f64,
}

impl Hybrid for Evolution<'_> {
    type Error = Error;

    fn next_event(&self) -> Option<f64> {
        self.event_mode.next()
    }

    fn time(&self) -> f64 {
        self.integration.time
    }

    fn elapsed(&self) -> f64 {
        self.place
    }

    fn integrate(&mut self, target: f64, trials: Trials<'_>) -> Result<bool> {
        let Self { integration, calls, start, size, place, relative, .. } = self;
        let Integration { integrator, events, look, time, states, nominals, equations } = &mut **integration;
        let tolerance = Tolerance { relative: *relative, nominals };
        let mut solved = Solved { calls, equations, tolerance, start: *start, size: *size, failure: None };
        let step = integrator.step(&mut solved, (*place, target), states, &tolerance, trials.count);
        let reached = match (step, solved.failure.take()) {
            (Ok(reached), None) => reached,
            (Ok(reached), Some(failure)) if is_discarded(&failure) => reached,
            (_, Some(failure)) => return Err(failure),
            (Err(failure), None) => bail!(
                "{}: the states cannot be integrated beyond {} s: the error of {} stays above the tolerance \
                 {relative:?}, or its derivative is not finite",
                calls.name,
                Seconds(*time),
                calls.fmu.states[failure.state].name
            ),
        };
        let mut path = Path { solved, integrator, events, states, look, place: *place };
        let has_event = if path.solved.equations.indicators.is_empty() {
            path.go_to(reached)?
        } else {
            first_event(&mut path, *start, (*place, reached), trials.count)?
        };
        *place = path.place;
        *time = path.solved.time(*place);
        let (called, [event, terminates]) = calls.handle.completed_integrator_step();
        calls.check(&[], called)?;
        if terminates {
            calls.end(*time)?;
        }
        Ok(has_event || event)
    }

    fn handle(&mut self, due: Option<f64>) -> Result<bool> {
        let Self { integration, calls, event_mode, .. } = self;
        let mut time = integration.time;
        if let Some(due) = due.filter(|due| *due > time) {
            time = due;
            calls.go_to(time, &integration.states)?;
        }
        integration.handle(calls, event_mode, time, true)?;
        Ok(true)
    }

    fn abandoned(&self, most_trials: u32, _events: u32) -> Error {
        anyhow!(
            "{}: the step from {} s was abandoned at {} s after {most_trials} trials and events",
            self.calls.name,
            Seconds(self.start),
            Seconds(self.integration.time)
        )
    }
}

/// Reads the event indicators, which have signs only if they are finite.
fn read_indicators(calls: &mut Calls, indicators: &mut [f64], time: f64) -> Result<()> {
    calls.get_vector(Vector::Indicators, indicators)?;
    match indicators.iter().position(|indicator| !indicator.is_finite()) {
        Some(wrong) => bail!(
            "{}: the event indicator {} is {} at {} s",
            calls.name,
            wrong + 1,
            indicators[wrong],
            Seconds(time)
        ),
        None => Ok(()),
    }
}

/// The equations in a communication step.
struct Solved<'a> {
    calls: &'a mut Calls,
    equations: &'a mut Equations,
    tolerance: Tolerance<'a>,
    /// The communication step (s).
    start: f64,
    size: f64,
    /// The last call that failed.
    failure: Option<Error>,
}

impl Solved<'_> {
    /// The time at a place in the communication step (s).
    fn time(&self, place: f64) -> f64 {
        self.start + place.min(self.size)
    }

    fn differentiate(
        &mut self,
        time: f64,
        states: &[f64],
        directions: &impl Directions,
        products: &mut [f64],
        by_time: &mut [f64],
    ) -> Result<()> {
        let calls = &mut *self.calls;
        let nominals = self.tolerance.nominals;
        evaluate(calls, time, states, &mut self.equations.here)?;
        // Those of the states, as the pattern is full.
        let count = directions.count();
        if count > 0 && calls.has_directional_derivatives {
            self.equations.direct(calls, products)?;
            let at = Use {
                time,
                states,
                derivatives: &self.equations.here,
                nominals,
                step: self.size,
                tolerance: self.tolerance.relative,
            };
            if let Some(wrong) = self.equations.check.find_wrong(calls, products, &at)? {
                let [of, by] = [wrong.row, wrong.column].map(|state| &calls.fmu.states[state]);
                let warning = format!(
                    "the FMU's derivative of {} by {} is {} at {} s, but differences give {:.3e}; from here on, differences \
                     replace the FMU's derivatives",
                    of.derivative_name,
                    by.name,
                    number(products[wrong.row * count + wrong.column]),
                    Seconds(time),
                    wrong.quotient
                );
                calls.warn(warning);
                calls.has_directional_derivatives = false;
            }
        }
        if count > 0 && !calls.has_directional_derivatives {
            self.equations.difference(calls, time, (states, nominals), products)?;
        }
        let Equations { along, here, .. } = &mut *self.equations;
        let later = time + f64::EPSILON.sqrt() * time.abs().max(self.size);
        evaluate(calls, later, states, along)?;
        for ((by_time, along), here) in by_time.iter_mut().zip(&*along).zip(&*here) {
            *by_time = (along - here) / (later - time);
        }
        Ok(())
    }

    /// Computes values, unless an error has ended the calls. Without them the integrator takes a shorter step, in which
    /// the FMU may be called again only if it discarded the last one.
    fn try_to(&mut self, values: &mut [f64], compute: impl FnOnce(&mut Self, &mut [f64]) -> Result<()>) {
        let may_be_called = self.failure.as_ref().is_none_or(is_discarded);
        if may_be_called {
            match compute(self, values) {
                Ok(()) => return,
                Err(error) => self.failure = Some(error),
            }
        }
        values.fill(f64::NAN);
    }
}

/// The derivatives at a time (s).
fn evaluate(calls: &mut Calls, time: f64, states: &[f64], derivatives: &mut [f64]) -> Result<()> {
    calls.go_to(time, states)?;
    calls.get_vector(Vector::Derivatives, derivatives)
}

impl System for Solved<'_> {
    fn derivatives(&mut self, place: f64, states: &[f64], derivatives: &mut [f64]) {
        self.try_to(derivatives, |solved, derivatives| {
            evaluate(solved.calls, solved.time(place), states, derivatives)
        });
    }

    fn linearize(
        &mut self,
        place: f64,
        states: &[f64],
        directions: &impl Directions,
        products: &mut [f64],
        by_time: &mut [f64],
    ) {
        self.try_to(by_time, |solved, by_time| {
            solved.differentiate(solved.time(place), states, directions, products, by_time)
        });
    }
}

/// The last step of the integrator, along which events are searched.
struct Path<'a> {
    solved: Solved<'a>,
    integrator: &'a mut Integrator,
    events: &'a mut Events,
    states: &'a mut [f64],
    look: &'a mut f64,
    place: f64,
}

impl Trajectory for Path<'_> {
    type Error = Error;

    fn events(&mut self) -> &mut Events {
        self.events
    }

    fn look(&mut self) -> &mut f64 {
        self.look
    }

    fn go_to(&mut self, place: f64) -> Result<bool> {
        self.place = place;
        self.integrator.states_at(&mut self.solved, place, self.states);
        let time = self.solved.time(place);
        let Solved { calls, equations, .. } = &mut self.solved;
        calls.go_to(time, self.states)?;
        read_indicators(calls, &mut equations.indicators, time)?;
        let read = |indicators: &mut [f64]| indicators.copy_from_slice(&equations.indicators);
        Ok(self.events.find_changes(time, &[], read)?)
    }
}
