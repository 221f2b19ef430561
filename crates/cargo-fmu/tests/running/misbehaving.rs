//! FMUs that end the process, and the messages of any.

use std::fs;
#[cfg(target_os = "linux")]
use std::{
    io::{BufRead, BufReader, Read},
    path::Path,
    process::{Child, ChildStderr, Command, ExitStatus, Stdio},
};

use crate::{Bench, careless};

/// A folder with the FMU of `misbehaving.c`, whose misdeed from the start is the given one, and a study of two runs.
fn misbehaving(version: u8, misdeed: &str) -> Bench {
    let bench = Bench(tempfile::tempdir().unwrap());
    let description = careless::misbehaving(version, 1, misdeed);
    careless::write(&bench.path("careless.fmu"), &description, careless::misbehaving_library());
    bench.scenario(0.25, "");
    let study = "scenario = \"scenario.toml\"\n[grid]\n\"alone:from\" = [1.0, 0.0]\n[measures]\nlast = { final = \"y\" }\n";
    bench.write("study.toml", study);
    bench
}

/// The bench's FMU is in a folder for temporary files, which is empty in the end.
fn refused_with_temporary_folder(bench: &Bench, arguments: &[&str], misdeed: &str) -> String {
    let temporary = tempfile::tempdir().unwrap();
    let mut command = bench.command(arguments);
    let output = command
        .env("TMPDIR", temporary.path())
        .env("MISDEED", careless::number_of(misdeed).to_string())
        .output()
        .unwrap();
    let printed = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{misdeed}: {printed}");
    assert_eq!(fs::read_dir(temporary.path()).unwrap().count(), 0, "{misdeed}");
    printed
}

/// Without a word it would seem to have succeeded.
#[cfg(target_os = "linux")]
#[test]
fn an_fmu_that_ends_the_process_is_an_error() {
    let library = format!("careless{}", std::env::consts::DLL_SUFFIX);
    for (version, misdeed, of, function) in [
        (2, "exit_in_load", library.as_str(), "the loading of its library"),
        (2, "exit_in_instantiate", "alone", "fmi2Instantiate"),
        (3, "exit_in_instantiate", "alone", "fmi3InstantiateCoSimulation"),
        (2, "exit_in_step", "alone", "fmi2DoStep at 0 s"),
        (3, "exit_in_step", "alone", "fmi3DoStep at 0 s"),
        (2, "quick_exit_in_step", "alone", "fmi2DoStep at 0 s"),
        (2, "exit_in_terminate", "alone", "fmi2Terminate at 0.25 s"),
        // The sweep frees one that it has not initialized.
        (3, "exit_in_free", "alone", "fmi3FreeInstance"),
    ] {
        let bench = misbehaving(version, misdeed);
        let commands =
            [["simulate", "scenario.toml", "--out", "out.csv"], ["sweep", "study.toml", "--out", "out"]];
        // A sweep that can load its FMUs goes on.
        let is_run = !["exit_in_load", "exit_in_instantiate", "exit_in_free"].contains(&misdeed);
        for command in &commands[..if is_run { 1 } else { 2 }] {
            let message = refused_with_temporary_folder(&bench, command, misdeed);
            let expected = format!("error: {of}: the FMU ended the process by `exit` in {function}");
            assert!(message.starts_with(&expected) && message.lines().count() == 1, "{misdeed}: {message}");
            assert!(!bench.path("out.csv").exists() && !bench.path("out/results.csv").exists(), "{misdeed}");
        }
    }
    let bench = misbehaving(2, "exit_in_thread");
    let message = refused_with_temporary_folder(&bench, &["simulate", "scenario.toml"], "none");
    let expected =
        "error: an FMU ended the process by `exit` outside of a call: alone after fmi2DoStep at 0 s\n";
    assert_eq!(message, expected);
}

