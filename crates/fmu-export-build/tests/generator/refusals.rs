//! What is refused: the small model, broken in one place at a time, and the message that says so.

use std::fs;

use fmu_export_build::generate_into;
use serde_json::{Value, json};

use super::{folder_with_model, read, sources};

/// The message for the small model after an edit of it, without the folder.
fn refusal(name: &str, edit: impl FnOnce(&mut Value)) -> String {
    let mut model: Value = serde_json::from_str(&read(&sources().join("vessels.json"))).expect("it is JSON");
    edit(&mut model);
    refusal_of_text(name, &serde_json::to_string_pretty(&model).expect("it is JSON"), None)
}

fn refusal_of_text(name: &str, model: &str, units: Option<&str>) -> String {
    let folder = folder_with_model(name);
    let file = folder.join("vessels.json");
    fs::write(&file, model).expect("the folder for tests is writable");
    if let Some(units) = units {
        fs::write(folder.join("units.json"), units).expect("the folder for tests is writable");
    }
    match generate_into(&file, &folder, "1.2.3") {
        Ok(_) => "nothing was refused".to_owned(),
        Err(error) => {
            assert!(!folder.join("Vessels").exists(), "{name}: something was written");
            let message = error.to_string();
            message.replace(&format!("{}{}", folder.display(), std::path::MAIN_SEPARATOR), "")
        }
    }
}

/// The variables of the small model, for edits.
mod at {
    pub(super) const INFLOW: &str = "/variables/0";
    pub(super) const ENABLED: &str = "/variables/1";
    pub(super) const LEVEL: &str = "/variables/2";
    pub(super) const FILLS: &str = "/variables/4";
    pub(super) const AREA: &str = "/component_types/0/variables/0";
    pub(super) const MASS: &str = "/component_types/0/variables/1";
    pub(super) const OUTFLOW: &str = "/component_types/0/variables/2";
    pub(super) const MODE: &str = "/components/2/variables/0";
    pub(super) const LABEL: &str = "/components/2/variables/1";
    pub(super) const TABLE: &str = "/components/2/variables/2";
    pub(super) const GAIN: &str = "/components/2/variables/3";
    pub(super) const RESERVE: &str = "/components/2/variables/4";
}

/// Sets (or with null removes) fields of the object at a place in the small model, and compares what is
/// said of it.
fn assert_refused(place: &str, fields: &Value, message: &str) {
    let name: String = format!("refusal {place} {fields}")
        .chars()
        .map(|character| if character.is_ascii_alphanumeric() { character } else { '_' })
        .collect();
    let refusal = refusal(&name, |model| {
        let object = model.pointer_mut(place).and_then(Value::as_object_mut).expect("the place is there");
        for (key, value) in fields.as_object().expect("fields are an object") {
            if value.is_null() {
                object.remove(key);
            } else {
                object.insert(key.clone(), value.clone());
            }
        }
    });
    assert_eq!(refusal, format!("vessels.json: {message}"), "{place} {fields}");
}

#[test]
fn wrong_units_are_refused() {
    use at::{ENABLED, INFLOW, MASS, RESERVE, TABLE};
    assert_refused(
        INFLOW,
        &json!({"unit": "kg/h"}),
        "variable 'inflow': unit 'kg/h' is not defined in units.json",
    );
    assert_refused(
        INFLOW,
        &json!({"display_unit": "t/s"}),
        "variable 'inflow': unit 'kg/s' has no display unit 't/s' in units.json",
    );
    assert_refused(INFLOW, &json!({"unit": null}), "variable 'inflow': display unit 'g/s' without a unit");
    assert_refused(
        INFLOW,
        &json!({"unit": null, "display_unit": null}),
        "variable 'inflow': a Real needs a unit ('1' when it has no dimension)",
    );
    assert_refused(
        ENABLED,
        &json!({"unit": "1"}),
        "variable 'enabled': unit, display_unit and nominal are for Real, not Boolean",
    );
    assert_refused(
        MASS,
        &json!({"unit": "m2"}),
        "variable 'der(first.mass)': unit 'm2/s' is not defined in units.json",
    );
    assert_refused(
        RESERVE,
        &json!({"derivative": {"reads": []}}),
        "variable 'der(settings.reserve)': unit 'm/s/s' is not defined in units.json",
    );
    assert_refused(
        TABLE,
        &json!({"unit": ["1", "m", "1"]}),
        "variable 'settings.table': 3 units are listed; an array of as many elements has one for each",
    );
    assert_refused(
        TABLE,
        &json!({"unit": ["1", "m", "m2", "m3"]}),
        "variable 'settings.table[2,2]': unit 'm3' is not defined in units.json",
    );
    assert_refused(
        TABLE,
        &json!({"unit": ["1", "m", "1", "m"], "display_unit": "%"}),
        "variable 'settings.table': a display unit needs one unit, not a list",
    );
    assert_refused(
        INFLOW,
        &json!({"unit": ["kg/s"]}),
        "variable 'inflow': 1 units are listed; an array of as many elements has one for each",
    );
}

