//! The `build` feature: what is generated for a small model, and what is refused.
//!
//! The model, `build/vessels.json`, has one of everything. Its generated files are kept beside it, so
//! that every change of them is seen, and compiled into this test. After a wanted change they are
//! written anew with `FMI2_EXPORT_BLESS=1 cargo test -p fmi2-export --features build --test build`.

#![cfg(feature = "build")]
// Values are handed through, not computed: they are equal, not close.
#![allow(clippy::float_cmp)]

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

use fmi2_export::build::{Generated, generate_into};
use fmi2_export::description::{Causality, DataType, Initial, Variability};
use fmi2_export::{Inputs as _, Variables as _};
use serde_json::{Value, json};

mod variables {
    include!("build/Vessels/variables.rs");
}

use variables::{FillMode, Parameters, States, Variables, VesselStates};

fn sources() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/build")
}

/// An empty folder for one test.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("build").join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("the folder for tests is writable");
    folder
}

fn read(file: &Path) -> String {
    fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()))
}

fn generate(out_dir: &Path) -> Generated {
    generate_into(&sources().join("vessels.json"), out_dir, "1.2.3").unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn generated_files_are_the_kept_ones() {
    if env::var_os("FMI2_EXPORT_BLESS").is_some() {
        generate(&sources());
    }
    let generated = generate(&folder("kept"));
    assert_eq!(generated.units, sources().join("units.json"));
    for (file, name) in
        [(generated.model_description, "modelDescription.xml"), (generated.variables, "variables.rs")]
    {
        assert_eq!(read(&file), read(&sources().join("Vessels").join(name)), "{name}");
    }
}

/// The elements of a list in `ModelStructure`: index and dependencies.
fn unknowns(xml: &str, list: &str) -> Vec<(String, String)> {
    let (_, rest) = xml.split_once(&format!("<{list}>")).expect("the list is there");
    let (content, _) = rest.split_once(&format!("</{list}>")).expect("the list ends");
    content
        .lines()
        .filter(|line| line.contains("<Unknown"))
        .map(|line| {
            let attributes: Vec<_> = line.split('"').collect();
            assert_eq!([attributes[0].trim(), attributes[2].trim()], ["<Unknown index=", "dependencies="]);
            (attributes[1].to_owned(), attributes[3].to_owned())
        })
        .collect()
}

fn expected(unknowns: &[(&str, &str)]) -> Vec<(String, String)> {
    unknowns.iter().map(|&(index, dependencies)| (index.to_owned(), dependencies.to_owned())).collect()
}

/// Derived by hand from the model. The indices are: 1 time, 2 inflow, 3 enabled, 4 level, 5 drain,
/// 6 fills, 7 first.area, 8 first.mass, 9 its derivative, 10 first.outflow, 11 to 14 the same of second,
/// 15 settings.mode, 16 .label, 17 to 20 .table, 21 .gain, 22 .reserve (exact), 23 its derivative.
#[test]
fn dependencies_are_the_closure_of_reads() {
    let xml = read(&generate(&folder("dependencies")).model_description);
    // Inputs, states and time; parameters are none of the knowns of a step.
    assert_eq!(unknowns(&xml, "Outputs"), expected(&[("4", "8"), ("5", "3 12"), ("6", "")]));
    // The second vessel's derivative reads the first one's outflow, which reads its mass.
    assert_eq!(unknowns(&xml, "Derivatives"), expected(&[("9", "2 8"), ("13", "8 12"), ("23", "1 22")]));
    // Inputs, exact variables and time: approximate states are replaced by what they are computed from.
    let initial = [
        ("4", "7 15"),
        ("5", "3 11 15"),
        ("6", "1 15"),
        ("8", "7 15"),
        ("9", "2 7 15"),
        ("12", "11 15"),
        ("13", "7 11 15"),
        ("21", "17 18 19 20"),
        ("23", "1 17 18 19 20 22"),
    ];
    assert_eq!(unknowns(&xml, "InitialUnknowns"), expected(&initial));
}

/// Each element as the standard (sections 2.2.2 to 2.2.8, 4.3.1) asks for it.
#[test]
fn xml_says_what_the_json_says() {
    let xml = read(&generate(&folder("xml")).model_description);
    for part in [
        r#"<fmiModelDescription fmiVersion="2.0" modelName="Vessels" guid="{"#,
        r#"author="A. N. Author &amp; Co." version="1.2.3" copyright="None" license="MIT""#,
        r#"variableNamingConvention="structured">"#,
        r#"<CoSimulation modelIdentifier="Vessels" needsExecutionTool="false""#,
        r#"<BaseUnit kg="1" s="-1"/>"#,
        r#"<DisplayUnit name="g/s" factor="1000.0"/>"#,
        r#"<Item name="half_full" value="2" description="Half &quot;full&quot;"/>"#,
        r#"<DefaultExperiment startTime="0.0" stopTime="10.0" stepSize="0.1"/>"#,
    ] {
        assert!(xml.contains(part), "{part}");
    }
    // Neither an unused unit nor an unused display unit.
    assert!(!xml.contains("degC") && !xml.contains("\"mm\""));
    let variable = |name: &str| {
        let (_, rest) = xml.split_once(&format!(r#"<ScalarVariable name="{name}" "#)).expect("it is there");
        let (attributes, rest) = rest.split_once(">\n").expect("it has content");
        let (content, _) = rest.split_once('\n').expect("it ends");
        (attributes.to_owned(), content.trim().to_owned())
    };
    let cases = [
        (
            "time",
            r#"valueReference="0" description="Time" causality="independent" variability="continuous""#,
            r#"<Real unit="s"/>"#,
        ),
        (
            "inflow",
            r#"valueReference="1" description="Flow into the first vessel" causality="input" variability="continuous""#,
            r#"<Real unit="kg/s" displayUnit="g/s" min="0.0" max="10.0" start="0.5"/>"#,
        ),
        (
            "enabled",
            r#"valueReference="2" description="Whether anything leaves" causality="input" variability="discrete""#,
            r#"<Boolean start="true"/>"#,
        ),
        (
            "level",
            r#"valueReference="3" description="Level of the first vessel" causality="output" variability="continuous" initial="calculated""#,
            r#"<Real unit="m" nominal="2.0"/>"#,
        ),
        (
            "fills",
            r#"valueReference="5" description="How often it was filled" causality="output" variability="discrete" initial="calculated""#,
            r#"<Integer min="-1" max="100"/>"#,
        ),
        (
            "second.area",
            r#"valueReference="10" description="Second vessel: Cross section" causality="parameter" variability="fixed" initial="exact""#,
            r#"<Real unit="m2" min="0.1" start="0.75"/>"#,
        ),
        (
            "first.mass",
            r#"valueReference="7" description="First vessel: Contents" causality="local" variability="continuous" initial="approx""#,
            r#"<Real unit="kg" start="1e-5"/>"#,
        ),
        (
            "der(first.mass)",
            r#"valueReference="8" description="First vessel: Rate of change of the contents" causality="local" variability="continuous" initial="calculated""#,
            r#"<Real unit="kg/s" derivative="8"/>"#,
        ),
        (
            "settings.mode",
            r#"valueReference="14" description="Settings: Start" causality="parameter" variability="fixed" initial="exact""#,
            r#"<Enumeration declaredType="FillMode" start="2"/>"#,
        ),
        (
            "settings.label",
            r#"valueReference="15" description="Settings: Label [any] text" causality="parameter" variability="tunable" initial="exact""#,
            r#"<String start="a &lt;b&gt;"/>"#,
        ),
        (
            "settings.table[2,1]",
            r#"valueReference="18" description="Settings: Table" causality="parameter" variability="fixed" initial="exact""#,
            r#"<Real unit="1" start="3.0"/>"#,
        ),
        (
            "settings.gain",
            r#"valueReference="20" description="Settings: Its determinant" causality="calculatedParameter" variability="fixed" initial="calculated""#,
            r#"<Real unit="1"/>"#,
        ),
        (
            "der(settings.reserve)",
            r#"valueReference="22" description="Time derivative of settings.reserve" causality="local" variability="continuous" initial="calculated""#,
            r#"<Real unit="m/s2" derivative="22"/>"#,
        ),
    ];
    for (name, attributes, content) in cases {
        assert_eq!(variable(name), (attributes.to_owned(), content.to_owned()), "{name}");
    }
}

#[test]
fn guid_follows_the_content() {
    let guid = |version: &str, name: &str| {
        let out_dir = folder(name);
        let generated = generate_into(&sources().join("vessels.json"), &out_dir, version);
        let xml = read(&generated.expect("the model is sound").model_description);
        let (_, rest) = xml.split_once("guid=\"{").expect("there is a guid");
        rest[..36].to_owned()
    };
    assert_eq!(guid("1.2.3", "guid_1"), guid("1.2.3", "guid_2"));
    assert_ne!(guid("1.2.3", "guid_3"), guid("1.2.4", "guid_4"));
    assert!(Variables::DESCRIPTION.guid.contains(&guid("1.2.3", "guid_5")));
    assert!(Variables::DESCRIPTION.xml.contains(Variables::DESCRIPTION.guid));
}

#[test]
fn structs_start_with_the_start_values() {
    let variables = Variables::default();
    let parameters = &variables.parameters;
    assert_eq!([parameters.first.area, parameters.second.area], [0.5, 0.75]);
    assert_eq!(parameters.settings.mode, FillMode::HalfFull);
    assert_eq!(parameters.settings.label, "a <b>");
    assert_eq!(parameters.settings.table, [[1.0, 2.0], [3.0, 4.0]]);
    assert_eq!(*parameters, Parameters::default());
    assert!(variables.inputs().enabled);
    assert_eq!(variables.states.to_array(), [1e-5, 1e-5, 3.0]);
    assert_eq!(States::NAMES, ["first.mass", "second.mass", "settings.reserve"]);
    let states = States::from_array([1.0, 2.0, 3.0]);
    assert_eq!(states.second, VesselStates { mass: 2.0 });
    assert_eq!(states.to_array(), [1.0, 2.0, 3.0]);
}

#[test]
fn accessors_reach_the_fields() {
    let mut variables = Variables::default();
    // settings.table[2,1]
    variables.set_real(18, 7.0);
    assert_eq!(variables.parameters.settings.table, [[1.0, 2.0], [7.0, 4.0]]);
    assert_eq!(variables.real(18), 7.0);
    // A state is set where it starts and read where it is.
    variables.set_real(7, 5.0);
    assert_eq!(
        [variables.start.first.mass, variables.states.first.mass, variables.real(7)],
        [5.0, 1e-5, 1e-5]
    );
    variables.derivatives.first.mass = 8.0;
    assert_eq!(variables.real(8), 8.0);
    variables.set_integer(14, 1);
    assert_eq!((variables.parameters.settings.mode, variables.integer(14)), (FillMode::Empty, 1));
    variables.set_integer(14, 3);
    assert_eq!(variables.parameters.settings.mode, FillMode::Empty);
    variables.set_boolean(2, false);
    assert!(!variables.boolean(2) && !variables.inputs().enabled);
    variables.set_string(15, "other");
    assert_eq!(variables.string(15), "other");
    // Outputs are not set, and other types' references do nothing.
    variables.set_real(3, 1.0);
    variables.set_real(14, 1.0);
    assert_eq!([variables.outputs.level, variables.real(14), variables.real(99)], [0.0; 3]);

    let mut inputs = *variables.inputs();
    inputs.set_real(0, 2.5);
    assert_eq!([inputs.inflow, inputs.real(0)], [2.5, 2.5]);
    let bounds: Vec<_> = variables::Inputs::REALS.iter().map(|input| [input.min, input.max]).collect();
    assert_eq!(bounds, [[0.0, 10.0]]);
}

#[test]
fn first_non_finite_names_states_and_outputs() {
    let mut variables = Variables::default();
    variables.locals.first.outflow = f64::NAN;
    assert_eq!(variables.first_non_finite(), None);
    variables.states.second.mass = f64::INFINITY;
    assert_eq!(variables.first_non_finite(), Some(11));
    variables.outputs.drain = f64::NAN;
    assert_eq!(variables.first_non_finite(), Some(4));
}

#[test]
fn tables_agree_with_the_xml() {
    let description = Variables::DESCRIPTION;
    assert_eq!(description.model_identifier, "Vessels");
    assert_eq!(description.log_categories, ["logStatusError", "logStatusWarning", "logEvents"]);
    assert!(description.capabilities.interpolate_inputs && description.capabilities.get_and_set_state);
    assert_eq!(description.variables.len(), 23);
    for (reference, variable) in description.variables.iter().enumerate() {
        let text = format!(r#"<ScalarVariable name="{}" valueReference="{reference}""#, variable.name);
        assert!(description.xml.contains(&text), "{text}");
    }
    let inflow = &description.variables[1];
    assert_eq!(
        (inflow.data_type, inflow.causality, inflow.variability, inflow.initial, inflow.real_input),
        (DataType::Real, Causality::Input, Variability::Continuous, Initial::None, Some(0))
    );
    let mode = &description.variables[14];
    assert_eq!((mode.data_type, mode.min, mode.max), (DataType::Enumeration, 1.0, 2.0));
    let level = &description.variables[3];
    assert_eq!((level.min, level.max), (f64::NEG_INFINITY, f64::INFINITY));
}

/// What is said of the small model after an edit of it, without the folder.
fn refusal(name: &str, edit: impl FnOnce(&mut Value)) -> String {
    let mut model: Value = serde_json::from_str(&read(&sources().join("vessels.json"))).expect("it is JSON");
    edit(&mut model);
    refusal_of_text(name, &serde_json::to_string_pretty(&model).expect("it is JSON"), None)
}

fn refusal_of_text(name: &str, model: &str, units: Option<&str>) -> String {
    let folder = folder(name);
    let file = folder.join("vessels.json");
    fs::write(&file, model).expect("the folder for tests is writable");
    let units = units.map_or_else(|| read(&sources().join("units.json")), str::to_owned);
    fs::write(folder.join("units.json"), units).expect("the folder for tests is writable");
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
    use at::{ENABLED, INFLOW, MASS, RESERVE};
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
}

#[test]
fn wrong_start_values_are_refused() {
    use at::{AREA, ENABLED, FILLS, INFLOW, LABEL, LEVEL, MASS, MODE, OUTFLOW, RESERVE, TABLE};
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
    assert_refused(INFLOW, &json!({"start": "much"}), "variable 'inflow': start \"much\" is no Real");
    assert_refused(ENABLED, &json!({"start": 1}), "variable 'enabled': start 1 is no Boolean");
    assert_refused(
        MODE,
        &json!({"start": "full"}),
        "variable 'settings.mode': start 'full' is no item of FillMode",
    );
    assert_refused(MODE, &json!({"start": 1}), "variable 'settings.mode': start 1 is no FillMode");
    assert_refused(
        MODE,
        &json!({"type": "FullMode"}),
        "variable 'settings.mode': type 'FullMode' is none of Real, Integer, Boolean, String and the enumerations",
    );
    assert_refused(
        MODE,
        &json!({"type": "Integer", "start": 1.5}),
        "variable 'settings.mode': start 1.5 is no Integer",
    );
    assert_refused(
        LABEL,
        &json!({"start": "two\nlines"}),
        "variable 'settings.label': start contains a control character",
    );
    assert_refused(
        LABEL,
        &json!({"min": 0}),
        "variable 'settings.label': min and max are for Real and Integer, not String",
    );
    assert_refused(FILLS, &json!({"min": 0.5}), "variable 'fills': the bound 0.5 is no Integer");
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
        "variable 'settings.table': start [] is no Real",
    );
    assert_refused(TABLE, &json!({"dimensions": [2, 0]}), "variable 'settings.table': a dimension is 0");
}

#[test]
fn wrong_combinations_are_refused() {
    use at::{AREA, ENABLED, GAIN, INFLOW, LEVEL, MASS, OUTFLOW};
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
    let derivative = json!({"reads": []});
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
        "variable 'settings.gain': a calculatedParameter reads 'inflow', which is no parameter",
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
    use at::{INFLOW, MODE, OUTFLOW};
    let letters = "the name is not made of lower-case letters, digits and underscores";
    for name in ["Inflow", "1st", "in-flow", "in.flow", "", "_x", "größe", "x[1]"] {
        assert_refused(INFLOW, &json!({"name": name}), &format!("variable '{name}': {letters}"));
    }
    assert_refused(INFLOW, &json!({"name": "type"}), "variable 'type': the name is a reserved word of Rust");
    let duplicate = "there is another variable of this name";
    assert_refused(INFLOW, &json!({"name": "level"}), &format!("variable 'level': {duplicate}"));
    assert_refused(INFLOW, &json!({"name": "time"}), &format!("variable 'time': {duplicate}"));
    assert_refused(OUTFLOW, &json!({"name": "area"}), &format!("variable 'first.area': {duplicate}"));
    assert_refused(INFLOW, &json!({"name": "first"}), "variable 'first': a component has the same name");
    assert_refused(INFLOW, &json!({"description": " "}), "variable 'inflow': its text is empty");
    assert_refused(
        INFLOW,
        &json!({"description": "a\nb"}),
        "variable 'inflow': its text contains a control character, such as a line break",
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
        "variable 'settings.mode': type 'FillMode' is none of Real, Integer, Boolean, String and the enumerations",
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
    assert_refused("", &json!({"author": ""}), "'author': its text is empty");
    let no_outputs = refusal("no outputs", |model| {
        let variables = model["variables"].as_array_mut().expect("there are variables");
        variables.retain(|variable| variable["causality"] != "output");
    });
    assert_eq!(no_outputs, "vessels.json: there is no variable with causality 'output'");
}

/// Where in a text the first character of a part stands, in the words of serde.
fn place(text: &str, part: &str) -> String {
    let (before, _) = text.split_once(part).unwrap_or_else(|| panic!("{part} is not in the text"));
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(0, str::len) + 1;
    format!("line {line} column {column}")
}

/// What is no JSON of a model is refused with line, column and the variable around it.
#[test]
fn wrong_json_is_refused_where_it_is_wrong() {
    let text = read(&sources().join("vessels.json"));
    let refuse = |name: &str, from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        let edited = text.replacen(from, to, 1);
        (refusal_of_text(name, &edited, None), edited)
    };
    let (said, edited) =
        refuse("comma", r#"0.5, "description": "Flow into"#, r#"0.5 "description": "Flow into"#);
    let at = place(&edited, r#""description": "Flow into"#);
    assert_eq!(said, format!("vessels.json: expected `,` or `}}` at {at} (in 'inflow')"));

    // An unknown field is noticed at its closing quote.
    let (said, edited) = refuse("field", r#""nominal": 2"#, r#""nominals": 2"#);
    let at = place(&edited, r#"": 2, "reads""#);
    assert!(
        said.starts_with("vessels.json: unknown field `nominals`, expected one of `name`, `description`,")
    );
    assert!(said.ends_with(&format!(" at {at} (in 'level')")), "{said}");

    // A missing one where the object ends.
    let (said, edited) =
        refuse("missing", r#""start": true, "description": "Whether anything leaves"}"#, r#""start": true}"#);
    let at = place(&edited, "},\n    {\"name\": \"level\"");
    assert_eq!(said, format!("vessels.json: missing field `description` at {at} (in 'enabled')"));

    let (said, _) = refuse(
        "variant",
        r#""start": 0.5, "description": "Cross"#,
        r#""start": 0.5, "variability": "constant", "description": "Cross"#,
    );
    assert!(
        said.starts_with("vessels.json: unknown variant `constant`, expected one of `fixed`, `tunable`,")
    );
    assert!(said.ends_with("(in 'area')"), "{said}");

    // There is no NaN in JSON, and no number beyond the doubles.
    let (said, _) = refuse("nan", r#""nominal": 2"#, r#""nominal": NaN"#);
    assert!(said.ends_with("(in 'level')"), "{said}");
    let (said, _) = refuse("overflow", r#""nominal": 2"#, r#""nominal": 1e999"#);
    assert!(said.contains("number out of range"), "{said}");

    let (said, _) = refuse("twice", r#"{"area": 0.75}"#, r#"{"area": 0.75, "area": 0.8}"#);
    assert!(said.starts_with("vessels.json: \"area\" is given twice at "), "{said}");
    assert!(said.ends_with("(in 'second')"), "{said}");
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
