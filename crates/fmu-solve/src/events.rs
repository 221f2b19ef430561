//! Event indicators and time events: when and why a model has an event.

use core::mem;

use crate::display::{Seconds, Shown};
use crate::error::Error;
use crate::persistence::{Archive, Persistent};
use crate::time::nearer;

/// The most events at one time, each caused by the previous one.
pub const MOST_ITERATIONS: u32 = 1000;

/// The hysteresis of indicators for importers ("a small hysteresis" in FMI 2.0.5, section 3.1): an indicator is shifted
/// away from its next crossing, so that it is never 0 when the importer continues, and has certainly crossed 0 where
/// the importer locates the crossing. Indicators are of order one; this is a thousand times their rounding.
const HYSTERESIS: f64 = 1e-12;

/// An event follows another closely within this share of the experiment: no importer handles so many.
const SOON: f64 = 1e-12;

/// A model's event bookkeeping.
#[derive(Debug, Default)]
pub struct Events {
    /// The time of the next time event, in s.
    pub next: Option<f64>,
    /// The time of the last event, in s.
    reached: f64,
    /// How many consecutive events closely followed the previous one.
    crowded: u32,
    /// Which indicators were positive at the last event.
    positive: Box<[bool]>,
    /// Which indicators have changed since the last event.
    changed: Box<[bool]>,
    indicators: Box<[f64]>,
    /// The largest magnitude of each indicator so far.
    scales: Box<[f64]>,
    /// The last search, with its memory.
    search: Option<Box<Search>>,
}

/// A search for the first crossing in a step.
#[derive(Debug)]
struct Search {
    /// The indicators on both sides of the crossing that is being located.
    sides: [Box<[f64]>; 2],
    /// The indicators at the last two points, and these points.
    last: [Box<[f64]>; 2],
    places: [f64; 2],
    /// The number of points searched, of those with a sharp turn of an indicator, and of those with any turn.
    looked: u32,
    sharp: u32,
    turning: u32,
}

/// A clone has no memory for a search.
impl Clone for Events {
    fn clone(&self) -> Self {
        Self {
            positive: self.positive.clone(),
            changed: self.changed.clone(),
            indicators: self.indicators.clone(),
            scales: self.scales.clone(),
            search: None,
            ..*self
        }
    }
}

/// How indicators change from point to point in a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pace {
    /// So fast that a crossing may be missed.
    Fast,
    Even,
    /// So slowly that half as many points would do.
    Slow,
}

/// An indicator turns sharply where its second difference, relative to its scale, exceeds this, as in an oscillation
/// with fewer than about eight points per period: with n points it reaches 4·sin²(π/n). [Chosen](crate::chosen).
const SHARP: f64 = 0.5;
/// It turns where the difference exceeds this, as with fewer than 25 points: half of more are still enough.
/// [Chosen](crate::chosen).
const TURNING: f64 = SHARP / 8.0;
/// Kinks and jumps turn sharply at two points, however close these are.
const OF_A_JUMP: u32 = 2;
/// One sharp turn in so many points is that of a kink or jump, not of speed. [Chosen](crate::chosen).
const RARELY: u32 = 16;

/// The sides of a crossing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Before,
    After,
}

/// Saves what does not follow from the model.
impl Persistent for Events {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        self.next.persist(archive)?;
        self.reached.persist(archive)?;
        self.crowded.persist(archive)?;
        self.scales.persist(archive)?;
        self.positive.persist(archive)
    }
}

impl Search {
    fn new(indicators: usize) -> Self {
        let pair = || [vec![0.0; indicators].into(), vec![0.0; indicators].into()];
        Self { sides: pair(), last: pair(), places: [0.0; 2], looked: 0, sharp: 0, turning: 0 }
    }
}

impl Events {
    /// The events of a model with this many event indicators.
    #[must_use]
    pub fn new(indicators: usize) -> Self {
        Self {
            next: None,
            reached: f64::NEG_INFINITY,
            crowded: 0,
            positive: vec![false; indicators].into(),
            changed: vec![false; indicators].into(),
            indicators: vec![0.0; indicators].into(),
            scales: vec![0.0; indicators].into(),
            search: None,
        }
    }

    /// Which indicators have changed since the last event.
    #[must_use]
    pub fn changed(&self) -> &[bool] {
        &self.changed
    }

    /// The position of the first indicator that has changed since the last event.
    #[must_use]
    pub fn first_changed(&self) -> Option<usize> {
        self.changed.iter().position(|changed| *changed)
    }

