//! How the plant goes through time.
//!
//! The actuation is cheap, swings and meets kinks (stops, the reversal of friction, the valve's change of
//! ports); the gas path is ten times as expensive, stiff, does not swing, and is smooth. And as long as the
//! exhaust does not push the wastegate, the actuation drives the gas path but not the other way round. So
//! each takes the steps that suit it: the actuation goes ahead in small ones, the gas path follows in large
//! ones and finds the rod's position in between by the actuation's cubic interpolation. Where the exhaust
//! does push, both go together.
//!
//! Tried on the recorded experiment of the tests: 40 s in steps of 12.5 ms, the largest error of all states
//! and outputs in percent of full scale (without the rod's speed and friction, which have tolerances of their
//! own) and evaluations in a step of 12.5 ms, averaged over all 3200, Jacobians included. One of the gas path
//! costs as much as twelve of the actuation.
//!
//! | gas path | actuation | error | gas path | actuation |
//! |---|---|---|---|---|
//! | Runge-Kutta, fourth order, 1/2400 s | the same | 0.002 | 120 | 120 |
//! | Dormand-Prince 5(4) | the same | 0.012 | 44 | 23 |
//! | Runge-Kutta-Chebyshev of second order | Dormand-Prince 5(4) | 0.010 | 9 | 27 |
//! | Runge-Kutta-Chebyshev of second order | Bogacki-Shampine 3(2) | 0.009 | 9 | 18 |
//! | ROS34PW2, a Jacobian a step | Dormand-Prince 5(4) | 0.014 | 18 | 23 |
//! | ROS34PW2, a Jacobian until a step fails | Dormand-Prince 5(4) | 0.010 | 8 | 23 |
//! | ROS2, a Jacobian for 50 steps | ROS2 | 0.009 | 4 | 12 |
//! | **ROS2, a Jacobian for 25 steps** | **ROS34PW2** | 0.007 | 3.5 | 11 |
//!
//! With Bogacki-Shampine and ROS2 in the actuation the rod's speed or the friction force missed its own
//! tolerance besides.
//!
//! What is remembered from one communication step to the next ([`Pace`]) is the lengths of steps, the
//! linearizations and the last derivatives; it only saves work, but it belongs to the plant's state, so that
//! a restored plant goes on bit for bit.

use super::system::{ACTUATION, GAS_PATH, GAS_PATH_SCALES, GasPath, System};
use super::variables::{Inputs, States};
use crate::solver::bogacki_shampine;
use crate::solver::cubic::Cubic;
use crate::solver::rosenbrock::{self, Begin, Linearization};
use crate::solver::step_size::{StepSize, largest_error, relative_error};

/// What counts as 100 % of the actuation's states, in their order and units: for the rod's speed and the
/// friction force, which are fast and tiny, ten times what they reach; for the tank's pressure, which forgets
/// no error, a thirtieth of it.
const ACTUATION_SCALES: [f64; ACTUATION] = [20.0, 100.0, 1e3, 1e5, 1e-2, 1.0, 2.0];

/// The share of the tolerance for the error of a single step of the actuation: the errors of several steps
/// and of the kinks add up, and what the gas path makes of the rod's position is up to three times as much.
/// Found by experiment, like that of the gas path.
const ACTUATION_SHARE: f64 = 0.2;
/// The same for the gas path.
const GAS_PATH_SHARE: f64 = 0.25;
/// For how many steps at most a linearization serves.
const LINEARIZATION_SERVES: u32 = 25;

/// The length of the first steps in s.
const FIRST_STEP: f64 = 1e-3;
/// The longest step in s.
const LONGEST_STEP: f64 = 0.025;
/// The length in s below which a step that does not meet its tolerance is given up.
const SMALLEST_STEP: f64 = 1e-9;
/// How many steps may be tried in an interval: so many, …
const MOST_TRIALS: f64 = 100_000.0;
/// … and so many for each second. Where more are needed, who waits would take it for the end of all things.
const MOST_TRIALS_PER_SECOND: f64 = 100_000.0;
/// The difference of times, relative to a step, for the actuation's derivatives with respect to time.
const TIME_DIFFERENCE: f64 = 1e-3;
/// How many steps the actuation may be ahead.
const MOST_AHEAD: usize = 16;
/// The place of the rod's position among the actuation's states.
const POSITION: usize = 4;

