//! The master: connects instances by a scenario's [`links`](crate::links()), and steps them through it.
//!
//! A signal for a single FMU takes precedence over a connection.

use std::collections::BTreeMap;
use std::mem;
use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context, Result, anyhow, bail};
use fmu_io::terminal::number;
use fmu_package::connection::Connection;
use fmu_package::{Function, ValueType};
use fmu_terms::{Causality, like};

use crate::importer::{Ended, Fmu, Instance, Interface, Message, Selection};
use crate::links::{Link, links, refuse_ambiguous_unit};
use crate::noise::NoiseSource;
use crate::recorder::Recorder;
use crate::scenario::{Assignment, Input, Member, Scenario, Signal, Stepping};
use fmu_record::{Column, Record};

/// Exchanges of outputs and inputs during initialization, at least: the outputs of one FMU, once it has its inputs, may
/// change those of another, as a measured voltage changes a controller's duty. In a chain of more FMUs there are as many
/// exchanges as FMUs, so that the first one's outputs reach the last in any order.
const INITIAL_EXCHANGES: usize = 2;

/// The flag of FMUs for co-simulation whose steps may differ in size.
const VARIABLE_STEP: &str = "canHandleVariableCommunicationStepSize";

/// The FMUs of experiments, each loaded once, by their paths and interfaces. Clones share them.
#[derive(Clone, Default)]
pub struct LoadedFmus(BTreeMap<(PathBuf, Option<Interface>), Arc<Fmu>>);

impl LoadedFmus {
    /// All loaded FMUs, in the order of their paths.
    pub fn iter(&self) -> impl Iterator<Item = &Fmu> {
        self.0.values().map(Arc::as_ref)
    }

    /// The FMU of a scenario's member; loads it on first use.
    ///
    /// # Errors
    /// Those of [`Fmu::open_with`], with the member's location.
    pub fn get(&mut self, member: &Member) -> Result<Arc<Fmu>> {
        let key = (member.file.clone(), member.interface);
        if let Some(fmu) = self.0.get(&key) {
            return Ok(Arc::clone(fmu));
        }
        let fmu = Fmu::open_with(&member.file, member.interface);
        // The message names the file.
        let is_located = member.location.is_argument(&member.file.to_string_lossy());
        let fmu = if is_located { fmu } else { member.location.locate(fmu) }?;
        self.0.insert(key, Arc::clone(&fmu));
        Ok(fmu)
    }

    /// Takes an FMU that is loaded already, for members that have its path and leave the interface open.
    pub fn insert(&mut self, path: PathBuf, fmu: Arc<Fmu>) {
        self.0.insert((path, None), fmu);
    }
}

/// The coupled instances of a scenario. [`Master::run`] runs it to the end; [`Master::initialize`] and [`Master::step`]
/// go step by step.
pub struct Master<'a> {
    scenario: &'a Scenario,
    members: Vec<Coupled<'a>>,
    noise: Vec<NoiseOn>,
    recorder: Recorder,
    notes: Vec<String>,
    /// From where steps are counted (s), and those done since.
    origin: f64,
    steps_done: u32,
    /// The length of the last step, which is shorter than the others (s), if there is one.
    rest: Option<f64>,
    /// The time whose values the signals keep (s).
    signals_held_at: Option<f64>,
    tap: Option<Tap>,
}

/// A connection whose signal is changed.
struct Tap {
    target: usize,
    wires: usize,
    position: usize,
    /// What is added.
    added: f64,
    /// What the connection brought last.
    brought: f64,
}

/// An instance with its inputs.
struct Coupled<'a> {
    member: &'a Member,
    instance: Instance,
    driven: Driven,
    wires: Vec<Wires>,
}

/// The inputs driven by signals.
struct Driven {
    selection: Selection,
    signals: Vec<Signal>,
    /// From the signals to the inputs' values.
    conversions: Vec<Function>,
    values: Vec<f64>,
}

/// The connections from one instance to another.
struct Wires {
    source: usize,
    outputs: Selection,
    inputs: Selection,
    values: Vec<f64>,
    /// By position: conversions between different units.
    conversions: Vec<(usize, Function)>,
    texts: Vec<TextWire>,
}

/// A connection of Strings.
struct TextWire {
    output: Selection,
    input: String,
    /// The number of the output's text; not a number until it is read.
    number: f64,
    is_new: bool,
}

/// Noise on a connection.
struct NoiseOn {
    target: usize,
    wires: usize,
    position: usize,
    source: NoiseSource,
}

