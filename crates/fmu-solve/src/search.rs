//! The search for the first event in a step of the [integrator](crate::integrator): where an event indicator becomes
//! positive, or ceases to be.

use crate::events::{Events, Pace, Side};

/// The fewest points at which a step is searched for events. [Chosen](crate::chosen).
const SEARCHED: u32 = 8;
/// The most points, so that a search ends: enough for eight thousand oscillations of an indicator in a step.
const MOST_SEARCHED: u32 = 1 << 16;
/// The number of points searched beyond a crossing, if indicators change faster than states. [Chosen](crate::chosen).
const CONFIRMED: u32 = 24;
/// How far beyond its estimate a crossing is searched for, in roundings of the time since the communication step's
/// start: one for each of the four operations of the estimate.
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
    let mut places = chosen!(SEARCHED);
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
                last = if places == chosen!(SEARCHED) { places } else { place + chosen!(CONFIRMED) };
            } else if after.is_none() {
                before = elapsed;
            }
            events.look(elapsed);
        }
        let (looked, pace) = trajectory.events().looked();
        // A long search costs as much as trials of the integrator.
        *trials += looked.saturating_sub(1) / chosen!(SEARCHED);
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
    // not moved, makes both sides close in. Bisection finishes the search, until no time lies between: as every third
    // trial, so that a search takes at most three times as many as by bisection alone.
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
/// points, which stay half as far apart at least.
fn unevenness(place: u32) -> f64 {
    // The finalizer of MurmurHash3.
    let mixed = (place ^ place >> 16).wrapping_mul(0x85EB_CA6B);
    let mixed = (mixed ^ mixed >> 13).wrapping_mul(0xC2B2_AE35);
    0.5 * f64::from(mixed ^ mixed >> 16) / f64::from(u32::MAX) - 0.25
}

#[cfg(test)]
mod tests {
    use core::convert::Infallible;

    use super::*;
    use crate::chosen::experiment::{Outcome, compare};

    /// The end of the experiment (s), in steps of 1 s.
    const END: f64 = 20.0;

    /// Two indicators: an oscillation about an offset, and a slower one.
    #[derive(Clone)]
    struct Waves {
        frequency: f64,
        phase: f64,
        offset: f64,
        events: Events,
        look: f64,
        place: f64,
        points: u32,
    }

    impl Waves {
        fn indicators(&self, time: f64) -> [f64; 2] {
            let angle = self.frequency * time + self.phase;
            [angle.sin() - self.offset, (0.1 * angle).cos() + 0.9 * self.offset]
        }

        /// How often an indicator changes its sign, by many points.
        fn crossings(&self) -> u32 {
            // Some hundred a period of the fastest.
            let points = 1_000_000;
            let signs = |point: u32| {
                self.indicators(END * f64::from(point) / f64::from(points)).map(|indicator| indicator > 0.0)
            };
            let mut count = 0;
            for point in 1..=points {
                let (before, after) = (signs(point - 1), signs(point));
                count += u32::from(before != after);
            }
            count
        }

        /// The events that are found.
        fn search(&mut self) -> u32 {
            let (mut begin, mut found) = (0.0, 0);
            let first = self.indicators(begin);
            self.events.begin(begin, &[], |indicators| indicators.copy_from_slice(&first)).unwrap();
            while begin < END {
                let end = begin.floor() + 1.0;
                let Ok(has_event) = first_event(self, 0.0, (begin, end), &mut 0);
                if has_event {
                    found += 1;
                    self.events.accept();
                }
                begin = self.place;
            }
            found
        }
    }

    impl Trajectory for Waves {
        type Error = Infallible;

        fn events(&mut self) -> &mut Events {
            &mut self.events
        }

        fn look(&mut self) -> &mut f64 {
            &mut self.look
        }

        fn go_to(&mut self, place: f64) -> Result<bool, Infallible> {
            self.place = place;
            self.points += 1;
            let present = self.indicators(place);
            Ok(self
                .events
                .find_changes(place, &[], |indicators| indicators.copy_from_slice(&present))
                .unwrap())
        }
    }

    #[test]
    #[ignore = "an experiment that prints a table"]
    fn neither_half_nor_twice_of_a_chosen_constant_of_the_search_is_better() {
        let waves: Vec<_> = (0..40)
            .map(|number| {
                // The golden ratio's multiples, evenly spread.
                let share = |of: u32| (0.618_033_988_749_895 * f64::from(number * 3 + of)).fract();
                let waves = Waves {
                    frequency: 10.0_f64.powf(-1.0 + 3.0 * share(0)),
                    phase: 6.0 * share(1),
                    offset: 0.9 * share(2),
                    events: Events::new(2),
                    look: f64::INFINITY,
                    place: 0.0,
                    points: 0,
                };
                let crossings = waves.crossings();
                (waves, crossings)
            })
            .collect();
        let outcomes = || {
            let outcome = |(waves, crossings): &(Waves, u32)| {
                let mut waves = waves.clone();
                let missed = crossings.saturating_sub(waves.search());
                Outcome { cost: f64::from(waves.points), error: f64::from(1 + missed) }
            };
            waves.iter().map(outcome).collect::<Vec<_>>()
        };
        compare(&["CONFIRMED", "RARELY", "SEARCHED", "SHARP", "TURNING"], outcomes);
    }
}
