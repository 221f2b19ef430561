//! Integrates FMUs of Model Exchange with the exporter's integrator, from event to event.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use anyhow::{Error, Result, anyhow, bail};
use fmu_abi::fmi2::c_types::ValueReference;
use fmu_io::terminal::number;
use fmu_solve::event_loop::{self, EventLoop, Hybrid, MOST_TRIALS};
use fmu_solve::integrator::{Directions, Integrator, Pattern, System, Tolerance, Trials};
use fmu_solve::search::{Trajectory, first_event};
use fmu_solve::time::End;
use fmu_solve::{DEFAULT_TOLERANCE, Events, Stops};

use super::c_boundary::{Dependency, Vector};
use super::calls::Calls;
use super::columns::Columns;
use super::derivative_check::{DerivativeCheck, Use, Wrong};
use super::differences::Place;
use super::event_mode::EventMode;
use super::exchange::Exchange;
use super::fmu::Fmu;
use super::messages::is_discarded;

/// The solver of an instance of Model Exchange: the solution of its equations up to now.
#[derive(Clone)]
pub struct Solver {
    integrator: Integrator,
    /// The signs of the event indicators.
    events: Events,
    /// The longest time between two points that are searched for events (s).
    look: f64,
    /// The time of the last event or step (s).
    time: f64,
    states: Vec<f64>,
    nominals: Vec<f64>,
    evaluator: Evaluator,
}

/// What evaluates an FMU's equations.
#[derive(Clone)]
struct Evaluator {
    exchange: Exchange,
    /// The references of the derivatives and of the states, arrays as a whole.
    derivatives: Vec<ValueReference>,
    states: Vec<ValueReference>,
    /// A direction of the states, or states near those of interest.
    direction: Vec<f64>,
    /// Derivatives along the direction, or at the states near those of interest.
    along: Vec<f64>,
    /// Derivatives at the states of interest.
    here: Vec<f64>,
    indicators: Vec<f64>,
    check: DerivativeCheck,
    /// Where the FMU says that the Jacobian has elements, and where it is taken to have them.
    listed: Arc<Pattern>,
    pattern: Arc<Pattern>,
    /// The row of the Jacobian that its pattern may lack elements of.
    doubted: Option<usize>,
}

impl Evaluator {
    /// Products of the Jacobian by the FMU's directional derivatives, by rows.
    fn direct(&mut self, calls: &mut Calls, columns: &Columns<'_>, products: &mut [f64]) -> Result<()> {
        let Self { derivatives: of, states: by, direction, along, .. } = self;
        for number in columns.directions() {
            direction.fill(0.0);
            columns.states(number).for_each(|state| direction[state] = 1.0);
            let called = calls.handle.directional_derivative(of, by, direction, along)?;
            calls.check(&[], called)?;
            for (row, along) in along.iter().enumerate() {
                products[columns.place(row, number)] = *along;
            }
        }
        Ok(())
    }

    /// Products of the Jacobian by forward differences, about a time (s) and states at their places.
    fn difference(
        &mut self,
        calls: &mut Calls,
        time: f64,
        (states, places): (&[f64], &[Place]),
        columns: &Columns<'_>,
        products: &mut [f64],
    ) -> Result<()> {
        let Self { exchange, direction: moved, along, here, .. } = self;
        for number in columns.directions() {
            moved.copy_from_slice(states);
            for state in columns.states(number) {
                moved[state] = places[state].moved();
            }
            exchange.derivatives_at(calls, time, moved, along)?;
            for (row, (along, here)) in along.iter().zip(&*here).enumerate() {
                let column = columns.column(row, number);
                products[columns.place(row, number)] =
                    column.map_or(0.0, |column| (along - here) / (moved[column] - states[column]));
            }
        }
        Ok(())
    }

