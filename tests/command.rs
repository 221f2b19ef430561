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

/// What an FMU's description holds around its variables.
fn description(variables: &str) -> String {
    format!(
        r#"<fmiModelDescription fmiVersion="2.0" modelName="Other" guid="g">
          <CoSimulation modelIdentifier="Other"/>
          <ModelVariables>{variables}</ModelVariables>
        </fmiModelDescription>"#
    )
}

#[test]
fn hostile_archives_are_refused_with_a_reason() {
    let nested = format!("{}{}", "<a>".repeat(1000), "</a>".repeat(1000));
    let entity = r#"<!DOCTYPE b [<!ENTITY a "aaaaaaaaaa"><!ENTITY c "&a;&a;&a;&a;&a;&a;&a;&a;">]>
        <fmiModelDescription modelName="&c;"/>"#;
    for (name, xml, reason) in [
        ("entities.fmu", entity, "it has a document type definition"),
        ("nested.fmu", nested.as_str(), "more than 100 elements lie in each other"),
        ("unknown_entity.fmu", r#"<fmiModelDescription modelName="&nothing;"/>"#, "fmiModelDescription"),
        ("twice.fmu", r#"<fmiModelDescription modelName="a" modelName="b"/>"#, "fmiModelDescription"),
        (
            "no_number.fmu",
            r#"<fmiModelDescription><UnitDefinitions><Unit name="u"><BaseUnit m="1.5"/>
            </Unit></UnitDefinitions></fmiModelDescription>"#,
            "the attribute m is '1.5'",
        ),
    ] {
        let archive = archive(name, "modelDescription.xml", xml);
        for arguments in [&["info", &archive][..], &["check", &archive, "--as", "plant"]] {
            let message = refusal(arguments);
            assert!(message.contains("is broken") && message.contains(reason), "{name}: {message}");
        }
    }
    let message = refusal(&["info", &archive("traversal.fmu", "../../evil.sh", "")]);
    assert!(message.contains("its entry '../../evil.sh' would be extracted outside"), "{message}");
}

#[test]
fn whether_an_fmu_fits_is_the_exit_code() {
    let code = |arguments: &[&str]| boost_fmu(arguments).status.code();
    let other = archive("other_plant.fmu", "modelDescription.xml", &description(""));
    assert_eq!(code(&["check", &other, "--as", "plant"]), Some(1));
    assert_eq!(code(&["check", "there is no such.fmu", "--as", "plant"]), Some(2));
    assert_eq!(code(&["check", &other, "--as", "engine"]), Some(2));

    let real = |name: &str, causality: &str| {
        format!(r#"<ScalarVariable name="{name}" causality="{causality}"><Real/></ScalarVariable>"#)
    };
    let variables = [
        real("hp_wastegate_pwm", "input"),
        real("vacuum_pump", "input"),
        real("lp_wastegate", "input"),
        real("hp_bypass", "input"),
        real("boost_pressure", "output"),
        real("tank_pressure", "output"),
        real("supply_voltage_measured", "output"),
    ]
    .concat();
    let fitting = archive("fitting_plant.fmu", "modelDescription.xml", &description(&variables));
    assert_eq!(code(&["check", &fitting, "--as", "plant"]), Some(0));
    assert_eq!(code(&["check", &fitting, "--as", "controller"]), Some(1));
}

#[test]
fn a_map_is_written_read_back_and_kept() {
    let variables = r#"<ScalarVariable name="pBoost" causality="output"><Real/></ScalarVariable>
        <ScalarVariable name="duty" causality="input"><Real/></ScalarVariable>"#;
    let fmu = archive("mapped.fmu", "modelDescription.xml", &description(variables));
    let map = scratch("map.json");
    let map_name = map.to_str().unwrap();
    let _ = fs::remove_file(&map);
    let check = |option: &str| boost_fmu(&["check", &fmu, "--as", "plant", option, map_name]);

    assert_eq!(check("--write-map").status.code(), Some(1));
    let template = fs::read_to_string(&map).unwrap();
    assert!(template.contains(r#""name": "pBoost""#), "{template}");
    // What is there is not written over.
    fs::write(&map, "mine").unwrap();
    assert_eq!(check("--write-map").status.code(), Some(2));
    assert_eq!(fs::read_to_string(&map).unwrap(), "mine");

    let edited = |text: &str| {
        fs::write(&map, text).unwrap();
        let output = check("--map");
        let said = [output.stdout, output.stderr].concat();
        (output.status.code().unwrap(), String::from_utf8(said).unwrap())
    };
    let map_of = |role: &str, fmu: &str, variables: &str| {
        format!(r#"{{"as": "{role}", "fmu": "{fmu}", "variables": {{{variables}}}}}"#)
    };
    // Names that are left open are asked for, by name.
    let (code, said) = edited(&template);
    assert!(code == 2 && said.contains("leaves the name for hp_bypass open"), "{said}");
    for (text, reason) in [
        (map_of("plant", "Other", r#""boost": null"#), "names boost, which is no variable of a plant"),
        (map_of("plant", "Another", ""), "the map is for the FMU Another, not for Other"),
        (map_of("controller", "Other", ""), "the map is for a controller, not for a plant"),
        (map_of("plant", "Other", r#""boost_pressure": {"nam": "pBoost"}"#), "unknown field `nam`"),
        ("{".to_owned(), "is not as it should be"),
    ] {
        let (code, said) = edited(&text);
        assert!(code == 2 && said.contains(reason), "{text}: {said}");
    }
    let unconnected = r#""vacuum_pump": null, "lp_wastegate": null, "hp_bypass": null, "tank_pressure": null,
        "supply_voltage_measured": null"#;
    for (duty, expected, reason) in [
        (r#"{"name": "duty", "unit": "1"}"#, 0, "hp_wastegate_pwm = 100 · duty"),
        (r#"{"name": "duty", "factor": 50, "offset": 25}"#, 0, "hp_wastegate_pwm = 50 · duty + 25"),
        (r#"{"name": "dutie"}"#, 1, "the map's dutie is missing; like it: duty"),
        (r#"{"name": "duty", "unit": "V"}"#, 1, "its unit V measures another thing than %"),
        (r#"{"name": "duty", "unit": "furlong"}"#, 1, "the map's unit furlong is not known"),
        (r#"{"name": "duty", "unit": "1", "factor": 2}"#, 1, "both a unit and a factor"),
        (r#"{"name": "duty", "factor": 0}"#, 1, "factor 0 and offset 0 are no conversion"),
    ] {
        let variables = format!(
            r#"{unconnected}, "boost_pressure": {{"name": "pBoost", "unit": "bar"}}, "hp_wastegate_pwm": {duty}"#
        );
        let (code, said) = edited(&map_of("plant", "Other", &variables));
        assert!(code == expected && said.contains(reason), "{duty}: {code} {said}");
        assert!(said.contains("boost_pressure = 100000 · pBoost"), "{said}");
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