#[test]
fn wrong_start_values_are_refused() {
    use at::{AREA, ENABLED, INFLOW, LABEL, LEVEL, MASS, MODE, OUTFLOW, RESERVE};
    assert_refused(
        LEVEL,
        &json!({"start": 1}),
        "variable 'level': it is calculated, so it has no start value",
    );
    assert_refused(
        OUTFLOW,
        &json!({"start": 1}),
        "variable 'first.outflow': it is calculated, so it has no start value",
    );
    assert_refused(INFLOW, &json!({"start": null}), "variable 'inflow': it needs a start value");
    assert_refused(AREA, &json!({"start": null}), "variable 'first.area': it needs a start value");
    assert_refused(MASS, &json!({"start": null}), "variable 'first.mass': it needs a start value");
    assert_refused(RESERVE, &json!({"start": null}), "variable 'settings.reserve': it needs a start value");
    assert_refused(INFLOW, &json!({"start": 11}), "variable 'inflow': start 11.0 is outside 0.0..10.0");
    assert_refused(
        "/components/1/start",
        &json!({"area": 0.05}),
        "variable 'second.area': start 0.05 is outside 0.1..inf",
    );
    assert_refused(
        "/components/1/start",
        &json!({"volume": 1}),
        "variable 'second.volume': its component's 'start' names it, but the type has no such variable",
    );
    assert_refused(INFLOW, &json!({"min": 20}), "variable 'inflow': min 20.0 is greater than max 10.0");
    assert_refused(
        INFLOW,
        &json!({"start": "much"}),
        "variable 'inflow': start \"much\" is not of type Real",
    );
    // Words for what JSON has no number for, and a number that is not the word it stands for.
    for word in ["NaN", "inf", "-Infinity"] {
        let message = format!("variable 'inflow': start \"{word}\" is not of type Real");
        assert_refused(INFLOW, &json!({"start": word}), &message);
    }
    assert_refused(INFLOW, &json!({"start": true}), "variable 'inflow': start true is not of type Real");
    assert_refused(INFLOW, &json!({"start": -1}), "variable 'inflow': start -1.0 is outside 0.0..10.0");
    assert_refused(ENABLED, &json!({"start": 1}), "variable 'enabled': start 1 is not of type Boolean");
    assert_refused(
        ENABLED,
        &json!({"start": "true"}),
        "variable 'enabled': start \"true\" is not of type Boolean",
    );
    assert_refused(LABEL, &json!({"start": 1}), "variable 'settings.label': start 1 is not of type String");
    assert_refused(
        LABEL,
        &json!({"start": true}),
        "variable 'settings.label': start true is not of type String",
    );
    assert_refused(
        MODE,
        &json!({"start": "full"}),
        "variable 'settings.mode': start 'full' is not an item of FillMode",
    );
    assert_refused(MODE, &json!({"start": 1}), "variable 'settings.mode': start 1 is not of type FillMode");
    assert_refused(
        MODE,
        &json!({"type": "FullMode"}),
        "variable 'settings.mode': type 'FullMode' is not one of Real, Integer, Boolean, String and the enumerations",
    );
    assert_refused(
        MODE,
        &json!({"type": "Integer", "start": 1.5}),
        "variable 'settings.mode': start 1.5 is not of type Integer",
    );
    assert_refused(
        MODE,
        &json!({"type": "Integer", "start": 2_147_483_648_u32}),
        "variable 'settings.mode': start 2147483648 is not of type Integer",
    );
    assert_refused(
        MODE,
        &json!({"type": "Integer", "start": 3, "max": 2}),
        "variable 'settings.mode': start 3.0 is outside -inf..2.0",
    );
}

