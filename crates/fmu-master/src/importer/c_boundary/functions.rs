//! The functions of an FMU's library, with the types that each version of FMI declares.

use std::ffi::{c_char, c_int, c_void};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use anyhow::{Context, Result, anyhow};
use fmu_export::fmi2::c_types::{Boolean, Component, EventInfo, FmuState, ValueReference};
use fmu_io::temporary::Folder;
use libloading::Library;

use super::super::messages::Function;
use super::super::numbers::{Memory, NUMBERS_OF_FMI2, NUMBERS_OF_FMI3, Numbers};
use super::live::{Call, Environment, Live};
use super::logger::CallbackFunctions;

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

/// A library that its functions are looked up in.
struct Symbols {
    library: Library,
    /// `fmi2` or `fmi3`.
    prefix: &'static str,
}

impl Symbols {
    /// The word for a state in the names of functions.
    fn state(&self) -> &'static str {
        if self.prefix == "fmi3" { "FMUState" } else { "FMUstate" }
    }

    /// A function that the library must have.
    ///
    /// # Safety
    /// `Function` is the type that the standard declares for this name.
    unsafe fn get<Function: Copy>(&self, name: &str) -> Result<Function> {
        let name = format!("{}{}", self.prefix, name.replace("FMUState", self.state()));
        // SAFETY: the caller's promise.
        let symbol = unsafe { self.library.get::<Function>(&name) }.ok();
        symbol.map(|symbol| *symbol).with_context(|| format!("its library has no {name}"))
    }
}

