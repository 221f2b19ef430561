//! The duty of each mode without feedback.

use super::actuator_inverse;
use super::schedule::OperatingPoint;
use super::variables::{ControlMode, Inputs, Parameters, Real};
use crate::elementary::smaller;

/// The boost pressure reference (Pa), within the limit that protects the engine (paper, section 6).
pub fn bounded_reference(parameters: &Parameters, inputs: &Inputs) -> Real {
    smaller(inputs.boost_reference, parameters.boost_limit)
}

/// The duty at nominal voltage (%) of a mode without memory: the static map of the paper's fig. 12 in mode boost with
/// the strategy `by_speed`, the inverse actuator in mode position, the input in mode `open_loop`.
pub fn at_rest(parameters: &Parameters, inputs: &Inputs) -> Real {
    match parameters.mode {
        ControlMode::Boost => {
            let reference = bounded_reference(parameters, inputs);
            OperatingPoint::new(&parameters.schedule, reference, inputs.engine_speed).feedforward()
        }
        ControlMode::Position => {
            actuator_inverse::duty(&parameters.actuator_inverse, inputs.wastegate_reference)
        }
        ControlMode::OpenLoop => inputs.pwm_reference,
    }
}
