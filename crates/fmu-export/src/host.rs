//! What a module's host provides. FMI 3.0 modules import the last four functions if they call them.

use core::ffi::{c_char, c_void};

use fmu_abi::Status;

use crate::panics;

#[link(wasm_import_module = "fmu")]
unsafe extern "C" {
    /// Receives a message: the environment passed by the importer, status, category, text.
    pub fn log(environment: *mut c_void, status: Status, category: *const c_char, text: *const c_char);
    /// Receives a panic's message, before the trap: UTF-8, and its number of bytes.
    pub fn panic(text: *const u8, size: usize);
    /// The size of a file in bytes, or less than 0 if it cannot be read; its path is UTF-8.
    pub fn file_size(path: *const u8, path_size: usize) -> i64;
    /// Reads `size` bytes of a file; returns whether that succeeded.
    pub fn read_file(path: *const u8, path_size: usize, bytes: *mut u8, size: usize) -> i32;
    /// `fmi3IntermediateUpdateCallback`.
    pub fn intermediate_update(
        environment: *mut c_void,
        time: f64,
        set_requested: u8,
        get_allowed: u8,
        step_finished: u8,
        can_return_early: u8,
        early_return_requested: *mut u8,
        early_return_time: *mut f64,
    );
    /// `fmi3ClockUpdateCallback`.
    pub fn clock_update(environment: *mut c_void);
    /// `fmi3LockPreemptionCallback`.
    pub fn lock_preemption();
    /// `fmi3UnlockPreemptionCallback`.
    pub fn unlock_preemption();
}

/// Reports a panic's message to the host; the panic then traps.
pub(crate) fn report_panics() {
    std::panic::set_hook(Box::new(|info| {
        let place =
            info.location().map_or_else(String::new, |place| format!(" ({}:{})", place.file(), place.line()));
        let text = panics::message(info.payload()).to_owned() + &place;
        // SAFETY: the host reads the text, which outlives the call.
        unsafe { panic(text.as_ptr(), text.len()) }
    }));
}

/// The size of a host file.
pub(crate) fn size_of(path: &str) -> Option<usize> {
    // SAFETY: the host reads the path, which outlives the call.
    usize::try_from(unsafe { file_size(path.as_ptr(), path.len()) }).ok()
}

/// Reads a host file of a known size.
pub(crate) fn read(path: &str, size: usize) -> Option<Vec<u8>> {
    let mut bytes = vec![0; size];
    // SAFETY: the host reads the path, which outlives the call, and writes as many bytes as there are.
    let is_read = unsafe { read_file(path.as_ptr(), path.len(), bytes.as_mut_ptr(), bytes.len()) };
    (is_read != 0).then_some(bytes)
}
