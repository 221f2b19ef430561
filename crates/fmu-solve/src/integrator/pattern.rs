//! Where a Jacobian has elements, the groups of columns that one evaluation gives together, and an order of elimination
//! that fills in few more elements.

use core::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::error::Error;

/// The elements of a square matrix that may differ from zero, by rows, always with the diagonal.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pattern {
    /// Where each row begins in `columns`, and the end; empty if every element may differ from zero.
    starts: Vec<u32>,
    /// The columns of the elements, ascending within each row.
    columns: Vec<u32>,
    /// The operations by which the derivatives are evaluated, as far as known.
    operations: u32,
    /// The operations that the gradients of all rows go back through, some many times.
    traversed: u32,
}

crate::persistent!(<> Pattern { starts, columns, operations, traversed });

/// An order of elimination.
pub(super) struct Elimination {
    pub(super) order: Vec<u32>,
    /// How many unknowns of each equation remain once its own is eliminated.
    left: Vec<usize>,
}

impl Elimination {
    /// About the multiplications of a factorization and of solutions with it.
    pub(super) fn multiplications(&self, solutions: usize) -> usize {
        self.left.iter().map(|&left| left * left + solutions * 2 * left).sum()
    }
}

impl Pattern {
    /// The pattern of a matrix without zeros.
    #[must_use]
    pub fn full() -> Self {
        Self::default()
    }

    /// The pattern with these columns in each row, or the full one if there are too many for it to be of use.
    #[must_use]
    pub fn of_rows(size: usize, mut row: impl FnMut(usize, &mut Vec<usize>)) -> Self {
        let mut pattern = Self { starts: vec![0], ..Self::default() };
        let (mut found, mut is_full) = (vec![], false);
        for index in 0..size {
            found.clear();
            found.push(index);
            row(index, &mut found);
            if is_full {
                continue;
            }
            found.sort_unstable();
            found.dedup();
            pattern.columns.extend(found.iter().copied().map(number));
            pattern.starts.push(number(pattern.columns.len()));
            if pattern.columns.len() > size.saturating_mul(chosen!(FEW).clamp(size / 4, size.div_ceil(2))) {
                (pattern, is_full) = (Self::full(), true);
            }
        }
        pattern
    }

    /// The pattern of derivatives that take so many operations, of which the gradients of all rows go back through so
    /// many.
    #[must_use]
    pub(crate) fn with_operations(self, operations: usize, traversed: usize) -> Self {
        let most = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
        Self { operations: most(operations), traversed: most(traversed), ..self }
    }

    /// The operations by which the derivatives are evaluated: at least one for each element.
    pub(super) fn operations(&self) -> usize {
        self.columns.len().max(self.operations as usize)
    }

    /// The pattern of a sum.
    pub(super) fn with(&self, other: &Self) -> Self {
        let sum = if self.is_full() || other.is_full() {
            Self::full()
        } else {
            Self::of_rows(self.size(), |row, columns| {
                columns.extend(self.row(row).iter().chain(other.row(row)).map(|&column| column as usize));
            })
        };
        let [operations, traversed] =
            [(self.operations, other.operations), (self.traversed, other.traversed)].map(|(a, b)| a.max(b));
        Self { operations, traversed, ..sum }
    }

