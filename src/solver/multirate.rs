//! Integration of a system in two parts, each with its own steps.
//!
//! The fast part does not depend on the slow one, and leads in small steps; the slow part follows in large ones. One
//! state of the fast part drives the slow one, with cubic interpolation between the fast steps.

use fmu_export::Error;
use fmu_export::persistence::{Archive, Persistent};

use super::course::{Course, IntegrationFailure, Interval, Rules, StepMemory, TIME_DIFFERENCE};
use super::cubic::Cubic;
use super::rosenbrock::step;

/// The maximum lead of the fast part, in steps.
const MOST_AHEAD: usize = 16;

/// The leading part.
pub trait Fast<const STATES: usize, const INPUTS: usize>: Copy {
    /// Its values at an instant.
    type Evaluation: Copy;
    /// Its error control.
    const RULES: &'static Rules<STATES>;
    /// Whether its inputs are constant.
    fn is_constant(&self) -> bool;
    /// Its inputs at a time.
    fn inputs(&self, time: f64) -> [f64; INPUTS];
    /// Its values at a time with states.
    fn evaluate(&self, time: f64, states: &[f64; STATES]) -> Self::Evaluation;
    /// The derivatives of its states.
    fn derivatives(evaluation: &Self::Evaluation) -> [f64; STATES];
    /// The state that drives the slow part.
    fn driver(states: &[f64; STATES]) -> f64;
}

/// The following part, driven by a state of the fast one.
pub trait Slow<const STATES: usize, const INPUTS: usize>: Copy {
    /// Its values at an instant.
    type Evaluation: Copy;
    /// Its error control.
    const RULES: &'static Rules<STATES>;
    /// Whether its inputs other than the driver are constant.
    fn is_constant(&self) -> bool;
    /// Its inputs at a time.
    fn inputs(&self, time: f64) -> [f64; INPUTS];
    /// Its values at a time with states and a driver.
    fn evaluate(&self, time: f64, states: &[f64; STATES], driver: f64) -> Self::Evaluation;
    /// The derivatives of its states.
    fn derivatives(evaluation: &Self::Evaluation) -> [f64; STATES];
    /// The driver's effect: a function of it in which the derivatives are nearly linear.
    fn effect(&self, driver: f64) -> f64;
    /// The derivatives of the slopes with respect to the effect; `slopes` are those with the driver.
    fn by_effect(
        &self,
        time: f64,
        states: &[f64; STATES],
        slopes: &[f64; STATES],
        driver: f64,
    ) -> [f64; STATES];
}

/// The memory of the slow part from one interval to the next.
#[derive(Clone, Copy, Debug)]
pub struct SlowMemory<const STATES: usize, const INPUTS: usize> {
    /// The memory of any system.
    pub memory: StepMemory<STATES, INPUTS>,
    /// See [`Slow::by_effect`]; belongs to the linearization.
    by_effect: [f64; STATES],
}

impl<const STATES: usize, const INPUTS: usize> SlowMemory<STATES, INPUTS> {
    /// An empty memory, with the length of the first step in s.
    pub fn new(first_step: f64) -> Self {
        Self { memory: StepMemory::new(first_step), by_effect: [0.0; STATES] }
    }
}

impl<const STATES: usize, const INPUTS: usize> Persistent for SlowMemory<STATES, INPUTS> {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let Self { memory, by_effect } = self;
        memory.persist(archive)?;
        by_effect.persist(archive)
    }
}

/// A part with its memory and its states, which advance from the start to the end of the interval.
pub type Going<'a, Remembered, const STATES: usize> = (&'a mut Remembered, &'a mut [f64; STATES]);

/// Advances both parts of a system over an interval. Returns their values at its end.
pub fn advance<P, const FAST: usize, const FAST_INPUTS: usize, const SLOW: usize, const SLOW_INPUTS: usize>(
    system: P,
    (fast_memory, fast_states): Going<'_, StepMemory<FAST, FAST_INPUTS>, FAST>,
    (slow_memory, slow_states): Going<'_, SlowMemory<SLOW, SLOW_INPUTS>, SLOW>,
    interval: Interval<'_>,
) -> Result<
    (<P as Fast<FAST, FAST_INPUTS>>::Evaluation, <P as Slow<SLOW, SLOW_INPUTS>>::Evaluation),
    IntegrationFailure,
