//! The commands that run FMUs, as a user would run them, with the FMU of `careless/`: their errors, and the files that
//! they leave.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use tempfile::TempDir;

use self::archives::write_archive;
use self::careless::{DESCRIPTION, library};

#[path = "../support/archives.rs"]
mod archives;
#[path = "../../../fmu-master/tests/careless/mod.rs"]
mod careless;
mod compiling;
mod connections;
mod ends;
mod misbehaving;
mod resuming;
mod systems;

/// The valid part of the study.
const GRID: &str = "scenario = \"scenario.toml\"\nrecords = true\n[grid]\n\"alone:input\" = [1.0, 2.0]\n";

/// A folder with the FMU, a scenario and a study.
struct Bench(TempDir);

impl Bench {
    fn new() -> Self {
        let bench = Self(tempfile::tempdir().unwrap());
        careless::write(&bench.path("careless.fmu"), DESCRIPTION, library());
        bench.scenario(1.0, "");
        bench.write("study.toml", &format!("{GRID}[measures]\nlast = {{ final = \"level\" }}\n"));
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

    /// Writes the scenario, with lines for its FMU.
    fn scenario(&self, stop_time: f64, more: &str) {
        let text = format!(
            "step = 0.125\nstop_time = {stop_time:?}\n[[fmu]]\nname = \"alone\"\nfile = \"careless.fmu\"\n{more}"
        );
        self.write("scenario.toml", &text);
    }

    /// The files and folders there.
    fn names(&self, folder: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(folder)).unwrap();
        let mut names: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_cargo-fmu"));
        command.args(arguments).current_dir(self.0.path());
        if ["simulate", "sweep"].contains(&arguments[0]) {
            command.args(["--fmus", "."]);
        }
        command
    }

    fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// What a successful command prints on its standard error.
    fn succeeds(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let printed = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{arguments:?}: {printed}");
        printed
    }

    /// The message of a failing command.
    fn refusal(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let printed = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {printed}");
        printed
    }
}

/// A library outside of the FMU's folder, which exists, must not be loaded.
#[test]
fn an_fmu_with_a_path_for_its_identifier_is_not_loaded() {
    let bench = Bench::new();
    let outside = bench.path("outside");
    for suffix in ["so", "dll", "dylib"] {
        fs::write(outside.with_extension(suffix), library()).unwrap();
    }
    let up = "../".repeat(20);
    let identifier = format!("{up}{}", outside.to_str().unwrap().trim_start_matches('/'));
    let description =
        DESCRIPTION.replace("modelIdentifier=\"careless\"", &format!("modelIdentifier=\"{identifier}\""));
    careless::write(&bench.path("careless.fmu"), &description, library());
    let message = bench.refusal(&["simulate", "scenario.toml"]);
    assert!(message.contains("careless.fmu") && message.contains(&identifier), "{message}");
    assert!(message.contains("is not a C identifier"), "{message}");
}

/// In what the FMU logs, and in names.
#[test]
fn messages_of_an_fmu_do_not_control_the_terminal() {
    let bench = Bench::new();
    let printed = "\u{9b}31m\u{202e}\u{7f}";
    let description =
        DESCRIPTION.replace("guid=\"careless\"", &format!("guid=\"{printed}\u{9d}0;title\u{9c}\""));
    careless::write(&bench.path("careless.fmu"), &description, library());
    let message = bench.refusal(&["simulate", "scenario.toml"]);
    assert!(message.contains(r"\u{9b}31m\u{202e}\u{7f}\u{9d}0;title\u{9c} is not 100% mine"), "{message}");
    assert!(message.chars().all(|character| character == '\n' || !character.is_control()), "{message:?}");
}

/// On Unix an access to the missing part raises SIGBUS. The file ends with the sections' headers, after the data.
#[test]
fn a_truncated_library_is_not_loaded() {
    let bench = Bench::new();
    let whole = library();
    for length in [whole.len() - 1, whole.len() / 2, whole.len() / 4, 4096, 100] {
        careless::write(&bench.path("careless.fmu"), DESCRIPTION, &whole[..length]);
        let message = bench.refusal(&["simulate", "scenario.toml"]);
        assert!(message.contains("it is damaged or cut short"), "{length} bytes: {message}");
    }
}

#[test]
fn outputs_that_are_inputs_or_each_other_are_refused_before_anything_runs() {
    let bench = Bench::new();
    let table = "time,a\n0,1\n1,2\n";
    bench.write("signal.csv", table);
    bench.scenario(1.0, "inputs.input = { csv = \"signal.csv\", column = \"a\" }");
    let scenario = bench.read("scenario.toml");
    let fmu = fs::read(bench.path("careless.fmu")).unwrap();
    let before = bench.names(".");
    let simulate = ["simulate", "scenario.toml"];
    for (options, reason) in [
        (["--out", "scenario.toml"].as_slice(), "scenario.toml: a record is a file that ends with"),
        (&["--out", "careless.fmu"], "careless.fmu: a record is a file that ends with"),
        (&["--out", "./signal.csv"], "the input signal.csv would be lost"),
        (&["--out", "missing/x.csv"], "cannot write missing/x.csv: "),
    ] {
        let message = bench.refusal(&[&simulate, options].concat());
        assert!(message.contains(reason), "{options:?}: {message}");
    }
    assert_eq!((bench.read("scenario.toml"), bench.read("signal.csv")), (scenario, table.to_owned()));
    assert_eq!(fs::read(bench.path("careless.fmu")).unwrap(), fmu);
    assert_eq!(bench.names("."), before);

    // A study reads what another study recorded.
    fs::create_dir_all(bench.path("out/records")).unwrap();
    bench.write("out/records/0.csv", table);
    bench.scenario(1.0, "inputs.input = { csv = \"out/records/0.csv\", column = \"a\" }");
    let message = bench.refusal(&["sweep", "study.toml", "--out", "out"]);
    assert!(message.contains("out/records: the input out/records/0.csv would be lost"), "{message}");
    assert_eq!(bench.read("out/records/0.csv"), table);
    bench.write("results.csv", &bench.read("study.toml"));
    let message = bench.refusal(&["sweep", "results.csv", "--out", "."]);
    assert!(message.contains("the input results.csv would be lost"), "{message}");
}

/// Two runs of equal duration; the file is one of theirs.
#[test]
fn two_processes_with_one_output_leave_one_complete_file() {
    let bench = Bench::new();
    let mut whole = vec![];
    for (name, input) in [("one.toml", 1), ("other.toml", 3)] {
        bench.scenario(3000.0, &format!("values = {{ input = {input} }}"));
        fs::rename(bench.path("scenario.toml"), bench.path(name)).unwrap();
        bench.succeeds(&["simulate", name, "--out", "alone.csv"]);
        whole.push(bench.read("alone.csv"));
    }
    assert_ne!(whole[0], whole[1]);
    // Other files next to it are kept.
    bench.write("race.csv.new", "mine");
    for _ in 0..20 {
        let race =
            |name| bench.command(&["simulate", name, "--out", "race.csv"]).stdout(Stdio::null()).spawn();
        let both = [race("one.toml").unwrap(), race("other.toml").unwrap()];
        for mut process in both {
            assert!(process.wait().unwrap().success());
        }
        assert!(whole.contains(&bench.read("race.csv")));
    }
    assert_eq!(bench.read("race.csv.new"), "mine");
    let left = bench.names(".");
    assert!(left.iter().all(|name| !name.starts_with('.')), "{left:?}");
}

