//! `info`: an FMU's description, as a table or as JSON.

use std::collections::BTreeMap;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use fmu_io::reading;
use fmu_io::terminal::{complain, in_line, print};
use fmu_package::{FmuDescription, FmuVariable, Library, Unit, archive, refuse_no_identifier};
use fmu_terms::Word;
use serde::Serialize;

/// Output formats.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum Format {
    /// For people
    #[default]
    Text,
    /// For programs
    Json,
}

/// Show an FMU's description and variables
#[derive(Args, Debug)]
pub struct Info {
    /// An FMU from any tool
    #[arg(value_name = "FILE.fmu")]
    file: PathBuf,
    /// Output format
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

impl Info {
    /// Prints an FMU's description and variables.
    ///
    /// # Errors
    /// When the file cannot be read, or is not an FMU.
    pub fn run(&self) -> Result<()> {
        let description = FmuDescription::read(&self.file)?;
        for identifier in description.interfaces.iter().filter_map(|(of, _)| description.identifier(*of)) {
            if let Err(error) = refuse_no_identifier(identifier) {
                complain(&format!("warning: {}: {error}", self.file.display()));
            }
        }
        Ok(print(&match self.format {
            Format::Text => table(&description),
            Format::Json => json(&self.file, &description)?,
        })?)
    }
}

/// An FMU as JSON; `docs/validation.md` describes the keys.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Json<'a> {
    file: String,
    fmi_version: Option<&'a str>,
    model_name: Option<&'a str>,
    guid: Option<&'a str>,
    attributes: BTreeMap<&'a str, &'a str>,
    interfaces: Vec<JsonInterface<'a>>,
    default_experiment: BTreeMap<&'a str, &'a str>,
    libraries: Vec<JsonLibrary>,
    units: Vec<JsonUnit<'a>>,
    enumerations: Vec<JsonEnumeration<'a>>,
    variables: Vec<JsonVariable<'a>>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct JsonInterface<'a> {
    name: &'a str,
    attributes: BTreeMap<&'a str, &'a str>,
}

#[derive(Serialize)]
struct JsonLibrary {
    path: String,
    platform: String,
    kind: Option<String>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct JsonUnit<'a> {
    name: &'a str,
    display_units: Vec<&'a str>,
}

#[derive(Serialize)]
struct JsonEnumeration<'a> {
    name: &'a str,
    items: BTreeMap<&'a str, i32>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct JsonVariable<'a> {
    name: &'a str,
    value_reference: Option<u32>,
    r#type: &'a str,
    dimensions: Option<Vec<usize>>,
    declared_type: Option<&'a str>,
    causality: Option<&'a str>,
    variability: Option<&'a str>,
    initial: Option<&'a str>,
    unit: Option<&'a str>,
    start: Option<&'a str>,
    min: Option<&'a str>,
    max: Option<&'a str>,
    description: Option<&'a str>,
    aliases: Vec<JsonAlias<'a>>,
}

#[derive(Serialize)]
struct JsonAlias<'a> {
    name: &'a str,
    description: Option<&'a str>,
}

/// Empty means undeclared.
fn declared(text: &str) -> Option<&str> {
    (!text.is_empty()).then_some(text)
}

fn json(file: &Path, description: &FmuDescription) -> Result<String> {
    fn by_name(attributes: &[(String, String)]) -> BTreeMap<&str, &str> {
        attributes.iter().map(|(name, value)| (name.as_str(), value.as_str())).collect()
    }
    let attribute = |name| declared(description.attribute(name));
    let json = Json {
        file: file.display().to_string(),
        fmi_version: attribute("fmiVersion"),
        model_name: attribute("modelName"),
        guid: declared(description.guid()),
        attributes: by_name(&description.attributes),
        interfaces: description
            .interfaces
            .iter()
            .map(|(name, attributes)| JsonInterface { name: name.as_str(), attributes: by_name(attributes) })
            .collect(),
        default_experiment: by_name(&description.default_experiment),
        libraries: libraries(file)?,
        units: description.units.iter().map(unit).collect(),
        enumerations: description
            .enumerations
            .iter()
            .map(|enumeration| JsonEnumeration {
                name: &enumeration.name,
                items: enumeration.items.iter().map(|(name, value)| (name.as_str(), *value)).collect(),
            })
            .collect(),
        variables: description.variables.iter().map(|it| variable(it, description)).collect(),
    };
    Ok(serde_json::to_string_pretty(&json)? + "\n")
}

