//! How the plant goes through time.
//!
//! The actuation is cheap, swings and meets kinks (stops, the reversal of friction, the valve's change of
//! ports); the gas path is several times as expensive, stiff, does not swing, and is smooth. And as long as the
//! exhaust does not push the wastegate, the actuation drives the gas path but not the other way round. So
//! each takes the steps that suit it: the actuation goes ahead in small ones, the gas path follows
//! behind in large ones and finds the rod's position in between by the actuation's cubic interpolation.
//! Where the exhaust does push, both go together.
//!
//! Both take steps of ROS34PW2, which keep their order with a Jacobian that is out of date. A Jacobian serves for
//! 25 steps; one from before a jump of the inputs is not used any more, and the first step after the jump is short.
//!
//! Tried on the recorded experiment of the tests: 40 s in steps of 12.5 ms, the largest error of all states
//! and outputs in percent of full scale (without the rod's speed and friction, which have tolerances of their
//! own). In the last column that of ten experiments in which all inputs move at random.
//!
//! | gas path | actuation | recorded | random |
//! |---|---|---|---|
//! | Runge-Kutta, fourth order, 1/2400 s | the same | 0.002 | |
//! | Dormand-Prince 5(4) | the same | 0.012 | |
//! | Runge-Kutta-Chebyshev of second order | Dormand-Prince 5(4) | 0.010 | |
//! | Runge-Kutta-Chebyshev of second order | Bogacki-Shampine 3(2) | 0.009 | |
//! | ROS34PW2, a Jacobian a step | Dormand-Prince 5(4) | 0.014 | |
//! | ROS2, a Jacobian for 50 steps | ROS2 | 0.009 | |
//! | ROS2, a Jacobian for 100 steps that each corrects | ROS34PW2 | 0.007 | 0.08 |
//! | **ROS34PW2, a Jacobian for 25 steps, none beyond a jump** | **the same** | 0.002 | 0.008 |
//!
//! The last row is what is here: `cargo test --test plant reproduced -- --nocapture` prints its errors, `benches/run`
//! what it costs beside the first. The others are records of trials, of which the code is not kept.
//!
//! What is remembered from one communication step to the next ([`Pace`]) is the lengths of steps, the
//! linearizations and the last derivatives; it only saves work, but it belongs to the plant's state, so that
//! a restored plant goes on bit for bit.

use std::cell::Cell;

use fmi2_export::Error;
use fmi2_export::persistence::{Archive, Persistent};

use super::system::{Actuation, Evaluation, GAS_PATH_SCALES, GasPath, System};
use super::variables::{ActuationStates, GasPathStates, Inputs, StateGroups, States};
use crate::elementary::power;
use crate::solver::Trial;
use crate::solver::cubic::Cubic;
use crate::solver::rosenbrock::{Begin, Blocks, Linearization, step};
use crate::solver::step_size::{StepSize, largest_error, relative_error};

const ACTUATION: usize = ActuationStates::COUNT;
const GAS_PATH: usize = GasPathStates::COUNT;

/// The tank's pressure forgets no error, so it is judged this much more strictly than its full scale says.
const TANK_STRICTNESS: f64 = 35.0;
/// The rod's speed is fast and tiny: its errors may be this many times as large.
const ROD_SPEED_SLACK: f64 = 10.0;
/// The same for the friction force, which kinks where the rod turns. Where the exhaust pushes the wastegate there is
/// no slack: the rod creeps with its pressure then, and the errors of many steps add up.
const FRICTION_SLACK: f64 = 1.25;

/// What counts as 100 % of the actuation's states where steps are judged.
const ACTUATION_SCALES: ActuationStates = {
    let mut scales = ActuationStates::NOMINAL;
    scales.tank.pressure /= TANK_STRICTNESS;
    scales.actuator.velocity *= ROD_SPEED_SLACK;
    scales.actuator.friction_force *= FRICTION_SLACK;
    scales
};

/// The same where the exhaust pushes the wastegate.
const PUSHED_ACTUATION_SCALES: ActuationStates = {
    let mut scales = ACTUATION_SCALES;
    scales.actuator.friction_force = ActuationStates::NOMINAL.actuator.friction_force;
    scales
};

/// The flows between the volumes beside a compressor or a wastegate depend steeply on their pressures, so errors of
/// these count more than their full scales say: 0.01 % of the flow's full scale is then within reach, too. These are
/// the shares of the full scales that count as 100 %.
const BEFORE_LP_COMPRESSOR: f64 = 0.6;
const BETWEEN_COMPRESSORS: f64 = 0.3;
const BEHIND_HP_COMPRESSOR: f64 = 0.75;
const BEFORE_HP_WASTEGATE: f64 = 0.6;
const BETWEEN_WASTEGATES: f64 = 2.0 / 3.0;

