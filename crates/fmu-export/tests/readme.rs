//! The model on the front page of the documentation is built as a reader would: its files are taken from
//! the page, compiled by cargo, and the library is asked what it exports.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const PAGE: &str = include_str!("../README.md");

/// The first code block of a language after a text of the page.
fn block<'a>(after: &str, language: &str) -> &'a str {
    let begin = PAGE.find(after).unwrap_or_else(|| panic!("the page does not say {after}"));
    let fence = format!("```{language}\n");
    let (_, rest) = PAGE[begin..].split_once(&fence).unwrap_or_else(|| panic!("no {language} after {after}"));
    rest.split("```").next().unwrap()
}

fn write(folder: &Path, name: &str, content: &str) {
    let file = folder.join(name);
    fs::create_dir_all(file.parent().unwrap()).unwrap();
    fs::write(file, content).unwrap();
}

#[test]
fn the_model_of_the_front_page_compiles() {
    let crate_folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("lag");
    let path = |name| format!("path = {:?}", crate_folder.with_file_name(name).display().to_string());
    let manifest = block("`Cargo.toml`", "toml")
        .replace("fmu-export = \"0.1\"", &format!("fmu-export = {{ {} }}", path("fmu-export")))
        .replace(
            "fmu-export-build = \"0.1\"",
            &format!("fmu-export-build = {{ {} }}", path("fmu-export-build")),
        );
    assert_eq!(manifest.matches("path = ").count(), 2, "both dependencies are taken from here");
    write(&folder, "Cargo.toml", &(manifest + "\n[workspace]\n"));
    write(&folder, "build.rs", block("`build.rs`", "rust,ignore"));
    write(&folder, "lag.json", block("`lag.json`", "json"));
    write(&folder, "units.json", block("`units.json`", "json"));
    write(&folder, "src/lib.rs", block("`src/lib.rs`", "rust,ignore"));
    // The workspace's choice of versions: nothing is looked up.
    fs::copy(crate_folder.join("../../Cargo.lock"), folder.join("Cargo.lock")).unwrap();

    let output = Command::new(env!("CARGO"))
        .args(["build", "--target-dir"])
        .arg(folder.join("target"))
        .current_dir(&folder)
        .env("RUSTFLAGS", "-Dwarnings")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let name = format!("{}Lag{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    let library = fs::read(folder.join("target/debug").join(name)).unwrap();
    let symbol = b"fmi2GetRealOutputDerivatives\0";
    assert!(library.windows(symbol.len()).any(|bytes| bytes == symbol));
}
