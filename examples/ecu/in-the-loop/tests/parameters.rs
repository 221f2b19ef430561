//! The firmware in single precision, with a parameter set in its reference page, computes what the same task computes here.

use std::fmt::Arguments;
use std::fs;
use std::path::Path;

use BoostControllerInTheLoop::ecu::Ecu;
use boost_fmu::controller::ControlLaw;
use boost_fmu::controller::variables::{FeedbackStructure, Real, Strategy, Variables};
use fmu_export::persistence::Archive;
use fmu_export::{Context, Experiment, Persistent as _, Task, calibration};

/// The results as the firmware archives them.
fn archived(variables: &mut Variables) -> Vec<u8> {
    let mut archive = Archive::writing();
    variables.outputs.persist(&mut archive).unwrap();
    variables.locals.persist(&mut archive).unwrap();
    archive.into_bytes()
}

/// Drives firmware and task through 200 samples, of which each gives the same bits: of a library's functions the law calls here
/// only roots, which are exact.
fn assert_same(ecu: &mut Ecu, task: &mut Task<ControlLaw>) {
    for number in 0..200 {
        assert_same_sample(ecu, task, number);
    }
}

/// The next sample, or the initialization before the first one.
fn assert_same_sample(ecu: &mut Ecu, task: &mut Task<ControlLaw>, number: u8) {
    let mut log = |_: &'static str, message: Arguments<'_>| {
        assert!(!message.to_string().contains("stay as they were"), "{message}");
    };
    let inputs = &mut task.variables.inputs;
    inputs.engine_speed = 1500.0 + 5.0 * Real::from(number);
    inputs.boost_pressure = 120e3 + 100.0 * Real::from(number % 30);
    inputs.boost_reference = 150e3;
    (inputs.ambient_pressure, inputs.ambient_temperature) = (85e3, 313.15);
    let mut cells = calibration::inputs(&task.variables).collect::<Vec<_>>().into_iter();
    if number == 0 {
        ecu.initialize(&mut cells).unwrap();
        task.initialize(&mut log).unwrap();
    } else {
        ecu.sample(&mut cells).unwrap();
        task.sample(&mut log).unwrap();
    }
    let answer = ecu.answer(&mut Context::new(Experiment::default(), &mut log)).unwrap();
    assert_eq!(answer, archived(&mut task.variables), "{number}");
}

#[test]
#[ignore = "FMU_PRECISION must be single"]
fn a_compiled_set_and_a_page_give_what_the_task_gives() {
    // It is compiled with the set of that name, and in single precision, beside the firmware's folder.
    let folder = Path::new(env!("ECU_IMAGE")).ancestors().nth(3).unwrap();
    let image = fs::read(folder.join("paper_structure_single")).unwrap();
    let mut ecu = Ecu::start_with(&image, 0, &[]).unwrap();
    let mut task = Task::<ControlLaw>::default();
    let parameters = &mut task.variables.parameters;
    (parameters.structure, parameters.strategy) = (FeedbackStructure::Paper, Strategy::BySpeed);
    assert_same(&mut ecu, &mut task);
    let mut task = Task::<ControlLaw>::default();
    ecu.write_page(&calibration::page(&task.variables).collect::<Vec<_>>()).unwrap();
    assert_same(&mut ecu, &mut task);
    // A tool's page has doubles: a fixed parameter that rounds to what it is has not changed.
    let page = calibration::page(&task.variables);
    let period = f64::from(0.0125_f32).to_bits();
    let cells: Vec<_> = page.map(|cell| if cell == period { 0.0125_f64.to_bits() } else { cell }).collect();
    assert!(cells.contains(&0.0125_f64.to_bits()));
    task.take_page(&cells).unwrap();
    ecu.write_page(&cells).unwrap();
    assert_same_sample(&mut ecu, &mut task, 200);
}
