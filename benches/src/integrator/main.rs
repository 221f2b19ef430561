//! Measures the built-in integrator and CVODE on the problems of the integrator's tests, with the same equations and
//! exact Jacobians: `benches/integrator/run` calls it with the folder of SUNDIALS' libraries.
//!
//! Further arguments are the problems, all without.
//!
//! Prints, as CSV, the problem, communication steps, way, solver, tolerance, largest error at the end and processor time
//! in s, without the evaluations of the outputs.

mod jacobian;
mod sundials;

use std::ffi::{c_int, c_long};
use std::hint::black_box;
use std::path::Path;
use std::{array, env, iter};

use fmu_export::{Accessed as _, Described as _, InputSignal, Integrated, Numbered as _, Simulation};
use fmu_export_problems::{
    Arenstorf, Brusselator, Chain, Converter, Dense, Heat, Kuramoto, Lorenz, Network, Oregonator, Pendulums,
    Pleiades, Pollution, Problem, Reference,
};

use crate::jacobian::Elements;
use crate::sundials::{Cvode, Solver, Sundials, Way};

/// The smallest error that is compared; below it, tighter tolerances are left out.
const LEAST_ERROR: f64 = 1e-9;
/// Each time is the median of so many, far apart, each of as many runs as take this long, in s.
const ROUNDS: usize = 3;
const LONG: f64 = 1e-3;
/// No further round is needed after so many s.
const LONGEST: f64 = 0.5;
/// The tolerance and communication steps by which the solvers of CVODE are chosen, and how many times the time of the
/// fastest one may take.
const TRIED: (f64, u32) = (1e-6, 10);
const SLOW: f64 = 10.0;

#[repr(C)]
struct Timespec {
    seconds: c_long,
    nanoseconds: c_long,
}

unsafe extern "C" {
    fn clock_gettime(clock: c_int, time: *mut Timespec) -> c_int;
}

/// The processor time of this process in s.
fn processor_time() -> f64 {
    const OF_PROCESS: c_int = 2;
    let mut time = Timespec { seconds: 0, nanoseconds: 0 };
    // SAFETY: the structure is that of Linux on 64-bit processors, the only ones with the package's libraries.
    assert_eq!(unsafe { clock_gettime(OF_PROCESS, &raw mut time) }, 0);
    time.seconds as f64 + 1e-9 * time.nanoseconds as f64
}

/// The states at the end and the processor time in s.
type Run = (Vec<f64>, f64);

/// Runs a problem by the built-in integrator. The inputs are set at each point or keep their values.
fn run_built_in<P: Problem>(tolerance: f64, steps: u32, way: Way) -> Run {
    let mut simulation = Simulation::<Integrated<P>>::default();
    simulation.experiment.tolerance = Some(tolerance);
    simulation.experiment.stop_time = Some(P::END);
    simulation.initialize().expect("problems can be initialized");
    let mut inputs = InputSignal::constant(simulation.variables.inputs());
    if way != Way::Restart {
        inputs = inputs.kept();
    }
    let begin = processor_time();
    for _ in 0..steps {
        simulation.step_with(P::END / f64::from(steps), &inputs).expect("problems can be solved");
    }
    let seconds = processor_time() - begin;
    let mut states = vec![];
    P::Variables::each_state(&simulation.variables, |_, state: f64| states.push(state));
    (states, seconds)
}

/// The time in s of an evaluation of the rates.
fn evaluation<P: Problem>() -> f64 {
    let mut states = vec![0.0; P::Variables::STATE_NOMINALS.len()];
    P::start(&mut states);
    let mut rates = states.clone();
    let (begin, mut count) = (processor_time(), 0);
    loop {
        for _ in 0..10 {
            P::default().rates(black_box(&states), &mut rates);
            black_box(&rates);
        }
        count += 10;
        let seconds = processor_time() - begin;
        if seconds > 10.0 * LONG {
            return seconds / f64::from(count);
        }
    }
}

/// What is compared.
struct Contender<'a> {
    way: Way,
    name: String,
    run: Box<dyn FnMut(f64, u32) -> Option<Run> + 'a>,
    /// The error and the times at the present tolerance.
    error: f64,
    times: Vec<f64>,
    /// Whether the error is small enough.
    is_done: bool,
}

impl<'a> Contender<'a> {
    fn new(way: Way, name: String, run: impl FnMut(f64, u32) -> Option<Run> + 'a) -> Self {
        Self { way, name, run: Box::new(run), error: f64::NAN, times: vec![], is_done: false }
    }
}

impl Contender<'_> {
    /// Measures a round, unless those before took long enough.
    fn measure(&mut self, tolerance: f64, steps: u32, reference: &Reference) {
        if self.times.iter().sum::<f64>() > LONGEST {
            return;
        }
        let (mut sum, mut count) = (0.0, 0);
        while sum < LONG {
            let Some((states, seconds)) = (self.run)(tolerance, steps) else { return };
            self.error = reference.error(&states);
            sum += seconds;
            count += 1;
        }
        self.times.push(sum / f64::from(count));
    }
}

