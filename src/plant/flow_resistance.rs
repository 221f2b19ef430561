//! Turbulent flow with a small pressure loss: air filter, intercooler, and the exhaust with its catalyst
//! (Eriksson, Modeling and control of turbocharged SI and DI engines, OGST 62(4), 2007).

use super::gas::signed_root;
use fmu_export::Number;

/// The flow in kg/s by the law W = √(p·Δp/(H·T)) from the first to the second side, each given by pressure (Pa)
/// and temperature (K), through a resistance H in Pa² s²/(kg² K), with upstream density. Below a pressure difference of
/// `linear_pressure` (Pa) the flow is linear, to keep its slope finite.
pub fn mass_flow<D: Number>(resistance: D, linear_pressure: D, first: (D, D), second: (D, D)) -> D {
    let difference = first.0 - second.0;
    let (pressure, temperature) = if difference >= 0.0 { first } else { second };
    (pressure / (resistance * temperature)).sqrt() * signed_root(difference, linear_pressure)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_from_the_linear_range_the_law_is_quadratic() {
        let flow = mass_flow(1.6e8, 1.0, (1e5, 300.0), (9e4, 300.0));
        // The smoothing's share is (1 Pa/10 kPa)²/4.
        assert!((flow - (1e5_f64 * 1e4 / (1.6e8 * 300.0)).sqrt()).abs() < 1e-8);
    }
}
