//! Compiles the parameters of a set into the reference page: those of the file that the environment variable
//! `ECU_PARAMETERS` names, over the start values.

use std::env;
use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use fmu_package::{Causality, FmuDescription, FmuVariable, ParameterSet, Value};

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-env-changed=ECU_PARAMETERS");
    println!("cargo::rerun-if-changed=memory.x");
    println!("cargo::rerun-if-changed=a2l.x");
    println!("cargo::rustc-link-search={}", env::var("CARGO_MANIFEST_DIR")?);
    let description = FmuDescription::parse(boost_fmu::CONTROLLER_XML)?;
    let is_parameter = |variable: &&FmuVariable| variable.causality == Causality::Parameter;
    let mut parameters: Vec<_> = description.variables.iter().filter(is_parameter).collect();
    parameters.sort_by_key(|parameter| parameter.value_reference.meaning());
    let mut cells = String::new();
    if let Ok(file) = env::var("ECU_PARAMETERS") {
        println!("cargo::rerun-if-changed={file}");
        for parameter in ParameterSet::read(Path::new(&file))?.fit(&description)?.parameters {
            let cell = parameters.iter().position(|known| known.name == parameter.name);
            let cell = cell.ok_or_else(|| format!("{file}: {} is no parameter", parameter.name))?;
            let items =
                description.enumeration(&parameters[cell].declared_type).map(|known| &known.items[..]);
            let item = |name: &str| items?.iter().find(|(known, _)| known == name).map(|(_, value)| *value);
            let bits = match &parameter.value {
                Value::Real(number, _) => Some(number.to_bits()),
                Value::Integer(number) => Some(number.cast_unsigned().into()),
                Value::Boolean(value) => Some((*value).into()),
                Value::Enumeration(name) => item(name).map(|value| value.cast_unsigned().into()),
                Value::String(_) => None,
            };
            let bits =
                bits.ok_or_else(|| format!("{file}: {} has no cell for this value", parameter.name))?;
            write!(cells, "({cell}, {bits}),")?;
        }
    }
    let file = Path::new(&env::var("OUT_DIR")?).join("parameters.rs");
    Ok(fs::write(file, format!("&[{cells}]"))?)
}
