//! The functions of FMI 3.0, generic over the model. [`fmi3_functions!`] exports all 75, whatever the FMU offers.
//!
//! [`fmi3_functions!`]: crate::fmi3_functions

#![allow(clippy::missing_safety_doc, clippy::too_many_arguments)]
#![allow(non_snake_case, reason = "the standard's names")]

use core::iter;

use fmu_abi::fmi3::c_types::{
    self, Binary, Boolean, Byte, Enumeration, FALSE, FmuState, Status, String, ValueReference,
};
use fmu_abi::fmi3::calling_sequence;
use fmu_solve::Error;

use crate::c_boundary::arguments::{elements, not_null, write_elements};
use crate::c_boundary::{self, c_functions, get_values, held, set_values, states};
use crate::instance::Instance;
use crate::instance::dependencies::DEPENDENT;
use crate::kinds::Model;
use crate::model::context::Experiment;
use crate::model::variables::Described as _;

pub use self::clocks::*;
pub use self::exchange::*;
pub use self::instantiation::{fmi3InstantiateCoSimulation, fmi3InstantiateModelExchange};
pub use self::scheduled_execution::*;
pub use self::steps::*;

mod clocks;
mod exchange;
mod instantiation;
mod scheduled_execution;
mod steps;

/// `fmi3GetVersion`.
#[must_use]
pub fn fmi3GetVersion<M: Model>() -> String {
    c"3.0".as_ptr()
}

/// `fmi3FreeInstance`; frees the remaining states, too.
pub unsafe fn fmi3FreeInstance<M: Model>(instance: c_types::Instance) {
    // SAFETY: the instance is the importer's (see the module).
    unsafe { c_boundary::free::<M>(instance) }
}

c_functions! {
    fmi3ExitInitializationMode(), Instance::exit_initialization_mode;
    fmi3SetDebugLogging(on: Boolean, count: usize, categories: *const String),
        |instance| c_boundary::set_debug_logging(instance, on != FALSE, (categories, count));
    fmi3EnterInitializationMode(
        tolerance_defined: Boolean, tolerance: f64, start_time: f64, stop_time_defined: Boolean,
        stop_time: f64,
    ), |instance| {
        let status = instance.setup_experiment(Experiment {
            start_time,
            stop_time: (stop_time_defined != FALSE).then_some(stop_time),
            tolerance: (tolerance_defined != FALSE).then_some(tolerance),
        })?;
        Ok(status.max(instance.enter_initialization_mode()?))
    };
    fmi3EnterConfigurationMode(), Instance::enter_configuration_mode;
    fmi3ExitConfigurationMode(), Instance::exit_configuration_mode;
    fmi3Terminate(), Instance::terminate;
    fmi3Reset(), Instance::reset;

    /// The values stay valid until the next call for this instance.
    fmi3GetBinary(
        references: *const ValueReference, count: usize, sizes: *mut usize, values: *mut Binary,
        value_count: usize,
    ), |instance| {
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
    fmi3SetBinary(
        references: *const ValueReference, count: usize, sizes: *const usize, values: *const Binary,
        value_count: usize,
    ), |instance| {
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
    fmi3GetFMUState(state: *mut FmuState),
        |instance| states::get_state(instance, state);
    fmi3SetFMUState(state: FmuState), |instance| states::set_state(instance, state);
    /// Null is a no-op.
    fmi3FreeFMUState(state: *mut FmuState), |_| states::free_state::<M>(state);
    fmi3SerializedFMUStateSize(state: FmuState, size: *mut usize),
        |_| states::serialized_size::<M>(state, size);
    /// Writes as many bytes as `fmi3SerializedFMUStateSize` reports.
    fmi3SerializeFMUState(state: FmuState, bytes: *mut Byte, size: usize),
        |_| states::serialize::<M>(state, (bytes, size));
    /// Always into a new state.
    fmi3DeserializeFMUState(bytes: *const Byte, size: usize, state: *mut FmuState),
        |instance| states::deserialize(instance, (bytes, size), state);

    fmi3GetOutputDerivatives(
        references: *const ValueReference, count: usize, orders: *const i32, values: *mut f64,
        value_count: usize,
    ), |instance| {
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

    /// Does nothing, as section 2.3.5 allows if `providesEvaluateDiscreteStates` is false. Ticks are computed when
    /// values are requested.
    fmi3EvaluateDiscreteStates(), |_| Ok(Status::Ok);
    fmi3GetNumberOfVariableDependencies(
        dependent: ValueReference, count: *mut usize,
    ), |instance| {
        let dependencies = instance.dependencies(dependent)?;
        not_null("nDependencies", count)?.write_unaligned(dependencies.len());
        Ok(Status::Ok)
    };
    fmi3GetVariableDependencies(
        dependent: ValueReference, elements: *mut usize, independents: *mut ValueReference,
        elements_of_independents: *mut usize, kinds: *mut Enumeration, count: usize,
    ), |instance| {
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
    fmi3GetNumberOfEventIndicators(count: *mut usize), |_| {
        not_null("nEventIndicators", count)?.write_unaligned(M::Variables::EVENT_INDICATORS.len());
        Ok(Status::Ok)
    };
    fmi3GetNumberOfContinuousStates(count: *mut usize), |_| {
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

/// Defines functions of derivatives of unknowns with respect to knowns: the seed has as many values as one of them,
/// the sensitivity as the other.
macro_rules! derivatives {
    ($($name:ident: $get:ident, $seeds_unknowns:literal;)*) => {
        c_functions! { $(
            $name(
                unknowns: *const ValueReference, unknown_count: usize, knowns: *const ValueReference,
                known_count: usize, seed: *const f64, seed_count: usize, sensitivity: *mut f64,
                sensitivity_count: usize,
            ), |instance| {
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
                            instance.$get(unknowns, knowns, &seed, sensitivity)
                        })
                    })
                })
            };
        )* }
    };
}

