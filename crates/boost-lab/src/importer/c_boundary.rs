//! The C side: the functions of an FMU's library, and the calls that go through it. All of the laboratory's
//! `unsafe` is here.
//!
//! A library is foreign code, and cannot be verified. This module keeps the importer's side of FMI 2.0: signatures
//! as the standard declares them, valid pointers with their lengths, callbacks that outlive the instance (FMUs keep
//! the pointer to them), no call after a fatal error, and no instance in two threads. A status is a plain number,
//! since a careless FMU returns any.
#![allow(unsafe_code)]

use std::cell::Cell;
use std::collections::VecDeque;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::path::Path;
use std::ptr;
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Context, Result, anyhow};
use fmu_export::fmi2::c_types::{
    Boolean, CO_SIMULATION, Component, FALSE, FmuState, Integer, TRUE, ValueReference,
};
use libloading::Library;

use super::messages::{Message, Status};

/// The number of messages kept for an instance: the last ones.
const KEPT_MESSAGES: usize = 1000;

/// `fmi2CallbackFunctions` (FMI 2.0.5, section 2.1.5).
#[repr(C)]
struct CallbackFunctions {
    logger: unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...),
    allocate_memory: unsafe extern "C" fn(usize, usize) -> *mut c_void,
    free_memory: unsafe extern "C" fn(*mut c_void),
    step_finished: *const c_void,
    component_environment: *const Receiver,
}

