//! What is rejected, and why: the rules of FMI 2.0 and of generated Rust that a declaration can break. FMU validators
//! catch few of these; FMU users suffer from all of them.

pub(crate) mod clocks;

use std::collections::BTreeSet;

use serde_json::Value;

use crate::declaration::{
    Causality, Declaration, Described, DisplayUnitDeclaration, Initial, TYPES_OF_FMI3, UnitDeclaration,
    UnitNames, Variability, VariableDeclaration,
};
use crate::error::{Refusals, nearest};
use crate::interfaces::Version;
use crate::model::{DataType, Model, Part, Place, Scalar, Start, Whole};
use crate::rust;
use crate::units::Units;
use crate::xml;

/// Rust keywords, which cannot name fields.
const RESERVED: [&str; 51] = [
    "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "crate", "do", "dyn",
    "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl", "in", "let", "loop",
    "macro", "match", "mod", "move", "mut", "override", "priv", "pub", "ref", "return", "self", "static",
    "struct", "super", "trait", "true", "try", "type", "typeof", "unsafe", "unsized", "use", "virtual",
    "where", "while", "yield",
];

/// The longest name, in bytes: longer ones are unreadable and slow to look up.
pub(crate) const LONGEST_NAME: usize = 200;

/// The most scalar variables in a model: more than anyone compiles.
const MOST_VARIABLES: usize = 100_000;

/// The most dimensions of an array.
const MOST_DIMENSIONS: usize = 16;

/// The checks that need no variable.
pub(crate) fn declaration(declaration: &Declaration, identifier: &str, refusals: &mut Refusals) {
    if !is_c_identifier(identifier) {
        let reason = format!("'{identifier}' is not a C identifier, as an FMU's name must be");
        refusals.add("model_identifier", reason);
    }
    if let Some(experiment) = &declaration.default_experiment {
        let start = experiment.start_time.unwrap_or(0.0);
        if experiment.stop_time.is_some_and(|stop| stop <= start) {
            refusals.add("default_experiment.stop_time", "it is not after start_time");
        }
        if experiment.step_size.is_some_and(|size| size <= 0.0) {
            refusals.add("default_experiment.step_size", "it is not greater than 0");
        }
    }
    if declaration.capabilities.serialize_state == Some(true) && !declaration.capabilities.get_and_set_state {
        let reason = "a state that cannot be saved cannot be serialized, and 'get_and_set_state' is false";
        refusals.add("capabilities.serialize_state", reason);
    }
    names(declaration, refusals);
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
        type_name(name, &key, refusals);
        if built_in_types().any(|known| known == name) {
            refusals.add(format!("{key}.name"), format!("'{name}' is the name of a built-in type"));
        }
        if enumeration.items.is_empty() {
            refusals.add(format!("{key}.items"), format!("{name}: it has no items"));
        }
        for (number, item) in enumeration.items.iter().enumerate() {
            let (name, key) = (&item.name, format!("{key}.items[{number}].name"));
            if let Err(reason) = mixed_name(name, "letters, digits, underscores and spaces") {
                refusals.add(key, reason);
            } else if rust::pascal_case(name) == "Self" {
                refusals.add(key, format!("'{name}' would be 'Self' in Rust, which is a reserved word"));
            }
        }
        let variants = enumeration.items.iter().map(|item| rust::pascal_case(&item.name));
        unique(&format!("{key}.items"), variants, refusals);
    }
    let types = &declaration.component_types;
    unique("component_types", types.iter().map(|known| known.name.clone()), refusals);
    for (number, component_type) in types.iter().enumerate() {
        type_name(&component_type.name, &format!("component_types[{number}]"), refusals);
    }
    field_names("state_groups", &described(&declaration.state_groups), refusals);
    unique("state_groups", described(&declaration.state_groups), refusals);
    let components: Vec<_> = declaration.components.iter().map(|component| component.name.clone()).collect();
    field_names("components", &components, refusals);
    unique("components", components.clone(), refusals);
    let variables = declaration.variables.iter().map(|variable| rust::snake_case(&variable.name));
    let variables: BTreeSet<_> = variables.chain(["time".to_owned()]).collect();
    for (number, component) in components.iter().enumerate() {
        if variables.contains(component) {
            let reason = format!("'{component}' is also the name of a variable");
            refusals.add(format!("components[{number}].name"), reason);
        }
    }
}

