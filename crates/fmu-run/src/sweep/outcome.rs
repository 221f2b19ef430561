//! The outcome of a run.

use serde::{Deserialize, Serialize};

use crate::journal::Part;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    pub run: usize,
    /// The FMU's message, if the run failed, or what ended the worker.
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

impl Part for Outcome {
    type Key = usize;

    fn key(&self) -> usize {
        self.run
    }
}
