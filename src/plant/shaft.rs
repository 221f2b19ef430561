//! A turbocharger shaft, between turbine power and compressor power.

use super::gas::smooth_max;
use super::variables::ShaftParameters;
use fmu_export::Number;

#[derive(Clone, Copy, Debug)]
pub struct Shaft<D = f64> {
    /// Moment of inertia in kg m².
    inertia: D,
    /// Viscous friction of the bearings over the moment of inertia, in 1/s.
    damping_by_inertia: D,
}

impl<D: Number> Shaft<D> {
    pub fn new(parameters: ShaftParameters<D>) -> Self {
        let ShaftParameters { inertia, bearing_damping } = parameters;
        Self { inertia, damping_by_inertia: bearing_damping / inertia }
    }

    /// Angular acceleration in rad/s² at a speed (rad/s), for the powers (W) of turbine and compressor.
    ///
    /// Torque is power over speed, kept finite below 100 rad/s. There the compressor power fades, so that its smoothed
    /// equations cannot drive a stationary shaft backwards.
    pub fn acceleration(&self, speed: D, turbine_power: D, compressor_power: D) -> D {
        let net_power = turbine_power - compressor_power * (speed * 0.01).max(0.0).min(1.0);
        net_power / (self.inertia * smooth_max(speed, 0.0.into(), 100.0.into()))
            - self.damping_by_inertia * speed
    }
}
