//! Models that panic, return an error or compute what is not finite, in each function that calls them: an error with a
//! message. After a panic, or a step or event that failed, the instance is in the state `error`, which a reset or a state that
//! was saved before leads out of (FMI 2.0.5, sections 2.1.3 and 4.2.4; FMI 3.0.2, section 2.2.4).

use InstanceType::{CoSimulation, ModelExchange};
use State::{EventMode, InitializationMode, StepComplete};
use fmu_importer::{Fmu, Instance, State, Status, Whim};
use fmu_terms::{InstanceType, Version};

/// An item of the test model's parameter `fault.place`, by its value; an interface and a state; and a function that meets it
/// there, as FMI 2.0 names it.
type Place = (i32, InstanceType, State, &'static str);

const CHECK_PARAMETERS: i32 = 2;
const INITIALIZE: i32 = 3;
const STEP: i32 = 4;
const REFRESH: i32 = 5;
const DIFFERENTIATE: i32 = 11;
const EVENT: i32 = 12;
const EVENT_INDICATORS: i32 = 13;
const NEXT_EVENT: i32 = 14;

const PLACES: [Place; 22] = [
    (CHECK_PARAMETERS, CoSimulation, InitializationMode, "ExitInitializationMode"),
    (CHECK_PARAMETERS, CoSimulation, StepComplete, "DoStep"),
    (INITIALIZE, CoSimulation, InitializationMode, "ExitInitializationMode"),
    // There, getting a value computes it (section 4.2.4, note 2).
    (INITIALIZE, CoSimulation, InitializationMode, "GetReal"),
    (STEP, CoSimulation, StepComplete, "DoStep"),
    (REFRESH, CoSimulation, StepComplete, "GetReal"),
    (DIFFERENTIATE, CoSimulation, StepComplete, "GetDirectionalDerivative"),
    (DIFFERENTIATE, CoSimulation, StepComplete, "GetRealOutputDerivatives"),
    (EVENT, ModelExchange, EventMode, "NewDiscreteStates"),
    (EVENT_INDICATORS, ModelExchange, InitializationMode, "ExitInitializationMode"),
    (EVENT_INDICATORS, ModelExchange, EventMode, "NewDiscreteStates"),
    (EVENT_INDICATORS, ModelExchange, EventMode, "GetEventIndicators"),
    (NEXT_EVENT, ModelExchange, InitializationMode, "ExitInitializationMode"),
    (NEXT_EVENT, ModelExchange, EventMode, "NewDiscreteStates"),
    (REFRESH, ModelExchange, EventMode, "GetDerivatives"),
    (REFRESH, ModelExchange, EventMode, "GetEventIndicators"),
    (REFRESH, ModelExchange, EventMode, "GetContinuousStates"),
    (REFRESH, ModelExchange, EventMode, "EnterContinuousTimeMode"),
    (REFRESH, ModelExchange, EventMode, "NewDiscreteStates"),
    (CHECK_PARAMETERS, ModelExchange, InitializationMode, "ExitInitializationMode"),
    (CHECK_PARAMETERS, ModelExchange, EventMode, "NewDiscreteStates"),
    (CHECK_PARAMETERS, ModelExchange, EventMode, "EnterContinuousTimeMode"),
];

/// The functions that FMI 3.0 names otherwise.
fn named<'n>(fmu: &Fmu, name: &'n str) -> &'n str {
    match name {
        "GetReal" if fmu.description.version() == Version::Three => "GetFloat64",
        "GetDerivatives" if fmu.description.version() == Version::Three => "GetContinuousStateDerivatives",
        "GetRealOutputDerivatives" if fmu.description.version() == Version::Three => "GetOutputDerivatives",
        "NewDiscreteStates" if fmu.description.version() == Version::Three => "UpdateDiscreteStates",
        name => name,
    }
}

