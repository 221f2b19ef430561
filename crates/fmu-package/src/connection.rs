//! Connections between FMUs, listed in TOML by a scenario or a file of their own.
//!
//! ```
//! use fmu_io::document::Document;
//! use fmu_package::connection;
//!
//! let text = r#"
//! [[connection]]
//! from = "plant:p"
//! to = "controller:boost_pressure"
//! from_unit = "bar"
//! "#;
//! let document = Document::parse("loop.toml", text)?;
//! let connections = connection::list(&document.root().required("connection", "a connection")?)?;
//! assert_eq!((connections[0].from(), connections[0].input.as_str()), ("plant:p".to_owned(), "boost_pressure"));
//! # Ok::<(), anyhow::Error>(())
//! ```

use std::fmt::{self, Display, Formatter};
use std::path::{Path, PathBuf};

use anyhow::{Result, anyhow, bail};
use fmu_io::document::{Document, Location, Node};
use fmu_io::reading;
use fmu_terms::{Linear, Unit};

use crate::model_description::FmuDescription;
use crate::transformation::Function;
use crate::units::unit_conversion;
use crate::variable::FmuVariable;

const TABLE: &str = "a table [[connection]] for each connection";

/// A connection to an input of an FMU.
#[derive(Clone, Debug)]
pub struct Connection {
    /// The name of the source FMU; none if the source is a signal of the scenario.
    pub source: Option<String>,
    /// The source FMU's output, or the signal.
    pub output: String,
    /// The name of the target FMU.
    pub target: String,
    /// The target FMU's input.
    pub input: String,
    /// The conversion from the output's value to the input's.
    pub conversion: Conversion,
    /// The converted value from which on a Boolean input is true.
    pub threshold: Option<f64>,
    /// Where the connection is given.
    pub location: Location,
}

/// How a connection converts.
#[derive(Clone, Debug, PartialEq)]
pub enum Conversion {
    /// Converts from one unit to the other, where both are known.
    Units {
        /// The output's unit, instead of the declared one.
        from: Option<String>,
        /// The input's unit, instead of the declared one.
        to: Option<String>,
    },
    /// Converts by a function.
    Function(Function),
}

/// Why an FMU cannot have a name: a colon ends it in `FMU:variable`.
#[must_use]
pub fn refused_name(fmu: &str) -> Option<String> {
    fmu.contains(':')
        .then(|| format!("the name {fmu} has a colon, which ends an FMU's name, as in FMU:variable"))
}

impl Conversion {
    /// Converts by the declared units.
    pub const DECLARED: Self = Self::Units { from: None, to: None };

    /// The conversion in the opposite direction.
    #[must_use]
    pub fn inverse(&self) -> Self {
        match self.clone() {
            Self::Units { from, to } => Self::Units { from: to, to: from },
            Self::Function(function) => Self::Function(function.inverse()),
        }
    }
}

impl Connection {
    /// The connection's source: the FMU's name, a colon and the output, or the signal.
    #[must_use]
    pub fn from(&self) -> String {
        match &self.source {
            Some(fmu) => format!("{fmu}:{}", self.output),
            None => self.output.clone(),
        }
    }

    /// The connection's target: the FMU's name, a colon and the input.
    #[must_use]
    pub fn to(&self) -> String {
        format!("{}:{}", self.target, self.input)
    }

    /// The function from the output's value to the input's. A signal has no declared unit; a variable without a
    /// unit takes and gives values unchanged.
    ///
    /// # Errors
    /// When a unit is not known, or does not convert.
    pub fn function(
        &self,
        from: Option<(&FmuVariable, &FmuDescription)>,
        (input, taker): (&FmuVariable, &FmuDescription),
    ) -> Result<Function> {
        let (from_unit, to_unit) = match &self.conversion {
            Conversion::Function(function) => return Ok(function.clone()),
            Conversion::Units { from, to } => (from, to),
        };
        let declared: (&str, &[Unit]) =
            from.map_or(("", &[]), |(output, giver)| (&output.unit, &giver.units));
        let from_unit = from_unit.as_deref().unwrap_or(declared.0);
        let to_unit = to_unit.as_deref().unwrap_or(&input.unit);
        if from_unit.is_empty() || to_unit.is_empty() {
            return Ok(Function::IDENTITY);
        }
        let function = unit_conversion((from_unit, declared.1), (to_unit, &taker.units));
        let function = function.map(|conversion| input.of_its_quantity(conversion));
        function.map(Function::from).map_err(|reason| anyhow!("{} to {}: {reason}", self.from(), self.to()))
    }
}

/// The lines of a file.
impl Display for Connection {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        let mut line = |key: &str, text: &str| writeln!(formatter, "{key} = {}", quoted(text));
        line("from", &self.from())?;
        line("to", &self.to())?;
        match &self.conversion {
            Conversion::Units { from, to } => {
                let units = [("from_unit", from), ("to_unit", to)];
                units.into_iter().try_for_each(|(key, unit)| unit.iter().try_for_each(|unit| line(key, unit)))
            }
            Conversion::Function(Function::Linear(Linear { factor, offset })) => {
                writeln!(formatter, "factor = {factor:?}\noffset = {offset:?}")
            }
            Conversion::Function(Function::Table(entries)) => {
                let entries = entries.iter().map(|(from, to)| format!("[{from:?}, {to:?}]"));
                writeln!(formatter, "table = [{}]", entries.collect::<Vec<_>>().join(", "))
            }
        }?;
        self.threshold.iter().try_for_each(|threshold| writeln!(formatter, "threshold = {threshold:?}"))
    }
}

