//! The interface of this repository's FMUs, and FMUs seen through it.

use std::path::Path;
use std::sync::{Arc, LazyLock};

use anyhow::{Result, bail};
use boost_interface::{Compatibility, Interface, Role, Translation};
use fmu_master::Fmu;
use fmu_package::connection::Connection;

/// The interface of this repository's FMUs.
pub static INTERFACE: LazyLock<Interface> = LazyLock::new(|| {
    let [plant, controller] = boost_fmu::DESCRIPTIONS;
    Interface::new(plant, controller).expect("the build generated the descriptions")
});

/// Opens an FMU; with connections of the system, in the interface's names and units.
pub fn open(path: &Path, role: Role, connections: &[Connection]) -> Result<Arc<Fmu>> {
    let fmu = fmu_run::open(path)?;
    if connections.is_empty() {
        return Ok(fmu);
    }
    let compatibility = Compatibility::new(&INTERFACE, role, fmu.description(), connections)?;
    if !compatibility.fits() {
        bail!("{}: {}", path.display(), compatibility.to_string().trim_end());
    }
    let Translation { description, conversions, thresholds } = compatibility.translation();
    Ok(fmu.translated(description, conversions, thresholds))
}
