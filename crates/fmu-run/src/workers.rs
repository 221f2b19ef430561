//! Workers: other processes of this program that run FMUs, so that an FMU that crashes or hangs ends its own run only.
//!
//! A worker is started with this process's own arguments, after a hidden subcommand, and prepares the same task from them.
//! It takes jobs, a JSON line each, from its standard input, and answers by its standard output; its FMUs get neither.
//! Job and answer have the same number. A process that ends without its answer has failed, whatever its status; so has a
//! job whose answer is not one, as an FMU can write to any descriptor. The parent alone writes the journal and shows the
//! progress.
//!
//! A worker goes on after a job in which its FMUs have [changed nothing](Changes) of the process. No process ends by way
//! of the handlers that FMUs have registered: they could fail after a file is written.

use std::collections::VecDeque;
use std::env;
use std::ffi::OsString;
use std::fmt;
use std::fs::{self, File};
use std::io::{self, BufRead as _, BufReader, Write};
use std::path::PathBuf;
use std::process::{ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex, Weak};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Error, Result, anyhow, bail, ensure};
use clap::Args;
use fmu_io::temporary::{self, Folder};
use fmu_io::terminal::number;
use fmu_master::process::{
    Changes, Group, LastCall, adopt, contained, end_at_once, end_children, end_forks, end_own_group,
    take_standard_streams, tell_last_call,
};
use fmu_master::when_an_fmu_exits;
use serde::de::{DeserializeOwned, IgnoredAny};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::journal::{Journal, Part};
use super::number_in;
use fmu_io::threads::{each, locked};

/// The hidden subcommand, which no help or completion shows.
const WORKER: &str = "worker";
/// The temporary folders of workers.
const PREFIX: &str = ".worker-of-cargo-fmu-";
/// The answer of a process that answers once, in its temporary folder.
const ANSWER: &str = "answer";
/// The last call to an FMU, in a worker's temporary folder.
const LAST_CALL: &str = "last_call";
/// A worker without a job ends within this time; it only unloads its FMUs.
const ENDS_WITHIN: Duration = Duration::from_secs(10);
/// A process whose output is closed ends within this time, unless an FMU has closed it.
const ENDS_SOON: Duration = Duration::from_secs(1);
/// The time between looks at whether a process has ended.
const LOOKS: Duration = Duration::from_millis(1);
/// The most of a line that a message shows.
const MOST_SHOWN: usize = 60;

/// The program that works: this one, or that of a library's caller.
#[derive(Clone, Debug)]
pub struct Program {
    /// The program.
    pub path: PathBuf,
    /// The arguments with which the program works, instead of running the command.
    pub arguments: Vec<OsString>,
}

impl Program {
    /// This program, told to work by arguments that [`told_to_work`] recognizes; `arguments` begin with its name.
    ///
    /// # Errors
    /// When the system does not tell which program this is.
    pub fn this(arguments: &[OsString]) -> Result<Self> {
        let path = env::current_exe().context("cannot find this program")?;
        let arguments = [&[WORKER.into()], arguments.get(1..).unwrap_or_default()].concat();
        Ok(Self { path, arguments })
    }
}

/// Whether the arguments of a program, which begin with its name, tell it to work; and those that say what.
#[must_use]
pub fn told_to_work(mut arguments: Vec<OsString>) -> (bool, Vec<OsString>) {
    let is_told = arguments.get(1).is_some_and(|word| word == WORKER);
    if is_told {
        arguments.remove(1);
    }
    (is_told, arguments)
}

/// How many workers there are, and how long they may take.
#[derive(Args, Debug)]
#[group(skip)]
pub struct WorkerArguments {
    /// Number of processes that run FMUs [default: one per core]
    #[arg(long = "workers", value_name = "NUMBER", alias = "threads", value_parser = clap::value_parser!(u16).range(1..))]
    pub number: Option<u16>,
    /// Longest time of a run on the clock (s); one that takes longer has failed
    #[arg(long, value_name = "SECONDS", default_value_t = 3600.0, value_parser = number_in(1e-3..=1e9, "a time from 0.001 to 1e9 s"))]
    pub time_limit: f64,
}

/// A job or an answer. The opening of a worker answers number 0.
#[derive(Serialize, Deserialize)]
struct Numbered<T> {
    number: u64,
    content: T,
}

