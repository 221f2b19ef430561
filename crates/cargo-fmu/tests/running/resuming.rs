//! Studies that resume: only with what their results depend on.

use std::fs;

use super::careless::{self, DESCRIPTION, library};
use super::{Bench, parameter_set};

/// Every key of a scenario.
const SCENARIO: &str = r#"title = "One"
step = 0.125
start_time = 0.5
stop_time = 2
stepping = "in_turn"
record = ["alone:level", "drive"]

[[fmu]]
name = "alone"
file = "careless.fmu"
parameters = ["set.ssv"]
values = { input = 1.5 }
run_in = { duration = 0.5, during = { flag = true }, after = { fail = "no" } }

[[fmu]]
name = "other"
file = "other.fmu"
interface = "cs"

[[fmu]]
name = "fourth"
file = "careless.fmu"

[[fmu]]
name = "third"
file = "careless.fmu"
inputs.input = { csv = "signal.csv", column = "a", hold = true }

[inputs]
drive = { steps = [[0, 1.0], [1, 2.0]] }

[[connection]]
from = "drive"
to = "alone:input"
from_unit = "m"
to_unit = "m"

[[connection]]
from = "alone:level"
to = "fourth:input"

[noise]
input = { standard_deviation = 0.1, seed = 1 }

[measurement_noise]
"alone:level" = { standard_deviation = 0.2, seed = 2 }
"#;

/// Every key of a study.
const STUDY: &str = r#"title = "One"
scenario = "scenario.toml"
records = true

[latin_hypercube]
runs = 2
seed = 3
ranges = { "third:input" = { from = 1, to = 2, spacing = "linear" } }

[measures]
last = { final = "alone:level", from = 1.0, to = 1.5 }
up = { overshoot_up = "alone:level", reference = "drive" }
"#;

/// A folder with the study, and its files.
fn study() -> Bench {
    let bench = Bench::new();
    let other = careless::misbehaving(2, 1, "none");
    careless::write(&bench.path("other.fmu"), &other, careless::misbehaving_library());
    bench.write("set.ssv", &parameter_set("flag", "Boolean", "false"));
    bench.write("signal.csv", "t,a\n0,1\n1,2\n");
    bench.write("scenario.toml", SCENARIO);
    bench.write("study.toml", STUDY);
    bench
}

const SWEEP: [&str; 6] = ["sweep", "study.toml", "--out", "out", "--workers", "1"];

