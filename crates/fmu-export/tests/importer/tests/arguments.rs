//! Invalid arguments: each function with valid ones but for one, which is an error with a message that names it, and changes
//! nothing (FMI 2.0.5, sections 2.1.2, 2.1.7 and 2.1.8; FMI 3.0.2, sections 2.2.3, 2.2.7 and 2.2.9).

use std::collections::BTreeSet;
use std::ffi::{CString, c_void};
use std::{env, ptr};

use fmu_importer::arguments::reference;
use fmu_importer::functions::{Element, FMI2, FMI3};
use fmu_importer::instance::instances;
use fmu_importer::{Argument, Fmu, Function, Instance, Kind, State, Status, Whim};
use fmu_package::ValueType;
use fmu_terms::{Causality, DataType, InstanceType, Version};

/// In which each function is allowed in some interface, all but those of the other states.
const STATES: [State; 6] = [
    State::StepComplete,
    State::EventMode,
    State::ContinuousTimeMode,
    State::ClockActivationMode,
    State::InitializationMode,
    State::Instantiated,
];

/// An instance in a state in which a function is allowed, with the function's valid arguments.
fn before<'f>(
    fmu: &'f Fmu,
    instance_type: InstanceType,
    function: &'static Function,
) -> Option<(Instance<'f>, Vec<Argument>)> {
    STATES.into_iter().find_map(|state| {
        let mut instance = Instance::in_state(fmu, instance_type, state)?;
        if !instance.allows(function) {
            return None;
        }
        if function.name == "fmi2EnterInitializationMode" {
            instance.ok("SetupExperiment");
        }
        let arguments = instance.arguments(function, &mut Whim::none());
        Some((instance, arguments))
    })
}

/// Replaces an argument of a function, which [refuses](assert_refused) it.
fn refuses(
    fmu: &Fmu,
    instance_type: InstanceType,
    function: &'static Function,
    position: usize,
    replaced: impl FnOnce(&Argument) -> Argument,
    names: &[&str],
) {
    let (mut instance, mut arguments) = before(fmu, instance_type, function).unwrap();
    arguments[position] = replaced(&arguments[position]);
    assert_refused(&mut instance, function, &arguments, names);
}

/// The call is an error with one message, which has all of `names`, and changes nothing.
fn assert_refused(
    instance: &mut Instance<'_>,
    function: &'static Function,
    arguments: &[Argument],
    names: &[&str],
) {
    let (version, instance_type) = (instance.fmu.description.version(), instance.instance_type);
    let told =
        format!("{} of {instance_type:?} in {:?} with {arguments:?}", function.name, instance.at.state);
    let saved = instance.snapshot();
    let _ = instance.messages();
    let (status, _) = instance.call(function, arguments);
    let messages = instance.messages();
    assert_eq!(status, Status::Error, "{told}: {messages:?}");
    let [(Status::ERROR, text)] = &messages[..] else { panic!("{told}: {messages:?}") };
    assert!(text.starts_with(&format!("{}: ", function.name)), "{told}: {text}");
    assert!(names.iter().all(|name| text.contains(name)), "{told}, {names:?}: {text}");
    if version == Version::Three {
        // Section 2.2.4: the state that was saved leads out of the error.
        instance.restore(&saved);
    }
    assert!(instance.snapshot() == saved, "{told} changes the instance");
    if version == Version::Three {
        instance.restore(&saved);
    }
}