/// A folder with the FMU, and a study that keeps records of a run for each misdeed.
fn study_of(misdeeds: &[&str]) -> Bench {
    const MEASURES: &str = "third = { final = \"third\" }\ninstances = { final = \"instances\" }\n";
    let bench = misbehaving(2, "none");
    bench.write("scenario.toml", &format!("record = [\"y\"]\n{}", bench.read("scenario.toml")));
    let rows = misdeeds.iter().map(|misdeed| format!("[[list]]\n\"alone:misdeed\" = \"{misdeed}\"\n"));
    let rows: String = rows.collect();
    bench.write(
        "study.toml",
        &format!("scenario = \"scenario.toml\"\nrecords = true\n[measures]\n{MEASURES}{rows}"),
    );
    bench
}

/// A column of the results, as it is written.
fn column(bench: &Bench, name: &str) -> Vec<String> {
    let text = bench.read("out/results.csv");
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let index = lines.next().unwrap().split(',').position(|column| column == name).unwrap();
    // No error here has a comma or a line break.
    lines.map(|line| line.split(',').nth(index).unwrap().to_owned()).collect()
}

#[cfg(target_os = "linux")]
#[test]
fn a_run_that_ends_its_process_is_a_row_and_the_others_are_kept() {
    let misdeeds =
        ["none", "dereference_null", "abort", "none", "end", "exit_in_step", "quick_exit_in_step", "none"];
    let reasons = [
        "",
        "alone: the FMU ended the process in fmi2DoStep at 0 s: signal: 11 (SIGSEGV)",
        "alone: the FMU ended the process in fmi2DoStep at 0 s: signal: 6 (SIGABRT)",
        "",
        "alone: the FMU ended the process in fmi2DoStep at 0 s: exit status: 0",
        "alone: the FMU ended the process by `exit` in fmi2DoStep at 0 s",
        "alone: the FMU ended the process by `exit` in fmi2DoStep at 0 s",
        "",
    ];
    let bench = study_of(&misdeeds);
    for workers in ["1", "3"] {
        let temporary = tempfile::tempdir().unwrap();
        let mut command = bench.command(&["sweep", "study.toml", "--out", "out", "--workers", workers]);
        let output = command.env("TMPDIR", temporary.path()).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(fs::read_dir(temporary.path()).unwrap().count(), 0);
        assert_eq!(column(&bench, "error"), reasons);
        assert_eq!(bench.names("out/records"), ["0.csv", "3.csv", "7.csv"]);
        // They are finished, and not run again.
        let again = bench.run(&["sweep", "study.toml", "--out", "out"]);
        assert!(String::from_utf8(again.stdout).unwrap().starts_with("8 of 8 runs are in the journal\n"));
        fs::remove_dir_all(bench.path("out")).unwrap();
    }
}

#[cfg(unix)]
#[test]
fn a_run_that_hangs_is_a_row() {
    let bench = study_of(&["none", "hang", "none"]);
    let output = bench.run(&["sweep", "study.toml", "--out", "out", "--time-limit", "5"]);
    assert_eq!(output.status.code(), Some(1));
    let reason = "\"it took longer than the time limit, 5 s; alone was in fmi2DoStep at 0 s\"";
    let text = bench.read("out/results.csv");
    assert!(text.contains(reason), "{text}");
    assert_eq!(bench.names("out/records"), ["0.csv", "2.csv"]);
    let message = bench.refusal(&["sweep", "study.toml", "--time-limit", "0"]);
    assert!(message.contains("expected a time from 0.001 to 1e9 s"), "{message}");
}

