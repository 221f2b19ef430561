//! Random declarations: what the build accepts, rustc compiles without a warning, whatever the names and texts in it are.
//!
//! Names are drawn from those of Rust, its standard library and the generated text. Needs cargo, so it is ignored by
//! default; the same declarations are tried each time. For others and more:
//! `RANDOM_DECLARATIONS=20000 cargo test --release -p fmu-export-build --test declarations -- --ignored`.

mod a2l;
mod random;

use std::collections::BTreeSet;
use std::env;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use fmu_export_build::{Fmi, Interfaces, Package, Precision, Version, generate_into};
use serde_json::{Value, json};

use random::Random;

/// How many declarations are tried, unless `RANDOM_DECLARATIONS` gives another number.
const COUNT: usize = 50;
/// How many modules are compiled at once.
const BATCH: usize = 500;

#[rustfmt::skip]
const NAMES: [&str; 85] = [
    "value", "values", "states", "parameters", "inputs", "outputs", "locals", "clocks", "start", "derivatives", "variables",
    "generated", "enumerations", "fmi", "fmu_export", "core", "std", "alloc", "self_", "archive", "other", "function",
    "number", "nested", "index", "time", "default", "map", "combine", "of", "from_array", "to_array", "from_groups", "groups",
    "names", "count", "item", "reference", "position", "sums", "reals", "find", "zero", "real", "string", "boolean", "f64",
    "i32", "u8", "bool", "str", "char", "usize", "union", "raw", "auto", "safe", "macro_rules", "t", "T", "C", "c", "x_1",
    "aB", "a_b", "HTTPPort", "vec", "some", "none", "format",
    // Such as other tools write.
    "in", "type", "self", "a.b.c", "a[2].b", "'it\\'s [1]'", "1st", "a b", "größe", "Größe", "-", "_", "熱", "a\u{308}", "<&>",
];

#[rustfmt::skip]
const RESERVED: [&str; 16] = [
    "yield", "self", "Self", "type", "gen", "async", "try", "match", "become", "priv", "final", "crate", "super", "static",
    "dyn", "unsized",
];

#[rustfmt::skip]
const TYPES: [&str; 46] = [
    "T", "S", "U", "Copy", "Clone", "Debug", "PartialEq", "Eq", "Fn", "FnMut", "FnOnce", "Vec", "String", "Option", "Some",
    "None", "Result", "Ok", "Err", "Box", "Default", "Iterator", "IntoIterator", "From", "Into", "TryFrom", "TryInto", "Send",
    "Sync", "Sized", "Drop", "ToOwned", "ToString", "AsRef", "Error", "Number", "Persistent", "RealInput", "Variables",
    "States", "StateGroups", "DESCRIPTION", "TStates", "AParameters", "Clocks", "Mode",
];

#[rustfmt::skip]
const ITEMS: [&str; 20] = [
    "self_", "some", "none", "ok", "err", "T", "a b", "a_c", "value", "from value", "vec", "x1", "DESCRIPTION", "Copy", "option",
    "default", "Clone", "sized", "item", "result",
];

#[rustfmt::skip]
const TEXTS: [&str; 19] = [
    "plain", "\"quotes\" and \\ \\u{41} \\n", "*/ /* // /// //!", "~~~", "    indented(", "`code` [link] <b>",
    "``` let x;", "{brace} {} {0:?}", "# heading", "é 熱 🎉", "\u{200f}right to left", "r#\"raw\"#", "' & &amp; ]]>",
    "- list", "1. list", "\u{2028}line", "\u{feff}mark", "two\r\nlines\tand",
    "\u{202e}turned",
];

/// The type of some Reals.
const REAL_TYPE: &str = "a 'type' of \"Reals\"";

impl Random {
    fn name(&mut self) -> String {
        match self.below(40) {
            0 => self.pick(&RESERVED).to_owned(),
            1..15 => {
                let letters = (0..=self.below(3)).map(|_| self.pick(&['a', 'b', 'B', 't', 'T', '_', '1']));
                format!("x{}", letters.collect::<String>())
            }
            _ => self.pick(&NAMES).to_owned(),
        }
    }

