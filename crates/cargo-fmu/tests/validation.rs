//! `validate` and `info` as programs see them: exit status and JSON, as docs/validation.md describes them.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::{Value, json};

#[allow(dead_code)]
mod support;

use support::archive_of;

const DESCRIPTION: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Tank" guid="{1}">
  <CoSimulation modelIdentifier="tank"><SourceFiles><File name="tank.c"/></SourceFiles></CoSimulation>
  <UnitDefinitions><Unit name="m"><DisplayUnit name="mm" factor="1000"/></Unit></UnitDefinitions>
  <TypeDefinitions><SimpleType name="Mode"><Enumeration><Item name="off" value="0"/></Enumeration></SimpleType></TypeDefinitions>
  <DefaultExperiment stopTime="10"/>
  <ModelVariables>
    <ScalarVariable name="level" valueReference="7" causality="input" description="Of water">
      <Real unit="m" start="1" min="0"/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure/>
</fmiModelDescription>"#;

fn fmu(name: &str, description: &str) -> String {
    let library = b"no library".as_slice();
    archive_of(
        name,
        &[
            ("modelDescription.xml", description.as_bytes()),
            ("sources/tank.c", b""),
            ("binaries/darwin64/VisualStudio/tank.lib", library),
        ],
    )
}

fn cargo_fmu(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_cargo-fmu")).arg("fmu").args(arguments).output().unwrap()
}

fn json(arguments: &[&str]) -> Value {
    serde_json::from_slice(&cargo_fmu(arguments).stdout).unwrap()
}

fn page() -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/validation.md")).unwrap()
}

/// Checks that the page describes all keys of an object, and of those in it; names in `maps` are the FMU's.
fn assert_described(value: &Value, maps: &[&str], page: &str) {
    match value {
        Value::Object(object) => {
            for (key, value) in object {
                let is_described =
                    ["`", ".", "[]."].iter().any(|before| page.contains(&format!("{before}{key}`")));
                assert!(is_described, "{key} is not described");
                if !maps.contains(&key.as_str()) {
                    assert_described(value, maps, page);
                }
            }
        }
        Value::Array(items) => items.iter().for_each(|item| assert_described(item, maps, page)),
        _ => {}
    }
}

#[test]
fn the_exit_status_is_that_of_the_verdict() {
    let status = |path: &str| cargo_fmu(&["validate", path]).status.code();
    assert_eq!(status(&fmu("good.fmu", DESCRIPTION)), Some(0));
    let warned = archive_of(
        "warned.fmu",
        &[("modelDescription.xml", DESCRIPTION.as_bytes()), ("sources/tank.c", b""), ("readme", b"")],
    );
    assert_eq!(status(&warned), Some(0));
    assert_eq!(status(&fmu("bad.fmu", &DESCRIPTION.replace("{1}", ""))), Some(1));
    assert_eq!(status("no such file.fmu"), Some(2));
}

#[test]
fn findings_are_told_with_place_rule_and_remedy() {
    let path = fmu("start.fmu", &DESCRIPTION.replace(" start=\"1\"", ""));
    let output = String::from_utf8(cargo_fmu(&["validate", &path]).stdout).unwrap();
    let expected = format!(
        "modelDescription.xml:8: error: level: it is input, but has no start value [start-missing]\n    \
         Add the start value that the library uses.\n{path}: FMI 2.0, 1 error, 0 warnings\n"
    );
    assert_eq!(output, expected);

    let report = json(&["validate", &path, "--format", "json"]);
    let expected = json!({
        "file": path, "fmiVersion": "2.0", "errors": 1, "warnings": 0, "notes": 0, "omitted": 0,
        "findings": [{
            "rule": "start-missing", "severity": "error", "file": "modelDescription.xml", "line": 8,
            "variable": "level", "message": "it is input, but has no start value",
            "remedy": "Add the start value that the library uses.",
            "source": "2.0.5: 2.2.7; 3.0.2: 2.4.7.5",
        }],
    });
    assert_eq!(report, expected);
    assert_described(&report, &[], &page());
}

