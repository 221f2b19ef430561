//! The Rust that is generated for components in components.

// Values are handed through, not computed: they are equal, not close.
#![allow(clippy::float_cmp)]

use fmu_export::{Accessed as _, Described as _};
use fmu_export_equations::nested::{
    RoomSouthStates, RoomStates, SpareStates, StateGroups, States, ThermalStates, Variables, WallStates,
};

/// Of two rooms, each its pressure and three walls.
const NAMES: [&str; 9] = [
    "tank.x",
    "house.hall.pressure",
    "house.hall.north.temperature",
    "house.hall.south.outside.temperature",
    "house.hall.south.inside.temperature",
    "house.attic.pressure",
    "house.attic.north.temperature",
    "house.attic.south.outside.temperature",
    "house.attic.south.inside.temperature",
];

#[test]
fn start_values_are_those_of_the_outermost_component_that_has_them() {
    let variables = Variables::default();
    assert_eq!(States::NAMES, NAMES);
    assert_eq!(variables.states.to_array(), [7.0, 1e5, 300.0, 270.0, 300.0, 1e5, 300.0, 280.0, 300.0]);
    let areas = |room: &fmu_export_equations::nested::RoomParameters| {
        [room.north.area, room.south.outside.area, room.south.inside.area]
    };
    let house = &variables.parameters.house;
    assert_eq!([areas(&house.hall), areas(&house.attic)], [[1.0, 1.0, 4.0], [1.0; 3]]);
}

#[test]
fn states_are_converted_by_group_and_name() {
    let states = States::from_array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
    let wall = |temperature| WallStates { temperature };
    let attic = RoomStates {
        pressure: 6.0,
        north: wall(7.0),
        south: RoomSouthStates { outside: wall(8.0), inside: wall(9.0) },
    };
    assert_eq!(states.house.attic, attic);
    let (thermal, spare) = (ThermalStates::of(&states), SpareStates::of(&states));
    assert_eq!((thermal.house, spare.tank), (states.house, states.tank));
    assert_eq!((ThermalStates::COUNT, &ThermalStates::NAMES[..]), (8, &NAMES[1..]));
    assert_eq!(ThermalStates::from_array(thermal.to_array()), thermal);
    assert_eq!(States::from_groups(StateGroups { thermal, spare }), states);
    let room = |pressure, temperature| [pressure, temperature, temperature, temperature];
    let rooms = |room: [f64; 4]| [room, room].concat();
    assert_eq!(ThermalStates::NOMINAL.to_array().to_vec(), rooms(room(1.0, 300.0)));
    assert_eq!(ThermalStates::MIN.to_array().to_vec(), rooms(room(f64::NEG_INFINITY, 0.0)));
}

#[test]
fn value_references_lead_to_the_fields() {
    let mut variables = Variables::default();
    let xml = Variables::MODEL_DESCRIPTION_XML;
    let (_, rest) =
        xml.split_once("name=\"house.attic.south.inside.temperature\" valueReference=\"").unwrap();
    let reference = rest.split('"').next().unwrap().parse().unwrap();
    variables.set_real(reference, 5.0);
    assert_eq!(variables.start.house.attic.south.inside.temperature, 5.0);
    assert_eq!(variables.start.house.hall.south.inside.temperature, 300.0);
}
