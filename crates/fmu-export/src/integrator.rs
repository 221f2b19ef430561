//! The built-in integrator of models of equations: `Rodas5P`, a linearly implicit (Rosenbrock) method of fifth order
//! with an embedded method of fourth order and dense output of fourth order, eight stages per step (Steinebach,
//! Construction of Rosenbrock-Wanner method `Rodas5P` and numerical benchmarks within the Julia Differential Equations
//! package, BIT Numerical Mathematics 63, 2023).
//!
//! It is L-stable and so suits stiff systems: it damps modes that are much faster than a step instead of following
//! them. Its order, high enough for non-stiff systems, rests on exact Jacobians, from dual numbers. As a one-step
//! method it restarts cheaply after an event, and remembers only the length of its next step.
//!
//! Only [`Integrator::new`] allocates.
//!
//! `docs/integrator.md` compares it with other solvers. The crates `diffsol`, `differential-equations` and
//! `ode_solvers` were tried, but none can write its memory as bytes in the middle of a run, which a serialized FMU
//! state needs.

use crate::linear;
use crate::persistence::Persistent;

const STAGES: usize = 8;

/// γ of the method.
const GAMMA: f64 = 0.211_937_563_194_290_14;

/// The weights of the stages in the states at which each stage is evaluated; later ones are those of the sixth, and 1.
const A: [&[f64]; STAGES] = [
    &[],
    &[3.0],
    &[2.849_394_379_747_939, 0.458_422_422_044_639_23],
    &[-6.954_028_509_809_101, 2.489_845_061_869_568, -10.358_996_098_473_584],
    &[2.802_998_627_562_896_4, 0.507_246_473_622_820_6, -0.398_831_254_177_052_4, -0.047_211_872_304_046_41],
    &SIXTH,
    &[SIXTH[0], SIXTH[1], SIXTH[2], SIXTH[3], SIXTH[4], 1.0],
    &[SIXTH[0], SIXTH[1], SIXTH[2], SIXTH[3], SIXTH[4], 1.0, 1.0],
];
const SIXTH: [f64; 5] = [
    -7.502_846_399_306_121,
    2.561_846_144_803_919,
    -11.627_539_656_261_098,
    -0.182_687_676_599_422_56,
    0.030_198_172_008_377_946,
];

/// The weights of the stages, divided by the step, on the right-hand side of each stage.
const C: [&[f64]; STAGES] = [
    &[],
    &[-14.155_112_264_123_755],
    &[-17.972_960_358_859_52, -2.859_693_295_451_294],
    &[147.121_502_757_117_16, -1.412_214_027_182_13, 71.689_402_513_023_58],
    &[165.435_170_248_716_76, -0.459_282_345_649_112_6, 42.909_383_369_586_03, -5.961_986_721_573_306],
    &[
        24.854_864_614_690_072,
        -3.000_922_700_283_218_6,
        47.493_111_002_076_8,
        5.581_419_782_155_812_5,
        -0.661_069_182_524_947_1,
    ],
    &[
        30.912_732_140_285_99,
        -3.120_824_334_993_797_4,
        77.799_546_460_708_92,
        34.286_460_282_947_83,
        -19.097_331_116_725_623,
        -28.087_943_162_872_662,
    ],
    &[
        37.802_771_233_905_63,
        -3.257_196_902_907_227_6,
        112.269_188_494_963_27,
        66.934_723_124_404_7,
        -40.066_189_370_910_02,
        -54.667_802_628_779_68,
        -9.488_616_523_096_27,
    ],
];

/// The time of each stage within the step, relative to it.
const TIMES: [f64; STAGES] = [
    0.0,
    0.635_812_689_582_870_4,
    0.409_579_839_339_753_5,
    0.976_930_672_506_071_6,
    0.428_840_360_955_866_4,
    1.0,
    1.0,
    1.0,
];

/// The weight of the derivative with respect to time in each stage, times the step.
const TIME_DERIVATIVE: [f64; STAGES] = [
    GAMMA,
    -0.423_875_126_388_580_27,
    -0.338_462_712_623_592_4,
    1.804_645_287_288_273_4,
    2.325_825_639_765_069,
    0.0,
    0.0,
    0.0,
];