/// `info` says it and goes on, as what runs FMUs does.
#[test]
fn a_hyphen_in_the_model_identifier_is_told() {
    let description = DESCRIPTION.replace("modelIdentifier=\"tank\"", "modelIdentifier=\"two-tanks\"");
    assert!(description.contains("two-tanks"));
    let path = fmu("hyphen.fmu", &description);
    let sentence = "the modelIdentifier 'two-tanks' is not a C identifier";
    let info = cargo_fmu(&["info", &path]);
    assert_eq!(String::from_utf8(info.stderr).unwrap(), format!("warning: {path}: {sentence}\n"));
    assert_eq!(info.status.code(), Some(0));
    let validated = cargo_fmu(&["validate", &path]);
    assert_eq!(validated.status.code(), Some(1));
    let validated = String::from_utf8(validated.stdout).unwrap();
    assert!(validated.contains(&format!("error: {sentence} [model-identifier]")), "{validated}");
}

/// Of each rule three messages, and of each message three places; as JSON all.
#[test]
fn findings_of_one_kind_are_one_line() {
    let variable = |name: &str, initial: &str| {
        format!(
            "<ScalarVariable name=\"{name}\" valueReference=\"9\" initial=\"{initial}\"><Real/></ScalarVariable>\n"
        )
    };
    let mut variables: String = (0..5).map(|number| variable(&format!("a{number}"), "never")).collect();
    variables.extend(["once", "twice", "thrice"].map(|initial| variable(initial, initial)));
    let description = DESCRIPTION.replace("</ModelVariables>", &format!("\n{variables}</ModelVariables>"));
    let path = fmu("kinds.fmu", &description);
    let output = String::from_utf8(cargo_fmu(&["validate", &path]).stdout).unwrap();
    let of_schema: Vec<_> = output.lines().skip_while(|line| !line.contains("never")).take(5).collect();
    let first = description.lines().position(|line| line.contains("a0")).unwrap() + 1;
    let told = |at: String, initial: &str| {
        let wanted = "one of exact, approx, calculated";
        format!(
            "modelDescription.xml:{at}: error: the attribute initial of ScalarVariable is '{initial}', not {wanted} \
             [schema-value]"
        )
    };
    let expected = [
        told(format!("{first}, {}, {} and 2 more", first + 1, first + 2), "never"),
        of_schema[1].to_owned(),
        told((first + 5).to_string(), "once"),
        told((first + 6).to_string(), "twice"),
        "    and 1 more of this rule; --format json has all".to_owned(),
    ];
    assert_eq!(of_schema, expected);
    let report = json(&["validate", &path, "--format", "json"]);
    let findings = report["findings"].as_array().unwrap();
    assert_eq!(findings.iter().filter(|finding| finding["rule"] == "schema-value").count(), 8);
}

#[test]
fn an_fmu_of_fmi_1_is_refused_and_another_tool_named() {
    let path = fmu("one.fmu", &DESCRIPTION.replace("fmiVersion=\"2.0\"", "fmiVersion=\"1.0\""));
    let sentence = "it is of FMI 1.0, which is not supported here; use FMPy";
    let validated = cargo_fmu(&["validate", &path]);
    assert_eq!(validated.status.code(), Some(1));
    let expected = format!(
        "modelDescription.xml:2: error: {sentence} [version]\n    \
         Set `fmiVersion` to the version that the FMU implements.\n{path}: FMI 1.0, 1 error, 0 warnings\n"
    );
    assert_eq!(String::from_utf8(validated.stdout).unwrap(), expected);
    for format in ["text", "json"] {
        let info = cargo_fmu(&["info", &path, "--format", format]);
        assert_eq!((info.status.code(), info.stdout), (Some(2), vec![]));
        let message = String::from_utf8(info.stderr).unwrap();
        assert!(
            message.ends_with(&format!("modelDescription.xml in {path} cannot be read: {sentence}\n")),
            "{message}"
        );
    }
}

