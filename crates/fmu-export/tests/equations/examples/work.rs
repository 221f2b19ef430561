//! Prints what the built-in integrator takes for models of the tests, and the states that it ends at, as CSV: system,
//! tolerance, right-hand sides, Jacobians and states. `benches/integrator/run` compares it with other solvers.

use std::sync::atomic::{AtomicU64, Ordering};

use fmu_export::{
    Context, Described as _, Equations, Error, EvaluationOf, Event, Integrated, Number, Numbered as _,
    Persistent, Simulation,
};
use fmu_export_equations::{BouncingBall, Decay, Hires, Robertson, VanDerPol};

/// Evaluations with numbers and with dual numbers.
static NUMBERS: AtomicU64 = AtomicU64::new(0);
static DUALS: AtomicU64 = AtomicU64::new(0);

/// A model of equations whose evaluations are counted.
#[derive(Clone, Debug, Default, Persistent)]
struct Counted<E: Persistent>(E);

impl<E: Equations> Equations for Counted<E> {
    type Variables = E::Variables;

    fn evaluate<T: Number>(&self, time: T, variables: EvaluationOf<'_, E, T>) {
        let count = if size_of::<T>() == size_of::<f64>() { &NUMBERS } else { &DUALS };
        count.fetch_add(1, Ordering::Relaxed);
        self.0.evaluate(time, variables);
    }

    fn event_indicators(&self, time: f64, variables: &E::Variables, indicators: &mut [f64]) {
        self.0.event_indicators(time, variables, indicators);
    }

    fn event(
        &mut self,
        event: &Event<'_>,
        variables: &mut E::Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        self.0.event(event, variables, context)
    }
}

/// Runs a system to its end in one communication step, at each tolerance.
fn run<E: Equations>(name: &str, end: f64, set: impl Fn(&mut E::Variables)) {
    for tolerance in [1e-4, 1e-6, 1e-8, 1e-10] {
        let mut simulation = Simulation::<Integrated<Counted<E>>>::default();
        simulation.experiment.tolerance = Some(tolerance);
        set(&mut simulation.variables);
        simulation.initialize().expect("it can be initialized");
        NUMBERS.store(0, Ordering::Relaxed);
        DUALS.store(0, Ordering::Relaxed);
        simulation.step(end).expect("it can be integrated");
        let mut states = String::new();
        E::Variables::each_state(&simulation.variables, |_, state: f64| states += &format!(",{state:?}"));
        // A Jacobian takes one evaluation for each state, and one for the derivative with respect to time.
        let jacobian = E::Variables::STATE_NOMINALS.len() as u64 + 1;
        let (numbers, duals) = (NUMBERS.load(Ordering::Relaxed), DUALS.load(Ordering::Relaxed));
        println!("{name},{tolerance:?},{numbers},{}{states}", duals / jacobian);
    }
}

fn main() {
    run::<Decay>("decay", 3.0, |_| {});
    run::<VanDerPol>("van_der_pol_1", 20.0, |_| {});
    run::<BouncingBall>("bouncing_ball", 2.0, |_| {});
    run::<Robertson>("robertson", 4e5, |_| {});
    run::<VanDerPol>("van_der_pol_1000", 2000.0, |variables| variables.parameters.mu = 1000.0);
    run::<Hires>("hires", 321.8122, |_| {});
}