    /// Different names.
    fn names(&mut self, count: usize) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        while names.len() < count {
            let name = self.name();
            let key = |name: &str| name.replace('_', "").to_lowercase();
            // Now and then two that may be the same in Rust.
            if names.iter().all(|other| key(other) != key(&name)) || self.one_in(20) {
                names.push(name);
            }
        }
        names
    }

    /// Names of components, groups and event indicators.
    fn lower_names(&mut self, count: usize) -> Vec<String> {
        self.names(count).iter().map(|name| name.to_lowercase()).collect()
    }

    fn text(&mut self) -> Value {
        // The last one is refused.
        let count = if self.one_in(20) { TEXTS.len() } else { TEXTS.len() - 1 };
        self.pick(&TEXTS[..count]).into()
    }

    /// A start value of a type, with an array for each size.
    fn start(&mut self, data_type: &str, items: &[String], sizes: &[usize]) -> Value {
        match sizes.split_first() {
            Some((&size, inner)) => (0..size).map(|_| self.start(data_type, items, inner)).collect(),
            None => match data_type {
                "Real" | "Float32" => self.pick(&[0.0, 1.0, -2.5, 1e-7, 1e30]).into(),
                "Boolean" => self.one_in(2).into(),
                "String" => self.pick(&TEXTS).into(),
                "Binary" => self.pick(&["", "00ff"]).into(),
                "Integer" | "Int64" => self.pick(&[-7, 0, 2]).into(),
                "UInt64" | "UInt8" => self.pick(&[7, 0, 2]).into(),
                _ => items[self.below(items.len())].clone().into(),
            },
        }
    }

    fn variable(
        &mut self,
        name: &str,
        fmi3: bool,
        enumerations: &[(String, Vec<String>)],
        grouped: bool,
    ) -> Value {
        let mut types = vec!["Real"; 4];
        types.extend(["Integer", "Boolean", "String"]);
        types.extend(enumerations.iter().flat_map(|(name, _)| [name.as_str(); 2]));
        if fmi3 {
            types.extend(["Float32", "Int64", "UInt64", "UInt8", "Binary", "Clock"]);
        }
        let data_type = self.pick(&types);
        let mut variable = json!({"name": name, "type": data_type});
        if self.one_in(2) {
            variable["description"] = self.text();
        }
        if data_type == "Clock" {
            let is_input = self.one_in(2);
            variable["causality"] = (if is_input { "input" } else { "output" }).into();
            if is_input {
                variable["interval_variability"] = "triggered".into();
            }
            return variable;
        }
        if matches!(data_type, "Real" | "Float32") {
            variable["unit"] = self.pick(&["1", "m", "kg.m2/s2", "%"]).into();
        }
        if data_type == "Real" && self.one_in(4) {
            variable["type"] = REAL_TYPE.into();
        }
        let sizes: Vec<_> = match self.below(8) {
            0 => vec![1 + self.below(3)],
            1 => vec![1 + self.below(2), 1 + self.below(3)],
            // On the heap.
            2 if self.one_in(4) => vec![300],
            3 if self.one_in(4) => vec![20, 15],
            _ => vec![],
        };
        if !sizes.is_empty() {
            variable["dimensions"] = sizes.clone().into();
        }
        let items =
            enumerations.iter().find(|(name, _)| name == data_type).map_or(&[][..], |(_, items)| items);
        let causality = self.pick(&["input", "output", "parameter", "calculatedParameter", "local"]);
        variable["causality"] = causality.into();
        let is_state =
            !grouped && data_type == "Real" && matches!(causality, "output" | "local") && self.one_in(2);
        if is_state {
            variable["derivative"] = true.into();
        }
        if is_state || matches!(causality, "input" | "parameter") {
            // One for all elements, or each.
            let of = if self.one_in(3) { &[] } else { &sizes[..] };
            variable["start"] = self.start(data_type, items, of);
        }
        variable
    }

    fn variables(&mut self, fmi3: bool, enumerations: &[(String, Vec<String>)], grouped: bool) -> Vec<Value> {
        let count = self.below(7);
        let names = self.names(count);
        names.iter().map(|name| self.variable(name, fmi3, enumerations, grouped)).collect()
    }

    /// Components that contain others, to a depth.
    fn components(
        &mut self,
        fmi3: bool,
        enumerations: &[(String, Vec<String>)],
        grouped: bool,
        types: &[Value],
        depth: usize,
    ) -> Vec<Value> {
        let count = self.below(2 + depth);
        let names = self.lower_names(count);
        let component = |name| {
            let mut component = json!({"name": name});
            if self.one_in(2) {
                component["description"] = self.text();
            }
            if !types.is_empty() && self.one_in(2) {
                component["type"] = types[self.below(types.len())]["name"].clone();
                return component;
            }
            component["variables"] = self.variables(fmi3, enumerations, grouped).into();
            if depth > 0 && self.one_in(2) {
                component["components"] =
                    self.components(fmi3, enumerations, grouped, types, depth - 1).into();
            }
            component
        };
        names.into_iter().map(component).collect()
    }

    /// A component with a map and a curve over axes.
    fn charts(&mut self) -> Value {
        let (names, sizes) = (self.names(4), [2 + self.below(3), 2 + self.below(20)]);
        let parameter = |name: &str, sizes: &[usize], axes: &[&str]| json!({"name": name, "unit": "%", "causality": "parameter", "dimensions": sizes, "axes": axes, "start": 1});
        let [row, column, map, curve] = [0, 1, 2, 3].map(|number| names[number].as_str());
        json!({"name": "charts", "variables": [
            parameter(map, &sizes, &[row, column]), parameter(curve, &sizes[1..], &[column]),
            parameter(row, &sizes[..1], &[]), parameter(column, &sizes[1..], &[]),
        ]})
    }

    fn declaration(&mut self, fmi3: bool) -> Value {
        let mut enumerations: Vec<(String, Vec<String>)> = Vec::new();
        for _ in 0..self.below(3) {
            let items = (0..=self.below(2)).map(|_| self.pick(&ITEMS).to_owned()).collect();
            enumerations.push((self.pick(&TYPES).to_owned(), items));
        }
        let described: Vec<_> = enumerations
            .iter()
            .map(|(name, items)| {
                let item = |item| {
                    let value = self.pick(&[None, Some(-4), Some(1), Some(i32::MAX)]);
                    json!({"name": item, "description": self.text(), "value": value})
                };
                let items: Vec<_> = items.iter().map(item).collect();
                json!({"name": name, "description": self.text(), "items": items})
            })
            .collect();
        let grouped = self.one_in(4);
        let mut variables = self.variables(fmi3, &enumerations, grouped);
        variables.push(json!({"name": "result", "causality": "output", "type": "Integer"}));
        // Each may contain those before it.
        let mut component_types: Vec<Value> = Vec::new();
        for _ in 0..self.below(3) {
            let components = self.components(fmi3, &enumerations, true, &component_types, 1);
            let variables = self.variables(fmi3, &enumerations, true);
            let name = self.pick(&TYPES);
            component_types.push(json!({"name": name, "variables": variables, "components": components}));
        }
        let mut components = self.components(fmi3, &enumerations, grouped, &component_types, 2);
        if self.one_in(2) {
            components.push(self.charts());
        }
        // Those that no component has are refused.
        let written = json!([components, component_types]).to_string();
        component_types.retain(|known| written.contains(&json!({"type": known["name"]}).to_string()[1..]));
        let mut declaration = json!({
            "model_identifier": "Random", "real_types": [{"name": REAL_TYPE, "description": self.text(), "min": -1e31}],
            "enumerations": described, "variables": variables,
            "component_types": component_types, "components": components, "event_indicators": self.lower_names(1),
            "log_categories": [{"name": self.text(), "description": self.text()}],
        });
        if grouped {
            // With a state of its own: each group has one.
            let name = self.lower_names(1).remove(0);
            let state = json!({"name": "level", "unit": "m", "start": 1, "derivative": true});
            declaration["state_groups"] = json!([{"name": name, "description": self.text()}]);
            let mut component = json!({"name": "tank", "state_group": name, "variables": [state]});
            if self.one_in(2) {
                component["components"] = json!([{"name": "inner", "variables": [state]}]);
            }
            declaration["components"].as_array_mut().expect("it is a list").push(component);
        }
        declaration
    }
}

