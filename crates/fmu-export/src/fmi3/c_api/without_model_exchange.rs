//! The Model Exchange functions of an FMU without it, which the calling sequence rejects, and those that differ.

use super::accessors;
use crate::c_boundary::{c_functions, get_values, refusals};
use crate::error::Error;
use crate::fmi3::c_types::{self, Boolean, Status, ValueReference};
use crate::fmi3::calling_sequence::Function;
use crate::instance::Instance;
use crate::model::Model;

const REASON: &str = "this FMU does not offer Model Exchange";

refusals! {
    fmi3EnterEventMode(), super::WITHOUT_EVENT_MODE;
    fmi3UpdateDiscreteStates(*mut Boolean, *mut Boolean, *mut Boolean, *mut Boolean, *mut Boolean, *mut f64), REASON;
    fmi3EnterContinuousTimeMode(), REASON;
    fmi3CompletedIntegratorStep(Boolean, *mut Boolean, *mut Boolean), REASON;
    fmi3SetTime(f64), REASON;
    fmi3SetContinuousStates(*const f64, usize), REASON;
    fmi3GetContinuousStateDerivatives(*mut f64, usize), REASON;
    fmi3GetEventIndicators(*mut f64, usize), REASON;
    fmi3GetContinuousStates(*mut f64, usize), REASON;
    fmi3GetNominalsOfContinuousStates(*mut f64, usize), REASON;
}

c_functions! {
    fmi3ExitInitializationMode<Model>(), Instance::exit_initialization_mode;
}

accessors! {
    fmi3GetFloat64<Model>, get_values(*mut f64), Instance::get_real;
}
