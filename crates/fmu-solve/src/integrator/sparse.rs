//! Sparse linear systems by LU factorization of rows in an order that fills in few elements.
//!
//! Pivots are on the diagonal, so that their elements stand in places known beforehand, unless one is small beside its
//! row; then columns are exchanged for this matrix. So the factors follow from the matrix alone, whatever was factored
//! before.

use super::dense::is_regular;
use super::pattern::{Pattern, number};

/// A pivot on the diagonal is large enough from this share of the largest element of its row on, as in KLU (`tol` of
/// `klu_defaults`; Davis and Palamadai Natarajan, Algorithm 907, ACM Transactions on Mathematical Software 37, 2010).
const LEAST_PIVOT: f64 = 1e-3;

/// Rows of elements.
#[derive(Debug, Default)]
struct Rows {
    /// Where each row ends.
    ends: Vec<u32>,
    columns: Vec<u32>,
    values: Vec<f64>,
}

impl Rows {
    fn clear(&mut self) {
        self.ends.clear();
        self.columns.clear();
        self.values.clear();
    }

    fn push(&mut self, column: u32, value: f64) {
        self.columns.push(column);
        self.values.push(value);
    }

    fn end_row(&mut self) {
        self.ends.push(number(self.columns.len()));
    }

    #[inline]
    fn range(&self, row: usize) -> core::ops::Range<usize> {
        let begin = if row == 0 { 0 } else { self.ends[row - 1] };
        begin as usize..self.ends[row] as usize
    }

    /// The columns and values of a row.
    #[inline]
    fn row(&self, row: usize) -> impl Iterator<Item = (usize, f64)> {
        let range = self.range(row);
        let values = self.values[range.clone()].iter();
        self.columns[range].iter().zip(values).map(|(&column, &value)| (column as usize, value))
    }
}

/// The factors of a sparse matrix.
#[derive(Debug)]
pub(super) struct Factors {
    /// The row eliminated in each step, and the column of its pivot.
    order: Vec<u32>,
    pivots: Vec<u32>,
    /// The step whose pivot is in each column.
    steps: Vec<u32>,
    /// The factors of the rows eliminated before, and the rest of each row over its pivot, so that a solution does not
    /// wait for that product; their columns are steps.
    lower: Rows,
    upper: Rows,
    reciprocals: Vec<f64>,
    /// Whether the elements stand where they do with all pivots on the diagonal.
    is_diagonal: bool,
    row: Vec<f64>,
    /// For the search of a row's elements: in which step a column was last found, and those found.
    found: Vec<u32>,
    eliminated: Vec<u32>,
    left: Vec<u32>,
}

impl Factors {
    /// Factors in an order of elimination, not yet computed.
    pub(super) fn new(order: Vec<u32>) -> Self {
        let size = order.len();
        Self {
            order,
            pivots: vec![0; size],
            steps: vec![0; size],
            lower: Rows::default(),
            upper: Rows::default(),
            reciprocals: vec![0.0; size],
            is_diagonal: false,
            row: vec![0.0; size],
            found: vec![0; size],
            eliminated: vec![],
            left: vec![],
        }
    }

    /// Factors a multiple of the unit matrix minus a matrix. Returns whether it is regular to working precision.
    pub(super) fn factor(&mut self, diagonal: f64, pattern: &Pattern, elements: &[f64]) -> bool {
        if !self.is_diagonal {
            self.find_elements(pattern);
        }
        self.factor_on_diagonal(diagonal, pattern, elements)
            || self.eliminate(pattern, Some((diagonal, elements)))
    }

    fn find_elements(&mut self, pattern: &Pattern) {
        self.eliminate(pattern, None);
    }

