//! Connections of scenarios and files.

use crate::careless::{DESCRIPTION, library};
use crate::{Bench, careless, last};

/// A plant whose output is in kPa and whose input is a share, and the connections that a scenario would have by name if
/// both had the first FMU's names and units.
const CONNECTIONS: &str = r#"
[[connection]]
from = "alone:level"
to = "other:p_in"

[[connection]]
from = "drive"
from_unit = "%"
to = "alone:input"
to_unit = "1"
"#;

/// A scenario of the FMU, and of one with other names and units that integrates the first one's level.
fn coupled() -> Bench {
    let bench = Bench::new();
    let other = DESCRIPTION
        .replace("name=\"level\"", "name=\"sum\"")
        .replace("name=\"input\"", "name=\"p_in\"")
        .replace("<Real start=\"1\"/>", "<Real unit=\"kPa\" start=\"1\"/>");
    careless::write(&bench.path("other.fmu"), &other, library());
    bench.scenario(1.0, "[[fmu]]\nname = \"other\"\nfile = \"other.fmu\"\n[inputs]\ndrive = 200\n");
    bench.write("connections.toml", CONNECTIONS);
    bench
}

/// As `level` integrates 2 from 0, it is 2 t Pa; `other` takes 0.002 t kPa after each step of the first.
#[test]
fn connections_lead_from_names_and_units_to_others() {
    let bench = coupled();
    let scenario = bench.read("scenario.toml");
    bench.write("with.toml", &format!("{scenario}{CONNECTIONS}"));
    let out = ["--out", "a.csv"];
    bench.succeeds(&[&["simulate", "with.toml"][..], &out].concat());
    let table = bench.read("a.csv");
    assert!(table.starts_with("time,drive,level,sum\n# s,%,Pa,Pa\n0.0,200.0,0.0,0.0\n"), "{table}");
    // The sum over k from 1 to 8 of 0.125 s · 0.002 · 0.125 k.
    assert!((last(&table) - 0.001_125).abs() < 1e-15, "{table}");
    let given = ["simulate", "scenario.toml", "--connections", "connections.toml"];
    bench.succeeds(&[&given[..], &out].concat());
    assert_eq!(bench.read("a.csv"), table);
    // Another signal, and a constant in its unit.
    bench.succeeds(&[&given[..], &["--set", "drive=100"], &out].concat());
    assert!((last(&bench.read("a.csv")) - 0.5 * 0.001_125).abs() < 1e-15, "{table}");

    // A function instead of units.
    let factor = CONNECTIONS.replace("to = \"other:p_in\"", "to = \"other:p_in\"\nfactor = 0.01\noffset = 3");
    bench.write("factor.toml", &factor);
    bench.succeeds(&[&["simulate", "scenario.toml", "--connections", "factor.toml"][..], &out].concat());
    assert!((last(&bench.read("a.csv")) - (0.01125 + 3.0)).abs() < 1e-13, "{}", bench.read("a.csv"));

    // A table, which has a 2 for the 200.
    let ends = "from_unit = \"%\"\nto = \"alone:input\"\nto_unit = \"1\"";
    let tabulated = CONNECTIONS.replace(ends, "to = \"alone:input\"\ntable = [[100, 7], [200, 2]]");
    bench.write("table.toml", &tabulated);
    bench.succeeds(&[&["simulate", "scenario.toml", "--connections", "table.toml"][..], &out].concat());
    assert!((last(&bench.read("a.csv")) - 0.001_125).abs() < 1e-15, "{}", bench.read("a.csv"));

    // Noise is in the unit of the input: a thousand times the level, where in Pa it would be the level itself.
    let noise = scenario.replace("step = 0.125", "step = 0.125\nnoise.p_in.standard_deviation = 2.0");
    bench.write("noise.toml", &noise);
    bench.succeeds(&[&["simulate", "noise.toml", "--connections", "connections.toml"][..], &out].concat());
    assert!((last(&bench.read("a.csv")) - 0.001_125).abs() > 0.01, "{}", bench.read("a.csv"));
}

