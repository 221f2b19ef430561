//! The Jacobian, which may serve several steps, and the linear equations of a step with it.

use std::sync::Arc;

use super::explicit;
use super::pattern::{Pattern, gradients, number};
use super::step_size::SIMILAR;
use super::system::{Directions, System};
use super::{dense, sparse};
use crate::error::Error;
use crate::persistence::{Archive, Persistent};

/// An element that the pattern lacks is noticed from this share of its row on. Below, it is of no consequence, as the
/// Jacobian of an FMU's difference quotients is no more precise: √ε, 1.5·10⁻⁸. Rounding of a row of a thousand elements is
/// far less, 2·10⁻¹³ of it.
const MISSED: f64 = 1e-9;
/// The most steps that a Jacobian serves: as many as one set of factors in CVODE (`MSBP_DEFAULT`). Where an older one
/// caused a rejection, the next ones serve no longer than it did, and each time that this many steps are accepted, twice as
/// long again: rejections then cost a trial in twenty steps at most.
const SERVES: u32 = 20;
/// Under a method whose order rests on the Jacobian: the largest growth of the step with which one is kept. The error
/// of a step of fifth order, the sixth power of the length, then grows threefold. [Chosen](crate::chosen).
const GROWTH: f64 = 1.2;
/// Relative to the tolerance: up to this error a Jacobian serves another step even if the method's order rests on it. A
/// step with an older one then has two decades to err more, and ends its service if it does. [Chosen](crate::chosen).
pub(super) const SMALL_ERROR: f64 = 0.01;
/// How many times as long a multiplication of elements takes whose place is looked up. [Chosen](crate::chosen).
const INDEXED: usize = 2;
/// How many times as long as an evaluation one with a direction takes: a sum of dual numbers has two sums, a product three
/// products and a sum, but as many calls and branches. [Chosen](crate::chosen).
const DIRECTION: usize = 2;

/// A Jacobian.
#[derive(Debug)]
pub(super) struct Jacobian {
    /// Where the Jacobian has elements, once found; not for few states.
    pattern: Option<Arc<Pattern>>,
    /// The elements, by rows; none in a clone that does not use them.
    elements: Vec<f64>,
    /// The number of steps that the Jacobian still serves; 0 if it must be renewed.
    serves: u32,
    /// The number of steps completed with the Jacobian.
    served: u32,
    /// The length of the step for which the matrix was factored; 0 if none.
    factored_for: f64,
    /// The most steps that the next Jacobian serves, and the number of steps accepted since this changed.
    most: u32,
    accepted: u32,
}

impl Default for Jacobian {
    fn default() -> Self {
        Self {
            pattern: None,
            elements: vec![],
            serves: 0,
            served: 0,
            factored_for: 0.0,
            most: SERVES,
            accepted: 0,
        }
    }
}

impl Persistent for Jacobian {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let mut pattern = self.pattern.take().map(Arc::unwrap_or_clone);
        pattern.persist(archive)?;
        self.pattern = pattern.map(Arc::new);
        let Self { pattern: _, elements, serves, served, factored_for, most, accepted } = self;
        most.persist(archive)?;
        accepted.persist(archive)?;
        serves.persist(archive)?;
        elements.persist(archive)?;
        if !elements.is_empty() {
            served.persist(archive)?;
            factored_for.persist(archive)?;
        }
        Ok(())
    }
}

impl Jacobian {
    /// What a clone keeps: the elements if they serve the next step, or the last one still `needs` them.
    pub(super) fn kept(&self, needs: bool) -> Self {
        let elements = if needs || self.serves() { self.elements.clone() } else { vec![] };
        Self { pattern: self.pattern.clone(), elements, ..*self }
    }

    /// Checks what was read for this many states, of which the last step `needs` the elements.
    pub(super) fn check(&self, size: usize, needs: bool) -> Result<(), Error> {
        let count = match &self.pattern {
            Some(pattern) => {
                pattern.check(size)?;
                pattern.count(size)
            }
            None => size.saturating_mul(size),
        };
        let is_counted = (1..=SERVES).contains(&self.most) && self.accepted.max(self.served) <= SERVES;
        let is_complete =
            self.elements.len() == count || self.elements.is_empty() && !(needs || self.serves());
        if is_counted && is_complete {
            Ok(())
        } else {
            Err(Error::new("the Jacobian in the serialized state is not one of this model"))
        }
    }

