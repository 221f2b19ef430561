//! The functions of an FMU's library, with the types that each version of FMI declares.

use std::ffi::{c_char, c_int, c_void};
use std::path::Path;

use anyhow::{Context, Result, anyhow};
use fmu_export::fmi2::c_types::{Boolean, Component, EventInfo, FmuState, ValueReference};
use libloading::Library;

use super::super::numbers::{Memory, NUMBERS_OF_FMI2, NUMBERS_OF_FMI3, Numbers};
use super::logger::{CallbackFunctions, Receiver};

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

type Instantiate2 = unsafe extern "C" fn(
    *const c_char,
    c_int,
    *const c_char,
    *const c_char,
    *const CallbackFunctions,
    Boolean,
    Boolean,
) -> Component;
type InstantiateExchange3 = unsafe extern "C" fn(
    *const c_char,
    *const c_char,
    *const c_char,
    bool,
    bool,
    *const Receiver,
    LogMessage,
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
type SetTime = unsafe extern "C" fn(Component, f64) -> c_int;
type GetVector = unsafe extern "C" fn(Component, *mut f64, usize) -> c_int;
type SetVector = unsafe extern "C" fn(Component, *const f64, usize) -> c_int;
type CompletedIntegratorStep2 = unsafe extern "C" fn(Component, Boolean, *mut Boolean, *mut Boolean) -> c_int;
type CompletedIntegratorStep3 = unsafe extern "C" fn(Component, bool, *mut u8, *mut u8) -> c_int;
type GetDirectionalDerivative2 = unsafe extern "C" fn(
    Component,
    *const ValueReference,
    usize,
    *const ValueReference,
    usize,
    *const f64,
    *mut f64,
) -> c_int;
type GetDirectionalDerivative3 = unsafe extern "C" fn(
    Component,
    *const ValueReference,
    usize,
    *const ValueReference,
    usize,
    *const f64,
    usize,
    *mut f64,
    usize,
) -> c_int;
type NewDiscreteStates2 = unsafe extern "C" fn(Component, *mut EventInfo) -> c_int;
type UpdateDiscreteStates3 =
    unsafe extern "C" fn(Component, *mut u8, *mut u8, *mut u8, *mut u8, *mut u8, *mut f64) -> c_int;
type SetClock3 = unsafe extern "C" fn(Component, *const ValueReference, usize, *const bool) -> c_int;
type GetInterval3 =
    unsafe extern "C" fn(Component, *const ValueReference, usize, *mut f64, *mut c_int) -> c_int;
type GetShift3 = unsafe extern "C" fn(Component, *const ValueReference, usize, *mut f64) -> c_int;
type GetNumber3 = unsafe extern "C" fn(Component, *mut usize) -> c_int;
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
    fn is_fmi3(&self) -> bool {
        self.prefix == "fmi3"
    }

    fn state(&self) -> &'static str {
        if self.is_fmi3() { "FMUState" } else { "FMUstate" }
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
pub enum OfVersion {
    Two {
        instantiate: Instantiate2,
        setup_experiment: SetupExperiment2,
        enter_initialization_mode: OfInstance,
        do_step: Option<DoStep2>,
        get_real_status: Option<GetRealStatus2>,
        get_boolean_status: Option<GetBooleanStatus2>,
        /// By the position in [`NUMBERS_OF_FMI2`].
        numbers: Vec<(Get2, Set2)>,
        set_string: Set2,
    },
    Three {
        instantiate: Instantiate,
        enter_initialization_mode: EnterInitializationMode3,
        do_step: Option<DoStep3>,
        /// By the position in [`NUMBERS_OF_FMI3`].
        numbers: Vec<(Get3, Set3)>,
        set_string: Set3,
    },
}

/// The function of FMI 3.0 that makes an instance.
pub enum Instantiate {
    CoSimulation(Instantiate3),
    ModelExchange(InstantiateExchange3),
}

/// The functions of Event Mode.
pub struct EventMode {
    pub enter: OfInstance,
    /// `EnterContinuousTimeMode` of Model Exchange, `EnterStepMode` of co-simulation.
    pub leave: OfInstance,
    pub update: Update,
}

/// Those that update discrete states, and in FMI 3.0 handle clocks.
pub enum Update {
    Two(NewDiscreteStates2),
    Three { update: UpdateDiscreteStates3, set_clock: SetClock3, interval: GetInterval3, shift: GetShift3 },
}

/// The functions of Model Exchange besides those of Event Mode.
pub struct Exchange {
    pub set_time: SetTime,
    pub set_states: SetVector,
    /// By [`Vector`].
    pub get: [GetVector; Vector::COUNT],
    /// Of FMI 3.0; in FMI 2.0 the modelDescription.xml has it.
    pub number_of_indicators: Option<GetNumber3>,
    pub completed_integrator_step: CompletedIntegratorStep,
    pub directional_derivative: Option<DirectionalDerivative>,
}

pub enum CompletedIntegratorStep {
    Two(CompletedIntegratorStep2),
    Three(CompletedIntegratorStep3),
}

pub enum DirectionalDerivative {
    Two(GetDirectionalDerivative2),
    Three(GetDirectionalDerivative3),
}

/// Numbers that a solver reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vector {
    States,
    Nominals,
    Derivatives,
    Indicators,
}

impl Vector {
    const COUNT: usize = 4;

    /// The name of its function.
    pub fn name(self, is_fmi3: bool) -> &'static str {
        match self {
            Self::States => "GetContinuousStates",
            Self::Nominals => "GetNominalsOfContinuousStates",
            Self::Derivatives if is_fmi3 => "GetContinuousStateDerivatives",
            Self::Derivatives => "GetDerivatives",
            Self::Indicators => "GetEventIndicators",
        }
    }
}

