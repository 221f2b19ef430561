//! The steps of the paper's Fig. 13, for tests and benchmarks in Rust: those of the laboratory's scenario.

use std::sync::LazyLock;

/// Steps of the boost reference: times (s) and values (Pa).
pub static BOOST_STEPS: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| {
    pairs(
        include_str!("../../boost/lab/scenarios/figure_13.toml"),
        |inputs| &inputs["boost_reference"]["steps"],
    )
});

/// The pairs of numbers in a list among a scenario's inputs.
pub fn pairs(scenario: &str, list: impl Fn(&toml::Value) -> &toml::Value) -> Vec<(f64, f64)> {
    let scenario: toml::Table = scenario.parse().expect("the scenario is TOML");
    let number = |value: &toml::Value| {
        value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64)).expect("a number")
    };
    let list = list(&scenario["inputs"]).as_array().expect("a list of pairs");
    list.iter().map(|pair| (number(&pair[0]), number(&pair[1]))).collect()
}
