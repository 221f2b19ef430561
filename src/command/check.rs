//! `check`: prints a table that shows whether an FMU can replace the plant or the controller.

use std::io::BufReader;
use std::path::{Path, PathBuf};

use anyhow::Result;
use boost_interface::{Compatibility, Interface, Role};
use fmu_io::terminal::print;
use fmu_io::{reading, writing};
use fmu_package::connection::{self, Connection};
use fmu_package::{FmuDescription, Platform, archive};
use fmu_validation::rules::{LIBRARY_MISSING, LIBRARY_NAME};
use fmu_validation::{Finding, validate};

/// An FMU that may replace the plant or the controller.
pub struct Candidate {
    /// The FMU's description, with the elements of arrays, as a run has them.
    description: FmuDescription,
    /// What the FMU's libraries lack on any platform.
    problems: Vec<String>,
    /// What the FMU's libraries lack on this platform.
    note: Option<String>,
}

impl Candidate {
    /// Reads an FMU's description, and finds its libraries.
    ///
    /// # Errors
    /// When it is not an FMU.
    pub fn read(path: &Path) -> Result<Self> {
        let description = FmuDescription::read(path)?.scalars()?;
        let findings = validate(path, &[])?.findings.into_iter();
        let of_libraries =
            findings.filter(|finding| [LIBRARY_MISSING.id, LIBRARY_NAME.id].contains(&finding.rule.id));
        let in_words = |Finding { place, message, .. }: Finding| match place.file {
            Some(folder) => format!("in its {folder} {message}"),
            None => message,
        };
        let problems: Vec<_> = of_libraries.map(in_words).collect();
        let library = Platform::host().zip(description.co_simulation_identifier());
        let library =
            library.map(|(platform, identifier)| platform.library_path(identifier, description.version()));
        let archive = archive::open(BufReader::new(reading::open(path)?))?;
        let has = |library: &String| {
            archive.file_names().any(|name| name.is_ok_and(|name| name.ends_with(library)))
        };
        let lacks = |library: &String| problems.is_empty() && !has(library);
        let note = library
            .filter(lacks)
            .map(|library| format!("It does not run on this platform: it has no {library}."));
        Ok(Self { description, problems, note })
    }

    /// Compares the FMU with the interface.
    ///
    /// # Errors
    /// When a connection is not one of plant and controller.
    pub fn compare<'a>(
        &'a self,
        interface: &'a Interface,
        role: Role,
        connections: &[Connection],
    ) -> Result<Compatibility<'a>> {
        let mut compatibility = Compatibility::new(interface, role, &self.description, connections)?;
        compatibility.problems.extend_from_slice(&self.problems);
        Ok(compatibility)
    }
}

/// Prints how an FMU fits, and optionally writes connections to edit. Returns whether it fits.
pub fn run(
    interface: &Interface,
    path: &Path,
    role: Role,
    connections: &[PathBuf],
    write: Option<&Path>,
) -> Result<bool> {
    let candidate = Candidate::read(path)?;
    let connections = connection::read_all(connections)?;
    let compatibility = candidate.compare(interface, role, &connections)?;
    print(&compatibility.to_string())?;
    if let Some(note) = &candidate.note {
        print(&format!("{note}\n"))?;
    }
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
