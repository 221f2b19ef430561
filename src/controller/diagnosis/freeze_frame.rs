//! The freeze frame: the conditions when the first code was found.

use fmu_export::Persistent;

use crate::controller::variables::{FreezeFrameLocals, Inputs, Locals, Real};

/// The frame, empty before the first code.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct FreezeFrame {
    is_taken: bool,
    code: i32,
    /// The time since the start (s).
    time: f64,
    engine_speed: Real,
    boost_pressure: Real,
    duty: Real,
}

impl FreezeFrame {
    /// Keeps the first code with its time (s), measurements, and duty (%) of the high-pressure wastegate.
    pub fn take(&mut self, code: i32, time: f64, inputs: &Inputs, duty: Real) {
        if !self.is_taken {
            let &Inputs { engine_speed, boost_pressure, .. } = inputs;
            *self = Self { is_taken: true, code, time, engine_speed, boost_pressure, duty };
        }
    }

    pub fn publish(&self, locals: &mut Locals) {
        locals.freeze_frame = FreezeFrameLocals {
            fault_code: self.code,
            time: self.time as Real,
            engine_speed: self.engine_speed,
            boost_pressure: self.boost_pressure,
            hp_wastegate_pwm: self.duty,
        };
    }
}
