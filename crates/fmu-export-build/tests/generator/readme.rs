//! The reference of the JSON in the README: it names every key, and its examples are accepted.

use std::collections::BTreeSet;
use std::fs;

use fmu_export_build::{Interfaces, SCHEMA, generate_into};
use serde_json::{Value, json};

use super::{folder, package};

const README: &str = include_str!("../../README.md");

/// The keys of all objects that a schema describes.
fn keys(schema: &Value) -> BTreeSet<&str> {
    match schema {
        Value::Object(object) => {
            let own = object.get("properties").and_then(Value::as_object).into_iter().flatten();
            own.map(|(key, _)| key.as_str()).chain(object.values().flat_map(keys)).collect()
        }
        Value::Array(list) => list.iter().flat_map(keys).collect(),
        _ => BTreeSet::new(),
    }
}

#[test]
fn every_key_is_in_the_reference() {
    let schema: Value = serde_json::from_str(SCHEMA).expect("the schema is JSON");
    let keys = keys(&schema);
    assert!(keys.len() > 40, "{keys:?}");
    for key in keys {
        let named = [format!("`{key}`"), format!("\"{key}\":")];
        assert!(named.iter().any(|named| README.contains(named)), "{key}");
    }
}

/// The examples after the first are parts of a model: an excerpt without braces, a variable, a file of units.
#[test]
fn the_examples_are_accepted() {
    let folder = folder("readme");
    let examples: Vec<_> =
        README.split("```json\n").skip(1).filter_map(|block| block.split("```").next()).collect();
    assert_eq!(examples.len(), 8);
    for example in examples {
        let mut model: Value = serde_json::from_str(example)
            .or_else(|_| serde_json::from_str(&format!("{{{example}}}")))
            .expect("an example is JSON");
        if model.is_array() {
            fs::write(folder.join("units.json"), example).expect("the folder for tests is writable");
            let pressure = json!({"name": "p", "unit": "inHg/s", "display_unit": "bar/h"});
            model = json!({"units": "units.json", "variables": [pressure]});
        } else if model.get("name").is_some() {
            let state = |name| json!({"name": name, "unit": "kg", "start": 1, "derivative": true});
            model = json!({"variables": [model, state("mass"), state("area")]});
        }
        let inflow = json!({"name": "inflow", "causality": "input", "unit": "kg/s", "start": 0});
        let output = json!({"name": "sum", "causality": "output", "unit": "1"});
        let model_keys = model.as_object_mut().expect("it is an object");
        let variables =
            model_keys.entry("variables").or_insert(json!([])).as_array_mut().expect("it is a list");
        if variables.iter().all(|variable| variable["name"] != "inflow") {
            variables.extend([inflow, output]);
        }
        let file = folder.join("model.json");
        fs::write(&file, model.to_string()).expect("the folder for tests is writable");
        generate_into(&file, &folder, &package(), Interfaces::CoSimulation)
            .unwrap_or_else(|error| panic!("{example}: {error}"));
    }
}
