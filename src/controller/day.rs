//! The day: the schedule of the strategy `split_range`, identified at one ambient, made to hold at another.
//!
//! An operating point on this day is looked up at the one on the schedule's day, with the same openings of all valves,
//! that has the same pressure ratios of the turbines and corrected speeds of the shafts. With δ and θ the ambient pressure
//! and temperature by those of the schedule, Π the ratio of boost to ambient pressure, and τ that of the exhaust's
//! temperatures:
//!
//! - In thin air less exhaust flows, and loses more of its heat before the turbines: its temperature is proportional to
//!   the flow's power ε. A turbine's flow at equal pressure ratio is proportional to p / √T, so that τ = (δ / √τ)^ε. The
//!   temperature of the ambient changes that of the exhaust by a hundredth, which is neglected.
//! - The turbines' work per mass is proportional to τ, and that of the compressors is equal to it,
//!   `c_p T (Π^((γ−1)/γ) − 1)`: the schedule's ratio follows from `Π₀^((γ−1)/γ) − 1 = θ/τ (Π^((γ−1)/γ) − 1)`.
//! - The engine's flow is proportional to speed, boost pressure and 1/θ, and those through turbines and wastegates to
//!   δ/√τ, so the schedule's engine speed is `N Π √τ / (θ Π₀)`.
//! - The shafts turn by √τ faster at equal corrected speed. Their energy is proportional to τ and their power to δ √τ, so
//!   that time constants are longer by √τ/δ.
//!
//! (Corrected quantities: Eriksson and Nielsen, Modeling and Control of Engines and Drivelines, 2014, chapter 8.)
//!
//! The actuator does not scale: its spring needs the same difference to ambient pressure, and paper, eq. (7), gives the
//! chamber's absolute pressure. So the duty is the one whose chamber pressure is lower by as much as the ambient's.

use fmu_export::Persistent;

use super::actuator_inverse;
use super::schedule::OperatingPoint;
use super::variables::{Inputs, Parameters};
use crate::elementary::{larger, power};

/// The least ambient pressure (Pa) and temperature (K) that are measurements: there is no road where they are lower.
const LEAST_PRESSURE: f64 = 40e3;
const LEAST_TEMPERATURE: f64 = 200.0;

/// (γ − 1)/γ of air.
const EXPONENT: f64 = 0.4 / 1.4;

/// The least ratio of pressures to ambient: a measurement of 0 stays finite.
const LEAST_RATIO: f64 = 0.1;

/// The least pressure (Pa) for which engine speed is converted: with a reference of 0 it stays finite.
const LEAST_CONVERTED: f64 = 1e3;

/// How a day differs from the one of the schedule.
#[derive(Clone, Copy, Debug, PartialEq, Persistent)]
pub struct Day {
    /// δ: ambient pressure by that of the schedule.
    pressure_ratio: f64,
    /// θ: ambient temperature by that of the schedule.
    temperature_ratio: f64,
    /// τ: work per mass of exhaust by that on the day of the schedule.
    work_ratio: f64,
    /// Ambient pressure (Pa).
    ambient_pressure: f64,
    /// How far it is below that of the schedule (Pa).
    pressure_deficit: f64,
    /// Whether it differs at all.
    pub is_other: bool,
}

impl Default for Day {
    /// That of any schedule.
    fn default() -> Self {
        Self {
            pressure_ratio: 1.0,
            temperature_ratio: 1.0,
            work_ratio: 1.0,
            ambient_pressure: 1.0,
            pressure_deficit: 0.0,
            is_other: false,
        }
    }
}

