//! Rules on variables, one function each.

use std::collections::{BTreeMap, BTreeSet};

use fmu_package::Declared;
use fmu_package::xml::{flag, named};
use fmu_terms::{
    Causality, DataType, Initial, Interface, IntervalVariability, Variability, Version, Word, is_structured,
};

use crate::model::{Model, Variable};
use crate::report::{Report, Wrong};
use crate::rules::{
    ALIAS, CAUSALITY, CLOCK, CLOCKED, CONTINUOUS_TYPE, DERIVATIVE, DIMENSION, FINITE, INDEPENDENT, INITIAL,
    INTERMEDIATE_UPDATE, NAME_SYNTAX, NOMINAL, PREVIOUS, REINIT, START_COUNT, START_FORBIDDEN, START_MISSING,
    START_RANGE, STATE_NOMINAL, VALUE_REFERENCE, VARIABLE_NAME,
};
use crate::schema::number;
use crate::types::range;

pub(crate) fn check(model: &Model<'_>, report: &mut Report) {
    names(model, report);
    name_syntax(model, report);
    independent(model, report);
    for variable in &model.variables {
        let wrong = &mut |rule, message: String| report.add(rule, model.at(variable), message);
        continuous_type(variable, wrong);
        start_range(model, variable, wrong);
        values(model, variable, wrong);
        if variable.typed.has_attribute("min") || variable.typed.has_attribute("max") {
            range(variable.inherited("min"), variable.inherited("max"), model.at(variable), report);
        }
    }
    let states: BTreeSet<_> = model.states().collect();
    for (index, variable) in model.variables.iter().enumerate() {
        let wrong = &mut |rule, message: String| report.add(rule, model.at(variable), message);
        causality_and_start(model, variable, wrong);
        derivative(model, index, variable, wrong);
        reinit(model, variable, states.contains(&index), wrong);
        state_nominal(model, variable, states.contains(&index), wrong);
    }
    match model.version {
        Version::Two => aliases(model, report),
        Version::Three => fmi3(model, report),
    }
}

fn fmi3(model: &Model<'_>, report: &mut Report) {
    value_references(model, report);
    let mut previous_values = BTreeSet::new();
    for (index, variable) in model.variables.iter().enumerate() {
        let wrong = &mut |rule, message: String| report.add(rule, model.at(variable), message);
        dimensions(model, variable, wrong);
        clock(variable, wrong);
        clocked(model, variable, wrong);
        previous(model, index, variable, &mut previous_values, wrong);
        if flag(variable.element, "intermediateUpdate") && variable.variability != Variability::Continuous {
            wrong(&INTERMEDIATE_UPDATE, format!("it is {}", variable.variability));
        }
    }
}

fn names(model: &Model<'_>, report: &mut Report) {
    let mut seen = BTreeSet::new();
    for variable in &model.variables {
        let aliases = named(variable.element, "Alias").filter_map(|alias| alias.attribute("name"));
        for name in std::iter::once(variable.name).chain(aliases) {
            if name.is_empty() && variable.element.has_attribute("name") {
                report.add(&VARIABLE_NAME, model.at(variable), "the name is empty");
            } else if !name.is_empty() && !seen.insert(name) {
                report.add(&VARIABLE_NAME, model.at(variable), format!("another variable is named {name}"));
            }
        }
    }
}

fn name_syntax(model: &Model<'_>, report: &mut Report) {
    let must_be_structured = model.root.attribute("variableNamingConvention") == Some("structured");
    for variable in model.variables.iter().filter(|variable| !variable.name.is_empty()) {
        let name = variable.name;
        if must_be_structured && !is_structured(name) {
            report.add(&NAME_SYNTAX, model.at(variable), format!("'{name}' is not a structured name"));
        } else if name.contains(['\r', '\n', '\t']) {
            report.add(&NAME_SYNTAX, model.at(variable), "the name has tabs or line breaks");
        }
    }
}

fn independent(model: &Model<'_>, report: &mut Report) {
    let all: Vec<_> =
        model.variables.iter().filter(|variable| variable.causality == Causality::Independent).collect();
    if model.version == Version::Three && all.is_empty() {
        model.wrong(report, &INDEPENDENT, model.root, "no variable is independent");
    }
    for variable in all.iter().skip(1) {
        report.add(&INDEPENDENT, model.at(variable), format!("{} is also independent", all[0].name));
    }
    for variable in all.iter().filter(|variable| !variable.is_float()) {
        report.add(&INDEPENDENT, model.at(variable), format!("it is of the type {}", variable.kind()));
    }
}

