//! What a worker does.

use std::env;
use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Write};
use std::path::PathBuf;
use std::sync::mpsc;
use std::thread;

use anyhow::{Result, bail, ensure};
use fmu_master::process::{
    Changes, contained, end_at_once, end_forks, end_own_group, take_standard_streams, tell_last_call,
};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::protocol::{ANSWER, Answers, LAST_CALL, Numbered, PREFIX, Target};

/// Works: prepares a task, answers with what `prepare` returns beside it, and does jobs: `run` calls FMUs, and `finish`
/// writes files, when the process is again one to write files in. Ends when the parent ends.
///
/// # Errors
/// When the parent cannot be answered.
pub fn work<T, O: Serialize, J: DeserializeOwned, F, R: Serialize>(
    prepare: impl FnOnce() -> Result<(T, O)>,
    run: impl Fn(&T, J) -> Result<F>,
    finish: impl Fn(&T, F) -> Result<R>,
) -> Result<()> {
    begin_work()?;
    let (input, output) = take_standard_streams()?;
    let answers = Answers::new(Target::Pipe(output));
    let (sender, jobs) = mpsc::channel();
    thread::spawn(move || {
        for job in BufReader::new(input).lines().map_while(Result::ok) {
            // Sending fails once the worker is about to end.
            let _ = sender.send(job);
        }
        end_own_group();
    });
    let mut task = None;
    let opening = prepare().map(|(prepared, opening)| {
        task = Some(prepared);
        opening
    });
    answers.send_result(opening, true)?;
    let Some(task) = task else { return Ok(()) };
    for job in jobs {
        let Numbered { number, content } = serde_json::from_str(&job)?;
        let Some(job) = content else { break };
        answers.begin(number);
        let (found, changes) = contained(|| run(&task, job));
        ensure!(changes != Changes::Descriptors, "an FMU has closed descriptors of its process");
        answers.send_result(found.and_then(|found| finish(&task, found)), changes == Changes::None)?;
    }
    drop(task);
    end_at_once(0)
}

/// Tells the parent which FMU is called, and returns the temporary folder that it gave this process.
fn begin_work() -> Result<PathBuf> {
    let folder = env::temp_dir();
    if !folder.file_name().is_some_and(|name| name.to_string_lossy().starts_with(PREFIX)) {
        bail!("only another process of this program starts a worker");
    }
    end_forks();
    // Not every file system maps files; the reason of a failure is then without the FMU.
    let _ = tell_last_call(&folder.join(LAST_CALL));
    Ok(folder)
}

/// Works for a parent that [waits for a single answer](super::supervised). Does not return when the parent has it.
///
/// # Errors
/// When the parent cannot be answered.
pub fn work_once(run: impl FnOnce() -> Result<()>) -> Result<()> {
    let folder = begin_work()?;
    let answers = Answers::new(Target::File(folder.join(ANSWER)));
    // On Windows the job ends with the parent, and a folder cannot be opened.
    if let Ok(parents) = File::open(&folder) {
        thread::spawn(move || {
            // The parent holds the lock as long as it lives.
            if parents.lock().is_ok() {
                end_own_group();
            }
        });
    }
    answers.send_result(run(), true)?;
    io::stdout().flush()?;
    end_at_once(0)
}
