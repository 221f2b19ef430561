//! Compiles the logger that FMUs call: its arguments are variadic, and stable Rust cannot define such a function.
//! Generates the description of this repository's controller, whose grid is tuned where no other is given.

fn main() {
    println!("cargo:rerun-if-changed=src/importer/logger.c");
    cc::Build::new().file("src/importer/logger.c").warnings_into_errors(true).compile("logger");
    fmu_export_build::generate("../../modelDescription/controller.json");
}
