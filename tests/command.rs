//! The command, run as a user would: its answers to what is wrong.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn boost_fmu(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_boost-fmu")).args(arguments).output().unwrap()
}

/// What the command says on stderr when it fails.
fn refusal(arguments: &[&str]) -> String {
    let output = boost_fmu(arguments);
    assert!(!output.status.success(), "{arguments:?} succeeded");
    String::from_utf8(output.stderr).unwrap()
}

fn scratch(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// A ZIP archive with one entry.
fn archive(name: &str, entry: &str, content: &str) -> String {
    let path = scratch(name);
    let mut zip = zip::ZipWriter::new(fs::File::create(&path).unwrap());
    zip.start_file(entry, zip::write::SimpleFileOptions::default()).unwrap();
    zip.write_all(content.as_bytes()).unwrap();
    zip.finish().unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn an_unknown_model_is_refused_with_the_known_ones() {
    let message = refusal(&["export", "BoostPlan"]);
    assert!(message.contains("no model BoostPlan"), "{message}");
    assert!(message.contains("BoostController, BoostPlant"), "{message}");
}

#[test]
fn info_says_why_a_file_is_no_fmu() {
    let missing = refusal(&["info", "there is no such.fmu"]);
    assert!(missing.contains("cannot open there is no such.fmu"), "{missing}");

    let text = scratch("text.fmu");
    fs::write(&text, "no archive").unwrap();
    let message = refusal(&["info", text.to_str().unwrap()]);
    assert!(message.contains("it is no ZIP archive"), "{message}");

    let message = refusal(&["info", &archive("empty.fmu", "readme.txt", "")]);
    assert!(message.contains("no modelDescription.xml"), "{message}");

    for (name, xml, reason) in [
        ("cut.fmu", "<fmiModelDescription><ModelVariables>", "ends within the element ModelVariables"),
        ("crossed.fmu", "<fmiModelDescription><a></b>", "is broken"),
        ("other.fmu", "<html/>", "the root element is html"),
        ("blank.fmu", "", "no root element"),
    ] {
        let message = refusal(&["info", &archive(name, "modelDescription.xml", xml)]);
        assert!(message.contains(reason), "{name}: {message}");
    }
}

#[test]
fn info_shows_the_variables_of_each_version_of_fmi() {
    let fmi2 = r#"<?xml version="1.0"?>
        <fmiModelDescription fmiVersion="2.0" modelName="A &amp; B">
          <TypeDefinitions><SimpleType name="Pressure"><Real unit="Pa"/></SimpleType></TypeDefinitions>
          <ModelVariables>
            <ScalarVariable name="p" causality="input" description="pressure">
              <Real declaredType="Pressure" start="1e5" min="0"/>
              <Annotations/>
            </ScalarVariable>
          </ModelVariables>
        </fmiModelDescription>"#;
    let fmi3 = r#"<fmiModelDescription fmiVersion="3.0" modelName="C">
          <ModelVariables><Float64 name="p" causality="input" unit="Pa" start="1e5" min="0"
            description="pressure"/></ModelVariables>
        </fmiModelDescription>"#;
    for (name, xml, title, data_type) in
        [("fmi2.fmu", fmi2, "A & B", "Real"), ("fmi3.fmu", fmi3, "C", "Float64")]
    {
        let output = boost_fmu(&["info", &archive(name, "modelDescription.xml", xml)]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let table = String::from_utf8(output.stdout).unwrap();
        assert!(table.contains(&format!("modelName   {title}")), "{table}");
        let row = table.lines().find(|line| line.starts_with("p ")).unwrap();
        let words: Vec<_> = row.split_whitespace().collect();
        assert_eq!(words, ["p", "input", data_type, "Pa", "1e5", "0..", "pressure"]);
    }
}