/// A command limited to a number of 512-byte blocks per file, which ignores the signal at the limit.
#[cfg(unix)]
fn limited(command: &Command, blocks: u32) -> Command {
    let mut limited = Command::new("sh");
    limited.args(["-c", &format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\"")]);
    limited.arg(command.get_program()).args(command.get_args());
    limited.current_dir(command.get_current_dir().unwrap());
    limited
}

/// As on a full disk.
#[cfg(unix)]
#[test]
fn an_existing_file_stays_when_writing_fails() {
    // More than the FMU, and less than the output.
    const BLOCKS: u32 = 128;
    let bench = Bench::new();
    bench.succeeds(&["simulate", "scenario.toml", "--out", "good.csv", "--plot", "good.html"]);
    let [csv, html] = ["good.csv", "good.html"].map(|name| bench.read(name));
    bench.scenario(5000.0, "");
    let before = bench.names(".");
    for options in [["--out", "good.csv"], ["--plot", "good.html"], ["--out", "new.csv"]] {
        let command = bench.command(&[&["simulate", "scenario.toml"], &options[..]].concat());
        let output = limited(&command, BLOCKS).output().unwrap();
        let printed = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{printed}");
        assert_eq!(printed.matches("File too large").count(), 1, "{printed}");
        assert!(printed.starts_with("error: cannot write "), "{printed}");
    }
    assert_eq!([bench.read("good.csv"), bench.read("good.html")], [csv, html]);
    assert_eq!(bench.names("."), before);
    // The journal keeps no part of a line either, and the study resumes from it.
    let many = bench.read("study.toml").replace("[1.0, 2.0]", "{ from = 0, to = 1, points = 3000 }");
    bench.write("study.toml", &many.replace("records = true", "records = false"));
    bench.scenario(1.0, "");
    let command = bench.command(&["sweep", "study.toml", "--out", "out"]);
    let output = limited(&command, BLOCKS).output().unwrap();
    let printed = String::from_utf8(output.stderr).unwrap();
    assert!(
        output.status.code() == Some(2) && printed.contains("journal.jsonl: File too large"),
        "{printed}"
    );
    assert!(bench.read("out/journal.jsonl").ends_with("}\n"));
    bench.succeeds(&["sweep", "study.toml", "--out", "out"]);
    assert_eq!(bench.read("out/results.csv").lines().count(), 3002);
}

/// What is in a PNG's header, at offsets of its specification.
fn png_size(png: &[u8]) -> [u32; 2] {
    assert!(png.starts_with(b"\x89PNG\r\n\x1a\n"));
    [16, 20].map(|place| u32::from_be_bytes(png[place..place + 4].try_into().unwrap()))
}

#[test]
fn a_plot_is_what_its_ending_says_and_has_the_panels_of_the_scenario() {
    let bench = Bench::new();
    bench.scenario(1.0, "values = { input = 2 }");
    let scenario = bench.read("scenario.toml");
    let with = |more: &str| bench.write("scenario.toml", &format!("{more}\n{scenario}"));
    with("title = \"A <short> test\"\npanels = [[\"level\"], [\"level\"]]");
    for name in ["plot.svg", "plot.PNG", "plot.html"] {
        bench.succeeds(&["simulate", "scenario.toml", "--plot", name]);
    }
    let svg = bench.read("plot.svg");
    assert!(svg.starts_with("<svg ") && svg.contains("A &lt;short&gt; test"), "{svg}");
    assert_eq!(svg.matches("<polyline").count() % 2, 0, "{svg}");
    // 900 pixels in the style sheet's measure, twice as many for dense screens.
    let [width, height] = png_size(&fs::read(bench.path("plot.PNG")).unwrap());
    assert!(width == 1800 && svg.contains(&format!("height=\"{}\"", height / 2)), "{width} {height}");
    let html = bench.read("plot.html");
    assert!(html.contains("<h1>A &lt;short&gt; test</h1>"));
    assert_eq!(html.matches("<div class=\"panel\"").count(), 2);
    // Nearly all of it is the library.
    assert!(html.len() < 1_500_000, "{}", html.len());

    for (panels, reason) in [
        ("[[\"level\"], [\"levle\"]]", "line 1, panels[2][1]: levle is not recorded; did you mean level?"),
        ("[[]]", "line 1, panels[1]: expected at least one name, found a list of 0"),
        ("[\"level\"]", "line 1, panels[1]: expected a list of names of variables, found the text \"level\""),
        ("[]", "line 1, panels: expected a list of panels, each a list of names"),
    ] {
        with(&format!("panels = {panels}"));
        let message = bench.refusal(&["simulate", "scenario.toml"]);
        assert!(message.contains(reason), "{message}");
    }
    with("");
    for name in ["plot.pdf", "plot", "svg"] {
        let message = bench.refusal(&["simulate", "scenario.toml", "--plot", name, "--out", "none.csv"]);
        let reason = format!("{name}: a plot file must end with .svg, .png or .html");
        assert!(message.contains(&reason) && !bench.path("none.csv").exists(), "{message}");
    }
}

