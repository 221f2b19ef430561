//! Scenarios: TOML files of coupled FMUs, their start, their inputs and what is recorded. docs/simulate.md in the
//! repository describes every key.
//!
//! ```
//! use std::path::Path;
//!
//! use fmu_master::scenario::Scenario;
//!
//! let text = r#"
//!     step = 0.01
//!     stop_time = 30
//!     record = ["reference", "level", "controller:valve"]
//!
//!     [[fmu]]
//!     name = "controller"
//!     file = "Controller.fmu"
//!     values = { gain = 2.5 }
//!
//!     [[fmu]]
//!     name = "tank"
//!     file = "Tank.fmu"
//!
//!     [inputs]
//!     reference = { steps = [[0, 1.0], [5, 1.5]] }
//! "#;
//! let [folder, fmus] = ["scenarios", "fmus"].map(Path::new);
//! let scenario = Scenario::parse("tank.toml", text, folder, fmus)?;
//! assert_eq!(scenario.steps, 3000);
//! assert_eq!(scenario.fmus[1].file, Path::new("fmus/Tank.fmu"));
//! # Ok::<(), anyhow::Error>(())
//! ```

mod course;
mod identity;
mod signal;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use fmu_io::document::{Document, Node, TomlTable};
use fmu_io::reading;
use fmu_io::terminal::number;
use fmu_package::connection::{self, Connection};
use fmu_package::{ParameterSet, Value};
use fmu_record::Data;
use fmu_solve::time::rounding;
use toml::de::DeValue;

use crate::importer::Interface;

pub use self::course::{Course, Measured};
pub use self::identity::Identity;
pub use self::signal::Signal;
pub use fmu_io::document::Location;

/// An experiment with coupled FMUs. Its methods keep dependent fields consistent, such as `stop_time` and `steps`.
#[derive(Clone, Debug, Default)]
pub struct Scenario {
    /// The scenario's title.
    pub title: Option<String>,
    /// A description, below the title on a page.
    pub description: Option<String>,
    /// The communication step (s).
    pub step: f64,
    /// When the experiment begins (s).
    pub start_time: f64,
    /// When the experiment ends (s).
    pub stop_time: f64,
    /// The relative tolerance that the FMUs get.
    pub tolerance: Tolerance,
    /// The number of whole communication steps.
    pub steps: u32,
    /// What remains after whole steps (s): a last step of this size, unless it is 0.
    pub rest: f64,
    /// The order in which the FMUs step.
    pub stepping: Stepping,
    /// The FMUs, in the order of stepping.
    pub fmus: Vec<Member>,
    /// Signals for the inputs of every FMU that has them.
    pub inputs: Vec<Input>,
    /// All connections; if none are given, outputs and signals connect to inputs of the same name.
    pub connections: Option<Vec<Connection>>,
    /// Whether an FMU was replaced by another that may lack some of its inputs.
    pub has_replaced_fmus: bool,
    /// Noise on connections.
    pub noise: Vec<Noise>,
    /// Noise on recorded values.
    pub measurement_noise: Vec<Noise>,
    /// The recorded variables; by default all driven inputs and all outputs.
    pub record: Option<Vec<Recorded>>,
    /// The recorded variables in each panel of a plot.
    pub panels: Option<Vec<Vec<Recorded>>>,
    /// All files read, and those of the FMUs.
    pub files: Vec<PathBuf>,
}

/// The relative tolerance that FMUs get for their integrators.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Tolerance {
    /// Each FMU gets the tolerance of its default experiment, if that has one.
    #[default]
    OfFmu,
    /// No FMU gets a tolerance.
    Undefined,
    /// All FMUs get this tolerance.
    Given(f64),
}

/// The order in a communication step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stepping {
    /// The FMUs step in sequence, each with the new outputs of those before it.
    #[default]
    InTurn,
    /// All FMUs step with the outputs of the previous step.
    AtOnce,
}

/// An FMU of a scenario.
#[derive(Clone, Debug)]
pub struct Member {
    /// The name in the scenario.
    pub name: String,
    /// The path of the `.fmu` file.
    pub file: PathBuf,
    /// The interface by which the FMU runs; by default co-simulation if it offers that, else Model Exchange.
    pub interface: Option<Interface>,
    /// Whether the FMU's steps [return early](crate::Fmu::instantiate_with_early_return) for events.
    pub returns_early: bool,
    /// Where the scenario names the FMU.
    pub location: Location,
    /// Parameter sets, applied before initialization.
    pub parameters: Vec<(ParameterSet, Location)>,
    /// Values, set before initialization, after the parameter sets.
    pub values: Vec<Assignment>,
    /// A run of this FMU on its own before the experiment.
    pub run_in: Option<RunIn>,
    /// Signals that replace connections to the FMU's inputs.
    pub inputs: Vec<Input>,
}

