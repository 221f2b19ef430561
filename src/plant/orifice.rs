//! Compressible flow through an opening (paper, eqs. (1) and (2)).
//!
//! Two things differ from the paper as printed. The choked branch of eq. (2) is printed as
//! √γ·(2γ/(γ+1))^((γ+1)/(2(γ−1))), which is discontinuous; without the γ in the base it meets the other branch at the
//! critical pressure ratio, so here the pressure ratio is simply limited to the critical one. And the slope of Ψ is
//! infinite at equal pressures, which no integrator can follow: above a pressure ratio `Π_l` the function is the
//! straight line to Ψ(1) = 0 (as in the Linköping mean value engine models).

use super::gas::Gas;
use crate::elementary::Elementary;

/// The flow function Ψ of a gas, and the gas itself.
#[derive(Clone, Copy, Debug)]
pub struct Orifice<D = f64> {
    gas: Gas<D>,
    /// 2γ/(γ − 1).
    factor: D,
    /// `Π_c`, below which the flow is choked.
    critical_ratio: D,
    /// `Ψ(Π_c)`.
    choked: D,
    /// `Π_l`, above which the function is linear.
    linear_ratio: D,
    /// `Ψ(Π_l)/(1 − Π_l)`.
    linear_slope: D,
}

impl<D: Elementary> Orifice<D> {
    /// The flow function of a gas, linear above a pressure ratio.
    pub fn new(gas: Gas<D>, linear_ratio: D) -> Self {
        let ratio = gas.parameters.heat_capacity_ratio;
        let mut orifice = Self {
            gas,
            factor: ratio * 2.0 / (ratio - 1.0),
            critical_ratio: ((ratio + 1.0).recip() * 2.0).power(gas.isentropic_exponent.recip()),
            choked: 0.0.into(),
            linear_ratio,
            linear_slope: 0.0.into(),
        };
        let isentropic = |ratio: D| orifice.isentropic(ratio, ratio.power(gas.isentropic_exponent));
        (orifice.choked, orifice.linear_slope) =
            (isentropic(orifice.critical_ratio), isentropic(linear_ratio) / (-linear_ratio + 1.0));
        orifice
    }

    /// Ψ at a pressure ratio (downstream over upstream) from 0 to 1; `temperature_ratio` is that of an isentropic
    /// expansion.
    fn flow_function(&self, pressure_ratio: D, temperature_ratio: impl FnOnce(D) -> D) -> D {
        if pressure_ratio > self.linear_ratio {
            self.linear_slope * (-pressure_ratio + 1.0)
        } else if pressure_ratio >= self.critical_ratio {
            self.isentropic(pressure_ratio, temperature_ratio(pressure_ratio))
        } else {
            self.choked
        }
    }

    /// Ψ of eq. (2) for unchoked flow. Π^(1/γ) = Π/Π^((γ−1)/γ) saves the second power.
    fn isentropic(&self, pressure_ratio: D, temperature_ratio: D) -> D {
        pressure_ratio / temperature_ratio * (self.factor * (-temperature_ratio + 1.0)).sqrt()
    }

    /// The flow in kg/s through an effective area (m²) from the first to the second side, each given by
    /// pressure (Pa) and temperature (K); negative if the second pressure is higher.
    #[inline]
    pub fn mass_flow(&self, area: D, first: (D, D), second: (D, D)) -> D {
        let temperature_ratio = |pressure_ratio: D| pressure_ratio.power(self.gas.isentropic_exponent);
        if area.is_constant(0.0) {
            0.0.into()
        } else if first.0 >= second.0 {
            self.downhill(area, first, second.0, temperature_ratio)
        } else {
            -self.downhill(area, second, first.0, temperature_ratio)
        }
    }

    /// [`Self::mass_flow`] for a known temperature ratio of isentropic flow from the first to the second side.
    pub fn mass_flow_at(&self, area: D, first: (D, D), second: (D, D), temperature_ratio: D) -> D {
        if area.is_constant(0.0) {
            0.0.into()
        } else if first.0 >= second.0 {
            self.downhill(area, first, second.0, |_| temperature_ratio)
        } else {
            -self.downhill(area, second, first.0, |_| temperature_ratio.recip())
        }
    }

    /// Eq. (1): the flow from the higher pressure to the lower.
    fn downhill(
        &self,
        area: D,
        (pressure, temperature): (D, D),
        downstream_pressure: D,
        temperature_ratio: impl FnOnce(D) -> D,
    ) -> D {
        let density_velocity = pressure / (self.gas.parameters.gas_constant * temperature).sqrt();
        area * density_velocity * self.flow_function(downstream_pressure / pressure, temperature_ratio)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::variables::GasParameters;

    fn air() -> Orifice {
        let gas = GasParameters { gas_constant: 287.0, specific_heat: 1005.0, heat_capacity_ratio: 1.4 };
        Orifice::new(Gas::new(gas), 0.95)
    }

    fn flow_function(pressure_ratio: f64) -> f64 {
        air().flow_function(pressure_ratio, |ratio| ratio.powf(0.4 / 1.4))
    }

    #[test]
    fn choked_flow_has_the_textbook_value() {
        // √γ·(2/(γ+1))^((γ+1)/(2(γ−1))) for γ = 1.4.
        let textbook = 1.4_f64.sqrt() * (2.0_f64 / 2.4).powf(3.0);
        assert!((flow_function(0.3) - textbook).abs() < 1e-14);
        assert!((textbook - 0.684_731).abs() < 1e-6);
    }

    #[test]
    fn the_branches_meet() {
        let orifice = air();
        for seam in [orifice.critical_ratio, orifice.linear_ratio] {
            let jump = flow_function(seam + 1e-12) - flow_function(seam - 1e-12);
            // The slopes are below 10, so continuity leaves less than 2e-11.
            assert!(jump.abs() < 2e-11, "a jump of {jump} at {seam}");
        }
        assert!(flow_function(1.0).abs() < f64::EPSILON);
    }

    #[test]
    fn the_flow_goes_to_the_lower_pressure() {
        let (high, low) = ((2e5, 300.0), (1e5, 400.0));
        let forward = air().mass_flow(1e-4, high, low);
        assert!(forward > 0.0);
        assert!((air().mass_flow(1e-4, low, high) + forward).abs() < f64::EPSILON);
    }
}