#[test]
fn a_record_is_what_its_ending_says_and_has_units() {
    let bench = Bench::new();
    for name in ["record.csv", "record.parquet"] {
        bench.succeeds(&["simulate", "scenario.toml", "--out", name]);
    }
    assert!(bench.read("record.csv").starts_with("time,level\n# s,Pa\n0.0,"));
    bench.succeeds(&["simulate", "scenario.toml", "--out", "plain.csv", "--no-units"]);
    assert!(bench.read("plain.csv").starts_with("time,level\n0.0,"));
    let parquet = fs::read(bench.path("record.parquet")).unwrap();
    assert!(parquet.starts_with(b"PAR1"));
    let metadata = String::from_utf8_lossy(&parquet);
    assert!(metadata.contains(r#"{"level":"Pa","time":"s"}"#));
    for name in ["record.xlsx", "record", "csv"] {
        let message = bench.refusal(&["simulate", "scenario.toml", "--out", name]);
        assert!(
            message.contains(&format!("{name}: a record is a file that ends with .csv or .parquet")),
            "{message}"
        );
        assert!(!bench.path(name).exists());
    }
    let printed = |arguments: &[&str]| String::from_utf8(bench.run(arguments).stdout).unwrap();
    let compared = printed(&["compare", "record.csv", "record.parquet", "--plot", "all.html"]);
    assert_eq!(compared, "record.parquet minus record.csv:\n  level           equal\nall.html\n");
}

/// The last value of a record's last column.
fn last(table: &str) -> f64 {
    table.lines().last().unwrap().rsplit(',').next().unwrap().parse().unwrap()
}

#[test]
fn one_fmu_runs_alone_with_values_of_the_command_line() {
    let bench = Bench::new();
    let alone = ["simulate", "careless.fmu", "--step", "0.125"];
    let empty = "<ssv:ParameterSet xmlns:ssv=\"http://ssp-standard.org/SSP1/SystemStructureParameterValues\" version=\"1.0\" \
                 name=\"none\"><ssv:Parameters/></ssv:ParameterSet>";
    bench.write("none.ssv", empty);
    let options = ["--parameters", "none.ssv", "--out", "careless.csv"];
    let message = bench.succeeds(&[&alone[..], &options].concat());
    assert!(message.contains("note: --parameters none.ssv: it sets no parameters"), "{message}");
    assert!(message.contains("note: Careless defines no stop time: it runs to 1 s"), "{message}");
    assert!(bench.read("careless.csv").lines().last().unwrap().starts_with("1.0,"));
    let alone = [&alone[..], &["--stop-time", "2", "--out", "careless.csv"]].concat();
    bench.succeeds(&alone);
    // The start value of the input is 1.
    assert_eq!(last(&bench.read("careless.csv")).to_bits(), 2.0_f64.to_bits());
    bench.succeeds(&[&alone[..], &["--set", "input=3", "--set", "Careless:flag=true"]].concat());
    assert_eq!(last(&bench.read("careless.csv")).to_bits(), 6.0_f64.to_bits());
    bench.succeeds(&[&alone[..], &["--record", "level,Careless:flag", "--set", "flag=true"]].concat());
    assert!(bench.read("careless.csv").ends_with("2.0,2.0,1.0\n"));
    bench.write("set.ssv", &parameter_set("flag", "Boolean", "true"));
    bench.succeeds(&[&alone[..], &["--record", "flag", "--parameters", "set.ssv"]].concat());
    assert!(bench.read("careless.csv").ends_with("2.0,1.0\n"));
    bench.write("other.ssv", &parameter_set("flga", "Boolean", "true"));
    for (options, reason) in [
        (["--set", "inptu=1"], "--set inptu=1: no FMU has a settable variable inptu; did you mean input?"),
        (["--set", "input=x"], "--set input=x: expected a number"),
        (["--set", "input=1 kPa"], "--set input=1 kPa: the value 1 kPa of input cannot be used: "),
        (["--set", "flag=maybe"], "--set flag=maybe: expected true or false"),
        (
            ["--set", "fail=eror"],
            "--set fail=eror: the value eror of fail cannot be used: it is not one of no, ",
        ),
        (["--set", "level=1"], "--set level=1: no FMU has a settable variable level"),
        (["--set", "fail=error"], "fmi2DoStep returned fmi2Error at 0 s"),
        (["--set", "flag"], "expected NAME=VALUE"),
        (["--parameters", "other.ssv"], "--parameters other.ssv: no FMU has a parameter of the set any"),
        (["--fmu", "a=b.fmu"], "--fmu a=b.fmu: only for scenarios, not single FMUs"),
        (["--record", "levl"], "--record: no FMU has a variable levl; did you mean level?"),
    ] {
        let message = bench.refusal(&[&alone[..], &options].concat());
        assert!(message.contains(reason), "{message}");
    }
}

/// The rule of docs/simulate.md: any heading of the time, a jump, and a column that is no input.
#[test]
fn measured_data_drive_an_input_by_one_rule() {
    let bench = Bench::new();
    bench.write("jump.csv", "t (ms),inptu,input,note\n0,1,0,start\n500,1,0,up\n500,1,4,up\n2000,1,4,end\n");
    let alone = ["simulate", "careless.fmu", "--step", "0.125", "--stop-time", "1", "--input", "jump.csv"];
    let output = bench.run(&[&alone[..], &["--out", "one.csv"]].concat());
    let warnings = String::from_utf8(output.stderr).unwrap();
    assert_eq!(
        warnings,
        "warning: --input jump.csv: no FMU has an input inptu; did you mean input?\n\
         warning: --input jump.csv: no FMU has an input note\n"
    );
    // Half a second at 4.
    assert_eq!(last(&bench.read("one.csv")).to_bits(), 2.0_f64.to_bits());
    bench.scenario(1.0, "[inputs]\ninput = { csv = \"jump.csv\", column = \"input\" }");
    bench.succeeds(&["simulate", "scenario.toml", "--out", "other.csv"]);
    assert_eq!(bench.read("other.csv"), bench.read("one.csv"));
    for (text, reason) in [
        ("time,input\n0,1\n1,x\n", "cannot read jump.csv: line 3, input: expected a number, found \"x\""),
        ("time,input\n1,1\n0,1\n", "cannot read jump.csv: line 3, time: the time decreases from 1 s to 0 s"),
    ] {
        bench.write("jump.csv", text);
        for (arguments, place) in [
            (&alone[..], "error: --input: "),
            (&["simulate", "scenario.toml"], "error: scenario.toml, line 7, inputs.input"),
        ] {
            let message = bench.refusal(arguments);
            assert!(message.starts_with(place) && message.ends_with(&format!("{reason}\n")), "{message}");
        }
    }
}

fn parameter_set(name: &str, data_type: &str, value: &str) -> String {
    format!(
        "<ssv:ParameterSet xmlns:ssv=\"http://ssp-standard.org/SSP1/SystemStructureParameterValues\" version=\"1.0\" \
         name=\"any\"><ssv:Parameters><ssv:Parameter name=\"{name}\"><ssv:{data_type} value=\"{value}\"/>\
         </ssv:Parameter></ssv:Parameters></ssv:ParameterSet>"
    )
}

#[test]
fn values_of_the_command_line_replace_those_of_the_scenario() {
    let bench = Bench::new();
    bench.scenario(
        1.0,
        "values = { input = 5, flag = true }\nrun_in = { duration = 1, during = { fail = \"no\" } }",
    );
    let out = ["--out", "scenario.csv"];
    bench.succeeds(
        &[&["simulate", "scenario.toml", "--set", "input=7", "--stop-time", "2"][..], &out].concat(),
    );
    // From the run-in with the same input, one second long.
    assert_eq!(last(&bench.read("scenario.csv")).to_bits(), 21.0_f64.to_bits());
    bench.scenario(1.0, "values = { flag = true }\n[inputs]\ninput = { steps = [[0, 1], [0.5, 2]] }");
    for name in ["input=4", "alone:input=4"] {
        bench.succeeds(&[&["simulate", "scenario.toml", "--set", name][..], &out].concat());
        assert_eq!(last(&bench.read("scenario.csv")).to_bits(), 4.0_f64.to_bits(), "{name}");
    }
    for (options, reason) in [
        (["--stop-time", "0"], "--stop-time 0: expected a time after start_time, 0 s"),
        (["--step", "0.1"], "--step is for a system or a single FMU; scenario.toml sets its own"),
    ] {
        let message = bench.refusal(&[&["simulate", "scenario.toml"], &options[..]].concat());
        assert!(message.contains(reason), "{message}");
    }
    bench.scenario(1.0, "run_in = { duration = 1, during = { flag = true }, after = { fail = \"no\" } }");
    let message = bench.refusal(&["simulate", "scenario.toml", "--set", "flag=false"]);
    assert!(message.contains("--set flag=false: the scenario sets flag in the run_in of alone"), "{message}");
}

/// Two FMUs: the first integrates the system's input, the second twice what the first says.
fn write_system(bench: &Bench, old: &str, new: &str) {
    const STRUCTURE: &str = r#"<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
        xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="Chain">
      <ssd:System name="Chain">
        <ssd:Connectors><ssd:Connector name="drive" kind="input"><ssc:Real/></ssd:Connector></ssd:Connectors>
        <ssd:ParameterBindings><ssd:ParameterBinding source="start.ssv"/></ssd:ParameterBindings>
        <ssd:Elements>
          <ssd:Component name="first" source="resources/careless.fmu"><ssd:Connectors>
            <ssd:Connector name="input" kind="input"/><ssd:Connector name="level" kind="output"/></ssd:Connectors>
            <ssd:ParameterBindings><ssd:ParameterBinding source="flag.ssv"/></ssd:ParameterBindings></ssd:Component>
          <ssd:Component name="second" source="resources/careless.fmu"><ssd:Connectors>
            <ssd:Connector name="input" kind="input"/></ssd:Connectors></ssd:Component>
        </ssd:Elements>
        <ssd:Connections>
          <ssd:Connection startConnector="drive" endElement="first" endConnector="input"/>
          <ssd:Connection startElement="first" startConnector="level" endElement="second" endConnector="input">
            <ssc:LinearTransformation factor="2"/></ssd:Connection>
        </ssd:Connections>
      </ssd:System>
      <ssd:DefaultExperiment stopTime="1"/>
    </ssd:SystemStructureDescription>"#;
    let structure = STRUCTURE.replace(old, new);
    assert!(old == new || structure != STRUCTURE, "{old}");
    let start = parameter_set("drive", "Real", "3");
    let flag = parameter_set("flag", "Boolean", "true");
    let fmu = fs::read(bench.path("careless.fmu")).unwrap();
    let files = [
        ("SystemStructure.ssd", structure.as_bytes()),
        ("start.ssv", start.as_bytes()),
        ("flag.ssv", flag.as_bytes()),
        ("resources/careless.fmu", &fmu),
    ];
    write_archive(&bench.path("chain.ssp"), &files);
}

#[test]
fn a_system_runs_with_its_connections_start_values_and_parameters() {
    let bench = Bench::new();
    write_system(&bench, "", "");
    let system = ["simulate", "chain.ssp", "--step", "0.125", "--out", "chain.csv"];
    bench.succeeds(&system);
    let table = bench.read("chain.csv");
    assert!(
        table.starts_with("time,drive,first:level,second:level\n# s,,Pa,Pa\n0.0,3.0,0.0,0.0\n"),
        "{table}"
    );
    // In turn: the sum over k from 1 to 8 of 0.125 s · 2 · (3 · 0.125 k).
    assert!(table.ends_with("\n1.0,3.0,3.0,3.375\n"), "{table}");
    bench.succeeds(
        &[
            &system[..],
            &["--set", "drive=6", "--stop-time", "0.5", "--record", "second:level,drive,first:flag"],
        ]
        .concat(),
    );
    // Twice the sum from 1 to 4.
    assert!(bench.read("chain.csv").ends_with("\n0.5,1.875,6.0,1.0\n"), "{}", bench.read("chain.csv"));
    for (options, reason) in [
        (["--set", "input=1"], "--set input=1: ambiguous: use first:input or second:input"),
        (["--fmu", "first=careless.fmu"], "--fmu first=careless.fmu: only for scenarios, not systems"),
        (["--connections", "a.toml"], "--connections a.toml: only for scenarios, not systems"),
    ] {
        let message = bench.refusal(&[&system[..], &options].concat());
        assert!(message.contains(reason), "{message}");
    }
    for (old, new, reason) in [
        (
            "startElement=\"first\"",
            "startElement=\"third\"",
            "the connections of Chain: there is no element third",
        ),
        (
            "careless.fmu\"><ssd:Connectors>\n            <ssd:Connector name=\"input\" kind=\"input\"/></",
            "none.fmu\"><ssd:Connectors></",
            "the component second: cannot open chain.ssp/resources/none.fmu: ",
        ),
        ("name=\"drive\"", "name=\"other\"", "the connections of Chain: Chain has no connector drive"),
    ] {
        write_system(&bench, old, new);
        let message = bench.refusal(&system);
        assert!(message.contains(reason), "{message}");
    }
    careless::write(&bench.path("careless.fmu"), DESCRIPTION, &library()[..100]);
    write_system(&bench, "", "");
    let message = bench.refusal(&system);
    assert!(message.contains("cannot import chain.ssp/resources/careless.fmu: "), "{message}");
}

/// Of the chain, in which nothing returns.
#[test]
fn what_cannot_be_linearized_is_named_and_a_cut_chain_has_no_gain() {
    let bench = Bench::new();
    write_system(&bench, "", "");
    let system = ["linearize", "chain.ssp", "--step", "0.125"];
    let cut = bench.run(&[&system[..], &["--loop", "second:input", "--frequencies", "0.5,2"]].concat());
    assert_eq!(String::from_utf8(cut.stderr).unwrap(), "");
    let printed = String::from_utf8(cut.stdout).unwrap();
    assert!(printed.ends_with(" frequencies\n  gain margin none\n  phase margin none\n"), "{printed}");
    for (options, reason) in [
        (&[][..], "nothing to linearize: first and second have no continuous states"),
        (&["--of", "fist"], "--of fist: there is no such FMU; did you mean first?"),
        (&["--of", "first"], "first: the FMU has no continuous states"),
        (&["--loop", "inptu"], "--loop inptu: no FMU gets inptu from another; did you mean input?"),
        (&["--path", "input,level"], "--path input,level: no linearized FMU has this input and output"),
        (&["--frequencies", "2,1"], "--frequencies: expected two frequencies in Hz, the lower first"),
        (
            &["--loop", "input", "--frequencies", "3,4"],
            "--frequencies: a loop can only be measured below 2\u{202f}Hz",
        ),
        (&["--amplitude", "1"], "--loop <[FMU:]INPUT>"),
        (&["--plot", "loop.svg"], "loop.svg: the page must end with .html"),
        (&["--out", "chain.ssp"], "the input chain.ssp would be lost"),
    ] {
        let message = bench.refusal(&[&system[..], options].concat());
        assert!(message.contains(reason), "{message}");
    }
}

#[test]
fn a_missing_fmu_is_answered_with_what_to_do() {
    let bench = Bench::new();
    bench.write("wrong.toml", &bench.read("scenario.toml").replace("careless.fmu", "carless.fmu"));
    let message = bench.refusal(&["simulate", "wrong.toml"]);
    for part in [
        "wrong.toml, line 5, fmu[1].file: ./carless.fmu does not exist; name another",
        ": `export` writes FMUs to target/fmu; ",
        "did you mean careless.fmu?",
        "name another folder with --fmus DIR or another file with --fmu alone=FILE.fmu",
    ] {
        assert!(message.contains(part), "{message}");
    }
    // The default is the same for all commands, and not the scenario's folder.
    for arguments in [["simulate", "scenario.toml"], ["sweep", "study.toml"]] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_cargo-fmu"));
        let output = command.args(arguments).current_dir(bench.0.path()).output().unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(message.contains("target/fmu/") && message.contains("`export` writes"), "{message}");
    }
    let twice = ["simulate", "scenario.toml", "--fmu", "alone=careless.fmu", "--fmu", "alone=careless.fmu"];
    assert!(bench.refusal(&twice).contains("duplicate FMU: --fmu names alone twice"));
}

/// The other FMU has no such input.
#[test]
fn signals_are_recorded_where_a_replaced_fmu_lacks_the_input() {
    let bench = Bench::new();
    bench.scenario(1.0, "inputs = { own = 5 }\n[inputs]\nthrottle = { steps = [[0, 1], [0.5, 2]] }");
    bench.write(
        "record.toml",
        &format!("record = [\"throttle\", \"own\", \"level\"]\n{}", bench.read("scenario.toml")),
    );
    let message = bench.refusal(&["simulate", "record.toml"]);
    assert!(message.contains("inputs.throttle: no FMU has an input throttle"), "{message}");
    let replaced = ["simulate", "record.toml", "--fmu", "alone=careless.fmu", "--out", "record.csv"];
    let replaced = bench.run(&replaced);
    let notes = String::from_utf8(replaced.stderr).unwrap();
    assert!(replaced.status.success(), "{notes}");
    assert!(
        notes.contains("note: record.toml, line 9, inputs.throttle: no FMU has an input throttle"),
        "{notes}"
    );
    let table = bench.read("record.csv");
    assert!(table.starts_with("time,throttle,own,level\n# s,,,Pa\n0.0,1.0,5.0,0.0\n"), "{table}");
    assert!(table.ends_with("\n1.0,2.0,5.0,1.0\n"), "{table}");
}

/// Fig. 13 begins with a run-in that sets `initialization.mode`, which another plant does not have.
#[test]
fn a_run_in_is_left_out_where_a_replaced_fmu_lacks_its_variables() {
    let bench = Bench::new();
    bench.scenario(
        1.0,
        "run_in = { duration = 1, during = { mode = 1 }, after = { frozen = false, mode = 0 } }",
    );
    let message = bench.refusal(&["simulate", "scenario.toml"]);
    assert!(message.contains("mode"), "{message}");
    let output =
        bench.run(&["simulate", "scenario.toml", "--fmu", "alone=careless.fmu", "--out", "record.csv"]);
    let notes = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{notes}");
    assert!(notes.contains("note: the run_in of alone is left out: the FMU has no frozen, mode"), "{notes}");
    assert!(bench.read("record.csv").lines().count() > 4);
}

#[test]
fn records_are_compared_as_numbers_and_in_a_plot() {
    let bench = Bench::new();
    for (name, input) in [("one.csv", "input=1"), ("two.csv", "input=3")] {
        bench.succeeds(&["simulate", "scenario.toml", "--set", input, "--out", name]);
    }
    let output = bench.run(&["compare", "one.csv", "two.csv", "--plot", "both.html"]);
    let text = String::from_utf8(output.stdout).unwrap();
    // The greatest difference is at the end: 3 - 1 times one second; of 9 rows the root of the mean square of k/4.
    assert!(text.starts_with("two.csv minus one.csv:\n  input  "), "{text}");
    // With the unit of the row below the header.
    assert!(
        text.contains("  level            2\u{202f}Pa at 1\u{202f}s       1.19\u{202f}Pa RMS\n"),
        "{text}"
    );
    assert!(text.ends_with("\nboth.html\n"), "{text}");
    let page = bench.read("both.html");
    assert!(page.contains("two.csv minus one.csv") && page.contains("\"y\":[0.0,0.25,0.5"), "{text}");
    let cells = ["2\u{202f}Pa", "1\u{202f}s", "1.19\u{202f}Pa"];
    let cells = cells.map(|cell| format!("<td class=\"number\">{cell}</td>")).concat();
    assert!(page.contains(&format!("<td>level</td>{cells}")), "{page}");
    // Nothing is written unasked.
    let before = bench.names(".");
    bench.succeeds(&["compare", "one.csv", "two.csv"]);
    bench.succeeds(&["simulate", "scenario.toml"]);
    assert_eq!(bench.names("."), before);
    for (arguments, reason) in [
        (["one.csv", "none.csv"].as_slice(), "cannot read none.csv: "),
        (&["one.csv"], "2 values required"),
        (&["one.csv", "two.csv", "--variables", "levl"], "one.csv has no variable levl; did you mean level?"),
        (&["one.csv", "two.csv", "--plot", "one.csv"], "one.csv: a plot file must end with"),
        (&["one.csv", "scenario.toml"], "scenario.toml: a record is a file that ends with .csv or .parquet"),
        (&["one.csv", "later.csv"], "later.csv has none of the times of one.csv"),
        (&["empty.csv", "one.csv"], "cannot read empty.csv: it has no rows"),
        (&["one.csv", "volts.csv"], "cannot read volts.csv: its time is in V, which is no unit of time"),
        (&["one.csv", "vast.csv", "--plot", "x.svg"], "input, vast.csv: 1e308 is beyond 1e300"),
        (&["one.csv", "vast.csv", "--plot", "x.png"], "input, vast.csv: 1e308 is beyond 1e300"),
    ] {
        for (name, table) in [
            ("later.csv", "time,level\n2,1\n3,1\n"),
            ("empty.csv", "time,level\n"),
            ("volts.csv", "time (V),level\n0,1\n"),
            ("vast.csv", "time,input\n0,1\n1,1e308\n"),
        ] {
            bench.write(name, table);
        }
        let message = bench.refusal(&[&["compare"], arguments].concat());
        assert!(message.contains(reason), "{message}");
    }
}

#[test]
fn a_study_has_a_report() {
    let bench = Bench::new();
    let study = bench
        .read("study.toml")
        .replace("[1.0, 2.0]", "[1.0, 2.0, 4.0]\n\"alone:fail\" = [\"no\", \"error\"]");
    bench.write("study.toml", &format!("title = \"Some <inputs>\"\n{study}"));
    let output = bench.run(&["sweep", "study.toml", "--out", "out"]);
    // Runs have failed.
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8(output.stdout).unwrap().contains("out/report.html\n"));
    let page = bench.read("out/report.html");
    for part in [
        "<h1>Some &lt;inputs&gt;</h1>",
        "6 runs, of which 3 failed and 0 have warnings",
        "<td>last</td><td class=\"number\">1\u{202f}Pa (run 0)</td><td class=\"number\">2\u{202f}Pa (run 2)</td><td class=\"number\">4\u{202f}Pa (run 4)</td>",
        "<td>alone:input</td><td>3 values from 1 to 4</td>",
        "<td>alone:fail</td><td>error, no</td>",
        "<td>1</td><td>alone: fmi2DoStep returned fmi2Error at 0 s",
        // The runs that did not fail.
        "\"x\":[1.0,2.0,4.0],\"y\":[1.0,2.0,4.0]",
        // What the colours are, and no more what the axis has.
        "<p class=\"title\">colours: alone:fail</p>",
        "one dot per run; colours show the other parameter.",
    ] {
        assert!(page.contains(part), "{part}");
    }
    assert!(page.len() < 2_500_000);
    assert!(!page.contains("\"type\":\"log\""));
    let header = "run,alone:input,alone:fail,last,error,warnings\n#,,,Pa,,\n0,";
    assert!(bench.read("out/results.csv").starts_with(header));
    // A range that is spread by logarithms is drawn over them.
    let range = "{ from = 1.0, to = 4.0, points = 3, spacing = \"logarithmic\" }";
    bench.write("study.toml", &bench.read("study.toml").replace("[1.0, 2.0, 4.0]", range));
    bench.run(&["sweep", "study.toml", "--out", "spread"]);
    assert!(bench.read("spread/report.html").contains("\"type\":\"log\""));
}

