//! The coupled instances of a scenario, from communication point to communication point:
//!
//! ```text
//! t: READ -> SET -> EVENTS -> (a row) -> STEP -> t + h: READ ...
//! ```
//!
//! Each instance is read when its step ends, before any input of the point is set: between `fmi2SetReal` and `fmi2DoStep`
//! nothing is read (FMI 2.0.5, section 4.2.4; FMI 3.0.2, Step Mode). So all values of a point are there at one time, and
//! the value of each connection follows from them. Stepping knows neither records nor noise: who records reads the
//! values of a point, and who disturbs a connection says what is added to its value.

use std::cell::Cell;
use std::rc::Rc;

use anyhow::{Context, Error, Result, anyhow, bail};
use fmu_package::{Domain, Function, Value};
use fmu_solve::display::Seconds;
use fmu_solve::time::coincidence;

use crate::importer::{Course, Ended, Fmu, Instance, Misfit, Selection};
use crate::scenario::{Assignment, Member, RunIn, Signal, Stepping};

/// Exchanges of outputs and inputs during initialization, at least: the outputs of one FMU, once it has its inputs, may
/// change those of another, as a measured voltage changes a controller's duty. In a chain of more FMUs there are as many
/// exchanges as FMUs, so that the first one's outputs reach the last in any order.
const INITIAL_EXCHANGES: usize = 2;

/// The most rounds of events at a communication point.
const MOST_ROUNDS: u32 = 1000;

/// The rounding of a value that comes back through a loop of FMUs, of a conversion and a sum in each, relative to it.
const LOOP_ROUNDING: f64 = 4.0 * f64::EPSILON;

/// The coupled instances.
pub struct Coupling<'a> {
    pub members: Vec<Coupled<'a>>,
    stepping: Stepping,
    /// The communication step (s).
    step: f64,
    /// What is read of all instances, one after the other.
    readings: Vec<f64>,
    /// The time whose values the signals keep (s).
    held_at: Rc<Cell<Option<f64>>>,
}

/// An instance with its inputs.
pub struct Coupled<'a> {
    pub member: &'a Member,
    run_in: Option<&'a RunIn>,
    pub instance: Instance,
    /// The index of the member's first reading.
    first: usize,
    /// The member's outputs that others get, the first of its readings.
    outputs: Selection,
    pub inputs: Inputs,
    texts: Vec<TextWire>,
    /// Whether the member takes part in the round of events.
    is_called: bool,
}

/// The inputs of an instance that are held over each step.
pub struct Inputs {
    selection: Selection,
    pub wires: Vec<Wire>,
    /// Whether an output is among the sources.
    has_outputs: bool,
    /// The values at the communication point, of in-turn stepping those of the step.
    pub values: Vec<f64>,
    /// What the inputs were last set to.
    set: Vec<f64>,
}

/// What gives an input its value.
pub struct Wire {
    pub source: Source,
    conversion: Function,
    /// Both ends of the connection, for messages.
    name: String,
    /// The value from which on a Boolean input is true.
    threshold: Option<f64>,
    /// What is added to the converted value, as noise is.
    pub added: f64,
    /// The converted value without what is added.
    pub brought: f64,
}

/// A source of an input.
pub enum Source {
    Signal(Signal),
    /// A member's output.
    Output {
        member: usize,
        /// The output's index among what is read of the member; once coupled, of all.
        reading: usize,
    },
}

/// A connection of Strings.
pub struct TextWire {
    /// The index of a member, and of one of its readings: the number of the text.
    pub source: (usize, usize),
    pub input: String,
    /// The number of the text that is set.
    set: f64,
}

impl TextWire {
    pub fn new(source: (usize, usize), input: String) -> Self {
        Self { source, input, set: f64::NAN }
    }
}

impl Wire {
    pub fn new(source: Source, conversion: Function, threshold: Option<f64>, name: String) -> Self {
        Self { source, conversion, name, threshold, added: 0.0, brought: f64::NAN }
    }
}

impl Inputs {
    /// Inputs of an FMU by their names.
    pub fn new(fmu: &Fmu, wires: Vec<(String, Wire)>) -> Result<Self> {
        let (names, wires): (Vec<_>, Vec<_>) = wires.into_iter().unzip();
        let thresholds = wires.iter().map(|wire: &Wire| wire.threshold);
        Ok(Self {
            selection: selection(fmu, names.iter().map(String::as_str), thresholds)?,
            has_outputs: wires.iter().any(|wire| matches!(wire.source, Source::Output { .. })),
            values: vec![f64::NAN; wires.len()],
            set: vec![f64::NAN; wires.len()],
            wires,
        })
    }

