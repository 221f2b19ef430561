//! The shaft of a turbocharger, between the power of the turbine and that of the compressor.

use super::gas::smooth_max;

/// A shaft.
#[derive(Clone, Copy, Debug)]
pub struct Shaft {
    /// Moment of inertia in kg m².
    pub inertia: f64,
    /// Viscous friction of the bearings in N m s.
    pub bearing_damping: f64,
}

impl Shaft {
    /// Angular acceleration in rad/s² at a speed (rad/s), for the powers (W) of turbine and compressor.
    ///
    /// Torque is power over speed, kept finite below 100 rad/s. There the compressor's power fades: what
    /// the smoothing of its equations leaves at standstill must not drive the shaft backwards.
    #[must_use]
    pub fn acceleration(&self, speed: f64, turbine_power: f64, compressor_power: f64) -> f64 {
        let net_power = turbine_power - compressor_power * (speed / 100.0).clamp(0.0, 1.0);
        net_power / (self.inertia * smooth_max(speed, 0.0, 100.0))
            - self.bearing_damping * speed / self.inertia
    }
}
