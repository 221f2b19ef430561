//! The FMUs that live in this process: attributes messages to them, and finds which one ends the process.
//!
//! The environment that an FMU passes to its callbacks is a number to look up, never a pointer to follow, because some
//! FMUs pass a different one.

use std::cell::Cell;
use std::collections::{BTreeMap, VecDeque};
use std::ffi::c_int;
use std::fmt;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use fmu_io::{temporary, terminal};
use fmu_solve::display::Seconds;

use super::super::messages::{Message, Status};
use super::last_call::told;
use super::process::with_own_modes;

/// The number of messages kept for an instance; the last ones are kept.
const KEPT_MESSAGES: usize = 1000;

/// An environment: a number of the size of a pointer.
pub type Environment = usize;

/// The next environment. Each is used once, so that a late message is not attributed to another FMU. They begin where
/// an FMU's own numbers and, in 64 bits, pointers do not lie.
static NEXT: AtomicUsize = AtomicUsize::new(1 << (usize::BITS - 1));

/// The living FMUs, by their environments.
static LIVE: Mutex<BTreeMap<Environment, Arc<Life>>> = Mutex::new(BTreeMap::new());

/// Reports an FMU that ends the process, and returns the exit status.
type Report = Box<dyn FnMut(&str) -> c_int + Send>;

/// What is done when an FMU ends the process, once exits are watched.
static REPORT: Mutex<Option<Report>> = Mutex::new(None);

thread_local! {
    /// The environment of the FMU that this thread is calling.
    static CALLED: Cell<Option<Environment>> = const { Cell::new(None) };
    /// Whether an end of the process by this thread is noticed.
    static IS_WATCHED: Cell<bool> = const { Cell::new(false) };
}

unsafe extern "C" {
    // From the C library.
    fn atexit(handler: extern "C" fn()) -> c_int;
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    fn at_quick_exit(handler: extern "C" fn()) -> c_int;
    fn _exit(status: c_int) -> !;
}

/// What is known of a living FMU.
struct Life {
    name: String,
    messages: Mutex<VecDeque<Message>>,
    /// The last call.
    call: Mutex<Call>,
}

impl Life {
    fn add(&self, message: Message) {
        let mut messages = locked(&self.messages);
        if messages.len() == KEPT_MESSAGES {
            messages.pop_front();
        }
        messages.push_back(message);
    }
}

/// A call to an FMU.
#[derive(Clone, Copy)]
pub enum Call {
    /// The FMU's library is loaded, and will be unloaded.
    Load,
    /// A function, at the time reached (s), if there is one.
    Of(&'static str, Option<f64>),
}

impl Call {
    /// The call's name, and the time reached (s), if there is one.
    pub fn parts(self) -> (&'static str, Option<f64>) {
        match self {
            Self::Load => ("the loading of its library", None),
            Self::Of(function, time) => (function, time),
        }
    }
}

impl fmt::Display for Call {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, time) = self.parts();
        formatter.write_str(name)?;
        time.map_or(Ok(()), |time| write!(formatter, " at {} s", Seconds(time)))
    }
}

/// A living FMU, an instance or a library, until it is dropped.
pub struct Live {
    environment: Environment,
    life: Arc<Life>,
}

impl Live {
    /// An FMU that this thread will call.
    pub fn new(name: String) -> Self {
        watch();
        let environment = NEXT.fetch_add(1, Ordering::Relaxed);
        let life = Arc::new(Life { name, messages: Mutex::default(), call: Mutex::new(Call::Load) });
        locked(&LIVE).insert(environment, Arc::clone(&life));
        Self { environment, life }
    }

    pub fn environment(&self) -> Environment {
        self.environment
    }

    /// Adds a message.
    pub fn add(&self, message: Message) {
        self.life.add(message);
    }

    /// Takes the FMU's messages since the last call of this function.
    pub fn take(&self) -> Vec<Message> {
        locked(&self.life.messages).drain(..).collect()
    }

