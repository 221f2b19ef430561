//! The solenoid valve that sets the actuator chamber pressure (paper, section 4).
//!
//! The PWM carrier is not resolved: the plunger is slow compared with it and follows the moving average of the magnetic
//! field (paper, section 5), a first-order lag of the duty scaled with the voltage, as compensated by eq. (9). The
//! plunger duty determines the chamber pressure at which the plunger's forces balance, eq. (7): below that pressure the
//! valve admits ambient air to the chamber, above it the valve connects the chamber to the vacuum tank.
//!
//! As printed, eq. (8) has flow whenever the upstream pressure is above that target, which for the ambient port is
//! always. Here it is read such that eq. (7) is an equilibrium: the tank port opens above the target and the ambient
//! port below it, wider with distance from the target. The third printed coefficient of eq. (7) has the wrong sign (the
//! chamber would rise above ambient), and the polynomial is limited to ambient pressure (exceeded below 9.6 %).

use super::orifice::Orifice;
use super::variables::{ValveLocals, ValveParameters};
use crate::elementary::Elementary;

/// A plunger's largest duty in percent.
const LARGEST_DUTY: u8 = 100;

#[derive(Clone, Copy, Debug)]
pub struct SolenoidValve<D = f64> {
    pub parameters: ValveParameters<D>,
    /// The flow function of the ports.
    pub orifice: Orifice<D>,
    /// The area (m²) of a leak into the tank, in addition to the valve's leakage.
    pub leak_area: D,
}

impl<D: Elementary> SolenoidValve<D> {
    /// The duty in percent at nominal voltage equivalent to `duty` at `voltage` (V).
    pub fn commanded_duty(&self, duty: D, voltage: D) -> D {
        let relative = voltage / self.parameters.nominal_voltage;
        let gain = if (self.parameters.voltage_exponent - 1.0).is_constant(0.0) {
            relative
        } else {
            relative.power(self.parameters.voltage_exponent)
        };
        (duty * gain).max(0.0).min(f64::from(LARGEST_DUTY))
    }

    /// Rate of change of the plunger's duty in %/s.
    pub fn plunger_rate(&self, commanded_duty: D, plunger_duty: D) -> D {
        (commanded_duty - plunger_duty) / self.parameters.time_constant
    }

    /// Eq. (7): the pressure in Pa at which the valve holds the chamber.
    pub fn pressure(&self, plunger_duty: D, ambient_pressure: D) -> D {
        let [k1, k2, k3, k4] = self.parameters.pressure_coefficient;
        let u = plunger_duty;
        (((k1 * u + k2) * u + k3) * u + k4).min(ambient_pressure)
    }

    /// The valve at a plunger duty in percent: the flows between ambient (pressure in Pa, temperature in K), chamber
    /// and tank (pressures in Pa), all at ambient temperature. Voltage in V and commanded duty in percent act only on
    /// the plunger.
    pub fn flows(
        &self,
        (voltage, commanded_duty): (D, D),
        plunger_duty: D,
        ambient: (D, D),
        chamber_pressure: D,
        tank_pressure: D,
    ) -> ValveLocals<D> {
        let temperature = ambient.1;
        let chamber = (chamber_pressure, temperature);
        let tank = (tank_pressure, temperature);
        let pressure = self.pressure(plunger_duty, ambient.0);
        let deviation = (chamber_pressure - pressure) / self.parameters.proportional_band;
        let opening = deviation / (deviation * deviation + 1.0).sqrt();
        let [k1, k2, k3] = self.parameters.leakage_coefficient;
        let leakage_area = self.parameters.leakage_area_scale
            * ((k1 * plunger_duty + k2) * plunger_duty + k3).max(0.0)
            + self.leak_area;
        // At the target itself, the tank port is about to open.
        let (tank_opening, ambient_opening) =
            if opening >= 0.0 { (opening, 0.0.into()) } else { (0.0.into(), -opening) };
        ValveLocals {
            voltage,
            commanded_duty,
            pressure,
            opening,
            tank_mass_flow: self.orifice.mass_flow(self.parameters.tank_area * tank_opening, chamber, tank),
            ambient_mass_flow: self.orifice.mass_flow(
                self.parameters.ambient_area * ambient_opening,
                ambient,
                chamber,
            ),
            leakage_mass_flow: self.orifice.mass_flow(leakage_area, ambient, tank),
        }
    }

    /// The pressure in Pa at which the chamber settles: the target, within tank and ambient pressure.
    pub fn chamber_pressure_at_rest(&self, plunger_duty: D, ambient_pressure: D, tank_pressure: D) -> D {
        self.pressure(plunger_duty, ambient_pressure).max(tank_pressure).min(ambient_pressure)
    }
}

impl SolenoidValve {
    /// The lowest pressure in Pa at which the valve would hold the chamber, and its plunger duty, a whole percentage.
    pub fn lowest_pressure(&self) -> (f64, f64) {
        let pressures =
            (0..=LARGEST_DUTY).map(f64::from).map(|duty| (self.pressure(duty, f64::INFINITY), duty));
        pressures.fold((f64::INFINITY, 0.0), |lowest, next| if next.0 < lowest.0 { next } else { lowest })
    }
}
