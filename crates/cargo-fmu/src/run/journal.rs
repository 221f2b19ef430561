//! The journal of a long task: the finished parts, line by line, from which an interrupted task resumes.
//!
//! The first line has the task's settings, each other line a finished part, as JSON. A truncated last line is ignored.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use anyhow::{Context, Result, bail};
use fmu_io::reading::{self, LARGEST_CONTENT, up_to};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// Everything the results depend on, by name.
pub type Settings = BTreeMap<String, String>;

/// The SHA-256 of a file that results depend on.
///
/// # Errors
/// When a file cannot be read.
pub fn digest(path: &Path) -> Result<String> {
    Ok(Sha256::digest(reading::bytes(path)?)
        .iter()
        .fold(String::new(), |text, byte| text + &format!("{byte:02x}")))
}

#[derive(Serialize, Deserialize)]
struct Header {
    settings: Settings,
}

/// A part of a task.
pub trait Part: Clone + Serialize + DeserializeOwned {
    /// What tells it from the other parts.
    type Key: Ord;

    /// Its key.
    fn key(&self) -> Self::Key;
}

/// An open journal. Several threads may use it.
pub struct Journal<P: Part> {
    path: PathBuf,
    file: Mutex<File>,
    /// The parts that were finished when it was opened.
    finished: BTreeMap<P::Key, P>,
}

impl<P: Part> Journal<P> {
    /// Opens or creates a journal.
    ///
    /// # Errors
    /// When it cannot be read or written, belongs to other settings, is damaged, or another process uses it.
    pub fn open(path: &Path, settings: &Settings) -> Result<Self> {
        Self::open_file(path, settings).with_context(|| format!("the journal {}", path.display()))
    }

    fn open_file(path: &Path, settings: &Settings) -> Result<Self> {
        let mut file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => bail!("another process uses it"),
            Err(TryLockError::Error(error)) => return Err(error.into()),
        }
        if !file.metadata()?.is_file() {
            bail!("it is not a file");
        }
        // A line for each of a million runs exceeds the limit for texts.
        let mut text = up_to(LARGEST_CONTENT, &file)?;
        // The truncated last line may end within a character.
        let whole = text.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
        text.truncate(whole);
        let text = reading::utf_8(text)?;
        let mut lines = text.lines().zip(1..);
        let header = lines.next();
        if let Some((line, _)) = header {
            let header: Header = serde_json::from_str(line).context("line 1: expected the settings")?;
            check(&header.settings, settings)?;
        }
        let finished = lines.map(|(line, number)| {
            let part: P = serde_json::from_str(line).with_context(|| format!("line {number} is damaged"))?;
            Ok((part.key(), part))
        });
        let finished = finished.collect::<Result<_>>()?;
        // The truncated last line is overwritten.
        file.set_len(whole as u64)?;
        file.seek(SeekFrom::End(0))?;
        let journal = Self { path: path.to_owned(), file: Mutex::new(file), finished };
        if header.is_none() {
            journal.write(&Header { settings: settings.clone() })?;
        }
        Ok(journal)
    }

    /// The parts that were finished when it was opened.
    pub fn finished(&self) -> impl ExactSizeIterator<Item = &P> {
        self.finished.values()
    }

    /// A part that was finished when the journal was opened; any other is finished now, and written.
    ///
    /// # Errors
    /// When the part fails, or cannot be written.
    pub fn part(&self, key: &P::Key, finish: impl FnOnce() -> Result<P>) -> Result<P> {
        if let Some(part) = self.finished.get(key) {
            return Ok(part.clone());
        }
        let part = finish()?;
        self.write(&part)?;
        Ok(part)
    }

    /// Appends a line.
    fn write(&self, line: &impl Serialize) -> Result<()> {
        let text = serde_json::to_string(line)? + "\n";
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let mut write = || {
            let whole = file.stream_position()?;
            // In one piece, so that only the last line can be truncated.
            file.write_all(text.as_bytes()).inspect_err(|_| {
                // Another thread may write more; if this fails too, the next opening reports it.
                let _ = file.set_len(whole).and_then(|()| file.seek(SeekFrom::Start(whole)));
            })
        };
        write().with_context(|| format!("cannot write {}", self.path.display()))
    }
}