/// The weights of the stages in the polynomials of the dense output.
const DENSE: [[f64; STAGES]; 3] = [
    [
        25.948_786_856_663_858,
        -2.557_972_484_584_623_5,
        10.433_815_404_888_879,
        -2.367_925_102_268_520_4,
        0.524_948_541_321_073,
        1.124_108_831_045_040_4,
        0.427_287_619_443_187_4,
        -0.172_022_210_701_554_93,
    ],
    [
        -9.915_688_506_951_71,
        -0.968_994_459_411_515_4,
        3.043_803_724_297_845_3,
        -24.495_224_566_215_796,
        20.176_138_334_709_044,
        15.980_663_614_246_51,
        -6.789_040_303_419_874,
        -6.710_236_069_923_372,
    ],
    [
        11.419_903_575_922_262,
        2.887_964_514_613_699_4,
        72.921_379_959_960_29,
        80.125_118_346_226_43,
        -52.072_871_366_152_654,
        -59.789_936_252_667_29,
        -0.155_826_842_827_519_13,
        4.883_087_185_713_722,
    ],
];

/// The safety factor on the length that would just meet the tolerance.
const SAFETY: f64 = 0.9;
/// The largest growth of the step length from one step to the next, and the largest reduction.
const GROWTH: f64 = 6.0;
const REDUCTION: f64 = 0.2;
/// The order of the error estimate: the slope of its logarithm over that of the step.
const ESTIMATE_ORDER: f64 = 5.0;
/// How much longer than proposed a step may be, relatively, so that rounding of its end does not split it.
const ROUNDING: f64 = 1e-6;
/// The shortest step, in roundings of the time.
const SHORTEST_STEP: f64 = 16.0 * f64::EPSILON;

/// A system dx/dt = f(t, x).
pub trait System {
    /// Computes the derivatives of the states.
    fn derivatives(&mut self, time: f64, states: &[f64], derivatives: &mut [f64]);
    /// Computes their partial derivatives with respect to each state, by rows, and to time.
    fn linearize(&mut self, time: f64, states: &[f64], jacobian: &mut [f64], by_time: &mut [f64]);
}

/// Even the shortest step misses the tolerance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepFailure {
    /// The position of the state whose error is largest relative to its tolerance, or NaN.
    pub state: usize,
}

/// The integrator with its last step.
#[derive(Clone, Debug)]
pub struct Integrator {
    /// The length of the next step in s; 0 if still to be estimated.
    next: f64,
    /// The start of the last step in s, and its length.
    begin: f64,
    length: f64,
    /// The states there, and at the end of the step.
    from: Vec<f64>,
    to: Vec<f64>,
    /// The derivatives at its start; f of a stage otherwise.
    slopes: Vec<f64>,
    by_time: Vec<f64>,
    jacobian: Vec<f64>,
    factors: Vec<f64>,
    pivots: Vec<usize>,
    stages: [Vec<f64>; STAGES],
    moved: Vec<f64>,
    /// The polynomials of the dense output, once they are asked for.
    dense: Vec<[f64; DENSE.len()]>,
    has_dense: bool,
    /// The position of the state with the largest error in the last trial.
    decisive: usize,
}

/// Excludes the last step: a saved instance is between steps.
impl Persistent for Integrator {
    fn persist(&mut self, archive: &mut crate::persistence::Archive<'_>) -> Result<(), crate::Error> {
        self.next.persist(archive)
    }
}

impl Integrator {
    /// An integrator for this many states.
    #[must_use]
    pub fn new(size: usize) -> Self {
        let vector = || vec![0.0; size];
        Self {
            next: 0.0,
            begin: 0.0,
            length: 0.0,
            from: vector(),
            to: vector(),
            slopes: vector(),
            by_time: vector(),
            jacobian: vec![0.0; size * size],
            factors: vec![0.0; size * size],
            pivots: vec![0; size],
            stages: core::array::from_fn(|_| vector()),
            moved: vector(),
            dense: vec![[0.0; DENSE.len()]; size],
            has_dense: false,
            decisive: 0,
        }
    }

    /// Re-estimates the length of the next step, as after a jump.
    pub fn restart(&mut self) {
        self.next = 0.0;
    }