    /// Warns if the FMU's dependencies of a derivative, which were doubted, lack a state: its full Jacobian tells.
    fn confirm_doubt(&mut self, calls: &mut Calls, row: usize, jacobian: &[f64]) {
        let fmu = Arc::clone(&calls.fmu);
        let listed = self.listed.row(row);
        let row_of = jacobian.chunks_exact(self.here.len()).nth(row).unwrap_or_default();
        let lacking = row_of.iter().enumerate().filter(|(column, element)| {
            **element != 0.0 && listed.binary_search(&u32::try_from(*column).unwrap_or(u32::MAX)).is_err()
        });
        if let Some((column, element)) =
            lacking.max_by(|(_, one), (_, other)| one.abs().total_cmp(&other.abs()))
        {
            calls.warn(format!(
                "the FMU's ModelStructure does not list {} among the dependencies of {}, whose derivative by it is {}; \
                 from here on, all derivatives are taken to depend on all states",
                fmu.states[column].name,
                fmu.states[row].derivative_name,
                number(*element)
            ));
        }
    }
}

/// States with nominal values as those about which differences are taken.
fn places(fmu: &Fmu, states: &[f64], nominals: &[f64]) -> Vec<Place> {
    let of = fmu.states.iter().zip(states.iter().zip(nominals));
    of.map(|(described, (&state, &nominal))| Place::new(state, nominal, described.range)).collect()
}

/// Where the FMU says that the Jacobian has elements, if it has arrays of states and tells their elements' dependencies,
/// which `ModelStructure` cannot.
fn pattern_by_element(calls: &mut Calls) -> Result<Option<Pattern>> {
    let fmu = Arc::clone(&calls.fmu);
    let mut arrays = BTreeMap::<_, Range<usize>>::new();
    for (place, state) in fmu.states.iter().enumerate() {
        arrays.entry(state.reference).or_insert(place..place).end = place + 1;
    }
    if arrays.len() == fmu.states.len() || !fmu.has_capability("providesPerElementDependencies") {
        return Ok(None);
    }
    let rows = rows_by_element(&arrays, |places| {
        let (called, dependencies) = calls.handle.dependencies(fmu.states[places.start].derivative)?;
        calls.check(&[], called)?;
        Ok(dependencies)
    });
    let mut rows = rows?;
    Ok(Some(Pattern::of_rows(rows.len(), |row, columns| columns.append(&mut rows[row]))))
}

/// The states on which each derivative depends, from the places of each array of states, and what its derivatives'
/// elements depend on.
fn rows_by_element(
    arrays: &BTreeMap<ValueReference, Range<usize>>,
    mut dependencies: impl FnMut(&Range<usize>) -> Result<Vec<Dependency>>,
) -> Result<Vec<Vec<usize>>> {
    let mut rows = vec![vec![]; arrays.values().map(ExactSizeIterator::len).sum()];
    for places in arrays.values() {
        for Dependency { element, on, element_of_it } in dependencies(places)? {
            let Some(states) = arrays.get(&on) else { continue };
            let (Some(derivatives), Some(states)) =
                (elements(places, element), elements(states, element_of_it))
            else {
                bail!("fmi3GetVariableDependencies names an element that its variable does not have");
            };
            derivatives.for_each(|row| rows[row].extend(states.clone()));
        }
    }
    Ok(rows)
}

/// The places of an array's element by its number from 1, or all of them if it is 0; none if there is no such element.
fn elements(places: &Range<usize>, number: usize) -> Option<Range<usize>> {
    let Some(before) = number.checked_sub(1) else { return Some(places.clone()) };
    (before < places.len()).then(|| places.start + before..places.start + number)
}