/// The ball of `exchange.c` bounces between communication points: both commands record the rows at its events, or not.
/// Measures are of communication points.
#[test]
fn a_study_records_events_as_a_run_does() {
    let bench = Bench::new();
    let ball = include_str!("../../../fmu-master/tests/careless/exchange.xml");
    careless::write(&bench.path("careless.fmu"), ball, &careless::compiled("exchange.c"));
    let study = "scenario = \"scenario.toml\"\nrecords = true\n[grid]\n\"alone:e\" = [0.5]\n[measures]\n\
                 fastest = { minimum = \"v\" }\nmean = { mean = \"v\" }\n";
    bench.write("study.toml", study);
    let output = bench.run(&["simulate", "scenario.toml", "--out", "with.csv"]);
    // 9 at communication points. Events are at the impacts, at 0.447 and 0.894 s, each 0.25 s and after the third step of
    // the integrator; those each 0.25 s are at communication points, whose rows follow them.
    assert_eq!(String::from_utf8(output.stdout).unwrap(), "with.csv  19 rows\n");
    bench.succeeds(&["simulate", "scenario.toml", "--no-events", "--out", "without.csv"]);
    // Below names and units.
    assert_eq!(bench.read("without.csv").lines().count(), 2 + 9);
    for (out, run, options) in [("all", "with.csv", &[][..]), ("few", "without.csv", &["--no-events"])] {
        bench.succeeds(&[&["sweep", "study.toml", "--out", out], options].concat());
        assert_eq!(bench.read(&format!("{out}/records/0.csv")), bench.read(run));
    }
    assert_eq!(bench.read("few/results.csv"), bench.read("all/results.csv"));
    let message = bench.refusal(&["sweep", "study.toml", "--out", "all", "--no-events"]);
    assert!(message.contains("events in records"), "{message}");
}

