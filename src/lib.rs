//! Boost pressure control of a two-stage turbocharged engine: the [`plant`] (engine, turbochargers and
//! vacuum-actuated wastegate) and its [`controller`], after Criscuolo, Leufvén, Thomasson and Eriksson,
//! "Model-based boost pressure control with system voltage disturbance rejection" (IFAC 2011).
//!
//! Each is an [`fmu_export::Model`] declared in `modelDescription/`, compiled into its FMU by a crate that contains
//! only the export.

// The controller also runs on an ECU.
#![no_std]

#[cfg(any(test, not(target_os = "none")))]
extern crate std;

pub mod controller;
pub mod elementary;
#[cfg(not(target_os = "none"))]
pub mod plant;

/// The controller as its FMU has it.
#[cfg(not(target_os = "none"))]
pub type BoostController = fmu_export::SampledModel<controller::ControlLaw>;

/// The controller's modelDescription.xml.
pub const CONTROLLER_XML: &str =
    <controller::variables::Variables as fmu_export::Described>::MODEL_DESCRIPTION_XML;

/// The modelDescription.xml of the plant and of the controller.
#[cfg(not(target_os = "none"))]
pub const DESCRIPTIONS: [&str; 2] =
    [<plant::variables::Variables as fmu_export::Described>::MODEL_DESCRIPTION_XML, CONTROLLER_XML];

/// The longest communication step of either model in seconds: a day. A longer one would take minutes to compute and
/// is most likely a mistake.
const LONGEST_STEP: f64 = 86_400.0;
