//! Imports FMUs for co-simulation, FMI 2.0 and 3.0, from any tool.
//!
//! An [`Fmu`] is extracted and loaded; it creates [`Instance`]s in any thread, each of which stays in its thread.
//! Variables are addressed by names, resolved once: a [`Selection`] gets or sets numbers of any type together without
//! allocating. Array elements are variables. A failed call is a [`CallFailed`]: the function, the time, and the FMU's
//! messages.
//!
//! Only this module calls FMUs. Of the crates that import FMI, `fmi` needs libclang to build and crashes on messages
//! without a category, and `fmi-rs` (0.3.4) crashes with FMUs that keep the pointer to the callbacks, as many do, and
//! on undefined statuses.

mod c_boundary;
mod folder;
mod messages;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::ffi::CString;
use std::fmt;
use std::path::{MAIN_SEPARATOR, Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use self::c_boundary::{Functions, Handle, NumberType, Numbers};
pub(crate) use self::folder::extract;
pub use self::messages::{CallFailed, Ended, Message, Status};
use crate::name_map::NameMap;
use anyhow::{Context, Result, bail};
use fmu_export::fmi2::c_types::{FmuState, ValueReference};
use fmu_io::reading;
use fmu_io::temporary::Folder;
use fmu_package::library::refuse_cut_short;
use fmu_package::{Element, FmuDescription, FmuVariable, Linear, ParameterSet, Platform, Translation, Value};
use fmu_terms::like;

/// The capability flag of FMUs with a single instance per process, for [`FmuDescription::has_capability`].
pub const ONLY_ONCE: &str = "canBeInstantiatedOnlyOncePerProcess";

/// What to do about a missing FMU: where exported ones are, and the file beside it whose name is nearest.
#[must_use]
pub fn remedy(path: &Path) -> String {
    let others = path.parent().and_then(|folder| folder.read_dir().ok()).into_iter().flatten().flatten();
    let others =
        others.map(|entry| entry.path()).filter(|path| path.extension().is_some_and(|end| end == "fmu"));
    let mut others: Vec<_> =
        others.map(|path| path.file_name().unwrap_or_default().to_string_lossy().into_owned()).collect();
    others.sort();
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let like = like(&name, others.iter().map(String::as_str));
    format!("`export` writes FMUs to target/fmu{like}")
}

/// An FMU for co-simulation (FMI 2.0 or 3.0), extracted to a temporary folder and loaded. Its folder and library stay
/// until it and its instances are dropped.
pub struct Fmu {
    path: PathBuf,
    description: FmuDescription,
    /// The conversions from the FMU's values, by name.
    conversions: BTreeMap<String, Linear>,
    functions: Arc<Functions>,
    // Dropped after the library in it.
    folder: Arc<Folder>,
}

impl Fmu {
    /// Extracts an FMU, reads its description and loads its library.
    ///
    /// # Errors
    /// When there is no such file, it is not an FMU, it is not for co-simulation or for this platform, its version of
    /// FMI is neither 2.0 nor 3.0, or its library cannot be loaded; the message names the file.
    pub fn open(path: &Path) -> Result<Arc<Self>> {
        Self::open_anonymous(path).with_context(|| format!("cannot import {}", path.display())).map(Arc::new)
    }

    /// The same, with other names and units if there is a map.
    ///
    /// # Errors
    /// Those of [`Fmu::open`] and of the map.
    pub fn open_with(path: &Path, map: Option<&dyn NameMap>) -> Result<Arc<Self>> {
        let fmu = Self::open(path)?;
        let Some(map) = map else { return Ok(fmu) };
        let translation = map.translation(&fmu.description).with_context(|| path.display().to_string())?;
        Ok(fmu.translated(translation))
    }

    fn open_anonymous(path: &Path) -> Result<Self> {
        if !path.exists() {
            bail!("there is no such file; {}", remedy(path));
        }
        let folder = extract(path)?;
        let description = folder.path().join("modelDescription.xml");
        if !description.is_file() {
            bail!("there is no modelDescription.xml in it");
        }
        let description = FmuDescription::parse(&reading::text(&description)?)
            .and_then(FmuDescription::scalars)
            .context("its modelDescription.xml is broken")?;
        let version = description.attribute("fmiVersion");
        let is_fmi3 = description.is_fmi3();
        if !version.starts_with("2.") && !is_fmi3 {
            bail!("it is one of FMI {version}; only FMI 2.0 and 3.0 are supported");
        }
        let Some(identifier) = description.co_simulation_identifier() else {
            bail!("it is not for co-simulation");
        };
        let Some(platform) = Platform::host() else { bail!("FMI does not support this platform") };
        let name = platform.library_path(identifier, is_fmi3);
        let library = folder.path().join(&name);
        if !library.is_file() {
            bail!("it has no {name}: it is not for this platform");
        }
        refuse_cut_short(&reading::bytes(&library)?).with_context(|| format!("its {name}"))?;
        let functions = Functions::load(&library, is_fmi3)?;
        Ok(Self {
            path: path.to_owned(),
            description,
            conversions: BTreeMap::new(),
            functions: Arc::new(functions),
            folder: Arc::new(folder),
        })
    }

    /// The FMU in other names and units, which replace its own from here on. Both share the loaded library.
    #[must_use]
    pub fn translated(&self, translation: Translation) -> Arc<Self> {
        let mut conversions = translation.conversions;
        conversions.retain(|_, conversion| *conversion != Linear::IDENTITY);
        Arc::new(Self {
            path: self.path.clone(),
            description: translation.description,
            conversions,
            functions: Arc::clone(&self.functions),
            folder: Arc::clone(&self.folder),
        })
    }

    /// Its modelDescription.xml: variables, units, capabilities, default experiment. Elements of arrays are variables.
    #[must_use]
    pub fn description(&self) -> &FmuDescription {
        &self.description
    }

    /// A variable, by its name.
    ///
    /// # Errors
    /// When there is none; the message has the nearest name.
    pub fn variable(&self, name: &str) -> Result<&FmuVariable> {
        self.description.variable(name).with_context(|| {
            let names = self.description.variables.iter().map(|variable| variable.name.as_str());
            format!("{} has no variable {name}{}", self.path.display(), like(name, names))
        })
    }

    /// The names of the variables of a causality, such as `input` or `output`, in the FMU's order.
    pub fn names<'a>(&'a self, causality: &'a str) -> impl Iterator<Item = &'a str> {
        self.description.of_causality(causality).map(|variable| variable.name.as_str())
    }

    /// Resolves numeric variables for [`Instance::get`] and [`Instance::set`]: Reals, Integers, Booleans, Enumerations,
    /// and their types in FMI 3.0.
    ///
    /// # Errors
    /// When there is no variable of a name, it is not a number, or its value reference is not one.
    pub fn select<'a>(&self, names: impl IntoIterator<Item = &'a str>) -> Result<Selection> {
        let mut selection = Selection::default();
        for name in names {
            let variable = self.variable(name)?;
            let (reference, position) = (reference(variable)?, selection.names.len());
            let Some((number_type, values)) = self.functions.number_type(&variable.data_type) else {
                bail!("{name} is of the type {}, which is not a number", variable.data_type);
            };
            let groups = &mut selection.groups;
            let known = groups.iter().position(|group| group.number_type == number_type);
            let group = known.unwrap_or_else(|| {
                let function = self.functions.name(number_type);
                groups.push(Group {
                    number_type,
                    function,
                    references: vec![],
                    values,
                    slots: vec![],
                    arrays: vec![],
                });
                groups.len() - 1
            });
            let conversion = self.conversions.get(name).map(|to_seen| (*to_seen, to_seen.inverse()));
            groups[group].push(reference, variable.element, position, conversion);
            selection.names.push(name.to_owned());
        }
        Ok(selection)
    }

    /// Creates an instance, with logging on. An FMU with the flag [`ONLY_ONCE`] allows one per process.
    ///
    /// # Errors
    /// When the FMU refuses, as a [`CallFailed`] with its messages, or `name` holds a zero byte.
    pub fn instantiate(self: &Arc<Self>, name: &str) -> Result<Instance> {
        let resources = self.folder.path().join("resources");
        let (function, resources) = if self.description.is_fmi3() {
            ("fmi3InstantiateCoSimulation", format!("{}{MAIN_SEPARATOR}", resources.display()))
        } else {
            ("fmi2Instantiate", folder::uri(&resources))
        };
        let texts = [name, self.description.guid(), &resources].map(CString::new);
        let [Ok(name_text), Ok(guid), Ok(resources)] = texts else {
            bail!("the name {name:?} holds a zero byte")
        };
        match Handle::new(&self.functions, [name_text, guid, resources]) {
            Ok(handle) => {
                let handle = Rc::new(handle);
                Ok(Instance {
                    fmu: Arc::clone(self),
                    name: name.to_owned(),
                    handle,
                    time: None,
                    warnings: vec![],
                })
            }
            Err(messages) => bail!(CallFailed {
                instance: name.to_owned(),
                function: function.to_owned(),
                variables: vec![],
                time: None,
                status: None,
                last_successful_time: None,
                messages: messages::telling(messages, &self.description),
            }),
        }
    }
}

