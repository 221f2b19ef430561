//! The master: couples instances by a scenario's [`links`](crate::links()), takes them from communication point to
//! communication point, and records. What happens at a point is the [coupling](crate::coupling)'s.
//!
//! A signal for a single FMU takes precedence over a connection.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result, anyhow, bail};
use fmu_io::terminal::number;
use fmu_package::{FmuDescription, FmuVariable, Function, ValueType};
use fmu_solve::time::rounding;
use fmu_terms::{Causality, Variability, like};

use crate::columns::{Columns, Found};
use crate::coupling::{self, Coupling, Inputs, Parts, TextWire, Wire};
use crate::importer::{Ended, Fmu, Instance, Interface, Message};
use crate::links::{Link, links, refuse_ambiguous_unit};
use crate::noise::NoiseSource;
use crate::recorder::{Recorder, Source};
use crate::scenario::{Input, Member, RunIn, Scenario, Signal, Tolerance};
use fmu_record::{Column, Record};

/// The flag of FMUs for co-simulation whose steps may differ in size.
const VARIABLE_STEP: &str = "canHandleVariableCommunicationStepSize";

/// The FMUs of experiments, each loaded once, by their paths and interfaces. Clones share them.
#[derive(Clone, Default)]
pub struct LoadedFmus {
    fmus: BTreeMap<(PathBuf, Option<Interface>), Arc<Fmu>>,
    /// The descriptions of FMUs, read before the FMUs are loaded.
    descriptions: BTreeMap<PathBuf, FmuDescription>,
}

impl LoadedFmus {
    /// All loaded FMUs, in the order of their paths.
    pub fn iter(&self) -> impl Iterator<Item = &Fmu> {
        self.fmus.values().map(Arc::as_ref)
    }

    /// Keeps the description of an FMU, with the elements of arrays, so that it is read once.
    pub(crate) fn describe(&mut self, path: &Path, description: FmuDescription) {
        self.descriptions.insert(path.to_owned(), description);
    }

    /// The FMU of a scenario's member; loads it on first use.
    ///
    /// # Errors
    /// When the FMU cannot be opened, as for [`Fmu::open_with`]; the error has the member's location.
    pub fn get(&mut self, member: &Member) -> Result<Arc<Fmu>> {
        let key = (member.file.clone(), member.interface);
        if let Some(fmu) = self.fmus.get(&key) {
            return Ok(Arc::clone(fmu));
        }
        let description = self.descriptions.remove(&member.file);
        let fmu = Fmu::open_described(&member.file, member.interface, description);
        // The message names the file.
        let is_located = member.location.is_argument(&member.file.to_string_lossy());
        let fmu = if is_located { fmu } else { member.location.locate(fmu) }?;
        self.fmus.insert(key, Arc::clone(&fmu));
        Ok(fmu)
    }

    /// Takes an FMU that is loaded already, for members that have its path and leave the interface open.
    pub fn insert(&mut self, path: PathBuf, fmu: Arc<Fmu>) {
        self.fmus.insert((path, None), fmu);
    }
}

/// The coupled instances of a scenario. [`Master::run`] runs it to the end; [`Master::initialize`] and [`Master::step`]
/// go step by step.
pub struct Master<'a> {
    scenario: &'a Scenario,
    coupling: Coupling<'a>,
    noise: Vec<NoiseOn>,
    recorder: Recorder,
    records_events: bool,
    notes: Vec<String>,
    steps_done: u32,
    /// The length of the last step, which is shorter than the others (s), if there is one.
    rest: Option<f64>,
    tap: Option<At>,
}

/// An input, by its member and its place among the member's.
#[derive(Clone, Copy)]
struct At {
    member: usize,
    position: usize,
}

/// Noise on a connection.
struct NoiseOn {
    at: At,
    source: NoiseSource,
}

/// The result of a complete run.
pub struct Run {
    /// A row for each communication point, and those at events, if they are recorded.
    pub record: Record,
    /// The instances' warnings, with their names.
    pub warnings: Vec<(String, Message)>,
    /// The FMU that asked for the end before the scenario's, if one did. The last row is that of its time if it is alone,
    /// else of the last communication point that all have reached.
    pub ended: Option<Ended>,
}