#[test]
fn each_fault_of_a_connection_is_named_with_its_line() {
    let bench = coupled();
    for (old, new, reason) in [
        ("alone:level", "aloen:level", "line 2, connection[1]: there is no FMU aloen; did you mean alone?"),
        (
            "alone:level",
            "alone:levle",
            "line 2, connection[1]: alone has no output levle; did you mean level?",
        ),
        ("other:p_in", "other:pin", "line 2, connection[1]: other has no input pin; did you mean p_in?"),
        ("other:p_in", "other:flag", "line 2, connection[1]: other has no input flag"),
        (
            "other:p_in",
            "other",
            "line 4, connection[1].to: expected the target: \"FMU:input\", found the text \"other\"",
        ),
        ("from = \"drive\"", "from = \":drive\"", "line 7, connection[2].from: expected the source: "),
        ("drive", "drvie", "inputs.drive: no connection is from drive; did you mean drvie?"),
        (
            "alone:input",
            "other:p_in",
            "line 6, connection[2]: other:p_in has two sources: alone:level, in line 2, and drive",
        ),
        ("\"%\"", "\"V\"", "line 6, connection[2]: drive to alone:input: the unit V does not convert to 1"),
        (
            "\"%\"",
            "\"furlong\"",
            "line 6, connection[2]: drive to alone:input: the unit 'furlong' is not known",
        ),
        (
            "to_unit = \"1\"",
            "factor = 2",
            "line 6, connection[2]: give either units, or a factor and an offset, or a table",
        ),
        (
            "from_unit = \"%\"",
            "table = [[1]]",
            "line 8, connection[2].table[1]: expected a pair of a value and the one in its place, found a list",
        ),
        (
            "from_unit",
            "from_unti",
            "line 8, connection[2].from_unti: this key is not known; did you mean from_unit?",
        ),
        ("\n[[connection]]", "\nstep = 1\n[[connection]]", "line 2, step: this key is not known"),
    ] {
        let text = CONNECTIONS.replacen(old, new, 1);
        assert_ne!(text, CONNECTIONS, "{old}");
        bench.write("wrong.toml", &text);
        let message = bench.refusal(&["simulate", "scenario.toml", "--connections", "wrong.toml"]);
        assert!(message.contains(reason), "{new}: {message}");
    }
    for (text, reason) in [
        (
            "{\"as\": \"plant\"}",
            "wrong.toml is JSON, as name maps were; connections are tables [[connection]] in TOML",
        ),
        ("", "line 1, the file: connection is missing: a table [[connection]] for each connection"),
        (
            "connection = []",
            "line 1, connection: expected a table [[connection]] for each connection, found a list of 0",
        ),
    ] {
        bench.write("wrong.toml", text);
        let message = bench.refusal(&["simulate", "scenario.toml", "--connections", "wrong.toml"]);
        assert!(message.contains(reason), "{text}: {message}");
    }
    let message = bench.refusal(&["simulate", "careless.fmu", "--connections", "connections.toml"]);
    assert!(
        message.contains("--connections connections.toml: only for scenarios, not single FMUs"),
        "{message}"
    );
    let message = bench.refusal(&[
        "simulate",
        "scenario.toml",
        "--connections",
        "connections.toml",
        "--out",
        "connections.toml",
    ]);
    assert!(message.contains("connections.toml: a record is a file that ends with"), "{message}");
}

/// Both get 200: as a percentage, and as a pressure.
#[test]
fn a_signal_for_inputs_in_different_units_needs_its_own() {
    let bench = coupled();
    let both =
        CONNECTIONS.replace("from = \"alone:level\"", "from = \"drive\"").replace("from_unit = \"%\"\n", "");
    bench.write("both.toml", &both);
    let message = bench.refusal(&["simulate", "scenario.toml", "--connections", "both.toml"]);
    let reason = "inputs.drive: other:p_in is in kPa, alone:input in 1: give each its own signal, or a connection with from_unit";
    assert!(message.contains(reason), "{message}");
}

/// In a loop with an FMU of other names, what an unchanged scenario records may be missing.
#[test]
fn a_name_that_a_replaced_fmu_does_not_have_is_not_recorded() {
    let bench = coupled();
    let panels = "record = [\"drive\", \"alone:level\", \"sum\"]\npanels = [[\"alone:level\"], [\"sum\"]]\n\
                  measurement_noise.sum.standard_deviation = 1.0\n";
    let scenario = format!("{panels}{}", bench.read("scenario.toml"));
    bench.write("scenario.toml", &scenario.replace("other.fmu", "careless.fmu"));
    bench.write("connections.toml", &CONNECTIONS.replace("other:p_in", "other:input"));
    let simulate = ["simulate", "scenario.toml", "--connections", "connections.toml"];
    let message = bench.refusal(&simulate);
    assert!(message.contains("line 1, record[3]: no FMU has a variable sum"), "{message}");
    let replaced = ["--fmu", "other=careless.fmu", "--out", "a.csv", "--plot", "a.svg"];
    let output = bench.run(&[&simulate[..], &replaced].concat());
    let notes = String::from_utf8(output.stderr).unwrap();
    assert_eq!(notes, "note: scenario.toml, line 1, record[3]: no FMU has a variable sum\n");
    assert!(bench.read("a.csv").starts_with("time,drive,alone:level\n# s,%,Pa\n"), "{}", bench.read("a.csv"));
}

#[test]
fn a_study_depends_on_its_connections() {
    let bench = coupled();
    bench.write("study.toml", "scenario = \"scenario.toml\"\n[grid]\n\"alone:flag\" = [true]\n[measures]\nlast = { final = \"sum\" }\n");
    let sweep = ["sweep", "study.toml", "--out", "out", "--connections", "connections.toml"];
    bench.succeeds(&sweep);
    let results = bench.read("out/results.csv");
    let cell: f64 = results.lines().last().unwrap().split(',').nth(2).unwrap().parse().unwrap();
    assert!((cell - 0.001_125).abs() < 1e-15, "{results}");
    bench.write("connections.toml", &CONNECTIONS.replace("to_unit = \"1\"", "to_unit = \"%\""));
    let message = bench.refusal(&sweep);
    assert!(message.contains("scenario's connections was "), "{message}");
}

/// Without connections.
#[test]
fn two_outputs_of_an_inputs_name_are_refused() {
    let bench = coupled();
    let taker =
        DESCRIPTION.replace("name=\"level\"", "name=\"sum\"").replace("name=\"input\"", "name=\"level\"");
    careless::write(&bench.path("other.fmu"), &taker, library());
    let twin = "[[fmu]]\nname = \"twin\"\nfile = \"careless.fmu\"\n[inputs]\ninput = 1";
    let scenario = bench.read("scenario.toml").replace("[inputs]\ndrive = 200", twin);
    bench.write("scenario.toml", &scenario);
    let message = bench.refusal(&["simulate", "scenario.toml"]);
    assert!(
        message.contains("fmu[2].file: other:level has two sources: alone:level and twin:level"),
        "{message}"
    );
    // A signal of its own decides.
    bench.write(
        "scenario.toml",
        &scenario.replace("file = \"other.fmu\"", "file = \"other.fmu\"\ninputs.level = 1"),
    );
    bench.succeeds(&["simulate", "scenario.toml", "--record", "sum"]);
}
