//! Checks an FMU's directional derivatives by comparison with difference quotients.
//!
//! A wrong Jacobian need not show in the integrator's estimated error: if an element is far too large, the states
//! hardly move, and no step is rejected. So the first Jacobian is compared along the directions by which it was computed,
//! which are its columns if it is full. Each later one is compared along a direction of all states, by one evaluation, and
//! along those if that differs. The same finds elements that a pattern lacks; its first Jacobian is compared both ways.
//!
//! A difference quotient is inexact, too. Where the equations bend, kink or are noisy, quotients of different lengths
//! differ from each other by about as much as from the derivative. So an element is wrong only if it lies outside the
//! range of quotients of six lengths, on both sides.

use std::mem;

use anyhow::Result;
use fmu_solve::integrator::check_direction;

use super::calls::Calls;
use super::columns::Columns;
use super::differences::{Place, forward};
use super::exchange::Exchange;
use super::messages::is_discarded;

/// The lengths of the differences relative to that of a [forward] one, in the order in which they are tried. Where f bends
/// on a longer scale than the nominal, rounding is less at the longer ones.
const LENGTHS: [f64; 6] = [1.0, 64.0, 4096.0, -1.0, -64.0, -4096.0];
/// An error below this fraction of a row does not matter: the integrator's estimated error contains its effect.
const SHARE: f64 = 0.01;
/// The rounding error of a derivative, in roundings of the terms of its linearization.
const ROUNDINGS: f64 = 16.0;

/// Where and for what a Jacobian is used.
pub struct Use<'a> {
    /// The time of the states (s).
    pub time: f64,
    pub states: &'a [f64],
    pub derivatives: &'a [f64],
    /// The states as those about which differences are taken.
    pub places: &'a [Place],
    /// The longest step (s).
    pub step: f64,
    /// The relative tolerance.
    pub tolerance: f64,
}

/// What is wrong with a Jacobian.
pub struct Wrong {
    pub row: usize,
    /// The wrong element's column; none if the pattern lacks an element in the row.
    pub column: Option<usize>,
    /// What a difference quotient gives instead.
    pub quotient: f64,
}

/// The memory of a check.
#[derive(Clone)]
pub struct DerivativeCheck {
    /// Whether no Jacobian was checked before.
    is_first: bool,
    direction: Vec<f64>,
    /// States near those of interest, and the derivatives there.
    states: Vec<f64>,
    derivatives: Vec<f64>,
    /// The size of the terms of each row.
    terms: Vec<f64>,
    /// The product of each row and the direction, and the sum of its terms' sizes.
    products: Vec<[f64; 2]>,
    /// The lowest and the highest quotient of each row.
    quotients: Vec<[f64; 2]>,
}

impl DerivativeCheck {
    pub fn new(size: usize) -> Self {
        let vector = || vec![0.0; size];
        let pairs = || vec![[0.0; 2]; size];
        Self {
            is_first: true,
            direction: vector(),
            states: vector(),
            derivatives: vector(),
            terms: vector(),
            products: pairs(),
            quotients: pairs(),
        }
    }

    /// Starts over: the next Jacobian is checked as the first one.
    pub fn begin(&mut self) {
        self.is_first = true;
    }

