//! Boost pressure control of a two-stage turbocharged engine: the [`plant`] (engine, turbochargers and
//! vacuum-actuated wastegate) and its [`controller`], after Criscuolo, Leufvén, Thomasson and Eriksson,
//! "Model-based boost pressure control with system voltage disturbance rejection" (IFAC 2011).
//!
//! Each is an [`fmu_export::Model`] declared in `modelDescription/`, compiled into its FMU by a crate that contains
//! only the export.

pub mod controller;
pub mod elementary;
pub mod plant;

/// The modelDescription.xml of the plant and of the controller.
pub const DESCRIPTIONS: [&str; 2] = [
    <plant::variables::Variables as fmu_export::Described>::MODEL_DESCRIPTION_XML,
    <controller::variables::Variables as fmu_export::Described>::MODEL_DESCRIPTION_XML,
];

/// The longest communication step of either model in seconds: a day. A longer one would take minutes to compute and
/// is most likely a mistake.
const LONGEST_STEP: f64 = 86_400.0;
