//! The logger callbacks of each version.

use std::ffi::{CStr, c_char, c_int, c_void};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::super::messages::{Called, Message, Status};
use super::live::{self, Environment};

/// The `fmi2CallbackLogger`, which formats as `printf` does.
type Logger = unsafe extern "C" fn(Environment, *const c_char, c_int, *const c_char, *const c_char, ...);
/// Takes a formatted message.
type Receive = unsafe extern "C" fn(Environment, *const c_char, c_int, *const c_char);

/// `fmi2CallbackFunctions` (FMI 2.0.5, section 2.1.5).
#[repr(C)]
pub struct CallbackFunctions {
    logger: Logger,
    allocate_memory: unsafe extern "C" fn(usize, usize) -> *mut c_void,
    free_memory: unsafe extern "C" fn(*mut c_void),
    step_finished: Option<unsafe extern "C" fn(Environment, c_int)>,
    component_environment: AtomicUsize,
}

unsafe extern "C" {
    /// Defined in logger.c.
    fn fmu_master_logger(receive: Receive) -> Logger;
    /// The C library's function, as the standard requires.
    fn calloc(count: usize, size: usize) -> *mut c_void;
    /// The C library's function.
    fn free(memory: *mut c_void);
}

impl CallbackFunctions {
    pub fn new() -> Self {
        static LOGGER: OnceLock<Logger> = OnceLock::new();
        Self {
            // SAFETY: it is called once, so that nothing else accesses what it stores.
            logger: *LOGGER.get_or_init(|| unsafe { fmu_master_logger(receive) }),
            allocate_memory: calloc,
            free_memory: free,
            step_finished: None,
            component_environment: AtomicUsize::new(0),
        }
    }

    /// Gives the callbacks to an instance.
    pub fn set_environment(&self, environment: Environment) {
        self.component_environment.store(environment, Ordering::Relaxed);
    }
}

/// Takes a message of FMI 2.0.
///
/// # Safety
/// Each text is null or ends with a zero byte.
unsafe extern "C" fn receive(
    environment: Environment,
    name: *const c_char,
    status: c_int,
    text: *const c_char,
) {
    // SAFETY: the callers' promise.
    let (name, text) = unsafe { (text_at(name), text_at(text)) };
    take(environment, name.as_deref(), status, text);
}

/// The `fmi3LogMessageCallback`.
///
/// # Safety
/// The text is null or ends with a zero byte.
pub unsafe extern "C" fn log_message(
    environment: Environment,
    status: c_int,
    _category: *const c_char,
    text: *const c_char,
) {
    // SAFETY: the callers' promise.
    take(environment, None, status, unsafe { text_at(text) });
}

fn take(environment: Environment, name: Option<&str>, status: c_int, text: Option<String>) {
    let text = text.unwrap_or_else(|| "a message without a text".to_owned());
    live::receive(environment, name, Message { status: Status(status), text, time: None });
}

/// A copy of a C text, if there is one.
///
/// # Safety
/// `text` is null or ends with a zero byte.
unsafe fn text_at(text: *const c_char) -> Option<String> {
    // SAFETY: the caller's promise.
    (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned())
}

/// Copies of the texts that a call has told; none if it failed.
///
/// # Safety
/// If the call succeeded, each text is null or ends with a zero byte.
pub unsafe fn told(called: Called, texts: &[*const c_char]) -> Vec<String> {
    if !called.status.succeeded() {
        return vec![];
    }
    // SAFETY: the caller's promise.
    texts.iter().map(|text| unsafe { text_at(*text) }.unwrap_or_default()).collect()
}
