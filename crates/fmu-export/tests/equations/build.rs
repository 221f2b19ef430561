//! Generates the variables of all models, with both interfaces; of those that depend on time also without capabilities.

use std::path::Path;
use std::{env, fs};

use fmu_export_build::{Fmi, Interfaces, Package, Version, generate_into};

fn main() {
    let out_dir = env::var("OUT_DIR").expect("OUT_DIR is set for build scripts");
    for model in [
        "decay",
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
        "drive",
        "furnace",
        "two_parts",
        "nested",
        "tuned",
        "tuned_samples",
        "two_clocks",
        "waves",
        "ticks",
        "alarms",
        "gears",
        "branches",
        "../../../fmu-export-build/tests/generator/vessels",
    ] {
        let declaration = format!("{model}.json");
        println!("cargo::rerun-if-changed={declaration}");
        generate(Path::new(&declaration), Path::new(&out_dir), Version::Two);
    }
    // Models as FMI 3.0, in addition to or instead of FMI 2.0.
    for model in [
        "tuned",
        "tuned_samples",
        "tuned_ticks",
        "two_clocks",
        "ending",
        "waves",
        "ticks",
        "alarms",
        "gears",
        "branches",
    ] {
        let declaration = format!("{model}.json");
        println!("cargo::rerun-if-changed={declaration}");
        generate(Path::new(&declaration), &Path::new(&out_dir).join("fmi3"), Version::Three);
    }
    let text = fs::read_to_string("two_parts.json").expect("it is beside this file");
    let of_capabilities = |line: &&str| line.contains("\"capabilities\"");
    assert_eq!(text.lines().filter(of_capabilities).count(), 1, "the line of the capabilities");
    let lines: Vec<_> = text.lines().filter(|line| !of_capabilities(line)).collect();
    let bare = Path::new(&out_dir).join("without_capabilities.json");
    fs::write(&bare, lines.join("\n").replace("\"two_parts\"", "\"without_capabilities\""))
        .expect("OUT_DIR is writable");
    generate(&bare, Path::new(&out_dir), Version::Two);
}

fn generate(declaration: &Path, out_dir: &Path, version: Version) {
    let fmi = Fmi { version, interfaces: Interfaces::Both };
    generate_into(declaration, out_dir, &Package::of_build_script(), fmi)
        .unwrap_or_else(|error| panic!("{error}"));
}
