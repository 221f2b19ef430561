//! `export`: exports the models as `cargo fmu export` does, and for each FMI version the package of their system, if
//! both are exported for co-simulation.

use std::path::PathBuf;

use anyhow::{Result, bail};
use boost_interface::{Interface, Role};
use cargo_fmu::Export;
use fmu_package::FmuDescription;

use super::ssp::{self, SYSTEM};

/// Exports models; the packages bind the parameter sets.
pub fn run(interface: &Interface, export: Export, parameters: &[PathBuf]) -> Result<()> {
    let plan = export.plan()?;
    let members = [Role::Plant, Role::Controller].map(|role| interface.model_identifier(role));
    if !parameters.is_empty() && !members.iter().all(|member| plan.models().any(|model| model == *member)) {
        bail!("parameter sets are bound in the system of {}; export both", members.join(" and "));
    }
    let packages = plan.folders().map(|folder| folder.join(format!("{SYSTEM}.ssp")));
    let written = plan.run(parameters, &packages)?;
    let mut is_bound = parameters.is_empty();
    for package in packages {
        let [plant, controller] = members.map(|member| package.with_file_name(format!("{member}.fmu")));
        let is_member = |fmu: &PathBuf| -> Result<bool> {
            Ok(written.contains(fmu) && FmuDescription::read(fmu)?.co_simulation_identifier().is_some())
        };
        if is_member(&plant)? && is_member(&controller)? {
            let parameters = parameters.to_vec();
            let system = ssp::Arguments {
                plant,
                controller,
                connections: vec![],
                parameters,
                inputs: None,
                out: Some(package),
            };
            ssp::run(interface, &system)?;
            is_bound = true;
        }
    }
    if !is_bound {
        bail!("parameter sets are bound in {SYSTEM}.ssp, which takes FMUs for co-simulation");
    }
    Ok(())
}
