//! The relay that keeps the vacuum tank between two pressures with its pump (paper, section 6).

use fmu_export::{Error, Persistent};

use super::variables::{Parameters, Real};

/// The state of the relay: whether the pump is on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Persistent)]
pub struct TankRelay {
    on: bool,
}

impl TankRelay {
    /// Whether the pump is on at a tank pressure (Pa): on above one limit, off below the other.
    pub fn sample(&mut self, parameters: &Parameters, tank_pressure: Real) -> bool {
        if tank_pressure > parameters.tank_pressure_on {
            self.on = true;
        } else if tank_pressure < parameters.tank_pressure_off {
            self.on = false;
        }
        self.on
    }
}

/// Rejects limits without a band between them.
pub fn check(parameters: &Parameters) -> Result<(), Error> {
    let (on, off) = (parameters.tank_pressure_on, parameters.tank_pressure_off);
    if on > off {
        return Ok(());
    }
    Err(Error::new(format_args!(
        "tank_pressure_on is {on} Pa and must be above tank_pressure_off, which is {off} Pa"
    )))
}
