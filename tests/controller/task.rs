//! The controller as a task, as firmware runs it: it computes what its FMU computes, and takes parameters from a page.

use boost_fmu::BoostController;
use boost_fmu::controller::ControlLaw;
use boost_fmu::controller::variables::{Inputs, Variables};
use fmu_export::calibration::{self, Cells, Follower, parameter_cells};
use fmu_export::{Simulation, Task};

use crate::random::Random;

const PARAMETERS: usize = parameter_cells::<Variables>();

fn log(_: &'static str, _: core::fmt::Arguments<'_>) {}

fn measured(random: &mut Random) -> Inputs {
    Inputs {
        boost_reference: random.between(110e3, 200e3),
        boost_pressure: random.between(-1e3, 250e3),
        tank_pressure: random.between(20e3, 110e3),
        supply_voltage_measured: random.between(-1.0, 20.0),
        engine_speed: random.between(800.0, 6000.0),
        ambient_pressure: random.between(80e3, 105e3),
        ..Inputs::default()
    }
}

/// The page of a task's parameters.
fn page(task: &Task<ControlLaw>) -> Vec<u64> {
    calibration::page(&task.variables).collect()
}

/// The cell of a parameter, found by changing it.
fn cell_of(change: impl Fn(&mut Variables)) -> usize {
    let before = Variables::default();
    let mut changed = before.clone();
    change(&mut changed);
    let mut cells = calibration::page(&before).zip(calibration::page(&changed));
    cells.position(|(before, after)| before != after).expect("the parameter has a cell")
}

/// Inputs beyond their bounds are limited in both.
#[test]
fn a_task_computes_what_the_fmu_computes() {
    let mut random = Random(11);
    let (mut task, mut simulation) =
        (Task::<ControlLaw>::default(), Simulation::<BoostController>::default());
    for number in 0..2000 {
        task.variables.inputs = measured(&mut random);
        simulation.variables.inputs = task.variables.inputs;
        if number == 0 {
            task.initialize(&mut log).unwrap();
            simulation.initialize().unwrap();
        }
        task.sample(&mut log).unwrap();
        simulation.step(simulation.variables.parameters.sample_time).unwrap();
        assert_eq!(task.variables.outputs, simulation.variables.outputs, "{number}");
        assert_eq!(task.variables.locals, simulation.variables.locals, "{number}");
    }
}

#[test]
fn a_page_has_each_parameter_and_gives_it_back() {
    let task = Task::<ControlLaw>::default();
    let start = page(&task);
    assert_eq!(start.len(), PARAMETERS);
    let cell = cell_of(|variables| variables.parameters.range_schedule.gain[15][11] *= 2.0);
    let mut changed = start.clone();
    changed[cell] = (-12_345.0_f64).to_bits();
    let mut task = task;
    task.take_page(&changed).unwrap();
    assert_eq!(task.variables.parameters.range_schedule.gain[15][11], -12_345.0);
    assert_eq!(page(&task), changed);
    // A tool may leave anything in the bytes that a Boolean has not.
    let cell = cell_of(|variables| variables.parameters.diagnosis.limp_home ^= true);
    let mut other = changed.clone();
    other[cell] |= 0xABCD_EF00;
    task.take_page(&other).unwrap();
    assert_eq!(page(&task), changed);
}

/// Whatever is refused, the parameters are those of before.
#[test]
fn a_page_is_taken_whole_or_not_at_all() {
    let cells = [
        cell_of(|variables| variables.parameters.range_schedule.gain[0][0] *= 2.0),
        cell_of(|variables| variables.parameters.pwm_min += 1.0),
        cell_of(|variables| variables.parameters.range_schedule.engine_speed[3] += 1.0),
        cell_of(|variables| variables.parameters.diagnosis.limp_home ^= true),
    ];
    let mut task = Task::<ControlLaw>::default();
    task.initialize(&mut log).unwrap();
    let before = page(&task);
    let refusals = [
        (cells[0], f64::NAN.to_bits(), "NaN for the variable range_schedule.gain[1,1]"),
        (
            cells[0],
            1e9_f64.to_bits(),
            "1000000000 for the variable range_schedule.gain[1,1] is outside its range",
        ),
        (cells[0], 0.0_f64.to_bits(), "range_schedule.gain[1,1]"),
        (cells[1], 100.0_f64.to_bits(), "pwm_min is 100 % and must be below pwm_max"),
        (cells[2], 2001.0_f64.to_bits(), "range_schedule.engine_speed[4] is fixed"),
        (cells[3], 2, "2 for the variable diagnosis.limp_home is neither 0 nor 1"),
    ];
    for (cell, bits, reason) in refusals {
        let mut page_of_tool = before.clone();
        page_of_tool[cells[0]] = (-9_999.0_f64).to_bits();
        page_of_tool[cell] = bits;
        let refusal = task.take_page(&page_of_tool).unwrap_err().to_string();
        assert!(refusal.contains(reason), "{refusal}");
        assert_eq!(page(&task), before, "{refusal}");
    }
    // Before a start, what is fixed may change, too.
    let mut next = Task::<ControlLaw>::default();
    let mut changed = before;
    changed[cells[2]] = 1800.0_f64.to_bits();
    next.take_page(&changed).unwrap();
    assert_eq!(next.variables.parameters.range_schedule.engine_speed[3], 1800.0);
}

#[test]
fn a_change_of_the_page_is_seen_once() {
    static PAGE: Cells<PARAMETERS> = Cells::new();
    let mut follower = Follower::new();
    assert!(follower.changed(&PAGE).is_none(), "it is all zeros at first");
    PAGE.set(PARAMETERS - 1, [7, 8].into_iter());
    assert_eq!(follower.changed(&PAGE).map(|page| page[PARAMETERS - 1]), Some(7));
    assert!(follower.changed(&PAGE).is_none());
}
