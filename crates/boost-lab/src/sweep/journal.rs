//! The runs that a study has finished: an interrupted study goes on from them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};

use crate::journal::{self, Settings};

/// The file in the folder of a study's results.
pub(super) const NAME: &str = "journal.jsonl";

/// What came of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Which run, from 0 on.
    pub run: usize,
    /// Why it failed, if it did: the FMU's own message.
    pub error: Option<String>,
    /// The measures; none where one is undefined.
    pub measures: Vec<Option<f64>>,
    /// What the FMUs warned of.
    pub warnings: Vec<String>,
}

impl Outcome {
    /// A run that has no result.
    #[must_use]
    pub fn new(run: usize, measures: usize) -> Self {
        Self { run, error: None, measures: vec![None; measures], warnings: vec![] }
    }
}

/// The finished runs of a study.
pub struct StudyJournal {
    folder: PathBuf,
    journal: journal::Journal,
    outcomes: BTreeMap<usize, Outcome>,
}

impl StudyJournal {
    /// Opens the journal in a folder, or begins one.
    ///
    /// # Errors
    /// When it is of other settings, which the message names, or another process works on it, or it cannot be
    /// read or written.
    pub fn open(folder: &Path, settings: &Settings) -> Result<Self> {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
        let (journal, finished) = journal::Journal::open(&folder.join(NAME), settings)?;
        let outcomes = finished.into_iter().map(|outcome: Outcome| (outcome.run, outcome)).collect();
        Ok(Self { folder: folder.to_owned(), journal, outcomes })
    }

    /// The folder of the results.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Whether a run is finished.
    #[must_use]
    pub fn has(&self, run: usize) -> bool {
        self.outcomes.contains_key(&run)
    }

    /// How many runs are finished.
    #[must_use]
    pub fn len(&self) -> usize {
        self.outcomes.len()
    }

    /// Whether no run is finished.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.outcomes.is_empty()
    }

    /// Writes what came of a run.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&mut self, outcome: Outcome) -> Result<()> {
        self.journal.write(&outcome)?;
        self.outcomes.insert(outcome.run, outcome);
        Ok(())
    }

    /// The finished runs, in their order.
    #[must_use]
    pub fn into_outcomes(self) -> Vec<Outcome> {
        self.outcomes.into_values().collect()
    }
}
