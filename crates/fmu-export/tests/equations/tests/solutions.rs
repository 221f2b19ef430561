//! The built-in integrator against closed forms and independent solutions.

use fmu_export::{
    Context, Dual, Equations, Error, EvaluationOf, Event, Fmu, InputSignal, Integrated, Model as _, Number,
    Numbered as _, Persistent, Simulation, Tape, check_dependencies, steady_state,
};
use fmu_export_equations::{
    BouncingBall, Decay, Hires, Robertson, Stairs, Undeclared, VanDerPol, bouncing_ball, decay, stairs,
    undeclared, van_der_pol,
};

/// The solutions that `reference.py` printed: name, time and states.
const REFERENCES: &str = include_str!("../solutions.csv");
/// A step errs by at most the tolerance, relative to a state and its nominal value; for the steps between two times,
/// of which there are some hundred, what is left of all of them together is less than so many tolerances.
const ACCUMULATED: f64 = 100.0;

/// The times and states of a reference solution.
fn reference(name: &str) -> Vec<(f64, Vec<f64>)> {
    let lines = REFERENCES.lines().filter_map(|line| line.strip_prefix(name)?.strip_prefix(','));
    let numbers = lines.map(|line| line.split(',').map(|number| number.parse().expect("a number")));
    let points: Vec<_> =
        numbers.map(|mut numbers| (numbers.next().expect("a time"), numbers.collect())).collect();
    assert!(!points.is_empty(), "there is no solution {name}");
    points
}

fn simulation<E: Equations>(tolerance: f64) -> Simulation<Integrated<E>> {
    let mut simulation = Simulation::default();
    simulation.experiment.tolerance = Some(tolerance);
    simulation
}

fn bits<const N: usize>(values: [f64; N]) -> [u64; N] {
    values.map(f64::to_bits)
}

/// Goes to a time by a number of equal communication steps.
fn go_to<F: Fmu>(simulation: &mut Simulation<F>, time: f64, steps: u32) -> Result<(), Error> {
    let size = (time - simulation.time) / f64::from(steps);
    (0..steps).try_for_each(|_| simulation.step(size))
}

fn assert_near(found: &[f64], expected: &[f64], tolerance: f64, nominal: f64, what: &str) {
    for (found, expected) in found.iter().zip(expected) {
        let error = (found - expected).abs() / (tolerance * (expected.abs() + nominal));
        assert!(error <= ACCUMULATED, "{what}: {found:?} instead of {expected:?}, {error:.0} tolerances");
    }
}

#[test]
fn decay_follows_its_closed_form() {
    for tolerance in [1e-4, 1e-6, 1e-8, 1e-10] {
        let mut simulation = simulation::<Decay>(tolerance);
        simulation.initialize().unwrap();
        go_to(&mut simulation, 3.0, 1).unwrap();
        let decay::Outputs { square, seconds } = simulation.variables.outputs;
        let x = simulation.variables.states.x;
        assert_near(&[x], &[(-3.0_f64).exp()], tolerance, 1.0, "x");
        assert_eq!(bits([square, seconds]), bits([x * x, 3.0]), "outputs are those at the end of the step");
    }
}

/// A decay whose start has no derivatives.
#[derive(Clone, Debug, Default, Persistent)]
struct Arbitrary {}

impl Equations for Arbitrary {
    type Variables = decay::Variables;
    const LONGEST_STEP: f64 = 10.0;

    fn check_start(&self) -> Result<(), Error> {
        Err(Error::new("the start is arbitrary"))
    }

    fn evaluate<T: Number>(&self, time: T, variables: EvaluationOf<'_, Self, T>) {
        Decay {}.evaluate(time, variables);
    }
}

