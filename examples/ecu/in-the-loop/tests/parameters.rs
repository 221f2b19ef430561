//! The firmware in single precision, with a parameter set in its reference page, computes what the same task computes here.

use std::fmt::Arguments;
use std::fs;
use std::ops::Range;
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

/// Drives firmware and task through samples with measurements at random, of which each gives the same bits: of a library's
/// functions the law calls here only roots, which are exact.
fn assert_same(ecu: &mut Ecu, task: &mut Task<ControlLaw>, samples: Range<u32>) {
    // Knuth's MMIX generator (The Art of Computer Programming, volume 2, section 3.3.4).
    let mut random = 7_u64;
    let mut between = |least: Real, most: Real| {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        least + (random >> 40) as Real / (1_u64 << 24) as Real * (most - least)
    };
    for number in samples {
        let mut log = |_: &'static str, message: Arguments<'_>| {
            assert!(!message.to_string().contains("stay as they were"), "{message}");
        };
        let inputs = &mut task.variables.inputs;
        if number % 50 == 0 {
            inputs.engine_speed = between(1000.0, 5500.0);
            inputs.boost_reference = between(110e3, 200e3);
            inputs.hp_turbo_speed = between(0.0, 220e3);
        }
        inputs.boost_pressure +=
            0.02 * (inputs.boost_reference - inputs.boost_pressure) + between(-100.0, 100.0);
        inputs.tank_pressure = between(25e3, 40e3);
        inputs.supply_voltage_measured = between(11.0, 14.0);
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
    assert_same(&mut ecu, &mut task, 0..600);
    let mut task = Task::<ControlLaw>::default();
    ecu.write_page(&calibration::page(&task.variables).collect::<Vec<_>>()).unwrap();
    assert_same(&mut ecu, &mut task, 0..600);
    // A tool's page has doubles: a fixed parameter that rounds to what it is has not changed.
    let page = calibration::page(&task.variables);
    let period = f64::from(0.0125_f32).to_bits();
    let cells: Vec<_> = page.map(|cell| if cell == period { 0.0125_f64.to_bits() } else { cell }).collect();
    assert!(cells.contains(&0.0125_f64.to_bits()));
    task.take_page(&cells).unwrap();
    ecu.write_page(&cells).unwrap();
    assert_same(&mut ecu, &mut task, 600..601);
}