impl<'a> Master<'a> {
    /// Instantiates and couples the FMUs of a scenario.
    ///
    /// # Errors
    /// When an FMU cannot be loaded or instantiated, or the scenario does not fit its FMUs: no FMU has an input or
    /// recorded variable, several have a recorded one, two FMUs have the output for one input, or units do not convert.
    /// The message names the line.
    pub fn new(scenario: &'a Scenario, fmus: &mut LoadedFmus) -> Result<Self> {
        let loaded: Vec<_> = scenario.fmus.iter().map(|member| fmus.get(member)).collect::<Result<_>>()?;
        let mut notes = vec![];
        let links = links(scenario, &loaded)?;
        for input in &scenario.inputs {
            take_note(scenario, drives(input, scenario, &links), input, &mut notes)?;
            refuse_ambiguous_unit(input, scenario, &links, &loaded)?;
        }
        let mut wanted: Vec<Wanted> = scenario.fmus.iter().map(|_| Wanted::default()).collect();
        let mut taken = vec![];
        for index in 0..loaded.len() {
            taken.push(Taken::new(scenario, &loaded, &links, index, &mut wanted, &mut notes)?);
        }
        let outputs: Vec<_> = wanted.iter().map(|wanted| wanted.names.len()).collect();
        let columns = Columns::new(scenario, &loaded, &links, &mut notes)?;
        let mut sources = vec![];
        for (_, found) in &columns.all {
            sources.push(match found {
                Found::Signal(signal) => Source::Signal(signal.clone(), Function::IDENTITY),
                Found::Variable { member, name } => {
                    let source = taken[*member].source(*member, name);
                    source.unwrap_or_else(|| wanted[*member].reading(*member, name))
                }
            });
        }
        let all = columns.all.into_iter().map(|(column, _)| column).collect();
        let recorder = Recorder::new(scenario, all, sources, &columns.missing)?;
        let mut parts = vec![];
        let mut tolerances: BTreeMap<String, Vec<&str>> = BTreeMap::new();
        for (index, Taken { held, followed, texts }) in taken.into_iter().enumerate() {
            let (member, fmu, names) = (&scenario.fmus[index], &loaded[index], &wanted[index].names);
            let instance = if member.returns_early {
                fmu.instantiate_with_early_return(&member.name)
            } else {
                fmu.instantiate(&member.name)
            };
            let mut instance = member.location.locate(instance)?;
            let tolerance = match scenario.tolerance {
                Tolerance::Given(tolerance) => Some(tolerance),
                Tolerance::Undefined => None,
                Tolerance::OfFmu => fmu.default_tolerance(),
            };
            instance.set_tolerance(tolerance);
            if let (Tolerance::OfFmu, Some(tolerance)) = (scenario.tolerance, tolerance) {
                tolerances.entry(number(tolerance)).or_default().push(&member.name);
            }
            let (follow, signals): (Vec<_>, Vec<_>) = followed
                .into_iter()
                .map(|Following { input, signal, conversion }| (input, (signal, conversion)))
                .unzip();
            parts.push(Parts {
                member,
                run_in: run_in(scenario, member, fmu, &mut notes),
                instance,
                readings: fmu.select_with_texts(names.iter().map(String::as_str))?,
                outputs: fmu.select_with_texts(names[..outputs[index]].iter().map(String::as_str))?,
                inputs: member.location.locate(Inputs::new(fmu, held))?,
                followed: (!follow.is_empty())
                    .then(|| anyhow::Ok((fmu.select(follow.iter().map(String::as_str))?, signals)))
                    .transpose()?,
                texts,
            });
        }
        for (tolerance, names) in tolerances {
            notes.push(format!(
                "{}: tolerance {tolerance}, of the DefaultExperiment; --tolerance gives another, or none",
                names.join(" and ")
            ));
        }
        let rest = rest(scenario, &loaded, &mut notes)?;
        let coupling = Coupling::new(parts, scenario.stepping, scenario.step)?;
        let noise = noise(scenario, &coupling)?;
        Ok(Self {
            scenario,
            coupling,
            noise,
            recorder,
            records_events: false,
            notes,
            steps_done: 0,
            rest,
            tap: None,
        })
    }

    /// The columns of the record; their values are those recorded so far.
    pub fn recorded(&self) -> impl Iterator<Item = &Column> {
        self.recorder.record.columns().iter()
    }

    /// The signals and recorded names that the FMUs do not have, because one was replaced, and what else the FMUs get; a
    /// message each.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// An instance, by its name in the scenario.
    ///
    /// # Errors
    /// When the scenario has no FMU of this name.
    pub fn instance(&mut self, name: &str) -> Result<&mut Instance> {
        let coupled = self.coupling.members.iter_mut().find(|coupled| coupled.member.name == name);
        Ok(&mut coupled.with_context(|| format!("the scenario has no FMU {name}"))?.instance)
    }

