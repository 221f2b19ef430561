//! What is refused, and why: the rules of FMI 2.0 and of the generated Rust that a model's JSON can
//! break. Validators of FMUs catch few of these; users of an FMU suffer from all of them.

use std::collections::BTreeSet;

use serde_json::Value;

use super::error::Refusal;
use super::json::{self, Causality, Initial, Variability};
use super::resolve::{DataType, Part, Role, Start, Variable};
use super::rust;

/// The log categories that the runtime uses.
const LOG_CATEGORIES: [&str; 3] = ["logStatusError", "logStatusWarning", "logEvents"];

/// Words of Rust that cannot be names of fields.
const RESERVED: [&str; 50] = [
    "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "crate", "do", "dyn",
    "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl", "in", "let", "loop",
    "macro", "match", "mod", "move", "mut", "override", "priv", "pub", "ref", "return", "self", "static",
    "struct", "super", "trait", "true", "try", "type", "typeof", "unsafe", "unsized", "use", "virtual",
    "where", "while",
];

/// The checks that need no variable.
pub(crate) fn model(model: &json::Model) -> Result<(), Refusal> {
    let identifier = &model.model_identifier;
    if !is_c_identifier(identifier) {
        return Err(Refusal::new(format!("model_identifier '{identifier}' is not an identifier of C")));
    }
    for required in LOG_CATEGORIES {
        if !model.log_categories.iter().any(|category| category.name == required) {
            return Err(Refusal::new(format!(
                "log_categories lacks '{required}', under which the runtime logs"
            )));
        }
    }
    unique("log category", model.log_categories.iter().map(|category| category.name.as_str()))?;
    let experiment = &model.default_experiment;
    if experiment.stop_time <= experiment.start_time {
        return Err(Refusal::new("default_experiment: stop_time is not after start_time"));
    }
    if experiment.step_size <= 0.0 {
        return Err(Refusal::new("default_experiment: step_size is not greater than 0"));
    }
    names(model)?;
    texts(model)
}

/// The names of everything but variables.
fn names(model: &json::Model) -> Result<(), Refusal> {
    unique("enumeration", model.enumerations.iter().map(|enumeration| enumeration.name.as_str()))?;
    for enumeration in &model.enumerations {
        let name = &enumeration.name;
        type_name("enumeration", name)?;
        if matches!(name.as_str(), "Real" | "Integer" | "Boolean" | "String") {
            return Err(Refusal::new(format!("enumeration '{name}': this is the name of a built-in type")));
        }
        if enumeration.items.is_empty() {
            return Err(Refusal::new(format!("enumeration '{name}' has no items")));
        }
        for item in &enumeration.items {
            field_name(&item.name).map_err(|reason| {
                Refusal::new(format!("enumeration '{name}', item '{}': {reason}", item.name))
            })?;
        }
        let variants: Vec<_> = enumeration.items.iter().map(|item| rust::pascal_case(&item.name)).collect();
        unique(&format!("enumeration '{name}': item"), variants.iter().map(String::as_str))?;
    }
    unique("component type", model.component_types.iter().map(|known| known.name.as_str()))?;
    for component_type in &model.component_types {
        type_name("component type", &component_type.name)?;
    }
    unique("state group", model.state_groups.iter().map(|group| group.name.as_str()))?;
    for group in &model.state_groups {
        let name = &group.name;
        field_name(name).map_err(|reason| Refusal::new(format!("state group '{name}': {reason}")))?;
    }
    unique("component", model.components.iter().map(|component| component.name.as_str()))?;
    for component in &model.components {
        let name = &component.name;
        field_name(name).map_err(|reason| Refusal::new(format!("component '{name}': {reason}")))?;
        let variables = model.variables.iter().map(|variable| variable.name.as_str());
        if variables.chain(["time"]).any(|variable| variable == name) {
            return Err(Refusal::of(name, "a component has the same name"));
        }
    }
    Ok(())
}

/// The texts that are free to choose, all of which become attributes of XML.
fn texts(model: &json::Model) -> Result<(), Refusal> {
    let mut texts = vec![
        ("description", &model.description),
        ("author", &model.author),
        ("copyright", &model.copyright),
        ("license", &model.license),
    ];
    for category in &model.log_categories {
        texts.push(("log_categories", &category.name));
        texts.push((&category.name, &category.description));
    }
    for enumeration in &model.enumerations {
        texts.push((&enumeration.name, &enumeration.description));
        texts.extend(enumeration.items.iter().map(|item| (item.name.as_str(), &item.description)));
    }
    texts.extend(model.components.iter().map(|component| (component.name.as_str(), &component.description)));
    texts.extend(model.state_groups.iter().map(|group| (group.name.as_str(), &group.description)));
    for (name, text) in texts {
        one_line(text).map_err(|reason| Refusal::new(format!("'{name}': {reason}")))?;
    }
    Ok(())
}

