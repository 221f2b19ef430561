//! The functions of FMI 3.0, generic over the model. [`fmi3_co_simulation!`] and its siblings define their symbols in the
//! exported library: all 75, whatever the FMU offers.
//!
//! [`fmi3_co_simulation!`]: crate::fmi3_co_simulation

#![allow(clippy::missing_safety_doc, clippy::too_many_arguments)]

use core::ffi::CStr;
use core::iter;

use super::c_types::{
    self, Binary, Boolean, Byte, Enumeration, FALSE, FmuState, Status, String, ValueReference,
};
use super::calling_sequence::Function;
use crate::c_boundary::arguments::{elements, not_null, write_elements};
use crate::c_boundary::{self, c_functions, get_values, refusals, set_values, states};
use crate::calling_sequence::{Function as _, Interface};
use crate::context::Experiment;
use crate::error::Error;
use crate::event_mode::EventMode;
use crate::instance::Instance;
use crate::instance::dependencies::DEPENDENT;
use crate::model::Model;
use crate::model_exchange::ModelExchange;
use crate::variables::Variables;

pub use self::instantiation::{instantiate_co_simulation, instantiate_model_exchange};
pub use self::steps::{do_step, do_step_to_event};
pub use crate::c_boundary::silence_panics;

pub mod clocks;
mod instantiation;
pub mod scheduled_execution;
mod steps;
pub mod without_model_exchange;
pub mod without_scheduled_execution;

/// `fmi3GetVersion`.
pub const VERSION: &CStr = c"3.0";

/// `fmi3FreeInstance`; frees the remaining states, too.
pub unsafe fn free_instance<M: Model>(instance: c_types::Instance) {
    // SAFETY: the instance is the importer's (see the module).
    unsafe { c_boundary::free::<M>(instance) }
}

