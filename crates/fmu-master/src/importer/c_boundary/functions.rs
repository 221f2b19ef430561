//! The functions of an FMU's library, with the types that each version of FMI declares.

use std::ffi::{c_int, c_void};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use anyhow::{Context, Result, anyhow, bail};
use fmu_abi::fmi2::c_types::{Component, ValueReference};
use fmu_io::temporary::Folder;
use fmu_terms::{DataType, Version};
use libloading::Library;

use super::super::messages::Function;
use super::super::numbers::{Memory, NUMBERS_OF_FMI2, NUMBERS_OF_FMI3, Numbers};
use super::live::{Call, Environment, Live};
use super::logger::CallbackFunctions;
use super::process::contained;

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
    let package = missing_package(&text)
        .map_or(String::new(), |package| format!("; Debian and Ubuntu have it in the package {package}"));
    anyhow!("its library cannot be loaded: {text}{remedy}{package}")
}

/// Libraries that FMUs of Fortran, C++ and others need, with the beginnings of the names of their packages, which the number
/// of the library's version follows.
const PACKAGES: [(&str, &str); 9] = [
    ("libgfortran.so.", "libgfortran"),
    ("libquadmath.so.", "libquadmath"),
    ("libgomp.so.", "libgomp"),
    ("libstdc++.so.", "libstdc++"),
    ("libc++.so.", "libc++"),
    ("libblas.so.", "libblas"),
    ("liblapack.so.", "liblapack"),
    ("libtinfo.so.", "libtinfo"),
    ("libncurses.so.", "libncurses"),
];

/// The package with a missing library, from the loader's message.
fn missing_package(text: &str) -> Option<String> {
    let library =
        text.split(": cannot open shared object file").next().filter(|name| name.len() < text.len())?;
    let library = library.rsplit(' ').next()?;
    PACKAGES.iter().find_map(|(prefix, package)| {
        let version = library.strip_prefix(prefix)?;
        Some(format!("{package}{}", version.split('.').next()?))
    })
}

/// A library in which functions are looked up.
struct Symbols {
    library: Library,
    /// `fmi2` or `fmi3`.
    prefix: &'static str,
}

impl Symbols {
    /// A function that the library must have.
    ///
    /// # Safety
    /// `Function` is the type that the standard declares for this name.
    unsafe fn get<Function: Copy>(&self, name: &str) -> Result<Function> {
        // SAFETY: the caller's promise.
        let symbol = unsafe { self.library.get::<Function>(name) }.ok();
        symbol.map(|symbol| *symbol).with_context(|| format!("its library has no {name}"))
    }
}

/// The types of FMI 2.0's functions, with a plain number as a status.
mod fmi2 {
    use std::ffi::c_int as Status;

    use fmu_abi::fmi2::c_types::{
        Boolean, Byte, Component, Enumeration, EventInfo, FmuState, Integer, String, ValueReference,
    };

    use super::CallbackFunctions;

    fmu_abi::fmi2_calls!(fmu_abi::function_types);
}

/// The types of FMI 3.0's functions, with a plain number as a status.
mod fmi3 {
    use std::ffi::c_int as Status;

    use fmu_abi::fmi3::c_types::{
        Binary, Boolean, Byte, Clock, ClockUpdateCallback, Enumeration, FmuState, Instance,
        IntermediateUpdateCallback, PreemptionCallback, String, ValueReference,
    };

    use super::Environment as InstanceEnvironment;

    type LogMessageCallback = unsafe extern "C" fn(InstanceEnvironment, Status, String, String);

    fmu_abi::fmi3_calls!(fmu_abi::function_types);
}

