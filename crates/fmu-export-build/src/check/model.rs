//! The flat model as a whole.

use std::collections::BTreeSet;

use fmu_terms::{Causality, DataType, IntervalVariability, Version};

use crate::declaration::Declaration;
use crate::error::{Refusals, nearest};
use crate::model::{Model, Part, Place, Scalar, outward, without_subscripts};
use crate::names::{clock_name, field_name, unique};
use crate::texts::text;
use crate::type_names::{FIXED_NAMES, struct_names};

pub(crate) fn variables(model: &Model<'_>, refusals: &mut Refusals) {
    state_groups(model, refusals);
    type_names(model, refusals);
    declared_types(model, refusals);
    types_of_version(model, refusals);
    calculated_parameters(model, refusals);
    clocks(model, refusals);
    axes(model, refusals);
    if model.is_bare_metal {
        bare_metal(model, refusals);
    }
}

/// Each axis is a parameter with a value for each row, column and so on of its map.
fn axes(model: &Model<'_>, refusals: &mut Refusals) {
    for (part, field) in
        model.parts.iter().flat_map(|part| part.fields.iter().map(move |field| (part, field)))
    {
        let declaration = field.declaration;
        let Scalar { name, key, .. } = &model.scalars[field.positions[0]];
        let name = without_subscripts(name);
        let sizes = &declaration.sizes;
        if declaration.axes.is_empty() {
            continue;
        }
        if declaration.axes.len() != sizes.len() {
            let (axes, sizes) = (declaration.axes.len(), sizes.len());
            refusals.add(format!("{key}.axes"), format!("{name}: has {axes} axes for {sizes} dimensions"));
            continue;
        }
        for (axis, &size) in declaration.axes.iter().zip(sizes) {
            let reason = match model.axis(part, axis) {
                Some(found) if found.place != Place::Parameters => {
                    format!("the axis '{axis}' is no parameter")
                }
                Some(found) if found.declaration.sizes != [size] => {
                    format!(
                        "the axis '{axis}' has the dimensions {:?}, not [{size}]",
                        found.declaration.sizes
                    )
                }
                Some(_) => continue,
                None => format!("there is no axis '{axis}'{}", nearest(axis, model.names.keys())),
            };
            refusals.add(format!("{key}.axes"), format!("{name}: {reason}"));
        }
    }
}

/// Without an operating system there are neither files nor memory for texts of any length.
fn bare_metal(model: &Model<'_>, refusals: &mut Refusals) {
    for scalar in &model.scalars {
        if let data_type @ (DataType::String | DataType::Binary) = scalar.data_type.data_type() {
            let reason = "needs memory from an operating system, which the target has not";
            refusals.add(
                &scalar.key,
                format!("{}: a {} {reason}", scalar.name, data_type.name(model.fmi.version)),
            );
        }
    }
    if let Some(resources) = &model.declaration.resources {
        let reason = format!("the target has no operating system with files: {resources}");
        refusals.add("resources", reason);
    }
}

/// If there are groups, each state belongs to that of its outermost component, and each group has states.
fn state_groups(model: &Model<'_>, refusals: &mut Refusals) {
    let groups = &model.declaration.state_groups;
    let names: BTreeSet<_> = groups.iter().map(|group| group.name.as_str()).collect();
    for (position, part) in model.parts.iter().enumerate() {
        let outermost = outward(&model.parts, position).filter_map(|part| model.parts[part].component).last();
        let state = Place::States.fields(part).next();
        if let Some(group) = part.state_group() {
            let reason = if part.around != Some(0) {
                let outermost = outermost.map_or("", |outermost| &outermost.name);
                format!("'state_group' is for components of the model; this one is in that of '{outermost}'")
            } else if !names.contains(group) {
                format!("'{group}' is not one of the state_groups{}", nearest(group, names.iter()))
            } else if model.held(Place::States, part).is_empty() {
                format!("is in the state group '{group}', but has no states")
            } else {
                continue;
            };
            refusals.add(format!("{}.state_group", part.key), format!("{}: {reason}", part.name));
        } else if let Some(state) = state
            && !groups.is_empty()
            && outermost.is_none_or(|outermost| outermost.state_group.is_none())
        {
            let Scalar { name, key, .. } = &model.scalars[state.positions[0]];
            refusals.add(key, format!("{name}: is a state, but its component has no 'state_group'"));
        }
    }
    let used: BTreeSet<_> = model.parts.iter().filter_map(Part::state_group).collect();
    for (number, group) in groups.iter().enumerate() {
        if !used.contains(group.name.as_str()) {
            let reason = format!("no component is in the state group '{}'", group.name);
            refusals.add(format!("state_groups[{number}]"), reason);
        }
    }
}

/// The generated types must have distinct names.
fn type_names(model: &Model<'_>, refusals: &mut Refusals) {
    let declaration = model.declaration;
    let mut names: BTreeSet<_> = FIXED_NAMES.map(str::to_owned).into();
    if model.in_place(Place::CalculatedParameters).next().is_some() {
        names.insert(Place::CalculatedParameters.type_name().to_owned());
    }
    if declaration.has_clocks() {
        names.insert(Place::Clocks.type_name().to_owned());
    }
    let enumerations = declaration.enumerations.iter().enumerate();
    let enumerations =
        enumerations.map(|(number, known)| (format!("enumerations[{number}].name"), known.rust_name()));
    for (key, name) in struct_names(model).into_iter().chain(enumerations) {
        if names.contains(&name) {
            refusals.add(key, format!("two generated types would be called '{name}'"));
        }
        names.insert(name);
    }
}