#[test]
fn a_start_without_derivatives_says_why() {
    let mut simulation = simulation::<Arbitrary>(1e-2);
    simulation.initialize().unwrap();
    let Simulation { model, variables, .. } = simulation;
    let direction = decay::Variables::zero();
    let start = model.differentiate_initialization(Dual::from(0.0), &variables, &direction);
    assert_eq!(start.err().unwrap().to_string(), "the start is arbitrary");
    assert!(model.differentiate(Dual::from(0.0), &variables, &direction).is_ok());
    assert_eq!(Integrated::<Arbitrary>::LONGEST_STEP.to_bits(), 10.0_f64.to_bits());
}

#[test]
fn van_der_pol_agrees_with_radau_whatever_the_steps_are() {
    for mu in [1.0, 1000.0] {
        let reference = reference(&format!("van_der_pol_{mu}"));
        for tolerance in [1e-4, 1e-6, 1e-8, 1e-10] {
            for steps in [1, 7, 500] {
                let mut simulation = simulation::<VanDerPol>(tolerance);
                simulation.variables.parameters.mu = mu;
                simulation.initialize().unwrap();
                for &(time, ref expected) in &reference {
                    go_to(&mut simulation, time, steps).unwrap();
                    let what = format!("mu {mu}, tolerance {tolerance:?}, {steps} steps to {time}");
                    assert_near(&simulation.variables.states.to_array(), expected, tolerance, 1.0, &what);
                }
            }
        }
    }
}

#[test]
fn robertson_agrees_with_radau_over_eleven_decades() {
    for tolerance in [1e-4, 1e-6, 1e-8] {
        let mut simulation = simulation::<Robertson>(tolerance);
        simulation.initialize().unwrap();
        for (time, expected) in reference("robertson") {
            go_to(&mut simulation, time, 1).unwrap();
            let what = format!("tolerance {tolerance:?}, to {time:e}");
            // The nominal value of the declaration.
            assert_near(&simulation.variables.states.y, &expected, tolerance, 1e-5, &what);
        }
    }
}

#[test]
fn hires_agrees_with_radau_to_its_last_time() {
    for tolerance in [1e-4, 1e-6, 1e-8, 1e-10] {
        let mut simulation = simulation::<Hires>(tolerance);
        simulation.initialize().unwrap();
        for (time, expected) in reference("hires") {
            go_to(&mut simulation, time, 1).unwrap();
            let what = format!("tolerance {tolerance:?}, to {time}");
            // The nominal value of the declaration.
            assert_near(&simulation.variables.states.y, &expected, tolerance, 1e-3, &what);
        }
    }
}

#[test]
fn without_a_tolerance_it_is_the_default() {
    let run = |tolerance| {
        let mut simulation = Simulation::<Integrated<VanDerPol>>::default();
        simulation.experiment.tolerance = tolerance;
        simulation.initialize().unwrap();
        simulation.step(10.0).unwrap();
        bits(simulation.variables.states.to_array())
    };
    assert_eq!(run(None), run(Some(fmu_export::DEFAULT_TOLERANCE)));
    assert_ne!(run(None), run(Some(1e-7)));
}

#[test]
fn inputs_with_derivatives_are_followed() {
    let tolerance = 1e-8;
    let mut simulation = simulation::<Decay>(tolerance);
    simulation.initialize().unwrap();
    let mut inputs = InputSignal::constant(&decay::Inputs { target: 1.0 });
    inputs.set_derivative(0, 1, 2.0);
    simulation.step_with(2.0, &inputs).unwrap();
    // x' = 1 + 2·t − x from 1: x = 2·t − 1 + 2·exp(−t).
    assert_near(&[simulation.variables.states.x], &[3.0 + 2.0 * (-2.0_f64).exp()], tolerance, 1.0, "x");
    let target = simulation.variables.inputs.target;
    assert_eq!(target.to_bits(), 5.0_f64.to_bits(), "it is that at the end");
}

