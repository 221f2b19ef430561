//! The command, run as a user would, with the FMU of `careless/`: its errors, and the files that it leaves.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use tempfile::TempDir;

use self::careless::{DESCRIPTION, library};

mod careless;

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
        let mut command = Command::new(env!("CARGO_BIN_EXE_boost-lab"));
        command.args(arguments).current_dir(self.0.path());
        command
    }

    fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    fn succeeds(&self, arguments: &[&str]) {
        let output = self.run(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
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
fn exit_statuses_are_in_the_help() {
    let help = String::from_utf8(Bench::new().run(&["--help"]).stdout).unwrap();
    for status in ["  0    ", "  1    ", "  2    ", "  130  "] {
        assert!(help.contains(status), "{help}");
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
    assert!(message.contains("is not an identifier of C"), "{message}");
}

/// In what the FMU logs, and in names.
#[test]
fn messages_of_an_fmu_do_not_control_the_terminal() {
    let bench = Bench::new();
    let printed = "\u{9b}31m\u{202e}\u{7f}";
    let description =
        DESCRIPTION.replace("guid=\"careless\"", &format!("guid=\"{printed}&#27;]0;title&#7;\""));
    careless::write(&bench.path("careless.fmu"), &description, library());
    let message = bench.refusal(&["simulate", "scenario.toml"]);
    assert!(message.contains(r"\u{9b}31m\u{202e}\u{7f}\u{1b}]0;title\u{7} is not 100% mine"), "{message}");
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
        (["--out", "scenario.toml"].as_slice(), "the input scenario.toml would be lost"),
        (&["--out", "careless.fmu"], "the input careless.fmu would be lost"),
        (&["--out", "./signal.csv"], "the input signal.csv would be lost"),
        (&["--out", "x.csv", "--plot", "signal.csv"], "the input signal.csv would be lost"),
        (&["--out", "x", "--plot", "./x"], "x is written to the same place"),
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
    let tune = ["tune", "--plant", "careless.fmu", "--parameters", "schedule.ssv", "--out", "."];
    bench.write("schedule.ssv", "");
    assert!(bench.refusal(&tune).contains("the input schedule.ssv would be lost"));
    bench.write("identified.ssv", "");
    let identify = ["identify", "actuator", "signal.csv", "--plant", "careless.fmu", "--out", "."];
    let message = bench.refusal(&[&identify[..], &["--parameters", "identified.ssv"]].concat());
    assert!(message.contains("the input identified.ssv would be lost"), "{message}");
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
    // Other files beside it are kept.
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

/// A command that may write so many blocks of 512 bytes to a file, and ignores the signal at the limit.
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
    assert_eq!(bench.read("out/results.csv").lines().count(), 3001);
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
    // 6 MB at most, nearly all of which is the library.
    assert!(html.len() < 6_000_000, "{}", html.len());

    for (panels, reason) in [
        ("[[\"level\"], [\"levle\"]]", "line 1, panels[2][1]: levle is not recorded; the nearest is level"),
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
        let reason = format!("{name}: a plot is written to a file that ends with .svg, .png or .html");
        assert!(message.contains(&reason) && !bench.path("none.csv").exists(), "{message}");
    }
}

/// It is not replaced by a file.
#[cfg(unix)]
#[test]
fn a_pipe_is_written_to_directly() {
    let bench = Bench::new();
    let output = bench.run(&["simulate", "scenario.toml", "--out", "/dev/stdout"]);
    assert!(String::from_utf8(output.stdout).unwrap().starts_with("time,level\n0.0,0.0\n"));
    bench.succeeds(&["simulate", "scenario.toml", "--out", "/dev/null"]);
    assert!(!fs::metadata("/dev/null").unwrap().is_file());
}

#[cfg(unix)]
#[test]
fn an_endless_file_is_refused() {
    let bench = Bench::new();
    bench.scenario(1.0, "inputs.input = { csv = \"/dev/zero\", column = \"a\" }");
    fs::rename(bench.path("scenario.toml"), bench.path("csv.toml")).unwrap();
    bench.scenario(1.0, "parameters = [\"/dev/zero\"]");
    fs::rename(bench.path("scenario.toml"), bench.path("set.toml")).unwrap();
    bench.scenario(1.0, "map = \"/dev/zero\"");
    fs::rename(bench.path("scenario.toml"), bench.path("map.toml")).unwrap();
    bench.scenario(1.0, "");
    bench.write("endless.toml", &bench.read("study.toml").replace("scenario.toml", "/dev/zero"));
    for arguments in [
        ["simulate", "/dev/zero"].as_slice(),
        &["simulate", "csv.toml"],
        &["simulate", "set.toml"],
        &["simulate", "map.toml"],
        &["simulate", "scenario.toml", "--map", "/dev/zero"],
        &["sweep", "/dev/zero"],
        &["sweep", "endless.toml"],
        &["identify", "actuator", "/dev/zero", "--plant", "careless.fmu"],
        &["tune", "--plant", "careless.fmu", "--parameters", "/dev/zero"],
    ] {
        let message = bench.refusal(arguments);
        assert!(message.contains("/dev/zero: it is larger than 67108864 bytes"), "{arguments:?}: {message}");
    }
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
            "study.toml, line 6, measures.{name}: the results have a column {} already",
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
    assert_eq!(bench.names("out"), ["journal.jsonl", "records", "results.csv", "results.parquet"]);
}

/// By the controller's range.
#[test]
fn a_time_constant_that_the_controller_does_not_take_is_refused_before_anything_runs() {
    let bench = Bench::new();
    let message = bench.refusal(&["tune", "--plant", "careless.fmu", "--lambda", "1e308", "--out", "out"]);
    let reason = "the value 1e308 of lambda cannot be taken: 1e308 is not within 0.001..100";
    assert!(message.contains(reason), "{message}");
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
