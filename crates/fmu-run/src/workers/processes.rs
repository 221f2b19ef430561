//! Processes that run FMUs for this one, each with a temporary folder, which end with it.

use std::fs;
use std::io;
use std::process::Command;
use std::sync::{Arc, Mutex, Weak};

use anyhow::{Context, Result, bail};
use fmu_io::temporary::{self, Folder};
use fmu_io::threads::locked;
use fmu_master::process::{Group, adopt, end_children};

use super::loss::{ended, last_call};
use super::program::Program;
use super::protocol::{ANSWER, Answer, Numbered, PREFIX};

/// The living processes, which an interruption ends before it removes their folders.
pub struct Processes(Arc<Mutex<Vec<Weak<Group>>>>);

impl Processes {
    pub fn new() -> Self {
        adopt();
        let processes = Self(Arc::default());
        let living = Arc::downgrade(&processes.0);
        temporary::when_interrupted(move || {
            if let Some(living) = living.upgrade() {
                locked(&living).iter().filter_map(Weak::upgrade).for_each(|group| group.end());
                end_children();
            }
        });
        processes
    }

    /// Starts a program with a temporary folder of its own, which also remains this process's to remove.
    pub fn start(&self, program: &Program, adapt: impl FnOnce(&mut Command)) -> Result<(Arc<Group>, Folder)> {
        let folder = Folder::filled(PREFIX, |_| Ok::<_, io::Error>(())).context("no temporary folder")?;
        let mut command = Command::new(&program.path);
        command.args(&program.arguments);
        for variable in ["TMPDIR", "TMP", "TEMP"] {
            command.env(variable, folder.path());
        }
        adapt(&mut command);
        let mut living = locked(&self.0);
        if temporary::is_interrupted() {
            drop(living);
            temporary::leave_to_interruption();
            bail!("interrupted");
        }
        let group = Group::spawn(command).with_context(|| format!("cannot start {}", program.path.display()));
        let group = Arc::new(group?);
        living.retain(|group| group.strong_count() > 0);
        living.push(Arc::downgrade(&group));
        Ok((group, folder))
    }
}

/// Runs a program that [works once](super::work_once), with this one's standard streams. Ends what it has started.
///
/// # Errors
/// When the program fails, or ends without an answer.
pub fn supervised(program: &Program) -> Result<()> {
    let processes = Processes::new();
    let (group, folder) = processes.start(program, |_| ())?;
    let status = group.wait()?;
    end_children();
    temporary::leave_to_interruption();
    let answer = fs::read(folder.path().join(ANSWER)).unwrap_or_default();
    match serde_json::from_slice(&answer) {
        Ok(Numbered { content: Answer::Done { result: (), .. }, .. }) => Ok(()),
        Ok(Numbered { content: Answer::Failed(error) | Answer::Ends(error), .. }) => bail!(error),
        Err(_) => bail!(ended(status, last_call(&folder))),
    }
}