fn one_line(text: &str) -> Result<(), String> {
    if text.trim().is_empty() {
        return Err("its text is empty".to_owned());
    }
    if !survives_xml(text) {
        return Err("its text contains a character that XML does not keep, such as a line break".to_owned());
    }
    Ok(())
}

/// Whether an attribute of XML carries a text unchanged: tabs and line breaks become spaces, and most other
/// control characters and two of Unicode's code points are not allowed in XML at all.
fn survives_xml(text: &str) -> bool {
    !text.chars().any(|character| character.is_control() || matches!(character, '\u{fffe}' | '\u{ffff}'))
}

fn unique<'a>(what: &str, names: impl Iterator<Item = &'a str>) -> Result<(), Refusal> {
    let mut seen = BTreeSet::new();
    for name in names {
        if !seen.insert(name) {
            return Err(Refusal::new(format!("{what} '{name}' is declared twice")));
        }
    }
    Ok(())
}

fn is_c_identifier(name: &str) -> bool {
    name.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
        && name.chars().all(|character| character.is_ascii_alphanumeric() || character == '_')
}

fn type_name(what: &str, name: &str) -> Result<(), Refusal> {
    let upper = name.starts_with(|first: char| first.is_ascii_uppercase());
    if upper && name != "Self" && name.chars().all(|character| character.is_ascii_alphanumeric()) {
        Ok(())
    } else {
        Err(Refusal::new(format!("{what} '{name}': the name is not written like this: TypeName")))
    }
}

fn field_name(name: &str) -> Result<(), String> {
    let lower =
        |character: char| character.is_ascii_lowercase() || character.is_ascii_digit() || character == '_';
    if !name.starts_with(|first: char| first.is_ascii_lowercase()) || !name.chars().all(lower) {
        return Err("the name is not made of lower-case letters, digits and underscores".to_owned());
    }
    if RESERVED.contains(&name) {
        return Err("the name is a reserved word of Rust".to_owned());
    }
    Ok(())
}

/// What the checks of one variable find out about it.
pub(crate) struct Checked {
    pub(crate) role: Role,
    pub(crate) data_type: DataType,
    pub(crate) variability: Variability,
    pub(crate) initial: Option<Initial>,
    /// The start values of its scalars, row by row.
    pub(crate) starts: Option<Vec<Start>>,
}

/// The checks of one declared variable by itself.
pub(crate) fn variable(
    model: &json::Model,
    json: &json::Variable,
    start: Option<&Value>,
) -> Result<Checked, String> {
    field_name(&json.name)?;
    one_line(&json.description)?;
    if let Some(description) = json.derivative.as_ref().and_then(|derivative| derivative.description.as_ref())
    {
        one_line(description)?;
    }
    let data_type = data_type(model, json)?;
    let (role, variability) = role(json, data_type)?;
    let initial = initial(json, role)?;
    reads(json, role, initial)?;
    bounds(json, data_type)?;
    if json.dimensions.contains(&0) {
        return Err("a dimension is 0".to_owned());
    }
    let has_start = matches!(role, Role::Parameter | Role::Input | Role::State);
    let starts = match start {
        Some(_) if !has_start => return Err("it is calculated, so it has no start value".to_owned()),
        None if has_start => return Err("it needs a start value".to_owned()),
        None => None,
        Some(start) => {
            let mut starts = Vec::new();
            flatten(&json.dimensions, start, &mut |value| {
                starts.push(start_value(model, json, data_type, value)?);
                Ok(())
            })?;
            Some(starts)
        }
    };
    Ok(Checked { role, data_type, variability, initial, starts })
}

fn data_type(model: &json::Model, json: &json::Variable) -> Result<DataType, String> {
    Ok(match json.data_type.as_str() {
        "Real" => DataType::Real,
        "Integer" => DataType::Integer,
        "Boolean" => DataType::Boolean,
        "String" => DataType::String,
        name => {
            let position = model.enumerations.iter().position(|enumeration| enumeration.name == name);
            let unknown =
                || format!("type '{name}' is not one of Real, Integer, Boolean, String and the enumerations");
            DataType::Enumeration(position.ok_or_else(unknown)?)
        }
    })
}