    /// Takes a step from `states`, not beyond an end, shortened until its error meets the relative tolerance. Returns
    /// the time at which it ends; `trials` counts.
    ///
    /// # Errors
    /// When even the shortest step misses the tolerance.
    pub fn step(
        &mut self,
        system: &mut impl System,
        (time, end): (f64, f64),
        states: &[f64],
        tolerance: &Tolerance<'_>,
        trials: &mut u32,
    ) -> Result<f64, StepFailure> {
        self.from.copy_from_slice(states);
        self.begin = time;
        system.derivatives(time, states, &mut self.slopes);
        system.linearize(time, states, &mut self.jacobian, &mut self.by_time);
        let left = end - time;
        if self.next <= 0.0 {
            self.next = self.first_step(tolerance);
        }
        let mut rejected = false;
        loop {
            *trials += 1;
            // The longest that reaches the end in equal steps.
            let length = left / (left / (self.next * (1.0 + ROUNDING))).ceil().max(1.0);
            let error = self.trial(system, length, tolerance);
            self.decisive = error.state;
            let by_error = if error.largest > 0.0 {
                SAFETY * error.largest.powf(-ESTIMATE_ORDER.recip())
            } else {
                GROWTH
            };
            if error.largest <= 1.0 {
                let most = if rejected { 1.0 } else { GROWTH };
                let allowed = length * by_error.clamp(REDUCTION, most);
                // A step cut short by the end, with hardly any error, says little about longer ones.
                self.next = if by_error >= most { allowed.max(self.next) } else { allowed };
                self.length = length;
                self.has_dense = false;
                return Ok(if length >= left { end } else { time + length });
            }
            rejected = true;
            self.next = length * by_error.clamp(REDUCTION, 1.0);
            if self.next <= SHORTEST_STEP * time.abs().max(end.abs()) || self.next < f64::MIN_POSITIVE {
                return Err(StepFailure { state: error.state });
            }
        }
    }

    /// The position of the state whose error determined the length of the last trial.
    #[must_use]
    pub(crate) fn decisive_state(&self) -> usize {
        self.decisive
    }

    /// The states at a time in the last step.
    pub fn states_at(&mut self, time: f64, states: &mut [f64]) {
        let share = (time - self.begin) / self.length;
        if share >= 1.0 {
            return states.copy_from_slice(&self.to);
        }
        if !self.has_dense {
            for (i, dense) in self.dense.iter_mut().enumerate() {
                *dense = DENSE.map(|weights| {
                    weights.iter().zip(&self.stages).map(|(weight, stage)| weight * stage[i]).sum::<f64>()
                });
            }
            self.has_dense = true;
        }
        let ends = self.from.iter().zip(&self.to);
        for ((state, [first, second, third]), (from, to)) in states.iter_mut().zip(&self.dense).zip(ends) {
            let bulge = first + share * (second + share * third);
            *state = (1.0 - share) * from + share * (to + (1.0 - share) * bulge);
        }
    }

    /// The length of a first step: that in which the states change by a hundredth at their present derivatives
    /// (Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, section II.4). The end does not limit it: it
    /// would limit the steps after it, too.
    fn first_step(&self, tolerance: &Tolerance<'_>) -> f64 {
        let norm = |values: &[f64]| {
            let scaled =
                values.iter().enumerate().map(|(i, value)| (value / tolerance.scale(i, self.from[i])).abs());
            scaled.fold(0.0, f64::max)
        };
        let (states, slopes) = (norm(&self.from), norm(&self.slopes));
        let length = 0.01 * states.max(1.0) / slopes;
        if length > 0.0 { length } else { f64::INFINITY }
    }