    /// Counts an event at a time in s of an experiment of a length in s, if it closely follows the previous one. Returns
    /// whether there were so many that the experiment may never end.
    pub fn crowd(&mut self, time: f64, length: f64) -> bool {
        let distance = (time - self.reached).abs();
        if distance <= 0.0 {
            // Another iteration of it.
            return false;
        }
        // Only rounding tells adjacent numbers apart.
        let is_soon = distance <= (SOON * length).max(f64::EPSILON * time.abs());
        self.crowded = if is_soon { self.crowded.saturating_add(1) } else { 0 };
        self.crowded == MOST_ITERATIONS
    }

    /// Stores the indicators' present signs as those of the last event.
    ///
    /// # Errors
    /// When an indicator is not finite and so has no sign.
    pub fn begin(
        &mut self,
        time: f64,
        names: &[&str],
        compute: impl FnOnce(&mut [f64]),
    ) -> Result<(), Error> {
        // An indicator that is never computed has no sign.
        self.find_changes(time, names, |indicators| {
            indicators.fill(f64::NAN);
            compute(indicators);
        })?;
        self.accept();
        Ok(())
    }

    /// Finds which indicators have changed at a time in s; `names` are their names. Returns whether any has.
    ///
    /// # Errors
    /// When an indicator is not finite and so has no sign.
    pub fn find_changes(
        &mut self,
        time: f64,
        names: &[&str],
        compute: impl FnOnce(&mut [f64]),
    ) -> Result<bool, Error> {
        compute(&mut self.indicators);
        if let Some(wrong) = self.indicators.iter().position(|indicator| !indicator.is_finite()) {
            return Err(Error::new(format!(
                "the event indicator {} is {} at {} s",
                names.get(wrong).copied().unwrap_or("without a name"),
                Shown(self.indicators[wrong]),
                Seconds(time)
            )));
        }
        for ((changed, positive), indicator) in
            self.changed.iter_mut().zip(&self.positive).zip(&self.indicators)
        {
            *changed = (*indicator > 0.0) != *positive;
        }
        Ok(self.changed.contains(&true))
    }

    /// Starts a search at the point where the indicators were last computed.
    pub(crate) fn begin_search(&mut self, place: f64) {
        let Self { indicators, search, .. } = self;
        let search = search.get_or_insert_with(|| Box::new(Search::new(indicators.len())));
        (search.looked, search.sharp, search.turning) = (0, 0, 0);
        search.places[1] = place;
        search.last[1].copy_from_slice(indicators);
    }

    /// Records the indicators that were last computed, at the next point.
    pub(crate) fn look(&mut self, place: f64) {
        let Self { indicators, scales, search: Some(search), .. } = self else { return };
        search.looked += 1;
        let share = (search.places[1] - search.places[0]) / (place - search.places[0]);
        let (mut is_sharp, mut turns) = (false, false);
        for (i, (indicator, scale)) in indicators.iter().zip(scales).enumerate() {
            let [first, second] = [search.last[0][i], search.last[1][i]];
            *scale = scale.max(indicator.abs());
            if search.looked > 1 {
                // Twice the distance from the straight line: for equidistant points, the second difference.
                let difference = 2.0 * (second - first - share * (indicator - first)).abs();
                is_sharp |= difference > chosen!(SHARP) * *scale;
                turns |= difference > chosen!(TURNING) * *scale;
            }
        }
        search.sharp += u32::from(is_sharp);
        search.turning += u32::from(turns);
        search.places = [search.places[1], place];
        // The oldest are computed over.
        search.last.swap(0, 1);
        mem::swap(&mut search.last[1], indicators);
    }

    /// The number of points searched, and how the indicators changed there.
    pub(crate) fn looked(&self) -> (u32, Pace) {
        let Some(Search { looked, sharp, turning, .. }) = self.search.as_deref() else {
            return (0, Pace::Even);
        };
        let pace = if *sharp > OF_A_JUMP + looked / chosen!(RARELY) {
            Pace::Fast
        } else if *turning <= OF_A_JUMP {
            Pace::Slow
        } else {
            Pace::Even
        };
        (*looked, pace)
    }

    /// Rejects a finished event that leaves a limit exceeded, because no further event may follow. `names` are the
    /// names of the indicators, `limits` the positions of those that are limits; they were computed after the event.
    ///
    /// # Errors
    /// When a limit is exceeded.
    pub fn check_limits(&self, time: f64, names: &[&str], limits: &[usize]) -> Result<(), Error> {
        match limits.iter().find(|limit| self.indicators[**limit] > 0.0) {
            Some(&exceeded) => Err(Error::new(format!(
                "the event at {} s leaves {} at {}, though it is a limit: an event must put the state onto the limit \
                 and end what pushes it beyond",
                Seconds(time),
                names[exceeded],
                Shown(self.indicators[exceeded])
            ))),
            None => Ok(()),
        }
    }

