//! A model with one of everything, for tests of the exporter. Its parameters select where and how it fails.
#![allow(non_snake_case)] // the library is named after the model identifier

use std::panic::panic_any;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use fmu_export::persistence::{Archive, Persistent};
use fmu_export::{
    Accessed as _, Context, Dual, Error, Event, InputsOf, Model, Numbered as _, Serves, Step, Tape,
};

// What the runtime asks of a model is not for users: this one is to fail at each of its places.
fmu_export::fmu!(@exported TestModel, TestModel);

/// A step ends at the model's end where it misses it by less, in s.
const ROUNDING: f64 = 1e-9;

/// Whether the next `default` panics, which has no parameters.
static DEFAULT_FAILS: AtomicBool = AtomicBool::new(false);

/// The model. The flags are for functions without parameters.
#[allow(
    clippy::struct_excessive_bools,
    reason = "each of them is a fault or a branch, apart from the others"
)]
pub struct TestModel {
    steps: i32,
    /// Whether the level was above its limit at the last step or event.
    full: bool,
    start_time: f64,
    ticks: i32,
    hits: i32,
    /// Events until now.
    had: i32,
    /// The time of the last event.
    last: f64,
    /// Echoes of a tick that are still to come.
    echoes: i32,
    /// Changes its sign with each echo.
    echo: f64,
    clone_fails: bool,
    drop_fails: bool,
    persist_fails: bool,
}

impl Default for TestModel {
    fn default() -> Self {
        assert!(!DEFAULT_FAILS.swap(false, Ordering::Relaxed), "the default panics");
        Self {
            steps: 0,
            full: false,
            start_time: 0.0,
            ticks: 0,
            hits: 0,
            had: 0,
            last: 0.0,
            echoes: 0,
            echo: 1.0,
            clone_fails: false,
            drop_fails: false,
            persist_fails: false,
        }
    }
}

impl Clone for TestModel {
    fn clone(&self) -> Self {
        assert!(!self.clone_fails, "the clone panics");
        Self { ..*self }
    }
}

impl Drop for TestModel {
    fn drop(&mut self) {
        assert!(!self.drop_fails, "the drop panics");
    }
}

impl Persistent for TestModel {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        assert!(!self.persist_fails, "the serialization panics");
        self.steps.persist(archive)?;
        self.full.persist(archive)?;
        self.start_time.persist(archive)?;
        self.ticks.persist(archive)?;
        self.hits.persist(archive)?;
        self.had.persist(archive)?;
        self.last.persist(archive)?;
        self.echoes.persist(archive)?;
        self.echo.persist(archive)?;
        self.clone_fails.persist(archive)?;
        self.drop_fails.persist(archive)
    }
}

/// A panic's payload that panics when dropped.
struct PanickingPayload;

impl Drop for PanickingPayload {
    fn drop(&mut self) {
        panic!("the payload panics");
    }
}

/// Fails in the selected manner, if this is the selected place.
fn fail(variables: &mut Variables, here: Place) -> Result<(), Error> {
    let fault = &variables.parameters.fault;
    if fault.place != here {
        return Ok(());
    }
    match fault.manner {
        Manner::Text => panic!("a text, 100 %s of it #1#"),
        Manner::Formatted => panic!("a text of {} parts", variables.parameters.fault.place as i32),
        Manner::Number => panic_any(42),
        Manner::PanickingPayload => panic_any(PanickingPayload),
        Manner::Error => return Err(Error::new("the model's own error")),
        Manner::NotANumber => variables.states.tank.level = f64::NAN,
        Manner::Infinity => variables.states.tank.level = f64::INFINITY,
        Manner::Thread => {
            let thread = thread::spawn(|| panic!("a text of the thread"));
            return thread.join().map_err(|_| Error::new("the thread failed"));
        }
    }
    Ok(())
}