derivatives! {
    fmi3GetDirectionalDerivative: get_directional_derivative, false;
    fmi3GetAdjointDerivative: get_adjoint_derivative, true;
}

/// Defines functions that get or set values.
macro_rules! accessors {
    ($($(#[$attribute:meta])* $name:ident, $access:ident($values:ty), $body:expr;)*) => {$(
        #[doc = concat!("`", stringify!($name), "`.")]
        $(#[$attribute])*
        pub unsafe fn $name<M: Model>(
            instance: c_types::Instance,
            references: *const ValueReference,
            count: usize,
            values: $values,
            value_count: usize,
        ) -> Status {
            let (references, values) = ((references, count), (values, value_count));
            // SAFETY: the instance and the arrays are the importer's (see the module).
            unsafe { $access::<M, _>(instance, &calling_sequence::$name, references, values, $body) }
        }
    )*};
}

accessors! {
    /// In FMI 3.0, event indicators are variables.
    fmi3GetFloat64, get_values(*mut f64), |instance, references, values| {
        if const { Instance::<M>::EVENT_MODE.is_made } {
            instance.check_registered(references)?;
        }
        if const { Instance::<M>::EVENTS.is_made } {
            instance.get_real_with_indicators(references, values)
        } else {
            instance.get_real(references, values)
        }
    };
    fmi3SetFloat64, set_values(*const f64), |instance, references, values| {
        if const { Instance::<M>::EVENT_MODE.is_made } {
            instance.check_registered(references)?;
        }
        instance.set_real(references, values)
    };
    fmi3GetFloat32, get_values(*mut f32), Instance::get_float32;
    fmi3SetFloat32, set_values(*const f32), Instance::set_float32;
    fmi3GetInt8, get_values(*mut i8), Instance::get_wholes;
    fmi3SetInt8, set_values(*const i8), Instance::set_wholes;
    fmi3GetUInt8, get_values(*mut u8), Instance::get_wholes;
    fmi3SetUInt8, set_values(*const u8), Instance::set_wholes;
    fmi3GetInt16, get_values(*mut i16), Instance::get_wholes;
    fmi3SetInt16, set_values(*const i16), Instance::set_wholes;
    fmi3GetUInt16, get_values(*mut u16), Instance::get_wholes;
    fmi3SetUInt16, set_values(*const u16), Instance::set_wholes;
    fmi3GetInt32, get_values(*mut i32), Instance::get_integers;
    fmi3SetInt32, set_values(*const i32), Instance::set_integers;
    fmi3GetUInt32, get_values(*mut u32), Instance::get_wholes;
    fmi3SetUInt32, set_values(*const u32), Instance::set_wholes;
    fmi3GetInt64, get_values(*mut i64), Instance::get_wholes;
    fmi3SetInt64, set_values(*const i64), Instance::set_wholes;
    fmi3GetUInt64, get_values(*mut u64), Instance::get_wholes;
    fmi3SetUInt64, set_values(*const u64), Instance::set_wholes;
    fmi3GetBoolean, get_values(*mut Boolean), Instance::get_boolean;
    fmi3SetBoolean, set_values(*const Boolean), Instance::set_boolean;
    fmi3GetString, get_values(*mut String), c_boundary::get_strings;
    fmi3SetString, set_values(*const String), |instance, references, values| {
        c_boundary::set_strings(instance, calling_sequence::CONVENTIONS.values, references, values)
    };
}

crate::fmi3_calls!(held);
