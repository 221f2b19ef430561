//! Dense linear systems by LU factorization with partial pivoting, in place.

use core::mem;

/// Factors a multiple of the unit matrix minus a square matrix, by rows, into `factors`; `pivots` gets the exchanged rows.
/// Returns whether it is regular to working precision.
pub(crate) fn factor(diagonal: f64, matrix: &[f64], factors: &mut [f64], pivots: &mut [usize]) -> bool {
    for (factor, element) in factors.iter_mut().zip(matrix) {
        *factor = -element;
    }
    for row in 0..pivots.len() {
        factors[row * pivots.len() + row] += diagonal;
    }
    eliminate(factors, pivots)
}

/// Factors a square matrix in place.
fn eliminate(matrix: &mut [f64], pivots: &mut [usize]) -> bool {
    let size = pivots.len();
    for (column, pivot) in pivots.iter_mut().enumerate() {
        let (above, below) = matrix.split_at_mut((column + 1) * size);
        let pivot_row = &mut above[column * size..];
        let mut largest = pivot_row[column].abs();
        *pivot = column;
        for (row, after) in below.chunks_exact(size).zip(column + 1..) {
            let magnitude = row[column].abs();
            if magnitude > largest {
                (largest, *pivot) = (magnitude, after);
            }
        }
        if !is_regular(largest) {
            return false;
        }
        if let Some(after) = pivot.checked_sub(column + 1) {
            pivot_row.swap_with_slice(&mut below[after * size..(after + 1) * size]);
        }
        let reciprocal = pivot_row[column].recip();
        let pivot_row = &pivot_row[column + 1..];
        for row in below.chunks_exact_mut(size) {
            let (before, row) = row.split_at_mut(column + 1);
            let factor = before[column] * reciprocal;
            before[column] = factor;
            for (element, above) in row.iter_mut().zip(pivot_row) {
                *element -= factor * above;
            }
        }
    }
    true
}

/// Solves a linear system in place of its right-hand side, by the factors of its matrix.
pub(crate) fn solve(factors: &[f64], pivots: &[usize], vector: &mut [f64]) {
    let size = pivots.len();
    for (row, &pivot) in pivots.iter().enumerate() {
        vector.swap(row, pivot);
    }
    for row in 0..size {
        let (known, vector) = vector.split_at_mut(row);
        vector[0] -= product(&factors[row * size..row * size + row], known);
    }
    for row in (0..size).rev() {
        let (vector, known) = vector[row..].split_at_mut(1);
        let factors = &factors[row * size + row..(row + 1) * size];
        vector[0] = (vector[0] - product(&factors[1..], known)) / factors[0];
    }
}

/// The scalar product of vectors of one length, by four sums, of which a processor adds several at once.
fn product(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    let mut sums = [0.0; 4];
    for (a, b) in a.iter().zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// Whether a pivot of this magnitude has a reciprocal, so that a matrix is regular to working precision.
#[inline]
pub(super) fn is_regular(pivot: f64) -> bool {
    pivot > f64::MIN_POSITIVE && pivot.is_finite()
}

/// Inverts a matrix of a few rows in place, by Gauss-Jordan elimination with partial pivoting. Returns whether it is
/// regular to working precision.
pub(super) fn invert<const N: usize>(matrix: &mut [[f64; N]; N]) -> bool {
    // Columns of the inverse are stored instead of the unit matrix's.
    let mut pivots = [0; N];
    for column in 0..N {
        let pivot = (column + 1..N).fold(column, |pivot, row| {
            if matrix[row][column].abs() > matrix[pivot][column].abs() { row } else { pivot }
        });
        if !is_regular(matrix[pivot][column].abs()) {
            return false;
        }
        pivots[column] = pivot;
        if pivot != column {
            matrix.swap(column, pivot);
        }
        let reciprocal = matrix[column][column].recip();
        matrix[column][column] = 1.0;
        let row = matrix[column].map(|element| element * reciprocal);
        for other in matrix.iter_mut() {
            let factor = mem::replace(&mut other[column], 0.0);
            for (element, above) in other.iter_mut().zip(&row) {
                *element -= factor * above;
            }
        }
        matrix[column] = row;
    }
    // Exchanged rows of a matrix are exchanged columns of its inverse.
    for column in (0..N).rev().filter(|&column| pivots[column] != column) {
        for row in matrix.iter_mut() {
            row.swap(column, pivots[column]);
        }
    }
    matrix.iter().flatten().all(|element| element.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_times_its_inverse_is_one() {
        let matrix = [[0.0, 2.0, 1.0], [1.0, -1.0, 0.0], [3.0, 0.0, -2.0]];
        let mut inverse = matrix;
        assert!(invert(&mut inverse));
        for (row, factors) in matrix.iter().enumerate() {
            for column in 0..3 {
                let product: f64 = factors.iter().zip(&inverse).map(|(a, row)| a * row[column]).sum();
                // A handful of operations on numbers of order 1.
                assert!((product - f64::from(u8::from(row == column))).abs() < 1e-14);
            }
        }
        assert!(!invert(&mut [[1.0, 2.0], [2.0, 4.0]]));
    }

    #[test]
    fn a_system_that_needs_pivoting_is_solved() {
        // 2·1 − A = [[0, 2, 1], [1, −1, 0], [3, 0, −2]].
        let matrix = [2.0, -2.0, -1.0, -1.0, 3.0, 0.0, -3.0, 0.0, 4.0];
        let (mut factors, mut pivots) = ([0.0; 9], [0; 3]);
        assert!(factor(2.0, &matrix, &mut factors, &mut pivots));
        // The right-hand side for x = (1, 2, 3).
        let mut x = [7.0, -1.0, -3.0];
        solve(&factors, &pivots, &mut x);
        for (x, expected) in x.iter().zip([1.0, 2.0, 3.0]) {
            // A handful of operations on numbers of order 1.
            assert!((x - expected).abs() < 1e-14, "{x} instead of {expected}");
        }
    }

    #[test]
    fn no_equations_have_a_solution() {
        assert!(factor(1.0, &[], &mut [], &mut []));
        solve(&[], &[], &mut []);
    }

    #[test]
    fn singular_matrices_are_refused() {
        for matrix in [[1.0, 2.0, 2.0, 4.0], [f64::NAN, 0.0, 0.0, 1.0], [f64::INFINITY, 0.0, 0.0, 1.0]] {
            assert!(!factor(0.0, &matrix, &mut [0.0; 4], &mut [0; 2]), "{matrix:?}");
        }
    }
}
