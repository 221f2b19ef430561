//! Gases and what several components need of them: ideal gas with constant specific heats, and the
//! smooth functions that keep the equations differentiable where flows reverse.

/// An ideal gas.
#[derive(Clone, Copy, Debug)]
pub struct Gas {
    /// Specific gas constant R in J/(kg K).
    pub gas_constant: f64,
    /// Specific heat at constant pressure in J/(kg K).
    pub specific_heat: f64,
    /// Ratio of the specific heats γ.
    pub heat_capacity_ratio: f64,
    /// The isentropic exponent of temperature over pressure, (γ − 1)/γ.
    pub isentropic_exponent: f64,
}

impl Gas {
    /// A gas from its constants: R and the specific heat in J/(kg K), and γ.
    #[must_use]
    pub fn new(gas_constant: f64, specific_heat: f64, heat_capacity_ratio: f64) -> Self {
        Self {
            gas_constant,
            specific_heat,
            heat_capacity_ratio,
            isentropic_exponent: (heat_capacity_ratio - 1.0) / heat_capacity_ratio,
        }
    }

    /// dp/dt in Pa/s of a volume (m³) at a temperature (K) into which `mass_flow` (kg/s) goes on balance:
    /// the ideal gas law, with the variation of temperature neglected (paper, eq. (3)).
    #[must_use]
    pub fn pressure_rate(&self, temperature: f64, volume: f64, mass_flow: f64) -> f64 {
        self.gas_constant * temperature / volume * mass_flow
    }
}

/// A differentiable max(a, b); `width` is how near a and b must be to matter both.
#[must_use]
pub fn smooth_max(a: f64, b: f64, width: f64) -> f64 {
    let distance = a - b;
    0.5 * (a + b + (distance * distance + width * width).sqrt())
}

/// A differentiable, odd √|x|·sgn x, linear within about `width` of 0.
#[must_use]
pub fn signed_root(x: f64, width: f64) -> f64 {
    x / (x * x + width * width).sqrt().sqrt()
}

/// The temperature in K where two flows (kg/s, K) are mixed; backward flows carry nothing in.
///
/// `width` in kg/s blends the temperatures where both flows vanish.
#[must_use]
pub fn mixed_temperature(first: (f64, f64), second: (f64, f64), width: f64) -> f64 {
    let a = smooth_max(first.0, 0.0, width);
    let b = smooth_max(second.0, 0.0, width);
    (a * first.1 + b * second.1) / (a + b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smooth_functions_meet_the_sharp_ones_far_from_the_kink() {
        // The deviation of the smooth maximum is width²/(4·distance), of the root (width/x)²/4 relatively.
        assert!((smooth_max(3.0, 1.0, 1e-4) - 3.0).abs() < 2e-9);
        assert!((signed_root(-4.0, 1e-4) + 2.0).abs() < 1e-9);
        assert!(smooth_max(-1.0, 0.0, 1e-4) > 0.0);
    }

    #[test]
    fn mixing_goes_by_the_inflows() {
        let temperature = mixed_temperature((0.03, 400.0), (0.01, 300.0), 1e-5);
        assert!((temperature - 375.0).abs() < 1e-3);
        // What flows out does not count: to the share of the smoothing, 1e-10/(4·0.01·0.03).
        let temperature = mixed_temperature((0.03, 400.0), (-0.01, 300.0), 1e-5);
        assert!((temperature - 400.0).abs() < 1e-3);
    }
}
