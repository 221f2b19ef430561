//! Ambient conditions ("day"): converts the schedule of the strategy `split_range` from reference to other conditions.
//!
//! An operating point is looked up at reference conditions, at the point with the same valve openings, turbine pressure
//! ratios and corrected shaft speeds. With δ and θ the ambient pressure and temperature over their reference values, Π
//! the ratio of boost to ambient pressure, and τ the ratio of exhaust temperatures:
//!
//! - In thin air less exhaust flows and loses more of its heat upstream of the turbines: its temperature is
//!   proportional to flow to the power ε. Turbine flow at equal pressure ratio is proportional to p / √T, so that τ =
//!   (δ / √τ)^ε. Ambient temperature changes exhaust temperature by a hundredth, which is neglected.
//! - Turbine work per mass is proportional to τ and equals compressor work, `c_p T (Π^((γ−1)/γ) − 1)`: the schedule's
//!   ratio follows from `Π₀^((γ−1)/γ) − 1 = θ/τ (Π^((γ−1)/γ) − 1)`.
//! - Engine flow is proportional to speed, boost pressure and 1/θ, flow through turbines and wastegates to δ/√τ, so the
//!   schedule's engine speed is `N Π √τ / (θ Π₀)`.
//! - At equal corrected speed the shafts turn faster by √τ. Their energy is proportional to τ and their power to δ √τ,
//!   so time constants are longer by √τ/δ.
//!
//! (Corrected quantities: Eriksson and Nielsen, Modeling and Control of Engines and Drivelines, 2014, chapter 8.)
//!
//! The actuator does not scale: its spring needs the same difference to ambient pressure, but paper, eq. (7), gives
//! absolute chamber pressure. So the duty is the one whose chamber pressure is lower by the difference in ambient
//! pressure.

use fmu_export::{Float, Persistent};

use super::actuator_inverse;
use super::variables::{DayLocals, Inputs, Parameters, Real};
use crate::elementary::{Power, larger};

/// The lowest ambient pressure (Pa) and temperature (K) that are measurements: no road has lower ones.
const LEAST_PRESSURE: Real = 40e3;
const LEAST_TEMPERATURE: Real = 200.0;

/// (γ − 1)/γ of air.
const EXPONENT: Real = 0.4 / 1.4;

/// The lowest pressure ratio to ambient, to stay finite for a measurement of 0.
const LEAST_RATIO: Real = 0.1;

/// The lowest pressure (Pa) for converting engine speed, to stay finite for a reference of 0.
const LEAST_CONVERTED: Real = 1e3;

impl Inputs {
    /// Whether ambient pressure is measured.
    #[must_use]
    pub fn measures_ambient_pressure(&self) -> bool {
        self.ambient_pressure >= LEAST_PRESSURE
    }

    /// By how much ambient pressure is below the nominal one (Pa), 0 without a measurement.
    #[must_use]
    pub fn pressure_deficit(&self, parameters: &Parameters) -> Real {
        if self.measures_ambient_pressure() {
            parameters.nominal_ambient_pressure - self.ambient_pressure
        } else {
            0.0
        }
    }
}

/// Ambient conditions relative to reference conditions.
#[derive(Clone, Copy, Debug, PartialEq, Persistent)]
pub struct Day {
    /// δ: ambient pressure over its reference value.
    pressure_ratio: Real,
    /// θ: ambient temperature over its reference value.
    temperature_ratio: Real,
    /// τ: work per mass of exhaust over that at reference conditions.
    work_ratio: Real,
    /// Ambient pressure (Pa).
    ambient_pressure: Real,
    /// By how much ambient pressure is below the reference value (Pa).
    pressure_deficit: Real,
    /// Whether ambient pressure is measured.
    pub is_measured: bool,
}

impl Default for Day {
    /// Reference conditions.
    fn default() -> Self {
        Self {
            pressure_ratio: 1.0,
            temperature_ratio: 1.0,
            work_ratio: 1.0,
            ambient_pressure: 1.0,
            pressure_deficit: 0.0,
            is_measured: false,
        }
    }
}