#[test]
fn several_fmus_are_validated_at_once() {
    let (good, bad) = (fmu("first.fmu", DESCRIPTION), fmu("second.fmu", &DESCRIPTION.replace("{1}", "")));
    let output = cargo_fmu(&["validate", &good, &bad]);
    assert_eq!(output.status.code(), Some(1));
    let output = String::from_utf8(output.stdout).unwrap();
    let of = |path: &str| output.find(&format!("{path}: FMI 2.0, ")).unwrap();
    assert!(of(&good) < of(&bad), "{output}");
    let reports = json(&["validate", &good, &bad, "--format", "json"]);
    assert_eq!((&reports[0]["file"], &reports[1]["file"]), (&json!(good), &json!(bad)));
    assert_eq!(cargo_fmu(&["validate", &good, "no such file.fmu"]).status.code(), Some(2));
}

#[test]
fn importers_are_named_by_the_user() {
    let array = r#"<Float64 name="x" valueReference="1" causality="parameter" start="0"><Dimension start="2"/></Float64>"#;
    let description = format!(
        r#"<fmiModelDescription fmiVersion="3.0" modelName="Tank" instantiationToken="1">
        <CoSimulation modelIdentifier="tank"/>
        <ModelVariables><Float64 name="time" valueReference="0" causality="independent"/>{array}</ModelVariables>
        <ModelStructure/></fmiModelDescription>"#
    );
    let path = archive_of(
        "array.fmu",
        &[("modelDescription.xml", description.as_bytes()), ("sources/buildDescription.xml", b"<fmiBuildDescription fmiVersion=\"3.0\"><BuildConfiguration modelIdentifier=\"tank\"/></fmiBuildDescription>")],
    );
    let output = cargo_fmu(&["validate", &path, "--importer", "pyfmi", "--importer", "CasADi"]);
    let expected = format!(
        "modelDescription.xml:3: note: x: it is an array, refused by CasADi 3.8.2, PyFMI 2.21.0 [array]\n    \
         Export the FMU for FMI 2.0, where each element is a variable.\n{path}: FMI 3.0, 0 errors, 0 warnings, 1 note\n"
    );
    assert_eq!(String::from_utf8(output.stdout).unwrap(), expected);
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(json(&["validate", &path, "--format", "json"])["findings"], json!([]));

    let unknown = cargo_fmu(&["validate", &path, "--importer", "Excel"]);
    assert_eq!(unknown.status.code(), Some(2));
    let message = String::from_utf8(unknown.stderr).unwrap();
    assert!(
        message.contains("'Excel'")
            && message.contains("CasADi, Chrono, fmi, FMI.jl, FMPy, OMSimulator, PyFMI"),
        "{message}"
    );
}

#[test]
fn info_is_told_as_json() {
    let path = fmu("info.fmu", DESCRIPTION);
    let info = json(&["info", &path, "--format", "json"]);
    let expected = json!({
        "file": path, "fmiVersion": "2.0", "modelName": "Tank", "guid": "{1}",
        "attributes": { "fmiVersion": "2.0", "modelName": "Tank", "guid": "{1}" },
        "interfaces": [{ "name": "CoSimulation", "attributes": { "modelIdentifier": "tank" } }],
        "defaultExperiment": { "stopTime": "10" },
        "libraries": [],
        "units": [{ "name": "m", "displayUnits": ["mm"] }],
        "enumerations": [{ "name": "Mode", "items": { "off": 0 } }],
        "variables": [{
            "name": "level", "valueReference": 7, "type": "Real", "dimensions": null, "declaredType": null,
            "causality": "input", "variability": "continuous", "initial": null, "unit": "m", "start": "1", "min": "0", "max": null,
            "description": "Of water", "aliases": [],
        }],
    });
    assert_eq!(info, expected);
    assert_described(&info, &["attributes", "defaultExperiment", "items"], &page());
    let aliased = fmu(
        "aliased.fmu",
        "<fmiModelDescription fmiVersion=\"3.0\"><ModelVariables><Float64 name=\"a\"><Alias name=\"b\" \
         description=\"of b\"/><Alias name=\"c\"/></Float64></ModelVariables></fmiModelDescription>",
    );
    let info = json(&["info", &aliased, "--format", "json"]);
    let expected = json!([{ "name": "b", "description": "of b" }, { "name": "c", "description": null }]);
    assert_eq!(info["variables"][0]["aliases"], expected);
    assert_described(&info, &["attributes", "defaultExperiment", "items"], &page());
}