/// Declares functions of an instance that a library has together, with their names, in both versions if their types are
/// the same.
macro_rules! functions {
    (@load $symbols:ident $version:ident $name:ident) => {
        $symbols.get::<$version::$name>(stringify!($name))?
    };
    (@load $symbols:ident $version:ident $name:ident $of_fmi3:ident) => {
        if $symbols.prefix == "fmi3" {
            functions!(@load $symbols fmi3 $of_fmi3)
        } else {
            functions!(@load $symbols $version $name)
        }
    };
    ($(
        $(#[$meta:meta])*
        $table:ident: $version:ident { $($field:ident: $name:ident $(/ $of_fmi3:ident)?),* $(,)? }
    )*) => {$(
        $(#[$meta])*
        pub struct $table {
            $(pub $field: $version::$name),*
        }

        impl $table {
            /// # Safety
            /// The library is one of the version.
            unsafe fn load(symbols: &Symbols) -> Result<Self> {
                // SAFETY: the standard declares these types for these names.
                unsafe { Ok(Self { $($field: functions!(@load symbols $version $name $($of_fmi3)?)),* }) }
            }
        }
    )*};
}

functions! {
    /// Functions of both versions and interfaces.
    Common: fmi2 {
        exit_initialization_mode: fmi2ExitInitializationMode / fmi3ExitInitializationMode,
        terminate: fmi2Terminate / fmi3Terminate,
        free_instance: fmi2FreeInstance / fmi3FreeInstance,
    }

    /// Functions of saved states.
    States: fmi2 {
        get: fmi2GetFMUstate / fmi3GetFMUState,
        set: fmi2SetFMUstate / fmi3SetFMUState,
        free: fmi2FreeFMUstate / fmi3FreeFMUState,
    }

    /// Functions of FMI 2.0 alone.
    Common2: fmi2 {
        setup_experiment: fmi2SetupExperiment,
        enter_initialization_mode: fmi2EnterInitializationMode,
        set_string: fmi2SetString,
    }

    /// Functions of FMI 3.0 alone.
    Common3: fmi3 { enter_initialization_mode: fmi3EnterInitializationMode, set_string: fmi3SetString }

    /// Functions of co-simulation.
    Step2: fmi2 { do_step: fmi2DoStep }
    Step3: fmi3 { do_step: fmi3DoStep }

    /// Functions that tell how a step in FMI 2.0 went.
    RealStatus2: fmi2 { get: fmi2GetRealStatus }
    BooleanStatus2: fmi2 { get: fmi2GetBooleanStatus }

    /// Functions of Model Exchange in both versions.
    Exchange: fmi2 {
        enter_event_mode: fmi2EnterEventMode / fmi3EnterEventMode,
        enter_continuous_time_mode: fmi2EnterContinuousTimeMode / fmi3EnterContinuousTimeMode,
        set_time: fmi2SetTime / fmi3SetTime,
        set_states: fmi2SetContinuousStates / fmi3SetContinuousStates,
        states: fmi2GetContinuousStates / fmi3GetContinuousStates,
        nominals: fmi2GetNominalsOfContinuousStates / fmi3GetNominalsOfContinuousStates,
        derivatives: fmi2GetDerivatives / fmi3GetContinuousStateDerivatives,
        indicators: fmi2GetEventIndicators / fmi3GetEventIndicators,
    }

    /// Functions of Model Exchange in one version.
    Exchange2: fmi2 {
        new_discrete_states: fmi2NewDiscreteStates,
        completed_integrator_step: fmi2CompletedIntegratorStep,
    }
    Exchange3: fmi3 { completed_integrator_step: fmi3CompletedIntegratorStep }

    /// Functions that read texts.
    Strings2: fmi2 { get: fmi2GetString }
    Strings3: fmi3 { get: fmi3GetString }

    Directional2: fmi2 { get: fmi2GetDirectionalDerivative }
    Directional3: fmi3 { get: fmi3GetDirectionalDerivative }

    /// Functions that tell dependencies by element.
    Dependencies3: fmi3 { count: fmi3GetNumberOfVariableDependencies, get: fmi3GetVariableDependencies }

    /// Functions of Event Mode in FMI 3.0.
    Events3: fmi3 {
        enter_event_mode: fmi3EnterEventMode,
        enter_step_mode: fmi3EnterStepMode,
        update_discrete_states: fmi3UpdateDiscreteStates,
        set_clock: fmi3SetClock,
        get_interval: fmi3GetIntervalDecimal,
        get_shift: fmi3GetShiftDecimal,
    }
}

// Of every type of numbers: a pointer to numbers is one to bytes.
type References = *const ValueReference;
type Get2 = unsafe extern "C" fn(Component, References, usize, *mut c_void) -> c_int;
type Get3 = unsafe extern "C" fn(Component, References, usize, *mut c_void, usize) -> c_int;
type Set2 = unsafe extern "C" fn(Component, References, usize, *const c_void) -> c_int;
type Set3 = unsafe extern "C" fn(Component, References, usize, *const c_void, usize) -> c_int;

/// The function that makes an instance.
pub enum Instantiate {
    Two(fmi2::fmi2Instantiate),
    CoSimulation3(fmi3::fmi3InstantiateCoSimulation),
    ModelExchange3(fmi3::fmi3InstantiateModelExchange),
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
    /// FMI 2.0, with accessors by the position in [`NUMBERS_OF_FMI2`].
    Two(Common2, Vec<(Get2, Set2)>),
    /// FMI 3.0, with accessors by the position in [`NUMBERS_OF_FMI3`].
    Three(Common3, Vec<(Get3, Set3)>),
}

/// The functions of an FMU's library: those of its version and interface. As long as this exists, the library stays
/// loaded and its folder stays.
pub struct Functions {
    pub instantiate: Instantiate,
    pub of_version: OfVersion,
    pub common: Common,
    pub states: Option<States>,
    pub step2: Option<Step2>,
    pub step3: Option<Step3>,
    pub real_status2: Option<RealStatus2>,
    pub boolean_status2: Option<BooleanStatus2>,
    pub exchange: Option<Exchange>,
    pub exchange2: Option<Exchange2>,
    pub exchange3: Option<Exchange3>,
    pub strings2: Option<Strings2>,
    pub strings3: Option<Strings3>,
    pub directional2: Option<Directional2>,
    pub directional3: Option<Directional3>,
    pub dependencies3: Option<Dependencies3>,
    pub events3: Option<Events3>,
    symbols: Symbols,
    // The callbacks of freed instances, for later ones. Dropped after the library, whose code may use them until it is
    // unloaded.
    callbacks: Mutex<Vec<Arc<CallbackFunctions>>>,
    _live: Live,
    pub folder: Folder,
}

impl Functions {
    /// Loads the library of FMI 2.0 or 3.0 in a folder, for co-simulation or Model Exchange, which may need Event Mode.
    ///
    /// # Errors
    /// When it cannot be loaded, or lacks a function.
    pub fn load(
        folder: Folder,
        path: &Path,
        is_fmi3: bool,
        is_exchange: bool,
        needs_event_mode: bool,
    ) -> Result<Self> {
        let live = Live::new(path.file_name().unwrap_or_default().to_string_lossy().into_owned());
        // SAFETY: loading runs the library's initializers; the user chose to run this FMU's code.
        let (library, _) = contained(|| live.call(Call::Load, || unsafe { Library::new(path) }));
        let library = library.map_err(not_loaded)?;
        let symbols = Symbols { library, prefix: if is_fmi3 { "fmi3" } else { "fmi2" } };
        let it = &symbols;
        // SAFETY: the standard declares these types for these names.
        unsafe {
            Ok(Self {
                instantiate: match (is_fmi3, is_exchange) {
                    (false, _) => Instantiate::Two(it.get("fmi2Instantiate")?),
                    (true, false) => Instantiate::CoSimulation3(it.get("fmi3InstantiateCoSimulation")?),
                    (true, true) => Instantiate::ModelExchange3(it.get("fmi3InstantiateModelExchange")?),
                },
                of_version: if is_fmi3 {
                    OfVersion::Three(Common3::load(it)?, accessors(it, &NUMBERS_OF_FMI3, Version::Three)?)
                } else {
                    OfVersion::Two(Common2::load(it)?, accessors(it, &NUMBERS_OF_FMI2, Version::Two)?)
                },
                common: Common::load(it)?,
                states: States::load(it).ok(),
                step2: (!is_fmi3 && !is_exchange).then(|| Step2::load(it)).transpose()?,
                step3: (is_fmi3 && !is_exchange).then(|| Step3::load(it)).transpose()?,
                real_status2: (!is_fmi3).then(|| RealStatus2::load(it).ok()).flatten(),
                boolean_status2: (!is_fmi3).then(|| BooleanStatus2::load(it).ok()).flatten(),
                exchange: is_exchange.then(|| Exchange::load(it)).transpose()?,
                exchange2: (!is_fmi3 && is_exchange).then(|| Exchange2::load(it)).transpose()?,
                exchange3: (is_fmi3 && is_exchange).then(|| Exchange3::load(it)).transpose()?,
                strings2: (!is_fmi3).then(|| Strings2::load(it).ok()).flatten(),
                strings3: is_fmi3.then(|| Strings3::load(it).ok()).flatten(),
                directional2: (!is_fmi3).then(|| Directional2::load(it).ok()).flatten(),
                directional3: is_fmi3.then(|| Directional3::load(it).ok()).flatten(),
                dependencies3: is_fmi3.then(|| Dependencies3::load(it).ok()).flatten(),
                events3: match Events3::load(it) {
                    Err(missing) if is_fmi3 && needs_event_mode => return Err(missing),
                    found => found.ok().filter(|_| is_fmi3),
                },
                symbols,
                callbacks: Mutex::default(),
                _live: live,
                folder,
            })
        }
    }

    /// The word for a state in the names of functions.
    pub fn state(&self) -> &'static str {
        if self.is_fmi3() { "FMUState" } else { "FMUstate" }
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

    pub fn numbers(&self) -> &'static [(DataType, Memory)] {
        if self.is_fmi3() { &NUMBERS_OF_FMI3 } else { &NUMBERS_OF_FMI2 }
    }

    /// Refuses a library that cannot tell its texts.
    pub fn refuse_no_texts(&self) -> Result<()> {
        if self.strings2.is_none() && self.strings3.is_none() {
            bail!("its library has no {}GetString", self.symbols.prefix);
        }
        Ok(())
    }

    /// Refuses a library of FMI 3.0 without Event Mode.
    pub fn refuse_no_events(&self) -> Result<()> {
        if self.events3.is_none() {
            bail!("its library lacks functions of Event Mode");
        }
        Ok(())
    }

    /// The functions for a variable's type, if numeric, and the memory for its values.
    pub fn number_type(&self, data_type: DataType) -> Option<(NumberType, Numbers)> {
        let wanted = match (data_type, self.is_fmi3()) {
            (DataType::Enumeration, false) => DataType::Integer,
            (DataType::Enumeration, true) => DataType::Int64,
            (other, _) => other,
        };
        let position = self.numbers().iter().position(|(known, _)| *known == wanted)?;
        Some((NumberType(position), Numbers::new(self.numbers()[position].1)))
    }

    /// A type's name in the names of its functions.
    pub fn name(&self, number_type: NumberType) -> &'static str {
        let version = if self.is_fmi3() { Version::Three } else { Version::Two };
        self.numbers()[number_type.0].0.name(version)
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
    numbers: &[(DataType, Memory)],
    version: Version,
) -> Result<Vec<(Get, Set)>> {
    let of = |(data_type, _): &(DataType, Memory)| {
        let name = data_type.name(version);
        let [get, set] = ["Get", "Set"].map(|access| format!("{}{access}{name}", symbols.prefix));
        // SAFETY: the caller's promise.
        unsafe { Ok((symbols.get(&get)?, symbols.get(&set)?)) }
    };
    numbers.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_library_is_in_a_package() {
        let message =
            |library: &str| format!("{library}: cannot open shared object file: No such file or directory");
        for (library, package) in [
            ("libgfortran.so.5", Some("libgfortran5")),
            ("libquadmath.so.0", Some("libquadmath0")),
            ("libstdc++.so.6", Some("libstdc++6")),
            ("libown.so.1", None),
        ] {
            assert_eq!(missing_package(&message(library)).as_deref(), package, "{library}");
        }
        assert_eq!(missing_package("libgfortran.so.5: wrong ELF class"), None);
    }
}
