//! The exact derivatives against difference quotients, and their zeros against the declared dependencies.

use boost_fmu::plant::BoostPlant;
use boost_fmu::plant::variables::{InitializationMode, States, Variables};
use fmu_export::description::{Causality, Initial, ValueReference};
use fmu_export::{Accessed as _, Context, Dual, Experiment, Model, Numbered as _, Tape};

use crate::dependencies::{
    Dependencies, assert_as_declared, declared_of_initialization, declared_of_steps, name, nothing_observed,
    random_point, reals, reference, stuck, unknowns_at,
};
use crate::random::Random;

/// The largest relative difference between quotients of different widths.
const AGREEMENT: f64 = 1e-4;

/// A plant initialized at a point.
fn initialized(point: &Variables) -> (BoostPlant, Variables) {
    let (mut model, mut variables) = (BoostPlant::default(), point.clone());
    let mut log = |_: &'static str, _: std::fmt::Arguments<'_>| {};
    let mut context = Context::new(Experiment::default(), &mut log);
    model.initialize(&mut variables, &mut context).expect("there are values everywhere");
    (model, variables)
}

/// The derivatives with respect to one known, of the initialization or of the steps.
fn derivatives(point: &Variables, known: ValueReference, of_initialization: bool) -> Variables {
    let (model, variables) = initialized(point);
    let mut direction = Variables::zero();
    direction.set_real(known, 1.0);
    let start = Dual::from(0.0);
    let derivatives = if of_initialization {
        model.differentiate_initialization(start, &variables, &direction)
    } else {
        model.differentiate(start, &variables, &direction)
    };
    derivatives.expect("there are derivatives")
}

/// A random point with a start mode, with or without the latch and a frozen tank.
fn point(random: &mut Random, mode: InitializationMode, way: usize) -> Variables {
    let mut point = random_point(random);
    point.parameters.initialization.mode = mode;
    point.parameters.valve.duty_latch = way.is_multiple_of(2);
    point.parameters.tank.frozen = way / 2 % 2 == 1;
    if mode == InitializationMode::Settled {
        // In the middle of the stroke, at either stop, and where the tank limits the vacuum in the chamber.
        let regimes = [(45.0, 3e4), (40.0, 3.2e4), (15.0, 3.1e4), (90.0, 3e4), (90.0, 7.5e4)];
        let (duty, tank_pressure) = regimes[way % regimes.len()];
        point.set_real(reference("hp_wastegate_pwm"), duty);
        point.start.tank.pressure = tank_pressure;
        point.states.tank.pressure = tank_pressure;
    }
    // After each of the regimes has been without.
    let [wastegate, sensor] = stuck(&point);
    match way {
        5.. if way % 4 == 1 => wastegate,
        5.. if way % 4 == 3 => sensor,
        _ => point,
    }
}

/// The knowns of the initialization: inputs, parameters, and the start values that are used in every mode.
fn knowns_of_initialization() -> Vec<ValueReference> {
    reals(|_, causality, initial| causality == Causality::Input || initial == Some(Initial::Exact))
}

/// The inputs and the states.
fn knowns_of_steps() -> Vec<ValueReference> {
    reals(|reference, causality, _| {
        causality == Causality::Input || States::NAMES.contains(&name(reference).as_str())
    })
}

/// The parameters, which FMI 3.0 counts among the knowns of steps.
fn parameters() -> Vec<ValueReference> {
    reals(|_, causality, _| causality == Causality::Parameter)
}

/// The calculated variables, except for the states.
fn calculated() -> Vec<ValueReference> {
    reals(|_, causality, initial| {
        causality == Causality::Output
            || causality == Causality::Local && initial == Some(Initial::Calculated)
    })
}

