//! What `ModelStructure` lists has derivatives: each unknown with respect to each of its dependencies, forwards and
//! backwards, in each state that allows it (FMI 2.0.5, section 2.1.9; FMI 3.0.2, section 2.2.11).

use std::collections::BTreeSet;

use fmu_importer::arguments::reference;
use fmu_importer::instance::instances;
use fmu_importer::{Argument, Fmu, Function, Instance, State, Status};
use fmu_package::FmuVariable;
use fmu_terms::{Causality, DataType, Initial, Version};

const STATES: [State; 6] = [
    State::InitializationMode,
    State::StepComplete,
    State::EventMode,
    State::ContinuousTimeMode,
    State::ClockActivationMode,
    State::Terminated,
];

/// Both derivatives are the same sums of products in another order, of at most some thousand terms, each rounded to 1e-16 of
/// itself. They may cancel; the largest derivative of an unknown tells their size.
const ROUNDING: f64 = 1e-12;

/// An unknown of `ModelStructure`, and the knowns on which it depends.
struct Unknown<'f> {
    variable: &'f FmuVariable,
    dependencies: Vec<&'f FmuVariable>,
}

/// An attribute of an element.
fn attribute<'x>(element: &'x str, name: &str) -> Option<&'x str> {
    element.split_once(&format!(" {name}=\""))?.1.split('"').next()
}

/// The unknowns that are numbers with derivatives, of initialization or later; one without dependencies depends on all
/// knowns.
fn unknowns(fmu: &Fmu, of_initialization: bool) -> Vec<Unknown<'_>> {
    let version = fmu.description.version();
    let variables = &fmu.description.variables;
    let is_real = |variable: &&FmuVariable| variable.data_type == DataType::Real;
    let named = |number: &str| {
        if version == Version::Three {
            variables.iter().find(|variable| variable.value_reference.text() == number).unwrap()
        } else {
            &variables[number.parse::<usize>().unwrap() - 1]
        }
    };
    let is_state = |variable: &FmuVariable| {
        let position = 1 + variables.iter().position(|other| other.name == variable.name).unwrap();
        let key = if version == Version::Three {
            variable.value_reference.to_string()
        } else {
            position.to_string()
        };
        variables.iter().any(|other| other.derivative.text() == key)
    };
    let is_known = |variable: &&FmuVariable| match variable.causality.meaning() {
        Some(Causality::Input) => true,
        Some(Causality::Parameter) => of_initialization || version == Version::Three,
        Some(Causality::Independent) => false,
        _ if of_initialization => variable.initial == Initial::Exact,
        _ => is_state(variable),
    };
    let all: Vec<_> = variables.iter().filter(is_real).filter(is_known).collect();
    let (_, structure) = fmu.xml.split_once("<ModelStructure>").unwrap();
    let mut list = "";
    let mut found = vec![];
    for element in structure.split('<') {
        let name = element.split([' ', '>', '/']).next().unwrap_or_default();
        // Of FMI 2.0 an unknown is in a list, of FMI 3.0 it has its name.
        list = match name {
            "Unknown" | "" => list,
            name => name,
        };
        let is_of = match list {
            "InitialUnknowns" | "InitialUnknown" => of_initialization,
            "Outputs" | "Derivatives" | "Output" | "ContinuousStateDerivative" => !of_initialization,
            _ => continue,
        };
        let key = if version == Version::Three { "valueReference" } else { "index" };
        let Some(variable) = attribute(element, key).map(named).filter(|_| is_of).filter(is_real) else {
            continue;
        };
        let dependencies = attribute(element, "dependencies")
            .map_or_else(|| all.clone(), |list| list.split_whitespace().map(named).filter(is_real).collect());
        found.push(Unknown { variable, dependencies });
    }
    found
}