    /// Computes `stages` and `to` for a step length.
    fn trial(&mut self, system: &mut impl System, length: f64, tolerance: &Tolerance<'_>) -> LargestError {
        let size = self.from.len();
        let diagonal = (length * GAMMA).recip();
        for (factor, element) in self.factors.iter_mut().zip(&self.jacobian) {
            *factor = -element;
        }
        for i in 0..size {
            self.factors[i * size + i] += diagonal;
        }
        if !linear::factor(&mut self.factors, &mut self.pivots) {
            return LargestError { largest: f64::INFINITY, state: self.first_not_linear() };
        }
        for stage in 0..STAGES {
            let (known, rest) = self.stages.split_at_mut(stage);
            let solution = &mut rest[0];
            for i in 0..size {
                let weighted = |weights: &[f64]| {
                    weights.iter().zip(&*known).map(|(weight, stage)| weight * stage[i]).sum::<f64>()
                };
                self.moved[i] = self.from[i] + weighted(A[stage]);
                solution[i] = weighted(C[stage]) / length + length * TIME_DERIVATIVE[stage] * self.by_time[i];
            }
            if stage > 0 {
                system.derivatives(self.begin + TIMES[stage] * length, &self.moved, &mut self.to);
            }
            let slopes = if stage > 0 { &self.to } else { &self.slopes };
            if let Some(state) = slopes.iter().position(|slope| !slope.is_finite()) {
                return LargestError { largest: f64::INFINITY, state };
            }
            for (solution, slope) in solution.iter_mut().zip(slopes) {
                *solution += slope;
            }
            linear::solve(&self.factors, &self.pivots, solution);
        }
        // The last stage is the difference from the embedded method.
        let last = &self.stages[STAGES - 1];
        let mut largest = LargestError { largest: 0.0, state: 0 };
        for (state, (to, (moved, error))) in self.to.iter_mut().zip(self.moved.iter().zip(last)).enumerate() {
            *to = moved + error;
            let scale = tolerance.scale(state, self.from[state].abs().max(to.abs()));
            let error = (error / scale).abs();
            if !to.is_finite() || error.is_nan() {
                return LargestError { largest: f64::INFINITY, state };
            }
            if error > largest.largest {
                largest = LargestError { largest: error, state };
            }
        }
        largest
    }

    /// The first state whose derivative has no finite linearization.
    fn first_not_linear(&self) -> usize {
        let mut rows = self.jacobian.chunks_exact(self.from.len());
        rows.position(|row| row.iter().any(|element| !element.is_finite())).unwrap_or(0)
    }
}

/// The allowed error of a step.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance<'a> {
    /// Relative to the sum of a state and its nominal value.
    pub relative: f64,
    /// The nominal value of each state.
    pub nominals: &'a [f64],
}

impl Tolerance<'_> {
    fn scale(&self, state: usize, value: f64) -> f64 {
        self.relative * (value.abs() + self.nominals[state])
    }
}

/// The largest error of a trial relative to its tolerance, and the position of its state; infinite if anything was not
/// finite.
struct LargestError {
    largest: f64,
    state: usize,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// x' = x·cos t, y' = −y², from 1 at t = 1.
    struct Nonlinear;

    impl System for Nonlinear {
        fn derivatives(&mut self, time: f64, states: &[f64], derivatives: &mut [f64]) {
            derivatives[0] = states[0] * time.cos();
            derivatives[1] = -states[1] * states[1];
        }

        fn linearize(&mut self, time: f64, states: &[f64], jacobian: &mut [f64], by_time: &mut [f64]) {
            jacobian.copy_from_slice(&[time.cos(), 0.0, 0.0, -2.0 * states[1]]);
            by_time.copy_from_slice(&[-states[0] * time.sin(), 0.0]);
        }
    }

    fn exact(time: f64) -> [f64; 2] {
        [(time.sin() - 1.0_f64.sin()).exp(), time.recip()]
    }

    /// The errors of one step from 1: at its end, the estimate there, and at its middle.
    fn errors(length: f64) -> [[f64; 2]; 3] {
        let mut integrator = Integrator::new(2);
        integrator.next = length;
        let tolerance = Tolerance { relative: 1.0, nominals: &[1.0; 2] };
        integrator.step(&mut Nonlinear, (1.0, 1.0 + length), &exact(1.0), &tolerance, &mut 0).unwrap();
        let estimate = [integrator.stages[STAGES - 1][0], integrator.stages[STAGES - 1][1]];
        let mut error_at = |time: f64| {
            let mut states = [0.0; 2];
            integrator.states_at(time, &mut states);
            [states[0] - exact(time)[0], states[1] - exact(time)[1]]
        };
        [error_at(1.0 + length), estimate, error_at(1.0 + 0.5 * length)]
    }

    #[test]
    fn errors_fall_with_their_orders() {
        // The error of one step of a method of order p falls at least with the power p + 1: a wrong coefficient loses
        // a whole power. Half a power is for terms of higher order.
        for ((long, short), power) in errors(0.05).into_iter().zip(errors(0.025)).zip([6.0, 5.0, 5.0]) {
            for (long, short) in long.iter().zip(short) {
                let found = (long / short).abs().log2();
                assert!(found > power - 0.5, "the error falls with the power {found}, not {power}");
            }
        }
    }

