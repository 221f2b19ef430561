//! What is generated for a target without an operating system: the A2L, read by a parser of others, and the page of start
//! values; and what such a target refuses.

use std::fs;
use std::path::PathBuf;

use a2lfile::{A2lObjectName as _, Characteristic, CharacteristicType};
use fmu_export_build::{Interfaces, Package, Precision, generate_into};

use super::a2l::module;
use super::{folder, read};

/// A controller with one of each kind of parameters, measurements and conversions.
const MODEL: &str = r#"{
  "model_identifier": "Calibrated",
  "description": "A \"sampled\" controller",
  "enumerations": [{"name": "Mode", "items": [{"name": "off", "value": -2}, {"name": "on", "value": 5}]}],
  "variables": [
    {"name": "mode", "type": "Mode", "causality": "parameter", "variability": "tunable", "start": "on"},
    {"name": "count", "type": "Integer", "causality": "parameter", "min": -3, "max": 9, "start": -1},
    {"name": "enabled", "type": "Boolean", "causality": "parameter", "start": true},
    {"name": "limit temperature", "unit": "K", "display_unit": "degC", "causality": "parameter", "max": 373.15, "start": 293.15},
    {"name": "limit_temperature", "rust_name": "limit_difference", "unit": "K", "display_unit": "degC", "relative_quantity": true, "causality": "parameter",
     "start": 5},
    {"name": "measured", "unit": "Pa", "display_unit": "kPa", "causality": "input", "min": 0, "start": 1e5},
    {"name": "duty", "unit": "%", "causality": "output"},
    {"name": "duties", "unit": "%", "causality": "local", "dimensions": [3]},
    {"name": "block", "unit": "1", "causality": "parameter", "dimensions": [2, 3, 4], "start": 2},
    {"name": "units", "unit": ["m", "s"], "causality": "parameter", "dimensions": [2], "start": [1, 2]}
  ],
  "components": [{
    "name": "map",
    "variables": [
      {"name": "speed", "unit": "rpm", "causality": "parameter", "dimensions": [20], "start": 1},
      {"name": "pressure", "unit": "Pa", "display_unit": "kPa", "causality": "parameter", "dimensions": [30], "start": 1},
      {"name": "gain", "unit": "%", "causality": "parameter", "variability": "tunable", "dimensions": [30, 20],
       "axes": ["pressure", "map.speed"], "min": -1, "start": 0.5},
      {"name": "limit", "unit": "Pa", "causality": "parameter", "dimensions": [20], "axes": ["speed"], "start": 1}
    ]
  }]
}"#;

fn package() -> Package {
    Package { version: "1.2.3".to_owned(), is_bare_metal: true, ..Package::default() }
}

/// Generates the model of a package, into the folder of its name.
fn generate_for(package: &Package, name: &str, model: &str) -> Result<PathBuf, String> {
    let folder = folder(name);
    let file = folder.join("model.json");
    fs::write(&file, model).expect("the folder for tests is writable");
    let generated = generate_into(&file, &folder, package, Interfaces::CoSimulation);
    generated.map(|generated| generated.variables.with_file_name("")).map_err(|error| error.to_string())
}

fn generate(name: &str, model: &str) -> Result<PathBuf, String> {
    generate_for(&package(), name, model)
}

