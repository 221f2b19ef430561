//! A linearly implicit (Rosenbrock) method of third order for stiff systems: ROS34PW2 (Rang and Angermann, New
//! Rosenbrock W-methods of order 3 for partial differential algebraic equations of index 1, BIT Numerical
//! Mathematics 45, 2005), four evaluations and four linear solutions a step.
//!
//! It is L-stable: modes much faster than the step are damped. As a W-method it keeps its order with any matrix A in
//! place of the Jacobian, so one from finite differences serves many steps, and its inverse all steps of about the same
//! length. The error estimate falls with the third power of the step.

use fmu_export::Error;
use fmu_export::persistence::{Archive, Persistent};

use super::{Trial, linear};

/// γ of the method.
const GAMMA: f64 = 0.435_866_521_508_459;
/// Finite differences relative to the scale of a state, about the root of the rounding unit.
const INCREMENT: f64 = 1e-7;
/// The largest relative difference of a step's length from the one of the inverse.
const SIMILAR: f64 = 0.4;

/// The linear equations of the method.
#[derive(Clone, Copy, Debug)]
pub struct Linearization<const N: usize> {
    /// The approximate Jacobian, by columns.
    jacobian: [[f64; N]; N],
    /// The number of remaining steps with it; 0 if there is none.
    serves: u32,
    /// Whether no step was accepted with it yet.
    is_fresh: bool,
    /// The inverse of 1 − γ·h·A, by columns.
    inverse: [[f64; N]; N],
    /// The product γ·h of the inverse; 0 if there is none.
    weight: f64,
}

impl<const N: usize> Persistent for Linearization<N> {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let Self { jacobian, serves, is_fresh, inverse, weight } = self;
        jacobian.persist(archive)?;
        serves.persist(archive)?;
        is_fresh.persist(archive)?;
        inverse.persist(archive)?;
        weight.persist(archive)
    }
}

impl<const N: usize> Default for Linearization<N> {
    fn default() -> Self {
        Self { jacobian: [[0.0; N]; N], serves: 0, is_fresh: false, inverse: [[0.0; N]; N], weight: 0.0 }
    }
}

/// The start of a step.
#[derive(Clone, Copy, Debug)]
pub struct Begin<'a, const N: usize> {
    pub time: f64,
    pub states: &'a [f64; N],
    pub slopes: &'a [f64; N],
    /// The approximate partial derivatives of the slopes with respect to time.
    pub drift: &'a [f64; N],
}

/// Solves the linear equations of a step of the prepared length.
pub trait Solver<const N: usize> {
    /// The product of the inverse of 1 − γ·h·A and a vector.
    fn solve(&self, vector: [f64; N]) -> [f64; N];
}

impl<const N: usize> Solver<N> for Linearization<N> {
    #[inline]
    fn solve(&self, vector: [f64; N]) -> [f64; N] {
        product(&self.inverse, &vector)
    }
}

/// The product of a matrix, by columns, and a vector.
#[inline]
fn product<const N: usize>(matrix: &[[f64; N]; N], vector: &[f64; N]) -> [f64; N] {
    let mut product = [0.0; N];
    // Column by column, so that the sums of all rows are computed in parallel.
    for (column, x) in matrix.iter().zip(vector) {
        for (sum, element) in product.iter_mut().zip(column) {
            *sum += element * x;
        }
    }
    product
}

/// Two linearizations, of a system's first and last states, without their coupling.
#[derive(Clone, Copy, Debug)]
pub struct Blocks<'a, const A: usize, const B: usize>(pub &'a Linearization<A>, pub &'a Linearization<B>);

impl<const A: usize, const B: usize, const N: usize> Solver<N> for Blocks<'_, A, B> {
    fn solve(&self, vector: [f64; N]) -> [f64; N] {
        const { assert!(A + B == N) };
        let first = self.0.solve(std::array::from_fn(|i| vector[i]));
        let last = self.1.solve(std::array::from_fn(|i| vector[A + i]));
        std::array::from_fn(|i| if i < A { first[i] } else { last[i - A] })
    }
}

impl<const N: usize> Linearization<N> {
    /// Whether the next step needs a new one.
    pub fn is_used_up(&self) -> bool {
        self.serves == 0
    }

    /// Counts an accepted step.
    pub fn count(&mut self) {
        self.is_fresh = false;
        self.serves = self.serves.saturating_sub(1);
    }

