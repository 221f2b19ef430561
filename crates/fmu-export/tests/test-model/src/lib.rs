//! A model with one of everything, for tests of the exporter. Its parameters select where and how it fails.
#![allow(non_snake_case)] // the library is named after the model identifier

use std::panic::panic_any;
use std::sync::atomic::{AtomicBool, Ordering};

use fmu_export::persistence::{Archive, Persistent};
use fmu_export::{Context, Error, InputsOf, Model, Step, Variables as _};

mod variables {
    fmu_export::include_variables!("TestModel");
}
use variables::{Gear, Inputs, Manner, Place, Start, Variables};

/// Whether the next `default` panics, which has no parameters.
static DEFAULT_FAILS: AtomicBool = AtomicBool::new(false);

/// The model. The flags are for functions without parameters.
struct TestModel {
    steps: i32,
    clone_fails: bool,
    drop_fails: bool,
    persist_fails: bool,
}

impl Default for TestModel {
    fn default() -> Self {
        assert!(!DEFAULT_FAILS.swap(false, Ordering::Relaxed), "the default panics");
        Self { steps: 0, clone_fails: false, drop_fails: false, persist_fails: false }
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
    }
    Ok(())
}

/// The sign of the motion.
fn sign(gear: Gear) -> f64 {
    if gear == Gear::Forward { 1.0 } else { -1.0 }
}

/// The derivative of the level's rate with respect to the rate.
fn gain(variables: &Variables, inputs: &Inputs) -> f64 {
    let parameters = &variables.parameters;
    let doubled = if parameters.settings.doubled { 2.0 } else { 1.0 };
    if inputs.enabled { doubled * parameters.tank.gain } else { 0.0 }
}

impl TestModel {
    /// Calculates outputs, locals and derivatives.
    fn evaluate(&self, variables: &mut Variables, inputs: &Inputs) {
        let gain = gain(variables, inputs);
        let (parameters, states) = (&variables.parameters, &variables.states);
        let [[a, b], [c, d]] = parameters.settings.table;
        let (level, position) = (states.tank.level, states.motion.position);
        variables.locals.settings.determinant = a * d - b * c;
        variables.derivatives.tank.level = gain * inputs.rate + inputs.pulse;
        variables.derivatives.motion.position =
            (a * d - b * c) * sign(inputs.gear) * inputs.drive - position * position;
        variables.locals.tank.full = level > parameters.settings.high;
        let outputs = &mut variables.outputs;
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

    fn initialize(
        &mut self,
        variables: &mut Variables,
        inputs: &InputsOf<Self>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        variables.states = variables.start;
        if variables.parameters.motion.start == Start::AtRest {
            if variables.start.motion.position != 0.0 {
                context.warn(format_args!("the start value of motion.position is not used"));
            }
            variables.states.motion.position = 0.0;
        }
        if inputs.note.starts_with("warning") {
            context.warn(format_args!("{}", inputs.note));
        }
        context.event(format_args!("the level starts at {}", variables.states.tank.level));
        fail(variables, Place::Initialize)?;
        self.steps = variables.parameters.settings.first;
        self.evaluate(variables, inputs);
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
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        variables.states.tank.level += f64::from(step.inputs.initial().lift);
        // Two midpoint steps: exact for a rate that is linear in time.
        let half = step.size / 2.0;
        for middle in [0.5 * half, 1.5 * half] {
            self.evaluate(variables, &step.inputs.at(middle));
            variables.states.tank.level += variables.derivatives.tank.level * half;
            variables.states.motion.position += variables.derivatives.motion.position * half;
            if middle < half {
                fail(variables, Place::Step)?;
            }
        }
        self.steps += 1;
        self.evaluate(variables, &step.inputs.at(step.size));
        Ok(())
    }

    fn refresh(&mut self, _time: f64, variables: &mut Variables, inputs: &InputsOf<Self>) {
        // It returns no error, so it panics.
        if let Err(error) = fail(variables, Place::Refresh) {
            panic!("{error}");
        }
        self.evaluate(variables, inputs);
    }

    fn differentiate(
        &self,
        _time: f64,
        variables: &Variables,
        inputs: &InputsOf<Self>,
        direction: &Variables,
    ) -> Result<Variables, Error> {
        fail(&mut variables.clone(), Place::Differentiate)?;
        let mut result = Variables::zero();
        let (inputs_by, states_by) = (direction.inputs(), &direction.start);
        let position = variables.states.motion.position;
        result.derivatives.tank.level = gain(variables, inputs) * inputs_by.rate + inputs_by.pulse;
        result.derivatives.motion.position =
            variables.locals.settings.determinant * sign(inputs.gear) * inputs_by.drive
                - 2.0 * position * states_by.motion.position;
        result.outputs.output = states_by.tank.level + variables.parameters.tank.gain * inputs_by.rate;
        result.outputs.position = states_by.motion.position;
        Ok(result)
    }

    fn differentiate_initialization(
        &self,
        start_time: f64,
        variables: &Variables,
        inputs: &InputsOf<Self>,
        direction: &Variables,
    ) -> Result<Variables, Error> {
        // The start value of the motion's position is a guess, and therefore not a known in the standard.
        let mut result = self.differentiate(start_time, variables, inputs, direction)?;
        result.outputs.output += direction.parameters.tank.gain * inputs.rate;
        Ok(result)
    }

    fn restored(&mut self, variables: &Variables) {
        // As in `refresh`.
        if let Err(error) = fail(&mut variables.clone(), Place::Restored) {
            panic!("{error}");
        }
    }
}

variables::export_fmi2!(TestModel);
