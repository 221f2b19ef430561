//! Exact Jacobians for the solvers that are compared, by dual numbers.

use fmu_export::{Described as _, Dual};
use fmu_export_problems::Problem;

/// Where a Jacobian has elements, by columns: where each column begins, and the row of each element.
#[derive(Debug)]
pub struct Elements {
    pub begins: Vec<usize>,
    pub rows: Vec<usize>,
    /// The columns that share an evaluation, as none of their elements share a row.
    groups: Vec<Vec<usize>>,
    /// The number of diagonals below and above the main one.
    pub lower: usize,
    pub upper: usize,
}

impl Elements {
    /// The elements of a problem's Jacobian, with the diagonal: the rates that a state which is not a number spoils.
    pub fn of<P: Problem>() -> Self {
        let size = P::Variables::STATE_NOMINALS.len();
        let (mut states, mut rates) = (vec![0.0; size], vec![0.0; size]);
        P::start(&mut states);
        let mut found = Self { begins: vec![0], rows: vec![], groups: vec![], lower: 0, upper: 0 };
        // The columns of each group with an element in each row.
        let mut taken: Vec<Vec<bool>> = vec![];
        for column in 0..size {
            let state = std::mem::replace(&mut states[column], f64::NAN);
            P::default().rates(&states, &mut rates);
            states[column] = state;
            let rows: Vec<_> = (0..size).filter(|&row| row == column || rates[row].is_nan()).collect();
            let group = taken.iter().position(|taken| rows.iter().all(|&row| !taken[row]));
            let group = group.unwrap_or_else(|| {
                taken.push(vec![false; size]);
                found.groups.push(vec![]);
                taken.len() - 1
            });
            found.groups[group].push(column);
            for row in rows {
                taken[group][row] = true;
                found.lower = found.lower.max(row.saturating_sub(column));
                found.upper = found.upper.max(column.saturating_sub(row));
                found.rows.push(row);
            }
            found.begins.push(found.rows.len());
        }
        found
    }

    /// The share of the matrix that is filled.
    pub fn share(&self) -> f64 {
        let size = (self.begins.len() - 1) as f64;
        self.rows.len() as f64 / (size * size)
    }

    /// The diagonals above the main one for which a banded matrix of SUNDIALS has memory, which its factors fill.
    pub fn stored_upper(&self) -> usize {
        (self.upper + self.lower).min(self.begins.len() - 2)
    }

    /// Gives position, row, column and value of each element.
    pub fn evaluate<P: Problem>(
        &self,
        problem: &P,
        at: &[f64],
        states: &mut Vec<Dual>,
        rates: &mut Vec<Dual>,
        mut take: impl FnMut(usize, usize, usize, f64),
    ) {
        states.clear();
        states.extend(at.iter().map(|&state| Dual::from(state)));
        rates.resize(at.len(), Dual::default());
        for group in &self.groups {
            for &column in group {
                states[column].derivative = 1.0;
            }
            problem.rates(states, rates);
            for &column in group {
                states[column].derivative = 0.0;
                for position in self.begins[column]..self.begins[column + 1] {
                    let row = self.rows[position];
                    take(position, row, column, rates[row].derivative);
                }
            }
        }
    }
}