    /// Whether the Jacobian still serves the next step.
    pub(super) fn serves(&self) -> bool {
        self.serves > 0
    }

    /// Whether no step was completed with the Jacobian.
    pub(super) fn is_fresh(&self) -> bool {
        self.served == 0
    }

    /// Discards the Jacobian if it does not serve a step of this length.
    pub(super) fn expect<S: System>(&mut self, length: f64) {
        if !S::METHOD.takes_any_jacobian && length > chosen!(GROWTH) * self.factored_for {
            self.discard();
        }
    }

    /// Counts a completed step with an error relative to the tolerance.
    pub(super) fn count_step<S: System>(&mut self, error: f64) {
        let serves = S::METHOD.takes_any_jacobian || error <= chosen!(SMALL_ERROR);
        self.serves = if serves { self.serves.saturating_sub(1) } else { 0 };
        self.served += 1;
        self.accepted += 1;
        if self.accepted >= SERVES {
            (self.most, self.accepted) = ((2 * self.most).min(SERVES), 0);
        }
    }

    /// Has the next Jacobians serve no longer than this one did.
    pub(super) fn distrust(&mut self) {
        (self.most, self.accepted) = (self.served.max(1), 0);
        self.discard();
    }

    /// Has the Jacobian renewed before the next step.
    pub(super) fn discard(&mut self) {
        self.serves = 0;
    }

    /// Computes the derivatives with respect to time only.
    pub(super) fn keep<S: System>(
        &self,
        matrix: &mut Matrix,
        system: &mut S,
        (time, states): (f64, &[f64]),
        by_time: &mut [f64],
    ) {
        if S::MAY_BE_SPARSE
            && let Some(pattern) = &self.pattern
        {
            // The pattern of a clone is another one.
            matrix.follow::<S>(pattern);
        }
        system.linearize(time, states, &Units(0), &mut [], by_time);
    }

    /// Computes the elements again, and the derivatives with respect to time.
    pub(super) fn renew<S: System>(
        &mut self,
        matrix: &mut Matrix,
        system: &mut S,
        (time, states): (f64, &[f64]),
        by_time: &mut [f64],
    ) {
        let size = states.len();
        (self.serves, self.served, self.factored_for) =
            (if S::METHOD.takes_any_jacobian { SERVES } else { self.most }, 0, 0.0);
        if S::MAY_BE_SPARSE && size > S::METHOD.most_dense() {
            let pattern = self.pattern.get_or_insert_with(|| Arc::new(system.pattern(time, states)));
            loop {
                matrix.follow::<S>(pattern);
                let Some(groups) = &matrix.groups else { break };
                self.serves = self.most;
                self.elements.resize(pattern.count(size), 0.0);
                matrix.products.resize(size * groups.count(), 0.0);
                if !groups.long_rows.is_empty() {
                    system.gradients(time, states, &groups.long_rows, |row, gradient| {
                        let columns = pattern.range(row).zip(pattern.row(row));
                        for (element, &column) in columns {
                            self.elements[element] = gradient(column as usize);
                        }
                    });
                }
                system.linearize(time, states, groups, &mut matrix.products, by_time);
                if groups.take(&matrix.products, &mut self.elements) {
                    return;
                }
                let wider = pattern.with(&system.pattern(time, states));
                if wider == **pattern {
                    return;
                }
                *pattern = Arc::new(wider);
            }
        }
        self.elements.resize(size * size, 0.0);
        if S::MAY_BE_SPARSE && self.pattern.as_ref().is_some_and(|pattern| pattern.is_by_rows(size)) {
            let rows: Vec<_> = (0..size).collect();
            system.gradients(time, states, &rows, |row, gradient| {
                for (column, element) in self.elements[row * size..(row + 1) * size].iter_mut().enumerate() {
                    *element = gradient(column);
                }
            });
            system.linearize(time, states, &Units(0), &mut [], by_time);
        } else {
            system.linearize(time, states, &Units(size), &mut self.elements, by_time);
        }
    }

    /// A bound of the magnitudes of its eigenvalues: the root of the norm of its square, of magnitudes, for states
    /// relative to their scales. The root makes it close for systems of second order, too. `once` is memory.
    pub(super) fn radius(&self, scale: impl Fn(usize) -> f64, once: &mut [f64]) -> f64 {
        let size = once.len();
        for (row, once) in once.iter_mut().enumerate() {
            *once = self.product_of_magnitudes(row, size, &scale);
        }
        let twice = (0..size).map(|row| self.product_of_magnitudes(row, size, |i| once[i]) / scale(row));
        twice.fold(0.0, f64::max).sqrt()
    }