    /// Records the indicators in the last place of the search, and those computed since, as the sides of a crossing.
    pub(crate) fn note_crossing(&mut self) {
        if let Some(search) = self.search.as_deref_mut() {
            search.sides[Side::Before as usize].copy_from_slice(&search.last[1]);
        }
        self.note(Side::After);
    }

    /// Records the indicators last computed as those on one side of a crossing.
    pub(crate) fn note(&mut self, side: Side) {
        if let Some(search) = &mut self.search {
            search.sides[side as usize].copy_from_slice(&self.indicators);
        }
    }

    /// Where straight lines between the sides first cross zero: from 0, before, to 1, after.
    pub(crate) fn crossing(&self) -> f64 {
        let sides = self.search.iter().flat_map(|search| search.sides[0].iter().zip(&search.sides[1]));
        let shares = sides.filter(|(before, after)| (**before > 0.0) != (**after > 0.0));
        shares.map(|(before, after)| before / (before - after)).fold(1.0, f64::min)
    }

    /// Accepts the changes found: the model has handled its event.
    pub fn accept(&mut self) {
        for (positive, changed) in self.positive.iter_mut().zip(&mut self.changed) {
            *positive ^= *changed;
            *changed = false;
        }
    }

    /// The indicators as an importer sees them.
    pub fn shift(&self, indicators: &mut [f64]) {
        for (indicator, positive) in indicators.iter_mut().zip(&self.positive) {
            *indicator += if *positive { HYSTERESIS } else { -HYSTERESIS };
        }
    }

    /// The time of the last event in s, if it is at most `rounding` later than a given time; otherwise the given time.
    /// Time events may be handled slightly early, and must not recur.
    #[must_use]
    pub fn time(&self, time: f64, rounding: f64) -> f64 {
        if self.reached > time && self.reached <= time + rounding { self.reached } else { time }
    }

    /// The time of the last event in s.
    #[must_use]
    pub fn last(&self) -> f64 {
        self.reached
    }

    /// When the time event that is reached at a time in s was due, which may be later within a `rounding`.
    #[must_use]
    pub fn due(&self, time: f64, rounding: f64) -> Option<f64> {
        self.next.filter(|next| *next <= time + nearer(rounding, *next - self.reached))
    }

    /// Sets the time of the next event as asked for again, at a time in s between events: an event that has moved to an
    /// earlier time is due at once.
    ///
    /// # Errors
    /// When the model's answer is not a number.
    pub fn move_next(&mut self, next: Option<f64>, time: f64) -> Result<(), Error> {
        match next {
            Some(next) if next.is_nan() => self.set_next(Some(next), time, false),
            next => {
                self.next = next.filter(|next| *next != f64::INFINITY).map(|next| next.max(time));
                Ok(())
            }
        }
    }

    /// Sets the time of the next event, requested at an event at a time in s; only the initial event may be due at once.
    /// Infinity means never.
    ///
    /// # Errors
    /// When the model's answer is not after the present time.
    pub fn set_next(&mut self, next: Option<f64>, time: f64, is_initial: bool) -> Result<(), Error> {
        let next = next.filter(|next| *next != f64::INFINITY);
        if let Some(next) = next
            && !(next > time || next >= time && is_initial)
        {
            return Err(Error::new(format!(
                "the next event is due at {} s, not after the one at {} s",
                Shown(next),
                Shown(time)
            )));
        }
        self.reached = time;
        self.next = next;
        Ok(())
    }

    /// The error of an event at a time in s that does not end; `names` are the indicators'.
    #[must_use]
    #[cold]
    pub fn endless(&self, time: f64, names: &[&str]) -> Error {
        let changing: Vec<_> =
            names.iter().zip(&self.changed).filter(|(_, changed)| **changed).map(|(name, _)| *name).collect();
        let still = if changing.is_empty() {
            "time events are still due".to_owned()
        } else {
            format!("the event indicators still change ({})", changing.join(", "))
        };
        endless(time, &still)
    }
}

/// The error of an event at a time in s that does not end, and what still goes on.
#[must_use]
#[cold]
pub fn endless(time: f64, still: &str) -> Error {
    Error::new(format!(
        "the event at {} s does not end: after {MOST_ITERATIONS} iterations {still}",
        Seconds(time)
    ))
}

/// The cause of an event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event<'a> {
    /// The time in s; for an event that the model announced, exactly that number.
    pub time: f64,
    /// Whether it is the initial event, where the model finds its initial branches.
    pub is_initial: bool,
    /// Whether the time announced by the model is reached.
    pub is_due: bool,
    /// Which event indicators have become positive or ceased to be.
    pub indicators: &'a [bool],
}