#[test]
fn start_values_that_do_not_fit_the_declaration_are_refused() {
    use at::{FILLS, INFLOW, LABEL, TABLE};
    assert_refused(FILLS, &json!({"min": 101}), "variable 'fills': min 101.0 is greater than max 100.0");
    assert_refused(TABLE, &json!({"max": 3}), "variable 'settings.table': start 4.0 is outside -inf..3.0");
    assert_refused(
        LABEL,
        &json!({"start": "two\nlines"}),
        "variable 'settings.label': start contains a character that XML does not keep, such as a line break",
    );
    assert_refused(
        LABEL,
        &json!({"min": 0}),
        "variable 'settings.label': min and max are for Real and Integer, not String",
    );
    assert_refused(FILLS, &json!({"min": 0.5}), "variable 'fills': the bound 0.5 is not of type Integer");
    assert_refused(INFLOW, &json!({"nominal": 0}), "variable 'inflow': nominal is not greater than 0");
    assert_refused(
        TABLE,
        &json!({"start": 1}),
        "variable 'settings.table': start is 1 where the dimensions ask for an array of 2",
    );
    assert_refused(
        TABLE,
        &json!({"start": [[1, 2], [3]]}),
        "variable 'settings.table': start has 1 elements where the dimensions ask for 2",
    );
    assert_refused(
        TABLE,
        &json!({"start": [[1, 2], [3, []]]}),
        "variable 'settings.table': start [] is not of type Real",
    );
    assert_refused(TABLE, &json!({"dimensions": [2, 0]}), "variable 'settings.table': a dimension is 0");
}

#[test]
fn wrong_combinations_are_refused() {
    use at::{AREA, ENABLED, FILLS, GAIN, INFLOW, LEVEL, MASS, OUTFLOW};
    for (place, variable, causality, variability) in [
        (AREA, "first.area", "parameter", "continuous"),
        (AREA, "first.area", "parameter", "discrete"),
        (GAIN, "settings.gain", "calculatedParameter", "discrete"),
        (INFLOW, "inflow", "input", "fixed"),
        (INFLOW, "inflow", "input", "tunable"),
        (LEVEL, "level", "output", "fixed"),
    ] {
        let message = format!(
            "variable '{variable}': FMI allows no causality '{causality}' with variability '{variability}'"
        );
        assert_refused(place, &json!({"variability": variability}), &message);
    }
    for data_type in ["Integer", "Boolean", "String", "FillMode"] {
        let message = format!("variable 'enabled': only a Real is continuous, not {data_type}");
        assert_refused(ENABLED, &json!({"variability": "continuous", "type": data_type}), &message);
    }
    assert_refused(
        FILLS,
        &json!({"variability": "continuous"}),
        "variable 'fills': only a Real is continuous, not Integer",
    );
    let derivative = json!({"reads": []});
    for (place, variable) in [(INFLOW, "inflow"), (AREA, "first.area"), (FILLS, "fills")] {
        let message = format!("variable '{variable}': only a local continuous Real has a 'derivative'");
        assert_refused(place, &json!({"derivative": derivative}), &message);
    }
    let message = "only a local continuous Real has a 'derivative'";
    assert_refused(LEVEL, &json!({"derivative": derivative}), &format!("variable 'level': {message}"));
    assert_refused(MASS, &json!({"variability": "discrete"}), &format!("variable 'first.mass': {message}"));
    assert_refused(
        MASS,
        &json!({"type": "Integer", "unit": null}),
        &format!("variable 'first.mass': {message}"),
    );
    assert_refused(INFLOW, &json!({"initial": "exact"}), "variable 'inflow': an input has no 'initial'");
    assert_refused(
        AREA,
        &json!({"initial": "approx"}),
        "variable 'first.area': a parameter's 'initial' is 'exact'",
    );
    assert_refused(
        MASS,
        &json!({"initial": "calculated"}),
        "variable 'first.mass': a state's 'initial' is 'approx' or 'exact'",
    );
    assert_refused(
        OUTFLOW,
        &json!({"initial": "exact"}),
        "variable 'first.outflow': the 'initial' of what is calculated and no state is 'calculated'",
    );
}