/// Each function that some state of an interface allows, with its valid arguments.
fn each_function(check: impl Fn(&Fmu, InstanceType, &'static Function, &[Argument])) {
    let fmus: Vec<_> = Fmu::test_models().collect();
    for (fmu, instance_type) in instances(&fmus) {
        for function in &fmu.functions {
            if let Some((instance, arguments)) = before(fmu, instance_type, function) {
                check(fmu, instance_type, function, &arguments);
                drop(instance);
            }
        }
    }
}

/// The number of elements of an array: its count is the next one, or of FMI 2.0 the one before.
fn count(function: &Function, arguments: &[Argument], position: usize) -> u64 {
    let of = |position: usize| match arguments[position] {
        Argument::Whole(count) if function.parameters[position].1 == Kind::Count => Some(count),
        _ => None,
    };
    let after = (position + 1..arguments.len()).find_map(of);
    let is_vector = position == 0 || function.name.starts_with("fmi3");
    let before = || (0..position).rev().find_map(of);
    if is_vector { after.or_else(before) } else { before() }.unwrap_or(1)
}

#[test]
#[ignore = "of exported FMUs"]
fn an_array_that_is_null_is_refused_unless_it_is_empty() {
    each_function(|fmu, instance_type, function, arguments| {
        for (position, &(parameter, kind)) in function.parameters.iter().enumerate() {
            let is_freed = function.name.to_lowercase().ends_with("freefmustate");
            if !matches!(kind, Kind::In(_) | Kind::Out(_)) {
                continue;
            }
            if count(function, arguments, position) == 0 || is_freed {
                // FMI 2.0.5, section 2.1.8: to free no state is ignored.
                let (mut instance, mut arguments) = before(fmu, instance_type, function).unwrap();
                arguments[position] = Argument::Null;
                let status = instance.call(function, &arguments).0;
                assert_eq!(
                    status,
                    Status::Ok,
                    "{} with {arguments:?}: {:?}",
                    function.name,
                    instance.messages()
                );
                continue;
            }
            refuses(fmu, instance_type, function, position, |_| Argument::Null, &[parameter, "NULL"]);
        }
    });
}

#[test]
#[ignore = "of exported FMUs"]
fn a_wrong_number_of_elements_is_refused_before_they_are_accessed() {
    const OF_VECTORS: [&str; 8] =
        ["nx", "ni", "nContinuousStates", "nEventIndicators", "nValues", "nSeed", "nSensitivity", "size"];
    each_function(|fmu, instance_type, function, arguments| {
        for (position, (parameter, _)) in function.parameters.iter().enumerate() {
            let (Argument::Whole(right), true) = (&arguments[position], OF_VECTORS.contains(parameter))
            else {
                continue;
            };
            // Damaged states, truncated ones among them, are in random_calls.rs.
            if function.name.to_lowercase().contains("deserialize") {
                continue;
            }
            // Compiled sources copy arrays into their own memory, as long as the importer says.
            let is_compiled = env::var_os("FMUS").is_some();
            let wrong = [right.saturating_sub(1), right + 1, 1 << 31, 1 << 60, 1 << 63, u64::MAX];
            let tried = if is_compiled { &wrong[..1] } else { &wrong };
            for &wrong in tried.iter().filter(|wrong| *wrong != right) {
                let names = [&wrong.to_string()[..], &right.to_string()];
                refuses(fmu, instance_type, function, position, |_| Argument::Whole(wrong), &names);
            }
        }
    });
}

/// Calls each function that takes value references with one of no variable, as an array's elements are none, and of a
/// variable of each other type, alone and after right ones, wherever the function is allowed. Returns the functions.
fn refuse_wrong_references(fmus: &[Fmu]) -> BTreeSet<&'static str> {
    let mut tried = BTreeSet::new();
    for (fmu, instance_type) in instances(fmus) {
        for (function, data_type) in fmu.functions.iter().filter_map(|of| Some((*of, of.data_type()?))) {
            let right: BTreeSet<_> = fmu.variables(data_type).map(reference).collect();
            let mut types = BTreeSet::new();
            let others = fmu.description.variables.iter().filter(|variable| {
                !right.contains(&reference(variable))
                    && types.insert((variable.data_type.text(), fmu.size(variable)))
            });
            let mut wrong: Vec<_> =
                others.map(|other| (other, reference(other), other.name.clone())).collect();
            let scalar = fmu.description.variables.iter().find(|variable| fmu.size(variable) == 1).unwrap();
            let array = fmu.description.variables.iter().find(|variable| fmu.size(variable) > 1);
            let element = array.map(|array| reference(array) + 1);
            wrong.extend(element.into_iter().chain([9999, 1 << 31, u32::MAX]).map(|unknown| {
                // Functions of clocks name the element.
                let names_element = data_type == "Clock" && Some(unknown) == element;
                (scalar, unknown, if names_element { String::new() } else { unknown.to_string() })
            }));
            for state in STATES {
                let Some(instance) = Instance::in_state(fmu, instance_type, state) else { continue };
                if !instance.allows(function) {
                    continue;
                }
                let selected = instance.selected(function, &mut Whim::none());
                let parameters = function.parameters.iter().enumerate();
                let of_references = parameters.filter(|(_, (_, kind))| Function::has_references(*kind));
                for (list, (position, _)) in of_references.enumerate() {
                    for (variable, wrong, name) in &wrong {
                        for is_alone in [true, false] {
                            let mut lists = selected.clone();
                            if is_alone {
                                lists[list].clear();
                            }
                            let mut references: Vec<_> = lists[list].iter().copied().map(reference).collect();
                            references.push(*wrong);
                            lists[list].push(variable);
                            let mut instance = Instance::in_state(fmu, instance_type, state).unwrap();
                            let mut arguments = instance.arguments_of(function, lists, &mut Whim::none());
                            arguments[position] = match function.parameters[position].1 {
                                Kind::Reference => Argument::Whole((*wrong).into()),
                                _ => Argument::of(&references),
                            };
                            assert_refused(&mut instance, function, &arguments, &[name]);
                        }
                    }
                }
                tried.insert(function.name);
            }
        }
    }
    tried
}

