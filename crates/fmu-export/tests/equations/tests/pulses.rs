//! What the equations do between two internal steps, and a communication point shows: speeds of a vehicle, for a while.

use std::array::from_fn;
use std::cell::Cell;
use std::f64::consts::PI;

use fmu_export::{
    Equations, EvaluationOf, InputSignal, Integrated, Number, Persistent, Simulation, VariablesOf,
};
use fmu_export_equations::drive;
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::Rng as _;

/// Before the first pulse, and the end of a run, in s.
const QUIET: f64 = 15.0;
const END: f64 = 60.0;
/// The error that is too large: far more than the tolerance, far less than what is lost with a part of a pulse.
const LOST: f64 = 0.01;
const DAY: f64 = 86400.0;

#[derive(Clone, Copy, Debug)]
enum Shape {
    /// Rises, stays and falls; the slopes are a share of the width each.
    Trapezoid(f64),
    /// Gauss' bell; the width is eight standard deviations.
    Bell,
    /// On, at the same time each day.
    Daily,
    /// Jumps, and decays with the width as its time constant.
    Decay,
    /// So many waves: of a sine, a saw, and a switch that does not add up to 0.
    Sines(f64),
    Saw(f64),
    Switch(f64),
}

/// A speed for some time.
#[derive(Clone, Copy, Debug)]
struct Pulse {
    shape: Shape,
    begin: f64,
    width: f64,
    height: f64,
}

impl Pulse {
    fn end(self) -> f64 {
        self.begin + self.width
    }

    /// The distance.
    fn area(self) -> f64 {
        let Self { shape, width, height, .. } = self;
        match shape {
            Shape::Trapezoid(slope) => height * width * (1.0 - slope),
            Shape::Bell => height * width / 8.0 * (2.0 * PI).sqrt(),
            Shape::Daily => height * width,
            _ => f64::NAN,
        }
    }

    fn at<T: Number>(self, time: T) -> T {
        let Self { shape, begin, width, height } = self;
        let since = time - T::from(begin);
        let share = since / T::from(width);
        let wave = |waves: f64| share * waves - T::from((share.value() * waves).floor());
        let level = match shape {
            Shape::Bell => (-((share - T::from(0.5)) * 8.0).powi(2) * 0.5).exp(),
            Shape::Daily => T::from(f64::from(u8::from(since.value().rem_euclid(DAY) < width))),
            _ if share.value() < 0.0 => T::from(0.0),
            Shape::Decay => (-share).exp(),
            _ if share.value() > 1.0 => T::from(0.0),
            Shape::Trapezoid(slope) => {
                let nearest = if share.value() < 0.5 { share } else { -share + 1.0 };
                if nearest.value() < slope { nearest / T::from(slope) } else { T::from(1.0) }
            }
            Shape::Sines(waves) => (wave(waves) * (2.0 * PI)).sin(),
            Shape::Saw(waves) => wave(waves),
            Shape::Switch(waves) => T::from(if wave(waves).value() < 0.5 { 1.0 } else { -0.5 }),
        };
        level * height
    }
}

/// A state at rest, and how it is driven by the speed: x' = A·x + b·v.
#[derive(Clone, Copy, Debug)]
struct System {
    matrix: [[f64; 4]; 4],
    driven: [f64; 4],
}

thread_local! {
    static PULSE: Cell<Option<Pulse>> = const { Cell::new(None) };
    static SYSTEM: Cell<Option<System>> = const { Cell::new(None) };
}

fn speed<T: Number>(time: T) -> T {
    PULSE.get().expect("a test sets it").at(time)
}

/// What is beside the distance: nothing; the time; …
const ALONE: u8 = 0;
const CLOCK: u8 = 1;
/// … a state so stiff that steps are those of `Rodas5P`; …
const STIFF: u8 = 2;
/// … two wagons far away, of which one is pushed, and pushes the other by a stiff coupling; …
const WAGONS: u8 = 3;
/// … a [`System`].
const LINEAR: u8 = 4;

/// The rate of decay in 1/s, the stiffness in 1/s² and the damping in 1/s of the coupling, and the place of the wagons.
const RATE: f64 = 1e5;
const STIFFNESS: f64 = 1e6;
const DAMPING: f64 = 1e3;
const PLACE: f64 = 1000.0;

#[derive(Clone, Debug, Default, Persistent)]
struct Drive<const BESIDE: u8> {}

impl<const BESIDE: u8> Equations for Drive<BESIDE> {
    type Variables = drive::Variables;

    fn initialize<T: Number>(&self, variables: &mut VariablesOf<Self, T>) {
        let start = match BESIDE {
            STIFF => [1.0, 0.0, 0.0, 0.0],
            WAGONS => [PLACE, 0.0, PLACE, 0.0],
            _ => [0.0; 4],
        };
        variables.states.beside = start.map(T::from);
    }

