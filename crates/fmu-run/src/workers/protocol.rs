//! What a process and its workers write to each other.

use std::fs::{self, File};
use std::io::Write;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use anyhow::{Context, Result};
use fmu_io::threads::locked;
use fmu_master::when_an_fmu_exits;
use serde::{Deserialize, Serialize};

/// The temporary folders of workers.
pub const PREFIX: &str = ".worker-of-cargo-fmu-";
/// The answer of a process that answers once, in its temporary folder.
pub const ANSWER: &str = "answer";
/// The last call to an FMU, in a worker's temporary folder.
pub const LAST_CALL: &str = "last_call";

/// A job or an answer. The opening of a worker answers number 0.
#[derive(Serialize, Deserialize)]
pub struct Numbered<T> {
    pub number: u64,
    pub content: T,
}

/// An answer. The last one of a process that is ending by an FMU's wish is an error.
#[derive(Serialize, Deserialize)]
pub enum Answer<T> {
    Done {
        result: T,
        /// Whether the process is as it was before.
        is_clean: bool,
    },
    Failed(String),
    /// An FMU ends the process.
    Ends(String),
}

/// Where a worker answers. FMUs that end the process answer there, too.
#[derive(Clone)]
pub struct Answers(Arc<Mutex<Channel>>);

struct Channel {
    to: Target,
    /// The number of the present job.
    number: u64,
}

pub enum Target {
    Pipe(File),
    /// A file that is opened for an answer, whatever descriptors FMUs close.
    File(PathBuf),
}

impl Answers {
    pub fn new(to: Target) -> Self {
        let answers = Self(Arc::new(Mutex::new(Channel { to, number: 0 })));
        let last = answers.clone();
        when_an_fmu_exits(move |culprit| {
            // The parent notices a missing answer, and looks at no status.
            let _ = last.send(Answer::<()>::Ends(culprit.to_owned()));
            1
        });
        answers
    }

    /// From now on, answers have this number.
    pub fn begin(&self, number: u64) {
        locked(&self.0).number = number;
    }

    fn send<T: Serialize>(&self, content: Answer<T>) -> Result<()> {
        let channel = &mut *locked(&self.0);
        let text = serde_json::to_string(&Numbered { number: channel.number, content })? + "\n";
        match &mut channel.to {
            Target::Pipe(pipe) => pipe.write_all(text.as_bytes()),
            // An FMU may have removed the folder.
            Target::File(path) => {
                path.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::write(path, text))
            }
        }
        .context("cannot answer")
    }

    pub fn send_result<T: Serialize>(&self, result: Result<T>, is_clean: bool) -> Result<()> {
        self.send(match result {
            Ok(result) => Answer::Done { result, is_clean },
            Err(error) => Answer::Failed(format!("{error:#}")),
        })
    }
}
