//! FMUs and their instances, in any state.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::ptr;
use std::{env, iter, mem};

use fmu_abi::fmi2::c_types::{self, fmi2FreeInstance, fmi2Instantiate};
use fmu_abi::fmi3::c_types::{
    fmi3InstantiateCoSimulation, fmi3InstantiateModelExchange, fmi3InstantiateScheduledExecution,
};
use fmu_package::{FmuDescription, FmuVariable, Platform, ValueType, archive};
use fmu_terms::{DataType, InstanceType, Interface, Version};
use libloading::Library;
use tempfile::TempDir;

use crate::arguments::{Argument, Whim, reference};
use crate::functions::{Element, FMI2, FMI3, Function, Kind, Raw};

/// `fmi2Status` and `fmi3Status`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(i32)]
#[allow(missing_docs)]
pub enum Status {
    Ok,
    Warning,
    Discard,
    Error,
}

impl Status {
    /// `Error` as a number.
    pub const ERROR: c_int = Self::Error as c_int;

    fn of(answer: c_int) -> Self {
        let all = [Self::Ok, Self::Warning, Self::Discard, Self::Error];
        all.into_iter().find(|status| *status as c_int == answer).expect("a status, and not of a fatal error")
    }
}

/// The states of an instance, each with its letter in the tables of calls, and its name in messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum State {
    Instantiated = b'I' as isize,
    InitializationMode = b'N' as isize,
    /// `stepComplete`, Step Mode.
    StepComplete = b'S' as isize,
    StepFailed = b'F' as isize,
    EventMode = b'E' as isize,
    ContinuousTimeMode = b'C' as isize,
    ClockActivationMode = b'A' as isize,
    Terminated = b'T' as isize,
    /// The state `error` of FMI 2.0; FMI 3.0 names it Terminated, too.
    Error = b'X' as isize,
}

impl State {
    /// Its letter.
    pub fn letter(self) -> char {
        char::from(self as u8)
    }
}

/// The progress of an instance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// The state.
    pub state: State,
    /// The time.
    pub time: f64,
    /// Whether the experiment was set up (FMI 2.0).
    pub is_set_up: bool,
}

impl Progress {
    const NONE: Self = Self { state: State::Instantiated, time: 0.0, is_set_up: false };
}

/// The status of a call, and the bytes that it returned.
pub type Answer = (Status, Vec<Vec<u8>>);

/// An FMU with its library.
pub struct Fmu {
    /// What its XML says.
    pub description: FmuDescription,
    /// The text of its XML.
    pub xml: String,
    /// The variables that belong to clocks.
    pub clocked: BTreeSet<String>,
    /// The numbers of continuous states and event indicators.
    pub counts: (usize, usize),
    /// Its table of calls.
    pub functions: Vec<&'static Function>,
    /// The path of its library.
    pub path: PathBuf,
    /// Where its resources are.
    resources: CString,
    library: Option<Library>,
    _folder: TempDir,
}

/// The names in the XML of elements that name clocks.
fn clocked(xml: &str) -> BTreeSet<String> {
    let elements = xml.split('<').filter(|element| element.contains(" clocks=\""));
    let names = elements.filter_map(|element| element.split_once(" name=\"")?.1.split('"').next());
    names.map(str::to_owned).collect()
}

impl Fmu {
    /// An FMU of a folder.
    pub fn open(folder: &Path, path: &str) -> Self {
        let path = folder.join(path);
        assert!(path.is_file(), "{} is missing: bash tests/run exports it", path.display());
        let description = FmuDescription::read(&path).unwrap();
        let folder = tempfile::tempdir().unwrap();
        archive::extract(&mut archive::open(File::open(&path).unwrap()).unwrap(), folder.path(), |_| true)
            .unwrap();
        let identifier =
            description.interfaces[0].1.iter().find(|(name, _)| name == "modelIdentifier").unwrap();
        let platform = Platform::host().unwrap();
        let path = folder.path().join(platform.library_path(&identifier.1, description.version()));
        // Of FMI 3.0 all, of FMI 2.0 those of the interfaces that it offers.
        let table = if description.version() == Version::Three { FMI3 } else { FMI2 };
        let is_exported = |function: &&Function| {
            function.interface.is_none_or(|of| {
                description.version() == Version::Three || description.interface(of).is_some()
            })
        };
        // A URI (FMI 2.0.5, section 2.1.5), or a path that ends with a separator (FMI 3.0.2, section 2.3.1).
        let [scheme, end] = if description.version() == Version::Three { ["", "/"] } else { ["file://", ""] };
        let resources = format!("{scheme}{}{end}", folder.path().join("resources").display());
        let xml = fs::read_to_string(folder.path().join("modelDescription.xml")).unwrap();
        let functions = table.iter().filter(is_exported).collect();
        let indicators = description.attribute("numberOfEventIndicators").parse();
        let counts = (
            xml.matches(" derivative=\"").count(),
            indicators.unwrap_or_else(|_| xml.matches("<EventIndicator ").count()),
        );
        let mut fmu = Self {
            counts,
            functions,
            clocked: clocked(&xml),
            xml,
            path,
            resources: CString::new(resources).unwrap(),
            library: None,
            description,
            _folder: folder,
        };
        fmu.load();
        fmu
    }

