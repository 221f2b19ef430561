//! FMUs that end the process, and the messages of any.

use std::fs;

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
        for command in
            [["simulate", "scenario.toml", "--out", "out.csv"], ["sweep", "study.toml", "--out", "out"]]
        {
            let message = refused_with_temporary_folder(&bench, &command, misdeed);
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

    // In the midst of a study, and with its own status.
    let bench = misbehaving(2, "none");
    bench.scenario(0.25, "values = { misdeed = \"exit_in_step\", status = 7 }");
    let sweep = ["sweep", "study.toml", "--out", "out", "--threads", "1"];
    let message = refused_with_temporary_folder(&bench, &sweep, "none");
    assert_eq!(message, "error: alone: the FMU ended the process by `exit` in fmi2DoStep at 0 s\n");
    assert_eq!(bench.read("out/journal.jsonl").lines().count(), 2);
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
        ("fail_in_step", "gave fmi2Error\n  it cannot go on\n"),
        ("log_unknown_status", "gave fmi2Error\n  said with 17\n"),
    ] {
        let message_of = misbehaving(2, misdeed).refusal(&["simulate", "scenario.toml"]);
        assert_eq!(message_of, format!("error: alone: fmi2DoStep at 0 s {message}"));
    }
}
