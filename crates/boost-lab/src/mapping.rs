//! FMUs with other names and units: a [`NameMap`] gives them the interface's.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use boost_interface::Compatibility;
pub use boost_interface::NameMap;
use fmu_package::FmuDescription;

use crate::importer::Fmu;
use crate::scenario::Scenario;

/// Imports an FMU, with a map if there is one.
pub fn open(file: &Path, map: Option<&NameMap>) -> Result<Arc<Fmu>> {
    let fmu = Fmu::open(file)?;
    let Some(map) = map else { return Ok(fmu) };
    let compatibility = Compatibility::new(map.role, fmu.description(), Some(map))
        .with_context(|| file.display().to_string())?;
    if !compatibility.fits() {
        bail!("{}", compatibility.to_string().trim_end());
    }
    Ok(fmu.translated(compatibility.translation()))
}

/// Assigns each map to the scenario's FMUs that it is for.
pub fn give(scenario: &mut Scenario, maps: &[PathBuf]) -> Result<()> {
    if maps.is_empty() {
        return Ok(());
    }
    let model = |file: &Path| Ok(FmuDescription::read(file)?.attribute("modelName").to_owned());
    let models = scenario.fmus.iter().map(|member| member.location.locate(model(&member.file)));
    let models: Vec<String> = models.collect::<Result<_>>()?;
    for path in maps {
        let map = NameMap::read(path)?;
        let mut is_taken = false;
        for (member, _) in scenario.fmus.iter_mut().zip(&models).filter(|(_, model)| **model == map.fmu) {
            member.map = Some(map.clone());
            is_taken = true;
        }
        if !is_taken {
            bail!(
                "the map {} is for the FMU {}, which the scenario does not have: it has {}",
                path.display(),
                map.fmu,
                models.join(", ")
            );
        }
    }
    Ok(())
}

/// A map in canonical form.
pub(crate) fn setting(map: &NameMap) -> Result<String> {
    serde_json::to_string(map).context("the map")
}