impl Solver {
    /// Starts after the initialization, at its time (s). The initial event follows.
    pub fn new(calls: &mut Calls, exchange: &Exchange, time: f64) -> Result<Self> {
        let indicators = calls.fmu.description().number_of_event_indicators()?;
        let size = calls.fmu.states.len();
        let mut derivatives: Vec<_> = calls.fmu.states.iter().map(|state| state.derivative).collect();
        let mut states: Vec<_> = calls.fmu.states.iter().map(|state| state.reference).collect();
        derivatives.dedup();
        states.dedup();
        let listed = pattern_by_element(calls)?.map_or_else(|| Arc::clone(&calls.fmu.pattern), Arc::new);
        Ok(Self {
            integrator: Integrator::new(size),
            events: Events::new(indicators),
            look: f64::INFINITY,
            time,
            states: vec![0.0; size],
            nominals: vec![1.0; size],
            evaluator: Evaluator {
                exchange: exchange.clone(),
                derivatives,
                states,
                direction: vec![0.0; size],
                along: vec![0.0; size],
                here: vec![0.0; size],
                indicators: vec![0.0; indicators],
                check: DerivativeCheck::new(size),
                listed: Arc::clone(&listed),
                pattern: listed,
                doubted: None,
            },
        })
    }

    /// Brings the FMU to a time (s), at the present states.
    pub fn go_to(&self, calls: &mut Calls, time: f64) -> Result<()> {
        self.evaluator.exchange.go_to(calls, time, &self.states)
    }

    /// Handles an event as [`EventMode::handle`] does. If `is_sharp`, the solution may bend there and the integrator
    /// restarts; otherwise only inputs changed.
    pub fn handle(
        &mut self,
        calls: &mut Calls,
        events: &mut EventMode,
        (time, late): (f64, f64),
        is_sharp: bool,
        is_watched: bool,
    ) -> Result<()> {
        events.handle(calls, (time, late), is_watched)?;
        self.time = time;
        let before = &mut self.evaluator.direction;
        before.copy_from_slice(&self.states);
        let exchange = &self.evaluator.exchange;
        exchange.get_vector(calls, Vector::States, &mut self.states)?;
        if is_sharp || *before != self.states {
            self.integrator.restart();
        }
        exchange.get_nominals(calls, &mut self.nominals)?;
        exchange.read_indicators(calls, &mut self.evaluator.indicators, time)?;
        let Self { events, evaluator, .. } = self;
        Ok(events.begin(time, &[], |indicators| indicators.copy_from_slice(&evaluator.indicators))?)
    }

    /// Steps from a time (s) by a size (s).
    pub fn step(&mut self, calls: &mut Calls, events: &mut EventMode, start: f64, size: f64) -> Result<()> {
        let end = start + size;
        let relative = calls.experiment.tolerance.unwrap_or(DEFAULT_TOLERANCE);
        if events.is_entered() {
            self.handle(calls, events, (self.time, 0.0), false, false)?;
        }
        // The last event may have been handled a little late.
        let place = (self.time - start).max(0.0);
        let mut step = SolverStep { solver: self, calls, event_mode: events, start, size, place, relative };
        // Events at the end belong to the communication point there.
        EventLoop::new((start, size, End::of_any(start, size)), true, MOST_TRIALS)
            .go_on::<false, _>(&mut step, Stops::NONE)?;
        calls.set_time(Some(end));
        Ok(())
    }
}

/// A communication step, from event to event.
struct SolverStep<'a> {
    solver: &'a mut Solver,
    calls: &'a mut Calls,
    event_mode: &'a mut EventMode,
    /// The communication step, and the present place in it (s).
    start: f64,
    size: f64,
    place: f64,
    /// The tolerance.
    relative: f64,
}