/// The message names what has changed, and nothing is lost.
#[test]
fn a_study_resumes_only_as_it_was() {
    let bench = study();
    bench.succeeds(&SWEEP);
    let journal = bench.read("out/journal.jsonl");
    let refusal = |change: &str, name: &str| {
        let message = bench.refusal(&SWEEP);
        assert!(message.contains("it was written with other settings"), "{change}: {message}");
        assert!(message.contains(&format!("\n  {name} was ")), "{change}: {message}");
        assert_eq!(bench.read("out/journal.jsonl"), journal, "{change}");
    };
    for (old, new, name) in [
        ("step = 0.125", "step = 0.25", "scenario's step"),
        ("start_time = 0.5", "start_time = 0.25", "scenario's start_time"),
        ("stop_time = 2", "stop_time = 3", "scenario's stop_time"),
        ("\"in_turn\"", "\"at_once\"", "scenario's stepping"),
        ("\"drive\"]", "\"drive\", \"third:level\"]", "scenario's record"),
        ("name = \"other\"", "name = \"another\"", "other's interface"),
        ("file = \"other.fmu\"", "file = \"twin.fmu\"", "SHA-256 of other's file"),
        ("interface = \"cs\"", "interface = \"me\"", "other's interface"),
        ("interface = \"cs\"", "", "other's interface"),
        ("\"set.ssv\"", "\"new.ssv\"", "alone's parameter set 1"),
        ("input = 1.5", "input = 2.5", "alone's input"),
        ("duration = 0.5", "duration = 0.25", "alone's run_in.duration"),
        ("flag = true", "flag = false", "alone's run_in.during.flag"),
        ("after = { fail = \"no\" }", "after = {}", "alone's run_in.after.fail"),
        ("column = \"a\"", "column = \"b\"", "third's inputs.input"),
        ("hold = true", "hold = false", "third's inputs.input"),
        ("[1, 2.0]]", "[1, 3.0]]", "scenario's inputs.drive"),
        ("to = \"alone:input\"", "to = \"third:input\"", "scenario's connections"),
        ("from_unit = \"m\"", "from_unit = \"km\"", "scenario's connections"),
        ("to_unit = \"m\"", "to_unit = \"km\"", "scenario's connections"),
        ("from_unit = \"m\"\nto_unit = \"m\"", "factor = 2", "scenario's connections"),
        ("from_unit = \"m\"\nto_unit = \"m\"", "table = [[1, 2]]", "scenario's connections"),
        ("deviation = 0.1", "deviation = 0.3", "scenario's noise.input"),
        ("seed = 1", "seed = 9", "scenario's noise.input"),
        ("deviation = 0.2", "deviation = 0.3", "scenario's measurement_noise.alone:level"),
        ("seed = 2", "seed = 9", "scenario's measurement_noise.alone:level"),
    ] {
        let changed = SCENARIO.replace(old, new);
        assert_ne!(changed, SCENARIO, "{old}");
        bench.write("scenario.toml", &changed);
        bench.write("new.ssv", &parameter_set("flag", "Boolean", "true"));
        bench.write("signal.csv", "t,a,b\n0,1,1\n1,2,2\n");
        let twin = careless::misbehaving(2, 2, "none");
        careless::write(&bench.path("twin.fmu"), &twin, careless::misbehaving_library());
        // A column of data counts with its name.
        refusal(new, name);
    }
    bench.write("scenario.toml", SCENARIO);
    for (old, new, name) in [
        ("records = true", "records = false", "records"),
        ("runs = 2", "runs = 3", "runs"),
        ("seed = 3", "seed = 4", "values of third:input"),
        ("from = 1, to = 2", "from = 0.5, to = 2", "values of third:input"),
        ("to = 2,", "to = 3,", "values of third:input"),
        ("\"linear\"", "\"logarithmic\"", "values of third:input"),
        ("\"third:input\"", "\"alone:input\"", "values of third:input"),
        ("final =", "mean =", "measures.last"),
        ("final = \"alone:level\"", "final = \"drive\"", "measures.last"),
        ("from = 1.0", "from = 1.25", "measures.last"),
        ("to = 1.5", "to = 1.25", "measures.last"),
        ("overshoot_up", "rise_time", "measures.up"),
        ("last =", "end =", "measures.last"),
    ] {
        let changed = STUDY.replace(old, new);
        assert_ne!(changed, STUDY, "{old}");
        bench.write("study.toml", &changed);
        refusal(new, name);
    }
    // What others wrote.
    let (header, rest) = journal.split_once('\n').unwrap();
    let version = env!("CARGO_PKG_VERSION");
    assert!(header.contains(&format!("\"version of cargo-fmu\":\"{version}\"")), "{header}");
    let other = header.replace(&format!("cargo-fmu\":\"{version}"), "cargo-fmu\":\"0.0.9");
    let other = format!("{other}\n{rest}");
    bench.write("study.toml", STUDY);
    bench.write("out/journal.jsonl", &other);
    let message = bench.refusal(&SWEEP);
    assert!(message.contains(&format!("\n  version of cargo-fmu was 0.0.9, is {version}\n")), "{message}");
    // It is only shown.
    bench.write("out/journal.jsonl", &journal);
    bench.write("study.toml", &STUDY.replace("\"One\"", "\"Two\""));
    bench.write("scenario.toml", &SCENARIO.replace("\"One\"", "\"Two\""));
    bench.write("signal.csv", "t,a\n0,1\n1,2\n");
    bench.succeeds(&SWEEP);
    assert_eq!(bench.read("out/journal.jsonl"), journal);
}

/// Its run is repeated, and gives the same.
#[test]
fn a_record_that_is_gone_is_noticed() {
    let bench = study();
    bench.succeeds(&SWEEP);
    let names = ["out/records/1.csv", "out/results.csv"];
    let before = names.map(|name| bench.read(name));
    fs::remove_file(bench.path(names[0])).unwrap();
    let output = bench.run(&SWEEP);
    let [printed, notes] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert_eq!(output.status.code(), Some(0), "{notes}");
    assert_eq!(notes, "note: the record of run 1 is gone: run 1 is repeated\n");
    assert!(printed.starts_with("1 of 2 runs are in the journal\n"), "{printed}");
    assert_eq!(names.map(|name| bench.read(name)), before);
    // The journal has it once more.
    assert_eq!(bench.succeeds(&SWEEP), "");
    // A study without records needs none.
    bench.write("study.toml", &STUDY.replace("records = true", "records = false"));
    let elsewhere = ["sweep", "study.toml", "--out", "elsewhere"];
    bench.succeeds(&elsewhere);
    assert_eq!(bench.succeeds(&elsewhere), "");
    let description = DESCRIPTION.replace("guid=", "author=\"other\" guid=");
    careless::write(&bench.path("careless.fmu"), &description, library());
    let message = bench.refusal(&elsewhere);
    assert!(message.contains("SHA-256 of alone's file was "), "{message}");
}