/// As cells of CSV, in a record of numbers, too. What the FMU's library cannot tell is refused by name.
#[test]
fn texts_are_recorded() {
    let bench = Bench::new();
    let stage =
        "<ScalarVariable name=\"stage\" valueReference=\"6\" causality=\"output\"><String/></ScalarVariable>";
    let description = DESCRIPTION.replace("</ModelVariables>", &format!("{stage}</ModelVariables>"));
    careless::write(&bench.path("careless.fmu"), &description, library());
    let simulate =
        ["simulate", "careless.fmu", "--step", "0.5", "--stop-time", "1.5", "--record", "level,stag*"];
    bench.succeeds(&[&simulate[..], &["--out", "a.csv"]].concat());
    let rows =
        "time,level,stage\n# s,Pa,\n0.0,0.0,low\n0.5,0.5,low\n1.0,1.0,\"\"\"up\"\", nearly\"\n1.5,1.5,\n";
    assert_eq!(bench.read("a.csv"), rows);
    bench.write("b.csv", &rows.replace("0.5,low", "0.5,high"));
    let output = bench.run(&["compare", "a.csv", "b.csv"]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("  stage         unequal other texts in 1 rows, from 0.5\u{202f}s on\n"), "{text}");
    let output = bench.run(&simulate);
    let summary = String::from_utf8(output.stdout).unwrap();
    let last = summary.lines().last().unwrap().split_whitespace().collect::<Vec<_>>();
    assert_eq!(last, ["stage", "low"], "{summary}");
    bench.succeeds(&[&simulate[..], &["--plot", "a.html"]].concat());
    let page = bench.read("a.html");
    assert!(page.contains("\"text\":[\"low\",\"&quot;up&quot;, nearly\",\"\"]"));
    // By default there are numbers only.
    bench.succeeds(&["simulate", "careless.fmu", "--out", "b.csv"]);
    assert!(bench.read("b.csv").starts_with("time,level\n"));
    bench.scenario(1.0, "");
    let study = bench.read("study.toml").replace("final = \"level\"", "final = \"stage\"");
    bench.write("scenario.toml", &format!("record = [\"stage\"]\n{}", bench.read("scenario.toml")));
    bench.write("study.toml", &study);
    let message = bench.refusal(&["sweep", "study.toml"]);
    assert!(message.contains("stage is a String, which cannot be measured"), "{message}");
    careless::write(&bench.path("careless.fmu"), &description, careless::misbehaving_library());
    let message = bench.refusal(&["simulate", "careless.fmu", "--record", "stage"]);
    assert!(message.contains("stage cannot be read: its library has no fmi2GetString"), "{message}");
}

