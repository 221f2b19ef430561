//! The finished runs of a study: an interrupted study resumes from them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};

use crate::run::journal::{self, Settings};

/// The file in the folder of a study's results.
pub(super) const NAME: &str = "journal.jsonl";

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    pub run: usize,
    /// The FMU's message, if the run failed.
    pub error: Option<String>,
    /// The measures; none for an undefined one.
    pub measures: Vec<Option<f64>>,
    pub warnings: Vec<String>,
}

impl Outcome {
    /// A run that has no result.
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
    /// Opens or creates the journal in a folder.
    pub fn open(folder: &Path, settings: &Settings) -> Result<Self> {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
        let (journal, finished) = journal::Journal::open(&folder.join(NAME), settings)?;
        let outcomes = finished.into_iter().map(|outcome: Outcome| (outcome.run, outcome)).collect();
        Ok(Self { folder: folder.to_owned(), journal, outcomes })
    }

    pub fn folder(&self) -> &Path {
        &self.folder
    }

    pub fn has(&self, run: usize) -> bool {
        self.outcomes.contains_key(&run)
    }

    pub fn len(&self) -> usize {
        self.outcomes.len()
    }

    pub fn write(&mut self, outcome: Outcome) -> Result<()> {
        self.journal.write(&outcome)?;
        self.outcomes.insert(outcome.run, outcome);
        Ok(())
    }

    pub fn into_outcomes(self) -> Vec<Outcome> {
        self.outcomes.into_values().collect()
    }
}
