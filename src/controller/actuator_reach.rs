//! Whether the actuator can open the high-pressure wastegate as far as the reference needs.
//!
//! It opens by vacuum, so that neither the tank's pressure nor the one that the valve reaches at full duty may be above
//! the pressure that the chamber needs. An engine starts with air in its tank, which the pump empties in some two
//! minutes, while the other valves limit boost. A leak, a dead pump or a failing supply take the vacuum away later: the
//! other valves then limit boost once it is too high, since at low engine speed the high-pressure stage alone may not
//! raise it.

use fmu_export::Persistent;

use super::actuator_inverse::{self, FULL_DUTY};
use super::diagnosis::OVERBOOST;
use super::variables::Parameters;
use crate::elementary::{larger, smaller};

/// The memory of the check.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct ActuatorReach {
    /// Whether the tank has been full since the start.
    has_filled: bool,
    vacuum: Vacuum,
    /// How long boost has been too high (s).
    excess_time: f64,
    /// Whether the other valves limit boost.
    is_lost: bool,
}

/// What is known of the vacuum since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
enum Vacuum {
    /// It has not sufficed yet.
    #[default]
    Awaited,
    /// It has sufficed.
    Sufficed,
    /// That of a tank that was never full turned out not to suffice: a full tank is awaited.
    AwaitedInFull,
}

impl ActuatorReach {
    /// Whether the tank has been full since the start. Until then, an actuator that cannot hold boost is no fault.
    pub fn has_filled(&self) -> bool {
        self.has_filled
    }

    /// Whether the other valves are to limit boost, from tank pressure (Pa) and supply voltage (V), where measured, and
    /// the actuator's duty at nominal voltage (%) that holds the reference at rest; `excess` is boost above its reference
    /// (Pa), and `pressure_deficit` by how much ambient pressure is below the nominal one (Pa).
    pub fn is_lost(
        &mut self,
        parameters: &Parameters,
        (tank_pressure, supply_voltage): (Option<f64>, Option<f64>),
        holding_duty: impl FnOnce() -> f64,
        excess: f64,
        pressure_deficit: f64,
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
        self.has_filled |= tank_pressure <= tank_pressure_on;
        // In thin air the same pressure is less vacuum.
        let has_vacuum = tank_pressure + pressure_deficit <= diagnosis.vacuum_lost_above;
        match self.vacuum {
            // A full tank is all that there is.
            Vacuum::Awaited if has_vacuum => self.vacuum = Vacuum::Sufficed,
            Vacuum::Awaited | Vacuum::AwaitedInFull if self.has_filled => {
                (self.vacuum, self.is_lost) = (Vacuum::Sufficed, false);
            }
            _ => {}
        }
        let voltage = supply_voltage.unwrap_or(nominal_voltage);
        let most = smaller(FULL_DUTY * voltage / nominal_voltage, FULL_DUTY);
        if has_vacuum && most >= pwm_max && self.has_filled {
            (self.excess_time, self.is_lost) = (0.0, false);
            return false;
        }
        let exceeds = excess >= OVERBOOST && !self.is_lost;
        self.excess_time = if exceeds { self.excess_time + sample_time } else { 0.0 };
        let is_too_high = self.excess_time >= diagnosis.answer_time;
        // A stiffer spring than the map's needs more.
        if is_too_high && !self.has_filled {
            self.vacuum = Vacuum::AwaitedInFull;
        }
        if self.vacuum == Vacuum::AwaitedInFull {
            self.is_lost = true;
            return true;
        }
        if self.vacuum == Vacuum::Sufficed && !self.is_lost && !is_too_high {
            // Whatever the actuator reaches, boost is not too high.
            return false;
        }
        let seated = actuator_inverse::seated_pressure(actuator_inverse);
        let needed = actuator_inverse::pressure_at(actuator_inverse, holding_duty());
        let lowest = larger(tank_pressure, actuator_inverse::pressure_at(actuator_inverse, most));
        if needed >= seated || lowest <= needed {
            (self.vacuum, self.is_lost) = (Vacuum::Sufficed, false);
        } else if self.vacuum == Vacuum::Awaited {
            self.is_lost = true;
        } else if diagnosis.limp_home {
            self.is_lost |= is_too_high;
        }
        self.is_lost
    }
}
