//! What is generated for a small model, and what is refused.
//!
//! The model, `vessels.json`, has one of everything. Its generated files are kept beside it, so
//! that every change of them is seen, and compiled into this test. After a wanted change they are
//! written anew with `FMU_EXPORT_BLESS=1 cargo test -p fmu-export-build --test generator`.

// Values are handed through, not computed: they are equal, not close.
#![allow(clippy::float_cmp)]

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use fmu_export::description::{Causality, DataType, Initial, Variability};
use fmu_export::{Inputs as _, Variables as _};
use fmu_export_build::{Generated, Interfaces, Package, generate_into};

mod defaults;
mod documentation;
mod interfaces;
mod readme;
mod refusals;
mod structure;

mod variables {
    include!("Vessels/variables.rs");
}

use variables::{
    FillMode, Parameters, SparePartsStates, StateGroups, States, StoresStates, Variables, VesselStates,
};

fn sources() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/generator")
}

/// An empty folder, another one at each call: tests run in parallel.
fn folder(name: &str) -> PathBuf {
    static FOLDERS: AtomicUsize = AtomicUsize::new(0);
    let number = FOLDERS.fetch_add(1, Ordering::Relaxed);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("build").join(format!("{number} {name}"));
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("the folder for tests is writable");
    folder
}

/// A folder with nothing but the small model.
fn folder_with_model(name: &str) -> PathBuf {
    let folder = folder(name);
    for file in ["vessels.json", "units.json", "vessels.html", "vessels.svg", "vessels.png"] {
        fs::copy(sources().join(file), folder.join(file)).expect("the folder for tests is writable");
    }
    folder
}

/// The package that the small model belongs to.
fn package() -> Package {
    Package { name: "small-model".to_owned(), version: "1.2.3".to_owned(), ..Package::default() }
}

fn read(file: &Path) -> String {
    fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()))
}

fn generate(out_dir: &Path) -> Generated {
    generate_into(&sources().join("vessels.json"), out_dir, &package(), Interfaces::CoSimulation)
        .unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn generated_files_equal_the_golden_files() {
    if env::var_os("FMU_EXPORT_BLESS").is_some() {
        generate(&sources());
    }
    let generated = generate(&folder("kept"));
    // The SVG is a figure of the page, and by its name the drawing of the icon.
    let beside = ["units.json", "vessels.html", "vessels.svg", "vessels.png", "vessels.svg"];
    assert_eq!(generated.sources, beside.map(|name| sources().join(name)));
    let kept = |file: &Path| {
        let name = file.file_name().expect("a file has a name");
        assert_eq!(fs::read(file).ok(), fs::read(sources().join("Vessels").join(name)).ok(), "{name:?}");
    };
    kept(&generated.model_description);
    kept(&generated.variables);
    kept(&generated.documentation);
    kept(&generated.icon.expect("the JSON names one"));
    kept(&generated.drawing.expect("there is one"));
    kept(&generated.terminals.expect("the JSON has some"));
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
    // No unused unit, but the display units of those that are used.
    assert!(!xml.contains("degC") && xml.contains("\"mm\""));
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
            r#"<Real unit="kg" min="0.0" start="1e-5"/>"#,
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
        let package = Package { version: version.to_owned(), ..package() };
        let generated =
            generate_into(&sources().join("vessels.json"), &out_dir, &package, Interfaces::CoSimulation);
        let xml = read(&generated.expect("the model is sound").model_description);
        let (_, rest) = xml.split_once("guid=\"{").expect("there is a guid");
        rest[..36].to_owned()
    };
    assert_eq!(guid("1.2.3", "guid_1"), guid("1.2.3", "guid_2"));
    assert_ne!(guid("1.2.3", "guid_3"), guid("1.2.4", "guid_4"));
    assert!(Variables::DESCRIPTION.guid.contains(&guid("1.2.3", "guid_5")));
    assert!(Variables::MODEL_DESCRIPTION_XML.contains(Variables::DESCRIPTION.guid));
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
fn groups_of_states_are_converted_by_name() {
    let states = States::from_array([1.0, 2.0, 3.0]);
    let (stores, spare_parts) = (StoresStates::of(&states), SparePartsStates::of(&states));
    assert_eq!([stores.first.mass, stores.second.mass, spare_parts.settings.reserve], [1.0, 2.0, 3.0]);
    assert_eq!((StoresStates::NAMES, StoresStates::COUNT), (["first.mass", "second.mass"], 2));
    assert_eq!((stores.to_array(), StoresStates::from_array([1.0, 2.0])), ([1.0, 2.0], stores));
    assert_eq!(States::from_groups(StateGroups { stores, spare_parts }), states);
    assert_eq!(StoresStates::default().to_array(), [1e-5; 2]);
    // The masses declare a least value, the reserve a nominal one.
    assert_eq!((StoresStates::MIN.to_array(), StoresStates::NOMINAL.to_array()), ([0.0; 2], [1.0; 2]));
    let (least, nominal) = (SparePartsStates::MIN.to_array(), SparePartsStates::NOMINAL.to_array());
    assert_eq!((least, nominal), ([f64::NEG_INFINITY], [4.0]));
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
    variables.states_from_start();
    assert_eq!((variables.real(7), variables.states), (5.0, variables.start));
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
fn first_non_finite_names_states_derivatives_and_outputs() {
    let mut variables = Variables::default();
    variables.locals.first.outflow = f64::NAN;
    assert_eq!(variables.first_non_finite(), None);
    variables.outputs.drain = f64::NAN;
    assert_eq!(variables.first_non_finite(), Some(4));
    variables.derivatives.second.mass = f64::NAN;
    assert_eq!(variables.first_non_finite(), Some(12));
    variables.states.second.mass = f64::INFINITY;
    assert_eq!(variables.first_non_finite(), Some(11));
    // All are finite here, though their sum is not.
    let mut variables = Variables::default();
    (variables.states.first.mass, variables.states.second.mass) = (f64::MAX, -f64::MAX);
    assert_eq!(variables.first_non_finite(), None);
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
        assert!(Variables::MODEL_DESCRIPTION_XML.contains(&text), "{text}");
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
