//! The C side: the functions of an FMU's library and the calls to it, with all of the laboratory's `unsafe`.
//!
//! A library is foreign code and cannot be verified. This module keeps the importer's side of FMI: signatures as
//! declared by each version, valid pointers with their lengths, callbacks that outlive the instance (FMUs keep pointers
//! to them), no call after a fatal error, and no instance in two threads. A status is a plain number, since a careless
//! FMU may return any.
#![allow(unsafe_code)]

use std::cell::Cell;
use std::collections::VecDeque;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::path::Path;
use std::ptr;
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Context, Result, anyhow};
use fmu_export::fmi2::c_types::{Boolean, CO_SIMULATION, Component, FALSE, FmuState, TRUE, ValueReference};
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

/// The `fmi3LogMessageCallback`.
///
/// # Safety
/// The environment is null or the instance's receiver; the text is null or ends with a zero byte.
unsafe extern "C" fn log_message(
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

/// Why a library was not loaded. One from `PythonFMU` expects Python in the process.
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

/// Declares a type of numbers for each kind of memory that an FMU reads and writes.
macro_rules! numbers {
    ($($memory:ident($number:ty)),*) => {
        /// Numbers of one type, as an FMU reads and writes them.
        pub enum Numbers {
            $($memory(Vec<$number>)),*
        }

        /// Their type.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        enum Memory {
            $($memory),*
        }

        impl Numbers {
            fn new(memory: Memory) -> Self {
                match memory {
                    $(Memory::$memory => Self::$memory(vec![])),*
                }
            }

            fn memory(&self) -> Memory {
                match self {
                    $(Self::$memory(_) => Memory::$memory),*
                }
            }

            pub fn len(&self) -> usize {
                match self {
                    $(Self::$memory(values) => values.len()),*
                }
            }

            /// Appends zeros.
            pub fn extend(&mut self, count: usize) {
                match self {
                    $(Self::$memory(values) => values.resize(values.len() + count, <$number>::default())),*
                }
            }

            pub fn get(&self, index: usize) -> f64 {
                match self {
                    $(Self::$memory(values) => values[index].to_real()),*
                }
            }

            pub fn set(&mut self, index: usize, value: f64) {
                match self {
                    $(Self::$memory(values) => values[index] = <$number>::of_real(value)),*
                }
            }

            fn address(&self) -> *const c_void {
                match self {
                    $(Self::$memory(values) => values.as_ptr().cast()),*
                }
            }

            fn address_to_write(&mut self) -> *mut c_void {
                match self {
                    $(Self::$memory(values) => values.as_mut_ptr().cast()),*
                }
            }
        }
    };
}

numbers! {
    F64(f64), F32(f32), I8(i8), U8(u8), I16(i16), U16(u16), I32(i32), U32(u32), I64(i64), U64(u64)
}

/// A number that is exchanged as a Real; a whole one becomes the nearest that the type has.
trait Number {
    fn to_real(self) -> f64;
    fn of_real(value: f64) -> Self;
}

impl Number for f64 {
    fn to_real(self) -> f64 {
        self
    }

    fn of_real(value: f64) -> Self {
        value
    }
}

/// Implements [`Number`] by casts, after rounding for whole numbers. Casts saturate.
macro_rules! number_by_cast {
    ($round:expr, $($number:ty),*) => {
        $(
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)]
            #[allow(clippy::cast_lossless)]
            impl Number for $number {
                fn to_real(self) -> f64 {
                    self as f64
                }

                fn of_real(value: f64) -> Self {
                    let round: fn(f64) -> f64 = $round;
                    round(value) as Self
                }
            }
        )*
    };
}

number_by_cast!(|value| value, f32);
number_by_cast!(f64::round, i8, u8, i16, u16, i32, u32, i64, u64);

/// The types of numbers that FMI 2.0 has functions for, with their memory: an `fmi2Boolean` is an int.
const NUMBERS_OF_FMI2: [(&str, Memory); 3] =
    [("Real", Memory::F64), ("Integer", Memory::I32), ("Boolean", Memory::I32)];

/// Those of FMI 3.0: an `fmi3Boolean` is a C `bool`, which a careless FMU gives any value.
const NUMBERS_OF_FMI3: [(&str, Memory); 11] = [
    ("Float64", Memory::F64),
    ("Float32", Memory::F32),
    ("Int8", Memory::I8),
    ("UInt8", Memory::U8),
    ("Int16", Memory::I16),
    ("UInt16", Memory::U16),
    ("Int32", Memory::I32),
    ("UInt32", Memory::U32),
    ("Int64", Memory::I64),
    ("UInt64", Memory::U64),
    ("Boolean", Memory::U8),
];

