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
        "tuned",
        "tuned_samples",
        "../../../fmu-export-build/tests/generator/vessels",
    ] {
        let declaration = format!("{model}.json");
        println!("cargo::rerun-if-changed={declaration}");
        let package = Package::of_build_script();
        generate_into(Path::new(&declaration), Path::new(&out_dir), &package, Interfaces::Both)
            .unwrap_or_else(|error| panic!("{error}"));
    }
    // Of FMI 3.0, beside or instead of FMI 2.0.
    for model in ["tuned", "tuned_samples", "tuned_ticks"] {
        let declaration = format!("{model}.json");
        println!("cargo::rerun-if-changed={declaration}");
        let out_dir = Path::new(&out_dir).join("fmi3");
        let fmi = Fmi { version: Version::Three, interfaces: Interfaces::Both };
        generate_into(Path::new(&declaration), &out_dir, &Package::of_build_script(), fmi)
            .unwrap_or_else(|error| panic!("{error}"));
    }
}
