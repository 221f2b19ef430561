//! The model on the front page is the one that `cargo fmu new` writes, which is compiled, exported and run.

const PAGE: &str = include_str!("../README.md");
const DECLARATION: &str = include_str!("../../cargo-fmu/templates/dahlquist/model.json");
const SOURCE: &str = include_str!("../../cargo-fmu/templates/dahlquist/lib.rs");

/// The first code block of a language.
fn block(language: &str) -> &'static str {
    let (_, rest) = PAGE.split_once(&format!("```{language}\n")).expect("the page has such a block");
    rest.split("```").next().expect("the block ends")
}

#[test]
fn the_front_page_shows_what_new_writes() {
    assert_eq!(block("json"), DECLARATION);
    let (_, source) = SOURCE.split_once("\n\n").expect("the comment ends");
    let (model, _) = source.split_once("\n#[cfg(test)]").expect("the tests follow");
    assert_eq!(block("rust,ignore"), model.replace("{Type}", "Decay"));
}
