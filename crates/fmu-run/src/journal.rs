//! The journal of a long task: the parts that began and that are finished, line by line, from which an interrupted task
//! resumes.
//!
//! The first line has the task's identity, each other line a part that begins or is finished, as JSON. A truncated last
//! line is ignored.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard};

use anyhow::{Context, Result, bail};
use fmu_io::reading::{self, LARGEST_CONTENT, up_to};
use fmu_io::temporary::{is_interrupted, leave_to_interruption, when_interrupted};
pub use fmu_master::scenario::Identity;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use fmu_io::threads::locked;

/// The form of journals that this program writes.
const FORM: u32 = 3;

#[derive(Serialize, Deserialize)]
struct Header {
    /// The journal's form: none before parts were noted when they begin, 2 when the identity lacked parts.
    form: Option<u32>,
    #[serde(default)]
    identity: Identity,
}

/// A line after the first.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Line<K, P> {
    Begun(K),
    Finished(P),
    /// Parts that neither finished nor ended the command: the user interrupted them, or the task failed.
    Interrupted(Vec<K>),
}

/// A part of a task.
pub trait Part: Clone + Send + Sync + Serialize + DeserializeOwned + 'static {
    /// What tells the part from others.
    type Key: Clone + Ord + Send + Sync + Serialize + DeserializeOwned;

    /// The part's key.
    fn key(&self) -> Self::Key;
}

/// An open journal. Several threads may use it.
pub struct Journal<P: Part> {
    path: PathBuf,
    state: Arc<Mutex<State<P>>>,
    /// How often parts began that did not end, when the journal was opened.
    begun: BTreeMap<P::Key, usize>,
}

struct State<P: Part> {
    file: File,
    running: BTreeSet<P::Key>,
    finished: BTreeMap<P::Key, P>,
}

impl<P: Part> Journal<P> {
    /// Opens or creates a journal.
    ///
    /// # Errors
    /// When it cannot be read or written, belongs to another identity, is damaged, or another process uses it.
    pub fn open(path: &Path, identity: &Identity) -> Result<Self> {
        let journal =
            Self::open_file(path, identity).with_context(|| format!("the journal {}", path.display()))?;
        let state = Arc::downgrade(&journal.state);
        when_interrupted(move || {
            let Some(state) = state.upgrade() else { return };
            let mut state = locked(&state);
            let running = state.running.iter().cloned().collect();
            // Without it they are tried once more, alone.
            let _ = state.write(&Line::<_, P>::Interrupted(running));
        });
        Ok(journal)
    }

    fn open_file(path: &Path, identity: &Identity) -> Result<Self> {
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
            let header: Header = serde_json::from_str(line).context("line 1: expected the identity")?;
            if header.form != Some(FORM) {
                bail!(
                    "another version of this program wrote it, in another form; choose another folder, or remove it"
                );
            }
            check(&header.identity, identity)?;
        }
        let (mut begun, mut finished) = (BTreeMap::<P::Key, usize>::new(), BTreeMap::new());
        for (line, number) in lines {
            match serde_json::from_str(line).with_context(|| format!("line {number} is damaged"))? {
                Line::Begun(key) => *begun.entry(key).or_default() += 1,
                Line::Finished(part) => {
                    let part: P = part;
                    begun.remove(&part.key());
                    finished.insert(part.key(), part);
                }
                Line::Interrupted(keys) => {
                    for key in keys {
                        begun.entry(key).and_modify(|times| *times = times.saturating_sub(1));
                    }
                }
            }
        }
        // The truncated last line is overwritten.
        file.set_len(whole as u64)?;
        file.seek(SeekFrom::End(0))?;
        let mut state = State { file, running: BTreeSet::new(), finished };
        if header.is_none() {
            state.write(&Header { form: Some(FORM), identity: identity.clone() })?;
        }
        Ok(Self { path: path.to_owned(), state: Arc::new(Mutex::new(state)), begun })
    }

    /// The finished parts.
    #[must_use]
    pub fn finished(&self) -> Vec<P> {
        self.state().finished.values().cloned().collect()
    }

    /// A finished part.
    #[must_use]
    pub fn part(&self, key: &P::Key) -> Option<P> {
        self.state().finished.get(key).cloned()
    }

    /// How often a part began and did not end, when the journal was opened.
    #[must_use]
    pub fn times_begun(&self, key: &P::Key) -> usize {
        self.begun.get(key).copied().unwrap_or_default()
    }

    /// Notes that a part begins.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn begin(&self, key: &P::Key) -> Result<()> {
        let mut state = self.state();
        state.running.insert(key.clone());
        self.writing(state.write(&Line::<_, P>::Begun(key)))
    }

    /// Notes that a part that began will not be finished now, through no fault of its own.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn interrupt(&self, key: &P::Key) -> Result<()> {
        let mut state = self.state();
        state.running.remove(key);
        self.writing(state.write(&Line::<_, P>::Interrupted(vec![key])))
    }

    /// Has a finished part done again, as a file of its results is gone.
    pub fn forget(&self, key: &P::Key) {
        self.state().finished.remove(key);
    }

    /// Notes that a part is finished.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn finish(&self, part: P) -> Result<()> {
        let mut state = self.state();
        state.running.remove(&part.key());
        self.writing(state.write(&Line::<P::Key, _>::Finished(&part)))?;
        state.finished.insert(part.key(), part);
        Ok(())
    }

    fn writing(&self, written: Result<()>) -> Result<()> {
        written.with_context(|| format!("cannot write {}", self.path.display()))
    }

    /// The journal's state; after an interruption, nobody gets it.
    fn state(&self) -> MutexGuard<'_, State<P>> {
        loop {
            let state = locked(&self.state);
            if !is_interrupted() {
                return state;
            }
            drop(state);
            leave_to_interruption();
        }
    }
}