/// The libraries directly in the platform folders; those in subfolders are for linking.
fn libraries(file: &Path) -> Result<Vec<JsonLibrary>> {
    let shown = file.display();
    let mut archive = archive::open(BufReader::new(reading::open(file)?))?;
    let mut left = reading::LARGEST_CONTENT;
    let files =
        archive::read_files(&mut archive, &mut left).with_context(|| format!("cannot read {shown}"))?;
    let libraries = files.into_iter().filter_map(|(path, content)| {
        let (platform, name) = path.strip_prefix("binaries/")?.split_once('/')?;
        if name.contains('/') || ![".so", ".dll", ".dylib"].iter().any(|suffix| name.ends_with(suffix)) {
            return None;
        }
        let kind = Library::read(&content).ok().map(|library| library.to_string());
        Some(JsonLibrary { platform: platform.to_owned(), path: path.clone(), kind })
    });
    Ok(libraries.collect())
}

fn unit(unit: &Unit) -> JsonUnit<'_> {
    let display_units = unit.display_units.iter().map(|shown| shown.name.as_str()).collect();
    JsonUnit { name: &unit.name, display_units }
}

fn variable<'a>(variable: &'a FmuVariable, description: &FmuDescription) -> JsonVariable<'a> {
    JsonVariable {
        name: &variable.name,
        value_reference: variable.value_reference.meaning(),
        r#type: variable.data_type.text(),
        dimensions: description.sizes(variable).ok().filter(|sizes| !sizes.is_empty()),
        declared_type: declared(&variable.declared_type),
        causality: declared(variable.causality.text()),
        variability: declared(variable.variability.text()),
        initial: declared(variable.initial.text()),
        unit: declared(&variable.unit),
        start: declared(&variable.start),
        min: declared(&variable.min),
        max: declared(&variable.max),
        description: declared(&variable.description),
        aliases: variable
            .aliases
            .iter()
            .map(|(name, description)| JsonAlias { name, description: declared(description) })
            .collect(),
    }
}

fn table(description: &FmuDescription) -> String {
    let joined = |attributes: &[(String, String)]| {
        attributes.iter().map(|(name, value)| format!("{name}={value}")).collect::<Vec<_>>().join(" ")
    };
    let mut facts = description.attributes.clone();
    facts.retain(|(name, _)| !name.contains(':'));
    facts.extend(
        description.interfaces.iter().map(|(name, attributes)| (name.to_string(), joined(attributes))),
    );
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
    let header = ["name", "causality", "variability", "type", "unit", "start", "range", "description"];
    let rows = description.variables.iter().flat_map(|variable| {
        let aliases = variable.aliases.iter().map(|alias| alias_columns(alias, variable));
        [columns(variable, description)].into_iter().chain(aliases)
    });
    let rows: Vec<_> = [header.map(str::to_owned)].into_iter().chain(rows).collect();
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    // The last column is not aligned.
    let widths: [usize; 7] = std::array::from_fn(width);
    for row in &rows {
        for (column, &width) in row.iter().zip(&widths) {
            text += &format!("{column:width$}  ");
        }
        text += &format!("{}\n", row[7]);
    }
    text
}

/// The row of a variable's alias.
fn alias_columns((alias, description): &(String, String), variable: &FmuVariable) -> [String; 8] {
    let of = format!("alias of {}", variable.name);
    let description = if description.is_empty() { of } else { format!("{of}: {description}") };
    [alias, "", "", "", "", "", "", &description].map(in_line)
}

/// A variable's row.
fn columns(variable: &FmuVariable, fmu: &FmuDescription) -> [String; 8] {
    let range = match (variable.min.as_str(), variable.max.as_str()) {
        ("", "") => String::new(),
        (min, max) => format!("{min}..{max}"),
    };
    let sizes = fmu.sizes(variable).unwrap_or_default();
    let sizes = sizes.iter().map(usize::to_string).collect::<Vec<_>>().join(",");
    let FmuVariable { name, causality, variability, data_type, unit, start, description, .. } = variable;
    let data_type = if sizes.is_empty() { data_type.to_string() } else { format!("{data_type}[{sizes}]") };
    [name, causality.text(), variability.text(), &data_type, unit, start, &range, description].map(in_line)
}