/// What counts as 100 % of the gas path's states where steps are judged.
const GAS_PATH_ERROR_SCALES: GasPathStates = {
    let mut scales = GAS_PATH_SCALES;
    scales.air_filter.pressure *= BEFORE_LP_COMPRESSOR;
    scales.lp_compressor.outlet_pressure *= BETWEEN_COMPRESSORS;
    scales.hp_compressor.outlet_pressure *= BEHIND_HP_COMPRESSOR;
    scales.exhaust_manifold.pressure *= BEFORE_HP_WASTEGATE;
    scales.interstage_exhaust.pressure *= BETWEEN_WASTEGATES;
    scales
};

/// The least that each state of the gas path can be: no pressure is negative, and no shaft turns backwards.
const GAS_PATH_LEAST: GasPathStates = {
    let mut least = GasPathStates::MIN;
    least.hp_shaft.speed = 0.0;
    least.lp_shaft.speed = 0.0;
    least
};

/// The share of the tolerance for the error of a single step of the actuation: the errors of several steps
/// and of the kinks add up, and what the gas path makes of the rod's position is up to three times as much.
/// Found by experiment, like that of the gas path.
const ACTUATION_SHARE: f64 = 0.1;
/// The same for the gas path.
const GAS_PATH_SHARE: f64 = 0.3;
/// For how many steps at most a linearization serves.
const LINEARIZATION_SERVES: u32 = 25;

/// A jump of the inputs changes the slopes at once. Where this alone would change the states by more than so
/// many tolerances over the step that was proposed before, the linearization belongs to another place.
const JUMP_RENEWS: f64 = 100.0;
/// How the first step after a jump is shortened: by a power of the ratio to so many tolerances. A step that is
/// long and damps the fast modes would not see that the jump has excited them.
#[derive(Clone, Copy, Debug)]
struct JumpLaw {
    tolerances: f64,
    exponent: f64,
}

/// For the actuation, whose rod swings. Found by experiment, like that of the gas path.
const ACTUATION_JUMPS: JumpLaw = JumpLaw { tolerances: 10.0, exponent: 0.5 };
/// The same for the gas path.
const GAS_PATH_JUMPS: JumpLaw = JumpLaw { tolerances: 30.0, exponent: 1.0 / 3.0 };

/// The length of the first steps in s.
const FIRST_STEP: f64 = 1e-3;
/// The longest step in s.
const LONGEST_STEP: f64 = 0.025;
/// The length in s below which a step that does not meet its tolerance is given up.
const SMALLEST_STEP: f64 = 1e-9;
/// How many steps a call may try whatever its length …
const MOST_TRIALS: f64 = 50_000.0;
/// … and for each second of it: 20 times as many as where nothing happens.
const MOST_TRIALS_PER_SECOND: f64 = 2_000.0;
/// The difference of times, relative to a step, for derivatives with respect to time.
const TIME_DIFFERENCE: f64 = 1e-3;
/// The difference of shares of the wastegate's area for derivatives with respect to it.
const AREA_DIFFERENCE: f64 = 1e-3;
/// How many steps the actuation may be ahead.
const MOST_AHEAD: usize = 16;
/// What is remembered from one communication step to the next.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    actuation: Memory<ACTUATION, ACTUATION_INPUTS>,
    gas_path: Memory<GAS_PATH, GAS_PATH_INPUTS>,
    /// The derivatives of the gas path's derivatives with respect to the share of the wastegate's area.
    by_area: [f64; GAS_PATH],
    /// Whether the vacuum tank was held: the actuation's derivatives are others then.
    tank_is_frozen: bool,
}

fmi2_export::persistent!(Pace { actuation, gas_path, by_area, tank_is_frozen });

impl Default for Pace {
    fn default() -> Self {
        Self {
            actuation: Memory::default(),
            gas_path: Memory::default(),
            by_area: [0.0; GAS_PATH],
            tank_is_frozen: false,
        }
    }
}

/// What is remembered of a half of the plant, with so many states and inputs.
#[derive(Clone, Copy, Debug)]
struct Memory<const STATES: usize, const INPUTS: usize> {
    /// The length of the next step in s.
    step: f64,
    linearization: Linearization<STATES>,
    /// The derivatives at the end of the last communication step, …
    slopes: [f64; STATES],
    /// … and the inputs that they belong to; not numbers where there are none.
    inputs: [f64; INPUTS],
}