/// Event indicators are named like variables, such as `vessel.empty`.
fn event_indicators(declaration: &Declaration, refusals: &mut Refusals) {
    let mut seen = BTreeSet::new();
    for (number, name) in declaration.event_indicators.iter().enumerate() {
        let key = format!("event_indicators[{number}]");
        if let Err(reason) = name.split('.').try_for_each(field_name) {
            refusals.add(&key, format!("{name}: {reason}"));
        }
        if !seen.insert(name) {
            refusals.add(key, format!("'{name}' is declared twice"));
        }
    }
    for (number, name) in declaration.limits.iter().enumerate() {
        if !seen.contains(name) {
            let nearest = nearest(name, declaration.event_indicators.iter().cloned());
            let reason = format!("'{name}' is not one of the event_indicators{nearest}");
            refusals.add(format!("limits[{number}]"), reason);
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
        if let Err(reason) = field_name(&terminal.name) {
            refusals.add(format!("{key}.name"), reason);
        }
        if let Some(Err(reason)) = terminal.description.as_deref().map(one_line) {
            refusals.add(format!("{key}.description"), reason);
        }
        let mut seen = BTreeSet::new();
        for (position, name) in terminal.variables.iter().enumerate() {
            let key = format!("{key}.variables[{position}]");
            let reason = match names.get(name) {
                None => format!("there is no variable '{name}'{}", nearest(name, names.keys().cloned())),
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

/// The free texts, all of which become XML attributes.
fn texts(declaration: &Declaration, refusals: &mut Refusals) {
    let mut check = |key: String, text: &str| {
        if let Err(reason) = one_line(text) {
            refusals.add(key, reason);
        }
    };
    for (key, text) in [
        ("description", &declaration.description),
        ("author", &declaration.author),
        ("copyright", &declaration.copyright),
        ("license", &declaration.license),
    ] {
        if let Some(text) = text {
            check(key.to_owned(), text);
        }
    }
    let mut described = |key: &str, list: &[Described]| {
        for (number, item) in list.iter().enumerate() {
            check(format!("{key}[{number}].name"), &item.name);
            check(format!("{key}[{number}].description"), &item.description);
        }
    };
    described("log_categories", &declaration.log_categories);
    described("state_groups", &declaration.state_groups);
    for (number, enumeration) in declaration.enumerations.iter().enumerate() {
        described(&format!("enumerations[{number}].items"), &enumeration.items);
    }
    for (number, enumeration) in declaration.enumerations.iter().enumerate() {
        check(format!("enumerations[{number}].description"), &enumeration.description);
    }
    for (number, component) in declaration.components.iter().enumerate() {
        if let Some(text) = &component.description {
            check(format!("components[{number}].description"), text);
        }
    }
}

fn one_line(text: &str) -> Result<(), String> {
    if text.trim().is_empty() {
        return Err("the text is empty".to_owned());
    }
    if !survives_xml(text) {
        return Err(
            "the text contains a character that XML does not preserve, such as a line break".to_owned()
        );
    }
    if text.contains(DIRECTION_OF_WRITING) {
        return Err("the text contains a bidirectional control character, which Rust rejects".to_owned());
    }
    Ok(())
}

/// The marks rejected by rustc's lint `text_direction_codepoint_in_comment`: with them, an editor displays a text
/// other than the actual one.
const DIRECTION_OF_WRITING: [char; 9] = [
    '\u{202a}', '\u{202b}', '\u{202c}', '\u{202d}', '\u{202e}', '\u{2066}', '\u{2067}', '\u{2068}',
    '\u{2069}',
];

/// Whether an XML attribute preserves a text: tabs and line breaks become spaces, and most other control characters
/// and two Unicode code points are not allowed in XML at all.
fn survives_xml(text: &str) -> bool {
    !text.chars().any(|character| character.is_control() || matches!(character, '\u{fffe}' | '\u{ffff}'))
}

/// Rejects a name that occurs twice in a list.
fn unique(list: &str, names: impl IntoIterator<Item = String>, refusals: &mut Refusals) {
    let mut seen = BTreeSet::new();
    for (number, name) in names.into_iter().enumerate() {
        if seen.contains(&name) {
            refusals.add(format!("{list}[{number}].name"), format!("'{name}' is declared twice"));
        }
        seen.insert(name);
    }
}

fn is_c_identifier(name: &str) -> bool {
    name.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
        && name.chars().all(|character| character.is_ascii_alphanumeric() || character == '_')
}

fn type_name(name: &str, key: &str, refusals: &mut Refusals) {
    if let Err(reason) = length(name) {
        return refusals.add(format!("{key}.name"), reason);
    }
    let upper = name.starts_with(|first: char| first.is_ascii_uppercase());
    if !upper || name == "Self" || !name.chars().all(|character| character.is_ascii_alphanumeric()) {
        refusals.add(format!("{key}.name"), format!("'{name}' is not of the form TypeName"));
    }
}

fn field_names(list: &str, names: &[String], refusals: &mut Refusals) {
    for (number, name) in names.iter().enumerate() {
        if let Err(reason) = field_name(name) {
            refusals.add(format!("{list}[{number}].name"), reason);
        }
    }
}

pub(crate) fn length(name: &str) -> Result<(), String> {
    if name.len() <= LONGEST_NAME {
        return Ok(());
    }
    let start: String = name.chars().take(20).collect();
    Err(format!("'{start}…' is longer than {LONGEST_NAME} bytes"))
}

fn field_name(name: &str) -> Result<(), String> {
    length(name)?;
    let lower =
        |character: char| character.is_ascii_lowercase() || character.is_ascii_digit() || character == '_';
    if !name.starts_with(|first: char| first.is_ascii_lowercase()) || !name.chars().all(lower) {
        return Err(format!("'{name}' is not made of lower-case letters, digits and underscores"));
    }
    if RESERVED.contains(&name) {
        return Err(format!("'{name}' is a reserved word in Rust"));
    }
    Ok(())
}

/// A name that is written differently in Rust; `made_of` describes its characters.
fn mixed_name(name: &str, made_of: &str) -> Result<(), String> {
    length(name)?;
    let allowed = |character: char| {
        character.is_ascii_alphanumeric()
            || character == '_'
            || character == ' ' && made_of.contains("spaces")
    };
    if !name.starts_with(|first: char| first.is_ascii_alphabetic()) || !name.chars().all(allowed) {
        return Err(format!("'{name}' is not made of {made_of}"));
    }
    if RESERVED.contains(&rust::snake_case(name).as_str()) {
        return Err(format!("'{name}' is a reserved word in Rust"));
    }
    Ok(())
}

/// The results of one variable's checks.
pub(crate) struct Checked {
    pub(crate) place: Place,
    pub(crate) data_type: DataType,
    pub(crate) variability: Variability,
    pub(crate) initial: Option<Initial>,
    /// Its scalars' start values, row by row.
    pub(crate) starts: Option<Vec<Start>>,
}

/// The key at fault, and the reason.
pub(crate) type Blame = (&'static str, String);

/// Checks one declared variable, which follows this many scalars.
pub(crate) fn variable(
    declaration: &Declaration,
    variable: &VariableDeclaration,
    start: Option<&Value>,
    before: usize,
) -> Result<Checked, Blame> {
    mixed_name(&variable.name, "letters, digits and underscores").map_err(|reason| {
        let component = variable.name.split_once('.').map(|(component, own)| {
            format!("; '{own}' is declared under the component '{component}' of 'components'")
        });
        ("name", reason + &component.unwrap_or_default())
    })?;
    if let Some(description) = &variable.description {
        one_line(description).map_err(|reason| ("description", reason))?;
    }
    let derivative = variable.derivative.as_ref();
    if let Some(description) = derivative.and_then(|derivative| derivative.description.as_ref()) {
        one_line(description).map_err(|reason| ("derivative.description", reason))?;
    }
    if variable.sizes.contains(&0) {
        return Err(("dimensions", "a dimension is 0".to_owned()));
    }
    if variable.sizes.len() > MOST_DIMENSIONS {
        return Err(("dimensions", format!("an array has at most {MOST_DIMENSIONS}")));
    }
    let with_derivative = if variable.derivative.is_some() { 2 } else { 1 };
    let scalars =
        variable.sizes.iter().try_fold(with_derivative, |product: usize, &size| product.checked_mul(size));
    if scalars.is_none_or(|scalars| scalars > MOST_VARIABLES - before.min(MOST_VARIABLES)) {
        let reason = "counting array elements and derivatives";
        let key = if variable.sizes.is_empty() { "name" } else { "dimensions" };
        return Err((key, format!("a model has at most {MOST_VARIABLES} variables, {reason}")));
    }
    let data_type = data_type(declaration, variable).map_err(|reason| ("type", reason))?;
    let (place, variability) = place(variable, data_type)?;
    let initial = initial(variable, place, variability).map_err(|reason| ("initial", reason))?;
    reads(variable, place, variability, initial)?;
    unit(variable, data_type)?;
    bounds(variable, data_type)?;
    clocks::keys(variable, data_type)?;
    if !variable.clocks.is_empty() && !matches!(variability, Variability::Discrete | Variability::Tunable) {
        return Err(("clocks", "a variable with clocks is 'discrete' or 'tunable'".to_owned()));
    }
    if variable.previous.is_some() && (variable.clocks.is_empty() || variability != Variability::Discrete) {
        return Err((
            "previous",
            "a variable with a previous value is 'discrete' and has 'clocks'".to_owned(),
        ));
    }
    let has_start = matches!(place, Place::Inputs | Place::States) || initial == Some(Initial::Exact);
    let starts = match start {
        Some(_) if data_type == DataType::Clock => return Err(("start", "a Clock has none".to_owned())),
        Some(_) if !has_start => {
            let unless =
                if variability == Variability::Discrete { ", unless 'initial' is 'exact'" } else { "" };
            return Err(("start", format!("it is calculated, so it has no start value{unless}")));
        }
        None if has_start => return Err(("start", "it needs a start value".to_owned())),
        None => None,
        Some(start) => {
            let mut starts = Vec::new();
            let values = flatten(&variable.sizes, start, &mut |value| {
                starts.push(start_value(declaration, variable, data_type, value)?);
                Ok(())
            });
            values.map_err(|reason| ("start", reason))?;
            Some(starts)
        }
    };
    Ok(Checked { place, data_type, variability, initial, starts })
}

/// The types of every version.
const COMMON_TYPES: [&str; 4] = ["Real", "Integer", "Boolean", "String"];

fn built_in_types() -> impl Iterator<Item = &'static str> {
    COMMON_TYPES.into_iter().chain(TYPES_OF_FMI3)
}

fn data_type(declaration: &Declaration, variable: &VariableDeclaration) -> Result<DataType, String> {
    let enumerations = || declaration.enumerations.iter().map(|enumeration| &enumeration.name);
    Ok(match variable.data_type.as_str() {
        "Real" => DataType::Real,
        "Integer" => DataType::Integer,
        "Boolean" => DataType::Boolean,
        "String" => DataType::String,
        "Float32" => DataType::Float32,
        "Binary" => DataType::Binary,
        "Clock" => DataType::Clock,
        name if let Some(whole) = Whole::ALL.into_iter().find(|whole| whole.name() == name) => {
            DataType::Whole(whole)
        }
        name => DataType::Enumeration(enumerations().position(|known| known == name).ok_or_else(|| {
            let known = built_in_types().map(str::to_owned).chain(enumerations().cloned());
            let nearest = match name {
                // The names in FMI 3.0 and in programming languages of types that FMI 2.0 also has.
                "Float64" | "f64" | "float" | "double" => "; use 'Real'".to_owned(),
                "Int32" | "i32" | "int" => "; use 'Integer'".to_owned(),
                "bool" => "; use 'Boolean'".to_owned(),
                "str" => "; use 'String'".to_owned(),
                _ => nearest(name, known),
            };
            let types = built_in_types().collect::<Vec<_>>().join(", ");
            format!("'{name}' is not one of {types} and the enumerations{nearest}")
        })?),
    })
}

/// The combinations of causality and variability that FMI 2.0.5 allows (section 2.2.7).
fn place(variable: &VariableDeclaration, data_type: DataType) -> Result<(Place, Variability), Blame> {
    let causality = variable.causality;
    let is_structural = causality == Causality::StructuralParameter;
    if is_structural && data_type != DataType::Whole(Whole::UInt64) {
        return Err(("type", "a structuralParameter is of type UInt64".to_owned()));
    }
    let of_parameter =
        is_structural || matches!(causality, Causality::Parameter | Causality::CalculatedParameter);
    let default = match data_type {
        _ if of_parameter => Variability::Fixed,
        DataType::Real | DataType::Float32 => Variability::Continuous,
        _ => Variability::Discrete,
    };
    let variability = variable.variability.unwrap_or(default);
    if is_structural && variability != Variability::Fixed {
        return Err(("variability", "the build fixes a structuralParameter, so it is 'fixed'".to_owned()));
    }
    if data_type == DataType::Clock {
        if !matches!(causality, Causality::Input | Causality::Output | Causality::Local) {
            return Err(("causality", "a Clock is an input, an output or local".to_owned()));
        }
        if variability != Variability::Discrete {
            return Err(("variability", "a Clock is discrete".to_owned()));
        }
    }
    let changes = matches!(variability, Variability::Discrete | Variability::Continuous);
    let allowed = match causality {
        Causality::Parameter | Causality::CalculatedParameter => {
            matches!(variability, Variability::Fixed | Variability::Tunable)
        }
        Causality::Input => changes,
        Causality::Output => changes || variability == Variability::Constant,
        Causality::Local | Causality::StructuralParameter => true,
    };
    if !allowed {
        let (causality, variability) = (xml::causality(Some(causality)), xml::variability(variability));
        let reason = format!("FMI does not allow variability '{variability}' with causality '{causality}'");
        return Err(("variability", reason));
    }
    if variability == Variability::Continuous && !is_float(data_type) {
        return Err(("variability", format!("only a Real can be continuous, not {}", variable.data_type)));
    }
    let is_state = variable.derivative.is_some();
    if is_state
        && (data_type != DataType::Real
            || variability != Variability::Continuous
            || !matches!(causality, Causality::Local | Causality::Output))
    {
        return Err(("derivative", "only a continuous local or output Real has one".to_owned()));
    }
    if variable.reinit && !is_state {
        return Err(("reinit", "events can set only a state, which has a 'derivative'".to_owned()));
    }
    for (key, is_strict, bound) in
        [("strict_min", variable.strict_min, variable.min), ("strict_max", variable.strict_max, variable.max)]
    {
        if is_strict && !(is_state && bound.is_some()) {
            let bound = key.trim_start_matches("strict_");
            return Err((key, format!("it is for a state, which has a 'derivative', with a '{bound}'")));
        }
    }
    let place = match causality {
        _ if is_state => Place::States,
        _ if data_type == DataType::Clock => Place::Clocks,
        Causality::Parameter | Causality::StructuralParameter => Place::Parameters,
        Causality::Input => Place::Inputs,
        Causality::Output => Place::Outputs,
        Causality::CalculatedParameter | Causality::Local => Place::Locals,
    };
    Ok((place, variability))
}

/// How the start value is determined: a choice for states, and for discrete variables that events change. The
/// standard's default, `calculated`, does not suit variables with a start value, which all states have.
fn initial(
    variable: &VariableDeclaration,
    place: Place,
    variability: Variability,
) -> Result<Option<Initial>, String> {
    let (default, allowed, reason): (_, &[_], _) = match place {
        Place::Inputs => (None, &[], "an input has none"),
        Place::Clocks => (None, &[], "a Clock has none"),
        Place::Parameters => (Some(Initial::Exact), &[Initial::Exact], "a parameter's is 'exact'"),
        Place::States => {
            let computed = variable.initial_reads.is_some();
            let default = if computed { Initial::Approx } else { Initial::Exact };
            (Some(default), &[Initial::Approx, Initial::Exact], "a state's is 'approx' or 'exact'")
        }
        _ if variability == Variability::Constant => {
            (Some(Initial::Exact), &[Initial::Exact], "a constant's is 'exact'")
        }
        _ if variability == Variability::Discrete => (
            Some(Initial::Calculated),
            &[Initial::Calculated, Initial::Exact],
            "a discrete variable's is 'calculated' or 'exact'",
        ),
        _ => (
            Some(Initial::Calculated),
            &[Initial::Calculated],
            "for a calculated variable, neither state nor discrete, it is 'calculated'",
        ),
    };
    match variable.initial {
        None => Ok(default),
        Some(initial) if allowed.contains(&initial) => Ok(Some(initial)),
        Some(_) => Err(reason.to_owned()),
    }
}

/// Whether dependencies are declared only where possible.
fn reads(
    variable: &VariableDeclaration,
    place: Place,
    variability: Variability,
    initial: Option<Initial>,
) -> Result<(), Blame> {
    let (reads, initial_reads) = (variable.reads.is_some(), variable.initial_reads.is_some());
    let is_given =
        matches!(place, Place::Parameters | Place::Inputs) || variable.causality == Causality::Input;
    let blame = match place {
        _ if is_given && reads => ("reads", "it is set from outside, so it reads nothing"),
        _ if is_given && initial_reads => ("initial_reads", "it is set from outside, so it reads nothing"),
        Place::States if reads => ("reads", "a state's reads belong to its 'derivative'"),
        _ if reads && variability == Variability::Constant => ("reads", "a constant reads nothing"),
        _ if initial == Some(Initial::Exact) && initial_reads => {
            ("initial_reads", "its start is exact, so it reads nothing in initialization")
        }
        _ => return Ok(()),
    };
    Err((blame.0, blame.1.to_owned()))
}

fn is_float(data_type: DataType) -> bool {
    matches!(data_type, DataType::Real | DataType::Float32)
}

/// Only Reals have unit, display unit and nominal.
fn unit(variable: &VariableDeclaration, data_type: DataType) -> Result<(), Blame> {
    if !is_float(data_type) {
        let used = [
            ("unit", variable.unit.is_some()),
            ("display_unit", variable.display_unit.is_some()),
            ("nominal", variable.nominal.is_some()),
        ];
        return match used.into_iter().find(|(_, used)| *used) {
            Some((key, _)) => Err((key, format!("it is for a Real, not for {}", variable.data_type))),
            None => Ok(()),
        };
    }
    match &variable.unit {
        None => return Err(("unit", "a Real needs one; '1' if dimensionless".to_owned())),
        Some(UnitNames::Each(units)) => {
            let elements: usize = variable.sizes.iter().product();
            if variable.sizes.is_empty() {
                return Err(("unit", "only an array can have a list of units".to_owned()));
            }
            if units.len() != elements {
                return Err(("unit", format!("the list has {} units for {elements} elements", units.len())));
            }
            if variable.display_unit.is_some() {
                return Err(("display_unit", "it needs one unit, not a list".to_owned()));
            }
        }
        Some(UnitNames::All(_)) => {}
    }
    if variable.nominal.is_some_and(|nominal| nominal <= 0.0) {
        return Err(("nominal", "it is not greater than 0".to_owned()));
    }
    Ok(())
}

/// Min and max, for types that have them.
fn bounds(variable: &VariableDeclaration, data_type: DataType) -> Result<(), Blame> {
    for (key, bound) in [("min", variable.min), ("max", variable.max)] {
        let Some(bound) = bound else { continue };
        let range = match data_type {
            DataType::Real => continue,
            DataType::Float32 => f64::from(f32::MIN)..=f64::from(f32::MAX),
            DataType::Integer => f64::from(i32::MIN)..=f64::from(i32::MAX),
            DataType::Whole(whole) => {
                let (_, range) = whole.in_rust();
                exact(*range.start())..=exact(*range.end())
            }
            _ => return Err((key, format!("it is for numbers, not for {}", variable.data_type))),
        };
        if !range.contains(&bound) || data_type != DataType::Float32 && bound.fract() != 0.0 {
            return Err((key, format!("{bound} is not of type {}", variable.data_type)));
        }
    }
    if let (Some(min), Some(max)) = (variable.min, variable.max)
        && min > max
    {
        return Err(("min", format!("{min} is greater than max {max}")));
    }
    Ok(())
}

/// The nearest bound that a JSON number represents exactly.
#[expect(clippy::cast_precision_loss, reason = "every whole number up to 2 to the power of 53 is exact")]
fn exact(bound: i128) -> f64 {
    const LARGEST: i128 = 1 << f64::MANTISSA_DIGITS;
    bound.clamp(-LARGEST, LARGEST) as f64
}

/// Visits a start value of the given dimensions, row by row.
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
            Err(format!("it has {} elements, but the dimensions require {size}", values.len()))
        }
        _ => Err(format!("{start} is not an array of {size} elements, as the dimensions require")),
    }
}

fn start_value(
    declaration: &Declaration,
    variable: &VariableDeclaration,
    data_type: DataType,
    value: &Value,
) -> Result<Start, String> {
    let mismatch = || format!("{value} is not of type {}", variable.data_type);
    let within = |number: f64| match (variable.min, variable.max) {
        (Some(min), _) if number < min => Err(format!("{value} is less than min {min}")),
        (_, Some(max)) if number > max => Err(format!("{value} is greater than max {max}")),
        _ => Ok(()),
    };
    match data_type {
        DataType::Real => {
            let value = value.as_f64().ok_or_else(mismatch)?;
            within(value)?;
            Ok(Start::Real(value))
        }
        DataType::Float32 => {
            let value = value.as_f64().filter(|value| value.abs() <= f32::MAX.into()).ok_or_else(mismatch)?;
            within(value)?;
            Ok(Start::Real(value))
        }
        DataType::Integer | DataType::Whole(_) => {
            let range = match data_type {
                DataType::Whole(whole) => whole.in_rust().1,
                _ => i32::MIN.into()..=i32::MAX.into(),
            };
            let number = value.as_i64().map(i128::from).or_else(|| value.as_u64().map(i128::from));
            let number = number.filter(|number| range.contains(number)).ok_or_else(mismatch)?;
            within(value.as_f64().ok_or_else(mismatch)?)?;
            Ok(Start::Integer(number))
        }
        DataType::Binary => {
            let text = value.as_str().ok_or_else(mismatch)?;
            let bytes = text.as_bytes().chunks(2).map(|digits| {
                let digits = str::from_utf8(digits).ok().filter(|digits| digits.len() == 2)?;
                let is_hexadecimal = digits.bytes().all(|digit| digit.is_ascii_hexdigit());
                u8::from_str_radix(digits, 16).ok().filter(|_| is_hexadecimal)
            });
            let bytes = bytes.collect::<Option<_>>();
            bytes
                .map(Start::Binary)
                .ok_or_else(|| format!("{value} does not consist of two hexadecimal digits per byte"))
        }
        DataType::Boolean => value.as_bool().map(Start::Boolean).ok_or_else(mismatch),
        DataType::Clock => Err("a Clock has none".to_owned()),
        DataType::String => {
            let text = value.as_str().ok_or_else(mismatch)?;
            if !survives_xml(text) {
                return Err(
                    "it contains a character that XML does not preserve, such as a line break".to_owned()
                );
            }
            Ok(Start::String(text.to_owned()))
        }
        DataType::Enumeration(position) => {
            let name = value.as_str().ok_or_else(mismatch)?;
            let items = &declaration.enumerations[position].items;
            let item = items.iter().position(|item| item.name == name);
            item.map(Start::Item).ok_or_else(|| {
                let known = || items.iter().map(|item| item.name.clone());
                let nearest = nearest(name, known());
                let known = known().collect::<Vec<_>>().join(", ");
                format!("'{name}' is not one of {}'s items {known}{nearest}", variable.data_type)
            })
        }
    }
}

/// Checks the units file by itself.
pub(crate) fn units(units: &[UnitDeclaration], refusals: &mut Refusals) {
    let mut names = BTreeSet::new();
    let known = Units::new(units);
    for (number, unit) in units.iter().enumerate() {
        let (name, key) = (&unit.name, format!("[{number}]"));
        let mut refuse = |key: String, reason: &str| refusals.add(key, format!("'{name}': {reason}"));
        if !names.insert(name) {
            refuse(format!("{key}.name"), "it is declared twice");
        }
        if let Err(reason) = one_line(name) {
            refuse(format!("{key}.name"), &reason);
        }
        if unit.factor == 0.0 {
            refuse(format!("{key}.factor"), "it is 0");
        }
        if unit.base.is_none() && (unit.factor.to_bits() != 1.0_f64.to_bits() || unit.offset != 0.0) {
            refuse(key.clone(), "a factor or offset needs a 'base' to refer to");
        }
        let mut display_names = BTreeSet::new();
        for (number, display) in unit.display_units.iter().enumerate() {
            let key = format!("{key}.display_units[{number}]");
            if !display_names.insert(display.name()) {
                refuse(key.clone(), &format!("'{}' is declared twice", display.name()));
            }
            if let Err(reason) = one_line(display.name()) {
                refuse(key.clone(), &reason);
            }
            if let DisplayUnitDeclaration::New { factor: 0.0, .. } = display {
                refuse(format!("{key}.factor"), "it is 0");
            }
        }
        if let Err(reason) = known.find(name) {
            refusals.add(format!("{key}.display_units"), reason);
        }
    }
}

/// If there are groups, each state belongs to one, and each group has states.
pub(crate) fn state_groups(
    declaration: &Declaration,
    parts: &[Part<'_>],
    scalars: &[Scalar],
    refusals: &mut Refusals,
) {
    let groups = &declaration.state_groups;
    let names: BTreeSet<_> = groups.iter().map(|group| group.name.as_str()).collect();
    for part in parts {
        let state = part.fields.iter().find(|field| field.place == Place::States);
        let component = part.name.unwrap_or_default();
        match (part.state_group, state) {
            (Some(group), _) if !names.contains(group) => {
                let nearest = nearest(group, groups.iter().map(|known| known.name.clone()));
                let reason = format!("{component}: '{group}' is not one of the state_groups{nearest}");
                refusals.add(format!("{}.state_group", part.key), reason);
            }
            (Some(group), None) => {
                let reason = format!("{component}: it is in the state group '{group}', but has no states");
                refusals.add(format!("{}.state_group", part.key), reason);
            }
            (None, Some(state)) if !groups.is_empty() => {
                let Scalar { name, key, .. } = &scalars[state.positions[0]];
                refusals.add(key, format!("{name}: it is a state, but its component has no 'state_group'"));
            }
            _ => {}
        }
    }
    let used: BTreeSet<_> = parts.iter().filter_map(|part| part.state_group).collect();
    for (number, group) in groups.iter().enumerate() {
        if !used.contains(group.name.as_str()) {
            let reason = format!("no component is in the state group '{}'", group.name);
            refusals.add(format!("state_groups[{number}]"), reason);
        }
    }
}

/// The generated types must have distinct names.
pub(crate) fn type_names(declaration: &Declaration, parts: &[Part<'_>], refusals: &mut Refusals) {
    let mut names: BTreeSet<_> = rust::FIXED_NAMES.map(str::to_owned).into();
    if declaration.has_clocks() {
        names.insert(Place::Clocks.type_name().to_owned());
    }
    let enumerations = declaration.enumerations.iter().enumerate();
    let enumerations =
        enumerations.map(|(number, known)| (format!("enumerations[{number}].name"), known.name.clone()));
    for (key, name) in rust::struct_names(declaration, parts).into_iter().chain(enumerations) {
        if names.contains(&name) {
            refusals.add(key, format!("two generated types would be called '{name}'"));
        }
        names.insert(name);
    }
}

/// FMI 2.0 has fewer types than FMI 3.0.
pub(crate) fn types_of_version(scalars: &[Scalar], version: Version, refusals: &mut Refusals) {
    if version == Version::Three {
        return;
    }
    let mut seen = BTreeSet::new();
    for Scalar { name, key, data_type, .. } in scalars {
        let data_type = match data_type {
            DataType::Float32 => "Float32",
            DataType::Whole(whole) => whole.name(),
            DataType::Binary => "Binary",
            DataType::Clock => "Clock",
            _ => continue,
        };
        if seen.insert(key) {
            let reason = format!("{name}: FMI 2.0 has no type {data_type}; FMI 3.0 has it (--fmi 3)");
            refusals.add(format!("{key}.type"), reason);
        }
    }
}

/// A co-simulation unit without outputs is useless.
pub(crate) fn outputs(scalars: &[Scalar], refusals: &mut Refusals) {
    if scalars.iter().all(|scalar| scalar.causality != Some(Causality::Output)) {
        refusals.add("variables", "no variable has causality 'output'");
    }
}

/// Only parameters change a calculated parameter.
pub(crate) fn calculated_parameters(scalars: &[Scalar], refusals: &mut Refusals) {
    let of_parameter = |scalar: &Scalar| {
        matches!(
            scalar.causality,
            Some(Causality::Parameter | Causality::StructuralParameter | Causality::CalculatedParameter)
        )
    };
    for scalar in scalars.iter().filter(|scalar| scalar.causality == Some(Causality::CalculatedParameter)) {
        for (list, reads) in [("reads", &scalar.reads), ("initial_reads", &scalar.initial_reads)] {
            let read = reads.iter().flatten().map(|&read| &scalars[read]).find(|read| !of_parameter(read));
            if let Some(read) = read {
                let (name, read) = (&scalar.name, &read.name);
                let reason =
                    format!("{name}: a calculatedParameter reads '{read}', which is not a parameter");
                refusals.add(format!("{}.{list}", scalar.key), reason);
                break;
            }
        }
    }
}
