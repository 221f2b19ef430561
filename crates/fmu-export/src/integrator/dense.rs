//! Dense linear systems by LU factorization with partial pivoting, in place.

use core::mem;

/// Factors a square matrix, by rows; `pivots` gets the exchanged rows. Returns whether it is regular to working
/// precision.
pub(crate) fn factor(matrix: &mut [f64], pivots: &mut [usize]) -> bool {
    let size = pivots.len();
    for column in 0..size {
        let magnitude = |row: usize| matrix[row * size + column].abs();
        let pivot = (column + 1..size)
            .fold(column, |pivot, row| if magnitude(row) > magnitude(pivot) { row } else { pivot });
        if !(magnitude(pivot) > f64::MIN_POSITIVE && magnitude(pivot).is_finite()) {
            return false;
        }
        pivots[column] = pivot;
        if pivot != column {
            for other in 0..size {
                matrix.swap(column * size + other, pivot * size + other);
            }
        }
        let (above, below) = matrix.split_at_mut((column + 1) * size);
        let pivot_row = &above[column * size..];
        for row in below.chunks_exact_mut(size) {
            let factor = row[column] / pivot_row[column];
            row[column] = factor;
            for (element, above) in row.iter_mut().zip(pivot_row).skip(column + 1) {
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
    let known = |row: &[f64], vector: &[f64]| row.iter().zip(vector).map(|(a, x)| a * x).sum::<f64>();
    for row in 1..size {
        vector[row] -= known(&factors[row * size..row * size + row], vector);
    }
    for row in (0..size).rev() {
        let (factors, after) = (&factors[row * size..(row + 1) * size], row + 1);
        vector[row] = (vector[row] - known(&factors[after..], &vector[after..])) / factors[row];
    }
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
        let largest = matrix[pivot][column].abs();
        if !(largest > f64::MIN_POSITIVE && largest.is_finite()) {
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
        let mut matrix = [0.0, 2.0, 1.0, 1.0, -1.0, 0.0, 3.0, 0.0, -2.0];
        let mut pivots = [0; 3];
        assert!(factor(&mut matrix, &mut pivots));
        // The right-hand side for x = (1, 2, 3).
        let mut x = [7.0, -1.0, -3.0];
        solve(&matrix, &pivots, &mut x);
        for (x, expected) in x.iter().zip([1.0, 2.0, 3.0]) {
            // A handful of operations on numbers of order 1.
            assert!((x - expected).abs() < 1e-14, "{x} instead of {expected}");
        }
    }

    #[test]
    fn singular_matrices_are_refused() {
        for mut matrix in [[1.0, 2.0, 2.0, 4.0], [f64::NAN, 0.0, 0.0, 1.0], [f64::INFINITY, 0.0, 0.0, 1.0]] {
            assert!(!factor(&mut matrix, &mut [0; 2]), "{matrix:?}");
        }
    }
}
