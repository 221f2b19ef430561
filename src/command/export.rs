//! `export`: exports the models as `cargo fmu export` does, and the package of their system if both are exported for
//! co-simulation.

use std::path::PathBuf;

use anyhow::{Result, bail};
use boost_interface::Role;
use cargo_fmu::Export;
use fmu_package::{FmuDescription, reading};

use super::ssp;

/// Exports models; the package binds the parameter sets.
pub fn run(export: Export, parameters: &[PathBuf]) -> Result<()> {
    let plan = export.plan()?;
    let members = [Role::Plant, Role::Controller].map(Role::model_identifier);
    if !members.iter().all(|member| plan.models().any(|model| model == *member)) {
        if !parameters.is_empty() {
            bail!("parameter sets are bound in the system of {}; export both", members.join(" and "));
        }
        plan.run(&[], &[])?;
        return Ok(());
    }
    let system = plan.folder().join("Boost.ssp");
    let written = plan.run(parameters, std::slice::from_ref(&system))?;
    for member in members {
        if !written.contains(&plan.fmu(member)) {
            if !parameters.is_empty() {
                bail!("parameter sets are bound in Boost.ssp, which takes FMUs of FMI 2.0");
            }
            return Ok(());
        }
        if FmuDescription::read(&plan.fmu(member))?.interface("CoSimulation").is_none() {
            if !parameters.is_empty() {
                bail!("parameter sets are bound in Boost.ssp, which takes FMUs for co-simulation");
            }
            return Ok(());
        }
    }
    let [plant, controller] = members.map(|model| reading::bytes(&plan.fmu(model)));
    ssp::write(&ssp::own(plant?, controller?, parameters)?, &system)
}