    /// Loads its library.
    pub fn load(&mut self) {
        // SAFETY: the library does nothing when it is loaded.
        self.library = Some(unsafe { Library::new(&self.path) }.unwrap());
    }

    /// Unloads its library, until it is loaded again.
    pub fn unload(&mut self) {
        self.library = None;
    }

    /// The folder of the exported FMUs.
    pub fn folder() -> PathBuf {
        let target = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../../target");
        env::var_os("FMUS").map_or(target, |folder| Path::new("../../../..").join(folder))
    }

    /// The exported FMUs of the test models.
    pub fn test_models() -> impl Iterator<Item = Self> {
        let paths = [
            "test-model/cs,me/TestModel.fmu",
            "test-model/cs,me/fmi3/TestModel.fmu",
            "sampled-model/fmi3/SampledModel.fmu",
            "sampled-model/fmi3/SampledModelScheduled.fmu",
            "clocked-model/cs,me/fmi3/ClockedModel.fmu",
            "clocked-model/se/fmi3/ClockedModel.fmu",
        ];
        paths.into_iter().map(|path| Self::open(&Self::folder(), path))
    }

    /// What its instances can be for.
    pub fn instance_types(&self) -> Vec<InstanceType> {
        let offers = |of: InstanceType| self.description.interface(of.interface()).is_some();
        let has_clocks = self.variables("Clock").next().is_some();
        [
            (InstanceType::ModelExchange, offers(InstanceType::ModelExchange)),
            (InstanceType::CoSimulation, offers(InstanceType::CoSimulation) && !has_clocks),
            (
                InstanceType::CoSimulationWithEvents,
                self.description.has_capability(Interface::CoSimulation, "hasEventMode"),
            ),
            (InstanceType::ScheduledExecution, offers(InstanceType::ScheduledExecution)),
        ]
        .into_iter()
        .filter_map(|(instance_type, is_offered)| is_offered.then_some(instance_type))
        .collect()
    }

    /// A function of the table, by its name without the version.
    pub fn function(&self, name: &str) -> &'static Function {
        self.functions.iter().copied().find(|function| &function.name[4..] == name).expect(name)
    }

    /// The variables of a type.
    pub fn variables<'a>(&'a self, data_type: &'a str) -> impl Iterator<Item = &'a FmuVariable> {
        let of_enumerations = if self.description.version() == Version::Three { "Int64" } else { "Integer" };
        self.description.variables.iter().filter(move |variable| {
            variable.data_type.text() == data_type
                || variable.data_type == DataType::Enumeration && data_type == of_enumerations
        })
    }

    /// The number of a variable's values.
    pub fn size(&self, variable: &FmuVariable) -> usize {
        self.description.sizes(variable).unwrap().iter().product()
    }

    /// Calls a function with NULL for its instance.
    pub fn call_without_instance(&self, function: &Function, arguments: &[Argument]) -> Status {
        let raw: Vec<Raw> = arguments.iter().map(Argument::raw).collect();
        // SAFETY: the arguments are those of the function.
        Status::of(unsafe { (function.call)(self.address(function.name), ptr::null_mut(), &raw) })
    }

    /// The address of a symbol.
    fn address(&self, symbol: &str) -> *const c_void {
        // SAFETY: only its address is used.
        let symbol = unsafe { self.library.as_ref().unwrap().get::<unsafe extern "C" fn()>(symbol) };
        *symbol.unwrap() as *const c_void
    }
}

/// The messages that an instance has logged: status and text.
type Messages = RefCell<Vec<(c_int, String)>>;

