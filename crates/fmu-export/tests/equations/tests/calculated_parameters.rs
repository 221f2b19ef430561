//! What follows from tunable parameters alone: variables by `calculate_parameters`, fields by `take_parameters`. It follows
//! at once, in each interface and mode, and with its derivatives.

// They are whole numbers, computed without rounding.
#![allow(clippy::float_cmp)]

use fmu_export::{Integrated, Model, SampledModel, Simulation};
use fmu_export_equations::{Tuned, Tuned3, TunedSamples, TunedSamples3, TunedTicks};
use fmu_terms::InstanceType;

use crate::importer::Importer;

/// What follows from the gain.
fn follows(gain: f64) -> [f64; 5] {
    let plain = 11.0 * gain;
    [10.0 * gain, plain, 10.0 * gain, if gain > 3.0 { plain } else { -plain }, 10.0 * gain]
}

const FOLLOWING: [&str; 5] = ["scaled", "plain", "y", "z", "of_field"];

/// The relative error of the state: a step's is at most the default tolerance, 1e-6, times 1 + x, and the errors of two
/// steps add up at most.
fn is_close(found: f64, exact: f64) -> bool {
    (found - exact).abs() <= 2e-6 * (1.0 + exact)
}

/// In Step Mode, with a getter before the step and without.
fn follow_in_steps<M: Model>() {
    for reads in [true, false] {
        let mut importer = Importer::<M>::new(InstanceType::CoSimulation);
        importer.initialize();
        assert_eq!(importer.get(FOLLOWING), follows(2.0));
        importer.step(0.0, 0.5);
        assert!(importer.tune(5.0));
        if reads {
            assert_eq!(importer.get(FOLLOWING), follows(5.0));
        }
        // The state has the change, but not its consequences.
        let mut restored = importer.restored();
        let middle = 20.0 * (1.0 - (-0.5_f64).exp());
        let exact = 50.0 + (middle - 50.0) * (-0.5_f64).exp();
        for importer in [&mut importer, &mut restored] {
            importer.step(0.5, 0.5);
            let [x] = importer.get(["x"]);
            assert!(is_close(x, exact), "{x} {exact}");
            assert_eq!(importer.get(FOLLOWING), follows(5.0));
        }
        let mut restored = restored.restored();
        assert_eq!(restored.get(FOLLOWING), follows(5.0));
        // Beyond its range it changes nothing; an FMU of FMI 3.0 needs a saved state then.
        if Importer::<M>::IS_FMI2 {
            assert!(!importer.tune(200.0));
            assert_eq!(importer.get(FOLLOWING), follows(5.0));
        }
        importer.reset();
        importer.initialize();
        assert_eq!(importer.get(FOLLOWING), follows(2.0));
        importer.reset();
        assert!(importer.tune(4.0));
        importer.enter_initialization();
        assert_eq!(importer.get(FOLLOWING), follows(4.0));
        assert!(importer.tune(3.0));
        assert_eq!((importer.get(FOLLOWING), importer.get(["held"])), (follows(3.0), [30.0]));
    }
}

#[test]
fn they_follow_in_co_simulation() {
    follow_in_steps::<Integrated<Tuned>>();
    follow_in_steps::<Integrated<Tuned3>>();
}

/// In Event Mode, in which parameters are tuned, and in the mode that follows.
fn follow_in_events<M: Model>(instance_type: InstanceType) {
    let is_exchange = instance_type == InstanceType::ModelExchange;
    // The time event is due when `scaled` says.
    for reads in [true, false] {
        let mut importer = Importer::<M>::new(instance_type);
        importer.initialize();
        assert_eq!((importer.get(FOLLOWING), importer.update()), (follows(2.0), Some(20.0)));
        assert!(importer.tune(5.0));
        let mut restored = importer.restored();
        for importer in [&mut importer, &mut restored] {
            if reads {
                assert_eq!(importer.get(FOLLOWING), follows(5.0));
                if is_exchange {
                    assert_eq!(importer.rates(), [50.0, 0.0]);
                }
            }
            assert_eq!(importer.update(), Some(50.0));
            importer.leave_event_mode();
            assert_eq!(importer.get(FOLLOWING), follows(5.0));
        }
        if is_exchange {
            // To its own value: no change.
            assert!(importer.tune(5.0));
            assert_eq!(importer.rates(), [50.0, 0.0]);
        }
        // Without an iteration, too.
        importer.enter_event_mode();
        assert!(importer.tune(4.0));
        importer.leave_event_mode();
        if is_exchange {
            assert_eq!(importer.rates(), [40.0, 0.0]);
        } else {
            importer.step(0.0, 0.5);
            let ([x], exact) = (importer.get(["x"]), 40.0 * (1.0 - (-0.5_f64).exp()));
            assert!(is_close(x, exact), "{x} {exact}");
        }
        assert_eq!(importer.get(FOLLOWING), follows(4.0));
        importer.reset();
        importer.initialize();
        assert_eq!((importer.get(FOLLOWING), importer.update()), (follows(2.0), Some(20.0)));
    }
}

#[test]
fn they_follow_in_event_mode() {
    follow_in_events::<Integrated<Tuned>>(InstanceType::ModelExchange);
    follow_in_events::<Integrated<Tuned3>>(InstanceType::ModelExchange);
    follow_in_events::<Integrated<Tuned3>>(InstanceType::CoSimulationWithEvents);
}

