//! Good FMUs of each version, without findings, and broken ones with a small edit each, in which exactly the broken
//! rule is found.
//!
//! The broken FMUs stay in the folder `broken-fmus` in cargo's folder for tests, for `tests/fmu/validators.py`, which
//! tries other validators.

// The library is compiled for Linux.
#![cfg(target_os = "linux")]

mod breaks;
mod library;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use fmu_validation::importers;
use fmu_validation::rules::{self, Severity};
use fmu_validation::{Report, validate};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use breaks::Edit;

const DESCRIPTION: &str = "modelDescription.xml";
const TERMINALS: &str = "terminalsAndIcons/terminalsAndIcons.xml";
const BUILD: &str = "sources/buildDescription.xml";

/// The files of an FMU, by their paths.
type Files = BTreeMap<String, Vec<u8>>;

/// The versions of FMI; good FMUs with sources, and with a library.
#[derive(Clone, Copy)]
enum Good {
    Fmi2,
    Fmi3,
    /// FMI 2 with a library.
    Library,
}

fn files(good: Good) -> Files {
    let (description, mut files) = match good {
        Good::Fmi2 => (include_str!("fmi2.xml"), Files::new()),
        Good::Fmi3 => (
            include_str!("fmi3.xml"),
            Files::from([
                (BUILD.to_owned(), include_bytes!("buildDescription.xml").to_vec()),
                (TERMINALS.to_owned(), include_bytes!("terminalsAndIcons.xml").to_vec()),
            ]),
        ),
        Good::Library => {
            (include_str!("fmi2.xml"), Files::from([(library::PATH.to_owned(), library::build())]))
        }
    };
    files.insert(DESCRIPTION.to_owned(), description.as_bytes().to_vec());
    files.insert("sources/tank.c".to_owned(), vec![]);
    files
}

fn zipped(files: &Files) -> Vec<u8> {
    let mut zip = ZipWriter::new(std::io::Cursor::new(vec![]));
    for (path, content) in files {
        zip.start_file(path.as_str(), SimpleFileOptions::default()).unwrap();
        zip.write_all(content).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::create_dir_all(&folder).unwrap();
    folder
}

fn report(path: &Path, archive: &[u8]) -> Report {
    fs::write(path, archive).unwrap();
    validate(path, &[]).unwrap()
}

/// The broken rules of a severity.
fn broken(report: &Report, severity: Severity) -> BTreeSet<&'static str> {
    report
        .findings
        .iter()
        .map(|finding| finding.rule)
        .filter(|rule| rule.severity == severity)
        .map(|rule| rule.id)
        .collect()
}

#[test]
fn nothing_is_found_in_good_fmus() {
    for (name, good) in [("2", Good::Fmi2), ("3", Good::Fmi3), ("library", Good::Library)] {
        let report = report(&folder("good-fmus").join(format!("{name}.fmu")), &zipped(&files(good)));
        assert!(report.findings.is_empty(), "{name}: {:#?}", report.findings);
    }
}