/// Declares functions of an instance that a library has together, with their names and further arguments.
macro_rules! functions {
    ($(
        $(#[$meta:meta])*
        $table:ident { $($field:ident: $name:ident($($argument:ty),*)),* $(,)? }
    )*) => {$(
        $(#[$meta])*
        pub struct $table {
            $(pub $field: unsafe extern "C" fn(Component $(, $argument)*) -> c_int),*
        }

        impl $table {
            /// # Safety
            /// The library is one of the version.
            unsafe fn load(symbols: &Symbols) -> Result<Self> {
                // SAFETY: the standard declares these types for these names; a C `bool` is a byte, and a pointer to
                // numbers one to bytes.
                unsafe { Ok(Self { $($field: symbols.get(stringify!($name))?),* }) }
            }
        }
    )*};
}

type References = *const ValueReference;

functions! {
    /// Of both versions and interfaces.
    Common { exit_initialization_mode: ExitInitializationMode(), terminate: Terminate() }

    /// Of saved states.
    States {
        get: GetFMUState(*mut FmuState),
        set: SetFMUState(FmuState),
        free: FreeFMUState(*mut FmuState),
    }

    /// Of FMI 2.0.
    Common2 {
        setup_experiment: SetupExperiment(Boolean, f64, f64, Boolean, f64),
        enter_initialization_mode: EnterInitializationMode(),
        set_string: SetString(References, usize, *const c_void),
    }

    /// Of FMI 3.0.
    Common3 {
        enter_initialization_mode: EnterInitializationMode(bool, f64, f64, bool, f64),
        set_string: SetString(References, usize, *const c_void, usize),
    }

    /// Of co-simulation.
    Step2 { do_step: DoStep(f64, f64, Boolean) }
    Step3 { do_step: DoStep(f64, f64, bool, *mut u8, *mut u8, *mut u8, *mut f64) }

    /// What a step in FMI 2.0 says.
    RealStatus2 { get: GetRealStatus(c_int, *mut f64) }
    BooleanStatus2 { get: GetBooleanStatus(c_int, *mut Boolean) }

    /// Of Model Exchange, in both versions.
    Exchange {
        enter_event_mode: EnterEventMode(),
        enter_continuous_time_mode: EnterContinuousTimeMode(),
        set_time: SetTime(f64),
        set_states: SetContinuousStates(*const f64, usize),
        states: GetContinuousStates(*mut f64, usize),
        nominals: GetNominalsOfContinuousStates(*mut f64, usize),
        indicators: GetEventIndicators(*mut f64, usize),
    }

    /// Of Model Exchange, in one version.
    Exchange2 {
        derivatives: GetDerivatives(*mut f64, usize),
        new_discrete_states: NewDiscreteStates(*mut EventInfo),
        completed_integrator_step: CompletedIntegratorStep(Boolean, *mut Boolean, *mut Boolean),
    }
    Exchange3 {
        derivatives: GetContinuousStateDerivatives(*mut f64, usize),
        completed_integrator_step: CompletedIntegratorStep(bool, *mut u8, *mut u8),
    }

    Directional2 { get: GetDirectionalDerivative(References, usize, References, usize, *const f64, *mut f64) }
    Directional3 {
        get: GetDirectionalDerivative(References, usize, References, usize, *const f64, usize, *mut f64, usize),
    }

    /// Of Event Mode in FMI 3.0.
    Events3 {
        enter_event_mode: EnterEventMode(),
        enter_step_mode: EnterStepMode(),
        update_discrete_states: UpdateDiscreteStates(*mut u8, *mut u8, *mut u8, *mut u8, *mut u8, *mut f64),
        set_clock: SetClock(References, usize, *const bool),
        get_interval: GetIntervalDecimal(References, usize, *mut f64, *mut c_int),
        get_shift: GetShiftDecimal(References, usize, *mut f64),
    }
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
type InstantiateCoSimulation3 = unsafe extern "C" fn(
    *const c_char,
    *const c_char,
    *const c_char,
    bool,
    bool,
    bool,
    bool,
    References,
    usize,
    Environment,
    LogMessage,
    *const c_void,
) -> Component;
type InstantiateModelExchange3 = unsafe extern "C" fn(
    *const c_char,
    *const c_char,
    *const c_char,
    bool,
    bool,
    Environment,
    LogMessage,
) -> Component;
/// `fmi3LogMessageCallback`.
type LogMessage = unsafe extern "C" fn(Environment, c_int, *const c_char, *const c_char);
type Get2 = unsafe extern "C" fn(Component, References, usize, *mut c_void) -> c_int;
type Get3 = unsafe extern "C" fn(Component, References, usize, *mut c_void, usize) -> c_int;
type Set2 = unsafe extern "C" fn(Component, References, usize, *const c_void) -> c_int;
type Set3 = unsafe extern "C" fn(Component, References, usize, *const c_void, usize) -> c_int;

/// The function that makes an instance.
pub enum Instantiate {
    Two(Instantiate2),
    CoSimulation3(InstantiateCoSimulation3),
    ModelExchange3(InstantiateModelExchange3),
}

impl Instantiate {
    /// The function's name, in two parts.
    pub fn name(&self) -> [&'static str; 2] {
        let interface = match self {
            Self::Two(_) => "",
            Self::CoSimulation3(_) => "CoSimulation",
            Self::ModelExchange3(_) => "ModelExchange",
        };
        ["Instantiate", interface]
    }
}

/// What every FMU of a version has.
pub enum OfVersion {
    /// With accessors by the position in [`NUMBERS_OF_FMI2`].
    Two(Common2, Vec<(Get2, Set2)>),
    /// With accessors by the position in [`NUMBERS_OF_FMI3`].
    Three(Common3, Vec<(Get3, Set3)>),
}

/// The functions of an FMU's library: those of its version and interface. As long as this exists, the library stays
/// loaded and its folder stays.
pub struct Functions {
    pub instantiate: Instantiate,
    pub of_version: OfVersion,
    pub common: Common,
    pub free_instance: unsafe extern "C" fn(Component),
    pub states: Option<States>,
    pub step2: Option<Step2>,
    pub step3: Option<Step3>,
    pub real_status2: Option<RealStatus2>,
    pub boolean_status2: Option<BooleanStatus2>,
    pub exchange: Option<Exchange>,
    pub exchange2: Option<Exchange2>,
    pub exchange3: Option<Exchange3>,
    pub directional2: Option<Directional2>,
    pub directional3: Option<Directional3>,
    pub events3: Option<Events3>,
    symbols: Symbols,
    // The callbacks of freed instances, for later ones. Dropped after the library, whose code may use them until it is
    // unloaded.
    callbacks: Mutex<Vec<Arc<CallbackFunctions>>>,
    _live: Live,
    pub folder: Folder,
}

impl Functions {
    /// Loads the library of FMI 2.0 or 3.0 in a folder, for co-simulation or Model Exchange, perhaps with Event Mode.
    ///
    /// # Errors
    /// When it cannot be loaded, or lacks a function.
    pub fn load(
        folder: Folder,
        path: &Path,
        is_fmi3: bool,
        is_exchange: bool,
        has_event_mode: bool,
    ) -> Result<Self> {
        let live = Live::new(path.file_name().unwrap_or_default().to_string_lossy().into_owned());
        // SAFETY: loading runs the library's initializers; the user chose to run this FMU's code.
        let library = live.call(Call::Load, || unsafe { Library::new(path) }).map_err(not_loaded)?;
        let symbols = Symbols { library, prefix: if is_fmi3 { "fmi3" } else { "fmi2" } };
        let it = &symbols;
        // SAFETY: the standard declares these types for these names.
        unsafe {
            Ok(Self {
                instantiate: match (is_fmi3, is_exchange) {
                    (false, _) => Instantiate::Two(it.get("Instantiate")?),
                    (true, false) => Instantiate::CoSimulation3(it.get("InstantiateCoSimulation")?),
                    (true, true) => Instantiate::ModelExchange3(it.get("InstantiateModelExchange")?),
                },
                of_version: if is_fmi3 {
                    OfVersion::Three(Common3::load(it)?, accessors(it, &NUMBERS_OF_FMI3)?)
                } else {
                    OfVersion::Two(Common2::load(it)?, accessors(it, &NUMBERS_OF_FMI2)?)
                },
                common: Common::load(it)?,
                free_instance: it.get("FreeInstance")?,
                states: States::load(it).ok(),
                step2: (!is_fmi3 && !is_exchange).then(|| Step2::load(it)).transpose()?,
                step3: (is_fmi3 && !is_exchange).then(|| Step3::load(it)).transpose()?,
                real_status2: RealStatus2::load(it).ok(),
                boolean_status2: BooleanStatus2::load(it).ok(),
                exchange: is_exchange.then(|| Exchange::load(it)).transpose()?,
                exchange2: (!is_fmi3 && is_exchange).then(|| Exchange2::load(it)).transpose()?,
                exchange3: (is_fmi3 && is_exchange).then(|| Exchange3::load(it)).transpose()?,
                directional2: (!is_fmi3).then(|| Directional2::load(it).ok()).flatten(),
                directional3: is_fmi3.then(|| Directional3::load(it).ok()).flatten(),
                events3: (is_fmi3 && has_event_mode).then(|| Events3::load(it)).transpose()?,
                symbols,
                callbacks: Mutex::default(),
                _live: live,
                folder,
            })
        }
    }

    /// The word for a state in the names of functions.
    pub fn state(&self) -> &'static str {
        self.symbols.state()
    }

    /// A function of a name in two parts.
    pub fn function(&self, name: [&'static str; 2]) -> Function {
        Function { prefix: self.symbols.prefix, name }
    }

    /// Callbacks for an instance. An FMU may keep a pointer to them beyond it.
    pub fn callbacks(&self) -> Arc<CallbackFunctions> {
        self.freed().pop().unwrap_or_else(|| Arc::new(CallbackFunctions::new()))
    }

    /// Takes the callbacks of a freed instance.
    pub fn take_back(&self, callbacks: Arc<CallbackFunctions>) {
        self.freed().push(callbacks);
    }

    fn freed(&self) -> MutexGuard<'_, Vec<Arc<CallbackFunctions>>> {
        self.callbacks.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub fn is_fmi3(&self) -> bool {
        matches!(self.of_version, OfVersion::Three(..))
    }

    pub fn numbers(&self) -> &'static [(&'static str, Memory)] {
        if self.is_fmi3() { &NUMBERS_OF_FMI3 } else { &NUMBERS_OF_FMI2 }
    }

    /// The functions for a variable's type, if numeric, and the memory for its values.
    pub fn number_type(&self, data_type: &str) -> Option<(NumberType, Numbers)> {
        let wanted = match (data_type, self.is_fmi3()) {
            ("Enumeration", false) => "Integer",
            ("Enumeration", true) => "Int64",
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

/// The functions that get and set the types of numbers.
///
/// # Safety
/// The functions are of the types that the version declares for these names.
unsafe fn accessors<Get: Copy, Set: Copy>(
    symbols: &Symbols,
    numbers: &[(&str, Memory)],
) -> Result<Vec<(Get, Set)>> {
    let of = |(name, _): &(&str, Memory)| {
        // SAFETY: the caller's promise.
        unsafe { Ok((symbols.get(&format!("Get{name}"))?, symbols.get(&format!("Set{name}"))?)) }
    };
    numbers.iter().map(of).collect()
}