impl<const STATES: usize, const INPUTS: usize> Persistent for Memory<STATES, INPUTS> {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let Self { step, linearization, slopes, inputs } = self;
        step.persist(archive)?;
        linearization.persist(archive)?;
        slopes.persist(archive)?;
        inputs.persist(archive)
    }
}

impl<const STATES: usize, const INPUTS: usize> Default for Memory<STATES, INPUTS> {
    fn default() -> Self {
        Self {
            step: FIRST_STEP,
            linearization: Linearization::default(),
            slopes: [0.0; STATES],
            inputs: [f64::NAN; INPUTS],
        }
    }
}

impl<const STATES: usize, const INPUTS: usize> Memory<STATES, INPUTS> {
    /// The derivatives where the last communication step ended, if they are those with these inputs.
    fn slopes(&self, inputs: &[f64; INPUTS]) -> Option<[f64; STATES]> {
        let is_same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits();
        self.inputs.iter().zip(inputs).all(is_same).then_some(self.slopes)
    }

    /// Adapts to slopes that have jumped since the last communication step.
    fn adapt_to_jump(&mut self, course: &mut Course<'_, STATES>, law: JumpLaw) {
        if self.inputs[0].is_nan() {
            return;
        }
        let (length, _) = course.next();
        let jump = std::array::from_fn(|i| length * (course.slopes[i] - self.slopes[i]));
        let jump = relative_error(&course.states, &jump, &course.weights);
        if jump > JUMP_RENEWS {
            self.linearization.discard();
        }
        if jump > law.tolerances {
            course.steps.next = length * power(law.tolerances / jump, law.exponent);
        }
    }

    /// Remembers where a communication step ends.
    fn end(&mut self, course: &Course<'_, STATES>, inputs: [f64; INPUTS]) {
        (self.step, self.slopes, self.inputs) = (course.steps.next, course.slopes, inputs);
    }
}

/// How many inputs the actuation has.
const ACTUATION_INPUTS: usize = 5;
/// How many inputs the gas path has.
const GAS_PATH_INPUTS: usize = 7;

/// The inputs that the actuation sees.
fn actuation_inputs(inputs: &Inputs) -> [f64; ACTUATION_INPUTS] {
    [
        inputs.hp_wastegate_pwm,
        inputs.vacuum_pump,
        inputs.supply_voltage,
        inputs.ambient_pressure,
        inputs.ambient_temperature,
    ]
}

/// The inputs that the gas path sees.
fn gas_path_inputs(inputs: &Inputs) -> [f64; GAS_PATH_INPUTS] {
    [
        inputs.engine_speed,
        inputs.throttle,
        inputs.lp_wastegate,
        inputs.hp_bypass,
        inputs.surge_valve,
        inputs.ambient_pressure,
        inputs.ambient_temperature,
    ]
}

/// Why the states at the end of an interval are not known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Failure {
    /// The time in s until which they are.
    pub time: f64,
    /// The name of the state whose error is too large.
    pub state: &'static str,
}

/// The steps that a call may still try, so that it ends in bounded time.
#[derive(Debug)]
pub struct Budget(Cell<f64>);

impl Budget {
    /// The budget of a call that advances the plant by a duration in s.
    #[must_use]
    pub fn new(duration: f64) -> Self {
        Self(Cell::new(MOST_TRIALS + MOST_TRIALS_PER_SECOND * duration))
    }

    /// Counts a trial. Whether another one is allowed.
    fn spend(&self) -> bool {
        self.0.set(self.0.get() - 1.0);
        self.0.get() > 0.0
    }
}

/// An interval of time to go through.
#[derive(Clone, Copy, Debug)]
pub struct Interval<'a> {
    /// Its begin in s.
    pub from: f64,
    /// Its end in s.
    pub to: f64,
    /// The error that the states may have, relative to their full scales.
    pub tolerance: f64,
    /// What the call may spend on this interval and those after it.
    pub budget: &'a Budget,
}

impl Interval<'_> {
    /// Whether no more steps are tried after one that was taken or not.
    fn is_given_up(&self, steps: &StepSize, taken: bool) -> bool {
        !self.budget.spend() || !taken && steps.next < SMALLEST_STEP
    }
}

/// The inputs during an interval.
#[derive(Clone, Copy, Debug)]
pub struct Signal<F> {
    /// The inputs at a time in s.
    pub at: F,
    /// Whether they are the same at any time.
    pub is_constant: bool,
}