    /// Takes a step from t = 1 with an initial length and a distant end. Returns the number of trials.
    fn step_from(integrator: &mut Integrator, length: f64, tolerance: &Tolerance<'_>) -> u32 {
        let mut trials = 0;
        integrator.next = length;
        integrator.step(&mut Nonlinear, (1.0, 1e4), &exact(1.0), tolerance, &mut trials).unwrap();
        trials
    }

    #[test]
    fn the_next_step_just_meets_the_tolerance() {
        let tolerance = Tolerance { relative: 1e-6, nominals: &[1.0; 2] };
        let mut integrator = Integrator::new(2);
        assert_eq!(step_from(&mut integrator, 0.03, &tolerance), 1);
        let proposed = integrator.next;
        // Its error is the fifth power of the safety factor, up to terms of higher order.
        let error = integrator.trial(&mut Nonlinear, proposed, &tolerance).largest;
        assert!(error > 0.4 && error < 0.8, "{error}");
        // The error of a step half as long again is about 4 tolerances: it is rejected.
        assert_eq!(step_from(&mut integrator, 1.5 * proposed, &tolerance), 2);
    }

    #[test]
    fn the_next_step_does_not_grow_at_once_after_a_rejection() {
        /// x' = 1, until t = 1.
        struct Wall;
        impl System for Wall {
            fn derivatives(&mut self, time: f64, _states: &[f64], derivatives: &mut [f64]) {
                derivatives[0] = if time <= 1.0 { 1.0 } else { f64::NAN };
            }

            fn linearize(&mut self, _time: f64, _states: &[f64], jacobian: &mut [f64], by_time: &mut [f64]) {
                (jacobian[0], by_time[0]) = (0.0, 0.0);
            }
        }
        let tolerance = Tolerance { relative: 1e-6, nominals: &[1.0] };
        let mut integrator = Integrator::new(1);
        let mut trials = 0;
        integrator.next = 2.0;
        integrator.step(&mut Wall, (0.0, 1e4), &[0.0], &tolerance, &mut trials).unwrap();
        assert_eq!(trials, 2);
        // A fifth of 2, up to the division of the time to the end into equal steps.
        assert!((integrator.next - 0.4).abs() < 1e-3, "{}", integrator.next);
    }

    #[test]
    fn lengths_that_are_far_off_take_few_trials() {
        let tolerance = Tolerance { relative: 1e-6, nominals: &[1.0; 2] };
        let mut integrator = Integrator::new(2);
        // From 1e3 to about 0.05, by a fifth each time plus two.
        let trials = step_from(&mut integrator, 1e3, &tolerance);
        assert!(trials <= 9, "{trials} trials");
        // From 1e-9 to 1e-2, sixfold each time.
        let mut length = 1e-9;
        let mut steps = 0;
        while length < 1e-2 {
            step_from(&mut integrator, length, &tolerance);
            (length, steps) = (integrator.next, steps + 1);
        }
        assert_eq!(steps, 9);
    }

    #[test]
    fn a_step_that_the_end_cuts_short_leaves_the_length_of_the_next() {
        let tolerance = Tolerance { relative: 1e-3, nominals: &[1.0; 2] };
        let mut integrator = Integrator::new(2);
        integrator.next = 0.1;
        let end = integrator.step(&mut Nonlinear, (1.0, 1.001), &exact(1.0), &tolerance, &mut 0).unwrap();
        assert_eq!([end, integrator.next].map(f64::to_bits), [1.001, 0.1].map(f64::to_bits));
    }

    #[test]
    fn a_step_to_the_end_ends_there() {
        let (begin, end): (f64, f64) = (0.3, 0.9);
        assert_ne!((begin + (end - begin)).to_bits(), end.to_bits(), "rounding would end it elsewhere");
        let tolerance = Tolerance { relative: 1e6, nominals: &[1.0; 2] };
        let mut integrator = Integrator::new(2);
        integrator.next = 10.0;
        let reached =
            integrator.step(&mut Nonlinear, (begin, end), &exact(begin), &tolerance, &mut 0).unwrap();
        assert_eq!(reached.to_bits(), end.to_bits());
    }

