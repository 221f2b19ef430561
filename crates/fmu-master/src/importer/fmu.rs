//! FMUs, extracted and loaded for one of their interfaces.

use std::collections::BTreeMap;
use std::iter::repeat_n;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use fmu_abi::fmi2::c_types::ValueReference;
use fmu_io::{reading, terminal};
use fmu_package::library::refuse_cut_short;
use fmu_package::{
    BuildConfiguration, FmuDescription, FmuVariable, Function, MODEL_DESCRIPTION, Platform, read_xml,
};
use fmu_solve::integrator::Pattern;
use fmu_terms::{Causality, DataType, Interface, Version, like};

use super::c_boundary::Loaded;
use super::folder::extract;

/// The capability flag of FMUs with a single instance per process, for [`Fmu::has_capability`].
pub const ONLY_ONCE: &str = "canBeInstantiatedOnlyOncePerProcess";

/// The capability flag of FMUs with Event Mode in co-simulation.
const EVENT_MODE: &str = "hasEventMode";

/// An FMU of FMI 2.0 or 3.0, extracted to a temporary folder and loaded. Its folder and library stay until it and its
/// instances are dropped.
pub struct Fmu {
    path: PathBuf,
    interface: Interface,
    description: FmuDescription,
    /// The conversions to the FMU's values of inputs and from those of other variables, by name.
    pub(super) conversions: BTreeMap<String, Function>,
    /// The values from which on Booleans are true, by name.
    pub(super) thresholds: BTreeMap<String, f64>,
    /// The continuous states of Model Exchange.
    pub(super) states: Arc<[State]>,
    /// Where the Jacobian of the states has elements, by `ModelStructure`.
    pub(super) pattern: Arc<Pattern>,
    /// Whether the FMU needs Event Mode in co-simulation: for clocks.
    pub(super) needs_event_mode: bool,
    pub(super) loaded: Arc<Loaded>,
}

/// The description in a file, with the elements of arrays.
fn described(file: &Path) -> Result<FmuDescription> {
    if !file.is_file() {
        bail!("there is no {MODEL_DESCRIPTION} in it");
    }
    FmuDescription::parse(&read_xml(file)?)
        .and_then(FmuDescription::scalars)
        .with_context(|| format!("its {MODEL_DESCRIPTION} cannot be read"))
}

/// A continuous state.
pub struct State {
    pub name: String,
    pub reference: ValueReference,
    pub derivative: ValueReference,
    /// The derivative's name.
    pub derivative_name: String,
    /// The state's least and greatest value.
    pub range: (f64, f64),
}

impl Fmu {
    /// Extracts an FMU, reads its description and loads its library: for co-simulation if it offers that, else for
    /// Model Exchange.
    ///
    /// # Errors
    /// If there is no such file, it is not an FMU, it has neither interface, it is not for this platform, its FMI
    /// version is neither 2.0 nor 3.0, or its library cannot be loaded; the message names the file.
    pub fn open(path: impl AsRef<Path>) -> Result<Arc<Self>> {
        Self::open_with(path, None)
    }

    /// Opens an FMU as [`Fmu::open`] does, for the given interface, if any.
    ///
    /// # Errors
    /// When the FMU cannot be opened, as for [`Fmu::open`], or does not have the interface.
    pub fn open_with(path: impl AsRef<Path>, interface: Option<Interface>) -> Result<Arc<Self>> {
        Self::open_described(path.as_ref(), interface, None)
    }

    /// Opens an FMU as [`Fmu::open_with`] does; a description already read has the elements of arrays.
    pub(crate) fn open_described(
        path: &Path,
        interface: Option<Interface>,
        description: Option<FmuDescription>,
    ) -> Result<Arc<Self>> {
        let fmu = Self::open_anonymous(path, interface, description);
        Ok(Arc::new(fmu.with_context(|| format!("cannot import {}", path.display()))?))
    }

