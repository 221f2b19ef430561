//! A centrifugal compressor by its head and flow coefficients (Eriksson, Modeling and control of
//! turbocharged SI and DI engines, OGST 62(4), 2007).
//!
//! Speed lines are the parabola `Ψ = Ψ_m·(1 − (Φ/Φ_m)²)` between the head coefficient `Ψ = 2·Δh_is/U²` and
//! the flow coefficient `Φ = W/(ρ₁·πD²/4·U)`, solved for the flow. Written with squares of speeds it is
//! defined at standstill and for pressure ratios below 1 as well; beyond the head of zero flow it is
//! continued as an odd function, which is the back flow of surge. Efficiency is a parabola over Φ, and
//! "effective": mechanical and heat losses are in it.

use super::gas::{Gas, Volume, signed_root, smooth_max};
use super::scalar::Scalar;

/// A compressor.
#[derive(Clone, Copy, Debug)]
pub struct Compressor<D = f64> {
    /// Radius of the impeller in m.
    pub radius: D,
    /// Area of the impeller's circle over the gas constant, in m² kg K/J.
    pub inlet_area_by_gas_constant: D,
    /// Twice the specific heat over the head coefficient at zero flow, `2·c_p/Ψ_m`, in J/(kg K).
    pub head_slope: D,
    /// Flow coefficient at zero head, `Φ_m`.
    pub peak_flow_coefficient: D,
    /// Best efficiency.
    pub peak_efficiency: D,
    /// Reciprocal of the flow coefficient of the best efficiency.
    pub by_peak_efficiency_flow_coefficient: D,
    /// Smallest efficiency.
    pub minimum_efficiency: D,
    /// Width in m²/s² of the transition between forward and backward flow.
    pub head_smoothing: D,
    /// The volume behind the compressor.
    pub outlet_volume: Volume<D>,
    /// The gas.
    pub air: Gas<D>,
}

/// What a compressor does at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Compression<D = f64> {
    /// Flow in kg/s; negative: backwards.
    pub mass_flow: D,
    /// Efficiency.
    pub efficiency: D,
    /// Temperature at the outlet in K.
    pub outlet_temperature: D,
    /// Power taken up in W.
    pub power: D,
}

impl<D: Scalar> Compressor<D> {
    /// The flow from the inlet (pressure in Pa, temperature in K) at a shaft speed (rad/s), where isentropic
    /// compression to the outlet's pressure raises the temperature by a ratio.
    #[must_use]
    pub fn compress(&self, inlet: (D, D), temperature_ratio: D, speed: D) -> Compression<D> {
        let (pressure, temperature) = inlet;
        let specific_heat = self.air.specific_heat;
        let tip_speed_squared = (self.radius * speed).powi(2);
        // Isentropic rise of temperature; its product with the specific heat is Δh_is.
        let rise = temperature * (temperature_ratio - 1.0);
        // The square of (tip speed times Φ/Φ_m), by the parabola of the speed lines.
        let flow_speed_squared = tip_speed_squared - self.head_slope * rise;
        let flow_speed = self.peak_flow_coefficient * signed_root(flow_speed_squared, self.head_smoothing);
        let mass_flow = pressure / temperature * self.inlet_area_by_gas_constant * flow_speed;

        // 10 m/s keeps the flow coefficient finite at standstill.
        let flow_coefficient = flow_speed * (tip_speed_squared + 100.0).sqrt().recip();
        let off_peak = flow_coefficient * self.by_peak_efficiency_flow_coefficient - 1.0;
        let efficiency = smooth_max(
            self.peak_efficiency * (-off_peak * off_peak + 1.0),
            self.minimum_efficiency,
            0.02.into(),
        );
        let actual_rise = smooth_max(rise, 0.0.into(), 1.0.into()) / efficiency;
        Compression {
            mass_flow,
            efficiency,
            outlet_temperature: temperature + actual_rise,
            power: smooth_max(mass_flow, 0.0.into(), 1e-4.into()) * specific_heat * actual_rise,
        }
    }
}