/// A run-in: the FMU steps on its own up to the start of the experiment, with the inputs of that time.
#[derive(Clone, Debug)]
pub struct RunIn {
    /// The duration of the run-in (s).
    pub duration: f64,
    /// The number of communication steps.
    pub steps: u32,
    /// Values, set before the run-in's initialization.
    pub during: Vec<Assignment>,
    /// Values of tunable parameters, set at the end of the run-in.
    pub after: Vec<Assignment>,
}

/// A value for a variable of an FMU.
#[derive(Clone, Debug)]
pub struct Assignment {
    /// The variable's name.
    pub name: String,
    /// The value, in the unit that the FMU declares.
    pub value: Value,
    /// Where the scenario gives the value.
    pub location: Location,
}

/// An input, and what drives it.
#[derive(Clone, Debug)]
pub struct Input {
    /// The input's name.
    pub name: String,
    /// The input's values over time.
    pub course: Course,
    /// Where the scenario gives the input.
    pub location: Location,
}

/// Normally distributed noise on a connection or in the record.
#[derive(Clone, Debug)]
pub struct Noise {
    /// The input that the connection leads to, or the recorded variable.
    pub name: String,
    /// The standard deviation, in the variable's unit.
    pub standard_deviation: f64,
    /// The seed: equal seeds give equal noise.
    pub seed: u64,
    /// Where the scenario gives the noise.
    pub location: Location,
}

/// A recorded variable.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// The variable's name, with its FMU's name and a colon before it if several have it.
    pub name: String,
    /// Where the scenario names the variable.
    pub location: Location,
}

impl Member {
    /// An FMU as it is, whose name and file come from a location.
    #[must_use]
    pub fn new(name: &str, file: &Path, location: Location) -> Self {
        Self {
            name: name.to_owned(),
            file: file.to_owned(),
            interface: None,
            returns_early: false,
            location,
            parameters: vec![],
            values: vec![],
            run_in: None,
            inputs: vec![],
        }
    }
}

impl Scenario {
    /// Reads a file. Paths are relative to its folder, those of FMUs to `fmus`. The FMUs are not opened.
    ///
    /// # Errors
    /// When a file cannot be read, or the scenario is not valid; the message names line and key, and what was expected.
    pub fn read(path: &Path, fmus: &Path) -> Result<Self> {
        let text = reading::text(path)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut scenario = Self::parse(&path.to_string_lossy(), &text, folder, fmus)?;
        scenario.files.push(path.to_owned());
        Ok(scenario)
    }

    /// Reads the text of a file, whose name is for messages. Paths are relative to `folder`, those of FMUs to `fmus`.
    ///
    /// # Errors
    /// See [`Scenario::read`].
    pub fn parse(file: &str, text: &str, folder: &Path, fmus: &Path) -> Result<Self> {
        let document = Document::parse(file, text)?;
        let root = document.root();
        let title = root.title()?.map(str::to_owned);
        let description = root.optional("description").map(|node| node.string("a text")).transpose()?;
        let start = root.optional("start_time");
        let start_time = start.map_or(Ok(0.0), |node| node.number("a time in s"))?;
        let stop = root.required("stop_time", "a time in s")?;
        let stop_time = stop.number("a time in s")?;
        if stop_time <= start_time {
            return Err(stop.unexpected(&format!("a time after start_time, {} s", number(start_time))));
        }
        let step = root.required("step", "the communication step in s")?.positive("a time above 0 in s")?;
        let (steps, rest) = stop.location().locate(steps_in(start_time, stop_time, step))?;
        let mut scenario = Self {
            title,
            description: description.map(str::to_owned),
            step,
            start_time,
            stop_time,
            steps,
            rest,
            stepping: root.optional("stepping").map_or(Ok(Stepping::InTurn), |node| {
                const EXPECTED: &str = "\"in_turn\" or \"at_once\"";
                match node.string(EXPECTED)? {
                    "in_turn" => Ok(Stepping::InTurn),
                    "at_once" => Ok(Stepping::AtOnce),
                    _ => Err(node.unexpected(EXPECTED)),
                }
            })?,
            fmus: read_members(&root, step, [folder, fmus])?,
            inputs: root.optional("inputs").map_or(Ok(vec![]), |node| read_inputs(&node, folder))?,
            connections: root.optional("connection").map(|node| connection::list(&node)).transpose()?,
            noise: root.optional("noise").map_or(Ok(vec![]), |node| read_noise(&node))?,
            measurement_noise: root
                .optional("measurement_noise")
                .map_or(Ok(vec![]), |node| read_noise(&node))?,
            record: root.optional("record").map(|node| read_record(&node)).transpose()?,
            panels: root.optional("panels").map(|node| read_panels(&node)).transpose()?,
            ..Self::default()
        };
        root.finish()?;
        scenario.files = document.into_files();
        Ok(scenario)
    }

