//! The functions of Model Exchange, and of events in Co-Simulation.

use fmu_abi::fmi3::c_types::{Boolean, FALSE, Status};
use fmu_abi::fmi3::calling_sequence;
use fmu_solve::Error;
use fmu_terms::InstanceType;

use crate::c_boundary::arguments::not_null;
use crate::c_boundary::{self, c_functions};
use crate::instance::Instance;
use crate::kinds::Model;
use crate::model::variables::Described as _;

c_functions! {
    /// An error in co-simulation without Event Mode.
    fmi3EnterEventMode(), |instance| {
        if const { !Instance::<M>::EVENTS.is_made } || instance.instance_type() == InstanceType::CoSimulation {
            return Err(Error::new("Event Mode is not used (hasEventMode or eventModeUsed is false)"));
        }
        instance.enter_event_mode()
    };
    fmi3UpdateDiscreteStates(
        again: *mut Boolean, terminate: *mut Boolean, nominals_changed: *mut Boolean,
        values_changed: *mut Boolean, next_event_time_defined: *mut Boolean, next_event_time: *mut f64,
    ) if EVENTS, |instance| {
        let again = not_null("discreteStatesNeedUpdate", again)?;
        let terminate = not_null("terminateSimulation", terminate)?;
        let nominals_changed = not_null("nominalsOfContinuousStatesChanged", nominals_changed)?;
        let values_changed = not_null("valuesOfContinuousStatesChanged", values_changed)?;
        let is_defined = not_null("nextEventTimeDefined", next_event_time_defined)?;
        let next = not_null("nextEventTime", next_event_time)?;
        let (status, found) = instance.new_discrete_states()?;
        again.write_unaligned(Boolean::from(found.again));
        terminate.write_unaligned(Boolean::from(found.terminate));
        nominals_changed.write_unaligned(FALSE);
        values_changed.write_unaligned(Boolean::from(found.states_changed));
        is_defined.write_unaligned(Boolean::from(found.next.is_some()));
        next.write_unaligned(found.next.unwrap_or_default());
        Ok(status)
    };
    fmi3EnterContinuousTimeMode() if EVENTS, Instance::enter_continuous_time_mode;
    /// Does nothing: `needsCompletedIntegratorStep` is false.
    fmi3CompletedIntegratorStep(
        _no_set_fmu_state_prior: Boolean, event_mode: *mut Boolean, terminate: *mut Boolean,
    ) if EVENTS, |_| c_boundary::completed_integrator_step(event_mode, terminate);
    fmi3SetTime(time: f64) if EVENTS, |instance| instance.set_time(time);
    fmi3SetContinuousStates(states: *const f64, count: usize) if EVENTS, |instance| {
        let names = ["continuousStates", "nContinuousStates"];
        c_boundary::set_continuous_states(instance, names, (states, count))
    };
}

/// Defines functions that get an array of all states or event indicators.
macro_rules! arrays {
    ($($name:ident: $get:ident, $arguments:expr, $elements:ident;)*) => {
        c_functions! { $(
            $name(values: *mut f64, count: usize) if EVENTS, |instance| {
                let expected = M::Variables::$elements.len();
                c_boundary::get_array($arguments, expected, (values, count), |values| instance.$get(values))
            };
        )* }
    };
}

arrays! {
    fmi3GetContinuousStateDerivatives: get_derivatives,
        ["derivatives", "nContinuousStates"], STATE_NOMINALS;
    fmi3GetEventIndicators: get_event_indicators,
        ["eventIndicators", "nEventIndicators"], EVENT_INDICATORS;
    fmi3GetContinuousStates: get_continuous_states,
        ["continuousStates", "nContinuousStates"], STATE_NOMINALS;
    fmi3GetNominalsOfContinuousStates: get_nominals_of_continuous_states,
        ["nominals", "nContinuousStates"], STATE_NOMINALS;
}
