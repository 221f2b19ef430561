//! Internal steps beyond a communication point: fewer of them, of which nothing is to be seen at the points.

use std::cell::Cell;
use std::ffi::c_void;
use std::ptr;

use fmu_export::fmi2::{c_api, c_types};
use fmu_export::integrator::{AUTOMATIC, DOP853, RODAS5P};
use fmu_export::{
    Context, Described as _, Equations, Error, EvaluationOf, Event, Integrated, Integration, Number,
    Numbered as _, Persistent, Simulation,
};
use fmu_export_equations::{Decay, Hires, decay, hires};

use crate::instantiate;

/// Steps per second, far finer than the integrator's.
const STEPS: i32 = 100;
const SIZE: f64 = 0.01;
const TOLERANCE: f64 = 1e-8;
/// Of a step's error, relative to 1, some remain over the internal steps.
const ACCUMULATED: f64 = 10.0;

thread_local! {
    static EVALUATIONS: Cell<u32> = const { Cell::new(0) };
    /// The place of the last one with numbers: time, state and input. And how many were at that of the one before.
    static PLACE: Cell<[u64; 3]> = const { Cell::new([0; 3]) };
    static REPEATED: Cell<u32> = const { Cell::new(0) };
    /// The latest time (s) at which the equations are evaluated.
    static LATEST: Cell<f64> = const { Cell::new(f64::NEG_INFINITY) };
    /// From when on (s) they are not valid, and whether they panic then.
    static VALID_UNTIL: Cell<f64> = const { Cell::new(f64::INFINITY) };
    static PANICS: Cell<bool> = const { Cell::new(false) };
    /// When (s) there are time events.
    static PERIOD: Cell<f64> = const { Cell::new(f64::INFINITY) };
}