fn reference(variable: &FmuVariable) -> Result<ValueReference> {
    variable.value_reference.parse().with_context(|| {
        format!("the value reference of {} is '{}'", variable.name, variable.value_reference)
    })
}

/// Numeric variables of an [`Fmu`], resolved by [`Fmu::select`]. Their values are doubles in the order of the names, in
/// the units that the FMU declares. Booleans are 0 and 1; Enumerations are the numbers of their items.
#[derive(Default)]
pub struct Selection {
    names: Vec<String>,
    groups: Vec<Group>,
}

/// Those of a type.
struct Group {
    number_type: NumberType,
    /// The type's name in its functions.
    function: &'static str,
    references: Vec<ValueReference>,
    /// Of all references, arrays as a whole.
    values: Numbers,
    slots: Vec<Slot>,
    /// The arrays among the references, each with its first value.
    arrays: Vec<(ValueReference, usize)>,
}

/// One of a group's variables.
struct Slot {
    /// Its index among the group's values.
    value: usize,
    /// Its index among the selection's.
    position: usize,
    /// From the FMU's value, and to it.
    conversion: Option<(Linear, Linear)>,
}

impl Group {
    fn push(
        &mut self,
        reference: ValueReference,
        element: Option<Element>,
        position: usize,
        conversion: Option<(Linear, Linear)>,
    ) {
        let known = self.arrays.iter().find(|(array, _)| *array == reference).map(|(_, first)| *first);
        let first = known.unwrap_or_else(|| {
            let first = self.values.len();
            self.references.push(reference);
            self.values.extend(element.map_or(1, |element| element.size));
            if element.is_some() {
                self.arrays.push((reference, first));
            }
            first
        });
        let value = first + element.map_or(0, |element| element.position);
        self.slots.push(Slot { value, position, conversion });
    }