/// It records what is measured: neither what else is drawn nor what else has noise.
#[test]
fn a_study_takes_a_scenario_with_panels_and_noise() {
    let bench = Bench::new();
    let own = "panels = [[\"level\", \"input\"]]\nmeasurement_noise.input.standard_deviation = 1.0\n";
    let scenario = format!("record = [\"level\", \"input\"]\n{own}{}", bench.read("scenario.toml"));
    bench.write("scenario.toml", &scenario);
    bench.succeeds(&["simulate", "scenario.toml"]);
    let study = bench.read("study.toml");
    for (records, header) in [("true", "time,level,input\n# s,Pa,\n"), ("false", "")] {
        bench.write("study.toml", &study.replace("records = true", &format!("records = {records}")));
        bench.succeeds(&["sweep", "study.toml", "--out", records]);
        assert!(bench.read(&format!("{records}/results.csv")).contains("\n1,2.0,2.0,,\n"));
        assert!(header.is_empty() || bench.read("true/records/0.csv").starts_with(header));
    }
}

#[test]
fn a_stop_time_of_an_fmu_that_is_no_number_is_refused() {
    let bench = Bench::new();
    let description =
        DESCRIPTION.replace("<ModelVariables>", "<DefaultExperiment stopTime=\"NaN\"/><ModelVariables>");
    careless::write(&bench.path("careless.fmu"), &description, library());
    let message = bench.refusal(&["simulate", "careless.fmu", "--step", "0.1"]);
    assert!(message.contains("NaN communication steps of 0.1 s: expected at most 4294967295"), "{message}");
}