#[test]
fn wrong_dependencies_are_refused() {
    use at::{AREA, GAIN, INFLOW, LEVEL, MASS, OUTFLOW, RESERVE};
    let undeclared = "it is calculated from dependencies that are not declared: 'reads' is missing";
    assert_refused(LEVEL, &json!({"reads": null}), &format!("variable 'level': {undeclared}"));
    assert_refused(OUTFLOW, &json!({"reads": null}), &format!("variable 'first.outflow': {undeclared}"));
    assert_refused(GAIN, &json!({"reads": null}), &format!("variable 'settings.gain': {undeclared}"));
    assert_refused(
        MASS,
        &json!({"initial_reads": null}),
        "variable 'first.mass': it is a state whose start is computed, and has no 'initial_reads'",
    );
    assert_refused(
        RESERVE,
        &json!({"initial_reads": []}),
        "variable 'settings.reserve': its start is exact, so it reads nothing in initialization",
    );
    assert_refused(
        MASS,
        &json!({"reads": []}),
        "variable 'first.mass': it is a state: what its equation reads belongs to its 'derivative'",
    );
    assert_refused(
        AREA,
        &json!({"reads": []}),
        "variable 'first.area': it is set from outside, so it reads nothing",
    );
    assert_refused(
        INFLOW,
        &json!({"initial_reads": []}),
        "variable 'inflow': it is set from outside, so it reads nothing",
    );
    assert_refused(
        LEVEL,
        &json!({"reads": ["first.volume"]}),
        "variable 'level': it reads 'first.volume', which does not exist",
    );
    assert_refused(
        LEVEL,
        &json!({"reads": ["der(first.area)"]}),
        "variable 'level': it reads 'der(first.area)', which does not exist",
    );
    assert_refused(
        OUTFLOW,
        &json!({"initial_reads": ["volume"]}),
        "variable 'first.outflow': it reads 'volume', which does not exist",
    );
    assert_refused(
        OUTFLOW,
        &json!({"reads": ["{sink}"]}),
        "variable 'first.outflow': it reads '{sink}', but component 'first' has no such connection",
    );
    assert_refused(
        LEVEL,
        &json!({"reads": ["{source}"]}),
        "variable 'level': it reads '{source}', but connections are for components with a type",
    );
    assert_refused(
        "/components/1/connections",
        &json!({"source": "third.outflow"}),
        "variable 'der(second.mass)': it reads 'third.outflow', which does not exist",
    );
    assert_refused(
        "/components/1/connections",
        &json!({"sink": "inflow"}),
        "component 'second': connection 'sink' is read by no variable",
    );
    assert_refused(
        "/components/1/connections",
        &json!({"sink": "outflow"}),
        "component 'second': connection 'sink' names 'outflow', which does not exist",
    );
    assert_refused(
        GAIN,
        &json!({"reads": ["table", "inflow"]}),
        "variable 'settings.gain': a calculatedParameter reads 'inflow', which is not a parameter",
    );
}

