//! The integration of the plant over time.
//!
//! The actuation is cheap, oscillates and has kinks (stops, friction reversal, the valve changing ports); the gas path
//! is several times as expensive, stiff, smooth and does not oscillate. Unless the exhaust pushes the wastegate, the
//! actuation drives the gas path but not vice versa, so each takes its own steps ([`multirate`]). If the exhaust does
//! push, both take the same steps.
//!
//! Both use ROS34PW2, which keeps its order with an outdated Jacobian. A Jacobian serves 25 steps; one from before an
//! input jump is discarded, and the first step after the jump is short.
//!
//! `docs/integration.md` compares the methods tried.

use fmu_export::Persistent;

use super::system::{Actuation, GAS_PATH_SCALES, GasPath, Instant, System};
use super::variables::{
    ActuationStates, FaultParameters, GasPathStates, Inputs, Parameters, StateGroups, States,
};
use crate::solver::course::{Budget, Course, IntegrationFailure, Interval, JumpLaw, Rules, StepMemory};
use crate::solver::multirate::{self, Fast, Slow, SlowMemory};
use crate::solver::rosenbrock::{Blocks, step};

const ACTUATION: usize = ActuationStates::COUNT;
const GAS_PATH: usize = GasPathStates::COUNT;

/// Extra weight of tank pressure errors, since they do not decay.
const TANK_STRICTNESS: f64 = 35.0;
/// Slack for rod speed, which is fast and tiny.
const ROD_SPEED_SLACK: f64 = 10.0;
/// Slack for the friction force, which kinks where the rod reverses. If the exhaust pushes the wastegate there is none:
/// the rod then creeps with exhaust pressure, and the errors of many steps add up.
const FRICTION_SLACK: f64 = 1.25;

/// The 100 % of the actuation's states in error control.
const ACTUATION_SCALES: ActuationStates = {
    let mut scales = ActuationStates::NOMINAL;
    scales.tank.pressure /= TANK_STRICTNESS;
    scales.actuator.velocity *= ROD_SPEED_SLACK;
    scales.actuator.friction_force *= FRICTION_SLACK;
    scales
};

/// The same if the exhaust pushes the wastegate.
const PUSHED_ACTUATION_SCALES: ActuationStates = {
    let mut scales = ACTUATION_SCALES;
    scales.actuator.friction_force = ActuationStates::NOMINAL.actuator.friction_force;
    scales
};

/// Flows between the volumes at a compressor or wastegate depend steeply on their pressures, so errors of these count
/// more than by full scale, to reach 0.01 % of the flow's full scale too. These shares of the full scales count as 100
/// %.
const BEFORE_LP_COMPRESSOR: f64 = 0.6;
const BETWEEN_COMPRESSORS: f64 = 0.3;
const BEHIND_HP_COMPRESSOR: f64 = 0.75;
const BEFORE_HP_WASTEGATE: f64 = 0.6;
const BETWEEN_WASTEGATES: f64 = 2.0 / 3.0;

/// The 100 % of the gas path's states in error control.
const GAS_PATH_ERROR_SCALES: GasPathStates = {
    let mut scales = GAS_PATH_SCALES;
    scales.air_filter.pressure *= BEFORE_LP_COMPRESSOR;
    scales.lp_compressor.outlet_pressure *= BETWEEN_COMPRESSORS;
    scales.hp_compressor.outlet_pressure *= BEHIND_HP_COMPRESSOR;
    scales.exhaust_manifold.pressure *= BEFORE_HP_WASTEGATE;
    scales.interstage_exhaust.pressure *= BETWEEN_WASTEGATES;
    scales
};

/// The lower limits of the gas path's states: no negative pressure, no shaft turning backwards.
const GAS_PATH_LEAST: GasPathStates = {
    let mut least = GasPathStates::MIN;
    least.hp_shaft.speed = 0.0;
    least.lp_shaft.speed = 0.0;
    least
};