impl Pace {
    /// Advances the states of a plant over an interval. Returns what everything does at its end.
    ///
    /// # Errors
    /// Where a step does not meet the tolerance however short it is, or too many are needed; the states are
    /// then worthless.
    pub fn advance(
        &mut self,
        system: &System,
        signal: &Signal<impl Fn(f64) -> Inputs>,
        states: &mut States,
        interval: Interval<'_>,
    ) -> Result<Evaluation, Failure> {
        if self.tank_is_frozen != system.is_tank_frozen() {
            self.tank_is_frozen = system.is_tank_frozen();
            self.actuation = Memory { step: self.actuation.step, ..Memory::default() };
        }
        if system.actuator.exhaust_area == 0.0 {
            self.advance_apart(system, signal, states, interval)
        } else {
            self.advance_together(system, signal, states, interval)
        }
    }

    /// Advances the actuation and the gas path each with its own steps.
    fn advance_apart(
        &mut self,
        system: &System,
        signal: &Signal<impl Fn(f64) -> Inputs>,
        states: &mut States,
        interval: Interval<'_>,
    ) -> Result<Evaluation, Failure> {
        let (actuation, gas_path) = (ActuationStates::of(states), GasPathStates::of(states));
        let mut ahead = Ahead::new(&mut self.actuation, system, signal, actuation, interval);
        let mut behind = Behind::new((&mut self.gas_path, &mut self.by_area), &ahead, gas_path, interval);
        while behind.course.time < interval.to {
            behind.step(&mut ahead)?;
        }
        *states = States::from_groups(StateGroups {
            actuation: ActuationStates::from_array(ahead.course.states),
            gas_path: GasPathStates::from_array(behind.course.states),
        });
        Ok(Evaluation { gas_path: behind.end(ahead.opening(interval.to)), actuation: ahead.end() })
    }

    /// Advances everything with the same steps. What couples the halves is left out of the linearization.
    fn advance_together(
        &mut self,
        system: &System,
        signal: &Signal<impl Fn(f64) -> Inputs>,
        states: &mut States,
        interval: Interval<'_>,
    ) -> Result<Evaluation, Failure> {
        let inputs = &signal.at;
        let evaluate = |time: f64, x: &[f64; States::COUNT]| {
            let (actuation, gas_path) = split(x);
            system.evaluate(&inputs(time), &States::from_groups(StateGroups { actuation, gas_path }))
        };
        let derivatives = |time: f64, x: &[f64; States::COUNT]| {
            let Evaluation { actuation, gas_path } = evaluate(time, x);
            joined(&actuation.derivatives, &gas_path.derivatives)
        };
        let scales = joined(&PUSHED_ACTUATION_SCALES, &GAS_PATH_ERROR_SCALES);
        let least = joined(&ActuationStates::MIN, &GAS_PATH_LEAST);
        let begin = joined(&ActuationStates::of(states), &GasPathStates::of(states));
        let slopes = derivatives(interval.from, &begin);
        let mut course =
            Course::new(interval, self.actuation.step, (&scales, ACTUATION_SHARE), least, (begin, slopes));
        loop {
            let (length, end) = course.next();
            self.linearize(system, &inputs(course.time), &course);
            let (actuation, gas_path) = (&mut self.actuation.linearization, &mut self.gas_path.linearization);
            let is_ready = actuation.prepare(length) && gas_path.prepare(length);
            let trial = is_ready.then(|| {
                let drift = course.drift(derivatives, length, signal.is_constant);
                let at_end = |x: &[f64; States::COUNT]| derivatives(end, x);
                step(&Blocks(actuation, gas_path), derivatives, at_end, &course.begin(&drift), length)
            });
            let name = |state: usize| match state.checked_sub(ACTUATION) {
                None => ActuationStates::NAMES[state],
                Some(state) => GasPathStates::NAMES[state],
            };
            if course.settle(trial, length, end, name)? {
                actuation.count();
                gas_path.count();
                if course.time >= interval.to {
                    let (actuation, gas_path) = split(&course.states);
                    *states = States::from_groups(StateGroups { actuation, gas_path });
                    self.actuation.step = course.steps.next;
                    return Ok(system.evaluate(&inputs(interval.to), states));
                }
            } else {
                actuation.discard();
                gas_path.discard();
            }
        }
    }