    fn factor_on_diagonal(&mut self, diagonal: f64, pattern: &Pattern, elements: &[f64]) -> bool {
        let Self { order, steps, lower, upper, reciprocals, row, .. } = self;
        for (step, &eliminated) in order.iter().enumerate() {
            let (below, above) = (lower.range(step), upper.range(step));
            for &column in lower.columns[below.clone()].iter().chain(&upper.columns[above.clone()]) {
                row[column as usize] = 0.0;
            }
            row[step] = 0.0;
            let range = pattern.range(eliminated as usize);
            for (&column, element) in pattern.row(eliminated as usize).iter().zip(&elements[range]) {
                row[steps[column as usize] as usize] = -element;
            }
            row[step] += diagonal;
            for element in below {
                let earlier = lower.columns[element] as usize;
                let value = row[earlier];
                lower.values[element] = value * reciprocals[earlier];
                for (column, above) in upper.row(earlier) {
                    row[column] -= value * above;
                }
            }
            let mut largest = row[step].abs();
            for &column in &upper.columns[above.clone()] {
                let value = row[column as usize];
                // By their order what is not a number is largest.
                if value.abs().total_cmp(&largest).is_gt() {
                    largest = value.abs();
                }
            }
            if !is_pivot(row[step], largest) {
                return false;
            }
            reciprocals[step] = row[step].recip();
            for element in above {
                upper.values[element] = row[upper.columns[element] as usize] * reciprocals[step];
            }
        }
        true
    }

    /// Eliminates row by row, with the values given, or without where all pivots are on the diagonal.
    fn eliminate(&mut self, pattern: &Pattern, values: Option<(f64, &[f64])>) -> bool {
        const NONE: u32 = u32::MAX;
        self.is_diagonal = values.is_none();
        let Self { order, pivots, steps, lower, upper, reciprocals, row, found, eliminated, left, .. } = self;
        lower.clear();
        upper.clear();
        steps.fill(NONE);
        found.fill(NONE);
        for (step, &of) in order.iter().enumerate() {
            eliminated.clear();
            left.clear();
            let mut find = |columns: &[u32], eliminated: &mut Vec<u32>| {
                for &column in columns {
                    if found[column as usize] != number(step) {
                        found[column as usize] = number(step);
                        row[column as usize] = 0.0;
                        match steps[column as usize] {
                            NONE => left.push(column),
                            earlier => eliminated.push(earlier),
                        }
                    }
                }
            };
            find(pattern.row(of as usize), eliminated);
            let mut next = 0;
            while let Some(&earlier) = eliminated.get(next) {
                find(&upper.columns[upper.range(earlier as usize)], eliminated);
                next += 1;
            }
            eliminated.sort_unstable();
            if let Some((diagonal, elements)) = values {
                let range = pattern.range(of as usize);
                for (&column, element) in pattern.row(of as usize).iter().zip(&elements[range]) {
                    row[column as usize] = -element;
                }
                row[of as usize] += diagonal;
            }
            for &earlier in &*eliminated {
                let value = row[pivots[earlier as usize] as usize];
                lower.push(earlier, value * reciprocals[earlier as usize]);
                if values.is_some() {
                    for (column, above) in upper.row(earlier as usize) {
                        row[column] -= value * above;
                    }
                }
            }
            lower.end_row();
            let mut pivot = of;
            if values.is_some() {
                let magnitude = |column: u32| row[column as usize].abs();
                let by_magnitude = |a: &u32, b: &u32| magnitude(*a).total_cmp(&magnitude(*b));
                let Some(largest) = left.iter().copied().max_by(by_magnitude) else { return false };
                if steps[of as usize] != NONE || !is_pivot(row[of as usize], magnitude(largest)) {
                    pivot = largest;
                }
                if !is_pivot(row[pivot as usize], magnitude(largest)) {
                    return false;
                }
            }
            pivots[step] = pivot;
            steps[pivot as usize] = number(step);
            reciprocals[step] = row[pivot as usize].recip();
            for &column in left.iter().filter(|&&column| column != pivot) {
                upper.push(column, row[column as usize] * reciprocals[step]);
            }
            upper.end_row();
        }
        for column in &mut upper.columns {
            *column = steps[*column as usize];
        }
        true
    }

    /// Solves a linear system in place of its right-hand side.
    pub(super) fn solve(&mut self, vector: &mut [f64]) {
        let Self { order, pivots, lower, upper, reciprocals, row, .. } = self;
        for (step, &of) in order.iter().enumerate() {
            let mut value = vector[of as usize];
            for (earlier, factor) in lower.row(step) {
                value -= factor * row[earlier];
            }
            row[step] = value;
        }
        for step in (0..order.len()).rev() {
            let mut value = row[step] * reciprocals[step];
            for (later, element) in upper.row(step) {
                value -= element * row[later];
            }
            row[step] = value;
            vector[pivots[step] as usize] = row[step];
        }
    }
}

