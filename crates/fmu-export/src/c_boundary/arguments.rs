//! An importer's pointers as slices and strings.
//!
//! Arrays and results may be unaligned: 32-bit compilers align doubles to 4 bytes, Rust to 8, and bindings pass parts
//! of buffers. Result memory is never interpreted: an unaligned array is filled as a copy and written back. No Rust
//! enum is read from the importer's memory.

use core::ffi::{CStr, c_char};
use core::slice;
use std::borrow::Cow;

use fmu_solve::Error;

use crate::allocation::check_memory;
use crate::instance::Answer;

/// An array argument; null counts as empty.
///
/// # Safety
/// Unless null, `array` has `count` elements that nothing changes during the call.
pub(crate) unsafe fn elements<'a, T: Copy>(
    name: &str,
    array: *const T,
    count: usize,
) -> Result<Cow<'a, [T]>, Error> {
    if count == 0 {
        return Ok(Cow::Borrowed(&[]));
    }
    let array = not_null(name, array.cast_mut())?.cast_const();
    Ok(if array.is_aligned() {
        // SAFETY: not null and aligned; the caller promises this length.
        Cow::Borrowed(unsafe { slice::from_raw_parts(array, count) })
    } else {
        check_memory(count.saturating_mul(size_of::<T>()))?;
        // SAFETY: the caller promises that each of these is an element.
        (0..count).map(|index| unsafe { array.add(index).read_unaligned() }).collect()
    })
}

/// Writes an array.
///
/// # Safety
/// Unless null, `array` has `count` elements that nothing else uses during the call.
pub(crate) unsafe fn write_elements<T: Copy>(
    name: &str,
    array: *mut T,
    count: usize,
    write: impl FnOnce(&mut [T]) -> Answer,
) -> Answer {
    if count == 0 {
        return write(&mut []);
    }
    let array = not_null(name, array)?;
    if array.is_aligned() {
        // SAFETY: not null and aligned; the caller promises this length and that nothing aliases it.
        return write(unsafe { slice::from_raw_parts_mut(array, count) });
    }
    // SAFETY: the caller's promise.
    let mut values = unsafe { elements(name, array, count) }?.into_owned();
    let answer = write(&mut values);
    // Even after an error, the values written before it are returned, as if they had been written to the importer's
    // array.
    for (index, value) in values.into_iter().enumerate() {
        // SAFETY: the caller promises that this is an element.
        unsafe { array.add(index).write_unaligned(value) };
    }
    answer
}

/// Checks an array's element count before access.
pub(crate) fn check_count(argument: &str, found: usize, expected: usize) -> Result<(), Error> {
    if found == expected {
        Ok(())
    } else {
        Err(Error::new(format!("{argument} is {found}; this FMU has {expected}")))
    }
}

/// An argument that must not be null.
pub(crate) fn not_null<T>(name: &str, argument: *mut T) -> Result<*mut T, Error> {
    if argument.is_null() { Err(Error::new(format!("the argument {name} is NULL"))) } else { Ok(argument) }
}

/// A string argument.
///
/// # Safety
/// `text` is null or ends in NUL.
pub(crate) unsafe fn c_string<'a>(name: &str, text: *const c_char) -> Result<&'a CStr, Error> {
    let text = not_null(name, text.cast_mut())?;
    // SAFETY: not null; the caller promises a NUL at the end.
    Ok(unsafe { CStr::from_ptr(text) })
}
