//! The code that the C functions of all FMI versions share: it turns an importer's pointers into instances, slices and
//! strings.
//!
//! All `unsafe` of the crate is here, in the functions of [`fmi2`](crate::fmi2) and [`fmi3`](crate::fmi3), in calls of
//! their loggers, and where the floating-point environment is replaced. It relies on what the standard demands of
//! importers: instances come from the instantiation function, and one thread at a time uses them until they are freed;
//! arrays have the stated lengths, and result arrays overlap no other argument; strings end in NUL. The rest is
//! checked: null pointers, instances and states of another FMU, UTF-8, every number.

pub(crate) mod arguments;
pub(crate) mod saved_states;
pub(crate) mod states;

use core::ffi::{c_char, c_void};
use core::ptr;

use fmu_abi::Status;
use fmu_abi::calling_sequence::Function;
use fmu_abi::floating_point::in_default_environment;
use fmu_solve::Error;
use fmu_terms::InstanceType;

use crate::allocation::check_memory;
use crate::checksum::checksum;
use crate::instance::logger::Logger;
use crate::instance::{Answer, Instance, Offer, Preemption};
use crate::kinds::Model;
use crate::model::description::ValueReference;
use crate::model::variables::Described as _;
use crate::panics::contain;

use arguments::{c_string, check_count, elements, not_null, write_elements};

/// Replaces the default panic hook, which writes to the host's stderr; panics go to the importer's logger instead. The
/// hook is local to this library, which links its own standard library.
pub(crate) fn silence_panics() {
    static ONCE: std::sync::Once = std::sync::Once::new();
    #[cfg(not(target_family = "wasm"))]
    ONCE.call_once(|| std::panic::set_hook(Box::new(crate::panics::note)));
    #[cfg(target_family = "wasm")]
    ONCE.call_once(crate::host::report_panics);
}

/// Makes a C function from an expression that is generic over the FMU of [`exported_model!`], so that the compiler
/// reports a missing trait of the model only once.
#[doc(hidden)]
#[macro_export]
macro_rules! exported_function {
    ($symbol:ident($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)?, |$fmu:ident| $body:expr) => {
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $symbol($($argument: $type),*) $(-> $result)? {
            #[inline]
            #[allow(clippy::too_many_arguments, reason = "those of the standard")]
            unsafe fn of<$fmu: $crate::Fmu>($($argument: $type),*) $(-> $result)? {
                // SAFETY: the arguments are the importer's, unchanged.
                unsafe { $body }
            }
            // SAFETY: the arguments are the importer's, unchanged.
            unsafe { of::<Fmu>($($argument),*) }
        }
    };
}

/// Defines the FMU of [`exported_function!`], and refuses interfaces for which its model cannot be exported.
#[doc(hidden)]
#[macro_export]
macro_rules! exported_model {
    ($model:ty) => {
        type Fmu = $model;

        const _: () = <Fmu as $crate::Fmu>::CHECKED;
    };
}

/// Exports the functions of a version's table, each of which calls the generic function of its name in the module
/// `functions`: of FMI 2.0 those of the interfaces that the FMU offers, of FMI 3.0 all, between the importer's locks.
#[doc(hidden)]
#[macro_export]
macro_rules! exports {
    (@CoSimulation ModelExchange $functions:tt) => {};
    (@ModelExchange CoSimulation $functions:tt) => {};
    (@Library $offered:ident { $($name:ident($($parameter:ident: $type:ty),* $(,)?) $(-> $result:ty)?;)* }) => {$(
        $crate::exported_function! {
            $name($($parameter: $type),*) $(-> $result)?,
            |F| functions::$name::<F::Model>($($parameter),*)
        }
    )*};
    // This function takes the locks itself, except while it notifies the importer of clocks.
    (@ScheduledExecution locked $functions:tt) => { $crate::exports! { @ScheduledExecution All $functions } };
    (@$interface:ident locked { $($name:ident($($parameter:ident: $type:ty),* $(,)?): $phases:tt;)* }) => {$(
        $crate::exported_function! {
            $name(instance: *mut ::core::ffi::c_void, $($parameter: $type),*) -> Status,
            |F| functions::locked::<F::Model, _>(instance, || {
                functions::$name::<F::Model>(instance, $($parameter),*)
            })
        }
    )*};
    (@$interface:ident $offered:ident { $($name:ident($($parameter:ident: $type:ty),* $(,)?): $phases:tt;)* }) => {$(
        $crate::exported_function! {
            $name(instance: *mut ::core::ffi::c_void, $($parameter: $type),*) -> Status,
            |F| functions::$name::<F::Model>(instance, $($parameter),*)
        }
    )*};
    ($offered:ident $($interface:ident $functions:tt)*) => {
        $($crate::exports! { @$interface $offered $functions })*
    };
}