#[test]
#[ignore = "it compiles what is generated, by cargo"]
fn what_is_accepted_compiles() {
    let (count, seed) = match env::var("RANDOM_DECLARATIONS") {
        Ok(count) => (count.parse().expect("it is a number"), u64::from(std::process::id())),
        Err(_) => (COUNT, 2011),
    };
    println!("seed {seed}");
    let mut random = Random(seed);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("declarations");
    let _ = fs::remove_dir_all(folder.join("src"));
    fs::create_dir_all(folder.join("src")).expect("the folder for tests is writable");
    let write = |name: &str, text: &str| {
        fs::write(folder.join(name), text).expect("the folder for tests is writable");
    };
    let exporter = concat!(env!("CARGO_MANIFEST_DIR"), "/../fmu-export");
    let manifest = "[package]\nname = \"declarations\"\nedition = \"2024\"\n[workspace]\n[dependencies]\n";
    write("Cargo.toml", &format!("{manifest}fmu-export = {{ path = {exporter:?} }}\n"));
    fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/../../Cargo.lock"), folder.join("Cargo.lock"))
        .expect("the folder for tests is writable");
    let mut package =
        Package { name: "random".to_owned(), version: "1.0.0".to_owned(), ..Package::default() };
    let (mut accepted, mut modules) = (0, String::new());
    for number in 0..count {
        let version = random.pick(&Version::ALL);
        let interfaces =
            random.pick(&[Interfaces::CoSimulation, Interfaces::ModelExchange, Interfaces::Both]);
        let declaration = random.declaration(version == Version::Three);
        package.precision = random.pick(&Precision::ALL);
        let out_dir = folder.join(format!("src/m{number}"));
        fs::create_dir_all(&out_dir).expect("the folder for tests is writable");
        write(&format!("src/m{number}/model.json"), &format!("{declaration:#}"));
        let fmi = Fmi { version, interfaces };
        match generate_into(&out_dir.join("model.json"), &out_dir, &package, fmi) {
            Ok(_) => {
                accepted += 1;
                let _ =
                    writeln!(modules, "pub mod m{number} {{ include!(\"m{number}/Random/variables.rs\"); }}");
            }
            Err(error) => assert!(!error.findings().is_empty()),
        }
        if (number + 1) % BATCH == 0 || number + 1 == count {
            write("src/lib.rs", &format!("#![deny(warnings)]\n{modules}"));
            modules.clear();
            // Lints have checked the exporter there, without debug information.
            let check = Command::new(env!("CARGO"))
                .args(["check", "--quiet", "--offline", "--target-dir"])
                .arg(concat!(env!("CARGO_TARGET_TMPDIR"), "/.."))
                .env("CARGO_PROFILE_DEV_DEBUG", "0")
                .current_dir(&folder)
                .output()
                .expect("cargo runs");
            let errors = String::from_utf8_lossy(&check.stderr);
            assert!(check.status.success(), "{}", errors.chars().take(8000).collect::<String>());
        }
    }
    println!("{accepted} of {count} declarations are accepted, and compile");
    assert!(accepted > count / 4, "{accepted} of {count}: too few to say something");
}