    fn open_anonymous(
        path: &Path,
        interface: Option<Interface>,
        description: Option<FmuDescription>,
    ) -> Result<Self> {
        if !path.exists() {
            bail!("there is no such file");
        }
        let Some(platform) = Platform::host() else { bail!("FMI does not support this platform") };
        let mut has_build_description = false;
        let folder = extract(path, |entry| {
            has_build_description |= entry == BuildConfiguration::PATH;
            platform.needs(entry)
        })?;
        let description = match description {
            Some(description) => description,
            None => described(&folder.path().join(MODEL_DESCRIPTION))?,
        };
        let (declared, version) = (description.attribute("fmiVersion"), description.version());
        if version == Version::Two && !declared.starts_with("2.") {
            bail!("it is an FMI {declared} FMU; only FMI 2.0 and 3.0 are supported");
        }
        let (interface, identifier) = chosen(&description, interface)?;
        let name = platform.library_path(identifier, version);
        let file = folder.path().join(&name);
        if !file.is_file() {
            let has_sources = has_build_description || !description.source_files.is_empty();
            let remedy = if has_sources {
                format!("; `{} compile {}` compiles its C sources", terminal::program(), path.display())
            } else {
                String::new()
            };
            bail!("it has no {name}: it is not for this platform{remedy}");
        }
        refuse_cut_short(reading::open(&file)?).with_context(|| format!("its {name}"))?;
        let is_exchange = interface == Interface::ModelExchange;
        let needs_event_mode = !is_exchange && needs_event_mode(&description)?;
        let (states, pattern) = if is_exchange {
            (states(&description)?, pattern(&description)?)
        } else {
            (vec![], Pattern::full())
        };
        let loaded = Loaded::new(folder, &file, version, interface)?;
        if needs_event_mode {
            loaded.refuse_no_event_mode()?;
        }
        Ok(Self {
            path: path.to_owned(),
            interface,
            description,
            states: states.into(),
            pattern: Arc::new(pattern),
            needs_event_mode,
            conversions: BTreeMap::new(),
            thresholds: BTreeMap::new(),
            loaded: Arc::new(loaded),
        })
    }

    /// The FMU with another description, whose names and units replace its own from here on. `conversions` lead to the
    /// FMU's values of inputs and from those of other variables, as signals do, and `thresholds` are the numbers from
    /// which Booleans are true. Both FMUs share the loaded library.
    #[must_use]
    pub fn translated(
        &self,
        description: FmuDescription,
        mut conversions: BTreeMap<String, Function>,
        thresholds: BTreeMap<String, f64>,
    ) -> Arc<Self> {
        conversions.retain(|_, conversion| *conversion != Function::IDENTITY);
        Arc::new(Self {
            path: self.path.clone(),
            interface: self.interface,
            states: Arc::clone(&self.states),
            pattern: Arc::clone(&self.pattern),
            needs_event_mode: self.needs_event_mode,
            description,
            conversions,
            thresholds,
            loaded: Arc::clone(&self.loaded),
        })
    }

    /// The conversions from the FMU's values of a variable and to them, if they are converted.
    pub(super) fn conversions_of(&self, variable: &FmuVariable) -> Option<(Function, Function)> {
        let given = self.conversions.get(&variable.name)?.clone();
        let inverse = given.clone().inverse();
        let is_input = variable.causality == Causality::Input;
        Some(if is_input { (inverse, given) } else { (given, inverse) })
    }

    /// The content of modelDescription.xml: variables, units, capabilities and so on. Array elements are variables.
    #[must_use]
    pub fn description(&self) -> &FmuDescription {
        &self.description
    }

    /// The interface that the FMU is loaded for.
    #[must_use]
    pub fn interface(&self) -> Interface {
        self.interface
    }

    /// Whether the FMU declares a capability flag for its [interface](Self::interface), such as [`ONLY_ONCE`].
    #[must_use]
    pub fn has_capability(&self, flag: &str) -> bool {
        self.description.has_capability(self.interface, flag)
    }

    /// The tolerance of its default experiment, if it has one.
    #[must_use]
    pub fn default_tolerance(&self) -> Option<f64> {
        let defaults = &self.description.default_experiment;
        let (_, text) = defaults.iter().find(|(name, _)| name == "tolerance")?;
        text.trim().parse().ok().filter(|tolerance: &f64| *tolerance > 0.0 && tolerance.is_finite())
    }