/// The functions of an FMU's library, which stays loaded as long as this exists.
pub struct Functions {
    pub of_version: OfVersion,
    pub exit_initialization_mode: OfInstance,
    pub terminate: OfInstance,
    pub free_instance: unsafe extern "C" fn(Component),
    pub get_state: Option<Save>,
    pub set_state: Option<Restore>,
    pub free_state: Option<Save>,
    pub event_mode: Option<EventMode>,
    pub exchange: Option<Exchange>,
    symbols: Symbols,
}

impl Functions {
    /// Loads a library of FMI 2.0 or 3.0, for co-simulation or Model Exchange, which has Event Mode.
    pub fn load(path: &Path, is_fmi3: bool, is_exchange: bool, has_event_mode: bool) -> Result<Self> {
        // SAFETY: loading runs the library's initializers; the user chose to run this FMU's code.
        let library = unsafe { Library::new(path) }.map_err(not_loaded)?;
        let symbols = Symbols { library, prefix: if is_fmi3 { "fmi3" } else { "fmi2" } };
        let state = symbols.state();
        // SAFETY: the standard declares these types for these names.
        unsafe {
            let of_version = if is_fmi3 {
                OfVersion::three(&symbols, is_exchange)
            } else {
                OfVersion::two(&symbols, is_exchange)
            };
            Ok(Self {
                of_version: of_version?,
                event_mode: has_event_mode.then(|| EventMode::load(&symbols, is_exchange)).transpose()?,
                exchange: is_exchange.then(|| Exchange::load(&symbols)).transpose()?,
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

    pub fn is_fmi3(&self) -> bool {
        self.symbols.is_fmi3()
    }

    /// What the names of the functions begin with.
    pub fn prefix(&self) -> &'static str {
        self.symbols.prefix
    }

    pub fn numbers(&self) -> &'static [(&'static str, Memory)] {
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
pub struct NumberType(pub usize);

impl OfVersion {
    /// # Safety
    /// The library is one of FMI 2.0.
    unsafe fn two(symbols: &Symbols, is_exchange: bool) -> Result<Self> {
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
                do_step: (!is_exchange).then(|| symbols.get("DoStep")).transpose()?,
                get_real_status: symbols.find("GetRealStatus"),
                get_boolean_status: symbols.find("GetBooleanStatus"),
                numbers: numbers.collect::<Result<_>>()?,
                set_string: symbols.get("SetString")?,
            })
        }
    }

    /// # Safety
    /// The library is one of FMI 3.0.
    unsafe fn three(symbols: &Symbols, is_exchange: bool) -> Result<Self> {
        let numbers = NUMBERS_OF_FMI3.iter().map(|(name, _)| {
            // SAFETY: as above.
            unsafe { Ok((symbols.get(&format!("Get{name}"))?, symbols.get(&format!("Set{name}"))?)) }
        });
        // SAFETY: as above.
        unsafe {
            Ok(Self::Three {
                instantiate: if is_exchange {
                    Instantiate::ModelExchange(symbols.get("InstantiateModelExchange")?)
                } else {
                    Instantiate::CoSimulation(symbols.get("InstantiateCoSimulation")?)
                },
                enter_initialization_mode: symbols.get("EnterInitializationMode")?,
                do_step: (!is_exchange).then(|| symbols.get("DoStep")).transpose()?,
                numbers: numbers.collect::<Result<_>>()?,
                set_string: symbols.get("SetString")?,
            })
        }
    }
}

impl EventMode {
    /// # Safety
    /// The library is one of the version.
    unsafe fn load(symbols: &Symbols, is_exchange: bool) -> Result<Self> {
        // SAFETY: the standard declares these types for these names.
        unsafe {
            Ok(Self {
                enter: symbols.get("EnterEventMode")?,
                leave: symbols.get(if is_exchange { "EnterContinuousTimeMode" } else { "EnterStepMode" })?,
                update: if symbols.is_fmi3() {
                    Update::Three {
                        update: symbols.get("UpdateDiscreteStates")?,
                        set_clock: symbols.get("SetClock")?,
                        interval: symbols.get("GetIntervalDecimal")?,
                        shift: symbols.get("GetShiftDecimal")?,
                    }
                } else {
                    Update::Two(symbols.get("NewDiscreteStates")?)
                },
            })
        }
    }
}

impl Exchange {
    /// # Safety
    /// The library is one of the version.
    unsafe fn load(symbols: &Symbols) -> Result<Self> {
        let is_fmi3 = symbols.is_fmi3();
        let get = |vector: Vector| {
            // SAFETY: the standard declares this type for these names.
            unsafe { symbols.get::<GetVector>(vector.name(is_fmi3)) }
        };
        // SAFETY: the standard declares these types for these names.
        unsafe {
            Ok(Self {
                set_time: symbols.get("SetTime")?,
                set_states: symbols.get("SetContinuousStates")?,
                get: [
                    get(Vector::States)?,
                    get(Vector::Nominals)?,
                    get(Vector::Derivatives)?,
                    get(Vector::Indicators)?,
                ],
                number_of_indicators: if is_fmi3 {
                    Some(symbols.get("GetNumberOfEventIndicators")?)
                } else {
                    None
                },
                completed_integrator_step: if is_fmi3 {
                    CompletedIntegratorStep::Three(symbols.get("CompletedIntegratorStep")?)
                } else {
                    CompletedIntegratorStep::Two(symbols.get("CompletedIntegratorStep")?)
                },
                directional_derivative: if is_fmi3 {
                    symbols.find("GetDirectionalDerivative").map(DirectionalDerivative::Three)
                } else {
                    symbols.find("GetDirectionalDerivative").map(DirectionalDerivative::Two)
                },
            })
        }
    }
}
