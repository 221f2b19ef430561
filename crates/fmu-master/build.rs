//! Compiles what is in C: the logger that FMUs call, because stable Rust cannot define a variadic function, and what
//! system headers define differently on each platform.

fn main() {
    let sources = ["src/importer/logger.c", "src/importer/process.c"];
    for source in sources {
        println!("cargo:rerun-if-changed={source}");
    }
    cc::Build::new().files(sources).warnings_into_errors(true).compile("importer");
}