    fn evaluate<T: Number>(&self, time: T, variables: EvaluationOf<'_, Self, T>) {
        let drive::Evaluation { states, derivatives, .. } = variables;
        let (beside, zero) = (states.beside, T::from(0.0));
        derivatives.beside = [zero; 4];
        derivatives.distance = speed(time);
        match BESIDE {
            CLOCK => {
                derivatives.beside[0] = T::from(1.0);
                derivatives.distance = speed(beside[0]);
            }
            STIFF => derivatives.beside[0] = beside[0] * -RATE,
            WAGONS => {
                let [place, push, other_place, other] = beside;
                let force = (place - other_place) * STIFFNESS + (push - other) * DAMPING;
                derivatives.beside = [push, speed(time) * 2.0 - force, other, force];
                derivatives.distance = zero;
            }
            LINEAR => {
                let System { matrix, driven } = SYSTEM.get().expect("a test sets it");
                let row =
                    |row: [f64; 4]| row.into_iter().zip(beside).map(|(element, x)| x * element).sum::<T>();
                derivatives.beside = from_fn(|i| row(matrix[i]) + speed(time) * driven[i]);
            }
            _ => {}
        }
    }
}

type Run<const BESIDE: u8> = Simulation<Integrated<Drive<BESIDE>>>;

fn started<const BESIDE: u8>(pulse: Pulse) -> Run<BESIDE> {
    PULSE.set(Some(pulse));
    let mut run = Run::<BESIDE>::default();
    run.initialize().unwrap();
    run
}

/// The error of a pulse's area after steps of a size, relative to it.
fn error<const BESIDE: u8>(pulse: Pulse, size: f64) -> f64 {
    let mut run = started::<BESIDE>(pulse);
    while run.time < END {
        run.step(size).unwrap();
    }
    let drive::States { distance, beside, .. } = run.variables.states;
    // The wagons' acceleration is the pulse, and its area their mean speed.
    let found = if BESIDE == WAGONS { 0.5 * (beside[1] + beside[3]) } else { distance };
    (found / pulse.area() - 1.0).abs()
}

struct Random(Pcg64Mcg);

impl Random {
    fn new() -> Self {
        Self(Pcg64Mcg::new(0x9E37_79B9_7F4A_7C15))
    }

    fn between(&mut self, least: f64, most: f64) -> f64 {
        least + (most - least) * f64::from(self.0.next_u32()) / f64::from(u32::MAX)
    }

    /// The logarithm is between those of both.
    fn decades(&mut self, least: f64, most: f64) -> f64 {
        self.between(least.ln(), most.ln()).exp()
    }

    /// A trapezoid or a bell of 0.3 to 10 s.
    fn pulse(&mut self) -> Pulse {
        let width = self.decades(0.3, 10.0);
        let slope = self.between(0.05, 0.5);
        let shape = if self.between(0.0, 1.0) < 0.5 { Shape::Trapezoid(slope) } else { Shape::Bell };
        Pulse { shape, begin: self.between(QUIET, END - width), width, height: self.decades(0.1, 100.0) }
    }

    /// Waves or a decay, each of two steps of a size at least.
    fn waves(&mut self, size: f64) -> Pulse {
        let (length, waves) = (self.decades(2.0, 40.0) * size, self.between(1.0, 10.0).floor());
        let shape = [Shape::Decay, Shape::Sines(waves), Shape::Saw(waves), Shape::Switch(waves)]
            [(self.0.next_u32() % 4) as usize];
        let width = if let Shape::Decay = shape { length } else { length * waves };
        Pulse { shape, begin: self.between(QUIET, 0.9 * END), width, height: 1.0 }
    }

    /// A stable system: rates of decay along random axes, and turns between all states.
    fn system(&mut self) -> System {
        let mut axes: [[f64; 4]; 4] = from_fn(|i| from_fn(|j| f64::from(u8::from(i == j))));
        for turn in 0..6 {
            let (first, angle) = (turn % 3, self.between(0.0, 2.0 * PI));
            for axis in &mut axes {
                let [one, other] = [axis[first], axis[first + 1]];
                axis[first] = one * angle.cos() - other * angle.sin();
                axis[first + 1] = one * angle.sin() + other * angle.cos();
            }
        }
        let fastest = self.decades(0.1, 1e6);
        let rates: [f64; 4] = from_fn(|_| self.decades(0.01, fastest));
        let mut matrix = from_fn(|i| {
            from_fn(|j| -(0..4).map(|axis| axes[i][axis] * rates[axis] * axes[j][axis]).sum::<f64>())
        });
        let turns = self.decades(0.01, fastest.sqrt());
        for (i, j) in [(1, 0), (2, 0), (2, 1), (3, 0), (3, 1), (3, 2)] {
            let turn = self.between(-turns, turns);
            matrix[i][j] += turn;
            matrix[j][i] -= turn;
        }
        System { matrix, driven: from_fn(|_| self.decades(0.1, 10.0)) }
    }
}

