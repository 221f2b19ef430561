//! An instance of an FMU with access to Real variables by name.

use std::path::Path;

use anyhow::{Context, Result};
use fmi::fmi2::import::Fmi2Import;
use fmi::fmi2::instance::{CoSimulation, Common, InstanceCS};
use fmi::fmi2::schema::{Causality, ScalarVariable, ScalarVariableElement};
use fmi::import::from_path;
use fmi::traits::FmiImport;

/// An instance of a co-simulation FMU.
pub struct Slave {
    name: String,
    /// The value references of its Real outputs.
    outputs: Vec<u32>,
    instance: InstanceCS,
    /// Removes the folder of the extracted FMU when dropped, so it comes after the instance.
    import: Fmi2Import,
}

impl Slave {
    /// Extracts an .fmu and makes one instance, named after the model.
    pub fn instantiate(file: &Path) -> Result<Self> {
        let failed = |what| format!("cannot {what} {}", file.display());
        let import: Fmi2Import = from_path(file).with_context(|| failed("import"))?;
        let name = import.model_description().model_name.clone();
        let instance = import.instantiate_cs(&name, false, false).with_context(|| failed("instantiate"))?;
        let outputs = reals(&import, Causality::Output).map(|variable| variable.value_reference).collect();
        Ok(Self { name, outputs, instance, import })
    }

    /// The value reference of a Real input.
    pub fn input(&self, name: &str) -> Result<u32> {
        let found = reals(&self.import, Causality::Input).find(|variable| variable.name == name);
        Ok(found.with_context(|| format!("{}: no Real input '{name}'", self.name))?.value_reference)
    }

    /// The names of its Real outputs.
    pub fn outputs(&self) -> Vec<&str> {
        reals(&self.import, Causality::Output).map(|variable| variable.name.as_str()).collect()
    }

    /// Their values, in the same order.
    pub fn output_values(&mut self) -> Result<Vec<f64>> {
        get(&mut self.instance, &self.outputs).with_context(|| self.name.clone())
    }

    /// Sets Real variables by their value references.
    pub fn set(&mut self, references: &[u32], values: &[f64]) -> Result<()> {
        let set = self.instance.set_real(references, values);
        set.with_context(|| format!("{}: fmi2SetReal of {references:?} to {values:?}", self.name))?;
        Ok(())
    }

    /// Sets up an experiment without an end or a tolerance.
    pub fn enter_initialization(&mut self, start_time: f64) -> Result<()> {
        let begun = self.instance.setup_experiment(None, start_time, None);
        begun.with_context(|| format!("{}: fmi2SetupExperiment", self.name))?;
        let entered = self.instance.enter_initialization_mode();
        entered.with_context(|| format!("{}: fmi2EnterInitializationMode", self.name))?;
        Ok(())
    }

    /// Ends the initialization.
    pub fn exit_initialization(&mut self) -> Result<()> {
        let left = self.instance.exit_initialization_mode();
        left.with_context(|| format!("{}: fmi2ExitInitializationMode", self.name))?;
        Ok(())
    }

    /// Steps from a time on; no earlier state will be restored.
    pub fn step(&mut self, time: f64, size: f64) -> Result<()> {
        let stepped = self.instance.do_step(time, size, true);
        stepped.with_context(|| format!("{}: fmi2DoStep at {time} s", self.name))?;
        Ok(())
    }
}

fn get(instance: &mut InstanceCS, references: &[u32]) -> Result<Vec<f64>> {
    let mut values = vec![0.0; references.len()];
    let got = instance.get_real(references, &mut values);
    got.with_context(|| format!("fmi2GetReal of {references:?}"))?;
    Ok(values)
}

fn reals(import: &Fmi2Import, causality: Causality) -> impl Iterator<Item = &ScalarVariable> {
    let of_both = move |variable: &&ScalarVariable| {
        variable.causality == causality && matches!(variable.elem, ScalarVariableElement::Real(_))
    };
    import.model_description().get_model_variables().filter(of_both)
}

/// A connection: the outputs of one FMU with the names of inputs of another.
pub struct Wires {
    outputs: Vec<u32>,
    inputs: Vec<u32>,
}

impl Wires {
    /// Connects equal names.
    pub fn between(source: &Slave, target: &Slave) -> Self {
        let (outputs, inputs) = reals(&source.import, Causality::Output)
            .filter_map(|output| Some((output.value_reference, target.input(&output.name).ok()?)))
            .unzip();
        Self { outputs, inputs }
    }

    /// Transfers the values.
    pub fn transfer(&self, source: &mut Slave, target: &mut Slave) -> Result<()> {
        let values = get(&mut source.instance, &self.outputs).with_context(|| source.name.clone())?;
        target.set(&self.inputs, &values)
    }
}
