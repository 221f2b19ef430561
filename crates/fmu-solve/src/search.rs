//! The search for the first event in a step of the [integrator](crate::integrator): where an event indicator becomes
//! positive, or ceases to be.

use crate::events::{Events, Pace, Side};

/// The fewest and most points at which a step is searched for events.
const SEARCHED: u32 = 8;
const MOST_SEARCHED: u32 = 1 << 16;
/// The number of points searched beyond a crossing, if indicators change faster than states.
const CONFIRMED: u32 = 24;
/// How far beyond its estimate a crossing is searched for, in roundings of the time since the communication step's
/// start.
pub(crate) const ROUNDINGS: f64 = 4.0;

/// A step of the integrator. Its places are times in s since the communication step's start.
pub trait Trajectory {
    /// What fails at a place.
    type Error;

    /// The event indicators.
    fn events(&mut self) -> &mut Events;

    /// The longest time in s between two points that are searched: infinite at first, the search adapts it to how fast
    /// indicators change.
    fn look(&mut self) -> &mut f64;

    /// Goes to a place and [finds which indicators have changed](Events::find_changes) there. Returns whether any has.
    ///
    /// # Errors
    /// When the model cannot be evaluated there.
    fn go_to(&mut self, place: f64) -> Result<bool, Self::Error>;
}

/// Goes to the first event between two places of a communication step that starts at `start`, just beyond the
/// crossing, or to the second place. Returns whether there is an event.
///
/// `trials` counts what the search costs, in trials of the integrator.
///
/// # Errors
/// When the model cannot be evaluated before the event.
#[allow(clippy::inline_always, reason = "apart from its caller it costs 3 % of the instructions of a step")]
#[inline(always)]
pub fn first_event<T: Trajectory>(
    trajectory: &mut T,
    start: f64,
    (begin, end): (f64, f64),
    trials: &mut u32,
) -> Result<bool, T::Error> {
    // Points so close that indicators change little between them, whatever the step: otherwise crossings would be
    // missed.
    let mut places = SEARCHED;
    while (end - begin) / f64::from(places) > *trajectory.look() && places < MOST_SEARCHED {
        places *= 2;
    }
    let (mut before, mut after) = loop {
        let (mut before, mut after) = (begin, None);
        trajectory.events().begin_search(begin);
        let mut last = places;
        for place in 1..=places {
            if place > last {
                break;
            }
            let share = (f64::from(place) + unevenness(place)) / f64::from(places);
            let elapsed = if place == places { end } else { begin + share * (end - begin) };
            let has_changed = match trajectory.go_to(elapsed) {
                // The equations need not be valid beyond an event.
                Err(_) if after.is_some() => break,
                has_changed => has_changed?,
            };
            let events = trajectory.events();
            // Whether a crossing was the first depends on how the indicators change.
            if after.is_none() && has_changed {
                events.note_crossing();
                after = Some(elapsed);
                last = if places == SEARCHED { SEARCHED } else { place + CONFIRMED };
            } else if after.is_none() {
                before = elapsed;
            }
            events.look(elapsed);
        }
        let (looked, pace) = trajectory.events().looked();
        // A long search costs as much as trials of the integrator.
        *trials += looked.saturating_sub(1) / SEARCHED;
        let distance = (end - begin) / f64::from(places);
        if pace == Pace::Fast && places < MOST_SEARCHED {
            places *= 2;
            *trajectory.look() = 0.5 * distance;
            trajectory.go_to(begin)?;
            continue;
        }
        if pace == Pace::Slow && *trajectory.look() < 2.0 * distance {
            *trajectory.look() = 2.0 * distance;
        }
        match after {
            Some(after) => break (before, after),
            None => return Ok(false),
        }
    };
    // Straight lines between the sides lead close to the crossing; aiming slightly past it, on the side that has
    // not moved, makes both sides close in. Bisection finishes the search, until no time lies between.
    let mut moved = Side::After;
    for trial in 1_u32.. {
        let width = after - before;
        let middle = before + 0.5 * width;
        let time = |elapsed: f64| start + elapsed;
        if time(middle) <= time(before) || time(middle) >= time(after) {
            break;
        }
        let line = before + trajectory.events().crossing() * width;
        let beyond = ROUNDINGS * f64::EPSILON * after.abs();
        let elapsed = match moved {
            _ if trial.is_multiple_of(3) => middle,
            Side::Before => line + beyond,
            Side::After => line - beyond,
        };
        let elapsed = if before < elapsed && elapsed < after { elapsed } else { middle };
        moved = if trajectory.go_to(elapsed)? { Side::After } else { Side::Before };
        trajectory.events().note(moved);
        match moved {
            Side::Before => before = elapsed,
            Side::After => after = elapsed,
        }
    }
    trajectory.go_to(after)
}

/// A point's pseudo-random offset from equidistance, from -1/4 to 1/4, so that no oscillation stays in step with the
/// points.
fn unevenness(place: u32) -> f64 {
    // The finalizer of MurmurHash3.
    let mixed = (place ^ place >> 16).wrapping_mul(0x85EB_CA6B);
    let mixed = (mixed ^ mixed >> 13).wrapping_mul(0xC2B2_AE35);
    0.5 * f64::from(mixed ^ mixed >> 16) / f64::from(u32::MAX) - 0.25
}