/// Holds the functions of `c_api` against the version's table: each is there, and of its type.
macro_rules! held {
    (Library {
        $($library:ident($($argument:ident: $of:ty),* $(,)?) $(-> $result:ty)?;)*
    }
    $($interface:ident { $($name:ident($($parameter:ident: $type:ty),* $(,)?): $phases:tt;)* })*) => {
        const _: () = {
            use super::c_types::*;

            fn _held<M: crate::Model>() {
                $(let _: unsafe fn($($of),*) $(-> $result)? = $library::<M>;)*
                $($(let _: unsafe fn(*mut core::ffi::c_void, $($type),*) -> Status = $name::<M>;)*)*
            }
        };
    };
}

/// Defines functions of the standard that take an instance. Each row has the name, the arguments, and what an FMU must
/// offer for it; the function runs its body on the instance if the calling sequence allows it.
macro_rules! c_functions {
    ($(
        $(#[$attribute:meta])*
        $name:ident($($argument:ident: $type:ty),* $(,)?) $(if $offered:ident)?, $body:expr;
    )*) => {$(
        #[doc = concat!("`", stringify!($name), "`.")]
        $(#[$attribute])*
        pub unsafe fn $name<M: Model>(instance: *mut core::ffi::c_void, $($argument: $type),*) -> Status {
            $(
                if const { !Instance::<M>::$offered.is_made } {
                    // SAFETY: the instance is the importer's (see the module).
                    return unsafe {
                        $crate::c_boundary::refuse::<M>(instance, &calling_sequence::$name, Instance::<M>::$offered)
                    };
                }
            )?
            // SAFETY: the instance and the other arguments are the importer's (see the module).
            unsafe { $crate::c_boundary::call::<M>(instance, &calling_sequence::$name, $body) }
        }
    )*};
}

pub(crate) use {c_functions, held};

/// The target of a handle. Coupled FMUs share a process; the first word distinguishes their instances.
#[repr(C)]
pub(crate) struct Exported<M: Model> {
    fmu: u64,
    instance: Instance<M>,
}

impl<M: Model> Exported<M> {
    /// The first word of this FMU's instances.
    const FMU: u64 = checksum(M::Variables::DESCRIPTION.guid.as_bytes());

    /// Where the target of a handle is, unless the handle is null or another FMU's.
    ///
    /// # Safety
    /// `handle` is null or came from [`instantiate`] of this or another FMU made by this crate, and is not freed.
    unsafe fn place(handle: *mut c_void) -> Option<*mut Self> {
        let target = handle.cast::<Self>();
        if target.is_null() || !target.is_aligned() {
            return None;
        }
        // SAFETY: the caller promises that a non-null handle begins with this word; it is aligned for it.
        let fmu = unsafe { target.cast::<u64>().read() };
        (fmu == Self::FMU).then_some(target)
    }

    /// The target of a handle, unless it is null or another FMU's.
    ///
    /// # Safety
    /// As for [`Exported::place`]; no other thread uses the handle during the call.
    pub(crate) unsafe fn of<'a>(handle: *mut c_void) -> Option<&'a mut Self> {
        // SAFETY: a target that begins with this FMU's word is one of `M`, alive and not shared.
        unsafe { Self::place(handle).map(|target| &mut *target) }
    }

    /// The target of a handle, if valid.
    ///
    /// # Safety
    /// As for [`Exported::of`].
    pub(crate) unsafe fn instance_of<'a>(handle: *mut c_void) -> Option<&'a mut Instance<M>> {
        // SAFETY: the caller's promise.
        unsafe { Self::of(handle) }.map(|target| &mut target.instance)
    }

    /// The locks of an instance, unless the handle is null or another FMU's.
    ///
    /// # Safety
    /// As for [`Exported::place`]. This thread may have preempted a call of another; no call changes what is read here.
    pub(crate) unsafe fn preemption(handle: *mut c_void) -> Option<Preemption> {
        // SAFETY: a target that begins with this FMU's word is one of `M`, alive; no reference is made.
        unsafe { Self::place(handle).map(|target| (&raw const (*target).instance.preemption).read()) }
    }
}

/// Creates an instance for an interface. Returns its handle, or null and a message if an argument is wrong or the
/// model panics.
pub(crate) fn instantiate<M: Model>(
    function: &str,
    logger: Logger,
    instance_type: Result<InstanceType, Error>,
    set_up: impl FnOnce(&mut Instance<M>),
) -> *mut c_void {
    // Created in place: instances are large, and moves would copy them.
    let made = instance_type.and_then(|instance_type| {
        check_memory(size_of::<Exported<M>>())?;
        in_default_environment(|| {
            contain(|| Box::new(Exported { fmu: Exported::<M>::FMU, instance: Instance::new(instance_type) }))
        })
    });
    match made {
        Ok(mut exported) => {
            exported.instance.logger = logger;
            set_up(&mut exported.instance);
            Box::into_raw(exported).cast()
        }
        Err(error) => {
            logger.error(format_args!("{error}"));
            if let Some(messages) = logger.take() {
                messages.deliver(function);
            }
            ptr::null_mut()
        }
    }
}

/// Runs a function's body on the instance of a handle, in Rust's floating-point environment.
///
/// # Safety
/// As for [`Exported::of`].
pub(crate) unsafe fn call<M: Model>(
    handle: *mut c_void,
    function: &Function,
    body: impl FnOnce(&mut Instance<M>) -> Answer,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe { run::<M>(handle, function, |instance| in_default_environment(|| instance.call(function, body))) }
}

/// Refuses a function of what the FMU does not offer.
///
/// # Safety
/// As for [`Exported::of`].
#[cold]
pub(crate) unsafe fn refuse<M: Model>(handle: *mut c_void, function: &Function, offer: Offer) -> Status {
    // SAFETY: the caller's promise.
    unsafe { call::<M>(handle, function, |_| Err(Error::new(offer.refusal))) }
}

/// Runs the body of a function that only copies and compares numbers, in the importer's floating-point environment. To
/// compute, the body switches to Rust's.
///
/// # Safety
/// As for [`Exported::of`].
unsafe fn copy<M: Model>(
    handle: *mut c_void,
    function: &Function,
    body: impl FnOnce(&mut Instance<M>) -> Answer,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe { run::<M>(handle, function, |instance| instance.call(function, body)) }
}

/// Runs a function on the instance of a handle, and delivers its messages.
///
/// # Safety
/// As for [`Exported::of`].
unsafe fn run<M: Model>(
    handle: *mut c_void,
    function: &Function,
    body: impl FnOnce(&mut Instance<M>) -> Status,
) -> Status {
    // SAFETY: the caller's promise.
    let Some(Exported { instance, .. }) = (unsafe { Exported::<M>::of(handle) }) else {
        return Status::Error;
    };
    let status = body(instance);
    // From here on, do not access the target: the importer's logger may call or free it.
    if let Some(messages) = instance.take_messages() {
        messages.deliver(function.name);
    }
    status
}

/// Frees an instance and its unfreed states.
///
/// # Safety
/// As for [`Exported::of`]; the handle is not used again.
pub(crate) unsafe fn free<M: Model>(handle: *mut c_void) {
    // SAFETY: the caller's promise.
    let Some(target) = (unsafe { Exported::<M>::of(handle) }) else { return };
    // Later calls are recognized as invalid until the memory is reused.
    target.fmu = 0;
    // SAFETY: the pointer came from `instantiate`, and the standard forbids its use after this call.
    let target = unsafe { Box::from_raw(ptr::from_mut(target)) };
    saved_states::free_all_of(ptr::from_ref(&target.instance).addr());
    // A panic here cannot be reported: the logger belongs to the freed instance.
    let _ = in_default_environment(|| contain(|| drop(target)));
}

/// Runs the body of a getter with the value references of scalars and the memory for their values.
///
/// # Safety
/// As for [`call`]; the arrays have as many elements as their counts say.
pub(crate) unsafe fn get_values<M: Model, T: Copy>(
    handle: *mut c_void,
    function: &Function,
    (references, count): (*const ValueReference, usize),
    (values, value_count): (*mut T, usize),
    get: impl FnOnce(&mut Instance<M>, &[ValueReference], &mut [T]) -> Answer,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        copy::<M>(handle, function, |instance| {
            let references = elements(function.version.value_references, references, count)?;
            instance.with_scalars(&references, value_count, |instance, scalars| {
                write_elements(function.version.values, values, value_count, |values| {
                    get(instance, scalars, values)
                })
            })
        })
    }
}

/// Runs the body of a setter with the value references of scalars and their values.
///
/// # Safety
/// As for [`get_values`].
pub(crate) unsafe fn set_values<M: Model, T: Copy>(
    handle: *mut c_void,
    function: &Function,
    (references, count): (*const ValueReference, usize),
    (values, value_count): (*const T, usize),
    set: impl FnOnce(&mut Instance<M>, &[ValueReference], &[T]) -> Answer,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        copy::<M>(handle, function, |instance| {
            let references = elements(function.version.value_references, references, count)?;
            instance.with_scalars(&references, value_count, |instance, scalars| {
                set(instance, scalars, &elements(function.version.values, values, value_count)?)
            })
        })
    }
}