/// An answer. The last one of a process that is ending by an FMU's wish is an error.
#[derive(Serialize, Deserialize)]
enum Answer<T> {
    Done {
        result: T,
        /// Whether the process is as it was before.
        is_clean: bool,
    },
    Failed(String),
    /// An FMU ends the process.
    Ends(String),
}

/// What comes from a worker.
enum Output {
    Line(Vec<u8>),
    /// The process has ended; what it has left behind may keep the pipe open.
    End,
}

/// Where a worker answers. FMUs that end the process answer there, too.
#[derive(Clone)]
struct Answers(Arc<Mutex<Channel>>);

struct Channel {
    to: Target,
    /// The number of the present job.
    number: u64,
}

enum Target {
    Pipe(File),
    /// A file that is opened for an answer, whatever descriptors FMUs close.
    File(PathBuf),
}

impl Answers {
    fn new(to: Target) -> Self {
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
    fn begin(&self, number: u64) {
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

    fn send_result<T: Serialize>(&self, result: Result<T>, is_clean: bool) -> Result<()> {
        self.send(match result {
            Ok(result) => Answer::Done { result, is_clean },
            Err(error) => Answer::Failed(format!("{error:#}")),
        })
    }
}

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

/// Works for a parent that [waits for a single answer](supervised). Does not return when the parent has it.
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

/// Runs a program that [works once](work_once), with this one's standard streams. Ends what it has started.
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

/// The last call to an FMU by a worker with a temporary folder.
fn last_call(folder: &Folder) -> Option<LastCall> {
    LastCall::read(&folder.path().join(LAST_CALL))
}

/// How a process ended that gave no answer. Whether a core was dumped is a setting of the machine.
fn ended(status: ExitStatus, last: Option<LastCall>) -> String {
    let status = status.to_string();
    let status = status.trim_end_matches(" (core dumped)");
    match last {
        Some(LastCall { fmu, call, has_returned: false }) => {
            format!("{fmu}: the FMU ended the process in {call}: {status}")
        }
        Some(LastCall { fmu, call, .. }) => format!("the process ended after {call} of {fmu}: {status}"),
        None => format!("the process that runs FMUs ended: {status}"),
    }
}

/// Why a job has no result.
enum Lost {
    /// The worker ended or failed.
    WithWorker(String),
    /// Something else wrote an answer; with the last call to an FMU.
    Garbled(String, Option<LastCall>),
    /// The worker cannot answer any more; with the last call to an FMU.
    Closed(Option<LastCall>),
    /// The job took longer than the limit; with the last call to an FMU.
    InTime(Duration, Option<LastCall>),
}

impl fmt::Display for Lost {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::WithWorker(reason) => formatter.write_str(reason),
            Self::Garbled(line, last) => {
                let fmu = last.as_ref().map_or("an FMU", |last| &last.fmu);
                write!(formatter, "{fmu}: the FMU wrote to a descriptor that is not its own: {line:?}")
            }
            Self::Closed(last) => {
                let fmu = last.as_ref().map_or("an FMU", |last| &last.fmu);
                write!(formatter, "{fmu}: the FMU closed descriptors that are not its own")
            }
            Self::InTime(limit, last) => {
                write!(formatter, "it took longer than the time limit, {} s", number(limit.as_secs_f64()))?;
                match last {
                    Some(LastCall { fmu, call, has_returned: false }) => {
                        write!(formatter, "; {fmu} was in {call}")
                    }
                    _ => Ok(()),
                }
            }
        }
    }
}

/// The living processes, which an interruption ends before it removes their folders.
struct Processes(Arc<Mutex<Vec<Weak<Group>>>>);

impl Processes {
    fn new() -> Self {
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
    fn start(&self, program: &Program, adapt: impl FnOnce(&mut Command)) -> Result<(Arc<Group>, Folder)> {
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

/// How a process ended, if it does within a time.
fn status_within(limit: Duration, group: &Group) -> Option<ExitStatus> {
    let begin = Instant::now();
    loop {
        match group.status() {
            Ok(None) if begin.elapsed() < limit => thread::sleep(LOOKS),
            status => break status.ok().flatten(),
        }
    }
}

impl<'a> Workers<'a> {
    /// Starts the first worker; returns also how it opened.
    ///
    /// # Errors
    /// When the program cannot be started, or cannot prepare its task.
    pub fn open<O: DeserializeOwned>(program: &'a Program, arguments: &WorkerArguments) -> Result<(Self, O)> {
        let cores = || thread::available_parallelism().map_or(1, usize::from);
        let number = arguments.number.map_or_else(cores, usize::from);
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