/// The tests of a method, and its most evaluations in a communication step for which one internal step suffices.
macro_rules! tests_of {
    ($($module:ident: $method:ident, $evaluations:literal);*) => {$(
        mod $module {
            use super::*;

            const METHOD: fmu_export::integrator::Method = $method;

            /// A decay that is watched.
            #[derive(Clone, Debug, Default, Persistent)]
            struct Watched(Decay);

            impl Equations for Watched {
                type Variables = decay::Variables;

                const INTEGRATION: Integration<decay::Variables> =
                    Integration { method: &METHOD, ..Integration::DEFAULT };

                fn evaluate<T: Number>(&self, time: T, variables: EvaluationOf<'_, Self, T>) {
                    EVALUATIONS.set(EVALUATIONS.get() + 1);
                    LATEST.set(LATEST.get().max(time.value()));
                    let numbers = [time, variables.states.x, variables.inputs.target];
                    let is_dual = size_of::<T>() > size_of::<f64>();
                    let place = if is_dual { [0; 3] } else { numbers.map(|number| number.value().to_bits()) };
                    REPEATED.set(REPEATED.get() + u32::from(PLACE.replace(place) == place && !is_dual));
                    let is_valid = time.value() <= VALID_UNTIL.get();
                    assert!(is_valid || !PANICS.get(), "they are not valid");
                    self.0.evaluate(if is_valid { time } else { T::from(f64::NAN) }, variables);
                }

                fn next_event(&self, time: f64, _variables: &decay::Variables) -> Option<f64> {
                    let period = PERIOD.get();
                    period.is_finite().then(|| ((time / period + 1e-6).floor() + 1.0) * period)
                }

                fn event(
                    &mut self,
                    event: &Event<'_>,
                    variables: &mut decay::Variables,
                    context: &mut Context<'_>,
                ) -> Result<(), Error> {
                    self.0.event(event, variables, context)
                }
            }

            type Model = Integrated<Watched>;

            /// An instance of the FMU.
            struct Importer(*mut c_void);

            impl Drop for Importer {
                fn drop(&mut self) {
                    // SAFETY: the instance is this importer's, and this its last use.
                    unsafe { c_api::fmi2FreeInstance::<Model>(self.0) }
                }
            }

            // SAFETY of every call below: the instance is the importer's, and used by one thread; arrays have the passed lengths, and
            // what is passed outlives the call.
            impl Importer {
                /// An initialized one.
                fn new(stop_time: Option<f64>) -> Self {
                    let mut importer = Self::instantiated();
                    let (has_stop, stop) = (stop_time.is_some().into(), stop_time.unwrap_or_default());
                    // SAFETY: see above.
                    unsafe {
                        c_api::fmi2SetupExperiment::<Model>(importer.0, 1, TOLERANCE, 0.0, has_stop, stop);
                        c_api::fmi2EnterInitializationMode::<Model>(importer.0);
                        importer.set("rate", 2.0);
                        c_api::fmi2ExitInitializationMode::<Model>(importer.0);
                    }
                    EVALUATIONS.set(0);
                    LATEST.set(f64::NEG_INFINITY);
                    importer
                }

                fn instantiated() -> Self {
                    Self(instantiate::<Model>(c_types::CO_SIMULATION))
                }

                fn set(&mut self, name: &str, value: f64) {
                    let mut described = decay::Variables::described();
                    let (reference, _) = described.find(|(_, variable)| variable.name() == name).unwrap();
                    let status =
                        // SAFETY: see above.
                        unsafe { c_api::fmi2SetReal::<Model>(self.0, &raw const reference, 1, &raw const value) };
                    assert_eq!(status, c_types::Status::Ok, "{name}");
                }

                fn get(&mut self, name: &str) -> f64 {
                    let mut described = decay::Variables::described();
                    let (reference, _) = described.find(|(_, variable)| variable.name() == name).unwrap();
                    let mut value = f64::NAN;
                    // SAFETY: see above.
                    unsafe { c_api::fmi2GetReal::<Model>(self.0, &raw const reference, 1, &raw mut value) };
                    value
                }

                fn x(&mut self) -> f64 {
                    self.get("x")
                }

                /// Takes a communication step by its number. Returns `x` at its end.
                fn step(&mut self, number: i32) -> f64 {
                    self.step_from(f64::from(number) * SIZE, SIZE)
                }

                fn step_from(&mut self, start: f64, size: f64) -> f64 {
                    // SAFETY: see above.
                    let status = unsafe { c_api::fmi2DoStep::<Model>(self.0, start, size, 1) };
                    assert_eq!(status, c_types::Status::Ok, "the step from {start} s");
                    self.x()
                }

                /// Saves the state, and restores it in place of what a step from it leaves; `as_bytes`, from a copy.
                fn save_and_restore(&mut self, start: f64, as_bytes: bool) {
                    let mut state = ptr::null_mut();
                    // SAFETY: see above.
                    unsafe {
                        c_api::fmi2GetFMUstate::<Model>(self.0, &raw mut state);
                        if as_bytes {
                            let mut size = 0;
                            c_api::fmi2SerializedFMUstateSize::<Model>(self.0, state, &raw mut size);
                            let mut bytes = vec![0; size];
                            c_api::fmi2SerializeFMUstate::<Model>(self.0, state, bytes.as_mut_ptr(), size);
                            c_api::fmi2FreeFMUstate::<Model>(self.0, &raw mut state);
                            let status =
                                c_api::fmi2DeSerializeFMUstate::<Model>(self.0, bytes.as_ptr(), size, &raw mut state);
                            assert_eq!(status, c_types::Status::Ok);
                        }
                        self.set("target", 3.0);
                        self.step_from(start, SIZE);
                        let status = c_api::fmi2SetFMUstate::<Model>(self.0, state);
                        assert_eq!(status, c_types::Status::Ok);
                        c_api::fmi2FreeFMUstate::<Model>(self.0, &raw mut state);
                    }
                }
            }

            /// `x` at all points of a second, each after `before` the step.
            fn run(stop_time: Option<f64>, mut before: impl FnMut(&mut Importer, i32)) -> Vec<f64> {
                let mut importer = Importer::new(stop_time);
                (0..STEPS)
                    .map(|number| {
                        before(&mut importer, number);
                        importer.step(number)
                    })
                    .collect()
            }

            fn bits(values: &[f64]) -> Vec<u64> {
                values.iter().map(|value| value.to_bits()).collect()
            }

            #[test]
            fn states_at_all_points_are_within_the_tolerance_and_cost_less() {
                let found = run(None, |_, _| {});
                let cost = EVALUATIONS.get();
                for (number, x) in found.iter().enumerate() {
                    let exact = (-2.0 * (number + 1) as f64 * SIZE).exp();
                    assert!((x - exact).abs() <= ACCUMULATED * TOLERANCE, "{number}: {x} instead of {exact}");
                }
                // An input that changes by less than the tolerance at each step has each one integrated on its own.
                run(None, |importer, number| importer.set("target", f64::from(number) * 1e-12));
                let every_step = EVALUATIONS.get();
                assert!(3 * cost < every_step, "{cost} evaluations, {every_step} without steps beyond the points");
            }

            /// The derivatives at a step's start and end are those of evaluations that are made anyway.
            #[test]
            fn no_place_is_evaluated_twice_in_a_row() {
                run(None, |importer, number| {
                    importer.set("target", f64::from(number) * 1e-3);
                    if number == 1 {
                        // The first step looks for the length of steps.
                        EVALUATIONS.set(0);
                    }
                });
                let (found, steps) = (EVALUATIONS.get(), STEPS.unsigned_abs() - 1);
                assert!(found <= $evaluations * steps, "{found} evaluations in {steps} steps");
                for seed in 1..=50 {
                    let mut draw = draws(seed);
                    let (mut importer, mut time) = (Importer::new(None), SIZE);
                    importer.set("rate", f64::from(1 + draw(1000)));
                    importer.step(0);
                    REPEATED.set(0);
                    for _ in 0..50 {
                        if draw(5) > 0 {
                            importer.set("target", f64::from(draw(5)) - 0.5 * time);
                        }
                        let size = [SIZE, 0.1 * SIZE, 20.0 * SIZE][draw(3) as usize];
                        importer.step_from(time, size);
                        time += size;
                    }
                    assert_eq!(REPEATED.get(), 0, "seed {seed}");
                }
            }

            #[test]
            fn a_run_that_saves_at_every_step_is_that_of_one_that_never_does() {
                let found = run(None, |_, _| {});
                for as_bytes in [false, true] {
                    let saved =
                        run(None, |importer, number| importer.save_and_restore(f64::from(number) * SIZE, as_bytes));
                    assert_eq!(bits(&saved), bits(&found), "as bytes: {as_bytes}");
                }
            }

            #[test]
            fn setting_equal_values_and_reading_change_nothing() {
                let found = run(None, |_, _| {});
                let set = run(None, |importer, _| {
                    importer.set("target", 0.0);
                    importer.set("rate", 2.0);
                    importer.x();
                });
                assert_eq!(bits(&set), bits(&found));
            }

            /// The present value of a state is not its start value, which may have been set before.
            #[test]
            fn a_start_value_that_is_set_twice_is_the_last() {
                let mut importer = Importer::instantiated();
                importer.set("x", 5.0);
                importer.set("x", 1.0);
                // SAFETY: see above.
                unsafe {
                    c_api::fmi2SetupExperiment::<Model>(importer.0, 1, TOLERANCE, 0.0, 0, 0.0);
                    c_api::fmi2EnterInitializationMode::<Model>(importer.0);
                    c_api::fmi2ExitInitializationMode::<Model>(importer.0);
                }
                assert_eq!(importer.x().to_bits(), 1.0_f64.to_bits());
            }

            #[test]
            fn in_any_order_what_changes_nothing_changes_nothing() {
                for seed in 1..=50_u32 {
                    let mut draw = draws(seed);
                    let (mut one, mut other) = (Importer::new(None), Importer::new(None));
                    let (mut time, mut target, mut rate) = (0.0, 0.0, 2.0);
                    for _ in 0..200 {
                        match draw(12) {
                            0 => target = f64::from(draw(3)),
                            1 => rate = 1.0 + f64::from(draw(3)),
                            _ => {}
                        }
                        for importer in [&mut one, &mut other] {
                            importer.set("target", target);
                            importer.set("rate", rate);
                        }
                        for _ in 0..draw(4) {
                            match draw(5) {
                                0 => other.set("target", target),
                                1 => other.set("rate", rate),
                                2 => drop(other.x()),
                                3 => other.save_and_restore(time, false),
                                _ => other.save_and_restore(time, true),
                            }
                        }
                        let size = [SIZE, 0.1 * SIZE, 20.0 * SIZE][draw(3) as usize];
                        let [x, same] = [&mut one, &mut other].map(|importer| importer.step_from(time, size));
                        time += size;
                        assert_eq!(x.to_bits(), same.to_bits(), "seed {seed}: {x} and {same} at {time} s");
                    }
                }
            }

            #[test]
            fn changes_act_from_the_point_at_which_they_are_made() {
                for name in ["target", "rate"] {
                    let found = run(None, |importer, number| {
                        if number == 50 {
                            importer.set(name, 1.5);
                        }
                    });
                    for number in 50..STEPS {
                        let (before, after) = ((-1.0_f64).exp(), f64::from(number - 49) * SIZE);
                        let exact = match name {
                            "target" => 1.5 + (before - 1.5) * (-2.0 * after).exp(),
                            _ => before * (-1.5 * after).exp(),
                        };
                        let x = found[usize::try_from(number).unwrap()];
                        assert!((x - exact).abs() <= ACCUMULATED * TOLERANCE, "{name}, {number}: {x} instead of {exact}");
                    }
                }
            }

            #[test]
            fn what_fails_beyond_a_point_is_no_error_before() {
                for panics in [false, true] {
                    VALID_UNTIL.set(1.0);
                    PANICS.set(panics);
                    let mut importer = Importer::new(None);
                    let found = (0..STEPS).map(|number| importer.step(number)).last().unwrap();
                    assert!(LATEST.get() > 1.0, "no step went beyond");
                    assert!((found - (-2.0_f64).exp()).abs() <= ACCUMULATED * TOLERANCE, "{found}");
                    let values = ["x", "der(x)", "square", "seconds", "target"];
                    let reached = values.map(|name| importer.get(name));
                    // SAFETY: see above.
                    let status = unsafe { c_api::fmi2DoStep::<Model>(importer.0, 1.0, 1.0, 1) };
                    assert_eq!(status, c_types::Status::Error);
                    // What can be read is what was reached.
                    VALID_UNTIL.set(f64::INFINITY);
                    assert_eq!(bits(&values.map(|name| importer.get(name))), bits(&reached), "panics: {panics}");
                }
            }

            #[test]
            fn no_step_goes_beyond_the_stop_time_or_a_time_event() {
                run(Some(1.0), |_, _| {});
                assert!(LATEST.get() <= 1.0, "{}", LATEST.get());
                PERIOD.set(0.095);
                run(None, |_, number| {
                    let next = ((f64::from(number) * SIZE / 0.095).floor() + 1.0) * 0.095;
                    // Rounding of both.
                    assert!(LATEST.get() <= next + 1e-12, "{} before the step from {number}", LATEST.get());
                });
            }
        }
    )*};
}
tests_of!(explicit: DOP853, 13; linearly_implicit: RODAS5P, 11; automatic: AUTOMATIC, 13);