unsafe extern "C" {
    /// Defined in logger.c.
    fn boost_lab_log(
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
struct Receiver {
    receive: unsafe extern "C" fn(*const Receiver, c_int, *const c_char),
    messages: Mutex<VecDeque<Message>>,
}

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

/// Why a library was not loaded. That of an FMU from `PythonFMU` expects Python in the process.
fn not_loaded(error: libloading::Error) -> anyhow::Error {
    // The loader's text is the source of the error.
    let text = format!("{:#}", anyhow::Error::new(error));
    let remedy = if ["_Py", "Py"].iter().any(|symbol| text.contains(&format!("undefined symbol: {symbol}"))) {
        "; FMUs of PythonFMU expect Python's library in the process: put LD_PRELOAD=libpython3.11.so, with the path and \
         the version of yours, before the command"
    } else {
        ""
    };
    anyhow!("its library cannot be loaded: {text}{remedy}")
}

/// Declares the functions of a library: the required ones and the optional ones.
macro_rules! functions {
    (
        required { $($name:ident: $symbol:literal ($($argument:ty),*) $(-> $result:ty)?;)* }
        optional { $($other:ident: $other_symbol:literal ($($other_argument:ty),*) -> $other_result:ty;)* }
    ) => {
        /// The functions of an FMU's library, which stays loaded as long as this exists.
        pub struct Functions {
            $($name: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
            $($other: Option<unsafe extern "C" fn($($other_argument),*) -> $other_result>,)*
            _library: Library,
        }

        impl Functions {
            pub fn load(path: &Path) -> Result<Self> {
                // SAFETY: loading runs the library's initializers; the user chose to run this FMU's code.
                let library = unsafe { Library::new(path) }.map_err(not_loaded)?;
                Ok(Self {
                    $(
                        // SAFETY: the standard declares this signature for this name.
                        $name: *unsafe { library.get($symbol) }.with_context(|| {
                            format!("its library has no {}", concat!($symbol))
                        })?,
                    )*
                    $(
                        // SAFETY: as above.
                        $other: unsafe { library.get($other_symbol) }.ok().map(|symbol| *symbol),
                    )*
                    _library: library,
                })
            }
        }
    };
}

functions! {
    required {
        instantiate: "fmi2Instantiate" (
            *const c_char, c_int, *const c_char, *const c_char, *const CallbackFunctions, Boolean, Boolean
        ) -> Component;
        free_instance: "fmi2FreeInstance" (Component);
        setup_experiment: "fmi2SetupExperiment" (Component, Boolean, f64, f64, Boolean, f64) -> c_int;
        enter_initialization_mode: "fmi2EnterInitializationMode" (Component) -> c_int;
        exit_initialization_mode: "fmi2ExitInitializationMode" (Component) -> c_int;
        terminate: "fmi2Terminate" (Component) -> c_int;
        get_real: "fmi2GetReal" (Component, *const ValueReference, usize, *mut f64) -> c_int;
        get_integer: "fmi2GetInteger" (Component, *const ValueReference, usize, *mut Integer) -> c_int;
        get_boolean: "fmi2GetBoolean" (Component, *const ValueReference, usize, *mut Boolean) -> c_int;
        set_real: "fmi2SetReal" (Component, *const ValueReference, usize, *const f64) -> c_int;
        set_integer: "fmi2SetInteger" (Component, *const ValueReference, usize, *const Integer) -> c_int;
        set_boolean: "fmi2SetBoolean" (Component, *const ValueReference, usize, *const Boolean) -> c_int;
        set_string: "fmi2SetString" (Component, *const ValueReference, usize, *const *const c_char) -> c_int;
        do_step: "fmi2DoStep" (Component, f64, f64, Boolean) -> c_int;
    }
    optional {
        get_state: "fmi2GetFMUstate" (Component, *mut FmuState) -> c_int;
        set_state: "fmi2SetFMUstate" (Component, FmuState) -> c_int;
        free_state: "fmi2FreeFMUstate" (Component, *mut FmuState) -> c_int;
        get_real_status: "fmi2GetRealStatus" (Component, c_int, *mut f64) -> c_int;
    }
}

type Get<T> = unsafe extern "C" fn(Component, *const ValueReference, usize, *mut T) -> c_int;
type Set<T> = unsafe extern "C" fn(Component, *const ValueReference, usize, *const T) -> c_int;

/// `fmi2LastSuccessfulTime` of `fmi2StatusKind`.
const LAST_SUCCESSFUL_TIME: c_int = 2;

/// An instance. It and its saved states stay in one thread.
pub struct Handle {
    component: Component,
    functions: Arc<Functions>,
    receiver: Box<Receiver>,
    /// Whether `fmi2Terminate` is due before the instance is freed.
    steps: Cell<bool>,
    /// Whether a fatal error occurred, after which the standard forbids any call.
    is_dead: Cell<bool>,
    // The FMU may keep pointers to these.
    _callbacks: Box<CallbackFunctions>,
    _texts: [CString; 3],
}

impl Handle {
    pub fn new(functions: &Arc<Functions>, texts: [CString; 3]) -> std::result::Result<Self, Vec<Message>> {
        let receiver = Box::new(Receiver { receive, messages: Mutex::default() });
        let callbacks = Box::new(CallbackFunctions {
            logger: boost_lab_log,
            allocate_memory: calloc,
            free_memory: free,
            step_finished: ptr::null(),
            component_environment: &raw const *receiver,
        });
        let [name, guid, resources] = &texts;
        // SAFETY: the texts and the callbacks, in boxes that do not move, live as long as the instance.
        let component = unsafe {
            (functions.instantiate)(
                name.as_ptr(),
                CO_SIMULATION,
                guid.as_ptr(),
                resources.as_ptr(),
                &raw const *callbacks,
                FALSE,
                TRUE,
            )
        };
        if component.is_null() {
            return Err(receiver.take());
        }
        Ok(Self {
            component,
            functions: Arc::clone(functions),
            receiver,
            steps: Cell::new(false),
            is_dead: Cell::new(false),
            _callbacks: callbacks,
            _texts: texts,
        })
    }

    /// The messages since the last call of this function.
    pub fn take_messages(&self) -> Vec<Message> {
        self.receiver.take()
    }

    /// Calls a function, unless the instance is dead.
    fn call(&self, function: impl FnOnce(Component) -> c_int) -> Status {
        if self.is_dead.get() {
            return Status::FATAL;
        }
        let status = Status(function(self.component));
        if status == Status::FATAL {
            self.is_dead.set(true);
        }
        status
    }

    pub fn setup_experiment(&self, start_time: f64, stop_time: Option<f64>) -> Status {
        let (is_defined, stop_time) = stop_time.map_or((FALSE, 0.0), |time| (TRUE, time));
        // SAFETY: the component is alive.
        self.call(|component| unsafe {
            (self.functions.setup_experiment)(component, FALSE, 0.0, start_time, is_defined, stop_time)
        })
    }

    pub fn enter_initialization_mode(&self) -> Status {
        // SAFETY: the component is alive.
        self.call(|component| unsafe { (self.functions.enter_initialization_mode)(component) })
    }

    pub fn exit_initialization_mode(&self) -> Status {
        // SAFETY: the component is alive.
        let status = self.call(|component| unsafe { (self.functions.exit_initialization_mode)(component) });
        self.steps.set(status.succeeded());
        status
    }

    /// Calls `fmi2DoStep`. A state that was saved may be restored after it.
    pub fn do_step(&self, time: f64, size: f64) -> Status {
        // SAFETY: the component is alive.
        let status = self.call(|component| unsafe { (self.functions.do_step)(component, time, size, FALSE) });
        self.steps.set(status.succeeded());
        status
    }

    /// After a discarded step: the time up to which it succeeded, if the FMU tells.
    pub fn last_successful_time(&self) -> Option<f64> {
        let get = self.functions.get_real_status?;
        let mut time = f64::NAN;
        // SAFETY: the component is alive, the place to write to is ours.
        let status = self.call(|component| unsafe { get(component, LAST_SUCCESSFUL_TIME, &raw mut time) });
        status.succeeded().then_some(time).filter(|time| time.is_finite())
    }

    /// Calls one of the instance's functions that get numbers.
    fn get<T>(&self, function: Get<T>, references: &[ValueReference], values: &mut [T]) -> Status {
        assert_eq!(references.len(), values.len(), "each value has its reference");
        // SAFETY: the component is alive, both arrays have this length.
        self.call(|component| unsafe {
            function(component, references.as_ptr(), references.len(), values.as_mut_ptr())
        })
    }

    /// Calls one of the instance's functions that set numbers.
    fn set<T>(&self, function: Set<T>, references: &[ValueReference], values: &[T]) -> Status {
        assert_eq!(references.len(), values.len(), "each value has its reference");
        // SAFETY: the component is alive, both arrays have this length.
        self.call(|component| unsafe {
            function(component, references.as_ptr(), references.len(), values.as_ptr())
        })
    }

    pub fn get_real(&self, references: &[ValueReference], values: &mut [f64]) -> Status {
        self.get(self.functions.get_real, references, values)
    }

    pub fn get_integer(&self, references: &[ValueReference], values: &mut [Integer]) -> Status {
        self.get(self.functions.get_integer, references, values)
    }

    pub fn get_boolean(&self, references: &[ValueReference], values: &mut [Boolean]) -> Status {
        self.get(self.functions.get_boolean, references, values)
    }

    pub fn set_real(&self, references: &[ValueReference], values: &[f64]) -> Status {
        self.set(self.functions.set_real, references, values)
    }

    pub fn set_integer(&self, references: &[ValueReference], values: &[Integer]) -> Status {
        self.set(self.functions.set_integer, references, values)
    }

    pub fn set_boolean(&self, references: &[ValueReference], values: &[Boolean]) -> Status {
        self.set(self.functions.set_boolean, references, values)
    }

    /// Calls `fmi2SetString` for one variable.
    pub fn set_string(&self, reference: ValueReference, value: &CStr) -> Status {
        let text = value.as_ptr();
        // SAFETY: the component is alive, both arrays have one element.
        self.call(|component| unsafe {
            (self.functions.set_string)(component, &raw const reference, 1, &raw const text)
        })
    }

    /// Calls `fmi2GetFMUstate`; none where the FMU has no such function.
    pub fn get_state(&self) -> Option<(Status, FmuState)> {
        let get = self.functions.get_state?;
        let mut state = ptr::null_mut();
        // SAFETY: the component is alive; a null state asks for a new one.
        let status = self.call(|component| unsafe { get(component, &raw mut state) });
        Some((status, state))
    }

    /// Calls `fmi2SetFMUstate`; none where the FMU has no such function.
    pub fn set_state(&self, state: FmuState) -> Option<Status> {
        let set = self.functions.set_state?;
        // SAFETY: the component is alive, and the state is one that it gave and that is not freed.
        let status = self.call(|component| unsafe { set(component, state) });
        // What a step before made impossible is possible again.
        self.steps.set(status.succeeded());
        Some(status)
    }

    pub fn free_state(&self, mut state: FmuState) {
        if let Some(free) = self.functions.free_state {
            // SAFETY: the component is alive, and the state is one that it gave and that is not freed.
            self.call(|component| unsafe { free(component, &raw mut state) });
        }
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        if self.steps.get() {
            // SAFETY: the component is alive.
            self.call(|component| unsafe { (self.functions.terminate)(component) });
        }
        if !self.is_dead.get() {
            // SAFETY: the component is alive, and this is the last call.
            unsafe { (self.functions.free_instance)(self.component) };
        }
    }
}

impl Receiver {
    fn take(&self) -> Vec<Message> {
        self.messages.lock().unwrap_or_else(PoisonError::into_inner).drain(..).collect()
    }
}
