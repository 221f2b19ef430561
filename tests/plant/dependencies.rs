//! The dependencies in modelDescription.xml: at random points every known is changed, and the unknowns that change are
//! compared with the declaration.
//!
//! With a missing dependency importers solve algebraic loops wrongly; with one too many they see loops that do not
//! exist.

use std::collections::{BTreeMap, BTreeSet};

use boost_fmu::plant::BoostPlant;
use boost_fmu::plant::variables::{InitializationMode, States, Variables};
use fmu_export::description::{Causality, DataType, Initial, ValueReference};
use fmu_export::{Accessed as _, Context, Described as _, Experiment, Model};
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use crate::random::Random;

/// Unknowns with their dependencies.
pub type Dependencies = BTreeMap<ValueReference, BTreeSet<ValueReference>>;

/// The `ModelStructure`, by the name of the list.
pub fn declared() -> BTreeMap<String, Dependencies> {
    let mut structure: BTreeMap<String, Dependencies> = BTreeMap::new();
    let mut list = String::new();
    let mut reader = Reader::from_str(Variables::MODEL_DESCRIPTION_XML);
    loop {
        match reader.read_event().expect("well-formed XML") {
            Event::Start(element) => element.name().as_ref().clone_into(&mut list),
            Event::Empty(element) if element.name().as_ref() == "Unknown" => {
                let numbers = |name| -> Vec<ValueReference> {
                    let text = attribute(&element, name);
                    // Indices start at 1, value references at 0, in the same order.
                    text.split_whitespace().map(|word| word.parse::<u32>().expect("an index") - 1).collect()
                };
                let unknown = numbers("index")[0];
                structure
                    .entry(list.clone())
                    .or_default()
                    .insert(unknown, numbers("dependencies").into_iter().collect());
            }
            Event::Eof => return structure,
            _ => {}
        }
    }
}

fn attribute(element: &BytesStart<'_>, name: &str) -> String {
    let attribute =
        element.try_get_attribute(name).expect("well-formed XML").expect("the attribute is there");
    attribute.value.into_owned()
}

pub fn name(reference: ValueReference) -> String {
    Variables::description(reference).expect("the variable exists").name().to_string()
}

pub fn reference(wanted: &str) -> ValueReference {
    Variables::described().find(|(_, variable)| variable.name() == wanted).expect("the variable exists").0
}

/// The Real variables that a condition holds for.
pub fn reals(condition: impl Fn(ValueReference, Causality, Option<Initial>) -> bool) -> Vec<ValueReference> {
    Variables::described()
        .filter(|(reference, variable)| {
            variable.data_type == DataType::Real
                && condition(*reference, variable.causality, variable.initial)
        })
        .map(|(reference, _)| reference)
        .collect()
}

/// The values of the unknowns, after initialization from a point.
pub fn unknowns_at(point: &Variables, unknowns: &[ValueReference]) -> Vec<f64> {
    let mut variables = point.clone();
    let mut log = |_: &'static str, _: std::fmt::Arguments<'_>| {};
    let mut context = Context::new(Experiment::default(), &mut log);
    BoostPlant::default().initialize(&mut variables, &mut context).expect("there are values everywhere");
    unknowns.iter().map(|&unknown| variables.real(unknown)).collect()
}