/// Fails in a place, in a manner by its value in `fault.manner`: the message of the error. Whether the instance must then be
/// in the state `error` is asked for.
fn fails(fmu: &Fmu, (place, instance_type, state, name): Place, manner: i32, ends: bool) -> String {
    let name = named(fmu, name);
    let told = format!("{name} of {instance_type:?} at the place {place} in the manner {manner}");
    let mut bystander = Instance::in_state(fmu, instance_type, state).unwrap();
    let untouched = bystander.snapshot();
    let mut instance = Instance::new(fmu, instance_type);
    // A tick is due.
    instance.set("events.period", 4);
    if fmu.description.version() == Version::Two {
        instance.ok("SetupExperiment");
    }
    instance.ok("EnterInitializationMode");
    if state != InitializationMode {
        instance.ok("ExitInitializationMode");
    }
    let at = instance.at;
    let saved = instance.save();
    instance.set("fault.manner", manner);
    instance.set("fault.place", place);
    let _ = instance.messages();
    let (status, _) = instance.call_with(name, &mut Whim::none());
    let messages = instance.messages().into_iter().filter(|(status, _)| *status == Status::ERROR);
    let messages: Vec<_> = messages.map(|(_, text)| text).collect();
    assert_eq!((status, messages.len()), (Status::Error, 1), "{told}: {messages:?}");
    for refused in ["Terminate", "EnterInitializationMode"].into_iter().filter(|_| ends) {
        assert_eq!(instance.call_with(refused, &mut Whim::none()).0, Status::Error, "{told}");
        let text = instance.messages().remove(0).1;
        assert!(text.contains("must not be called in the state"), "{told}: {text}");
    }
    instance.set_state(saved, at);
    instance.free_state(saved);
    instance.ok(name);
    instance.ok("Reset");
    assert!(instance.snapshot() == Instance::new(fmu, instance_type).snapshot(), "{told}");
    assert!(bystander.snapshot() == untouched, "{told}");
    messages.into_iter().next().unwrap()
}

/// Those of both versions of FMI.
fn test_models() -> impl Iterator<Item = Fmu> {
    Fmu::test_models().filter(|fmu| fmu.description.variable("fault.place").is_some())
}

#[test]
#[ignore = "of exported FMUs"]
fn a_panic_is_an_error_and_ends_the_run() {
    for fmu in test_models() {
        for place in PLACES {
            // In messages `#` is doubled (FMI 2.0.5, section 2.1.5).
            let formatted = format!("a text of {} parts", place.0);
            for (manner, told) in [(1, "a text, 100 %s of it ##1##"), (2, &formatted), (3, "no message")] {
                let text = fails(&fmu, place, manner, true);
                assert!(text.contains(&format!(": the model panicked: {told} (src/lib.rs:")), "{text}");
                assert!(text.ends_with("); reset the instance"), "{text}");
            }
        }
    }
}

/// It is passed on unchanged, from where the model can return it.
#[test]
#[ignore = "of exported FMUs"]
fn an_error_of_the_model_is_told() {
    let returns = [CHECK_PARAMETERS, INITIALIZE, STEP, DIFFERENTIATE, EVENT];
    for fmu in test_models() {
        for place in PLACES {
            let returns = returns.contains(&place.0);
            let text = fails(&fmu, place, 5, !returns || [STEP, EVENT].contains(&place.0));
            let told = if returns { ": the model's own error" } else { "panicked: the model's own error (" };
            assert!(text.contains(told), "{text}");
        }
    }
}

/// The message names the variable or indicator.
#[test]
#[ignore = "of exported FMUs"]
fn what_is_not_finite_is_named() {
    for fmu in test_models() {
        for place in PLACES {
            let (named, ends) = match (place.0, place.3) {
                (INITIALIZE, _) => ("the variable tank.level became", false),
                (STEP | EVENT, _) => ("the variable tank.level became", true),
                (EVENT_INDICATORS, "ExitInitializationMode" | "NewDiscreteStates") => {
                    ("the event indicator full is", false)
                }
                (REFRESH, "GetReal") => ("is", false),
                _ => continue,
            };
            for (manner, shown) in [(6, "NaN"), (7, "inf")] {
                let text = fails(&fmu, place, manner, ends);
                assert!(text.contains(&format!("{named} {shown}")), "{text}");
            }
        }
    }
}