/// `fmi2CallbackLogger` with the one variadic argument that the format "%s" reads: on the platforms where this runs, it is
/// passed as any other.
unsafe extern "C" fn log_2(
    environment: *mut c_void,
    _name: *const c_char,
    status: c_types::Status,
    category: *const c_char,
    _format: *const c_char,
    text: *const c_char,
) {
    // SAFETY: those of `log_3`.
    unsafe { log_3(environment, status, category, text) }
}

/// `fmi3LogMessageCallback`.
unsafe extern "C" fn log_3(
    environment: *mut c_void,
    status: c_types::Status,
    _category: *const c_char,
    text: *const c_char,
) {
    // SAFETY: the environment is the instance's, and the text ends in NUL.
    let (messages, text) = unsafe { (&*environment.cast::<Messages>(), CStr::from_ptr(text)) };
    messages.borrow_mut().push((status as c_int, text.to_string_lossy().into_owned()));
}

/// An instance, with its saved states.
pub struct Instance<'f> {
    /// Its FMU.
    pub fmu: &'f Fmu,
    /// What it is for.
    pub instance_type: InstanceType,
    /// Where it is.
    pub at: Progress,
    /// The states that were saved, and not freed.
    pub saved: Vec<(*mut c_void, Progress)>,
    /// The number of calls.
    pub calls: u64,
    address: *mut c_void,
    messages: Box<Messages>,
}

impl Drop for Instance<'_> {
    fn drop(&mut self) {
        let symbol = if self.fmu.description.version() == Version::Three {
            "fmi3FreeInstance"
        } else {
            "fmi2FreeInstance"
        };
        // SAFETY: the symbol is that function's, and this is the instance's last use.
        unsafe {
            let free: fmi2FreeInstance = mem::transmute(self.fmu.address(symbol));
            free(self.address);
        }
    }
}

// SAFETY of every call below: the arguments are those of the function, the instance is used by one thread, and the memory
// of arrays has as many elements as their counts say, or is refused before it is accessed.
impl<'f> Instance<'f> {
    /// A new instance.
    pub fn new(fmu: &'f Fmu, instance_type: InstanceType) -> Self {
        let messages = Box::new(Messages::default());
        let environment = (&raw const *messages).cast_mut().cast();
        let token = CString::new(fmu.description.guid()).unwrap();
        let (name, token, resources) = (c"importer".as_ptr(), token.as_ptr(), fmu.resources.as_ptr());
        // SAFETY: each symbol is that function's; `callbacks` is valid during the call.
        let address = unsafe {
            match instance_type {
                _ if fmu.description.version() == Version::Two => {
                    let callbacks =
                        [log_2 as *const c_void, ptr::null(), ptr::null(), ptr::null(), environment];
                    let instantiate: fmi2Instantiate = mem::transmute(fmu.address("fmi2Instantiate"));
                    let of = c_int::from(instance_type != InstanceType::ModelExchange);
                    instantiate(name, of, token, resources, (&raw const callbacks).cast(), 0, 1)
                }
                InstanceType::CoSimulation | InstanceType::CoSimulationWithEvents => {
                    let instantiate: fmi3InstantiateCoSimulation =
                        mem::transmute(fmu.address("fmi3InstantiateCoSimulation"));
                    let events = u8::from(instance_type == InstanceType::CoSimulationWithEvents);
                    let required = ptr::null();
                    instantiate(
                        name,
                        token,
                        resources,
                        0,
                        1,
                        events,
                        1,
                        required,
                        0,
                        environment,
                        Some(log_3),
                        None,
                    )
                }
                InstanceType::ModelExchange => {
                    let instantiate: fmi3InstantiateModelExchange =
                        mem::transmute(fmu.address("fmi3InstantiateModelExchange"));
                    instantiate(name, token, resources, 0, 1, environment, Some(log_3))
                }
                InstanceType::ScheduledExecution => {
                    let instantiate: fmi3InstantiateScheduledExecution =
                        mem::transmute(fmu.address("fmi3InstantiateScheduledExecution"));
                    instantiate(name, token, resources, 0, 1, environment, Some(log_3), None, None, None)
                }
            }
        };
        assert!(!address.is_null(), "{messages:?}");
        Self { fmu, instance_type, at: Progress::NONE, saved: vec![], calls: 0, address, messages }
    }