#[test]
fn a_ramp_of_the_input_is_integrated_as_one_in_time() {
    let mut in_time = simulation::<Decay>(1e-4);
    in_time.variables.parameters.ramp = 2.0;
    in_time.initialize().unwrap();
    in_time.step(2.0).unwrap();
    let mut of_input = simulation::<Decay>(1e-4);
    of_input.initialize().unwrap();
    let mut inputs = InputSignal::constant(&of_input.variables.inputs);
    inputs.set_derivative(0, 1, 2.0);
    of_input.step_with(2.0, &inputs).unwrap();
    // The same steps; what is left is the rounding of some, on states of order 1.
    let difference = (in_time.variables.states.x - of_input.variables.states.x).abs();
    assert!(difference < 100.0 * f64::EPSILON, "{difference:e}");
}

#[test]
fn the_start_time_is_that_of_the_experiment() {
    let mut simulation = simulation::<Decay>(1e-6);
    simulation.experiment.start_time = 5.0;
    simulation.initialize().unwrap();
    assert_eq!(simulation.variables.outputs.seconds.to_bits(), 5.0_f64.to_bits());
}

#[test]
fn the_ball_bounces_when_it_should_until_it_rests() {
    let mut simulation = simulation::<BouncingBall>(1e-6);
    simulation.variables.parameters.restitution = 0.97;
    simulation.initialize().unwrap();
    let bouncing_ball::Parameters { restitution, gravity, smallest_velocity } =
        simulation.variables.parameters;
    // The fall from 1 m, and flights from one bounce to the next.
    let mut velocity = (2.0 * gravity).sqrt();
    let (mut time, mut bounces) = (velocity / gravity, 1);
    velocity *= restitution;
    while velocity >= smallest_velocity {
        // Steps end where they want: before the bounce, and after it.
        go_to(&mut simulation, time - 1e-6, 3).unwrap();
        assert_eq!(simulation.variables.outputs.bounces, bounces - 1);
        go_to(&mut simulation, time + 1e-6, 1).unwrap();
        let found = (simulation.variables.outputs.bounces, simulation.variables.outputs.last_bounce);
        assert_eq!(found.0, bounces);
        // The method is exact for a parabola. What is left is the rounding of at most a thousand steps, whose sums have
        // terms a hundred times as large as the states, which are of order 1.
        assert!(
            (found.1 - time).abs() < 1000.0 * 100.0 * 4.0 * f64::EPSILON,
            "bounce {bounces} at {} instead of {time}",
            found.1
        );
        time += 2.0 * velocity / gravity;
        velocity *= restitution;
        bounces += 1;
    }
    assert!(bounces > 100);
    simulation.step(10.0).unwrap();
    let variables = &simulation.variables;
    assert_eq!(variables.outputs.bounces, bounces, "each bounce is one event");
    assert_eq!(bits(variables.states.to_array()), [0; 2], "it rests");
}

#[test]
fn a_long_step_that_advances_is_none_without_an_end() {
    // Without damping, x = 2·cos t.
    let mut simulation = simulation::<VanDerPol>(1e-10);
    simulation.variables.parameters.mu = 0.0;
    simulation.initialize().unwrap();
    let end = 1e5;
    simulation.step(end).unwrap();
    // The errors of steps, ten a second at most, add up: each is at most the tolerance times the sum of x and its nominal value, 1.
    let found = simulation.variables.states.x0;
    assert!((found - 2.0 * end.cos()).abs() < 10.0 * end * 3e-10, "{found} instead of {}", 2.0 * end.cos());
}

#[test]
fn events_that_come_ever_faster_are_an_error_that_says_when() {
    let mut simulation = simulation::<BouncingBall>(1e-6);
    simulation.variables.parameters.smallest_velocity = 0.0;
    simulation.variables.parameters.restitution = 1.0;
    simulation.variables.parameters.gravity = 1e9;
    simulation.initialize().unwrap();
    let error = simulation.step(1e4).unwrap_err().to_string();
    assert!(error.starts_with("the step from 0 s was abandoned at "), "{error}");
    assert!(error.contains("after 100000 trials and events"), "{error}");
    assert!(error.ends_with("are events, which come ever faster, the last caused by height"), "{error}");
}

