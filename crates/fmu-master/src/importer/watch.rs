//! The variables of an instance that connections and the record need.

use super::selection::Selection;

/// Variables that are read together.
pub struct Watch {
    pub selection: Selection,
    pub values: Vec<f64>,
    /// What was read at events since this was last taken; none if nothing is read at events.
    pub events: Option<Vec<EventRow>>,
}

/// Variables before or after an event.
pub struct EventRow {
    /// The time of the event (s).
    pub time: f64,
    pub is_after: bool,
    pub values: Vec<f64>,
}
