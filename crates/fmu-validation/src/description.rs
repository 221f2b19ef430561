//! Rules on the FMU as a whole: interfaces, identifiers, the default experiment.

use std::collections::BTreeSet;

use fmu_package::refuse_no_identifier;
use fmu_package::xml::{Element, flag, listed, named};
use fmu_terms::{Interface, Version};
use regex_lite::Regex;

use crate::model::Model;
use crate::report::Report;
use crate::rules::{
    CAPABILITY, DEFAULT_EXPERIMENT, EVENT_INDICATOR_COUNT, GENERATION_DATE, GUID, INTERFACE, LOG_CATEGORY,
    MODEL_IDENTIFIER, Rule,
};
use crate::schema::number;

pub(crate) fn check(model: &Model<'_>, report: &mut Report) {
    interfaces(model, report);
    identifiers(model, report);
    guid(model, report);
    event_indicator_count(model, report);
    generation_date(model, report);
    default_experiment(model, report);
    capabilities(model, report);
    let categories = listed(model.root, "LogCategories");
    unique(model, report, &LOG_CATEGORY, categories, "name");
}

/// Reports elements whose attribute has the same value as an earlier one's.
pub(crate) fn unique<'d>(
    model: &Model<'d>,
    report: &mut Report,
    rule: &'static Rule,
    elements: impl Iterator<Item = Element<'d>>,
    key: &str,
) {
    let mut seen = BTreeSet::new();
    for element in elements {
        if let Some(value) = element.attribute(key).filter(|value| !seen.insert(*value)) {
            model.wrong(report, rule, element, format!("the {key} '{value}' occurs twice"));
        }
    }
}

fn interfaces(model: &Model<'_>, report: &mut Report) {
    if model.interfaces.is_empty() {
        model.wrong(report, &INTERFACE, model.root, "no interface is declared");
    }
    let mut seen = BTreeSet::new();
    for interface in &model.interfaces {
        let name = interface.tag_name().name();
        if !seen.insert(name) {
            model.wrong(report, &INTERFACE, *interface, format!("{name} is declared twice"));
        }
    }
}

fn identifiers(model: &Model<'_>, report: &mut Report) {
    for element in &model.interfaces {
        let refused = element.attribute("modelIdentifier").map(refuse_no_identifier);
        if let Some(Err(error)) = refused {
            model.wrong(report, &MODEL_IDENTIFIER, *element, error.to_string());
        }
    }
}

fn guid(model: &Model<'_>, report: &mut Report) {
    let key = if model.version == Version::Three { "instantiationToken" } else { "guid" };
    if model.root.attribute(key).is_some_and(|guid| guid.trim().is_empty()) {
        model.wrong(report, &GUID, model.root, format!("the {key} is empty"));
    }
}

fn event_indicator_count(model: &Model<'_>, report: &mut Report) {
    let is_for_model_exchange =
        model.version == Version::Two && model.interface(Interface::ModelExchange).is_some();
    if is_for_model_exchange && !model.root.has_attribute("numberOfEventIndicators") {
        model.wrong(report, &EVENT_INDICATOR_COUNT, model.root, "there is no numberOfEventIndicators");
    }
}

fn generation_date(model: &Model<'_>, report: &mut Report) {
    let form = Regex::new(r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(Z|\+00:00)$").expect("the form is correct");
    if let Some(date) = model.root.attribute("generationDateAndTime").filter(|date| !form.is_match(date)) {
        model.wrong(report, &GENERATION_DATE, model.root, format!("generationDateAndTime is '{date}'"));
    }
}

fn default_experiment(model: &Model<'_>, report: &mut Report) {
    let Some(experiment) = named(model.root, "DefaultExperiment").next() else { return };
    let value = |key| experiment.attribute(key).and_then(number);
    for key in ["startTime", "stopTime", "stepSize", "tolerance"] {
        let Some(number) = value(key) else { continue };
        let is_time = key.ends_with("Time");
        if !number.is_finite() || !is_time && number <= 0.0 {
            let wanted = if is_time { "finite" } else { "positive and finite" };
            model.wrong(report, &DEFAULT_EXPERIMENT, experiment, format!("{key} is {number}, not {wanted}"));
        }
    }
    let (start, stop) = (value("startTime").unwrap_or(0.0), value("stopTime").unwrap_or(f64::INFINITY));
    if stop < start {
        let message = format!("stopTime is {stop}, before startTime, {start}");
        model.wrong(report, &DEFAULT_EXPERIMENT, experiment, message);
    }
}

fn capabilities(model: &Model<'_>, report: &mut Report) {
    let key = if model.version == Version::Three { "FMUState" } else { "FMUstate" };
    for interface in &model.interfaces {
        let (serialize, get) = (format!("canSerialize{key}"), format!("canGetAndSet{key}"));
        if flag(*interface, &serialize) && !flag(*interface, &get) {
            model.wrong(report, &CAPABILITY, *interface, format!("it has {serialize}, but not {get}"));
        }
    }
}