>
where
    P: Fast<FAST, FAST_INPUTS> + Slow<SLOW, SLOW_INPUTS>,
{
    let mut ahead = Ahead::new(system, fast_memory, *fast_states, interval);
    let mut behind = Behind::new(system, slow_memory, *slow_states, ahead.driver(interval.from), interval);
    while behind.course.time < interval.to {
        behind.step(&mut ahead)?;
    }
    (*fast_states, *slow_states) = (ahead.course.states, behind.course.states);
    let slow = behind.end(ahead.driver(interval.to));
    Ok((ahead.end(), slow))
}

/// The fast part.
struct Ahead<'a, P: Fast<STATES, INPUTS>, const STATES: usize, const INPUTS: usize> {
    system: P,
    memory: &'a mut StepMemory<STATES, INPUTS>,
    course: Course<'a, STATES>,
    /// Its values at the end of the interval, once a trial step has reached it.
    at_end: Option<P::Evaluation>,
    /// The driver over the steps that the slow part still needs.
    drivers: [Cubic; MOST_AHEAD],
    count: usize,
}

impl<'a, P: Fast<STATES, INPUTS>, const STATES: usize, const INPUTS: usize> Ahead<'a, P, STATES, INPUTS> {
    fn new(
        system: P,
        memory: &'a mut StepMemory<STATES, INPUTS>,
        states: [f64; STATES],
        interval: Interval<'a>,
    ) -> Self {
        let slopes = memory
            .slopes(&system.inputs(interval.from))
            .unwrap_or_else(|| P::derivatives(&system.evaluate(interval.from, &states)));
        let mut course = Course::new(interval, memory.step, P::RULES, (states, slopes));
        memory.adapt_to_jump(&mut course);
        let drivers = [Cubic::default(); MOST_AHEAD];
        Self { system, memory, course, at_end: None, drivers, count: 0 }
    }

    /// Advances at least to a time, or until the memory of drivers is full.
    #[inline(never)]
    fn go_to(&mut self, time: f64) -> Result<(), IntegrationFailure> {
        while self.course.time < time && self.count < MOST_AHEAD {
            self.step()?;
        }
        Ok(())
    }

    /// Tries a step.
    fn step(&mut self) -> Result<(), IntegrationFailure> {
        let (system, course, linearization) = (self.system, &mut self.course, &mut self.memory.linearization);
        let derivatives = |time: f64, x: &[f64; STATES]| P::derivatives(&system.evaluate(time, x));
        let (begin, driver, speed) = (course.time, P::driver(&course.states), P::driver(&course.slopes));
        if linearization.is_used_up() {
            linearization.renew(
                |x| derivatives(begin, x),
                &course.states,
                &course.slopes,
                &P::RULES.magnitudes,
                P::RULES.linearization_serves,
            );
        }
        let (length, end) = course.next();
        let at_end = |x: &[f64; STATES]| {
            let evaluation = system.evaluate(end, x);
            if end >= course.interval.to {
                self.at_end = Some(evaluation);
            }
            P::derivatives(&evaluation)
        };
        let trial = linearization.prepare(length).then(|| {
            let drift = course.drift(derivatives, length, system.is_constant());
            step(linearization, derivatives, at_end, &course.begin(&drift), length)
        });
        if course.settle(trial, length, end)? {
            let drivers = [driver, P::driver(&course.states)];
            let speeds = [speed, P::driver(&course.slopes)];
            self.drivers[self.count] = Cubic::new(begin, length, drivers, speeds);
            self.count += 1;
            linearization.count();
        } else {
            linearization.discard();
        }
        Ok(())
    }

    /// The driver at a time between the slow part's and this part's.
    fn driver(&self, time: f64) -> f64 {
        let past = self.drivers[..self.count].iter().find(|cubic| time < cubic.end());
        past.map_or_else(|| P::driver(&self.course.states), |cubic| cubic.at(time))
    }