    /// Finds what is wrong with a Jacobian, which is given by products. The FMU is evaluated at other states.
    ///
    /// # Errors
    /// When a call fails.
    pub fn find_wrong(
        &mut self,
        (calls, exchange): (&mut Calls, &Exchange),
        columns: &Columns<'_>,
        products: &[f64],
        at: &Use<'_>,
    ) -> Result<Option<Wrong>> {
        for (row, (terms, derivative)) in self.terms.iter_mut().zip(at.derivatives).enumerate() {
            let of_states = columns
                .row(row)
                .map(|column| (products[columns.element(row, column)] * at.states[column]).abs());
            *terms = derivative.abs() + of_states.filter(|term| term.is_finite()).sum::<f64>();
        }
        let is_first = mem::replace(&mut self.is_first, false);
        let mut suspect = None;
        if !is_first || !columns.is_full() {
            for column in 0..at.states.len() {
                self.direction[column] = check_direction(column) * at.places[column].scale();
            }
            suspect = self.contradiction((calls, exchange), columns, products, at)?;
            if !is_first && suspect.is_none() {
                return Ok(None);
            }
        }
        for direction in columns.directions() {
            self.direction.fill(0.0);
            for column in columns.states(direction) {
                self.direction[column] = at.places[column].scale();
            }
            if let Some(row) = self.contradiction((calls, exchange), columns, products, at)? {
                let [low, high] = self.quotients[row];
                let column = columns.column(row, direction);
                let quotient = f64::midpoint(low, high) / column.map_or(1.0, |column| self.direction[column]);
                return Ok(Some(Wrong { row, column, quotient }));
            }
        }
        // Elements that a pattern lacks may cancel along the directions of its groups.
        let suspect = suspect.filter(|_| !columns.is_full());
        Ok(suspect.map(|row| Wrong { row, column: None, quotient: f64::NAN }))
    }

    /// The first row whose product with the direction differs from all difference quotients.
    fn contradiction(
        &mut self,
        (calls, exchange): (&mut Calls, &Exchange),
        columns: &Columns<'_>,
        products: &[f64],
        at: &Use<'_>,
    ) -> Result<Option<usize>> {
        let size = at.states.len();
        let moved: Vec<_> = (0..size).filter(|&column| self.direction[column] != 0.0).collect();
        let allowed = |length: f64, column: usize, direction: &[f64]| {
            at.places[column].allows(length * direction[column])
        };
        for &column in &moved {
            if !allowed(forward(), column, &self.direction) {
                self.direction[column] *= -1.0;
            }
        }
        for (row, product) in self.products.iter_mut().enumerate() {
            *product = [0.0; 2];
            for column in columns.row(row) {
                if self.direction[column] != 0.0 {
                    let term = products[columns.element(row, column)] * self.direction[column];
                    *product = [product[0] + term, product[1] + term.abs()];
                }
            }
        }
        self.quotients.fill([f64::INFINITY, f64::NEG_INFINITY]);
        let mut found = None;
        for length in LENGTHS.map(|length| forward() * length) {
            if !moved.iter().all(|&column| allowed(length, column, &self.direction)) {
                continue;
            }
            for (moved, (state, direction)) in
                self.states.iter_mut().zip(at.states.iter().zip(&self.direction))
            {
                *moved = state + length * direction;
            }
            match exchange.derivatives_at(calls, at.time, &self.states, &mut self.derivatives) {
                Err(error) if !is_discarded(&error) => return Err(error),
                Ok(()) if self.derivatives.iter().all(|derivative| derivative.is_finite()) => {}
                // The equations are not valid there.
                _ => continue,
            }
            for (quotient, (there, here)) in
                self.quotients.iter_mut().zip(self.derivatives.iter().zip(at.derivatives))
            {
                let new = (there - here) / length;
                *quotient = [quotient[0].min(new), quotient[1].max(new)];
            }
            found = (0..size).find(|&row| !columns.is_long(row) && !self.agrees(row, at));
            if found.is_none() {
                return Ok(None);
            }
        }
        Ok(found)
    }

    /// Whether a product agrees with the quotients so far.
    fn agrees(&self, row: usize, at: &Use<'_>) -> bool {
        let ([product, sum], [low, high]) = (self.products[row], self.quotients[row]);
        let rounding = ROUNDINGS * f64::EPSILON / forward() * self.terms[row];
        // An error that changes no state by its tolerance in the longest step.
        let harmless = at.tolerance * at.places[row].scale() / at.step;
        let distance = (low - product).max(product - high);
        // What is not a number agrees with nothing.
        product.is_finite() && distance <= (high - low) + SHARE * sum + rounding + harmless
    }
}