/// The outputs' derivatives go through what is calculated, in FMI 3.0 between steps, too, where parameters are knowns.
#[test]
fn they_have_derivatives() {
    fn check<M: Model>() {
        for instance_type in [InstanceType::CoSimulation, InstanceType::ModelExchange] {
            let mut importer = Importer::<M>::new(instance_type);
            importer.enter_initialization();
            for found in importer.by_gain(["scaled", "y", "z", "of_field", "held", "der(x)", "plain"]) {
                assert_eq!(found, [10.0, 10.0, -11.0, 10.0, 10.0, 10.0, 11.0]);
            }
            importer.exit_initialization();
            if Importer::<M>::IS_FMI2 {
                continue;
            }
            assert!(importer.tune(5.0));
            for found in importer.by_gain(["y", "z", "of_field", "der(x)", "plain"]) {
                assert_eq!(found, [10.0, 11.0, 10.0, 10.0, 11.0]);
            }
        }
    }
    check::<Integrated<Tuned>>();
    check::<Integrated<Tuned3>>();
}

/// Calculated parameters of a sampled model follow at once, its outputs at the next sample.
#[test]
fn those_of_sampled_models_follow_before_the_next_sample() {
    fn check<M: Model>(instance_type: InstanceType) {
        let names = ["scaled", "plain", "seen"];
        let mut importer = Importer::<M>::new(instance_type);
        importer.initialize();
        let begin = |importer: &mut Importer<M>| {
            if instance_type == InstanceType::CoSimulation {
                importer.step(0.0, 0.5);
            } else {
                importer.update();
            }
        };
        begin(&mut importer);
        assert_eq!(importer.get(names), [20.0, 22.0, 20.0]);
        assert!(importer.tune(5.0));
        let mut restored = importer.restored();
        for importer in [&mut importer, &mut restored] {
            assert_eq!(importer.get(names), [50.0, 55.0, 20.0]);
            match instance_type {
                // The samples at 0.5 s are those before 1 s; the next one is in the step that begins there.
                InstanceType::CoSimulation => {
                    importer.step(0.5, 0.5);
                    assert_eq!(importer.get(names), [50.0, 55.0, 20.0]);
                    importer.step(1.0, 0.5);
                }
                InstanceType::CoSimulationWithEvents => {
                    importer.leave_event_mode();
                    importer.step(0.0, 1.0);
                    assert_eq!(importer.get(names), [50.0, 55.0, 20.0]);
                    importer.enter_event_mode();
                    importer.update();
                }
                InstanceType::ModelExchange => {
                    importer.leave_event_mode();
                    importer.set_time(1.0);
                    assert_eq!(importer.get(names), [50.0, 55.0, 20.0]);
                    importer.enter_event_mode();
                    importer.update();
                }
                InstanceType::ScheduledExecution => unreachable!("no model of these is for it"),
            }
            assert_eq!(importer.get(names), [50.0, 55.0, 50.0]);
        }
        importer.reset();
        importer.initialize();
        begin(&mut importer);
        assert_eq!(importer.get(names), [20.0, 22.0, 20.0]);
    }
    check::<SampledModel<TunedSamples>>(InstanceType::CoSimulation);
    check::<SampledModel<TunedSamples>>(InstanceType::ModelExchange);
    check::<SampledModel<TunedSamples3>>(InstanceType::CoSimulation);
    check::<SampledModel<TunedSamples3>>(InstanceType::ModelExchange);
    check::<SampledModel<TunedSamples3>>(InstanceType::CoSimulationWithEvents);
}

/// In a model with clocks, calculated parameters change at once and outputs at the next tick.
#[test]
fn those_of_models_with_clocks_follow_before_the_next_tick() {
    for instance_type in [InstanceType::ModelExchange, InstanceType::CoSimulationWithEvents] {
        let mut importer = Importer::<SampledModel<TunedTicks>>::new(instance_type);
        importer.initialize();
        assert_eq!(importer.get(["scaled", "plain"]), [20.0, 22.0]);
        assert!(importer.tune(5.0));
        let mut restored = importer.restored();
        for importer in [&mut importer, &mut restored] {
            assert_eq!(importer.get(["scaled", "plain"]), [50.0, 55.0]);
            importer.tick("sample");
            assert_eq!(importer.get(["scaled", "plain", "seen"]), [50.0, 55.0, 50.0]);
            // A tick is computed from the newest parameters.
            assert!(importer.tune(4.0));
            assert_eq!(importer.get(["scaled", "plain", "seen"]), [40.0, 44.0, 40.0]);
        }
    }
}

/// Models in Rust, without an FMU.
#[test]
fn they_follow_in_simulations() {
    let mut simulation = Simulation::<Integrated<Tuned>>::default();
    simulation.initialize().unwrap();
    simulation.variables.parameters.gain = 5.0;
    simulation.step(0.5).unwrap();
    assert_eq!([simulation.variables.outputs.y, simulation.variables.outputs.of_field], [50.0; 2]);
    let mut simulation = Simulation::<SampledModel<TunedSamples>>::default();
    simulation.initialize().unwrap();
    simulation.variables.parameters.gain = 5.0;
    simulation.step(0.5).unwrap();
    assert_eq!(simulation.variables.outputs.seen, 50.0);
    let mut simulation = Simulation::<SampledModel<TunedTicks>>::default();
    simulation.initialize().unwrap();
    simulation.variables.parameters.gain = 5.0;
    simulation.tick(|variables| &mut variables.clocks.sample).unwrap();
    assert_eq!(simulation.variables.outputs.seen, 50.0);
}