#[test]
#[ignore = "of exported FMUs"]
fn a_wrong_value_reference_is_refused_by_every_function() {
    let fmus: Vec<_> = Fmu::test_models().collect();
    let tried = refuse_wrong_references(&fmus);
    for function in FMI2.iter().chain(FMI3).filter(|function| function.data_type().is_some()) {
        assert!(tried.contains(function.name), "{} is not tried", function.name);
    }
}

/// Without arrays the value references are those of the scalars.
#[test]
#[ignore = "of exported FMUs"]
fn a_wrong_value_reference_is_refused_by_models_of_equations() {
    let fmu = Fmu::open(&Fmu::folder(), "ladder/fmu/fmi3/BouncingBall.fmu");
    assert!(refuse_wrong_references(&[fmu]).contains("fmi3GetOutputDerivatives"));
}

#[test]
#[ignore = "of exported FMUs"]
fn numbers_that_are_not_finite_are_refused() {
    each_function(|fmu, instance_type, function, arguments| {
        for (position, &(parameter, kind)) in function.parameters.iter().enumerate() {
            for (value, shown) in [(f64::NAN, "NaN"), (f64::INFINITY, "inf"), (f64::NEG_INFINITY, "-inf")] {
                match kind {
                    // An infinite stop time is none.
                    Kind::Number if parameter != "stopTime" || value != f64::INFINITY => {
                        let of = |_: &Argument| Argument::Number(value);
                        refuses(fmu, instance_type, function, position, of, &[parameter, shown]);
                    }
                    Kind::In(Element::Float(size)) if count(function, arguments, position) > 0 => {
                        let of = |argument: &Argument| {
                            let Argument::Memory(memory) = argument else { panic!("{argument:?}") };
                            let mut numbers = memory.numbers();
                            numbers[0] = value;
                            if size == 8 {
                                return Argument::of(&numbers);
                            }
                            #[allow(clippy::cast_possible_truncation, reason = "they were of this type")]
                            Argument::of(&numbers.iter().map(|&number| number as f32).collect::<Vec<_>>())
                        };
                        refuses(fmu, instance_type, function, position, of, &[shown]);
                    }
                    _ => {}
                }
            }
        }
    });
}

#[test]
#[ignore = "of exported FMUs"]
fn texts_that_are_null_or_not_utf_8_are_refused() {
    each_function(|fmu, instance_type, function, arguments| {
        for (position, &(_, kind)) in function.parameters.iter().enumerate() {
            if kind != Kind::In(Element::Text) || count(function, arguments, position) == 0 {
                continue;
            }
            // Also as the last of all.
            let Argument::Memory(memory) = &arguments[position] else { continue };
            let room = memory.content().len() / 8;
            let texts = |wrong: Option<&[u8]>| {
                let mut texts = vec![Some(c"logStatusError".to_owned()); room];
                texts[room - 1] = wrong.map(|wrong| CString::new(wrong).unwrap());
                Argument::of_texts(texts)
            };
            refuses(fmu, instance_type, function, position, |_| texts(None), &["NULL"]);
            refuses(fmu, instance_type, function, position, |_| texts(Some(b"\xff\xfe")), &[]);
        }
    });
}

