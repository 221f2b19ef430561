//! `compile`: FMUs with C sources, run with the library that it makes of them.

use std::fs;
use std::path::Path;

use fmu_package::Platform;
use fmu_terms::Version;

use super::archives::write_archive;
use super::careless::DESCRIPTION;
use super::{Bench, last};

/// A library that is external, and one that is in the FMU.
const LIBRARIES: &str = "<Library name=\"m\" external=\"true\"/><Library name=\"offset\"/>";

/// The FMU of `gain.c`: its build description has this for `gain`, and a configuration for a platform that there is not.
fn gain(bench: &Bench, sets: &str, more: &[(&str, &[u8])]) {
    let description = r#"<fmiModelDescription fmiVersion="3.0" modelName="Gain" instantiationToken="1">
        <CoSimulation modelIdentifier="gain" canHandleVariableCommunicationStepSize="true"/>
        <ModelVariables>
          <Float64 name="u" valueReference="0" causality="input" start="3"/>
          <Float64 name="y" valueReference="1" causality="output"/>
        </ModelVariables>
        <ModelStructure><Output valueReference="1"/></ModelStructure>
      </fmiModelDescription>"#;
    let build = format!(
        r#"<fmiBuildDescription fmiVersion="3.0">
          <BuildConfiguration modelIdentifier="gain" platform="m68k-amiga">
            <SourceFileSet><SourceFile name="none.c"/></SourceFileSet>
          </BuildConfiguration>
          {sets}
        </fmiBuildDescription>"#
    );
    let bias = b"double bias(void);\n";
    let files = [
        ("modelDescription.xml", description.as_bytes()),
        ("sources/buildDescription.xml", build.as_bytes()),
        ("sources/gain.c", include_bytes!("gain.c")),
        ("sources/own/include/bias.h", bias),
        (
            "sources/own/bias.c",
            b"#include <math.h>\n#include \"bias.h\"\ndouble bias(void) { return sqrt(BIAS); }\n",
        ),
    ];
    write_archive(&bench.path("gain.fmu"), &[&files, more].concat());
}

/// The configuration that `gain.c` demands.
fn configuration(libraries: &str, bias: &str) -> String {
    format!(
        r#"<BuildConfiguration modelIdentifier="gain">
          <SourceFileSet language="C11" compiler="gcc" compilerOptions="-DOPTION=1  -Wall -Wextra -Werror">
            <SourceFile name="gain.c"/>
            <PreprocessorDefinition name="GAIN" value="2.0"/>
            <PreprocessorDefinition name="FLAG"/>
            <PreprocessorDefinition name="OPTIONAL" value="1" optional="true"/>
            <IncludeDirectory name="own/include"/>
          </SourceFileSet>
          <SourceFileSet>
            <SourceFile name="./own/bias.c"/>
            <PreprocessorDefinition name="BIAS" value="{bias}"/>
            <IncludeDirectory name="own/include"/>
          </SourceFileSet>
          {libraries}
        </BuildConfiguration>"#
    )
}

#[test]
fn sources_are_compiled_as_the_build_description_says() {
    let bench = Bench::new();
    gain(&bench, &configuration("", "16"), &[]);
    let refusal = bench.refusal(&["simulate", "gain.fmu"]);
    assert!(refusal.contains("`cargo fmu compile gain.fmu` compiles its C sources"), "{refusal}");
    bench.succeeds(&["compile", "gain.fmu"]);
    let beside = format!("gain.{}.fmu", Platform::host().unwrap().folder());
    bench.succeeds(&["simulate", &beside, "--set", "u=3", "--out", "gain.csv"]);
    // 2 · 3 + √16
    assert_eq!(last(&bench.read("gain.csv")).to_bits(), 10.0_f64.to_bits());
    // The library of the sources replaces the former one.
    gain(&bench, &configuration("", "25"), &[(&library(), b"none"), ("resources/a.txt", b"a")]);
    bench.succeeds(&["compile", "gain.fmu", "--out", "new.fmu"]);
    bench.succeeds(&["simulate", "new.fmu", "--set", "u=3", "--out", "gain.csv"]);
    assert_eq!(last(&bench.read("gain.csv")).to_bits(), 11.0_f64.to_bits());
    // All else is kept; a list of the libraries is added.
    let names = |fmu: &str| {
        let archive = zip::ZipArchive::new(fs::File::open(bench.path(fmu)).unwrap()).unwrap();
        let mut names: Vec<_> = archive.file_names().map(|name| name.unwrap().into_owned()).collect();
        names.sort();
        names
    };
    let mut expected = [names("gain.fmu"), vec!["documentation/platforms.txt".to_owned()]].concat();
    expected.sort();
    assert_eq!(names("new.fmu"), expected);
}

