//! Compiles the logger that FMUs call: its arguments are variadic, and stable Rust cannot define such a function.

fn main() {
    println!("cargo:rerun-if-changed=src/importer/logger.c");
    cc::Build::new().file("src/importer/logger.c").warnings_into_errors(true).compile("logger");
}