    /// Linearizes the halves of everything anew where they are used up.
    fn linearize(&mut self, system: &System, inputs: &Inputs, course: &Course<'_, { States::COUNT }>) {
        let (actuation, gas_path) = split(&course.states);
        let (actuation_slopes, gas_path_slopes) = split(&course.slopes);
        let (difference, opening) =
            (System::exhaust_difference(&gas_path), system.actuator.opening(actuation.actuator.position));
        if self.actuation.linearization.is_used_up() {
            self.actuation.linearization.renew(
                |x| actuate(system, inputs, x, difference).derivatives.to_array(),
                &actuation.to_array(),
                &actuation_slopes.to_array(),
                &ACTUATION_SCALES.to_array(),
                LINEARIZATION_SERVES,
            );
        }
        if self.gas_path.linearization.is_used_up() {
            self.gas_path.linearization.renew(
                |x| follow(system, inputs, x, opening).derivatives.to_array(),
                &gas_path.to_array(),
                &gas_path_slopes.to_array(),
                &GAS_PATH_SCALES.to_array(),
                LINEARIZATION_SERVES,
            );
        }
    }
}

/// The states of actuation and gas path one after the other.
fn joined(actuation: &ActuationStates, gas_path: &GasPathStates) -> [f64; States::COUNT] {
    let mut states = [0.0; States::COUNT];
    states[..ACTUATION].copy_from_slice(&actuation.to_array());
    states[ACTUATION..].copy_from_slice(&gas_path.to_array());
    states
}

/// The inverse of [`joined`].
fn split(states: &[f64; States::COUNT]) -> (ActuationStates, GasPathStates) {
    (
        ActuationStates::from_array(std::array::from_fn(|i| states[i])),
        GasPathStates::from_array(std::array::from_fn(|i| states[ACTUATION + i])),
    )
}

/// What the actuation does with states as an array.
#[inline]
fn actuate(
    system: &System,
    inputs: &Inputs,
    states: &[f64; ACTUATION],
    exhaust_difference: f64,
) -> Actuation {
    system.actuation(inputs, &ActuationStates::from_array(*states), exhaust_difference)
}

/// What the gas path does with states as an array, behind an opening of the wastegate.
#[inline]
fn follow(system: &System, inputs: &Inputs, states: &[f64; GAS_PATH], opening: f64) -> GasPath {
    system.gas_path(inputs, &GasPathStates::from_array(*states), opening)
}

/// The states of a system on their way through an interval.
struct Course<'a, const N: usize> {
    interval: Interval<'a>,
    /// The reciprocals of the errors that a step may have.
    weights: [f64; N],
    /// The least that each state can be. A step that leads below it was too long.
    least: [f64; N],
    steps: StepSize,
    /// How far it is.
    time: f64,
    states: [f64; N],
    slopes: [f64; N],
}

impl<'a, const N: usize> Course<'a, N> {
    /// A course from states with their derivatives; a step's error may be a share of the tolerance, relative to
    /// the scales, and no state falls below its least value.
    fn new(
        interval: Interval<'a>,
        first_step: f64,
        (scales, share): (&[f64; N], f64),
        least: [f64; N],
        (states, slopes): ([f64; N], [f64; N]),
    ) -> Self {
        Self {
            interval,
            weights: scales.map(|scale| (scale * interval.tolerance * share).recip()),
            least,
            steps: StepSize::new(first_step, LONGEST_STEP),
            time: interval.from,
            states,
            slopes,
        }
    }

    /// The length of the next step in s, and the time at which it ends.
    fn next(&self) -> (f64, f64) {
        let left = self.interval.to - self.time;
        let length = self.steps.within(left);
        (length, if length >= left { self.interval.to } else { self.time + length })
    }

    /// Where the next step begins.
    fn begin<'b>(&'b self, drift: &'b [f64; N]) -> Begin<'b, N> {
        Begin { time: self.time, states: &self.states, slopes: &self.slopes, drift }
    }

    /// How the derivatives change with time alone, at the begin of a step of a length.
    fn drift(
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

    /// Takes a step, or has it tried again with another length. Without a trial there was no way to compute it.
    fn settle(
        &mut self,
        trial: Option<Trial<N>>,
        length: f64,
        end: f64,
        name: impl Fn(usize) -> &'static str,
    ) -> Result<bool, Failure> {
        let (states, mut errors) =
            trial.map_or((self.states, [f64::INFINITY; N]), |trial| (trial.states, trial.error));
        for ((error, state), least) in errors.iter_mut().zip(&states).zip(&self.least) {
            if state < least {
                *error = f64::INFINITY;
            }
        }
        let error = relative_error(&states, &errors, &self.weights);
        let taken = self.steps.judge(length, error);
        if self.interval.is_given_up(&self.steps, taken) {
            let state = name(largest_error(&states, &errors, &self.weights));
            return Err(Failure { time: self.time, state });
        }
        if let Some(trial) = trial
            && taken
        {
            (self.time, self.states, self.slopes) = (end, trial.states, trial.slopes);
        }
        Ok(taken)
    }
}

impl Course<'_, ACTUATION> {
    /// The rod's position and speed.
    fn rod(&self) -> [f64; 2] {
        [self.states, self.slopes].map(|values| ActuationStates::from_array(values).actuator.position)
    }
}

