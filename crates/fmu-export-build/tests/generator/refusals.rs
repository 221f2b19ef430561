//! Rejections: the small model, broken in one place at a time, and the findings of the build.
//!
//! `refusals.txt` holds the cases: lines that edit the model, and below them, indented, the findings.
//!
//! | line | edit |
//! |---|---|
//! | `at POINTER {…}` | sets keys of the object at a JSON pointer, or removes those that are null |
//! | `append POINTER {…}` | appends to the list at a JSON pointer |
//! | `text ["from", "to"]` | replaces text in the model as it was written |
//! | `units …` | the file of units |
//!
//! After an edit other than of text the model has one key on each line. After an intended change, `FMU_EXPORT_BLESS=1`
//! updates the findings.

use std::env;
use std::fmt::Write as _;
use std::fs;
use std::path::MAIN_SEPARATOR;

use fmu_export_build::{Interfaces, generate_into};
use serde_json::Value;

use super::{folder_with_model, package, read, sources};

/// The findings on the small model after some edits, without the folder, and the rejected file.
fn refusal(name: &str, edits: &[&str]) -> (String, String) {
    let folder = folder_with_model(name);
    let file = folder.join("vessels.json");
    let mut text = read(&sources().join("vessels.json"));
    for edit in edits {
        let (kind, rest) = edit.split_once(' ').expect("an edit has arguments");
        let json = |text: &str| -> Value {
            serde_json::from_str(text).unwrap_or_else(|error| panic!("{edit}: {error}"))
        };
        match kind {
            "units" => fs::write(folder.join("units.json"), rest).expect("the folder for tests is writable"),
            "text" => {
                let [from, to]: [String; 2] =
                    serde_json::from_value(json(rest)).expect("there are two texts");
                assert!(text.contains(&from), "{edit}");
                text = text.replacen(&from, &to, 1);
            }
            _ => {
                let (pointer, value) = rest.split_once(' ').expect("an edit has a pointer and a value");
                let (mut model, value) = (json(&text), json(value));
                let place =
                    model.pointer_mut(pointer).unwrap_or_else(|| panic!("{edit}: there is no such place"));
                match (kind, place, value) {
                    ("at", Value::Object(object), Value::Object(keys)) => {
                        object.extend(keys);
                        object.retain(|_, value| !value.is_null());
                    }
                    ("append", Value::Array(list), value) => list.push(value),
                    _ => panic!("{edit}: there is no such edit"),
                }
                text = serde_json::to_string_pretty(&model).expect("it is JSON");
            }
        }
    }
    fs::write(&file, &text).expect("the folder for tests is writable");
    match generate_into(&file, &folder, &package(), Interfaces::CoSimulation) {
        Ok(_) => ("nothing was refused".to_owned(), text),
        Err(error) => {
            assert!(!folder.join("Vessels").exists(), "{name}: something was written");
            (error.to_string().replace(&format!("{}{MAIN_SEPARATOR}", folder.display()), ""), text)
        }
    }
}

/// A finding about an existing key has the line of that key.
fn assert_line_is_that_of_the_key(finding: &str, text: &str) {
    let Some((line, key)) = finding.strip_prefix("vessels.json:").and_then(|rest| rest.split_once(": "))
    else {
        return;
    };
    let (Ok(line), Some((key, _))) = (line.parse::<usize>(), key.split_once(": ")) else { return };
    let Ok(model) = serde_json::from_str::<Value>(text) else { return };
    let pointer = format!("/{}", key.replace('[', "/").replace(']', "").replace('.', "/"));
    let last = key.rsplit('.').next().expect("there is a last part");
    if model.pointer(&pointer).is_some() && !last.ends_with(']') {
        let line = text.lines().nth(line - 1).expect("the line is in the file");
        assert!(line.contains(&format!("\"{last}\":")), "{finding} is said of the line\n{line}");
    }
}

#[test]
fn what_is_wrong_is_refused_with_file_line_and_key() {
    let file = sources().join("refusals.txt");
    let expected = read(&file);
    let (mut found, mut edits, mut cases) = (String::new(), Vec::new(), 0);
    let mut lines = expected.lines().filter(|line| !line.starts_with("    ")).peekable();
    while let Some(line) = lines.next() {
        let _ = writeln!(found, "{line}");
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        edits.push(line);
        if lines.peek().is_none_or(|next| next.is_empty() || next.starts_with('#')) {
            cases += 1;
            let (findings, text) = refusal(&format!("refusal {cases}"), &edits);
            for finding in findings.lines() {
                assert_line_is_that_of_the_key(finding, &text);
                let _ = writeln!(found, "    {finding}");
            }
            edits.clear();
        }
    }
    if env::var_os("FMU_EXPORT_BLESS").is_some() {
        return fs::write(&file, &found).expect("the folder of the sources is writable");
    }
    assert!(cases > 150, "{cases} cases");
    for (found, expected) in found.lines().zip(expected.lines()) {
        assert_eq!(found, expected);
    }
    assert_eq!(found, expected);
}

/// What XML 1.0 forbids or discourages.
#[test]
fn characters_that_xml_does_not_keep_are_refused() {
    for character in ['\0', '\u{1}', '\u{b}', '\u{1f}', '\u{7f}', '\u{85}', '\u{fffe}', '\u{ffff}'] {
        let text = Value::from(format!("a{character}b"));
        for (pointer, key) in [("/variables/0", "description"), ("/components/2/variables/1", "start")] {
            let edit = format!("at {pointer} {{\"{key}\": {text}}}");
            let (findings, _) = refusal("characters", &[&edit]);
            let reason = format!("contains U+{:04X}, which XML does not preserve", u32::from(character));
            assert!(findings.ends_with(&reason), "{findings}");
        }
    }
}