    /// Whether every element may differ from zero.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.starts.is_empty()
    }

    pub(super) fn size(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// The number of elements of a matrix of this size.
    pub(super) fn count(&self, size: usize) -> usize {
        if self.is_full() { size.saturating_mul(size) } else { self.columns.len() }
    }

    /// The range of a row's elements.
    #[inline]
    pub(super) fn range(&self, row: usize) -> core::ops::Range<usize> {
        self.starts[row] as usize..self.starts[row + 1] as usize
    }

    /// The columns of a row's elements, ascending; of a pattern that is not full.
    #[inline]
    #[must_use]
    pub fn row(&self, row: usize) -> &[u32] {
        &self.columns[self.range(row)]
    }

    /// The columns of each row of the transposed matrix.
    fn transposed(&self) -> Vec<Vec<u32>> {
        let mut transposed = vec![vec![]; self.size()];
        for row in 0..self.size() {
            for &column in self.row(row) {
                transposed[column as usize].push(number(row));
            }
        }
        transposed
    }

    /// Whether a serialized pattern is one of a matrix of this size.
    pub(super) fn check(&self, size: usize) -> Result<(), Error> {
        let is_ascending = |row: usize| {
            let columns = self.row(row);
            columns.windows(2).all(|pair| pair[0] < pair[1])
                && columns.last().is_some_and(|last| (*last as usize) < size)
                && columns.binary_search(&number(row)).is_ok()
        };
        let is_pattern = self.is_full() && self.columns.is_empty()
            || self.starts.len() == size + 1
                && self.starts[0] == 0
                && self.starts.windows(2).all(|pair| pair[0] <= pair[1])
                && self.starts[size] as usize == self.columns.len()
                && (0..size).all(is_ascending);
        if is_pattern {
            Ok(())
        } else {
            Err(Error::new("the Jacobian in the serialized state is not one of this model"))
        }
    }

    /// The rows whose elements are computed one by one, as their columns would need as many groups.
    pub(super) fn long_rows(&self) -> Vec<usize> {
        let mut rows: Vec<_> = (0..self.size()).collect();
        rows.sort_by_key(|&row| Reverse(self.row(row).len()));
        let work = |&long: &usize| gradients(long) + self.row(rows[long]).len();
        let count = (0..self.size()).min_by_key(work).unwrap_or(0);
        rows.truncate(count);
        rows.sort_unstable();
        rows
    }

    /// Whether the gradients of all rows take less than an evaluation for each column of a full matrix.
    pub(super) fn is_by_rows(&self, size: usize) -> bool {
        let [operations, traversed] = [self.operations, self.traversed].map(u64::from);
        chosen!(RECORDING) as u64 * operations + chosen!(GRADIENT) as u64 * traversed
            < size as u64 * operations
    }

    /// The group of each column, and the number of groups: those of a group share no row but these, so that a product
    /// with the sum of their unit vectors gives the elements of all (Curtis, Powell and Reid, On the estimation of sparse
    /// Jacobian matrices, IMA Journal of Applied Mathematics 13, 1974).
    pub(super) fn groups(&self, left_out: &[usize]) -> (Vec<u32>, usize) {
        let mut rows_of = self.transposed();
        for rows in &mut rows_of {
            rows.retain(|&row| left_out.binary_search(&(row as usize)).is_err());
        }
        let mut groups = vec![u32::MAX; self.size()];
        let (mut taken_by, mut count) = (vec![usize::MAX; self.size() + 1], 0);
        for (column, rows) in rows_of.iter().enumerate() {
            for &row in rows {
                for &other in self.row(row as usize) {
                    if let Some(taken) = taken_by.get_mut(groups[other as usize] as usize) {
                        *taken = column;
                    }
                }
            }
            let group = taken_by.iter().position(|&taken| taken != column).unwrap_or(count);
            groups[column] = number(group);
            count = count.max(group + 1);
        }
        (groups, count)
    }

    /// The order in which to eliminate the unknowns: first those with the fewest neighbors in what is left, by the bound
    /// of Amestoy, Davis and Duff (An approximate minimum degree ordering algorithm, SIAM Journal on Matrix Analysis and
    /// Applications 17, 1996).
    pub(super) fn elimination(&self) -> Elimination {
        let size = self.size();
        // The neighbors of an unknown: those of the matrix, and those that eliminated unknowns have in common.
        let mut neighbors = self.transposed();
        for (row, neighbors) in neighbors.iter_mut().enumerate() {
            neighbors.extend_from_slice(self.row(row));
            neighbors.sort_unstable();
            neighbors.dedup();
            neighbors.retain(|&neighbor| neighbor as usize != row);
        }
        let mut cliques_of: Vec<Vec<u32>> = vec![vec![]; size];
        // By the unknown whose elimination makes it; empty otherwise.
        let mut cliques: Vec<Vec<u32>> = vec![vec![]; size];
        let mut degrees: Vec<_> = neighbors.iter().map(Vec::len).collect();
        // The first come first among equals, so that several chains of eliminations take turns.
        let mut queue: BinaryHeap<_> = degrees
            .iter()
            .enumerate()
            .map(|(unknown, &degree)| Reverse((degree, unknown, unknown)))
            .collect();
        let mut arrivals = size;
        // When an unknown was last found to be in the present clique; `size` once eliminated.
        let mut found = vec![usize::MAX; size];
        // The members of a clique that are not in the present one, and when they were last counted.
        let mut others = vec![(usize::MAX, 0); size];
        let (mut order, mut left) = (vec![], vec![]);
        while let Some(Reverse((degree, _, pivot))) = queue.pop() {
            if found[pivot] == size || degree != degrees[pivot] {
                continue;
            }
            let now = order.len();
            order.push(number(pivot));
            found[pivot] = size;
            let mut clique = vec![];
            let mut join = |members: &[u32]| {
                for &member in members {
                    let found = &mut found[member as usize];
                    if *found != now && *found != size {
                        *found = now;
                        clique.push(member);
                    }
                }
            };
            join(&core::mem::take(&mut neighbors[pivot]));
            for absorbed in core::mem::take(&mut cliques_of[pivot]) {
                join(&core::mem::take(&mut cliques[absorbed as usize]));
            }
            for &member in &clique {
                for &of in &cliques_of[member as usize] {
                    let others = &mut others[of as usize];
                    if others.0 != now {
                        *others = (now, cliques[of as usize].len());
                    }
                    // An absorbed one is empty.
                    others.1 = others.1.saturating_sub(1);
                }
            }
            for &member in &clique {
                let member = member as usize;
                cliques_of[member].retain(|&of| others[of as usize].1 > 0);
                neighbors[member]
                    .retain(|&neighbor| found[neighbor as usize] != now && found[neighbor as usize] != size);
                let apart: usize = cliques_of[member].iter().map(|&of| others[of as usize].1).sum();
                let bound = neighbors[member].len() + clique.len() - 1 + apart;
                degrees[member] = bound.min(size - now - 2);
                cliques_of[member].push(number(pivot));
                queue.push(Reverse((degrees[member], arrivals, member)));
                arrivals += 1;
            }
            left.push(clique.len());
            cliques[pivot] = clique;
        }
        Elimination { order, left }
    }
}