/// The actuation, which goes ahead of the gas path.
struct Ahead<'a, F> {
    system: &'a System,
    signal: &'a Signal<F>,
    memory: &'a mut Memory<ACTUATION, ACTUATION_INPUTS>,
    course: Course<'a, ACTUATION>,
    /// What it does at the end of the interval, once a step was tried that leads there.
    actuation: Option<Actuation>,
    /// The rod's position over the steps that the gas path has not left behind.
    positions: [Cubic; MOST_AHEAD],
    count: usize,
}

impl<'a, F: Fn(f64) -> Inputs> Ahead<'a, F> {
    fn new(
        memory: &'a mut Memory<ACTUATION, ACTUATION_INPUTS>,
        system: &'a System,
        signal: &'a Signal<F>,
        states: ActuationStates,
        interval: Interval<'a>,
    ) -> Self {
        let inputs = (signal.at)(interval.from);
        let slopes = memory
            .slopes(&actuation_inputs(&inputs))
            .unwrap_or_else(|| system.actuation(&inputs, &states, 0.0).derivatives.to_array());
        let scales = (&ACTUATION_SCALES.to_array(), ACTUATION_SHARE);
        let (least, states) = (ActuationStates::MIN.to_array(), states.to_array());
        let mut course = Course::new(interval, memory.step, scales, least, (states, slopes));
        memory.adapt_to_jump(&mut course, ACTUATION_JUMPS);
        Self {
            course,
            system,
            signal,
            memory,
            actuation: None,
            positions: [Cubic::default(); MOST_AHEAD],
            count: 0,
        }
    }

    /// Goes on at least to a time, or as far as the memory of positions reaches.
    #[inline(never)]
    fn go_to(&mut self, time: f64) -> Result<(), Failure> {
        while self.course.time < time && self.count < MOST_AHEAD {
            self.step()?;
        }
        Ok(())
    }

    /// Tries a step.
    fn step(&mut self) -> Result<(), Failure> {
        let (system, inputs) = (self.system, &self.signal.at);
        let evaluate = |time: f64, x: &[f64; ACTUATION]| actuate(system, &inputs(time), x, 0.0);
        let (course, linearization) = (&mut self.course, &mut self.memory.linearization);
        let (begin, at_begin) = (course.time, course.rod());
        if linearization.is_used_up() {
            linearization.renew(
                |x| evaluate(begin, x).derivatives.to_array(),
                &course.states,
                &course.slopes,
                &ACTUATION_SCALES.to_array(),
                LINEARIZATION_SERVES,
            );
        }
        let (length, end) = course.next();
        let derivatives = |time: f64, x: &[f64; ACTUATION]| evaluate(time, x).derivatives.to_array();
        let at_end = |x: &[f64; ACTUATION]| {
            let actuation = evaluate(end, x);
            if end >= course.interval.to {
                self.actuation = Some(actuation);
            }
            actuation.derivatives.to_array()
        };
        let trial = linearization.prepare(length).then(|| {
            let drift = course.drift(derivatives, length, self.signal.is_constant);
            step(linearization, derivatives, at_end, &course.begin(&drift), length)
        });
        if course.settle(trial, length, end, |state| ActuationStates::NAMES[state])? {
            let [positions, speeds] = std::array::from_fn(|i| [at_begin[i], course.rod()[i]]);
            self.positions[self.count] = Cubic::new(begin, length, positions, speeds);
            self.count += 1;
            linearization.count();
        } else {
            linearization.discard();
        }
        Ok(())
    }

    /// The wastegate's opening at a time between that of the gas path and the own.
    fn opening(&self, time: f64) -> f64 {
        let past = self.positions[..self.count].iter().find(|cubic| time < cubic.end());
        let position = past.map_or(self.course.rod()[0], |cubic| cubic.at(time));
        self.system.actuator.opening(position)
    }

    /// Forgets the positions before a time.
    fn forget_before(&mut self, time: f64) {
        let past = self.positions[..self.count].iter().take_while(|cubic| cubic.end() <= time).count();
        self.positions.copy_within(past..self.count, 0);
        self.count -= past;
    }

    /// Ends the interval. Returns what the actuation does there.
    fn end(&mut self) -> Actuation {
        let inputs = (self.signal.at)(self.course.time);
        self.memory.end(&self.course, actuation_inputs(&inputs));
        self.actuation.unwrap_or_else(|| actuate(self.system, &inputs, &self.course.states, 0.0))
    }
}

