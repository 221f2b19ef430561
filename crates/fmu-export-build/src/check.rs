//! The rules of FMI and of generated Rust that a declaration can break. FMU validators catch few violations; users of
//! the FMU suffer from all of them.
//!
//! Here is what needs no variable.

pub(crate) mod clocks;
pub(crate) mod model;
pub(crate) mod units;
pub(crate) mod variable;

use std::collections::{BTreeMap, BTreeSet};
use std::mem;

use fmu_terms::{is_identifier, is_reserved_by_windows};

use crate::declaration::{Declaration, Described, VariableDeclaration, within};
use crate::error::{Refusals, nearest, refuse_if};
use crate::names::{field_name, item_name, type_name, unique, variable_name, variant_name};
use crate::texts::{label, text};
use crate::value_type::ValueType;

pub(crate) fn declaration(declaration: &Declaration, identifier: &str, refusals: &mut Refusals) {
    if !is_identifier(identifier) {
        let reason = format!("'{identifier}' is not a valid FMU name, which must be a C identifier");
        refusals.add("model_identifier", reason);
    }
    if is_reserved_by_windows(identifier) {
        let reason = format!("'{identifier}' names a device of Windows, so that it cannot name a library");
        refusals.add("model_identifier", reason);
    }
    if let Some(experiment) = &declaration.default_experiment {
        let start = experiment.start_time.unwrap_or(0.0);
        if experiment.stop_time.is_some_and(|stop| stop <= start) {
            refusals.add("default_experiment.stop_time", "must be after start_time");
        }
        if experiment.step_size.is_some_and(|size| size <= 0.0) {
            refusals.add("default_experiment.step_size", "must be greater than 0");
        }
        if experiment.tolerance.is_some_and(|tolerance| tolerance <= 0.0) {
            refusals.add("default_experiment.tolerance", "must be greater than 0");
        }
    }
    if declaration.capabilities.serialize_state == Some(true) && !declaration.capabilities.get_and_set_state {
        let reason = "a state that cannot be saved cannot be serialized, and 'get_and_set_state' is false";
        refusals.add("capabilities.serialize_state", reason);
    }
    names(declaration, refusals);
    real_types(declaration, refusals);
    event_indicators(declaration, refusals);
    texts(declaration, refusals);
}

/// The names of everything except variables.
fn names(declaration: &Declaration, refusals: &mut Refusals) {
    let described = |list: &[Described]| list.iter().map(|known| known.name.clone()).collect::<Vec<_>>();
    unique("log_categories", described(&declaration.log_categories), refusals);
    let enumerations = &declaration.enumerations;
    unique("enumerations", enumerations.iter().map(|known| known.name.clone()), refusals);
    for (number, enumeration) in enumerations.iter().enumerate() {
        let (name, key) = (&enumeration.name, format!("enumerations[{number}]"));
        named(&key, name, enumeration.rust_name.as_deref(), type_name, refusals);
        if ValueType::of_name(name).is_some() {
            refusals.add(format!("{key}.name"), format!("'{name}' is the name of a built-in type"));
        }
        if enumeration.items.is_empty() {
            refusals.add(format!("{key}.items"), format!("{name}: has no items"));
        }
        for (number, item) in enumeration.items.iter().enumerate() {
            refusals.require(format!("{key}.items[{number}].name"), item_name(&item.name));
        }
        let (mut values, mut last) = (BTreeMap::new(), 0);
        for (number, (item, value)) in enumeration.valued().enumerate() {
            let (name, before) = (&item.name, mem::replace(&mut last, value));
            let reason = if item.value.is_none() && before == i32::MAX {
                format!("{name}: needs a 'value', as the item before has the largest, {before}")
            } else if let Some(other) = values.insert(value, name) {
                format!("{name}: '{other}' also has the value {value}")
            } else {
                continue;
            };
            refusals.add(format!("{key}.items[{number}]"), reason);
        }
        let variants = enumeration.items.iter().map(|item| variant_name(&item.name));
        unique(&format!("{key}.items"), variants, refusals);
    }
    let types = &declaration.component_types;
    unique("component_types", types.iter().map(|known| known.name.clone()), refusals);
    for (number, known) in types.iter().enumerate() {
        let key = format!("component_types[{number}]");
        named(&key, &known.name, known.rust_name.as_deref(), type_name, refusals);
    }
    fields("state_groups", &described(&declaration.state_groups), refusals);
    for contents in declaration.contents() {
        for (number, component) in contents.components.iter().enumerate() {
            let key = contents.key_of(number);
            named(&key, &component.name, component.rust_name.as_deref(), field_name, refusals);
        }
        let components = || contents.components.iter();
        unique(&within(&contents.key, "components"), components().map(|known| known.name.clone()), refusals);
        let variables = contents.variables.iter().map(VariableDeclaration::rust_name);
        let time = contents.key.is_empty().then(|| "time".to_owned());
        let variables: BTreeSet<_> = variables.chain(time).collect();
        let mut in_rust = BTreeMap::new();
        for (number, component) in components().enumerate() {
            let (name, rust_name) = (&component.name, component.rust_name());
            let reason = if variables.contains(&rust_name) {
                format!("'{rust_name}' is also the name of a variable")
            } else if let Some(other) = in_rust.insert(rust_name, name).filter(|other| *other != name) {
                format!("{name}: its Rust name is that of '{other}'; give it another 'rust_name'")
            } else {
                continue;
            };
            refusals.add(format!("{}.name", contents.key_of(number)), reason);
        }
    }
}