// The bodies of functions that are the same in all versions.

/// Gets strings, valid until the next such call for this instance.
pub(crate) fn get_strings<M: Model>(
    instance: &mut Instance<M>,
    references: &[ValueReference],
    values: &mut [*const c_char],
) -> Answer {
    let status = instance.get_string(references)?;
    for (value, text) in values.iter_mut().zip(&instance.strings) {
        *value = text.as_ptr();
    }
    Ok(status)
}

/// Sets strings, which are copied.
///
/// # Safety
/// The strings are null or end in NUL.
pub(crate) unsafe fn set_strings<M: Model>(
    instance: &mut Instance<M>,
    name: &str,
    references: &[ValueReference],
    values: &[*const c_char],
) -> Answer {
    let text = |&text: &*const c_char| {
        // SAFETY: the caller's promise.
        unsafe { c_string(name, text) }?.to_str().map_err(|_| Error::new("a string is not valid UTF-8"))
    };
    instance.set_string(references, &values.iter().map(text).collect::<Result<Vec<_>, _>>()?)
}

/// Switches debug logging.
///
/// # Safety
/// There are as many names as counted, which are null or end in NUL.
pub(crate) unsafe fn set_debug_logging<M: Model>(
    instance: &mut Instance<M>,
    logging_on: bool,
    (categories, count): (*const *const c_char, usize),
) -> Answer {
    // SAFETY: the caller's promise.
    let names = unsafe { elements("categories", categories, count) }?;
    // SAFETY: the caller's promise.
    let names = names.iter().map(|&name| unsafe { c_string("categories", name) });
    instance.set_debug_logging(logging_on, &names.collect::<Result<Vec<_>, _>>()?)
}