/// The solvers of CVODE that suit a problem: the fastest with a matrix, and those without unless they are much slower.
fn solvers<P: Problem>(sundials: &Sundials, elements: &Elements) -> Vec<Solver> {
    let mut candidates = vec![Solver::Adams, Solver::Gmres];
    let size = P::Variables::STATE_NOMINALS.len();
    if size < 1000 {
        candidates.extend([Solver::Dense, Solver::LapackDense]);
    }
    if elements.upper + elements.lower < size / 2 {
        candidates.extend([Solver::Band, Solver::LapackBand]);
    }
    if elements.share() < 0.25 {
        candidates.push(Solver::SuperLuMt);
    }
    let time = |&solver: &Solver| {
        let mut times: [f64; 3] = array::from_fn(|_| {
            let run = Cvode::<P>::new(sundials, solver, elements).run(TRIED.0, TRIED.1, Way::Free);
            run.map_or(f64::INFINITY, |(_, seconds)| seconds)
        });
        times.sort_by(f64::total_cmp);
        times[1]
    };
    let times: Vec<_> = candidates.iter().map(time).collect();
    for (solver, seconds) in candidates.iter().zip(&times) {
        eprintln!("{} by CVODE with {solver:?}: {:.3} ms", P::NAME, 1e3 * seconds);
    }
    let timed = || candidates.iter().copied().zip(times.iter().copied());
    let with_matrix = timed().filter(|(solver, _)| solver.has_matrix());
    let (fastest, least) =
        with_matrix.min_by(|(_, one), (_, other)| one.total_cmp(other)).expect("there are some");
    let without = timed().filter(|(solver, seconds)| !solver.has_matrix() && *seconds < SLOW * least);
    iter::once(fastest).chain(without.map(|(solver, _)| solver)).collect()
}

type Measure = fn(&Sundials);

/// Measures a problem.
fn measure<P: Problem>(sundials: &Sundials) {
    let elements = Elements::of::<P>();
    let solvers = solvers::<P>(sundials, &elements);
    let (reference, evaluation) = (Reference::of::<P>(), evaluation::<P>());
    for steps in [10, 1000] {
        let mut contenders = vec![];
        for way in [Way::Free, Way::Stop, Way::Restart] {
            if way != Way::Stop {
                contenders.push(Contender::new(way, "built in".to_owned(), move |tolerance, steps| {
                    let (states, seconds) = run_built_in::<P>(tolerance, steps, way);
                    Some((states, seconds - f64::from(steps) * evaluation))
                }));
            }
            for &solver in &solvers {
                let mut cvode = Cvode::<P>::new(sundials, solver, &elements);
                contenders.push(Contender::new(way, format!("{solver:?}"), move |tolerance, steps| {
                    cvode.run(tolerance, steps, way)
                }));
            }
        }
        for tolerance in (2..=12).map(|digits| 10_f64.powi(-digits)) {
            contenders.retain(|contender| !contender.is_done);
            for _ in 0..ROUNDS {
                for contender in &mut contenders {
                    contender.measure(tolerance, steps, &reference);
                }
            }
            for Contender { way, name, error, times, is_done, .. } in &mut contenders {
                times.sort_by(f64::total_cmp);
                // None where the solver fails, as some do at the loosest tolerances.
                if let Some(seconds) = times.get(times.len() / 2) {
                    println!("{},{steps},{way:?},{name},{tolerance:e},{error:e},{seconds:e}", P::NAME);
                    *is_done = *error < LEAST_ERROR;
                }
                times.clear();
            }
        }
    }
}

fn main() {
    let mut arguments = env::args().skip(1);
    let folder = arguments.next().expect("the first argument is the folder of SUNDIALS' libraries");
    let sundials = Sundials::load(Path::new(&folder));
    let named: Vec<_> = arguments.collect();
    let problems: [(&str, Measure); 13] = [
        (Lorenz::NAME, measure::<Lorenz>),
        (Arenstorf::NAME, measure::<Arenstorf>),
        (Pleiades::NAME, measure::<Pleiades>),
        (Converter::NAME, measure::<Converter>),
        (Oregonator::NAME, measure::<Oregonator>),
        (Pollution::NAME, measure::<Pollution>),
        (Dense::NAME, measure::<Dense>),
        (Chain::NAME, measure::<Chain>),
        (Brusselator::NAME, measure::<Brusselator>),
        (Heat::NAME, measure::<Heat>),
        (Pendulums::NAME, measure::<Pendulums>),
        (Kuramoto::NAME, measure::<Kuramoto>),
        (Network::NAME, measure::<Network>),
    ];
    for (name, measure) in problems {
        if named.is_empty() || named.iter().any(|named| named == name) {
            measure(&sundials);
        }
    }
}
