//! The order of calls: each function in each state of each interface (FMI 2.0.5, sections 3.2.3 and 4.2.4; FMI 3.0.2,
//! sections 2.3, 3.2, 4.2 and 5.2).

use fmu_importer::instance::instances;
use fmu_importer::{Argument, Fmu, Instance, State, Status, Whim};
use fmu_terms::{DataType, InstanceType, Version};

const STATES: [State; 9] = [
    State::Instantiated,
    State::InitializationMode,
    State::StepComplete,
    State::StepFailed,
    State::EventMode,
    State::ContinuousTimeMode,
    State::ClockActivationMode,
    State::Terminated,
    State::Error,
];

/// FMI 2.0.5, section 4.2.3: information on asynchronous steps, and a type without a status, are discarded.
const DISCARDED: [&str; 3] = ["fmi2GetStatus", "fmi2GetIntegerStatus", "fmi2GetStringStatus"];

#[test]
#[ignore = "of exported FMUs"]
fn a_function_succeeds_in_its_states_alone() {
    let fmus: Vec<_> = Fmu::test_models().collect();
    // Every other instance continues from the bytes of another one's state.
    let mut of_bytes = [false, true, true, false, true].into_iter().cycle();
    for (fmu, instance_type) in instances(&fmus) {
        for state in STATES {
            for function in &fmu.functions {
                let Some(mut instance) = Instance::in_state(fmu, instance_type, state) else { break };
                let is_restored = of_bytes.next().expect("it does not end");
                if is_restored {
                    let saved = instance.snapshot();
                    instance = Instance::new(fmu, instance_type);
                    instance.restore(&saved);
                }
                let told = format!("{} in {state:?} of {instance_type:?}", function.name);
                if function.name == "fmi2EnterInitializationMode" && state == State::Instantiated {
                    instance.ok("SetupExperiment");
                }
                let arguments = instance.arguments(function, &mut Whim::none());
                let saved = instance.snapshot();
                let _ = instance.messages();
                let (status, _) = instance.call(function, &arguments);
                let messages = instance.messages();
                instance.at.state = state;
                if instance.allows(function) {
                    let expected =
                        if DISCARDED.contains(&function.name) { Status::Discard } else { Status::Ok };
                    assert_eq!(status, expected, "{told}: {messages:?}");
                    continue;
                }
                // One message says why.
                assert_eq!(status, Status::Error, "{told}");
                let [(Status::ERROR, text)] = &messages[..] else { panic!("{told}: {messages:?}") };
                assert!(text.starts_with(&format!("{}: ", function.name)), "{told}: {text}");
                if fmu.description.version() == Version::Three {
                    // Section 2.2.4: the simulation must not be continued, but for another state.
                    let (status, _) = instance.call_with("Terminate", &mut Whim::none());
                    assert_eq!(status, Status::Error, "{told}");
                    instance.restore(&saved);
                }
                assert!(instance.snapshot() == saved, "{told} changes the instance");
                instance.ok("Reset");
                assert!(
                    instance.snapshot() == Instance::new(fmu, instance_type).snapshot(),
                    "fmi2Reset after {told}"
                );
            }
        }
    }
}

/// FMI 2.0.5, section 2.1.6: fmi2SetupExperiment must be called before.
#[test]
#[ignore = "of exported FMUs"]
fn initialization_needs_an_experiment() {
    let fmu = Fmu::test_models().next().unwrap();
    let mut instance = Instance::new(&fmu, InstanceType::CoSimulation);
    let (status, _) = instance.call_with("EnterInitializationMode", &mut Whim::none());
    assert_eq!(status, Status::Error);
    assert!(instance.messages()[0].1.contains("fmi2SetupExperiment"));
}

/// FMI 2.0.5, section 2.1.5: before an instance is made, and after one was refused, its address is NULL, for which no logger
/// receives the error.
#[test]
#[ignore = "of exported FMUs"]
fn a_function_without_an_instance_is_an_error() {
    let fmus: Vec<_> = Fmu::test_models().collect();
    for (fmu, instance_type) in instances(&fmus) {
        for function in &fmu.functions {
            let mut instance = Instance::new(fmu, instance_type);
            let arguments = instance.arguments(function, &mut Whim::none());
            assert_eq!(fmu.call_without_instance(function, &arguments), Status::Error, "{}", function.name);
        }
    }
}

/// The notes of FMI 2.0.5, sections 3.2.3 and 4.2.4, for every variable, and those of FMI 3.0.2, section 2.3. Beyond note 1,
/// inputs can be set before initialization, as libcosim, PyFMI and cofmupy do.
#[test]
#[ignore = "of exported FMUs"]
fn which_variables_can_be_set() {
    let fmus: Vec<_> = Fmu::test_models().filter(|fmu| fmu.variables("Clock").next().is_none()).collect();
    let mut tried = 0;
    for (fmu, instance_type) in instances(&fmus) {
        for state in STATES {
            for variable in &fmu.description.variables {
                let Some(mut instance) = Instance::in_state(fmu, instance_type, state) else { break };
                let is_real = variable.data_type == DataType::Real;
                let is_whole = variable.data_type == DataType::Integer;
                if !is_real && !is_whole
                    || matches!(state, State::Terminated | State::Error | State::StepFailed)
                {
                    continue;
                }
                // Within its range, and other than its start value.
                let start = variable.start.split(' ').next().unwrap().parse::<f64>().unwrap_or_default();
                let other = match (is_real, start > 0.0) {
                    (true, _) => start + 0.125,
                    (false, true) => 0.0,
                    (false, false) => start + 1.0,
                };
                let _ = instance.messages();
                let status = instance.set_to(variable, other);
                let messages = instance.messages();
                let told =
                    format!("{} in {state:?} of {instance_type:?}: {status:?}, {messages:?}", variable.name);
                instance.at.state = state;
                // Section 3.2.3, note 5: a continuous state, too; in Event Mode none that events set (`reinit`).
                let is_state = fmu.xml.contains(&format!("name=\"der({})\"", variable.name));
                let is_settable =
                    instance.is_settable(variable) || is_state && state == State::ContinuousTimeMode;
                tried += 1;
                if is_settable {
                    assert_eq!(status, Status::Ok, "{told}");
                } else {
                    assert_eq!(status, Status::Error, "{told}");
                    assert!(messages[0].1.contains(&variable.name), "{told}");
                }
            }
        }
    }
    assert!(tried > 500, "{tried}");
}

/// FMI 3.0.2, section 4.4: an FMU without `mightReturnEarlyFromDoStep` completes its steps, those with events, too.
#[test]
#[ignore = "of exported FMUs"]
fn steps_of_equations_are_whole_unless_the_fmu_says_otherwise() {
    let fmu = Fmu::open(&Fmu::folder(), "ladder/fmu/fmi3/BouncingBall.fmu");
    assert!(
        !fmu.description.has_capability(fmu_terms::Interface::CoSimulation, "mightReturnEarlyFromDoStep")
    );
    let mut instance = Instance::in_state(&fmu, InstanceType::CoSimulation, State::StepComplete).unwrap();
    let function = fmu.function("DoStep");
    for step in 1..=24 {
        let arguments = instance.arguments(function, &mut Whim::none());
        assert_eq!(instance.call(function, &arguments).0, Status::Ok);
        let [.., Argument::Memory(early), Argument::Memory(reached)] = &arguments[..] else { panic!() };
        assert_eq!((early.content(), reached.numbers()), (vec![0], vec![0.125 * f64::from(step)]));
    }
}