/// Asks for the end at a time that is not finite, if this is selected.
fn end_at_no_time(variables: &Variables, context: &mut Context<'_>) {
    let fault = &variables.parameters.fault;
    if fault.place == Place::End {
        context.terminate(if fault.manner == Manner::Infinity { f64::INFINITY } else { f64::NAN });
    }
}

/// The sign of the motion.
fn sign(gear: Gear) -> f64 {
    if gear == Gear::Forward { 1.0 } else { -1.0 }
}

/// The derivative of the level's rate with respect to the rate.
fn gain(variables: &Variables) -> f64 {
    gain_factor(variables) * variables.parameters.tank.gain
}

/// Its derivative with respect to the gain.
fn gain_factor(variables: &Variables) -> f64 {
    let doubled = if variables.parameters.settings.doubled { 2.0 } else { 1.0 };
    if variables.inputs.enabled { doubled } else { 0.0 }
}

impl TestModel {
    /// Notes whether the level is above its limit.
    fn note_full(&mut self, variables: &Variables) {
        self.full = variables.states.tank.level > variables.parameters.settings.high;
    }

    /// When the next tick is due.
    fn next_tick(&self, variables: &Variables) -> Option<f64> {
        let period = variables.parameters.events.period;
        (period > 0.0).then(|| self.start_time + f64::from(self.ticks) * period)
    }

    /// Calculates outputs, locals and derivatives.
    fn evaluate(&self, time: f64, variables: &mut Variables) {
        let gain = gain(variables);
        let Variables {
            parameters, calculated_parameters, inputs, states, derivatives, locals, outputs, ..
        } = variables;
        let determinant = calculated_parameters.settings.determinant;
        let (level, position) = (states.tank.level, states.motion.position);
        derivatives.tank.level = gain * inputs.rate + inputs.pulse;
        derivatives.motion.position = determinant * sign(inputs.gear) * inputs.drive - position * position;
        locals.tank.full = self.full;
        locals.events.clock = time;
        locals.events.ticks = self.ticks;
        locals.events.hits = self.hits;
        locals.events.had = self.had;
        locals.events.last = self.last;
        outputs.output = level + parameters.tank.gain * inputs.rate;
        outputs.position = position;
        outputs.steps = self.steps;
        outputs.positive = outputs.output > 0.0;
        outputs.text = format!("{} {}", parameters.settings.label, inputs.note);
        outputs.direction = inputs.gear;
    }
}

impl Model for TestModel {
    type Variables = Variables;
    const SERVES: Serves = Serves { model_exchange: true, ..Serves::CO_SIMULATION };

    const LONGEST_STEP: f64 = 1e6;

    fn check_parameters(variables: &Variables) -> Result<(), Error> {
        let settings = &variables.parameters.settings;
        if settings.low >= settings.high {
            return Err(Error::new(format!(
                "settings.low is {:?}, settings.high is {:?}",
                settings.low, settings.high
            )));
        }
        fail(&mut variables.clone(), Place::CheckParameters)
    }

    fn calculate_parameters(&self, parameters: &Parameters, calculated: &mut CalculatedParameters) {
        let [[a, b], [c, d]] = parameters.settings.table;
        calculated.settings.determinant = a * d - b * c;
    }

