//! `parameters`: an FMU's parameters as a parameter set to be edited; and whether a set is one for an FMU.

use std::path::Path;

use anyhow::{Context, Result, bail};
use fmi2_export::package::{ModelDescription, Parameter, ParameterSet, Value, Variable};

use super::{fmu, write_new};

/// Writes the parameters of an FMU, with their start values, to a new file.
pub fn run(path: &Path, out: Option<&Path>) -> Result<()> {
    let description = fmu::describe(path)?;
    let set = defaults(&description)
        .with_context(|| format!("modelDescription.xml in {} is not as it should be", path.display()))?;
    let name = format!("{}.ssv", set.name);
    let out = out.unwrap_or(Path::new(&name));
    write_new(out, set.to_xml().as_bytes())?;
    println!("{}  {} parameters", out.display(), set.parameters.len());
    Ok(())
}

/// Reads a parameter set.
pub fn read(path: &Path) -> Result<ParameterSet> {
    let shown = path.display();
    let text =
        std::fs::read_to_string(path).with_context(|| format!("cannot read the parameter set {shown}"))?;
    ParameterSet::parse(&text).with_context(|| format!("the parameter set {shown} is not as it should be"))
}

/// The start values of an FMU's parameters.
fn defaults(description: &ModelDescription) -> Result<ParameterSet> {
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

fn start(variable: &Variable, description: &ModelDescription) -> Result<Value> {
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

/// The set as the FMU takes it: each value of its variable's type, in its unit and within its range.
///
/// # Errors
/// At the first parameter that is none of the FMU's, or of another type, unit or range; the message names it.
pub fn fit(set: &ParameterSet, description: &ModelDescription) -> Result<ParameterSet> {
    let parameters = set.parameters.iter().map(|parameter| {
        let name = &parameter.name;
        let variable = description.variable(name).with_context(|| {
            format!(
                "{} has no variable {name}{}",
                description.attribute("modelName"),
                like(name, description)
            )
        })?;
        if !variable.is_settable() {
            bail!("{name} cannot be set: it is of the causality {}", variable.causality);
        }
        let value = fit_value(&parameter.value, variable, set, description)
            .with_context(|| format!("the value of {name} cannot be taken"))?;
        Ok(Parameter { value, ..parameter.clone() })
    });
    Ok(ParameterSet {
        parameters: parameters.collect::<Result<_>>()?,
        units: description.units.clone(),
        ..set.clone()
    })
}

fn fit_value(
    value: &Value,
    variable: &Variable,
    set: &ParameterSet,
    description: &ModelDescription,
) -> Result<Value> {
    let (min, max) = variable.range()?;
    let within = |value: f64, shown: String| {
        if (min..=max).contains(&value) {
            Ok(())
        } else {
            Err(anyhow::anyhow!("{shown} is not within {min}..{max}"))
        }
    };
    match (variable.data_type.as_str(), value) {
        ("Real", Value::Real(value, unit)) => {
            let value = match unit {
                Some(unit) if *unit != variable.unit => convert(*value, unit, variable, set, description)?,
                _ => *value,
            };
            within(value, format!("{value} {}", variable.unit))?;
            Ok(Value::Real(value, Some(variable.unit.clone()).filter(|unit| !unit.is_empty())))
        }
        ("Real", Value::Integer(value)) => {
            let value = Value::Real(f64::from(*value), None);
            fit_value(&value, variable, set, description)
        }
        ("Integer", Value::Integer(value)) => {
            within(f64::from(*value), value.to_string())?;
            Ok(Value::Integer(*value))
        }
        ("Boolean", Value::Boolean(value)) => Ok(Value::Boolean(*value)),
        ("String", Value::String(value)) => Ok(Value::String(value.clone())),
        ("Enumeration", value @ (Value::Enumeration(_) | Value::Integer(_))) => {
            let enumeration = description
                .enumeration(&variable.declared_type)
                .with_context(|| format!("its type {} is not defined", variable.declared_type))?;
            let is_meant = |(name, number): &&(String, i32)| match value {
                Value::Integer(wanted) => number == wanted,
                Value::Enumeration(wanted) => name == wanted,
                _ => false,
            };
            let (item, _) = enumeration.items.iter().find(is_meant).with_context(|| {
                let items: Vec<_> = enumeration.items.iter().map(|(name, _)| name.as_str()).collect();
                format!("it is none of {}", items.join(", "))
            })?;
            Ok(Value::Enumeration(item.clone()))
        }
        (wanted, given) => bail!("it is of the type {}, not {wanted}", type_name(given)),
    }
}

/// The value in the variable's unit.
fn convert(
    value: f64,
    unit: &str,
    variable: &Variable,
    set: &ParameterSet,
    description: &ModelDescription,
) -> Result<f64> {
    let own = set
        .units
        .iter()
        .find(|known| known.name == unit)
        .cloned()
        .or_else(|| description.unit(unit))
        .with_context(|| format!("the unit {unit} is not defined"))?;
    let wanted = description.unit(&variable.unit).and_then(|unit| unit.base);
    let conversion = own.base.zip(wanted).and_then(|(own, wanted)| own.to(&wanted));
    let conversion =
        conversion.with_context(|| format!("the unit {unit} does not convert to {}", variable.unit))?;
    Ok(conversion.apply(value))
}

fn type_name(value: &Value) -> &'static str {
    match value {
        Value::Real(..) => "Real",
        Value::Integer(_) => "Integer",
        Value::Boolean(_) => "Boolean",
        Value::String(_) => "String",
        Value::Enumeration(_) => "Enumeration",
    }
}

/// The name that is likeliest meant, as the end of a message.
fn like(name: &str, description: &ModelDescription) -> String {
    let settable = description.variables.iter().filter(|variable| variable.is_settable());
    settable
        .map(|variable| (strsim::jaro_winkler(name, &variable.name), &variable.name))
        .filter(|(likeness, _)| *likeness > 0.8)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map_or_else(String::new, |(_, name)| format!("; the nearest is {name}"))
}