type Instantiate2 = unsafe extern "C" fn(
    *const c_char,
    c_int,
    *const c_char,
    *const c_char,
    *const CallbackFunctions,
    Boolean,
    Boolean,
) -> Component;
type Instantiate3 = unsafe extern "C" fn(
    *const c_char,
    *const c_char,
    *const c_char,
    bool,
    bool,
    bool,
    bool,
    *const ValueReference,
    usize,
    *const Receiver,
    LogMessage,
    *const c_void,
) -> Component;
/// `fmi3LogMessageCallback`.
type LogMessage = unsafe extern "C" fn(*const Receiver, c_int, *const c_char, *const c_char);
type OfInstance = unsafe extern "C" fn(Component) -> c_int;
type SetupExperiment2 = unsafe extern "C" fn(Component, Boolean, f64, f64, Boolean, f64) -> c_int;
type EnterInitializationMode3 = unsafe extern "C" fn(Component, bool, f64, f64, bool, f64) -> c_int;
type DoStep2 = unsafe extern "C" fn(Component, f64, f64, Boolean) -> c_int;
type DoStep3 = unsafe extern "C" fn(Component, f64, f64, bool, *mut u8, *mut u8, *mut u8, *mut f64) -> c_int;
type Get2 = unsafe extern "C" fn(Component, *const ValueReference, usize, *mut c_void) -> c_int;
type Get3 = unsafe extern "C" fn(Component, *const ValueReference, usize, *mut c_void, usize) -> c_int;
type Set2 = unsafe extern "C" fn(Component, *const ValueReference, usize, *const c_void) -> c_int;
type Set3 = unsafe extern "C" fn(Component, *const ValueReference, usize, *const c_void, usize) -> c_int;
type GetRealStatus2 = unsafe extern "C" fn(Component, c_int, *mut f64) -> c_int;
type GetBooleanStatus2 = unsafe extern "C" fn(Component, c_int, *mut Boolean) -> c_int;
/// Of a state, `fmi2FMUstate` or `fmi3FMUState`.
type Save = unsafe extern "C" fn(Component, *mut FmuState) -> c_int;
type Restore = unsafe extern "C" fn(Component, FmuState) -> c_int;

/// A library that its functions are looked up in.
struct Symbols {
    library: Library,
    /// `fmi2` or `fmi3`.
    prefix: &'static str,
}

impl Symbols {
    fn state(&self) -> &'static str {
        if self.prefix == "fmi3" { "FMUState" } else { "FMUstate" }
    }

    /// A function, if the library has it.
    ///
    /// # Safety
    /// `Function` is the type that the standard declares for this name.
    unsafe fn find<Function: Copy>(&self, name: &str) -> Option<Function> {
        let name = format!("{}{name}", self.prefix);
        // SAFETY: the caller's promise.
        unsafe { self.library.get::<Function>(name) }.ok().map(|symbol| *symbol)
    }

    /// A function that the library must have.
    ///
    /// # Safety
    /// As [`Symbols::find`].
    unsafe fn get<Function: Copy>(&self, name: &str) -> Result<Function> {
        // SAFETY: the caller's promise.
        unsafe { self.find(name) }.with_context(|| format!("its library has no {}{name}", self.prefix))
    }
}

/// The functions whose arguments differ between the versions.
enum OfVersion {
    Two {
        instantiate: Instantiate2,
        setup_experiment: SetupExperiment2,
        enter_initialization_mode: OfInstance,
        do_step: DoStep2,
        get_real_status: Option<GetRealStatus2>,
        get_boolean_status: Option<GetBooleanStatus2>,
        /// By the position in [`NUMBERS_OF_FMI2`].
        numbers: Vec<(Get2, Set2)>,
        set_string: Set2,
    },
    Three {
        instantiate: Instantiate3,
        enter_initialization_mode: EnterInitializationMode3,
        do_step: DoStep3,
        /// By the position in [`NUMBERS_OF_FMI3`].
        numbers: Vec<(Get3, Set3)>,
        set_string: Set3,
    },
}

/// The functions of an FMU's library, which stays loaded as long as this exists.
pub struct Functions {
    of_version: OfVersion,
    exit_initialization_mode: OfInstance,
    terminate: OfInstance,
    free_instance: unsafe extern "C" fn(Component),
    get_state: Option<Save>,
    set_state: Option<Restore>,
    free_state: Option<Save>,
    symbols: Symbols,
}