/// The combinations of causality and variability that FMI 2.0.5 allows (section 2.2.7).
fn role(json: &json::Variable, data_type: DataType) -> Result<(Role, Variability), String> {
    let causality = json.causality;
    let of_parameter = matches!(causality, Causality::Parameter | Causality::CalculatedParameter);
    let default = match data_type {
        _ if of_parameter => Variability::Fixed,
        DataType::Real => Variability::Continuous,
        _ => Variability::Discrete,
    };
    let variability = json.variability.unwrap_or(default);
    let changes = matches!(variability, Variability::Discrete | Variability::Continuous);
    let allowed = match causality {
        Causality::Parameter | Causality::CalculatedParameter => !changes,
        Causality::Input | Causality::Output => changes,
        Causality::Local => true,
    };
    if !allowed {
        let name = |value: &dyn std::fmt::Debug| {
            let name = format!("{value:?}");
            name[..1].to_lowercase() + &name[1..]
        };
        return Err(format!(
            "FMI allows no causality '{}' with variability '{}'",
            name(&causality),
            name(&variability)
        ));
    }
    if variability == Variability::Continuous && data_type != DataType::Real {
        return Err(format!("only a Real is continuous, not {}", json.data_type));
    }
    let role = match causality {
        Causality::Local if json.derivative.is_some() => Role::State,
        Causality::Parameter => Role::Parameter,
        Causality::CalculatedParameter => Role::CalculatedParameter,
        Causality::Input => Role::Input,
        Causality::Output => Role::Output,
        Causality::Local => Role::Local,
    };
    if json.derivative.is_some() && (role != Role::State || variability != Variability::Continuous) {
        return Err("only a local continuous Real has a 'derivative'".to_owned());
    }
    Ok((role, variability))
}

/// How the start comes about: for all but states there is only one possibility.
fn initial(json: &json::Variable, role: Role) -> Result<Option<Initial>, String> {
    let (default, allowed): (_, &[_]) = match role {
        Role::Input | Role::Independent => (None, &[]),
        Role::Parameter => (Some(Initial::Exact), &[Initial::Exact]),
        Role::State => (Some(Initial::Approx), &[Initial::Approx, Initial::Exact]),
        _ => (Some(Initial::Calculated), &[Initial::Calculated]),
    };
    match json.initial {
        None => Ok(default),
        Some(initial) if allowed.contains(&initial) => Ok(Some(initial)),
        Some(_) => Err(match role {
            Role::Input | Role::Independent => "an input has no 'initial'".to_owned(),
            Role::Parameter => "a parameter's 'initial' is 'exact'".to_owned(),
            Role::State => "a state's 'initial' is 'approx' or 'exact'".to_owned(),
            _ => "the 'initial' of what is calculated and no state is 'calculated'".to_owned(),
        }),
    }
}

/// Whether the dependencies are declared, exactly where there are any.
fn reads(json: &json::Variable, role: Role, initial: Option<Initial>) -> Result<(), String> {
    let (reads, initial_reads) = (json.reads.is_some(), json.initial_reads.is_some());
    let reason = match role {
        Role::Parameter | Role::Input | Role::Independent if reads || initial_reads => {
            "it is set from outside, so it reads nothing"
        }
        Role::State if reads => "it is a state: what its equation reads belongs to its 'derivative'",
        Role::State if initial == Some(Initial::Exact) && initial_reads => {
            "its start is exact, so it reads nothing in initialization"
        }
        Role::State if initial != Some(Initial::Exact) && !initial_reads => {
            "it is a state whose start is computed, and has no 'initial_reads'"
        }
        Role::Output | Role::Local | Role::CalculatedParameter if !reads => {
            "it is calculated from dependencies that are not declared: 'reads' is missing"
        }
        _ => return Ok(()),
    };
    Err(reason.to_owned())
}