/// The result of a complete run.
pub struct Run {
    /// A row for the start and for the end of each communication step, and those at events, if they are recorded.
    pub record: Record,
    /// The instances' warnings, with their names.
    pub warnings: Vec<(String, Message)>,
    /// The FMU that asked for the end before the scenario's, if one did.
    pub ended: Option<Ended>,
}

impl<'a> Master<'a> {
    /// Instantiates and couples the FMUs of a scenario.
    ///
    /// # Errors
    /// When an FMU cannot be loaded or instantiated, or the scenario does not fit its FMUs: no FMU has an input or
    /// recorded variable, two FMUs have the output for one input, or units do not convert. The message names the line.
    pub fn new(scenario: &'a Scenario, fmus: &mut LoadedFmus) -> Result<Self> {
        let loaded: Vec<_> = scenario.fmus.iter().map(|member| fmus.get(member)).collect::<Result<_>>()?;
        let mut notes = vec![];
        let links = links(scenario, &loaded)?;
        for input in &scenario.inputs {
            take_note(scenario, drives(input, scenario, &links), input, &mut notes)?;
            refuse_ambiguous_unit(input, scenario, &links, &loaded)?;
        }
        let mut members = vec![];
        for (index, member) in scenario.fmus.iter().enumerate() {
            let fmu = &loaded[index];
            let wires = wires(scenario, &loaded, &links, index)?;
            let wired =
                |name: &str| wires.iter().any(|wires| wires.inputs.names().iter().any(|input| input == name));
            let mut inputs: Vec<(&str, &Input, Function)> = vec![];
            for input in &member.inputs {
                let found = has_input(fmu, &input.name);
                if take_note(scenario, found, input, &mut notes)? {
                    inputs.push((&input.name, input, Function::IDENTITY));
                }
            }
            for input in &scenario.inputs {
                let driven = links.iter().filter(|link| link.target == index && link.is_from(&input.name));
                for Link { connection, conversion, .. } in driven {
                    let name = connection.input.as_str();
                    if wired(name) {
                        return Err(input.location.error(format!(
                            "{} gets {name} from another FMU; a signal among its own inputs would replace it",
                            member.name
                        )));
                    }
                    if !inputs.iter().any(|(own, ..)| *own == name) {
                        inputs.push((name, input, conversion.clone()));
                    }
                }
            }
            let fit = |(name, input, conversion): &(&str, &Input, Function)| {
                let signal = input.course.fit(fmu.variable(name)?, fmu.description(), conversion.linear());
                input.location.locate(signal)
            };
            let signals = inputs.iter().map(fit).collect::<Result<_>>()?;
            let driven = Driven {
                selection: fmu.select(inputs.iter().map(|(name, ..)| *name))?,
                values: vec![f64::NAN; inputs.len()],
                signals,
                conversions: inputs.into_iter().map(|(.., conversion)| conversion).collect(),
            };
            let instance = if member.returns_early {
                fmu.instantiate_with_early_return(&member.name)
            } else {
                fmu.instantiate(&member.name)
            };
            let mut instance = member.location.locate(instance)?;
            instance.set_tolerance(scenario.tolerance);
            members.push(Coupled { member, instance, driven, wires });
        }
        let noise = noise(scenario, &members)?;
        let (recorder, selections) = Recorder::new(scenario, &loaded, &links, &mut notes)?;
        for (coupled, selection) in members.iter_mut().zip(selections) {
            coupled.instance.watch(selection)?;
        }
        let rest = rest(scenario, &loaded, &mut notes)?;
        Ok(Self {
            scenario,
            members,
            noise,
            recorder,
            notes,
            origin: scenario.start_time,
            steps_done: 0,
            rest,
            signals_held_at: None,
            tap: None,
        })
    }

    /// The columns of the record; their values are those recorded so far.
    pub fn recorded(&self) -> impl Iterator<Item = &Column> {
        self.recorder.record.columns().iter()
    }

    /// The signals and recorded names that the FMUs do not have, because one was replaced; a message each.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// An instance, by its name in the scenario.
    ///
    /// # Errors
    /// When the scenario has no FMU of this name.
    pub fn instance(&mut self, name: &str) -> Result<&mut Instance> {
        let coupled = self.members.iter_mut().find(|coupled| coupled.member.name == name);
        Ok(&mut coupled.with_context(|| format!("the scenario has no FMU {name}"))?.instance)
    }

    /// Records the rows before and after each event of the FMUs that report them, too.
    pub fn record_events(&mut self) {
        self.members.iter_mut().for_each(|coupled| coupled.instance.watch_events());
    }

