//! The command, run as a user would: its error messages.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

#[path = "../crates/cargo-fmu/tests/support/mod.rs"]
mod support;

use support::*;

fn boost_fmu(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_boost-fmu")).args(arguments).output().unwrap()
}

/// Runs the command in a folder.
fn boost_fmu_in(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_boost-fmu")).args(arguments).current_dir(folder).output().unwrap()
}

/// The message of a failing command.
fn refusal(arguments: &[&str]) -> String {
    let output = boost_fmu(arguments);
    assert!(!output.status.success(), "{arguments:?} succeeded");
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn exit_statuses_are_in_the_help() {
    let help = String::from_utf8(boost_fmu(&["--help"]).stdout).unwrap();
    for status in ["  0    ", "  1    ", "  2    ", "  130  "] {
        assert!(help.contains(status), "{help}");
    }
}

#[test]
fn hostile_archives_are_refused_with_a_reason() {
    let nested = format!("{}{}", "<a>".repeat(1000), "</a>".repeat(1000));
    let entity = r#"<!DOCTYPE b [<!ENTITY a "aaaaaaaaaa"><!ENTITY c "&a;&a;&a;&a;&a;&a;&a;&a;">]>
        <fmiModelDescription modelName="&c;"/>"#;
    for (name, xml, reason) in [
        ("entities.fmu", entity, "it has a document type definition"),
        ("nested.fmu", nested.as_str(), "it has more than 100 nested elements"),
        (
            "unknown_entity.fmu",
            r#"<fmiModelDescription modelName="&nothing;"/>"#,
            "line 1: unknown entity reference 'nothing'",
        ),
        ("control.fmu", r#"<fmiModelDescription modelName="&#27;"/>"#, "malformed entity reference"),
        (
            "twice.fmu",
            r#"<fmiModelDescription modelName="a" modelName="b"/>"#,
            "line 1: attribute 'modelName' is already defined",
        ),
        (
            "no_number.fmu",
            r#"<fmiModelDescription><UnitDefinitions><Unit name="u"><BaseUnit m="1.5"/>
            </Unit></UnitDefinitions></fmiModelDescription>"#,
            "the attribute m is '1.5'",
        ),
    ] {
        let archive = archive(name, "modelDescription.xml", xml);
        let message = refusal(&["check", &archive, "--as", "plant"]);
        assert!(message.contains("cannot be read") && message.contains(reason), "{name}: {message}");
    }
    let message = refusal(&["check", &archive("traversal.fmu", "../../evil.sh", ""), "--as", "plant"]);
    assert!(message.contains("its entry '../../evil.sh': it would be extracted outside"), "{message}");
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
    // An existing file is not overwritten.
    fs::write(&map, "mine").unwrap();
    assert_eq!(check("--write-map").status.code(), Some(2));
    assert_eq!(fs::read_to_string(&map).unwrap(), "mine");

    let edited = |text: &str| {
        fs::write(&map, text).unwrap();
        let output = check("--map");
        let printed = [output.stdout, output.stderr].concat();
        (output.status.code().unwrap(), String::from_utf8(printed).unwrap())
    };
    let map_of = |role: &str, fmu: &str, variables: &str| {
        format!(r#"{{"as": "{role}", "fmu": "{fmu}", "variables": {{{variables}}}}}"#)
    };
    // Names that are left open are reported.
    let (code, printed) = edited(&template);
    assert!(code == 2 && printed.contains("leaves the name for hp_bypass open"), "{printed}");
    for (text, reason) in [
        (map_of("plant", "Other", r#""boost": null"#), "names boost, which is not a variable of a plant"),
        (map_of("plant", "Another", ""), "the map is for the FMU Another, not for Other"),
        (map_of("controller", "Other", ""), "the map is for a controller, not for a plant"),
        (map_of("plant", "Other", r#""boost_pressure": {"nam": "pBoost"}"#), "unknown field `nam`"),
        ("{".to_owned(), "is not valid"),
    ] {
        let (code, printed) = edited(&text);
        assert!(code == 2 && printed.contains(reason) && printed.contains(map_name), "{text}: {printed}");
    }
    let unconnected = r#""vacuum_pump": null, "lp_wastegate": null, "hp_bypass": null, "tank_pressure": null,
        "supply_voltage_measured": null"#;
    for (duty, expected, reason) in [
        (r#"{"name": "duty", "unit": "1"}"#, 0, "hp_wastegate_pwm = 100 · duty"),
        (r#"{"name": "duty", "factor": 50, "offset": 25}"#, 0, "hp_wastegate_pwm = 50 · duty + 25"),
        (r#"{"name": "dutie"}"#, 1, "the map's dutie is missing; similar: duty"),
        (r#"{"name": "duty", "unit": "V"}"#, 1, "its unit V has another dimension than %"),
        (r#"{"name": "duty", "unit": "furlong"}"#, 1, "the map's unit furlong is not known"),
        (r#"{"name": "duty", "unit": "1", "factor": 2}"#, 1, "both a unit and a factor"),
        (r#"{"name": "duty", "factor": 0}"#, 1, "factor 0 and offset 0 are not a conversion"),
    ] {
        let variables = format!(
            r#"{unconnected}, "boost_pressure": {{"name": "pBoost", "unit": "bar"}}, "hp_wastegate_pwm": {duty}"#
        );
        let (code, printed) = edited(&map_of("plant", "Other", &variables));
        assert!(code == expected && printed.contains(reason), "{duty}: {code} {printed}");
        assert!(printed.contains("boost_pressure = 100000 · pBoost"), "{printed}");
        let open = "It replaces the plant only in part: the map leaves vacuum_pump, lp_wastegate, hp_bypass, \
                    tank_pressure, supply_voltage_measured unconnected.";
        assert_eq!(code == 0, printed.contains(open), "{printed}");
    }
}

/// What the table suggests for a variable, the map proposes, even if the variable is not required.
#[test]
fn a_map_proposes_what_the_table_suggests() {
    let variables = r#"<ScalarVariable name="speed_engine" causality="input"><Real/></ScalarVariable>"#;
    let fmu = archive("suggested.fmu", "modelDescription.xml", &description(variables));
    let map = scratch("suggested.json");
    let _ = fs::remove_file(&map);
    let output = boost_fmu(&["check", &fmu, "--as", "plant", "--write-map", map.to_str().unwrap()]);
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(printed.contains("missing; similar: speed_engine"), "{printed}");
    assert!(printed.contains("Its names for engine_speed are proposals"), "{printed}");
    let map = fs::read_to_string(&map).unwrap();
    let proposal = "\"engine_speed\": {\n      \"name\": \"speed_engine\",\n      \"candidates\": [\n        \"speed_engine\"";
    assert!(map.contains(proposal), "{map}");
}

/// The names in a folder.
fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// The descriptions of a plant and a controller that fit, with a name.
fn fitting(name: &str) -> [String; 2] {
    let real = |name: &&str, causality: &str| {
        format!(r#"<ScalarVariable name="{name}" causality="{causality}"><Real/></ScalarVariable>"#)
    };
    let commands = ["hp_wastegate_pwm", "vacuum_pump", "lp_wastegate", "hp_bypass"];
    let measurements = ["boost_pressure", "tank_pressure", "supply_voltage_measured"];
    [["input", "output"], ["output", "input"]].map(|[of_commands, of_measurements]| {
        let variables: String = commands
            .iter()
            .map(|name| real(name, of_commands))
            .chain(measurements.iter().map(|name| real(name, of_measurements)))
            .collect();
        description(&variables).replace("\"Other\"", &format!("\"{name}_{of_commands}\""))
    })
}

#[test]
fn an_identifier_that_is_a_path_is_refused_by_every_command() {
    let folder = empty("identifiers");
    let inner = folder.join("a/b");
    fs::create_dir_all(&inner).unwrap();
    let [plant, controller] = fitting("Evil");
    let evil = plant.replace(r#"modelIdentifier="Evil_input""#, "modelIdentifier=\"../../evil\u{9b}2J\"");
    let evil = archive("evil.fmu", "modelDescription.xml", &evil);
    let controller = archive("controller.fmu", "modelDescription.xml", &controller);
    for arguments in [
        ["check", &evil, "--as", "plant"].as_slice(),
        &["ssp", "--plant", &evil, "--controller", &controller],
    ] {
        let output = boost_fmu_in(&inner, arguments);
        let printed = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
        assert_eq!(output.status.code(), Some(2), "{printed}");
        let reason = r"the modelIdentifier '../../evil\u{9b}2J' is not a C identifier";
        assert!(printed.contains(&evil) && printed.contains(reason), "{arguments:?}: {printed}");
        assert!(!printed.contains('\u{9b}'), "{printed:?}");
    }
    assert_eq!(names(&folder), ["a"]);
    assert!(names(&inner).is_empty());
}

#[test]
fn a_description_does_not_control_the_terminal() {
    let harm = "\u{9d}0;title\u{9c}\u{9b}31m\u{202e}&#10;";
    let shown = r"\u{9d}0;title\u{9c}\u{9b}31m\u{202e}\n";
    let text = description("").replace(r#"modelName="Other""#, &format!(r#"modelName="e{harm}""#));
    let fmu = archive("harm.fmu", "modelDescription.xml", &text);
    let printed = |arguments: &[&str]| {
        let output = boost_fmu_in(&empty("harm"), arguments);
        let printed = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
        assert!(printed.chars().all(|character| character == '\n' || !character.is_control()), "{printed:?}");
        printed
    };
    assert!(printed(&["check", &fmu, "--as", "plant"]).contains(&format!("e{shown}")));
}

#[test]
fn outputs_that_are_inputs_are_refused() {
    let folder = empty("overlap");
    let [plant, controller] = fitting("Own");
    for (name, text) in [("plant.fmu", &plant), ("controller.fmu", &controller)] {
        fs::copy(archive(name, "modelDescription.xml", text), folder.join(name)).unwrap();
    }
    fs::write(folder.join("set.ssv"), "mine").unwrap();
    let plant = fs::read(folder.join("plant.fmu")).unwrap();
    let ssp =
        ["ssp", "--plant", "plant.fmu", "--controller", "controller.fmu", "--parameters", "set.ssv", "--out"];
    for (arguments, lost) in
        [([&ssp[..], &["plant.fmu"]].concat(), "plant.fmu"), ([&ssp[..], &["./set.ssv"]].concat(), "set.ssv")]
    {
        let output = boost_fmu_in(&folder, &arguments);
        let printed = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{printed}");
        assert!(printed.contains(&format!("the input {lost} would be lost")), "{printed}");
    }
    assert_eq!(fs::read(folder.join("plant.fmu")).unwrap(), plant);
    assert_eq!(names(&folder), ["controller.fmu", "plant.fmu", "set.ssv"]);
}

/// As on a full disk: no part of the file is left, and the error is reported once.
#[cfg(unix)]
#[test]
fn a_failed_write_leaves_no_file() {
    let folder = empty("full");
    let [plant, controller] = fitting("Full");
    let plant = archive("full_plant.fmu", "modelDescription.xml", &plant);
    let controller = archive("full_controller.fmu", "modelDescription.xml", &controller);
    let output = Command::new("sh")
        .args(["-c", "trap '' XFSZ; ulimit -f 1; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_boost-fmu")])
        .args(["ssp", "--plant", &plant, "--controller", &controller, "--out", "system.ssp"])
        .current_dir(&folder)
        .output()
        .unwrap();
    let printed = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{printed}");
    assert_eq!(printed.matches("File too large").count(), 1, "{printed}");
    assert!(names(&folder).is_empty(), "{:?}", names(&folder));
}

#[test]
fn too_large_contents_are_refused() {
    if cfg!(unix) {
        let [plant, controller] = fitting("Large");
        let plant = archive("large_plant.fmu", "modelDescription.xml", &plant);
        let controller = archive("large_controller.fmu", "modelDescription.xml", &controller);
        let ssp = ["ssp", "--plant", &plant, "--controller", &controller, "--out", "no.ssp"];
        for arguments in [
            [&ssp[..], &["--parameters", "/dev/zero"]].concat(),
            [&ssp[..], &["--map", "/dev/zero"]].concat(),
            vec!["check", &plant, "--as", "plant", "--map", "/dev/zero"],
        ] {
            let message = refusal(&arguments);
            assert!(message.contains("/dev/zero: it is larger than 67108864 bytes"), "{message}");
        }
        let message = refusal(&["export", "--binary", "linux64=/dev/zero"]);
        assert!(message.contains("/dev/zero: it is larger than 1073741824 bytes"), "{message}");
    }
}
