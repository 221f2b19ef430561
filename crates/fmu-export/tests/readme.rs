//! The model on both front pages is the one that `cargo fmu new` writes, which is compiled, exported and run.

const PAGE: &str = include_str!("../README.md");
const REPOSITORY_PAGE: &str = include_str!("../../../README.md");
const DECLARATION: &str = include_str!("../../cargo-fmu/templates/dahlquist/model.json");
const SOURCE: &str = include_str!("../../cargo-fmu/templates/dahlquist/lib.rs");

/// Models whose equations are tested.
const TESTED: &str = include_str!("equations/src/lib.rs");

/// A template around a simulation that steps itself.
const STEPPER: &str = include_str!("../../cargo-fmu/templates/checkout/lib.rs");

/// The first code block of a language.
fn block<'page>(page: &'page str, language: &str) -> &'page str {
    let (_, rest) = page.split_once(&format!("```{language}\n")).expect("the page has such a block");
    rest.split("```").next().expect("the block ends")
}

/// However it is wrapped.
fn on_a_line(code: &str) -> String {
    code.split_whitespace().collect::<Vec<_>>().concat().replace(",)", ")")
}

#[test]
fn sampled_inputs_are_those_of_a_tested_model() {
    let (_, section) = PAGE.split_once("### Sampled inputs").expect("the page has this section");
    let tested = on_a_line(TESTED).replace("furnace::", "");
    for item in block(section, "rust,ignore").split("\n\n") {
        assert!(tested.contains(&on_a_line(item)), "{item}");
    }
}

#[test]
fn the_model_of_an_existing_crate_is_what_new_writes() {
    let (_, section) = PAGE.split_once("### An FMU of an existing crate").expect("the page has this section");
    let (_, written) = STEPPER.split_once("use queue::Queue;\n\n").expect("it uses the queue");
    let (model, _) = written.split_once("\n#[cfg(test)]").expect("the tests follow");
    assert_eq!(block(section, "rust,ignore"), model.replace("{Type}", "Checkout"));
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