/// The gas path, which follows the actuation.
struct Behind<'a, F> {
    system: &'a System,
    signal: &'a Signal<F>,
    memory: &'a mut Memory<GAS_PATH, GAS_PATH_INPUTS>,
    /// See [`Pace::by_area`].
    by_area: &'a mut [f64; GAS_PATH],
    course: Course<'a, GAS_PATH>,
    /// What it does at the end of the interval, once a step was tried that leads there.
    gas_path: Option<GasPath>,
}

impl<'a, F: Fn(f64) -> Inputs> Behind<'a, F> {
    fn new(
        (memory, by_area): (&'a mut Memory<GAS_PATH, GAS_PATH_INPUTS>, &'a mut [f64; GAS_PATH]),
        ahead: &Ahead<'a, F>,
        states: GasPathStates,
        interval: Interval<'a>,
    ) -> Self {
        let (system, signal) = (ahead.system, ahead.signal);
        let inputs = (signal.at)(interval.from);
        let slopes = memory.slopes(&gas_path_inputs(&inputs)).unwrap_or_else(|| {
            system.gas_path(&inputs, &states, ahead.opening(interval.from)).derivatives.to_array()
        });
        let scales = (&GAS_PATH_ERROR_SCALES.to_array(), GAS_PATH_SHARE);
        let (least, states) = (GAS_PATH_LEAST.to_array(), states.to_array());
        let mut course = Course::new(interval, memory.step, scales, least, (states, slopes));
        memory.adapt_to_jump(&mut course, GAS_PATH_JUMPS);
        Self { system, signal, memory, by_area, course, gas_path: None }
    }

    /// Tries a step.
    fn step(&mut self, ahead: &mut Ahead<'_, F>) -> Result<(), Failure> {
        let (system, inputs, begin) = (self.system, &self.signal.at, self.course.time);
        if self.memory.linearization.is_used_up() {
            self.linearize(ahead.opening(begin));
        }
        let (mut length, mut end) = self.course.next();
        ahead.go_to(end)?;
        if ahead.course.time < end {
            end = ahead.course.time;
            length = end - begin;
        }
        let drift = self.drift(ahead, length);
        let (linearization, course) = (&mut self.memory.linearization, &mut self.course);
        let evaluate = |time: f64, x: &[f64; GAS_PATH]| follow(system, &inputs(time), x, ahead.opening(time));
        let at_end = |x: &[f64; GAS_PATH]| {
            let gas_path = evaluate(end, x);
            if end >= course.interval.to {
                self.gas_path = Some(gas_path);
            }
            gas_path.derivatives.to_array()
        };
        let trial = linearization.prepare(length).then(|| {
            let derivatives = |time: f64, x: &[f64; GAS_PATH]| evaluate(time, x).derivatives.to_array();
            step(linearization, derivatives, at_end, &course.begin(&drift), length)
        });
        if course.settle(trial, length, end, |state| GasPathStates::NAMES[state])? {
            linearization.count();
            ahead.forget_before(end);
        } else {
            linearization.discard();
        }
        Ok(())
    }

    /// Linearizes the gas path where it is, at an opening of the wastegate.
    fn linearize(&mut self, opening: f64) {
        let Self { system, course, .. } = self;
        let inputs = (self.signal.at)(course.time);
        let derivatives = |x: &[f64; GAS_PATH]| follow(system, &inputs, x, opening).derivatives.to_array();
        self.memory.linearization.renew(
            derivatives,
            &course.states,
            &course.slopes,
            &GAS_PATH_SCALES.to_array(),
            LINEARIZATION_SERVES,
        );
        let area = opening * opening;
        let moved = if area < 0.5 { area + AREA_DIFFERENCE } else { area - AREA_DIFFERENCE };
        let slopes = follow(system, &inputs, &course.states, moved.sqrt()).derivatives.to_array();
        *self.by_area = std::array::from_fn(|i| (slopes[i] - course.slopes[i]) / (moved - area));
    }

    /// How the derivatives change with time alone, at the begin of a step of a length.
    fn drift(&self, ahead: &Ahead<'_, F>, length: f64) -> [f64; GAS_PATH] {
        let Course { time, .. } = self.course;
        if self.signal.is_constant {
            let difference = TIME_DIFFERENCE * length;
            let [area, later] = [time, time + difference].map(|time| ahead.opening(time).powi(2));
            self.by_area.map(|slope| slope * (later - area) / difference)
        } else {
            let derivatives = |time: f64, x: &[f64; GAS_PATH]| {
                follow(self.system, &(self.signal.at)(time), x, ahead.opening(time)).derivatives.to_array()
            };
            self.course.drift(derivatives, length, false)
        }
    }

