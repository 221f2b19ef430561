//! Catches a model's panics, which must not unwind into the importer's stack, and reports where they occurred.

use core::any::Any;
use core::cell::Cell;
use core::mem;
use core::panic::AssertUnwindSafe;
use std::panic::catch_unwind;

use crate::error::Error;

thread_local! {
    /// Where this thread last panicked. The type has no destructor, because one would outlive the library.
    static PLACE: Cell<Place> = const { Cell::new(Place { file: [0; Place::LONGEST], line: 0 }) };
}

/// A line of a file.
#[derive(Clone, Copy)]
struct Place {
    /// The end of its path, padded with 0.
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

    fn file(&self) -> String {
        String::from_utf8_lossy(&self.file).trim_end_matches('\0').to_owned()
    }
}

#[cfg(not(target_family = "wasm"))]
/// Replaces the default panic hook, which writes to the host's stderr: records where the panic is.
pub(crate) fn note(panic: &std::panic::PanicHookInfo<'_>) {
    if let Some(location) = panic.location() {
        PLACE.set(Place::of(location));
    }
}

/// Runs code that may call the model. A panic becomes an error with its message and location.
///
/// After a panic, whatever the body borrowed may be inconsistent; the caller handles that.
pub(crate) fn contain<T>(body: impl FnOnce() -> T) -> Result<T, Error> {
    catch_unwind(AssertUnwindSafe(body)).map_err(to_error)
}

#[cold]
#[inline(never)]
fn to_error(payload: Box<dyn Any + Send>) -> Error {
    let place = PLACE.get();
    let error = Error::new(format!(
        "the model panicked: {} ({}:{})",
        message(payload.as_ref()),
        place.file(),
        place.line
    ));
    // A panic's payload may itself panic when dropped; the payload of that panic is leaked.
    if let Err(next) = catch_unwind(AssertUnwindSafe(|| drop(payload))) {
        mem::forget(next);
    }
    error
}

/// The message of a panic.
pub(crate) fn message(payload: &(dyn Any + Send)) -> &str {
    payload
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| payload.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no message")
}