/// The time of recording an evaluation, and of going back through all of the record, in evaluations with a direction.
/// [Chosen](crate::chosen).
const RECORDING: usize = 8;
const GRADIENT: usize = 4;

/// The time that the gradients of so many rows take.
pub(super) fn gradients(rows: usize) -> usize {
    if rows > 0 { chosen!(RECORDING) + rows * chosen!(GRADIENT) } else { 0 }
}

/// Rows with so few elements are sparse unless more than half full; otherwise a quarter is too many. Sparse random
/// networks then take less time than dense ones. [Chosen](crate::chosen).
const FEW: usize = 16;

/// A position among fewer than 2³² states or elements.
#[allow(clippy::cast_possible_truncation, reason = "so many do not fit into memory")]
pub(super) fn number(position: usize) -> u32 {
    position as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rod: each state with its neighbors.
    fn rod(size: usize) -> Pattern {
        Pattern::of_rows(size, |row, columns| {
            columns.extend(row.saturating_sub(1)..(row + 2).min(size));
        })
    }

    #[test]
    fn columns_of_a_group_share_no_row() {
        let (groups, count) = rod(20).groups(&[]);
        assert_eq!(count, 3);
        let expected: Vec<_> = (0..20).map(|column| column % 3).collect();
        assert_eq!(groups, expected);
        // A square of cells: each with four neighbors, whose columns differ from its own and from each other.
        let cells = square(12);
        let (groups, count) = cells.groups(&[]);
        assert!((5..=9).contains(&count), "{count} groups");
        for row in 0..cells.size() {
            let mut found: Vec<_> = cells.row(row).iter().map(|&column| groups[column as usize]).collect();
            found.sort_unstable();
            let all = found.len();
            found.dedup();
            assert_eq!(found.len(), all, "row {row}");
        }
    }

    fn square(side: usize) -> Pattern {
        Pattern::of_rows(side * side, |cell, columns| {
            let (x, y) = (cell % side, cell / side);
            let mut beside = |is_there: bool, other: usize| {
                if is_there {
                    columns.push(other);
                }
            };
            beside(x > 0, cell.wrapping_sub(1));
            beside(x + 1 < side, cell + 1);
            beside(y > 0, cell.wrapping_sub(side));
            beside(y + 1 < side, cell + side);
        })
    }

    /// The elements of both factors, by elimination of a dense pattern.
    fn filled(pattern: &Pattern, order: &[u32]) -> usize {
        let size = pattern.size();
        let mut has = vec![vec![false; size]; size];
        for (row, column) in
            (0..size).flat_map(|row| pattern.row(row).iter().map(move |&column| (row, column)))
        {
            has[row][column as usize] = true;
            has[column as usize][row] = true;
        }
        let mut left: Vec<_> = (0..size).collect();
        let mut count = size;
        for &pivot in order {
            left.retain(|&other| other != pivot as usize);
            let clique: Vec<_> = left.iter().copied().filter(|&other| has[pivot as usize][other]).collect();
            count += 2 * clique.len();
            for &row in &clique {
                for &column in &clique {
                    has[row][column] = true;
                }
            }
        }
        assert!(left.is_empty());
        count
    }

    #[test]
    fn a_row_of_all_columns_is_left_out_of_the_groups() {
        let mean = Pattern::of_rows(40, |row, columns| {
            columns.extend(if row == 7 { 0..40 } else { row.saturating_sub(1)..(row + 2).min(40) });
        });
        assert_eq!(mean.long_rows(), [7]);
        assert_eq!(mean.groups(&[7]).1, 3);
        assert_eq!(mean.groups(&[]).1, 40);
        assert_eq!(rod(40).long_rows(), [0; 0]);
    }

    #[test]
    fn the_order_fills_in_little() {
        // A rod fills in nothing, whatever its cells are called.
        let shuffled = |cell: usize| (cell * 7) % 30;
        let rod = Pattern::of_rows(30, |row, columns| {
            for cell in (0..29).filter(|&cell| shuffled(cell) == row || shuffled(cell + 1) == row) {
                columns.extend([shuffled(cell), shuffled(cell + 1)]);
            }
        });
        assert_eq!(filled(&rod, &rod.elimination().order), 30 + 2 * 29);
        // A star: its center comes last.
        let star = Pattern::of_rows(30, |row, columns| {
            columns.extend(if row == 0 { 0..30 } else { 0..1 });
        });
        assert_eq!(filled(&star, &star.elimination().order), 30 + 2 * 29);
        // By rows, a square of 12 × 12 cells fills a band of 12 on each side: some 144 · 25 elements.
        let cells = square(12);
        let rows: Vec<_> = (0..144).collect();
        let (by_rows, by_degree) = (filled(&cells, &rows), filled(&cells, &cells.elimination().order));
        assert!(by_degree < by_rows * 2 / 3, "{by_degree} elements instead of {by_rows}");
    }

    #[test]
    fn damaged_patterns_are_refused() {
        let whole = rod(5);
        assert!(whole.check(5).is_ok() && Pattern::full().check(5).is_ok());
        assert!(whole.check(4).is_err());
        for damage in [
            |pattern: &mut Pattern| pattern.columns[3] = 7,
            |pattern: &mut Pattern| pattern.columns.swap(2, 3),
            |pattern: &mut Pattern| pattern.starts[1] = 900,
            |pattern: &mut Pattern| pattern.starts[5] = 3,
            |pattern: &mut Pattern| pattern.starts.clear(),
            // Without the diagonal.
            |pattern: &mut Pattern| pattern.columns[0] = 4,
        ] {
            let mut pattern = whole.clone();
            damage(&mut pattern);
            assert!(pattern.check(5).is_err(), "{pattern:?}");
        }
    }
}