/// What is remembered from one communication step to the next.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// The length of the actuation's next step in s, or that of everything's.
    actuation_step: f64,
    actuation: Linearization<ACTUATION>,
    /// The length of the gas path's next step in s.
    gas_path_step: f64,
    gas_path: Linearization<GAS_PATH>,
    /// The derivatives of the gas path's derivatives with respect to the wastegate's opening.
    by_opening: [f64; GAS_PATH],
    /// The gas path's derivatives at the end of the last communication step, …
    slopes: [f64; GAS_PATH],
    /// … and the inputs that they belong to; not numbers where there are none.
    inputs: [f64; GAS_PATH_INPUTS],
}

fmi2_export::persistent!(Pace {
    actuation_step,
    actuation,
    gas_path_step,
    gas_path,
    by_opening,
    slopes,
    inputs
});

impl Default for Pace {
    fn default() -> Self {
        Self {
            actuation_step: FIRST_STEP,
            actuation: Linearization::default(),
            gas_path_step: FIRST_STEP,
            gas_path: Linearization::default(),
            by_opening: [0.0; GAS_PATH],
            slopes: [0.0; GAS_PATH],
            inputs: [f64::NAN; GAS_PATH_INPUTS],
        }
    }
}

/// How many inputs the gas path has.
const GAS_PATH_INPUTS: usize = 7;

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
    /// The state whose error is too large.
    pub state: usize,
}

/// An interval of time to go through.
#[derive(Clone, Copy, Debug)]
pub struct Interval {
    /// Its begin in s.
    pub from: f64,
    /// Its end in s.
    pub to: f64,
    /// The error that the states may have, relative to their full scales.
    pub tolerance: f64,
}