    /// Records the rows before and after each event of the FMUs that report them, too.
    pub fn record_events(&mut self) {
        self.records_events = true;
        self.coupling.members.iter_mut().for_each(|coupled| coupled.instance.watch_events());
    }

    /// The names of the FMUs that report no events, and whether they could: they have Event Mode, which is not in use.
    pub fn without_events(&self) -> impl Iterator<Item = (&str, bool)> {
        let silent = self.coupling.members.iter().filter(|coupled| !coupled.instance.reports_events());
        silent.map(|coupled| {
            (coupled.member.name.as_str(), coupled.instance.fmu().refuse_no_event_mode().is_ok())
        })
    }

    /// Holds the signals at their present values.
    pub fn hold_signals(&mut self) {
        self.coupling.hold_signals(Some(self.time()));
    }

    /// Selects the connection to an input that [`Master::step_adding`] changes. If several FMUs have the input, its
    /// name is preceded by the FMU's name and a colon.
    ///
    /// # Errors
    /// When there is no such connection, or several.
    pub fn tap(&mut self, input: &str) -> Result<()> {
        let mut known = vec![];
        let mut found = vec![];
        for (at, member, name) in connected(&self.coupling) {
            let full = format!("{member}:{name}");
            if input == name || input == full {
                found.push((full.clone(), at));
            }
            known.extend([name.to_owned(), full]);
        }
        match &found[..] {
            [(_, at)] => self.tap = Some(*at),
            [] => bail!("no FMU gets {input} from another{}", like(input, known.iter().map(String::as_str))),
            _ => {
                let names: Vec<_> = found.iter().map(|(name, _)| name.as_str()).collect();
                bail!("several FMUs get it: use {}", names.join(" or "))
            }
        }
        Ok(())
    }

    /// Makes a step, and adds a number to the signal of the tapped connection at the step's begin and over it, in the
    /// unit of its input. Nothing is recorded. Returns the signal without the number.
    ///
    /// # Errors
    /// When a call fails, no connection is tapped, or an FMU requests the end of the simulation ([`Ended`]).
    pub fn step_adding(&mut self, added: f64) -> Result<f64> {
        let At { member, position } = self.tap.context("no connection is tapped")?;
        self.coupling.members[member].inputs.wires[position].added = added;
        if let Some(ended) = self.coupling.settle(self.time())? {
            bail!(ended);
        }
        let (time, size) = self.next_step();
        let ended = self.coupling.step(time, size)?;
        self.steps_done += 1;
        match ended {
            Some(ended) => bail!(ended),
            None => Ok(self.coupling.members[member].inputs.wires[position].brought),
        }
    }

    /// What is recorded so far.
    #[must_use]
    pub fn record(&self) -> &Record {
        &self.recorder.record
    }

    /// The current communication point (s).
    #[must_use]
    pub fn time(&self) -> f64 {
        self.point(self.steps_done)
    }

    /// The steps to the last communication point of the scenario.
    fn steps(&self) -> u32 {
        self.scenario.steps + u32::from(self.rest.is_some())
    }

    /// The time of a communication point (s): the start, multiples of the step, and the stop, unless the FMUs do not
    /// reach it. Those past it count from there.
    fn point(&self, number: u32) -> f64 {
        let Scenario { start_time, stop_time, step, rest, .. } = *self.scenario;
        let is_reached = rest == 0.0 || self.rest.is_some();
        match number.checked_sub(self.steps()).filter(|_| is_reached) {
            Some(past) => stop_time + f64::from(past) * step,
            None => start_time + f64::from(number) * step,
        }
    }

    /// From where the next step goes, and its size (s). In doubles their sum does not exceed the stop time, beyond which
    /// an FMU that knows it may refuse to step.
    fn next_step(&self) -> (f64, f64) {
        let Scenario { stop_time, step, .. } = *self.scenario;
        let (mut time, mut size) = (self.time(), step);
        if self.steps_done + 1 == self.steps() {
            size = self.rest.unwrap_or(step);
            if time + size > stop_time + rounding(stop_time) {
                size = stop_time - time;
            }
            // The size stays, as an FMU may have only one.
            while time + size > stop_time {
                time = time.next_down();
            }
        }
        (time, size)
    }

