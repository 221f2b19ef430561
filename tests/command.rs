//! The command, run as a user would: its error messages.

use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Command, Output};

use fmu_package::{Content, ElementDescription, End, Kind, Linear, SystemDescription};

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

/// An FMU with a description, and a library of its name for each platform of FMI 2.0, which no command here loads.
fn fmu_of(name: &str, description: &str) -> String {
    let (_, identifier) = description.split_once("modelIdentifier=\"").unwrap();
    let identifier = identifier.split_once('"').unwrap().0;
    let libraries = [("linux64", "so"), ("win64", "dll"), ("darwin64", "dylib")]
        .map(|(folder, suffix)| format!("binaries/{folder}/{identifier}.{suffix}"));
    let libraries = libraries.iter().map(|path| (path.as_str(), b"".as_slice()));
    let entries: Vec<_> =
        [("modelDescription.xml", description.as_bytes())].into_iter().chain(libraries).collect();
    archive_of(name, &entries)
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
    let other = fmu_of("other_plant.fmu", &description(""));
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
    let fitting = fmu_of("fitting_plant.fmu", &description(&variables));
    assert_eq!(code(&["check", &fitting, "--as", "plant"]), Some(0));
    assert_eq!(code(&["check", &fitting, "--as", "controller"]), Some(1));
}

/// Connections of a plant with the interface's names, but for its duty and boost pressure, as a file.
fn connections(duty: &str) -> String {
    format!(
        r#"connection = [
            {{ from = "controller:hp_wastegate_pwm", to = {duty} }},
            {{ from = "plant:pBoost", to = "controller:boost_pressure", from_unit = "bar" }},
        ]"#
    )
}

