//! The choice of the method in random systems: it neither goes back and forth nor costs much more than the better method
//! alone. Costs are counted, in operations.

use super::*;

/// Random numbers (splitmix64).
pub(super) struct Random(pub(super) u64);

impl Random {
    /// A number from 0 to 1.
    pub(super) fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((x ^ (x >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A position below a number.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it is below the number")]
    pub(super) fn below(&mut self, number: usize) -> usize {
        (self.number() * number as f64) as usize
    }
}

/// Nodes that exchange heat by random links, radiate, and lose heat to the ambient.
#[derive(Clone)]
pub(super) struct Network {
    links: Vec<(usize, usize, f64)>,
    /// The loss of each node, and the reciprocal of its capacity.
    nodes: Vec<(f64, f64)>,
}

impl Network {
    /// A network of so many nodes with so many links each, with capacities over a range.
    pub(super) fn new(size: usize, links: usize, stiffness: f64, random: &mut Random) -> Self {
        let conductance = |random: &mut Random| 0.1 * 100.0_f64.powf(random.number());
        // A ring, so that no node is apart.
        let mut all: Vec<_> = (0..size).map(|node| (node, (node + 1) % size, conductance(random))).collect();
        while all.len() < links * size / 2 {
            let (one, other) = (random.below(size), random.below(size));
            if one != other {
                all.push((one, other, conductance(random)));
            }
        }
        let nodes = (0..size)
            .map(|node| {
                let loss = if node.is_multiple_of(10) { conductance(random) } else { 0.0 };
                (loss, stiffness.powf(-random.number()).recip() / stiffness)
            })
            .collect();
        Self { links: all, nodes }
    }

    pub(super) fn start(&self, random: &mut Random) -> Vec<f64> {
        self.nodes.iter().map(|_| random.number()).collect()
    }

    /// The slowest time constant, without radiation, by inverse iteration.
    pub(super) fn slowest(&self) -> f64 {
        let size = self.nodes.len();
        let (mut matrix, mut pivots) = (vec![0.0; size * size], vec![0; size]);
        let mut add = |row: usize, column: usize, value: f64| matrix[row * size + column] += value;
        for &(one, other, conductance) in &self.links {
            for (row, column) in [(one, other), (other, one)] {
                add(row, row, -self.nodes[row].1 * conductance);
                add(row, column, self.nodes[row].1 * conductance);
            }
        }
        for (node, (loss, per_capacity)) in self.nodes.iter().enumerate() {
            add(node, node, -per_capacity * loss);
        }
        let mut factors = vec![0.0; size * size];
        assert!(dense::factor(0.0, &matrix, &mut factors, &mut pivots));
        let mut vector = vec![1.0; size];
        let mut longest = 0.0;
        for _ in 0..30 {
            dense::solve(&factors, &pivots, &mut vector);
            longest = vector.iter().fold(0.0_f64, |most, element| most.max(element.abs()));
            for element in &mut vector {
                *element /= longest;
            }
        }
        longest
    }
}

impl Rates for Network {
    fn rates<T: Number>(&self, _time: f64, states: &[T]) -> Vec<T> {
        let mut rates: Vec<_> = states
            .iter()
            .zip(&self.nodes)
            .map(|(&state, (loss, _))| state * state * state * state.abs() * -0.05 - state * *loss)
            .collect();
        for &(one, other, conductance) in &self.links {
            let flow = (states[one] - states[other]) * conductance;
            rates[one] -= flow;
            rates[other] += flow;
        }
        for (rate, (_, per_capacity)) in rates.iter_mut().zip(&self.nodes) {
            *rate = *rate * *per_capacity;
        }
        rates
    }
}

/// The operations of a factorization and of a solution for so many states with a pattern.
pub(super) fn of_equations(pattern: &Pattern, size: usize) -> [f64; 2] {
    if pattern.is_full() {
        let size = size as f64;
        [size * size * size / 3.0, size * size]
    } else {
        let elimination = pattern.elimination();
        let [one, none] = [1, 0].map(|solutions| elimination.multiplications(solutions) as f64);
        // The places of the elements are looked up.
        [2.0 * none, 2.0 * (one - none)]
    }
}

/// What a run costs.
#[derive(Debug)]
struct Cost {
    switches: u32,
    operations: f64,
}

/// Integrates in communication steps, unless it costs more operations than the most. The system counts.
fn cost<S: System>(
    mut system: S,
    counts: impl Fn(&S) -> [u32; 6],
    start: &[f64],
    (end, steps): (f64, u32),
    most: f64,
) -> Option<Cost> {
    let size = start.len();
    let nominals = vec![1.0; size];
    let tolerance = Tolerance { relative: 1e-6, nominals: &nominals };
    let pattern = system.pattern(0.0, start);
    let operations = pattern.operations() as f64;
    let [of_factors, of_solution] = of_equations(&pattern, size);
    let mut integrator = Integrator::new(size);
    let (mut states, mut switches, mut found) = (start.to_vec(), 0, None);
    for step in 0..steps {
        let [mut time, target] = [step, step + 1].map(|step| end * f64::from(step) / f64::from(steps));
        while time < target {
            let was = integrator.switch.is_implicit;
            let span = Span { begin: time, end: target, limit: end.max(target), rounding: 1e-12 * end };
            time = integrator.step(&mut system, span, &states, &tolerance, &mut 0).unwrap();
            integrator.states_at(&mut system, time, &mut states);
            switches += u32::from(was != integrator.switch.is_implicit);
            let [_, _, _, evaluations, directions, rows] = counts(&system);
            let [factors, solutions] = integrator.work.as_ref().unwrap().matrix.counts;
            let operations = operations * f64::from(evaluations + 2 * directions + 4 * rows)
                + of_factors * f64::from(factors)
                + of_solution * f64::from(solutions);
            if operations > most {
                return None;
            }
            found = Some(Cost { switches, operations });
        }
    }
    found
}

/// The switches of a run in a number of steps, and its operations over those of the better method alone.
fn compare<R: Rates + Clone>(rates: &R, start: &[f64], run: (f64, u32)) -> (u32, f64) {
    let counted = || Counted::<R, true>::new(rates.clone());
    let of_one = |system: &Counted<R, true>| system.counts;
    let stiff = cost(counted(), of_one, start, run, f64::INFINITY).unwrap();
    let nonstiff = cost(Explicit(counted()), |system| system.0.counts, start, run, stiff.operations);
    let best = nonstiff.map_or(stiff.operations, |cost| cost.operations);
    // Far more is as wrong.
    let chosen = cost(Automatic(counted()), |system| system.0.counts, start, run, 10.0 * best);
    chosen.map_or((u32::MAX, f64::INFINITY), |cost| (cost.switches, cost.operations / best))
}

/// Checks random networks of sizes within a range.
fn check_networks(seed: u64, count: u64, sizes: [usize; 2]) {
    for number in 0..count {
        let mut random = Random(seed + number);
        let size = sizes[0] + random.below(sizes[1] - sizes[0] + 1);
        let links = 2 + random.below(9);
        let stiffness = 1e8_f64.powf(random.number());
        let network = Network::new(size, links, stiffness, &mut random);
        let start = network.start(&mut random);
        for steps in [10, 1000] {
            let (switches, ratio) = compare(&network, &start, (10.0 * network.slowest(), steps));
            assert!(
                switches <= 10 && ratio <= 1.5,
                "{switches} switches, {ratio} times the work in {steps} steps: {size} nodes with {links} links, \
                 stiffness {stiffness:e}"
            );
        }
    }
}

#[test]
fn the_methods_do_not_go_back_and_forth_in_networks() {
    check_networks(1, 4, [200, 260]);
}

#[test]
#[ignore = "part of `tests/run release`"]
fn the_methods_do_not_go_back_and_forth_in_twenty_networks() {
    check_networks(1, 20, [50, 500]);
}

/// Diffusion and reaction of a fast species with a slow one that does not diffuse, on a grid of random coefficients.
#[derive(Clone)]
pub(super) struct Reaction {
    width: usize,
    conductances: Vec<[f64; 2]>,
    speeds: Vec<f64>,
    slowness: f64,
}

impl Reaction {
    /// A grid of so many cells a side, of conductances around `speed` over a range.
    pub(super) fn new(width: usize, spread: f64, speed: f64, random: &mut Random) -> Self {
        let cells = width * width;
        let mut number = || speed * spread.powf(random.number() - 0.5);
        let conductances = (0..cells).map(|_| [number(), number()]).collect();
        let speeds = (0..cells).map(|_| 10.0_f64.powf(2.0 * random.number())).collect();
        Self { width, conductances, speeds, slowness: 0.05 + random.number() }
    }
}

impl Rates for Reaction {
    fn rates<T: Number>(&self, _time: f64, states: &[T]) -> Vec<T> {
        let cells = self.width * self.width;
        let mut rates = vec![T::from(0.0); 2 * cells];
        for cell in 0..cells {
            let (u, v) = (states[cell], states[cells + cell]);
            rates[cell] += (u - u * u * u - v) * self.speeds[cell];
            rates[cells + cell] = (u - v * 0.5 + 0.1) * self.slowness;
            let ends = [(cell + 1).is_multiple_of(self.width), cell + self.width >= cells];
            for ((stride, is_end), conductance) in
                [1, self.width].into_iter().zip(ends).zip(self.conductances[cell])
            {
                if !is_end {
                    let flow = (u - states[cell + stride]) * conductance;
                    rates[cell] -= flow;
                    rates[cell + stride] += flow;
                }
            }
        }
        rates
    }
}

#[test]
#[ignore = "part of `tests/run release`"]
fn relaxation_oscillations_cost_little_more_than_by_the_better_method() {
    // With as many changes of the method as there are phases.
    for number in 0..12 {
        let mut random = Random(1000 + number);
        let width = 5 + random.below(10);
        let (spread, speed) = (1e4_f64.powf(random.number()), 1e5_f64.powf(random.number()));
        let reaction = Reaction::new(width, spread, speed, &mut random);
        let start: Vec<_> = (0..2 * width * width).map(|_| 2.0 * random.number() - 1.0).collect();
        for steps in [10, 1000] {
            let (_, ratio) = compare(&reaction, &start, (30.0, steps));
            assert!(
                ratio <= 1.5,
                "{ratio} times the work in {steps} steps: {width} nodes wide, spread {spread:e}, speed {speed:e}"
            );
        }
    }
}