    /// A new instance, brought into a state; `None` if its type does not have the state.
    pub fn in_state(fmu: &'f Fmu, instance_type: InstanceType, state: State) -> Option<Self> {
        let mut instance = Self::new(fmu, instance_type);
        let version = fmu.description.version();
        let path: &[&str] = match (state, instance_type) {
            (State::Instantiated, _) => &[],
            (State::InitializationMode, _) => &["EnterInitializationMode"],
            (State::StepComplete | State::Terminated | State::Error, InstanceType::CoSimulation)
            | (
                State::EventMode | State::Terminated | State::Error,
                InstanceType::ModelExchange | InstanceType::CoSimulationWithEvents,
            )
            | (
                State::ClockActivationMode | State::Terminated | State::Error,
                InstanceType::ScheduledExecution,
            ) => &["EnterInitializationMode", "ExitInitializationMode"],
            (State::StepComplete, InstanceType::CoSimulationWithEvents) => {
                &["EnterInitializationMode", "ExitInitializationMode", "EnterStepMode"]
            }
            (State::ContinuousTimeMode, InstanceType::ModelExchange) => {
                &["EnterInitializationMode", "ExitInitializationMode", "EnterContinuousTimeMode"]
            }
            (State::StepFailed, InstanceType::CoSimulation) if version == Version::Two => {
                &["EnterInitializationMode", "ExitInitializationMode"]
            }
            _ => return None,
        };
        if version == Version::Two && state != State::Instantiated {
            instance.ok("SetupExperiment");
        }
        if version == Version::Two && state == State::Error {
            instance.set("events.period", 4);
        }
        for function in path {
            instance.ok(function);
        }
        match state {
            State::Terminated => instance.ok("Terminate"),
            // Of FMI 2.0: the model panics in a step, or at a tick.
            State::Error if version == Version::Two => {
                let (place, fails) = match instance_type {
                    InstanceType::CoSimulation => (4, "DoStep"),
                    _ => (12, "NewDiscreteStates"),
                };
                instance.set("fault.place", place);
                assert_eq!(instance.call_with(fails, &mut Whim::none()).0, Status::Error);
                instance.at.state = State::Error;
            }
            State::Error => {
                assert_eq!(instance.call_with("ExitInitializationMode", &mut Whim::none()).0, Status::Error);
            }
            State::StepFailed => {
                // The end is asked for within the step.
                instance.set("events.end", 1);
                assert_eq!(instance.call_with("DoStep", &mut Whim::none()).0, Status::Discard);
                instance.at.time = 1.0 / 16.0;
            }
            _ => {}
        }
        assert_eq!(instance.at.state, state);
        instance.messages.borrow_mut().clear();
        Some(instance)
    }

    /// Sets a scalar: a whole number, or sixteenths.
    pub fn set(&mut self, name: &str, value: i32) {
        let variable = self.fmu.description.variable(name).unwrap();
        let unit = if variable.value_type() == ValueType::Real { 16.0 } else { 1.0 };
        assert_eq!(self.set_to(variable, f64::from(value) / unit), Status::Ok);
    }

    /// Sets all elements of a variable to a number, as its type.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole numbers are small")]
    pub fn set_to(&mut self, variable: &FmuVariable, value: f64) -> Status {
        let (version, count) = (self.fmu.description.version(), self.fmu.size(variable));
        let kind = match (variable.data_type.text(), version) {
            ("Enumeration", Version::Two) => "Integer",
            ("Enumeration", Version::Three) => "Int64",
            (kind, _) => kind,
        };
        let values = match kind {
            "Real" | "Float64" => Argument::of(&vec![value; count]),
            "Float32" => Argument::of(&vec![value as f32; count]),
            "UInt8" => Argument::of(&vec![value as u8; count]),
            "Int64" => Argument::of(&vec![value as i64; count]),
            _ => Argument::of(&vec![value as i32; count]),
        };
        let mut arguments = vec![Argument::of(&[reference(variable)]), Argument::Whole(1), values];
        if version == Version::Three {
            arguments.push(Argument::Whole(count as u64));
        }
        self.call(self.fmu.function(&format!("Set{kind}")), &arguments).0
    }

    /// Calls a function that must succeed, with valid arguments.
    pub fn ok(&mut self, name: &str) {
        let (status, _) = self.call_with(name, &mut Whim::none());
        assert!(
            status <= Status::Warning,
            "{name} in {:?} of {:?}: {status:?}, {:?}",
            self.at,
            self.instance_type,
            self.messages
        );
    }