/// Whether an element is a regular pivot of a row with this largest magnitude.
fn is_pivot(element: f64, largest: f64) -> bool {
    element.abs() >= LEAST_PIVOT * largest && is_regular(element.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The residual of a solution of (d·1 − A)·x = b, relative to the largest terms.
    fn residual(factors: &mut Factors, pattern: &Pattern, diagonal: f64, elements: &[f64]) -> Option<f64> {
        let size = pattern.size();
        let right: Vec<_> = (0..size).map(|row| (row as f64).sin()).collect();
        let mut x = right.clone();
        if !factors.factor(diagonal, pattern, elements) {
            return None;
        }
        factors.solve(&mut x);
        let mut worst = 0.0_f64;
        for row in 0..size {
            let (mut sum, mut terms) = (diagonal * x[row] - right[row], right[row].abs());
            for (element, &column) in pattern.range(row).zip(pattern.row(row)) {
                sum -= elements[element] * x[column as usize];
                terms += (elements[element] * x[column as usize]).abs();
            }
            worst = worst.max(sum.abs() / (terms + (diagonal * x[row]).abs()));
        }
        Some(worst)
    }

    /// A network in which each of 60 states depends on three others, chosen by a congruential generator.
    fn network() -> (Pattern, Vec<f64>) {
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as u32
        };
        let pattern =
            Pattern::of_rows(60, |_, columns| columns.extend((0..3).map(|_| random() as usize % 60)));
        let elements =
            (0..60).flat_map(|row| pattern.row(row).iter().map(move |&column| (row, column as usize)));
        let mut element = |(row, column)| {
            let value = f64::from(random() % 2001) / 1000.0 - 1.0;
            // Every fifth state does not depend on itself.
            if row == column && row % 5 == 0 { 0.0 } else { value }
        };
        let elements = elements.map(&mut element).collect();
        (pattern, elements)
    }

    #[test]
    fn a_sparse_system_is_solved_with_and_without_exchanges() {
        let (pattern, elements) = network();
        let mut factors = Factors::new(pattern.elimination().order);
        // Rounding of some hundred operations a row, times the growth that pivots of a thousandth allow.
        let bound = 1e-11;
        assert!(residual(&mut factors, &pattern, 100.0, &elements).unwrap() < bound);
        assert!(factors.is_diagonal);
        // Without a dominant diagonal some columns are exchanged.
        assert!(residual(&mut factors, &pattern, 1e-7, &elements).unwrap() < bound);
        assert!(!factors.is_diagonal);
        assert!(residual(&mut factors, &pattern, 100.0, &elements).unwrap() < bound);
        assert!(factors.is_diagonal);
    }

    #[test]
    fn the_factors_follow_from_the_matrix_alone() {
        let (pattern, elements) = network();
        let solved = |diagonals: &[f64]| {
            let mut factors = Factors::new(pattern.elimination().order);
            for diagonal in diagonals {
                assert!(factors.factor(*diagonal, &pattern, &elements));
            }
            let mut x = vec![1.0; 60];
            factors.solve(&mut x);
            x.into_iter().map(f64::to_bits).collect::<Vec<_>>()
        };
        assert_eq!(solved(&[3.0]), solved(&[100.0, 1e-7, 3.0]));
        assert_eq!(solved(&[1e-7]), solved(&[100.0, 1e-7]));
    }

    #[test]
    fn a_zero_on_the_diagonal_is_passed_over() {
        // x₀ and x₁ exchanged, and x₂.
        let pattern = Pattern::of_rows(3, |row, columns| columns.extend([[1], [0], [2]][row]));
        // By rows: (0, −4), (−5, 0), (−2).
        let elements = [0.0, -4.0, -5.0, 0.0, -2.0];
        let mut factors = Factors::new(pattern.elimination().order);
        let mut x = [8.0, 15.0, 6.0];
        assert!(factors.factor(0.0, &pattern, &elements));
        factors.solve(&mut x);
        assert_eq!(x.map(f64::to_bits), [3.0, 2.0, 3.0].map(f64::to_bits));
    }

    #[test]
    fn singular_matrices_are_refused() {
        // The first two depend on each other.
        let pattern = Pattern::of_rows(3, |row, columns| columns.extend([[1], [0], [2]][row]));
        let mut factors = Factors::new(pattern.elimination().order);
        for elements in [[1.0, 2.0, 2.0, 4.0, 1.0], [f64::NAN, 1.0, 1.0, 1.0, 1.0]] {
            assert!(!factors.factor(0.0, &pattern, &elements), "{elements:?}");
        }
    }
}