/// The path of the library of `gain` for this platform.
fn library() -> String {
    Platform::host().unwrap().library_path("gain", Version::Three)
}

/// The static library is that of the second set.
#[cfg(unix)]
#[test]
fn libraries_are_linked() {
    let bench = Bench::new();
    let object = bench.path("bias.o");
    bench.write("bias.c", "double bias(void) { return 7.0; }\n");
    let tool = |tool: &str, arguments: &[&Path]| {
        assert!(std::process::Command::new(tool).args(arguments).status().unwrap().success());
    };
    let [option, fpic, output] = ["-c", "-fPIC", "-o"].map(Path::new);
    tool("cc", &[option, fpic, &bench.path("bias.c"), output, &object]);
    tool("ar", &[Path::new("rcs"), &bench.path("liboffset.a"), &object]);
    let archive = fs::read(bench.path("liboffset.a")).unwrap();
    let folder = Path::new(&library()).parent().unwrap().join("liboffset.a");
    let without = configuration(LIBRARIES, "0")
        .replace("<SourceFile name=\"./own/bias.c\"/>", "<SourceFile name=\"empty.c\"/>");
    let empty = ("sources/empty.c", &b"typedef int nothing;\n"[..]);
    gain(&bench, &without, &[empty, (folder.to_str().unwrap(), &archive)]);
    bench.succeeds(&["compile", "gain.fmu", "--out", "new.fmu"]);
    bench.succeeds(&["simulate", "new.fmu", "--set", "u=3", "--out", "gain.csv"]);
    assert_eq!(last(&bench.read("gain.csv")).to_bits(), 13.0_f64.to_bits());
    gain(&bench, &without, &[empty]);
    let refusal = bench.refusal(&["compile", "gain.fmu"]);
    assert!(refusal.contains("there is no library offset in binaries/"), "{refusal}");
    gain(&bench, &configuration("<Library name=\"none-such\" external=\"true\"/>", "16"), &[]);
    let refusal = bench.refusal(&["compile", "gain.fmu"]);
    assert!(refusal.contains("none-such"), "{refusal}");
}

#[test]
fn source_files_of_fmi_2_are_compiled() {
    let bench = Bench::new();
    let listed = "<CoSimulation modelIdentifier=\"careless\" canGetAndSetFMUstate=\"true\"><SourceFiles>\
                  <File name=\"careless.c\"/></SourceFiles></CoSimulation>";
    let (before, after) = DESCRIPTION.split_once("<CoSimulation").unwrap();
    let description = format!("{before}{listed}{}", after.split_once("/>").unwrap().1);
    let source = include_bytes!("../../../fmu-master/tests/careless/careless.c");
    let files = [("modelDescription.xml", description.as_bytes()), ("sources/careless.c", source)];
    write_archive(&bench.path("c.fmu"), &files);
    bench.succeeds(&["simulate", "careless.fmu", "--set", "input=0.3", "--out", "expected.csv"]);
    bench.succeeds(&["compile", "c.fmu", "--out", "new.fmu"]);
    bench.succeeds(&["simulate", "new.fmu", "--set", "input=0.3", "--out", "found.csv"]);
    assert_eq!(bench.read("found.csv"), bench.read("expected.csv"));
    let refusal = bench.refusal(&["compile", "careless.fmu"]);
    assert!(refusal.ends_with("cannot compile careless.fmu: it lists no C sources\n"), "{refusal}");
    let refusal = bench.refusal(&["compile", "new.fmu", "--out", "new.fmu"]);
    assert!(refusal.contains("the input new.fmu would be lost"), "{refusal}");
}

/// An FMU of FMI 2.0 with sources: `careless.c` after the header `names.h`.
fn careless_sources(bench: &Bench, name: &str, names: &str) {
    let listed = "<CoSimulation modelIdentifier=\"careless\" canGetAndSetFMUstate=\"true\"><SourceFiles>\
                  <File name=\"careless.c\"/></SourceFiles></CoSimulation>";
    let (before, after) = DESCRIPTION.split_once("<CoSimulation").unwrap();
    let description = format!("{before}{listed}{}", after.split_once("/>").unwrap().1);
    let source = include_str!("../../../fmu-master/tests/careless/careless.c");
    let source = format!("#include \"names.h\"\n{source}");
    let files = [
        ("modelDescription.xml", description.as_bytes()),
        ("sources/names.h", names.as_bytes()),
        ("sources/careless.c", source.as_bytes()),
    ];
    write_archive(&bench.path(name), &files);
}

