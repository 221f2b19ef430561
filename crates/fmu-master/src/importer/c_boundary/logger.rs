//! What an instance logs, in the callbacks of each version.

use std::collections::VecDeque;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::ptr;
use std::sync::{Mutex, PoisonError};

use super::super::messages::{Message, Status};

/// The number of messages kept for an instance: the last ones.
const KEPT_MESSAGES: usize = 1000;

/// `fmi2CallbackFunctions` (FMI 2.0.5, section 2.1.5).
#[repr(C)]
pub struct CallbackFunctions {
    logger: unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...),
    allocate_memory: unsafe extern "C" fn(usize, usize) -> *mut c_void,
    free_memory: unsafe extern "C" fn(*mut c_void),
    step_finished: *const c_void,
    component_environment: *const Receiver,
}

unsafe extern "C" {
    /// Defined in logger.c.
    fn fmu_master_log(
        environment: *mut c_void,
        instance: *const c_char,
        status: c_int,
        category: *const c_char,
        format: *const c_char,
        ...
    );
    /// From the C library, as the standard requires.
    fn calloc(count: usize, size: usize) -> *mut c_void;
    /// From the C library.
    fn free(memory: *mut c_void);
}

/// Receives an instance's messages. logger.c declares the first field.
#[repr(C)]
pub struct Receiver {
    receive: unsafe extern "C" fn(*const Receiver, c_int, *const c_char),
    messages: Mutex<VecDeque<Message>>,
}

impl Receiver {
    pub fn new() -> Self {
        Self { receive, messages: Mutex::default() }
    }

    /// The messages since the last call of this function.
    pub fn take(&self) -> Vec<Message> {
        self.messages.lock().unwrap_or_else(PoisonError::into_inner).drain(..).collect()
    }
}

impl CallbackFunctions {
    /// With a receiver that outlives the instance.
    pub fn new(receiver: &Receiver) -> Self {
        Self {
            logger: fmu_master_log,
            allocate_memory: calloc,
            free_memory: free,
            step_finished: ptr::null(),
            component_environment: &raw const *receiver,
        }
    }
}

/// Takes a message.
///
/// # Safety
/// `receiver` belongs to a living instance; the text is null or ends with a zero byte.
unsafe extern "C" fn receive(receiver: *const Receiver, status: c_int, text: *const c_char) {
    // SAFETY: the callers' promise.
    let (receiver, text) = unsafe { (&*receiver, text_at(text)) };
    // An FMU may log from other threads.
    let mut messages = receiver.messages.lock().unwrap_or_else(PoisonError::into_inner);
    if messages.len() == KEPT_MESSAGES {
        messages.pop_front();
    }
    messages.push_back(Message { status: Status(status), text });
}

/// The `fmi3LogMessageCallback`.
///
/// # Safety
/// The environment is null or the instance's receiver; the text is null or ends with a zero byte.
pub unsafe extern "C" fn log_message(
    receiver: *const Receiver,
    status: c_int,
    _category: *const c_char,
    text: *const c_char,
) {
    // Some FMUs forget the environment.
    if !receiver.is_null() {
        // SAFETY: the callers' promise.
        unsafe { receive(receiver, status, text) };
    }
}

/// A copy of a C text; empty where there is none.
///
/// # Safety
/// `text` is null or ends with a zero byte.
unsafe fn text_at(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: the caller's promise.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}
