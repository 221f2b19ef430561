//! FMUs with other names and units: a [`NameMap`] gives them those of the interface.

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
pub type Map = Arc<dyn fmu_master::NameMap>;

/// Reads a map's file.
pub fn read(path: &Path) -> Result<Map> {
    Ok(Arc::new(ToInterface(NameMap::read(&INTERFACE, path)?)))
}

/// Assigns each map to the scenario's FMUs that it is for.
pub fn give(scenario: &mut Scenario, maps: &[PathBuf]) -> Result<()> {
    if maps.is_empty() {
        return Ok(());
    }
    let fmus = scenario.fmus.iter_mut().map(|member| {
        let model = member.location.locate(model(&member.file))?;
        Ok((model, &mut member.map))
    });
    assign(maps, fmus.collect::<Result<_>>()?, "scenario")
}

/// The model's name in an FMU, by which maps name it.
pub fn model(file: &Path) -> Result<String> {
    Ok(FmuDescription::read(file)?.attribute("modelName").to_owned())
}

/// Assigns each map to those of a task's FMUs that it is for, which are given by their models' names.
pub fn assign(maps: &[PathBuf], mut fmus: Vec<(String, &mut Option<Map>)>, task: &str) -> Result<()> {
    for path in maps {
        let map = NameMap::read(&INTERFACE, path)?;
        let of_model = map.fmu.clone();
        let map: Map = Arc::new(ToInterface(map));
        let mut is_taken = false;
        for (_, place) in fmus.iter_mut().filter(|(model, _)| *model == of_model) {
            **place = Some(Arc::clone(&map));
            is_taken = true;
        }
        if !is_taken {
            let models: Vec<_> = fmus.iter().map(|(model, _)| model.as_str()).collect();
            bail!(
                "the map {} is for the FMU {of_model}, which the {task} does not have: it has {}",
                path.display(),
                models.join(", ")
            );
        }
    }
    Ok(())
}