/// Unit, min, max and nominal, as far as the type has them.
fn bounds(json: &json::Variable, data_type: DataType) -> Result<(), String> {
    if data_type == DataType::Real {
        match (&json.unit, &json.display_unit) {
            (None, Some(display_unit)) => {
                return Err(format!("display unit '{display_unit}' without a unit"));
            }
            (None, None) => return Err("a Real needs a unit ('1' when it has no dimension)".to_owned()),
            (Some(json::Units::Each(units)), display_unit) => {
                let elements: usize = json.dimensions.iter().product();
                if json.dimensions.is_empty() || units.len() != elements {
                    return Err(format!(
                        "{} units are listed; an array of as many elements has one for each",
                        units.len()
                    ));
                }
                if display_unit.is_some() {
                    return Err("a display unit needs one unit, not a list".to_owned());
                }
            }
            (Some(json::Units::All(_)), _) => {}
        }
        if json.nominal.is_some_and(|nominal| nominal <= 0.0) {
            return Err("nominal is not greater than 0".to_owned());
        }
    } else if json.unit.is_some() || json.display_unit.is_some() || json.nominal.is_some() {
        return Err(format!("unit, display_unit and nominal are for Real, not {}", json.data_type));
    }
    let bounds = [json.min, json.max];
    match data_type {
        DataType::Real => {}
        DataType::Integer => {
            let integers = f64::from(i32::MIN)..=f64::from(i32::MAX);
            let is_integer = |bound: f64| bound.fract() == 0.0 && integers.contains(&bound);
            if let Some(bound) = bounds.into_iter().flatten().find(|&bound| !is_integer(bound)) {
                return Err(format!("the bound {bound:?} is not of type Integer"));
            }
        }
        _ if bounds != [None, None] => {
            return Err(format!("min and max are for Real and Integer, not {}", json.data_type));
        }
        _ => {}
    }
    if let [Some(min), Some(max)] = bounds
        && min > max
    {
        return Err(format!("min {min:?} is greater than max {max:?}"));
    }
    Ok(())
}

/// Walks through a start value of the given dimensions, row by row.
fn flatten(
    dimensions: &[usize],
    start: &Value,
    take: &mut impl FnMut(&Value) -> Result<(), String>,
) -> Result<(), String> {
    let Some((&size, inner)) = dimensions.split_first() else {
        return take(start);
    };
    match start {
        Value::Array(values) if values.len() == size => {
            values.iter().try_for_each(|value| flatten(inner, value, take))
        }
        Value::Array(values) => {
            Err(format!("start has {} elements where the dimensions ask for {size}", values.len()))
        }
        _ => Err(format!("start is {start} where the dimensions ask for an array of {size}")),
    }
}

fn start_value(
    model: &json::Model,
    json: &json::Variable,
    data_type: DataType,
    value: &Value,
) -> Result<Start, String> {
    let mismatch = || format!("start {value} is not of type {}", json.data_type);
    let within = |value: f64| {
        if json.min.is_some_and(|min| value < min) || json.max.is_some_and(|max| value > max) {
            let min = json.min.unwrap_or(f64::NEG_INFINITY);
            let max = json.max.unwrap_or(f64::INFINITY);
            return Err(format!("start {value:?} is outside {min:?}..{max:?}"));
        }
        Ok(())
    };
    match data_type {
        DataType::Real => {
            let value = value.as_f64().ok_or_else(mismatch)?;
            within(value)?;
            Ok(Start::Real(value))
        }
        DataType::Integer => {
            let integer = value.as_i64().and_then(|value| i32::try_from(value).ok()).ok_or_else(mismatch)?;
            within(f64::from(integer))?;
            Ok(Start::Integer(integer))
        }
        DataType::Boolean => value.as_bool().map(Start::Boolean).ok_or_else(mismatch),
        DataType::String => {
            let text = value.as_str().ok_or_else(mismatch)?;
            if !survives_xml(text) {
                return Err(
                    "start contains a character that XML does not keep, such as a line break".to_owned()
                );
            }
            Ok(Start::String(text.to_owned()))
        }
        DataType::Enumeration(position) => {
            let name = value.as_str().ok_or_else(mismatch)?;
            let items = &model.enumerations[position].items;
            let item = items.iter().position(|item| item.name == name);
            item.map(Start::Item)
                .ok_or_else(|| format!("start '{name}' is not an item of {}", json.data_type))
        }
    }
}

/// The units that the variables use, in the order of their file.
pub(crate) fn units<'a>(
    model: &json::Model,
    variables: &[Variable],
    units: &'a [json::Unit],
) -> Result<Vec<&'a json::Unit>, Refusal> {
    let file = &model.units;
    let mut used = BTreeSet::new();
    for variable in variables {
        let Some(name) = variable.unit.as_deref() else {
            continue;
        };
        let refuse = |reason: String| Err(Refusal::of(&variable.name, reason));
        let Some(position) = units.iter().position(|unit| unit.name == name) else {
            return refuse(format!("unit '{name}' is not defined in {file}"));
        };
        used.insert(position);
        if let Some(name) = variable.display_unit.as_deref() {
            let unit = &units[position];
            if !unit.display_units.iter().any(|display| display.name == name) {
                return refuse(format!("unit '{}' has no display unit '{name}' in {file}", unit.name));
            }
        }
    }
    Ok(used.into_iter().map(|position| &units[position]).collect())
}