impl Interval {
    /// Whether no more steps are tried after one that was taken or not.
    fn is_given_up(&self, steps: &StepSize, taken: bool) -> bool {
        let most = MOST_TRIALS + MOST_TRIALS_PER_SECOND * (self.to - self.from);
        steps.tried as f64 > most || !taken && steps.next < SMALLEST_STEP
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
    /// Advances the states of a plant over an interval. Returns what the gas path does at its end, where
    /// that is known.
    ///
    /// # Errors
    /// Where a step does not meet the tolerance however short it is, or too many are needed; the states are
    /// then worthless.
    pub fn advance(
        &mut self,
        system: &System,
        signal: Signal<impl Fn(f64) -> Inputs>,
        states: &mut [f64; States::COUNT],
        interval: Interval,
    ) -> Result<Option<GasPath>, Failure> {
        if system.actuator.exhaust_area == 0.0 {
            self.advance_apart(system, &signal, states, interval).map(Some)
        } else {
            self.advance_together(system, signal.at, states, interval).map(|()| None)
        }
    }

    /// Advances everything with the same steps.
    fn advance_together(
        &mut self,
        system: &System,
        inputs: impl Fn(f64) -> Inputs,
        states: &mut [f64; States::COUNT],
        interval: Interval,
    ) -> Result<(), Failure> {
        let weights = std::array::from_fn(|i| {
            let scale = if i < ACTUATION { ACTUATION_SCALES[i] } else { GAS_PATH_SCALES[i - ACTUATION] };
            (interval.tolerance * ACTUATION_SHARE * scale).recip()
        });
        let derivatives = |time: f64, x: &[f64; States::COUNT]| {
            system.evaluate(&inputs(time), &States::from_array(*x)).derivatives().to_array()
        };
        let mut steps = StepSize::new(self.actuation_step, bogacki_shampine::ERROR_ORDER);
        let mut time = interval.from;
        let mut slopes = derivatives(time, states);
        while time < interval.to {
            let left = interval.to - time;
            let length = steps.within(left).min(LONGEST_STEP);
            let trial = bogacki_shampine::step(derivatives, time, states, &slopes, length);
            let taken = steps.judge(length, relative_error(&trial.states, &trial.error, &weights));
            if interval.is_given_up(&steps, taken) {
                return Err(Failure { time, state: largest_error(&trial.states, &trial.error, &weights) });
            }
            if taken {
                time = if length >= left { interval.to } else { time + length };
                (*states, slopes) = (trial.states, trial.slopes);
            }
        }
        self.actuation_step = steps.next.min(LONGEST_STEP);
        Ok(())
    }

    /// Advances the actuation and the gas path each with its own steps.
    fn advance_apart(
        &mut self,
        system: &System,
        signal: &Signal<impl Fn(f64) -> Inputs>,
        states: &mut [f64; States::COUNT],
        interval: Interval,
    ) -> Result<GasPath, Failure> {
        let Interval { from, to, tolerance } = interval;
        let inputs = &signal.at;
        let mut x = std::array::from_fn(|i| states[ACTUATION + i]);
        let mut ahead = Ahead::new(self, system, signal, std::array::from_fn(|i| states[i]), interval);
        let weights = GAS_PATH_SCALES.map(|scale| (scale * tolerance * GAS_PATH_SHARE).recip());
        let failure = |time: f64, x: &[f64; GAS_PATH], errors: &[f64; GAS_PATH]| Failure {
            time,
            state: ACTUATION + largest_error(x, errors, &weights),
        };
        let mut steps = StepSize::new(self.gas_path_step, rosenbrock::ERROR_ORDER);
        let mut time = from;
        let here = gas_path_inputs(&inputs(time));
        let is_known = here.iter().zip(&self.inputs).all(|(here, last)| here.to_bits() == last.to_bits());
        let mut slopes = if is_known {
            self.slopes
        } else {
            system.breathe(&inputs(time), &x, ahead.opening(time)).derivatives
        };
        loop {
            if self.gas_path.is_used_up() {
                let (inputs, opening) = (inputs(time), ahead.opening(time));
                let derivatives = |x: &[f64; GAS_PATH]| system.breathe(&inputs, x, opening).derivatives;
                self.gas_path.renew(derivatives, &x, &slopes, &GAS_PATH_SCALES, LINEARIZATION_SERVES);
                let moved = if opening < 0.5 { opening + 1e-4 } else { opening - 1e-4 };
                let moved_slopes = system.breathe(&inputs, &x, moved).derivatives;
                self.by_opening = std::array::from_fn(|i| (moved_slopes[i] - slopes[i]) / (moved - opening));
            }
            let left = to - time;
            let wanted = steps.within(left).min(LONGEST_STEP);
            ahead.go_to(time + wanted, wanted >= left)?;
            let length = if ahead.time < time + wanted { ahead.time - time } else { wanted };
            let end = if length >= left { to } else { time + length };
            let mut error = f64::INFINITY;
            let mut errors = [f64::INFINITY; GAS_PATH];
            if self.gas_path.prepare_second_order(length) {
                let (middle, opening) = (time + 0.5 * length, ahead.opening(time));
                let changes: [[f64; GAS_PATH]; 2] = if signal.is_constant {
                    [middle, end].map(|time| {
                        let change = ahead.opening(time) - opening;
                        self.by_opening.map(|slope| slope * change)
                    })
                } else {
                    [middle, end].map(|time| {
                        let later = system.breathe(&inputs(time), &x, ahead.opening(time)).derivatives;
                        std::array::from_fn(|i| later[i] - slopes[i])
                    })
                };
                let drift = std::array::from_fn(|i| (4.0 * changes[0][i] - changes[1][i]) / length);
                let bend = std::array::from_fn(|i| changes[1][i] - 2.0 * changes[0][i]);
                let derivatives =
                    |_, x: &[f64; GAS_PATH]| system.breathe(&inputs(end), x, ahead.opening(end)).derivatives;
                let begin = Begin { time, states: &x, slopes: &slopes, drift: &drift };
                let next = self.gas_path.second_order(derivatives, &begin, length);
                let gas_path = system.breathe(&inputs(end), &next, ahead.opening(end));
                errors = self.gas_path.second_order_error(
                    [&x, &next],
                    [&slopes, &gas_path.derivatives],
                    &bend,
                    length,
                );
                error = relative_error(&next, &errors, &weights);
                if steps.judge(length, error) {
                    time = end;
                    (x, slopes) = (next, gas_path.derivatives);
                    self.gas_path.count();
                    ahead.forget_before(time);
                    if time >= to {
                        self.gas_path_step = steps.next.min(LONGEST_STEP);
                        (self.slopes, self.inputs) = (slopes, gas_path_inputs(&inputs(to)));
                        states[..ACTUATION].copy_from_slice(&ahead.states);
                        states[ACTUATION..].copy_from_slice(&x);
                        (self.actuation_step, self.actuation) =
                            (ahead.steps.next.min(LONGEST_STEP), ahead.linearization);
                        return Ok(gas_path);
                    }
                    if interval.is_given_up(&steps, true) {
                        return Err(failure(time, &x, &errors));
                    }
                    continue;
                }
            } else {
                steps.judge(length, error);
            }
            if interval.is_given_up(&steps, false) {
                return Err(failure(time, &x, &errors));
            }
            self.gas_path.discard();
        }
    }
}

/// The actuation, which goes ahead of the gas path.
struct Ahead<'a, F> {
    system: &'a System,
    signal: &'a Signal<F>,
    interval: Interval,
    weights: [f64; ACTUATION],
    steps: StepSize,
    linearization: Linearization<ACTUATION>,
    /// How far it is.
    time: f64,
    states: [f64; ACTUATION],
    slopes: [f64; ACTUATION],
    /// The rod's position over the steps that the gas path has not left behind.
    positions: [Cubic; MOST_AHEAD],
    count: usize,
}

