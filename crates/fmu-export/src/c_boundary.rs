//! What the C functions of every FMI version share: turning an importer's pointers into instances, slices and strings.
//!
//! All `unsafe` of the crate is here, in the functions of [`fmi2`](crate::fmi2) and [`fmi3`](crate::fmi3), in calls of
//! their loggers, and where the floating-point environment is replaced. It relies on what the standard demands of
//! importers: instances come from the instantiation function, and one thread at a time uses them until they are freed;
//! arrays have the stated lengths, and result arrays overlap no other argument; strings end in NUL. The rest is
//! checked: null pointers, instances and states of another FMU, UTF-8, every number.
//!
//! Arrays and results may be unaligned: 32-bit compilers align doubles to 4 bytes, Rust to 8, and bindings pass parts
//! of buffers. Result memory is never read, and no Rust enum is read from the importer's memory.

use core::ffi::{CStr, c_char, c_void};
use core::ptr;
use core::slice;
use std::borrow::Cow;
use std::sync::PoisonError;

use crate::calling_sequence::{Function, Interface};
use crate::checksum::checksum;
use crate::description::ValueReference;
use crate::error::{Error, check_memory};
use crate::floating_point::in_default_environment;
use crate::instance::memory::Memory;
use crate::instance::{Answer, Instance, Preemption};
use crate::logger::Logger;
use crate::model::Model;
use crate::model_exchange::ModelExchange;
use crate::panics::contain;
use crate::saved_states;
use crate::status::Status;
use crate::variables::Variables;

/// Replaces the default panic hook, which writes to the host's stderr; panics go to the importer's logger instead. The
/// hook is local to this library, which links its own standard library.
pub fn silence_panics() {
    static ONCE: std::sync::Once = std::sync::Once::new();
    #[cfg(not(target_family = "wasm"))]
    ONCE.call_once(|| std::panic::set_hook(Box::new(crate::panics::note)));
    #[cfg(target_family = "wasm")]
    ONCE.call_once(crate::wasm::host::report_panics);
}

/// Makes a C function from an expression generic over the FMU of [`exported_model!`], so that the compiler reports
/// only once what a model lacks.
#[doc(hidden)]
#[macro_export]
macro_rules! exported_function {
    ($symbol:ident($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)?, |$fmu:ident| $body:expr) => {
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $symbol($($argument: $type),*) $(-> $result)? {
            #[inline]
            #[allow(clippy::too_many_arguments, reason = "those of the standard")]
            unsafe fn of<$fmu: Exported>($($argument: $type),*) $(-> $result)? {
                // SAFETY: the arguments are the importer's, unchanged.
                unsafe { $body }
            }
            // SAFETY: the arguments are the importer's, unchanged.
            unsafe { of::<Fmu>($($argument),*) }
        }
    };
}

/// Defines the FMU of [`exported_function!`]: its model, and the trait it must implement.
#[doc(hidden)]
#[macro_export]
macro_rules! exported_model {
    ($model:ty: $kind:ident) => {
        struct Fmu;

        trait Exported {
            type Model: $crate::$kind;
        }

        impl Exported for Fmu {
            type Model = $model;
        }
    };
}

