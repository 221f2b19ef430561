//! The functions of clocks.

use super::{
    Clock, Enumeration, Error, Function, Instance, Model, Status, ValueReference, call, elements, instance,
    write_elements,
};
use crate::instance::activation::fraction;
use crate::instance::clocks::seconds;

/// Value references and their number.
type References = (*const ValueReference, usize);

/// `fmi3GetClock`.
pub unsafe fn get_clock<M: Model>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    values: *mut Clock,
) -> Status {
    // SAFETY: the instance and the arrays are the importer's (see the module).
    unsafe {
        call::<M>(instance, Function::GetClock, |instance| {
            let references = elements("valueReferences", references, count)?;
            write_elements("values", values, count, |values| instance.get_clock(&references, values))
        })
    }
}

/// `fmi3SetClock`.
pub unsafe fn set_clock<M: Model>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    values: *const Clock,
) -> Status {
    // SAFETY: the instance and the arrays are the importer's (see the module).
    unsafe {
        call::<M>(instance, Function::SetClock, |instance| {
            let references = elements("valueReferences", references, count)?;
            instance.set_clock(&references, &elements("values", values, count)?)
        })
    }
}

/// `fmi3GetIntervalDecimal`. An unknown interval is 0.
pub unsafe fn get_interval_decimal<M: Model>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    intervals: *mut f64,
    qualifiers: *mut Enumeration,
) -> Status {
    // SAFETY: the instance and the arrays are the importer's (see the module).
    unsafe {
        call::<M>(instance, Function::GetIntervalDecimal, |instance| {
            let references = elements("valueReferences", references, count)?;
            write_elements("intervals", intervals, count, |intervals| {
                write_elements("qualifiers", qualifiers, count, |qualifiers| {
                    instance.get_intervals(&references, false, |place, interval, qualifier| {
                        intervals[place] = interval.unwrap_or_default();
                        qualifiers[place] = qualifier as Enumeration;
                        Ok(())
                    })
                })
            })
        })
    }
}

/// `fmi3GetIntervalFraction`: the simplest fraction equal to the interval.
pub unsafe fn get_interval_fraction<M: Model>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    counters: *mut u64,
    resolutions: *mut u64,
    qualifiers: *mut Enumeration,
) -> Status {
    // SAFETY: the instance and the arrays are the importer's (see the module).
    unsafe {
        call::<M>(instance, Function::GetIntervalFraction, |instance| {
            let references = elements("valueReferences", references, count)?;
            write_elements("counters", counters, count, |counters| {
                write_elements("resolutions", resolutions, count, |resolutions| {
                    write_elements("qualifiers", qualifiers, count, |qualifiers| {
                        instance.get_intervals(&references, true, |place, interval, qualifier| {
                            [counters[place], resolutions[place]] =
                                fraction_of("interval", interval.unwrap_or_default())?;
                            qualifiers[place] = qualifier as Enumeration;
                            Ok(())
                        })
                    })
                })
            })
        })
    }
}

/// `fmi3GetShiftDecimal`.
pub unsafe fn get_shift_decimal<M: Model>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    shifts: *mut f64,
) -> Status {
    // SAFETY: the instance and the arrays are the importer's (see the module).
    unsafe {
        call::<M>(instance, Function::GetShiftDecimal, |instance| {
            let references = elements("valueReferences", references, count)?;
            write_elements("shifts", shifts, count, |shifts| {
                instance.get_shifts(&references, false, |place, shift| {
                    shifts[place] = shift;
                    Ok(())
                })
            })
        })
    }
}

/// `fmi3GetShiftFraction`: the simplest fraction equal to the shift.
pub unsafe fn get_shift_fraction<M: Model>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    counters: *mut u64,
    resolutions: *mut u64,
) -> Status {
    // SAFETY: the instance and the arrays are the importer's (see the module).
    unsafe {
        call::<M>(instance, Function::GetShiftFraction, |instance| {
            let references = elements("valueReferences", references, count)?;
            write_elements("counters", counters, count, |counters| {
                write_elements("resolutions", resolutions, count, |resolutions| {
                    instance.get_shifts(&references, true, |place, shift| {
                        [counters[place], resolutions[place]] = fraction_of("shift", shift)?;
                        Ok(())
                    })
                })
            })
        })
    }
}

/// A time in s as a fraction.
fn fraction_of(what: &str, time: f64) -> Result<[u64; 2], Error> {
    if time > 0.0 {
        let none = || Error::new(format!("the {what} {time:?} s is not a fraction of 64-bit numbers"));
        fraction(time).ok_or_else(none)
    } else {
        Ok([0, 1])
    }
}

/// Defines functions that set clock times, each as a decimal number and as a fraction.
macro_rules! set_times {
    ($($decimal:ident: $of_decimal:ident, $fraction:ident: $of_fraction:ident, $name:literal, $is_interval:literal;)*) => {$(
        #[doc = concat!("`fmi3", stringify!($of_decimal), "`.")]
        pub unsafe fn $decimal<M: Model>(
            instance: Instance,
            references: *const ValueReference,
            count: usize,
            times: *const f64,
        ) -> Status {
            // SAFETY: the instance and the arrays are the importer's (see the module).
            unsafe {
                call::<M>(instance, Function::$of_decimal, |instance| {
                    let references = elements("valueReferences", references, count)?;
                    instance.set_times(&references, &elements($name, times, count)?, $is_interval, false)
                })
            }
        }

        #[doc = concat!("`fmi3", stringify!($of_fraction), "`.")]
        pub unsafe fn $fraction<M: Model>(
            instance: Instance,
            references: *const ValueReference,
            count: usize,
            counters: *const u64,
            resolutions: *const u64,
        ) -> Status {
            // SAFETY: the instance and the arrays are the importer's (see the module).
            unsafe {
                call::<M>(instance, Function::$of_fraction, |instance| {
                    set_fractions(instance, (references, count), counters, resolutions, $is_interval)
                })
            }
        }
    )*};
}

set_times! {
    set_interval_decimal: SetIntervalDecimal, set_interval_fraction: SetIntervalFraction, "intervals", true;
    set_shift_decimal: SetShiftDecimal, set_shift_fraction: SetShiftFraction, "shifts", false;
}

/// Sets clock times.
///
/// # Safety
/// The arrays have as many elements as counted.
unsafe fn set_fractions<M: Model>(
    instance: &mut instance::Instance<M>,
    (references, count): References,
    counters: *const u64,
    resolutions: *const u64,
    is_interval: bool,
) -> Result<Status, Error> {
    // SAFETY: the caller's promise.
    let (references, counters, resolutions) = unsafe {
        (
            elements("valueReferences", references, count)?,
            elements("counters", counters, count)?,
            elements("resolutions", resolutions, count)?,
        )
    };
    if resolutions.contains(&0) {
        return Err(Error::new("a resolution is 0"));
    }
    let fractions = counters.iter().zip(resolutions.iter());
    let times: Vec<_> = fractions.map(|(&counter, &resolution)| seconds(counter, resolution)).collect();
    instance.set_times(&references, &times, is_interval, true)
}
