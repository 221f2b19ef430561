//! The last step of the integrator, with its dense output.

use super::system::System;
use crate::error::Error;
use crate::persistence::{Archive, Persistent};

/// The integrator's last step.
#[derive(Debug)]
pub(super) struct LastStep {
    /// The step's start and end in s, and its length.
    pub(super) begin: f64,
    pub(super) end: f64,
    pub(super) length: f64,
    /// The states at the step's start and end.
    pub(super) from: Vec<f64>,
    pub(super) to: Vec<f64>,
    /// Whether the explicit method took the step. If so, its stages can be evaluated again: its start then, and what
    /// that counted from.
    pub(super) is_explicit: bool,
    pub(super) begun: f64,
    pub(super) zero: f64,
    /// The polynomials of the dense output, once they are asked for, and the terms that the explicit method adds.
    pub(super) dense: Vec<[f64; 3]>,
    pub(super) higher: Vec<[f64; 3]>,
    pub(super) has_dense: bool,
}

impl Persistent for LastStep {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let Self { begin, end, length, from, to, is_explicit, begun, zero, dense, has_dense, .. } = self;
        [begin, end, length].into_iter().try_for_each(|time| time.persist(archive))?;
        from.persist(archive)?;
        to.persist(archive)?;
        is_explicit.persist(archive)?;
        *has_dense = !*is_explicit;
        if *is_explicit {
            begun.persist(archive)?;
            zero.persist(archive)
        } else {
            dense.persist(archive)
        }
    }
}

impl LastStep {
    pub(super) fn new(size: usize) -> Self {
        let vector = || vec![0.0; size];
        Self {
            begin: 0.0,
            end: 0.0,
            length: 0.0,
            from: vector(),
            to: vector(),
            is_explicit: false,
            begun: 0.0,
            zero: 0.0,
            dense: vec![],
            higher: vec![],
            has_dense: false,
        }
    }

    /// Whether the explicit method took the step. Code for it is left out where it never does.
    #[inline]
    pub(super) fn took_explicit<S: System>(&self) -> bool {
        S::METHOD.has_explicit() && self.is_explicit
    }

    /// What a saved state keeps of the step: the polynomials, or what is needed to evaluate them again if those are
    /// more.
    pub(super) fn kept(&self) -> Self {
        let Self { from, to, dense, .. } = self;
        let has_dense = self.has_dense && !self.is_explicit;
        let dense = if has_dense { dense.clone() } else { vec![] };
        Self { from: from.clone(), to: to.clone(), dense, higher: vec![], has_dense, ..*self }
    }

    /// Checks what was read for this many states.
    pub(super) fn check(&self, size: usize) -> Result<(), Error> {
        let Self { begin, end, length, from, to, is_explicit, begun, zero, dense, .. } = self;
        let polynomials = if *is_explicit { &[][..] } else { dense };
        let numbers = [begin, end, length, begun, zero].into_iter().chain(from).chain(to);
        let are_finite = numbers.chain(polynomials.as_flattened()).all(|number| number.is_finite());
        let is_complete = [from.len(), to.len()] == [size; 2] && (*is_explicit || dense.len() == size);
        if is_complete && are_finite && begin < end && *length > 0.0 {
            Ok(())
        } else {
            Err(Error::new("the integrator's step in the serialized state is not one of this model"))
        }
    }

    /// What the dense output adds at a share of the step to the line from its start to its end, divided by
    /// share·(1 − share), and the slope of this.
    fn bulge(&self, state: usize, share: f64) -> [f64; 2] {
        let ([first, second, mut third], mut slope) = (self.dense[state], 0.0);
        if let Some([fourth, fifth, sixth]) = self.higher.get(state) {
            third += share * (fourth + share * (fifth + share * sixth));
            slope = fourth + share * (2.0 * fifth + 3.0 * share * sixth);
        }
        [first + share * (second + share * third), second + share * (2.0 * third + share * slope)]
    }

    /// The slope of the dense output at a share of the step.
    pub(super) fn slope(&self, state: usize, share: f64) -> f64 {
        let [bulge, bulge_slope] = self.bulge(state, share);
        let rest = 1.0 - share;
        let rise = self.to[state] - self.from[state] + (rest - share) * bulge + share * rest * bulge_slope;
        rise / self.length
    }

    /// The states at a time, with dense output.
    pub(super) fn states_at(&self, time: f64, states: &mut [f64]) {
        if time >= self.end {
            return states.copy_from_slice(&self.to);
        }
        let share = (time - self.begin) / self.length;
        let ends = self.from.iter().zip(&self.to);
        for (i, (state, (from, to))) in states.iter_mut().zip(ends).enumerate() {
            let [bulge, _] = self.bulge(i, share);
            *state = (1.0 - share) * from + share * (to + (1.0 - share) * bulge);
        }
    }
}
