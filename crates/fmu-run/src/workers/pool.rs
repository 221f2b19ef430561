//! The workers of a task, among which its jobs are shared.

use std::collections::VecDeque;
use std::io::{BufRead as _, BufReader, Write as _};
use std::process::{ChildStdin, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Error, Result, anyhow, bail};
use fmu_io::temporary::{self, Folder};
use fmu_io::threads::{self, each, locked};
use fmu_master::process::{Group, end_children};
use serde::Serialize;
use serde::de::{DeserializeOwned, IgnoredAny};
use serde_json::Value;

use super::loss::{Lost, ended, last_call, status_within};
use super::processes::Processes;
use super::program::{Program, WorkerArguments};
use super::protocol::{Answer, Numbered};
use crate::journal::{Journal, Part};

/// A worker without a job ends within this time; it only unloads its FMUs.
const ENDS_WITHIN: Duration = Duration::from_secs(10);
/// A process whose output is closed ends within this time, unless an FMU has closed it.
const ENDS_SOON: Duration = Duration::from_secs(1);
/// The most of a line that a message shows.
const MOST_SHOWN: usize = 60;

/// The processes that work for this one.
pub struct Workers<'a> {
    program: &'a Program,
    number: usize,
    limit: Duration,
    processes: Processes,
    idle: Mutex<Vec<Worker>>,
    /// How each worker must begin.
    opening: Value,
}

/// A worker.
struct Worker {
    group: Arc<Group>,
    jobs: ChildStdin,
    output: Receiver<Output>,
    /// The number of the last job.
    number: u64,
    folder: Folder,
}

/// What a line of a worker's output is.
enum Received<R> {
    /// The answer to the last job.
    Answer(Answer<R>),
    /// A second answer to an earlier job, of a process that an FMU has forked.
    Earlier,
    /// No answer.
    Garbled,
}

impl Worker {
    /// What a line of the worker's output is.
    fn received<R: DeserializeOwned>(&self, line: &[u8]) -> Received<R> {
        match serde_json::from_slice(line) {
            Ok(Numbered::<IgnoredAny> { number, .. }) if number < self.number => Received::Earlier,
            Ok(Numbered { number, .. }) if number == self.number => serde_json::from_slice(line)
                .map_or(Received::Garbled, |Numbered { content, .. }| Received::Answer(content)),
            _ => Received::Garbled,
        }
    }

    /// Asks for a job, or the end.
    fn ask<J: Serialize>(&mut self, content: Option<J>) -> Result<()> {
        self.number += 1;
        let line = serde_json::to_string(&Numbered { number: self.number, content })? + "\n";
        // A worker that is gone does not answer either.
        let _ = self.jobs.write_all(line.as_bytes());
        Ok(())
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.group.end();
    }
}

/// What comes from a worker.
enum Output {
    Line(Vec<u8>),
    /// The process has ended; what it has left behind may keep the pipe open.
    End,
}

impl<'a> Workers<'a> {
    /// Starts the first worker; returns also how it opened.
    ///
    /// # Errors
    /// When the program cannot be started, or cannot prepare its task.
    pub fn open<O: DeserializeOwned>(program: &'a Program, arguments: &WorkerArguments) -> Result<(Self, O)> {
        let number = threads::number(arguments.number);
        let limit = Duration::from_secs_f64(arguments.time_limit);
        let mut workers = Self {
            program,
            number,
            limit,
            processes: Processes::new(),
            idle: Mutex::default(),
            opening: Value::Null,
        };
        let (worker, opening) = workers.start()?.map_err(|lost| anyhow!("cannot load the FMUs: {lost}"))?;
        workers.opening = match opening {
            Answer::Done { result, .. } => result,
            Answer::Failed(error) | Answer::Ends(error) => bail!(error),
        };
        let opened = serde_json::from_value(workers.opening.clone()).context("a worker's opening")?;
        locked(&workers.idle).push(worker);
        Ok((workers, opened))
    }

    /// Starts a worker; returns also how it opened.
    fn start(&self) -> Result<Result<(Worker, Answer<Value>), Lost>> {
        let (group, folder) = self.processes.start(self.program, |command| {
            command.stdin(Stdio::piped()).stdout(Stdio::piped());
        })?;
        let (jobs, output) = group.child(|child| (child.stdin.take(), child.stdout.take()));
        let (jobs, output) = jobs.zip(output).context("no pipes")?;
        let (sender, received) = mpsc::channel();
        let (ending, ended) = (Arc::clone(&group), sender.clone());
        thread::spawn(move || {
            // It also ends what the process has left behind.
            let _ = ending.wait();
            let _ = ended.send(Output::End);
        });
        thread::spawn(move || {
            for line in BufReader::new(output).split(b'\n').map_while(Result::ok) {
                if sender.send(Output::Line(line)).is_err() {
                    break;
                }
            }
        });
        let mut worker = Worker { group, jobs, output: received, number: 0, folder };
        Ok(self.await_answer(&mut worker).map(|opening| (worker, opening)))
    }