    /// The names of the FMUs that report no events, in co-simulation without Event Mode; and whether they have it.
    pub fn without_events(&self) -> impl Iterator<Item = (&str, bool)> {
        let silent = self.members.iter().filter(|coupled| !coupled.instance.reports_events());
        silent.map(|Coupled { member, instance, .. }| {
            (member.name.as_str(), instance.fmu().refuse_no_event_mode().is_ok())
        })
    }

    /// Holds the signals at their present values.
    pub fn hold_signals(&mut self) {
        self.signals_held_at = Some(self.time());
    }

    /// Selects the connection to an input that [`Master::step_adding`] changes. If several FMUs have the input, its
    /// name is preceded by the FMU's name and a colon.
    ///
    /// # Errors
    /// When there is no such connection, or several.
    pub fn tap(&mut self, input: &str) -> Result<()> {
        let mut known = vec![];
        let mut found = vec![];
        for (target, coupled) in self.members.iter().enumerate() {
            for (wires, connections) in coupled.wires.iter().enumerate() {
                for (position, name) in connections.inputs.names().iter().enumerate() {
                    let full = format!("{}:{name}", coupled.member.name);
                    if input == name || input == full {
                        found.push((
                            full.clone(),
                            Tap { target, wires, position, added: 0.0, brought: f64::NAN },
                        ));
                    }
                    known.extend([name.clone(), full]);
                }
            }
        }
        let names: Vec<_> = found.iter().map(|(name, _)| name.as_str()).collect();
        match names[..] {
            [_] => self.tap = found.pop().map(|(_, tap)| tap),
            [] => bail!("no FMU gets {input} from another{}", like(input, known.iter().map(String::as_str))),
            _ => bail!("several FMUs get it: use {}", names.join(" or ")),
        }
        Ok(())
    }

    /// Makes a step as [`Master::step`] does, and adds a number to the signal of the tapped connection, in the unit of
    /// its input. Returns the signal without it.
    ///
    /// # Errors
    /// When a call fails, or no connection is tapped.
    pub fn step_adding(&mut self, added: f64) -> Result<f64> {
        self.tap.as_mut().context("no connection is tapped")?.added = added;
        self.step()?;
        Ok(self.tap.as_ref().map_or(f64::NAN, |tap| tap.brought))
    }

    /// What is recorded so far.
    #[must_use]
    pub fn record(&self) -> &Record {
        &self.recorder.record
    }

    /// The current communication point (s).
    #[must_use]
    pub fn time(&self) -> f64 {
        self.origin + f64::from(self.steps_done) * self.scenario.step
    }

    /// Initializes all instances at the scenario's start.
    ///
    /// Instances without a run-in are initialized together; then those with a run-in, with the outputs of the others.
    /// The values at the start are recorded.
    ///
    /// # Errors
    /// When a value does not fit its variable, or a call fails.
    pub fn initialize(&mut self) -> Result<()> {
        let start_time = self.scenario.start_time;
        let (late, prompt): (Vec<_>, Vec<_>) =
            (0..self.members.len()).partition(|&index| self.members[index].member.run_in.is_some());
        for &index in &prompt {
            self.members[index].begin(start_time, start_time, &[])?;
        }
        for _ in 0..INITIAL_EXCHANGES.max(prompt.len()) {
            for &target in &prompt {
                self.take(target, |source| prompt.contains(&source), false)?;
            }
        }
        for &index in &prompt {
            self.members[index].instance.exit_initialization()?;
        }
        for index in late {
            let Some(run_in) = &self.members[index].member.run_in else { continue };
            self.members[index].begin(start_time - run_in.duration, start_time, &run_in.during)?;
            self.take(index, |source| prompt.contains(&source), false)?;
            let instance = &mut self.members[index].instance;
            instance.exit_initialization()?;
            let begin = start_time - run_in.duration;
            let step = self.scenario.step;
            for step_index in 0..run_in.steps {
                instance.step(begin + f64::from(step_index) * step, step)?;
            }
            assign(instance, &run_in.after)?;
        }
        self.record_at(start_time)
    }

    /// Makes a communication step and records its end, even past the scenario's end.
    ///
    /// # Errors
    /// When a call fails.
    pub fn step(&mut self) -> Result<()> {
        self.step_by(self.scenario.step)?;
        self.steps_done += 1;
        self.record_at(self.time())
    }