    /// The inputs' names.
    pub fn names(&self) -> &[String] {
        self.selection.names()
    }

    /// Whether a value is not yet set.
    fn are_new(&self) -> bool {
        self.values.iter().zip(&self.set).any(|(value, set)| value.to_bits() != set.to_bits())
    }

    /// Whether a value differs from what is set by more than the rounding of some operations, which may go on for ever in
    /// a loop.
    fn still_change(&self) -> bool {
        let mut pairs = self.values.iter().zip(&self.set);
        pairs.any(|(value, set)| {
            let is_rounding = (value - set).abs() <= LOOP_ROUNDING * value.abs();
            value.to_bits() != set.to_bits() && !is_rounding
        })
    }
}

/// The courses of signals that continuous inputs of Model Exchange follow.
pub struct Courses {
    signals: Vec<(Signal, Vec<f64>, Function)>,
    /// The communication step (s).
    step: f64,
    held_at: Rc<Cell<Option<f64>>>,
}

impl Courses {
    /// The courses of signals, with their conversions to the inputs.
    fn new(signals: Vec<(Signal, Function)>, step: f64, held_at: Rc<Cell<Option<f64>>>) -> Self {
        let signals = signals.into_iter().map(|(signal, conversion)| {
            let jumps = signal.jumps();
            (signal, jumps, conversion)
        });
        Self { signals: signals.collect(), step, held_at }
    }
}

/// The first jump after a time (s), which is one of those until another time (s).
fn jump_after(jumps: &[f64], until: f64) -> Option<f64> {
    jumps.get(jumps.partition_point(|jump| *jump <= until)).copied()
}

impl Course for Courses {
    fn values(&self, from: f64, time: f64, values: &mut [f64]) {
        let until = from + coincidence(self.step, from);
        let at = |signal: &Signal, time: f64| signal.at_within(time, coincidence(self.step, time));
        for ((signal, jumps, conversion), value) in self.signals.iter().zip(values) {
            let own = match self.held_at.get() {
                Some(held_at) => at(signal, held_at),
                None if jumps.is_empty() || time <= until => at(signal, time),
                None => signal.before(jump_after(jumps, until).map_or(time, |jump| time.min(jump)), 0.0),
            };
            *value = converted(own, conversion);
        }
    }

    fn next_jump(&self, after: f64) -> Option<f64> {
        if self.held_at.get().is_some() {
            return None;
        }
        let until = after + coincidence(self.step, after);
        let jumps = self.signals.iter().filter_map(|(_, jumps, _)| jump_after(jumps, until));
        jumps.min_by(f64::total_cmp)
    }
}

/// A converted value, bit-identical without a conversion.
pub fn converted(value: f64, conversion: &Function) -> f64 {
    if *conversion == Function::IDENTITY { value } else { conversion.apply(value) }
}

/// What a member needs to be coupled.
pub struct Parts<'a> {
    pub member: &'a Member,
    pub run_in: Option<&'a RunIn>,
    pub instance: Instance,
    /// What is read of the member; the outputs that others get come first.
    pub readings: Selection,
    pub outputs: Selection,
    pub inputs: Inputs,
    /// Continuous inputs in Model Exchange that follow signals.
    pub followed: Option<(Selection, Vec<(Signal, Function)>)>,
    pub texts: Vec<TextWire>,
}