/// The initial step size in s.
const FIRST_STEP: f64 = 1e-3;
/// The longest step in s.
const LONGEST_STEP: f64 = 0.025;
/// The longest use of a linearization, in steps.
const LINEARIZATION_SERVES: u32 = 25;
/// The number of steps a call may try, whatever its length …
const MOST_TRIALS: f64 = 50_000.0;
/// … plus this number per second: 20 times as many as at rest.
const MOST_TRIALS_PER_SECOND: f64 = 2_000.0;
/// The finite difference of the wastegate's area share for its derivatives.
const AREA_DIFFERENCE: f64 = 1e-3;

/// Error control of the actuation. The errors of several steps and of kinks add up, and the gas path amplifies rod
/// position errors up to three times: hence the share. It and the step reduction after a jump, where the rod
/// oscillates, were found by experiment, as were the gas path's.
const ACTUATION_RULES: Rules<ACTUATION> = Rules {
    names: ActuationStates::NAMES,
    error_scales: ACTUATION_SCALES.to_array(),
    magnitudes: ACTUATION_SCALES.to_array(),
    least: ActuationStates::MIN.to_array(),
    share: 0.1,
    jump: JumpLaw { tolerances: 10.0, exponent: 0.5 },
    longest_step: LONGEST_STEP,
    linearization_serves: LINEARIZATION_SERVES,
};

/// Error control of the gas path.
const GAS_PATH_RULES: Rules<GAS_PATH> = Rules {
    names: GasPathStates::NAMES,
    error_scales: GAS_PATH_ERROR_SCALES.to_array(),
    magnitudes: GAS_PATH_SCALES.to_array(),
    least: GAS_PATH_LEAST.to_array(),
    share: 0.3,
    jump: JumpLaw { tolerances: 30.0, exponent: 1.0 / 3.0 },
    longest_step: LONGEST_STEP,
    linearization_serves: LINEARIZATION_SERVES,
};

/// Error control of both together.
const PUSHED_RULES: Rules<{ States::COUNT }> = Rules {
    names: joined(ActuationStates::NAMES, GasPathStates::NAMES),
    error_scales: joined(PUSHED_ACTUATION_SCALES.to_array(), GAS_PATH_RULES.error_scales),
    magnitudes: joined(ACTUATION_RULES.magnitudes, GAS_PATH_RULES.magnitudes),
    least: joined(ACTUATION_RULES.least, GAS_PATH_RULES.least),
    share: ACTUATION_RULES.share,
    jump: ACTUATION_RULES.jump,
    longest_step: LONGEST_STEP,
    linearization_serves: LINEARIZATION_SERVES,
};

/// Kept from one communication step to the next: step sizes, linearizations and the last derivatives. It only saves
/// work, but is part of the plant's state, so that a restored plant continues bit for bit.
#[derive(Clone, Copy, Debug, Persistent)]
pub struct Pace {
    actuation: StepMemory<ACTUATION, ACTUATION_INPUTS>,
    gas_path: SlowMemory<GAS_PATH, GAS_PATH_INPUTS>,
    /// Whether the vacuum tank was held, which changes the actuation's derivatives.
    tank_is_frozen: bool,
    /// The faults, which change all derivatives.
    fault: FaultParameters,
}

impl Default for Pace {
    fn default() -> Self {
        Self {
            actuation: StepMemory::new(FIRST_STEP),
            gas_path: SlowMemory::new(FIRST_STEP),
            tank_is_frozen: false,
            fault: Parameters::default().fault,
        }
    }
}

/// The budget of a call that advances the plant by a duration in s.
pub fn budget(duration: f64) -> Budget {
    Budget::new(MOST_TRIALS + MOST_TRIALS_PER_SECOND * duration)
}

/// The inputs during an interval.
#[derive(Clone, Copy, Debug)]
pub struct IntervalInputs<F> {
    /// The inputs at a time in s.
    pub at: F,
    /// Whether they are the same at any time.
    pub is_constant: bool,
}

