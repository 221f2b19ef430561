//! The vacuum tank and its pump (paper, section 3.2 and eq. (3)).
//!
//! The running pump draws a constant mass flow, accurate enough between 30 and 35 kPa according to the paper, where the
//! controller keeps the tank. A pump cannot draw from a perfect vacuum, so below 1 kPa, far outside that band, its flow
//! falls in proportion to the pressure, to zero at the pump's ultimate vacuum, the lowest pressure the tank can reach.

use super::gas::Volume;
use super::variables::{PumpLocals, PumpParameters, TankParameters};
use fmu_export::Number;

/// The pressure in Pa below which the pump flow falls.
const PUMP_FADES_BELOW: f64 = 1000.0;
/// The pressure in Pa at which the pump flow is zero.
const ULTIMATE_VACUUM: f64 = 10.0;

#[derive(Clone, Copy, Debug)]
pub struct VacuumTank<D = f64> {
    pub parameters: TankParameters<D>,
    pub pump: PumpParameters<D>,
    /// The air in the tank.
    pub volume: Volume<D>,
}

impl<D: Number> VacuumTank<D> {
    /// The pump (0 … 1) at a tank pressure (Pa).
    pub fn pump(&self, pump: D, pressure: D) -> PumpLocals<D> {
        let share = (pressure - ULTIMATE_VACUUM) / (PUMP_FADES_BELOW - ULTIMATE_VACUUM);
        let drawn_mass_flow = self.pump.mass_flow * pump * share.max(0.0).min(1.0);
        PumpLocals { drawn_mass_flow }
    }

    /// Rate of change of the pressure in Pa/s, for a net inflow `mass_flow` in kg/s at a temperature in K.
    pub fn pressure_rate(&self, temperature: D, mass_flow: D) -> D {
        if self.parameters.frozen { 0.0.into() } else { self.volume.pressure_rate(temperature, mass_flow) }
    }
}