    /// Initializes all instances at the scenario's start.
    ///
    /// Instances without a run-in are initialized together; then those with a run-in, with the outputs of the others.
    /// The values at the start are recorded. The FMUs get no stop time, so that steps may go past it.
    ///
    /// # Errors
    /// When a value does not fit its variable, a call fails, or an FMU requests the end of the simulation ([`Ended`]).
    pub fn initialize(&mut self) -> Result<()> {
        self.begin(None)
    }

    fn begin(&mut self, stop_time: Option<f64>) -> Result<()> {
        self.coupling.initialize(self.scenario.start_time, stop_time)?;
        self.settle()
    }

    /// Makes a communication step and records its end, even past the scenario's end.
    ///
    /// # Errors
    /// When a call fails, or an FMU requests the end of the simulation ([`Ended`]). If it is alone, its values at that
    /// time are recorded.
    pub fn step(&mut self) -> Result<()> {
        let (time, size) = self.next_step();
        let ended = self.coupling.step(time, size)?;
        if let Some(ended) = ended {
            self.end(&ended)?;
            bail!(ended);
        }
        self.steps_done += 1;
        self.settle()
    }

    /// Sets the inputs and handles the events of the current communication point, and records it.
    fn settle(&mut self) -> Result<()> {
        let time = self.time();
        for NoiseOn { at, source } in &mut self.noise {
            self.coupling.members[at.member].inputs.wires[at.position].added = source.draw();
        }
        if self.records_events && self.coupling.has_due_events(time) {
            self.recorder.take_before(time, &self.coupling);
        }
        let ended = self.coupling.settle(time)?;
        self.recorder.take(time, &mut self.coupling);
        ended.map_or(Ok(()), |ended| Err(ended.into()))
    }

    /// Records the end that an FMU requests at the end of a step, or, alone, within it.
    fn end(&mut self, ended: &Ended) -> Result<()> {
        if self.recorder.last().is_none_or(|last| last < ended.time) {
            self.coupling.connect_all(ended.time)?;
            self.recorder.take(ended.time, &mut self.coupling);
        }
        Ok(())
    }

    /// Makes all steps from the start to the scenario's end, the last of which may be shorter. Before each, `progress`
    /// gets the number of steps done, and what is recorded, which it may take.
    ///
    /// # Errors
    /// When a call fails, or an FMU requests the end of the simulation ([`Ended`]).
    pub fn step_to_end(&mut self, mut progress: impl FnMut(u32, &mut Record)) -> Result<()> {
        for index in 0..self.steps() {
            progress(index, &mut self.recorder.record);
            self.step()?;
        }
        Ok(())
    }

    /// Runs a scenario from its start to its end, or until an FMU requests the end. The FMUs get the stop time. Calls
    /// `progress` as [`Master::step_to_end`] does.
    ///
    /// # Errors
    /// When [`Master::initialize`] or [`Master::step`] fails.
    pub fn run(mut self, progress: impl FnMut(u32, &mut Record)) -> Result<Run> {
        let run = self.begin(Some(self.scenario.stop_time)).and_then(|()| self.step_to_end(progress));
        let ended = run.map_or_else(|error| error.downcast().map(Some), |()| Ok(None))?;
        let warnings = self.coupling.members.iter_mut().flat_map(|coupled| {
            let name = coupled.instance.name().to_owned();
            coupled.instance.terminate();
            coupled.instance.take_warnings().into_iter().map(move |message| (name.clone(), message))
        });
        let warnings = warnings.collect();
        Ok(Run { record: self.recorder.record, warnings, ended })
    }
}

/// What is read of a member, by name.
#[derive(Default)]
struct Wanted {
    names: Vec<String>,
    positions: HashMap<String, usize>,
}

impl Wanted {
    /// The position of a variable among what is read.
    fn position(&mut self, name: &str) -> usize {
        *self.positions.entry(name.to_owned()).or_insert_with(|| {
            self.names.push(name.to_owned());
            self.names.len() - 1
        })
    }

    fn reading(&mut self, member: usize, name: &str) -> Source {
        Source::Reading { member, position: self.position(name) }
    }
}

/// What gives a member's inputs their values.
struct Taken {
    held: Vec<(String, Wire)>,
    followed: Vec<Following>,
    texts: Vec<TextWire>,
}

/// A continuous input in Model Exchange that follows a signal.
struct Following {
    input: String,
    signal: Signal,
    conversion: Function,
}