/// Each run counts the instances that its process has made, beginning with that of the first look at the FMUs. A process in
/// which an FMU has changed anything does no second run.
#[cfg(target_os = "linux")]
#[test]
fn what_an_fmu_changes_ends_with_its_run() {
    use std::os::unix::fs::PermissionsExt as _;

    let changes = [
        "round_up",
        "trap",
        "handle",
        "leave_folder",
        "close_output",
        "mask_modes",
        "set_locale",
        "set_environment",
        "limit",
        "block_signals",
        "leak",
        "alarm",
        "leave_child",
        "leave_session",
    ];
    // In the first process, then in one after each change.
    let mut misdeeds = vec!["none", "none", "print"];
    let mut instances = vec![2, 3, 4];
    let mut next = 5;
    for change in changes {
        misdeeds.extend([change, "none"]);
        instances.extend([next, 2]);
        next = 3;
    }
    let bench = study_of(&misdeeds);
    let mut command = bench.command(&["sweep", "study.toml", "--out", "out", "--workers", "1"]);
    let output = command.env("CHILD", bench.path("children")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    refuse_living(&bench.read("children"), 2);
    assert_eq!(
        column(&bench, "instances"),
        instances.iter().map(|count| format!("{count}.0")).collect::<Vec<_>>()
    );
    assert_eq!(column(&bench, "third"), vec![(1.0 / 3.0_f64).to_string(); misdeeds.len()]);
    // But for the number of instances, the records are the same.
    let record = |run: usize| {
        let name = format!("out/records/{run}.csv");
        let mode = fs::metadata(bench.path(&name)).unwrap().permissions().mode();
        let text = bench.read(&name);
        (mode, text.lines().map(|line| line.rsplit_once(',').unwrap().0.to_owned()).collect::<Vec<_>>())
    };
    assert!((1..misdeeds.len()).all(|run| record(run) == record(0)));
}

/// The processes of these numbers, a line each, have ended and are reaped.
#[cfg(target_os = "linux")]
fn refuse_living(numbers: &str, count: usize) {
    assert_eq!(numbers.lines().count(), count);
    for number in numbers.lines() {
        assert!(!Path::new("/proc").join(number).exists(), "{number}");
    }
}

/// What an FMU does to the channel to its worker is the failure of its own run, and the others are kept.
#[cfg(target_os = "linux")]
#[test]
fn an_fmu_disturbs_only_its_own_run() {
    let bench = study_of(&["none", "fork", "write_anywhere", "none", "close_any", "fork", "none"]);
    for workers in ["1", "2"] {
        let output = bench.run(&["sweep", "study.toml", "--out", "out", "--workers", workers]);
        let printed = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{printed}");
        let written = "run 2: alone: the FMU wrote to a descriptor that is not its own: \"xx{";
        assert!(printed.contains(written), "{printed}");
        assert_eq!(bench.names("out/records"), ["0.csv", "1.csv", "3.csv", "5.csv", "6.csv"]);
        assert!(bench.read("out/report.html").contains("7 runs, of which 2 failed"));
        fs::remove_dir_all(bench.path("out")).unwrap();
    }
}

/// Neither does it overwrite what FMUs of others print, nor lose its own file.
#[cfg(target_os = "linux")]
#[test]
fn a_simulation_has_its_file_or_an_error() {
    let bench = misbehaving(2, "none");
    let simulate = ["simulate", "scenario.toml", "--record", "y,third", "--out", "out.csv"];
    bench.succeeds(&simulate);
    let record = bench.read("out.csv");
    for misdeed in ["round_up", "trap", "handle", "leave_folder", "print"] {
        fs::remove_file(bench.path("out.csv")).unwrap();
        bench.scenario(0.25, &format!("values = {{ misdeed = \"{misdeed}\" }}"));
        bench.succeeds(&simulate);
        assert_eq!(bench.read("out.csv"), record, "{misdeed}");
    }
    fs::remove_file(bench.path("out.csv")).unwrap();
    for (misdeed, end) in [
        ("end", "exit status: 0"),
        ("abort", "signal: 6 (SIGABRT)"),
        ("dereference_null", "signal: 11 (SIGSEGV)"),
    ] {
        bench.scenario(0.25, &format!("values = {{ misdeed = \"{misdeed}\" }}"));
        let message = refused_with_temporary_folder(&bench, &simulate, "none");
        let expected = format!("error: alone: the FMU ended the process in fmi2DoStep at 0 s: {end}\n");
        assert_eq!(message, expected);
        assert!(!bench.path("out.csv").exists());
        let linearize = ["linearize", "scenario.toml", "--fmus", ".", "--interface", "cs", "--at", "0.5"];
        assert_eq!(refused_with_temporary_folder(&bench, &linearize, "none"), message);
    }
}

/// Nor its children.
#[cfg(target_os = "linux")]
#[test]
fn a_simulation_leaves_no_process_behind() {
    let bench = misbehaving(2, "none");
    let simulate = ["simulate", "scenario.toml", "--record", "y", "--out", "out.csv"];
    bench.succeeds(&simulate);
    let record = bench.read("out.csv");
    for (misdeed, children) in [("leave_child", 1), ("leave_session", 1), ("fork", 0)] {
        bench.write("children", "");
        bench.scenario(0.25, &format!("values = {{ misdeed = \"{misdeed}\" }}"));
        let output = bench.command(&simulate).env("CHILD", bench.path("children")).output().unwrap();
        assert!(output.status.success(), "{misdeed}: {}", String::from_utf8_lossy(&output.stderr));
        let printed = String::from_utf8(output.stdout).unwrap();
        assert_eq!(printed, "out.csv  3 rows; sampled: no events from alone\n", "{misdeed}");
        assert_eq!(bench.read("out.csv"), record, "{misdeed}");
        refuse_living(&bench.read("children"), children);
    }
}

/// FMUs are unloaded before a file is written, and no handler of theirs runs after.
#[cfg(target_os = "linux")]
#[test]
fn an_fmu_fails_before_a_file_is_written_or_not_at_all() {
    let bench = misbehaving(2, "none");
    let simulate = ["simulate", "scenario.toml", "--out", "out.csv", "--plot", "out.svg"];
    bench.scenario(0.25, "values = { misdeed = \"abort_in_unload\" }");
    let message = bench.refusal(&simulate);
    assert!(message.starts_with("error: the process ended after fmi2FreeInstance"), "{message}");
    assert!(!bench.path("out.csv").exists() && !bench.path("out.svg").exists());
    bench.scenario(0.25, "values = { misdeed = \"abort_at_exit\" }");
    assert_eq!(bench.succeeds(&simulate), "");
    assert!(bench.path("out.csv").exists() && bench.path("out.svg").exists());
}

/// The results are there.
#[test]
fn a_failing_end_of_a_run_is_a_warning() {
    for (version, function) in [(2, "fmi2Terminate"), (3, "fmi3Terminate")] {
        let bench = misbehaving(version, "fail_in_terminate");
        let status = &function[..4];
        let warning = format!("alone at 0.25 s: {function} returned {status}Error");
        let printed = bench.succeeds(&["simulate", "scenario.toml", "--out", "out.csv"]);
        assert_eq!(printed, format!("warning: {warning}\n"));
        assert!(bench.path("out.csv").exists());
        let study = "scenario = \"scenario.toml\"\n[grid]\n\"alone:from\" = [0.0]\n[measures]\nlast = { final = \"y\" }\n";
        bench.write("study.toml", study);
        bench.succeeds(&["sweep", "study.toml", "--out", "out"]);
        assert!(bench.read("out/results.csv").ends_with(&format!(",,{warning}\n")));
    }
}

/// The second of two FMUs does, from the initialization to the unloading of its library.
#[cfg(target_os = "linux")]
#[test]
fn the_fmu_that_ends_the_process_is_named() {
    let bench = misbehaving(2, "none");
    let system = |misdeed: &str| {
        let values = format!("values = {{ misdeed = \"{misdeed}\" }}");
        bench.scenario(0.25, &format!("[[fmu]]\nname = \"second\"\nfile = \"careless.fmu\"\n{values}\n"));
    };
    let ends = [
        (
            "abort_in_initialization",
            "second: the FMU ended the process in fmi2EnterInitializationMode at 0 s",
        ),
        ("abort", "second: the FMU ended the process in fmi2DoStep at 0 s"),
        ("abort_in_unload", "the process ended after fmi2FreeInstance at 0.25 s of second"),
    ];
    for (misdeed, reason) in ends {
        system(misdeed);
        let message = refused_with_temporary_folder(&bench, &["simulate", "scenario.toml"], "none");
        assert_eq!(message, format!("error: {reason}: signal: 6 (SIGABRT)\n"));
    }
    // A sweep unloads no library before it has the answer.
    system("none");
    let runs = ends[..2].iter().map(|(misdeed, _)| format!("[[list]]\n\"second:misdeed\" = \"{misdeed}\"\n"));
    let study = "scenario = \"scenario.toml\"\n[measures]\nlast = { final = \"second:y\" }\n";
    bench.write("study.toml", &(study.to_owned() + &runs.collect::<String>()));
    assert_eq!(bench.run(&["sweep", "study.toml", "--out", "out"]).status.code(), Some(1));
    let reasons = ends[..2].iter().map(|(_, reason)| format!("{reason}: signal: 6 (SIGABRT)"));
    assert_eq!(column(&bench, "error"), reasons.collect::<Vec<_>>());
}

/// A sweep whose second run hangs, seen to do so.
#[cfg(target_os = "linux")]
struct Hanging {
    process: Child,
    printed: BufReader<ChildStderr>,
}

#[cfg(target_os = "linux")]
impl Hanging {
    fn new(bench: &Bench, workers: &str, temporary: &Path) -> Self {
        let command = bench.command(&["sweep", "study.toml", "--out", "out", "--workers", workers]);
        // The process that runs the tests may ignore the signals.
        let mut process = Command::new("env")
            .arg("--default-signal=INT,TERM,HUP")
            .arg(command.get_program())
            .args(command.get_args())
            .current_dir(command.get_current_dir().unwrap())
            .env("IN_STEP", careless::number_of("hang").to_string())
            .env("TMPDIR", temporary)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut printed = BufReader::new(process.stderr.take().unwrap());
        let mut line = String::new();
        printed.read_line(&mut line).unwrap();
        assert_eq!(line, "it hangs\n");
        Self { process, printed }
    }

    /// Sends a signal to the command alone, and waits for the end of all that print to its standard error.
    fn end(mut self, signal: &str) -> ExitStatus {
        let kill = ["-s", signal, &self.process.id().to_string()].map(str::to_owned);
        assert!(Command::new("kill").args(kill).status().unwrap().success());
        let mut rest = String::new();
        self.printed.read_to_string(&mut rest).unwrap();
        assert_eq!(rest, "");
        self.process.wait().unwrap()
    }
}

/// What the journal says after its settings.
fn journal(bench: &Bench) -> Vec<String> {
    bench.read("out/journal.jsonl").lines().skip(1).map(str::to_owned).collect()
}

/// Resumes a study whose second run does what is told, and returns the exit status and the errors of its runs.
fn resumed(bench: &Bench) -> (Option<i32>, Vec<String>) {
    let mut command = bench.command(&["sweep", "study.toml", "--out", "out", "--workers", "2"]);
    let status = command.env("IN_STEP", "0").output().unwrap().status;
    (status.code(), column(bench, "error"))
}

#[cfg(target_os = "linux")]
#[test]
fn a_run_that_was_cut_short_is_tried_once_more_alone() {
    let bench = study_of(&["none", "told", "none"]);
    let temporary = tempfile::tempdir().unwrap();
    let killed = || Hanging::new(&bench, "1", temporary.path()).end("KILL");
    assert_eq!(killed().code(), None);
    let [begun_0, _, begun_1] = &journal(&bench)[..] else { panic!("{:?}", journal(&bench)) };
    assert_eq!([begun_0.as_str(), begun_1], ["{\"begun\":0}", "{\"begun\":1}"]);
    // With more workers than runs.
    let once = bench.read("out/journal.jsonl");
    Hanging::new(&bench, "3", temporary.path()).end("KILL");
    assert_eq!(journal(&bench)[3..], ["{\"begun\":1}"]);
    let errors = ["", "it began twice, and both times the command ended before it did", ""];
    let quoted =
        errors.map(|error| if error.is_empty() { String::new() } else { "\"it began twice".to_owned() });
    assert_eq!(resumed(&bench), (Some(1), quoted.to_vec()));
    assert!(bench.read("out/results.csv").contains(errors[1]));
    // It has done so once.
    bench.write("out/journal.jsonl", &once);
    assert_eq!(resumed(&bench), (Some(0), vec![String::new(); 3]));
}

#[cfg(target_os = "linux")]
#[test]
fn an_interruption_fails_no_run() {
    let bench = study_of(&["none", "told", "none"]);
    for signal in ["INT", "TERM"] {
        let temporary = tempfile::tempdir().unwrap();
        let status = Hanging::new(&bench, "1", temporary.path()).end(signal);
        assert_eq!(status.code(), Some(130));
        assert_eq!(fs::read_dir(temporary.path()).unwrap().count(), 0);
        assert_eq!(journal(&bench).last().unwrap(), "{\"interrupted\":[1]}");
    }
    assert_eq!(resumed(&bench), (Some(0), vec![String::new(); 3]));
}

/// Each waits for the other.
#[cfg(unix)]
#[test]
fn fmus_that_are_allowed_once_per_process_run_in_parallel() {
    let bench = study_of(&["meet", "meet"]);
    let description = careless::misbehaving(2, 1, "none")
        .replace("<CoSimulation ", "<CoSimulation canBeInstantiatedOnlyOncePerProcess=\"true\" ");
    careless::write(&bench.path("careless.fmu"), &description, careless::misbehaving_library());
    fs::create_dir(bench.path("meeting")).unwrap();
    let mut command =
        bench.command(&["sweep", "study.toml", "--out", "out", "--workers", "2", "--time-limit", "60"]);
    let output = command.env("MEETING", bench.path("meeting")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// Under the name of the instance that it is from, if that is known.
#[test]
fn every_message_is_printed() {
    // Of both steps at their begin, at the end, or without a time.
    let steps = [" at 0 s", " at 0.125 s"].as_slice();
    let (end, none) = ([" at 0.25 s"].as_slice(), [""].as_slice());
    for (version, misdeed, name, text, times) in [
        (2, "log_one", "alone", "said with 1", steps),
        (3, "log_one", "alone", "said with 1", steps),
        (2, "log_null", "alone", "said with null", steps),
        (3, "log_null", "alone", "said with null", steps),
        (2, "log_own", "alone", "said with its own", steps),
        (2, "log_in_instantiate", "alone", "said at the start", none),
        (3, "log_in_instantiate", "alone", "said at the start", none),
        (2, "log_in_thread", "misbehaving", "said in a thread", none),
        (3, "log_in_thread", "an FMU", "said in a thread", none),
        (2, "log_in_free", "alone", "said at the end", end),
        (2, "log_after_free", "misbehaving", "said after the end", none),
        (3, "log_after_free", "an FMU", "said after the end", none),
        (2, "log_nothing", "alone", "a message without a text", steps),
        (3, "log_nothing", "alone", "a message without a text", steps),
        (2, "log_latin", "alone", "d\u{fffd}j\u{fffd} vu", steps),
    ] {
        let bench = misbehaving(version, misdeed);
        let output = bench.run(&["simulate", "scenario.toml"]);
        let printed = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{misdeed}: {printed}");
        let mut lines: Vec<_> = printed.lines().collect();
        lines.dedup();
        let expected: Vec<_> = times.iter().map(|time| format!("warning: {name}{time}: {text}")).collect();
        assert_eq!(lines, expected, "{misdeed}");
    }
    for (misdeed, message) in [
        ("fail_in_step", "returned fmi2Error at 0 s\n  it cannot go on\n"),
        ("log_unknown_status", "returned fmi2Error at 0 s\n  said with 17\n"),
    ] {
        let message_of = misbehaving(2, misdeed).refusal(&["simulate", "scenario.toml"]);
        assert_eq!(message_of, format!("error: alone: fmi2DoStep {message}"));
    }
}

/// It would run on by itself, and nobody would stop it.
#[cfg(target_os = "linux")]
#[test]
fn a_simulation_ends_with_its_command() {
    let bench = misbehaving(2, "none");
    bench.scenario(0.25, "values = { misdeed = \"hang\" }");
    let mut command = bench.command(&["simulate", "scenario.toml"]);
    let temporary = tempfile::tempdir().unwrap();
    command.stdout(Stdio::piped()).env("TMPDIR", temporary.path());
    let mut process = command.spawn().unwrap();
    let mut printed = BufReader::new(process.stdout.take().unwrap());
    let mut line = String::new();
    printed.read_line(&mut line).unwrap();
    assert_eq!(line, "it hangs\n");
    process.kill().unwrap();
    // Until the other process closes it.
    printed.read_to_string(&mut line).unwrap();
    assert_eq!(line, "it hangs\n");
    process.wait().unwrap();
}

/// It happens at 0.3 s, between communication points, and lets `x1` jump from 1 to 7. Without Event Mode the FMU handles it
/// itself.
#[test]
fn co_simulation_with_event_mode_records_an_event() {
    let bench = misbehaving(3, "none");
    let values = "values = { misdeed = \"event_in_step\", from = 0.3 }";
    bench.scenario(0.5, values);
    let simulate = |options: &[&str]| {
        let output = bench.run(&[&["simulate", "scenario.toml", "--record", "alone:x1"], options].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let summary = simulate(&[]);
    assert!(summary.contains(" ms; sampled: no events from alone (see --event-mode)\n"), "{summary}");
    simulate(&["--out", "without.csv"]);
    simulate(&["--event-mode", "--no-events", "--out", "points.csv"]);
    let points = "time,alone:x1\n# s,\n0.0,1.0\n0.125,1.0\n0.25,1.0\n0.375,7.0\n0.5,7.0\n";
    assert_eq!([bench.read("without.csv"), bench.read("points.csv")], [points, points]);
    assert_eq!(simulate(&["--event-mode", "--out", "with.csv"]), "with.csv  7 rows\n");
    let rows = points.replace("0.375,", "0.3,1.0\n0.3,7.0\n0.375,");
    assert_eq!(bench.read("with.csv"), rows);
    // A second FMU cannot do so.
    careless::write(
        &bench.path("old.fmu"),
        &careless::misbehaving(2, 1, "none"),
        careless::misbehaving_library(),
    );
    bench.scenario(0.5, &format!("{values}\n[[fmu]]\nname = \"old\"\nfile = \"old.fmu\"\n"));
    let printed = simulate(&["--event-mode", "--out", "system.csv"]);
    assert_eq!(printed, "system.csv  7 rows; sampled: no events from old\n");
    assert_eq!(bench.read("system.csv"), rows);
}

#[test]
fn event_mode_is_refused_where_it_is_not_with_the_reason() {
    let without = careless::misbehaving(3, 1, "none").replace(" hasEventMode=\"true\"", "");
    for (description, options, reason) in [
        (without, &[][..], "it has no Event Mode in co-simulation (hasEventMode is false)"),
        (careless::misbehaving(2, 1, "none"), &[], "co-simulation of FMI 2.0 has no Event Mode"),
        (
            careless::misbehaving(3, 1, "none"),
            &["--interface", "me"],
            "it runs by Model Exchange, which handles events anyway",
        ),
    ] {
        let bench = misbehaving(3, "none");
        careless::write(&bench.path("careless.fmu"), &description, careless::misbehaving_library());
        let message = bench.refusal(&[&["simulate", "scenario.toml", "--event-mode"], options].concat());
        assert_eq!(message, format!("error: --event-mode: alone: {reason}\n"));
    }
}