/// Completes an integrator's step, after which there is nothing to do.
///
/// # Safety
/// The results are null or may be written to.
pub(crate) unsafe fn completed_integrator_step<B: Default>(event_mode: *mut B, terminate: *mut B) -> Answer {
    let event_mode = not_null("enterEventMode", event_mode)?;
    let terminate = not_null("terminateSimulation", terminate)?;
    // SAFETY: the caller's promise.
    unsafe {
        event_mode.write_unaligned(B::default());
        terminate.write_unaligned(B::default());
    }
    Ok(Status::Ok)
}

/// Sets the continuous states.
///
/// # Safety
/// There are as many states as counted.
pub(crate) unsafe fn set_continuous_states<M: Model>(
    instance: &mut Instance<M>,
    [name, count_name]: [&str; 2],
    (states, count): (*const f64, usize),
) -> Answer {
    check_count(count_name, count, M::Variables::STATE_NOMINALS.len())?;
    // SAFETY: the caller's promise.
    instance.set_continuous_states(&unsafe { elements(name, states, count) }?)
}

/// Gets as many numbers as expected: those of the states or event indicators.
///
/// # Safety
/// There are as many values as counted.
pub(crate) unsafe fn get_array(
    [name, count_name]: [&str; 2],
    expected: usize,
    (values, count): (*mut f64, usize),
    get: impl FnOnce(&mut [f64]) -> Answer,
) -> Answer {
    check_count(count_name, count, expected)?;
    // SAFETY: the caller's promise.
    unsafe { write_elements(name, values, count, get) }
}
