//! The journal: each sweep and each point of the grid as soon as it is finished, a line of JSON each, so that an
//! interrupted tuning goes on where it was. The first line holds the settings, which must stay the same.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};

use super::bench::{Point, Sweep};
use super::procedure::Procedure;

/// What determines the results.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// The laboratory's version.
    pub version: String,
    /// The plant: its name, and the CRC-32 of its file.
    pub plant: String,
    /// The plant's parameters.
    pub plant_parameters: Vec<String>,
    /// The columns (rpm).
    pub engine_speeds: Vec<f64>,
    /// The rows (Pa).
    pub boost_references: Vec<f64>,
    /// In V.
    pub nominal_voltage: f64,
    /// In s.
    pub sample_time: f64,
    /// What is done to the plant.
    pub procedure: Procedure,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Entry {
    Settings(Settings),
    Sweep(Sweep),
    Point(Point),
}

/// A journal that is open, and what it held.
pub struct Journal {
    path: PathBuf,
    file: Mutex<File>,
    sweeps: Vec<Sweep>,
    points: Vec<Point>,
}

impl Journal {
    /// Opens a journal, or begins it where there is none.
    ///
    /// # Errors
    /// When it was begun with other settings, which the message names; when it is damaged; when another process
    /// has it open.
    pub fn open(path: &Path, settings: &Settings) -> Result<Self> {
        Self::open_anonymous(path, settings).with_context(|| format!("the journal {}", path.display()))
    }

    fn open_anonymous(path: &Path, settings: &Settings) -> Result<Self> {
        let mut file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => bail!("another process tunes with it"),
            Err(TryLockError::Error(error)) => return Err(error.into()),
        }
        let text = fs::read_to_string(path)?;
        // A line without an end is one that an interruption cut off.
        let whole = text.rfind('\n').map_or(0, |end| end + 1);
        let mut journal = (vec![], vec![]);
        for (index, line) in text[..whole].lines().enumerate() {
            let entry =
                serde_json::from_str(line).with_context(|| format!("line {} is damaged", index + 1))?;
            match entry {
                Entry::Settings(begun) if index == 0 => compare(&begun, settings)?,
                Entry::Sweep(sweep) if index > 0 => journal.0.push(sweep),
                Entry::Point(point) if index > 0 => journal.1.push(point),
                _ => bail!(
                    "line {} does not belong there: the first line, and no other, is the settings",
                    index + 1
                ),
            }
        }
        file.set_len(whole as u64)?;
        file.seek(SeekFrom::End(0))?;
        let (sweeps, points) = journal;
        let journal = Self { path: path.to_owned(), file: Mutex::new(file), sweeps, points };
        if whole == 0 {
            journal.write(&Entry::Settings(settings.clone()))?;
        }
        Ok(journal)
    }

    /// The sweep at the engine speed of a column, if it was finished when the journal was opened.
    #[must_use]
    pub fn sweep(&self, column: usize) -> Option<&Sweep> {
        self.sweeps.iter().find(|sweep| sweep.column == column)
    }

    /// A point, if it was finished when the journal was opened.
    #[must_use]
    pub fn point(&self, row: usize, column: usize) -> Option<&Point> {
        self.points.iter().find(|point| (point.row, point.column) == (row, column))
    }

    /// How many sweeps and points were finished when the journal was opened.
    #[must_use]
    pub fn finished(&self) -> (usize, usize) {
        (self.sweeps.len(), self.points.len())
    }

    /// Writes a sweep that is finished.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_sweep(&self, sweep: &Sweep) -> Result<()> {
        self.write(&Entry::Sweep(sweep.clone()))
    }

    /// Writes a point that is finished.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_point(&self, point: &Point) -> Result<()> {
        self.write(&Entry::Point(point.clone()))
    }

    fn write(&self, entry: &Entry) -> Result<()> {
        let line = serde_json::to_string(entry)? + "\n";
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.write_all(line.as_bytes())
            .with_context(|| format!("the journal {} cannot be written", self.path.display()))
    }
}

