//! The reference model of the structure `model_reference` (internal model control).
//!
//! With a static feedforward and an integral term, the response to the reference is `(1 + s (T + λ')) / ((1 + s T) (1 +
//! s λ'))` with `λ' = λ + L/2`: it overshoots by construction. Here an engine model, composed of the local models along
//! its path, is driven to the reference with the time constant λ. The duty that does so is the feedforward; the
//! feedback acts only on the difference between the engine and the model, delayed like the engine. Since the model
//! receives the limited duty, it does not run away from an engine whose wastegate is at its stop.

use fmu_export::Persistent;

use super::schedule::OperatingPoint;
use super::variables::Real;
use crate::elementary::larger;

/// The state of the reference model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct ReferenceModel {
    /// `y_m`: its boost pressure (Pa).
    pub pressure: Real,
    /// `y_d`: the same, delayed like the engine (Pa); none before the first sample.
    delayed: Option<Real>,
}

/// The reference model at one sample.
#[derive(Clone, Copy, Debug)]
pub struct Linearized {
    /// The duty at nominal voltage (%) that would hold the model's boost pressure.
    holding: Real,
    /// `K_p`: the static gain from duty to the model's boost pressure (Pa/%).
    pub gain: Real,
    /// `K_p / T_tf`: the initial rate of change per duty (Pa/(% s)).
    slope: Real,
}

impl ReferenceModel {
    /// A model at rest at a boost pressure (Pa).
    pub fn at(pressure: Real) -> Self {
        Self { pressure, delayed: None }
    }

    /// Converts all pressures (Pa).
    pub fn convert(&mut self, pressure: impl Fn(Real) -> Real) {
        self.pressure = pressure(self.pressure);
        self.delayed = self.delayed.map(pressure);
    }

    /// The model at its boost pressure, given any operating point at the same engine speed, and the duty (%) that holds
    /// it if not the duty at rest.
    pub fn linearize<const COLUMNS: usize>(
        &self,
        operating_point: OperatingPoint<'_, COLUMNS>,
        holding: Option<Real>,
    ) -> Linearized {
        let here = operating_point.at_pressure(self.pressure);
        let local = here.local_model();
        Linearized {
            holding: holding.unwrap_or_else(|| here.feedforward()),
            gain: local.gain,
            slope: local.gain / local.time_constant,
        }
    }

    /// The duty at nominal voltage (%) that drives the model to the reference (Pa) with the time constant
    /// λ (s).
    pub fn feedforward(&self, model: &Linearized, reference: Real, lambda: Real) -> Real {
        model.holding + (reference - self.pressure) / lambda / model.slope
    }

    /// The pressure (Pa) that the engine should have: the delayed model's.
    pub fn expected_measurement(&self) -> Real {
        self.delayed.unwrap_or(self.pressure)
    }

    /// The excess of the delayed model over a measurement (Pa). The model starts at the measurement, hence at 0.
    pub fn error(&self, measurement: Real) -> Real {
        self.delayed.map_or(0.0, |delayed| delayed - measurement)
    }

    /// Moves the model a share of the way to a measurement (Pa).
    pub fn approach(&mut self, measurement: Real, share: Real) {
        let shift = share * self.error(measurement);
        self.pressure -= shift;
        self.delayed = self.delayed.map(|delayed| delayed - shift);
    }

    /// Advances to the next sample with the limited feedforward duty (%). The delay (s) is approximated by a first-order
    /// lag of equal time.
    pub fn advance(&mut self, model: &Linearized, duty: Real, delay: Real, sample_time: Real) {
        let delayed = self.delayed.unwrap_or(self.pressure);
        let lag = larger(delay, sample_time);
        self.delayed = Some(delayed + sample_time / lag * (self.pressure - delayed));
        self.pressure += sample_time * (duty - model.holding) * model.slope;
    }
}
