//! The command, run as a user would: its answers to what is wrong.

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::LazyLock;

mod support;

use support::*;

fn cargo_fmu(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_cargo-fmu")).args(arguments).current_dir(workspace()).output().unwrap()
}

/// A workspace with the model `Lag` in the package `lag`, and the package `other`, which has none. Nothing is built.
fn workspace() -> &'static Path {
    static WORKSPACE: LazyLock<PathBuf> = LazyLock::new(|| {
        let folder = empty("a workspace");
        let package = |name: &str, library: &str| {
            fs::create_dir_all(folder.join(name).join("src")).unwrap();
            fs::write(folder.join(name).join("src/lib.rs"), "").unwrap();
            let manifest = format!("[package]\nname = \"{name}\"\nedition = \"2024\"\n{library}");
            fs::write(folder.join(name).join("Cargo.toml"), manifest).unwrap();
        };
        package("lag", "[lib]\nname = \"Lag\"\ncrate-type = [\"cdylib\"]\n");
        package("other", "");
        fs::write(
            folder.join("Cargo.toml"),
            "[workspace]\nresolver = \"3\"\nmembers = [\"lag\", \"other\"]\n",
        )
        .unwrap();
        folder
    });
    &WORKSPACE
}

/// What the command says on stderr when it fails.
fn refusal(arguments: &[&str]) -> String {
    let output = cargo_fmu(arguments);
    assert!(!output.status.success(), "{arguments:?} succeeded");
    String::from_utf8(output.stderr).unwrap()
}

/// Without a build script, whose generator would have to be compiled first.
#[test]
fn export_tells_what_is_wrong_in_a_declaration_before_cargo_compiles() {
    let folder = empty("a wrong declaration");
    let run = |arguments: &[&str], folder: &Path| {
        Command::new(env!("CARGO_BIN_EXE_cargo-fmu"))
            .args(arguments)
            .current_dir(folder)
            .env("CARGO_NET_OFFLINE", "true")
            .output()
            .unwrap()
    };
    // A workspace of its own, with what this one has downloaded.
    fs::write(folder.join("Cargo.toml"), "[workspace]\nresolver = \"3\"\nmembers = []\n").unwrap();
    let lock = concat!(env!("CARGO_MANIFEST_DIR"), "/../../Cargo.lock");
    fs::copy(lock, folder.join("Cargo.lock")).unwrap();
    assert!(run(&["new", "lag", "--vcs", "none"], &folder).status.success());
    let package = folder.join("lag");
    let declaration = package.join("model.json");
    let text = fs::read_to_string(&declaration).unwrap();
    fs::write(&declaration, text.replacen("\"causality\": \"output\"", "\"causality\": \"outptu\"", 1))
        .unwrap();
    let output = run(&["export"], &package);
    assert_eq!(output.status.code(), Some(2));
    let told = String::from_utf8(output.stderr).unwrap();
    let lines: Vec<_> = told.lines().collect();
    let [begin, finding, end] = lines[..] else { panic!("{told}") };
    assert!(begin.starts_with("Compiling lag for "), "{told}");
    assert!(finding.starts_with("error: lag@0.1.0: model.json:"), "{told}");
    assert!(finding.ends_with(".causality: unknown value 'outptu'; did you mean 'output'?"), "{told}");
    assert!(end.ends_with("the declaration of lag is rejected; see the messages above"), "{told}");
}

