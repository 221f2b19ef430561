//! `info`: what an FMU says of itself, FMI 1.0 to 3.0, as a table.

use std::fs::File;
use std::io::{self, Read, Write};
use std::path::Path;

use anyhow::{Context, Result, bail};
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};
use zip::ZipArchive;

/// No description that a tool wrote is as large (bytes); an archive may claim more than memory holds.
const LARGEST_DESCRIPTION: u64 = 256 << 20;

/// Prints an FMU's description and variables.
pub fn run(path: &Path) -> Result<()> {
    let shown = path.display();
    let file = File::open(path).with_context(|| format!("cannot open {shown}"))?;
    let mut archive =
        ZipArchive::new(file).with_context(|| format!("{shown} is no FMU: not a ZIP archive"))?;
    let entry = archive
        .by_name("modelDescription.xml")
        .with_context(|| format!("{shown} is no FMU: there is no modelDescription.xml in it"))?;
    let mut xml = String::new();
    let read = entry
        .take(LARGEST_DESCRIPTION + 1)
        .read_to_string(&mut xml)
        .with_context(|| format!("cannot read modelDescription.xml in {shown}"))?;
    if read as u64 > LARGEST_DESCRIPTION {
        bail!("modelDescription.xml in {shown} is larger than {LARGEST_DESCRIPTION} bytes");
    }
    let description =
        Description::parse(&xml).with_context(|| format!("modelDescription.xml in {shown} is broken"))?;
    match description.print(&mut io::stdout().lock()) {
        // Whoever reads the table may stop before its end, as `head` does.
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("cannot print"),
    }
}

/// What is shown of an FMU.
#[derive(Debug, Default)]
struct Description {
    /// Name and value of what describes the whole.
    facts: Vec<(String, String)>,
    variables: Vec<Variable>,
}

#[derive(Debug, Default)]
struct Variable {
    name: String,
    data_type: String,
    causality: String,
    variability: String,
    unit: String,
    start: String,
    range: String,
    description: String,
}

/// The attributes of an element, unescaped.
struct Attributes(Vec<(String, String)>);

impl Attributes {
    fn of(element: &BytesStart<'_>) -> Result<Self> {
        let mut attributes = vec![];
        for attribute in element.attributes() {
            let attribute = attribute?;
            let value = attribute.normalized_value(XmlVersion::Implicit1_0)?;
            attributes.push((attribute.key.as_ref().to_owned(), value.into_owned()));
        }
        Ok(Self(attributes))
    }

    fn get(&self, key: &str) -> Option<&str> {
        self.0.iter().find(|(name, _)| name == key).map(|(_, value)| value.as_str())
    }

    fn text(&self, key: &str) -> String {
        self.get(key).unwrap_or_default().to_owned()
    }
}

