//! Generates the variables of all models, with both interfaces.

use std::env;
use std::path::Path;

use fmu_export_build::{Interfaces, Package, generate_into};

fn main() {
    let out_dir = env::var("OUT_DIR").expect("OUT_DIR is set for build scripts");
    for model in [
        "decay",
        "exact",
        "van_der_pol",
        "robertson",
        "hires",
        "bouncing_ball",
        "stairs",
        "undeclared",
        "draining",
        "falling",
        "rod",
        "field",
        "furnace",
        "../../../fmu-export-build/tests/generator/vessels",
    ] {
        let declaration = format!("{model}.json");
        println!("cargo::rerun-if-changed={declaration}");
        let package = Package::of_build_script();
        generate_into(Path::new(&declaration), Path::new(&out_dir), &package, Interfaces::Both)
            .unwrap_or_else(|error| panic!("{error}"));
    }
}
