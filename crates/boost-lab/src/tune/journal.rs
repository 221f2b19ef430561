//! The finished sweeps and points of a tuning: an interrupted tuning resumes from them.

use std::path::Path;

use anyhow::Result;
use serde::{Deserialize, Serialize};

use super::bench::{Point, Sweep};
use cargo_fmu::run::journal::{self, Settings};

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Finished {
    Sweep(Sweep),
    Point(Point),
}

/// An open journal with its entries.
pub struct TuningJournal {
    journal: journal::Journal,
    finished: Vec<Finished>,
}

impl TuningJournal {
    /// Opens or creates a journal.
    pub fn open(path: &Path, settings: &Settings) -> Result<Self> {
        let (journal, finished) = journal::Journal::open(path, settings)?;
        Ok(Self { journal, finished })
    }

    fn sweeps(&self) -> impl Iterator<Item = &Sweep> {
        self.finished.iter().filter_map(|finished| match finished {
            Finished::Sweep(sweep) => Some(sweep),
            Finished::Point(_) => None,
        })
    }

    fn points(&self) -> impl Iterator<Item = &Point> {
        self.finished.iter().filter_map(|finished| match finished {
            Finished::Point(point) => Some(point),
            Finished::Sweep(_) => None,
        })
    }

    /// The sweep of a column, if it was finished when the journal was opened.
    pub fn sweep(&self, column: usize) -> Option<&Sweep> {
        self.sweeps().find(|sweep| sweep.column == column)
    }

    /// A point, if it was finished when the journal was opened.
    pub fn point(&self, row: usize, column: usize) -> Option<&Point> {
        self.points().find(|point| (point.row, point.column) == (row, column))
    }

    /// The numbers of sweeps and points that were finished when the journal was opened.
    pub fn finished(&self) -> (usize, usize) {
        (self.sweeps().count(), self.points().count())
    }

    pub fn write_sweep(&self, sweep: &Sweep) -> Result<()> {
        self.journal.write(&Finished::Sweep(sweep.clone()))
    }

    pub fn write_point(&self, point: &Point) -> Result<()> {
        self.journal.write(&Finished::Point(point.clone()))
    }
}
