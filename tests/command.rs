//! The command, run as a user would: its answers to what is wrong.

use std::collections::BTreeMap;
use std::fs;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn boost_fmu(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_boost-fmu")).args(arguments).output().unwrap()
}

/// Runs the command in a folder.
fn boost_fmu_in(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_boost-fmu")).args(arguments).current_dir(folder).output().unwrap()
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
    archive_of(name, &[(entry, content.as_bytes())])
}

/// A ZIP archive.
fn archive_of(name: &str, entries: &[(&str, &[u8])]) -> String {
    let path = scratch(name);
    let mut zip = zip::ZipWriter::new(fs::File::create(&path).unwrap());
    for (entry, content) in entries {
        zip.start_file(*entry, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(content).unwrap();
    }
    zip.finish().unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn exit_statuses_are_in_the_help() {
    let help = String::from_utf8(boost_fmu(&["--help"]).stdout).unwrap();
    for status in ["  0    ", "  1    ", "  2    ", "  130  "] {
        assert!(help.contains(status), "{help}");
    }
}

#[test]
fn an_unknown_model_is_refused_with_the_known_ones() {
    let message = refusal(&["export", "BoostPlan"]);
    assert!(message.contains("no model BoostPlan"), "{message}");
    assert!(message.contains("BoostController, BoostPlant"), "{message}");
}

#[test]
fn a_target_without_its_tools_is_refused_with_their_names() {
    let refusal = |target: &[&str], variables: &[(&str, &str)]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_boost-fmu"));
        command.arg("export").env_remove("CARGO_UNSTABLE_BUILD_STD").env_remove("RUSTC");
        for target in target {
            command.args(["--target", target]);
        }
        let output = command.envs(variables.iter().copied()).output().unwrap();
        assert!(!output.status.success(), "{target:?} succeeded");
        String::from_utf8(output.stderr).unwrap()
    };
    let expect = |target: &[&str], variables: &[(&str, &str)], reason: &str| {
        let message = refusal(target, variables);
        assert!(message.contains(reason), "{target:?}: {message}");
    };
    expect(&["amiga"], &[], "FMI 2.0 has no platform 'amiga'; it has aarch64-darwin, aarch64-linux");
    expect(&["x86_64-unknown-linux-musl"], &[], "not a Rust target that FMUs are built for");
    expect(&["x86_64-apple-darwin.2.17"], &[], "only targets with glibc take its version");

    // A compiler that answers with a folder that is not there, and one that fails.
    let target = "i686-unknown-linux-gnu";
    let brings = "echo has no standard library for i686-unknown-linux-gnu: `rustup target add \
                  i686-unknown-linux-gnu` brings it; without rustup, cargo can build it";
    expect(&[target], &[("RUSTC", "echo")], brings);
    expect(&[target], &[("RUSTC", "false")], "false does not know the target i686-unknown-linux-gnu");
    expect(&[target], &[("RUSTC", "no such compiler")], "cannot run no such compiler");

    // No linker is found where there are no programs; cargo would build the standard library.
    let nothing = [("CARGO_UNSTABLE_BUILD_STD", "std"), ("PATH", env!("CARGO_TARGET_TMPDIR"))];
    let pip = "`pip install cargo-zigbuild` brings it, and zig";
    expect(&["x86_64-unknown-linux-gnu.2.17"], &nothing, pip);
    expect(&["x86_64-pc-windows-gnu"], &nothing, "`apt-get install gcc-mingw-w64-x86-64` brings it");
    expect(
        &["x86_64-pc-windows-msvc"],
        &nothing,
        "no linker for x86_64-pc-windows-msvc is known here; CARGO_TARGET_X86_64_PC_WINDOWS_MSVC_LINKER names one",
    );
    expect(
        &["win64", "x86_64-pc-windows-msvc"],
        &nothing,
        "x86_64-pc-windows-gnu and x86_64-pc-windows-msvc are both for win64",
    );
}

/// The headers of a shared library of ELF, with what makes its bytes differ.
fn elf(machine: u8, content: &str) -> Vec<u8> {
    // e_ident: 64 bits, little-endian; e_type ET_DYN; e_machine; e_version; at 52 the size of this header.
    let mut bytes = [b"\x7fELF\x02\x01\x01".as_slice(), &[0; 9], &[3, 0, machine, 0, 1]].concat();
    bytes.resize(64, 0);
    bytes[52] = 64;
    [bytes, content.into()].concat()
}

/// The headers of a shared library of Mach-O.
fn mach_o(processor: u8, content: &str) -> Vec<u8> {
    // The magic number of 64 bits; the processor's type, whose last byte says 64 bits; the file type MH_DYLIB.
    let header = [0xcf, 0xfa, 0xed, 0xfe, processor, 0, 0, 1, 0, 0, 0, 0, 6];
    let mut bytes = header.to_vec();
    bytes.resize(32, 0);
    [bytes, content.into()].concat()
}

const ELF_X86_64: u8 = 62;
const ELF_AARCH64: u8 = 183;
const MACH_O_X86_64: u8 = 7;
const MACH_O_ARM64: u8 = 12;

#[test]
fn a_library_of_another_platform_is_refused_before_anything_is_built() {
    let library = scratch("library");
    for (content, folder, reason) in [
        (elf(ELF_X86_64, ""), "win64", "it is ELF for x86-64; win64 takes PE for x86-64"),
        (elf(ELF_AARCH64, ""), "linux64", "it is ELF for aarch64; linux64 takes ELF for x86-64"),
        (elf(ELF_X86_64, ""), "darwin64", "darwin64 takes Mach-O for x86-64 or aarch64"),
        (elf(20, ""), "linux64", "it is for the processor PowerPc"),
        (mach_o(MACH_O_X86_64, ""), "aarch64-darwin", "aarch64-darwin takes Mach-O for aarch64"),
        (b"a text".to_vec(), "linux64", "it is not a shared library"),
    ] {
        fs::write(&library, content).unwrap();
        let binary = format!("{folder}={}", library.display());
        let message = refusal(&["export", "--binary", &binary]);
        assert!(message.contains(&format!("cannot be the library for {folder}")), "{message}");
        assert!(message.contains(reason), "{reason}: {message}");
    }
    let message = refusal(&["export", "--binary", "linux64"]);
    assert!(message.contains("there is no '=' in it"), "{message}");
    let message = refusal(&["export", "--binary", "win64=there is no such.dll"]);
    assert!(message.contains("cannot read there is no such.dll"), "{message}");
}

/// An FMU of the model `Other`.
fn fmu_of(name: &str, entries: &[(&str, &[u8])]) -> String {
    let description = description("");
    archive_of(name, &[&[("modelDescription.xml", description.as_bytes())], entries].concat())
}

/// The files of an archive, and whether its first is the description.
fn files_of(path: &str) -> BTreeMap<String, Vec<u8>> {
    let mut zip = zip::ZipArchive::new(fs::File::open(path).unwrap()).unwrap();
    assert_eq!(zip.by_index(0).unwrap().name().unwrap(), "modelDescription.xml");
    (0..zip.len())
        .map(|index| {
            let mut entry = zip.by_index(index).unwrap();
            let mut content = vec![];
            entry.read_to_end(&mut content).unwrap();
            (entry.name().unwrap().into_owned(), content)
        })
        .collect()
}

#[test]
fn libraries_of_several_fmus_are_merged() {
    let out = scratch("merged.fmu");
    let merged = out.to_str().unwrap();
    let (x86, arm) = (elf(ELF_X86_64, "x86"), elf(ELF_AARCH64, "arm"));
    let (intel, apple) = (mach_o(MACH_O_X86_64, "intel"), mach_o(MACH_O_ARM64, "apple"));
    let license = ("documentation/licenses/LICENSE", b"free".as_slice());
    let linux = [
        license,
        ("documentation/licenses/rust-1.90.0.html", b"notices"),
        ("binaries/linux64/Other.so", &x86),
        ("binaries/darwin64/Other.dylib", &intel),
    ];
    let linux = fmu_of("linux.fmu", &linux);
    // What is the same in both is no matter, nor is what else lies beside a library or has another license.
    let arm = [
        license,
        ("documentation/licenses/rust-1.91.0.html", b"later notices"),
        ("binaries/linux64/Other.so", &x86),
        ("binaries/aarch64-linux/Other.so", &arm),
        ("binaries/aarch64-linux/dependency.so", b"other"),
        ("binaries/darwin64/Other.dylib", &apple),
    ];
    let arm = fmu_of("arm.fmu", &arm);

    let merge = |fmus: [&str; 2], options: &[&str]| {
        let output = boost_fmu(&[&["merge"], &fmus[..], &["--out", merged], options].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        (fs::read(&out).unwrap(), String::from_utf8(output.stdout).unwrap())
    };
    let (bytes, list) = merge([&linux, &arm], &["--ran", "linux64=Debian 12"]);
    let lines: Vec<_> = list.lines().skip(2).collect();
    assert_eq!(
        lines,
        [
            "aarch64-linux: ELF for aarch64; only built",
            "darwin64: Mach-O for aarch64 and x86-64; only built",
            "linux64: ELF for x86-64; run: Debian 12",
        ]
    );
    let files = files_of(merged);
    assert_eq!(files["documentation/platforms.txt"], list.as_bytes());
    assert_eq!(files["documentation/licenses/LICENSE"], b"free");
    assert_eq!(files["binaries/linux64/Other.so"], x86);
    assert_eq!(files["binaries/aarch64-linux/dependency.so"], b"other");
    // A universal library holds those of both processors as they were.
    let universal = &files["binaries/darwin64/Other.dylib"];
    for library in [&intel, &apple] {
        assert!(universal.windows(library.len()).any(|window| window == library));
    }
    assert_eq!(files["documentation/licenses/rust-1.90.0.html"], b"notices");
    assert_eq!(files["documentation/licenses/rust-1.91.0.html"], b"later notices");
    assert_eq!(files.len(), 9);

    // The order makes no difference, and what was run is remembered.
    let again = scratch("merged_before.fmu");
    fs::copy(&out, &again).unwrap();
    assert_eq!(merge([&arm, &linux], &["--ran", "linux64=Debian 12"]).0, bytes);
    let again = again.to_str().unwrap();
    assert_eq!(merge([again, again], &[]).0, bytes);
}

#[test]
fn fmus_that_do_not_belong_together_are_not_merged() {
    let library = elf(ELF_X86_64, "");
    let linux64 = "binaries/linux64/Other.so";
    let own = fmu_of("own.fmu", &[(linux64, &library)]);
    let universal = [("binaries/darwin64/Other.dylib", mach_o(MACH_O_ARM64, "a"))];
    let apple = fmu_of("apple.fmu", &[(universal[0].0, &universal[0].1)]);
    let out = scratch("refused.fmu");
    let refused = |first: &str, other: &str, reasons: &[&str], options: &[&str]| {
        let message = refusal(&[&["merge", first, other, "--out", out.to_str().unwrap()], options].concat());
        for reason in reasons {
            assert!(message.contains(reason), "{reason}: {message}");
        }
    };

    let text = description("");
    let model = |name: &str, text: &str| archive(name, "modelDescription.xml", text);
    let other = model("other_guid.fmu", &text.replace(r#"guid="g""#, r#"guid="h""#));
    refused(&own, &other, &[&own, &other, "are different models, with the GUIDs g and h"], &[]);
    let other = model("other_text.fmu", &text.replace("2.0", "2.1"));
    refused(&own, &other, &["have the GUID g and yet different descriptions"], &[]);
    let other = archive("no_description.fmu", linux64, "");
    refused(&own, &other, &["there is no modelDescription.xml in", "no_description.fmu"], &[]);

    let other = fmu_of("other_library.fmu", &[(linux64, &elf(ELF_X86_64, "other"))]);
    refused(&own, &other, &[&own, &other, "both hold binaries/linux64/Other.so, and these differ"], &[]);
    let same = [("binaries/darwin64/Other.dylib", mach_o(MACH_O_ARM64, "b"))];
    let other = fmu_of("apple_again.fmu", &[(same[0].0, &same[0].1)]);
    refused(&apple, &other, &["both hold binaries/darwin64/Other.dylib", "duplicated architecture"], &[]);
    let other = fmu_of("wrong_folder.fmu", &[("binaries/win64/Other.dll", &library)]);
    refused(&own, &other, &["the library for win64 in", "wrong_folder.fmu", "it is ELF for x86-64"], &[]);
    let other = fmu_of("other_license.fmu", &[("documentation/license.txt", b"")]);
    refused(&own, &other, &["differ in documentation/license.txt"], &[]);
    let license = "documentation/licenses/license.txt";
    let [one, other] = [("one_license.fmu", b"one"), ("another_license.fmu", b"two")]
        .map(|(name, text)| fmu_of(name, &[(license, text)]));
    refused(&one, &other, &["differ in documentation/licenses/license.txt"], &[]);

    refused(&own, &own, &["there is no library for win64 that was run"], &["--ran", "win64=here"]);
    refused(&own, &own, &["--ran is given twice for linux64"], &["--ran", "linux64=a", "--ran", "linux64=b"]);
    let other = archive("traversal_merge.fmu", "../evil", "");
    refused(&own, &other, &["would be extracted outside"], &[]);
    assert!(!out.exists());
}

#[test]
fn info_says_why_a_file_is_no_fmu() {
    let missing = refusal(&["info", "there is no such.fmu"]);
    assert!(missing.contains("cannot open there is no such.fmu"), "{missing}");

    let text = scratch("text.fmu");
    fs::write(&text, "no archive").unwrap();
    let message = refusal(&["info", text.to_str().unwrap()]);
    assert!(message.contains("it is not a ZIP archive"), "{message}");

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
        (map_of("plant", "Other", r#""boost": null"#), "names boost, which is not a variable of a plant"),
        (map_of("plant", "Another", ""), "the map is for the FMU Another, not for Other"),
        (map_of("controller", "Other", ""), "the map is for a controller, not for a plant"),
        (map_of("plant", "Other", r#""boost_pressure": {"nam": "pBoost"}"#), "unknown field `nam`"),
        ("{".to_owned(), "is not as it should be"),
    ] {
        let (code, said) = edited(&text);
        assert!(code == 2 && said.contains(reason) && said.contains(map_name), "{text}: {said}");
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
        (r#"{"name": "duty", "factor": 0}"#, 1, "factor 0 and offset 0 are not a conversion"),
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

/// A folder of its own, empty.
fn empty(name: &str) -> PathBuf {
    let folder = scratch(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir(&folder).unwrap();
    folder
}

/// The names in a folder.
fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// The descriptions of a plant and a controller that fit, of a name.
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
    let evil = plant.replace(r#"modelIdentifier="Evil_input""#, r#"modelIdentifier="../../evil&#27;[2J""#);
    let evil = archive("evil.fmu", "modelDescription.xml", &evil);
    let controller = archive("controller.fmu", "modelDescription.xml", &controller);
    for arguments in [
        ["parameters", &evil].as_slice(),
        &["info", &evil],
        &["check", &evil, "--as", "plant"],
        &["merge", &evil, "--out", "merged.fmu"],
        &["ssp", "--plant", &evil, "--controller", &controller],
    ] {
        let output = boost_fmu_in(&inner, arguments);
        let said = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
        assert_eq!(output.status.code(), Some(2), "{said}");
        let reason = r"the modelIdentifier '../../evil\u{1b}[2J' is not an identifier of C";
        assert!(said.contains(&evil) && said.contains(reason), "{arguments:?}: {said}");
        assert!(!said.contains('\u{1b}'), "{said:?}");
    }
    assert_eq!(names(&folder), ["a"]);
    assert!(names(&inner).is_empty());
}

/// In names, units, descriptions, and where there is an error in them.
#[test]
fn a_description_does_not_control_the_terminal() {
    let harm = "&#27;]0;title&#7;\u{9b}31m\u{202e}&#10;";
    let shown = r"\u{1b}]0;title\u{7}\u{9b}31m\u{202e}\n";
    let variable = format!(
        r#"<ScalarVariable name="a{harm}" causality="input" description="b{harm}"><Real unit="c{harm}" start="d{harm}"/>
        </ScalarVariable>"#
    );
    let text = description(&variable).replace(r#"modelName="Other""#, &format!(r#"modelName="e{harm}""#));
    let fmu = archive("harm.fmu", "modelDescription.xml", &text);
    let said = |arguments: &[&str]| {
        let output = boost_fmu_in(&empty("harm"), arguments);
        let said = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
        assert!(said.chars().all(|character| character == '\n' || !character.is_control()), "{said:?}");
        said
    };
    let table = said(&["info", &fmu]);
    for name in ["a", "b", "c", "d", "e"] {
        assert!(table.contains(&format!("{name}{shown}")), "{table}");
    }
    assert!(said(&["check", &fmu, "--as", "plant"]).contains(&format!("e{shown}")));
    let broken = archive("harm_in_tag.fmu", "modelDescription.xml", "<a></\u{1b}[2J>");
    assert!(said(&["info", &broken]).contains(r"\u{1b}[2J"));
    let entry = archive("harm_in_entry.fmu", "../\u{1b}[2J", "");
    assert!(said(&["info", &entry]).contains(r"'../\u{1b}[2J'"));
}

/// What is there in the end is one of both, and what others keep beside it is theirs.
#[test]
fn two_processes_with_one_output_write_one_of_both() {
    let folder = empty("race");
    let packages = ["One", "Another"].map(|name| {
        let [plant, controller] = fitting(name);
        let plant = archive(&format!("race_{name}_plant.fmu"), "modelDescription.xml", &plant);
        let controller = archive(&format!("race_{name}_controller.fmu"), "modelDescription.xml", &controller);
        let arguments = ["ssp", "--plant", &plant, "--controller", &controller, "--out", "race.ssp"];
        let arguments = arguments.map(str::to_owned);
        let output = boost_fmu_in(&folder, &arguments.each_ref().map(String::as_str));
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        (arguments, fs::read(folder.join("race.ssp")).unwrap())
    });
    assert_ne!(packages[0].1, packages[1].1);
    fs::write(folder.join("race.ssp.new"), "mine").unwrap();
    for _ in 0..20 {
        let both = packages.each_ref().map(|(arguments, _)| {
            let mut command = Command::new(env!("CARGO_BIN_EXE_boost-fmu"));
            command.args(arguments).current_dir(&folder).stdout(Stdio::null()).spawn().unwrap()
        });
        for mut process in both {
            assert!(process.wait().unwrap().success());
        }
        let written = fs::read(folder.join("race.ssp")).unwrap();
        assert!(packages.iter().any(|(_, package)| *package == written));
    }
    assert_eq!(fs::read_to_string(folder.join("race.ssp.new")).unwrap(), "mine");
    assert_eq!(names(&folder), ["race.ssp", "race.ssp.new"]);
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
    for (arguments, lost) in [
        ([&ssp[..], &["plant.fmu"]].concat(), "plant.fmu"),
        ([&ssp[..], &["./set.ssv"]].concat(), "set.ssv"),
        (vec!["merge", "plant.fmu", "--out", "../overlap/plant.fmu"], "plant.fmu"),
    ] {
        let output = boost_fmu_in(&folder, &arguments);
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(&format!("the input {lost} would be lost")), "{said}");
    }
    assert_eq!(fs::read(folder.join("plant.fmu")).unwrap(), plant);
    assert_eq!(names(&folder), ["controller.fmu", "plant.fmu", "set.ssv"]);
}

/// As on a full disk: nothing is left of what could not be written, and it is said once.
#[cfg(unix)]
#[test]
fn a_failed_write_leaves_no_file() {
    let folder = empty("full");
    let [plant, controller] = fitting("Full");
    let parameter = |index: u32| {
        let name = format!(r#"name="p{index}" causality="parameter" variability="fixed""#);
        format!(r#"<ScalarVariable {name}><Real start="{index}"/></ScalarVariable>"#)
    };
    let parameters = (0..2000).map(parameter).collect::<Vec<_>>().concat();
    let plant = plant.replace("<ModelVariables>", &format!("<ModelVariables>{parameters}"));
    let plant = archive("full_plant.fmu", "modelDescription.xml", &plant);
    let controller = archive("full_controller.fmu", "modelDescription.xml", &controller);
    for arguments in [
        ["parameters", &plant, "--out", "set.ssv"].as_slice(),
        &["merge", &plant, "--out", "merged.fmu"],
        &["ssp", "--plant", &plant, "--controller", &controller, "--out", "system.ssp"],
    ] {
        let output = Command::new("sh")
            .args(["-c", "trap '' XFSZ; ulimit -f 1; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_boost-fmu")])
            .args(arguments)
            .current_dir(&folder)
            .output()
            .unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert_eq!(said.matches("File too large").count(), 1, "{said}");
        assert!(names(&folder).is_empty(), "{arguments:?}: {:?}", names(&folder));
    }
}

#[test]
fn too_large_contents_are_refused() {
    // Two entries claim, in the central directory, to hold 2 GiB each.
    let bomb = fmu_of("bomb.fmu", &[("resources/a", b"a"), ("resources/b", b"b")]);
    let mut bytes = fs::read(&bomb).unwrap();
    let central: Vec<_> = (0..bytes.len() - 4).filter(|&at| bytes[at..].starts_with(b"PK\x01\x02")).collect();
    assert_eq!(central.len(), 3);
    for at in &central[1..] {
        bytes[at + 24..at + 28].copy_from_slice(&[0xff, 0xff, 0xff, 0x7f]);
    }
    fs::write(&bomb, bytes).unwrap();
    for arguments in [["info", &bomb].as_slice(), &["merge", &bomb, "--out", "no.fmu"]] {
        let message = refusal(arguments);
        assert!(message.contains("its entries claim to hold more than 1073741824 bytes"), "{message}");
    }
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