    /// Discards it if a step was accepted with it; otherwise it is still current.
    pub fn discard(&mut self) {
        if !self.is_fresh {
            self.serves = 0;
        }
    }

    /// Linearizes at states with the derivatives `slopes`, for a number of steps; `scales` is the magnitude of each
    /// state.
    pub fn renew(
        &mut self,
        mut derivatives: impl FnMut(&[f64; N]) -> [f64; N],
        states: &[f64; N],
        slopes: &[f64; N],
        scales: &[f64; N],
        serves: u32,
    ) {
        for column in 0..N {
            let mut moved = *states;
            moved[column] += INCREMENT * scales[column];
            let reciprocal = (moved[column] - states[column]).recip();
            let moved_slopes = derivatives(&moved);
            self.jacobian[column] = std::array::from_fn(|row| (moved_slopes[row] - slopes[row]) * reciprocal);
        }
        (self.serves, self.is_fresh) = (serves, true);
        self.weight = 0.0;
    }

    /// Prepares a step of a length. Returns whether the matrix is regular.
    pub fn prepare(&mut self, length: f64) -> bool {
        let weight = GAMMA * length;
        if (self.weight - weight).abs() <= SIMILAR * weight {
            return true;
        }
        let mut matrix = self.jacobian.map(|column| column.map(|element| -weight * element));
        for (i, column) in matrix.iter_mut().enumerate() {
            column[i] += 1.0;
        }
        let Some(inverse) = linear::inverse(matrix) else { return false };
        (self.inverse, self.weight) = (inverse, weight);
        true
    }
}