    /// The names in each panel of a plot, if the scenario has panels.
    #[must_use]
    pub fn panel_names(&self) -> Option<Vec<Vec<String>>> {
        let names = |panel: &Vec<Recorded>| panel.iter().map(|recorded| recorded.name.clone()).collect();
        self.panels.as_ref().map(|panels| panels.iter().map(names).collect())
    }

    /// The signal that drives an input of every FMU that has it, if that is not measured data.
    #[must_use]
    pub fn input(&self, name: &str) -> Option<&Signal> {
        match &self.inputs.iter().find(|input| input.name == name)?.course {
            Course::Signal(signal) => Some(signal),
            Course::Measured(_) => None,
        }
    }

    /// Lets the scenario start and end at other times (s).
    ///
    /// # Errors
    /// When the end is not after the start, or there are too many steps.
    pub fn run_between(&mut self, start_time: f64, stop_time: f64) -> Result<()> {
        self.start_time = start_time;
        self.end_at(stop_time)
    }

    /// Lets the scenario end at another time (s).
    ///
    /// # Errors
    /// When the time is not after the start, or there are too many steps.
    pub fn end_at(&mut self, stop_time: f64) -> Result<()> {
        if stop_time <= self.start_time {
            bail!("expected a time after start_time, {} s", number(self.start_time));
        }
        (self.steps, self.rest) = steps_in(self.start_time, stop_time, self.step)?;
        self.stop_time = stop_time;
        Ok(())
    }

    /// Gives a variable of an FMU another value before initialization.
    /// [`Master::initialize`](crate::Master::initialize) checks that it has the variable.
    ///
    /// # Errors
    /// When the scenario has no FMU of this name.
    pub fn set_value(&mut self, fmu: &str, name: &str, value: Value) -> Result<()> {
        let member = self.member_mut(fmu)?;
        member.values.retain(|assignment| assignment.name != name);
        let location = member.location.clone();
        member.values.push(Assignment { name: name.to_owned(), value, location });
        Ok(())
    }

    /// Gives an input of all FMUs that have it another signal.
    ///
    /// # Errors
    /// When the scenario has no signal for the input.
    pub fn set_input(&mut self, name: &str, signal: Signal) -> Result<()> {
        let input = self.inputs.iter_mut().find(|input| input.name == name);
        input.with_context(|| format!("the scenario has no signal for {name}"))?.course = signal.into();
        Ok(())
    }

    /// Gives an input of one FMU its own signal, which replaces a connection.
    ///
    /// # Errors
    /// When the scenario has no FMU of this name.
    pub fn set_own_input(&mut self, fmu: &str, name: &str, signal: Signal) -> Result<()> {
        let member = self.member_mut(fmu)?;
        member.inputs.retain(|input| input.name != name);
        let location = member.location.clone();
        member.inputs.push(Input { name: name.to_owned(), course: signal.into(), location });
        Ok(())
    }

    fn member_mut(&mut self, name: &str) -> Result<&mut Member> {
        let member = self.fmus.iter_mut().find(|member| member.name == name);
        member.with_context(|| format!("the scenario has no FMU {name}"))
    }
}