/// The types of Reals.
fn real_types(declaration: &Declaration, refusals: &mut Refusals) {
    let types = &declaration.real_types;
    unique("real_types", types.iter().map(|known| known.name.clone()), refusals);
    for (number, known) in types.iter().enumerate() {
        let (name, key) = (&known.name, format!("real_types[{number}]"));
        refusals.require(format!("{key}.name"), variable_name(name));
        if ValueType::of_name(name).is_some() {
            refusals.add(format!("{key}.name"), format!("'{name}' is the name of a built-in type"));
        }
        if declaration.enumerations.iter().any(|enumeration| enumeration.name == *name) {
            refusals.add(format!("{key}.name"), format!("'{name}' is also the name of an enumeration"));
        }
        for (of, written) in [("description", &known.description), ("quantity", &known.quantity)] {
            refusals.require(format!("{key}.{of}"), written.as_deref().map_or(Ok(()), text));
        }
        let is_shown_only = known.display_unit.is_some() && known.unit.is_none();
        for checked in [
            refuse_if(is_shown_only, "display_unit", "needs a 'unit'"),
            variable::nominal(known.nominal),
            variable::range(known.min, known.max),
        ] {
            if let Err((of, reason)) = checked {
                refusals.add(format!("{key}.{of}"), format!("{name}: {reason}"));
            }
        }
    }
}

/// A name in FMI, and the one that it has in Rust, if it is declared.
fn named(
    key: &str,
    name: &str,
    rust_name: Option<&str>,
    in_rust: impl Fn(&str) -> Result<(), String>,
    refusals: &mut Refusals,
) {
    refusals.require(format!("{key}.name"), variable_name(name));
    refusals.require(format!("{key}.rust_name"), rust_name.map_or(Ok(()), in_rust));
}

/// The names in a list, each of which is a field in Rust.
fn fields(list: &str, names: &[String], refusals: &mut Refusals) {
    for (number, name) in names.iter().enumerate() {
        refusals.require(format!("{list}[{number}].name"), field_name(name));
    }
    unique(list, names.iter().cloned(), refusals);
}

/// Event indicators have names like variables.
fn event_indicators(declaration: &Declaration, refusals: &mut Refusals) {
    let mut seen = BTreeSet::new();
    for (number, name) in declaration.event_indicators.iter().enumerate() {
        let key = format!("event_indicators[{number}]");
        refusals.require(&key, variable_name(name));
        if !seen.insert(name) {
            refusals.add(key, format!("'{name}' is declared twice"));
        }
    }
    for (number, name) in declaration.limits.iter().enumerate() {
        if !seen.contains(name) {
            let nearest = nearest(name, &declaration.event_indicators);
            let reason = format!("'{name}' is not one of the event_indicators{nearest}");
            refusals.add(format!("limits[{number}]"), reason);
        }
    }
}

/// The free texts, all of which become XML attributes.
fn texts(declaration: &Declaration, refusals: &mut Refusals) {
    let mut check = |key: String, written: Option<&String>| {
        refusals.require(key, written.map_or(Ok(()), |written| text(written)));
    };
    check("description".to_owned(), declaration.description.as_ref());
    check("author".to_owned(), declaration.author.as_ref());
    check("copyright".to_owned(), declaration.copyright.as_ref());
    check("license".to_owned(), declaration.license.as_ref());
    for contents in declaration.contents() {
        for (number, component) in contents.components.iter().enumerate() {
            check(format!("{}.description", contents.key_of(number)), component.description.as_ref());
        }
    }
    for (number, enumeration) in declaration.enumerations.iter().enumerate() {
        check(format!("enumerations[{number}].description"), enumeration.description.as_ref());
        for (item_number, item) in enumeration.items.iter().enumerate() {
            let key = format!("enumerations[{number}].items[{item_number}].description");
            check(key, item.description.as_ref());
        }
    }
    for (list, described) in
        [("log_categories", &declaration.log_categories), ("state_groups", &declaration.state_groups)]
    {
        for (number, item) in described.iter().enumerate() {
            refusals.require(format!("{list}[{number}].name"), label(&item.name));
            refusals.require(format!("{list}[{number}].description"), text(&item.description));
        }
    }
}