    /// Ends the interval. Returns what the gas path does there.
    fn end(&mut self, opening: f64) -> GasPath {
        let inputs = (self.signal.at)(self.course.time);
        self.memory.end(&self.course, gas_path_inputs(&inputs));
        self.gas_path.unwrap_or_else(|| follow(self.system, &inputs, &self.course.states, opening))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::initialization::running;
    use crate::plant::variables::Parameters;

    /// The states after 2 s of inputs that change at 0.5 s and 1 s, taken in equal intervals.
    fn travelled(system: &System, tolerance: f64, intervals: u32) -> States {
        let mut pace = Pace::default();
        let mut states = running(system, &Inputs::default(), 32_500.0);
        for n in 0..intervals {
            let (from, to) =
                (2.0 * f64::from(n) / f64::from(intervals), 2.0 * f64::from(n + 1) / f64::from(intervals));
            let (duty, speed) = if from < 0.5 - 1e-9 {
                (20.0, 1500.0)
            } else if from < 1.0 - 1e-9 {
                (80.0, 1500.0)
            } else {
                (60.0, 2500.0)
            };
            let inputs = Inputs { hp_wastegate_pwm: duty, engine_speed: speed, ..Inputs::default() };
            let signal = Signal { at: |_| inputs, is_constant: true };
            pace.advance(
                system,
                &signal,
                &mut states,
                Interval { from, to, tolerance, budget: &Budget::new(1.0) },
            )
            .unwrap();
        }
        states
    }

    /// The largest difference relative to the full scales; the rod's speed and the friction force count
    /// where they are compared in the trace alone.
    fn difference(a: &States, b: &States) -> f64 {
        let mut scales = ACTUATION_SCALES;
        scales.tank.pressure = ActuationStates::NOMINAL.tank.pressure;
        let scales = States::from_groups(StateGroups { actuation: scales, gas_path: GAS_PATH_SCALES });
        let mut largest = 0.0_f64;
        let _ = a.combine(b, &mut |a, b| (a - b).abs()).combine(&scales, &mut |error, scale| {
            largest = largest.max(error / scale);
        });
        largest
    }

    fn system(exhaust_area: f64) -> System {
        let mut parameters = Parameters::default();
        parameters.actuator.exhaust_area = exhaust_area;
        System::new(&parameters)
    }

    #[test]
    fn less_is_left_of_the_error_the_smaller_the_tolerance() {
        let system = system(0.0);
        let exact = travelled(&system, 1e-8, 160);
        let mut last = f64::INFINITY;
        for tolerance in [1e-3, 1e-4, 1e-5, 1e-6] {
            let error = difference(&travelled(&system, tolerance, 160), &exact);
            assert!(error < tolerance && error < 0.7 * last, "{error:e} with {tolerance:e}");
            last = error;
        }
    }

    #[test]
    fn the_steps_of_the_master_do_not_matter() {
        let system = system(0.0);
        let expected = travelled(&system, 1e-4, 160);
        for intervals in [4, 20, 2000] {
            let found = difference(&travelled(&system, 1e-4, intervals), &expected);
            assert!(found < 1e-4, "{found:e} with {intervals} intervals");
        }
    }

    #[test]
    fn together_it_goes_the_same_way_as_apart() {
        // An area on which the exhaust pushes with 1e-15 N.
        let found = difference(&travelled(&system(1e-20), 1e-4, 160), &travelled(&system(0.0), 1e-4, 160));
        assert!(found < 1e-4, "{found:e}");
    }

    #[test]
    fn what_cannot_be_integrated_is_told() {
        type Damage = fn(&mut States);
        let chamber: Damage = |states| states.actuator.chamber_pressure = f64::NAN;
        let intercooler: Damage = |states| states.intercooler.outlet_pressure = f64::NAN;
        for (exhaust_area, damage) in [(0.0, chamber), (0.0, intercooler), (1e-4, intercooler)] {
            let system = system(exhaust_area);
            let inputs = Inputs::default();
            let mut states = running(&system, &inputs, 32_500.0);
            damage(&mut states);
            let signal = Signal { at: |_| inputs, is_constant: true };
            let budget = Budget::new(0.5);
            let interval = Interval { from: 0.5, to: 1.0, tolerance: 1e-4, budget: &budget };
            let failure = Pace::default().advance(&system, &signal, &mut states, interval).unwrap_err();
            assert!((failure.time - 0.5).abs() < f64::EPSILON, "{failure:?}");
        }
    }
}
