//! The steps of the paper's Fig. 13, for tests and benchmarks in Rust: those of the laboratory's scenario.

use std::sync::LazyLock;

/// Steps of the boost reference: times (s) and values (Pa).
pub static BOOST_STEPS: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| {
    let text = include_str!("../../crates/boost-lab/scenarios/figure_13.toml");
    let scenario: toml::Table = text.parse().expect("the scenario is TOML");
    let number = |value: &toml::Value| {
        value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64)).expect("a number")
    };
    let steps = scenario["inputs"]["boost_reference"]["steps"].as_array().expect("a list of steps");
    steps.iter().map(|step| (number(&step[0]), number(&step[1]))).collect()
});
