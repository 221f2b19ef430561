//! The cylinders: air and fuel flow, exhaust temperature and torque, averaged over the working cycles
//! (Eriksson, Modeling and control of turbocharged SI and DI engines, OGST 62(4), 2007).
//!
//! The engine burns a stoichiometric mixture; its speed is an input, set by the dynamometer.

use core::f64::consts::PI;

use super::gas::Gas;
use super::variables::{CylindersLocals, CylindersParameters};
use crate::elementary::Elementary;

/// The cylinders of a four-stroke engine.
#[derive(Clone, Copy, Debug)]
pub struct Cylinders<D = f64> {
    pub parameters: CylindersParameters<D>,
    /// Fuel per air in a stoichiometric mixture.
    pub fuel_air_ratio: D,
    pub air: Gas<D>,
    /// Exponent of the pressure ratio in the expansion of residual gas.
    pub residual_exponent: D,
}

/// The flows through the cylinders at an instant.
#[derive(Clone, Copy, Debug)]
pub struct CylinderFlows<D = f64> {
    /// Volumetric efficiency.
    pub volumetric_efficiency: D,
    /// Air in kg/s.
    pub air: D,
    /// Fuel in kg/s.
    pub fuel: D,
    /// Exhaust gas in kg/s.
    pub exhaust: D,
    /// Exhaust temperature at the valves in K.
    pub exhaust_temperature: D,
}

impl<D: Elementary> Cylinders<D> {
    /// The flows at an engine speed (rpm) from the intake (pressure in Pa, temperature in K).
    ///
    /// The volumetric efficiency accounts for residual gas expanding to intake pressure by the volume ratio `residual`.
    /// Where residual gas fills the cylinders (throttle shut), no air enters.
    pub fn flows(&self, engine_speed: D, intake: (D, D), residual: D) -> CylinderFlows<D> {
        let (pressure, temperature) = intake;
        let volumetric_efficiency = self.parameters.volumetric_efficiency_factor
            * (self.parameters.compression_ratio - residual).max(0.0)
            / (self.parameters.compression_ratio - 1.0);
        let density = pressure / (self.air.parameters.gas_constant * temperature);
        // One filling per two revolutions: rpm / 120 cycles per second.
        let air = volumetric_efficiency * self.parameters.displacement * engine_speed / 120.0 * density;
        let fuel = air * self.fuel_air_ratio;
        let exhaust = air + fuel;
        CylinderFlows {
            volumetric_efficiency,
            air,
            fuel,
            exhaust,
            exhaust_temperature: self.parameters.exhaust_temperature_offset
                + self.parameters.exhaust_temperature_slope * exhaust,
        }
    }

    /// The local variables and the brake torque in N m, for an engine speed (rpm), its flows and the pressures (Pa) of
    /// both manifolds. No state depends on the work, so the right-hand side omits it.
    ///
    /// Friction follows the boost-layout model of the Linköping engine models (there after Heywood's textbook
    /// correlation): one part grows with piston speed, one with load.
    pub fn work(
        &self,
        engine_speed: D,
        flows: CylinderFlows<D>,
        intake_pressure: D,
        exhaust_pressure: D,
    ) -> (CylindersLocals<D>, D) {
        // The floor of 1 rpm is for standstill, where no fuel flows either.
        let cycles_per_second = engine_speed.max(1.0) / 120.0;
        let boost = (intake_pressure / 1e5 - 1.0).max(0.0);
        let retarded = (-self.parameters.ignition_retard_loss * boost * boost + 1.0).max(0.0);
        let efficiency = self.parameters.indicated_efficiency * retarded;
        let indicated_work =
            flows.fuel / cycles_per_second * self.parameters.lower_heating_value * efficiency;
        let piston_speed = self.parameters.stroke * 2.0 * engine_speed / 60.0;
        let load = self.parameters.mean_effective_pressure_offset
            + self.parameters.mean_effective_pressure_slope * intake_pressure;
        let motored =
            (piston_speed.power(1.8.into()) * 0.0072 + 0.464) * self.parameters.friction_boost_layout * 1e5;
        let friction_mean_effective_pressure = self.parameters.friction_auxiliary_factor
            * (motored + load.max(0.0) * 0.0215)
            * (self.parameters.bore.recip() * 0.075).sqrt();
        let pumping_pressure = exhaust_pressure - intake_pressure;
        let net = indicated_work
            - self.parameters.displacement * (pumping_pressure + friction_mean_effective_pressure);
        let locals = CylindersLocals {
            volumetric_efficiency: flows.volumetric_efficiency,
            air_mass_flow: flows.air,
            fuel_mass_flow: flows.fuel,
            exhaust_mass_flow: flows.exhaust,
            exhaust_temperature: flows.exhaust_temperature,
            indicated_work,
            friction_mean_effective_pressure,
        };
        (locals, net / (4.0 * PI))
    }
}