impl Taken {
    /// Connections from other FMUs, except to inputs driven by the member's own signals; and signals. What is read of
    /// other FMUs for it is added to what is wanted of them.
    fn new(
        scenario: &Scenario,
        loaded: &[Arc<Fmu>],
        links: &[Link],
        index: usize,
        wanted: &mut [Wanted],
        notes: &mut Vec<String>,
    ) -> Result<Self> {
        let (member, fmu) = (&scenario.fmus[index], &loaded[index]);
        let mut taken = Self { held: vec![], followed: vec![], texts: vec![] };
        let is_replaced = |link: &Link| member.inputs.iter().any(|input| input.name == link.connection.input);
        for link in links.iter().filter(|link| link.target == index && !is_replaced(link)) {
            let Some(giver) = link.source else { continue };
            let (output, input) = (&link.connection.output, &link.connection.input);
            let reading = wanted[giver].position(output);
            if fmu.variable(input)?.value_type() == ValueType::String {
                taken.texts.push(TextWire::new((giver, reading), input.clone()));
                continue;
            }
            let source = coupling::Source::Output { member: giver, reading };
            let ends = format!("{} to {}", link.connection.from(), link.connection.to());
            let wire = Wire::new(source, link.conversion.clone(), link.connection.threshold, ends);
            taken.held.push((input.clone(), wire));
        }
        let mut inputs: Vec<(&str, &Input, Function, Option<f64>)> = vec![];
        for input in &member.inputs {
            if take_note(scenario, can_be_driven(fmu, &input.name), input, notes)? {
                inputs.push((&input.name, input, Function::IDENTITY, None));
            }
        }
        for input in &scenario.inputs {
            let driven = links.iter().filter(|link| link.target == index && link.is_from(&input.name));
            for Link { connection, conversion, .. } in driven {
                let name = connection.input.as_str();
                if taken.held.iter().any(|(held, _)| held == name) {
                    return Err(input.location.error(format!(
                        "{} gets {name} from another FMU; a signal among its own inputs would replace it",
                        member.name
                    )));
                }
                if !inputs.iter().any(|(own, ..)| *own == name) {
                    inputs.push((name, input, conversion.clone(), connection.threshold));
                }
            }
        }
        for (name, input, conversion, threshold) in inputs {
            let variable = fmu.variable(name)?;
            let signal = input.course.fit(variable, fmu.description(), conversion.linear());
            let signal = input.location.locate(signal)?;
            let ends = format!("{} to {}:{name}", input.name, member.name);
            let input = name.to_owned();
            if fmu.interface() == Interface::ModelExchange && !variable.is_discrete() {
                taken.followed.push(Following { input, signal, conversion });
            } else {
                let wire = Wire::new(coupling::Source::Signal(signal), conversion, threshold, ends);
                taken.held.push((input, wire));
            }
        }
        Ok(taken)
    }

    /// Where an input's recorded values come from, if it is connected.
    fn source(&self, member: usize, name: &str) -> Option<Source> {
        if let Some(position) = self.held.iter().position(|(input, _)| input == name) {
            return Some(Source::Input { member, position });
        }
        if let Some(TextWire { source: (member, position), .. }) =
            self.texts.iter().find(|wire| wire.input == name)
        {
            return Some(Source::Reading { member: *member, position: *position });
        }
        let followed = self.followed.iter().find(|followed| followed.input == name)?;
        Some(Source::Signal(followed.signal.clone(), followed.conversion.clone()))
    }
}

/// The inputs that are held over a step: the place, the member's name and the input's.
fn driven<'a>(coupling: &'a Coupling<'_>) -> impl Iterator<Item = (At, &'a str, &'a str)> {
    coupling.members.iter().enumerate().flat_map(|(member, coupled)| {
        let names = coupled.inputs.names().iter().enumerate();
        names.map(move |(position, name)| {
            (At { member, position }, coupled.member.name.as_str(), name.as_str())
        })
    })
}

/// The [`driven`] inputs that get outputs.
fn connected<'a>(coupling: &'a Coupling<'_>) -> impl Iterator<Item = (At, &'a str, &'a str)> {
    driven(coupling).filter(|(at, ..)| {
        let wire = &coupling.members[at.member].inputs.wires[at.position];
        matches!(wire.source, coupling::Source::Output { .. })
    })
}

/// Whether an input is found. If FMUs of the scenario are replaced, a missing one is a note instead of an error.
fn take_note(scenario: &Scenario, found: Result<()>, input: &Input, notes: &mut Vec<String>) -> Result<bool> {
    match input.location.locate(found) {
        Ok(()) => Ok(true),
        Err(error) if scenario.has_replaced_fmus => {
            notes.push(format!("{error:#}"));
            Ok(false)
        }
        Err(error) => Err(error),
    }
}