    /// The answer to the last job; else why there is none.
    fn await_answer<R: DeserializeOwned>(&self, worker: &mut Worker) -> Result<Answer<R>, Lost> {
        let mut deadline = Instant::now() + self.limit;
        let mut has_ended = false;
        let lost = loop {
            match worker.output.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
                Ok(Output::Line(line)) => match worker.received(&line) {
                    Received::Answer(answer) => return Ok(answer),
                    Received::Earlier => {}
                    Received::Garbled => {
                        let shown = String::from_utf8_lossy(&line).chars().take(MOST_SHOWN).collect();
                        break Lost::Garbled(shown, last_call(&worker.folder));
                    }
                },
                // Its last answer may still come.
                Ok(Output::End) => (has_ended, deadline) = (true, Instant::now() + ENDS_SOON),
                Err(RecvTimeoutError::Timeout) if !has_ended => {
                    break Lost::InTime(self.limit, last_call(&worker.folder));
                }
                Err(_) => {
                    break match status_within(ENDS_SOON, &worker.group) {
                        Some(status) => Lost::WithWorker(ended(status, last_call(&worker.folder))),
                        None => Lost::Closed(last_call(&worker.folder)),
                    };
                }
            }
        };
        worker.group.end();
        // An interruption ends workers, too.
        temporary::leave_to_interruption();
        Err(lost)
    }

    /// Has a job done.
    fn run<J: Serialize, R: DeserializeOwned>(&self, job: &J) -> Result<Result<R, Lost>> {
        let used = locked(&self.idle).pop();
        if let Some(worker) = used {
            let result = self.run_in(worker, job)?;
            // Otherwise the cause may be what an earlier job left, such as a thread.
            if matches!(result, Ok(_) | Err(Lost::InTime(..))) {
                return Ok(result);
            }
        }
        let (worker, opening) = match self.start()? {
            Ok(started) => started,
            Err(lost) => return Ok(Err(lost)),
        };
        match opening {
            Answer::Done { result, .. } if result == self.opening => self.run_in(worker, job),
            Answer::Done { .. } => bail!("the task's files have changed while it ran"),
            Answer::Failed(error) | Answer::Ends(error) => Ok(Err(Lost::WithWorker(error))),
        }
    }

    fn run_in<J: Serialize, R: DeserializeOwned>(
        &self,
        mut worker: Worker,
        job: &J,
    ) -> Result<Result<R, Lost>> {
        worker.ask(Some(job))?;
        Ok(match self.await_answer(&mut worker) {
            Ok(Answer::Done { result, is_clean }) => {
                if is_clean {
                    locked(&self.idle).push(worker);
                } else {
                    Self::dismiss(worker);
                }
                Ok(result)
            }
            Ok(Answer::Failed(error) | Answer::Ends(error)) => Err(Lost::WithWorker(error)),
            Err(lost) => Err(lost),
        })
    }

    /// Lets a worker unload its FMUs and end.
    fn dismiss(mut worker: Worker) {
        if worker.ask(None::<()>).is_ok() {
            let _ = status_within(ENDS_WITHIN, &worker.group);
        }
    }

    /// Runs the parts of a task that its journal lacks, and returns all in their order. `failed` makes a part of the
    /// reason for which its worker ended; `progress` is called for each part that ends.
    ///
    /// A part that began before, but did not end as its process did, is tried once more, alone.
    ///
    /// # Errors
    /// When a part cannot be run or written, or `failed` fails.
    pub fn finish<P: Part, J: Serialize + Sync>(
        &self,
        journal: &Journal<P>,
        jobs: &[(P::Key, J)],
        failed: impl Fn(&P::Key, String) -> Result<P> + Sync,
        progress: impl Fn(&P) + Sync,
    ) -> Result<Vec<P>> {
        let attempt = |(key, job): &(P::Key, J)| {
            let result = if journal.times_begun(key) > 1 {
                Err("it began twice, and both times the command ended before it did".to_owned())
            } else {
                journal.begin(key)?;
                self.run(job)?.map_err(|lost| lost.to_string())
            };
            result.or_else(|reason| failed(key, reason))
        };
        let part = |job: &(P::Key, J)| {
            let part = attempt(job).or_else(|error| journal.interrupt(&job.0).and(Err(error)))?;
            journal.finish(part.clone())?;
            progress(&part);
            Ok::<_, Error>(())
        };
        let missing = jobs.iter().filter(|(key, _)| journal.part(key).is_none());
        let (suspected, others): (VecDeque<_>, VecDeque<_>) =
            missing.partition(|(key, _)| journal.times_begun(key) > 0);
        suspected.into_iter().try_for_each(part)?;
        each(self.number, others, part)?;
        jobs.iter().map(|(key, _)| journal.part(key).context("a part is missing")).collect()
    }
}

impl Drop for Workers<'_> {
    fn drop(&mut self) {
        locked(&self.idle).drain(..).for_each(Self::dismiss);
        end_children();
    }
}