impl<'a, F: Fn(f64) -> Inputs> Ahead<'a, F> {
    fn new(
        pace: &Pace,
        system: &'a System,
        signal: &'a Signal<F>,
        states: [f64; ACTUATION],
        interval: Interval,
    ) -> Self {
        let time = interval.from;
        Self {
            system,
            signal,
            interval,
            weights: ACTUATION_SCALES.map(|scale| (scale * interval.tolerance * ACTUATION_SHARE).recip()),
            steps: StepSize::new(pace.actuation_step, rosenbrock::ERROR_ORDER),
            linearization: pace.actuation,
            time,
            states,
            slopes: system.actuate(&(signal.at)(time), &states, 0.0).derivatives,
            positions: [Cubic::default(); MOST_AHEAD],
            count: 0,
        }
    }

    /// Goes on at least to a time, or as far as the memory of positions reaches.
    #[inline(never)]
    fn go_to(&mut self, end: f64, to_the_end: bool) -> Result<(), Failure> {
        let (system, inputs) = (self.system, &self.signal.at);
        let derivatives = |time: f64, x: &[f64; ACTUATION]| system.actuate(&inputs(time), x, 0.0).derivatives;
        let end = if to_the_end { self.interval.to } else { end };
        while self.time < end && self.count < MOST_AHEAD {
            if self.linearization.is_used_up() {
                let time = self.time;
                self.linearization.renew(
                    |x| derivatives(time, x),
                    &self.states,
                    &self.slopes,
                    &ACTUATION_SCALES,
                    LINEARIZATION_SERVES,
                );
            }
            let left = self.interval.to - self.time;
            let length = self.steps.within(left).min(LONGEST_STEP);
            let time = if length >= left { self.interval.to } else { self.time + length };
            let mut errors = [f64::INFINITY; ACTUATION];
            let mut error = f64::INFINITY;
            if self.linearization.prepare_third_order(length) {
                let drift = if self.signal.is_constant {
                    [0.0; ACTUATION]
                } else {
                    let difference = TIME_DIFFERENCE * length;
                    let later = derivatives(self.time + difference, &self.states);
                    std::array::from_fn(|i| (later[i] - self.slopes[i]) / difference)
                };
                let (states, slopes) = (&self.states, &self.slopes);
                let begin = Begin { time: self.time, states, slopes, drift: &drift };
                let (next, estimate) = self.linearization.third_order(derivatives, &begin, length);
                let slopes = derivatives(time, &next);
                errors = estimate;
                error = relative_error(&next, &errors, &self.weights);
                if self.steps.judge(length, error) {
                    let positions = [self.states[POSITION], next[POSITION]];
                    let speeds = [self.slopes[POSITION], slopes[POSITION]];
                    self.positions[self.count] = Cubic::new(self.time, length, positions, speeds);
                    self.count += 1;
                    (self.time, self.states, self.slopes) = (time, next, slopes);
                    self.linearization.count();
                    if self.interval.is_given_up(&self.steps, true) {
                        return Err(self.failure(&errors));
                    }
                    continue;
                }
            } else {
                self.steps.judge(length, error);
            }
            if self.interval.is_given_up(&self.steps, false) {
                return Err(self.failure(&errors));
            }
            self.linearization.discard();
        }
        Ok(())
    }

