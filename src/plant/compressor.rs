//! A centrifugal compressor by its head and flow coefficients (Eriksson, Modeling and control of
//! turbocharged SI and DI engines, OGST 62(4), 2007).
//!
//! Speed lines are the parabola `Ψ = Ψ_m·(1 − (Φ/Φ_m)²)` between the head coefficient `Ψ = 2·Δh_is/U²` and the flow
//! coefficient `Φ = W/(ρ₁·πD²/4·U)`, solved for the flow. Written with squared speeds it is defined at standstill and
//! for pressure ratios below 1; beyond the head of zero flow it continues as an odd function, the reverse flow of
//! surge. Efficiency is a parabola over Φ and includes mechanical and heat losses.

use core::f64::consts::PI;

use super::gas::{Gas, Volume, signed_root, smooth_max};
use super::variables::{CompressorLocals, CompressorParameters};
use fmu_export::Number;

#[derive(Clone, Copy, Debug)]
pub struct Compressor<D = f64> {
    parameters: CompressorParameters<D>,
    /// Radius of the impeller in m.
    radius: D,
    /// Impeller area over the gas constant, in m² kg K/J.
    inlet_area_by_gas_constant: D,
    /// Twice the specific heat over the head coefficient at zero flow, `2·c_p/Ψ_m`, in J/(kg K).
    head_slope: D,
    /// Reciprocal of the flow coefficient at peak efficiency.
    by_peak_efficiency_flow_coefficient: D,
    /// The volume downstream of the compressor.
    pub outlet_volume: Volume<D>,
    pub air: Gas<D>,
}

impl<D: Number> Compressor<D> {
    pub fn new(parameters: CompressorParameters<D>, air: Gas<D>) -> Self {
        let p = &parameters;
        Self {
            radius: p.diameter * 0.5,
            inlet_area_by_gas_constant: p.diameter * p.diameter * (0.25 * PI) / air.parameters.gas_constant,
            head_slope: air.parameters.specific_heat * 2.0 / p.peak_head_coefficient,
            by_peak_efficiency_flow_coefficient: p.peak_efficiency_flow_coefficient.recip(),
            outlet_volume: air.volume(p.outlet_volume),
            parameters,
            air,
        }
    }

    /// The flow from the inlet (pressure in Pa, temperature in K) at a shaft speed (rad/s), for the temperature ratio
    /// of isentropic compression to outlet pressure.
    pub fn compress(&self, inlet: (D, D), temperature_ratio: D, speed: D) -> CompressorLocals<D> {
        let (pressure, temperature) = inlet;
        let specific_heat = self.air.parameters.specific_heat;
        let tip_speed_squared = (self.radius * speed).powi(2);
        // Isentropic temperature rise; times the specific heat it is Δh_is.
        let rise = temperature * (temperature_ratio - 1.0);
        // The square of (tip speed times Φ/Φ_m), by the speed line parabola.
        let flow_speed_squared = tip_speed_squared - self.head_slope * rise;
        let flow_speed = self.parameters.peak_flow_coefficient
            * signed_root(flow_speed_squared, self.parameters.head_smoothing);
        let mass_flow = pressure / temperature * self.inlet_area_by_gas_constant * flow_speed;

        // 10 m/s keeps the flow coefficient finite at standstill.
        let flow_coefficient = flow_speed * (tip_speed_squared + 100.0).sqrt().recip();
        let off_peak = flow_coefficient * self.by_peak_efficiency_flow_coefficient - 1.0;
        let efficiency = smooth_max(
            self.parameters.peak_efficiency * (-off_peak * off_peak + 1.0),
            self.parameters.minimum_efficiency,
            0.02.into(),
        );
        let actual_rise = smooth_max(rise, 0.0.into(), 1.0.into()) / efficiency;
        CompressorLocals {
            mass_flow,
            efficiency,
            outlet_temperature: temperature + actual_rise,
            power: smooth_max(mass_flow, 0.0.into(), 1e-4.into()) * specific_heat * actual_rise,
        }
    }
}
