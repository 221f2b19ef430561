//! Rules on the model structure, one function each.

use std::collections::{BTreeMap, BTreeSet};

use fmu_terms::{Causality, DataType, Initial, Variability, Version, Word};

use crate::model::{Entry, Model};
use crate::report::{Report, Wrong};
use crate::rules::{
    CLOCKED_STATES, DEPENDENCY_KIND, DEPENDENCY_KIND_USE, DEPENDENCY_KNOWN, DEPENDENCY_ORDER, DERIVATIVES,
    EVENT_INDICATORS, INITIAL_UNKNOWNS, OUTPUTS, Rule, STRUCTURE_DUPLICATE, STRUCTURE_ORDER,
    STRUCTURE_REFERENCE,
};

pub(crate) fn check(model: &Model<'_>, report: &mut Report) {
    if !model.root.children().any(|child| child.has_tag_name("ModelStructure")) {
        return;
    }
    let states: BTreeSet<_> = model.states().collect();
    for entry in &model.entries {
        let wrong = &mut |rule, message: String| report.add(rule, model.xml.at(entry.element), message);
        references(model, entry, wrong);
        dependencies(model, entry, wrong);
        kinds(model, entry, wrong);
        knowns(model, entry, &states, wrong);
    }
    duplicates(model, report);
    order(model, report);
    outputs(model, report);
    derivatives(model, report);
    initial_unknowns(model, &states, report);
    if model.version == Version::Three {
        clocked_states(model, report);
        event_indicators(model, report);
    }
}

fn references(model: &Model<'_>, entry: &Entry<'_>, wrong: Wrong<'_>) {
    let dependencies = entry.element.attribute("dependencies").unwrap_or_default().split_ascii_whitespace();
    for reference in std::iter::once(entry.reference).chain(dependencies) {
        // The schema check reports non-numbers.
        if reference.trim().parse::<u32>().is_ok() && model.resolve(reference).is_none() {
            wrong(&STRUCTURE_REFERENCE, format!("there is no variable {reference}"));
        }
    }
}

fn dependencies(model: &Model<'_>, entry: &Entry<'_>, wrong: Wrong<'_>) {
    let Some(dependencies) = &entry.dependencies else { return };
    let distinct: BTreeSet<_> = dependencies.iter().collect();
    if distinct.len() < dependencies.len() {
        wrong(&STRUCTURE_DUPLICATE, "a dependency occurs twice".to_owned());
    } else if model.version == Version::Two && !dependencies.is_sorted() {
        wrong(&DEPENDENCY_ORDER, "the dependencies are not sorted".to_owned());
    }
}

fn kinds(model: &Model<'_>, entry: &Entry<'_>, wrong: Wrong<'_>) {
    let Some(kinds) = entry.element.attribute("dependenciesKind") else { return };
    let kinds: Vec<_> = kinds.split_ascii_whitespace().collect();
    let Some(dependencies) = entry.element.attribute("dependencies") else {
        return wrong(&DEPENDENCY_KIND, "there are no dependencies".to_owned());
    };
    let count = dependencies.split_ascii_whitespace().count();
    if count != kinds.len() {
        return wrong(&DEPENDENCY_KIND, format!("there are {count} dependencies, but {} kinds", kinds.len()));
    }
    let is_float = entry.variable.is_none_or(|index| model.variables[index].is_float());
    for kind in kinds {
        let is_initial = entry.list == "InitialUnknown";
        let is_variability = matches!(
            Variability::of(kind),
            Some(Variability::Fixed | Variability::Tunable | Variability::Discrete)
        );
        if is_variability && is_initial || kind != "dependent" && !is_float {
            let of = if is_float { "an initial unknown" } else { "a variable that is not floating-point" };
            return wrong(&DEPENDENCY_KIND_USE, format!("the kind {kind} is not allowed for {of}"));
        }
    }
}

/// Section 2.2.8 of FMI 2.0.5 and 2.4.8 of FMI 3.0.2. Parameters are knowns in FMI 3 only.
fn knowns(model: &Model<'_>, entry: &Entry<'_>, states: &BTreeSet<usize>, wrong: Wrong<'_>) {
    let is_known = |index: usize| {
        let known = &model.variables[index];
        match (entry.list, known.causality.meaning()) {
            (_, Some(Causality::Input | Causality::Independent)) => true,
            ("InitialUnknown", _) => known.initial == Initial::Exact,
            (_, Some(Causality::Parameter | Causality::StructuralParameter)) => {
                model.version == Version::Three
            }
            // Discrete states and ticking Clocks are known only inside the FMU.
            _ => {
                states.contains(&index)
                    || model.version == Version::Three && known.variability == Variability::Discrete
            }
        }
    };
    let mut unknown = entry.dependencies.iter().flatten().filter(|&&index| !is_known(index));
    if let Some(&first) = unknown.next() {
        let name = model.variables[first].name;
        let more = match unknown.count() {
            0 => "which is not a known".to_owned(),
            more => format!("and {more} more, which are not knowns"),
        };
        wrong(&DEPENDENCY_KNOWN, format!("it depends on {name}, {more}"));
    }
}