/// A state breaks a circle; without one there is no order in which to compute.
#[test]
fn circles_are_refused() {
    use at::{LEVEL, OUTFLOW};
    assert_refused(
        LEVEL,
        &json!({"reads": ["drain", "level"]}),
        "variable 'level': it reads itself: level -> level",
    );
    assert_refused(
        OUTFLOW,
        &json!({"reads": ["{source}", "second.outflow"]}),
        "variable 'second.outflow': it reads itself: second.outflow -> first.outflow -> second.outflow",
    );
    // der(first.mass) reads outflow, so outflow must not read it.
    assert_refused(
        OUTFLOW,
        &json!({"reads": ["der(mass)"]}),
        "variable 'first.outflow': it reads itself: first.outflow -> der(first.mass) -> first.outflow",
    );
}

#[test]
fn wrong_names_are_refused() {
    use at::{GAIN, INFLOW, MODE, OUTFLOW, TABLE};
    let letters = "the name is not made of lower-case letters, digits and underscores";
    for name in
        ["Inflow", "INFLOW", "1st", "in-flow", "in.flow", "", "_x", "größe", "x[1]", "der(x)", "a b", "a\t"]
    {
        assert_refused(INFLOW, &json!({"name": name}), &format!("variable '{name}': {letters}"));
    }
    assert_refused(INFLOW, &json!({"name": "type"}), "variable 'type': the name is a reserved word of Rust");
    let duplicate = "there is another variable of this name";
    assert_refused(INFLOW, &json!({"name": "level"}), &format!("variable 'level': {duplicate}"));
    assert_refused(INFLOW, &json!({"name": "time"}), &format!("variable 'time': {duplicate}"));
    assert_refused(OUTFLOW, &json!({"name": "area"}), &format!("variable 'first.area': {duplicate}"));
    // An array's elements take its name, too.
    assert_refused(GAIN, &json!({"name": "table"}), &format!("variable 'settings.table': {duplicate}"));
    assert_refused(TABLE, &json!({"name": "label"}), &format!("variable 'settings.label': {duplicate}"));
    assert_refused(INFLOW, &json!({"name": "first"}), "variable 'first': a component has the same name");
    assert_refused(
        "/components/2",
        &json!({"name": "time"}),
        "variable 'time': a component has the same name",
    );
    assert_refused(MODE, &json!({"name": "Mode"}), &format!("variable 'settings.Mode': {letters}"));
    assert_refused("/components/1", &json!({"name": "first"}), "component 'first' is declared twice");
    assert_refused("/components/1", &json!({"name": "Second"}), &format!("component 'Second': {letters}"));
    assert_refused(
        "/components/1",
        &json!({"type": "Barrel"}),
        "component 'second': type 'Barrel' is not among the component_types",
    );
    assert_refused(
        "/components/1",
        &json!({"type": null}),
        "component 'second': it needs either 'variables' or a 'type'",
    );
    assert_refused(
        "/components/2",
        &json!({"start": {"table": 1}}),
        "component 'settings': 'start' and 'connections' are for components with a type",
    );
    assert_refused(
        "/component_types/0",
        &json!({"name": "vessel"}),
        "component type 'vessel': the name is not written like this: TypeName",
    );
    assert_refused(
        "/component_types/0",
        &json!({"name": "Settings"}),
        "component 'first': type 'Vessel' is not among the component_types",
    );
    assert_refused(
        "/enumerations/0",
        &json!({"name": "VesselStates"}),
        "variable 'settings.mode': type 'FillMode' is not one of Real, Integer, Boolean, String and the enumerations",
    );
    assert_refused(
        "/enumerations/0",
        &json!({"name": "Real"}),
        "enumeration 'Real': this is the name of a built-in type",
    );
    assert_refused("/enumerations/0", &json!({"items": []}), "enumeration 'FillMode' has no items");
    assert_refused(
        "/enumerations/0/items/0",
        &json!({"name": "half_full"}),
        "enumeration 'FillMode': item 'HalfFull' is declared twice",
    );
    assert_refused(
        "/enumerations/0/items/0",
        &json!({"name": "Empty"}),
        &format!("enumeration 'FillMode', item 'Empty': {letters}"),
    );
    for identifier in ["1st", "Ves sels", "Vessels-2", "", "Gefäße"] {
        assert_refused(
            "",
            &json!({"model_identifier": identifier}),
            &format!("model_identifier '{identifier}' is not an identifier of C"),
        );
    }
    let clash = refusal("clash of types", |model| {
        model["enumerations"][0]["name"] = json!("VesselStates");
        *model.pointer_mut(&format!("{MODE}/type")).expect("the mode has a type") = json!("VesselStates");
    });
    assert_eq!(clash, "vessels.json: the generated type 'VesselStates' is declared twice");
    let unused = refusal("unused type", |model| {
        let types = model["component_types"].as_array_mut().expect("there are types");
        types.push(json!({"name": "Pipe", "variables": []}));
    });
    assert_eq!(unused, "vessels.json: component type 'Pipe' has no component");
}