/// A step; `derivatives` computes dx/dt at a time, `at_end` those at the step's end. The estimated error is the
/// difference from the embedded method of second order.
#[inline]
pub fn step<const N: usize>(
    solver: &impl Solver<N>,
    derivatives: impl Fn(f64, &[f64; N]) -> [f64; N],
    at_end: impl FnOnce(&[f64; N]) -> [f64; N],
    begin: &Begin<'_, N>,
    length: f64,
) -> Trial<N> {
    // The printed coefficients (α, Γ, b) for the sums u = Γ·k instead of k, which avoids products with A:
    // α·Γ⁻¹, γ·(1/γ − Γ⁻¹), b·Γ⁻¹ and, for the error, (b − b̂)·Γ⁻¹.
    let Begin { time, states, slopes, drift } = begin;
    let solve = |slopes: &[f64; N], drift_weight: f64, others: [f64; N]| {
        solver.solve(std::array::from_fn(|i| {
            GAMMA * length * (slopes[i] + drift_weight * length * drift[i]) + others[i]
        }))
    };
    let u1 = solve(slopes, GAMMA, [0.0; N]);
    let moved = std::array::from_fn(|i| states[i] + 2.0 * u1[i]);
    let f2 = derivatives(time + 2.0 * GAMMA * length, &moved);
    let u2 = solve(&f2, -GAMMA, u1.map(|u1| -2.0 * u1));
    let moved = std::array::from_fn(|i| {
        states[i] + 1.419_217_317_455_764_7 * u1[i] - 0.259_232_211_672_969_7 * u2[i]
    });
    let f3 = derivatives(time + 0.731_579_957_788_852_4 * length, &moved);
    let others = std::array::from_fn(|i| -1.823_996_994_774_513_6 * u1[i] + 0.124_305_652_566_720_08 * u2[i]);
    let u3 = solve(&f3, -0.413_333_376_233_886_5, others);
    let moved: [f64; N] = std::array::from_fn(|i| {
        states[i] + 4.184_760_482_319_16 * u1[i] - 0.285_192_017_355_495_9 * u2[i]
            + 2.294_280_360_279_042 * u3[i]
    });
    let f4 = derivatives(time + length, &moved);
    let others = std::array::from_fn(|i| {
        -2.775_676_116_302_468_4 * u1[i] - 2.961_983_662_554_788_4 * u2[i] + 1.250_979_895_056_060_4 * u3[i]
    });
    let u4 = solve(&f4, 0.0, others);
    let end = std::array::from_fn(|i| moved[i] + u4[i]);
    let error = std::array::from_fn(|i| {
        0.277_749_947_647_967_95 * u1[i] - 1.403_239_895_175_999 * u2[i]
            + 1.772_630_127_667_550_6 * u3[i]
            + 0.5 * u4[i]
    });
    Trial { slopes: at_end(&end), states: end, error }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The errors at 2 of x' = λ·(x − y − cos t) + y·cos t − sin t, y' = y·cos t with the Jacobian from the start; the
    /// solution is y = exp(sin t), x = y + cos t.
    fn error(stiffness: f64, steps: u32) -> [f64; 2] {
        let exact = |t: f64| [t.sin().exp() + t.cos(), t.sin().exp()];
        let rates = |t: f64, z: &[f64; 2]| {
            [stiffness * (z[0] - z[1] - t.cos()) + z[1] * t.cos() - t.sin(), z[1] * t.cos()]
        };
        let length = 2.0 / f64::from(steps);
        let mut states = exact(0.0);
        let mut linearization = Linearization::default();
        linearization.renew(|z| rates(0.0, z), &states, &rates(0.0, &states), &[1.0; 2], steps);
        for step in 0..steps {
            let time = f64::from(step) * length;
            let slopes = rates(time, &states);
            let later = rates(time + 1e-6, &states);
            let drift = std::array::from_fn(|i| (later[i] - slopes[i]) / 1e-6);
            let begin = Begin { time, states: &states, slopes: &slopes, drift: &drift };
            assert!(linearization.prepare(length));
            states = super::step(&linearization, rates, |z| *z, &begin, length).states;
        }
        let exact = exact(2.0);
        [states[0] - exact[0], states[1] - exact[1]]
    }

    #[test]
    fn the_order_of_the_errors_holds_with_an_old_jacobian() {
        let ratio = error(-1.0, 80)[1] / error(-1.0, 160)[1];
        // The third power of 2, except for terms of higher order.
        assert!((ratio / 8.0 - 1.0).abs() < 0.15, "the error falls by {ratio}");
    }

    #[test]
    fn a_mode_a_million_times_as_fast_is_damped() {
        let [fast, slow] = error(-1e6, 40);
        // An explicit method has an error of 1e100 here.
        assert!(fast.abs() < 5e-3 && slow.abs() < 5e-3, "{fast}, {slow}");
    }

    #[test]
    fn the_estimates_fall_with_the_third_power_and_have_the_magnitude_of_the_errors() {
        // x' = x·cos t from 1 at t = 1: x = exp(sin t − sin 1).
        let rates = |t: f64, x: &[f64; 1]| [x[0] * t.cos()];
        let first_step = |length: f64| {
            let mut linearization = Linearization::default();
            let (states, slopes, drift) = ([1.0], rates(1.0, &[1.0]), [-1.0_f64.sin()]);
            linearization.renew(|x| rates(1.0, x), &states, &slopes, &[1.0], 1);
            let begin = Begin { time: 1.0, states: &states, slopes: &slopes, drift: &drift };
            let at_end = |x: &[f64; 1]| rates(1.0 + length, x);
            assert!(linearization.prepare(length));
            let trial = step(&linearization, rates, at_end, &begin, length);
            let exact = ((1.0 + length).sin() - 1.0_f64.sin()).exp();
            (trial.states[0] - exact, trial.error[0])
        };
        let (long, short) = (first_step(0.1), first_step(0.05));
        // The estimate is the embedded method's error, which is larger.
        assert!(long.0.abs() <= 3.0 * long.1.abs(), "{long:?}");
        let ratio = long.1 / short.1;
        assert!((6.0..10.0).contains(&ratio), "the estimate falls by {ratio}");
    }

    #[test]
    fn each_block_is_solved_by_its_own_matrix() {
        let linearization = |slope: f64| {
            let mut linearization = Linearization::default();
            linearization.renew(|x: &[f64; 1]| [slope * x[0]], &[0.0], &[0.0], &[1.0], 1);
            assert!(linearization.prepare(1.0));
            linearization
        };
        let (first, last) = (linearization(-1.0), linearization(-5.0));
        let [x, y] = Blocks(&first, &last).solve([1.0, 1.0]);
        assert!((x - (1.0 + GAMMA).recip()).abs() < 1e-7 && (y - (1.0 + 5.0 * GAMMA).recip()).abs() < 1e-7);
    }

    #[test]
    fn a_singular_matrix_is_reported() {
        let mut linearization = Linearization::default();
        linearization.renew(|_| [f64::NAN], &[0.0], &[0.0], &[1.0], 5);
        assert!(!linearization.prepare(1.0));
    }
}
