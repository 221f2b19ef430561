//! `documentation/platforms.txt`: the platforms of an FMU's libraries, their requirements, and where they were run.

use std::collections::BTreeMap;
use std::fmt::{self, Display};

use crate::library::Library;
use crate::platform::Platform;

/// Starts a line's list of systems on which the library was run.
const RUN: &str = "; run: ";

/// An FMU's platforms, by folder in `binaries/`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PlatformList {
    /// The library of each.
    pub libraries: BTreeMap<String, Library>,
    /// The systems or emulators on which a platform's library was run.
    pub runs: BTreeMap<String, String>,
}

impl PlatformList {
    /// The path in the archive.
    pub const PATH: &'static str = "documentation/platforms.txt";

    /// Reads from a list where the libraries were run.
    #[must_use]
    pub fn read_runs(text: &str) -> BTreeMap<String, String> {
        text.lines()
            .filter_map(|line| {
                let (folder, rest) = line.split_once(": ")?;
                let (_, run) = rest.split_once(RUN)?;
                folder.parse::<Platform>().ok()?;
                Some((folder.to_owned(), run.to_owned()))
            })
            .collect()
    }
}

/// The text of the file: a line for each platform.
impl Display for PlatformList {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(formatter, "The libraries of this FMU by folder in binaries/\n")?;
        for (folder, library) in &self.libraries {
            write!(formatter, "{folder}: {library}")?;
            match self.runs.get(folder) {
                Some(run) => writeln!(formatter, "{RUN}{run}")?,
                None => writeln!(formatter, "; only built")?,
            }
        }
        Ok(())
    }
}
