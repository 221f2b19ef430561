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

/// A solenoid valve.
#[derive(Clone, Copy, Debug)]
pub struct SolenoidValve {
    /// k1 … k4 of eq. (7) for the duty in percent, in Pa.
    pub pressure_coefficient: [f64; 4],
    /// k1 … k3 of eq. (6) for the duty in percent.
    pub leakage_coefficient: [f64; 3],
    /// What eq. (6) is multiplied with, in m².
    pub leakage_area_scale: f64,
    /// Area between ambient and chamber in m².
    pub ambient_area: f64,
    /// Area between chamber and tank in m².
    pub tank_area: f64,
    /// Distance from the target in Pa at which a port is open to 1/√2.
    pub proportional_band: f64,
    /// Time constant of the plunger in s.
    pub time_constant: f64,
    /// Voltage in V at which the plunger sees the commanded duty.
    pub nominal_voltage: f64,
    /// Exponent of the voltage; 1 in eq. (9).
    pub voltage_exponent: f64,
    /// The flow function of the ports.
    pub orifice: Orifice,
}

/// What the valve does at an instant.
#[derive(Clone, Copy, Debug)]
pub struct ValveFlows {
    /// Target of the chamber's pressure in Pa, eq. (7).
    pub pressure: f64,
    /// Opening of the port in use: above 0 to the tank, below 0 to ambient.
    pub opening: f64,
    /// Flow from the chamber to the tank in kg/s.
    pub tank: f64,
    /// Flow from ambient to the chamber in kg/s.
    pub ambient: f64,
    /// Flow that leaks from ambient to the tank in kg/s.
    pub leakage: f64,
}

impl SolenoidValve {
    /// The duty in percent at nominal voltage that has the effect of `duty` at `voltage` (V).
    #[must_use]
    #[allow(clippy::float_cmp, reason = "exactly 1 needs no power")]
    pub fn commanded_duty(&self, duty: f64, voltage: f64) -> f64 {
        let relative = voltage / self.nominal_voltage;
        let gain = if self.voltage_exponent == 1.0 { relative } else { relative.powf(self.voltage_exponent) };
        (duty * gain).clamp(0.0, 100.0)
    }

    /// Rate of change of the plunger's duty in %/s.
    #[must_use]
    pub fn plunger_rate(&self, commanded_duty: f64, plunger_duty: f64) -> f64 {
        (commanded_duty - plunger_duty) / self.time_constant
    }

    /// Eq. (7): the pressure in Pa at which the valve holds the chamber.
    #[must_use]
    pub fn pressure(&self, plunger_duty: f64, ambient_pressure: f64) -> f64 {
        let [k1, k2, k3, k4] = self.pressure_coefficient;
        let u = plunger_duty;
        (((k1 * u + k2) * u + k3) * u + k4).min(ambient_pressure)
    }

    /// The flows between ambient (pressure in Pa, temperature in K), chamber and tank (pressures in Pa);
    /// the whole vacuum system has ambient temperature.
    #[must_use]
    pub fn flows(
        &self,
        plunger_duty: f64,
        ambient: (f64, f64),
        chamber_pressure: f64,
        tank_pressure: f64,
    ) -> ValveFlows {
        let temperature = ambient.1;
        let chamber = (chamber_pressure, temperature);
        let tank = (tank_pressure, temperature);
        let pressure = self.pressure(plunger_duty, ambient.0);
        let deviation = (chamber_pressure - pressure) / self.proportional_band;
        let opening = deviation / (1.0 + deviation * deviation).sqrt();
        let [k1, k2, k3] = self.leakage_coefficient;
        let leakage_area = self.leakage_area_scale * ((k1 * plunger_duty + k2) * plunger_duty + k3).max(0.0);
        ValveFlows {
            pressure,
            opening,
            tank: self.orifice.mass_flow(self.tank_area * opening.max(0.0), chamber, tank),
            ambient: self.orifice.mass_flow(self.ambient_area * (-opening).max(0.0), ambient, chamber),
            leakage: self.orifice.mass_flow(leakage_area, ambient, tank),
        }
    }

    /// The pressure in Pa at which the chamber comes to rest: the target, as far as tank and ambient allow.
    #[must_use]
    pub fn chamber_pressure_at_rest(
        &self,
        plunger_duty: f64,
        ambient_pressure: f64,
        tank_pressure: f64,
    ) -> f64 {
        self.pressure(plunger_duty, ambient_pressure).max(tank_pressure).min(ambient_pressure)
    }
}