/// A point inside the ranges, where every parameter that can have an effect has one.
pub fn random_point(random: &mut Random) -> Variables {
    let mut variables = Variables::default();
    let p = &mut variables.parameters;
    p.initialization.mode = InitializationMode::Given;
    p.pump.voltage_drop = 0.4;
    p.valve.voltage_exponent = 1.2;
    p.actuator.exhaust_area = 1e-4;
    p.actuator.friction_exponent = 1.3;
    // Of the faults, those that leave everything else its effect.
    p.fault.vacuum_leak_area = 2e-9;
    p.fault.boost_sensor_offset = -2e3;
    p.fault.supply_sensor_offset = 0.4;
    p.fault.wastegate_stuck_position = 0.3;
    p.fault.boost_sensor_stuck_pressure = 1.2e5;
    let shuffled = |known, causality| causality == Causality::Parameter && !name(known).starts_with("fault.");
    for known in reals(|known, causality, _| shuffled(known, causality)) {
        let value = variables.real(known);
        variables.set_real(known, value * random.between(0.98, 1.02));
    }
    for (name, least, most) in [
        ("hp_wastegate_pwm", 10.0, 90.0),
        ("vacuum_pump", 0.1, 0.9),
        ("lp_wastegate", 0.1, 0.9),
        ("hp_bypass", 0.1, 0.9),
        ("surge_valve", 0.1, 0.9),
        ("throttle", 0.1, 0.9),
        ("supply_voltage", 9.0, 12.0),
        ("engine_speed", 1000.0, 5000.0),
        ("ambient_pressure", 8e4, 1.09e5),
        ("ambient_temperature", 270.0, 310.0),
        ("supply_sensor.voltage", 10.0, 14.0),
        ("valve.plunger_duty", 5.0, 95.0),
        ("tank.pressure", 3e4, 1e5),
        ("actuator.chamber_pressure", 3e4, 1e5),
        ("actuator.position", -1e-4, 1.01e-2),
        ("actuator.velocity", -0.1, 0.1),
        ("actuator.friction_force", -0.15, 0.15),
        ("air_filter.pressure", 9e4, 1e5),
        ("lp_compressor.outlet_pressure", 1e5, 1.5e5),
        ("hp_compressor.outlet_pressure", 1e5, 2e5),
        ("intercooler.outlet_pressure", 1e5, 2e5),
        ("intake_manifold.pressure", 5e4, 2e5),
        ("exhaust_manifold.pressure", 1.1e5, 3e5),
        ("interstage_exhaust.pressure", 1.05e5, 2e5),
        ("exhaust.pressure", 9e4, 1.2e5),
        ("hp_shaft.speed", 3000.0, 2e4),
        ("lp_shaft.speed", 2000.0, 1e4),
    ] {
        variables.set_real(reference(name), random.between(least, most));
    }
    variables.states = variables.start;
    variables
}

/// A point with each of the faults that take its effect from something else.
pub fn stuck(point: &Variables) -> [Variables; 2] {
    let [mut wastegate, mut sensor] = [point.clone(), point.clone()];
    wastegate.parameters.fault.wastegate_stuck = true;
    sensor.parameters.fault.boost_sensor_stuck = true;
    [wastegate, sensor]
}

/// Adds to `observed` the unknowns that change by more than `threshold` (relative to their magnitude) when one of the
/// knowns changes slightly up or down.
fn observe(
    observed: &mut Dependencies,
    point: &Variables,
    knowns: &[ValueReference],
    step: f64,
    threshold: f64,
) {
    let unknowns: Vec<_> = observed.keys().copied().collect();
    let base = unknowns_at(point, &unknowns);
    for &known in knowns {
        for sign in [-1.0, 1.0] {
            let mut moved = point.clone();
            let value = point.real(known);
            moved.set_real(known, value + sign * step * value.abs().max(1e-6));
            let there = unknowns_at(&moved, &unknowns);
            for ((unknown, here), there) in unknowns.iter().zip(&base).zip(there) {
                if (there - here).abs() > threshold * here.abs().max(1e-3) {
                    observed.get_mut(unknown).expect("a declared unknown").insert(known);
                }
            }
        }
    }
}

/// The declared dependencies of outputs and derivatives.
pub fn declared_of_steps() -> Dependencies {
    let structure = declared();
    structure["Outputs"].clone().into_iter().chain(structure["Derivatives"].clone()).collect()
}

/// The declared dependencies of the initialization on Real knowns: others cannot be changed slightly.
pub fn declared_of_initialization(knowns: &[ValueReference]) -> Dependencies {
    let mut declared = declared()["InitialUnknowns"].clone();
    for dependencies in declared.values_mut() {
        dependencies.retain(|known| knowns.contains(known));
    }
    declared
}

/// The same unknowns without dependencies.
pub fn nothing_observed(declared: &Dependencies) -> Dependencies {
    declared.keys().map(|&unknown| (unknown, BTreeSet::new())).collect()
}