/// Counts where a sine of time passes a half.
#[derive(Clone, Debug, Default, Persistent)]
struct Crossings {}

impl Equations for Crossings {
    type Variables = stairs::Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: EvaluationOf<'_, Self, T>) {
        variables.derivatives.level = T::from(0.0);
        variables.outputs.seen = T::from(0.0);
        variables.outputs.steps = 0;
    }

    fn event_indicators(&self, time: f64, _variables: &stairs::Variables, indicators: &mut [f64]) {
        indicators[0] = (50.0 * time).sin() - 0.5;
    }

    fn event(
        &mut self,
        event: &Event<'_>,
        variables: &mut stairs::Variables,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let switches = &mut variables.outputs.switches;
        *switches = if event.is_initial { 0 } else { *switches + 1 };
        Ok(())
    }
}

/// sin 50 t = 0.5 twice in each of 795.77 periods in 100 s, at a twelfth and five twelfths.
#[test]
fn no_crossing_is_missed_in_long_steps() {
    for steps in [1, 10, 100, 1000] {
        let mut simulation = simulation::<Crossings>(1e-6);
        simulation.initialize().unwrap();
        go_to(&mut simulation, 100.0, steps).unwrap();
        assert_eq!(simulation.variables.outputs.switches, 1592, "in {steps} steps");
    }
}

#[test]
fn a_solution_too_fast_for_its_step_is_an_error_that_names_the_state() {
    let mut simulation = simulation::<Oscillator>(1e-9);
    simulation.initialize().unwrap();
    let error = simulation.step(1e4).unwrap_err().to_string();
    assert!(error.contains(": x0 changes too fast") || error.contains(": x1 changes too fast"), "{error}");
}

#[test]
fn events_in_time_are_at_their_very_number() {
    let mut simulation = simulation::<Stairs>(1e-6);
    simulation.initialize().unwrap();
    // Neither steps nor their rounding hit the multiples of 0.3.
    for step in 1..=40 {
        simulation.step(0.1).unwrap();
        let expected = step / 3;
        assert_eq!(simulation.variables.outputs.steps, expected, "after step {step}");
        let time = f64::from(expected) * 0.3;
        assert_eq!(simulation.variables.outputs.last_step.to_bits(), time.to_bits());
    }
    let mut at_once = self::simulation::<Stairs>(1e-6);
    at_once.initialize().unwrap();
    at_once.step(4.0).unwrap();
    assert_eq!(at_once.variables.outputs, simulation.variables.outputs);
    // The rates 1, 2, …, 12 for 0.3 s each, and 13 for 0.1 s.
    for simulation in [simulation, at_once] {
        assert_near(&[simulation.variables.states.level], &[0.3 * 78.0 + 13.0 * 0.1], 1e-6, 1.0, "level");
    }
}

#[test]
fn an_event_that_only_rounding_puts_after_a_step_belongs_to_it() {
    let mut simulation = simulation::<Stairs>(1e-6);
    simulation.variables.parameters.interval = 0.8;
    simulation.initialize().unwrap();
    simulation.step(0.1).unwrap();
    simulation.step(0.7).unwrap();
    assert!(simulation.time < 0.8, "rounding");
    assert_eq!(simulation.variables.outputs.steps, 1);
    assert_eq!(simulation.variables.outputs.last_step.to_bits(), 0.8_f64.to_bits());
    // The next is a millionth of the step after it.
    simulation.step(1.6 - 0.8e-6 - simulation.time).unwrap();
    assert_eq!(simulation.variables.outputs.steps, 1);
}

/// Late, the rounding of the time is more than the tolerance relative to the step.
#[test]
fn late_in_time_too_an_event_that_only_rounding_puts_after_a_step_belongs_to_it() {
    let mut simulation = simulation::<Stairs>(1e-6);
    let due = 1e6_f64;
    simulation.variables.parameters.interval = due;
    simulation.experiment.start_time = due - 0.1;
    simulation.initialize().unwrap();
    let end = due.next_down().next_down();
    simulation.step(end - simulation.time).unwrap();
    assert_eq!(simulation.time.to_bits(), end.to_bits());
    assert_eq!(simulation.variables.outputs.steps, 1);
    assert_eq!(simulation.variables.outputs.last_step.to_bits(), due.to_bits());
}

