//! The files generated for a small model, and the declarations that are refused.
//!
//! The model, `vessels.json`, has one of everything. Its descriptions are golden files, so that every change of them is
//! seen, as are the Rust and the page of `oscillator.json`. After an intended change, update them with
//! `FMU_EXPORT_BLESS=1 cargo test -p fmu-export-build --test
//! generator`. The Rust of `vessels.json` is compiled, and tested, in `crates/fmu-export/tests/equations`.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use fmu_export_build::{Generated, Interfaces, Package, generate_into};

#[path = "../a2l/mod.rs"]
mod a2l;
mod arrays;
mod bare_metal;
mod defaults;
mod documentation;
mod interfaces;
mod readme;
mod refusals;
mod structure;

fn sources() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/generator")
}

/// An empty folder, another one at each call: tests run in parallel.
fn folder(name: &str) -> PathBuf {
    static FOLDERS: AtomicUsize = AtomicUsize::new(0);
    let number = FOLDERS.fetch_add(1, Ordering::Relaxed);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("build").join(format!("{number} {name}"));
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("the folder for tests is writable");
    folder
}

/// A folder with nothing but the small model.
fn folder_with_model(name: &str) -> PathBuf {
    let folder = folder(name);
    for file in ["vessels.json", "units.json", "vessels.html", "vessels.svg", "vessels.png"] {
        fs::copy(sources().join(file), folder.join(file)).expect("the folder for tests is writable");
    }
    folder
}

/// The package that the small model belongs to.
fn package() -> Package {
    Package { name: "small-model".to_owned(), version: "1.2.3".to_owned(), ..Package::default() }
}

fn read(file: &Path) -> String {
    fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()))
}

fn generate(out_dir: &Path) -> Generated {
    generate_into(&sources().join("vessels.json"), out_dir, &package(), Interfaces::CoSimulation)
        .unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn generated_files_equal_the_golden_files() {
    if env::var_os("FMU_EXPORT_BLESS").is_some() {
        let generated = generate(&sources());
        // Those of the oscillator are kept.
        for file in [generated.variables, generated.documentation] {
            fs::remove_file(file).expect("it was written");
        }
    }
    let generated = generate(&folder("kept"));
    // The SVG is a figure of the page, and by its name the drawing of the icon.
    let beside = ["units.json", "vessels.html", "vessels.svg", "vessels.png", "vessels.svg"];
    assert_eq!(generated.sources, beside.map(|name| sources().join(name)));
    let kept = |file: &Path| {
        let name = file.file_name().expect("a file has a name");
        assert_eq!(fs::read(file).ok(), fs::read(sources().join("Vessels").join(name)).ok(), "{name:?}");
    };
    kept(&generated.model_description);
    kept(&generated.icon.expect("the JSON names one"));
    kept(&generated.drawing.expect("there is one"));
    kept(&generated.terminals.expect("the JSON has some"));
}

/// The elements of a list in `ModelStructure`: index and dependencies.
fn unknowns(xml: &str, list: &str) -> Vec<(String, String)> {
    let (_, rest) = xml.split_once(&format!("<{list}>")).expect("the list is there");
    let (content, _) = rest.split_once(&format!("</{list}>")).expect("the list ends");
    content
        .lines()
        .filter(|line| line.contains("<Unknown"))
        .map(|line| {
            let attributes: Vec<_> = line.split('"').collect();
            assert_eq!([attributes[0].trim(), attributes[2].trim()], ["<Unknown index=", "dependencies="]);
            (attributes[1].to_owned(), attributes[3].to_owned())
        })
        .collect()
}

fn expected(unknowns: &[(&str, &str)]) -> Vec<(String, String)> {
    unknowns.iter().map(|&(index, dependencies)| (index.to_owned(), dependencies.to_owned())).collect()
}

/// Derived by hand from the model. The indices are: 1 time, 2 inflow, 3 enabled, 4 level, 5 drain,
/// 6 fills, 7 first.area, 8 first.mass, 9 its derivative, 10 first.outflow, 11 to 14 the same of second,
/// 15 settings.mode, 16 .label, 17 to 20 .table, 21 .gain, 22 .reserve (exact), 23 its derivative.
#[test]
fn dependencies_are_the_closure_of_reads() {
    let xml = read(&generate(&folder("dependencies")).model_description);
    // Inputs, states and time; parameters are none of the knowns of a step.
    assert_eq!(unknowns(&xml, "Outputs"), expected(&[("4", "8"), ("5", "3 12"), ("6", "")]));
    // The second vessel's derivative reads the first one's outflow, which reads its mass.
    assert_eq!(unknowns(&xml, "Derivatives"), expected(&[("9", "2 8"), ("13", "8 12"), ("23", "1 22")]));
    // Inputs, exact variables and time: approximate states are replaced by what they are computed from.
    let initial = [
        ("4", "7 15"),
        ("5", "3 11 15"),
        ("6", "1 15"),
        ("8", "7 15"),
        ("9", "2 7 15"),
        ("12", "11 15"),
        ("13", "7 11 15"),
        ("21", "17 18 19 20"),
        ("23", "1 17 18 19 20 22"),
    ];
    assert_eq!(unknowns(&xml, "InitialUnknowns"), expected(&initial));
}

#[test]
fn guid_follows_the_content() {
    let guid = |version: &str, name: &str| {
        let out_dir = folder(name);
        let package = Package { version: version.to_owned(), ..package() };
        let generated =
            generate_into(&sources().join("vessels.json"), &out_dir, &package, Interfaces::CoSimulation);
        let xml = read(&generated.expect("the model is sound").model_description);
        let (_, rest) = xml.split_once("guid=\"{").expect("there is a guid");
        rest[..36].to_owned()
    };
    assert_eq!(guid("1.2.3", "guid_1"), guid("1.2.3", "guid_2"));
    assert_ne!(guid("1.2.3", "guid_3"), guid("1.2.4", "guid_4"));
    let generated = generate(&folder("guid_5"));
    for file in [&generated.variables, &generated.documentation] {
        assert!(read(file).contains(&guid("1.2.3", "guid_6")), "{}", file.display());
    }
}
