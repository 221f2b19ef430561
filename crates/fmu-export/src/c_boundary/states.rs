//! The bodies of the functions for saved states, which are the same in all versions.

use core::ffi::c_void;
use core::ptr;
use std::sync::PoisonError;

use fmu_abi::Status;
use fmu_solve::Error;

use super::arguments::{elements, not_null, write_elements};
use crate::c_boundary::saved_states;
use crate::instance::memory::Memory;
use crate::instance::{Answer, Instance};
use crate::kinds::Model;

/// Reads the state behind a handle.
pub(crate) fn with_state<M: Model, T>(
    state: *mut c_void,
    body: impl FnOnce(&Memory<M>) -> Result<T, Error>,
) -> Result<T, Error> {
    if state.is_null() {
        return Err(Error::new("the argument FMUstate is NULL"));
    }
    let state = saved_states::find::<Memory<M>>(state.addr())?;
    body(&state.read().unwrap_or_else(PoisonError::into_inner))
}

/// Stores a memory as a new state of an instance, and returns its handle.
pub(crate) fn keep<M: Model>(instance: &Instance<M>, memory: Memory<M>) -> *mut c_void {
    ptr::without_provenance_mut(saved_states::keep(ptr::from_ref(instance).addr(), memory))
}

/// Saves an instance's state. If `*state` is null, creates a saved state; otherwise overwrites that one.
///
/// # Safety
/// `state` is null or may be read and written to.
pub(crate) unsafe fn get_state<M: Model>(instance: &mut Instance<M>, state: *mut *mut c_void) -> Answer {
    let state = not_null("FMUstate", state)?;
    let memory = instance.save()?;
    // SAFETY: the caller's promise.
    let saved = unsafe { state.read_unaligned() };
    if saved.is_null() {
        // SAFETY: the caller's promise.
        unsafe { state.write_unaligned(keep(instance, memory)) };
    } else {
        let there = saved_states::find::<Memory<M>>(saved.addr())?;
        *there.write().unwrap_or_else(PoisonError::into_inner) = memory;
    }
    Ok(Status::Ok)
}

/// Restores a saved state.
pub(crate) fn set_state<M: Model>(instance: &mut Instance<M>, state: *mut c_void) -> Answer {
    with_state(state, |memory| instance.restore(memory).map(|()| Status::Ok))
}

/// Frees a saved state; null is a no-op.
///
/// # Safety
/// As for [`get_state`].
pub(crate) unsafe fn free_state<M: Model>(state: *mut *mut c_void) -> Answer {
    // SAFETY: the caller's promise.
    let saved = if state.is_null() { state.cast() } else { unsafe { state.read_unaligned() } };
    if !saved.is_null() {
        saved_states::free::<Memory<M>>(saved.addr())?;
        // SAFETY: the caller's promise.
        unsafe { state.write_unaligned(ptr::null_mut()) };
    }
    Ok(Status::Ok)
}

/// The size of a serialized state in bytes.
///
/// # Safety
/// `size` is null or may be written to.
pub(crate) unsafe fn serialized_size<M: Model>(state: *mut c_void, size: *mut usize) -> Answer {
    let size = not_null("size", size)?;
    let content = with_state(state, Instance::<M>::serialize)?;
    // SAFETY: the caller's promise.
    unsafe { size.write_unaligned(content.len()) };
    Ok(Status::Ok)
}

/// Serializes a saved state into as many bytes as [`serialized_size`] reports.
///
/// # Safety
/// There are as many bytes as counted.
pub(crate) unsafe fn serialize<M: Model>(state: *mut c_void, (bytes, size): (*mut u8, usize)) -> Answer {
    let content = with_state(state, Instance::<M>::serialize)?;
    if size != content.len() {
        return Err(Error::new(format!("size is {size}, the state has {} bytes", content.len())));
    }
    let write = |target: &mut [u8]| {
        target.copy_from_slice(&content);
        Ok(Status::Ok)
    };
    // SAFETY: the caller's promise.
    unsafe { write_elements("serializedState", bytes, size, write) }
}

/// Turns a serialized state into a new saved state. Unlike [`get_state`], this does not read `*state`: the standard
/// does not require importers to set it, and it may happen to be the handle of a state.
///
/// # Safety
/// There are as many bytes as counted; `state` is null or may be written to.
pub(crate) unsafe fn deserialize<M: Model>(
    instance: &Instance<M>,
    (bytes, size): (*const u8, usize),
    state: *mut *mut c_void,
) -> Answer {
    // SAFETY: the caller's promise.
    let bytes = unsafe { elements("serializedState", bytes, size) }?;
    let state = not_null("FMUstate", state)?;
    let memory = instance.deserialize(&bytes)?;
    // SAFETY: the caller's promise.
    unsafe { state.write_unaligned(keep(instance, memory)) };
    Ok(Status::Ok)
}