fn value_references(model: &Model<'_>, report: &mut Report) {
    let mut seen = BTreeMap::new();
    for variable in &model.variables {
        let Some(reference) = variable.element.attribute("valueReference") else { continue };
        if let Some(first) = seen.insert(reference.trim(), variable.name) {
            report.add(
                &VALUE_REFERENCE,
                model.at(variable),
                format!("{first} also has the value reference {reference}"),
            );
        }
    }
}

fn continuous_type(variable: &Variable<'_>, wrong: Wrong<'_>) {
    if variable.variability == Variability::Continuous
        && !variable.is_float()
        && variable.causality != Causality::Independent
    {
        let how = if variable.element.has_attribute("variability") { "" } else { ", by default" };
        wrong(&CONTINUOUS_TYPE, format!("it is {}, and continuous{how}", variable.kind()));
    }
}

fn causality_and_start(model: &Model<'_>, variable: &Variable<'_>, wrong: Wrong<'_>) {
    // The schema check reports words it does not know.
    let (Some(causality), Some(variability)) = (variable.causality.meaning(), variable.variability.meaning())
    else {
        return;
    };
    let Some(allowed) = Initial::allowed(model.version, causality, variability) else {
        return wrong(&CAUSALITY, format!("{causality} and {variability} cannot be combined"));
    };
    let initial = variable.initial.meaning();
    if variable.element.has_attribute("initial") && initial.is_none_or(|initial| !allowed.contains(&initial))
    {
        if let Some(initial) = initial {
            let allowed: Vec<_> = allowed.iter().map(|initial| initial.as_str()).collect();
            let allowed = if allowed.is_empty() { "none".to_owned() } else { allowed.join(", ") };
            wrong(&INITIAL, format!("initial is {initial}; for {causality} and {variability}: {allowed}"));
        }
        return;
    }
    if variable.data_type == DataType::Clock {
        return;
    }
    let is_needed =
        matches!(initial, Some(Initial::Exact | Initial::Approx)) || causality == Causality::Input;
    let is_forbidden = initial == Some(Initial::Calculated) || causality == Causality::Independent;
    let role = match causality {
        Causality::Input | Causality::Independent => causality.as_str(),
        _ => initial.map_or("", Word::as_str),
    };
    match variable.start() {
        None if is_needed => wrong(&START_MISSING, format!("it is {role}, but has no start value")),
        Some(start) if is_forbidden => {
            wrong(&START_FORBIDDEN, format!("it is {role}, but has the start value '{start}'"));
        }
        _ => {}
    }
}

/// The numeric start values.
fn start_values<'d>(variable: &Variable<'d>) -> impl Iterator<Item = f64> + use<'d> {
    variable.typed.attribute("start").unwrap_or_default().split_ascii_whitespace().filter_map(number)
}

fn start_range(model: &Model<'_>, variable: &Variable<'_>, wrong: Wrong<'_>) {
    if matches!(
        variable.data_type.meaning(),
        Some(DataType::String | DataType::Boolean | DataType::Binary | DataType::Clock)
    ) {
        return;
    }
    let bound = |key, none| variable.inherited(key).and_then(number).unwrap_or(none);
    let (min, max) = (bound("min", f64::NEG_INFINITY), bound("max", f64::INFINITY));
    for start in start_values(variable).filter(|start| *start < min || *start > max) {
        wrong(&START_RANGE, format!("the start value is {start}, outside of {min} to {max}"));
    }
    let declared = variable.typed.attribute("declaredType").and_then(|name| model.type_named(name));
    let Some(enumeration) = declared.filter(|_| variable.data_type == DataType::Enumeration) else { return };
    let items: Vec<_> =
        named(enumeration, "Item").filter_map(|item| item.attribute("value").and_then(number)).collect();
    for start in start_values(variable).filter(|start| !items.contains(start)) {
        wrong(&START_RANGE, format!("the start value {start} is not an item of the enumeration"));
    }
}

fn values(model: &Model<'_>, variable: &Variable<'_>, wrong: Wrong<'_>) {
    let value = |key| variable.typed.attribute(key).and_then(number);
    if value("nominal") == Some(0.0) {
        wrong(&NOMINAL, "nominal is 0".to_owned());
    }
    let keys = ["start", "min", "max", "nominal"];
    for key in keys.into_iter().filter(|_| model.version == Version::Two && variable.is_float()) {
        if let Some(number) = value(key).filter(|number| !number.is_finite()) {
            wrong(&FINITE, format!("{key} is {number}"));
        }
    }
}