impl Description {
    fn parse(xml: &str) -> Result<Self> {
        let mut reader = Reader::from_str(xml);
        let mut description = Self::default();
        // The names of the open elements.
        let mut path: Vec<String> = vec![];
        // FMI 2.0 and 3.0: the units of the declared types.
        let mut type_units: Vec<(String, String)> = vec![];
        let mut root_seen = false;
        loop {
            let event = reader.read_event()?;
            let (element, is_empty) = match &event {
                Event::Start(element) => (element, false),
                Event::Empty(element) => (element, true),
                Event::End(_) => {
                    path.pop();
                    continue;
                }
                Event::Eof => break,
                _ => continue,
            };
            let name = element.local_name().as_ref().to_owned();
            let attributes = Attributes::of(element)?;
            let parents: Vec<&str> = path.iter().map(String::as_str).collect();
            match parents[..] {
                [] => {
                    if name != "fmiModelDescription" {
                        bail!("the root element is {name}, not fmiModelDescription");
                    }
                    root_seen = true;
                    description.facts = attributes.0;
                }
                [_] if matches!(name.as_str(), "CoSimulation" | "ModelExchange" | "ScheduledExecution") => {
                    let capabilities: Vec<_> =
                        attributes.0.iter().map(|(key, value)| format!("{key}={value}")).collect();
                    description.facts.push((name.clone(), capabilities.join(" ")));
                }
                [_] if name == "DefaultExperiment" => {
                    let settings: Vec<_> =
                        attributes.0.iter().map(|(key, value)| format!("{key}={value}")).collect();
                    description.facts.push((name.clone(), settings.join(" ")));
                }
                [_, "TypeDefinitions"] => type_units.push((attributes.text("name"), attributes.text("unit"))),
                [_, "TypeDefinitions", _] => {
                    if let Some((_, unit)) = type_units.last_mut() {
                        *unit = attributes.text("unit");
                    }
                }
                [_, "ModelVariables"] => {
                    let mut variable = Variable {
                        name: attributes.text("name"),
                        causality: attributes.text("causality"),
                        variability: attributes.text("variability"),
                        description: attributes.text("description"),
                        ..Variable::default()
                    };
                    // FMI 3.0: the element itself is the type.
                    if name != "ScalarVariable" {
                        variable.take_type(&name, &attributes, &type_units);
                    }
                    description.variables.push(variable);
                }
                [_, "ModelVariables", "ScalarVariable"] => {
                    if let Some(variable) = description.variables.last_mut()
                        && variable.data_type.is_empty()
                    {
                        variable.take_type(&name, &attributes, &type_units);
                    }
                }
                _ => {}
            }
            if !is_empty {
                path.push(name);
            }
        }
        if !root_seen {
            bail!("it has no root element");
        }
        if let Some(open) = path.last() {
            bail!("it ends within the element {open}");
        }
        Ok(description)
    }

    fn print(&self, out: &mut impl Write) -> io::Result<()> {
        let width = self.facts.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
        for (name, value) in self.facts.iter().filter(|(name, _)| !name.contains(':')) {
            writeln!(out, "{name:width$}  {value}")?;
        }
        writeln!(out, "\n{} variables", self.variables.len())?;
        let header = Variable {
            name: "name".into(),
            data_type: "type".into(),
            causality: "causality".into(),
            variability: "variability".into(),
            unit: "unit".into(),
            start: "start".into(),
            range: "range".into(),
            description: "description".into(),
        };
        let rows = || std::iter::once(&header).chain(&self.variables);
        let widths: Vec<usize> = (0..header.columns().len())
            .map(|column| rows().map(|row| row.columns()[column].chars().count()).max().unwrap_or(0))
            .collect();
        for row in rows() {
            for (text, &width) in row.columns().iter().zip(&widths) {
                write!(out, "{text:width$}  ")?;
            }
            writeln!(out, "{}", row.description)?;
        }
        Ok(())
    }
}

impl Variable {
    /// The columns that are aligned; the description follows them.
    fn columns(&self) -> [&str; 7] {
        [
            &self.name,
            &self.causality,
            &self.variability,
            &self.data_type,
            &self.unit,
            &self.start,
            &self.range,
        ]
    }

    /// Takes what the type's element says.
    fn take_type(&mut self, name: &str, attributes: &Attributes, type_units: &[(String, String)]) {
        name.clone_into(&mut self.data_type);
        self.start = attributes.text("start");
        let declared = attributes.get("declaredType");
        let unit_of_type = || {
            let declaration = type_units.iter().find(|(name, _)| Some(name.as_str()) == declared);
            declaration.map(|(_, unit)| unit.as_str())
        };
        attributes.get("unit").or_else(unit_of_type).unwrap_or_default().clone_into(&mut self.unit);
        if let (min, max) = (attributes.get("min"), attributes.get("max"))
            && (min.is_some() || max.is_some())
        {
            self.range = format!("{}..{}", min.unwrap_or_default(), max.unwrap_or_default());
        }
    }
}