/// Compares derivatives with central differences of the initialization. Their errors are the
/// rounding of the difference, and the third derivative; the better one of two widths is used. Their tolerance is
/// their difference from each other; if that is large, there is a kink between.
fn compare(
    point: &Variables,
    knowns: &[ValueReference],
    unknowns: &[ValueReference],
    of_initialization: bool,
) -> usize {
    let base = unknowns_at(point, unknowns);
    let mut compared = 0;
    for &known in knowns {
        let exact = derivatives(point, known, of_initialization);
        let value = point.real(known);
        let quotients = |share: f64| -> Vec<f64> {
            let width = share * value.abs().max(1e-3);
            let at = |there: f64| {
                let mut moved = point.clone();
                moved.set_real(known, there);
                unknowns_at(&moved, unknowns)
            };
            let (up, down) = (at(value + width), at(value - width));
            up.iter().zip(down).map(|(up, down)| (up - down) / (2.0 * width)).collect()
        };
        let (wide, narrow) = (quotients(1e-4), quotients(1e-5));
        for (i, &unknown) in unknowns.iter().enumerate() {
            let exact = exact.real(unknown);
            // The least effect of the known on the unknown.
            let scale = exact.abs().max(1e-2 * base[i].abs() / value.abs().max(1e-3));
            if (wide[i] - narrow[i]).abs() > AGREEMENT * scale {
                continue;
            }
            compared += 1;
            let error = (exact - wide[i]).abs().min((exact - narrow[i]).abs());
            assert!(
                error <= AGREEMENT * scale,
                "{} by {}: {exact:e}, but the quotients are {:e} and {:e}",
                name(unknown),
                name(known),
                wide[i],
                narrow[i]
            );
        }
    }
    compared
}

#[test]
fn derivatives_are_those_of_the_equations() {
    let (knowns, unknowns) = ([knowns_of_steps(), parameters()].concat(), calculated());
    let mut random = Random(17);
    let mut compared = 0;
    for way in 0..4 {
        // The latch holds the duty between periods, but not in initialization: off here.
        let point = point(&mut random, InitializationMode::Given, 2 * way + 1);
        compared += compare(&point, &knowns, &unknowns, false);
    }
    // All except for a few at kinks and cancellations.
    assert!(compared * 10 >= 9 * 4 * knowns.len() * unknowns.len(), "{compared}");
}

#[test]
fn derivatives_of_the_initialization_are_those_of_its_result() {
    let knowns = knowns_of_initialization();
    let mut unknowns = calculated();
    unknowns.extend(reals(|_, causality, initial| {
        causality == Causality::Local && initial == Some(Initial::Approx)
    }));
    for (mode, ways) in
        [(InitializationMode::Given, 2), (InitializationMode::Running, 2), (InitializationMode::Settled, 3)]
    {
        let mut random = Random(23);
        let mut compared = 0;
        // The settled derivatives and their quotients are 0 up to rounding.
        let settled = mode == InitializationMode::Settled;
        let told: Vec<_> = unknowns
            .iter()
            .copied()
            .filter(|&unknown| !(settled && name(unknown).starts_with("der(")))
            .collect();
        for way in 0..ways {
            compared += compare(&point(&mut random, mode, way), &knowns, &told, true);
        }
        assert!(compared * 10 >= 9 * ways * knowns.len() * told.len(), "{mode:?}: {compared}");
    }
}

/// Compares both kinds of derivatives, each unknown by each known, as relative changes of both. Where contributions cancel
/// out, both have the rounding of these: the tolerance is relative to the sum of all.
fn compare_adjoint(point: &Variables, knowns: &[ValueReference], unknowns: &[ValueReference], initial: bool) {
    let (model, variables) = initialized(point);
    let columns: Vec<_> = knowns.iter().map(|&known| derivatives(point, known, initial)).collect();
    let change = |unknown, known, derivative: f64| {
        (derivative * variables.real(known) / variables.real(unknown).abs().max(1e-3)).abs()
    };
    let mut tape = Tape::new();
    let (mut sum, mut differences) = (0.0, Vec::new());
    for &unknown in unknowns {
        let weights = Variables::weights(&[unknown], &[1.0]);
        let row = if initial {
            model.differentiate_initialization_backwards(0.0, &variables, &weights, &mut tape)
        } else {
            model.differentiate_backwards(0.0, &variables, &weights, true, &mut tape)
        }
        .expect("there are derivatives");
        for (&known, column) in knowns.iter().zip(&columns) {
            let (forward, backward) = (column.real(unknown), row.real(known));
            sum += change(unknown, known, forward);
            differences.push((change(unknown, known, forward - backward), unknown, known));
        }
    }
    for (difference, unknown, known) in differences {
        let (unknown, known) = (name(unknown), name(known));
        assert!(difference <= 1e-12 * sum, "{unknown} by {known}: a difference of {difference:e} in {sum:e}");
    }
}