impl<P: Part> State<P> {
    /// Appends a line.
    fn write(&mut self, line: &impl Serialize) -> Result<()> {
        let text = serde_json::to_string(line)? + "\n";
        let file = &mut self.file;
        let whole = file.stream_position()?;
        // In one piece, so that only the last line can be truncated.
        file.write_all(text.as_bytes()).inspect_err(|_| {
            // More may be written; if this fails too, the next opening reports it.
            let _ = file.set_len(whole).and_then(|()| file.seek(SeekFrom::Start(whole)));
        })?;
        Ok(())
    }
}

/// Rejects other settings and names the first differences.
fn check(old: &Identity, new: &Identity) -> Result<()> {
    const MOST_NAMED: usize = 3;
    let names = old.keys().chain(new.keys().filter(|name| !old.contains_key(*name)));
    let differing: Vec<_> = names.filter(|name| old.get(*name) != new.get(*name)).collect();
    if differing.is_empty() {
        return Ok(());
    }
    let lines = differing.iter().take(MOST_NAMED).map(|name| {
        let [was, is] = [old, new].map(|identity| identity.get(*name).map_or("not there", |value| value));
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

    fn identity(voltage: &str) -> Identity {
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
        let journal = Journal::open(&path, &identity("12")).unwrap();
        assert_eq!(journal.finished().len(), 0);
        journal.finish(results()).unwrap();
        drop(journal);
        let whole = fs::read_to_string(&path).unwrap();
        // An interruption cut off the next line, in the second case within a character.
        for cut in [b"{\"finished\":[4.2,1".as_slice(), b"{\"finished\":[\"1 \xc2"] {
            fs::write(&path, [whole.as_bytes(), cut].concat()).unwrap();
            let journal = Journal::open(&path, &identity("12")).unwrap();
            assert_eq!(journal.part(&3), Some(results()));
            journal.finish(vec![1.0]).unwrap();
            drop(journal);
            assert_eq!(fs::read_to_string(&path).unwrap(), whole.clone() + "{\"finished\":[1.0]}\n");
        }
    }

    /// The message when a journal is refused, which must not change it.
    fn refusal(text: &str, voltage: &str) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal.jsonl");
        drop(Journal::<Vec<f64>>::open(&path, &identity("12")).unwrap());
        let text = fs::read_to_string(&path).unwrap() + text;
        fs::write(&path, &text).unwrap();
        let error = Journal::<Vec<f64>>::open(&path, &identity(voltage)).err().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), text);
        format!("{error:#}")
    }

    #[test]
    fn other_settings_are_refused_by_name() {
        let message = refusal("{\"finished\":[1.0]}\n{", "13");
        assert!(message.ends_with("or remove it:\n  voltage was 12, is 13"), "{message}");
    }

    /// The former form had no lines for parts that begin.
    #[test]
    fn a_journal_of_the_former_form_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal.jsonl");
        fs::write(&path, "{\"form\":2,\"settings\":{\"plant\":\"BoostPlant\",\"voltage\":\"12\"}}\n[1.0]\n")
            .unwrap();
        let error = Journal::<Vec<f64>>::open(&path, &identity("12")).err().unwrap();
        assert!(
            format!("{error:#}").contains("wrote it, in another form; choose another folder"),
            "{error:#}"
        );
    }

    #[test]
    fn a_damaged_line_is_named() {
        let message = refusal("{\"finished\":[1.0]}\n[2.\n{\"begun\":3}\n{", "12");
        assert!(message.contains("journal.jsonl: line 3 is damaged"), "{message}");
    }

    #[test]
    fn a_journal_is_locked_by_its_process() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal.jsonl");
        let _journal = Journal::<Vec<f64>>::open(&path, &identity("12")).unwrap();
        let error = Journal::<Vec<f64>>::open(&path, &identity("12")).err().unwrap();
        assert!(format!("{error:#}").ends_with("another process uses it"), "{error:#}");
    }
}