/// Random numbers below a bound, from a seed.
fn draws(mut random: u32) -> impl FnMut(u32) -> u32 {
    move |of| {
        // Of Numerical Recipes: its upper bits.
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (random >> 16) % of
    }
}

#[test]
fn stiff_states_are_within_the_tolerance_at_all_points() {
    let run = |tolerance, steps: u32| {
        let mut simulation = Simulation::<Integrated<Hires>>::default();
        simulation.experiment.tolerance = Some(tolerance);
        simulation.initialize().unwrap();
        (0..steps)
            .map(|_| {
                simulation.step(100.0 / f64::from(steps)).unwrap();
                let mut states = [0.0; 8];
                hires::Variables::each_state(&simulation.variables, |state, value: f64| {
                    states[state] = value;
                });
                states
            })
            .collect::<Vec<_>>()
    };
    let exact = run(1e-12, 1000);
    for tolerance in [1e-4, 1e-6, 1e-8] {
        let found = run(tolerance, 1000);
        let pairs = found.iter().flatten().zip(exact.iter().flatten());
        let largest = pairs.map(|(x, exact)| (x - exact).abs() / (1.0 + exact.abs())).fold(0.0, f64::max);
        assert!(largest <= ACCUMULATED * tolerance, "{largest:e} at the tolerance {tolerance:e}");
    }
}