    /// Refuses an FMU that cannot be instantiated [with early return](Self::instantiate_with_early_return).
    ///
    /// # Errors
    /// When it runs by Model Exchange, is of FMI 2.0, or has no Event Mode in co-simulation.
    pub fn refuse_no_event_mode(&self) -> Result<()> {
        if self.interface == Interface::ModelExchange {
            bail!("it runs by Model Exchange, which handles events anyway");
        }
        if self.description.version() == Version::Two {
            bail!("co-simulation of FMI 2.0 has no Event Mode");
        }
        if !self.has_capability(EVENT_MODE) {
            bail!("it has no Event Mode in co-simulation ({EVENT_MODE} is false)");
        }
        Ok(self.loaded.refuse_no_event_mode()?)
    }

    /// A variable, by its name.
    ///
    /// # Errors
    /// If there is none; the message suggests the nearest name.
    pub fn variable(&self, name: &str) -> Result<&FmuVariable> {
        self.description.variable(name).with_context(|| {
            let names = self.description.variables.iter().map(|variable| variable.name.as_str());
            format!("{} has no variable {name}{}", self.path.display(), like(name, names))
        })
    }

    /// The names of the variables of a causality, in the FMU's order.
    pub fn names(&self, causality: Causality) -> impl Iterator<Item = &str> {
        self.description.of_causality(causality).map(|variable| variable.name.as_str())
    }
}

/// A variable's value reference as a number.
pub(super) fn reference(variable: &FmuVariable) -> Result<ValueReference> {
    variable.value_reference.meaning().with_context(|| {
        format!("the value reference of {} is '{}'", variable.name, variable.value_reference)
    })
}

/// The interface by which to run an FMU, and the identifier of its library.
fn chosen(description: &FmuDescription, wanted: Option<Interface>) -> Result<(Interface, &str)> {
    let offered = |interface: Interface| {
        let identifier = description.identifier(interface);
        identifier.map(|identifier| (interface, identifier))
    };
    let both = [Interface::CoSimulation, Interface::ModelExchange];
    let found = match wanted {
        Some(interface) => offered(interface),
        None => both.into_iter().find_map(offered),
    };
    let others: Vec<_> = both.into_iter().filter_map(offered).map(|(other, _)| other.name()).collect();
    found.with_context(|| match (wanted, others.first()) {
        (Some(interface), Some(other)) => format!("it is not for {}, only for {other}", interface.name()),
        _ if description.interface(Interface::ScheduledExecution).is_some() => {
            "it is for Scheduled Execution only, which needs a scheduler for its clocks".to_owned()
        }
        _ => "it is neither for co-simulation nor for Model Exchange".to_owned(),
    })
}

/// Whether co-simulation needs Event Mode: for clocks.
fn needs_event_mode(description: &FmuDescription) -> Result<bool> {
    let Some(clock) = input_clocks(description).next() else { return Ok(false) };
    if !description.has_capability(Interface::CoSimulation, EVENT_MODE) {
        bail!("its clock {} needs Event Mode, which it does not have in co-simulation", clock.name);
    }
    Ok(true)
}

/// The clocks that the importer lets tick.
pub(super) fn input_clocks(description: &FmuDescription) -> impl Iterator<Item = &FmuVariable> {
    description.of_causality(Causality::Input).filter(|variable| variable.data_type == DataType::Clock)
}

fn states(description: &FmuDescription) -> Result<Vec<State>> {
    let states = description.continuous_states().context("its modelDescription.xml is broken")?;
    let named = |[state, derivative]: [&FmuVariable; 2]| {
        Ok(State {
            name: state.name.clone(),
            reference: reference(state)?,
            derivative: reference(derivative)?,
            derivative_name: derivative.name.clone(),
            range: state.range()?,
        })
    };
    states.into_iter().map(named).collect()
}

/// Where the Jacobian of the states has elements; full if any derivative depends on all of them.
fn pattern(description: &FmuDescription) -> Result<Pattern> {
    let dependencies = description.state_dependencies().context("its modelDescription.xml is broken")?;
    // The elements of an array share them.
    let of_elements = dependencies.iter().flat_map(|(elements, listed)| repeat_n(listed.as_ref(), *elements));
    let rows: Option<Vec<_>> = of_elements.collect();
    Ok(rows.map_or_else(Pattern::full, |rows| {
        Pattern::of_rows(rows.len(), |row, columns| columns.extend(rows[row]))
    }))
}
