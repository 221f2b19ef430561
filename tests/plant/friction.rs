//! Dahl's friction (paper, eq. (5)) with an exponent other than 1, against a hand calculation.

use boost_fmu::plant::variables::{InitializationMode, Inputs};

use crate::bench::Bench;

#[test]
fn friction_builds_up_by_the_exponent() {
    for (exponent, share) in [(1.0, 0.5), (2.0, 0.25), (3.0, 0.125)] {
        let bench = Bench::new(Inputs::default(), |parameters, start| {
            parameters.initialization.mode = InitializationMode::Given;
            parameters.actuator.friction_exponent = exponent;
            start.actuator.velocity = 0.01;
            // Half of the Coulomb force.
            start.actuator.friction_force = 0.5 * parameters.actuator.coulomb_friction;
        });
        let rate = bench.variables.derivatives.actuator.friction_force;
        let expected = bench.variables.parameters.actuator.friction_stiffness * share * 0.01;
        // Rounding.
        assert!((rate / expected - 1.0).abs() < 1e-12, "{rate} N/s instead of {expected} N/s");
    }
}