#[test]
fn the_published_rules_are_those_of_the_command() {
    let rules = String::from_utf8(cargo_fmu(&["validate", "--rules"]).stdout).unwrap();
    assert!(
        page().contains(&rules),
        "run `cargo fmu validate --rules`, and put the tables into docs/validation.md"
    );
}

/// A damaged entry is one more finding of `validate`; other commands check what they read.
#[test]
fn a_damaged_entry_is_found_where_it_is_read() {
    let damaged = fmu("damaged.fmu", DESCRIPTION);
    let mut bytes = fs::read(&damaged).unwrap();
    // In the last entry's header of the central directory.
    let header = bytes.windows(4).rposition(|window| window == b"PK\x01\x02").unwrap();
    bytes[header + 24] += 1;
    fs::write(&damaged, bytes).unwrap();
    let library = "binaries/darwin64/VisualStudio/tank.lib";
    let finding = format!("{library}: error: it cannot be unpacked: its size is not what the archive states");
    let refusal = format!("its {library} cannot be read: its size is not what the archive states");
    for (arguments, status, message) in [
        (["validate", &damaged].as_slice(), 1, finding.as_str()),
        (&["info", &damaged], 0, ""),
        (&["merge", &damaged, "--out", "no.fmu"], 2, &refusal),
    ] {
        let output = cargo_fmu(arguments);
        let printed = [output.stdout, output.stderr].concat();
        assert_eq!(output.status.code(), Some(status), "{arguments:?}");
        assert!(str::from_utf8(&printed).unwrap().contains(message), "{arguments:?}");
    }
}

/// A program must not take an FMU that another one refuses.
#[test]
fn what_validate_finds_in_the_archive_is_refused_by_all_that_read_it() {
    let below = archive_of(
        "below.fmu",
        &[("modelDescription.xml", DESCRIPTION.as_bytes()), ("modelDescription.xml/x", b"")],
    );
    let linked = fmu("linked.fmu", DESCRIPTION);
    let file = fs::File::options().read(true).write(true).open(&linked).unwrap();
    let mut zip = zip::ZipWriter::new_append(file).unwrap();
    zip.add_symlink("resources/link", "/etc/passwd", zip::write::SimpleFileOptions::default()).unwrap();
    zip.finish().unwrap();
    let twice = archive_of("twice.fmu", &[("resources/one", b""), ("resources/two", b"")]);
    let mut bytes = fs::read(&twice).unwrap();
    for place in 0..bytes.len() - 13 {
        if bytes[place..].starts_with(b"resources/two") {
            bytes[place..place + 13].copy_from_slice(b"resources/one");
        }
    }
    fs::write(&twice, bytes).unwrap();
    for (path, entry) in
        [(&below, "modelDescription.xml/x"), (&linked, "resources/link"), (&twice, "resources/one")]
    {
        assert_eq!(cargo_fmu(&["validate", path]).status.code(), Some(1), "{path}");
        for arguments in [
            ["info", path].as_slice(),
            &["info", path, "--format", "json"],
            &["parameters", path, "--out", "no.ssv"],
            &["merge", path, "--out", "no.fmu"],
        ] {
            let output = cargo_fmu(arguments);
            let message = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
            assert!(message.contains(&format!("{path} is not an FMU: its entry '{entry}': ")), "{message}");
        }
    }
}
