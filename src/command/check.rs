//! `check`: prints a table that shows whether an FMU can replace the plant or the controller.

use std::path::Path;

use anyhow::{Context, Result};
use boost_interface::{Compatibility, Interface, NameMap, Role};
use fmu_io::terminal::print;
use fmu_io::writing;
use fmu_package::FmuDescription;

/// Prints how an FMU fits, and optionally writes a map to edit. Returns whether it fits.
pub fn run(
    interface: &Interface,
    path: &Path,
    role: Role,
    map: Option<&Path>,
    write_map: Option<&Path>,
) -> Result<bool> {
    let description = FmuDescription::read(path)?;
    let file = map;
    let map = file.map(|file| NameMap::read(interface, file)).transpose()?;
    // Only the map can be at fault.
    let compatibility = Compatibility::new(interface, role, &description, map.as_ref())
        .with_context(|| file.map_or_else(String::new, |file| file.display().to_string()))?;
    print(&compatibility.to_string())?;
    if let Some(file) = write_map {
        let map = compatibility.to_map(map.as_ref());
        writing::write_new(file, map.to_json()?.as_bytes())?;
        let proposed: Vec<_> = map.proposed().collect();
        let check = match proposed.as_slice() {
            [] => String::new(),
            names => {
                format!(" Its names for {} are proposals, with candidates beside them.", names.join(", "))
            }
        };
        print(&format!("Wrote the map {}; edit it and pass it with --map.{check}\n", file.display()))?;
    }
    Ok(compatibility.fits())
}