impl Functions {
    pub fn load(path: &Path, is_fmi3: bool) -> Result<Self> {
        // SAFETY: loading runs the library's initializers; the user chose to run this FMU's code.
        let library = unsafe { Library::new(path) }.map_err(not_loaded)?;
        let symbols = Symbols { library, prefix: if is_fmi3 { "fmi3" } else { "fmi2" } };
        let state = symbols.state();
        // SAFETY: the standard declares these types for these names.
        unsafe {
            let of_version = if is_fmi3 { OfVersion::three(&symbols) } else { OfVersion::two(&symbols) }?;
            Ok(Self {
                of_version,
                exit_initialization_mode: symbols.get("ExitInitializationMode")?,
                terminate: symbols.get("Terminate")?,
                free_instance: symbols.get("FreeInstance")?,
                get_state: symbols.find(&format!("Get{state}")),
                set_state: symbols.find(&format!("Set{state}")),
                free_state: symbols.find(&format!("Free{state}")),
                symbols,
            })
        }
    }

    /// The word for a state in the names of functions.
    pub fn state(&self) -> &'static str {
        self.symbols.state()
    }

    /// What the names of the functions begin with.
    pub fn prefix(&self) -> &'static str {
        self.symbols.prefix
    }

    fn numbers(&self) -> &'static [(&'static str, Memory)] {
        match self.of_version {
            OfVersion::Two { .. } => &NUMBERS_OF_FMI2,
            OfVersion::Three { .. } => &NUMBERS_OF_FMI3,
        }
    }

    /// The functions for a variable's type, if numeric, and the memory for its values.
    pub fn number_type(&self, data_type: &str) -> Option<(NumberType, Numbers)> {
        let wanted = match (data_type, self.prefix()) {
            ("Enumeration", "fmi2") => "Integer",
            ("Enumeration", _) => "Int64",
            (other, _) => other,
        };
        let position = self.numbers().iter().position(|(name, _)| *name == wanted)?;
        Some((NumberType(position), Numbers::new(self.numbers()[position].1)))
    }

    /// The name of a type in those of its functions.
    pub fn name(&self, number_type: NumberType) -> &'static str {
        self.numbers()[number_type.0].0
    }
}

/// A type that a library has functions for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NumberType(usize);

impl OfVersion {
    /// # Safety
    /// The library is one of FMI 2.0.
    unsafe fn two(symbols: &Symbols) -> Result<Self> {
        let numbers = NUMBERS_OF_FMI2.iter().map(|(name, _)| {
            // SAFETY: the standard declares these types for these names; a pointer to numbers is one to bytes.
            unsafe { Ok((symbols.get(&format!("Get{name}"))?, symbols.get(&format!("Set{name}"))?)) }
        });
        // SAFETY: the standard declares these types for these names.
        unsafe {
            Ok(Self::Two {
                instantiate: symbols.get("Instantiate")?,
                setup_experiment: symbols.get("SetupExperiment")?,
                enter_initialization_mode: symbols.get("EnterInitializationMode")?,
                do_step: symbols.get("DoStep")?,
                get_real_status: symbols.find("GetRealStatus"),
                get_boolean_status: symbols.find("GetBooleanStatus"),
                numbers: numbers.collect::<Result<_>>()?,
                set_string: symbols.get("SetString")?,
            })
        }
    }

    /// # Safety
    /// The library is one of FMI 3.0.
    unsafe fn three(symbols: &Symbols) -> Result<Self> {
        let numbers = NUMBERS_OF_FMI3.iter().map(|(name, _)| {
            // SAFETY: as above.
            unsafe { Ok((symbols.get(&format!("Get{name}"))?, symbols.get(&format!("Set{name}"))?)) }
        });
        // SAFETY: as above.
        unsafe {
            Ok(Self::Three {
                instantiate: symbols.get("InstantiateCoSimulation")?,
                enter_initialization_mode: symbols.get("EnterInitializationMode")?,
                do_step: symbols.get("DoStep")?,
                numbers: numbers.collect::<Result<_>>()?,
                set_string: symbols.get("SetString")?,
            })
        }
    }
}

/// `fmi2LastSuccessfulTime` of `fmi2StatusKind`.
const LAST_SUCCESSFUL_TIME: c_int = 2;
/// `fmi2Terminated`, beside it.
const TERMINATED: c_int = 3;

