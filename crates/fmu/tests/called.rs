//! Help and messages use the name with which the command is called.

use std::process::{Command, Output};

fn fmu(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fmu")).args(arguments).output().unwrap()
}

#[test]
fn help_is_in_the_words_of_the_caller() {
    for arguments in [&["--help"][..], &["simulate", "--help"], &["validate", "--help"]] {
        let help = String::from_utf8(fmu(arguments).stdout).unwrap();
        assert!(help.contains("\n  fmu ") && help.contains("Usage: fmu "), "{help}");
        assert!(!help.contains("cargo fmu"), "{help}");
    }
}

/// Cargo calls `cargo-fmu` with the word `fmu`; nobody else does.
#[test]
fn the_name_is_no_command() {
    let done = fmu(&["fmu", "--help"]);
    assert_eq!(done.status.code(), Some(2));
    assert!(String::from_utf8(done.stderr).unwrap().contains("Usage: fmu <COMMAND>"));
}
