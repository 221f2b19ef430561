//! The columns of a Jacobian by the directions along which its products are computed: several share one where no row has
//! elements of both.

use std::mem;
use std::ops::Range;

use fmu_solve::integrator::{Directions, Pattern};

/// The directions along which the products of a Jacobian were computed.
pub struct Columns<'a> {
    pattern: Option<&'a Pattern>,
    /// The number of directions, with one that checks the pattern.
    count: usize,
    /// The direction of each state.
    of: Vec<usize>,
    /// The rows whose elements are computed otherwise.
    is_long: Vec<bool>,
}

impl<'a> Columns<'a> {
    /// The directions of a full Jacobian, one for each state.
    pub fn full(size: usize) -> Self {
        Self { pattern: None, count: size, of: (0..size).collect(), is_long: vec![false; size] }
    }

    /// The directions of an integrator, for this many states.
    pub fn new(directions: &'a impl Directions, size: usize) -> Self {
        let Some(pattern) = directions.pattern() else { return Self::full(size) };
        let count = directions.count();
        let direction = |state: usize| (0..count - 1).find(|&of| directions.component(of, state) != 0.0);
        let of: Vec<_> = (0..size).map(|state| direction(state).unwrap_or(count)).collect();
        let mut rows = vec![size; count + 1];
        let is_long = (0..size).map(|row| {
            let mut columns = pattern.row(row).iter();
            columns.any(|&column| mem::replace(&mut rows[of[column as usize]], row) == row)
        });
        let is_long = is_long.collect();
        Self { pattern: Some(pattern), count, of, is_long }
    }

    /// Whether the directions are those of a full Jacobian.
    pub fn is_full(&self) -> bool {
        self.pattern.is_none()
    }

    /// The direction that checks the pattern.
    pub fn checking(&self) -> Option<usize> {
        self.pattern.map(|_| self.count - 1)
    }

    /// The directions that give elements.
    pub fn directions(&self) -> Range<usize> {
        0..self.count - usize::from(self.pattern.is_some())
    }

    /// The states of a direction.
    pub fn states(&self, direction: usize) -> impl Iterator<Item = usize> {
        self.of.iter().enumerate().filter(move |(_, of)| **of == direction).map(|(state, _)| state)
    }

    /// Whether a row's elements are computed otherwise.
    pub fn is_long(&self, row: usize) -> bool {
        self.is_long[row]
    }

    /// The columns of a row's elements; none of a row whose elements are computed otherwise.
    pub fn row(&self, row: usize) -> impl Iterator<Item = usize> {
        let columns =
            self.pattern.map_or(&[][..], |pattern| if self.is_long[row] { &[] } else { pattern.row(row) });
        let all = if self.pattern.is_none() { self.of.len() } else { 0 };
        (0..all).chain(columns.iter().map(|&column| column as usize))
    }

    /// The column of a row's element along a direction.
    pub fn column(&self, row: usize, direction: usize) -> Option<usize> {
        match self.pattern {
            None => Some(direction),
            Some(_) => self.row(row).find(|&column| self.of[column] == direction),
        }
    }

    /// Where the product of a row with a direction is.
    pub fn place(&self, row: usize, direction: usize) -> usize {
        row * self.count + direction
    }

    /// Where the product that gives an element is.
    pub fn element(&self, row: usize, column: usize) -> usize {
        self.place(row, self.of[column])
    }
}