#[test]
fn an_input_that_jumps_is_an_event_at_the_beginning_of_the_step() {
    let mut simulation = simulation::<Stairs>(1e-6);
    simulation.initialize().unwrap();
    simulation.step(0.1).unwrap();
    assert_eq!(simulation.variables.outputs.switches, 0);
    for (signal, switches) in [(1.0, 1), (2.0, 1), (-1.0, 2)] {
        let (begin, before) = (simulation.time, simulation.variables.outputs);
        simulation.variables.inputs.signal = signal;
        simulation.step(0.1).unwrap();
        let stairs::Outputs { switches: found, last_switch, .. } = simulation.variables.outputs;
        assert_eq!(found, switches);
        let expected = if switches > before.switches { begin } else { before.last_switch };
        assert_eq!(last_switch.to_bits(), expected.to_bits());
    }
}

#[test]
fn an_indicator_that_is_positive_at_the_start_is_no_event() {
    let mut simulation = simulation::<Stairs>(1e-6);
    simulation.variables.inputs.signal = 1.0;
    simulation.initialize().unwrap();
    simulation.step(0.1).unwrap();
    assert_eq!(simulation.variables.outputs.switches, 0);
}

#[test]
fn an_indicator_that_changes_twice_within_a_step_of_the_integrator_is_two_events() {
    let mut simulation = simulation::<Stairs>(1e-6);
    // (t − 0.1)·(0.15 − t), positive within. The rate is constant, so that one step goes to the end.
    simulation.variables.inputs.signal = -0.015;
    simulation.initialize().unwrap();
    let mut inputs = InputSignal::constant(&simulation.variables.inputs);
    inputs.set_derivative(0, 1, 0.25);
    inputs.set_derivative(0, 2, -2.0);
    simulation.step_with(0.25, &inputs).unwrap();
    assert_eq!(simulation.variables.outputs.switches, 2);
}

#[test]
fn an_event_that_is_not_ahead_is_refused() {
    let mut simulation = simulation::<Stairs>(1e-6);
    simulation.variables.parameters.waits = false;
    // The first event may be due at the start, but not the second one, too.
    simulation.initialize().unwrap();
    let error = simulation.step(0.1).unwrap_err().to_string();
    assert_eq!(error, "the next event is due at 0 s, not after the one at 0 s");
}

#[test]
fn rates_that_are_not_numbers_are_an_error_that_says_when_and_whose() {
    let mut simulation = simulation::<Robertson>(1e-6);
    simulation.variables.parameters.fails_from = 2.0;
    simulation.initialize().unwrap();
    let error = simulation.step(10.0).unwrap_err().to_string();
    let (_, rest) = error.split_once("cannot be integrated beyond ").expect("the error names the time");
    let (time, rest) = rest.split_once(" s: the error of ").expect("and the state");
    let time: f64 = time.parse().unwrap();
    // The first evaluation beyond 2 s fails, so that steps only approach it: to the nanosecond that messages show.
    assert!((time - 2.0).abs() <= 1e-9, "{error}");
    assert!(
        rest.starts_with("y[2] stays above the tolerance 1e-6, or its derivative is not finite"),
        "{error}"
    );
}

#[test]
fn a_copy_goes_on_to_the_same_bits() {
    let mut simulation = simulation::<BouncingBall>(1e-6);
    simulation.initialize().unwrap();
    // Between the third bounce and the next.
    simulation.step(1.7).unwrap();
    let mut copy = simulation.clone();
    for simulation in [&mut simulation, &mut copy] {
        go_to(simulation, 2.3, 7).unwrap();
    }
    assert_eq!(bits(simulation.variables.states.to_array()), bits(copy.variables.states.to_array()));
    assert_eq!(simulation.variables.outputs, copy.variables.outputs);
}