/// What XML 1.0 cannot carry, or only as something else.
#[test]
fn texts_that_xml_does_not_keep_are_refused() {
    use at::{INFLOW, LABEL, MASS};
    let lost = "contains a character that XML does not keep, such as a line break";
    for character in ['\0', '\u{1}', '\t', '\n', '\r', '\u{1f}', '\u{7f}', '\u{85}', '\u{fffe}', '\u{ffff}'] {
        let text = format!("a{character}b");
        let description = json!({"description": text});
        assert_refused(INFLOW, &description, &format!("variable 'inflow': its text {lost}"));
        assert_refused(LABEL, &json!({"start": text}), &format!("variable 'settings.label': start {lost}"));
    }
    let text = "a\u{1}b";
    let description = json!({"description": text});
    let mass = format!("variable 'first.mass': its text {lost}");
    assert_refused(MASS, &description, &mass);
    assert_refused(&format!("{MASS}/derivative"), &description, &mass);
    for (place, name) in [
        ("", "description"),
        ("/components/0", "first"),
        ("/enumerations/0", "FillMode"),
        ("/enumerations/0/items/0", "empty"),
        ("/log_categories/2", "logEvents"),
    ] {
        assert_refused(place, &description, &format!("'{name}': its text {lost}"));
        assert_refused(place, &json!({"description": " "}), &format!("'{name}': its text is empty"));
    }
    for name in ["author", "copyright", "license"] {
        assert_refused("", &json!({name: text}), &format!("'{name}': its text {lost}"));
        assert_refused("", &json!({name: ""}), &format!("'{name}': its text is empty"));
    }
    assert_refused(INFLOW, &json!({"description": " "}), "variable 'inflow': its text is empty");
    let category = refusal("log category", |model| {
        let categories = model["log_categories"].as_array_mut().expect("there are categories");
        categories.push(json!({"name": text, "description": "Another"}));
    });
    assert_eq!(category, format!("vessels.json: 'log_categories': its text {lost}"));
    // Half of a UTF-16 surrogate pair is not a character of Unicode either.
    let edited = read(&sources().join("vessels.json")).replacen("Flow into", "Flow \\ud800 into", 1);
    let message = refusal_of_text("surrogate", &edited, None);
    assert!(message.ends_with("(in 'inflow')"), "{message}");
}

#[test]
fn wrong_models_are_refused() {
    let experiment = "/default_experiment";
    let stop = "default_experiment: stop_time is not after start_time";
    assert_refused(experiment, &json!({"stop_time": 0}), stop);
    assert_refused(experiment, &json!({"stop_time": -1}), stop);
    let step = "default_experiment: step_size is not greater than 0";
    assert_refused(experiment, &json!({"step_size": 0}), step);
    assert_refused(experiment, &json!({"step_size": -0.1}), step);
    for (position, name) in ["logStatusError", "logStatusWarning", "logEvents"].into_iter().enumerate() {
        let message = format!("log_categories lacks '{name}', under which the runtime logs");
        assert_refused(&format!("/log_categories/{position}"), &json!({"name": "logAll"}), &message);
    }
    let twice = refusal("log category twice", |model| {
        let categories = model["log_categories"].as_array_mut().expect("there are categories");
        categories.push(json!({"name": "logEvents", "description": "Events"}));
    });
    assert_eq!(twice, "vessels.json: log category 'logEvents' is declared twice");
    let no_outputs = refusal("no outputs", |model| {
        let variables = model["variables"].as_array_mut().expect("there are variables");
        variables.retain(|variable| variable["causality"] != "output");
    });
    assert_eq!(no_outputs, "vessels.json: there is no variable with causality 'output'");
}