/// Refuses settings that differ.
fn compare(begun: &Settings, now: &Settings) -> Result<()> {
    let [begun, now] = [begun, now].map(serde_json::to_value);
    let (begun, now) = (begun?, now?);
    let names = now.as_object().into_iter().flatten().map(|(name, _)| name);
    let differences: Vec<_> = names
        .filter(|name| begun[*name] != now[*name])
        .map(|name| format!("{name} {}, now {}", begun[name], now[name]))
        .collect();
    if differences.is_empty() {
        return Ok(());
    }
    bail!(
        "it was begun with other settings: {}; give --out another folder, or remove the journal to begin anew",
        differences.join("; ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> Settings {
        Settings {
            version: "1".to_owned(),
            plant: "Plant 00c0ffee".to_owned(),
            plant_parameters: vec![],
            engine_speeds: vec![1000.0, 0.1 + 0.2],
            boost_references: vec![1.1e5],
            nominal_voltage: 12.0,
            sample_time: 0.0125,
            procedure: Procedure::default(),
        }
    }

    fn sweep(column: usize) -> Sweep {
        let hold = super::super::bench::Hold { duty: 44.0, boost_pressure: 125_963.1 / 3.0, drift: -1e-17 };
        Sweep { column, holds: vec![hold] }
    }

    #[test]
    fn what_was_finished_is_there_again_to_the_last_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal.jsonl");
        let journal = Journal::open(&path, &settings()).unwrap();
        assert_eq!(journal.finished(), (0, 0));
        journal.write_sweep(&sweep(3)).unwrap();
        drop(journal);
        // An interruption cut off the next line.
        let mut text = fs::read_to_string(&path).unwrap();
        text += "{\"sweep\":{\"column\":4,\"ho";
        fs::write(&path, &text).unwrap();
        let journal = Journal::open(&path, &settings()).unwrap();
        assert_eq!(journal.sweep(3), Some(&sweep(3)));
        assert_eq!(journal.sweep(4), None);
        journal.write_sweep(&sweep(4)).unwrap();
        drop(journal);
        let journal = Journal::open(&path, &settings()).unwrap();
        assert_eq!(journal.sweep(4), Some(&sweep(4)));
        assert_eq!(journal.finished(), (2, 0));
    }

    #[test]
    fn other_settings_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal.jsonl");
        drop(Journal::open(&path, &settings()).unwrap());
        let other = Settings { nominal_voltage: 13.0, plant: "Plant 0".to_owned(), ..settings() };
        let refusal = format!("{:#}", Journal::open(&path, &other).err().unwrap());
        assert!(
            refusal.ends_with(
                "it was begun with other settings: nominal_voltage 12.0, now 13.0; plant \"Plant 00c0ffee\", now \
                 \"Plant 0\"; give --out another folder, or remove the journal to begin anew"
            ),
            "{refusal}"
        );
    }

    #[test]
    fn damage_is_refused_by_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal.jsonl");
        drop(Journal::open(&path, &settings()).unwrap());
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, text.clone() + "{\"sweep\":1}\n").unwrap();
        let refusal = format!("{:#}", Journal::open(&path, &settings()).err().unwrap());
        assert!(refusal.contains("journal.jsonl: line 2 is damaged"), "{refusal}");
        fs::write(&path, text.clone() + &text).unwrap();
        let refusal = format!("{:#}", Journal::open(&path, &settings()).err().unwrap());
        assert!(refusal.contains("line 2 does not belong there"), "{refusal}");
    }

    #[test]
    fn a_journal_is_of_one_process() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal.jsonl");
        let _journal = Journal::open(&path, &settings()).unwrap();
        let refusal = format!("{:#}", Journal::open(&path, &settings()).err().unwrap());
        assert!(refusal.ends_with("another process tunes with it"), "{refusal}");
    }
}
