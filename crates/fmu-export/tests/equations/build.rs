//! Generates the variables of all models, with both interfaces.

use std::env;
use std::path::Path;

use fmu_export_build::{Fmi, Interfaces, Package, Version, generate_into};

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
        "ending",
        "../../../fmu-export-build/tests/generator/vessels",
    ] {
        let declaration = format!("{model}.json");
        println!("cargo::rerun-if-changed={declaration}");
        let package = Package::of_build_script();
        // What FMI 3.0 alone demands.
        let version = if model == "ending" { Version::Three } else { Version::Two };
        let fmi = Fmi { version, interfaces: Interfaces::Both };
        generate_into(Path::new(&declaration), Path::new(&out_dir), &package, fmi)
            .unwrap_or_else(|error| panic!("{error}"));
    }
}
