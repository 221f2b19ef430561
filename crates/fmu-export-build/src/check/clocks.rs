//! The rules of clocks (FMI 3.0.2, sections 2.2.8 and 2.4.4).

use super::{Blame, mixed_name, one_line};
use crate::declaration::{Causality, Declaration, IntervalVariability, VariableDeclaration};
use crate::error::Refusals;
use crate::interfaces::Fmi;
use crate::model::{DataType, Part, Place, Scalar};

/// The clocks. Scheduled Execution needs an input clock; a package may declare further models without one, which are
/// not exported.
pub(crate) fn all(
    declaration: &Declaration,
    fmi: Fmi,
    parts: &[Part<'_>],
    scalars: &[Scalar],
    refusals: &mut Refusals,
) {
    if let Some(clock) = &declaration.clock {
        if let Err(reason) = mixed_name(&clock.name, "letters, digits and underscores") {
            refusals.add("clock.name", reason);
        } else if scalars.iter().any(|scalar| scalar.name == clock.name) {
            refusals.add("clock.name", format!("{}: another variable has this name", clock.name));
        }
        if let Some(Err(reason)) = clock.description.as_deref().map(one_line) {
            refusals.add("clock.description", reason);
        }
        if let Some(other) = scalars.iter().find(|scalar| scalar.place == Place::Clocks) {
            let reason = format!("{}: there is another clock, '{}'", clock.name, other.name);
            refusals.add("clock", reason);
        }
    } else if !declaration.has_clocks() {
        return;
    }
    if !fmi.interfaces.scheduled_execution() {
        return;
    }
    if let Some(state) = scalars.iter().find(|scalar| scalar.place == Place::States) {
        let reason = format!("{}: Scheduled Execution is for models without continuous states", state.name);
        refusals.add(format!("{}.derivative", state.key), reason);
    }
    for field in parts.iter().flat_map(|part| &part.fields).filter(|field| field.place == Place::Clocks) {
        let (declaration, Scalar { name, key, .. }) = (field.declaration, &scalars[field.positions[0]]);
        if declaration.causality == Causality::Local {
            let reason = format!("{name}: Scheduled Execution has no local clocks");
            refusals.add(format!("{key}.causality"), reason);
        } else if declaration.causality == Causality::Input && declaration.priority.is_none() {
            let reason = format!("{name}: in Scheduled Execution an input clock needs a 'priority'");
            refusals.add(key, reason);
        }
    }
}

/// The keys of clocks, by kind of clock.
pub(super) fn keys(variable: &VariableDeclaration, data_type: DataType) -> Result<(), Blame> {
    let refuse = |key, reason: &str| Err((key, reason.to_owned()));
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
    let first =
        |keys: &[(&'static str, bool)]| keys.iter().find(|(_, is_used)| *is_used).map(|(key, _)| *key);
    let is_input = variable.causality == Causality::Input;
    let triggered = variable.interval_variability == Some(IntervalVariability::Triggered);
    if data_type != DataType::Clock {
        return match first(&of_inputs).or(first(&timing)) {
            Some(key) => refuse(key, "it is for a Clock"),
            None => Ok(()),
        };
    }
    if !variable.sizes.is_empty() {
        return refuse("dimensions", "a Clock cannot be an array");
    }
    if !is_input {
        let others = [of_inputs[1], of_inputs[2], of_inputs[3]];
        return match first(&others).or(first(&timing)) {
            Some(key) => refuse(key, "it is for an input Clock"),
            None if variable.interval_variability.is_some() && !triggered => {
                refuse("interval_variability", "a Clock that is not an input is 'triggered'")
            }
            None => Ok(()),
        };
    }
    let Some(kind) = variable.interval_variability else {
        return refuse("interval_variability", "an input Clock needs one");
    };
    if let Some(key) = first(&timing).filter(|_| !kind.is_periodic()) {
        return refuse(key, "it is for a 'constant', 'fixed' or 'tunable' Clock");
    }
    if triggered && variable.supports_fraction {
        return refuse("supports_fraction", "a 'triggered' Clock has no interval");
    }
    if variable.resolution == Some(0) {
        return refuse("resolution", "it is 0");
    }
    if variable.interval_counter.is_some() != variable.resolution.is_some() {
        return refuse("resolution", "it and 'interval_counter' need each other");
    }
    let Some([interval, shift]) = variable.timing() else {
        return match first(&timing) {
            Some(key) => refuse(key, "it needs an interval, 'interval_decimal' or 'interval_counter'"),
            None if kind == IntervalVariability::Constant => {
                refuse("interval_decimal", "a 'constant' Clock needs it, or 'interval_counter'")
            }
            None => Ok(()),
        };
    };
    if interval <= 0.0 {
        return refuse(
            timing[usize::from(variable.interval_decimal.is_none())].0,
            "it is not greater than 0",
        );
    }
    if shift < 0.0 {
        return refuse("shift_decimal", "it is less than 0");
    }
    let differs = |counter, time: f64| variable.seconds(counter).is_some_and(|counted| differ(counted, time));
    if variable.shift_counter.is_some() && variable.interval_counter.is_none() {
        refuse("shift_counter", "it needs an 'interval_counter'")
    } else if differs(variable.interval_counter, interval) {
        refuse("interval_decimal", "it differs from the interval of 'interval_counter'")
    } else if differs(variable.shift_counter, shift) {
        refuse("shift_decimal", "it differs from the shift of 'shift_counter'")
    } else {
        Ok(())
    }
}

/// Whether two times differ by more than rounding.
fn differ(one: f64, other: f64) -> bool {
    (one - other).abs() > 4.0 * f64::EPSILON * one.max(other)
}