fn duplicates(model: &Model<'_>, report: &mut Report) {
    let mut seen = BTreeSet::new();
    for entry in &model.entries {
        if let Some(index) = entry.variable.filter(|index| !seen.insert((entry.list, *index))) {
            let message = format!("{} occurs twice in this list", model.variables[index].name);
            model.wrong(report, &STRUCTURE_DUPLICATE, entry.element, message);
        }
    }
}

fn order(model: &Model<'_>, report: &mut Report) {
    if model.version != Version::Two {
        return;
    }
    let indices: Vec<_> =
        model.list("InitialUnknown").filter_map(|entry| Some((entry.variable?, entry))).collect();
    if let Some(pair) = indices.windows(2).find(|pair| pair[0].0 > pair[1].0) {
        let name = |place: usize| model.variables[pair[place].0].name;
        let message = format!("{} is declared before {}", name(1), name(0));
        model.wrong(report, &STRUCTURE_ORDER, pair[1].1.element, message);
    }
}

/// Reports variables that are missing from a list, or should not be in it.
fn compare(
    model: &Model<'_>,
    list: &'static str,
    expected: &BTreeSet<usize>,
    may_be: impl Fn(usize) -> bool,
    rule: &'static Rule,
    report: &mut Report,
) {
    let listed: BTreeSet<_> = model.list(list).filter_map(|entry| entry.variable).collect();
    for &index in expected.difference(&listed) {
        let variable = &model.variables[index];
        report.add(rule, model.at(variable), format!("the list of {list} lacks {}", variable.name));
    }
    for entry in model.list(list) {
        if let Some(index) = entry.variable.filter(|index| !expected.contains(index) && !may_be(*index)) {
            let message = format!("the list of {list} contains {}", model.variables[index].name);
            model.wrong(report, rule, entry.element, message);
        }
    }
}

fn outputs(model: &Model<'_>, report: &mut Report) {
    let expected = (0..model.variables.len())
        .filter(|&index| model.variables[index].causality == Causality::Output)
        .collect();
    compare(model, "Output", &expected, |_| false, &OUTPUTS, report);
}

fn derivatives(model: &Model<'_>, report: &mut Report) {
    let mut seen = BTreeMap::new();
    for entry in model.list("ContinuousStateDerivative") {
        let Some(variable) = entry.variable.map(|index| &model.variables[index]) else { continue };
        let state =
            variable.derivative.and_then(|state| model.resolve(state)).map(|index| &model.variables[index]);
        let first = variable.derivative.and_then(|state| seen.insert(state.trim(), variable.name));
        let message = match (state, first) {
            (None, _) if variable.derivative.is_none() => {
                format!("{} has no attribute derivative", variable.name)
            }
            (Some(state), _)
                if !matches!(state.causality.meaning(), Some(Causality::Local | Causality::Output)) =>
            {
                format!("its state {} is {}", state.name, state.causality)
            }
            // Another rule reports the same variable twice in the list.
            (Some(state), Some(first)) if first != variable.name => {
                format!("its state {} is also that of {first}", state.name)
            }
            _ => continue,
        };
        model.wrong(report, &DERIVATIVES, entry.element, message);
    }
}

fn initial_unknowns(model: &Model<'_>, states: &BTreeSet<usize>, report: &mut Report) {
    let derivatives: BTreeSet<_> =
        model.list("ContinuousStateDerivative").filter_map(|entry| entry.variable).collect();
    let is_expected = |&index: &usize| {
        let variable = &model.variables[index];
        let is_calculated = matches!(variable.initial.meaning(), Some(Initial::Approx | Initial::Calculated));
        let is_output = variable.causality == Causality::Output
            && variable.data_type != DataType::Clock
            && !variable.is_clocked();
        variable.causality == Causality::CalculatedParameter
            || is_calculated && (is_output || states.contains(&index) || derivatives.contains(&index))
    };
    let expected = (0..model.variables.len()).filter(is_expected).collect();
    // Clocks have no `initial`, and FMPy requires output Clocks.
    let may_be = |index: usize| {
        let variable = &model.variables[index];
        variable.is_clocked()
            || variable.causality == Causality::Output && variable.data_type == DataType::Clock
    };
    compare(model, "InitialUnknown", &expected, may_be, &INITIAL_UNKNOWNS, report);
}

fn clocked_states(model: &Model<'_>, report: &mut Report) {
    let has_previous = |&index: &usize| model.variables[index].element.has_attribute("previous");
    let expected = (0..model.variables.len()).filter(has_previous).collect();
    compare(model, "ClockedState", &expected, |_| false, &CLOCKED_STATES, report);
}

fn event_indicators(model: &Model<'_>, report: &mut Report) {
    for entry in model.list("EventIndicator") {
        let Some(variable) = entry.variable.map(|index| &model.variables[index]) else { continue };
        let is_one = variable.is_float() && variable.variability == Variability::Continuous;
        if !is_one || !matches!(variable.causality.meaning(), Some(Causality::Local | Causality::Output)) {
            let message = format!(
                "{} is {} {} {}",
                variable.name,
                variable.causality,
                variable.variability,
                variable.kind()
            );
            model.wrong(report, &EVENT_INDICATORS, entry.element, message);
        }
    }
}
