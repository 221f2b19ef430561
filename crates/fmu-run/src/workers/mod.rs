//! Workers: other processes of this program that run FMUs, so that an FMU that crashes or hangs ends its own run only.
//!
//! A worker is started with this process's own arguments, after a hidden subcommand, and prepares the same task from them.
//! It takes jobs, a JSON line each, from its standard input, and answers by its standard output; its FMUs get neither.
//! Job and answer have the same number. A process that ends without its answer has failed, whatever its status; so has a
//! job whose answer is not one, as an FMU can write to any descriptor. The parent alone writes the journal and shows the
//! progress.
//!
//! A worker goes on after a job in which its FMUs have [changed nothing](fmu_master::process::Changes) of the process.
//! No process ends by way of the handlers that FMUs have registered: they could fail after a file is written.

mod loss;
mod pool;
mod processes;
mod program;
mod protocol;
mod working;

pub use self::pool::Workers;
pub use self::processes::supervised;
pub use self::program::{Program, WorkerArguments, told_to_work};
pub use self::working::{work, work_once};