    /// The product of the magnitudes of a row and a vector.
    fn product_of_magnitudes(&self, row: usize, size: usize, vector: impl Fn(usize) -> f64) -> f64 {
        match &self.pattern {
            Some(pattern) if !pattern.is_full() => {
                let elements = self.elements[pattern.range(row)].iter().zip(pattern.row(row));
                elements.map(|(element, &column)| element.abs() * vector(column as usize)).sum()
            }
            _ => {
                let elements = self.elements[row * size..(row + 1) * size].iter().enumerate();
                elements.map(|(column, element)| element.abs() * vector(column)).sum()
            }
        }
    }

    /// The first state whose derivative has no finite linearization.
    pub(super) fn first_not_finite(&self, size: usize) -> usize {
        let is_finite = |range: core::ops::Range<usize>| self.elements[range].iter().all(|x| x.is_finite());
        let range = |row: usize| match &self.pattern {
            Some(pattern) if !pattern.is_full() => pattern.range(row),
            _ => row * size..(row + 1) * size,
        };
        (0..size).find(|&row| !is_finite(range(row))).unwrap_or(0)
    }
}

/// The directions of the first states.
struct Units(usize);

impl Directions for Units {
    #[inline]
    fn count(&self) -> usize {
        self.0
    }

    #[inline]
    fn component(&self, direction: usize, state: usize) -> f64 {
        if state == direction { 1.0 } else { 0.0 }
    }
}

/// The component along a state of a direction in which no two columns cancel but by chance: between 0.5 and 1.5, by
/// multiples of the golden ratio.
#[must_use]
pub fn check_direction(state: usize) -> f64 {
    0.5 + (0.618_033_988_749_895 * (state + 1) as f64).fract()
}

/// The groups of columns of a pattern.
#[derive(Debug)]
struct Groups {
    pattern: Arc<Pattern>,
    /// The group of each column.
    of: Vec<u32>,
    number: usize,
    /// The rows that are left out of the groups.
    long_rows: Vec<usize>,
}

/// The directions of the groups, and one that checks them.
impl Directions for Groups {
    fn count(&self) -> usize {
        self.number + 1
    }

    fn component(&self, direction: usize, state: usize) -> f64 {
        if direction == self.number {
            check_direction(state)
        } else if self.of[state] as usize == direction {
            1.0
        } else {
            0.0
        }
    }

    fn pattern(&self) -> Option<&Pattern> {
        Some(&self.pattern)
    }
}

impl Groups {
    fn new(pattern: &Arc<Pattern>) -> Self {
        let long_rows = pattern.long_rows();
        let (of, number) = pattern.groups(&long_rows);
        Self { pattern: Arc::clone(pattern), of, number, long_rows }
    }

    /// About the evaluations with a direction that take as long as all elements.
    fn directions(&self) -> usize {
        self.count() + gradients(self.long_rows.len())
    }

    /// Takes the elements from products, but for long rows. Returns whether all give the product that checks them, too.
    fn take(&self, products: &[f64], elements: &mut [f64]) -> bool {
        let mut is_complete = true;
        let mut long_rows = self.long_rows.iter().copied().peekable();
        for (row, products) in products.chunks_exact(self.count()).enumerate() {
            let is_long = long_rows.next_if_eq(&row).is_some();
            let check = products[self.number];
            let (mut difference, mut terms) = (check, check.abs());
            for (element, &column) in self.pattern.range(row).zip(self.pattern.row(row)) {
                if !is_long {
                    elements[element] = products[self.of[column as usize] as usize];
                }
                let term = elements[element] * check_direction(column as usize);
                difference -= term;
                terms += term.abs();
            }
            // What is not a number ends the step elsewhere.
            is_complete &= difference.abs() <= MISSED * terms || difference.is_nan();
        }
        is_complete
    }
}

/// The matrix of the linear equations.
#[derive(Debug)]
pub(super) struct Matrix {
    /// The groups of columns; none if the Jacobian is full.
    groups: Option<Groups>,
    /// The products of the Jacobian along the groups' directions, by rows.
    products: Vec<f64>,
    factors: Factors,
    /// Whether the factors are those of the present Jacobian.
    is_factored: bool,
    /// What the factors' solutions are multiplied by.
    scale: f64,
    /// How many steps of the explicit method one with a Jacobian and factors of its own costs, where these are sparse.
    pub(super) price: u32,
    /// How many times the matrix was factored, and equations were solved.
    #[cfg(test)]
    pub(super) counts: [u32; 2],
}