/// The derivatives of a function, of which each value of the seeds is 1.
fn derivatives(
    instance: &mut Instance<'_>,
    function: &'static Function,
    [unknowns, knowns]: [&[&FmuVariable]; 2],
) -> Vec<f64> {
    let fmu = instance.fmu;
    let references = |variables: &[&FmuVariable]| {
        let references: Vec<_> = variables.iter().map(|variable| reference(variable)).collect();
        [Argument::of(&references), Argument::Whole(variables.len() as u64)]
    };
    let size =
        |variables: &[&FmuVariable]| variables.iter().map(|variable| fmu.size(variable)).sum::<usize>();
    let is_forwards = function.name.contains("Directional");
    let [seeds, results] = if is_forwards { [knowns, unknowns] } else { [unknowns, knowns] }.map(size);
    let counted = |values: Vec<f64>| {
        let count =
            (fmu.description.version() == Version::Three).then_some(Argument::Whole(values.len() as u64));
        [Some(Argument::of(&values)), count].into_iter().flatten()
    };
    let arguments: Vec<_> = references(unknowns)
        .into_iter()
        .chain(references(knowns))
        .chain(counted(vec![1.0; seeds]))
        .chain(counted(vec![0.0; results]))
        .collect();
    let (status, _) = instance.call(function, &arguments);
    let names = |variables: &[&FmuVariable]| {
        variables.iter().map(|variable| variable.name.clone()).collect::<Vec<_>>().join(", ")
    };
    assert_eq!(
        status,
        Status::Ok,
        "{} of {} by {} in {:?} of {:?}: {:?}",
        function.name,
        names(unknowns),
        names(knowns),
        instance.at.state,
        instance.instance_type,
        instance.messages()
    );
    let position = if fmu.description.version() == Version::Three { 6 } else { 5 };
    let Argument::Memory(memory) = &arguments[position] else { unreachable!() };
    memory.numbers()
}

/// The sums of the values of each variable.
fn sums(fmu: &Fmu, variables: &[&FmuVariable], values: &[f64]) -> Vec<f64> {
    let mut values = values.iter();
    variables.iter().map(|variable| values.by_ref().take(fmu.size(variable)).sum()).collect()
}

/// Walks through the entries of FMUs that have derivatives, and returns how many derivatives there are in each.
fn walk(fmus: &[Fmu]) -> Vec<usize> {
    let flag = |fmu: &Fmu| {
        if fmu.description.version() == Version::Three {
            "providesDirectionalDerivatives"
        } else {
            "providesDirectionalDerivative"
        }
    };
    let has_derivatives = |fmu: &Fmu| fmu.xml.contains(&format!("{}=\"true\"", flag(fmu)));
    let mut counts = vec![];
    for fmu in fmus.iter().filter(|fmu| has_derivatives(fmu)) {
        let mut count = 0;
        for (fmu, instance_type) in instances(std::slice::from_ref(fmu)) {
            for state in STATES {
                let Some(mut instance) = Instance::in_state(fmu, instance_type, state) else { continue };
                let forwards = fmu.function("GetDirectionalDerivative");
                let backwards = fmu.functions.iter().find(|f| f.name.ends_with("GetAdjointDerivative"));
                let backwards = backwards.copied().filter(|function| instance.allows(function));
                if !instance.allows(forwards) {
                    continue;
                }
                let unknowns = unknowns(fmu, state == State::InitializationMode);
                let rows: Vec<_> = unknowns.iter().map(|unknown| unknown.variable).collect();
                let knowns: BTreeSet<_> = unknowns
                    .iter()
                    .flat_map(|unknown| unknown.dependencies.iter().map(|known| &known.name[..]))
                    .collect();
                let knowns: Vec<_> =
                    knowns.into_iter().map(|name| fmu.description.variable(name).unwrap()).collect();
                let columns: Vec<_> = knowns
                    .iter()
                    .map(|known| sums(fmu, &rows, &derivatives(&mut instance, forwards, [&rows, &[known]])))
                    .collect();
                for (row, unknown) in unknowns.iter().enumerate() {
                    let dependencies = &unknown.dependencies;
                    let told = |known: &FmuVariable| {
                        format!(
                            "{} by {} in {state:?} of {instance_type:?} of {}",
                            unknown.variable.name,
                            known.name,
                            fmu.description.attribute("modelName")
                        )
                    };
                    let mut listed = vec![];
                    for (known, column) in knowns.iter().zip(&columns) {
                        if dependencies.iter().any(|dependency| dependency.name == known.name) {
                            listed.push((*known, column[row]));
                        } else if state != State::InitializationMode {
                            // A solution of the start's equations has what their iteration leaves.
                            assert!(column[row] == 0.0, "{} is {}", told(known), column[row]);
                        }
                    }
                    count += listed.len();
                    let Some(backwards) = backwards else { continue };
                    let knowns: Vec<_> = listed.iter().map(|(known, _)| *known).collect();
                    let found = derivatives(&mut instance, backwards, [&[unknown.variable], &knowns]);
                    if state == State::InitializationMode {
                        // The plant starts at rest: all derivatives of its rates are what rounding leaves.
                        continue;
                    }
                    let largest = listed.iter().map(|(_, value)| value.abs()).fold(0.0, f64::max);
                    for ((known, expected), found) in listed.iter().zip(sums(fmu, &knowns, &found)) {
                        let is_equal = (found - expected).abs() <= ROUNDING * largest;
                        assert!(is_equal, "{}: {expected} forwards, {found} backwards", told(known));
                    }
                }
            }
        }
        counts.push(count);
    }
    counts
}