impl<'a> Coupling<'a> {
    pub fn new(parts: Vec<Parts<'a>>, stepping: Stepping, step: f64) -> Result<Self> {
        let held_at = Rc::new(Cell::new(None));
        let (mut members, mut first): (Vec<Coupled<'_>>, _) = (vec![], 0);
        for Parts { member, run_in, mut instance, readings, outputs, inputs, followed, texts } in parts {
            let count = readings.names().len();
            instance.watch(readings)?;
            if let Some((selection, signals)) = followed {
                instance.let_follow(selection, Box::new(Courses::new(signals, step, Rc::clone(&held_at))))?;
            }
            members.push(Coupled {
                member,
                run_in,
                instance,
                first,
                outputs,
                inputs,
                texts,
                is_called: false,
            });
            first += count;
        }
        let firsts: Vec<_> = members.iter().map(|coupled| coupled.first).collect();
        for wire in members.iter_mut().flat_map(|coupled| &mut coupled.inputs.wires) {
            if let Source::Output { member, reading } = &mut wire.source {
                *reading += firsts[*member];
            }
        }
        Ok(Self { members, stepping, step, readings: vec![f64::NAN; first], held_at })
    }

    /// A value that is read of a member.
    pub fn reading(&self, member: usize, position: usize) -> f64 {
        self.readings[self.members[member].first + position]
    }

    /// The difference (s) within which a time is that of a communication point (s).
    pub fn coincidence(&self, point: f64) -> f64 {
        coincidence(self.step, point)
    }

    /// Holds the signals at their values of a time (s), or lets them go on.
    pub fn hold_signals(&self, at: Option<f64>) {
        self.held_at.set(at);
    }

    /// Initializes all instances at a time (s), with the signals of that time: together, but those with a run-in after
    /// the others, with their outputs. The FMUs get the stop time (s), if there is one.
    pub fn initialize(&mut self, start: f64, stop: Option<f64>) -> Result<()> {
        let (late, prompt): (Vec<_>, Vec<_>) =
            (0..self.members.len()).partition(|&index| self.members[index].run_in.is_some());
        for &index in &prompt {
            self.begin(index, (start, start, stop), &[])?;
        }
        for _ in 0..INITIAL_EXCHANGES.max(prompt.len()) {
            if self.stepping == Stepping::AtOnce {
                prompt.iter().try_for_each(|&giver| self.read_outputs(giver))?;
            }
            for &taker in &prompt {
                if self.stepping == Stepping::InTurn {
                    self.read_sources(taker, &prompt)?;
                }
                self.give(taker, &prompt, start)?;
            }
        }
        for &index in &prompt {
            self.members[index].instance.leave_initialization()?;
            self.read(index)?;
        }
        self.hold_signals(Some(start));
        for index in late {
            let Some(run_in) = self.members[index].run_in else { continue };
            let begin = start - run_in.duration;
            self.begin(index, (begin, start, stop), &run_in.during)?;
            self.read_sources(index, &prompt)?;
            self.give(index, &prompt, start)?;
            let Coupled { instance, .. } = &mut self.members[index];
            instance.leave_initialization()?;
            for step in 0..run_in.steps {
                instance.step(begin + f64::from(step) * self.step, self.step)?;
            }
            // What is set from here on is of the start's SET.
            self.read(index)?;
            assign(&mut self.members[index].instance, &run_in.after)?;
        }
        self.hold_signals(None);
        Ok(())
    }

    /// Sets start values and enters initialization mode, for a begin, with the signals of the start and a stop time (s).
    fn begin(
        &mut self,
        index: usize,
        (begin, start, stop): (f64, f64, Option<f64>),
        more: &[Assignment],
    ) -> Result<()> {
        let Coupled { member, instance, .. } = &mut self.members[index];
        instance.set_up(begin, stop)?;
        for (set, location) in &member.parameters {
            location.locate(instance.set_parameters(set))?;
        }
        assign(instance, &member.values)?;
        assign(instance, more)?;
        instance.begin_to_follow(start)?;
        self.give(index, &[], start)?;
        self.members[index].instance.enter_initialization()
    }

    /// Reads the outputs of the members that give inputs to one, if these are among some.
    fn read_sources(&mut self, taker: usize, givers: &[usize]) -> Result<()> {
        for &giver in givers {
            let Coupled { inputs, texts, .. } = &self.members[taker];
            let is_source =
                |wire: &Wire| matches!(wire.source, Source::Output { member, .. } if member == giver);
            if inputs.wires.iter().any(is_source) || texts.iter().any(|wire| wire.source.0 == giver) {
                self.read_outputs(giver)?;
            }
        }
        Ok(())
    }

    /// Reads the outputs that others get.
    fn read_outputs(&mut self, index: usize) -> Result<()> {
        let Coupled { instance, outputs, first, .. } = &mut self.members[index];
        let count = outputs.names().len();
        instance.read(outputs, &mut self.readings[*first..*first + count])
    }

    /// Reads all that connections and the record need of a member.
    fn read(&mut self, index: usize) -> Result<()> {
        let Coupled { instance, first, .. } = &mut self.members[index];
        let values = instance.read_watched()?;
        self.readings[*first..*first + values.len()].copy_from_slice(values);
        Ok(())
    }

    /// Before or in initialization: sets the inputs that outputs of some members drive; without these, those of signals.
    fn give(&mut self, taker: usize, givers: &[usize], time: f64) -> Result<()> {
        let Coupled { instance, inputs, texts, .. } = &mut self.members[taker];
        let is_given = |wire: &Wire| match wire.source {
            Source::Signal(_) => givers.is_empty(),
            Source::Output { member, .. } => givers.contains(&member),
        };
        let given: Vec<_> = (0..inputs.wires.len()).filter(|&index| is_given(&inputs.wires[index])).collect();
        let names = given.iter().map(|&index| inputs.names()[index].as_str());
        let wires: Vec<_> = given.iter().map(|&index| &inputs.wires[index]).collect();
        let thresholds = wires.iter().map(|wire| wire.threshold);
        let mut selection = selection(instance.fmu(), names, thresholds)?;
        let late = coincidence(self.step, time);
        let values =
            wires.iter().map(|wire| converted(wire.value(&self.readings, (time, late)), &wire.conversion));
        let mut values: Vec<_> = values.collect();
        selection.fit(&mut values).map_err(|misfit| wires[misfit.position].refused(&misfit, time))?;
        instance.write_fitted(&mut selection, &values)?;
        for index in 0..texts.len() {
            let TextWire { source: (giver, position), input, .. } = &self.members[taker].texts[index];
            if givers.contains(giver) {
                let text =
                    text(self.members[*giver].outputs.texts_of(*position), self.reading(*giver, *position))?;
                let input = input.clone();
                self.members[taker].instance.set(&input, text)?;
            }
        }
        Ok(())
    }

    /// Sets a String if it is new.
    fn give_text(&mut self, taker: usize, index: usize) -> Result<()> {
        let TextWire { source: (giver, position), input, set } = &self.members[taker].texts[index];
        let number = self.reading(*giver, *position);
        if number.to_bits() == set.to_bits() {
            return Ok(());
        }
        let text = text(self.members[*giver].instance.watched_texts(*position), number)?;
        let input = input.clone();
        let Coupled { instance, texts, .. } = &mut self.members[taker];
        instance.set(&input, text)?;
        texts[index].set = number;
        Ok(())
    }

    /// Computes the values of a member's inputs at a time (s) from what is read.
    fn connect(&mut self, taker: usize, time: f64) -> Result<()> {
        let Self { members, readings, held_at, step, .. } = self;
        let Inputs { selection, wires, values, .. } = &mut members[taker].inputs;
        let signal_time = held_at.get().unwrap_or(time);
        let late = coincidence(*step, signal_time);
        for (wire, value) in wires.iter_mut().zip(&mut *values) {
            wire.brought = converted(wire.value(readings, (signal_time, late)), &wire.conversion);
            *value = if wire.added == 0.0 { wire.brought } else { wire.brought + wire.added };
        }
        selection.fit(values).map_err(|misfit| wires[misfit.position].refused(&misfit, time))
    }

    /// Computes all connections at a time (s) from what is read.
    pub fn connect_all(&mut self, time: f64) -> Result<()> {
        (0..self.members.len()).try_for_each(|index| self.connect(index, time))
    }

    /// Whether an instance has events at a communication point (s), other than changes of inputs.
    pub fn has_due_events(&self, time: f64) -> bool {
        let until = time + self.coincidence(time);
        self.members.iter().any(|coupled| coupled.instance.has_due_events(until))
    }

    /// SET and EVENTS at a communication point (s): computes all connections from what is read there. FMUs with Event Mode
    /// get their inputs; once no output changes by it, they handle their events. The outputs that these change reach one
    /// another, until nothing changes. Returns the first FMU that asks for the end there, if one does.
    pub fn settle(&mut self, time: f64) -> Result<Option<Ended>> {
        let until = time + self.coincidence(time);
        for round in 0..MOST_ROUNDS {
            self.connect_all(time)?;
            if self.set_new(time, until, round)? {
                continue;
            }
            let mut ended = None;
            for coupled in &mut self.members {
                coupled.is_called = coupled.instance.is_due(until);
                if coupled.is_called {
                    coupled.instance.begin_event(time, until)?;
                    if let Err(error) = coupled.instance.finish_event(time, until) {
                        ended.get_or_insert(error.downcast::<Ended>()?);
                    }
                }
            }
            if self.members.iter().all(|coupled| !coupled.is_called) {
                return Ok(None);
            }
            for index in 0..self.members.len() {
                if self.members[index].is_called {
                    self.read(index)?;
                }
            }
            if ended.is_some() {
                self.connect_all(time)?;
                return Ok(ended);
            }
        }
        let called = self.members.iter().filter(|coupled| coupled.is_called);
        let names: Vec<_> = called.map(|coupled| coupled.instance.name()).collect();
        bail!(
            "the events at {} s do not end: after {MOST_ROUNDS} rounds inputs or discrete states of {} still change",
            Seconds(time),
            names.join(" and ")
        )
    }

    /// Sets the inputs of FMUs with Event Mode that are new at a communication point (s), whose events are until a time
    /// (s), and reads what they change. Returns whether there were any.
    fn set_new(&mut self, time: f64, until: f64, round: u32) -> Result<bool> {
        let mut is_set = false;
        for index in 0..self.members.len() {
            let is_called = self.has_new_inputs(index, until, round);
            self.members[index].is_called = is_called;
            if is_called {
                self.members[index].instance.begin_event(time, until)?;
                self.set(index)?;
                is_set = true;
            }
        }
        for index in 0..self.members.len() {
            // The other members are read after their events.
            if self.members[index].is_called && !self.members[index].outputs.names().is_empty() {
                self.read(index)?;
            }
        }
        Ok(is_set)
    }

    /// Whether a member has Event Mode and new inputs, of which those that follow signals jump until a time (s).
    fn has_new_inputs(&self, index: usize, until: f64, round: u32) -> bool {
        let Coupled { instance, inputs, texts, .. } = &self.members[index];
        let has_new_text = || {
            let mut texts = texts.iter();
            texts.any(|wire| self.reading(wire.source.0, wire.source.1).to_bits() != wire.set.to_bits())
        };
        let are_new = || if round == 0 { inputs.are_new() } else { inputs.still_change() };
        instance.reports_events() && (instance.jumps_until(until) || are_new() || has_new_text())
    }

    /// Sets a member's inputs.
    fn set(&mut self, index: usize) -> Result<()> {
        let Coupled { instance, inputs: Inputs { selection, values, set, .. }, texts, .. } =
            &mut self.members[index];
        instance.write_fitted(selection, values)?;
        set.copy_from_slice(values);
        (0..texts.len()).try_for_each(|text| self.give_text(index, text))
    }

    /// Makes a step from a communication point (s) by a size (s), and reads the instances at its end. Returns the first
    /// FMU that asks for the end, if the others reach its time, or there are none.
    ///
    /// # Errors
    /// When a call fails, or an FMU of several requests the end within the step ([`Ended`]).
    pub fn step(&mut self, time: f64, size: f64) -> Result<Option<Ended>> {
        let end = time + size;
        let reached = end - coincidence(size, end);
        let mut ended = None;
        for index in 0..self.members.len() {
            if self.stepping == Stepping::InTurn {
                // The members before this one have stepped.
                self.connect(index, time)?;
            }
            let Coupled { instance, inputs, .. } = &self.members[index];
            if inputs.are_new() || inputs.has_outputs && !instance.reports_events() {
                self.set(index)?;
            }
            if let Err(error) = self.members[index].instance.advance(time, size) {
                let end: Ended = error.downcast()?;
                if self.members.len() > 1 && end.time < reached {
                    bail!(end);
                }
                ended.get_or_insert(end);
            }
            self.read(index)?;
        }
        Ok(ended)
    }
}

impl Wire {
    /// The value of the source at a time (s), to which a signal's jumps belong up to `late` (s) after it.
    fn value(&self, readings: &[f64], (time, late): (f64, f64)) -> f64 {
        match &self.source {
            Source::Signal(signal) => signal.at_within(time, late),
            Source::Output { reading, .. } => readings[*reading],
        }
    }

