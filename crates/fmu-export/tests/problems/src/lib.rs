//! Standard problems of the literature as models, by which the built-in integrator is measured. Each has an input, added
//! to the derivative of its last state.

use std::array::from_fn;
use std::sync::LazyLock;

use fmu_export::{Context, Described as _, Equations, Error, Event, Number, Persistent};

/// A problem, whose states are an array and whose rates do not depend on time.
pub trait Problem: Equations {
    /// As in `solutions.csv`.
    const NAME: &'static str;
    /// At which it ends, in s.
    const END: f64;

    /// Sets the initial states.
    fn start(states: &mut [f64]);

    /// Computes the rates without the input.
    fn rates<T: Number>(&self, states: &[T], rates: &mut [T]);
}

/// The solution of a problem at its end.
#[derive(Clone, Debug)]
pub struct Reference {
    /// How much an error on the way grows until the end, at most.
    pub growth: f64,
    /// Equally spaced among the problem's states.
    states: Vec<f64>,
    nominal: f64,
}

impl Reference {
    /// The solution that `reference.py` printed.
    ///
    /// # Panics
    /// When there is none.
    #[must_use]
    pub fn of<P: Problem>() -> Self {
        let mut lines = include_str!("../solutions.csv").lines();
        let line = lines.find_map(|line| line.strip_prefix(P::NAME)?.strip_prefix(','));
        let line = line.unwrap_or_else(|| panic!("there is no solution of {}", P::NAME));
        let mut numbers = line.split(',').map(|number| number.parse().expect("a number"));
        Self {
            growth: numbers.next().expect("a growth"),
            states: numbers.collect(),
            nominal: P::Variables::STATE_NOMINALS[0],
        }
    }

    /// The largest error of states at the end, relative to the sum of a state and its nominal value.
    #[must_use]
    pub fn error(&self, states: &[f64]) -> f64 {
        let stride = states.len().div_ceil(self.states.len());
        let errors = states.iter().step_by(stride).zip(&self.states);
        errors
            .map(|(state, expected)| (state - expected).abs() / (expected.abs() + self.nominal))
            .fold(0.0, |largest, error| if error > largest || error.is_nan() { error } else { largest })
    }
}

