//! `check`: prints a table that shows whether an FMU can replace the plant or the controller.

use std::path::{Path, PathBuf};

use anyhow::Result;
use boost_interface::{Compatibility, Interface, Role};
use fmu_io::terminal::print;
use fmu_io::writing;
use fmu_package::{FmuDescription, connection};

/// Prints how an FMU fits, and optionally writes connections to edit. Returns whether it fits.
pub fn run(
    interface: &Interface,
    path: &Path,
    role: Role,
    connections: &[PathBuf],
    write: Option<&Path>,
) -> Result<bool> {
    let description = FmuDescription::read(path)?;
    let connections = connection::read_all(connections)?;
    let compatibility = Compatibility::new(interface, role, &description, &connections)?;
    print(&compatibility.to_string())?;
    if let Some(file) = write {
        writing::write_new(file, compatibility.connections().as_bytes())?;
        let proposed: Vec<_> = compatibility.proposed().collect();
        let check = match proposed.as_slice() {
            [] => String::new(),
            names => format!(" Those for {} are proposals in comments.", names.join(", ")),
        };
        print(&format!(
            "Wrote the connections {}; edit them and pass them with --connections.{check}\n",
            file.display()
        ))?;
    }
    Ok(compatibility.fits())
}