/// What the headers of FMI 2.0 before those of 2022 do: they prepend a prefix to the name of each function.
fn prefixed(prefix: &str) -> String {
    let names = fmu_package::functions(Version::Two);
    let names = names.map(|name| format!("#define {name} FULL({name})\n")).collect::<Vec<_>>().concat();
    format!(
        "#define PASTE(a, b) a##b\n#define PASTED(a, b) PASTE(a, b)\n#define FULL(name) PASTED({prefix}, name)\n{names}"
    )
}

#[test]
fn the_prefix_of_older_headers_is_taken_off() {
    let bench = Bench::new();
    careless_sources(&bench, "c.fmu", &prefixed("careless_"));
    bench.succeeds(&["compile", "c.fmu", "--out", "new.fmu"]);
    bench.succeeds(&["simulate", "new.fmu", "--set", "input=0.3", "--out", "found.csv"]);
    bench.succeeds(&["simulate", "careless.fmu", "--set", "input=0.3", "--out", "expected.csv"]);
    assert_eq!(bench.read("found.csv"), bench.read("expected.csv"));
    // What the standard does not have is not a library of FMI.
    careless_sources(&bench, "c.fmu", &prefixed("own_"));
    let refusal = bench.refusal(&["compile", "c.fmu", "--out", "other.fmu"]);
    assert!(
        refusal.contains("fmi2Instantiate") && refusal.contains("it exports own_fmi2Instantiate"),
        "{refusal}"
    );
    assert!(!bench.path("other.fmu").exists());
}

/// By the command that `simulate` prints.
#[test]
fn the_fmus_of_a_system_are_compiled_within_it() {
    let bench = Bench::new();
    careless_sources(&bench, "c.fmu", "");
    fs::copy(bench.path("careless.fmu"), bench.path("binary.fmu")).unwrap();
    fs::rename(bench.path("c.fmu"), bench.path("careless.fmu")).unwrap();
    super::write_system(&bench, "", "");
    let refusal = bench.refusal(&["simulate", "chain.ssp", "--step", "0.125"]);
    let hint = refusal.split('`').nth(1).unwrap().strip_prefix("cargo fmu ").unwrap().to_owned();
    assert_eq!(hint, "compile chain.ssp/resources/careless.fmu");
    bench.succeeds(&[&hint.split(' ').collect::<Vec<_>>()[..], &["--out", "new.ssp"]].concat());
    bench.succeeds(&["simulate", "new.ssp", "--step", "0.125", "--out", "found.csv"]);
    fs::rename(bench.path("binary.fmu"), bench.path("careless.fmu")).unwrap();
    super::write_system(&bench, "", "");
    bench.succeeds(&["simulate", "chain.ssp", "--step", "0.125", "--out", "expected.csv"]);
    assert_eq!(bench.read("found.csv"), bench.read("expected.csv"));
    let refusal = bench.refusal(&["compile", "chain.ssp"]);
    let reason =
        "cannot compile chain.ssp: none of its FMUs lacks a library for this platform and lists C sources\n";
    assert!(refusal.ends_with(reason), "{refusal}");
    assert!(bench.names(".").iter().all(|name| !name.contains("linux64")), "{:?}", bench.names("."));
}

#[test]
fn what_cannot_be_compiled_is_refused_with_the_reason() {
    let bench = Bench::new();
    let right = configuration("", "16");
    for (sets, reason) in [
        (String::new(), "its sources/buildDescription.xml has no configuration for "),
        (right.replace("own/bias.c", "own/bais.c"), "there is no sources/own/bais.c"),
        (right.replace("own/include", "../own"), "its include directory '../own' is not below sources"),
        (right.replace("\"FLAG\"", "\"FLAGS\""), "cannot make sources/gain.c:\nsources/gain.c:"),
        (right.replace("value=\"16\"", "value=\"one\""), "sources/own/bias.c:3:"),
    ] {
        gain(&bench, &sets, &[]);
        let refusal = bench.refusal(&["compile", "gain.fmu", "--out", "new.fmu"]);
        assert!(refusal.contains("cannot compile gain.fmu: ") && refusal.contains(reason), "{refusal}");
        assert!(!bench.path("new.fmu").exists());
    }
    gain(&bench, &right, &[]);
    let output = bench.command(&["compile", "gain.fmu"]).env("CC", "there-is-none").output().unwrap();
    let refusal = String::from_utf8(output.stderr).unwrap();
    let reason = "there is no C compiler there-is-none; install one, or set CC to the path of yours\n";
    assert!(refusal.ends_with(reason), "{refusal}");
}
