//! The solenoid valve that sets the pressure in the actuator's chamber (paper, section 4).
//!
//! The PWM carrier is not resolved: the plunger is slow compared to it and follows the moving average of
//! the magnetic field (paper, section 5), a first-order lag of the duty scaled with the voltage — the
//! proportionality that eq. (9) compensates. The plunger's duty fixes the chamber pressure at which the
//! forces on it balance, eq. (7): below that pressure the valve lets ambient air into the chamber, above
//! it it connects the chamber to the vacuum tank.
//!
//! Eq. (8) as printed has flow whenever the upstream pressure is above that target, which for the ambient
//! port is always. The reading here is the one under which eq. (7) is an equilibrium: the tank port is
//! open above the target and the ambient port below it, each the wider the farther the chamber is from
//! the target. Of the printed coefficients of eq. (7) the third has the wrong sign (the chamber would
//! rise above ambient), and the polynomial is limited to ambient pressure (it exceeds it below 9.6 %).

use super::orifice::Orifice;
use super::scalar::Scalar;

/// A solenoid valve.
#[derive(Clone, Copy, Debug)]
pub struct SolenoidValve<D = f64> {
    /// k1 … k4 of eq. (7) for the duty in percent, in Pa.
    pub pressure_coefficient: [D; 4],
    /// k1 … k3 of eq. (6) for the duty in percent.
    pub leakage_coefficient: [D; 3],
    /// What eq. (6) is multiplied with, in m².
    pub leakage_area_scale: D,
    /// Area between ambient and chamber in m².
    pub ambient_area: D,
    /// Area between chamber and tank in m².
    pub tank_area: D,
    /// Distance from the target in Pa at which a port is open to 1/√2.
    pub proportional_band: D,
    /// Time constant of the plunger in s.
    pub time_constant: D,
    /// Voltage in V at which the plunger sees the commanded duty.
    pub nominal_voltage: D,
    /// Exponent of the voltage; 1 in eq. (9).
    pub voltage_exponent: D,
    /// The flow function of the ports.
    pub orifice: Orifice<D>,
}

/// What the valve does at an instant.
#[derive(Clone, Copy, Debug)]
pub struct ValveFlows<D = f64> {
    /// Target of the chamber's pressure in Pa, eq. (7).
    pub pressure: D,
    /// Opening of the port in use: above 0 to the tank, below 0 to ambient.
    pub opening: D,
    /// Flow from the chamber to the tank in kg/s.
    pub tank: D,
    /// Flow from ambient to the chamber in kg/s.
    pub ambient: D,
    /// Flow that leaks from ambient to the tank in kg/s.
    pub leakage: D,
}

impl<D: Scalar> SolenoidValve<D> {
    /// The duty in percent at nominal voltage that has the effect of `duty` at `voltage` (V).
    #[must_use]
    pub fn commanded_duty(&self, duty: D, voltage: D) -> D {
        let relative = voltage / self.nominal_voltage;
        let gain = if (self.voltage_exponent - 1.0).vanishes() {
            relative
        } else {
            relative.power(self.voltage_exponent)
        };
        (duty * gain).at_least(0.0).at_most(100.0)
    }

    /// Rate of change of the plunger's duty in %/s.
    #[must_use]
    pub fn plunger_rate(&self, commanded_duty: D, plunger_duty: D) -> D {
        (commanded_duty - plunger_duty) / self.time_constant
    }

    /// Eq. (7): the pressure in Pa at which the valve holds the chamber.
    #[must_use]
    pub fn pressure(&self, plunger_duty: D, ambient_pressure: D) -> D {
        let [k1, k2, k3, k4] = self.pressure_coefficient;
        let u = plunger_duty;
        (((k1 * u + k2) * u + k3) * u + k4).at_most(ambient_pressure)
    }

    /// The flows between ambient (pressure in Pa, temperature in K), chamber and tank (pressures in Pa);
    /// the whole vacuum system has ambient temperature.
    #[must_use]
    pub fn flows(
        &self,
        plunger_duty: D,
        ambient: (D, D),
        chamber_pressure: D,
        tank_pressure: D,
    ) -> ValveFlows<D> {
        let temperature = ambient.1;
        let chamber = (chamber_pressure, temperature);
        let tank = (tank_pressure, temperature);
        let pressure = self.pressure(plunger_duty, ambient.0);
        let deviation = (chamber_pressure - pressure) / self.proportional_band;
        let opening = deviation / (deviation * deviation + 1.0).sqrt();
        let [k1, k2, k3] = self.leakage_coefficient;
        let leakage_area =
            self.leakage_area_scale * ((k1 * plunger_duty + k2) * plunger_duty + k3).at_least(0.0);
        // At the target itself it is the tank's port that is about to open.
        let (tank_opening, ambient_opening) =
            if opening >= 0.0 { (opening, 0.0.into()) } else { (0.0.into(), -opening) };
        ValveFlows {
            pressure,
            opening,
            tank: self.orifice.mass_flow(self.tank_area * tank_opening, chamber, tank),
            ambient: self.orifice.mass_flow(self.ambient_area * ambient_opening, ambient, chamber),
            leakage: self.orifice.mass_flow(leakage_area, ambient, tank),
        }
    }

    /// The pressure in Pa at which the chamber comes to rest: the target, as far as tank and ambient allow.
    #[must_use]
    pub fn chamber_pressure_at_rest(&self, plunger_duty: D, ambient_pressure: D, tank_pressure: D) -> D {
        self.pressure(plunger_duty, ambient_pressure).at_least(tank_pressure).at_most(ambient_pressure)
    }
}
