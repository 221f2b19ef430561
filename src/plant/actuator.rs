//! The wastegate actuator: a membrane between the chamber and ambient, a spring, and the rod that opens
//! the high-pressure wastegate (paper, eqs. (3) to (5) and fig. 4).
//!
//! Vacuum opens: in eq. (4) ambient pressure and exhaust force on the wastegate plate act together against chamber
//! pressure and spring. More duty means less chamber pressure, a wider wastegate and less boost.
//!
//! The spring is preloaded and hardens towards full stroke (paper, fig. 8a); the stops are stiff springs whose damping
//! rises with depth. Friction follows Dahl (eq. (5)), written as σ·|1 − r|^α·sgn(1 − r)·v so that a friction force
//! beyond the Coulomb force does not raise a negative number to a power.

use super::gas::Gas;
use super::variables::{ActuatorLocals, ActuatorParameters};
use crate::elementary::Elementary;

/// A wastegate actuator.
#[derive(Clone, Copy, Debug)]
pub struct Actuator<D = f64> {
    /// The parameters.
    pub parameters: ActuatorParameters<D>,
    /// The gas in the chamber.
    pub air: Gas<D>,
    /// The opening at which the flap is stuck, if it is.
    pub stuck: Option<D>,
}

impl<D: Elementary> Actuator<D> {
    /// The chamber volume and the forces on the rod at a position (m) and speed (m/s), for ambient and chamber pressure
    /// (Pa) and the pressure difference (Pa) across the wastegate.
    #[must_use]
    pub fn evaluate(
        &self,
        position: D,
        velocity: D,
        ambient_pressure: D,
        chamber_pressure: D,
        exhaust_difference: D,
    ) -> ActuatorLocals<D> {
        ActuatorLocals {
            volume: self.volume(position),
            membrane_force: (ambient_pressure - chamber_pressure) * self.parameters.membrane_area,
            exhaust_force: self.parameters.exhaust_area * exhaust_difference,
            spring_force: self.spring_force(position),
            stop_force: self.stop_force(position, velocity),
        }
    }

    /// Eq. (4): acceleration in m/s².
    #[must_use]
    pub fn acceleration(&self, forces: &ActuatorLocals<D>, friction_force: D, velocity: D) -> D {
        let opening = forces.membrane_force + forces.exhaust_force - forces.spring_force - forces.stop_force;
        (opening - friction_force - self.parameters.damping * velocity) / self.parameters.mass
    }

    /// The spring's force in N at a position in m.
    #[must_use]
    pub fn spring_force(&self, position: D) -> D {
        self.parameters.spring_preload
            + self.parameters.spring_stiffness * position
            + self.parameters.spring_hardening * position.powi(7)
    }

    /// The stops' force in N at a position (m) and speed (m/s).
    #[must_use]
    pub fn stop_force(&self, position: D, velocity: D) -> D {
        let damped = |depth: D| {
            self.parameters.stop_damping * velocity * (depth / self.parameters.stop_damping_depth).min(1.0)
        };
        if position < 0.0 {
            self.parameters.stop_stiffness * position + damped(-position)
        } else if position > self.parameters.stroke {
            let depth = position - self.parameters.stroke;
            self.parameters.stop_stiffness * depth + damped(depth)
        } else {
            0.0.into()
        }
    }

    /// Eq. (5) times the speed (m/s): rate of change of the friction force (N) in N/s.
    #[must_use]
    pub fn friction_rate(&self, friction_force: D, velocity: D) -> D {
        let direction = if velocity < 0.0 { -1.0 } else { 1.0 };
        let margin = -friction_force / self.parameters.coulomb_friction * direction + 1.0;
        let share = if (self.parameters.friction_exponent - 1.0).is_constant(0.0) {
            margin
        } else if margin < 0.0 {
            -(-margin).power(self.parameters.friction_exponent)
        } else {
            margin.power(self.parameters.friction_exponent)
        };
        self.parameters.friction_stiffness * share * velocity
    }

    /// Chamber volume in m³ at a position in m. The lower limit is for solvers' trial states; the stops keep the rod
    /// far from it.
    #[must_use]
    pub fn volume(&self, position: D) -> D {
        (self.parameters.chamber_volume - self.parameters.membrane_area * position)
            .max(self.parameters.chamber_volume * 1e-3)
    }