/// Rejects other settings and names the first differences.
fn check(old: &Settings, new: &Settings) -> Result<()> {
    const MOST_NAMED: usize = 3;
    let names = old.keys().chain(new.keys().filter(|name| !old.contains_key(*name)));
    let differing: Vec<_> = names.filter(|name| old.get(*name) != new.get(*name)).collect();
    if differing.is_empty() {
        return Ok(());
    }
    let lines = differing.iter().take(MOST_NAMED).map(|name| {
        let [was, is] = [old, new].map(|settings| settings.get(*name).map_or("not there", |value| value));
        let [was, is] = around_difference(was, is);
        format!("\n  {name} was {was}, is {is}")
    });
    let lines: String = lines.collect();
    let more = differing.len().saturating_sub(MOST_NAMED);
    let more = if more > 0 { format!("\n  and {more} more") } else { String::new() };
    bail!("it was written with other settings; choose another folder, or remove it:{lines}{more}")
}

/// Two long texts, shortened to the surroundings of their first difference.
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

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn settings(voltage: &str) -> Settings {
        [("plant", "BoostPlant"), ("voltage", voltage)]
            .map(|(name, value)| (name.into(), value.into()))
            .into()
    }

    impl Part for Vec<f64> {
        type Key = usize;

        fn key(&self) -> usize {
            self.len()
        }
    }

    /// Numbers without a short decimal form.
    fn results() -> Vec<f64> {
        vec![125_963.1 / 3.0, -1e-17, 0.1 + 0.2]
    }

    #[test]
    fn finished_results_are_read_back_to_the_last_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal.jsonl");
        let journal = Journal::open(&path, &settings("12")).unwrap();
        assert_eq!(journal.finished().len(), 0);
        assert_eq!(journal.part(&3, || Ok(results())).unwrap(), results());
        drop(journal);
        let whole = fs::read_to_string(&path).unwrap();
        // An interruption cut off the next line, in the second case within a character.
        for cut in [b"[4.2,1".as_slice(), b"[\"1 \xc2"] {
            fs::write(&path, [whole.as_bytes(), cut].concat()).unwrap();
            let journal = Journal::open(&path, &settings("12")).unwrap();
            assert_eq!(journal.part(&3, || bail!("it is finished")).unwrap(), results());
            journal.part(&1, || Ok(vec![1.0])).unwrap();
            drop(journal);
            assert_eq!(fs::read_to_string(&path).unwrap(), whole.clone() + "[1.0]\n");
        }
    }

    /// The message when a journal is refused, which must not change it.
    fn refusal(text: &str, voltage: &str) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal.jsonl");
        drop(Journal::<Vec<f64>>::open(&path, &settings("12")).unwrap());
        let text = fs::read_to_string(&path).unwrap() + text;
        fs::write(&path, &text).unwrap();
        let error = Journal::<Vec<f64>>::open(&path, &settings(voltage)).err().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), text);
        format!("{error:#}")
    }

    #[test]
    fn other_settings_are_refused_by_name() {
        let message = refusal("[1.0]\n[2.", "13");
        assert!(message.ends_with("or remove it:\n  voltage was 12, is 13"), "{message}");
    }

    #[test]
    fn a_damaged_line_is_named() {
        let message = refusal("[1.0]\n[2.\n[3.0]\n[4", "12");
        assert!(message.contains("journal.jsonl: line 3 is damaged"), "{message}");
    }

    #[test]
    fn a_journal_is_locked_by_its_process() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal.jsonl");
        let _journal = Journal::<Vec<f64>>::open(&path, &settings("12")).unwrap();
        let error = Journal::<Vec<f64>>::open(&path, &settings("12")).err().unwrap();
        assert!(format!("{error:#}").ends_with("another process uses it"), "{error:#}");
    }
}