fn generated(name: &str) -> PathBuf {
    generate(name, MODEL).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn the_a2l_names_all_variables() {
    let module = module(&read(&generated("a2l").join("model.a2l")));
    let names: Vec<_> = module.characteristic.iter().map(|known| known.get_name().to_owned()).collect();
    // A space is no letter of an identifier, so that two names would be the same.
    let expected = [
        "mode",
        "count",
        "enabled",
        "limit_temperature",
        "limit_temperature_2",
        "block",
        "units[1]",
        "units[2]",
        "map.gain",
        "map.limit",
    ];
    assert_eq!(names, expected);
    let axes: Vec<_> =
        module.axis_pts.iter().map(|known| (known.get_name(), known.max_axis_points)).collect();
    assert_eq!(axes, [("map.speed", 20), ("map.pressure", 30)]);
    let measurements: Vec<_> = module.measurement.iter().map(|known| known.get_name().to_owned()).collect();
    assert_eq!(measurements, ["measured", "duty", "duties"]);
    let find = |name: &str| -> &Characteristic { &module.characteristic[name] };
    let kinds = ["mode", "block", "map.gain", "map.limit"].map(|name| find(name).characteristic_type);
    let expected = [
        CharacteristicType::Value,
        CharacteristicType::ValBlk,
        CharacteristicType::Map,
        CharacteristicType::Curve,
    ];
    assert_eq!(kinds, expected);
    // The first axis of an A2L is along a row.
    let axes: Vec<_> = find("map.gain")
        .axis_descr
        .iter()
        .map(|axis| axis.axis_pts_ref.as_ref().map(|points| points.axis_points.clone()))
        .collect();
    assert_eq!(axes, [Some("map.speed".to_owned()), Some("map.pressure".to_owned())]);
    let sizes = find("block").matrix_dim.as_ref().map(|sizes| sizes.dim_list.clone());
    assert_eq!(sizes, Some(vec![4, 3, 2]));
    // Limits as people see them.
    let limits = ["limit_temperature", "limit_temperature_2", "count", "mode", "enabled"]
        .map(|name| (find(name).lower_limit, find(name).upper_limit));
    assert_eq!(limits, [(f64::MIN, 100.0), (f64::MIN, f64::MAX), (-3.0, 9.0), (-2.0, 5.0), (0.0, 1.0)]);
    // Only tunable parameters change while the model runs.
    let are_fixed = ["mode", "map.gain", "map.limit", "count"].map(|name| find(name).read_only.is_some());
    assert_eq!(are_fixed, [false, false, true, true]);
}

#[test]
fn conversions_are_those_of_display_units() {
    let module = module(&read(&generated("conversions").join("model.a2l")));
    let shown = |name: &str, value: f64| {
        let known = &module.compu_method[&*module.characteristic[name].conversion];
        let linear = known.coeffs_linear.as_ref().map_or(value, |linear| linear.a * value + linear.b);
        (linear, known.unit.clone())
    };
    assert_eq!(shown("limit_temperature", 300.0), (300.0 - 273.15, "degC".to_owned()));
    assert_eq!(shown("limit_temperature_2", 5.0), (5.0, "degC".to_owned()), "a difference has no offset");
    assert_eq!(shown("map.gain", 0.5), (0.5, "%".to_owned()));
    let table =
        module.compu_method["VERBAL.Mode"].compu_tab_ref.as_ref().map(|table| table.conversion_table.clone());
    let items = &module.compu_vtab[&*table.expect("an enumeration has a table")].value_pairs;
    let items: Vec<_> = items.iter().map(|item| (item.in_val, item.out_val.as_str())).collect();
    assert_eq!(items, [(-2.0, "off"), (5.0, "on")]);
}

/// Names that differ in letters which an A2L has not.
#[test]
fn what_has_the_same_letters_has_names_of_its_own() {
    let items = |names: [&str; 2]| names.map(|name| format!(r#"{{"name": "{name}"}}"#)).join(", ");
    let variable = |name: &str, data_type: &str, start: &str| {
        format!(
            r#"{{"name": "{name}", "type": "{data_type}", "causality": "parameter", "start": "{start}"}}"#
        )
    };
    let component = |name: &str, inner: String| format!(r#"{{"name": "{name}", "variables": [{inner}]}}"#);
    let model = format!(
        r#"{{"model_identifier": "Letters", "enumerations": [
            {{"name": "Größe", "items": [{}]}}, {{"name": "Grüße", "items": [{}]}}],
            "variables": [{}, {}, {{"name": "y", "unit": "1", "causality": "output"}}], "components": [{}, {}]}}"#,
        items(["small", "large"]),
        items(["short", "long"]),
        variable("größe", "Größe", "large"),
        variable("grüße", "Grüße", "long"),
        component("maß", variable("x", "Größe", "small")),
        component("maü", variable("x", "Grüße", "short")),
    );
    let folder = generate("letters", &model).unwrap_or_else(|error| panic!("{error}"));
    let module = module(&read(&folder.join("model.a2l")));
    let first_items = ["gr__e", "gr__e_2", "ma_.x", "ma_.x_2"].map(|name| {
        let table = module.compu_method[&*module.characteristic[name].conversion].compu_tab_ref.as_ref();
        let table = &table.expect("an enumeration has a table").conversion_table;
        module.compu_vtab[&**table].value_pairs[0].out_val.clone()
    });
    assert_eq!(first_items, ["small", "short", "small", "short"]);
    let groups: Vec<_> = module.group.iter().map(|group| group.get_name().to_owned()).collect();
    assert_eq!(groups, ["model", "component.ma_", "component.ma__2"]);
}

/// Parameters and measurements have cells one after the other, each array as many as elements.
#[test]
fn cells_follow_each_other_and_have_the_start_values() {
    let folder = generated("cells");
    let text = read(&folder.join("model.a2l"));
    let link = |line: &str| -> (String, usize) {
        let (symbol, distance) = line.split_once("\" ").expect("a link has a distance");
        (symbol.to_owned(), distance.trim().parse().expect("a distance is a number"))
    };
    let links: Vec<_> =
        text.lines().filter_map(|line| line.trim().strip_prefix("SYMBOL_LINK \"")).map(link).collect();
    let of = |symbol: &str| -> Vec<usize> {
        links.iter().filter(|(known, _)| known == symbol).map(|(_, distance)| distance / 8).collect()
    };
    assert_eq!(of("CALIBRATION_PAGE"), [0, 1, 2, 3, 4, 5, 29, 30, 31, 51, 81, 681]);
    assert_eq!(of("MEASUREMENTS"), [0, 1, 2]);
    let page = fs::read(folder.join("start.page")).expect("there is a page");
    let (cells, rest) = page.as_chunks::<8>();
    assert_eq!((cells.len(), rest.len()), (701, 0));
    assert_eq!(i32::from_le_bytes(cells[0][..4].try_into().unwrap()), 5);
    assert_eq!(i32::from_le_bytes(cells[1][..4].try_into().unwrap()), -1);
    assert_eq!(cells[2], [1, 0, 0, 0, 0, 0, 0, 0]);
    let reals = [3, 4, 5, 28, 29, 30, 31, 81].map(|cell: usize| f64::from_le_bytes(cells[cell]));
    assert_eq!(reals.map(f64::to_bits), [293.15, 5.0, 2.0, 2.0, 1.0, 2.0, 1.0, 0.5].map(f64::to_bits));
}

/// There is no heap, and no function of the standard.
#[test]
fn the_interface_needs_no_operating_system() {
    let text = read(&generated("interface").join("variables.rs"));
    assert!(
        !text.contains("::std::")
            && !text.contains("export_functions")
            && text.contains("pub gain: [[T; 20]; 30],")
    );
    let package = Package { is_bare_metal: false, ..package() };
    let hosted = generate_for(&package, "hosted", MODEL).expect("the model is right");
    let text = read(&hosted.join("variables.rs"));
    assert!(
        text.contains("pub gain: ::std::boxed::Box<[[T; 20]; 30]>,") && !text.contains("mod calibration")
    );
    assert!(!hosted.join("model.a2l").exists());
}

/// Generates a model in a precision: the typed interface, and what others see, in which the GUID is left out, with the GUID.
fn in_precision(
    name: &str,
    model: &str,
    precision: Precision,
) -> Result<(String, [String; 3], String), String> {
    let generated = generate_for(&Package { precision, ..package() }, name, model)?;
    let text = read(&generated.join("variables.rs"));
    let seen = ["modelDescription.xml", "model.a2l", "index.html"].map(|file| read(&generated.join(file)));
    let (_, guid) = seen[0].split_once("guid=\"").expect("there is a GUID");
    let guid = guid.split('"').next().unwrap_or_default().to_owned();
    Ok((text, seen.map(|text| text.replace(&guid, "")), guid))
}

/// The numbers in the variables are `f32`, and what others see of them stays the same. States are integrated, and stay `f64`.
#[test]
fn a_model_computes_in_single_precision() {
    let [(double, seen_of_double, guid_of_double), (single, seen_of_single, guid_of_single)] = Precision::ALL
        .map(|precision| in_precision(precision.as_str(), MODEL, precision).expect("the model is right"));
    assert!(seen_of_single == seen_of_double);
    // Libraries of both must not get into one FMU.
    assert_ne!(guid_of_single, guid_of_double);
    assert!(double.contains("pub type Real = f64;") && double.contains("pub gain: [[T; 20]; 30],"));
    assert!(single.contains("pub type Real = f32;") && single.contains("pub gain: [[f32; 20]; 30],"));
    let state =
        r#""variables": [{"name": "x", "unit": "m", "causality": "output", "derivative": true, "start": 1},"#;
    let model = MODEL.replacen("\"variables\": [", state, 1);
    let (integrated, ..) = in_precision("integrated", &model, Precision::Single).expect("the model is right");
    assert!(integrated.contains("pub type Real = f64;") && integrated.contains("pub gain: [[T; 20]; 30],"));
}

/// A value at a bound is still within the range when it is rounded, and none becomes infinite.
#[test]
fn bounds_and_starts_fit_single_precision() {
    let model = |bounds: &str| {
        let inputs =
            format!(r#""variables": [{{"name": "x", "unit": "m", "causality": "input", {bounds}}},"#);
        MODEL.replacen("\"variables\": [", &inputs, 1)
    };
    for (bounds, expected) in [
        (r#""start": 0"#, [f32::MIN.into(), f32::MAX.into()]),
        (r#""min": -1, "start": 0"#, [-1.0, f32::MAX.into()]),
        (r#""min": 1e-5, "max": 1e40, "start": 1"#, [f64::from(1e-5_f32), f32::MAX.into()]),
        (r#""min": -1e300, "max": 0.1, "start": 0"#, [f32::MIN.into(), f64::from(0.1_f32)]),
    ] {
        let (text, ..) =
            in_precision("bounds", &model(bounds), Precision::Single).expect("the model is right");
        let [min, max] = expected;
        assert!(text.contains(&format!("RealInput {{ min: {min:?}, max: {max:?} }}")), "{bounds}");
    }
    let refusal =
        in_precision("start", &model(r#""start": 1e39"#), Precision::Single).expect_err("it is too large");
    assert!(refusal.ends_with("x: 1e39 is beyond the numbers of single precision"), "{refusal}");
    assert!(refusal.contains("variables[0].start"), "{refusal}");
}

#[test]
fn what_needs_an_operating_system_is_refused_by_name() {
    let with = |text: &str| MODEL.replacen("\"variables\": [", text, 1);
    let refused = |name: &str, model: &str| generate(name, model).expect_err("it needs an operating system");
    let string = with(
        r#""variables": [{"name": "file name", "type": "String", "causality": "parameter", "start": "a"},"#,
    );
    let refusal = refused("string", &string);
    assert!(
        refusal
            .ends_with("file name: a String needs memory from an operating system, which the target has not"),
        "{refusal}"
    );
    let model = with(r#""resources": "tables", "variables": ["#);
    let folder = folder("resources");
    fs::create_dir_all(folder.join("tables")).expect("the folder for tests is writable");
    let file = folder.join("model.json");
    fs::write(&file, model).expect("the folder for tests is writable");
    let refusal = generate_into(&file, &folder, &package(), Interfaces::CoSimulation)
        .expect_err("there are no files")
        .to_string();
    assert!(
        refusal.ends_with("resources: the target has no operating system with files: tables"),
        "{refusal}"
    );
}
