//! Poles and frequency responses of linear equations.

use std::f64::consts::TAU;

use fmu_master::Linearization;
use nalgebra::linalg::balancing::balance_parlett_reinsch;
use nalgebra::{Complex, DMatrix, DVector, Schur};

/// Points of a frequency response, in addition to those at poles.
const POINTS: u32 = 200;
/// The range of frequencies about those of the poles, and its maximum width.
const ROOM: f64 = 10.0;
const WIDTH: f64 = 1e8;
/// Frequencies without poles (Hz).
const WITHOUT_POLES: (f64, f64) = (0.01, 100.0);
/// Iterations per state after which the eigenvalues are given up: the limit of LAPACK (dhseqr).
const MOST_ITERATIONS: usize = 30;
/// The most trials to find the eigenvalues.
const MOST_TRIALS: usize = 4;
/// The most states for poles and responses: their cost is cubic, and seconds here.
pub const MOST_STATES: usize = 1000;

/// dx/dt = A·x + B·u, y = C·x + D·u, in states by which A is a Hessenberg matrix. Before, they are scaled so that the rows
/// and columns of A are of similar size.
pub struct StateSpace {
    /// A power of two (1/s), by which A is divided so that squares of its elements do not overflow.
    rate: f64,
    /// A divided by the rate.
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
}

impl StateSpace {
    pub fn new(of: &Linearization) -> Self {
        let (states, inputs, outputs) = (of.states.len(), of.inputs.len(), of.outputs.len());
        let matrix = |rows: usize, columns: usize, numbers: &[Vec<f64>]| {
            DMatrix::from_row_iterator(rows, columns, numbers.iter().flatten().copied())
        };
        let mut a = matrix(states, states, &of.a);
        let rate = power_of_two_below(a.amax());
        a.unscale_mut(rate);
        let mut b = matrix(states, inputs, &of.b);
        let mut c = matrix(outputs, states, &of.c);
        let scales = if states > 0 { balance_parlett_reinsch(&mut a) } else { DVector::zeros(0) };
        for (state, scale) in scales.iter().enumerate() {
            b.row_mut(state).unscale_mut(*scale);
            c.column_mut(state).scale_mut(*scale);
        }
        if states > 1 {
            let (transformation, hessenberg) = a.hessenberg().unpack();
            a = hessenberg;
            b = transformation.tr_mul(&b);
            c *= transformation;
        }
        Self { rate, a, b, c, d: matrix(outputs, inputs, &of.d) }
    }

    /// The eigenvalues of A (1/s), the slowest first; none if they do not converge.
    pub fn poles(&self) -> Option<Vec<Complex<f64>>> {
        let size = self.a.nrows();
        if size == 0 {
            return Some(vec![]);
        }
        let mut a = self.a.clone();
        let schur = (0..MOST_TRIALS).find_map(|_| {
            let schur = Schur::try_new(a.clone(), f64::EPSILON, MOST_ITERATIONS * size.max(10));
            // The shifts of some matrices, as of a ring, leave them as they are. Reflected, they are others.
            reflect(&mut a);
            schur
        });
        let poles = schur?.complex_eigenvalues();
        let rounding = size as f64 * f64::EPSILON * self.a.norm();
        let exact = |part: f64| if part.abs() < rounding { 0.0 } else { part };
        let mut poles: Vec<_> =
            poles.iter().map(|pole| Complex::new(exact(pole.re), exact(pole.im)) * self.rate).collect();
        poles.sort_by(|one, other| {
            let [one, other] = [one, other].map(|pole| (pole.norm(), pole.re, pole.im));
            one.partial_cmp(&other).unwrap_or(std::cmp::Ordering::Equal)
        });
        Some(poles)
    }

    /// The response C·(jω − A)⁻¹·B + D of an output to an input at a frequency (Hz); none if that is an undamped pole's.
    pub fn response(&self, input: usize, output: usize, frequency: f64) -> Option<Complex<f64>> {
        let complex = |number: f64| Complex::new(number, 0.0);
        // (jω − A)⁻¹ = (jω/r − A/r)⁻¹/r.
        let b = self.b.column(input).map(|number| complex(number / self.rate));
        let c = self.c.row(output).map(complex);
        let d = complex(self.d[(output, input)]);
        let mut matrix = self.a.map(|number| complex(-number));
        for state in 0..matrix.nrows() {
            matrix[(state, state)] += Complex::new(0.0, TAU * frequency / self.rate);
        }
        if matrix.is_empty() {
            return Some(d);
        }
        Some((&c * solve(matrix, b)?)[0] + d)
    }
}

