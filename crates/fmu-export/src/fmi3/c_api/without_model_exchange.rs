//! The Model Exchange functions of an FMU without it; the calling sequence rejects them.

use crate::c_boundary::refusals;
use crate::error::Error;
use crate::fmi3::c_types::{Boolean, Status};
use crate::fmi3::calling_sequence::Function;
use crate::model::Model;

const REASON: &str = "this FMU does not offer Model Exchange";

refusals! {
    "fmi3";
    update_discrete_states(*mut Boolean, *mut Boolean, *mut Boolean, *mut Boolean, *mut Boolean, *mut f64):
        UpdateDiscreteStates, REASON;
    enter_continuous_time_mode(): EnterContinuousTimeMode, REASON;
    completed_integrator_step(Boolean, *mut Boolean, *mut Boolean): CompletedIntegratorStep, REASON;
    set_time(f64): SetTime, REASON;
    set_continuous_states(*const f64, usize): SetContinuousStates, REASON;
    get_continuous_state_derivatives(*mut f64, usize): GetContinuousStateDerivatives, REASON;
    get_event_indicators(*mut f64, usize): GetEventIndicators, REASON;
    get_continuous_states(*mut f64, usize): GetContinuousStates, REASON;
    get_nominals_of_continuous_states(*mut f64, usize): GetNominalsOfContinuousStates, REASON;
}