    /// Takes the values to set. A Boolean is true from 0.5.
    fn gather(&mut self, values: &[f64]) {
        for Slot { value, position, conversion } in &self.slots {
            let given = values[*position];
            self.values.set(
                *value,
                match conversion {
                    Some((_, to_own)) => to_own.apply(given),
                    None if self.function == BOOLEAN => f64::from(given >= 0.5),
                    None => given,
                },
            );
        }
    }

    fn scatter(&self, values: &mut [f64]) {
        for Slot { value, position, conversion } in &self.slots {
            let own = self.values.get(*value);
            values[*position] = match conversion {
                Some((to_seen, _)) => to_seen.apply(own),
                // Any other value than 0 is true.
                None if self.function == BOOLEAN => f64::from(own != 0.0),
                None => own,
            };
        }
    }
}

/// The name of Booleans in their functions.
const BOOLEAN: &str = "Boolean";

impl Selection {
    /// The names of the selected variables, in their order.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }
}

/// An instance of an [`Fmu`], bound to the thread that created it. Dropping it terminates and frees it.
///
/// The order of calls is that of FMI: [`set_up`](Self::set_up), [`enter_initialization`](Self::enter_initialization),
/// [`exit_initialization`](Self::exit_initialization), and then [`step`](Self::step) for each communication step.
/// Values may be set at any point that the variable allows.
///
/// Each call fails with a [`CallFailed`] when the FMU does not return `fmi2OK` or `fmi2Warning`. After a fatal error
/// the FMU is not called again.
pub struct Instance {
    fmu: Arc<Fmu>,
    name: String,
    handle: Rc<Handle>,
    time: Option<f64>,
    warnings: Vec<Message>,
}

/// A saved state, which the instance can restore any number of times.
pub struct SavedState {
    state: FmuState,
    handle: Rc<Handle>,
    time: Option<f64>,
}

impl Drop for SavedState {
    fn drop(&mut self) {
        self.handle.free_state(self.state);
    }
}

impl Instance {
    /// Its name, with which error messages begin.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The FMU's warnings since the last call of this function, the oldest first.
    pub fn take_warnings(&mut self) -> Vec<Message> {
        self.collect();
        std::mem::take(&mut self.warnings)
    }