/// A text as a string of TOML.
fn quoted(text: &str) -> String {
    let escaped = |character: char| match character {
        '"' | '\\' => format!("\\{character}"),
        control if control.is_control() => format!("\\u{:04X}", u32::from(control)),
        other => other.to_string(),
    };
    format!("\"{}\"", text.chars().map(escaped).collect::<String>())
}

/// Reads the list of a key `connection`.
///
/// # Errors
/// When it is not a list of connections; the message names line and key, and what was expected.
pub fn list(node: &Node<'_>) -> Result<Vec<Connection>> {
    let connections = node.list(TABLE)?;
    if connections.is_empty() {
        Err(node.unexpected(TABLE))
    } else {
        connections.iter().map(connection).collect()
    }
}

fn connection(node: &Node<'_>) -> Result<Connection> {
    const FROM: &str = "the source: \"FMU:output\" or a signal";
    const TO: &str = "the target: \"FMU:input\"";
    const FACTOR: &str = "a number other than 0";
    let table = node.table(TABLE)?;
    let from = table.required("from", FROM)?;
    let (source, output) = match from.string(FROM)?.split_once(':') {
        Some((fmu, output)) => (Some(fmu.to_owned()), output),
        None => (None, from.string(FROM)?),
    };
    if output.is_empty() || source.as_deref() == Some("") {
        return Err(from.unexpected(FROM));
    }
    let to = table.required("to", TO)?;
    let ends = to.string(TO)?.split_once(':').filter(|(fmu, input)| !fmu.is_empty() && !input.is_empty());
    let (target, input) = ends.ok_or_else(|| to.unexpected(TO))?;
    let unit = |key: &str| {
        let unit = table.optional(key).map(|node| node.string("a unit").map(str::to_owned));
        unit.transpose()
    };
    let (from_unit, to_unit) = (unit("from_unit")?, unit("to_unit")?);
    let factor = table.optional("factor").map(|node| match node.number(FACTOR)? {
        0.0 => Err(node.unexpected(FACTOR)),
        factor => Ok(factor),
    });
    let offset = table.optional("offset").map(|node| node.number("a number"));
    let values = table.optional("table").map(|node| pairs(&node));
    let threshold = table.optional("threshold").map(|node| node.number("a number")).transpose()?;
    let has_units = from_unit.is_some() || to_unit.is_some();
    let conversion = match (factor.transpose()?, offset.transpose()?, values.transpose()?) {
        (None, None, None) => Conversion::Units { from: from_unit, to: to_unit },
        (None, None, Some(entries)) if !has_units => Conversion::Function(Function::Table(entries)),
        (factor, offset, None) if !has_units => {
            let linear = Linear { factor: factor.unwrap_or(1.0), offset: offset.unwrap_or(0.0) };
            Conversion::Function(linear.into())
        }
        _ => {
            let message = "give either units, or a factor and an offset, or a table";
            return Err(node.location().error(message));
        }
    };
    let connection = Connection {
        source,
        output: output.to_owned(),
        target: target.to_owned(),
        input: input.to_owned(),
        conversion,
        threshold,
        location: node.location().clone(),
    };
    table.finish()?;
    Ok(connection)
}

/// The entries of a table of values.
fn pairs(node: &Node<'_>) -> Result<Vec<(f64, f64)>> {
    const PAIR: &str = "a pair of a value and the one in its place";
    let pair = |pair: &Node<'_>| {
        let [from, to] = pair.list(PAIR)?.try_into().map_err(|_| pair.unexpected(PAIR))?;
        Ok((from.number(PAIR)?, to.number(PAIR)?))
    };
    node.list("a list of pairs of values")?.iter().map(pair).collect()
}

/// Reads a file of connections.
///
/// # Errors
/// When it cannot be read, or has anything else.
pub fn read(file: &Path) -> Result<Vec<Connection>> {
    let shown = file.display();
    let text = reading::text(file)?;
    if text.trim_start().starts_with('{') {
        bail!("{shown} is JSON, as name maps were; connections are tables [[connection]] in TOML");
    }
    let document = Document::parse(&shown.to_string(), &text)?;
    let root = document.root();
    let connections = list(&root.required("connection", TABLE)?)?;
    root.finish()?;
    Ok(connections)
}

/// All connections in a line: equal texts connect equally.
#[must_use]
pub fn in_line(connections: &[Connection]) -> String {
    let lines = connections.iter().map(|connection| connection.to_string().trim_end().replace('\n', ", "));
    lines.collect::<Vec<_>>().join("; ")
}

/// Reads several files of connections.
///
/// # Errors
/// See [`read`].
pub fn read_all(files: &[PathBuf]) -> Result<Vec<Connection>> {
    Ok(files.iter().map(|file| read(file)).collect::<Result<Vec<_>>>()?.concat())
}