impl Hybrid for SolverStep<'_> {
    type Error = Error;

    fn next_event(&self) -> Option<f64> {
        self.event_mode.next().into_iter().chain(self.calls.next_jump()).min_by(f64::total_cmp)
    }

    fn last_event(&self) -> f64 {
        self.event_mode.last()
    }

    fn time(&self) -> f64 {
        self.solver.time
    }

    fn elapsed(&self) -> f64 {
        self.place
    }

    fn integrate(&mut self, target: f64, trials: Trials<'_>) -> Result<bool> {
        let Self { solver, calls, start, size, place, relative, .. } = self;
        let Solver { integrator, events, look, time, states, nominals, evaluator } = &mut **solver;
        let tolerance = Tolerance { relative: *relative, nominals };
        let mut solved = Solved { calls, evaluator, tolerance, start: *start, size: *size, failure: None };
        let step = integrator.step(&mut solved, (*place, target), states, &tolerance, trials.count);
        let reached = match (step, solved.failure.take()) {
            (Ok(reached), None) => reached,
            (Ok(reached), Some(failure)) if is_discarded(&failure) => reached,
            (_, Some(failure)) => return Err(failure),
            (Err(failure), None) => {
                let state = &calls.fmu.states[failure.state].name;
                bail!("{}: {}", calls.name, failure.error(*time, state, *relative))
            }
        };
        let mut path = StepPath { solved, integrator, events, states, look, place: *place };
        let has_event = if path.solved.evaluator.indicators.is_empty() {
            path.go_to(reached)?
        } else {
            first_event(&mut path, *start, (*place, reached), trials.count)?
        };
        *place = path.place;
        *time = path.solved.time(*place);
        let has_other = path.solved.evaluator.exchange.complete_step(path.solved.calls, *time)?;
        Ok(has_event || has_other)
    }

    fn handle(&mut self, due: Option<f64>) -> Result<bool> {
        let Self { solver, calls, event_mode, .. } = self;
        let mut time = solver.time;
        if let Some(due) = due.filter(|due| *due > time) {
            time = due;
            solver.go_to(calls, time)?;
        }
        // A jump of an input is no event.
        let is_watched = due.is_none() || event_mode.has_due(time);
        solver.handle(calls, event_mode, (time, 0.0), true, is_watched)?;
        Ok(true)
    }

    fn abandoned(&self, most_trials: u32, _events: u32) -> Error {
        let abandoned = event_loop::abandoned(self.start, self.solver.time, most_trials);
        anyhow!("{}: {abandoned}", self.calls.name)
    }
}