    /// Calls a function with arguments that follow from a whim.
    pub fn call_with(&mut self, name: &str, whim: &mut Whim) -> Answer {
        let function = self.fmu.function(name);
        let arguments = self.arguments(function, whim);
        self.call(function, &arguments)
    }

    /// Calls a function, and follows the instance's state.
    pub fn call(&mut self, function: &'static Function, arguments: &[Argument]) -> Answer {
        self.calls += 1;
        let raw: Vec<Raw> = arguments.iter().map(Argument::raw).collect();
        // SAFETY: see above.
        let status =
            Status::of(unsafe { (function.call)(self.fmu.address(function.name), self.address, &raw) });
        let mut returned = vec![];
        for (argument, &(_, kind)) in arguments.iter().zip(function.parameters) {
            let Argument::Memory(memory) = argument else { continue };
            memory.check(function.name);
            let Kind::Out(element) = kind else { continue };
            if status > Status::Warning {
                continue;
            }
            returned.push(match element {
                Element::State => vec![],
                // SAFETY: after success they are those of the instance, valid until the next call.
                Element::Text => unsafe { memory.texts() },
                // SAFETY: as above; the sizes have been returned before.
                Element::Binary => unsafe { memory.binaries(returned.last()) },
                _ => memory.content(),
            });
            let is_time =
                ["Interval", "Shift", "Update", "DoStep"].iter().any(|part| function.name.contains(part));
            if let (Element::Float(_), false) = (element, is_time) {
                let numbers = memory.numbers();
                assert!(numbers.iter().all(|number| number.is_finite()), "{}: {numbers:?}", function.name);
            }
        }
        self.follow(&function.name[4..], status, arguments);
        (status, returned)
    }

    /// Follows a call.
    fn follow(&mut self, name: &str, status: Status, arguments: &[Argument]) {
        let number = |position: usize| match arguments[position] {
            Argument::Number(value) => value,
            _ => f64::NAN,
        };
        let version = self.fmu.description.version();
        match status {
            Status::Ok | Status::Warning => match name {
                "SetupExperiment" => (self.at.is_set_up, self.at.time) = (true, number(2)),
                "EnterInitializationMode" => {
                    self.at.state = State::InitializationMode;
                    if version == Version::Three {
                        self.at.time = number(2);
                    }
                }
                "ExitInitializationMode" => {
                    self.at.state = match self.instance_type {
                        InstanceType::CoSimulation => State::StepComplete,
                        InstanceType::ModelExchange | InstanceType::CoSimulationWithEvents => {
                            State::EventMode
                        }
                        InstanceType::ScheduledExecution => State::ClockActivationMode,
                    }
                }
                "EnterEventMode" => self.at.state = State::EventMode,
                "EnterContinuousTimeMode" => self.at.state = State::ContinuousTimeMode,
                "EnterStepMode" => self.at.state = State::StepComplete,
                "Terminate" => self.at.state = State::Terminated,
                "Reset" => self.at = Progress::NONE,
                "SetTime" => self.at.time = number(0),
                "ActivateModelPartition" => self.at.time = number(1),
                "DoStep" if version == Version::Three => {
                    let Argument::Memory(reached) = &arguments[6] else { return };
                    self.at.time = reached.numbers()[0];
                }
                "DoStep" => self.at.time = number(0) + number(1),
                _ => {}
            },
            Status::Discard if name == "DoStep" && version == Version::Two => {
                self.at.state = State::StepFailed;
            }
            // FMI 3.0.2, section 2.2.4: the simulation must not be continued.
            Status::Error if version == Version::Three => self.at.state = State::Error,
            _ => {}
        }
    }

    /// Whether the standard allows a function now, and the FMU has it.
    pub fn allows(&self, function: &Function) -> bool {
        let name = &function.name[4..];
        let is_of = match function.interface {
            Some(Interface::CoSimulation) if name == "EnterStepMode" => {
                self.instance_type == InstanceType::CoSimulationWithEvents
            }
            Some(interface) => self.instance_type.interface() == interface,
            None => name != "EnterEventMode" || self.instance_type != InstanceType::CoSimulation,
        };
        let has = |flag| self.fmu.description.has_capability(Interface::CoSimulation, flag);
        let is_capable = match name {
            "GetDirectionalDerivative" => {
                has("providesDirectionalDerivative") || has("providesDirectionalDerivatives")
            }
            "GetAdjointDerivative" => has("providesAdjointDerivatives"),
            "GetOutputDerivatives" => self.fmu.xml.contains("maxOutputDerivativeOrder=\"1\""),
            _ => true,
        };
        // FMI 2.0.5, section 3.2.3, note 8: that of an FMU without states, which need not leave Event Mode.
        let stays = function.name == "fmi2SetTime" && self.fmu.counts.0 == 0;
        let states = if stays { "EC" } else { function.states() };
        is_of && is_capable && states.contains(self.at.state.letter())
    }

