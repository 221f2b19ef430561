//! The finished sweeps and points of a tuning: an interrupted tuning resumes from them.

use serde::{Deserialize, Serialize};

use super::bench::{Point, Sweep};
use fmu_run::journal::{Journal, Part};

/// A part of a tuning.
#[derive(Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TuningPart {
    Sweep(Sweep),
    Point(Box<Point>),
}

impl Part for TuningPart {
    /// A point's row, and the column.
    type Key = (Option<usize>, usize);

    fn key(&self) -> Self::Key {
        match self {
            Self::Sweep(sweep) => (None, sweep.column),
            Self::Point(point) => (Some(point.row), point.column),
        }
    }
}

pub type TuningJournal = Journal<TuningPart>;

/// What a worker does for a part.
#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TuningJob {
    /// Sweeps the duty in a column.
    Sweep(usize),
    /// Steps the duty both ways from a value (%) in a row and a column.
    Point(usize, usize, f64),
}

impl TuningPart {
    pub fn sweep(self) -> Option<Sweep> {
        if let Self::Sweep(sweep) = self { Some(sweep) } else { None }
    }

    pub fn point(self) -> Option<Point> {
        if let Self::Point(point) = self { Some(*point) } else { None }
    }
}