#[test]
fn connections_are_written_read_back_and_kept() {
    let variables = r#"<ScalarVariable name="pBoost" causality="output"><Real/></ScalarVariable>
        <ScalarVariable name="duty" causality="input"><Real/></ScalarVariable>"#;
    let fmu = fmu_of("connected.fmu", &description(variables));
    let file = scratch("connections.toml");
    let name = file.to_str().unwrap();
    let _ = fs::remove_file(&file);
    let check = |option: &str| boost_fmu(&["check", &fmu, "--as", "plant", option, name]);

    assert_eq!(check("--write-connections").status.code(), Some(1));
    let template = fs::read_to_string(&file).unwrap();
    for part in [
        "# Other as the plant: all connections, for a scenario or --connections\n",
        "\n# boost_pressure: missing; similar: pBoost\n# [[connection]]\n# from = \"plant:pBoost\"\n\
         # to = \"controller:boost_pressure\"\n",
        "\n# vacuum_pump: missing\n# [[connection]]\n# from = \"controller:vacuum_pump\"\n# to = \"plant:?\"\n",
        "\n[[connection]]\nfrom = \"boost_reference\"\nto = \"controller:boost_reference\"\n",
    ] {
        assert!(template.contains(part), "{template}");
    }
    // It can be read as it is, and as it is proposed.
    assert_eq!(check("--connections").status.code(), Some(0));
    fs::write(&file, template.replace("# [[", "[[").replace("# from", "from").replace("# to", "to")).unwrap();
    let output = check("--connections");
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(printed.contains("boost_pressure               pBoost"), "{printed}");
    assert!(output.status.code() == Some(1) && printed.contains("? is missing"), "{printed}");
    // An existing file is not overwritten.
    fs::write(&file, "mine").unwrap();
    assert_eq!(check("--write-map").status.code(), Some(2));
    assert_eq!(fs::read_to_string(&file).unwrap(), "mine");

    let edited = |text: &str| {
        fs::write(&file, text).unwrap();
        let output = check("--connections");
        let printed = [output.stdout, output.stderr].concat();
        (output.status.code().unwrap(), String::from_utf8(printed).unwrap())
    };
    for (list, reason) in [
        (
            r#"{ from = "engine:pBoost", to = "controller:boost_pressure" }"#,
            "engine is neither plant nor controller",
        ),
        (
            r#"{ from = "controller:command", to = "plant:duty" }"#,
            "no variable of the interface: controller:command and plant:duty",
        ),
        (
            r#"{ from = "throttle", to = "plant:engine_speed" }"#,
            "two different variables of the interface: throttle and plant:engine_speed",
        ),
        (
            r#"{ from = "throttle", to = "plant:a" }, { from = "throttle", to = "plant:b" }"#,
            "throttle is connected with both a and b",
        ),
        (
            r#"{ from = "throttle", to = "plant:?", too = 1 }"#,
            "connection[1].too: this key is not known; did you mean to?",
        ),
    ] {
        let (code, printed) = edited(&format!("connection = [{list}]"));
        assert!(
            code == 2 && printed.contains(reason) && printed.contains(&format!("{name}, line 1, ")),
            "{list}: {printed}"
        );
    }
    let (code, printed) = edited(r#"{"as": "plant", "fmu": "Other", "variables": {}}"#);
    assert!(code == 2 && printed.contains(&format!("{name} is JSON, as name maps were; ")), "{printed}");
    for (duty, expected, reason) in [
        (r#""plant:duty", to_unit = "1""#, 0, "hp_wastegate_pwm = 100 · duty"),
        (r#""plant:duty", factor = 0.02, offset = -0.5"#, 0, "hp_wastegate_pwm = 50 · duty + 25"),
        (r#""plant:dutie""#, 1, "dutie is missing; similar: duty"),
        (r#""plant:duty", to_unit = "V""#, 1, "the unit % does not convert to V"),
        (r#""plant:duty", to_unit = "furlong""#, 1, "the unit 'furlong' is not known"),
    ] {
        let (code, printed) = edited(&connections(duty));
        assert!(code == expected && printed.contains(reason), "{duty}: {code} {printed}");
        assert!(printed.contains("boost_pressure = 100000 · pBoost"), "{printed}");
        let open = "It replaces the plant only in part; not connected: vacuum_pump, lp_wastegate, hp_bypass, \
                    tank_pressure, supply_voltage_measured.";
        assert_eq!(code == 0, printed.contains(open), "{printed}");
    }
    // What was given is written again.
    let given = connections(r#""plant:duty", factor = 0.02, offset = -0.5"#);
    let copy = scratch("copy.toml");
    let _ = fs::remove_file(&copy);
    fs::write(&file, given).unwrap();
    let copy_name = copy.to_str().unwrap();
    boost_fmu(&["check", &fmu, "--as", "plant", "--connections", name, "--write-connections", copy_name]);
    let copied = fs::read_to_string(&copy).unwrap();
    for part in ["to = \"plant:duty\"\nfactor = 0.02\noffset = -0.5\n", "from_unit = \"bar\"\n"] {
        assert!(copied.contains(part), "{copied}");
    }
}

/// What the table suggests for a variable, the file proposes, even if the variable is not required.
#[test]
fn a_file_proposes_what_the_table_suggests() {
    let variables = r#"<ScalarVariable name="speed_engine" causality="input"><Real/></ScalarVariable>"#;
    let fmu = fmu_of("suggested.fmu", &description(variables));
    let file = scratch("suggested.toml");
    let _ = fs::remove_file(&file);
    let output = boost_fmu(&["check", &fmu, "--as", "plant", "--write-connections", file.to_str().unwrap()]);
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(printed.contains("missing; similar: speed_engine"), "{printed}");
    assert!(printed.contains("Those for engine_speed are proposals in comments"), "{printed}");
    let text = fs::read_to_string(&file).unwrap();
    let proposal = "# from = \"engine_speed\"\n# to = \"plant:speed_engine\"\n# from_unit = \"rpm\"\n";
    assert!(text.contains(proposal), "{text}");
}

/// Each proposal has a variable of its own, of any type of numbers, and none that another connection has. What is open is
/// listed, with what there is to fill in.
#[test]
fn a_file_of_connections_lists_all_and_proposes_one_source_for_one_input() {
    let variable = |name: &str, causality: &str, typed: &str| {
        format!(
            r#"<ScalarVariable name="{name}" causality="{causality}" description="What {name} is">{typed}</ScalarVariable>"#
        )
    };
    let variables = [
        variable("hp_wastegate_pwm", "input", "<Real/>"),
        variable("LpWastegate", "input", "<Boolean/>"),
        variable("vacuumPump", "input", "<Integer/>"),
        variable("gear", "input", "<Integer/>"),
        variable("label", "input", "<String/>"),
        variable("boostPressure", "output", r#"<Real unit="bar"/>"#),
        variable("torque", "output", "<Real/>"),
    ]
    .concat();
    let fmu = fmu_of("open.fmu", &description(&variables));
    let file = scratch("open.toml");
    let _ = fs::remove_file(&file);
    let output = boost_fmu(&["check", &fmu, "--as", "plant", "--write-connections", file.to_str().unwrap()]);
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(
        printed.contains("vacuum_pump, lp_wastegate, boost_pressure are proposals in comments"),
        "{printed}"
    );
    let text = fs::read_to_string(&file).unwrap();
    for (from, to) in [
        ("controller:vacuum_pump", "plant:vacuumPump"),
        ("controller:lp_wastegate", "plant:LpWastegate"),
        // These are like LpWastegate and hp_wastegate_pwm, too.
        ("controller:hp_bypass", "plant:?"),
        ("controller:surge_valve", "plant:?"),
        ("throttle", "plant:?"),
        ("engine_speed", "plant:?"),
        ("plant:boostPressure", "controller:boost_pressure"),
        ("plant:?", "controller:tank_pressure"),
        ("plant:?", "controller:hp_turbo_speed"),
    ] {
        let open = format!("# [[connection]]\n# from = \"{from}\"\n# to = \"{to}\"\n");
        assert!(text.contains(&open), "{open}: {text}");
    }
    let listed = "\n# inputs of Other without a connection:\n\
                  #   LpWastegate (Boolean): What LpWastegate is\n\
                  #   vacuumPump (Integer): What vacuumPump is\n\
                  #   gear (Integer): What gear is\n\
                  #   label (String): What label is\n\
                  \n# outputs of Other without a connection:\n\
                  #   boostPressure (Real, bar): What boostPressure is\n\
                  #   torque (Real): What torque is\n";
    assert!(text.ends_with(listed), "{text}");
}

/// An FMU whose library no importer finds does not fit; one for other platforms does not run here.
#[test]
fn a_missing_or_misnamed_library_is_told() {
    let [plant, _] = fitting("Libraries");
    let check = |entry: Option<&str>| {
        let entries = [("modelDescription.xml", plant.as_bytes())].into_iter();
        let entries: Vec<_> = entries.chain(entry.map(|path| (path, b"".as_slice()))).collect();
        let output = boost_fmu(&["check", &archive_of("libraries.fmu", &entries), "--as", "plant"]);
        (output.status.code().unwrap(), String::from_utf8(output.stdout).unwrap())
    };
    let (code, printed) = check(None);
    assert!(code == 1 && printed.contains("WRONG  it has neither libraries nor sources"), "{printed}");
    let (code, printed) = check(Some("binaries/linux64/Other.so"));
    let wrong = "WRONG  in its binaries/linux64/ there is no Libraries_input.so, but Other.so";
    assert!(code == 1 && printed.contains(wrong), "{printed}");
    for path in ["binaries/aarch64-windows/Libraries_input.dll", "sources/all.c"] {
        let (code, printed) = check(Some(path));
        let note = "It does not run on this platform: it has no binaries/";
        assert!(code == 0 && printed.contains(note), "{path}: {printed}");
    }
    let output = boost_fmu(&["check", &fmu_of("libraries.fmu", &plant), "--as", "plant"]);
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(printed.ends_with("It can replace the plant.\n"), "{printed}");
}

/// An array's element is a variable, as in a run, and none of a system's connectors.
#[test]
fn an_element_of_an_array_fits() {
    let folder = empty("elements");
    let float = |name: &str, causality: &str, size: &str| {
        format!(r#"<Float64 name="{name}" causality="{causality}" valueReference="1">{size}</Float64>"#)
    };
    let variables = [
        float("valves", "output", r#"<Dimension start="2"/>"#),
        ["hp_wastegate_pwm", "vacuum_pump"].map(|name| float(name, "output", "")).concat(),
        ["boost_pressure", "tank_pressure", "supply_voltage_measured"]
            .map(|name| float(name, "input", ""))
            .concat(),
    ]
    .concat();
    let [plant, _] = fitting("Elements");
    let controller = description(&variables).replace("\"2.0\"", "\"3.0\"");
    for (name, text) in [("plant.fmu", &plant), ("controller.fmu", &controller)] {
        fs::copy(fmu_of(name, text), folder.join(name)).unwrap();
    }
    let by_name = ["hp_wastegate_pwm", "vacuum_pump"]
        .map(|name| format!(r#"{{ from = "controller:{name}", to = "plant:{name}" }},"#));
    let measured = ["boost_pressure", "tank_pressure", "supply_voltage_measured"]
        .map(|name| format!(r#"{{ from = "plant:{name}", to = "controller:{name}" }},"#));
    let elements = r#"{ from = "controller:valves[1]", to = "plant:lp_wastegate" },
        { from = "controller:valves[2]", to = "plant:hp_bypass" }"#;
    let list = [by_name.concat(), measured.concat(), elements.to_owned()].concat();
    fs::write(folder.join("all.toml"), format!("connection = [{list}]")).unwrap();
    let files = ["--connections", "all.toml"];
    let check =
        boost_fmu_in(&folder, &[&["check", "controller.fmu", "--as", "controller"], &files[..]].concat());
    assert!(check.status.success(), "{}", String::from_utf8_lossy(&check.stdout));
    let couple = ["ssp", "--plant", "plant.fmu", "--controller", "controller.fmu"];
    let refused = boost_fmu_in(&folder, &[&couple[..], &files].concat());
    let message = String::from_utf8_lossy(&refused.stderr);
    let reason = "lp_wastegate: a system connects whole variables, and valves[1] is an array's element";
    assert!(message.contains(reason), "{message}");
}

/// Two FMUs of other makers, each with its own file: the system connects the names of both.
#[test]
fn the_files_of_two_fmus_go_together() {
    let folder = empty("two");
    for (role, (name, variables)) in [
        ("plant", ("Engine", [["hp_wastegate_pwm", "input"], ["p", "output"], ["n", "input"]])),
        (
            "controller",
            ("Law", [["duty", "output"], ["boost_pressure_signal", "input"], ["target", "input"]]),
        ),
    ] {
        let variables = variables.map(|[name, causality]| {
            format!(r#"<ScalarVariable name="{name}" causality="{causality}"><Real/></ScalarVariable>"#)
        });
        let text = description(&variables.concat()).replace("\"Other\"", &format!("\"{name}\""));
        let fmu = fmu_of(&format!("two_{role}.fmu"), &text);
        fs::copy(fmu, folder.join(format!("{role}.fmu"))).unwrap();
    }
    let plant = r#"connection = [
        { from = "controller:hp_wastegate_pwm", to = "plant:hp_wastegate_pwm" },
        { from = "plant:p", to = "controller:boost_pressure", from_unit = "bar" },
        { from = "engine_speed", to = "plant:n", to_unit = "rad/s" },
        { from = "boost_reference", to = "controller:boost_reference" }]"#;
    let controller = r#"connection = [
        { from = "controller:duty", to = "plant:hp_wastegate_pwm", from_unit = "1" },
        { from = "plant:boost_pressure", to = "controller:boost_pressure_signal" },
        { from = "boost_reference", to = "controller:target", to_unit = "kPa" },
        { from = "engine_speed", to = "plant:engine_speed" }]"#;
    fs::write(folder.join("plant.toml"), plant).unwrap();
    fs::write(folder.join("controller.toml"), controller).unwrap();
    let mut systems = vec![];
    for files in [["plant.toml", "controller.toml"], ["controller.toml", "plant.toml"]] {
        let mut arguments = vec!["ssp", "--plant", "plant.fmu", "--controller", "controller.fmu"];
        arguments.extend(files.iter().flat_map(|file| ["--connections", file]));
        let output = boost_fmu_in(&folder, &arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let system = system_of(&folder.join("Boost.ssp"));
        let Content::System { connections, .. } = system.content else { panic!("{system:?}") };
        let name = |end: End| format!("{}:{}", end.component.unwrap_or_default(), end.connector);
        let described = connections
            .into_iter()
            .map(|each| (name(each.start), name(each.end), each.transformation.linear().factor));
        systems.push(described.collect::<Vec<_>>());
    }
    let [one, other] = <[_; 2]>::try_from(systems).unwrap();
    assert_eq!(one, other);

    // bar to Pa, 1 to %, rpm to rad/s and Pa to kPa.
    for expected in [
        ("Law:duty", "Engine:hp_wastegate_pwm", 100.0),
        ("Engine:p", "Law:boost_pressure_signal", 1e5),
        (":engine_speed", "Engine:n", std::f64::consts::TAU / 60.0),
        (":boost_reference", "Law:target", 1e-3),
    ] {
        let found = one.iter().find(|(from, to, _)| (from.as_str(), to.as_str()) == (expected.0, expected.1));
        let factor = found.unwrap_or_else(|| panic!("{expected:?}: {one:?}")).2;
        // Up to the rounding of a quotient.
        assert!((factor / expected.2 - 1.0).abs() < 4.0 * f64::EPSILON, "{expected:?}: {factor}");
    }

    // For masters that zero inputs: one input remains, and the plant's speed is no connector any more.
    let files = ["--connections", "plant.toml", "--connections", "controller.toml"];
    let couple = ["ssp", "--plant", "plant.fmu", "--controller", "controller.fmu"];
    let output = boost_fmu_in(&folder, &[&couple[..], &files, &["--inputs", "boost_reference"]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let system = system_of(&folder.join("Boost.ssp"));
    let names = |element: &ElementDescription| -> Vec<_> {
        let inputs = element.connectors.iter().filter(|connector| connector.kind == Some(Kind::Input));
        inputs.map(|connector| connector.name.clone()).collect()
    };
    assert_eq!(names(&system), ["boost_reference"]);
    let Content::System { elements, connections, .. } = &system.content else { panic!("{system:?}") };
    assert_eq!(
        elements.iter().map(names).collect::<Vec<_>>(),
        [vec!["target", "boost_pressure_signal"], vec!["hp_wastegate_pwm"]]
    );
    assert_eq!(connections.iter().filter(|connection| connection.start.component.is_none()).count(), 1);
    let output = boost_fmu_in(&folder, &[&couple[..], &files, &["--inputs", "boost_refrence"]].concat());
    let message = String::from_utf8_lossy(&output.stderr);
    let reason =
        "--inputs boost_refrence: the system has no such input; it has boost_reference, engine_speed";
    assert!(message.contains(reason), "{message}");
}

/// SSP has tables of Booleans and of integers, and the interface is Real. What no line gives is refused.
#[test]
fn a_table_into_a_boolean_is_a_line_in_a_system() {
    let folder = empty("tables");
    let real = r#"name="vacuum_pump" causality="input"><Real/>"#;
    let boolean = r#"name="pump" causality="input"><Boolean/>"#;
    for (fmu, role) in fitting("Table").iter().zip(["plant", "controller"]) {
        let fmu = fmu_of(&format!("table_{role}.fmu"), &fmu.replace(real, boolean));
        fs::copy(fmu, folder.join(format!("{role}.fmu"))).unwrap();
    }
    let of_plant = ["hp_wastegate_pwm", "lp_wastegate", "hp_bypass"]
        .map(|name| format!(r#"{{ from = "controller:{name}", to = "plant:{name}" }}, "#));
    let of_controller = ["boost_pressure", "tank_pressure", "supply_voltage_measured"]
        .map(|name| format!(r#"{{ from = "plant:{name}", to = "controller:{name}" }}, "#));
    let ssp = ["ssp", "--plant", "plant.fmu", "--controller", "controller.fmu", "--connections", "all.toml"];
    for (more, expected) in [
        ("table = [[0, 1], [1, 0]]", Some((-1.0, 1.0))),
        ("table = [[1, 1], [0, 0]]", Some((1.0, 0.0))),
        ("factor = -1, offset = 1", Some((-1.0, 1.0))),
        ("table = [[0, 1], [1, 1]]", None),
        ("table = [[0, 0], [2, 1]]", None),
        ("table = [[0, 1], [1, 0], [2, 0]]", None),
        ("threshold = 0.5", None),
    ] {
        let pump = format!(r#"{{ from = "controller:vacuum_pump", to = "plant:pump", {more} }}"#);
        let list = [of_plant.concat(), of_controller.concat(), pump].concat();
        fs::write(folder.join("all.toml"), format!("connection = [{list}]")).unwrap();
        let check =
            boost_fmu_in(&folder, &["check", "plant.fmu", "--as", "plant", "--connections", "all.toml"]);
        assert!(check.status.success(), "{more}: {}", String::from_utf8_lossy(&check.stdout));
        let done = boost_fmu_in(&folder, &ssp);
        let message = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.success(), expected.is_some(), "{more}: {message}");
        let Some(expected) = expected else {
            assert!(message.contains("vacuum_pump: a system has no t"), "{more}: {message}");
            continue;
        };
        let system = system_of(&folder.join("Boost.ssp"));
        let Content::System { connections, .. } = system.content else { panic!("{more}") };
        let to_pump = connections.iter().find(|each| each.end.connector == "pump").expect(more);
        let Linear { factor, offset } = to_pump.transformation.linear();
        assert_eq!((factor, offset), expected, "{more}");
    }
}

/// The root system of a package.
fn system_of(package: &Path) -> ElementDescription {
    let mut archive = zip::ZipArchive::new(fs::File::open(package).unwrap()).unwrap();
    let mut structure = String::new();
    archive.by_name("SystemStructure.ssd").unwrap().read_to_string(&mut structure).unwrap();
    SystemDescription::parse(&structure).unwrap().system
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
fn outputs_that_are_inputs_are_refused() {
    let folder = empty("overlap");
    let [plant, controller] = fitting("Own");
    for (name, text) in [("plant.fmu", &plant), ("controller.fmu", &controller)] {
        fs::copy(fmu_of(name, text), folder.join(name)).unwrap();
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
