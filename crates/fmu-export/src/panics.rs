//! Catches a model's panics, which must not unwind into the importer's stack, and reports where they occurred. A panic
//! of a thread that the model has started is told with the error to which it leads.

use core::any::Any;
use core::cell::Cell;
use core::fmt;
use core::mem;
use core::panic::AssertUnwindSafe;
use std::panic::catch_unwind;
use std::sync::{Mutex, MutexGuard, PoisonError};

use fmu_solve::Error;

thread_local! {
    /// Where this thread last panicked. The type has no destructor, because one would outlive the library.
    static PLACE: Cell<Place> = const { Cell::new(Place { file: [0; Place::LONGEST], line: 0 }) };
}

/// The first panic since the last error, of any thread: what it says, and where.
static FIRST: Mutex<Option<String>> = Mutex::new(None);

/// A line of a file.
#[derive(Clone, Copy)]
struct Place {
    /// The end of the file's path, padded with 0.
    file: [u8; Self::LONGEST],
    line: u32,
}

impl Place {
    const LONGEST: usize = 128;

    #[cfg(not(target_family = "wasm"))]
    fn of(location: &core::panic::Location<'_>) -> Self {
        let path = location.file().as_bytes();
        let mut file = [0; Self::LONGEST];
        let end = &path[path.len().saturating_sub(Self::LONGEST)..];
        file[..end.len()].copy_from_slice(end);
        Self { file, line: location.line() }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let file = String::from_utf8_lossy(&self.file);
        write!(formatter, "{}:{}", file.trim_end_matches('\0'), self.line)
    }
}

#[cfg(not(target_family = "wasm"))]
/// Replaces the default panic hook, which writes to the host's stderr: records the panic.
pub(crate) fn note(panic: &std::panic::PanicHookInfo<'_>) {
    if let Some(location) = panic.location() {
        PLACE.set(Place::of(location));
    }
    lock_first().get_or_insert_with(|| told(panic.payload()));
}

/// What a panic of this thread says, and where.
fn told(payload: &(dyn Any + Send)) -> String {
    format!("{} ({})", message(payload), PLACE.get())
}

/// Runs code that may call the model. A panic becomes an error with its message and location.
///
/// After a panic, whatever the body borrowed may be inconsistent; the caller handles that.
pub(crate) fn contain<T>(body: impl FnOnce() -> T) -> Result<T, Error> {
    catch_unwind(AssertUnwindSafe(body)).map_err(to_error)
}

/// Runs code that may call the model where it need not be valid. A panic is none, and leaves no trace.
#[inline(never)]
pub(crate) fn attempt<T>(body: impl FnOnce() -> T) -> Option<T> {
    let (place, first) = (PLACE.get(), lock_first().is_some());
    match catch_unwind(AssertUnwindSafe(body)) {
        Ok(result) => Some(result),
        Err(payload) => {
            discard(payload);
            PLACE.set(place);
            if !first {
                *lock_first() = None;
            }
            None
        }
    }
}

/// Drops what a panic carries, which may itself panic; what that one carries is leaked.
fn discard(payload: Box<dyn Any + Send>) {
    if let Err(next) = catch_unwind(AssertUnwindSafe(|| drop(payload))) {
        mem::forget(next);
    }
}

fn lock_first() -> MutexGuard<'static, Option<String>> {
    FIRST.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cold]
#[inline(never)]
fn to_error(payload: Box<dyn Any + Send>) -> Error {
    let own = told(payload.as_ref());
    discard(payload);
    with_cause(Error::new(format!("the model panicked: {own}")), &own)
}

/// An error with the panic of another thread that came before it, unless that is the error's own.
#[cold]
pub(crate) fn with_cause(error: Error, own: &str) -> Error {
    let first = lock_first().take();
    match first.filter(|first| first != own) {
        Some(first) => Error::new(format!("{error}; before, a thread panicked: {first}")),
        None => error,
    }
}

/// The message of a panic.
pub(crate) fn message(payload: &(dyn Any + Send)) -> &str {
    payload
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| payload.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no message")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_attempted_leaves_no_trace() {
        crate::c_boundary::silence_panics();
        let here = attempt(|| -> u8 { panic!("it panics here") });
        let elsewhere = attempt(|| std::thread::spawn(|| panic!("it panics there")).join().unwrap());
        // A panic of another test may be in between.
        let first = lock_first().take().unwrap_or_default();
        let _ = std::panic::take_hook();
        assert_eq!((here, elsewhere), (None, None));
        assert!(!first.contains("it panics"), "{first}");
    }
}