/// An instance. It and its saved states stay in one thread.
pub struct Handle {
    component: Component,
    functions: Arc<Functions>,
    receiver: Box<Receiver>,
    /// When the experiment starts and stops (s), which FMI 3.0 takes with the initialization.
    experiment: Cell<(f64, Option<f64>)>,
    /// The relative tolerance that the FMU is given, if it is.
    pub(super) tolerance: Cell<Option<f64>>,
    /// In FMI 3.0, what the last step said.
    last_step: Cell<LastStep>,
    /// Whether `Terminate` is due before the instance is freed.
    steps: Cell<bool>,
    /// Whether a fatal error occurred, after which the standard forbids any call.
    is_dead: Cell<bool>,
    // The FMU may keep pointers to these.
    _callbacks: Box<CallbackFunctions>,
    _texts: [CString; 3],
}

/// The results of an FMI 3.0 step besides its status.
#[derive(Clone, Copy, Default)]
struct LastStep {
    /// The time that it has reached (s).
    time: f64,
    /// Whether the FMU requests termination.
    terminates: bool,
}

impl Handle {
    pub fn new(functions: &Arc<Functions>, texts: [CString; 3]) -> std::result::Result<Self, Vec<Message>> {
        let receiver = Box::new(Receiver { receive, messages: Mutex::default() });
        let callbacks = Box::new(CallbackFunctions {
            logger: fmu_master_log,
            allocate_memory: calloc,
            free_memory: free,
            step_finished: ptr::null(),
            component_environment: &raw const *receiver,
        });
        let [name, guid, resources] = &texts;
        let component = match functions.of_version {
            // SAFETY: the texts and the callbacks, in boxes that do not move, live as long as the instance.
            OfVersion::Two { instantiate, .. } => unsafe {
                instantiate(
                    name.as_ptr(),
                    CO_SIMULATION,
                    guid.as_ptr(),
                    resources.as_ptr(),
                    &raw const *callbacks,
                    FALSE,
                    TRUE,
                )
            },
            // SAFETY: as above. Neither visible, nor with Event Mode, early return or intermediate updates, but with
            // messages.
            OfVersion::Three { instantiate, .. } => unsafe {
                instantiate(
                    name.as_ptr(),
                    guid.as_ptr(),
                    resources.as_ptr(),
                    false,
                    true,
                    false,
                    false,
                    ptr::null(),
                    0,
                    &raw const *receiver,
                    log_message,
                    ptr::null(),
                )
            },
        };
        if component.is_null() {
            return Err(receiver.take());
        }
        Ok(Self {
            component,
            functions: Arc::clone(functions),
            receiver,
            experiment: Cell::default(),
            tolerance: Cell::default(),
            last_step: Cell::default(),
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

    /// Sets when the experiment starts and stops (s).
    pub fn setup_experiment(&self, start_time: f64, stop_time: Option<f64>) -> Status {
        self.experiment.set((start_time, stop_time));
        let OfVersion::Two { setup_experiment, .. } = self.functions.of_version else { return Status::OK };
        let (is_defined, stop_time) = stop_time.map_or((FALSE, 0.0), |time| (TRUE, time));
        // SAFETY: the component is alive.
        self.call(|component| unsafe {
            let (has_tolerance, tolerance) =
                self.tolerance.get().map_or((FALSE, 0.0), |tolerance| (TRUE, tolerance));
            setup_experiment(component, has_tolerance, tolerance, start_time, is_defined, stop_time)
        })
    }

    pub fn enter_initialization_mode(&self) -> Status {
        let (start_time, stop_time) = self.experiment.get();
        // SAFETY: the component is alive.
        self.call(|component| unsafe {
            match self.functions.of_version {
                OfVersion::Two { enter_initialization_mode, .. } => enter_initialization_mode(component),
                OfVersion::Three { enter_initialization_mode, .. } => enter_initialization_mode(
                    component,
                    self.tolerance.get().is_some(),
                    self.tolerance.get().unwrap_or(0.0),
                    start_time,
                    stop_time.is_some(),
                    stop_time.unwrap_or(0.0),
                ),
            }
        })
    }

    pub fn exit_initialization_mode(&self) -> Status {
        // SAFETY: the component is alive.
        let status = self.call(|component| unsafe { (self.functions.exit_initialization_mode)(component) });
        self.steps.set(status.succeeded());
        status
    }

    /// Steps. A state that was saved may be restored after it.
    pub fn do_step(&self, time: f64, size: f64) -> Status {
        let (mut flags, mut reached) = ([0_u8; 3], f64::NAN);
        let [event, terminates, early] = &mut flags;
        // SAFETY: the component is alive, the places to write to are ours; a C `bool` is a byte.
        let status = self.call(|component| unsafe {
            match self.functions.of_version {
                OfVersion::Two { do_step, .. } => do_step(component, time, size, FALSE),
                OfVersion::Three { do_step, .. } => {
                    do_step(component, time, size, false, event, terminates, early, &raw mut reached)
                }
            }
        });
        self.last_step.set(LastStep { time: reached, terminates: flags[1] != 0 });
        self.steps.set(status.succeeded());
        status
    }

    /// After a step that succeeded, or in FMI 2.0 was discarded: whether the FMU asks for the end.
    pub fn terminates(&self) -> bool {
        let OfVersion::Two { get_boolean_status: Some(get), .. } = self.functions.of_version else {
            return self.last_step.get().terminates;
        };
        let mut terminates = FALSE;
        // SAFETY: the component is alive, the place to write to is ours.
        let status = self.call(|component| unsafe { get(component, TERMINATED, &raw mut terminates) });
        status.succeeded() && terminates != FALSE
    }

    /// After a discarded step or a request for termination: the time reached, if the FMU provides it.
    pub fn last_successful_time(&self) -> Option<f64> {
        let mut time = self.last_step.get().time;
        if let OfVersion::Two { get_real_status, .. } = self.functions.of_version {
            let get = get_real_status?;
            // SAFETY: the component is alive, the place to write to is ours.
            let status =
                self.call(|component| unsafe { get(component, LAST_SUCCESSFUL_TIME, &raw mut time) });
            if !status.succeeded() {
                return None;
            }
        }
        Some(time).filter(|time| time.is_finite())
    }

    /// Gets numbers of a type.
    pub fn get(
        &self,
        number_type: NumberType,
        references: &[ValueReference],
        values: &mut Numbers,
    ) -> Status {
        self.refuse_other_memory(number_type, references, values);
        let (count, size, address) = (references.len(), values.len(), values.address_to_write());
        // SAFETY: the component is alive, the values have the type's memory; each reference has its value, or in FMI
        // 3.0 the array's, by whose number an FMU tells whether they are all.
        self.call(|component| unsafe {
            match &self.functions.of_version {
                OfVersion::Two { numbers, .. } => {
                    numbers[number_type.0].0(component, references.as_ptr(), count, address)
                }
                OfVersion::Three { numbers, .. } => {
                    numbers[number_type.0].0(component, references.as_ptr(), count, address, size)
                }
            }
        })
    }

    /// Sets numbers of a type.
    pub fn set(&self, number_type: NumberType, references: &[ValueReference], values: &Numbers) -> Status {
        self.refuse_other_memory(number_type, references, values);
        let (count, size, address) = (references.len(), values.len(), values.address());
        // SAFETY: as in `get`.
        self.call(|component| unsafe {
            match &self.functions.of_version {
                OfVersion::Two { numbers, .. } => {
                    numbers[number_type.0].1(component, references.as_ptr(), count, address)
                }
                OfVersion::Three { numbers, .. } => {
                    numbers[number_type.0].1(component, references.as_ptr(), count, address, size)
                }
            }
        })
    }

    fn refuse_other_memory(&self, number_type: NumberType, references: &[ValueReference], values: &Numbers) {
        assert_eq!(values.memory(), self.functions.numbers()[number_type.0].1, "values of this type");
        assert!(references.len() <= values.len(), "each reference has its value");
    }

    /// Sets one text.
    pub fn set_string(&self, reference: ValueReference, value: &CStr) -> Status {
        let text = value.as_ptr();
        let texts: *const c_void = (&raw const text).cast();
        // SAFETY: the component is alive, both arrays have one element.
        self.call(|component| unsafe {
            match self.functions.of_version {
                OfVersion::Two { set_string, .. } => set_string(component, &raw const reference, 1, texts),
                OfVersion::Three { set_string, .. } => {
                    set_string(component, &raw const reference, 1, texts, 1)
                }
            }
        })
    }

    /// Saves the state; none where the FMU has no such function.
    pub fn get_state(&self) -> Option<(Status, FmuState)> {
        let get = self.functions.get_state?;
        let mut state = ptr::null_mut();
        // SAFETY: the component is alive; a null state asks for a new one.
        let status = self.call(|component| unsafe { get(component, &raw mut state) });
        Some((status, state))
    }

    /// Restores a state; none where the FMU has no such function.
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