/// Freed, another FMU's, of the other interface, or anything else: refused, and not dereferenced (FMI 2.0.5, section 2.1.8).
#[test]
#[ignore = "of exported FMUs"]
fn a_handle_that_is_not_a_state_is_refused() {
    let other = Fmu::test_models().next().unwrap();
    let mut other = Instance::new(&other, InstanceType::CoSimulation);
    let of_other = other.save();
    each_function(|fmu, instance_type, function, _| {
        let name = function.name[4..].to_lowercase();
        for (position, &(_, kind)) in function.parameters.iter().enumerate() {
            let of: fn(*mut c_void) -> Argument = match kind {
                Kind::State => Argument::State,
                // Bytes become a new state, whatever the handle held.
                Kind::Out(Element::State) if !name.starts_with("deserialize") => {
                    |state| Argument::of(&[state])
                }
                _ => continue,
            };
            for handle in [of_other, ptr::without_provenance_mut(4096)] {
                refuses(fmu, instance_type, function, position, |_| of(handle), &["FMUstate"]);
            }
            let (mut instance, mut arguments) = before(fmu, instance_type, function).unwrap();
            let freed = instance.save();
            instance.free_state(freed);
            arguments[position] = of(freed);
            assert_eq!(instance.call(function, &arguments).0, Status::Error, "{}", function.name);
            if kind == Kind::State {
                refuses(
                    fmu,
                    instance_type,
                    function,
                    position,
                    |_| of(ptr::null_mut()),
                    &["FMUstate", "NULL"],
                );
            }
        }
    });
    other.set_state(of_other, other.at);
}

/// By its handle and by its bytes; the message names both interfaces.
#[test]
#[ignore = "of exported FMUs"]
fn a_state_of_another_interface_is_refused() {
    let fmus: Vec<_> = Fmu::test_models().collect();
    for (fmu, instance_type) in instances(&fmus) {
        for of in fmu.instance_types().into_iter().filter(|of| *of != instance_type) {
            let mut other = Instance::new(fmu, of);
            let state = other.save();
            let bytes = other.serialize(state);
            for by_handle in [true, false] {
                let mut instance = Instance::new(fmu, instance_type);
                let saved = instance.snapshot();
                let status = if by_handle {
                    let set = instance.state_function("SetFMUstate");
                    instance.call(set, &[Argument::State(state)]).0
                } else {
                    instance.deserialize(&bytes).unwrap_err()
                };
                assert_eq!(status, Status::Error, "of {of:?} in {instance_type:?}");
                let messages = instance.messages();
                let text = &messages.last().unwrap().1;
                let name =
                    |of| if of == InstanceType::ModelExchange { "Model Exchange" } else { "Co-Simulation" };
                assert!([of, instance_type].into_iter().all(|of| text.contains(name(of))), "{text}");
                instance.restore(&saved);
                assert!(instance.snapshot() == saved);
            }
        }
    }
}

/// The message names both.
#[test]
#[ignore = "of exported FMUs"]
fn bytes_of_another_fmu_are_refused() {
    let fmus: Vec<_> = Fmu::test_models().collect();
    for (fmu, instance_type) in instances(&fmus) {
        for other in fmus.iter().filter(|other| other.description.guid() != fmu.description.guid()) {
            let (bytes, _) = Instance::new(other, other.instance_types()[0]).snapshot();
            let mut instance = Instance::new(fmu, instance_type);
            assert_eq!(instance.deserialize(&bytes), Err(Status::Error));
            let messages = instance.messages();
            // States of the versions differ in what they begin with.
            let named = [fmu, other].map(|of| messages[0].1.contains(of.description.guid()));
            let is_version = fmu.description.version() == other.description.version();
            assert!(named == [true; 2] || !is_version, "{messages:?}");
        }
    }
}