#[allow(clippy::float_cmp, reason = "exactly 1 without a measurement")]
impl Day {
    /// The day by its measurements; that of the schedule where there are none.
    pub fn measured(parameters: &Parameters, inputs: &Inputs) -> Self {
        let &Parameters {
            nominal_ambient_pressure, nominal_ambient_temperature, exhaust_work_exponent, ..
        } = parameters;
        let measured = |value, least, nominal| if value >= least { value } else { nominal };
        let ambient_pressure = measured(inputs.ambient_pressure, LEAST_PRESSURE, nominal_ambient_pressure);
        let temperature =
            measured(inputs.ambient_temperature, LEAST_TEMPERATURE, nominal_ambient_temperature);
        let pressure_ratio = ambient_pressure / nominal_ambient_pressure;
        Self {
            pressure_ratio,
            temperature_ratio: temperature / nominal_ambient_temperature,
            // The flow is proportional to δ / √τ, and τ to the flow's power ε.
            work_ratio: power(pressure_ratio, exhaust_work_exponent / (1.0 + 0.5 * exhaust_work_exponent)),
            ambient_pressure,
            pressure_deficit: nominal_ambient_pressure - ambient_pressure,
            is_other: ambient_pressure != nominal_ambient_pressure
                || temperature != nominal_ambient_temperature,
        }
    }

    /// The operating point of a pressure (Pa) and an engine speed (rpm) on the schedule's day.
    ///
    /// Other days have operating points between the columns of the schedule even where the engine turns at the speed of
    /// one.
    pub fn operating_point<'a>(
        &self,
        parameters: &'a Parameters,
        pressure: f64,
        engine_speed: f64,
    ) -> OperatingPoint<'a, 12> {
        let place = OperatingPoint::new(&parameters.range_schedule, pressure, engine_speed);
        if self.is_other { place.aligned(pressure, [parameters.pwm_min, parameters.pwm_max]) } else { place }
    }

    /// The pressure on the day of the schedule that corresponds to one on this day (Pa).
    pub fn scheduled_pressure(&self, pressure: f64) -> f64 {
        self.with_work(pressure, self.temperature_ratio / self.work_ratio) / self.pressure_ratio
    }

    /// The pressure on this day that corresponds to one on the day of the schedule (Pa).
    pub fn pressure(&self, scheduled: f64) -> f64 {
        self.with_work(scheduled * self.pressure_ratio, self.work_ratio / self.temperature_ratio)
    }

    /// The pressure (Pa) to which compressors of this day bring the air with a multiple of the work.
    fn with_work(&self, pressure: f64, multiple: f64) -> f64 {
        if multiple == 1.0 {
            return pressure;
        }
        let ratio = larger(pressure / self.ambient_pressure, LEAST_RATIO);
        let work = multiple * (power(ratio, EXPONENT) - 1.0);
        self.ambient_pressure * larger(power(larger(1.0 + work, LEAST_RATIO), 1.0 / EXPONENT), LEAST_RATIO)
    }

    /// The factor from engine speed to that at which the schedule holds, at a pressure on its day (Pa).
    pub fn speed_factor(&self, scheduled_pressure: f64) -> f64 {
        if self.temperature_ratio == 1.0 && self.work_ratio == 1.0 {
            return 1.0;
        }
        let scheduled_pressure = larger(scheduled_pressure, LEAST_CONVERTED);
        let pressure = self.pressure(scheduled_pressure) / self.pressure_ratio;
        self.work_ratio.sqrt() * pressure / (self.temperature_ratio * scheduled_pressure)
    }

    /// The limit of boost pressure (Pa, as on the day of the schedule) at an engine speed (rpm) of this day that keeps a
    /// shaft's speed, by that of the schedule over engine speed.
    ///
    /// Equal speeds of the shafts go with equal work and equal volume flows of the compressors, and these are proportional
    /// to engine speed and ratio of pressures.
    pub fn limit_of_shaft(&self, engine_speed: f64, scheduled: impl Fn(f64) -> f64) -> f64 {
        let on_day = |limit: f64| self.with_work(limit * self.pressure_ratio, 1.0 / self.temperature_ratio);
        let nearly = scheduled(engine_speed);
        let factor = on_day(nearly) / (nearly * self.pressure_ratio);
        self.scheduled_pressure(on_day(scheduled(engine_speed * factor)))
    }

    /// The factor of time constants.
    pub fn time_scale(&self) -> f64 {
        self.work_ratio.sqrt() / self.pressure_ratio
    }

    /// The duty (%) on this day that acts like one on the day of the schedule.
    pub fn duty(&self, parameters: &Parameters, scheduled: f64) -> f64 {
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