fn open(paths: &[&str]) -> Vec<Fmu> {
    paths.iter().map(|path| Fmu::open(&Fmu::folder(), path)).collect()
}

#[test]
#[ignore = "of exported FMUs"]
fn what_the_test_models_list_has_derivatives() {
    let counts = walk(&Fmu::test_models().collect::<Vec<_>>());
    assert!(counts.len() == 2 && counts.iter().all(|count| *count > 0), "{counts:?}");
}

#[test]
#[ignore = "of exported FMUs"]
fn what_both_fmus_and_the_templates_list_has_derivatives() {
    let counts = walk(&open(&[
        "fmu/BoostPlant.fmu",
        "fmu/BoostController.fmu",
        "ladder/fmu/Dahlquist.fmu",
        "ladder/fmu/VanDerPol.fmu",
        "ladder/fmu/BouncingBall.fmu",
        "ladder/fmu/StickSlip.fmu",
        "ladder/fmu/Stair.fmu",
        "ladder/fmu/Feedthrough.fmu",
        "ladder/fmu/Resource.fmu",
        "ladder/fmu/NeuralLayer.fmu",
        "ladder/fmu/Furnace.fmu",
        "ladder/fmu/PiController.fmu",
        "ladder/fmu/Cascade.fmu",
        "ladder/fmu/Battery.fmu",
    ]));
    println!("{counts:?}");
    assert!(counts.len() == 8 && counts.iter().all(|count| *count > 0), "{counts:?}");
}

#[test]
#[ignore = "of FMUs that `bash tests/run rest` exports"]
fn what_those_of_fmi3_list_has_derivatives() {
    let counts = walk(&open(&[
        "both/fmi3/BoostPlant.fmu",
        "both/fmi3/BoostController.fmu",
        "ladder/fmu/fmi3/Dahlquist.fmu",
        "ladder/fmu/fmi3/VanDerPol.fmu",
        "ladder/fmu/fmi3/BouncingBall.fmu",
        "ladder/fmu/fmi3/StickSlip.fmu",
        "ladder/fmu/fmi3/NeuralLayer.fmu",
        "ladder/fmu/fmi3/Furnace.fmu",
        "ladder/fmu/fmi3/Battery.fmu",
        "ladder-fmi3/fmu/fmi3/StateSpace.fmu",
        "ladder-fmi3/fmu/fmi3/Diffusion.fmu",
    ]));
    println!("{counts:?}");
    assert!(counts.len() == 10 && counts.iter().all(|count| *count > 0), "{counts:?}");
}
