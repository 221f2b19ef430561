//! Models whose equations compile and are wrong: told at initialization, by name.

use fmu_export::{
    Context, Equations, Error, EvaluationOf, Event, Integrated, Number, Persistent, Sample, Sampled,
    SampledModel, Simulation, check_dependencies,
};
use fmu_export_equations::{
    Falling, bouncing_ball, decay, draining, falling, tuned, tuned_samples, undeclared,
};

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
        (
            refusal::<ChangesCount>(),
            "`evaluate` changes bounces (output, discrete), which it may only read: set it in `event`",
        ),
        (refusal::<NoIndicator>(), "the event indicator height is NaN at 0 s"),
    ] {
        assert_eq!(found, expected);
    }
}

/// Defines models that differ in where they set what follows from parameters alone.
macro_rules! calculating {
    ($($name:ident: |$parameters:ident, $calculated:ident| $calculate:expr, |$variables:ident| $initialize:block, $event:block;)*) => {$(
        #[derive(Clone, Debug, Default, Persistent)]
        struct $name {}

        impl Equations for $name {
            type Variables = tuned::Variables;

            fn calculate_parameters<T: Number>(
                &self,
                $parameters: &tuned::Parameters<T>,
                $calculated: &mut tuned::CalculatedParameters<T>,
            ) {
                $calculate;
            }

            #[allow(unused_variables, reason = "most set nothing more")]
            fn initialize<T: Number>(&self, $variables: &mut tuned::Variables<T>) {
                $initialize
            }

            fn evaluate<T: Number>(&self, _time: T, variables: EvaluationOf<'_, Self, T>) {
                let tuned::Evaluation { calculated_parameters: calculated, states, derivatives, outputs, .. } = variables;
                derivatives.x = -states.x;
                // The JSON denies it.
                derivatives.held = calculated.scaled * states.x;
                (outputs.y, outputs.z, outputs.of_field) = (calculated.scaled, calculated.plain, calculated.plain);
            }

            fn event(
                &mut self,
                _event: &Event<'_>,
                $variables: &mut tuned::Variables,
                _context: &mut Context<'_>,
            ) -> Result<(), Error> {
                $variables.outputs.seen = 0;
                $event
                Ok(())
            }
        }
    )*};
}

/// Sets all of them.
fn all<T: Number>(parameters: &tuned::Parameters<T>, calculated: &mut tuned::CalculatedParameters<T>) {
    calculated.scaled = parameters.gain;
    calculated.plain = parameters.gain;
    calculated.strong = true;
}

calculating! {
    Forgets: |parameters, calculated| {
        calculated.scaled = parameters.gain;
        calculated.plain = parameters.gain;
    }, |variables| {}, {};
    Accumulates: |parameters, calculated| {
        calculated.scaled += parameters.gain;
        calculated.plain = parameters.gain;
        calculated.strong = true;
    }, |variables| {}, {};
    SetsLater: |parameters, calculated| all(parameters, calculated), |variables| { variables.calculated_parameters.plain = T::from(3.0); }, {};
    SetsAtEvents: |parameters, calculated| all(parameters, calculated), |variables| {}, { variables.calculated_parameters.strong = false; };
    Undeclared: |parameters, calculated| all(parameters, calculated), |variables| {}, {};
}

/// A sampled model that sets them at its start alone.
#[derive(Clone, Debug, Default, Persistent)]
struct AtTheStart {}

impl Sampled for AtTheStart {
    type Variables = tuned_samples::Variables;

    fn period(_variables: &tuned_samples::Variables) -> f64 {
        1.0
    }

    fn initialize(
        &mut self,
        variables: &mut tuned_samples::Variables,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        variables.calculated_parameters.scaled = 10.0 * variables.parameters.gain;
        Ok(())
    }

    fn sample(
        &mut self,
        _sample: Sample,
        _variables: &mut tuned_samples::Variables,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        Ok(())
    }
}

#[test]
fn a_calculated_parameter_that_another_hook_sets_is_named() {
    let sampled = Simulation::<SampledModel<AtTheStart>>::default().initialize().unwrap_err().to_string();
    for (found, variable, reason) in [
        (
            refusal::<Forgets>(),
            "strong (calculatedParameter, tunable)",
            "does not set it, or computes it from",
        ),
        (
            refusal::<Accumulates>(),
            "scaled (calculatedParameter, tunable)",
            "does not set it, or computes it from",
        ),
        (
            refusal::<SetsLater>(),
            "plain (local, tunable)",
            "another hook changes it after `calculate_parameters`",
        ),
        (
            refusal::<SetsAtEvents>(),
            "strong (calculatedParameter, tunable)",
            "another hook changes it after `calculate_parameters`",
        ),
        (sampled, "scaled (calculatedParameter, tunable)", "`calculate_parameters` does not set it"),
    ] {
        assert!(found.starts_with(&format!("{variable}: ")) && found.contains(reason), "{found}");
    }
}

#[test]
fn an_undeclared_dependency_through_a_calculated_parameter_is_named() {
    let undeclared = check_dependencies::<Integrated<Undeclared>>(&tuned::Variables::default()).unwrap_err();
    assert_eq!(undeclared.to_string(), "der(held) depends on x, which its 'reads' omit");
}

/// A fast decay towards a cosine of time (Prothero and Robinson), which its JSON does not say to read.
#[derive(Clone, Debug, Default, Persistent)]
struct Timeless {}

impl Equations for Timeless {
    type Variables = undeclared::Variables;

    fn evaluate<T: Number>(&self, time: T, variables: EvaluationOf<'_, Self, T>) {
        variables.derivatives.x = (time.cos() - variables.states.x) * 1e4 - time.sin();
    }
}

#[test]
fn an_undeclared_dependency_on_time_is_named() {
    let undeclared =
        check_dependencies::<Integrated<Timeless>>(&undeclared::Variables::default()).unwrap_err();
    assert_eq!(undeclared.to_string(), "der(x) depends on time, which its 'reads' omit");
    let mut simulation = Simulation::<Integrated<Timeless>>::default();
    simulation.initialize().unwrap();
    // Without the derivative by time, the stiff method has a low order, and steps are short.
    let abandoned = simulation.step(1e4).unwrap_err().to_string();
    assert!(abandoned.contains("was abandoned") && abandoned.contains("depend on time"), "{abandoned}");
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