    /// Keeps the warnings among messages.
    fn collect(&mut self) {
        let messages = self.handle.take_messages().into_iter();
        let warnings = messages.filter(|message| message.status == Status::WARNING);
        self.warnings.extend(warnings.map(|message| messages::with_names(message, &self.fmu.description)));
    }

    /// Turns a call's status into a result; the function name is without its version.
    fn check(&mut self, function: fmt::Arguments<'_>, variables: &[String], status: Status) -> Result<()> {
        if status == Status::OK {
            return Ok(());
        }
        if status.succeeded() {
            self.collect();
            return Ok(());
        }
        let function = format!("{}{function}", self.fmu.functions.prefix());
        let is_discarded_step = status == Status::DISCARD && function.ends_with("DoStep");
        bail!(CallFailed {
            instance: self.name.clone(),
            function,
            variables: variables.to_owned(),
            time: self.time,
            status: Some(status),
            messages: messages::telling(self.handle.take_messages(), &self.fmu.description),
            last_successful_time: if is_discarded_step { self.handle.last_successful_time() } else { None },
        });
    }

    /// Sets the relative tolerance of the FMU's integrator, before [`Instance::set_up`].
    pub fn set_tolerance(&mut self, tolerance: Option<f64>) {
        self.handle.tolerance.set(tolerance);
    }

    /// Sets the experiment's times (s); values may be set before. FMUs of FMI 3.0 get them on
    /// [entering initialization](Self::enter_initialization).
    ///
    /// # Errors
    /// When the call fails.
    pub fn set_up(&mut self, start_time: f64, stop_time: Option<f64>) -> Result<()> {
        let status = self.handle.setup_experiment(start_time, stop_time);
        self.check(format_args!("SetupExperiment"), &[], status)?;
        self.time = Some(start_time);
        Ok(())
    }

    /// Begins the initialization, in which outputs can be read and inputs set.
    ///
    /// # Errors
    /// When the call fails.
    pub fn enter_initialization(&mut self) -> Result<()> {
        let status = self.handle.enter_initialization_mode();
        self.check(format_args!("EnterInitializationMode"), &[], status)
    }

    /// Ends the initialization; steps follow.
    ///
    /// # Errors
    /// When the call fails.
    pub fn exit_initialization(&mut self) -> Result<()> {
        let status = self.handle.exit_initialization_mode();
        self.check(format_args!("ExitInitializationMode"), &[], status)
    }

    /// Steps from a time (s) by a size (s).
    ///
    /// # Errors
    /// [`Ended`] when the FMU asks for the end of the simulation; its values are then those at the end. Otherwise when the
    /// call fails; after a discarded step, [`CallFailed::last_successful_time`] is the time reached.
    pub fn step(&mut self, time: f64, size: f64) -> Result<()> {
        let status = self.handle.do_step(time, size);
        // In FMI 2.0 the step is then discarded; in FMI 3.0 it succeeds.
        let may_end =
            if self.fmu.description.is_fmi3() { status.succeeded() } else { status == Status::DISCARD };
        if may_end && self.handle.terminates() {
            self.collect();
            let time = self.handle.last_successful_time().unwrap_or(time + size);
            bail!(Ended { instance: self.name.clone(), time });
        }
        self.check(format_args!("DoStep"), &[], status)?;
        self.time = Some(time + size);
        Ok(())
    }

    /// Gets variables: writes one value for each name of the selection, which is of this instance's FMU. Allocates
    /// nothing.
    ///
    /// # Errors
    /// When a call fails.
    ///
    /// # Panics
    /// When there are fewer values than names.
    pub fn get(&mut self, selection: &mut Selection, values: &mut [f64]) -> Result<()> {
        for group in &mut selection.groups {
            self.read(group, &selection.names)?;
            group.scatter(values);
        }
        Ok(())
    }

    fn read(&mut self, group: &mut Group, names: &[String]) -> Result<()> {
        let status = self.handle.get(group.number_type, &group.references, &mut group.values);
        self.check(format_args!("Get{}", group.function), names, status)
    }

