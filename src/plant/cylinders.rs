//! The cylinders: air and fuel flow, exhaust temperature and torque, averaged over the working cycles
//! (Eriksson, Modeling and control of turbocharged SI and DI engines, OGST 62(4), 2007).
//!
//! The engine burns a stoichiometric mixture; its speed is an input (the dynamometer holds it).

use std::f64::consts::PI;

use super::gas::Gas;

/// The cylinders of an engine with four strokes.
#[derive(Clone, Copy, Debug)]
pub struct Cylinders {
    /// Displacement in m³.
    pub displacement: f64,
    /// Compression ratio.
    pub compression_ratio: f64,
    /// Bore in m.
    pub bore: f64,
    /// Stroke in m.
    pub stroke: f64,
    /// Factor of the volumetric efficiency.
    pub volumetric_efficiency_factor: f64,
    /// Stoichiometric air to fuel ratio.
    pub stoichiometric_air_fuel_ratio: f64,
    /// Lower heating value of the fuel in J/kg.
    pub lower_heating_value: f64,
    /// Indicated efficiency.
    pub indicated_efficiency: f64,
    /// Share of the work lost to retarded ignition at 1 bar of boost.
    pub ignition_retard_loss: f64,
    /// Factor of friction for the layout of the engine.
    pub friction_boost_layout: f64,
    /// Factor of friction and auxiliaries.
    pub friction_auxiliary_factor: f64,
    /// Brake mean effective pressure at zero intake pressure in Pa, in the friction model.
    pub mean_effective_pressure_offset: f64,
    /// Its slope over intake pressure.
    pub mean_effective_pressure_slope: f64,
    /// Exhaust temperature at zero flow in K.
    pub exhaust_temperature_offset: f64,
    /// Its slope over the exhaust flow in K s/kg.
    pub exhaust_temperature_slope: f64,
    /// The gas taken in.
    pub air: Gas,
    /// The gas put out.
    pub exhaust_gas: Gas,
}

/// The flows through the cylinders at an instant.
#[derive(Clone, Copy, Debug)]
pub struct CylinderFlows {
    /// Volumetric efficiency.
    pub volumetric_efficiency: f64,
    /// Air in kg/s.
    pub air: f64,
    /// Fuel in kg/s.
    pub fuel: f64,
    /// Exhaust gas in kg/s.
    pub exhaust: f64,
    /// Temperature of the exhaust at the valves in K.
    pub exhaust_temperature: f64,
}

/// The parts of the torque at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Work {
    /// Indicated work of the high-pressure cycle in J per cycle.
    pub indicated: f64,
    /// Friction mean effective pressure in Pa.
    pub friction_pressure: f64,
    /// Brake torque in N m.
    pub torque: f64,
}

impl Cylinders {
    /// The flows at an engine speed (rpm), between the intake (pressure in Pa, temperature in K) and the
    /// exhaust manifold's pressure (Pa).
    ///
    /// The volumetric efficiency is that of residual gas expanding to intake pressure.
    #[must_use]
    pub fn flows(&self, engine_speed: f64, intake: (f64, f64), exhaust_pressure: f64) -> CylinderFlows {
        let (pressure, temperature) = intake;
        let residual = (exhaust_pressure / pressure).powf(1.0 / self.exhaust_gas.heat_capacity_ratio);
        let volumetric_efficiency = self.volumetric_efficiency_factor * (self.compression_ratio - residual)
            / (self.compression_ratio - 1.0);
        let density = pressure / (self.air.gas_constant * temperature);
        // One filling in two revolutions: rpm / 120 cycles a second.
        let air = volumetric_efficiency * self.displacement * engine_speed / 120.0 * density;
        let fuel = air / self.stoichiometric_air_fuel_ratio;
        let exhaust = air + fuel;
        CylinderFlows {
            volumetric_efficiency,
            air,
            fuel,
            exhaust,
            exhaust_temperature: self.exhaust_temperature_offset + self.exhaust_temperature_slope * exhaust,
        }
    }

    /// The work at an engine speed (rpm), a flow of fuel (kg/s), and the pressures (Pa) of both manifolds.
    ///
    /// Friction after the boost-layout model of the Linköping engine models (there after Heywood's
    /// textbook correlation): a part that grows with piston speed and one with load.
    #[must_use]
    pub fn work(&self, engine_speed: f64, fuel: f64, intake_pressure: f64, exhaust_pressure: f64) -> Work {
        // The floor of 1 rpm is for standstill, where no fuel flows either.
        let cycles_per_second = engine_speed.max(1.0) / 120.0;
        let boost = (intake_pressure / 1e5 - 1.0).max(0.0);
        let efficiency = self.indicated_efficiency * (1.0 - self.ignition_retard_loss * boost * boost);
        let indicated = fuel / cycles_per_second * self.lower_heating_value * efficiency;
        let piston_speed = 2.0 * self.stroke * engine_speed / 60.0;
        let load = self.mean_effective_pressure_offset + self.mean_effective_pressure_slope * intake_pressure;
        let motored = (0.464 + 0.0072 * piston_speed.powf(1.8)) * self.friction_boost_layout * 1e5;
        let friction_pressure =
            self.friction_auxiliary_factor * (motored + 0.0215 * load.max(0.0)) * (0.075 / self.bore).sqrt();
        let pumping_pressure = exhaust_pressure - intake_pressure;
        let net = indicated - self.displacement * (pumping_pressure + friction_pressure);
        Work { indicated, friction_pressure, torque: net / (4.0 * PI) }
    }
}
