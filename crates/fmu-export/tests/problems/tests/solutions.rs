//! The problems at a tolerance of 1e-8 against the solutions that `reference.py` printed; the Arenstorf orbit, which lets
//! errors grow by millions, at 1e-10.

use fmu_export::{Integrated, Numbered as _, Simulation};
use fmu_export_problems::{
    Arenstorf, Brusselator, Chain, Converter, Dense, Heat, Kuramoto, Lorenz, Network, Oregonator, Pendulums,
    Pleiades, Pollution, Problem, Reference,
};

/// A step errs by at most the tolerance, relative to a state and its nominal value. The steps are some hundred, so that
/// together they err by less than so many tolerances, times the growth of an error until the end.
const ACCUMULATED: f64 = 100.0;

/// Runs a problem in few and in many communication steps.
fn agrees<P: Problem>(tolerance: f64) {
    let reference = Reference::of::<P>();
    for steps in [10, 1000] {
        let mut simulation = Simulation::<Integrated<P>>::default();
        simulation.experiment.tolerance = Some(tolerance);
        simulation.initialize().unwrap();
        for _ in 0..steps {
            simulation.step(P::END / f64::from(steps)).unwrap();
        }
        let mut states = Vec::new();
        P::Variables::each_state(&simulation.variables, |_, state: f64| states.push(state));
        let error = reference.error(&states) / (tolerance * reference.growth);
        assert!(error <= ACCUMULATED, "{} in {steps} steps: {error:.0} tolerances", P::NAME);
    }
}

macro_rules! problems {
    ($($name:ident: $problem:ident $tolerance:literal,)*) => {$(
        #[test]
        fn $name() {
            agrees::<$problem>($tolerance);
        }
    )*};
}
problems! {
    pleiades_agrees_with_dop853: Pleiades 1e-8,
    pollution_agrees_with_radau: Pollution 1e-8,
    oregonator_agrees_with_radau: Oregonator 1e-8,
    arenstorf_orbit_is_closed: Arenstorf 1e-10,
    lorenz_agrees_with_dop853: Lorenz 1e-8,
    heat_follows_its_closed_form: Heat 1e-8,
    brusselator_agrees_with_radau: Brusselator 1e-8,
    chain_follows_its_closed_form: Chain 1e-8,
    dense_agrees_with_radau: Dense 1e-8,
    converter_follows_its_closed_form: Converter 1e-8,
    kuramoto_agrees_with_dop853: Kuramoto 1e-8,
    pendulums_agree_with_dop853: Pendulums 1e-8,
    network_agrees_with_radau: Network 1e-8,
}