/// FMI 2.0.5, section 2.1.8: a handle is used again as a state is saved over, but bytes become a new state, whatever the
/// handle held.
#[test]
#[ignore = "of exported FMUs"]
fn a_state_is_saved_over_and_bytes_become_a_new_one() {
    let fmus: Vec<_> = Fmu::test_models().collect();
    for (fmu, instance_type) in instances(&fmus) {
        let mut instance = Instance::new(fmu, instance_type);
        let older = instance.save();
        let of_older = instance.serialize(older);
        if fmu.description.version() == Version::Two {
            instance.ok("SetupExperiment");
        }
        instance.ok("EnterInitializationMode");
        let (later, _) = instance.snapshot();
        for held in [older, ptr::without_provenance_mut(12345), ptr::null_mut()] {
            let state = Argument::of(&[held]);
            let arguments = [Argument::of(&later), Argument::Whole(later.len() as u64), state];
            let deserialize = instance.state_function("DeSerializeFMUstate");
            assert_eq!(instance.call(deserialize, &arguments).0, Status::Ok);
            assert!(arguments[2].handle() != held);
            assert!(instance.serialize(arguments[2].handle()) == later);
            assert!(instance.serialize(older) == of_older);
        }
        let over = Argument::of(&[older]);
        let get = instance.state_function("GetFMUstate");
        assert_eq!(instance.call(get, std::slice::from_ref(&over)).0, Status::Ok);
        assert_eq!(over.handle(), older);
        assert!(instance.serialize(older) == later);
    }
}

/// FMI 2.0.5, section 4.2.2: a step starts at the end of the last one, and takes time; one that would take years is refused at
/// once.
#[test]
#[ignore = "of exported FMUs"]
fn a_step_that_is_no_step_is_refused() {
    let fmus: Vec<_> = Fmu::test_models()
        .filter(|fmu| fmu.description.interface(fmu_terms::Interface::CoSimulation).is_some())
        .collect();
    for fmu in fmus.iter().filter(|fmu| fmu.variables("Clock").next().is_none()) {
        let function = fmu.function("DoStep");
        // The long ones also go past the stop time.
        for (size, names) in [0.0, -0.0, -0.125, -1e-300]
            .map(|size| (size, &["communicationStepSize"][..]))
            .into_iter()
            .chain([1e300, 1e18, 1e9].map(|size| (size, &[][..])))
        {
            refuses(fmu, InstanceType::CoSimulation, function, 1, |_| Argument::Number(size), names);
        }
        for begin in [0.125, -0.125, 1e-3, -1e-3, 1e9] {
            let names = ["currentCommunicationPoint"];
            refuses(fmu, InstanceType::CoSimulation, function, 0, |_| Argument::Number(begin), &names);
        }
    }
}

/// Every parameter and start value, and every input that is no number: its bounds are accepted, and nothing beyond them. A
/// number for an input is replaced by the nearest bound, with a warning: sensors and solvers overshoot.
#[test]
#[ignore = "of exported FMUs"]
fn a_value_out_of_its_range_is_refused() {
    let mut tried = 0;
    for fmu in Fmu::test_models() {
        let instance_type = fmu.instance_types()[0];
        for variable in fmu.description.variables.iter().filter(|variable| variable.is_settable()) {
            let (min, max) = variable.range().unwrap();
            let is_real = variable.value_type() == ValueType::Real;
            let is_limited =
                variable.causality == Causality::Input && is_real && variable.data_type != DataType::Float32;
            let enumeration = fmu.description.enumeration(&variable.declared_type);
            let (min, max) = match enumeration {
                Some(enumeration) => (1.0, enumeration.items.len() as f64),
                None => (min, max),
            };
            for (bound, direction) in [(min, -1.0), (max, 1.0)] {
                if !bound.is_finite() || variable.data_type == DataType::Clock {
                    continue;
                }
                tried += 1;
                let next = match variable.data_type.meaning() {
                    #[allow(clippy::cast_possible_truncation, reason = "it is of this type")]
                    Some(DataType::Float32) => {
                        f64::from((bound as f32 * direction).next_up()) * f64::from(direction)
                    }
                    _ if is_real => (bound * f64::from(direction)).next_up() * f64::from(direction),
                    _ => bound + f64::from(direction),
                };
                // An item in its lower 32 bits.
                let long = enumeration.map(|_| (bound + f64::from(u32::MAX) + 1.0, false));
                for (value, is_within) in [(bound, true), (next, false)].into_iter().chain(long) {
                    let mut instance = Instance::new(&fmu, instance_type);
                    let status = instance.set_to(variable, value);
                    let expected = match (is_within, is_limited) {
                        (true, _) => Status::Ok,
                        (false, true) => Status::Warning,
                        (false, false) => Status::Error,
                    };
                    assert_eq!(status, expected, "{value} for {}: {:?}", variable.name, instance.messages());
                }
            }
        }
    }
    assert!(tried > 60, "{tried}");
}