/// Defines functions of the standard that take an instance, by their names here, the traits of their models, arguments
/// and names in the standard: each runs its body on the instance if the calling sequence allows it.
macro_rules! functions {
    ($prefix:literal; $(
        $(#[$attribute:meta])*
        $name:ident<$model:ident>($($argument:ident: $type:ty),* $(,)?): $function:ident, $body:expr;
    )*) => {$(
        #[doc = concat!("`", $prefix, stringify!($function), "`.")]
        $(#[$attribute])*
        pub unsafe fn $name<M: $model>(instance: *mut core::ffi::c_void, $($argument: $type),*) -> Status {
            // SAFETY: the instance and the other arguments are the importer's (see the module).
            unsafe { $crate::c_boundary::call::<M>(instance, Function::$function, $body) }
        }
    )*};
}

/// Likewise for functions that always fail, with the reason.
macro_rules! refusals {
    ($prefix:literal; $($name:ident($($argument:ty),* $(,)?): $function:ident, $reason:expr;)*) => {$(
        #[doc = concat!("`", $prefix, stringify!($function), "`: an error.")]
        pub unsafe fn $name<M: Model>(instance: *mut core::ffi::c_void, $(_: $argument),*) -> Status {
            // SAFETY: the instance is the importer's (see the module).
            unsafe { $crate::c_boundary::call::<M>(instance, Function::$function, |_| Err(Error::new($reason))) }
        }
    )*};
}

pub(crate) use {functions, refusals};

/// The target of a handle. Coupled FMUs share a process; the first word tells their instances apart.
#[repr(C)]
pub(crate) struct Exported<M: Model> {
    fmu: u64,
    instance: Instance<M>,
}

impl<M: Model> Exported<M> {
    /// The first word of this FMU's instances.
    const FMU: u64 = checksum(M::Variables::DESCRIPTION.guid.as_bytes());

    /// The target of a handle, unless it is null or another FMU's.
    ///
    /// # Safety
    /// `handle` is null or came from [`instantiate`] of this or another FMU made by this crate, is not freed, and
    /// is used by no other thread during the call.
    pub(crate) unsafe fn of<'a>(handle: *mut c_void) -> Option<&'a mut Self> {
        let target = handle.cast::<Self>();
        if target.is_null() || !target.is_aligned() {
            return None;
        }
        // SAFETY: the caller promises that a non-null handle begins with this word; it is aligned for it.
        let fmu = unsafe { target.cast::<u64>().read() };
        // SAFETY: a target that begins with this FMU's word is one of `M`, alive and not shared.
        (fmu == Self::FMU).then(|| unsafe { &mut *target })
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
    /// As for [`Exported::of`], except that this thread may have preempted another one's call: no call changes what is
    /// read here.
    pub(crate) unsafe fn preemption(handle: *mut c_void) -> Option<Preemption> {
        let target = handle.cast::<Self>();
        if target.is_null() || !target.is_aligned() {
            return None;
        }
        // SAFETY: the caller promises that a non-null handle begins with this word; it is aligned for it.
        let fmu = unsafe { target.cast::<u64>().read() };
        // SAFETY: a target that begins with this FMU's word is one of `M`, alive; no reference is made.
        (fmu == Self::FMU).then(|| unsafe { (&raw const (*target).instance.preemption).read() })
    }
}

/// Creates an instance for an interface. Returns its handle, or null and a message if an argument is wrong or the
/// model panics.
pub(crate) fn instantiate<M: Model>(
    function: &str,
    logger: Logger,
    interface: Result<Interface, Error>,
    set_up: impl FnOnce(&mut Instance<M>),
) -> *mut c_void {
    // Created in place: instances are large, and moves would copy them.
    let made = interface.and_then(|interface| {
        check_memory(size_of::<Exported<M>>())?;
        in_default_environment(|| {
            contain(|| Box::new(Exported { fmu: Exported::<M>::FMU, instance: Instance::new(interface) }))
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
    function: impl Function,
    body: impl FnOnce(&mut Instance<M>) -> Answer,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        run::<M>(handle, function.name(), |instance| in_default_environment(|| instance.call(function, body)))
    }
}

/// Runs a function's body that only copies and compares numbers, in the importer's floating-point environment. Where
/// it computes, it enters Rust's.
///
/// # Safety
/// As for [`Exported::of`].
unsafe fn copy<M: Model>(
    handle: *mut c_void,
    function: impl Function,
    body: impl FnOnce(&mut Instance<M>) -> Answer,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe { run::<M>(handle, function.name(), |instance| instance.call(function, body)) }
}

/// Runs a function on the instance of a handle, and delivers its messages.
///
/// # Safety
/// As for [`Exported::of`].
unsafe fn run<M: Model>(
    handle: *mut c_void,
    function: &str,
    body: impl FnOnce(&mut Instance<M>) -> Status,
) -> Status {
    // SAFETY: the caller's promise.
    let Some(target) = (unsafe { Exported::<M>::of(handle) }) else { return Status::Error };
    let status = body(&mut target.instance);
    // Do not access the target below: the importer's logger may call or free it.
    if let Some(messages) = target.instance.take_messages() {
        messages.deliver(function);
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

/// An array argument; null counts as empty.
///
/// # Safety
/// Unless null, `array` has `count` elements that nothing changes during the call.
pub(crate) unsafe fn elements<'a, T: Copy>(
    name: &str,
    array: *const T,
    count: usize,
) -> Result<Cow<'a, [T]>, Error> {
    if count == 0 {
        return Ok(Cow::Borrowed(&[]));
    }
    let array = not_null(name, array.cast_mut())?.cast_const();
    Ok(if array.is_aligned() {
        // SAFETY: not null and aligned; the caller promises this length.
        Cow::Borrowed(unsafe { slice::from_raw_parts(array, count) })
    } else {
        check_memory(count.saturating_mul(size_of::<T>()))?;
        // SAFETY: the caller promises that each of these is an element.
        (0..count).map(|index| unsafe { array.add(index).read_unaligned() }).collect()
    })
}

/// Writes an array.
///
/// # Safety
/// Unless null, `array` has `count` elements that nothing else uses during the call.
pub(crate) unsafe fn write_elements<T: Copy>(
    name: &str,
    array: *mut T,
    count: usize,
    write: impl FnOnce(&mut [T]) -> Answer,
) -> Answer {
    if count == 0 {
        return write(&mut []);
    }
    let array = not_null(name, array)?;
    if array.is_aligned() {
        // SAFETY: not null and aligned; the caller promises this length and that nothing aliases it.
        return write(unsafe { slice::from_raw_parts_mut(array, count) });
    }
    // SAFETY: the caller's promise.
    let mut values = unsafe { elements(name, array, count) }?.into_owned();
    let answer = write(&mut values);
    // After an error too: values written before it are returned, as if written to the importer's array.
    for (index, value) in values.into_iter().enumerate() {
        // SAFETY: the caller promises that this is an element.
        unsafe { array.add(index).write_unaligned(value) };
    }
    answer
}

/// Checks an array's element count before access.
fn check_count(argument: &str, found: usize, elements: &[&str]) -> Result<(), Error> {
    if found == elements.len() {
        Ok(())
    } else {
        Err(Error::new(format!("{argument} is {found}; this FMU has {}", elements.len())))
    }
}

/// An argument that must not be null.
pub(crate) fn not_null<T>(name: &str, argument: *mut T) -> Result<*mut T, Error> {
    if argument.is_null() { Err(Error::new(format!("the argument {name} is NULL"))) } else { Ok(argument) }
}

/// A string argument.
///
/// # Safety
/// `text` is null or ends in NUL.
pub(crate) unsafe fn c_string<'a>(name: &str, text: *const c_char) -> Result<&'a CStr, Error> {
    let text = not_null(name, text.cast_mut())?;
    // SAFETY: not null; the caller promises a NUL at the end.
    Ok(unsafe { CStr::from_ptr(text) })
}

/// Reads the state behind a handle.
pub(crate) fn with_state<M: Model, T>(
    state: *mut c_void,
    body: impl FnOnce(&Memory<M>) -> Result<T, Error>,
) -> Result<T, Error> {
    if state.is_null() {
        return Err(Error::new("the argument FMUstate is NULL"));
    }
    let state = saved_states::find::<Memory<M>>(state.addr())?;
    body(&state.read().unwrap_or_else(PoisonError::into_inner))
}

/// Stores a memory as a new state of an instance, and returns its handle.
pub(crate) fn keep<M: Model>(instance: &Instance<M>, memory: Memory<M>) -> *mut c_void {
    ptr::without_provenance_mut(saved_states::keep(ptr::from_ref(instance).addr(), memory))
}

/// Runs the body of a getter on the value references of scalars and the memory for their values.
///
/// # Safety
/// As for [`call`]; the arrays have as many elements as their counts say.
pub(crate) unsafe fn get_values<M: Model, F: Function, T: Copy>(
    handle: *mut c_void,
    function: F,
    (references, count): (*const ValueReference, usize),
    (values, value_count): (*mut T, usize),
    get: impl FnOnce(&mut Instance<M>, &[ValueReference], &mut [T]) -> Answer,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        copy::<M>(handle, function, |instance| {
            let references = elements(F::VALUE_REFERENCES, references, count)?;
            instance.with_scalars(&references, value_count, |instance, scalars| {
                write_elements(F::VALUES, values, value_count, |values| get(instance, scalars, values))
            })
        })
    }
}

/// Likewise for a setter.
///
/// # Safety
/// As for [`get_values`].
pub(crate) unsafe fn set_values<M: Model, F: Function, T: Copy>(
    handle: *mut c_void,
    function: F,
    (references, count): (*const ValueReference, usize),
    (values, value_count): (*const T, usize),
    set: impl FnOnce(&mut Instance<M>, &[ValueReference], &[T]) -> Answer,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        copy::<M>(handle, function, |instance| {
            let references = elements(F::VALUE_REFERENCES, references, count)?;
            instance.with_scalars(&references, value_count, |instance, scalars| {
                set(instance, scalars, &elements(F::VALUES, values, value_count)?)
            })
        })
    }
}

// The bodies of functions alike in all versions.

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
    // SAFETY: likewise.
    let names = names.iter().map(|&name| unsafe { c_string("categories", name) });
    instance.set_debug_logging(logging_on, &names.collect::<Result<Vec<_>, _>>()?)
}

/// Saves an instance's state: into a new one if `*state` is null, otherwise over the existing one.
///
/// # Safety
/// `state` is null or may be read and written to.
pub(crate) unsafe fn get_state<M: Model>(instance: &mut Instance<M>, state: *mut *mut c_void) -> Answer {
    let state = not_null("FMUstate", state)?;
    let memory = instance.save()?;
    // SAFETY: the caller's promise.
    let saved = unsafe { state.read_unaligned() };
    if saved.is_null() {
        // SAFETY: the caller's promise.
        unsafe { state.write_unaligned(keep(instance, memory)) };
    } else {
        let there = saved_states::find::<Memory<M>>(saved.addr())?;
        *there.write().unwrap_or_else(PoisonError::into_inner) = memory;
    }
    Ok(Status::Ok)
}

/// Restores a saved state.
pub(crate) fn set_state<M: Model>(instance: &mut Instance<M>, state: *mut c_void) -> Answer {
    with_state(state, |memory| instance.restore(memory).map(|()| Status::Ok))
}

/// Frees a saved state; null is a no-op.
///
/// # Safety
/// As for [`get_state`].
pub(crate) unsafe fn free_state<M: Model>(state: *mut *mut c_void) -> Answer {
    // SAFETY: the caller's promise.
    let saved = if state.is_null() { state.cast() } else { unsafe { state.read_unaligned() } };
    if !saved.is_null() {
        saved_states::free::<Memory<M>>(saved.addr())?;
        // SAFETY: the caller's promise.
        unsafe { state.write_unaligned(ptr::null_mut()) };
    }
    Ok(Status::Ok)
}

/// The size of a serialized state in bytes.
///
/// # Safety
/// `size` is null or may be written to.
pub(crate) unsafe fn serialized_size<M: Model>(state: *mut c_void, size: *mut usize) -> Answer {
    let size = not_null("size", size)?;
    let content = with_state(state, Instance::<M>::serialize)?;
    // SAFETY: the caller's promise.
    unsafe { size.write_unaligned(content.len()) };
    Ok(Status::Ok)
}

/// Serializes a saved state into as many bytes as [`serialized_size`] reports.
///
/// # Safety
/// There are as many bytes as counted.
pub(crate) unsafe fn serialize<M: Model>(state: *mut c_void, (bytes, size): (*mut u8, usize)) -> Answer {
    let content = with_state(state, Instance::<M>::serialize)?;
    if size != content.len() {
        return Err(Error::new(format!("size is {size}, the state has {} bytes", content.len())));
    }
    let write = |target: &mut [u8]| {
        target.copy_from_slice(&content);
        Ok(Status::Ok)
    };
    // SAFETY: the caller's promise.
    unsafe { write_elements("serializedState", bytes, size, write) }
}

/// Turns a serialized state into a new saved one. Unlike [`get_state`], this does not read `*state`, which the
/// standard does not require to be set and which may happen to be a state's handle.
///
/// # Safety
/// There are as many bytes as counted; `state` is null or may be written to.
pub(crate) unsafe fn deserialize<M: Model>(
    instance: &Instance<M>,
    (bytes, size): (*const u8, usize),
    state: *mut *mut c_void,
) -> Answer {
    // SAFETY: the caller's promise.
    let bytes = unsafe { elements("serializedState", bytes, size) }?;
    let state = not_null("FMUstate", state)?;
    let memory = instance.deserialize(&bytes)?;
    // SAFETY: the caller's promise.
    unsafe { state.write_unaligned(keep(instance, memory)) };
    Ok(Status::Ok)
}

/// After an integrator's step there is nothing to do.
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
pub(crate) unsafe fn set_continuous_states<M: ModelExchange>(
    instance: &mut Instance<M>,
    [name, count_name]: [&str; 2],
    (states, count): (*const f64, usize),
) -> Answer {
    check_count(count_name, count, M::Variables::STATE_NAMES)?;
    // SAFETY: the caller's promise.
    instance.set_continuous_states(&unsafe { elements(name, states, count) }?)
}

/// Gets one number for each name: of the states or event indicators.
///
/// # Safety
/// There are as many values as counted.
pub(crate) unsafe fn get_array(
    [name, count_name]: [&str; 2],
    names: &[&str],
    (values, count): (*mut f64, usize),
    get: impl FnOnce(&mut [f64]) -> Answer,
) -> Answer {
    check_count(count_name, count, names)?;
    // SAFETY: the caller's promise.
    unsafe { write_elements(name, values, count, get) }
}
