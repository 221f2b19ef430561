//! Ideal gases with constant specific heats, and the smooth functions that keep the equations differentiable where
//! flows reverse.

use super::variables::GasParameters;
use fmu_export::Number;

#[derive(Clone, Copy, Debug)]
pub struct Gas<D = f64> {
    pub parameters: GasParameters<D>,
    /// The isentropic exponent of temperature over pressure, (γ − 1)/γ.
    pub isentropic_exponent: D,
}

impl<D: Number> Gas<D> {
    pub fn new(parameters: GasParameters<D>) -> Self {
        let ratio = parameters.heat_capacity_ratio;
        Self { parameters, isentropic_exponent: (ratio - 1.0) / ratio }
    }

    /// A volume (m³) that holds the gas.
    pub fn volume(&self, volume: D) -> Volume<D> {
        Volume { stiffness: self.parameters.gas_constant / volume }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Volume<D = f64> {
    /// R/V in J/(kg K m³).
    stiffness: D,
}

impl<D: Number> Volume<D> {
    /// dp/dt in Pa/s at a temperature (K) for a net inflow `mass_flow` (kg/s): the ideal gas law, neglecting
    /// temperature changes (paper, eq. (3)).
    pub fn pressure_rate(&self, temperature: D, mass_flow: D) -> D {
        self.stiffness * temperature * mass_flow
    }
}

/// A differentiable max(a, b), smoothed where a and b differ by about `width`.
pub fn smooth_max<D: Number>(a: D, b: D, width: D) -> D {
    let distance = a - b;
    (a + b + (distance * distance + width * width).sqrt()) * 0.5
}

/// A differentiable, odd √|x|·sgn x, linear within about `width` of 0.
pub fn signed_root<D: Number>(x: D, width: D) -> D {
    x / (x * x + width * width).sqrt().sqrt()
}

/// The temperature in K of two mixed flows (kg/s, K); reverse flows do not count.
///
/// `width` in kg/s blends the temperatures where both flows vanish.
pub fn mixed_temperature<D: Number>(first: (D, D), second: (D, D), width: D) -> D {
    let a = smooth_max(first.0, 0.0.into(), width);
    let b = smooth_max(second.0, 0.0.into(), width);
    // The flows are known first; this order combines them while the temperatures are computed.
    let share = b / (a + b);
    first.1 + share * (second.1 - first.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smooth_functions_meet_the_sharp_ones_far_from_the_kink() {
        // The smooth maximum deviates by width²/(4·distance), the root by a share of (width/x)²/4.
        assert!((smooth_max(3.0_f64, 1.0, 1e-4) - 3.0).abs() < 2e-9);
        assert!((signed_root(-4.0_f64, 1e-4) + 2.0).abs() < 1e-9);
        assert!(smooth_max(-1.0_f64, 0.0, 1e-4) > 0.0);
    }

    #[test]
    fn mixing_goes_by_the_inflows() {
        let temperature = mixed_temperature((0.03_f64, 400.0), (0.01, 300.0), 1e-5);
        assert!((temperature - 375.0).abs() < 1e-3);
        // Outflow does not count, up to the smoothing's share, 1e-10/(4·0.01·0.03).
        let temperature = mixed_temperature((0.03_f64, 400.0), (-0.01, 300.0), 1e-5);
        assert!((temperature - 400.0).abs() < 1e-3);
    }
}
