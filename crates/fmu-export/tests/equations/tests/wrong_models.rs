//! Models whose equations compile and are wrong: told at initialization, by name.

use fmu_export::{Equations, Integrated, Number, Persistent, Simulation, VariablesOf};
use fmu_export_equations::{bouncing_ball, decay, draining};

/// Defines models that differ by one line of their equations.
macro_rules! models {
    ($($name:ident: $module:ident, |$variables:ident| $evaluate:expr;)*) => {$(
        #[derive(Clone, Debug, Default, Persistent)]
        struct $name {}

        impl Equations for $name {
            type Variables = $module::Variables;

            fn evaluate<T: Number>(&self, _time: T, $variables: &mut VariablesOf<Self, T>) {
                $evaluate
            }
        }
    )*};
}

/// The equations of a decay.
fn decay<T: Number>(variables: &mut decay::Variables<T>) {
    variables.derivatives.x = -variables.states.x;
    variables.outputs.square = variables.states.x * variables.states.x;
    variables.outputs.seconds = T::from(0.0);
}

/// Those of a ball.
fn ball<T: Number>(variables: &mut bouncing_ball::Variables<T>) {
    variables.derivatives.h = variables.states.v;
    variables.derivatives.v = -variables.parameters.gravity;
}

models! {
    NoOutput: decay, |variables| {
        variables.derivatives.x = -variables.states.x;
        variables.outputs.seconds = T::from(0.0);
    };
    NoDerivative: decay, |variables| {
        variables.outputs.square = variables.states.x * variables.states.x;
        variables.outputs.seconds = T::from(0.0);
    };
    OutputOfItself: decay, |variables| {
        let before = variables.outputs.square;
        decay(variables);
        variables.outputs.square = before + 1.0;
    };
    ChangesState: decay, |variables| {
        variables.states.x *= T::from(0.5);
        decay(variables);
    };
    ChangesInput: decay, |variables| {
        variables.inputs.target = T::from(3.0);
        decay(variables);
    };
    ChangesParameter: decay, |variables| {
        variables.parameters.rate = T::from(3.0);
        decay(variables);
    };
    ChangesCount: bouncing_ball, |variables| {
        ball(variables);
        variables.outputs.bounces += 1;
    };
    NoIndicator: bouncing_ball, |variables| ball(variables);
}

fn refusal<E: Equations>() -> String {
    let refused = Simulation::<Integrated<E>>::default().initialize();
    refused.expect_err("the model is wrong").to_string()
}

#[test]
fn what_is_wrong_is_named() {
    for (found, expected) in [
        (refusal::<NoOutput>(), "`evaluate` does not set square, or makes it of what it was before"),
        (refusal::<NoDerivative>(), "`evaluate` does not set der(x), or makes it of what it was before"),
        (refusal::<OutputOfItself>(), "`evaluate` does not set square, or makes it of what it was before"),
        (refusal::<ChangesState>(), "`evaluate` changes x (output, continuous), which it may only read"),
        (refusal::<ChangesInput>(), "`evaluate` changes target (input, continuous), which it may only read"),
        (
            refusal::<ChangesParameter>(),
            "`evaluate` changes rate (parameter, tunable), which it may only read",
        ),
        (refusal::<ChangesCount>(), "`evaluate` does not set bounces, or makes it of what it was before"),
        (refusal::<NoIndicator>(), "the event indicator height is NaN at the time 0 s"),
    ] {
        assert_eq!(found, expected);
    }
}

/// A tank that is drained at a rate, not by the pressure in it.
#[derive(Clone, Debug, Default, Persistent)]
struct Draining {}

impl Equations for Draining {
    type Variables = draining::Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: &mut VariablesOf<Self, T>) {
        variables.derivatives.level = -variables.parameters.rate;
    }
}

#[test]
fn no_step_goes_beyond_a_strict_bound() {
    let mut simulation = Simulation::<Integrated<Draining>>::default();
    simulation.initialize().unwrap();
    simulation.step(0.9).unwrap();
    let error = simulation.step(0.9).unwrap_err().to_string();
    assert!(error.contains("the error of level stays above the tolerance"), "{error}");
    assert!(error.starts_with("the states cannot be integrated beyond the time 0.99"), "{error}");
}