    /// Takes the FMU's messages, and prints all but those for information only.
    pub fn print(&self) {
        let messages = self.take().into_iter();
        messages
            .filter(|message| message.status != Status::OK)
            .for_each(|message| print(&self.life.name, &message));
    }

    /// Calls the FMU; its changes of floating-point modes are undone.
    pub fn call<T>(&self, call: Call, function: impl FnOnce() -> T) -> T {
        *locked(&self.life.call) = call;
        CALLED.set(Some(self.environment));
        let fmu = (self.environment, self.life.name.as_str());
        let result = told(fmu, call.parts(), || with_own_modes(function));
        CALLED.set(None);
        result
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        locked(&LIVE).remove(&self.environment);
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Gives a message to the FMU that it is from: the one that this thread calls, or in a thread that an FMU created the
/// FMU of the environment, else the only one with that name. If there is none, the message is printed.
pub fn receive(environment: Environment, name: Option<&str>, mut message: Message) {
    let live = locked(&LIVE);
    let named = || {
        let mut named = live.values().filter(|life| name == Some(&life.name));
        named.next().filter(|_| named.next().is_none())
    };
    let called = || live.get(&CALLED.get()?);
    let Some(life) = called().or_else(|| live.get(&environment)).or_else(named) else {
        drop(live);
        return print(name.unwrap_or("an FMU"), &message);
    };
    if let Call::Of(_, time) = *locked(&life.call) {
        message.time = time;
    }
    life.add(message);
}

fn print(name: &str, message: &Message) {
    let kind = if message.status == Status::OK { "note" } else { "warning" };
    terminal::complain(&format!("{kind}: {}", message.of(name)));
}

/// From now on, if an FMU ends the process by `exit` or `quick_exit`, `report` gets a text that says which FMU did so,
/// and returns the process's exit status; temporary files are removed. A later call replaces it. Call this before FMUs
/// are loaded.
///
/// An FMU that ends the process by `_exit`, or by its own C library, is noticed only by the parent of the process.
pub fn when_an_fmu_exits(report: impl FnMut(&str) -> i32 + Send + 'static) {
    *locked(&REPORT) = Some(Box::new(report));
}

/// Notices if this thread ends the process. The handler serves one thread: while it runs, a second that ends the
/// process would find none and end it with its own status.
fn watch() {
    if locked(&REPORT).is_some() && !IS_WATCHED.replace(true) {
        // SAFETY: the handler is a function of this program, which does not unwind.
        unsafe {
            atexit(end);
            #[cfg(all(target_os = "linux", target_env = "gnu"))]
            at_quick_exit(end);
        }
    }
}

/// Ends the process if an FMU is doing so.
extern "C" fn end() {
    let culprit = if temporary::is_interrupted() { None } else { culprit() };
    // A second thread waits here.
    let mut report = locked(&REPORT);
    let (Some(culprit), Some(report)) = (culprit, report.as_mut()) else { return };
    temporary::remove_all();
    let status = report(&culprit);
    // SAFETY: it ends the process at once. To return would end it with the FMU's status, and `exit` must not be called
    // within itself.
    unsafe { _exit(status) }
}

/// The FMU that ends the process; none if no FMU lives, as when the program ends normally.
fn culprit() -> Option<String> {
    const ENDED: &str = "the FMU ended the process by `exit`";
    let live = locked(&LIVE);
    if let Some(life) = CALLED.get().and_then(|called| live.get(&called)) {
        return Some(format!("{}: {ENDED} in {}", life.name, locked(&life.call)));
    }
    let of = |life: &Arc<Life>| format!("{} after {}", life.name, locked(&life.call));
    let (instances, libraries): (Vec<_>, Vec<_>) =
        live.values().partition(|life| matches!(*locked(&life.call), Call::Of(..)));
    let mut suspects: Vec<_> =
        if instances.is_empty() { libraries } else { instances }.into_iter().map(of).collect();
    suspects.dedup();
    (!suspects.is_empty())
        .then(|| format!("an FMU ended the process by `exit` outside of a call: {}", suspects.join(", ")))
}
