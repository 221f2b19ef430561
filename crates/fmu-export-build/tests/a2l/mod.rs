//! An A2L, read by a parser of others.

use a2lfile::Module;

/// The module of an A2L, which is read strictly and is consistent.
pub fn module(text: &str) -> Module {
    let (file, findings) =
        a2lfile::load_from_string(text, None, true).unwrap_or_else(|error| panic!("{error}\n{text}"));
    assert!(findings.is_empty(), "{findings:?}\n{text}");
    let findings = file.check();
    assert!(findings.is_empty(), "{findings:?}\n{text}");
    file.project.module.first().expect("there is a module").clone()
}