/// A random point near a steady state, with a mode of initialization. Far from any, where turbines stand against the flow or
/// flows mix that go backwards, smoothed bounds lose both derivatives in rounding.
fn running_point(random: &mut Random, mode: InitializationMode, way: usize) -> Variables {
    let mut point = point(random, InitializationMode::Settled, way);
    let settled = initialized(&point).1.states;
    point.start = settled.map(|state| state * random.between(0.98, 1.02));
    point.parameters.initialization.mode = mode;
    point
}

#[test]
fn adjoint_derivatives_are_the_directional_ones() {
    let mut random = Random(37);
    for way in 0..20 {
        let point = running_point(&mut random, InitializationMode::Given, way);
        compare_adjoint(&point, &[knowns_of_steps(), parameters()].concat(), &calculated(), false);
    }
}

#[test]
fn adjoint_derivatives_of_the_initialization_are_the_directional_ones() {
    let mut random = Random(41);
    let mut unknowns = calculated();
    unknowns.extend(reals(|_, causality, initial| {
        causality == Causality::Local && initial == Some(Initial::Approx)
    }));
    for mode in [InitializationMode::Given, InitializationMode::Settled] {
        // The settled derivatives are 0 up to rounding.
        let settled = mode == InitializationMode::Settled;
        let told: Vec<_> = unknowns
            .iter()
            .copied()
            .filter(|&unknown| !(settled && name(unknown).starts_with("der(")))
            .collect();
        for way in 0..5 {
            let point = running_point(&mut random, mode, way);
            compare_adjoint(&point, &knowns_of_initialization(), &told, true);
        }
    }
}

/// Collects the derivatives that are not zero; `threshold` is relative to unknown and known.
fn note(
    observed: &mut Dependencies,
    point: &Variables,
    knowns: &[ValueReference],
    of_initialization: bool,
    threshold: f64,
) {
    let (_, variables) = initialized(point);
    for &known in knowns {
        let derivatives = derivatives(point, known, of_initialization);
        for (&unknown, dependencies) in observed.iter_mut() {
            let share =
                threshold * variables.real(unknown).abs().max(1e-3) / point.real(known).abs().max(1e-3);
            if derivatives.real(unknown).abs() > share {
                dependencies.insert(known);
            }
        }
    }
}

#[test]
fn declared_dependencies_are_where_derivatives_are_not_zero() {
    let declared = declared_of_steps();
    let mut observed = nothing_observed(&declared);
    let mut random = Random(29);
    for way in 0..40 {
        note(
            &mut observed,
            &point(&mut random, InitializationMode::Given, way),
            &knowns_of_steps(),
            false,
            0.0,
        );
    }
    assert_as_declared(&declared, &observed, false);
}

#[test]
fn declared_initial_dependencies_are_where_derivatives_are_not_zero() {
    let knowns = knowns_of_initialization();
    let declared = declared_of_initialization(&knowns);
    let mut observed = nothing_observed(&declared);
    let mut random = Random(31);
    for way in 0..20 {
        for mode in [InitializationMode::Given, InitializationMode::Running] {
            note(&mut observed, &point(&mut random, mode, way), &knowns, true, 0.0);
        }
    }
    for way in 0..10 {
        // In a linear solution, zeros are accurate to some 1e-13.
        note(&mut observed, &point(&mut random, InitializationMode::Settled, way), &knowns, true, 1e-11);
    }
    assert_as_declared(&declared, &observed, true);
}
