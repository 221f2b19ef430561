//! Two parts with steps of their own, against closed forms.

use fmu_export::{Equations, Integrated, Multirate, Number, Persistent, Simulation, TwoRates};
use fmu_export_equations::furnace::{Evaluation, Variables};
use fmu_export_equations::{EVALUATIONS, Furnace};

type Model = Integrated<Furnace, TwoRates<1, 1>>;

fn furnace(tolerance: f64, change: impl FnOnce(&mut Variables)) -> Simulation<Model> {
    let mut simulation = Simulation::<Model>::default();
    simulation.experiment.tolerance = Some(tolerance);
    simulation.variables.inputs.command = 1.0;
    change(&mut simulation.variables);
    simulation.initialize().unwrap();
    simulation
}

/// The response of the lags τ and C to 1 + sin(ω·t) from rest.
fn exact(time: f64, lag: f64, constant: f64) -> [f64; 2] {
    // 1/(1 + i·ω·τ) and its product with 1/(1 + i·ω·C).
    let over = |[re, im]: [f64; 2], constant: f64| {
        let (a, b) = (1.0, 200.0 * constant);
        let square = a * a + b * b;
        [(re * a + im * b) / square, (im * a - re * b) / square]
    };
    let first = over([1.0, 0.0], lag);
    let second = over(first, constant);
    let (sine, cosine) = (200.0 * time).sin_cos();
    let swing = |[re, im]: [f64; 2]| re * sine + im * cosine;
    let decay = -1.0 - first[1];
    let share = decay / (1.0 - constant / lag);
    let slow = -1.0 - second[1] - share;
    [
        1.0 + swing(first) + decay * (-time / lag).exp(),
        1.0 + swing(second) + share * (-time / lag).exp() + slow * (-time / constant).exp(),
    ]
}

#[test]
fn both_parts_follow_their_closed_forms_and_the_slow_one_takes_few_steps() {
    let mut before = f64::INFINITY;
    for tolerance in [1e-4, 1e-5, 1e-6] {
        let mut simulation = furnace(tolerance, |variables| variables.parameters.ripple = 1.0);
        EVALUATIONS.with(|counts| counts.iter().for_each(|count| count.set(0)));
        let mut largest = 0.0_f64;
        for _ in 0..20 {
            simulation.step(0.1).unwrap();
            let states = &simulation.variables.states;
            let [opening, temperature] = exact(simulation.time, 1e-3, 100.0);
            largest = largest
                .max((states.opening - opening).abs() / (1.0 + opening.abs()))
                .max((states.temperature - temperature).abs() / (1.0 + temperature.abs()));
        }
        // The valve forgets its errors within a step or two.
        assert!(largest < 3.0 * tolerance && largest < 0.5 * before, "{largest:e} with {tolerance:e}");
        before = largest;
        let [fast, slow] = EVALUATIONS.with(|counts| [counts[0].get(), counts[1].get()]);
        assert!(fast > 8 * slow, "{fast} evaluations of the valve, {slow} of the mass");
    }
}

/// The command that is set for a step acts from the sample at its start on, whenever the experiment starts.
#[test]
fn a_command_is_sampled_from_any_start_on() {
    for start in [0.0, -2.0, 1000.0, 1.7e9] {
        let mut simulation = Simulation::<Model>::default();
        simulation.experiment.tolerance = Some(1e-8);
        simulation.experiment.start_time = start;
        simulation.initialize().unwrap();
        for command in [0.5, -1.0, 2.0, 0.25] {
            simulation.variables.inputs.command = command;
            simulation.step(0.1).unwrap();
            // A lag of a millisecond has settled within 0.1 s, to exp(-100) and the tolerance.
            let opening = simulation.variables.states.opening;
            assert!((opening - command).abs() < 1e-6, "{opening} instead of {command} from {start} s");
        }
    }
}

#[test]
fn coupled_parts_take_the_same_steps() {
    // A feedback that does nothing to the solution.
    let after = |feedback: f64| {
        let mut simulation = furnace(1e-6, |variables| {
            (variables.parameters.ripple, variables.parameters.feedback) = (1.0, feedback);
        });
        (0..20).for_each(|_| simulation.step(0.1).unwrap());
        simulation.variables.states
    };
    let (apart, together) = (after(0.0), after(1e-12));
    assert!((apart.opening - together.opening).abs() < 6e-6 && apart != together, "{apart:?}, {together:?}");
    assert!((apart.temperature - together.temperature).abs() < 6e-6, "{apart:?}, {together:?}");
}

#[test]
fn a_sampled_input_acts_from_the_next_event_on_and_at_once_where_both_coincide() {
    let mut simulation = furnace(1e-8, |_| {});
    simulation.step(0.05).unwrap();
    simulation.variables.inputs.command = 2.0;
    // To the event at 0.1 s, at which the valve has forgotten its start.
    simulation.step(0.05).unwrap();
    assert!((simulation.variables.states.opening - 1.0).abs() < 1e-6, "sampled before the event");
    simulation.variables.inputs.command = 3.0;
    simulation.step(0.02).unwrap();
    assert!((simulation.variables.states.opening - 3.0).abs() < 1e-6, "not sampled at the event");
}

#[test]
fn a_copy_continues_bit_for_bit() {
    let mut simulation = furnace(1e-6, |variables| variables.parameters.ripple = 1.0);
    simulation.step(0.25).unwrap();
    let mut copy = simulation.clone();
    for simulation in [&mut simulation, &mut copy] {
        (0..5).for_each(|_| simulation.step(0.07).unwrap());
    }
    assert!(simulation.variables == copy.variables);
}

/// A mass whose rate is not a number after 1 s.
#[derive(Clone, Debug, Default, Persistent)]
struct Failing {}

impl Equations for Failing {
    type Variables = Variables;

    fn evaluate<T: Number>(&self, time: T, variables: Evaluation<'_, T>) {
        let Evaluation { states, derivatives, .. } = variables;
        derivatives.opening = -states.opening;
        derivatives.temperature = (-time + 1.0).sqrt();
    }
}

impl Multirate for Failing {}

#[test]
fn a_failure_names_the_time_that_was_reached() {
    let mut simulation = Simulation::<Integrated<Failing, TwoRates<1, 1>>>::default();
    simulation.initialize().unwrap();
    let error = simulation.step(2.0).unwrap_err().to_string();
    let (_, rest) = error.split_once("cannot be integrated beyond ").expect("the error names the time");
    let (time, rest) = rest.split_once(" s: the error of ").expect("the error names the state");
    assert!((time.parse::<f64>().unwrap() - 1.0).abs() < 1e-3, "{error}");
    assert!(rest.starts_with("temperature "), "{error}");
}