#[allow(clippy::float_cmp, reason = "exactly 1 without a measurement")]
impl Day {
    /// Measured conditions, or reference conditions without measurements.
    pub fn measured(parameters: &Parameters, inputs: &Inputs) -> Self {
        let &Parameters {
            nominal_ambient_pressure, nominal_ambient_temperature, exhaust_work_exponent, ..
        } = parameters;
        let measured = |value, least, nominal| if value >= least { value } else { nominal };
        let ambient_pressure = measured(inputs.ambient_pressure, LEAST_PRESSURE, nominal_ambient_pressure);
        let temperature =
            measured(inputs.ambient_temperature, LEAST_TEMPERATURE, nominal_ambient_temperature);
        let pressure_ratio = ambient_pressure / nominal_ambient_pressure;
        let temperature_ratio = temperature / nominal_ambient_temperature;
        Self {
            pressure_ratio,
            temperature_ratio,
            // Flow is proportional to δ / √τ, and τ to flow to the power ε.
            work_ratio: pressure_ratio.power(exhaust_work_exponent / (1.0 + 0.5 * exhaust_work_exponent)),
            ambient_pressure,
            pressure_deficit: inputs.pressure_deficit(parameters),
            is_measured: inputs.measures_ambient_pressure(),
        }
    }

    /// The pressure at reference conditions that corresponds to one here (Pa).
    pub fn scheduled_pressure(&self, pressure: Real) -> Real {
        self.with_work(pressure, self.temperature_ratio / self.work_ratio) / self.pressure_ratio
    }

    /// The pressure here that corresponds to one at reference conditions (Pa).
    pub fn pressure(&self, scheduled: Real) -> Real {
        self.with_work(scheduled * self.pressure_ratio, self.work_ratio / self.temperature_ratio)
    }

    /// The pressure (Pa) that the compressors reach here with a multiple of the work.
    fn with_work(&self, pressure: Real, multiple: Real) -> Real {
        if multiple == 1.0 {
            return pressure;
        }
        let ratio = larger(pressure / self.ambient_pressure, LEAST_RATIO);
        let work = multiple * (ratio.power(EXPONENT) - 1.0);
        self.ambient_pressure * larger(larger(1.0 + work, LEAST_RATIO).power(1.0 / EXPONENT), LEAST_RATIO)
    }

    /// The factor from engine speed to the schedule's, at a pressure here and the corresponding one at reference
    /// conditions (Pa).
    pub fn speed_factor(&self, pressure: Real, scheduled_pressure: Real) -> Real {
        if self.temperature_ratio == 1.0 && self.work_ratio == 1.0 {
            return 1.0;
        }
        let scheduled_pressure = larger(scheduled_pressure, LEAST_CONVERTED);
        Float::sqrt(self.work_ratio) * (pressure / self.pressure_ratio)
            / (self.temperature_ratio * scheduled_pressure)
    }

    /// The boost pressure limit (Pa, at reference conditions) at an engine speed (rpm) here that keeps a shaft speed,
    /// from the schedule's over engine speed.
    ///
    /// Equal shaft speeds mean equal work and equal volume flows of the compressors, which are proportional to engine
    /// speed and pressure ratio.
    pub fn limit_of_shaft(&self, engine_speed: Real, scheduled: impl Fn(Real) -> Real) -> Real {
        let nearly = scheduled(engine_speed) * self.pressure_ratio;
        let factor = self.with_work(nearly, 1.0 / self.temperature_ratio) / nearly;
        let limit = scheduled(engine_speed * factor) * self.pressure_ratio;
        // To the day with 1/θ of the work, and from it to reference conditions with θ/τ.
        self.with_work(limit, 1.0 / self.work_ratio) / self.pressure_ratio
    }

    /// The factor of time constants.
    pub fn time_scale(&self) -> Real {
        Float::sqrt(self.work_ratio) / self.pressure_ratio
    }

    /// The variables that show the conditions.
    pub fn locals(&self) -> DayLocals {
        DayLocals {
            pressure_ratio: self.pressure_ratio,
            temperature_ratio: self.temperature_ratio,
            work_ratio: self.work_ratio,
        }
    }

    /// The duty (%) here equivalent to one at reference conditions.
    pub fn duty(&self, parameters: &Parameters, scheduled: Real) -> Real {
        if self.pressure_deficit == 0.0 {
            return scheduled;
        }
        actuator_inverse::duty_at_lower_pressure(
            &parameters.actuator_inverse,
            scheduled,
            self.pressure_deficit,
        )
    }
}
