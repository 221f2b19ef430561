//! An instance of an FMU, of FMI 2.0 or 3.0, with access to its Reals by name.
//!
//! The crate `fmi` 0.8 reads of FMI 3.0 no unit with the base units A or K.

use std::path::Path;

use anyhow::{Context, Result, bail};
use fmi::fmi2::import::Fmi2Import;
use fmi::fmi2::instance::{CoSimulation as _, Common as _};
use fmi::fmi2::schema::{Causality as Causality2, ScalarVariableElement};
use fmi::fmi3::import::Fmi3Import;
use fmi::fmi3::schema::{AbstractVariableTrait as _, Causality as Causality3};
use fmi::fmi3::{CoSimulation as _, Common as _, Fmi3Model as _, GetSet as _};
use fmi::import::{from_path, peek_descr_path};
use fmi::schema::MajorVersion;
use fmi::schema::traits::FmiModelDescription as _;
use fmi::traits::FmiImport;
use fmi::{fmi2, fmi3};

/// An instance of a co-simulation FMU.
pub struct Slave {
    name: String,
    /// The names and value references of its Real inputs and outputs.
    inputs: Vec<(String, u32)>,
    outputs: Vec<(String, u32)>,
    instance: Instance,
}

/// An instance, and what removes the folder of the extracted FMU when dropped, so it comes after the instance.
enum Instance {
    Two(Box<fmi2::instance::InstanceCS>, #[expect(dead_code, reason = "it is dropped")] Box<Fmi2Import>),
    Three(Box<fmi3::instance::InstanceCS>, #[expect(dead_code, reason = "it is dropped")] Box<Fmi3Import>),
}

impl Slave {
    /// Extracts an .fmu and makes one instance, named after the model.
    pub fn instantiate(file: &Path) -> Result<Self> {
        let failed = |what| format!("cannot {what} {}", file.display());
        let version =
            peek_descr_path(file).and_then(|description| description.major_version().map_err(Into::into));
        let (name, [inputs, outputs], instance) = match version.with_context(|| failed("import"))? {
            MajorVersion::FMI2 => {
                let import: Fmi2Import = from_path(file).with_context(|| failed("import"))?;
                let name = import.model_description().model_name.clone();
                let instance =
                    import.instantiate_cs(&name, false, false).with_context(|| failed("instantiate"))?;
                let reals = |causality| {
                    let variables = import.model_description().get_model_variables();
                    let reals = variables.filter(|variable| {
                        variable.causality == causality
                            && matches!(variable.elem, ScalarVariableElement::Real(_))
                    });
                    reals.map(|variable| (variable.name.clone(), variable.value_reference)).collect()
                };
                let reals = [Causality2::Input, Causality2::Output].map(reals);
                (name, reals, Instance::Two(Box::new(instance), Box::new(import)))
            }
            MajorVersion::FMI3 => {
                let import: Fmi3Import = from_path(file).with_context(|| failed("import"))?;
                let name = import.model_description().model_name.clone();
                let instance = import.instantiate_cs(&name, false, false, false, false, &[]);
                let instance = instance.with_context(|| failed("instantiate"))?;
                let reals = |causality| {
                    let variables = import.model_description().model_variables.float64();
                    let reals = variables.into_iter().filter(|variable| variable.causality() == causality);
                    reals.map(|variable| (variable.name().to_owned(), variable.value_reference())).collect()
                };
                let reals = [Causality3::Input, Causality3::Output].map(reals);
                (name, reals, Instance::Three(Box::new(instance), Box::new(import)))
            }
            MajorVersion::FMI1 => bail!("{}: it is FMI 1.0", failed("import")),
        };
        Ok(Self { name, inputs, outputs, instance })
    }

    /// The value reference of a Real input.
    pub fn input(&self, name: &str) -> Result<u32> {
        let found = self.inputs.iter().find(|(known, _)| known == name);
        Ok(found.with_context(|| format!("{}: no Real input '{name}'", self.name))?.1)
    }

    /// The names of its Real outputs.
    pub fn outputs(&self) -> Vec<&str> {
        self.outputs.iter().map(|(name, _)| name.as_str()).collect()
    }

    /// Their values, in the same order.
    pub fn output_values(&mut self) -> Result<Vec<f64>> {
        let references: Vec<_> = self.outputs.iter().map(|(_, reference)| *reference).collect();
        self.get(&references)
    }

    /// The values of Real variables by their value references.
    fn get(&mut self, references: &[u32]) -> Result<Vec<f64>> {
        let mut values = vec![0.0; references.len()];
        let done = match &mut self.instance {
            Instance::Two(instance, _) => {
                instance.get_real(references, &mut values).map(drop).map_err(Into::into)
            }
            Instance::Three(instance, _) => {
                instance.get_float64(references, &mut values).map(drop).map_err(Into::into)
            }
        };
        self.told(done, || format!("getting {references:?}"))?;
        Ok(values)
    }

    /// Sets Real variables by their value references.
    pub fn set(&mut self, references: &[u32], values: &[f64]) -> Result<()> {
        let done = match &mut self.instance {
            Instance::Two(instance, _) => instance.set_real(references, values).map(drop).map_err(Into::into),
            Instance::Three(instance, _) => {
                instance.set_float64(references, values).map(drop).map_err(Into::into)
            }
        };
        self.told(done, || format!("setting {references:?} to {values:?}"))
    }

    /// Sets up an experiment without an end or a tolerance.
    pub fn enter_initialization(&mut self, start_time: f64) -> Result<()> {
        let done = match &mut self.instance {
            Instance::Two(instance, _) => {
                let begun = instance.setup_experiment(None, start_time, None);
                begun.and_then(|_| instance.enter_initialization_mode()).map(drop).map_err(Into::into)
            }
            Instance::Three(instance, _) => {
                instance.enter_initialization_mode(None, start_time, None).map(drop).map_err(Into::into)
            }
        };
        self.told(done, || format!("initialization from {start_time} s"))
    }

    /// Ends the initialization.
    pub fn exit_initialization(&mut self) -> Result<()> {
        let done = match &mut self.instance {
            Instance::Two(instance, _) => instance.exit_initialization_mode().map(drop).map_err(Into::into),
            Instance::Three(instance, _) => instance.exit_initialization_mode().map(drop).map_err(Into::into),
        };
        self.told(done, || "the end of initialization".to_owned())
    }

    /// Steps from a time on; no earlier state will be restored.
    pub fn step(&mut self, time: f64, size: f64) -> Result<()> {
        let done = match &mut self.instance {
            Instance::Two(instance, _) => instance.do_step(time, size, true).map(drop).map_err(Into::into),
            Instance::Three(instance, _) => {
                let [mut needs_events, mut ends, mut returns_early] = [false; 3];
                let mut reached = 0.0;
                instance
                    .do_step(time, size, true, &mut needs_events, &mut ends, &mut returns_early, &mut reached)
                    .map(drop)
                    .map_err(Into::into)
            }
        };
        self.told(done, || format!("the step at {time} s"))
    }

    /// Names the FMU and what it was called for.
    fn told(&self, done: Result<()>, what: impl Fn() -> String) -> Result<()> {
        done.with_context(|| format!("{}: {}", self.name, what()))
    }
}

/// A connection: the outputs of one FMU with the names of inputs of another.
pub struct Wires {
    outputs: Vec<u32>,
    inputs: Vec<u32>,
}

impl Wires {
    /// Connects equal names.
    pub fn between(source: &Slave, target: &Slave) -> Self {
        let ends =
            source.outputs.iter().filter_map(|(name, output)| Some((output, target.input(name).ok()?)));
        let (outputs, inputs) = ends.unzip();
        Self { outputs, inputs }
    }

    /// Transfers the values.
    pub fn transfer(&self, source: &mut Slave, target: &mut Slave) -> Result<()> {
        let values = source.get(&self.outputs)?;
        target.set(&self.inputs, &values)
    }
}