    /// The error for a value that the input does not take.
    fn refused(&self, Misfit { reason, .. }: &Misfit, time: f64) -> Error {
        anyhow!("{} at {} s: {reason}", self.name, Seconds(time))
    }
}

/// The text of a number.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a whole number from 0
fn text(known: &[String], number: f64) -> Result<Value> {
    known.get(number as usize).cloned().map(Value::String).context("the output's text was not read")
}

/// Selects inputs, some of which are true from a threshold on.
pub fn selection<'a>(
    fmu: &Fmu,
    names: impl IntoIterator<Item = &'a str>,
    thresholds: impl IntoIterator<Item = Option<f64>>,
) -> Result<Selection> {
    let mut selection = fmu.select(names)?;
    for (position, threshold) in thresholds.into_iter().enumerate() {
        if let Some(threshold) = threshold {
            let variable = fmu.variable(&selection.names()[position])?;
            let domain = Domain::with_threshold(variable, threshold).map_err(Error::msg)?;
            selection.limit(position, domain, None);
        }
    }
    Ok(selection)
}

fn assign(instance: &mut Instance, values: &[Assignment]) -> Result<()> {
    values.iter().try_for_each(|assignment| {
        assignment.location.locate(instance.set(&assignment.name, assignment.value.clone()))
    })
}
