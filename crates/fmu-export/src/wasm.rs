//! A model as a WebAssembly module: the functions that its host calls in addition to those of FMI.
//!
//! An importer's callbacks are host functions without addresses: the module imports them from `fmu`. As in C, null
//! callbacks are not called.
//!
//! A panic ends the call with a trap; the host receives its message through `panic` first. The module is then
//! unusable.

use core::alloc::Layout;
use core::ffi::c_void;
use core::ptr;
use core::slice;
use std::alloc::{alloc, dealloc};

use crate::c_boundary::Exported;
use crate::c_boundary::states::{keep, with_state};
use crate::instance::Instance;
use crate::kinds::Model;

/// The memory layout of arguments and results, aligned for any of them.
fn layout(size: usize) -> Option<Layout> {
    Layout::from_size_align(size.max(1), align_of::<u64>()).ok()
}

/// `fmu_allocate`: memory for arguments and results, or null.
#[must_use]
pub fn allocate(size: usize) -> *mut u8 {
    // SAFETY: the size is not 0.
    layout(size).map_or(ptr::null_mut(), |layout| unsafe { alloc(layout) })
}

/// `fmu_free`.
///
/// # Safety
/// The memory was allocated with this size.
pub unsafe fn free(memory: *mut u8, size: usize) {
    if let Some(layout) = layout(size).filter(|_| !memory.is_null()) {
        // SAFETY: the caller's promise.
        unsafe { dealloc(memory, layout) }
    }
}

/// `fmu_fail`: the instance needs a reset, as after a panic. For hosts that replace a module after a trap.
///
/// # Safety
/// The handle is null or came from the instantiation function, and is not freed.
pub unsafe fn fail<M: Model>(handle: *mut c_void) {
    // SAFETY: the caller's promise.
    if let Some(instance) = unsafe { Exported::<M>::instance_of(handle) } {
        instance.fail();
    }
}

/// `fmu_state_size`: the size of a saved state in bytes, or 0.
#[must_use]
pub fn state_size<M: Model>(state: *mut c_void) -> usize {
    with_state(state, Instance::<M>::to_bytes).map_or(0, |bytes| bytes.len())
}

/// `fmu_save_state`: writes the bytes of a saved state, which may then be freed.
///
/// # Safety
/// There are as many bytes as [`state_size`] reported.
pub unsafe fn save_state<M: Model>(state: *mut c_void, target: *mut u8) {
    if let Ok(bytes) = with_state(state, Instance::<M>::to_bytes) {
        // SAFETY: the caller's promise.
        unsafe { target.copy_from_nonoverlapping(bytes.as_ptr(), bytes.len()) }
    }
}

/// `fmu_load_state`: the state of an instance from saved bytes, or null.
///
/// # Safety
/// As for [`fail`]; there are as many bytes as counted.
pub unsafe fn load_state<M: Model>(handle: *mut c_void, bytes: *const u8, size: usize) -> *mut c_void {
    // SAFETY: the caller's promise.
    let (instance, bytes) =
        unsafe { (Exported::<M>::instance_of(handle), slice::from_raw_parts(bytes, size)) };
    let memory = Instance::<M>::from_bytes(bytes).ok();
    instance.zip(memory).map_or(ptr::null_mut(), |(instance, memory)| keep(instance, memory))
}

/// Defines the functions that a module exports in addition to those of FMI.
#[doc(hidden)]
#[macro_export]
macro_rules! wasm_functions {
    () => {
        $crate::exported_function! {
            fmu_fail(instance: *mut ::core::ffi::c_void),
            |F| $crate::wasm::fail::<F::Model>(instance)
        }

        $crate::exported_function! {
            fmu_state_size(state: *mut ::core::ffi::c_void) -> usize,
            |F| $crate::wasm::state_size::<F::Model>(state)
        }

        $crate::exported_function! {
            fmu_save_state(state: *mut ::core::ffi::c_void, bytes: *mut u8),
            |F| $crate::wasm::save_state::<F::Model>(state, bytes)
        }

        $crate::exported_function! {
            fmu_load_state(instance: *mut ::core::ffi::c_void, bytes: *const u8, size: usize)
                -> *mut ::core::ffi::c_void,
            |F| $crate::wasm::load_state::<F::Model>(instance, bytes, size)
        }

        #[unsafe(no_mangle)]
        extern "C" fn fmu_allocate(size: usize) -> *mut u8 {
            $crate::wasm::allocate(size)
        }

        #[unsafe(no_mangle)]
        unsafe extern "C" fn fmu_free(memory: *mut u8, size: usize) {
            // SAFETY: the arguments are the host's, unchanged.
            unsafe { $crate::wasm::free(memory, size) }
        }
    };
}