fn derivative(model: &Model<'_>, index: usize, variable: &Variable<'_>, wrong: Wrong<'_>) {
    let Some(reference) = variable.derivative else { return };
    let is_continuous =
        |variable: &Variable<'_>| variable.is_float() && variable.variability == Variability::Continuous;
    let message = match model.resolve(reference) {
        None => format!("derivative is {reference}, but there is no such variable"),
        Some(state) if state == index => "it is its own derivative".to_owned(),
        Some(state) if !is_continuous(&model.variables[state]) => {
            format!("it is the derivative of {}, which is not continuous", model.variables[state].name)
        }
        Some(_) if !is_continuous(variable) => "it is a derivative, but not continuous".to_owned(),
        Some(_) => return,
    };
    wrong(&DERIVATIVE, message);
}

fn reinit(model: &Model<'_>, variable: &Variable<'_>, is_state: bool, wrong: Wrong<'_>) {
    if !flag(variable.typed, "reinit") {
        return;
    }
    if !is_state {
        wrong(&REINIT, "it is not a continuous state".to_owned());
    } else if model.interface(Interface::ModelExchange).is_none() {
        wrong(&REINIT, "the FMU is not for Model Exchange".to_owned());
    }
}

/// Checks a state's nominal value, by which solvers scale its absolute tolerance.
fn state_nominal(model: &Model<'_>, variable: &Variable<'_>, is_state: bool, wrong: Wrong<'_>) {
    let nominal = variable.inherited("nominal").and_then(number);
    if let Some(nominal) = nominal.filter(|nominal| *nominal <= 0.0)
        && is_state
        && model.interface(Interface::ModelExchange).is_some()
    {
        wrong(&STATE_NOMINAL, format!("it is a state, but nominal is {nominal}"));
    }
}

/// The variables that share a value reference and a type.
fn alias_sets<'m, 'd>(model: &'m Model<'d>) -> impl Iterator<Item = Vec<&'m Variable<'d>>> {
    let mut sets: BTreeMap<_, Vec<_>> = BTreeMap::new();
    for variable in &model.variables {
        let is_enumeration = variable.data_type == DataType::Enumeration;
        let kind = if is_enumeration { "Integer" } else { variable.kind() };
        if let Some(reference) = variable.element.attribute("valueReference") {
            sets.entry((kind, reference.trim())).or_default().push(variable);
        }
    }
    sets.into_values()
}

fn aliases(model: &Model<'_>, report: &mut Report) {
    for set in alias_sets(model) {
        let (first, rest) = (set[0], &set[1..]);
        let is_constant = |variable: &Variable<'_>| variable.variability == Variability::Constant;
        let has_value = |variable: &Variable<'_>| !is_constant(variable) && variable.start().is_some();
        let mut with_value = set.iter().filter(|variable| has_value(variable));
        let start = with_value.next().map_or("", |variable| variable.name);
        let second = with_value.next().map_or("", |variable| variable.name);
        for variable in rest {
            let difference = if is_constant(variable) != is_constant(first) {
                "constant, but the other is not"
            } else if is_constant(variable) && variable.start() != first.start() {
                "a different constant"
            } else if variable.name == second {
                let message = format!("it has a start value, and so has its alias {start}");
                report.add(&ALIAS, model.at(variable), message);
                continue;
            } else if variable.inherited("unit") != first.inherited("unit") {
                "of a different unit"
            } else {
                continue;
            };
            report.add(&ALIAS, model.at(variable), format!("it is an alias of {}: {difference}", first.name));
        }
    }
}