    /// x' = 1000, y' = cos t.
    struct Rising;

    impl System for Rising {
        fn derivatives(&mut self, time: f64, _states: &[f64], derivatives: &mut [f64]) {
            derivatives.copy_from_slice(&[1000.0, time.cos()]);
        }

        fn linearize(&mut self, time: f64, _states: &[f64], jacobian: &mut [f64], by_time: &mut [f64]) {
            jacobian.fill(0.0);
            by_time.copy_from_slice(&[0.0, -time.sin()]);
        }
    }

    #[test]
    fn the_error_is_relative_to_the_larger_of_both_ends_and_the_nominal_value() {
        let tolerance = Tolerance { relative: 1e-3, nominals: &[1.0, 0.25] };
        let mut integrator = Integrator::new(2);
        integrator.next = 0.5;
        for (from, larger) in [(0.0, 0.5_f64.sin()), (2.0, 2.0 + 0.5_f64.sin()), (-2.0, 2.0)] {
            integrator.step(&mut Rising, (0.0, 0.5), &[0.0, from], &tolerance, &mut 0).unwrap();
            let error = integrator.trial(&mut Rising, 0.5, &tolerance);
            let expected = integrator.stages[STAGES - 1][1].abs() / (1e-3 * (larger + 0.25));
            assert_eq!(error.state, 1);
            // The error of the step is far less than a thousandth.
            assert!((error.largest / expected - 1.0).abs() < 1e-3, "{} instead of {expected}", error.largest);
        }
    }

    #[test]
    fn a_failure_names_the_state_without_a_linearization() {
        struct Broken;
        impl System for Broken {
            fn derivatives(&mut self, _time: f64, _states: &[f64], derivatives: &mut [f64]) {
                derivatives.fill(1.0);
            }

            fn linearize(&mut self, _time: f64, _states: &[f64], jacobian: &mut [f64], by_time: &mut [f64]) {
                jacobian.copy_from_slice(&[0.0, 0.0, 0.0, f64::NAN]);
                by_time.fill(0.0);
            }
        }
        let tolerance = Tolerance { relative: 1e-3, nominals: &[1.0; 2] };
        let result = Integrator::new(2).step(&mut Broken, (0.0, 1.0), &[0.0; 2], &tolerance, &mut 0);
        assert_eq!(result, Err(StepFailure { state: 1 }));
    }

    #[test]
    fn within_a_step_the_error_is_less_than_at_its_end() {
        let length = 0.1;
        let mut integrator = Integrator::new(2);
        integrator.next = length;
        let tolerance = Tolerance { relative: 1.0, nominals: &[1.0; 2] };
        integrator.step(&mut Nonlinear, (1.0, 1.0 + length), &exact(1.0), &tolerance, &mut 0).unwrap();
        for eighth in 1..8 {
            let time = 1.0 + f64::from(eighth) / 8.0 * length;
            let mut states = [0.0; 2];
            integrator.states_at(time, &mut states);
            for (i, (state, exact)) in states.iter().zip(exact(time)).enumerate() {
                // The largest is a third.
                let error = ((state - exact) / integrator.stages[STAGES - 1][i]).abs();
                assert!(error < 0.5, "after {eighth} eighths, {error} of the error estimated for the end");
            }
        }
    }

    #[test]
    fn a_mode_a_million_times_as_fast_as_the_step_is_damped() {
        struct Stiff;
        impl System for Stiff {
            fn derivatives(&mut self, _time: f64, states: &[f64], derivatives: &mut [f64]) {
                derivatives[0] = -1e6 * states[0];
            }

            fn linearize(&mut self, _time: f64, _states: &[f64], jacobian: &mut [f64], by_time: &mut [f64]) {
                (jacobian[0], by_time[0]) = (-1e6, 0.0);
            }
        }
        let mut integrator = Integrator::new(1);
        integrator.next = 1.0;
        let tolerance = Tolerance { relative: 1.0, nominals: &[1.0] };
        integrator.step(&mut Stiff, (0.0, 1.0), &[1.0], &tolerance, &mut 0).unwrap();
        // An L-stable method with a few stages leaves a multiple of 1e-6; an explicit one would have 1e48.
        assert!(integrator.to[0].abs() < 1e-4, "{}", integrator.to[0]);
    }
}
