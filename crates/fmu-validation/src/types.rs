//! Rules on units and declared types.

use std::collections::BTreeSet;

use fmu_package::xml::{Element, children, flag, named};

use crate::description::unique;
use crate::model::Model;
use crate::report::{Place, Report};
use crate::rules::{
    DISPLAY_UNIT, ENUMERATION_ITEM, RANGE, TYPE_DEFINED, TYPE_NAME, UNIT_DEFINED, UNIT_FACTOR, UNIT_NAME,
};
use crate::schema::number;

pub(crate) fn check(model: &Model<'_>, report: &mut Report) {
    units(model, report);
    names_of_types(model, report);
    for [declared, typed] in &model.types {
        items(model, *typed, report);
        unit(model, typed.attribute("unit"), typed.attribute("displayUnit"), model.xml.at(*declared), report);
        range(typed.attribute("min"), typed.attribute("max"), model.xml.at(*declared), report);
    }
    for variable in &model.variables {
        declared_type(model, variable.typed, model.at(variable), report);
        unit(
            model,
            variable.inherited("unit"),
            variable.inherited("displayUnit"),
            model.at(variable),
            report,
        );
        for alias in named(variable.element, "Alias") {
            let shown = alias.attribute("displayUnit");
            if shown.is_some() {
                unit(model, variable.inherited("unit"), shown, model.xml.at(alias), report);
            }
        }
    }
}

fn units(model: &Model<'_>, report: &mut Report) {
    unique(model, report, &UNIT_NAME, model.units.iter().copied(), "name");
    for definition in &model.units {
        unique(model, report, &UNIT_NAME, children(*definition), "name");
        for conversion in children(*definition) {
            let value = |key, default| conversion.attribute(key).and_then(number).unwrap_or(default);
            let (factor, offset) = (value("factor", 1.0), value("offset", 0.0));
            if !factor.is_finite() || factor == 0.0 || !offset.is_finite() {
                let message = format!("the factor is {factor}, the offset {offset}");
                model.wrong(report, &UNIT_FACTOR, conversion, message);
            }
            if flag(conversion, "inverse") && offset != 0.0 {
                model.wrong(
                    report,
                    &UNIT_FACTOR,
                    conversion,
                    format!("it is inverse and has the offset {offset}"),
                );
            }
        }
    }
}

fn names_of_types(model: &Model<'_>, report: &mut Report) {
    unique(model, report, &TYPE_NAME, model.types.iter().map(|[declared, _]| *declared), "name");
    let variables: BTreeSet<_> = model.variables.iter().map(|variable| variable.name).collect();
    for [declared, _] in &model.types {
        if let Some(name) = declared.attribute("name").filter(|name| variables.contains(name)) {
            model.wrong(report, &TYPE_NAME, *declared, format!("a variable is also named {name}"));
        }
    }
}

fn items(model: &Model<'_>, enumeration: Element<'_>, report: &mut Report) {
    for key in ["name", "value"] {
        let mut seen = BTreeSet::new();
        for item in named(enumeration, "Item") {
            if let Some(value) = item.attribute(key).filter(|value| !seen.insert(value.to_owned())) {
                report.add(&ENUMERATION_ITEM, model.xml.at(item), format!("the {key} {value} occurs twice"));
            }
        }
    }
}

fn unit(
    model: &Model<'_>,
    unit: Option<&str>,
    display_unit: Option<&str>,
    place: Place,
    report: &mut Report,
) {
    let definition = unit.and_then(|unit| model.unit_named(unit));
    if let (Some(unit), None) = (unit, definition) {
        return report.add(&UNIT_DEFINED, place, format!("the unit {unit} is not defined"));
    }
    let Some(display_unit) = display_unit else { return };
    let is_defined = definition
        .is_some_and(|unit| children(unit).any(|shown| shown.attribute("name") == Some(display_unit)));
    if !is_defined {
        let of =
            unit.map_or("but there is no unit".to_owned(), |unit| format!("which is not defined for {unit}"));
        report.add(&DISPLAY_UNIT, place, format!("the display unit is {display_unit}, {of}"));
    }
}

/// Reports a minimum greater than the maximum.
pub(crate) fn range(min: Option<&str>, max: Option<&str>, place: Place, report: &mut Report) {
    if let (Some(min), Some(max)) = (min.and_then(number), max.and_then(number))
        && min > max
    {
        report.add(&RANGE, place, format!("min is {min}, max {max}"));
    }
}

fn declared_type(model: &Model<'_>, typed: Element<'_>, place: Place, report: &mut Report) {
    let Some(name) = typed.attribute("declaredType") else { return };
    let kind = typed.tag_name().name();
    let message = match model.type_named(name) {
        None => format!("the type {name} is not defined"),
        // `Float64Type` in FMI 3.
        Some(declared) if declared.tag_name().name().trim_end_matches("Type") != kind => {
            format!("the type {name} is {}, the variable {kind}", declared.tag_name().name())
        }
        Some(_) => return,
    };
    report.add(&TYPE_DEFINED, place, message);
}