/// A member's run-in. If its FMU was replaced by one that lacks what the run-in sets, it is left out, with a note.
fn run_in<'a>(
    scenario: &Scenario,
    member: &'a Member,
    fmu: &Fmu,
    notes: &mut Vec<String>,
) -> Option<&'a RunIn> {
    let run_in = member.run_in.as_ref()?;
    let is_missing = |name: &&str| fmu.description().variable(name).is_none();
    let set = run_in.during.iter().chain(&run_in.after).map(|assignment| assignment.name.as_str());
    let missing: BTreeSet<_> = set.filter(is_missing).collect();
    if !scenario.has_replaced_fmus || missing.is_empty() {
        return Some(run_in);
    }
    let missing = missing.into_iter().collect::<Vec<_>>().join(", ");
    notes.push(format!("the run_in of {} is left out: the FMU has no {missing}", member.name));
    None
}

/// Rejects a signal that no input takes, except in a system without FMUs, of which only signals are recorded.
fn drives(input: &Input, scenario: &Scenario, links: &[Link]) -> Result<()> {
    if scenario.fmus.is_empty() || links.iter().any(|link| link.is_from(&input.name)) {
        return Ok(());
    }
    let outside = links.iter().filter(|link| link.source.is_none());
    let like = like(&input.name, outside.map(|link| link.connection.output.as_str()));
    Err(match scenario.connections {
        None => anyhow!("no FMU has an input {}{like}", input.name),
        Some(_) => anyhow!("no connection is from {}{like}", input.name),
    })
}

/// Rejects what a signal cannot drive: it drives inputs and tunable parameters.
fn can_be_driven(fmu: &Fmu, name: &str) -> Result<()> {
    let is_tunable = |variable: &FmuVariable| {
        variable.causality == Causality::Parameter && variable.variability == Variability::Tunable
    };
    let is_driven = |variable: &FmuVariable| variable.causality == Causality::Input || is_tunable(variable);
    if fmu.description().variable(name).is_some_and(is_driven) {
        return Ok(());
    }
    let driven = fmu.description().variables.iter().filter(|variable| is_driven(variable));
    let like = like(name, driven.map(|variable| variable.name.as_str()));
    bail!("no FMU has an input or a tunable parameter {name}{like}")
}

/// The last, shorter step of a scenario (s), if it has one and its FMUs can make it.
fn rest(scenario: &Scenario, fmus: &[Arc<Fmu>], notes: &mut Vec<String>) -> Result<Option<f64>> {
    if scenario.rest == 0.0 {
        return Ok(None);
    }
    let can = |fmu: &Fmu| fmu.interface() == Interface::ModelExchange || fmu.has_capability(VARIABLE_STEP);
    let Some(rigid) = fmus.iter().position(|fmu| !can(fmu)) else { return Ok(Some(scenario.rest)) };
    let Scenario { start_time, stop_time, step, steps, .. } = scenario;
    let name = &scenario.fmus[rigid].name;
    let reason = format!(
        "{} s after the start is not a multiple of the communication step, {} s, and {name} makes only steps of one size \
         ({VARIABLE_STEP} is false)",
        number(stop_time - start_time),
        number(*step)
    );
    if *steps == 0 {
        bail!("{reason}");
    }
    notes.push(format!("{reason}: the run ends at {} s", number(start_time + f64::from(*steps) * step)));
    Ok(None)
}

/// The noise of a scenario: on every connection from another FMU to inputs of the name, or on one FMU's input, written
/// `FMU:input`, whatever drives it.
fn noise(scenario: &Scenario, coupling: &Coupling<'_>) -> Result<Vec<NoiseOn>> {
    let mut all = vec![];
    for noise in &scenario.noise {
        let own = driven(coupling).filter(|(_, member, name)| format!("{member}:{name}") == noise.name);
        let places = connected(coupling).filter(|(.., name)| *name == noise.name).chain(own);
        let before = all.len();
        for (at, ..) in places {
            all.push(NoiseOn { at, source: NoiseSource::new(noise)? });
        }
        if all.len() == before {
            let own = driven(coupling).map(|(_, member, name)| format!("{member}:{name}"));
            let known: Vec<_> = connected(coupling).map(|(.., name)| name.to_owned()).chain(own).collect();
            let like = like(&noise.name, known.iter().map(String::as_str));
            return Err(noise.location.error(format!("no FMU gets {} from another{like}", noise.name)));
        }
    }
    Ok(all)
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "the values are exact")]
mod tests;