    /// Why it does not go on after a step with these errors.
    fn failure(&self, errors: &[f64; ACTUATION]) -> Failure {
        Failure { time: self.time, state: largest_error(&self.states, errors, &self.weights) }
    }

    /// The wastegate's opening at a time between that of the gas path and the own.
    fn opening(&self, time: f64) -> f64 {
        let past = self.positions[..self.count].iter().find(|cubic| time < cubic.end());
        let position = past.map_or(self.states[POSITION], |cubic| cubic.at(time));
        self.system.actuator.opening(position)
    }

    /// Forgets the positions before a time.
    fn forget_before(&mut self, time: f64) {
        let past = self.positions[..self.count].iter().take_while(|cubic| cubic.end() <= time).count();
        self.positions.copy_within(past..self.count, 0);
        self.count -= past;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::initialization::running;
    use crate::plant::variables::Parameters;

    /// The states after 2 s of inputs that change at 0.5 s and 1 s, taken in equal intervals.
    fn travelled(system: &System, tolerance: f64, intervals: u32) -> [f64; States::COUNT] {
        let mut pace = Pace::default();
        let mut states = running(system, &Inputs::default(), 32_500.0).to_array();
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
            pace.advance(system, signal, &mut states, Interval { from, to, tolerance }).unwrap();
        }
        states
    }

    /// The largest difference relative to the full scales; the rod's speed and the friction force count
    /// where they are compared in the trace alone.
    fn difference(a: &[f64; States::COUNT], b: &[f64; States::COUNT]) -> f64 {
        let scale = |i: usize| match i {
            2 => 3.5e4,
            _ if i < ACTUATION => ACTUATION_SCALES[i],
            _ => GAS_PATH_SCALES[i - ACTUATION],
        };
        (0..States::COUNT).map(|i| (a[i] - b[i]).abs() / scale(i)).fold(0.0, f64::max)
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
        for (exhaust_area, state) in [(0.0, 3), (0.0, 9), (1e-4, 9)] {
            let system = system(exhaust_area);
            let inputs = Inputs::default();
            let mut states = running(&system, &inputs, 32_500.0).to_array();
            states[state] = f64::NAN;
            let signal = Signal { at: |_| inputs, is_constant: true };
            let interval = Interval { from: 0.5, to: 1.0, tolerance: 1e-4 };
            let failure = Pace::default().advance(&system, signal, &mut states, interval).unwrap_err();
            assert!((failure.time - 0.5).abs() < f64::EPSILON, "{failure:?}");
        }
    }
}