/// An FMU whose steps may differ makes a last, shorter one; for another the run ends before.
#[test]
fn a_run_need_not_be_a_multiple_of_the_step() {
    let bench = Bench::new();
    let run = ["simulate", "careless.fmu", "--stop-time", "0.7", "--step", "0.25", "--out", "record.csv"];
    let told = bench.succeeds(&run);
    let expected = "0.7 s after the start is not a multiple of the communication step, 0.25 s, and Careless makes only steps \
                    of one size (canHandleVariableCommunicationStepSize is false): the run ends at 0.5 s";
    assert!(told.contains(expected), "{told}");
    let times = |record: &str| -> Vec<_> {
        record.lines().skip(2).map(|row| row.split(',').next().unwrap().to_owned()).collect()
    };
    assert_eq!(times(&bench.read("record.csv")), ["0.0", "0.25", "0.5"]);
    let message = bench.refusal(&["simulate", "careless.fmu", "--stop-time", "0.2", "--step", "0.25"]);
    assert!(message.contains("0.2 s after the start is not a multiple"), "{message}");

    let description = DESCRIPTION.replace(
        "canGetAndSetFMUstate",
        "canHandleVariableCommunicationStepSize=\"true\" canGetAndSetFMUstate",
    );
    careless::write(&bench.path("careless.fmu"), &description, library());
    let told = bench.succeeds(&run);
    assert!(!told.contains("multiple"), "{told}");
    assert_eq!(times(&bench.read("record.csv")), ["0.0", "0.25", "0.5", "0.7"]);
    let message = bench.refusal(&["simulate", "careless.fmu", "--stop-time=-1", "--step", "0.25"]);
    assert!(message.contains("the stop time, -1 s, is not after the start time, 0 s"), "{message}");
}

#[test]
fn a_variable_is_recorded_once() {
    let bench = Bench::new();
    bench.write("twice.toml", &format!("record = [\"level\", \"level\"]\n{}", bench.read("scenario.toml")));
    let message = bench.refusal(&["simulate", "twice.toml"]);
    assert!(message.contains("twice.toml, line 1, record[2]: level is already recorded"), "{message}");
    let message = bench.refusal(&["simulate", "scenario.toml", "--record", "level,input,level"]);
    assert!(message.contains("--record: level is already recorded"), "{message}");
}

/// It is not replaced by a file.
#[cfg(unix)]
#[test]
fn a_pipe_is_written_to_directly() {
    let bench = Bench::new();
    let output = bench.run(&["simulate", "scenario.toml", "--out", "/dev/stdout"]);
    assert!(String::from_utf8(output.stdout).unwrap().starts_with("time,level\n# s,Pa\n0.0,0.0\n"));
    bench.succeeds(&["simulate", "scenario.toml", "--out", "/dev/null"]);
    assert!(!fs::metadata("/dev/null").unwrap().is_file());
}

#[cfg(unix)]
#[test]
fn a_journal_that_is_not_a_file_is_refused() {
    let bench = Bench::new();
    fs::create_dir(bench.path("out")).unwrap();
    std::os::unix::fs::symlink("/dev/zero", bench.path("out/journal.jsonl")).unwrap();
    let message = bench.refusal(&["sweep", "study.toml", "--out", "out"]);
    assert!(message.contains("journal.jsonl: it is not a file"), "{message}");
}

#[test]
fn a_measure_does_not_have_another_columns_name() {
    let bench = Bench::new();
    for name in ["run", "error", "warnings", "\"alone:input\""] {
        bench.write("study.toml", &format!("{GRID}[measures]\n{name} = {{ final = \"level\" }}\n"));
        let message = bench.refusal(&["sweep", "study.toml", "--out", "out"]);
        let reason = format!(
            "study.toml, line 6, measures.{name}: the results already have a column {}",
            name.trim_matches('"')
        );
        assert!(message.contains(&reason), "{message}");
        assert!(!bench.path("out").exists());
    }
    bench.write(
        "study.toml",
        &format!("{GRID}[measures]\na = {{ final = \"level\" }}\na = {{ mean = \"level\" }}\n"),
    );
    let message = bench.refusal(&["sweep", "study.toml", "--out", "out"]);
    assert!(message.contains("study.toml, line 7: duplicate key"), "{message}");
}

#[test]
fn leftovers_of_a_killed_study_are_removed() {
    let bench = Bench::new();
    fs::create_dir_all(bench.path("out/records")).unwrap();
    bench.write("out/records/.unfinished-Ab12Cd", "time,lev");
    bench.write("out/records/.mine", "");
    bench.succeeds(&["sweep", "study.toml", "--out", "out"]);
    assert_eq!(bench.names("out/records"), [".mine", "0.csv", "1.csv"]);
    assert_eq!(
        bench.names("out"),
        ["journal.jsonl", "records", "report.html", "results.csv", "results.parquet"]
    );
}

/// By Ctrl-C and SIGTERM; otherwise it would run for days.
#[cfg(target_os = "linux")]
#[test]
fn an_interruption_leaves_no_extracted_fmu() {
    let bench = Bench::new();
    bench.scenario(1e8, "");
    for signal in ["INT", "TERM"] {
        let folder = tempfile::tempdir().unwrap();
        let extracted = || fs::read_dir(folder.path()).unwrap().count();
        let command = bench.command(&["simulate", "scenario.toml"]);
        // The process that runs the tests may ignore the signals.
        let mut process = Command::new("env")
            .arg("--default-signal=INT,TERM,HUP")
            .arg(command.get_program())
            .args(command.get_args())
            .current_dir(bench.0.path())
            .env("TMPDIR", folder.path())
            .spawn()
            .unwrap();
        while extracted() == 0 {
            assert!(process.try_wait().unwrap().is_none(), "it ended before it could be interrupted");
            thread::sleep(Duration::from_millis(1));
        }
        let kill = ["-s", signal, &process.id().to_string()].map(str::to_owned);
        assert!(Command::new("kill").args(kill).status().unwrap().success());
        assert_eq!(process.wait().unwrap().code(), Some(130), "{signal}");
        assert_eq!(extracted(), 0, "{signal}");
    }
    assert!(!bench.path("scenario.csv").exists());
}