fn dimensions(model: &Model<'_>, variable: &Variable<'_>, wrong: Wrong<'_>) {
    let mut size = Some(1_u64);
    for dimension in named(variable.element, "Dimension") {
        if variable.causality == Causality::StructuralParameter {
            wrong(&DIMENSION, "it is a structural parameter with a dimension".to_owned());
        }
        let length = match (dimension.attribute("start"), dimension.attribute("valueReference")) {
            (Some(start), None) => start.trim().parse().map_err(|_| format!("it is {start}")),
            (None, Some(reference)) => match model.resolve(reference).map(|index| &model.variables[index]) {
                None => Err(format!("there is no variable {reference}")),
                Some(of) if of.data_type != DataType::UInt64 => {
                    Err(format!("{} is of the type {}", of.name, of.kind()))
                }
                Some(of)
                    if of.causality != Causality::StructuralParameter
                        && of.variability != Variability::Constant =>
                {
                    Err(format!("{} is neither a structural parameter nor a constant", of.name))
                }
                Some(of) => of
                    .start()
                    .unwrap_or_default()
                    .trim()
                    .parse()
                    .map_err(|_| format!("{} has no start value", of.name)),
            },
            (Some(_), Some(_)) => Err("it has both start and valueReference".to_owned()),
            (None, None) => Err("it has neither start nor valueReference".to_owned()),
        };
        let length =
            length.and_then(|length| if length == 0 { Err("it is 0".to_owned()) } else { Ok(length) });
        match length {
            Ok(length) => size = size.and_then(|size| size.checked_mul(length)),
            Err(message) => {
                wrong(&DIMENSION, format!("a dimension is wrong: {message}"));
                size = None;
            }
        }
    }
    let elements = named(variable.element, "Start").count();
    let count = match variable.typed.attribute("start") {
        // Blanks belong to the text.
        Some(_) if variable.data_type == DataType::String => 1,
        Some(start) => start.split_ascii_whitespace().count(),
        None => elements,
    };
    if let Some(size) = size
        && variable.start().is_some()
        && count != 1
        && count as u64 != size
    {
        wrong(&START_COUNT, format!("it has {count} start values, but {size} elements"));
    }
}

fn clock(variable: &Variable<'_>, wrong: Wrong<'_>) {
    if variable.data_type != DataType::Clock {
        return;
    }
    let causality = variable.causality.meaning();
    if !matches!(causality, Some(Causality::Input | Causality::Output | Causality::Local)) {
        wrong(&CLOCK, format!("its causality is {}", variable.causality));
    }
    if variable.variability != Variability::Discrete {
        wrong(&CLOCK, format!("its variability is {}", variable.variability));
    }
    let interval = Declared::word(variable.typed.attribute("intervalVariability"));
    if variable.causality != Causality::Input && interval != IntervalVariability::Triggered {
        wrong(&CLOCK, format!("its intervalVariability is {interval}, but only inputs have intervals"));
    }
    if interval == IntervalVariability::Constant
        && !variable.typed.has_attribute("intervalDecimal")
        && !variable.typed.has_attribute("intervalCounter")
    {
        wrong(&CLOCK, "it is constant, but has no interval".to_owned());
    }
    for key in ["intervalDecimal", "intervalCounter", "resolution", "shiftDecimal"] {
        let value = variable.typed.attribute(key).and_then(number);
        let may_be_zero = key.starts_with("shift");
        if let Some(value) = value.filter(|value| *value < 0.0 || *value == 0.0 && !may_be_zero) {
            wrong(&CLOCK, format!("{key} is {value}"));
        }
        if value.is_some()
            && !may_be_zero
            && !interval.meaning().is_some_and(IntervalVariability::is_periodic)
        {
            wrong(&CLOCK, format!("it has {key}, but is {interval}"));
        }
    }
}

fn clocked(model: &Model<'_>, variable: &Variable<'_>, wrong: Wrong<'_>) {
    let Some(clocks) = variable.element.attribute("clocks") else { return };
    for reference in clocks.split_ascii_whitespace() {
        let clock = model.resolve(reference).map(|index| &model.variables[index]);
        if clock.is_none_or(|clock| clock.data_type != DataType::Clock) {
            wrong(&CLOCKED, format!("the variable {reference} in its clocks is not a Clock"));
        }
    }
    if !matches!(variable.variability.meaning(), Some(Variability::Discrete | Variability::Tunable)) {
        wrong(&CLOCKED, format!("it is clocked, but {}", variable.variability));
    }
}

fn previous<'d>(
    model: &Model<'d>,
    index: usize,
    variable: &Variable<'d>,
    seen: &mut BTreeSet<usize>,
    wrong: Wrong<'_>,
) {
    let Some(reference) = variable.element.attribute("previous") else { return };
    let message = match model.resolve(reference) {
        _ if !variable.is_clocked() => "it has no clocks".to_owned(),
        _ if variable.variability != Variability::Discrete => format!("it is {}", variable.variability),
        None => format!("there is no variable {reference}"),
        Some(other) if other == index => "it is its own previous value".to_owned(),
        Some(other) if !seen.insert(other) => {
            format!("{} is the previous value of another variable", model.variables[other].name)
        }
        Some(other) => {
            let other = &model.variables[other];
            let is_right = other.kind() == variable.kind()
                && other.variability == Variability::Discrete
                && other.causality != Causality::Input;
            if is_right {
                return;
            }
            format!("{} is {} {} {}", other.name, other.causality, other.variability, other.kind())
        }
    };
    wrong(&PREVIOUS, format!("its previous is wrong: {message}"));
}