    fn initialize(&mut self, variables: &mut Variables, context: &mut Context<'_>) -> Result<(), Error> {
        self.calculate_parameters(&variables.parameters, &mut variables.calculated_parameters);
        variables.states = variables.start;
        if variables.parameters.motion.start == Start::AtRest {
            if variables.start.motion.position != 0.0 {
                context.warn(format_args!("the start value of motion.position is not used"));
            }
            variables.states.motion.position = 0.0;
        }
        if variables.inputs.note.starts_with("warning") {
            context.warn(format_args!("{}", variables.inputs.note));
        }
        context.event(format_args!("the level starts at {}", variables.states.tank.level));
        fail(variables, Place::Initialize)?;
        end_at_no_time(variables, context);
        self.steps = variables.parameters.settings.first;
        self.start_time = context.experiment.start_time;
        let end = variables.parameters.events.end;
        if end > 0.0 && end <= self.start_time {
            context.terminate(end);
        }
        (self.ticks, self.hits, self.had, self.last) = (0, 0, 0, 0.0);
        (self.echoes, self.echo) = (0, 1.0);
        self.note_full(variables);
        self.evaluate(self.start_time, variables);
        let place = variables.parameters.fault.place;
        DEFAULT_FAILS.store(place == Place::Default, Ordering::Relaxed);
        self.clone_fails = place == Place::Clone;
        self.drop_fails = place == Place::Drop;
        self.persist_fails = place == Place::Persist;
        Ok(())
    }

    fn step(
        &mut self,
        variables: &mut Variables,
        step: &Step<'_, InputsOf<Self>>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        variables.states.tank.level += f64::from(variables.inputs.lift);
        // Two midpoint steps: exact for a rate that is linear in time.
        let half = step.size / 2.0;
        for middle in [0.5 * half, 1.5 * half] {
            step.inputs.move_to(middle, &mut variables.inputs);
            self.evaluate(step.start + middle, variables);
            variables.states.tank.level += variables.derivatives.tank.level * half;
            variables.states.motion.position += variables.derivatives.motion.position * half;
            if middle < half {
                fail(variables, Place::Step)?;
            }
        }
        self.steps += 1;
        self.note_full(variables);
        step.inputs.move_to(step.size, &mut variables.inputs);
        self.evaluate(step.end(), variables);
        let end = variables.parameters.events.end;
        if end > 0.0 && step.start - ROUNDING < end && end <= step.end() + ROUNDING {
            context.terminate(end);
        }
        end_at_no_time(variables, context);
        Ok(())
    }

    fn refresh(&mut self, time: f64, variables: &mut Variables) {
        // It returns no error, so it panics.
        if let Err(error) = fail(variables, Place::Refresh) {
            panic!("{error}");
        }
        self.evaluate(time, variables);
    }

    fn differentiate(
        &self,
        _time: Dual,
        variables: &Variables,
        direction: &Variables,
    ) -> Result<Variables, Error> {
        fail(&mut variables.clone(), Place::Differentiate)?;
        let (mut result, inputs) = (Variables::zero(), &variables.inputs);
        let (inputs_by, states_by) = (direction.inputs(), &direction.start);
        let position = variables.states.motion.position;
        let [[a, b], [c, d]] = variables.parameters.settings.table;
        let [[a_by, b_by], [c_by, d_by]] = direction.parameters.settings.table;
        let determinant_by = a_by * d + a * d_by - b_by * c - b * c_by;
        let gain_by = gain_factor(variables) * direction.parameters.tank.gain;
        result.calculated_parameters.settings.determinant = determinant_by;
        result.derivatives.tank.level =
            gain(variables) * inputs_by.rate + gain_by * inputs.rate + inputs_by.pulse;
        result.derivatives.motion.position = sign(inputs.gear)
            * (variables.calculated_parameters.settings.determinant * inputs_by.drive
                + determinant_by * inputs.drive)
            - 2.0 * position * states_by.motion.position;
        result.outputs.output = states_by.tank.level
            + variables.parameters.tank.gain * inputs_by.rate
            + direction.parameters.tank.gain * inputs.rate;
        result.outputs.position = states_by.motion.position;
        Ok(result)
    }

    fn differentiate_initialization(
        &self,
        start_time: Dual,
        variables: &Variables,
        direction: &Variables,
    ) -> Result<Variables, Error> {
        // The start value of the motion's position is a guess, and therefore not a known in the standard.
        self.differentiate(start_time, variables, direction)
    }

