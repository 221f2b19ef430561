//! The Rust that is generated for the vessels, a model with one of everything (crates/fmu-export-build/tests/generator).

// Values are handed through, not computed: they are equal, not close.
#![allow(clippy::float_cmp)]

use fmu_export::description::{Causality, DataType, Variability};
use fmu_export::{Accessed as _, Described as _, Inputs as _};
use fmu_export_equations::vessels::{
    FillMode, Inputs, Parameters, SparePartsStates, StateGroups, States, StoresStates, Variables,
    VesselStates,
};

#[test]
fn structs_start_with_the_start_values() {
    let variables = Variables::default();
    let parameters = &variables.parameters;
    assert_eq!([parameters.first.area, parameters.second.area], [0.5, 0.75]);
    assert_eq!(parameters.settings.mode, FillMode::HalfFull);
    assert_eq!(parameters.settings.label, "a <b>");
    assert_eq!(parameters.settings.table, [[1.0, 2.0], [3.0, 4.0]]);
    assert_eq!(*parameters, Parameters::default());
    assert!(variables.inputs().enabled);
    assert_eq!(variables.states.to_array(), [1e-5, 1e-5, 3.0]);
    assert_eq!(States::NAMES, ["first.mass", "second.mass", "settings.reserve"]);
    let states = States::from_array([1.0, 2.0, 3.0]);
    assert_eq!(states.second, VesselStates { mass: 2.0 });
    assert_eq!(states.to_array(), [1.0, 2.0, 3.0]);
}

#[test]
fn groups_of_states_are_converted_by_name() {
    let states = States::from_array([1.0, 2.0, 3.0]);
    let (stores, spare_parts) = (StoresStates::of(&states), SparePartsStates::of(&states));
    assert_eq!([stores.first.mass, stores.second.mass, spare_parts.settings.reserve], [1.0, 2.0, 3.0]);
    assert_eq!((StoresStates::NAMES, StoresStates::COUNT), (["first.mass", "second.mass"], 2));
    assert_eq!((stores.to_array(), StoresStates::from_array([1.0, 2.0])), ([1.0, 2.0], stores));
    assert_eq!(States::from_groups(StateGroups { stores, spare_parts }), states);
    assert_eq!(StoresStates::default().to_array(), [1e-5; 2]);
    // The masses declare a least value, the reserve a nominal one.
    assert_eq!((StoresStates::MIN.to_array(), StoresStates::NOMINAL.to_array()), ([0.0; 2], [1.0; 2]));
    let (least, nominal) = (SparePartsStates::MIN.to_array(), SparePartsStates::NOMINAL.to_array());
    assert_eq!((least, nominal), ([f64::NEG_INFINITY], [4.0]));
}

#[test]
fn accessors_reach_the_fields() {
    let mut variables = Variables::default();
    // settings.table[2,1]
    variables.set_real(18, 7.0);
    assert_eq!(variables.parameters.settings.table, [[1.0, 2.0], [7.0, 4.0]]);
    assert_eq!(variables.real(18), 7.0);
    // A state is set where it starts and read where it is.
    variables.set_real(7, 5.0);
    assert_eq!(
        [variables.start.first.mass, variables.states.first.mass, variables.real(7)],
        [5.0, 1e-5, 1e-5]
    );
    variables.states_from_start();
    assert_eq!((variables.real(7), variables.states), (5.0, variables.start));
    variables.derivatives.first.mass = 8.0;
    assert_eq!(variables.real(8), 8.0);
    variables.set_integer(14, 1);
    assert_eq!((variables.parameters.settings.mode, variables.integer(14)), (FillMode::Empty, 1));
    variables.set_integer(14, 3);
    assert_eq!(variables.parameters.settings.mode, FillMode::Empty);
    variables.set_boolean(2, false);
    assert!(!variables.boolean(2) && !variables.inputs().enabled);
    variables.set_string(15, "other");
    assert_eq!(variables.string(15), "other");
    // Outputs are not set, and other types' references do nothing.
    variables.set_real(3, 1.0);
    variables.set_real(14, 1.0);
    assert_eq!([variables.outputs.level, variables.real(14), variables.real(99)], [0.0; 3]);

    let mut inputs = *variables.inputs();
    inputs.set_real(0, 2.5);
    assert_eq!([inputs.inflow, inputs.real(0)], [2.5, 2.5]);
    let bounds: Vec<_> = Inputs::REALS.iter().map(|input| [input.min, input.max]).collect();
    assert_eq!(bounds, [[0.0, 10.0]]);
}

#[test]
fn first_non_finite_names_states_derivatives_and_outputs() {
    let mut variables = Variables::default();
    variables.locals.first.outflow = f64::NAN;
    assert_eq!(variables.first_non_finite(), None);
    variables.outputs.drain = f64::NAN;
    assert_eq!(variables.first_non_finite(), Some(4));
    variables.derivatives.second.mass = f64::NAN;
    assert_eq!(variables.first_non_finite(), Some(12));
    variables.states.second.mass = f64::INFINITY;
    assert_eq!(variables.first_non_finite(), Some(11));
    // All are finite here, though their sum is not.
    let mut variables = Variables::default();
    (variables.states.first.mass, variables.states.second.mass) = (f64::MAX, -f64::MAX);
    assert_eq!(variables.first_non_finite(), None);
}

#[test]
fn tables_agree_with_the_xml() {
    let description = Variables::DESCRIPTION;
    assert_eq!(description.model_identifier, "Vessels");
    assert_eq!(description.log_categories, ["logStatusError", "logStatusWarning", "logEvents"]);
    assert!(description.capabilities.interpolate_inputs && description.capabilities.get_and_set_state);
    assert_eq!(Variables::described().count(), 23);
    for (reference, variable) in Variables::described() {
        let text = format!(r#"<ScalarVariable name="{}" valueReference="{reference}""#, variable.name());
        assert!(Variables::MODEL_DESCRIPTION_XML.contains(&text), "{text}");
    }
    let inflow = Variables::description(1).unwrap();
    assert_eq!(
        (inflow.data_type, inflow.causality, inflow.variability, inflow.initial, inflow.real_input()),
        (DataType::Real, Causality::Input, Variability::Continuous, None, Some(0))
    );
    let mode = Variables::description(14).unwrap();
    assert_eq!((mode.data_type, mode.min, mode.max), (DataType::Enumeration, 1.0, 2.0));
    let level = Variables::description(3).unwrap();
    assert_eq!((level.min, level.max), (f64::NEG_INFINITY, f64::INFINITY));
}

#[test]
fn the_runtime_is_told_event_indicators_and_states() {
    assert_eq!(Variables::EVENT_INDICATORS, ["first_is_empty", "second.is_empty"]);
    let states =
        Variables::described().filter_map(|(_, variable)| Some((variable.state()?, variable.name())));
    let mut states: Vec<_> = states.collect();
    states.sort_unstable_by_key(|(position, _)| *position);
    assert!(states.iter().map(|(position, _)| *position).eq(0..Variables::STATE_NOMINALS.len()));
    for (position, name) in states {
        assert_eq!(name, States::NAMES[position]);
        assert_eq!(name, Variables::state_name(position));
    }
}