/// The number of the actuation's inputs.
const ACTUATION_INPUTS: usize = 5;
/// The number of the gas path's inputs.
const GAS_PATH_INPUTS: usize = 7;

/// A plant whose actuation is integrated ahead of its gas path.
struct Apart<'a, F> {
    system: &'a System,
    signal: &'a IntervalInputs<F>,
}

impl<F> Clone for Apart<'_, F> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<F> Copy for Apart<'_, F> {}

impl<F: Fn(f64) -> Inputs> Fast<ACTUATION, ACTUATION_INPUTS> for Apart<'_, F> {
    type Evaluation = Actuation;
    const RULES: &'static Rules<ACTUATION> = &ACTUATION_RULES;

    fn is_constant(&self) -> bool {
        self.signal.is_constant
    }

    fn inputs(&self, time: f64) -> [f64; ACTUATION_INPUTS] {
        let inputs = (self.signal.at)(time);
        [
            inputs.hp_wastegate_pwm,
            inputs.vacuum_pump,
            inputs.supply_voltage,
            inputs.ambient_pressure,
            inputs.ambient_temperature,
        ]
    }

    #[inline]
    fn evaluate(&self, time: f64, states: &[f64; ACTUATION]) -> Actuation {
        self.system.actuation(&(self.signal.at)(time), &ActuationStates::from_array(*states), 0.0)
    }

    #[inline]
    fn derivatives(actuation: &Actuation) -> [f64; ACTUATION] {
        actuation.derivatives.to_array()
    }

    #[inline]
    fn driver(states: &[f64; ACTUATION]) -> f64 {
        ActuationStates::from_array(*states).actuator.position
    }
}

impl<F: Fn(f64) -> Inputs> Slow<GAS_PATH, GAS_PATH_INPUTS> for Apart<'_, F> {
    type Evaluation = GasPath;
    const RULES: &'static Rules<GAS_PATH> = &GAS_PATH_RULES;

    fn is_constant(&self) -> bool {
        self.signal.is_constant
    }

    fn inputs(&self, time: f64) -> [f64; GAS_PATH_INPUTS] {
        let inputs = (self.signal.at)(time);
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

    #[inline]
    fn evaluate(&self, time: f64, states: &[f64; GAS_PATH], position: f64) -> GasPath {
        let opening = self.system.actuator.opening(position);
        self.system.gas_path(&(self.signal.at)(time), &GasPathStates::from_array(*states), opening)
    }

    #[inline]
    fn derivatives(gas_path: &GasPath) -> [f64; GAS_PATH] {
        gas_path.derivatives.to_array()
    }

    /// The wastegate's area share.
    #[inline]
    fn effect(&self, position: f64) -> f64 {
        self.system.actuator.opening(position).powi(2)
    }

    fn by_effect(
        &self,
        time: f64,
        states: &[f64; GAS_PATH],
        slopes: &[f64; GAS_PATH],
        position: f64,
    ) -> [f64; GAS_PATH] {
        let area = self.effect(position);
        let moved = if area < 0.5 { area + AREA_DIFFERENCE } else { area - AREA_DIFFERENCE };
        let states = GasPathStates::from_array(*states);
        let gas_path = self.system.gas_path(&(self.signal.at)(time), &states, moved.sqrt());
        let moved_slopes = gas_path.derivatives.to_array();
        std::array::from_fn(|i| (moved_slopes[i] - slopes[i]) / (moved - area))
    }
}