    /// Sets variables: one value for each name of the selection, which is of this instance's FMU. An Integer becomes
    /// the nearest whole number, a Boolean true from 0.5 on. Elements of an array that are not selected stay.
    ///
    /// # Errors
    /// When a call fails.
    ///
    /// # Panics
    /// When there are fewer values than names.
    pub fn set(&mut self, selection: &mut Selection, values: &[f64]) -> Result<()> {
        for group in &mut selection.groups {
            // Elements not selected keep their values.
            if !group.arrays.is_empty() {
                self.read(group, &selection.names)?;
            }
            group.gather(values);
            let status = self.handle.set(group.number_type, &group.references, &group.values);
            self.check(format_args!("Set{}", group.function), &selection.names, status)?;
        }
        Ok(())
    }

    /// The current value of a numeric variable, in the unit that the FMU declares. [`Instance::get`] resolves names
    /// only once.
    ///
    /// # Errors
    /// When there is no numeric variable of this name, or the call fails.
    pub fn number(&mut self, name: &str) -> Result<f64> {
        let mut value = [0.0];
        let mut selection = self.fmu.select([name])?;
        self.get(&mut selection, &mut value)?;
        Ok(value[0])
    }

    /// Sets a variable to a value of its type, in its unit or one that converts to it. An Enumeration takes the name of
    /// an item or its number.
    ///
    /// # Errors
    /// When there is no variable of this name, the value does not fit its type or unit, or the call fails.
    pub fn set_value(&mut self, name: &str, value: &Value) -> Result<()> {
        let fmu = Arc::clone(&self.fmu);
        let variable = fmu.variable(name)?;
        self.set_fitted(variable, &value.fit(variable, &[], &fmu.description)?)
    }

    /// Sets the variables of a parameter set (SSP), converted to their units.
    ///
    /// # Errors
    /// When the set does not [fit](ParameterSet::fit) the FMU, in which case nothing is set, or a call fails.
    pub fn set_parameters(&mut self, set: &ParameterSet) -> Result<()> {
        let fmu = Arc::clone(&self.fmu);
        let fitted =
            set.fit(&fmu.description).with_context(|| format!("the parameter set '{}'", set.name))?;
        fitted
            .parameters
            .iter()
            .try_for_each(|parameter| self.set_fitted(fmu.variable(&parameter.name)?, &parameter.value))
    }

    /// Sets a variable to a fitting value.
    fn set_fitted(&mut self, variable: &FmuVariable, value: &Value) -> Result<()> {
        let name = &variable.name;
        let number = match value {
            Value::Real(value, _) => *value,
            Value::Integer(value) => f64::from(*value),
            Value::Boolean(value) => f64::from(u8::from(*value)),
            Value::Enumeration(item) => {
                let enumeration = self.fmu.description.enumeration(&variable.declared_type);
                let items = enumeration.map_or(&[] as &[_], |known| known.items.as_slice());
                let number = items.iter().find(|(known, _)| known == item).map(|(_, number)| *number);
                f64::from(number.with_context(|| format!("{name} has no item {item}"))?)
            }
            Value::String(value) => {
                if variable.element.is_some() {
                    bail!("{name} is in an array of texts, which cannot be set");
                }
                let text =
                    CString::new(value.as_str()).with_context(|| format!("{name} holds a zero byte"))?;
                let status = self.handle.set_string(reference(variable)?, &text);
                return self.check(format_args!("SetString"), std::slice::from_ref(name), status);
            }
        };
        let mut selection = self.fmu.select([name.as_str()])?;
        self.set(&mut selection, &[number])
    }

    /// Saves the state of the FMU.
    ///
    /// # Errors
    /// When the FMU cannot save its state (capability `canGetAndSetFMUstate`), or the call fails.
    pub fn save(&mut self) -> Result<SavedState> {
        let Some((status, state)) = self.handle.get_state() else {
            bail!("{}: the FMU cannot save its state", self.name);
        };
        let word = self.fmu.functions.state();
        self.check(format_args!("Get{word}"), &[], status)?;
        Ok(SavedState { state, handle: Rc::clone(&self.handle), time: self.time })
    }

    /// Restores a state that this instance saved.
    ///
    /// # Errors
    /// When the state is another instance's, the FMU cannot restore states, or the call fails.
    pub fn restore(&mut self, saved: &SavedState) -> Result<()> {
        if !Rc::ptr_eq(&self.handle, &saved.handle) {
            bail!("{}: the state is another instance's", self.name);
        }
        let Some(status) = self.handle.set_state(saved.state) else {
            bail!("{}: the FMU cannot restore its state", self.name);
        };
        let word = self.fmu.functions.state();
        self.check(format_args!("Set{word}"), &[], status)?;
        self.time = saved.time;
        Ok(())
    }
}
