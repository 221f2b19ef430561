//! Models of many states, whose Jacobians are sparse.

use std::ffi::c_void;
use std::ptr;

use fmu_export::fmi2::c_api;
use fmu_export::fmi2::c_types::{CO_SIMULATION, Status};
use fmu_export::{Accessed as _, Context, Equations, InputSignal, Integrated, Model as _, Simulation, Step};
use fmu_export_equations::{BouncingBall, Decay, Field, Robertson, Rod};

use crate::allocations::counted;
use crate::instantiate;

const CELLS: usize = 200;

fn simulation(tolerance: f64, averages: bool) -> Simulation<Integrated<Rod>> {
    let mut simulation = Simulation::<Integrated<Rod>>::default();
    simulation.experiment.tolerance = Some(tolerance);
    simulation.variables.parameters.averages = averages;
    simulation.initialize().unwrap();
    simulation
}

/// The solution of the equations, which are those of cells of a finite length.
fn temperature(cell: usize, time: f64) -> f64 {
    let wave = std::f64::consts::PI / CELLS as f64;
    let decay = 4.0 * 400.0 * (0.5 * wave).sin().powi(2);
    1.0 + ((cell as f64 + 0.5) * wave).cos() * (-decay * time).exp()
}

#[test]
fn a_rod_follows_its_closed_form() {
    // With the average, a row of the Jacobian has all columns.
    for averages in [false, true] {
        for tolerance in [1e-4, 1e-6, 1e-8] {
            for steps in [1, 100] {
                let mut simulation = simulation(tolerance, averages);
                for _ in 0..steps {
                    simulation.step(5.0 / f64::from(steps)).unwrap();
                }
                let states = &simulation.variables.states;
                let average = if averages { 5.0 } else { 0.0 };
                let expected = (0..CELLS).map(|cell| temperature(cell, 5.0)).chain([average]);
                for (found, expected) in states.t.iter().copied().chain([states.average]).zip(expected) {
                    // Each of some hundred steps errs by less than the tolerance, relative to a state and 1.
                    let error = (found - expected).abs() / (tolerance * (expected.abs() + 1.0));
                    assert!(
                        error < 100.0,
                        "{found} instead of {expected}, {error:.0} tolerances of {tolerance:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn steps_after_the_first_ones_allocate_nothing() {
    // With several Jacobians.
    assert_eq!(allocations::<Rod>(0.1, 60), 0);
    // Large arrays of inputs. A new Jacobian allocates for large arrays; these steps need none.
    assert_eq!(allocations::<Field>(1e-3, 12), 0);
}

/// The steps in which the integrator finds that the system is stiff.
const FIRST: u32 = 10;

/// Those of steps of a size after the first ones.
fn allocations<E: Equations>(size: f64, steps: u32) -> u64 {
    let mut simulation = Simulation::<Integrated<E>>::default();
    simulation.initialize().unwrap();
    let Simulation { mut model, mut variables, experiment, .. } = simulation;
    let inputs = InputSignal::constant(variables.inputs());
    let mut log = |_: &'static str, _: std::fmt::Arguments<'_>| {};
    let mut step = |number: u32| {
        let step = Step::new(f64::from(number) * size, size, &inputs);
        model.step(&mut variables, &step, &mut Context::new(experiment, &mut log)).unwrap();
    };
    (0..FIRST).for_each(&mut step);
    let ((), allocations, _) = counted(|| (FIRST..FIRST + steps).for_each(step));
    allocations
}

/// A saved state holds what it is serialized to, and no matrices, twice at most.
#[test]
fn a_saved_state_is_no_larger_than_twice_its_bytes() {
    // The states, their start values and derivatives at least.
    saved_state_is_small::<Rod>(3 * 8 * CELLS);
    saved_state_is_small::<Decay>(3 * 8);
    saved_state_is_small::<Robertson>(3 * 8 * 3);
    // With an event indicator.
    saved_state_is_small::<BouncingBall>(3 * 8 * 2);
}

fn saved_state_is_small<E: Equations>(least: usize) {
    let instance = instantiate::<Integrated<E>>(CO_SIMULATION);
    // SAFETY: handles are used until they are freed.
    unsafe {
        assert_eq!(c_api::fmi2SetupExperiment::<Integrated<E>>(instance, 1, 1e-6, 0.0, 0, 0.0), Status::Ok);
        assert_eq!(c_api::fmi2EnterInitializationMode::<Integrated<E>>(instance), Status::Ok);
        assert_eq!(c_api::fmi2ExitInitializationMode::<Integrated<E>>(instance), Status::Ok);
        for step in 0..30 {
            let start = 0.1 * f64::from(step);
            assert_eq!(c_api::fmi2DoStep::<Integrated<E>>(instance, start, 0.1, 1), Status::Ok);
        }
        let mut states = [ptr::null_mut::<c_void>(); 2];
        let mut held = 0;
        for state in &mut states {
            // Of the second: the first also allocates the table of handles, which has room for eleven.
            let (status, _, bytes) =
                counted(|| c_api::fmi2GetFMUstate::<Integrated<E>>(instance, &raw mut *state));
            assert_eq!(status, Status::Ok);
            held = usize::try_from(bytes).unwrap();
        }
        let mut size = 0;
        let status = c_api::fmi2SerializedFMUstateSize::<Integrated<E>>(instance, states[1], &raw mut size);
        assert_eq!(status, Status::Ok);
        assert!(size > least, "{size} bytes");
        assert!(held > least && held <= 2 * size, "{held} bytes held, {size} serialized");
        for state in &mut states {
            assert_eq!(c_api::fmi2FreeFMUstate::<Integrated<E>>(instance, &raw mut *state), Status::Ok);
        }
        c_api::fmi2FreeInstance::<Integrated<E>>(instance);
    }
}
