//! Nodes that exchange by two links each with others at random, with conductances over three decades, that grow with the
//! difference.

use fmu_export::{Equations, Number};

fmu_export::fmu!(equations struct Network);

impl Equations for Network {
    type Variables = Variables;

    fn initialize<T: Number>(&self, variables: &mut fmu_export::VariablesOf<Self, T>) {
        for (node, state) in variables.states.x.iter_mut().enumerate() {
            *state = T::from((node as f64).sin());
        }
    }

    fn evaluate<T: Number>(&self, _time: T, variables: Evaluation<'_, T>) {
        let (nodes, slopes) = (&variables.states.x, &mut variables.derivatives.x);
        slopes.fill(T::from(0.0));
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as usize
        };
        for node in 0..nodes.len() {
            for _ in 0..2 {
                let (other, share) = (random() % nodes.len(), (random() % 1000) as f64 / 1000.0);
                let conductance = 0.1 + 100.0 * share * share * share * share;
                let difference = nodes[node] - nodes[other];
                let flow = difference * (difference * difference + 1.0) * conductance;
                slopes[node] -= flow;
                slopes[other] += flow;
            }
        }
    }
}