/// The rows of a record without names and units.
fn rows(record: &str) -> Vec<&str> {
    record
        .lines()
        .filter(|line| line.starts_with(|first: char| first.is_ascii_digit() || first == '-'))
        .collect()
}

#[test]
fn a_run_starts_when_the_command_line_says() {
    let bench = Bench::new();
    for subject in [&["careless.fmu", "--step", "0.125"][..], &["scenario.toml"]] {
        let simulate = [&["simulate"], subject, &["--stop-time", "1", "--out", "record.csv"]].concat();
        for (start, first, last) in [("0.5", "0.5,0.0", "1.0,0.5"), ("-1", "-1.0,0.0", "1.0,2.0")] {
            bench.succeeds(&[&simulate[..], &["--start-time", start]].concat());
            let record = bench.read("record.csv");
            let rows = rows(&record);
            assert_eq!((rows[0], rows[rows.len() - 1]), (first, last), "{subject:?}");
        }
    }
    for (options, reason) in [
        (
            &["scenario.toml", "--start-time", "2"][..],
            "--start-time 2: expected a time after start_time, 2 s",
        ),
        (
            &["scenario.toml", "--start-time", "2", "--stop-time", "1.5"],
            "--start-time 2 --stop-time 1.5: expected a time after start_time, 2 s",
        ),
        (
            &["careless.fmu", "--start-time", "2", "--stop-time", "1"],
            "the stop time, 1 s, is not after the start time, 2 s",
        ),
        (&["careless.fmu", "--start-time", "inf"], "expected a finite number"),
    ] {
        let message = bench.refusal(&[&["simulate"], options].concat());
        assert!(message.contains(reason), "{message}");
    }
}

/// With what to do about it.
#[test]
fn what_an_fmu_does_wrong_is_named_once() {
    let bench = Bench::new();
    let description =
        DESCRIPTION.replace("<ModelVariables>", "<DefaultExperiment stopTime=\"0\"/><ModelVariables>");
    careless::write(&bench.path("careless.fmu"), &description, library());
    let message = bench.refusal(&["simulate", "careless.fmu"]);
    let reason =
        "the stop time, 0 s, is not after the start time, 0 s; --stop-time and --start-time give others\n";
    assert!(message.ends_with(reason), "{message}");
    bench.succeeds(&["simulate", "careless.fmu", "--stop-time", "1"]);

    write_archive(&bench.path("case.fmu"), &[("ModelDescription.xml", DESCRIPTION.as_bytes())]);
    let message = bench.refusal(&["simulate", "case.fmu"]);
    let reason = "it contains no modelDescription.xml, but ModelDescription.xml: case matters\n";
    assert!(message.ends_with(reason), "{message}");

    write_archive(&bench.path("empty.fmu"), &[("modelDescription.xml", DESCRIPTION.as_bytes())]);
    let message = bench.refusal(&["simulate", "empty.fmu"]);
    assert!(message.contains("\nerror: cannot import empty.fmu: it has no binaries/"), "{message}");
}

/// Its elements are told by their names, in the order of their indices.
#[test]
fn an_array_of_fmi_2_is_recorded_and_set_as_a_whole() {
    let bench = Bench::new();
    let output = |name: &str| {
        format!(
            "<ScalarVariable name=\"{name}\" valueReference=\"0\" causality=\"output\"><Real unit=\"Pa\"/></ScalarVariable>"
        )
    };
    let description = DESCRIPTION
        .replace(&output("level"), &["Body.r_0[1]", "Body.r_0[2]", "Body.v"].map(output).concat())
        .replace("name=\"input\"", "name=\"u[1]\"");
    careless::write(&bench.path("careless.fmu"), &description, library());
    let simulate =
        ["simulate", "careless.fmu", "--step", "0.5", "--record", "Body.r_0", "--out", "record.csv"];
    bench.succeeds(&[&simulate[..], &["--set", "u=3"]].concat());
    let record = bench.read("record.csv");
    assert!(record.starts_with("time,Body.r_0[1],Body.r_0[2]\n"), "{record}");
    assert!(record.ends_with("\n1.0,3.0,3.0\n"), "{record}");
}

/// Those of a range, which are numbers.
#[test]
fn a_grid_has_values_for_an_integer() {
    let bench = Bench::new();
    let count = "<ScalarVariable name=\"count\" valueReference=\"2\" causality=\"parameter\" variability=\"tunable\"><Integer start=\"0\"/></ScalarVariable>";
    let description = DESCRIPTION.replace("</ModelVariables>", &format!("{count}</ModelVariables>"));
    careless::write(&bench.path("careless.fmu"), &description, library());
    let study = |points: u32| {
        format!(
            "scenario = \"scenario.toml\"\n[grid]\n\"alone:count\" = {{ from = -2, to = 0, points = {points} }}\n\
             [measures]\nlast = {{ final = \"level\" }}\n"
        )
    };
    bench.write("study.toml", &study(3));
    bench.run(&["sweep", "study.toml", "--out", "out"]);
    let results = bench.read("out/results.csv");
    let counts: Vec<_> = rows(&results).iter().map(|row| row.split(',').nth(1).unwrap().to_owned()).collect();
    assert_eq!(counts, ["-2", "-1", "0"]);
    bench.write("study.toml", &study(4));
    let message = bench.refusal(&["sweep", "study.toml"]);
    assert!(message.contains("alone:count"), "{message}");
}

#[test]
fn a_long_list_of_fmus_is_cut() {
    let bench = Bench::new();
    let others = |last: u32| {
        let others =
            (2..=last).map(|index| format!("[[fmu]]\nname = \"f{index}\"\nfile = \"careless.fmu\"\n"));
        format!(
            "inputs.input = 1\n{}",
            others.collect::<String>().replace(".fmu\"\n", ".fmu\"\ninputs.input = 1\n")
        )
    };
    for (last, named) in [(5, "alone, f2, f3, f4, f5\n"), (9, "alone, f2, f3, f4, f5 and 4 others\n")] {
        bench.scenario(0.25, &others(last));
        let output = bench.run(&["simulate", "scenario.toml", "--record", "alone:level", "--out", "out.csv"]);
        let printed = String::from_utf8(output.stdout).unwrap();
        assert_eq!(printed, format!("out.csv  3 rows; sampled: no events from {named}"));
    }
}