    fn step_by(&mut self, size: f64) -> Result<()> {
        let time = self.time();
        for coupled in &mut self.members {
            coupled.drive(self.signals_held_at.unwrap_or(time))?;
        }
        match self.scenario.stepping {
            Stepping::InTurn => {
                for index in 0..self.members.len() {
                    self.take(index, |_| true, true)?;
                    self.members[index].instance.step(time, size)?;
                }
            }
            Stepping::AtOnce => {
                for index in 0..self.members.len() {
                    self.take(index, |_| true, true)?;
                }
                for coupled in &mut self.members {
                    coupled.instance.step(time, size)?;
                }
            }
        }
        Ok(())
    }

    /// Makes all steps from the start to the scenario's end, the last of which may be shorter. Before each, `progress`
    /// gets the number of steps done, and what is recorded, which it may take.
    ///
    /// # Errors
    /// When a call fails, or an FMU requests the end of the simulation ([`Ended`]).
    pub fn step_to_end(&mut self, mut progress: impl FnMut(u32, &mut Record)) -> Result<()> {
        for index in 0..self.scenario.steps {
            progress(index, &mut self.recorder.record);
            self.step()?;
        }
        if let Some(rest) = self.rest {
            self.step_by(rest)?;
            (self.origin, self.steps_done) = (self.scenario.stop_time, 0);
            self.record_at(self.origin)?;
        }
        Ok(())
    }

    /// Runs a scenario from its start to its end, or until an FMU requests the end. Calls `progress` as
    /// [`Master::step_to_end`] does.
    ///
    /// # Errors
    /// Those of [`Master::initialize`] and [`Master::step`].
    pub fn run(mut self, progress: impl FnMut(u32, &mut Record)) -> Result<Run> {
        self.initialize()?;
        let mut ended = None;
        if let Err(error) = self.step_to_end(progress) {
            let end: Ended = error.downcast()?;
            self.record_at(end.time)?;
            ended = Some(end);
        }
        let warnings = self.members.iter_mut().flat_map(|coupled| {
            let name = coupled.instance.name().to_owned();
            coupled.instance.terminate();
            coupled.instance.take_warnings().into_iter().map(move |message| (name.clone(), message))
        });
        let warnings = warnings.collect();
        Ok(Run { record: self.recorder.record, warnings, ended })
    }

    fn record_at(&mut self, time: f64) -> Result<()> {
        self.recorder.take(time, self.members.iter_mut().map(|coupled| &mut coupled.instance))
    }

    /// Sets an instance's inputs to the outputs of the others.
    fn take(&mut self, target: usize, from: impl Fn(usize) -> bool, is_measured: bool) -> Result<()> {
        for index in 0..self.members[target].wires.len() {
            let source = self.members[target].wires[index].source;
            if !from(source) {
                continue;
            }
            if source == target {
                let Coupled { instance, wires, .. } = &mut self.members[target];
                wires[index].read(instance)?;
            } else {
                let [giver, taker] = self.members.get_disjoint_mut([source, target]).context("two FMUs")?;
                taker.wires[index].read(&mut giver.instance)?;
            }
            let wires = &mut self.members[target].wires[index];
            for (position, conversion) in &wires.conversions {
                wires.values[*position] = conversion.apply(wires.values[*position]);
            }
            if is_measured {
                for noise in
                    self.noise.iter_mut().filter(|noise| noise.target == target && noise.wires == index)
                {
                    wires.values[noise.position] += noise.source.draw();
                }
            }
            if let Some(tap) = self.tap.as_mut().filter(|tap| (tap.target, tap.wires) == (target, index)) {
                tap.brought = wires.values[tap.position];
                wires.values[tap.position] += tap.added;
            }
        }
        // An FMU may be its own source: no output is read once an input is set.
        let Coupled { instance, wires, .. } = &mut self.members[target];
        let mut wires = wires.iter_mut().filter(|wires| from(wires.source));
        wires.try_for_each(|wires| wires.write(instance))
    }
}

impl Wires {
    /// Reads the outputs.
    fn read(&mut self, instance: &mut Instance) -> Result<()> {
        instance.read(&mut self.outputs, &mut self.values)?;
        for TextWire { output, number, is_new, .. } in &mut self.texts {
            let mut now = [0.0];
            instance.read(output, &mut now)?;
            *is_new |= now[0].to_bits() != number.to_bits();
            *number = now[0];
        }
        Ok(())
    }