impl Pace {
    /// Advances the states of a plant over an interval. Returns the evaluation at its end.
    pub fn advance(
        &mut self,
        system: &System,
        signal: &IntervalInputs<impl Fn(f64) -> Inputs>,
        states: &mut States,
        interval: Interval<'_>,
    ) -> Result<Instant, IntegrationFailure> {
        if self.fault != *system.fault() {
            *self = Self { fault: *system.fault(), ..Self::default() };
        }
        if self.tank_is_frozen != system.is_tank_frozen() {
            self.tank_is_frozen = system.is_tank_frozen();
            self.actuation = StepMemory::new(self.actuation.step);
        }
        if system.actuator.parameters.exhaust_area == 0.0 {
            self.advance_apart(system, signal, states, interval)
        } else {
            self.advance_together(system, signal, states, interval)
        }
    }

    /// Advances actuation and gas path with separate steps.
    fn advance_apart(
        &mut self,
        system: &System,
        signal: &IntervalInputs<impl Fn(f64) -> Inputs>,
        states: &mut States,
        interval: Interval<'_>,
    ) -> Result<Instant, IntegrationFailure> {
        let mut actuation = ActuationStates::of(states).to_array();
        let mut gas_path = GasPathStates::of(states).to_array();
        let evaluations = multirate::advance(
            Apart { system, signal },
            (&mut self.actuation, &mut actuation),
            (&mut self.gas_path, &mut gas_path),
            interval,
        )?;
        *states = States::from_groups(StateGroups {
            actuation: ActuationStates::from_array(actuation),
            gas_path: GasPathStates::from_array(gas_path),
        });
        Ok(Instant { actuation: evaluations.0, gas_path: evaluations.1 })
    }

