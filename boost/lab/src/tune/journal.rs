//! The finished sweeps and points of a tuning: an interrupted tuning resumes from them.

use anyhow::Result;
use serde::{Deserialize, Serialize};

use super::bench::{Point, Sweep};
use cargo_fmu::run::journal::{Journal, Part};

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

/// The sweep of a column.
pub fn sweep(journal: &TuningJournal, column: usize, run: impl FnOnce() -> Result<Sweep>) -> Result<Sweep> {
    match journal.part(&(None, column), || run().map(TuningPart::Sweep))? {
        TuningPart::Sweep(sweep) => Ok(sweep),
        TuningPart::Point(_) => unreachable!("a point has a row"),
    }
}

/// A point of the grid.
pub fn point(
    journal: &TuningJournal,
    (row, column): (usize, usize),
    run: impl FnOnce() -> Result<Point>,
) -> Result<Point> {
    match journal.part(&(Some(row), column), || run().map(|point| TuningPart::Point(Box::new(point))))? {
        TuningPart::Point(point) => Ok(*point),
        TuningPart::Sweep(_) => unreachable!("a sweep has no row"),
    }
}
