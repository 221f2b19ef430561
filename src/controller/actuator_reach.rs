//! Whether the actuator can open the high-pressure wastegate as far as the reference needs.
//!
//! The actuator opens the wastegate by vacuum. An engine starts with air in the vacuum tank, which the pump removes in
//! some two minutes; until then the other valves limit boost. How much vacuum suffices is not left to the map of the
//! actuator, since a stiffer spring needs more, and thin air has less: where boost is too high nevertheless, a full
//! tank is awaited.
//! A leak, a dead pump or a failing supply take the vacuum away later. Neither the tank's pressure nor the one that the
//! valve reaches at full duty may be above the pressure that the chamber needs. The other valves then limit boost once it
//! is too high, since at low engine speed the high-pressure stage alone may not raise it.

use fmu_export::Persistent;

use super::actuator_inverse::{self, FULL_DUTY};
use super::diagnosis::OVERBOOST;
use super::variables::{Parameters, Real};
use crate::elementary::{larger, smaller};

/// The memory of the check.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct ActuatorReach {
    vacuum: Vacuum,
    /// How long boost has been too high (s).
    excess_time: Real,
    /// Whether the vacuum was taken away, so that the other valves limit boost.
    is_lost: bool,
}

/// The vacuum since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
enum Vacuum {
    /// The tank has not had a vacuum that opens the wastegate.
    #[default]
    Awaited,
    /// The tank has had a vacuum that opens the wastegate, and never been full.
    Partial,
    /// A partial vacuum did not suffice.
    Insufficient,
    /// The tank has been full: there is no more vacuum to be had.
    Full,
}

impl ActuatorReach {
    /// Whether the tank has been full since the start. Until then, an actuator that cannot hold boost is no fault.
    pub fn has_filled(&self) -> bool {
        self.vacuum == Vacuum::Full
    }

    /// Whether the other valves are to limit boost, from tank pressure (Pa) and supply voltage (V), where measured, and
    /// the actuator's duty at nominal voltage (%) that holds the reference at rest; `excess` is boost above its reference
    /// (Pa), and `pressure_deficit` by how much ambient pressure is below the nominal one (Pa).
    pub fn is_lost(
        &mut self,
        parameters: &Parameters,
        (tank_pressure, supply_voltage): (Option<Real>, Option<Real>),
        holding_duty: impl FnOnce() -> Real,
        excess: Real,
        pressure_deficit: Real,
    ) -> bool {
        let &Parameters {
            sample_time,
            nominal_voltage,
            pwm_max,
            tank_pressure_on,
            ref diagnosis,
            ref actuator_inverse,
            ..
        } = parameters;
        let tank_pressure = tank_pressure.unwrap_or(0.0);
        // In thin air the same pressure is less vacuum.
        let has_vacuum = tank_pressure + pressure_deficit <= diagnosis.vacuum_lost_above;
        if tank_pressure <= tank_pressure_on {
            self.vacuum = Vacuum::Full;
        } else if self.vacuum == Vacuum::Awaited && has_vacuum {
            self.vacuum = Vacuum::Partial;
        }
        let voltage = supply_voltage.unwrap_or(nominal_voltage);
        let most = smaller(FULL_DUTY * voltage / nominal_voltage, FULL_DUTY);
        let suffices = has_vacuum && most >= pwm_max && self.vacuum == Vacuum::Full;
        let exceeds = excess >= OVERBOOST && !suffices && !self.is_lost;
        self.excess_time = if exceeds { self.excess_time + sample_time } else { 0.0 };
        let is_too_high = self.excess_time >= diagnosis.answer_time;
        match self.vacuum {
            Vacuum::Awaited | Vacuum::Insufficient => true,
            Vacuum::Partial if is_too_high => {
                (self.vacuum, self.excess_time) = (Vacuum::Insufficient, 0.0);
                true
            }
            Vacuum::Partial => false,
            Vacuum::Full => {
                if suffices {
                    self.is_lost = false;
                } else if self.is_lost || is_too_high {
                    let seated = actuator_inverse::seated_pressure(actuator_inverse);
                    let needed = actuator_inverse::pressure_at(actuator_inverse, holding_duty());
                    let lowest = larger(tank_pressure, actuator_inverse::pressure_at(actuator_inverse, most));
                    let reaches = needed >= seated || lowest <= needed;
                    self.is_lost = !reaches && (self.is_lost || diagnosis.limp_home);
                }
                self.is_lost
            }
        }
    }
}
