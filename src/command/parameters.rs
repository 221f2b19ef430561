//! `parameters`: an FMU's parameters as a parameter set to be edited.

use std::path::Path;

use anyhow::{Context, Result, bail};
use fmi2_export::package::terminal::print;
use fmi2_export::package::{FmuDescription, FmuVariable, Parameter, ParameterSet, Value, writing};

/// Writes the parameters of an FMU, with their start values, to a new file.
pub fn run(path: &Path, out: Option<&Path>) -> Result<()> {
    let description = FmuDescription::read(path)?;
    let set = defaults(&description)
        .with_context(|| format!("modelDescription.xml in {} is not as it should be", path.display()))?;
    let name = format!("{}.ssv", set.name);
    let out = out.unwrap_or(Path::new(&name));
    writing::write_new(out, set.to_xml().as_bytes())?;
    Ok(print(&format!("{}  {} parameters\n", out.display(), set.parameters.len()))?)
}

/// The start values of an FMU's parameters.
fn defaults(description: &FmuDescription) -> Result<ParameterSet> {
    let parameters = description.of_causality("parameter").filter(|variable| variable.is_settable());
    let parameters = parameters.map(|variable| {
        let value = start(variable, description)
            .with_context(|| format!("the start value of {} is '{}'", variable.name, variable.start))?;
        Ok(Parameter { name: variable.name.clone(), description: variable.description.clone(), value })
    });
    Ok(ParameterSet {
        name: description.co_simulation_identifier().unwrap_or("Parameters").to_owned(),
        description: format!(
            "The parameters of {}, as they are by default",
            description.attribute("modelName")
        ),
        parameters: parameters.collect::<Result<_>>()?,
        units: description.units.clone(),
    })
}

fn start(variable: &FmuVariable, description: &FmuDescription) -> Result<Value> {
    let text = variable.start.trim();
    Ok(match variable.data_type.as_str() {
        "Real" => {
            let unit = Some(variable.unit.clone()).filter(|unit| !unit.is_empty());
            Value::Real(text.parse()?, unit)
        }
        "Integer" => Value::Integer(text.parse()?),
        "Boolean" => Value::Boolean(matches!(text, "true" | "1")),
        "Enumeration" => {
            let value: i32 = text.parse()?;
            let enumeration = description.enumeration(&variable.declared_type);
            let item = enumeration.and_then(|known| known.items.iter().find(|(_, item)| *item == value));
            Value::Enumeration(item.context("no item has this value")?.0.clone())
        }
        "String" => Value::String(variable.start.clone()),
        other => bail!("values of the type {other} are not known"),
    })
}