#[derive(Debug)]
enum Factors {
    Dense { elements: Vec<f64>, pivots: Vec<usize> },
    Sparse(Box<sparse::Factors>),
}

impl Factors {
    const NONE: Self = Self::Dense { elements: vec![], pivots: vec![] };
}

impl Matrix {
    pub(super) fn new() -> Self {
        Self {
            groups: None,
            products: vec![],
            factors: Factors::NONE,
            is_factored: false,
            scale: 1.0,
            price: 1,
            #[cfg(test)]
            counts: [0; 2],
        }
    }

    /// Forgets the factors, as those of another Jacobian.
    pub(super) fn forget(&mut self) {
        self.is_factored = false;
    }

    /// Takes the pattern of the present Jacobian.
    fn follow<S: System>(&mut self, pattern: &Arc<Pattern>) {
        let is_followed = match &self.groups {
            Some(groups) => Arc::ptr_eq(&groups.pattern, pattern) || groups.pattern == *pattern,
            None => pattern.is_full(),
        };
        if is_followed {
            return;
        }
        (self.groups, self.factors, self.price) = (None, Factors::NONE, 1);
        if !pattern.is_full() {
            let groups = self.groups.insert(Groups::new(pattern));
            let elimination = pattern.elimination();
            let multiplications = chosen!(INDEXED) * elimination.multiplications(S::METHOD.stages.len());
            let evaluations = S::METHOD.stages.len() + chosen!(DIRECTION) * groups.directions();
            let operations = evaluations * pattern.operations() + multiplications;
            let explicit = explicit::operations(pattern.size(), pattern.operations());
            self.price = number((operations + explicit / 2) / explicit).max(1);
            self.factors = Factors::Sparse(Box::new(sparse::Factors::new(elimination.order)));
        }
    }

    /// Has the factors of the matrix of the last step, of a length, which a clone has not. Returns whether it is regular.
    pub(super) fn restore<S: System>(&mut self, jacobian: &mut Jacobian, length: f64, size: usize) -> bool {
        if S::MAY_BE_SPARSE
            && let Some(pattern) = &jacobian.pattern
        {
            self.follow::<S>(pattern);
        }
        self.factor::<S>(jacobian, length, size)
    }

    /// Factors the matrix for a step of a length, or takes factors for a similar length where the method allows them.
    /// Returns whether it is regular to working precision.
    pub(super) fn factor<S: System>(&mut self, jacobian: &mut Jacobian, length: f64, size: usize) -> bool {
        // With factors for another length the Jacobian is, in effect, multiplied by their ratio.
        let similar = if S::METHOD.takes_any_jacobian { chosen!(SIMILAR) * length } else { 0.0 };
        if (jacobian.factored_for - length).abs() > similar {
            (jacobian.factored_for, self.is_factored) = (length, false);
        }
        self.scale = length / jacobian.factored_for;
        if self.is_factored {
            return true;
        }
        #[cfg(test)]
        {
            self.counts[0] += 1;
        }
        let diagonal = (jacobian.factored_for * S::METHOD.gamma).recip();
        self.is_factored = match &mut self.factors {
            Factors::Dense { elements, pivots } => {
                elements.resize(size * size, 0.0);
                pivots.resize(size, 0);
                dense::factor(diagonal, &jacobian.elements, elements, pivots)
            }
            Factors::Sparse(factors) => {
                let pattern = self.groups.as_ref().map(|groups| &groups.pattern);
                S::MAY_BE_SPARSE
                    && pattern.is_some_and(|pattern| factors.factor(diagonal, pattern, &jacobian.elements))
            }
        };
        self.is_factored
    }

    /// Solves the linear equations in place of their right-hand side.
    pub(super) fn solve<S: System>(&mut self, vector: &mut [f64]) {
        #[cfg(test)]
        {
            self.counts[1] += 1;
        }
        match &mut self.factors {
            Factors::Dense { elements, pivots } => dense::solve(elements, pivots, vector),
            Factors::Sparse(factors) if S::MAY_BE_SPARSE => factors.solve(vector),
            Factors::Sparse(_) => {}
        }
        if S::METHOD.takes_any_jacobian {
            for element in vector {
                *element *= self.scale;
            }
        }
    }
}
