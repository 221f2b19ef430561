//! Where a model's panics end: none may unwind into the importer, whose stack is not Rust's.

use std::any::Any;
use std::mem;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::error::Error;

/// Runs what may call the model. A panic becomes an error with its message.
///
/// What the body has borrowed may be half done then; the caller sees to it.
pub(crate) fn contain<T>(body: impl FnOnce() -> T) -> Result<T, Error> {
    catch_unwind(AssertUnwindSafe(body)).map_err(|payload| {
        let error = Error::new(format!("the model panicked: {}", message(payload.as_ref())));
        // What a panic carries may panic itself as it is dropped. Should that carry something again, it is
        // lost rather than let loose.
        if let Err(next) = catch_unwind(AssertUnwindSafe(|| drop(payload))) {
            mem::forget(next);
        }
        error
    })
}

/// The text that a panic was given.
fn message(payload: &(dyn Any + Send)) -> &str {
    payload
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| payload.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no message")
}