/// The equations in a communication step.
struct Solved<'a> {
    calls: &'a mut Calls,
    evaluator: &'a mut Evaluator,
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
        let Evaluator { exchange, here, .. } = &mut *self.evaluator;
        exchange.derivatives_at(self.calls, time, states, here)?;
        if directions.count() > 0 {
            self.fill(time, states, &Columns::new(directions, states.len()), products)?;
        }
        let Evaluator { exchange, along, here, .. } = &mut *self.evaluator;
        let later = Place::new(time, self.size, (f64::NEG_INFINITY, f64::INFINITY)).moved();
        exchange.derivatives_at(self.calls, later, states, along)?;
        for ((by_time, along), here) in by_time.iter_mut().zip(&*along).zip(&*here) {
            *by_time = (along - here) / (later - time);
        }
        Ok(())
    }

    /// Computes the products of the Jacobian with directions, and what is wrong with them.
    fn fill(&mut self, time: f64, states: &[f64], columns: &Columns<'_>, products: &mut [f64]) -> Result<()> {
        let places = places(&self.calls.fmu, states, self.tolerance.nominals);
        let calls = &mut *self.calls;
        if calls.has_directional_derivatives {
            self.evaluator.direct(calls, columns, products)?;
        } else {
            self.evaluator.difference(calls, time, (states, &places), columns, products)?;
        }
        if columns.is_full()
            && let Some(row) = self.evaluator.doubted.take()
        {
            self.evaluator.confirm_doubt(calls, row, products);
        }
        let mut is_complete = true;
        if calls.has_directional_derivatives || !columns.is_full() {
            let Evaluator { exchange, here, check, .. } = &mut *self.evaluator;
            let at = Use {
                time,
                states,
                derivatives: here,
                places: &places,
                step: self.size,
                tolerance: self.tolerance.relative,
            };
            match check.find_wrong((calls, exchange), columns, products, &at)? {
                Some(Wrong { row, column: Some(column), quotient }) if columns.is_full() => {
                    let [of, by] = [row, column].map(|state| &calls.fmu.states[state]);
                    let warning = format!(
                        "the FMU's derivative of {} by {} is {}, but differences give {quotient:.3e}; from here on, \
                         differences replace the FMU's derivatives",
                        of.derivative_name,
                        by.name,
                        number(products[columns.element(row, column)]),
                    );
                    calls.warn(warning);
                    calls.has_directional_derivatives = false;
                    self.evaluator.difference(calls, time, (states, &places), columns, products)?;
                }
                Some(Wrong { row, .. }) => {
                    // Either the pattern or a derivative is wrong: the full Jacobian tells which.
                    self.evaluator.pattern = Arc::new(Pattern::full());
                    self.evaluator.doubted = Some(row);
                    self.evaluator.check.begin();
                    is_complete = false;
                }
                None => {}
            }
        }
        if let Some(checking) = columns.checking() {
            let shown = if is_complete { f64::NAN } else { f64::MAX };
            (0..states.len()).for_each(|row| products[columns.place(row, checking)] = shown);
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

impl System for Solved<'_> {
    const MAY_BE_SPARSE: bool = true;

    fn derivatives(&mut self, place: f64, states: &[f64], derivatives: &mut [f64]) {
        self.try_to(derivatives, |solved, derivatives| {
            let time = solved.time(place);
            solved.evaluator.exchange.derivatives_at(solved.calls, time, states, derivatives)
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

    /// The rows by all columns.
    fn gradients(
        &mut self,
        place: f64,
        states: &[f64],
        rows: &[usize],
        mut take: impl FnMut(usize, &dyn Fn(usize) -> f64),
    ) {
        let size = states.len();
        let mut jacobian = vec![0.0; size * size];
        self.try_to(&mut jacobian, |solved, jacobian| {
            let time = solved.time(place);
            let Evaluator { exchange, here, .. } = &mut *solved.evaluator;
            exchange.derivatives_at(solved.calls, time, states, here)?;
            let columns = Columns::full(size);
            if solved.calls.has_directional_derivatives {
                solved.evaluator.direct(solved.calls, &columns, jacobian)
            } else {
                let places = places(&solved.calls.fmu, states, solved.tolerance.nominals);
                solved.evaluator.difference(solved.calls, time, (states, &places), &columns, jacobian)
            }
        });
        for &row in rows {
            take(row, &|column| jacobian[row * size + column]);
        }
    }

    fn pattern(&mut self, _place: f64, _states: &[f64]) -> Pattern {
        (*self.evaluator.pattern).clone()
    }
}

/// The last step of the integrator, along which events are searched.
struct StepPath<'a> {
    solved: Solved<'a>,
    integrator: &'a mut Integrator,
    events: &'a mut Events,
    states: &'a mut [f64],
    look: &'a mut f64,
    place: f64,
}

impl Trajectory for StepPath<'_> {
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
        let Solved { calls, evaluator, .. } = &mut self.solved;
        let Evaluator { exchange, indicators, .. } = &mut **evaluator;
        exchange.go_to(calls, time, self.states)?;
        exchange.read_indicators(calls, indicators, time)?;
        let read = |to: &mut [f64]| to.copy_from_slice(indicators);
        Ok(self.events.find_changes(time, &[], read)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn depends(element: usize, on: ValueReference, element_of_it: usize) -> Dependency {
        Dependency { element, on, element_of_it }
    }

    #[test]
    fn derivatives_of_arrays_depend_on_what_the_fmu_says_of_their_elements() {
        // Three states, then two; 9 is an input.
        let arrays = BTreeMap::from([(4, 0..3), (7, 3..5)]);
        let rows = rows_by_element(&arrays, |places| {
            Ok(match places.start {
                0 => vec![depends(1, 4, 2), depends(1, 9, 1), depends(3, 7, 0)],
                _ => vec![depends(0, 4, 3), depends(2, 7, 1)],
            })
        });
        assert_eq!(rows.unwrap(), [vec![1], vec![], vec![3, 4], vec![2], vec![2, 3]]);
        for wrong in [depends(4, 4, 1), depends(1, 7, 3)] {
            assert!(rows_by_element(&arrays, |_| Ok(vec![wrong])).is_err(), "{wrong:?}");
        }
    }
}
