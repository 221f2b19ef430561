//! FMUs with other names and units: a [`NameMap`] gives them the interface's.

use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

use anyhow::{Result, bail};
use boost_interface::{Compatibility, Interface, NameMap};
use fmu_master::scenario::Scenario;
use fmu_package::{FmuDescription, Translation};

/// The interface of this repository's FMUs.
pub static INTERFACE: LazyLock<Interface> = LazyLock::new(|| {
    let [plant, controller] = boost_fmu::DESCRIPTIONS;
    Interface::new(plant, controller).expect("the build generated the descriptions")
});

/// A map to the interface's names and units, for the master.
#[derive(Debug)]
struct ToInterface(NameMap);

impl fmu_master::NameMap for ToInterface {
    fn translation(&self, fmu: &FmuDescription) -> Result<Translation> {
        let compatibility = Compatibility::new(&INTERFACE, self.0.role, fmu, Some(&self.0))?;
        if !compatibility.fits() {
            bail!("{}", compatibility.to_string().trim_end());
        }
        Ok(compatibility.translation())
    }

    fn text(&self) -> String {
        serde_json::to_string(&self.0).expect("a map is JSON")
    }
}

/// A map, for the master.
pub fn of(map: NameMap) -> Arc<dyn fmu_master::NameMap> {
    Arc::new(ToInterface(map))
}

/// Reads a map's file.
pub fn read(path: &Path) -> Result<Arc<dyn fmu_master::NameMap>> {
    NameMap::read(&INTERFACE, path).map(of)
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
        let map = NameMap::read(&INTERFACE, path)?;
        let of_model = map.fmu.clone();
        let map = of(map);
        let mut is_taken = false;
        for (member, _) in scenario.fmus.iter_mut().zip(&models).filter(|(_, model)| **model == of_model) {
            member.map = Some(Arc::clone(&map));
            is_taken = true;
        }
        if !is_taken {
            bail!(
                "the map {} is for the FMU {of_model}, which the scenario does not have: it has {}",
                path.display(),
                models.join(", ")
            );
        }
    }
    Ok(())
}