/// The model of a problem, with what follows in braces of its equations.
macro_rules! problem {
    ($(#[$documentation:meta])* $model:ident { $($field:ident: $type:ty),* }, $module:ident: $identifier:literal $({ $($events:item)* })?) => {
        #[allow(missing_docs)]
        pub mod $module {
            fmu_export::include_variables!($identifier);
        }

        $(#[$documentation])*
        #[derive(Clone, Debug, Default, Persistent)]
        pub struct $model {
            $($field: $type,)*
        }

        impl Equations for $model {
            type Variables = $module::Variables;

            fn initialize<T: Number>(&self, variables: &mut $module::Variables<T>) {
                let states = &mut variables.states.x;
                let mut start = vec![0.0; states.len()];
                Self::start(&mut start);
                for (state, start) in states.iter_mut().zip(start) {
                    *state = T::from(start);
                }
            }

            fn evaluate<T: Number>(&self, _time: T, variables: $module::Evaluation<'_, T>) {
                let rates = &mut variables.derivatives.x;
                self.rates(&variables.states.x[..], &mut rates[..]);
                let last = rates.len() - 1;
                rates[last] += variables.inputs.input;
            }

            $($($events)*)?
        }
    };
}

problem! {
    /// Seven bodies in a plane that attract each other, on a nonstiff course with close encounters (Hairer, Nørsett and
    /// Wanner, Solving Ordinary Differential Equations I, section II.10).
    Pleiades {}, pleiades: "pleiades"
}

impl Problem for Pleiades {
    const NAME: &'static str = "pleiades";
    const END: f64 = 3.0;

    fn start(states: &mut [f64]) {
        states.copy_from_slice(&[
            3.0, 3.0, -1.0, -3.0, 2.0, -2.0, 2.0, 3.0, -3.0, 2.0, 0.0, 0.0, -4.0, 4.0, 0.0, 0.0, 0.0, 0.0,
            0.0, 1.75, -1.5, 0.0, 0.0, 0.0, -1.25, 1.0, 0.0, 0.0,
        ]);
    }

    fn rates<T: Number>(&self, states: &[T], rates: &mut [T]) {
        let (x, y) = (&states[..7], &states[7..14]);
        rates[..14].copy_from_slice(&states[14..]);
        for body in 0..7 {
            let mut pull = [T::from(0.0); 2];
            for other in (0..7).filter(|&other| other != body) {
                let (dx, dy) = (x[other] - x[body], y[other] - y[body]);
                let square = dx * dx + dy * dy;
                let force = (square * square.sqrt()).recip() * (other + 1) as f64;
                pull[0] += dx * force;
                pull[1] += dy * force;
            }
            [rates[14 + body], rates[21 + body]] = pull;
        }
    }
}

problem! {
    /// The chemistry of polluted air as 25 reactions of 20 species, stiff (Verwer, SIAM Journal on Scientific Computing
    /// 15, 1994).
    Pollution {}, pollution: "pollution"
}

impl Problem for Pollution {
    const NAME: &'static str = "pollution";
    const END: f64 = 60.0;

    fn start(states: &mut [f64]) {
        for (species, start) in [(1, 0.2), (3, 0.04), (6, 0.1), (7, 0.3), (8, 0.01), (16, 0.007)] {
            states[species] = start;
        }
    }

    fn rates<T: Number>(&self, states: &[T], rates: &mut [T]) {
        let y = |species: usize| states[species - 1];
        let r = [
            y(1) * 0.35,
            y(2) * y(4) * 26.6,
            y(5) * y(2) * 1.23e4,
            y(7) * 8.6e-4,
            y(7) * 8.2e-4,
            y(7) * y(6) * 1.5e4,
            y(9) * 1.3e-4,
            y(9) * y(6) * 2.4e4,
            y(11) * y(2) * 1.65e4,
            y(11) * y(1) * 9e3,
            y(13) * 0.022,
            y(10) * y(2) * 1.2e4,
            y(14) * 1.88,
            y(1) * y(6) * 1.63e4,
            y(3) * 4.8e6,
            y(4) * 3.5e-4,
            y(4) * 0.0175,
            y(16) * 1e8,
            y(16) * 4.44e11,
            y(17) * y(6) * 1240.0,
            y(19) * 2.1,
            y(19) * 5.78,
            y(1) * y(4) * 0.0474,
            y(19) * y(1) * 1780.0,
            y(20) * 3.12,
        ];
        let r = |reaction: usize| r[reaction - 1];
        rates.copy_from_slice(&[
            -r(1) - r(10) - r(14) - r(23) - r(24) + r(2) + r(3) + r(9) + r(11) + r(12) + r(22) + r(25),
            -r(2) - r(3) - r(9) - r(12) + r(1) + r(21),
            -r(15) + r(1) + r(17) + r(19) + r(22),
            -r(2) - r(16) - r(17) - r(23) + r(15),
            -r(3) + r(4) * 2.0 + r(6) + r(7) + r(13) + r(20),
            -r(6) - r(8) - r(14) - r(20) + r(3) + r(18) * 2.0,
            -r(4) - r(5) - r(6) + r(13),
            r(4) + r(5) + r(6) + r(7),
            -r(7) - r(8),
            -r(12) + r(7) + r(9),
            -r(9) - r(10) + r(8) + r(11),
            r(9),
            -r(11) + r(10),
            -r(13) + r(12),
            r(14),
            -r(18) - r(19) + r(16),
            -r(20),
            r(20),
            -r(21) - r(22) - r(24) + r(23) + r(25),
            -r(25) + r(24),
        ]);
    }
}

problem! {
    /// The Belousov-Zhabotinskii reaction, which oscillates, stiff (Hairer and Wanner, Solving Ordinary Differential
    /// Equations II, section IV.10).
    Oregonator {}, oregonator: "oregonator"
}

impl Problem for Oregonator {
    const NAME: &'static str = "oregonator";
    const END: f64 = 360.0;

    fn start(states: &mut [f64]) {
        states.copy_from_slice(&[1.0, 2.0, 3.0]);
    }

    fn rates<T: Number>(&self, states: &[T], rates: &mut [T]) {
        let [a, b, c] = from_fn(|state| states[state]);
        rates.copy_from_slice(&[
            (b + a * (-a * 8.375e-6 - b + 1.0)) * 77.27,
            (c - (a + 1.0) * b) / 77.27,
            (a - c) * 0.161,
        ]);
    }
}

problem! {
    /// A satellite around Earth and Moon on Arenstorf's closed orbit (Hairer, Nørsett and Wanner, section II.0).
    Arenstorf {}, arenstorf: "arenstorf"
}

impl Problem for Arenstorf {
    const NAME: &'static str = "arenstorf";
    const END: f64 = 17.065_216_560_157_964;

    fn start(states: &mut [f64]) {
        states.copy_from_slice(&[0.994, 0.0, 0.0, -2.001_585_106_379_082_5]);
    }

    fn rates<T: Number>(&self, states: &[T], rates: &mut [T]) {
        let [x, y, vx, vy] = from_fn(|state| states[state]);
        let moon = 0.012_277_471;
        let earth = 1.0 - moon;
        let (of_earth, of_moon) = (x + moon, x - earth);
        let cubed = |square: T| square * square.sqrt();
        let pull_of_earth = cubed(of_earth * of_earth + y * y).recip() * earth;
        let pull_of_moon = cubed(of_moon * of_moon + y * y).recip() * moon;
        rates.copy_from_slice(&[
            vx,
            vy,
            x + vy * 2.0 - of_earth * pull_of_earth - of_moon * pull_of_moon,
            y - vx * 2.0 - y * pull_of_earth - y * pull_of_moon,
        ]);
    }
}

problem! {
    /// Lorenz's chaotic flow (Journal of the Atmospheric Sciences 20, 1963).
    Lorenz {}, lorenz: "lorenz"
}

impl Problem for Lorenz {
    const NAME: &'static str = "lorenz";
    const END: f64 = 10.0;

    fn start(states: &mut [f64]) {
        states.fill(1.0);
    }

    fn rates<T: Number>(&self, states: &[T], rates: &mut [T]) {
        let [x, y, z] = from_fn(|state| states[state]);
        rates.copy_from_slice(&[(y - x) * 10.0, x * (-z + 28.0) - y, x * y - z * (8.0 / 3.0)]);
    }
}

/// The cells along an edge of the heated square.
const HEATED: usize = 50;

problem! {
    /// Conduction in a square with cold edges, from two waves.
    Heat {}, heat: "heat"
}

impl Problem for Heat {
    const NAME: &'static str = "heat";
    const END: f64 = 0.1;

    fn start(states: &mut [f64]) {
        for (cell, state) in states.iter_mut().enumerate() {
            let [x, y] = [cell % HEATED, cell / HEATED]
                .map(|place| std::f64::consts::PI * (place + 1) as f64 / (HEATED + 1) as f64);
            *state = x.sin() * y.sin() + 0.5 * (3.0 * x).sin() * (2.0 * y).sin();
        }
    }

    fn rates<T: Number>(&self, states: &[T], rates: &mut [T]) {
        let rate = (HEATED + 1).pow(2) as f64;
        for (cell, slope) in rates.iter_mut().enumerate() {
            let (column, row) = (cell % HEATED, cell / HEATED);
            let mut sum = states[cell] * -4.0;
            if column > 0 {
                sum += states[cell - 1];
            }
            if column + 1 < HEATED {
                sum += states[cell + 1];
            }
            if row > 0 {
                sum += states[cell - HEATED];
            }
            if row + 1 < HEATED {
                sum += states[cell + HEATED];
            }
            *slope = sum * rate;
        }
    }
}

/// The cells along an edge of the Brusselator.
const REACTING: usize = 32;

problem! {
    /// The Brusselator's reaction with diffusion in an insulated square (Hairer, Nørsett and Wanner, section II.10, with
    /// ten times the diffusion). The two concentrations of a cell are neighbours.
    Brusselator {}, brusselator: "brusselator"
}

impl Problem for Brusselator {
    const NAME: &'static str = "brusselator";
    const END: f64 = 7.5;

    fn start(states: &mut [f64]) {
        for (cell, concentrations) in states.chunks_exact_mut(2).enumerate() {
            let [x, y] = [cell % REACTING, cell / REACTING].map(|place| place as f64 / (REACTING - 1) as f64);
            concentrations.copy_from_slice(&[0.5 + y, 1.0 + 5.0 * x]);
        }
    }

    fn rates<T: Number>(&self, states: &[T], rates: &mut [T]) {
        let diffusion = 0.02 * (REACTING - 1).pow(2) as f64;
        // Beyond an insulated edge is the mirror image.
        let mirrored = |place: usize| {
            let before = if place == 0 { 1 } else { place - 1 };
            let after = if place + 1 == REACTING { REACTING - 2 } else { place + 1 };
            [before, after]
        };
        for row in 0..REACTING {
            let [above, below] = mirrored(row);
            for column in 0..REACTING {
                let [left, right] = mirrored(column);
                let cell = |row: usize, column: usize| 2 * (row * REACTING + column);
                let here = cell(row, column);
                let spread = |of: usize| {
                    let around = states[cell(above, column) + of]
                        + states[cell(below, column) + of]
                        + states[cell(row, left) + of]
                        + states[cell(row, right) + of];
                    (around - states[here + of] * 4.0) * diffusion
                };
                let (u, v) = (states[here], states[here + 1]);
                let reaction = u * u * v;
                rates[here] = reaction - u * 4.4 + 1.0 + spread(0);
                rates[here + 1] = u * 3.4 - reaction + spread(1);
            }
        }
    }
}

problem! {
    /// 1,000 masses between two walls, joined by springs and dampers, from two waves. Place and speed of a mass are
    /// neighbours.
    Chain {}, chain: "chain"
}

impl Problem for Chain {
    const NAME: &'static str = "chain";
    const END: f64 = 2.0;

    fn start(states: &mut [f64]) {
        let masses = states.len() / 2;
        for (mass, motion) in states.chunks_exact_mut(2).enumerate() {
            let angle = std::f64::consts::PI * (mass + 1) as f64 / (masses + 1) as f64;
            motion[0] = angle.sin() + 0.2 * (5.0 * angle).sin();
        }
    }

    fn rates<T: Number>(&self, states: &[T], rates: &mut [T]) {
        let masses = states.len() / 2;
        let stiffness = (masses + 1).pow(2) as f64;
        for mass in 0..masses {
            let tension = |of: usize| {
                let here = 2 * mass + of;
                let mut sum = states[here] * -2.0;
                if mass > 0 {
                    sum += states[here - 2];
                }
                if mass + 1 < masses {
                    sum += states[here + 2];
                }
                sum * stiffness
            };
            rates[2 * mass] = states[2 * mass + 1];
            rates[2 * mass + 1] = tension(0) + tension(1) * 0.001;
        }
    }
}

problem! {
    /// 200 states that decay at rates over four decades and drive each other, all by all.
    Dense {}, dense: "dense"
}

impl Problem for Dense {
    const NAME: &'static str = "dense";
    const END: f64 = 10.0;

    fn start(states: &mut [f64]) {
        for (place, state) in states.iter_mut().enumerate() {
            *state = 1.0 + 0.5 * (place as f64).cos();
        }
    }

    fn rates<T: Number>(&self, states: &[T], rates: &mut [T]) {
        let weights: [f64; 200] = from_fn(|distance| 0.005 / (1 + distance) as f64);
        for (place, slope) in rates.iter_mut().enumerate() {
            let decay = 10_f64.powf(4.0 * place as f64 / 199.0 - 1.0);
            *slope = states[place] * -decay;
            for (other, &state) in states.iter().enumerate() {
                *slope += state * state * weights[place.abs_diff(other)];
            }
        }
    }
}

problem! {
    /// 100 oscillators that pull each other into step, all by all (Kuramoto, 1975), not stiff.
    Kuramoto {}, kuramoto: "kuramoto"
}

impl Problem for Kuramoto {
    const NAME: &'static str = "kuramoto";
    const END: f64 = 20.0;

    fn start(states: &mut [f64]) {
        for (place, state) in states.iter_mut().enumerate() {
            *state = 3.0 * (7.0 * place as f64).sin();
        }
    }

    fn rates<T: Number>(&self, states: &[T], rates: &mut [T]) {
        let coupling = 1.5 / states.len() as f64;
        for (place, rate) in rates.iter_mut().enumerate() {
            let pull = states.iter().fold(T::from(0.0), |sum, &other| sum + (other - states[place]).sin());
            *rate = pull * coupling + (3.0 * place as f64).sin();
        }
    }
}

problem! {
    /// 20 pendulums in a row, joined by springs, not stiff. Angle and speed of one are neighbours.
    Pendulums {}, pendulums: "pendulums"
}

impl Problem for Pendulums {
    const NAME: &'static str = "pendulums";
    const END: f64 = 10.0;

    fn start(states: &mut [f64]) {
        for (place, motion) in states.chunks_exact_mut(2).enumerate() {
            motion[0] = 1.5 * (0.4 * place as f64).cos();
        }
    }

    fn rates<T: Number>(&self, states: &[T], rates: &mut [T]) {
        let angles = || states.iter().step_by(2).copied();
        let mut before = None;
        for ((here, after), place) in angles().zip(angles().skip(1).map(Some).chain([None])).zip(0..) {
            let of_springs = [before, after].into_iter().flatten();
            let torque = of_springs.fold(here.sin() * -9.81, |sum, other: T| sum + (other - here) * 5.0);
            [rates[2 * place], rates[2 * place + 1]] = [states[2 * place + 1], torque];
            before = Some(here);
        }
    }
}

/// The nodes of the network.
const NODES: usize = 300;

problem! {
    /// A thermal network: 300 nodes with capacities over four decades, joined by a ring and 600 random links; every tenth
    /// is heated, and all radiate. Temperatures are in K, stiff.
    Network {}, network: "network"
}

/// A pseudo-random number from 0 to 1 (Steele, Lea and Flood's `SplitMix64`).
fn random(place: usize) -> f64 {
    let mut bits = (place as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((bits ^ (bits >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// The links of the network: two nodes and the conductance in W/K.
static LINKS: LazyLock<Vec<(usize, usize, f64)>> = LazyLock::new(|| {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a node")]
    let other = |link: usize| match link {
        0..NODES => (link + 1) % NODES,
        _ => (random(5000 + link) * NODES as f64) as usize,
    };
    let links =
        (0..3 * NODES).map(|link| (link % NODES, other(link), 0.1 * 100_f64.powf(random(9000 + link))));
    links.filter(|(one, other, _)| one != other).collect()
});
/// The reciprocal of each node's capacity, in K/J.
static PER_CAPACITY: LazyLock<Vec<f64>> =
    LazyLock::new(|| (0..NODES).map(|node| 10_f64.powf(-4.0 * random(20_000 + node))).collect());

impl Problem for Network {
    const NAME: &'static str = "network";
    const END: f64 = 3600.0;

    fn start(states: &mut [f64]) {
        states.fill(293.15);
    }

    fn rates<T: Number>(&self, states: &[T], rates: &mut [T]) {
        for (node, (rate, &temperature)) in rates.iter_mut().zip(states).enumerate() {
            let square = temperature * temperature;
            let heating = if node % 10 == 0 { 50.0 } else { 0.0 };
            *rate = (square * square - 293.15_f64.powi(4)) * -1.134e-9 + heating;
        }
        for &(one, other, conductance) in &*LINKS {
            let flow = (states[one] - states[other]) * conductance;
            rates[one] -= flow;
            rates[other] += flow;
        }
        for (rate, &factor) in rates.iter_mut().zip(&*PER_CAPACITY) {
            *rate = *rate * factor;
        }
    }
}

/// A period of the converter's switch in s, and how much of it the switch is on.
const PERIOD: f64 = 1e-4;
const DUTY: f64 = 0.4;

problem! {
    /// A converter that steps 24 V down: current and voltage behind a switch, which time events turn on and off.
    Converter { switched: u32 }, converter: "converter" {
        fn next_event(&self, _time: f64, _variables: &converter::Variables) -> Option<f64> {
            let (period, is_on) = (self.switched / 2, self.is_on());
            Some((f64::from(period) + if is_on { DUTY } else { 1.0 }) * PERIOD)
        }

        fn event(
            &mut self,
            event: &Event<'_>,
            _variables: &mut converter::Variables,
            _context: &mut Context<'_>,
        ) -> Result<(), Error> {
            self.switched += u32::from(event.is_due);
            Ok(())
        }
    }
}

impl Converter {
    /// Whether the source is connected: from the begin of a period.
    fn is_on(&self) -> bool {
        self.switched.is_multiple_of(2)
    }
}

impl Problem for Converter {
    const NAME: &'static str = "converter";
    const END: f64 = 0.01;

    fn start(_states: &mut [f64]) {}

    fn rates<T: Number>(&self, states: &[T], rates: &mut [T]) {
        let (inductance, capacitance, resistance) = (1e-4, 1e-4, 2.0);
        let (current, voltage) = (states[0], states[1]);
        let source = if self.is_on() { 24.0 } else { 0.0 };
        rates[0] = (-voltage + source) / inductance;
        rates[1] = (current - voltage / resistance) / capacitance;
    }
}
