//! Which method takes a step where both may.

use crate::error::Error;
use crate::persistence::{Archive, Persistent};

/// How many votes the linearly implicit method needs while it costs little. [Chosen](crate::chosen).
const TO_IMPLICIT: u32 = 4;
/// How many votes the explicit method needs. [Chosen](crate::chosen).
const TO_EXPLICIT: u32 = 3;
/// The first trials after the linearly implicit method has taken over do not vote: their lengths are those that stability
/// allowed the explicit one, and their errors those that it left. [Chosen](crate::chosen).
const SETTLING: u32 = 2;

/// The present method, which is explicit at first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Switch {
    pub(super) is_implicit: bool,
    /// The votes for the other method, less the trials that spoke against it, at least 0.
    votes: u32,
    /// The trials since the last change.
    trials: u32,
    /// How many steps of the explicit method one of the linearly implicit one costs; 0 until known.
    pub(super) price: u32,
}

/// The votes of a trial: one for each multiple of what would be enough.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
pub(super) fn votes(multiples: f64) -> u32 {
    multiples as u32
}

impl Switch {
    pub(super) const fn new() -> Self {
        Self { is_implicit: false, votes: 0, trials: 0, price: 0 }
    }

    /// Counts a trial and its votes for the other method. Returns whether that takes over.
    pub(super) fn count(&mut self, votes: u32) -> bool {
        self.trials = self.trials.saturating_add(1);
        if self.is_implicit && self.trials <= chosen!(SETTLING) {
            return false;
        }
        self.votes = if votes > 0 { self.votes.saturating_add(votes) } else { self.votes.saturating_sub(1) };
        let takes_over = self.votes >= if self.is_implicit { chosen!(TO_EXPLICIT) } else { self.needed() };
        if takes_over {
            self.take_over();
        }
        takes_over
    }

    /// How many votes the linearly implicit method needs.
    fn needed(&self) -> u32 {
        // As many as explicit steps that cost as much as a trial.
        chosen!(TO_IMPLICIT).max(self.price)
    }

    /// Learns the price from the first linear equations. Returns whether their method had too few votes for it, and the
    /// explicit one goes on.
    pub(super) fn learn(&mut self, price: u32) -> bool {
        let was_known = self.price > 0;
        self.price = price;
        if was_known || price <= chosen!(TO_IMPLICIT) {
            return false;
        }
        (self.is_implicit, self.votes) = (false, chosen!(TO_IMPLICIT));
        true
    }

    /// Has the other method take over.
    pub(super) fn take_over(&mut self) {
        self.trials = 0;
        (self.is_implicit, self.votes) = (!self.is_implicit, 0);
    }
}

impl Persistent for Switch {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let Self { is_implicit, votes, trials, price } = self;
        is_implicit.persist(archive)?;
        votes.persist(archive)?;
        trials.persist(archive)?;
        price.persist(archive)?;
        if self.votes < self.needed() {
            Ok(())
        } else {
            Err(Error::new("the choice of the integrator's method in the serialized state is not one"))
        }
    }
}