#[test]
fn each_break_is_found_by_its_rule_and_no_other() {
    // Remove those of an earlier version of this test.
    fs::remove_dir_all(folder("broken-fmus")).unwrap();
    let folder = folder("broken-fmus");
    let mut wrong = vec![];
    for (index, &(what, rule, good, ref edit)) in breaks::all().enumerate() {
        let version = if matches!(good, Good::Fmi3) { 3 } else { 2 };
        let mut files = files(good);
        let archive = match edit {
            Edit::Xml(path, text, replacement) => {
                let before = String::from_utf8(files[*path].clone()).unwrap();
                assert!(before.contains(*text), "{what}: {text}");
                files.insert((*path).to_owned(), before.replacen(*text, replacement, 1).into_bytes());
                zipped(&files)
            }
            Edit::Files(edit) => {
                edit(&mut files);
                zipped(&files)
            }
            Edit::Archive(edit) => edit(&files),
        };
        let path = folder.join(format!("{index:03} {what} (FMI {version}).fmu"));
        let report = report(&path, &archive);
        let severity = rules::ALL.iter().find(|known| known.id == rule).unwrap().severity;
        let errors = broken(&report, Severity::Error);
        let expected = if severity == Severity::Error { BTreeSet::from([rule]) } else { BTreeSet::new() };
        let is_found = report.findings.iter().any(|finding| finding.rule.id == rule);
        if errors != expected || !is_found {
            wrong.push(format!("{what}, by {rule}: {:#?}", report.findings));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn each_rule_is_broken_once() {
    let broken: BTreeSet<_> = breaks::all().map(|(_, rule, ..)| *rule).collect();
    // The file's name and what importers refuse are checked in other tests.
    let all: BTreeSet<_> = rules::ALL
        .iter()
        .filter(|rule| rule.severity != Severity::Note && rule.id != "archive-name")
        .map(|rule| rule.id)
        .collect();
    assert_eq!(broken, all);
}

#[test]
fn what_an_importer_refuses_is_noted_for_it_alone() {
    let path = folder("good-fmus").join("refused.fmu");
    let mut files = files(Good::Fmi3);
    // Two arrays and a structural parameter are there already.
    let text = include_str!("fmi3.xml")
        .replace("</UnitDefinitions>", r#"<Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit></UnitDefinitions>"#)
        .replace(r#"<EnumerationType name="Mode""#, r#"<EnumerationType name="Mode" description="On or off""#)
        .replace(r#"<Float64 name="time""#, r#"<Float64 name="time" nominal="2""#)
        .replace(
            "</TypeDefinitions>",
            r#"<ClockType name="Tick" description="Read by all" intervalVariability="triggered"/></TypeDefinitions>"#,
        );
    files.insert(DESCRIPTION.to_owned(), text.into_bytes());
    fs::write(&path, zipped(&files)).unwrap();
    assert!(validate(&path, &[]).unwrap().findings.is_empty());
    let arrays = ["array: profile", "array: matrix"];
    let found: [(&str, &[&str]); 7] = [
        ("CasADi", &["structural-parameter: size", arrays[0], arrays[1]]),
        ("Chrono", &["structural-parameter: size", "clock-variable: tick", "enumeration-variable: mode"]),
        ("fmi", &["ampere-or-kelvin: ", "unit-of-variable: time"]),
        ("FMI.jl", &arrays),
        ("FMPy", &["type-description: "]),
        ("OMSimulator", &arrays),
        ("PyFMI", &arrays),
    ];
    let mut rules_found = BTreeSet::new();
    for (importer, (name, expected)) in importers::ALL.iter().zip(found) {
        assert_eq!(importer.name, name);
        let report = validate(&path, &[importer]).unwrap();
        let findings = report.findings.iter().map(|finding| {
            let version = format!("{name} {}", importer.versions);
            assert!(finding.message.ends_with(&format!(", refused by {version}")), "{}", finding.message);
            rules_found.insert(finding.rule.id);
            format!("{}: {}", finding.rule.id, finding.place.variable.as_deref().unwrap_or_default())
        });
        assert_eq!(findings.collect::<Vec<_>>(), expected);
        assert_eq!(report.findings.len(), report.count(Severity::Note));
    }
    let notes = rules::ALL.iter().filter(|rule| rule.severity == Severity::Note).map(|rule| rule.id);
    assert_eq!(rules_found, notes.collect());
}

#[test]
fn the_name_of_the_file_is_checked() {
    let report = report(&folder("good-fmus").join("tank.zip"), &zipped(&files(Good::Fmi2)));
    assert_eq!(broken(&report, Severity::Warning), BTreeSet::from(["archive-name"]));
}

/// A date in UTC by an offset, and a text with blanks, which is one start value.
#[test]
fn what_looks_wrong_may_be_right() {
    for (good, from, to) in [
        (Good::Fmi2, "12:00:00Z", "12:00:00+00:00"),
        (
            Good::Fmi2,
            "</ModelVariables>",
            "<ScalarVariable name=\"note\" valueReference=\"9\" causality=\"parameter\" variability=\"fixed\">\
             <String start=\"of three words\"/></ScalarVariable></ModelVariables>",
        ),
    ] {
        let mut files = files(good);
        let text = String::from_utf8(files[DESCRIPTION].clone()).unwrap();
        assert!(text.contains(from));
        files.insert(DESCRIPTION.to_owned(), text.replace(from, to).into_bytes());
        let report = report(&folder("good-fmus").join("right.fmu"), &zipped(&files));
        assert!(report.findings.is_empty(), "{:?}", report.findings);
    }
}

#[test]
fn more_findings_than_anybody_reads_are_counted() {
    let mut files = files(Good::Fmi2);
    let variable =
        r#"<ScalarVariable name="x" valueReference="9" variability="discrete"><Integer/></ScalarVariable>"#;
    let text = include_str!("fmi2.xml")
        .replace("</ModelVariables>", &(variable.repeat(100_500) + "</ModelVariables>"));
    files.insert(DESCRIPTION.to_owned(), text.into_bytes());
    let report = report(&folder("good-fmus").join("many.fmu"), &zipped(&files));
    // The first one is no duplicate.
    assert_eq!((report.findings.len(), report.omitted), (100_000, 499));
}
