//! The variables of a study, as far as its FMUs have them, and names for readers.

use clap::ValueEnum;
use fmu_master::Fmu;
use fmu_package::FmuDescription;
use fmu_terms::Causality;

/// The variables recorded for each case, if the FMUs have them.
const RECORDED: [&str; 15] = [
    "boost_reference",
    BOOST,
    TRUE_BOOST,
    TANK,
    "engine_speed",
    DUTY,
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
/// Boost pressure without faults of its sensor.
pub const TRUE_BOOST: &str = "intercooler.outlet_pressure";
pub const TANK: &str = "tank_pressure";
/// The plant's start value of tank pressure.
pub const TANK_START: &str = "tank.pressure";
/// The plant's parameter for the states from which it starts, and the value for an engine just started, with its wastegate
/// shut.
pub const START: &str = "initialization.mode";
pub const RUNNING: &str = "running";
/// The high-pressure wastegate's duty (%).
pub const DUTY: &str = "hp_wastegate_pwm";
/// The controller's parameter that lets the findings of its diagnosis act.
pub const LIMP_HOME: &str = "diagnosis.limp_home";
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

/// Whether a plant can start as an engine just started.
pub fn can_start_running(plant: &FmuDescription) -> bool {
    plant
        .variable(START)
        .and_then(|variable| plant.enumeration(&variable.declared_type))
        .is_some_and(|enumeration| enumeration.items.iter().any(|(item, _)| item == RUNNING))
}

/// What the documentation of an enumeration's value says, for readers.
pub fn help(value: &impl ValueEnum) -> String {
    let value = value.to_possible_value();
    value.and_then(|value| Some(value.get_help()?.to_string())).unwrap_or_default()
}

/// What of [`RECORDED`] one of the FMUs has.
pub fn recorded(fmus: [&Fmu; 2]) -> Vec<&'static str> {
    let is_known = |name: &&str| fmus.iter().any(|fmu| fmu.description().variable(name).is_some());
    RECORDED.into_iter().filter(is_known).collect()
}
