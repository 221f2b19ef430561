//! `info`: what an FMU says of itself, FMI 1.0 to 3.0, as a table.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use fmu_package::terminal::{in_line, print};
use fmu_package::{FmuDescription, FmuVariable};

/// Show what an FMU is and which variables it has
#[derive(Args, Debug)]
pub struct Info {
    /// An FMU of any maker
    #[arg(value_name = "FILE.fmu")]
    file: PathBuf,
}

impl Info {
    /// Prints an FMU's description and variables.
    ///
    /// # Errors
    /// When the file cannot be read, or is no FMU.
    pub fn run(&self) -> Result<()> {
        Ok(print(&table(&FmuDescription::read(&self.file)?))?)
    }
}

fn table(description: &FmuDescription) -> String {
    let joined = |attributes: &[(String, String)]| {
        attributes.iter().map(|(name, value)| format!("{name}={value}")).collect::<Vec<_>>().join(" ")
    };
    let mut facts = description.attributes.clone();
    facts.retain(|(name, _)| !name.contains(':'));
    facts.extend(description.interfaces.iter().map(|(name, attributes)| (name.clone(), joined(attributes))));
    if !description.default_experiment.is_empty() {
        facts.push(("DefaultExperiment".to_owned(), joined(&description.default_experiment)));
    }
    let facts: Vec<_> = facts.iter().map(|(name, value)| (in_line(name), in_line(value))).collect();
    let width = facts.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
    let mut text = String::new();
    for (name, value) in &facts {
        text += &format!("{name:width$}  {value}\n");
    }

    text += &format!("\n{} variables\n", description.variables.len());
    let header = ["name", "causality", "variability", "type", "unit", "start", "range"].map(str::to_owned);
    let rows: Vec<_> = std::iter::once((header, "description".to_owned()))
        .chain(
            description.variables.iter().map(|variable| (columns(variable), in_line(&variable.description))),
        )
        .collect();
    let width = |column: usize| rows.iter().map(|(row, _)| row[column].chars().count()).max().unwrap_or(0);
    let widths: [usize; 7] = std::array::from_fn(width);
    for (row, description) in &rows {
        for (column, &width) in row.iter().zip(&widths) {
            text += &format!("{column:width$}  ");
        }
        text += &format!("{description}\n");
    }
    text
}

/// The columns that are aligned; the description follows them.
fn columns(variable: &FmuVariable) -> [String; 7] {
    let range = match (variable.min.as_str(), variable.max.as_str()) {
        ("", "") => String::new(),
        (min, max) => format!("{min}..{max}"),
    };
    let FmuVariable { name, causality, variability, data_type, unit, start, .. } = variable;
    [name, causality, variability, data_type, unit, start, &range].map(|text| in_line(text))
}