/// The checks of the file of units by itself.
pub(crate) fn unit_file(units: &[json::Unit]) -> Result<(), Refusal> {
    unique("unit", units.iter().map(|unit| unit.name.as_str()))?;
    for unit in units {
        let name = &unit.name;
        one_line(name).map_err(|reason| Refusal::new(format!("unit '{name}': {reason}")))?;
        for display in &unit.display_units {
            one_line(&display.name).map_err(|reason| {
                Refusal::new(format!("unit '{name}', display unit '{}': {reason}", display.name))
            })?;
        }
        unique(
            &format!("unit '{name}': display unit"),
            unit.display_units.iter().map(|unit| unit.name.as_str()),
        )?;
        if unit.factor == 0.0 || unit.display_units.iter().any(|display| display.factor == 0.0) {
            return Err(Refusal::new(format!("unit '{name}': a factor is 0")));
        }
        if unit.base.is_none() && (unit.factor.to_bits() != 1.0_f64.to_bits() || unit.offset != 0.0) {
            return Err(Refusal::new(format!(
                "unit '{name}': a factor or offset needs a 'base' to refer to"
            )));
        }
    }
    Ok(())
}

/// Each state belongs to one of the groups, where there are any, and each group has states.
pub(crate) fn state_groups(model: &json::Model, parts: &[Part<'_>]) -> Result<(), Refusal> {
    let state = |part: &Part<'_>| {
        part.fields.iter().find(|field| field.role == Role::State).map(|field| field.json.name.clone())
    };
    for part in parts {
        let component = part.name.unwrap_or_default();
        match (part.state_group, state(part)) {
            (Some(group), _) if model.state_groups.iter().all(|known| known.name != group) => {
                return Err(Refusal::new(format!(
                    "component '{component}': state_group '{group}' is not among the state_groups"
                )));
            }
            (Some(group), None) => {
                return Err(Refusal::new(format!(
                    "component '{component}': it is in the state group '{group}', but has no states"
                )));
            }
            (None, Some(state)) if !model.state_groups.is_empty() => {
                let name = part.name.map_or(state.clone(), |component| format!("{component}.{state}"));
                return Err(Refusal::of(name, "it is a state whose component has no 'state_group'"));
            }
            _ => {}
        }
    }
    let is_empty = |name: &str| parts.iter().all(|part| part.state_group != Some(name));
    match model.state_groups.iter().find(|group| is_empty(&group.name)) {
        Some(group) => Err(Refusal::new(format!("state group '{}' has no component", group.name))),
        None => Ok(()),
    }
}

/// The generated types must have different names.
pub(crate) fn type_names(model: &json::Model, parts: &[Part<'_>]) -> Result<(), Refusal> {
    let mut names: Vec<_> = model.enumerations.iter().map(|enumeration| enumeration.name.clone()).collect();
    names.extend(rust::struct_names(model, parts));
    names.extend(rust::FIXED_NAMES.map(str::to_owned));
    unique("the generated type", names.iter().map(String::as_str))
}

/// A co-simulation unit without outputs computes nothing for anyone.
pub(crate) fn outputs(variables: &[Variable]) -> Result<(), Refusal> {
    if variables.iter().any(|variable| variable.role == Role::Output) {
        Ok(())
    } else {
        Err(Refusal::new("there is no variable with causality 'output'"))
    }
}

/// A calculated parameter changes with parameters only.
pub(crate) fn calculated_parameters(variables: &[Variable]) -> Result<(), Refusal> {
    for variable in variables.iter().filter(|variable| variable.role == Role::CalculatedParameter) {
        let allowed = |role| matches!(role, Role::Parameter | Role::CalculatedParameter);
        let others = variable.reads.iter().chain(variable.reads_in_initialization());
        if let Some(read) = others.map(|&read| &variables[read]).find(|read| !allowed(read.role)) {
            let reason = format!("a calculatedParameter reads '{}', which is not a parameter", read.name);
            return Err(Refusal::of(&variable.name, reason));
        }
    }
    Ok(())
}
