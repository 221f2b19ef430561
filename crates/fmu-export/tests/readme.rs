//! The model on both front pages is the one that `cargo fmu new` writes, which is compiled, exported and run.

const PAGE: &str = include_str!("../README.md");
const REPOSITORY_PAGE: &str = include_str!("../../../README.md");
const DECLARATION: &str = include_str!("../../cargo-fmu/templates/dahlquist/model.json");
const SOURCE: &str = include_str!("../../cargo-fmu/templates/dahlquist/lib.rs");

/// The first code block of a language.
fn block(page: &'static str, language: &str) -> &'static str {
    let (_, rest) = page.split_once(&format!("```{language}\n")).expect("the page has such a block");
    rest.split("```").next().expect("the block ends")
}

#[test]
fn the_front_pages_show_what_new_writes() {
    let (_, source) = SOURCE.split_once("\n\n").expect("the comment ends");
    let (model, _) = source.split_once("\n#[cfg(test)]").expect("the tests follow");
    for (page, rust) in [(PAGE, "rust,ignore"), (REPOSITORY_PAGE, "rust")] {
        assert_eq!(block(page, "json"), DECLARATION);
        assert_eq!(block(page, rust), model.replace("{Type}", "Decay"));
    }
}
