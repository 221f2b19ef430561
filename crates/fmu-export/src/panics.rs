//! Catches a model's panics, which must not unwind into the importer's stack.

use core::any::Any;
use core::mem;
use core::panic::AssertUnwindSafe;
use std::panic::catch_unwind;

use crate::error::Error;

/// Runs code that may call the model. A panic becomes an error with its message.
///
/// After a panic, what the body has borrowed may be inconsistent; the caller handles that.
pub(crate) fn contain<T>(body: impl FnOnce() -> T) -> Result<T, Error> {
    catch_unwind(AssertUnwindSafe(body)).map_err(to_error)
}

#[cold]
#[inline(never)]
fn to_error(payload: Box<dyn Any + Send>) -> Error {
    let error = Error::new(format!("the model panicked: {}", message(payload.as_ref())));
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
