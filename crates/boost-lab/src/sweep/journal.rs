//! What a study has finished, line by line: an interrupted study goes on from it.
//!
//! The first line holds the study's settings, each other one a run's outcome. A line that was cut short by the
//! interruption does not count.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Seek, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};

/// The file in the folder of a study's results.
const NAME: &str = "journal.jsonl";

/// What came of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Which run, from 0 on.
    pub run: usize,
    /// Why it failed, if it did: the FMU's own message.
    pub error: Option<String>,
    /// The measures; none where there is no number.
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

#[derive(Serialize, Deserialize)]
struct Header {
    settings: BTreeMap<String, String>,
}

/// The finished runs of a study.
pub struct Journal {
    folder: PathBuf,
    file: File,
    outcomes: BTreeMap<usize, Outcome>,
}

impl Journal {
    /// Opens the journal in a folder, or begins one.
    ///
    /// # Errors
    /// When it is of other settings, which the message names, or another process works on it, or it cannot be
    /// read or written.
    pub fn open(folder: &Path, settings: &BTreeMap<String, String>) -> Result<Self> {
        let path = folder.join(NAME);
        Self::open_file(folder, &path, settings).with_context(|| format!("the journal {}", path.display()))
    }

    fn open_file(folder: &Path, path: &Path, settings: &BTreeMap<String, String>) -> Result<Self> {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
        let mut file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)?;
        file.try_lock().map_err(|_| anyhow::anyhow!("another process works on it"))?;
        let text = match std::fs::read_to_string(path) {
            Err(error) if error.kind() == ErrorKind::InvalidData => bail!("it is no text"),
            text => text?,
        };
        let whole = text.rfind('\n').map_or(0, |end| end + 1);
        // What was cut short is written over.
        file.set_len(whole as u64)?;
        file.seek(std::io::SeekFrom::End(0))?;
        let mut lines = text[..whole].lines().zip(1..);
        let mut journal = Self { folder: folder.to_owned(), file, outcomes: BTreeMap::new() };
        match lines.next() {
            None => journal.write_line(&Header { settings: settings.clone() })?,
            Some((line, _)) => {
                let header: Header = serde_json::from_str(line).context("line 1: expected the settings")?;
                check(&header.settings, settings)?;
            }
        }
        for (line, number) in lines {
            let outcome: Outcome =
                serde_json::from_str(line).with_context(|| format!("line {number}: expected a run"))?;
            journal.outcomes.insert(outcome.run, outcome);
        }
        Ok(journal)
    }

    /// Where it is.
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

    /// Whether none is.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.outcomes.is_empty()
    }

    /// Writes what came of a run.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&mut self, outcome: Outcome) -> Result<()> {
        self.write_line(&outcome)
            .with_context(|| format!("cannot write {}", self.folder.join(NAME).display()))?;
        self.outcomes.insert(outcome.run, outcome);
        Ok(())
    }

    fn write_line(&mut self, line: &impl Serialize) -> Result<()> {
        let mut text = serde_json::to_string(line)?;
        text.push('\n');
        // In one piece, that at most the last line is ever cut short.
        self.file.write_all(text.as_bytes())?;
        Ok(())
    }

    /// The finished runs, in their order.
    #[must_use]
    pub fn into_outcomes(self) -> Vec<Outcome> {
        self.outcomes.into_values().collect()
    }
}

/// Refuses other settings, and names the first that differ.
fn check(old: &BTreeMap<String, String>, new: &BTreeMap<String, String>) -> Result<()> {
    const MOST_NAMED: usize = 3;
    let names = old.keys().chain(new.keys().filter(|name| !old.contains_key(*name)));
    let differing: Vec<_> = names.filter(|name| old.get(*name) != new.get(*name)).collect();
    if differing.is_empty() {
        return Ok(());
    }
    let told = differing.iter().take(MOST_NAMED).map(|name| {
        let [was, is] = [old, new].map(|settings| settings.get(*name).map_or("not there", |value| value));
        let [was, is] = around_difference(was, is);
        format!("\n  {name} was {was}, is {is}")
    });
    let told: String = told.collect();
    let more = differing.len().saturating_sub(MOST_NAMED);
    let more = if more > 0 { format!("\n  and {more} more") } else { String::new() };
    bail!("is of another study; choose another folder, or remove it:{told}{more}")
}

/// Two long texts, cut down to what is around their first difference.
fn around_difference(was: &str, is: &str) -> [String; 2] {
    const LONG: usize = 60;
    let same = was.chars().zip(is.chars()).take_while(|(a, b)| a == b).count();
    [was, is].map(|text| {
        if text.chars().count() <= LONG {
            return text.to_owned();
        }
        let begin = same.saturating_sub(LONG / 2);
        let part: String = text.chars().skip(begin).take(LONG).collect();
        let before = if begin > 0 { "\u{2026}" } else { "" };
        let after = if begin + LONG < text.chars().count() { "\u{2026}" } else { "" };
        format!("{before}{part}{after}")
    })
}