/// A declared type is not named like a variable (FMI 2.0.5, section 2.2.3).
fn declared_types(model: &Model<'_>, refusals: &mut Refusals) {
    let Declaration { enumerations, real_types, .. } = model.declaration;
    let enumerations: Vec<_> = enumerations.iter().map(|known| &known.name).collect();
    let real_types: Vec<_> = real_types.iter().map(|known| &known.name).collect();
    for (list, names) in [("enumerations", enumerations), ("real_types", real_types)] {
        for (number, name) in
            names.into_iter().enumerate().filter(|(_, name)| model.names.contains_key(*name))
        {
            let reason = format!("'{name}' is also the name of a variable");
            refusals.add(format!("{list}[{number}].name"), reason);
        }
    }
}

/// FMI 2.0 has fewer types than FMI 3.0.
fn types_of_version(model: &Model<'_>, refusals: &mut Refusals) {
    if model.fmi.version == Version::Three {
        return;
    }
    let is_uniform = |position| {
        let kind = model.field(position).declaration.interval_variability;
        kind.is_some_and(IntervalVariability::is_uniform)
    };
    for (position, Scalar { name, key, data_type, .. }) in model.scalars.iter().enumerate() {
        let reason = match data_type.data_type() {
            data_type if data_type.is_of(Version::Two) => continue,
            DataType::Clock if is_uniform(position) => continue,
            DataType::Clock => {
                "in FMI 2.0 only 'constant' and 'fixed' Clocks tick, by time events".to_owned()
            }
            data_type => format!("FMI 2.0 has no type {data_type}"),
        };
        refusals.add(format!("{key}.type"), format!("{name}: {reason}; FMI 3.0 has it (--fmi 3)"));
    }
}

/// Only parameters change a calculated parameter, and a local whose variability is `fixed` or `tunable`.
fn calculated_parameters(model: &Model<'_>, refusals: &mut Refusals) {
    let scalars = &model.scalars;
    let is_calculated = |scalar: &&Scalar| scalar.place == Place::CalculatedParameters;
    let of_parameter = |scalar: &Scalar| scalar.place == Place::Parameters || is_calculated(&scalar);
    for scalar in scalars.iter().filter(is_calculated) {
        for (list, reads) in
            [("reads", &scalar.reads.in_steps), ("initial_reads", &scalar.reads.in_initialization)]
        {
            let read = reads
                .iter()
                .flat_map(|reads| reads.iter())
                .map(|&read| &scalars[read])
                .find(|read| !of_parameter(read));
            if let Some(read) = read {
                let (name, read) = (&scalar.name, &read.name);
                let kind = match scalar.causality {
                    Causality::Local => format!("{} local", scalar.variability),
                    causality => causality.to_string(),
                };
                let reason = format!("{name}: a {kind} reads '{read}', which is not a parameter");
                refusals.add(format!("{}.{list}", scalar.key), reason);
                break;
            }
        }
    }
}

/// The clocks. Scheduled Execution needs an input clock; a package may declare further models without one, which are
/// not exported.
fn clocks(model: &Model<'_>, refusals: &mut Refusals) {
    let Model { declaration, fmi, parts, scalars, .. } = model;
    if let Some(clock) = &declaration.clock {
        if let Err(reason) = clock_name(&clock.name) {
            refusals.add("clock.name", reason);
        } else if scalars.iter().any(|scalar| scalar.name == clock.name) {
            refusals.add("clock.name", format!("{}: another variable has this name", clock.name));
        }
        refusals.require("clock.description", clock.description.as_deref().map_or(Ok(()), text));
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

/// Terminals: their names, and that their variables exist, each once.
pub(crate) fn terminals(model: &Model<'_>, refusals: &mut Refusals) {
    let Model { declaration, scalars, names, .. } = model;
    let elements: BTreeSet<_> =
        model.arrays().into_iter().flatten().map(|element| &scalars[element].name).collect();
    let terminals = &declaration.terminals;
    unique("terminals", terminals.iter().map(|terminal| terminal.name.clone()), refusals);
    for (number, terminal) in terminals.iter().enumerate() {
        let key = format!("terminals[{number}]");
        refusals.require(format!("{key}.name"), field_name(&terminal.name));
        let description = terminal.description.as_deref();
        refusals.require(format!("{key}.description"), description.map_or(Ok(()), text));
        let mut seen = BTreeSet::new();
        for (position, name) in terminal.variables.iter().enumerate() {
            let key = format!("{key}.variables[{position}]");
            let reason = match names.get(name) {
                None => format!("there is no variable '{name}'{}", nearest(name, names.keys())),
                Some(_) if elements.contains(name) => {
                    format!("in FMI 3.0 the array of '{name}' is one variable; name the array")
                }
                Some(positions) if !positions.iter().all(|position| seen.insert(position)) => {
                    format!("'{name}' is listed twice")
                }
                Some(_) => continue,
            };
            refusals.add(key, format!("{}: {reason}", terminal.name));
        }
    }
}
