//! What FMUs may change of their process, and processes that end with their parent.

use std::env;
use std::ffi::{OsString, c_int, c_uint};
use std::fs::{self, File};
use std::io::{self, stdin, stdout};
#[cfg(unix)]
use std::os::fd::AsFd;
#[cfg(windows)]
use std::os::windows::io::{AsHandle, AsRawHandle};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use fmu_abi::floating_point;

pub use super::last_call::{LastCall, tell_last_call};

/// More than the numbers of any platform, of which signals have two each.
const MOST_NUMBERS: usize = 512;
/// Descriptors that are looked at: a leaked one is the lowest that is free.
const DESCRIPTORS: usize = 256;
/// Standard input, output and error.
const STANDARD_STREAMS: usize = 3;

/// How often an FMU returned with changed floating-point modes.
static CHANGES_OF_MODES: AtomicUsize = AtomicUsize::new(0);

/// Whether this process is one that an FMU has forked.
static IS_FORKED: AtomicBool = AtomicBool::new(false);

unsafe extern "C" {
    // Defined in process.c.
    fn fmu_master_detach() -> c_int;
    fn fmu_master_state(to: *mut usize, most: usize) -> usize;
    fn fmu_master_descriptors(to: *mut usize, count: usize);
    fn fmu_master_mode_mask() -> c_uint;
    fn fmu_master_restore(mode_mask: c_uint);
    fn fmu_master_watch_forks(forked: extern "C" fn());
    fn fmu_master_adopt();
    fn fmu_master_has_children() -> c_int;
    fn fmu_master_end_child(process: isize);
    fn fmu_master_has_ended(process: isize) -> c_int;
    fn fmu_master_group(process: isize) -> isize;
    fn fmu_master_await(process: isize);
    fn fmu_master_end_group(group: isize, process: isize);
    fn fmu_master_forget_group(group: isize);
    fn fmu_master_end_own_group();
    // From the C library.
    fn _exit(status: c_int) -> !;
}

/// Calls an FMU; its changes of floating-point modes are undone. A process that it [forks](end_forks) does not return.
#[inline]
pub fn with_own_modes<T>(call: impl FnOnce() -> T) -> T {
    let (result, is_changed) = floating_point::restored_after(call);
    if is_changed {
        CHANGES_OF_MODES.fetch_add(1, Ordering::Relaxed);
    }
    if IS_FORKED.load(Ordering::Relaxed) {
        end_at_once(0);
    }
    result
}

/// What an FMU can leave behind for the next one.
#[derive(PartialEq)]
struct State {
    changes_of_modes: usize,
    /// Numbers of the C library and the system: process.c lists them.
    numbers: Vec<usize>,
    descriptors: Vec<usize>,
    environment: Vec<(OsString, OsString)>,
    folder: Option<PathBuf>,
    has_temporary_folder: bool,
}

impl State {
    fn of_this_process() -> Self {
        let mut numbers = vec![0; MOST_NUMBERS];
        let mut descriptors = vec![0; DESCRIPTORS];
        // SAFETY: they write at most as many numbers as there is room for.
        let count = unsafe {
            fmu_master_descriptors(descriptors.as_mut_ptr(), descriptors.len());
            fmu_master_state(numbers.as_mut_ptr(), numbers.len())
        };
        numbers.truncate(count);
        Self {
            changes_of_modes: CHANGES_OF_MODES.load(Ordering::Relaxed),
            numbers,
            descriptors,
            environment: env::vars_os().collect(),
            folder: env::current_dir().ok(),
            has_temporary_folder: env::temp_dir().is_dir(),
        }
    }
}

/// What FMUs have changed of their process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Changes {
    /// FMUs have changed nothing.
    None,
    /// Something that other FMUs would notice.
    Some,
    /// FMUs have closed or replaced descriptors that this program uses.
    Descriptors,
}