/// The largest power of two that is not above a number; 1 if it is too small for one.
fn power_of_two_below(number: f64) -> f64 {
    // Without the bits of the significand.
    if number.is_normal() { f64::from_bits(number.to_bits() >> 52 << 52) } else { 1.0 }
}

/// Transforms a matrix by a reflection, which keeps its eigenvalues. Elements of its normal are fractional parts of multiples
/// of the golden ratio.
fn reflect(matrix: &mut DMatrix<f64>) {
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let normal = DVector::from_fn(matrix.nrows(), |row, _| ((row + 1) as f64 * GOLDEN).fract() - 0.5);
    let normal = normal.normalize();
    let along = matrix.tr_mul(&normal);
    matrix.ger(-2.0, &normal, &along, 1.0);
    let along = &*matrix * &normal;
    matrix.ger(-2.0, &along, &normal, 1.0);
}

/// The solution of a system of equations whose matrix is a Hessenberg matrix; none if it is singular.
fn solve(
    mut matrix: DMatrix<Complex<f64>>,
    mut right: DVector<Complex<f64>>,
) -> Option<DVector<Complex<f64>>> {
    for row in 0..right.len() - 1 {
        if matrix[(row + 1, row)].norm() > matrix[(row, row)].norm() {
            matrix.swap_rows(row, row + 1);
            right.swap_rows(row, row + 1);
        }
        let pivot = matrix[(row, row)];
        if pivot.norm() == 0.0 {
            return None;
        }
        let factor = matrix[(row + 1, row)] / pivot;
        for column in row..right.len() {
            let above = matrix[(row, column)];
            matrix[(row + 1, column)] -= factor * above;
        }
        let above = right[row];
        right[row + 1] -= factor * above;
    }
    matrix.solve_upper_triangular_mut(&mut right).then_some(right)
}