#[test]
fn directional_derivatives_are_exact() {
    let mut simulation = simulation::<Decay>(1e-6);
    simulation.variables.parameters.rate = 0.5;
    simulation.variables.parameters.offset = 3.0;
    simulation.variables.parameters.ramp = 0.25;
    simulation.variables.start.x = 2.0;
    simulation.initialize().unwrap();
    let Simulation { model, variables, .. } = &simulation;
    assert_eq!(variables.states.x.to_bits(), 5.0_f64.to_bits());
    let mut direction = decay::Variables::zero();
    (direction.start.x, direction.inputs.target) = (1.0, 4.0);
    let start = Dual::from(0.0);
    let by = model.differentiate(start, variables, &direction).unwrap();
    // 0.5·(4 − 1) and 2·x.
    assert_eq!(bits([by.derivatives.x, by.outputs.square]), bits([1.5, 10.0]));
    // Time adds 0.5·0.25 for each second, at a rate of 8 s/s.
    let by = model.differentiate(Dual::new(0.0, 8.0), variables, &direction).unwrap();
    assert_eq!(bits([by.derivatives.x, by.outputs.square, by.outputs.seconds]), bits([2.5, 10.0, 8.0]));
    (direction.parameters.rate, direction.parameters.offset) = (1.0, 1.0);
    let by = model.differentiate_initialization(start, variables, &direction).unwrap();
    // x changes by 2; 0.5·(4 − 2) and, by the rate, −x.
    assert_eq!(bits([by.states.x, by.derivatives.x, by.outputs.square]), bits([2.0, 1.0 - 5.0, 20.0]));
}

#[test]
fn adjoint_derivatives_are_exact() {
    let mut simulation = simulation::<Decay>(1e-6);
    simulation.variables.parameters.rate = 0.5;
    simulation.variables.parameters.offset = 3.0;
    simulation.variables.start.x = 2.0;
    simulation.initialize().unwrap();
    let Simulation { model, variables, .. } = &simulation;
    let mut tape = Tape::new();
    let mut weights = decay::Variables::zero();
    (weights.derivatives.x, weights.outputs.square, weights.states.x) = (4.0, 2.0, 1.0);
    for by_parameters in [false, true] {
        let by = model.differentiate_backwards(0.0, variables, &weights, by_parameters, &mut tape).unwrap();
        // 4·0.5, and 4·(−0.5) + 2·2·x + 1 with x = 5; by the rate −4·x.
        let by_rate = if by_parameters { -20.0 } else { 0.0 };
        assert_eq!(bits([by.inputs.target, by.states.x, by.parameters.rate]), bits([2.0, 19.0, by_rate]));
    }
    let by = model.differentiate_initialization_backwards(0.0, variables, &weights, &mut tape).unwrap();
    // x is the sum of its start value and the offset; the derivative changes with the rate by −x.
    let found = [by.inputs.target, by.states.x, by.parameters.offset, by.parameters.rate];
    assert_eq!(bits(found), bits([2.0, 19.0, 19.0, -20.0]));
}

/// A plate that is heated and radiates, from the temperature at which it rests.
#[derive(Clone, Debug, Default, Persistent)]
struct Radiator {
    at_rest: [f64; 1],
}

impl Radiator {
    fn rate<T: Number>(variables: &decay::Variables<T>, [x]: [T; 1]) -> [T; 1] {
        [variables.inputs.target - variables.parameters.rate * x.powi(4)]
    }
}

impl Equations for Radiator {
    type Variables = decay::Variables;

    fn prepare(&mut self, variables: &mut decay::Variables, _context: &mut Context<'_>) -> Result<(), Error> {
        let still = variables.map(Dual::from);
        self.at_rest = steady_state::find(|x| Self::rate(&still, x), [variables.start.x], &[1.0])?;
        Ok(())
    }