    /// Sets the inputs.
    fn write(&mut self, instance: &mut Instance) -> Result<()> {
        instance.write(&mut self.inputs, &self.values)?;
        for TextWire { output, input, number, is_new } in &mut self.texts {
            if mem::take(is_new)
                && let Some(text) = output.text(*number)
            {
                instance.set(input, text)?;
            }
        }
        Ok(())
    }
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

/// Rejects an input that an FMU does not have.
fn has_input(fmu: &Fmu, name: &str) -> Result<()> {
    if fmu.names(Causality::Input).any(|known| known == name) {
        return Ok(());
    }
    bail!("no FMU has an input {name}{}", like(name, fmu.names(Causality::Input)))
}

fn assign(instance: &mut Instance, values: &[Assignment]) -> Result<()> {
    values.iter().try_for_each(|assignment| {
        assignment.location.locate(instance.set(&assignment.name, assignment.value.clone()))
    })
}

impl Coupled<'_> {
    /// Sets start values and enters initialization mode, with the signals at the experiment's start.
    fn begin(&mut self, start_time: f64, experiment_start: f64, also: &[Assignment]) -> Result<()> {
        self.instance.set_up(start_time, None)?;
        for (set, location) in &self.member.parameters {
            location.locate(self.instance.set_parameters(set))?;
        }
        assign(&mut self.instance, &self.member.values)?;
        assign(&mut self.instance, also)?;
        self.drive(experiment_start)?;
        self.instance.enter_initialization()?;
        Ok(())
    }

    /// Sets the inputs driven by signals, if one changed.
    fn drive(&mut self, time: f64) -> Result<()> {
        let Driven { selection, signals, conversions, values } = &mut self.driven;
        let mut is_changed = false;
        for ((signal, conversion), value) in signals.iter().zip(conversions).zip(values.iter_mut()) {
            let now = converted(signal.at(time), conversion);
            is_changed |= now.to_bits() != value.to_bits();
            *value = now;
        }
        if is_changed {
            self.instance.write(selection, values)?;
        }
        Ok(())
    }
}

/// A converted value, bit-identical without a conversion.
fn converted(value: f64, conversion: &Function) -> f64 {
    if *conversion == Function::IDENTITY { value } else { conversion.apply(value) }
}

/// The connections from other FMUs to an FMU, except to inputs driven by its own signals.
fn wires(scenario: &Scenario, fmus: &[Arc<Fmu>], links: &[Link], target: usize) -> Result<Vec<Wires>> {
    let own = &scenario.fmus[target].inputs;
    let is_replaced = |link: &&Link| own.iter().any(|input| input.name == link.connection.input);
    let mut all = vec![];
    for (source, fmu) in fmus.iter().enumerate() {
        let between = links.iter().filter(|link| link.target == target && link.source == Some(source));
        let between: Vec<_> = between.filter(|link| !is_replaced(link)).collect();
        if !between.is_empty() {
            let is_text = |link: &&Link| {
                let input = fmus[target].description().variable(&link.connection.input);
                input.is_some_and(|input| input.value_type() == ValueType::String)
            };
            let (texts, between): (Vec<_>, Vec<_>) = between.into_iter().partition(is_text);
            let texts =
                texts.into_iter().map(|Link { connection: Connection { output, input, .. }, .. }| {
                    let output = fmu.select_with_texts([output.as_str()])?;
                    Ok(TextWire { output, input: input.clone(), number: f64::NAN, is_new: false })
                });
            let conversions = between.iter().map(|link| link.conversion.clone()).enumerate();
            all.push(Wires {
                source,
                outputs: fmu.select(between.iter().map(|link| link.connection.output.as_str()))?,
                inputs: fmus[target].select(between.iter().map(|link| link.connection.input.as_str()))?,
                values: vec![0.0; between.len()],
                conversions: conversions
                    .filter(|(_, conversion)| *conversion != Function::IDENTITY)
                    .collect(),
                texts: texts.collect::<Result<_>>()?,
            });
        }
    }
    Ok(all)
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

/// The noise of a scenario, on every connection of the name.
fn noise(scenario: &Scenario, members: &[Coupled<'_>]) -> Result<Vec<NoiseOn>> {
    let mut all = vec![];
    for noise in &scenario.noise {
        let before = all.len();
        for (target, coupled) in members.iter().enumerate() {
            for (wires, known) in coupled.wires.iter().enumerate() {
                if let Some(position) = known.inputs.names().iter().position(|name| *name == noise.name) {
                    all.push(NoiseOn { target, wires, position, source: NoiseSource::new(noise)? });
                }
            }
        }
        if all.len() == before {
            let names =
                members.iter().flat_map(|coupled| &coupled.wires).flat_map(|wires| wires.inputs.names());
            let like = like(&noise.name, names.map(String::as_str));
            return Err(noise.location.error(format!("no FMU gets {} from another{like}", noise.name)));
        }
    }
    Ok(all)
}
