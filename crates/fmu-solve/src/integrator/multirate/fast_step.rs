//! A step of the fast part as the slow one needs it: as a polynomial over time.

use core::array;

use super::course::{Course, METHOD, STAGES, product};

/// The weights of the stages' values in the slopes at both ends of the polynomial through them, relative to the step.
const STAGE_SLOPES: [[f64; STAGES]; 2] = [slope_weights(0.0), slope_weights(1.0)];
/// The largest value of the cubic with the slope 1 at one end, relative to its length: θ·(1 − θ)² at a third.
pub(super) const BULGE: f64 = 4.0 / 27.0;

/// The states and derivatives of a step's stages after the first.
pub(super) type Stages<const N: usize> = [[[f64; N]; 2]; STAGES - 1];

/// An accepted step of the fast part.
#[derive(Clone, Copy, Debug)]
pub(super) struct FastStep<const N: usize> {
    pub(super) begin: f64,
    pub(super) end: f64,
    /// The states and their derivatives at both ends.
    pub(super) states: [[f64; N]; 2],
    pub(super) slopes: [[f64; N]; 2],
}

impl<const N: usize> FastStep<N> {
    /// The largest change of a state by which the derivatives at both ends differ from the mean one, relative to the
    /// state's allowed error.
    pub(super) fn bulge(&self, course: &Course<N>) -> f64 {
        let length = self.end - self.begin;
        let rise: [f64; N] = array::from_fn(|i| self.states[1][i] - self.states[0][i]);
        let relative = |slopes: &[f64; N]| {
            let relative = |i: usize| ((length * slopes[i] - rise[i]) * course.weights[i]).abs();
            (0..N).map(relative).fold(0.0, f64::max)
        };
        relative(&self.slopes[0]).max(relative(&self.slopes[1]))
    }

    /// Replaces the derivatives of a stiff part, which are mostly those of the states' errors, by those of the smooth
    /// solution: with A for the Jacobian J, it follows from x″ = J·x′ + ∂f/∂t that
    ///
    /// ```text
    /// (1 − γ·h·A)·x′ = f + γ·h·(d(f − A·x)/dt − x″),
    /// ```
    ///
    /// which damps the states' errors as in a step. The derivative on the right-hand side is that of the polynomial
    /// through the states and derivatives of the stages, x″ that of the cubic.
    #[inline(never)]
    pub(super) fn smoothen(&mut self, course: &Course<N>, stages: &Stages<N>) {
        let length = self.end - self.begin;
        let weight = METHOD.gamma * course.inverse_of / length;
        let rise: [f64; N] = array::from_fn(|i| (self.states[1][i] - self.states[0][i]) / length);
        let [first, last] = self.slopes;
        self.slopes = array::from_fn(|end| {
            let [first_weight, weights @ ..] = STAGE_SLOPES[end];
            let [mut states, mut slopes] =
                [self.states[0], first].map(|values| values.map(|value| first_weight * value));
            for (weight, [x, f]) in weights.iter().zip(stages) {
                states = array::from_fn(|i| states[i] + weight * x[i]);
                slopes = array::from_fn(|i| slopes[i] + weight * f[i]);
            }
            let by_states = product(&course.jacobian, &states);
            let here = [first, last][end];
            product(
                &course.inverse,
                &array::from_fn(|i| {
                    let curvature = match end {
                        0 => 6.0 * rise[i] - 4.0 * first[i] - 2.0 * last[i],
                        _ => 2.0 * first[i] + 4.0 * last[i] - 6.0 * rise[i],
                    };
                    here[i] + weight * (slopes[i] - by_states[i] - curvature)
                }),
            )
        });
    }

    /// The states at a time, by the cubic through states and derivatives at both ends.
    pub(super) fn at(&self, time: f64) -> [f64; N] {
        let length = self.end - self.begin;
        let share = (time - self.begin) / length;
        let rest = 1.0 - share;
        let (from, to) = (rest * rest * (1.0 + 2.0 * share), share * share * (3.0 - 2.0 * share));
        let (first, last) = (length * share * rest * rest, -length * share * share * rest);
        let Self { states, slopes, .. } = self;
        array::from_fn(|i| {
            from * states[0][i] + to * states[1][i] + first * slopes[0][i] + last * slopes[1][i]
        })
    }
}

/// The derivatives, at one of the stages' times, of Lagrange's polynomials through them.
const fn slope_weights(at: f64) -> [f64; STAGES] {
    let (times, mut weights, mut i) = (METHOD.times, [0.0; STAGES], 0);
    while i < STAGES {
        let mut left_out = 0;
        while left_out < STAGES {
            let (mut product, mut j) = (1.0, 0);
            while j < STAGES {
                if j == left_out && j != i {
                    product /= times[i] - times[j];
                } else if j != i && left_out != i {
                    product *= (at - times[j]) / (times[i] - times[j]);
                }
                j += 1;
            }
            if left_out != i {
                weights[i] += product;
            }
            left_out += 1;
        }
        i += 1;
    }
    weights
}