c_functions! {
    "fmi3";
    set_debug_logging<Model>(on: Boolean, count: usize, categories: *const String): SetDebugLogging,
        |instance| c_boundary::set_debug_logging(instance, on != FALSE, (categories, count));
    enter_initialization_mode<Model>(
        tolerance_defined: Boolean, tolerance: f64, start_time: f64, stop_time_defined: Boolean,
        stop_time: f64,
    ): EnterInitializationMode, |instance| {
        let status = instance.setup_experiment(Experiment {
            start_time,
            stop_time: (stop_time_defined != FALSE).then_some(stop_time),
            tolerance: (tolerance_defined != FALSE).then_some(tolerance),
        })?;
        Ok(status.max(instance.enter_initialization_mode()?))
    };
    exit_initialization_mode<Model>(): ExitInitializationMode, Instance::exit_initialization_mode;
    exit_initialization_mode_with_events<ModelExchange>(): ExitInitializationMode,
        Instance::exit_initialization_mode_with_events;
    enter_configuration_mode<Model>(): EnterConfigurationMode, Instance::enter_configuration_mode;
    exit_configuration_mode<Model>(): ExitConfigurationMode, Instance::exit_configuration_mode;
    terminate<Model>(): Terminate, Instance::terminate;
    reset<Model>(): Reset, Instance::reset;

    /// The values stay valid until the next call for this instance.
    get_binary<Model>(
        references: *const ValueReference, count: usize, sizes: *mut usize, values: *mut Binary,
        value_count: usize,
    ): GetBinary, |instance| {
        let references = elements("valueReferences", references, count)?;
        instance.with_scalars(&references, value_count, |instance, scalars| {
            write_elements("values", values, value_count, |values| {
                write_elements("valueSizes", sizes, value_count, |sizes| {
                    instance.get_binary(scalars, sizes, values)
                })
            })
        })
    };
    /// The values are copied.
    set_binary<Model>(
        references: *const ValueReference, count: usize, sizes: *const usize, values: *const Binary,
        value_count: usize,
    ): SetBinary, |instance| {
        let references = elements("valueReferences", references, count)?;
        instance.with_scalars(&references, value_count, |instance, scalars| {
            let values = elements("values", values, value_count)?;
            let sizes = elements("valueSizes", sizes, value_count)?;
            let values = values.iter().zip(sizes.iter());
            let values = values.map(|(&value, &size)| elements("values", value, size));
            let values = values.collect::<Result<Vec<_>, _>>()?;
            instance.set_binary(scalars, &values.iter().map(AsRef::as_ref).collect::<Vec<_>>())
        })
    };

    /// Creates a saved state if `*state` is null, otherwise overwrites that one.
    get_fmu_state<Model>(state: *mut FmuState): GetFMUState,
        |instance| states::get_state(instance, state);
    set_fmu_state<Model>(state: FmuState): SetFMUState, |instance| states::set_state(instance, state);
    /// Null is a no-op.
    free_fmu_state<Model>(state: *mut FmuState): FreeFMUState, |_| states::free_state::<M>(state);
    serialized_fmu_state_size<Model>(state: FmuState, size: *mut usize): SerializedFMUStateSize,
        |_| states::serialized_size::<M>(state, size);
    /// Writes as many bytes as `fmi3SerializedFMUStateSize` reports.
    serialize_fmu_state<Model>(state: FmuState, bytes: *mut Byte, size: usize): SerializeFMUState,
        |_| states::serialize::<M>(state, (bytes, size));
    /// Always into a new state.
    deserialize_fmu_state<Model>(bytes: *const Byte, size: usize, state: *mut FmuState): DeserializeFMUState,
        |instance| states::deserialize(instance, (bytes, size), state);

    get_output_derivatives<Model>(
        references: *const ValueReference, count: usize, orders: *const i32, values: *mut f64,
        value_count: usize,
    ): GetOutputDerivatives, |instance| {
        let references = elements("valueReferences", references, count)?;
        let orders = elements("orders", orders, count)?;
        instance.with_scalars(&references, value_count, |instance, scalars| {
            instance.check_registered(scalars)?;
            // An unknown variable keeps its order and is rejected later.
            let of_elements = |(&reference, &order): (&ValueReference, &i32)| {
                iter::repeat_n(order, Instance::<M>::elements(reference).map_or(1, Iterator::count))
            };
            let orders = references.iter().zip(orders.iter()).flat_map(of_elements);
            write_elements("values", values, value_count, |values| {
                instance.get_real_output_derivatives(scalars, orders, values)
            })
        })
    };

    enter_step_mode<EventMode>(): EnterStepMode, Instance::enter_step_mode;
    /// An error in co-simulation without Event Mode.
    enter_event_mode<ModelExchange>(): EnterEventMode, |instance| {
        if instance.interface() == Interface::CoSimulation {
            return Err(Error::new("Event Mode is not used (hasEventMode or eventModeUsed is false)"));
        }
        instance.enter_event_mode()
    };
    /// Does nothing, as section 2.3.5 allows if `providesEvaluateDiscreteStates` is false. Ticks are computed when
    /// values are requested.
    evaluate_discrete_states<Model>(): EvaluateDiscreteStates, |_| Ok(Status::Ok);
    update_discrete_states<ModelExchange>(
        again: *mut Boolean, terminate: *mut Boolean, nominals_changed: *mut Boolean,
        values_changed: *mut Boolean, next_event_time_defined: *mut Boolean, next_event_time: *mut f64,
    ): UpdateDiscreteStates, |instance| {
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

    enter_continuous_time_mode<ModelExchange>(): EnterContinuousTimeMode,
        Instance::enter_continuous_time_mode;
    /// Does nothing: `needsCompletedIntegratorStep` is false.
    completed_integrator_step<ModelExchange>(
        _no_set_fmu_state_prior: Boolean, event_mode: *mut Boolean, terminate: *mut Boolean,
    ): CompletedIntegratorStep, |_| c_boundary::completed_integrator_step(event_mode, terminate);
    set_time<ModelExchange>(time: f64): SetTime, |instance| instance.set_time(time);
    set_continuous_states<ModelExchange>(states: *const f64, count: usize): SetContinuousStates, |instance| {
        let names = ["continuousStates", "nContinuousStates"];
        c_boundary::set_continuous_states(instance, names, (states, count))
    };
    get_number_of_variable_dependencies<Model>(
        dependent: ValueReference, count: *mut usize,
    ): GetNumberOfVariableDependencies, |instance| {
        let dependencies = instance.dependencies(dependent)?;
        not_null("nDependencies", count)?.write_unaligned(dependencies.len());
        Ok(Status::Ok)
    };
    get_variable_dependencies<Model>(
        dependent: ValueReference, elements: *mut usize, independents: *mut ValueReference,
        elements_of_independents: *mut usize, kinds: *mut Enumeration, count: usize,
    ): GetVariableDependencies, |instance| {
        let dependencies = instance.dependencies(dependent)?;
        if dependencies.len() != count {
            let expected = dependencies.len();
            return Err(Error::new(format!("nDependencies is {count}; the variable has {expected}")));
        }
        let found = dependencies.iter();
        copy_to("elementIndicesOfDependent", elements, found.clone().map(|found| found.element), count)?;
        copy_to("independents", independents, found.clone().map(|found| found.independent), count)?;
        let of_independents = found.clone().map(|found| found.element_of_independent);
        copy_to("elementIndicesOfIndependents", elements_of_independents, of_independents, count)?;
        copy_to("dependencyKinds", kinds, found.map(|_| DEPENDENT), count)
    };
    get_number_of_event_indicators<Model>(count: *mut usize): GetNumberOfEventIndicators, |_| {
        not_null("nEventIndicators", count)?.write_unaligned(M::Variables::EVENT_INDICATORS.len());
        Ok(Status::Ok)
    };
    get_number_of_continuous_states<Model>(count: *mut usize): GetNumberOfContinuousStates, |_| {
        not_null("nContinuousStates", count)?.write_unaligned(M::Variables::STATE_NOMINALS.len());
        Ok(Status::Ok)
    };
}

/// Writes an array's values.
///
/// # Safety
/// As for [`write_elements`].
unsafe fn copy_to<T: Copy>(
    name: &str,
    array: *mut T,
    values: impl Iterator<Item = T>,
    count: usize,
) -> Result<Status, Error> {
    let write = |array: &mut [T]| {
        array.iter_mut().zip(values).for_each(|(element, value)| *element = value);
        Ok(Status::Ok)
    };
    // SAFETY: the caller's promise.
    unsafe { write_elements(name, array, count, write) }
}

/// Defines functions that get an array of all states or event indicators.
macro_rules! arrays {
    ($($name:ident: $function:ident, $get:ident, $arguments:expr, $elements:ident;)*) => {
        c_functions! { "fmi3"; $(
            $name<ModelExchange>(values: *mut f64, count: usize): $function, |instance| {
                let expected = M::Variables::$elements.len();
                c_boundary::get_array($arguments, expected, (values, count), |values| instance.$get(values))
            };
        )* }
    };
}

arrays! {
    get_continuous_state_derivatives: GetContinuousStateDerivatives, get_derivatives,
        ["derivatives", "nContinuousStates"], STATE_NOMINALS;
    get_event_indicators: GetEventIndicators, get_event_indicators,
        ["eventIndicators", "nEventIndicators"], EVENT_INDICATORS;
    get_continuous_states: GetContinuousStates, get_continuous_states,
        ["continuousStates", "nContinuousStates"], STATE_NOMINALS;
    get_nominals_of_continuous_states: GetNominalsOfContinuousStates, get_nominals_of_continuous_states,
        ["nominals", "nContinuousStates"], STATE_NOMINALS;
}

/// Defines functions of derivatives of unknowns with respect to knowns: the seed has as many values as one of them,
/// the sensitivity as the other.
macro_rules! derivatives {
    ($($name:ident: $function:ident, $seeds_unknowns:literal;)*) => {
        c_functions! { "fmi3"; $(
            $name<Model>(
                unknowns: *const ValueReference, unknown_count: usize, knowns: *const ValueReference,
                known_count: usize, seed: *const f64, seed_count: usize, sensitivity: *mut f64,
                sensitivity_count: usize,
            ): $function, |instance| {
                let [of_unknowns, of_knowns] = if $seeds_unknowns {
                    [seed_count, sensitivity_count]
                } else {
                    [sensitivity_count, seed_count]
                };
                let unknowns = elements("unknowns", unknowns, unknown_count)?;
                let knowns = elements("knowns", knowns, known_count)?;
                instance.with_scalars(&unknowns, of_unknowns, |instance, unknowns| {
                    instance.with_scalars(&knowns, of_knowns, |instance, knowns| {
                        let seed = elements("seed", seed, seed_count)?;
                        write_elements("sensitivity", sensitivity, sensitivity_count, |sensitivity| {
                            instance.$name(unknowns, knowns, &seed, sensitivity)
                        })
                    })
                })
            };
        )* }
    };
}

derivatives! {
    get_directional_derivative: GetDirectionalDerivative, false;
    get_adjoint_derivative: GetAdjointDerivative, true;
}

refusals! {
    "fmi3";
    refuse_step_mode(): EnterStepMode, "not supported by this FMU (hasEventMode is false)";
    enter_event_mode_of_co_simulation(): EnterEventMode, "not supported by this FMU (hasEventMode is false)";
}

/// Defines functions that get or set values.
macro_rules! accessors {
    ($($name:ident<$model:ident>: $function:ident, $access:ident($values:ty), $body:expr;)*) => {$(
        #[doc = concat!("`fmi3", stringify!($function), "`.")]
        pub unsafe fn $name<M: $model>(
            instance: c_types::Instance,
            references: *const ValueReference,
            count: usize,
            values: $values,
            value_count: usize,
        ) -> Status {
            let (references, values) = ((references, count), (values, value_count));
            // SAFETY: the instance and the arrays are the importer's (see the module).
            unsafe { $access::<M, _, _>(instance, Function::$function, references, values, $body) }
        }
    )*};
}

accessors! {
    get_float64<Model>: GetFloat64, get_values(*mut f64), Instance::get_real;
    set_float64<Model>: SetFloat64, set_values(*const f64), Instance::set_real;
    // For an FMU with Model Exchange, in which event indicators are variables.
    get_float64_with_indicators<ModelExchange>: GetFloat64, get_values(*mut f64),
        Instance::get_real_with_indicators;
    // For an FMU with Event Mode, and therefore intermediate updates.
    get_float64_with_updates<EventMode>: GetFloat64, get_values(*mut f64), |instance, references, values| {
        instance.check_registered(references)?;
        instance.get_real_with_indicators(references, values)
    };
    set_float64_with_updates<EventMode>: SetFloat64, set_values(*const f64), |instance, references, values| {
        instance.check_registered(references)?;
        instance.set_real(references, values)
    };
    get_float32<Model>: GetFloat32, get_values(*mut f32), Instance::get_float32;
    set_float32<Model>: SetFloat32, set_values(*const f32), Instance::set_float32;
    get_int8<Model>: GetInt8, get_values(*mut i8), Instance::get_wholes;
    set_int8<Model>: SetInt8, set_values(*const i8), Instance::set_wholes;
    get_uint8<Model>: GetUInt8, get_values(*mut u8), Instance::get_wholes;
    set_uint8<Model>: SetUInt8, set_values(*const u8), Instance::set_wholes;
    get_int16<Model>: GetInt16, get_values(*mut i16), Instance::get_wholes;
    set_int16<Model>: SetInt16, set_values(*const i16), Instance::set_wholes;
    get_uint16<Model>: GetUInt16, get_values(*mut u16), Instance::get_wholes;
    set_uint16<Model>: SetUInt16, set_values(*const u16), Instance::set_wholes;
    get_int32<Model>: GetInt32, get_values(*mut i32), Instance::get_integers;
    set_int32<Model>: SetInt32, set_values(*const i32), Instance::set_integers;
    get_uint32<Model>: GetUInt32, get_values(*mut u32), Instance::get_wholes;
    set_uint32<Model>: SetUInt32, set_values(*const u32), Instance::set_wholes;
    get_int64<Model>: GetInt64, get_values(*mut i64), Instance::get_wholes;
    set_int64<Model>: SetInt64, set_values(*const i64), Instance::set_wholes;
    get_uint64<Model>: GetUInt64, get_values(*mut u64), Instance::get_wholes;
    set_uint64<Model>: SetUInt64, set_values(*const u64), Instance::set_wholes;
    get_boolean<Model>: GetBoolean, get_values(*mut Boolean), Instance::get_boolean;
    set_boolean<Model>: SetBoolean, set_values(*const Boolean), Instance::set_boolean;
    get_string<Model>: GetString, get_values(*mut String), c_boundary::get_strings;
    set_string<Model>: SetString, set_values(*const String), |instance, references, values| {
        c_boundary::set_strings(instance, Function::VALUES, references, values)
    };
}
