//! Random importers: any function in any order with any arguments, and any bytes for a state.
//!
//! Invariants (see [`importer`] for those of single calls):
//!
//! - a function that the standard's table does not allow in a state is an error, and changes nothing;
//! - values returned with success are finite;
//! - a restored state continues identically, in the instance and in another;
//! - after `fmi2Reset` an instance equals a new one, bit for bit;
//! - damaged serialized states are refused.
//!
//! The tests try the same cases each time. For other and more cases:
//! `PROPTEST_CASES=20000 cargo test --release --test fuzz`.

use std::cell::Cell;
use std::env;

use boost_fmu::controller::BoostController;
use boost_fmu::plant::BoostPlant;
use fmu_export::fmi2::c_types::Status;
use fmu_export::{Integrated, Model, Variables as _};
use fmu_export_equations::test_model::TestModel;
use fmu_export_equations::{BouncingBall, Stairs};
use proptest::prelude::*;
use proptest::test_runner::{RngSeed, TestRunner};

mod addresses;
mod calls;
mod importer;
mod standard;

use calls::{Call, Damage, Number, Type};
use importer::{Functions, Importer, Interface};

/// So many cases, always the same, unless the environment sets another number.
fn runner(cases: u32) -> TestRunner {
    let mut config = ProptestConfig { failure_persistence: None, ..ProptestConfig::default() };
    if env::var_os("PROPTEST_CASES").is_none() {
        config.cases = cases;
        config.rng_seed = RngSeed::Fixed(2011);
    }
    TestRunner::new(config)
}

/// Random calls, after an opening that makes steps likely, of each interface that the model has.
fn any_order<M: Model>(cases: u32, functions: Functions, before: &[Call]) {
    any_order_of::<M>(Interface::CoSimulation, cases, functions, before);
    if M::Variables::DESCRIPTION.interfaces.model_exchange {
        any_order_of::<M>(Interface::ModelExchange, cases, functions, before);
    }
}

fn any_order_of<M: Model>(interface: Interface, cases: u32, functions: Functions, before: &[Call]) {
    let fresh = Importer::<M>::new(interface, functions).snapshot();
    let (sequences, made) = (Cell::new(0), Cell::new(0));
    let strategy = (
        calls::settings::<M::Variables>(),
        any::<proptest::sample::Index>(),
        proptest::collection::vec(calls::any_call::<M::Variables>(), 0..40),
        proptest::collection::vec(calls::without_states::<M::Variables>(), 0..20),
    );
    // One in five importers starts at once, the others after a part of the opening.
    let outcome = runner(cases).run(&strategy, |(settings, skipped, head, tail)| {
        let mut importer = Importer::<M>::new(interface, functions);
        let opening = opening(interface, before);
        let opened = opening.len() - skipped.index(opening.len() * 5 / 4).saturating_sub(opening.len());
        importer.run(settings.iter().chain(opening.iter().take(opened)).chain(&head))?;
        let saved = importer.snapshot();
        let expected = importer.run(&tail)?;

        importer.restore(&saved)?;
        prop_assert!(importer.snapshot() == saved, "a restored state has other bytes");
        prop_assert_eq!(&importer.run(&tail)?, &expected, "the restored instance goes on");
        let mut other = Importer::<M>::new(interface, functions);
        other.restore(&saved)?;
        prop_assert_eq!(&other.run(&tail)?, &expected, "another instance goes on");

        importer.run(&[Call::Reset])?;
        prop_assert!(importer.snapshot() == fresh, "fmi2Reset leaves something behind");
        sequences.set(sequences.get() + 1);
        made.set(made.get() + importer.calls + other.calls);
        Ok(())
    });
    outcome.unwrap_or_else(|failure| panic!("{failure}"));
    let name = M::Variables::DESCRIPTION.model_identifier;
    println!("{name}, {interface:?}: {} sequences, {} calls", sequences.get(), made.get());
}

/// The value reference of a variable.
fn reference<M: Model>(name: &str) -> u32 {
    M::Variables::described().find(|(_, variable)| variable.name == name).unwrap().0
}

/// The opening.
fn opening(interface: Interface, before: &[Call]) -> Vec<Call> {
    let mut calls = before.to_vec();
    calls.extend([
        Call::SetupExperiment { tolerance: None, start_time: 0.0, stop_time: None },
        Call::EnterInitializationMode,
        Call::ExitInitializationMode,
    ]);
    match interface {
        Interface::CoSimulation => calls.push(Call::DoStep { late: 0.0, size: 0.0125 }),
        Interface::ModelExchange => calls.extend([Call::HaveEvent, Call::Integrate(0.0125)]),
    }
    calls
}

#[test]
fn the_plant_survives_calls_in_any_order() {
    // A running start: with random parameters and inputs, the search for a settled start is long and mostly fails.
    let mode = reference::<BoostPlant>("initialization.mode");
    let running = Call::Set(Type::Integer, vec![(mode, Number::Special(2.0))]);
    any_order::<BoostPlant>(400, Functions::both::<BoostPlant>(), &[running]);
}

#[test]
fn the_controller_survives_calls_in_any_order() {
    any_order::<BoostController>(1000, Functions::both::<BoostController>(), &[]);
}

#[test]
fn the_test_model_survives_calls_in_any_order() {
    let period = reference::<TestModel>("events.period");
    let ticks = Call::Set(Type::Real, vec![(period, Number::Special(0.0625))]);
    any_order::<TestModel>(1000, Functions::both::<TestModel>(), &[ticks]);
}

#[test]
fn models_of_equations_survive_calls_in_any_order() {
    type Ball = Integrated<BouncingBall>;
    type Steps = Integrated<Stairs>;
    any_order::<Ball>(200, Functions::both::<Ball>(), &[]);
    any_order::<Steps>(200, Functions::both::<Steps>(), &[]);
}

/// Any bytes as a serialized state.
fn any_bytes<M: Model>(cases: u32) {
    let description = M::Variables::DESCRIPTION;
    let interface = Interface::CoSimulation;
    let mut importer = Importer::<M>::new(interface, Functions::co_simulation::<M>());
    importer.run(&opening(interface, &[])).unwrap();
    let sound = importer.snapshot();
    let tried = Cell::new(0);
    let strategy = (proptest::collection::vec(any::<Damage>(), 0..6), any::<bool>());
    let outcome = runner(cases).run(&strategy, |(damages, with_checksum)| {
        let mut bytes = damages.iter().fold(sound.bytes.clone(), |bytes, damage| damage.done_to(bytes));
        if with_checksum {
            standard::put_checksum(&mut bytes);
        }
        tried.set(tried.get() + 1);
        match importer.deserialize(&bytes) {
            // Damaged bytes with a valid checksum may be accepted, and must not change.
            Ok(again) => {
                prop_assert!(with_checksum || bytes == sound.bytes, "damaged bytes are taken");
                prop_assert!(again == bytes, "the bytes of the state differ");
            }
            Err(status) => prop_assert_eq!(status, Status::Error),
        }
        prop_assert!(importer.snapshot() == sound, "the instance has changed");
        Ok(())
    });
    outcome.unwrap_or_else(|failure| panic!("{failure}"));
    println!("{}: {} serialized states", description.model_identifier, tried.get());
}

#[test]
fn the_plant_refuses_damaged_states() {
    any_bytes::<BoostPlant>(5000);
}

#[test]
fn the_controller_refuses_damaged_states() {
    any_bytes::<BoostController>(5000);
}