/// Frequencies (Hz) that show the effect of the poles, ascending; within `range` if it is given.
pub fn frequencies(poles: &[Complex<f64>], range: Option<(f64, f64)>) -> Vec<f64> {
    let of_poles: Vec<_> = poles.iter().map(|pole| pole.norm() / TAU).filter(|own| *own > 0.0).collect();
    let (from, to) = range.unwrap_or_else(|| {
        let ends =
            of_poles.iter().fold((f64::INFINITY, 0.0), |(least, most), own| (own.min(least), own.max(most)));
        let to = ends.1 * ROOM;
        if of_poles.is_empty() { WITHOUT_POLES } else { ((ends.0 / ROOM).max(to / WIDTH), to) }
    });
    let spaced = (0..POINTS).map(|index| from * (to / from).powf(f64::from(index) / f64::from(POINTS - 1)));
    // Sharp peaks are between points.
    let damped = poles.iter().filter(|pole| pole.re != 0.0).map(|pole| pole.norm() / TAU);
    let mut all: Vec<_> = spaced.chain(damped.filter(|own| (from..=to).contains(own))).collect();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mass on a spring with a damper: m = 2 kg, d = 0.4 N·s/m, k = 50 N/m, in units that are far apart.
    fn oscillator() -> StateSpace {
        StateSpace::new(&Linearization {
            // In µm and m/s.
            states: vec![("x".to_owned(), 0.0), ("v".to_owned(), 0.0)],
            derivatives: vec![0.0; 2],
            inputs: vec![("f".to_owned(), 0.0)],
            outputs: vec![("x".to_owned(), 0.0)],
            a: vec![vec![0.0, 1e6], vec![-25e-6, -0.2]],
            b: vec![vec![0.0], vec![0.5]],
            c: vec![vec![1.0, 0.0]],
            d: vec![vec![0.0]],
            is_exact: true,
        })
    }

    #[test]
    fn poles_are_those_of_the_characteristic_polynomial() {
        // s² + 0.2·s + 25 = 0.
        for (pole, sign) in oscillator().poles().unwrap().iter().zip([-1.0, 1.0]) {
            let expected = Complex::new(-0.1, sign * 24.99_f64.sqrt());
            assert!((pole - expected).norm() < 1e-13 * 25.0, "{pole}");
        }
    }

    /// A scaled in time has the poles, and scaled frequencies the responses; squares of the elements are not numbers.
    #[test]
    fn fast_equations_have_poles_and_responses() {
        let names = |name: &str, count| vec![(name.to_owned(), 0.0); count];
        let space = |rate: f64| {
            let row = |numbers: [f64; 3]| numbers.map(|number| number * rate).to_vec();
            StateSpace::new(&Linearization {
                states: names("x", 3),
                derivatives: vec![0.0; 3],
                inputs: names("u", 1),
                outputs: names("y", 1),
                a: vec![row([-1.0, 2.0, 0.5]), row([-2.0, -1.0, 0.25]), row([0.0, 1.0, -3.0])],
                b: vec![vec![1.0], vec![0.0], vec![0.0]],
                c: vec![vec![0.0, 0.0, 1.0]],
                d: vec![vec![0.0]],
                is_exact: true,
            })
        };
        let unit = space(1.0);
        for exponent in [-900, -600, 515, 600, 900, 1020] {
            let rate = 2_f64.powi(exponent);
            let fast = space(rate);
            let expected: Vec<_> = unit.poles().unwrap().iter().map(|pole| pole * rate).collect();
            assert_eq!(fast.poles().unwrap(), expected, "2^{exponent}");
            let slow = unit.response(0, 0, 0.3).unwrap();
            let found = fast.response(0, 0, 0.3 * rate).unwrap() * rate;
            // Inputs divided by the highest rate are subnormal: they lose some of their bits.
            assert!((found - slow).norm() < 1e-14 * slow.norm(), "2^{exponent}: {found}");
        }
    }

    #[test]
    fn a_response_is_the_transfer_function() {
        for frequency in [0.01, 5.0 / TAU, 3.0, 1e3] {
            let found = oscillator().response(0, 0, frequency).unwrap();
            let s = Complex::new(0.0, TAU * frequency);
            let expected = Complex::new(1e6, 0.0) / (s * s * 2.0 + s * 0.4 + 50.0);
            assert!((found - expected).norm() < 1e-12 * expected.norm(), "{frequency} Hz: {found}");
        }
        let undamped = oscillator();
        let undamped = StateSpace { a: DMatrix::zeros(2, 2), ..undamped };
        assert_eq!(undamped.response(0, 0, 0.0), None);
    }

    /// A ring, each of whose states follows the one before: dx/dt of one is the next one's. Its poles are the roots of 1, and
    /// its response from the last state to the first is sⁿ⁻¹/(sⁿ − 1).
    #[test]
    fn poles_of_a_ring_are_roots_of_one() {
        let size = 48;
        let unit = |position: usize| (0..size).map(move |other| f64::from(u8::from(other == position)));
        let names = |name: &str, count| vec![(name.to_owned(), 0.0); count];
        let ring = StateSpace::new(&Linearization {
            states: names("x", size),
            derivatives: vec![0.0; size],
            inputs: names("u", 1),
            outputs: names("y", 1),
            a: (0..size).map(|row| unit((row + 1) % size).collect()).collect(),
            b: unit(0).map(|one| vec![one]).collect(),
            c: vec![unit(0).collect()],
            d: vec![vec![0.0]],
            is_exact: true,
        });
        let poles = ring.poles().unwrap();
        assert_eq!(poles.len(), size);
        for pole in poles {
            let error = (pole.powu(48) - 1.0).norm();
            // Transformations of n² elements round an orthogonal matrix by at most n²·ε, and the n-th power has n times the
            // error of a pole.
            assert!(error < 48.0_f64.powi(3) * f64::EPSILON, "{pole}: {error}");
        }
        let s = Complex::new(0.0, 1.5);
        let expected = s.powu(47) / (s.powu(48) - 1.0);
        let found = ring.response(0, 0, 1.5 / TAU).unwrap();
        // n²·ε of the matrix, twice, as |(jω − A)⁻¹| ≤ 1/(1.5 − 1).
        let rounding = 2.0 * 48.0 * 48.0 * f64::EPSILON;
        assert!((found - expected).norm() < rounding, "{found} {expected}");
    }

    #[test]
    fn frequencies_surround_the_poles_and_meet_them() {
        let poles = oscillator().poles().unwrap();
        let found = frequencies(&poles, None);
        assert!(found.is_sorted() && found.contains(&(poles[0].norm() / TAU)));
        let [first, last] = [found[0], found[found.len() - 1]].map(|frequency| frequency * TAU / 5.0);
        assert!((first - 0.1).abs() < 1e-9 && (last - 10.0).abs() < 1e-9, "{first} {last}");
        assert_eq!(frequencies(&poles, Some((1.0, 2.0))).len(), POINTS as usize);
    }
}