    /// Eq. (3) for a moving wall: rate of change of chamber pressure (Pa) in Pa/s, for a net inflow `mass_flow` in
    /// kg/s.
    #[must_use]
    pub fn pressure_rate(&self, pressure: D, temperature: D, volume: D, velocity: D, mass_flow: D) -> D {
        let inflow = self.air.parameters.gas_constant * temperature * mass_flow;
        (inflow + pressure * self.parameters.membrane_area * velocity) / volume
    }

    /// The wastegate opening, from 0 to 1.
    #[must_use]
    pub fn opening(&self, position: D) -> D {
        match self.stuck {
            None => (position / self.parameters.stroke).max(0.0).min(1.0),
            Some(opening) => opening,
        }
    }

    /// The position in m at which spring and stops balance an opening force in N, without friction.
    ///
    /// Newton's method within a shrinking bracket: the force rises monotonically with position.
    #[must_use]
    #[allow(clippy::float_cmp, reason = "ends where numbers lie no closer")]
    pub fn position_at_rest(&self, opening_force: D) -> D {
        let excess =
            |x: f64| self.spring_force(x.into()) + self.stop_force(x.into(), 0.0.into()) - opening_force;
        let (stroke, stop_stiffness) =
            (self.parameters.stroke.value(), self.parameters.stop_stiffness.value());
        let stiffness = |x: f64| {
            let stop = if (0.0..=stroke).contains(&x) { 0.0 } else { stop_stiffness };
            self.parameters.spring_stiffness.value()
                + 7.0 * self.parameters.spring_hardening.value() * x.powi(6)
                + stop
        };
        let mut low = (-excess(0.0).value()).min(0.0) / stop_stiffness;
        let mut high = stroke + (-excess(stroke).value()).max(0.0) / stop_stiffness;
        let mut position = 0.5 * (low + high);
        for _ in 0..200 {
            let force = excess(position).value();
            if force > 0.0 {
                high = position;
            } else {
                low = position;
            }
            let newton = position - force / stiffness(position);
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if next == position {
                break;
            }
            position = next;
        }
        // The derivative follows from the force balance, by the implicit function theorem.
        let left = excess(position);
        (left - left.value()) / -stiffness(position) + position
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::system::System;
    use crate::plant::variables::Parameters;

    fn actuator() -> Actuator {
        System::new(&Parameters::default()).actuator
    }

    #[test]
    fn the_position_at_rest_balances_the_forces_everywhere() {
        let actuator = actuator();
        for force in [-50.0, 0.0, 18.9, 19.0, 25.0, 40.0, 74.3, 74.4, 200.0] {
            let position = actuator.position_at_rest(force);
            let held = actuator.spring_force(position) + actuator.stop_force(position, 0.0);
            // The stiffest spring, 3e5 N/m, times the spacing of numbers at 0.01 m, 2e-18 m, plus the rounding of the
            // forces.
            assert!((held - force).abs() < 1e-12 * force.abs().max(1.0), "{force} N: {held} N");
        }
    }

    #[test]
    fn friction_opposes_motion_and_saturates() {
        let actuator = actuator();
        assert!(actuator.friction_rate(0.0, 0.01) > 0.0);
        assert!(actuator.friction_rate(0.0, -0.01) < 0.0);
        assert!(actuator.friction_rate(0.2, 0.01).abs() < 1e-12);
        // Turning back, the full stiffness and the release of the stored force add.
        assert!((actuator.friction_rate(0.2, -0.01) + 2.0 * 400.0 * 0.01).abs() < 1e-12);
    }

    #[test]
    fn the_general_exponent_contains_the_linear_case() {
        let linear = actuator();
        let mut general = linear;
        general.parameters.friction_exponent = 1.0 + 1e-12;
        for (force, velocity) in [(0.1, 0.02), (-0.15, 0.01), (0.25, 0.01), (0.05, -0.03)] {
            let difference = general.friction_rate(force, velocity) - linear.friction_rate(force, velocity);
            // 1e-12 times the logarithm of the share, times rates of up to 24 N/s.
            assert!(difference.abs() < 1e-9, "{difference}");
        }
    }
}