/// Runs FMUs, and makes the process one to write files in: it returns to the working folder and the mask of file modes.
/// Tells also what they have changed: floating-point modes, handlers and masks of signals, limits, timers, priority,
/// locale, environment, descriptors, folder, or children that they have left.
pub fn contained<T>(run: impl FnOnce() -> T) -> (T, Changes) {
    let before = State::of_this_process();
    // SAFETY: it only asks the system.
    let mode_mask = unsafe { fmu_master_mode_mask() };
    let result = run();
    let after = State::of_this_process();
    if before == after {
        return (result, Changes::None);
    }
    // SAFETY: it opens descriptors that are closed, and no other.
    unsafe { fmu_master_restore(mode_mask) };
    if let Some(folder) = &before.folder {
        // A folder that is gone cannot be returned to.
        let _ = env::set_current_dir(folder);
    }
    let mut own = before.descriptors.iter().zip(&after.descriptors).skip(STANDARD_STREAMS);
    let are_lost = own.any(|(before, after)| *before != 0 && before != after);
    (result, if are_lost { Changes::Descriptors } else { Changes::Some })
}

/// From now on, a process that an FMU forks ends when it returns from the FMU: it would go on as a second one of this.
pub fn end_forks() {
    extern "C" fn forked() {
        IS_FORKED.store(true, Ordering::Relaxed);
    }
    // SAFETY: the function is async-signal-safe, and does not unwind.
    unsafe { fmu_master_watch_forks(forked) }
}

/// Ends this process without handlers of its exit, which FMUs may have registered.
pub fn end_at_once(status: i32) -> ! {
    // SAFETY: it does not return.
    unsafe { _exit(status) }
}

/// From now on, what a [`Group`] leaves behind becomes a child of this process, for [`end_children`]; on Linux also what
/// has left the group.
pub fn adopt() {
    // SAFETY: a setting of this process.
    unsafe { fmu_master_adopt() }
}

/// Ends all children of this process.
pub fn end_children() {
    // SAFETY: it only asks the system.
    while unsafe { fmu_master_has_children() } != 0 {
        let children = children();
        // Other systems do not list them.
        if children.is_empty() {
            return;
        }
        for child in children {
            // SAFETY: a child of this process, which nobody else waits for.
            unsafe { fmu_master_end_child(child) }
        }
    }
}

/// The children of this process, by Linux's list of processes: `number (name) state parent …`.
fn children() -> Vec<isize> {
    let own = std::process::id().to_string();
    let is_child = |stat: &str| {
        let after_name = stat.rsplit_once(')').map_or("", |(_, rest)| rest);
        after_name.split_whitespace().nth(1) == Some(own.as_str())
    };
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    let child = |entry: fs::DirEntry| {
        let number = entry.file_name().to_str()?.parse().ok()?;
        let stat = fs::read_to_string(entry.path().join("stat")).ok()?;
        is_child(&stat).then_some(number)
    };
    entries.filter_map(child).collect()
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
    /// The process, not reaped before `status` is known, so that nothing else gets its number.
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

    /// How the process ended, if it has; what it has started has then ended, too.
    ///
    /// # Errors
    /// When the system does not tell.
    pub fn status(&self) -> io::Result<Option<ExitStatus>> {
        let locked = &mut *self.locked();
        // SAFETY: a child of this process; one that is reaped is not asked for.
        if locked.1.is_none() && unsafe { fmu_master_has_ended(self.process) } != 0 {
            self.end_all(locked)?;
        }
        Ok(locked.1)
    }

    /// Waits for the end of the process, and ends what it has started.
    ///
    /// # Errors
    /// When the system does not tell.
    pub fn wait(&self) -> io::Result<ExitStatus> {
        // Another thread may end it meanwhile.
        // SAFETY: waits for a child of this process; one that is reaped is not waited for.
        unsafe { fmu_master_await(self.process) }
        let locked = &mut *self.locked();
        self.end_all(locked)?;
        locked.1.ok_or_else(|| io::Error::other("no status"))
    }

    /// Ends the process and those that it has started, unless it has ended.
    pub fn end(&self) {
        let _ = self.end_all(&mut self.locked());
    }

    fn end_all(&self, (child, status): &mut (Child, Option<ExitStatus>)) -> io::Result<()> {
        if status.is_none() {
            // SAFETY: the process is not reaped, so the numbers are its own.
            unsafe { fmu_master_end_group(self.group, self.process) };
            *status = Some(child.wait()?);
        }
        Ok(())
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        self.end();
        // SAFETY: it is not used any more.
        unsafe { fmu_master_forget_group(self.group) };
    }
}
