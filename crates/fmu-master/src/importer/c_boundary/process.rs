//! What FMUs may change of their process, and processes that end with their parent.

use std::env;
use std::ffi::c_int;
use std::fs::File;
use std::io::{self, stdin, stdout};
#[cfg(unix)]
use std::os::fd::AsFd;
#[cfg(windows)]
use std::os::windows::io::{AsHandle, AsRawHandle};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use fmu_export::floating_point;

pub use super::last_call::{LastCall, tell_last_call};

/// More than the signals of any platform.
const MOST_SIGNALS: usize = 128;

/// How often an FMU returned with changed floating-point modes.
static CHANGES_OF_MODES: AtomicUsize = AtomicUsize::new(0);

unsafe extern "C" {
    // Defined in process.c.
    fn fmu_master_detach() -> c_int;
    fn fmu_master_handlers(to: *mut usize, most: usize) -> usize;
    fn fmu_master_group(process: isize) -> isize;
    fn fmu_master_await(process: isize);
    fn fmu_master_end_group(group: isize, process: isize);
    fn fmu_master_forget_group(group: isize);
    fn fmu_master_end_own_group();
}

/// Calls an FMU; its changes of floating-point modes are undone.
#[inline]
pub fn with_own_modes<T>(call: impl FnOnce() -> T) -> T {
    let (result, is_changed) = floating_point::restored_after(call);
    if is_changed {
        CHANGES_OF_MODES.fetch_add(1, Ordering::Relaxed);
    }
    result
}

/// What an FMU can leave behind for the next one.
#[derive(PartialEq)]
struct State {
    changes_of_modes: usize,
    handlers: Vec<usize>,
    folder: Option<PathBuf>,
}

impl State {
    fn of_this_process() -> Self {
        let mut handlers = vec![0; MOST_SIGNALS];
        // SAFETY: writes at most as many numbers as there is room for.
        let count = unsafe { fmu_master_handlers(handlers.as_mut_ptr(), handlers.len()) };
        handlers.truncate(count);
        let changes_of_modes = CHANGES_OF_MODES.load(Ordering::Relaxed);
        Self { changes_of_modes, handlers, folder: env::current_dir().ok() }
    }
}

/// Runs FMUs, and returns to the working folder if they have left it. Returns also whether they have changed it, the
/// floating-point modes or a handler of a signal.
pub fn contained<T>(run: impl FnOnce() -> T) -> (T, bool) {
    let before = State::of_this_process();
    let result = run();
    let is_changed = State::of_this_process() != before;
    if let (true, Some(folder)) = (is_changed, &before.folder) {
        // A folder that is gone cannot be returned to.
        let _ = env::set_current_dir(folder);
    }
    (result, is_changed)
}

/// Takes standard input and output away from FMUs: their input is empty, and what they print goes to standard error.
///
/// # Errors
/// When the system has no more handles.
pub fn take_standard_streams() -> io::Result<(File, File)> {
    #[cfg(unix)]
    let (input, output) = (stdin().as_fd().try_clone_to_owned()?, stdout().as_fd().try_clone_to_owned()?);
    #[cfg(windows)]
    let (input, output) =
        (stdin().as_handle().try_clone_to_owned()?, stdout().as_handle().try_clone_to_owned()?);
    // SAFETY: replaces the standard streams, of which no Rust code holds a copy.
    if unsafe { fmu_master_detach() } == 0 {
        return Err(io::Error::other("standard output cannot be redirected"));
    }
    Ok((input.into(), output.into()))
}

/// Ends this process at once, on Unix with its process group.
pub fn end_own_group() {
    // SAFETY: it does not return.
    unsafe { fmu_master_end_own_group() }
}

/// A process with those that it starts, on Unix a process group, on Windows a job. They end when this is dropped; on
/// Windows also when this process ends.
pub struct Group {
    /// Not reaped before `status` is known, so that nothing else gets its number.
    child: Mutex<(Child, Option<ExitStatus>)>,
    process: isize,
    group: isize,
}

impl Group {
    /// Starts a process.
    ///
    /// # Errors
    /// When it cannot be started.
    pub fn spawn(mut command: Command) -> io::Result<Self> {
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn()?;
        #[cfg(unix)]
        let process = isize::try_from(child.id()).map_err(io::Error::other)?;
        #[cfg(windows)]
        let process = child.as_raw_handle() as isize;
        // SAFETY: the process was just started, and is not reaped.
        let group = unsafe { fmu_master_group(process) };
        if group == 0 {
            let error = io::Error::last_os_error();
            child.kill()?;
            return Err(error);
        }
        Ok(Self { child: Mutex::new((child, None)), process, group })
    }

    /// The process, to take its standard streams from.
    pub fn child<T>(&self, take: impl FnOnce(&mut Child) -> T) -> T {
        take(&mut self.locked().0)
    }

    fn locked(&self) -> MutexGuard<'_, (Child, Option<ExitStatus>)> {
        self.child.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// How the process ended, if it has.
    ///
    /// # Errors
    /// When the system does not tell.
    pub fn status(&self) -> io::Result<Option<ExitStatus>> {
        let (child, status) = &mut *self.locked();
        if status.is_none() {
            *status = child.try_wait()?;
        }
        Ok(*status)
    }

    /// Waits for the end of the process.
    ///
    /// # Errors
    /// When the system does not tell.
    pub fn wait(&self) -> io::Result<ExitStatus> {
        // Another thread may end it meanwhile.
        // SAFETY: waits for a child of this process; one that is reaped is not waited for.
        unsafe { fmu_master_await(self.process) }
        let (child, status) = &mut *self.locked();
        *status = Some(child.wait()?);
        status.ok_or_else(|| io::Error::other("no status"))
    }

    /// Ends the process and those that it has started, unless it has ended.
    pub fn end(&self) {
        let (child, status) = &mut *self.locked();
        if status.is_none() {
            // SAFETY: the process is not reaped, so the numbers are its own.
            unsafe { fmu_master_end_group(self.group, self.process) };
            *status = child.wait().ok();
        }
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        self.end();
        // SAFETY: it is not used any more.
        unsafe { fmu_master_forget_group(self.group) };
    }
}
