//! Dense linear systems of a few unknowns.

/// Solves `matrix · x = right_side` by Gaussian elimination with partial pivoting.
///
/// `None` when the matrix is singular to working precision or not finite.
#[must_use]
pub fn solve<const N: usize>(mut matrix: [[f64; N]; N], mut right_side: [f64; N]) -> Option<[f64; N]> {
    for column in 0..N {
        let pivot = pivot(&matrix, column)?;
        matrix.swap(column, pivot);
        right_side.swap(column, pivot);
        let (pivoted, below) = matrix.split_at_mut(column + 1);
        let pivot_row = &pivoted[column];
        for (offset, row) in below.iter_mut().enumerate() {
            let factor = row[column] / pivot_row[column];
            for (element, above) in row.iter_mut().zip(pivot_row).skip(column) {
                *element -= factor * above;
            }
            right_side[column + 1 + offset] -= factor * right_side[column];
        }
    }
    for row in (0..N).rev() {
        let known: f64 = (row + 1..N).map(|k| matrix[row][k] * right_side[k]).sum();
        right_side[row] = (right_side[row] - known) / matrix[row][row];
    }
    right_side.iter().all(|x| x.is_finite()).then_some(right_side)
}

/// The row from the diagonal on with the largest element of a column; `None` if it is zero or not finite.
#[inline]
fn pivot<const N: usize>(matrix: &[[f64; N]; N], column: usize) -> Option<usize> {
    let mut pivot = column;
    for row in column + 1..N {
        if matrix[row][column].abs() > matrix[pivot][column].abs() {
            pivot = row;
        }
    }
    let largest = matrix[pivot][column].abs();
    (largest > f64::MIN_POSITIVE && largest.is_finite()).then_some(pivot)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_that_needs_pivoting_is_solved() {
        let matrix = [[0.0, 2.0, 1.0], [1.0, -1.0, 0.0], [3.0, 0.0, -2.0]];
        // The right side of x = (1, 2, 3).
        let x = solve(matrix, [7.0, -1.0, -3.0]).unwrap();
        for (x, expected) in x.iter().zip([1.0, 2.0, 3.0]) {
            // A handful of operations on numbers of order 1.
            assert!((x - expected).abs() < 1e-14, "{x} instead of {expected}");
        }
    }

    #[test]
    fn a_singular_system_is_refused() {
        assert_eq!(solve([[1.0, 2.0], [2.0, 4.0]], [1.0, 1.0]), None);
        assert_eq!(solve([[f64::NAN]], [1.0]), None);
    }
}
