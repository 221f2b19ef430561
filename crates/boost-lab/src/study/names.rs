//! The variables of a study, as far as its FMUs have them.

use fmu_master::Fmu;

/// The variables recorded for each case, if the FMUs have them.
const RECORDED: [&str; 12] = [
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
    "supply_voltage_measured",
];
pub const BOOST: &str = "boost_pressure";
pub const SHAFT: &str = "hp_turbo_speed";
/// Negative when a compressor surges.
pub const FLOWS: [&str; 2] = ["hp_compressor.mass_flow", "lp_compressor.mass_flow"];
pub const ALARM: &str = "fault_code";
/// The controller's target.
pub const MODEL: &str = "reference_model_pressure";

/// Which of the names the FMUs have.
pub struct Names {
    plant_inputs: Vec<String>,
    inputs: Vec<String>,
    pub recorded: Vec<&'static str>,
    has_shaft: bool,
}

impl Names {
    pub fn new(plant: &Fmu, controller: &Fmu) -> Self {
        let names = |fmu: &Fmu, of| fmu.names(of).map(str::to_owned).collect::<Vec<_>>();
        let plant_inputs = names(plant, "input");
        let inputs = [plant_inputs.clone(), names(controller, "input")].concat();
        let is_known =
            |name: &&str| [plant, controller].iter().any(|fmu| fmu.description().variable(name).is_some());
        let recorded = RECORDED.into_iter().filter(is_known).collect();
        let has_shaft = plant.names("output").any(|name| name == SHAFT);
        Self { plant_inputs, inputs, recorded, has_shaft }
    }

    pub fn has_input(&self, name: &str) -> bool {
        self.inputs.iter().any(|known| known == name)
    }

    pub fn plant_has_input(&self, name: &str) -> bool {
        self.plant_inputs.iter().any(|known| known == name)
    }

    /// The shaft speed variable.
    pub fn shaft(&self) -> Option<&'static str> {
        self.has_shaft.then_some(SHAFT)
    }
}