    fn initialize<T: Number>(&self, variables: &mut decay::Variables<T>) {
        let still = variables.map(|number| Dual::from(number.value()));
        let rate = |x| Self::rate(variables, x);
        [variables.states.x] = steady_state::follow(self.at_rest, &[1.0], rate, |x| Self::rate(&still, x));
    }

    fn evaluate<T: Number>(&self, time: T, variables: EvaluationOf<'_, Self, T>) {
        let decay::Evaluation { parameters, inputs, states, derivatives, outputs, .. } = variables;
        derivatives.x = inputs.target - parameters.rate * states.x.powi(4);
        (outputs.square, outputs.seconds) = (states.x * states.x, time);
    }
}

#[test]
fn a_model_may_start_at_rest() {
    let mut simulation = simulation::<Radiator>(1e-6);
    simulation.variables.parameters.rate = 0.5;
    simulation.variables.inputs.target = 8.0;
    simulation.initialize().unwrap();
    let Simulation { model, variables, .. } = &simulation;
    // (8/0.5)^(1/4), to the rounding of the last iteration.
    assert!((variables.states.x - 2.0).abs() < 1e-15);
    let mut direction = decay::Variables::zero();
    (direction.inputs.target, direction.start.x) = (1.0, 1.0);
    let by = model.differentiate_initialization(Dual::from(0.0), variables, &direction).unwrap();
    // 1/(4·0.5·x³); it stays at rest, whatever the guess is.
    assert!((by.states.x - 1.0 / 16.0).abs() < 1e-15, "{}", by.states.x);
    assert!(by.derivatives.x.abs() < 1e-15, "{}", by.derivatives.x);
    let mut weights = decay::Variables::zero();
    weights.states.x = 1.0;
    let by = model.differentiate_initialization_backwards(0.0, variables, &weights, &mut Tape::new());
    let by = by.unwrap();
    assert!((by.inputs.target - 1.0 / 16.0).abs() < 1e-15, "{}", by.inputs.target);
    // −x⁴/(4·0.5·x³).
    assert!((by.parameters.rate + 1.0).abs() < 1e-14, "{}", by.parameters.rate);

    simulation.variables.inputs.target = -1.0;
    assert_eq!(simulation.initialize().unwrap_err().to_string(), "no steady state was found");
}

#[test]
fn dependencies_that_are_not_declared_are_found() {
    check_dependencies::<Integrated<Decay>>(&decay::Variables::default()).unwrap();
    let error = check_dependencies::<Integrated<Undeclared>>(&undeclared::Variables::default())
        .unwrap_err()
        .to_string();
    assert_eq!(error, "der(x) depends on target, which its 'reads' omit");
}

/// An oscillator of 1000 rad/s.
#[derive(Clone, Debug, Default, Persistent)]
struct Oscillator {}

impl Equations for Oscillator {
    type Variables = van_der_pol::Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: EvaluationOf<'_, Self, T>) {
        variables.derivatives.x0 = variables.states.x1 * 1000.0;
        variables.derivatives.x1 = -variables.states.x0 * 1000.0;
    }
}

/// States advance by the step size that the importer passes, however its times are rounded: at Unix time by 2.4e-7 s,
/// 2.4e-4 of the step.
#[test]
fn late_start_times_do_not_change_the_states() {
    let states_from = |start_time: f64| {
        let mut simulation = simulation::<Oscillator>(1e-9);
        simulation.experiment.start_time = start_time;
        simulation.initialize().unwrap();
        for step in 0..1000 {
            simulation.time = start_time + f64::from(step) * 1e-3;
            simulation.step(1e-3).unwrap();
        }
        let van_der_pol::States { x0, x1 } = simulation.variables.states;
        bits([x0, x1])
    };
    let states = states_from(0.0);
    for start_time in [-3.0, 1e8, 1.7e9] {
        assert_eq!(states_from(start_time), states, "{start_time} s");
    }
}