/// Asserts that the observed dependencies are the declared ones. Derivatives may depend on less in initialization:
/// those of a settled start are declared to depend on everything that the start depends on, because without a steady
/// state they are not zero.
pub fn assert_as_declared(declared: &Dependencies, observed: &Dependencies, is_initialization: bool) {
    let differences = |from: &Dependencies, without: &Dependencies| -> Vec<String> {
        let reads = |(unknown, knowns): (&ValueReference, &BTreeSet<ValueReference>)| {
            let missing: Vec<_> = knowns.difference(&without[unknown]).map(|&known| name(known)).collect();
            (!missing.is_empty()).then(|| format!("{} on {}", name(*unknown), missing.join(", ")))
        };
        from.iter().filter_map(reads).collect()
    };
    let missing = differences(observed, declared);
    assert!(missing.is_empty(), "undeclared: {missing:#?}");
    let mut superfluous = differences(declared, observed);
    superfluous.retain(|text| !(is_initialization && text.starts_with("der(")));
    assert!(superfluous.is_empty(), "declared without effect: {superfluous:#?}");
}

#[test]
fn outputs_and_derivatives_depend_on_what_is_declared_and_on_nothing_else() {
    let declared = declared_of_steps();
    assert_eq!(declared.len(), 14 + States::COUNT);
    let knowns: Vec<_> = reals(|reference, causality, _| {
        causality == Causality::Input || States::NAMES.contains(&name(reference).as_str())
    });
    let mut observed = nothing_observed(&declared);
    let mut random = Random(7);
    for _ in 0..40 {
        // Without a solver, independent values stay equal to the last bit.
        observe(&mut observed, &random_point(&mut random), &knowns, 1e-4, 0.0);
    }
    assert_as_declared(&declared, &observed, false);
}

#[test]
fn what_the_controller_reads_depends_on_no_input() {
    for output in ["boost_pressure", "tank_pressure", "supply_voltage_measured"] {
        let dependencies = &declared()["Outputs"][&reference(output)];
        let states: Vec<_> = dependencies.iter().map(|&known| name(known)).collect();
        assert!(
            states.len() == 1 && States::NAMES.contains(&states[0].as_str()),
            "{output} depends on {states:?}"
        );
    }
}

#[test]
fn initialization_depends_on_what_is_declared() {
    let knowns: Vec<_> =
        reals(|_, causality, initial| causality == Causality::Input || initial == Some(Initial::Exact));
    let declared = declared_of_initialization(&knowns);
    let mut observed = nothing_observed(&declared);
    let mut random = Random(11);
    for _ in 0..30 {
        let mut point = random_point(&mut random);
        observe(&mut observed, &point, &knowns, 1e-4, 0.0);
        for point in stuck(&point) {
            observe(&mut observed, &point, &knowns, 1e-4, 0.0);
        }
        point.parameters.initialization.mode = InitializationMode::Running;
        observe(&mut observed, &point, &knowns, 1e-4, 0.0);
    }
    // The steady state is accurate to rounding, some 1e-13, so changes below 1e-11 are no dependence. The settled
    // derivatives are 0 up to rounding, and are not compared.
    let states_and_outputs = observed.keys().filter(|&&unknown| !name(unknown).starts_with("der("));
    let mut solved: Dependencies = states_and_outputs.map(|&unknown| (unknown, BTreeSet::new())).collect();
    // In the middle of the stroke, at either stop, and where the tank limits the vacuum in the chamber.
    for (duty, tank_pressure) in [(45.0, 3e4), (40.0, 3.2e4), (15.0, 3.1e4), (90.0, 3e4), (90.0, 7.5e4)] {
        let mut point = random_point(&mut random);
        point.parameters.initialization.mode = InitializationMode::Settled;
        point.set_real(reference("hp_wastegate_pwm"), duty);
        point.start.tank.pressure = tank_pressure;
        point.states.tank.pressure = tank_pressure;
        observe(&mut solved, &point, &knowns, 1e-2, 1e-11);
        for point in stuck(&point) {
            observe(&mut solved, &point, &knowns, 1e-2, 1e-11);
        }
    }
    for (unknown, knowns) in solved {
        observed.get_mut(&unknown).expect("a declared unknown").extend(knowns);
    }
    assert_as_declared(&declared, &observed, true);
}
