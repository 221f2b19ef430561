//! The firmware with a parameter set in its reference page computes what the same task computes here.

use std::fmt::Arguments;
use std::fs;
use std::path::Path;

use BoostControllerInTheLoop::ecu::Ecu;
use boost_fmu::controller::ControlLaw;
use boost_fmu::controller::variables::{FeedbackStructure, Strategy, Variables};
use fmu_export::persistence::Archive;
use fmu_export::{Context, Experiment, Persistent as _, Task, calibration};

/// The results as the firmware archives them.
fn archived(variables: &mut Variables) -> Vec<u8> {
    let mut archive = Archive::writing();
    variables.outputs.persist(&mut archive).unwrap();
    variables.locals.persist(&mut archive).unwrap();
    archive.into_bytes()
}

#[test]
fn the_reference_page_has_the_parameter_set() {
    // `paper_structure` is compiled with the set of that name, beside the firmware's folder.
    let folder = Path::new(env!("ECU_IMAGE")).ancestors().nth(3).unwrap();
    let image = fs::read(folder.join("paper_structure")).unwrap();
    let mut ecu = Ecu::start_with(&image, 0, &[]).unwrap();
    let mut log = |_: &'static str, _: Arguments<'_>| {};
    let mut context = Context::new(Experiment::default(), &mut log);
    let mut task = Task::<ControlLaw>::default();
    let parameters = &mut task.variables.parameters;
    (parameters.structure, parameters.strategy) = (FeedbackStructure::Paper, Strategy::BySpeed);
    for number in 0..200 {
        let inputs = &mut task.variables.inputs;
        inputs.engine_speed = 1500.0 + 5.0 * f64::from(number);
        inputs.boost_pressure = 120e3 + 100.0 * f64::from(number % 30);
        inputs.boost_reference = 150e3;
        let mut cells = calibration::inputs(&task.variables).collect::<Vec<_>>().into_iter();
        if number == 0 {
            ecu.initialize(&mut cells).unwrap();
            task.initialize(&mut |_: &'static str, _: Arguments<'_>| {}).unwrap();
        } else {
            ecu.sample(&mut cells).unwrap();
            task.sample(&mut |_: &'static str, _: Arguments<'_>| {}).unwrap();
        }
        assert_eq!(ecu.answer(&mut context).unwrap(), archived(&mut task.variables), "{number}");
    }
}
