//! Declares and generates the variables of the problems, which differ only in their number of states and their nominal
//! value.

use std::path::Path;
use std::{env, fs};

use fmu_export_build::{Fmi, Interfaces, Package, Version, generate_into};

const PROBLEMS: [(&str, usize, f64); 13] = [
    ("pleiades", 28, 1.0),
    ("pollution", 20, 1e-3),
    ("oregonator", 3, 1.0),
    ("arenstorf", 4, 1.0),
    ("lorenz", 3, 1.0),
    ("heat", 2500, 1.0),
    ("brusselator", 2048, 1.0),
    ("chain", 2000, 1.0),
    ("dense", 200, 1.0),
    ("converter", 2, 1.0),
    ("kuramoto", 100, 1.0),
    ("pendulums", 40, 1.0),
    ("network", 300, 1.0),
];

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let out_dir = env::var("OUT_DIR").expect("OUT_DIR is set for build scripts");
    let out_dir = Path::new(&out_dir);
    for (name, states, nominal) in PROBLEMS {
        let declaration = out_dir.join(format!("{name}.json"));
        let text = format!(
            r#"{{
                "model_identifier": "{name}",
                "variables": [
                    {{"name": "input", "causality": "input", "unit": "1/s", "start": 0}},
                    {{"name": "x", "causality": "output", "unit": "1", "dimensions": [{states}], "start": 0,
                      "nominal": {nominal}, "derivative": {{"unit": "1/s"}}}}
                ]
            }}"#
        );
        fs::write(&declaration, text).expect("OUT_DIR is writable");
        let fmi = Fmi { version: Version::Two, interfaces: Interfaces::Both };
        generate_into(&declaration, out_dir, &Package::of_build_script(), fmi)
            .unwrap_or_else(|error| panic!("{error}"));
    }
}
