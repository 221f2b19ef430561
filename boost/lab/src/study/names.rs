//! The variables of a study, as far as its FMUs have them.

use fmu_master::Fmu;
use fmu_terms::Causality;

/// The variables recorded for each case, if the FMUs have them.
const RECORDED: [&str; 13] = [
    "boost_reference",
    "boost_pressure",
    "engine_speed",
    "hp_wastegate_pwm",
    "lp_wastegate",
    "hp_bypass",
    SHAFT,
    FLOWS[0],
    FLOWS[1],
    ALARM,
    MODEL,
    PUMP,
    "supply_voltage_measured",
];
pub const BOOST: &str = "boost_pressure";
pub const SHAFT: &str = "hp_turbo_speed";
/// Negative when a compressor surges.
pub const FLOWS: [&str; 2] = ["hp_compressor.mass_flow", "lp_compressor.mass_flow"];
pub const ALARM: &str = "fault_code";
/// The command to the vacuum pump, 0 or 1.
pub const PUMP: &str = "vacuum_pump";
/// The controller's target.
pub const MODEL: &str = "reference_model_pressure";

/// Whether an FMU has an input or an output.
pub fn has(fmu: &Fmu, causality: Causality, name: &str) -> bool {
    fmu.names(causality).any(|known| known == name)
}

/// What of [`RECORDED`] one of the FMUs has.
pub fn recorded(fmus: [&Fmu; 2]) -> Vec<&'static str> {
    let is_known = |name: &&str| fmus.iter().any(|fmu| fmu.description().variable(name).is_some());
    RECORDED.into_iter().filter(is_known).collect()
}