/// Another cargo holds the lock on what is built.
#[test]
fn export_says_that_it_compiles_and_that_it_waits_for_another_cargo() {
    let folder = empty("a locked workspace");
    fs::create_dir_all(folder.join("src")).unwrap();
    fs::write(folder.join("src/lib.rs"), "").unwrap();
    let manifest =
        "[package]\nname = \"lag\"\n[lib]\nname = \"Lag\"\ncrate-type = [\"cdylib\"]\n[workspace]\n";
    fs::write(folder.join("Cargo.toml"), manifest).unwrap();
    let built = folder.join("target/fmu-library");
    fs::create_dir_all(&built).unwrap();
    let lock = fs::File::create(built.join(".cargo-lock")).unwrap();
    lock.lock().unwrap();
    let mut process = Command::new(env!("CARGO_BIN_EXE_cargo-fmu"))
        .arg("export")
        .current_dir(&folder)
        .env("CARGO_TARGET_DIR", folder.join("target"))
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(process.stderr.take().unwrap()).lines().map(Result::unwrap);
    let first = lines.next().unwrap();
    assert!(
        first.starts_with("Compiling Lag for ") && first.ends_with("cargo shows its progress:"),
        "{first}"
    );
    let waits = lines.find(|line| line.contains("Blocking waiting for file lock"));
    assert!(waits.is_some(), "it ended without waiting");
    drop(lock);
    assert!(lines.any(|line| line.contains("Compiling lag")));
    // It has no description.
    assert!(!process.wait().unwrap().success());
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
fn an_unknown_model_is_refused_with_the_known_ones() {
    let message = refusal(&["export", "Lagg"]);
    assert!(message.contains("there is no model Lagg; there are Lag"), "{message}");
    let message = refusal(&["export", "--package", "lagg"]);
    assert!(message.contains("the workspace has no package lagg; it has lag, other"), "{message}");
    let message = refusal(&["export", "--package", "other"]);
    assert!(
        message.contains("there is no model in") && message.contains("crate-type = [\"cdylib\"]"),
        "{message}"
    );
    let message = refusal(&["export", "--manifest-path", "nowhere/Cargo.toml"]);
    assert!(message.contains("nowhere/Cargo.toml"), "{message}");
}

#[test]
fn new_says_what_cannot_be_a_package_before_there_is_one() {
    let folder = empty("new packages");
    // Otherwise cargo enters the package among the members of this workspace.
    fs::write(folder.join("Cargo.toml"), "[workspace]\n").unwrap();
    for name in ["ünï", "2stage", "a b"] {
        let path = folder.join(name);
        let message = refusal(&["new", path.to_str().unwrap()]);
        assert!(message.contains(&format!("'{name}' is not a valid FMU name")), "{message}");
        assert!(!path.exists());
    }
    let path = folder.join("con");
    let message = refusal(&["new", path.to_str().unwrap()]);
    assert!(
        message.contains("'con' names a device of Windows, so that it cannot name a library"),
        "{message}"
    );
    assert!(!path.exists());
    let message = refusal(&["new", folder.to_str().unwrap()]);
    assert!(message.contains("new packages already exists") && !message.contains("cargo init"), "{message}");

    let path = folder.join("ünï");
    let output = cargo_fmu(&["new", path.to_str().unwrap(), "--name", "uni", "--vcs", "none"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// Cargo ignores the profiles of a member of a workspace.
#[test]
fn new_sets_the_profile_of_a_workspace_of_its_own_and_tells_that_of_another() {
    const PROFILE: &str = "[profile.dev.package.\"*\"]\ndebug = false\n";
    const LIBRARY_PROFILE: &str = "[profile.release]\ncodegen-units = 2\n";
    for (root, is_own, is_told) in [("", true, false), ("[workspace]\n", false, true)] {
        for profile in ["", "[profile.dev]\ndebug = 1\n"] {
            // Outside of this workspace.
            let folder = tempfile::tempdir().unwrap();
            if !root.is_empty() {
                fs::write(folder.path().join("Cargo.toml"), format!("{root}{profile}")).unwrap();
            }
            let path = folder.path().join("one");
            let output = cargo_fmu(&["new", path.to_str().unwrap(), "--vcs", "none"]);
            let told = String::from_utf8_lossy(&output.stdout);
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            let manifest = fs::read_to_string(path.join("Cargo.toml")).unwrap();
            for settings in [PROFILE, LIBRARY_PROFILE] {
                assert_eq!(manifest.contains(settings), is_own, "{manifest}");
            }
            assert_eq!(told.contains(PROFILE), is_told && profile.is_empty(), "{told}");
        }
    }
}

#[test]
fn unknown_interfaces_are_refused_with_the_known_ones() {
    for interfaces in ["", "cs,se", "cs,cs", "ModelExchange"] {
        let message = refusal(&["export", "--interfaces", interfaces]);
        assert!(message.contains("[possible values: cs, me, cs,me, se]"), "{message}");
    }
}

#[test]
fn scheduled_execution_is_refused_in_fmi_2() {
    let message = refusal(&["export", "--interfaces", "se", "--fmi", "2,3"]);
    assert!(message.contains("--interfaces se needs FMI 3.0, but --fmi is 2"), "{message}");
}

/// What an export says that lacks tools, with further variables.
fn refusal_without_tools(arguments: &[&str], folder: &Path, variables: &[(&str, &str)]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cargo-fmu"));
    command.arg("export").args(arguments).current_dir(folder);
    for variable in [
        "CARGO_UNSTABLE_BUILD_STD",
        "RUSTC",
        "FMU_WASM_RUSTC",
        "CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER",
        "WASM2C",
    ] {
        command.env_remove(variable);
    }
    let output = command.envs(variables.iter().copied()).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments:?} succeeded");
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(!message.contains("Compiling"), "{message}");
    message
}

/// Adds the source of a standard library, where `echo` says that a compiler has it.
fn add_source(folder: &Path) {
    let library = folder.join("--print sysroot/lib/rustlib/src/rust/library/std");
    fs::create_dir_all(&library).unwrap();
    fs::write(library.join("Cargo.toml"), "").unwrap();
}

#[test]
fn webassembly_without_its_tools_is_refused_with_the_line_to_type() {
    let folder = empty("no tools");
    let refused =
        |arguments: &[&str], variables: &[(&str, &str)]| refusal_without_tools(arguments, &folder, variables);
    let script =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../release/wasm-tools").canonicalize().unwrap();
    let script = format!("on Debian, `eval \"$(bash '{}')\"`", script.display());

    // A compiler that answers with what it is asked; there is no such folder.
    let message = refused(&["--wasm"], &[("RUSTC", "echo")]);
    let rustup = "error: echo has no standard library for wasm32-unknown-unknown: `rustup target add \
                  wasm32-unknown-unknown` installs it; without rustup, ";
    assert!(message.starts_with(&format!("{rustup}{script}")), "{message}");
    assert_eq!(message.lines().count(), 1, "{message}");

    let message = refused(&["--wasm"], &[("FMU_WASM_RUSTC", "no such compiler")]);
    assert!(message.contains("cannot run no such compiler, the compiler for WebAssembly"), "{message}");
    let message = refused(&["--wasm"], &[("FMU_WASM_RUSTC", "echo")]);
    assert!(message.contains("echo, set by FMU_WASM_RUSTC, has no source of the standard library: "));
    assert!(message.contains(&script), "{message}");

    add_source(&folder);
    let linker = "CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER";
    let message = refused(&["--wasm"], &[("FMU_WASM_RUSTC", "echo"), (linker, "no-such-linker")]);
    let missing = format!("no linker no-such-linker for echo; set {linker}: {script}");
    assert!(message.contains(&missing), "{message}");
}

#[test]
fn sources_take_one_version_of_wasm2c() {
    // There is a linker, any program, so that only wasm2c is missing.
    let folder = empty("no wasm2c");
    add_source(&folder);
    let refused = |program: &str, linker: &str| {
        let variables = [
            ("WASM2C", program),
            ("FMU_WASM_RUSTC", "echo"),
            ("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER", linker),
        ];
        refusal_without_tools(&["--sources"], &folder, &variables)
    };
    let missing = "`--sources` needs wasm2c 1.0.32: on Debian 12, `apt-get install wabt` installs it";
    let message = refused("no-such-program", "echo");
    assert!(message.starts_with(&format!("error: {missing}")), "{message}");
    let another = "this one is cargo-fmu ";
    assert!(refused(env!("CARGO_BIN_EXE_cargo-fmu"), "echo").contains(another));

    // What is missing is told at once.
    let message = refused("no-such-program", "no-such-linker");
    let lines: Vec<_> = message.lines().collect();
    assert_eq!(lines[0], "error: nothing was built, because several things are missing:");
    assert!(lines[1].starts_with("- no linker no-such-linker for echo"), "{message}");
    assert!(lines[2].starts_with(&format!("- {missing}")), "{message}");
    assert_eq!(lines.len(), 3, "{message}");
}

#[test]
fn a_target_without_its_tools_is_refused_with_their_names() {
    let refusal = |target: &[&str], variables: &[(&str, &str)]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_cargo-fmu"));
        command
            .arg("export")
            .current_dir(workspace())
            .env_remove("CARGO_UNSTABLE_BUILD_STD")
            .env_remove("RUSTC");
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
    expect(&["x86_64-unknown-linux-musl"], &[], "not a Rust target for FMUs");
    expect(&["x86_64-apple-darwin.2.17"], &[], "only glibc targets take a glibc version");

    // A compiler that answers with a folder that is not there, and one that fails.
    let target = "i686-unknown-linux-gnu";
    let brings = "echo has no standard library for i686-unknown-linux-gnu: `rustup target add \
                  i686-unknown-linux-gnu` installs it; without rustup, cargo can build it";
    expect(&[target], &[("RUSTC", "echo")], brings);
    expect(&[target], &[("RUSTC", "false")], "false does not know the target i686-unknown-linux-gnu");
    expect(&[target], &[("RUSTC", "no such compiler")], "cannot run no such compiler");

    // No linker is found where there are no programs; cargo would build the standard library.
    let nothing = [("CARGO_UNSTABLE_BUILD_STD", "std"), ("PATH", env!("CARGO_TARGET_TMPDIR"))];
    let pip = "`pip install cargo-zigbuild` installs it and zig";
    expect(&["x86_64-unknown-linux-gnu.2.17"], &nothing, pip);
    expect(&["x86_64-pc-windows-gnu"], &nothing, "`apt-get install gcc-mingw-w64-x86-64` installs it");
    expect(
        &["x86_64-pc-windows-msvc"],
        &nothing,
        "no linker for x86_64-pc-windows-msvc is known; set CARGO_TARGET_X86_64_PC_WINDOWS_MSVC_LINKER",
    );
    expect(
        &["win64", "x86_64-pc-windows-msvc"],
        &nothing,
        "x86_64-pc-windows-gnu and x86_64-pc-windows-msvc are both for win64",
    );
}

#[test]
fn a_library_of_another_platform_is_refused_before_anything_is_built() {
    let library = scratch("library");
    for (content, folder, reason) in [
        (elf(ELF_X86_64, ""), "win64", "it is ELF for x86-64; win64 requires PE for x86-64"),
        (elf(ELF_AARCH64, ""), "linux64", "it is ELF for aarch64; linux64 requires ELF for x86-64"),
        (elf(ELF_X86_64, ""), "darwin64", "darwin64 requires Mach-O for x86-64 or aarch64"),
        (elf(20, ""), "linux64", "its processor PowerPc is not supported"),
        (mach_o(MACH_O_X86_64, ""), "aarch64-darwin", "aarch64-darwin requires Mach-O for aarch64"),
        (b"a text".to_vec(), "linux64", "it is not a shared library"),
    ] {
        fs::write(&library, content).unwrap();
        let binary = format!("{folder}={}", library.display());
        let message = refusal(&["export", "--binary", &binary]);
        assert!(message.contains(&format!("cannot be the library for {folder}")), "{message}");
        assert!(message.contains(reason), "{reason}: {message}");
    }
    let message = refusal(&["export", "--binary", "linux64"]);
    assert!(message.contains("it contains no '='"), "{message}");
    let message = refusal(&["export", "--binary", "win64=there is no such.dll"]);
    assert!(message.contains("cannot read there is no such.dll"), "{message}");
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
    // Equal files do not matter, nor do other files beside a library or with another license.
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
        let output = cargo_fmu(&[&["merge"], &fmus[..], &["--out", merged], options].concat());
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

/// The description of an FMU of FMI 3.0 with variables.
fn description_3(variables: &str) -> String {
    description(variables).replace("2.0", "3.0").replace("guid", "instantiationToken")
}

#[test]
fn libraries_of_fmi_3_are_merged() {
    let text = description_3("");
    let fmu = |name: &str, libraries: &[(&str, &[u8])]| {
        archive_of(name, &[&[("modelDescription.xml", text.as_bytes())], libraries].concat())
    };
    let (intel, apple) = (mach_o(MACH_O_X86_64, "intel"), mach_o(MACH_O_ARM64, "apple"));
    let x86 = elf(ELF_X86_64, "x86");
    let macos = fmu("macos.fmu", &[("binaries/x86_64-darwin/Other.dylib", &intel)]);
    let others =
        [("binaries/x86_64-linux/Other.so", x86.as_slice()), ("binaries/aarch64-darwin/Other.dylib", &apple)];
    let others = fmu("others.fmu", &others);
    let out = scratch("merged_3.fmu");
    let options =
        ["--out", out.to_str().unwrap(), "--ran", "x86_64-linux=Debian 12", "--ran", "darwin64=macOS 15"];
    let output = cargo_fmu(&[&["merge", &macos, &others], &options[..]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let list = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<_> = list.lines().skip(2).collect();
    assert_eq!(
        lines,
        [
            "aarch64-darwin: Mach-O for aarch64; only built",
            "x86_64-darwin: Mach-O for x86-64; run: macOS 15",
            "x86_64-linux: ELF for x86-64; run: Debian 12",
        ]
    );
    let files = files_of(out.to_str().unwrap());
    assert_eq!(files["binaries/aarch64-darwin/Other.dylib"], apple);
    assert_eq!(files["binaries/x86_64-darwin/Other.dylib"], intel);

    let wrong = fmu("wrong_tuple.fmu", &[("binaries/aarch64-linux/Other.so", &x86)]);
    let refused =
        |options: &[&str]| refusal(&[&["merge", &macos, &wrong, "--out", "never.fmu"], options].concat());
    let message = refused(&[]);
    assert!(
        message.contains("the library for aarch64-linux in") && message.contains("it is ELF for x86-64"),
        "{message}"
    );
    let other = archive("other_token.fmu", "modelDescription.xml", &text.replace("\"g\"", "\"h\""));
    let message = refusal(&["merge", &macos, &other, "--out", "never.fmu"]);
    assert!(message.contains("are different models, with the GUIDs g and h"), "{message}");
}

#[test]
fn a_universal_library_is_for_both_of_its_processors() {
    let (intel, apple) = (mach_o(MACH_O_X86_64, "intel"), mach_o(MACH_O_ARM64, "apple"));
    let parts = [("of_intel.fmu", &intel), ("of_apple.fmu", &apple)]
        .map(|(name, library)| fmu_of(name, &[("binaries/darwin64/Other.dylib", library.as_slice())]));
    let out = scratch("universal.fmu");
    let merged = cargo_fmu(&["merge", &parts[0], &parts[1], "--out", out.to_str().unwrap()]);
    assert!(merged.status.success(), "{}", String::from_utf8_lossy(&merged.stderr));
    let universal = &files_of(out.to_str().unwrap())["binaries/darwin64/Other.dylib"];
    let text = description_3("");
    for (folder, library, is_for_it) in [
        ("x86_64-darwin", universal, true),
        ("aarch64-darwin", universal, true),
        ("x86_64-darwin", &apple, false),
        ("x86_64-linux", universal, false),
    ] {
        let suffix = if folder.ends_with("linux") { "so" } else { "dylib" };
        let path = format!("binaries/{folder}/Other.{suffix}");
        let files = [("modelDescription.xml", text.as_bytes()), (&path, library.as_slice())];
        let found = cargo_fmu(&["validate", &archive_of("of_darwin.fmu", &files)]);
        let found = String::from_utf8(found.stdout).unwrap();
        assert_eq!(!found.contains("which is not for this folder"), is_for_it, "{folder}: {found}");
    }
}

#[test]
fn arrays_of_fmi_3_have_sizes_and_their_elements_are_parameters() {
    let text = description_3(
        r#"<Float64 name="map" valueReference="1" causality="parameter" variability="fixed" start="1 2 3 4 5 6">
             <Dimension valueReference="2"/><Dimension start="3"/></Float64>
           <UInt64 name="rows" valueReference="2" causality="structuralParameter" variability="fixed" start="2"/>"#,
    );
    let fmu = archive("arrays.fmu", "modelDescription.xml", &text);
    let shown = String::from_utf8(cargo_fmu(&["info", &fmu]).stdout).unwrap();
    assert!(shown.contains("Float64[2,3]"), "{shown}");
    let json = cargo_fmu(&["info", &fmu, "--format", "json"]).stdout;
    let json: serde_json::Value = serde_json::from_slice(&json).unwrap();
    assert_eq!(json["guid"], "g");
    assert_eq!(json["variables"][0]["dimensions"], serde_json::json!([2, 3]));
    assert!(json["variables"][1]["dimensions"].is_null());

    let set = empty("arrays").join("arrays.ssv");
    assert!(cargo_fmu(&["parameters", &fmu, "--out", set.to_str().unwrap()]).status.success());
    let set = fs::read_to_string(set).unwrap();
    for (name, value) in [("map[1,1]", 1), ("map[1,3]", 3), ("map[2,1]", 4), ("map[2,3]", 6)] {
        let parameter = format!("name=\"{name}\">\n      <ssv:Real value=\"{value}.0\"/>");
        assert!(set.contains(&parameter), "{parameter}: {set}");
    }
    assert_eq!(set.matches("<ssv:Parameter ").count(), 6, "{set}");
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
    refused(&own, &other, &["have the same GUID g, but different descriptions"], &[]);
    let other = archive("no_description.fmu", linux64, "");
    refused(&own, &other, &["there is no modelDescription.xml in", "no_description.fmu"], &[]);

    let other = fmu_of("other_library.fmu", &[(linux64, &elf(ELF_X86_64, "other"))]);
    refused(&own, &other, &[&own, &other, "both contain binaries/linux64/Other.so, which differ"], &[]);
    let same = [("binaries/darwin64/Other.dylib", mach_o(MACH_O_ARM64, "b"))];
    let other = fmu_of("apple_again.fmu", &[(same[0].0, &same[0].1)]);
    refused(
        &apple,
        &other,
        &["both contain binaries/darwin64/Other.dylib", "two are for the same processor"],
        &[],
    );
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

    let folder = empty("a folder.fmu");
    for arguments in
        [["info"].as_slice(), &["merge", "--out", "merged.fmu"], &["validate"], &["parameters"], &["compile"]]
    {
        let message = refusal(&[arguments, &[folder.to_str().unwrap()]].concat());
        assert!(message.contains("a folder.fmu: it is a folder"), "{message}");
    }

    let text = scratch("text.fmu");
    fs::write(&text, "no archive").unwrap();
    let message = refusal(&["info", text.to_str().unwrap()]);
    assert!(message.contains("it is not a ZIP archive"), "{message}");

    let message = refusal(&["info", &archive("empty.fmu", "readme.txt", "")]);
    assert!(message.contains("no modelDescription.xml"), "{message}");

    for (name, xml, reason) in [
        ("cut.fmu", "<fmiModelDescription><ModelVariables>", "ends within the element ModelVariables"),
        ("crossed.fmu", "<fmiModelDescription><a></b>", "cannot be read"),
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
            description="pressure"><Alias name="p2" description="at the outlet"/><Alias name="p3"/></Float64></ModelVariables>
        </fmiModelDescription>"#;
    for (name, xml, title, data_type) in
        [("fmi2.fmu", fmi2, "A & B", "Real"), ("fmi3.fmu", fmi3, "C", "Float64")]
    {
        let output = cargo_fmu(&["info", &archive(name, "modelDescription.xml", xml)]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let table = String::from_utf8(output.stdout).unwrap();
        assert!(table.contains(&format!("modelName   {title}")), "{table}");
        let row = table.lines().find(|line| line.starts_with("p ")).unwrap();
        let words: Vec<_> = row.split_whitespace().collect();
        assert_eq!(words, ["p", "input", "continuous", data_type, "Pa", "1e5", "0..", "pressure"]);
        let aliases: Vec<_> = table.lines().filter(|line| line.contains("alias of")).collect();
        if name == "fmi3.fmu" {
            let words = aliases.iter().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "));
            assert_eq!(words.collect::<Vec<_>>(), ["p2 alias of p: at the outlet", "p3 alias of p"]);
        } else {
            assert!(aliases.is_empty(), "{table}");
        }
    }
}

/// As under `| true`, which does not read.
#[test]
fn a_closed_pipe_ends_no_command_in_a_panic() {
    let path = archive("pipe.fmu", "modelDescription.xml", &description(""));
    for arguments in [
        ["completions", "bash"].as_slice(),
        &["validate", "--rules"],
        &["info", &path],
        &["info", &path, "--format", "json"],
        &["--help"],
        &["--version"],
    ] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let mut command = Command::new(env!("CARGO_BIN_EXE_cargo-fmu"));
        let output = command.arg("fmu").args(arguments).stdout(writer).output().unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success() && message.is_empty(), "{arguments:?}: {message}");
    }
}

/// The exit status and what the command prints, run in a folder.
fn cargo_fmu_in(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cargo-fmu"));
    let output = command.arg("fmu").args(arguments).current_dir(folder).output().unwrap();
    (output.status.code(), String::from_utf8([output.stdout, output.stderr].concat()).unwrap())
}

#[test]
fn an_output_that_is_an_input_is_refused() {
    let folder = empty("overlap");
    let fmu = folder.join("plant.fmu");
    fs::copy(archive("plant.fmu", "modelDescription.xml", &description("")), &fmu).unwrap();
    let before = fs::read(&fmu).unwrap();
    let (code, printed) = cargo_fmu_in(&folder, &["merge", "plant.fmu", "--out", "../overlap/plant.fmu"]);
    assert!(code == Some(2) && printed.contains("the input plant.fmu would be lost"), "{printed}");
    assert_eq!(fs::read(&fmu).unwrap(), before);
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
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
    for arguments in [["info", &bomb].as_slice(), &["merge", &bomb, "--out", "no.fmu"], &["compile", &bomb]] {
        let message = refusal(arguments);
        assert!(message.contains("its entries exceed 1 GiB"), "{message}");
    }
}
