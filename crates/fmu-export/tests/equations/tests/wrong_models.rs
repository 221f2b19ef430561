//! Models whose equations compile and are wrong: told at initialization, by name.

use fmu_export::{Equations, EvaluationOf, Integrated, Number, Persistent, Simulation};
use fmu_export_equations::{Falling, bouncing_ball, decay, draining, falling};

/// Defines models that differ by one line of their equations.
macro_rules! models {
    ($($name:ident: $module:ident, |$variables:ident| $evaluate:expr;)*) => {$(
        #[derive(Clone, Debug, Default, Persistent)]
        struct $name {}

        impl Equations for $name {
            type Variables = $module::Variables;

            #[allow(unused_mut, reason = "those who hand the variables on borrow them")]
            fn evaluate<T: Number>(&self, _time: T, mut $variables: EvaluationOf<'_, Self, T>) {
                $evaluate
            }
        }
    )*};
}

/// The equations of a decay.
fn decay<T: Number>(variables: &mut decay::Evaluation<'_, T>) {
    variables.derivatives.x = -variables.states.x;
    variables.outputs.square = variables.states.x * variables.states.x;
    variables.outputs.seconds = T::from(0.0);
}

/// Those of a ball.
fn ball<T: Number>(variables: &mut bouncing_ball::Evaluation<'_, T>) {
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
        decay(&mut variables);
        variables.outputs.square = before + 1.0;
    };
    ChangesCount: bouncing_ball, |variables| {
        ball(&mut variables);
        variables.outputs.bounces += 1;
    };
    NoIndicator: bouncing_ball, |variables| ball(&mut variables);
}

fn refusal<E: Equations>() -> String {
    let refused = Simulation::<Integrated<E>>::default().initialize();
    refused.expect_err("the model is wrong").to_string()
}

#[test]
fn what_is_wrong_is_named() {
    for (found, expected) in [
        (refusal::<NoOutput>(), "`evaluate` does not set square, or computes it from its previous value"),
        (refusal::<NoDerivative>(), "`evaluate` does not set der(x), or computes it from its previous value"),
        (
            refusal::<OutputOfItself>(),
            "`evaluate` does not set square, or computes it from its previous value",
        ),
        (refusal::<ChangesCount>(), "`evaluate` changes bounces (output, discrete), which it may only read"),
        (refusal::<NoIndicator>(), "the event indicator height is NaN at 0 s"),
    ] {
        assert_eq!(found, expected);
    }
}

/// A model whose discrete output nothing sets.
#[derive(Clone, Debug, Default, Persistent)]
struct Uncounted {}

impl Equations for Uncounted {
    type Variables = falling::Variables;

    fn evaluate<T: Number>(&self, time: T, variables: EvaluationOf<'_, Self, T>) {
        Falling {}.evaluate(time, variables);
    }

    fn event_indicators(&self, time: f64, variables: &falling::Variables, indicators: &mut [f64]) {
        Falling {}.event_indicators(time, variables, indicators);
    }
}

#[test]
fn a_discrete_variable_that_nothing_sets_is_named() {
    assert_eq!(
        refusal::<Uncounted>(),
        "nothing sets impacts at the start: do so in `prepare`, `evaluate` or the initial event, or give it a \"start\" \
         with \"initial\": \"exact\" in the JSON"
    );
}

#[test]
fn an_event_that_leaves_a_limit_exceeded_is_named() {
    let mut simulation = Simulation::<Integrated<Falling>>::default();
    simulation.initialize().unwrap();
    let error = simulation.step(1.0).unwrap_err().to_string();
    // It falls for sqrt(2 h/g).
    assert!(error.starts_with("the event at 0.4515"), "{error}");
    assert!(error.contains(" s leaves depth at "), "{error}");
    assert!(error.ends_with(
        "though it is a limit: an event must put the state onto the limit and end what pushes it beyond"
    ));
}

/// A tank that is drained at a rate, not by the pressure in it.
#[derive(Clone, Debug, Default, Persistent)]
struct Draining {}

impl Equations for Draining {
    type Variables = draining::Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: EvaluationOf<'_, Self, T>) {
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
    assert!(error.starts_with("the states cannot be integrated beyond 1 s"), "{error}");
}