    /// Forgets the drivers before a time.
    fn forget_before(&mut self, time: f64) {
        let past = self.drivers[..self.count].iter().take_while(|cubic| cubic.end() <= time).count();
        self.drivers.copy_within(past..self.count, 0);
        self.count -= past;
    }

    /// Ends the interval. Returns the part's values there.
    fn end(&mut self) -> P::Evaluation {
        let time = self.course.time;
        self.memory.end(&self.course, self.system.inputs(time));
        self.at_end.unwrap_or_else(|| self.system.evaluate(time, &self.course.states))
    }
}

/// The slow part.
struct Behind<'a, P: Slow<STATES, INPUTS>, const STATES: usize, const INPUTS: usize> {
    system: P,
    memory: &'a mut SlowMemory<STATES, INPUTS>,
    course: Course<'a, STATES>,
    /// Its values at the end of the interval, once a trial step has reached it.
    at_end: Option<P::Evaluation>,
}

impl<'a, P: Slow<STATES, INPUTS>, const STATES: usize, const INPUTS: usize> Behind<'a, P, STATES, INPUTS> {
    fn new(
        system: P,
        memory: &'a mut SlowMemory<STATES, INPUTS>,
        states: [f64; STATES],
        driver: f64,
        interval: Interval<'a>,
    ) -> Self {
        let slopes = memory
            .memory
            .slopes(&system.inputs(interval.from))
            .unwrap_or_else(|| P::derivatives(&system.evaluate(interval.from, &states, driver)));
        let mut course = Course::new(interval, memory.memory.step, P::RULES, (states, slopes));
        memory.memory.adapt_to_jump(&mut course);
        Self { system, memory, course, at_end: None }
    }

    /// Tries a step.
    fn step<Q: Fast<FAST, FAST_INPUTS>, const FAST: usize, const FAST_INPUTS: usize>(
        &mut self,
        ahead: &mut Ahead<'_, Q, FAST, FAST_INPUTS>,
    ) -> Result<(), IntegrationFailure> {
        let (system, begin) = (self.system, self.course.time);
        if self.memory.memory.linearization.is_used_up() {
            self.linearize(ahead.driver(begin));
        }
        let (mut length, mut end) = self.course.next();
        ahead.go_to(end)?;
        if ahead.course.time < end {
            end = ahead.course.time;
            length = end - begin;
        }
        let derivatives =
            |time: f64, x: &[f64; STATES]| P::derivatives(&system.evaluate(time, x, ahead.driver(time)));
        let drift = if system.is_constant() {
            let difference = TIME_DIFFERENCE * length;
            let [effect, later] = [begin, begin + difference].map(|time| system.effect(ahead.driver(time)));
            self.memory.by_effect.map(|slope| slope * (later - effect) / difference)
        } else {
            self.course.drift(derivatives, length, false)
        };
        let (linearization, course) = (&mut self.memory.memory.linearization, &mut self.course);
        let at_end = |x: &[f64; STATES]| {
            let evaluation = system.evaluate(end, x, ahead.driver(end));
            if end >= course.interval.to {
                self.at_end = Some(evaluation);
            }
            P::derivatives(&evaluation)
        };
        let trial = linearization
            .prepare(length)
            .then(|| step(linearization, derivatives, at_end, &course.begin(&drift), length));
        if course.settle(trial, length, end)? {
            linearization.count();
            ahead.forget_before(end);
        } else {
            linearization.discard();
        }
        Ok(())
    }

    /// Linearizes the part at its present states and a driver.
    fn linearize(&mut self, driver: f64) {
        let Self { system, course, .. } = self;
        let Course { time, states, slopes, .. } = course;
        self.memory.memory.linearization.renew(
            |x| P::derivatives(&system.evaluate(*time, x, driver)),
            states,
            slopes,
            &P::RULES.magnitudes,
            P::RULES.linearization_serves,
        );
        self.memory.by_effect = system.by_effect(*time, states, slopes, driver);
    }

    /// Ends the interval. Returns the part's values there.
    fn end(&mut self, driver: f64) -> P::Evaluation {
        let time = self.course.time;
        self.memory.memory.end(&self.course, self.system.inputs(time));
        self.at_end.unwrap_or_else(|| self.system.evaluate(time, &self.course.states, driver))
    }
}
