//! `parameters`: an FMU's parameters as a parameter set to edit.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use fmu_io::terminal::print;
use fmu_io::writing;
use fmu_package::{FmuDescription, FmuVariable, Parameter, ParameterSet, Value, ValueType};
use fmu_terms::Causality;

/// Write an FMU's parameters and their defaults to a parameter set to edit
#[derive(Args, Debug)]
pub struct Parameters {
    /// An FMU from any tool
    #[arg(value_name = "FILE.fmu")]
    file: PathBuf,
    /// The file to write [default: MODEL.ssv, after the model identifier]
    #[arg(long, value_name = "FILE.ssv")]
    out: Option<PathBuf>,
}

impl Parameters {
    /// Writes the parameters of an FMU, with their start values, to a new file.
    ///
    /// # Errors
    /// When the FMU cannot be read, or the file already exists or cannot be written.
    pub fn run(&self) -> Result<()> {
        let set =
            FmuDescription::read(&self.file)?.scalars().map_err(Into::into).and_then(|it| defaults(&it));
        let set =
            set.with_context(|| format!("modelDescription.xml in {} is invalid", self.file.display()))?;
        let name = format!("{}.ssv", set.name);
        let out = self.out.as_deref().unwrap_or(Path::new(&name));
        writing::write_new(out, set.to_xml().as_bytes())?;
        Ok(print(&format!("{}  {} parameters\n", out.display(), set.parameters.len()))?)
    }
}

/// The start values of an FMU's parameters.
fn defaults(description: &FmuDescription) -> Result<ParameterSet> {
    let parameters = description.of_causality(Causality::Parameter).filter(|variable| variable.is_settable());
    let parameters = parameters.map(|variable| {
        let value = start(variable, description)
            .with_context(|| format!("the start value of {} is '{}'", variable.name, variable.start))?;
        Ok(Parameter { name: variable.name.clone(), description: variable.description.clone(), value })
    });
    Ok(ParameterSet {
        name: description.co_simulation_identifier().unwrap_or("Parameters").to_owned(),
        description: format!("The default parameters of {}", description.attribute("modelName")),
        parameters: parameters.collect::<Result<_>>()?,
        units: description.units.clone(),
    })
}

fn start(variable: &FmuVariable, description: &FmuDescription) -> Result<Value> {
    let text = variable.start.trim();
    Ok(match variable.value_type() {
        ValueType::Real => {
            let unit = Some(variable.unit.clone()).filter(|unit| !unit.is_empty());
            Value::Real(text.parse()?, unit)
        }
        ValueType::Integer => Value::Integer(text.parse()?),
        ValueType::Boolean => Value::Boolean(matches!(text, "true" | "1")),
        ValueType::Enumeration => {
            let value: i32 = text.parse()?;
            let enumeration = description.enumeration(&variable.declared_type);
            let item = enumeration.and_then(|known| known.items.iter().find(|(_, item)| *item == value));
            Value::Enumeration(item.context("no item has this value")?.0.clone())
        }
        ValueType::String => Value::String(variable.start.clone()),
        ValueType::Other => bail!("values of type {} are not supported", variable.data_type),
    })
}
