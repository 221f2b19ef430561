//! Poles and frequency responses of linear equations.

use std::f64::consts::TAU;

use anyhow::{Context, Result, bail};
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

/// dx/dt = A·x + B·u, y = C·x + D·u, in states scaled so that the rows and columns of A are of similar size.
pub struct StateSpace {
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
        let mut b = matrix(states, inputs, &of.b);
        let mut c = matrix(outputs, states, &of.c);
        let scales = if states > 0 { balance_parlett_reinsch(&mut a) } else { DVector::zeros(0) };
        for (state, scale) in scales.iter().enumerate() {
            b.row_mut(state).unscale_mut(*scale);
            c.column_mut(state).scale_mut(*scale);
        }
        Self { a, b, c, d: matrix(outputs, inputs, &of.d) }
    }

    /// The eigenvalues of A (1/s), the slowest first.
    ///
    /// # Errors
    /// When they do not converge.
    pub fn poles(&self) -> Result<Vec<Complex<f64>>> {
        let size = self.a.nrows();
        if size == 0 {
            return Ok(vec![]);
        }
        let schur = Schur::try_new(self.a.clone(), f64::EPSILON, MOST_ITERATIONS * size.max(10));
        let schur = schur.context("the eigenvalues of A do not converge")?;
        let poles = schur.complex_eigenvalues();
        let rounding = size as f64 * f64::EPSILON * self.a.norm();
        let exact = |part: f64| if part.abs() < rounding { 0.0 } else { part };
        let mut poles: Vec<_> =
            poles.iter().map(|pole| Complex::new(exact(pole.re), exact(pole.im))).collect();
        poles.sort_by(|one, other| {
            let [one, other] = [one, other].map(|pole| (pole.norm(), pole.re, pole.im));
            one.partial_cmp(&other).unwrap_or(std::cmp::Ordering::Equal)
        });
        Ok(poles)
    }

    /// The response C·(jω − A)⁻¹·B + D of an output to an input at frequencies (Hz).
    ///
    /// # Errors
    /// When a frequency is that of an undamped pole.
    pub fn response(&self, input: usize, output: usize, frequencies: &[f64]) -> Result<Vec<Complex<f64>>> {
        let complex = |number: f64| Complex::new(number, 0.0);
        let b = self.b.column(input).map(complex);
        let c = self.c.row(output).map(complex);
        let d = complex(self.d[(output, input)]);
        let at = |&frequency: &f64| {
            let mut matrix = self.a.map(|number| complex(-number));
            for state in 0..matrix.nrows() {
                matrix[(state, state)] += Complex::new(0.0, TAU * frequency);
            }
            if matrix.is_empty() {
                return Ok(d);
            }
            match matrix.lu().solve(&b) {
                Some(states) => Ok((&c * states)[0] + d),
                None => bail!("a pole is at {frequency} Hz"),
            }
        };
        frequencies.iter().map(at).collect()
    }
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

    #[test]
    fn a_response_is_the_transfer_function() {
        let frequencies = [0.01, 5.0 / TAU, 3.0, 1e3];
        let found = oscillator().response(0, 0, &frequencies).unwrap();
        for (frequency, found) in frequencies.into_iter().zip(found) {
            let s = Complex::new(0.0, TAU * frequency);
            let expected = Complex::new(1e6, 0.0) / (s * s * 2.0 + s * 0.4 + 50.0);
            assert!((found - expected).norm() < 1e-12 * expected.norm(), "{frequency} Hz: {found}");
        }
        let undamped = oscillator();
        let undamped = StateSpace { a: DMatrix::zeros(2, 2), ..undamped };
        assert_eq!(undamped.response(0, 0, &[0.0]).unwrap_err().to_string(), "a pole is at 0 Hz");
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