/// The number of whole steps from a start to a stop (s), and what remains after them; up to rounding, it may be nothing.
fn steps_in(start: f64, stop: f64, step: f64) -> Result<(u32, f64)> {
    let duration = stop - start;
    let nearest = (duration / step).round();
    let tolerance = 1e-9 * duration.max(1.0) + rounding(start.abs().max(stop.abs()));
    let is_multiple = nearest > 0.0 && (nearest * step - duration).abs() <= tolerance;
    let whole = if is_multiple { nearest } else { (duration / step).floor() };
    if !(0.0..=f64::from(u32::MAX)).contains(&whole) {
        bail!("{} communication steps of {} s: expected at most {}", number(whole), number(step), u32::MAX);
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // it is whole, not negative and small enough
    Ok((whole as u32, if is_multiple { 0.0 } else { duration - whole * step }))
}

/// The number of steps in a duration (s) that is a multiple of the step.
fn count(duration: f64, step: f64) -> Result<u32> {
    match steps_in(0.0, duration, step)? {
        (steps, 0.0) => Ok(steps),
        _ => bail!("{} s is not a multiple of the communication step, {} s", number(duration), number(step)),
    }
}

fn read_members(root: &TomlTable<'_>, step: f64, folders: [&Path; 2]) -> Result<Vec<Member>> {
    const EXPECTED: &str = "a table [[fmu]] for each FMU, in the order of stepping";
    let list = root.required("fmu", EXPECTED)?;
    let mut members: Vec<Member> = vec![];
    for node in list.list(EXPECTED)? {
        members.push(read_member(&node, step, folders, &members)?);
    }
    if members.is_empty() { Err(list.unexpected(EXPECTED)) } else { Ok(members) }
}

/// Reads an FMU that comes after others.
fn read_member(node: &Node<'_>, step: f64, [folder, fmus]: [&Path; 2], others: &[Member]) -> Result<Member> {
    let table = node.table("a table [[fmu]]")?;
    let name_node = table.required("name", "the FMU's name in the scenario")?;
    let name = name_node.string("a text")?;
    if let Some(other) = others.iter().find(|other| other.name == name) {
        let line = other.location.line().map_or_else(String::new, |line| format!(", in line {line}"));
        let message = format!("duplicate FMU: {name} is already the name of another{line}");
        return Err(name_node.location().error(message));
    }
    if let Some(reason) = connection::refused_name(name) {
        return Err(name_node.location().error(reason));
    }
    let file = table.required("file", "the FMU's path")?;
    let path = file.path("the FMU's path", fmus)?;
    let member = Member {
        interface: table.optional("interface").map(|node| read_interface(&node)).transpose()?,
        parameters: table.optional("parameters").map_or(Ok(vec![]), |node| {
            const EXPECTED: &str = "a list of paths of parameter sets (.ssv)";
            node.list(EXPECTED)?.iter().map(|node| read_parameters(node, folder, EXPECTED)).collect()
        })?,
        values: table.optional("values").map_or(Ok(vec![]), |node| read_values(&node))?,
        run_in: table.optional("run_in").map(|node| read_run_in(&node, step)).transpose()?,
        inputs: table.optional("inputs").map_or(Ok(vec![]), |node| read_inputs(&node, folder))?,
        ..Member::new(name, &path, file.location().clone())
    };
    table.finish()?;
    Ok(member)
}

fn read_interface(node: &Node<'_>) -> Result<Interface> {
    const EXPECTED: &str = "\"cs\" for co-simulation or \"me\" for Model Exchange";
    match node.string(EXPECTED)?.parse() {
        Ok(interface @ (Interface::CoSimulation | Interface::ModelExchange)) => Ok(interface),
        _ => Err(node.unexpected(EXPECTED)),
    }
}

fn read_parameters(node: &Node<'_>, folder: &Path, expected: &str) -> Result<(ParameterSet, Location)> {
    let path = node.path(expected, folder)?;
    let set = ParameterSet::read(&path).map_err(anyhow::Error::from);
    Ok((node.location().locate(set)?, node.location().clone()))
}

fn read_values(node: &Node<'_>) -> Result<Vec<Assignment>> {
    let table = node.table("a table of values by the names of variables")?;
    table.entries().map(|(name, node)| read_value(name, &node)).collect()
}

/// A value for a variable: a number, `true`, `false` or a text. A whole number of 32 bits is an Integer.
///
/// # Errors
/// When it is something else.
pub fn read_value(name: &str, node: &Node<'_>) -> Result<Assignment> {
    const EXPECTED: &str = "a number, true, false or a text";
    let value = match node.value() {
        DeValue::Integer(_) if node.integer::<i32>(EXPECTED).is_ok() => {
            Value::Integer(node.integer(EXPECTED)?)
        }
        DeValue::Integer(_) | DeValue::Float(_) => Value::Real(node.number(EXPECTED)?, None),
        DeValue::Boolean(value) => Value::Boolean(*value),
        DeValue::String(text) => Value::String(text.as_ref().to_owned()),
        _ => return Err(node.unexpected(EXPECTED)),
    };
    Ok(Assignment { name: name.to_owned(), value, location: node.location().clone() })
}

fn read_run_in(node: &Node<'_>, step: f64) -> Result<RunIn> {
    let table = node.table("a table of duration, during and after")?;
    let duration_node = table.required("duration", "a time in s")?;
    let duration = duration_node.positive("a time above 0 in s")?;
    let run_in = RunIn {
        duration,
        steps: duration_node.location().locate(count(duration, step))?,
        during: table.optional("during").map_or(Ok(vec![]), |node| read_values(&node))?,
        after: table.optional("after").map_or(Ok(vec![]), |node| read_values(&node))?,
    };
    table.finish()?;
    Ok(run_in)
}

fn read_inputs(node: &Node<'_>, folder: &Path) -> Result<Vec<Input>> {
    let table = node.table("a table of signals by the names of inputs")?;
    let read = |(name, node): (&str, Node<'_>)| {
        let course = read_course(&node, folder)?;
        Ok(Input { name: name.to_owned(), course, location: node.location().clone() })
    };
    table.entries().map(read).collect()
}

/// Reads what drives an input; paths of data are relative to `folder`.
fn read_course(node: &Node<'_>, folder: &Path) -> Result<Course> {
    const EXPECTED: &str = "a number, or a table with one of steps, points, ramp, sine and csv";
    if matches!(node.value(), DeValue::Integer(_) | DeValue::Float(_)) {
        return Ok(Signal::Constant(node.number(EXPECTED)?).into());
    }
    let table = node.table(EXPECTED)?;
    let course = if let Some(signal) = Signal::read(&table)? {
        signal.into()
    } else if let Some(file) = table.optional("csv") {
        Course::Measured(read_measured(&table, &file, folder)?)
    } else {
        return Err(node.unexpected(EXPECTED));
    };
    table.finish()?;
    Ok(course)
}

fn read_measured(table: &TomlTable<'_>, file: &Node<'_>, folder: &Path) -> Result<Measured> {
    let column = table.required("column", "the name of the column")?.string("the name of the column")?;
    let hold = table.optional("hold").map_or(Ok(false), |node| {
        node.value().as_bool().ok_or_else(|| {
            node.unexpected("true where values hold until the next row, false where lines lead there")
        })
    })?;
    let path = file.path("the path of a CSV file", folder)?;
    let data = file.location().locate(Data::read(&path, None))?;
    file.location().locate(Measured::new(&path, &data, column, hold))
}

fn read_noise(node: &Node<'_>) -> Result<Vec<Noise>> {
    let table = node.table("a table of noises by the names of variables")?;
    let read = |(name, node): (&str, Node<'_>)| {
        let table = node.table("a table of standard_deviation and seed")?;
        let noise = Noise {
            name: name.to_owned(),
            standard_deviation: table
                .required("standard_deviation", "a number above 0, in the variable's unit")?
                .positive("a number above 0, in the variable's unit")?,
            seed: table.optional("seed").map_or(Ok(0), |node| node.integer("a whole number, 0 or more"))?,
            location: node.location().clone(),
        };
        table.finish()?;
        Ok(noise)
    };
    table.entries().map(read).collect()
}

fn read_record(node: &Node<'_>) -> Result<Vec<Recorded>> {
    const EXPECTED: &str = "a list of names of variables";
    let read = |node: &Node<'_>| {
        let name = node.string("the name of a variable")?.to_owned();
        Ok(Recorded { name, location: node.location().clone() })
    };
    node.list(EXPECTED)?.iter().map(read).collect()
}

fn read_panels(node: &Node<'_>) -> Result<Vec<Vec<Recorded>>> {
    const EXPECTED: &str = "a list of panels, each a list of names of recorded variables";
    let panel = |node: &Node<'_>| {
        let names = read_record(node)?;
        if names.is_empty() { Err(node.unexpected("at least one name")) } else { Ok(names) }
    };
    let panels = node.list(EXPECTED)?;
    if panels.is_empty() { Err(node.unexpected(EXPECTED)) } else { panels.iter().map(panel).collect() }
}

#[cfg(test)]
mod tests;
