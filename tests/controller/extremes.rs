//! Any consistent parameters and any inputs within their ranges give finite values and outputs within their ranges.

use std::thread;

use boost_fmu::BoostController;
use boost_fmu::controller::variables::{Inputs, Variables};
use fmu_export::description::{Causality, DataType, ScalarVariable};
use fmu_export::{Accessed as _, Described as _, Inputs as _, Model as _};

use crate::bench::Bench;
use crate::random::Random;

/// A bound or something between, small values as likely as large ones.
fn value_within(random: &mut Random, least: f64, most: f64) -> f64 {
    let between = match random.between(0.0, 4.0) {
        choice if choice < 1.0 => least,
        choice if choice < 2.0 => most,
        choice if choice < 3.0 && least > 0.0 => least * (most / least).powf(random.between(0.0, 1.0)),
        _ => random.between(least, most),
    };
    between.clamp(least, most)
}

/// Random parameters that pass the check; the schedule's grid and signs of gains stay.
fn parameters(random: &mut Random) -> Variables {
    loop {
        let mut variables = Variables::default();
        for (reference, variable) in Variables::described() {
            let name = variable.name().to_string();
            if variable.causality != Causality::Parameter || random.between(0.0, 1.0) < 0.5 {
                continue;
            }
            match variable.data_type {
                DataType::Real if name.contains("schedule.gain") => {
                    variables.set_real(reference, -value_within(random, 1e-3, variable.max));
                }
                DataType::Real
                    if !["schedule.engine_speed", "schedule.boost_reference"]
                        .iter()
                        .any(|grid| name.contains(grid)) =>
                {
                    variables.set_real(reference, value_within(random, variable.min, variable.max));
                }
                DataType::Boolean => variables.set_boolean(reference, random.between(0.0, 1.0) < 0.5),
                // Mostly mode boost, where most can go wrong.
                DataType::Enumeration => {
                    let items = if variable.name() == "mode" { 3 } else { 2 };
                    let item = (1..items).find(|_| random.between(0.0, 1.0) < 0.7).unwrap_or(items);
                    variables.set_integer(reference, item);
                }
                _ => {}
            }
        }
        if BoostController::check_parameters(&variables).is_ok() {
            return variables;
        }
    }
}

/// Random controllers, and for each so many samples of random inputs.
const CONTROLLERS: u32 = 125;
const SAMPLES: u32 = 500;

#[test]
fn all_allowed_values_give_finite_outputs() {
    // It takes the longest of the controller's tests, so that it keeps several cores busy.
    thread::scope(|scope| {
        for seed in 99..103 {
            scope.spawn(move || outputs_are_finite(&mut Random(seed)));
        }
    });
}

fn outputs_are_finite(random: &mut Random) {
    let driven: Vec<_> =
        Variables::described().filter_map(|(_, variable)| Some((variable.real_input()?, variable))).collect();
    let is_checked = |variable: &ScalarVariable| {
        matches!(variable.causality, Causality::Output | Causality::Local)
            && variable.data_type == DataType::Real
    };
    let checked: Vec<_> = Variables::described().filter(|(_, variable)| is_checked(variable)).collect();
    for _ in 0..CONTROLLERS {
        let variables = parameters(random);
        let mut bench = Bench::new(&Inputs::default(), |_| {});
        bench.variables = variables;
        bench.initialize(&Inputs::default());
        let mut inputs = Inputs::default();
        for number in 0..SAMPLES {
            for (position, variable) in &driven {
                if random.between(0.0, 1.0) < 0.1 {
                    inputs.set_real(*position, value_within(random, variable.min, variable.max));
                }
            }
            bench.sample(number, &inputs);
            for (reference, variable) in &checked {
                let value = bench.variables.real(*reference);
                assert!(
                    value.is_finite() && (variable.min..=variable.max).contains(&value),
                    "{} is {value} with {:?} at {inputs:?}",
                    variable.name(),
                    bench.variables.parameters
                );
            }
        }
    }
}