    /// Advances everything with the same steps. The linearization omits the coupling between the halves.
    fn advance_together(
        &mut self,
        system: &System,
        signal: &IntervalInputs<impl Fn(f64) -> Inputs>,
        states: &mut States,
        interval: Interval<'_>,
    ) -> Result<Instant, IntegrationFailure> {
        let inputs = &signal.at;
        let evaluate = |time: f64, x: &[f64; States::COUNT]| {
            let (actuation, gas_path) = split(x);
            system.evaluate(&inputs(time), &States::from_groups(StateGroups { actuation, gas_path }))
        };
        let derivatives = |time: f64, x: &[f64; States::COUNT]| {
            let Instant { actuation, gas_path } = evaluate(time, x);
            joined(actuation.derivatives.to_array(), gas_path.derivatives.to_array())
        };
        let begin = joined(ActuationStates::of(states).to_array(), GasPathStates::of(states).to_array());
        let slopes = derivatives(interval.from, &begin);
        let mut course = Course::new(interval, self.actuation.step, &PUSHED_RULES, (begin, slopes));
        loop {
            let (length, end) = course.next();
            self.linearize(system, &inputs(course.time), &course);
            let (actuation, gas_path) =
                (&mut self.actuation.linearization, &mut self.gas_path.memory.linearization);
            let is_ready = actuation.prepare(length) && gas_path.prepare(length);
            let trial = is_ready.then(|| {
                let drift = course.drift(derivatives, length, signal.is_constant);
                let at_end = |x: &[f64; States::COUNT]| derivatives(end, x);
                step(&Blocks(actuation, gas_path), derivatives, at_end, &course.begin(&drift), length)
            });
            if course.settle(trial, length, end)? {
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

    /// Renews the halves' expired linearizations.
    fn linearize(&mut self, system: &System, inputs: &Inputs, course: &Course<'_, { States::COUNT }>) {
        let (actuation, gas_path) = split(&course.states);
        let (actuation_slopes, gas_path_slopes) = split(&course.slopes);
        let (difference, opening) =
            (System::exhaust_difference(&gas_path), system.actuator.opening(actuation.actuator.position));
        if self.actuation.linearization.is_used_up() {
            self.actuation.linearization.renew(
                |x| {
                    system
                        .actuation(inputs, &ActuationStates::from_array(*x), difference)
                        .derivatives
                        .to_array()
                },
                &actuation.to_array(),
                &actuation_slopes.to_array(),
                &ACTUATION_RULES.magnitudes,
                LINEARIZATION_SERVES,
            );
        }
        if self.gas_path.memory.linearization.is_used_up() {
            self.gas_path.memory.linearization.renew(
                |x| system.gas_path(inputs, &GasPathStates::from_array(*x), opening).derivatives.to_array(),
                &gas_path.to_array(),
                &gas_path_slopes.to_array(),
                &GAS_PATH_RULES.magnitudes,
                LINEARIZATION_SERVES,
            );
        }
    }
}

/// Actuation and gas path, concatenated.
const fn joined<T: Copy>(actuation: [T; ACTUATION], gas_path: [T; GAS_PATH]) -> [T; States::COUNT] {
    let mut joined = [gas_path[0]; States::COUNT];
    let mut i = 0;
    while i < States::COUNT {
        joined[i] = if i < ACTUATION { actuation[i] } else { gas_path[i - ACTUATION] };
        i += 1;
    }
    joined
}

/// The inverse for states.
fn split(states: &[f64; States::COUNT]) -> (ActuationStates, GasPathStates) {
    (
        ActuationStates::from_array(std::array::from_fn(|i| states[i])),
        GasPathStates::from_array(std::array::from_fn(|i| states[ACTUATION + i])),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::initialization::running;
    use crate::plant::variables::Parameters;

    /// The states after 2 s with inputs that change at 0.5 s and 1 s, in equal intervals.
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
            let signal = IntervalInputs { at: |_| inputs, is_constant: true };
            pace.advance(
                system,
                &signal,
                &mut states,
                Interval { from, to, tolerance, budget: &budget(1.0) },
            )
            .unwrap();
        }
        states
    }

    /// The largest difference relative to full scale; rod speed and friction force are compared only in the trace.
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
    fn the_error_falls_with_the_tolerance() {
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
    fn the_joint_and_the_multirate_integration_agree() {
        // An area on which the exhaust pushes with 1e-15 N.
        let found = difference(&travelled(&system(1e-20), 1e-4, 160), &travelled(&system(0.0), 1e-4, 160));
        assert!(found < 1e-4, "{found:e}");
    }

    #[test]
    fn the_intervals_of_a_call_share_its_budget() {
        let system = system(0.0);
        let inputs = Inputs::default();
        let mut states = running(&system, &inputs, 32_500.0);
        let (mut pace, budget) = (Pace::default(), Budget::new(52_000.0));
        let signal = IntervalInputs { at: |_| inputs, is_constant: true };
        let interval = |_: &u32| {
            let interval = Interval { from: 0.0, to: 1e-3, tolerance: 1e-4, budget: &budget };
            pace.advance(&system, &signal, &mut states, interval).is_ok()
        };
        // Each needs at least one step of the actuation and one of the gas path.
        let done = (0..30_000).take_while(interval).count();
        assert!(done > 20_000, "{done}");
        assert!(done < 27_000, "{done} intervals with a budget of 52,000 trials");
    }

    #[test]
    fn a_failed_integration_is_reported() {
        type Damage = fn(&mut States);
        let chamber: Damage = |states| states.actuator.chamber_pressure = f64::NAN;
        let intercooler: Damage = |states| states.intercooler.outlet_pressure = f64::NAN;
        for (exhaust_area, damage) in [(0.0, chamber), (0.0, intercooler), (1e-4, intercooler)] {
            let system = system(exhaust_area);
            let inputs = Inputs::default();
            let mut states = running(&system, &inputs, 32_500.0);
            damage(&mut states);
            let signal = IntervalInputs { at: |_| inputs, is_constant: true };
            let budget = budget(0.5);
            let interval = Interval { from: 0.5, to: 1.0, tolerance: 1e-4, budget: &budget };
            let failure = Pace::default().advance(&system, &signal, &mut states, interval).unwrap_err();
            assert!((failure.time - 0.5).abs() < f64::EPSILON, "{failure:?}");
        }
    }
}
