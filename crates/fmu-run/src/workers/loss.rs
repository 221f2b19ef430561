//! Why a job has no result: how a worker ended, and which FMU it was calling.

use std::fmt;
use std::process::ExitStatus;
use std::thread;
use std::time::{Duration, Instant};

use fmu_io::temporary::Folder;
use fmu_io::terminal::number;
use fmu_master::process::{Group, LastCall};

use super::protocol::LAST_CALL;

/// The time between looks at whether a process has ended.
const LOOKS: Duration = Duration::from_millis(1);

/// The last call to an FMU by a worker with a temporary folder.
pub fn last_call(folder: &Folder) -> Option<LastCall> {
    LastCall::read(&folder.path().join(LAST_CALL))
}

/// How a process ended that gave no answer. Whether a core was dumped is a setting of the machine.
pub fn ended(status: ExitStatus, last: Option<LastCall>) -> String {
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
pub enum Lost {
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

/// How a process ended, if it does within a time.
pub fn status_within(limit: Duration, group: &Group) -> Option<ExitStatus> {
    let begin = Instant::now();
    loop {
        match group.status() {
            Ok(None) if begin.elapsed() < limit => thread::sleep(LOOKS),
            status => break status.ok().flatten(),
        }
    }
}