    fn differentiate_backwards(
        &self,
        _time: f64,
        variables: &Variables,
        weights: &Variables,
        _by_parameters: bool,
        _tape: &mut Tape,
    ) -> Result<Variables, Error> {
        fail(&mut variables.clone(), Place::Differentiate)?;
        let (mut result, inputs) = (Variables::zero(), &variables.inputs);
        let (rates, outputs) = (&weights.derivatives, &weights.outputs);
        let position = variables.states.motion.position;
        result.inputs.rate =
            rates.tank.level * gain(variables) + outputs.output * variables.parameters.tank.gain;
        result.inputs.pulse = rates.tank.level;
        let by_motion = rates.motion.position * sign(inputs.gear);
        result.inputs.drive = by_motion * variables.calculated_parameters.settings.determinant;
        result.parameters.tank.gain =
            (outputs.output + gain_factor(variables) * rates.tank.level) * inputs.rate;
        let [[a, b], [c, d]] = variables.parameters.settings.table;
        let by_determinant = weights.calculated_parameters.settings.determinant + by_motion * inputs.drive;
        result.parameters.settings.table =
            [[d, -c], [-b, a]].map(|row| row.map(|factor| factor * by_determinant));
        result.states.tank.level = outputs.output;
        result.states.motion.position = outputs.position - 2.0 * position * rates.motion.position;
        Ok(result)
    }

    fn differentiate_initialization_backwards(
        &self,
        start_time: f64,
        variables: &Variables,
        weights: &Variables,
        tape: &mut Tape,
    ) -> Result<Variables, Error> {
        self.differentiate_backwards(start_time, variables, weights, true, tape)
    }

    fn restored(&mut self, variables: &Variables) {
        // As in `refresh`.
        if let Err(error) = fail(&mut variables.clone(), Place::Restored) {
            panic!("{error}");
        }
    }

    fn event_indicators(&self, _time: f64, variables: &Variables, indicators: &mut [f64]) {
        // As in `refresh`.
        let mut variables = variables.clone();
        if let Err(error) = fail(&mut variables, Place::EventIndicators) {
            panic!("{error}");
        }
        let (parameters, states) = (&variables.parameters, &variables.states);
        indicators[0] = states.tank.level - parameters.settings.high;
        indicators[1] = states.motion.position - parameters.events.wall;
        indicators[2] = self.echo;
    }

    fn next_event(&self, time: f64, variables: &Variables) -> Option<f64> {
        // As in `refresh`; the time of the event is what the level becomes.
        let mut variables = variables.clone();
        if let Err(error) = fail(&mut variables, Place::NextEvent) {
            panic!("{error}");
        }
        if !variables.states.tank.level.is_finite() {
            return Some(variables.states.tank.level);
        }
        let end = variables.parameters.events.end;
        let tick = self.next_tick(&variables).unwrap_or(f64::INFINITY);
        let next = if end > time { tick.min(end) } else { tick };
        (next < f64::INFINITY).then_some(next)
    }

    fn event(
        &mut self,
        event: &Event<'_>,
        variables: &mut Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        fail(variables, Place::Event)?;
        end_at_no_time(variables, context);
        if variables.inputs.note == "told" {
            context.event(format_args!("{}", variables.inputs.note));
        }
        let end = variables.parameters.events.end;
        if self.last < end && end <= event.time {
            context.terminate(end);
        }
        self.had += 1;
        self.last = event.time;
        if event.is_due && self.next_tick(variables).is_some_and(|tick| tick <= event.time) {
            self.ticks += 1;
            self.echoes = variables.parameters.events.echoes;
            variables.states.tank.level += f64::from(variables.inputs.lift);
        }
        if event.indicators[0] {
            self.note_full(variables);
        }
        if event.indicators[1] && variables.states.motion.position > variables.parameters.events.wall {
            variables.states.motion.position = 0.0;
            self.hits += 1;
        }
        if self.echoes != 0 {
            self.echoes -= 1;
            self.echo = -self.echo;
        }
        Ok(())
    }
}