#[test]
fn wrong_groups_of_states_are_refused() {
    let (first, settings) = ("/components/0", "/components/2");
    let unknown = "component 'first': state_group 'stock' is not among the state_groups";
    assert_refused(first, &json!({"state_group": "stock"}), unknown);
    let missing = "variable 'first.mass': it is a state whose component has no 'state_group'";
    assert_refused(first, &json!({"state_group": null}), missing);
    let interface = json!({
        "causality": "local", "reads": null, "start": 1, "initial": "exact", "derivative": {"reads": []}
    });
    let missing = "variable 'level': it is a state whose component has no 'state_group'";
    assert_refused(at::LEVEL, &interface, missing);
    let empty = "state group 'spare_parts' has no component";
    assert_refused(settings, &json!({"state_group": "stores"}), empty);
    let stateless = refusal("stateless", |model| {
        model["components"][2]["variables"].as_array_mut().expect("there are variables").pop();
    });
    let expected = "component 'settings': it is in the state group 'spare_parts', but has no states";
    assert_eq!(stateless, format!("vessels.json: {expected}"));
    let place = "/state_groups/1";
    assert_refused(place, &json!({"name": "stores"}), "state group 'stores' is declared twice");
    let name = "state group 'Spare': the name is not made of lower-case letters, digits and underscores";
    assert_refused(place, &json!({"name": "Spare"}), name);
    assert_refused(place, &json!({"description": ""}), "'spare_parts': its text is empty");
    let type_name = "the generated type 'SettingsStates' is declared twice";
    let same = refusal("same type", |model| {
        model["state_groups"][1]["name"] = json!("settings");
        model["components"][2]["state_group"] = json!("settings");
    });
    assert_eq!(same, format!("vessels.json: {type_name}"));
}

/// Where in a text the first character of a part stands, in the words of serde.
fn place(text: &str, part: &str) -> String {
    let (before, _) = text.split_once(part).unwrap_or_else(|| panic!("{part} is not in the text"));
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(0, str::len) + 1;
    format!("line {line} column {column}")
}