    /// The messages since the last time.
    pub fn messages(&self) -> Vec<(c_int, String)> {
        self.messages.take()
    }

    /// Saves the present state.
    pub fn save(&mut self) -> *mut c_void {
        let state = Argument::of::<*mut c_void>(&[ptr::null_mut()]);
        let get = self.state_function("GetFMUstate");
        let (status, _) = self.call(get, std::slice::from_ref(&state));
        assert_eq!(status, Status::Ok, "{:?}", self.messages);
        state.handle()
    }

    /// A function of saved states, whose spelling differs between the versions.
    pub fn state_function(&self, name: &str) -> &'static Function {
        let is_it = |function: &&Function| function.name[4..].eq_ignore_ascii_case(name);
        self.fmu.functions.iter().copied().find(is_it).unwrap()
    }

    /// The bytes of a saved state.
    pub fn serialize(&mut self, state: *mut c_void) -> Vec<u8> {
        let size = Argument::of(&[0_usize]);
        let of_size = self.state_function("SerializedFMUstateSize");
        let (status, values) = self.call(of_size, &[Argument::State(state), size]);
        assert_eq!(status, Status::Ok, "{:?}", self.messages);
        let size = usize::from_ne_bytes(values[0].as_slice().try_into().unwrap());
        let bytes = Argument::of(&vec![0_u8; size]);
        let serialize = self.state_function("SerializeFMUstate");
        let arguments = [Argument::State(state), bytes, Argument::Whole(size as u64)];
        let (status, mut values) = self.call(serialize, &arguments);
        assert_eq!(status, Status::Ok);
        values.remove(0)
    }

    /// The state with these bytes.
    ///
    /// # Errors
    /// When they are refused.
    pub fn deserialize(&mut self, bytes: &[u8]) -> Result<*mut c_void, Status> {
        let state = Argument::of::<*mut c_void>(&[ptr::null_mut()]);
        let arguments = [Argument::of(bytes), Argument::Whole(bytes.len() as u64), state];
        let (status, _) = self.call(self.state_function("DeSerializeFMUstate"), &arguments);
        let state = arguments[2].handle();
        assert_eq!(status == Status::Ok, !state.is_null());
        if status == Status::Ok { Ok(state) } else { Err(status) }
    }

    /// Frees a state.
    pub fn free_state(&mut self, state: *mut c_void) {
        let state = Argument::of(&[state]);
        let free = self.state_function("FreeFMUstate");
        assert_eq!(self.call(free, std::slice::from_ref(&state)).0, Status::Ok);
        assert!(state.handle().is_null());
    }

    /// The bytes of the present state, and where it is.
    pub fn snapshot(&mut self) -> (Vec<u8>, Progress) {
        let at = self.at;
        let state = self.save();
        let bytes = self.serialize(state);
        self.free_state(state);
        (bytes, at)
    }

    /// Goes on from a saved state.
    pub fn set_state(&mut self, state: *mut c_void, at: Progress) {
        let set = self.state_function("SetFMUstate");
        assert_eq!(self.call(set, &[Argument::State(state)]).0, Status::Ok, "{:?}", self.messages);
        self.at = at;
    }

    /// Goes on from bytes.
    pub fn restore(&mut self, (bytes, at): &(Vec<u8>, Progress)) {
        let state = self.deserialize(bytes).expect("the bytes of a saved state");
        self.set_state(state, *at);
        self.free_state(state);
    }

    /// Whether an instance of FMI 2.0 that has not finished a call is in the state `error`, where it cannot be terminated.
    pub fn find_error(&mut self) {
        let now = self.snapshot();
        if self.call_with("Terminate", &mut Whim::none()).0 == Status::Error {
            self.at = Progress { state: State::Error, ..now.1 };
        } else {
            self.restore(&now);
        }
    }
}

/// Each FMU with each type of its instances.
pub fn instances(fmus: &[Fmu]) -> impl Iterator<Item = (&Fmu, InstanceType)> {
    fmus.iter().flat_map(|fmu| iter::repeat(fmu).zip(fmu.instance_types()))
}
