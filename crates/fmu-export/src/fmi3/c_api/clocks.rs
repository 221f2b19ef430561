//! The functions of clocks.

use fmu_abi::fmi3::c_types::{Clock, Enumeration, Status, ValueReference};
use fmu_abi::fmi3::calling_sequence;
use fmu_solve::Error;

use crate::c_boundary::arguments::{elements, write_elements};
use crate::c_boundary::c_functions;
use crate::instance::activation::fraction;
use crate::instance::clocks::seconds;
use crate::kinds::Model;

c_functions! {
    fmi3GetClock(
        references: *const ValueReference, count: usize, values: *mut Clock,
    ), |instance| {
        let references = elements("valueReferences", references, count)?;
        write_elements("values", values, count, |values| instance.get_clock(&references, values))
    };
    fmi3SetClock(
        references: *const ValueReference, count: usize, values: *const Clock,
    ), |instance| {
        let references = elements("valueReferences", references, count)?;
        instance.set_clock(&references, &elements("values", values, count)?)
    };
    /// An unknown interval is 0.
    fmi3GetIntervalDecimal(
        references: *const ValueReference, count: usize, intervals: *mut f64, qualifiers: *mut Enumeration,
    ), |instance| {
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
    };
    /// The simplest fraction equal to the interval.
    fmi3GetIntervalFraction(
        references: *const ValueReference, count: usize, counters: *mut u64, resolutions: *mut u64,
        qualifiers: *mut Enumeration,
    ), |instance| {
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
    };
    fmi3GetShiftDecimal(
        references: *const ValueReference, count: usize, shifts: *mut f64,
    ), |instance| {
        let references = elements("valueReferences", references, count)?;
        write_elements("shifts", shifts, count, |shifts| {
            instance.get_shifts(&references, false, |place, shift| {
                shifts[place] = shift;
                Ok(())
            })
        })
    };
    /// The simplest fraction equal to the shift.
    fmi3GetShiftFraction(
        references: *const ValueReference, count: usize, counters: *mut u64, resolutions: *mut u64,
    ), |instance| {
        let references = elements("valueReferences", references, count)?;
        write_elements("counters", counters, count, |counters| {
            write_elements("resolutions", resolutions, count, |resolutions| {
                instance.get_shifts(&references, true, |place, shift| {
                    [counters[place], resolutions[place]] = fraction_of("shift", shift)?;
                    Ok(())
                })
            })
        })
    };
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
    ($($decimal:ident, $fraction:ident, $name:literal, $is_interval:literal;)*) => {
        c_functions! { $(
            $decimal(
                references: *const ValueReference, count: usize, times: *const f64,
            ), |instance| {
                let references = elements("valueReferences", references, count)?;
                instance.set_times(&references, &elements($name, times, count)?, $is_interval, false)
            };
            $fraction(
                references: *const ValueReference, count: usize, counters: *const u64,
                resolutions: *const u64,
            ), |instance| {
                let references = elements("valueReferences", references, count)?;
                let counters = elements("counters", counters, count)?;
                let resolutions = elements("resolutions", resolutions, count)?;
                if resolutions.contains(&0) {
                    return Err(Error::new("a resolution is 0"));
                }
                let fractions = counters.iter().zip(resolutions.iter());
                let times = fractions.map(|(&counter, &resolution)| seconds(counter, resolution));
                instance.set_times(&references, &times.collect::<Vec<_>>(), $is_interval, true)
            };
        )* }
    };
}

set_times! {
    fmi3SetIntervalDecimal, fmi3SetIntervalFraction, "intervals", true;
    fmi3SetShiftDecimal, fmi3SetShiftFraction, "shifts", false;
}