/// Text that is not the JSON of a model is refused with line, column and the variable around it.
#[test]
fn wrong_json_is_refused_where_it_is_wrong() {
    let text = read(&sources().join("vessels.json"));
    let refuse = |name: &str, from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        let edited = text.replacen(from, to, 1);
        (refusal_of_text(name, &edited, None), edited)
    };
    let (message, edited) =
        refuse("comma", r#"0.5, "description": "Flow into"#, r#"0.5 "description": "Flow into"#);
    let at = place(&edited, r#""description": "Flow into"#);
    assert_eq!(message, format!("vessels.json: expected `,` or `}}` at {at} (in 'inflow')"));

    // An unknown field is noticed at its closing quote.
    let (message, edited) = refuse("field", r#""nominal": 2"#, r#""nominals": 2"#);
    let at = place(&edited, r#"": 2, "reads""#);
    assert!(
        message.starts_with("vessels.json: unknown field `nominals`, expected one of `name`, `description`,")
    );
    assert!(message.ends_with(&format!(" at {at} (in 'level')")), "{message}");

    // A missing one where the object ends.
    let (message, edited) =
        refuse("missing", r#""start": true, "description": "Whether anything leaves"}"#, r#""start": true}"#);
    let at = place(&edited, "},\n    {\"name\": \"level\"");
    assert_eq!(message, format!("vessels.json: missing field `description` at {at} (in 'enabled')"));

    let (message, _) = refuse("causality", r#""level", "causality": "output", "#, r#""level", "#);
    assert!(message.starts_with("vessels.json: missing field `causality` at "), "{message}");
    assert!(message.ends_with("(in 'level')"), "{message}");
    let (message, _) =
        refuse("independent", r#""level", "causality": "output""#, r#""level", "causality": "independent""#);
    assert!(message.starts_with("vessels.json: unknown variant `independent`, expected one of"), "{message}");

    let (message, _) = refuse(
        "variant",
        r#""start": 0.5, "description": "Cross"#,
        r#""start": 0.5, "variability": "constant", "description": "Cross"#,
    );
    assert!(
        message.starts_with("vessels.json: unknown variant `constant`, expected one of `fixed`, `tunable`,")
    );
    assert!(message.ends_with("(in 'area')"), "{message}");

    // There is no NaN in JSON, and no number beyond the doubles.
    for (number, reason) in [
        ("NaN", "expected value at "),
        ("Infinity", "expected value at "),
        ("-Infinity", "invalid number at "),
        ("1e999", "number out of range at "),
        ("-1e999", "number out of range at "),
    ] {
        for field in
            [r#""nominal": 2"#, r#""start": 0.5"#, r#""min": 0"#, r#""max": 10"#, r#""stop_time": 10"#]
        {
            let (key, _) = field.split_once(' ').expect("there is a value");
            let (message, _) = refuse(&format!("{number} {key}"), field, &format!("{key} {number}"));
            assert!(message.starts_with(&format!("vessels.json: {reason}")), "{message}");
        }
    }

    let (message, _) = refuse("twice", r#"{"area": 0.75}"#, r#"{"area": 0.75, "area": 0.8}"#);
    assert!(message.starts_with("vessels.json: \"area\" is given twice at "), "{message}");
    assert!(message.ends_with("(in 'second')"), "{message}");
}

#[test]
fn wrong_files_of_units_are_refused() {
    let text = read(&sources().join("vessels.json"));
    let refuse = |name: &str, units: &str| refusal_of_text(name, &text, Some(units));
    assert_eq!(
        refuse("unit twice", r#"[{"name": "s"}, {"name": "s"}]"#),
        "units.json: unit 's' is declared twice"
    );
    assert_eq!(
        refuse("display twice", r#"[{"name": "s", "display_units": [{"name": "h"}, {"name": "h"}]}]"#),
        "units.json: unit 's': display unit 'h' is declared twice"
    );
    let lost = "its text contains a character that XML does not keep, such as a line break";
    assert_eq!(refuse("unit empty", r#"[{"name": ""}]"#), "units.json: unit '': its text is empty");
    assert_eq!(
        refuse("unit control", r#"[{"name": "s\u0001"}]"#),
        format!("units.json: unit 's\u{1}': {lost}")
    );
    assert_eq!(
        refuse("display empty", r#"[{"name": "s", "display_units": [{"name": ""}]}]"#),
        "units.json: unit 's', display unit '': its text is empty"
    );
    assert_eq!(
        refuse("display control", r#"[{"name": "s", "display_units": [{"name": "h\u0000"}]}]"#),
        format!("units.json: unit 's', display unit 'h\0': {lost}")
    );
    assert_eq!(
        refuse("factor 0", r#"[{"name": "s", "base": {"s": 1}, "factor": 0}]"#),
        "units.json: unit 's': a factor is 0"
    );
    assert_eq!(
        refuse("factor of nothing", r#"[{"name": "s", "factor": 60}]"#),
        "units.json: unit 's': a factor or offset needs a 'base' to refer to"
    );
    // FMI's exponents are integers, of its eight base units.
    assert!(refuse("fraction", r#"[{"name": "s", "base": {"s": 0.5}}]"#).ends_with("(in 's')"));
    assert!(
        refuse("base unit", r#"[{"name": "s", "base": {"h": 1}}]"#)
            .starts_with("units.json: unknown variant `h`, expected one of `kg`, `m`, `s`, `A`, `K`")
    );
    assert_eq!(refuse("no s", "[]"), "vessels.json: variable 'time': unit 's' is not defined in units.json");
    let missing = refusal("no file", |model| model["units"] = json!("unit.json"));
    assert!(missing.starts_with("unit.json: "), "{missing}");
}