fn loses_none<const BESIDE: u8>() {
    let mut random = Random::new();
    for number in 0..60 {
        let pulse = random.pulse();
        // The ends of a bell are not to be seen.
        let hidden = if let Shape::Bell = pulse.shape { 0.25 * pulse.width } else { 0.0 };
        for size in [0.1, 1.0] {
            let [first, last] =
                [pulse.begin + hidden, pulse.end() - hidden].map(|time| (time / size).floor());
            if first < last {
                let error = error::<BESIDE>(pulse, size);
                assert!(error < LOST, "{number}, steps of {size} s: {error} of {pulse:?}");
            }
        }
    }
}

#[test]
fn no_pulse_is_lost() {
    loses_none::<ALONE>();
}

#[test]
fn no_pulse_is_lost_where_the_time_is_a_state() {
    loses_none::<CLOCK>();
}

#[test]
fn no_pulse_is_lost_beside_a_stiff_state() {
    loses_none::<STIFF>();
}

#[test]
fn no_pulse_is_lost_in_a_stiff_coupling() {
    loses_none::<WAGONS>();
}

#[test]
fn a_triangle_over_two_steps_is_not_lost() {
    for size in [0.1, 0.01] {
        for steps in [2.0, 5.0, 20.0] {
            for number in 0..25 {
                let (width, begin) = (steps * size, 40.0 + 0.4 * f64::from(number));
                let pulse = Pulse { shape: Shape::Trapezoid(0.5), begin, width, height: 2.0 / width };
                let error = error::<ALONE>(pulse, size);
                assert!(error < LOST, "{number}, {steps} steps of {size} s: {error}");
            }
        }
    }
}

#[test]
fn a_room_that_is_heated_two_hours_a_day_gets_its_heat() {
    let heating = Pulse { shape: Shape::Daily, begin: 6.0 * 3600.0, width: 2.0 * 3600.0, height: 2000.0 };
    let mut room = started::<ALONE>(heating);
    for _ in 0..7 * 24 * 60 {
        room.step(60.0).unwrap();
    }
    let (found, expected) = (room.variables.states.distance, 7.0 * heating.area());
    // Each of fourteen jumps may cost as much as two steps err: a tolerance each, of the heat so far.
    assert!((found / expected - 1.0).abs() < 28.0 * 1e-6, "{found} instead of {expected} J");
}

/// The states of a linear system at all points.
fn states_at_points(size: f64, mut step: impl FnMut(&mut Run<LINEAR>, f64), pulse: Pulse) -> Vec<[f64; 5]> {
    let mut run = started::<LINEAR>(pulse);
    let mut found = vec![];
    while run.time < END {
        step(&mut run, size);
        let drive::States { distance, beside: [a, b, c, d], .. } = run.variables.states;
        found.push([distance, a, b, c, d]);
    }
    found
}

#[test]
fn driven_systems_are_where_steps_from_point_to_point_bring_them() {
    let mut random = Random::new();
    for number in 0..60 {
        let size = [0.1, 0.02][number % 2];
        let (system, pulse) = (random.system(), random.waves(size));
        SYSTEM.set(Some(system));
        let ahead = states_at_points(size, |run, size| run.step(size).unwrap(), pulse);
        let by_points = |run: &mut Run<LINEAR>, size| {
            let inputs = InputSignal::constant(&run.variables.inputs);
            run.step_with(size, &inputs).unwrap();
        };
        let exact = states_at_points(size, by_points, pulse);
        for (found, exact) in ahead.as_flattened().iter().zip(exact.as_flattened()) {
            let error = (found - exact).abs() / (1.0 + exact.abs());
            assert!(
                error < LOST,
                "{number}, {size} s: {found} instead of {exact} with {pulse:?}, {system:?}"
            );
        }
    }
}

#[test]
fn a_run_that_is_restored_goes_on_to_the_same_bits_past_pulses() {
    let mut random = Random::new();
    for number in 0..20 {
        let (system, pulse) = (random.system(), random.waves(0.1));
        SYSTEM.set(Some(system));
        let found = states_at_points(0.1, |run, size| run.step(size).unwrap(), pulse);
        let mut steps = 0;
        let restored = |run: &mut Run<LINEAR>, size| {
            steps += 1;
            if steps % 3 == 0 {
                let saved = run.clone();
                run.step(size).unwrap();
                *run = saved;
            }
            run.step(size).unwrap();
        };
        let restored = states_at_points(0.1, restored, pulse);
        let bits =
            |states: &[[f64; 5]]| states.as_flattened().iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert!(bits(&found) == bits(&restored), "{number}: {pulse:?}, {system:?}");
    }
}
