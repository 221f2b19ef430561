//! A model that fails where and how its parameters tell it: what surrounds a model is tested with it.
#![allow(non_snake_case)] // the library bears the model identifier

use std::panic::panic_any;
use std::sync::atomic::{AtomicBool, Ordering};

use fmu_export::persistence::{Archive, Persistent};
use fmu_export::{Context, Error, InputsOf, Model, Step};

mod variables {
    fmu_export::include_variables!("Panicking");
}
use variables::{Manner, Place, Variables};

/// Whether the next instance fails as it is made: nothing else reaches a model before it has parameters.
static DEFAULT_FAILS: AtomicBool = AtomicBool::new(false);

/// The model. What sees no parameters is told here whether it fails.
struct Panicking {
    clone_fails: bool,
    drop_fails: bool,
    persist_fails: bool,
}

impl Default for Panicking {
    fn default() -> Self {
        assert!(!DEFAULT_FAILS.swap(false, Ordering::Relaxed), "the default panics");
        Self { clone_fails: false, drop_fails: false, persist_fails: false }
    }
}

impl Clone for Panicking {
    fn clone(&self) -> Self {
        assert!(!self.clone_fails, "the clone panics");
        Self { ..*self }
    }
}

impl Drop for Panicking {
    fn drop(&mut self) {
        assert!(!self.drop_fails, "the drop panics");
    }
}

impl Persistent for Panicking {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        assert!(!self.persist_fails, "the serialization panics");
        self.clone_fails.persist(archive)?;
        self.drop_fails.persist(archive)
    }
}

/// What a panic may carry at worst.
struct PanickingPayload;

impl Drop for PanickingPayload {
    fn drop(&mut self) {
        panic!("the payload panics");
    }
}

/// Fails, where this is the place, in the manner that is asked for.
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
        Manner::Refusal => return Err(Error::new("a refusal")),
        Manner::NotANumber => variables.states.tank.level = f64::NAN,
        Manner::Infinity => variables.states.tank.level = f64::INFINITY,
    }
    Ok(())
}

/// What follows from the state and the input.
fn evaluate(variables: &mut Variables, input: f64) {
    variables.derivatives.tank.level = input;
    variables.outputs.output = variables.states.tank.level + input;
}

impl Model for Panicking {
    type Variables = Variables;

    fn check_parameters(variables: &Variables) -> Result<(), Error> {
        fail(&mut variables.clone(), Place::CheckParameters)
    }

    fn initialize(
        &mut self,
        variables: &mut Variables,
        inputs: &InputsOf<Self>,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        variables.states = variables.start;
        fail(variables, Place::Initialize)?;
        evaluate(variables, inputs.input);
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
        let half = step.size / 2.0;
        variables.states.tank.level += step.inputs.at(half / 2.0).input * half;
        fail(variables, Place::Step)?;
        variables.states.tank.level += step.inputs.at(half * 1.5).input * half;
        evaluate(variables, step.inputs.at(step.size).input);
        Ok(())
    }

    fn refresh(&mut self, variables: &mut Variables, inputs: &InputsOf<Self>) {
        // It has no error to give: it takes a panic only.
        if let Err(error) = fail(variables, Place::Refresh) {
            panic!("{error}");
        }
        evaluate(variables, inputs.input);
    }

    fn restored(&mut self, variables: &Variables) {
        // As above.
        if let Err(error) = fail(&mut variables.clone(), Place::Restored) {
            panic!("{error}");
        }
    }
}

fmu_export::export_fmi2!(Panicking);