/// What a target without an operating system accepts has an A2L in which each scalar with a cell has an item, and each item
/// cells of its own.
#[test]
fn the_a2l_of_what_is_accepted_is_consistent() {
    let mut random = Random(2012);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("a2l of declarations");
    fs::create_dir_all(&folder).expect("the folder for tests is writable");
    let file = folder.join("model.json");
    let package = Package { version: "1.0.0".to_owned(), is_bare_metal: true, ..Package::default() };
    let (mut accepted, mut maps) = (0, 0);
    for _ in 0..400 {
        let version = random.pick(&Version::ALL);
        let declaration = random.declaration(version == Version::Three);
        fs::write(&file, declaration.to_string()).expect("the folder for tests is writable");
        let Ok(generated) =
            generate_into(&file, &folder, &package, Fmi { version, interfaces: Interfaces::CoSimulation })
        else {
            continue;
        };
        accepted += 1;
        let written = |name: &str| fs::read(generated.variables.with_file_name(name)).expect("it is written");
        let text = String::from_utf8(written("model.a2l")).expect("it is a text");
        let module = a2l::module(&text);
        let size = |sizes: Option<&a2lfile::MatrixDim>| {
            sizes.map_or(1, |sizes| sizes.dim_list.iter().map(|&size| usize::from(size)).product())
        };
        // The distance of each item from the symbol, with its cells.
        let mut parameters: Vec<(i32, usize)> = Vec::new();
        for item in &module.characteristic {
            let link = item.symbol_link.as_ref().expect("it has a link");
            let over = item.axis_descr.iter().map(|axis| usize::from(axis.max_axis_points));
            maps += item.axis_descr.len();
            parameters.push((link.offset, over.product::<usize>() * size(item.matrix_dim.as_ref())));
        }
        for item in &module.axis_pts {
            let link = item.symbol_link.as_ref().expect("it has a link");
            parameters.push((link.offset, item.max_axis_points.into()));
        }
        parameters.sort_unstable();
        let end = parameters.into_iter().fold(0, |end, (offset, cells)| {
            assert_eq!(usize::try_from(offset), Ok(end), "{text}");
            end + 8 * cells
        });
        assert_eq!(end, written("start.page").len(), "{text}");
        let groups: BTreeSet<_> = module.group.iter().map(a2lfile::A2lObjectName::get_name).collect();
        assert_eq!(groups.len(), text.matches("/begin GROUP").count(), "{text}");
        let names: usize = module
            .group
            .iter()
            .map(|group| {
                group.ref_characteristic.as_ref().map_or(0, |list| list.identifier_list.len())
                    + group.ref_measurement.as_ref().map_or(0, |list| list.identifier_list.len())
            })
            .sum();
        assert_eq!(names, module.characteristic.len() + module.axis_pts.len() + module.measurement.len());
    }
    assert!(accepted > 50 && maps > 20, "{accepted} accepted, {maps} axes: too few to say something");
}
