//! The command, run as a user would, with an FMU that is a description alone: its errors.

use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Output};

use tempfile::TempDir;

/// A folder with the FMU.
struct Bench(TempDir);

impl Bench {
    fn new() -> Self {
        let bench = Self(tempfile::tempdir().unwrap());
        let mut fmu = zip::ZipWriter::new(fs::File::create(bench.path("plant.fmu")).unwrap());
        fmu.start_file("modelDescription.xml", zip::write::SimpleFileOptions::default()).unwrap();
        fmu.write_all(br#"<fmiModelDescription fmiVersion="2.0" modelName="Plant" guid="plant"/>"#).unwrap();
        fmu.finish().unwrap();
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    fn run(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_boost-lab"));
        command.args(arguments).current_dir(self.0.path()).output().unwrap()
    }

    /// The message of a failing command.
    fn refusal(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let printed = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {printed}");
        printed
    }
}

#[test]
fn outputs_that_are_inputs_are_refused_before_anything_runs() {
    let bench = Bench::new();
    bench.write("signal.csv", "time,a\n0,1\n1,2\n");
    let tune = ["tune", "--plant", "plant.fmu", "--parameters", "schedule.ssv", "--out", "."];
    bench.write("schedule.ssv", "");
    assert!(bench.refusal(&tune).contains("the input schedule.ssv would be lost"));
    bench.write("identified.ssv", "");
    let identify = ["identify", "actuator", "signal.csv", "--plant", "plant.fmu", "--out", "."];
    let message = bench.refusal(&[&identify[..], &["--parameters", "identified.ssv"]].concat());
    assert!(message.contains("the input identified.ssv would be lost"), "{message}");
}

#[test]
fn a_page_is_made_of_modules_alone() {
    let bench = Bench::new();
    fs::write(bench.path("empty.wasm"), b"\0asm\x01\0\0\0").unwrap();
    bench.write("text.wasm", "none");
    for (module, reason) in [
        ("missing.wasm", "missing.wasm: "),
        ("text.wasm", "text.wasm is not a module of `boost-fmu export --wasm`: "),
        ("plant.fmu", "plant.fmu is not a module of `boost-fmu export --wasm`: "),
        (
            "empty.wasm",
            "empty.wasm is not a module of `boost-fmu export --wasm`: it has no section modelDescription.xml",
        ),
    ] {
        let message = bench.refusal(&["live", "--plant", module, "--fmus", ".", "--out", "live.html"]);
        assert!(message.contains(reason), "{message}");
    }
    // A custom section: its id, its size, its name with that one's size, and the description.
    let module = |version| {
        let description = format!("<fmiModelDescription fmiVersion=\"{version}\" modelName=\"m\"/>");
        let section = [b"\x14modelDescription.xml", description.as_bytes()].concat();
        let size = u8::try_from(section.len()).unwrap();
        assert!(size < 0x80, "a size of one byte");
        [b"\0asm\x01\0\0\0\0".as_slice(), &[size], &section].concat()
    };
    fs::write(bench.path("three.wasm"), module("3.0")).unwrap();
    fs::write(bench.path("other.wasm"), module("2.0")).unwrap();
    fs::copy(bench.path("plant.fmu"), bench.path("BoostPlant.fmu")).unwrap();
    for (module, reason) in [
        ("three.wasm", "it has FMI 3.0; the page calls FMI 2.0"),
        ("other.wasm", "other.wasm and ./BoostPlant.fmu are different models"),
    ] {
        let message = bench.refusal(&["live", "--plant", module, "--fmus", ".", "--out", "live.html"]);
        assert!(message.contains(reason), "{message}");
    }
    let message = bench.refusal(&["live", "--plant", "text.wasm", "--fmus", ".", "--out", "text.wasm"]);
    assert!(message.contains("the input text.wasm would be lost"), "{message}");
    assert!(!bench.path("live.html").exists() && bench.read("text.wasm") == "none");
}

/// By the controller's range.
#[test]
fn a_time_constant_that_the_controller_does_not_take_is_refused_before_anything_runs() {
    let bench = Bench::new();
    let message = bench.refusal(&["tune", "--plant", "plant.fmu", "--lambda", "1e308", "--out", "out"]);
    let reason = "the value 1e308 of feedback_lambda cannot be used: 1e308 is not within 0.001..100 s";
    assert!(message.contains(reason), "{message}");
}
