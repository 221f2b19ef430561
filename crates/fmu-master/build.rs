//! Compiles the logger that FMUs call: stable Rust cannot define a variadic function.

fn main() {
    println!("cargo:rerun-if-changed=src/importer/logger.c");
    cc::Build::new().file("src/importer/logger.c").warnings_into_errors(true).compile("logger");
}
