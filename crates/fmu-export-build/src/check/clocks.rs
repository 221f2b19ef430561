//! The keys of clocks (FMI 3.0.2, sections 2.2.8 and 2.4.4).

use fmu_terms::{Causality, DataType, IntervalVariability};

use crate::declaration::VariableDeclaration;
use crate::error::{Blame, refuse_if};
use crate::value_type::ValueType;

/// Checks the keys of clocks, by kind of clock.
pub(crate) fn keys(variable: &VariableDeclaration, data_type: ValueType) -> Result<(), Blame> {
    let timing = [
        ("interval_decimal", variable.interval_decimal.is_some()),
        ("interval_counter", variable.interval_counter.is_some()),
        ("shift_decimal", variable.shift_decimal.is_some()),
        ("shift_counter", variable.shift_counter.is_some()),
        ("resolution", variable.resolution.is_some()),
    ];
    let of_inputs = [
        ("interval_variability", variable.interval_variability.is_some()),
        ("supports_fraction", variable.supports_fraction),
        ("can_be_deactivated", variable.can_be_deactivated),
        ("priority", variable.priority.is_some()),
    ];
    let none_of = |keys: &[(&'static str, bool)], reason: &str| {
        keys.iter().try_for_each(|&(key, is_used)| refuse_if(is_used, key, reason))
    };
    if data_type != DataType::Clock {
        none_of(&of_inputs, "this key is for a Clock")?;
        return none_of(&timing, "this key is for a Clock");
    }
    refuse_if(!variable.sizes.is_empty(), "dimensions", "a Clock cannot be an array")?;
    let kind = variable.interval_variability;
    let is_triggered = kind == Some(IntervalVariability::Triggered);
    if variable.causality != Causality::Input {
        none_of(&of_inputs[1..], "this key is for an input Clock")?;
        none_of(&timing, "this key is for an input Clock")?;
        let reason = "a Clock that is not an input is 'triggered'";
        return refuse_if(kind.is_some() && !is_triggered, "interval_variability", reason);
    }
    refuse_if(kind.is_none(), "interval_variability", "an input Clock needs an 'interval_variability'")?;
    if !kind.is_some_and(IntervalVariability::is_periodic) {
        none_of(&timing, "this key is for a 'constant', 'fixed' or 'tunable' Clock")?;
    }
    let has_fraction = variable.supports_fraction;
    refuse_if(is_triggered && has_fraction, "supports_fraction", "a 'triggered' Clock has no interval")?;
    refuse_if(variable.resolution == Some(0), "resolution", "must not be 0")?;
    let is_partial = variable.interval_counter.is_some() != variable.resolution.is_some();
    refuse_if(is_partial, "resolution", "'resolution' and 'interval_counter' need each other")?;
    let Some([interval, shift]) = variable.timing() else {
        none_of(&timing, "needs an interval: 'interval_decimal' or 'interval_counter'")?;
        let reason = "a 'constant' Clock needs 'interval_decimal' or 'interval_counter'";
        return refuse_if(kind == Some(IntervalVariability::Constant), "interval_decimal", reason);
    };
    let (key, _) = timing[usize::from(variable.interval_decimal.is_none())];
    refuse_if(interval <= 0.0, key, "must be greater than 0")?;
    refuse_if(shift < 0.0, "shift_decimal", "must not be negative")?;
    let is_uncounted = variable.shift_counter.is_some() && variable.interval_counter.is_none();
    refuse_if(is_uncounted, "shift_counter", "needs an 'interval_counter'")?;
    let differs = |counter, time: f64| variable.seconds(counter).is_some_and(|counted| differ(counted, time));
    let reason = "differs from the interval of 'interval_counter'";
    refuse_if(differs(variable.interval_counter, interval), "interval_decimal", reason)?;
    let reason = "differs from the shift of 'shift_counter'";
    refuse_if(differs(variable.shift_counter, shift), "shift_decimal", reason)
}

/// Whether two times differ by more than rounding.
fn differ(one: f64, other: f64) -> bool {
    (one - other).abs() > 4.0 * f64::EPSILON * one.max(other)
}
