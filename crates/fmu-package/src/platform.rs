//! The platforms of an FMU's libraries: their folders and formats (FMI 2.0.5, section 2.3).
//!
//! The standard names folders for x86. For other processors it refers to FMI 3.0's platform tuples (section 2.5.1.4.1
//! there).

use std::io;
use std::str::FromStr;

use fmu_terms::Version;

/// The formats of shared libraries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Linux.
    Elf,
    /// macOS.
    MachO,
    /// Windows.
    Pe,
}

impl Format {
    /// The format of this program.
    fn host() -> Option<Self> {
        [Self::Elf, Self::MachO, Self::Pe].into_iter().find(|format| format.row()[2] == std::env::consts::OS)
    }

    /// The suffix of a library's file, its name, and its system in Rust and in FMI 3.0.
    fn row(self) -> [&'static str; 4] {
        match self {
            Self::Elf => ["so", "ELF", "linux", "linux"],
            Self::MachO => ["dylib", "Mach-O", "macos", "darwin"],
            Self::Pe => ["dll", "PE", "windows", "windows"],
        }
    }

    /// The suffix of a library's file.
    #[must_use]
    pub fn suffix(self) -> &'static str {
        self.row()[0]
    }

    pub(crate) fn name(self) -> &'static str {
        self.row()[1]
    }
}

/// The processors of FMU libraries.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs)]
pub enum Architecture {
    Aarch64,
    X86,
    X86_64,
}

impl Architecture {
    /// The processor of this program.
    pub(crate) fn host() -> Option<Self> {
        let all = [Self::Aarch64, Self::X86, Self::X86_64];
        all.into_iter().find(|processor| processor.tuple() == std::env::consts::ARCH)
    }

    /// The name in FMI 3.0, and in Rust.
    fn tuple(self) -> &'static str {
        match self {
            Self::Aarch64 => "aarch64",
            Self::X86 => "x86",
            Self::X86_64 => "x86_64",
        }
    }

    pub(crate) fn name(self) -> String {
        self.tuple().replace('_', "-")
    }
}

/// A platform with a folder in FMI 2.0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs)]
pub enum Platform {
    Aarch64Darwin,
    Aarch64Linux,
    Aarch64Windows,
    /// In the standard, macOS on x86-64. On Apple Silicon, FMPy and others use this folder too, so the library may be
    /// for either processor, or a universal one for both.
    Darwin64,
    Linux32,
    Linux64,
    Win32,
    Win64,
}

impl Platform {
    /// All platforms.
    pub const ALL: [Self; 8] = [
        Self::Aarch64Darwin,
        Self::Aarch64Linux,
        Self::Aarch64Windows,
        Self::Darwin64,
        Self::Linux32,
        Self::Linux64,
        Self::Win32,
        Self::Win64,
    ];

    /// This program's platform, if FMI 2.0 has a folder for it.
    #[must_use]
    pub fn host() -> Option<Self> {
        let format = Format::host()?;
        let own = Architecture::host()?;
        let is_own = |platform: &Self| platform.format() == format && platform.architectures().contains(&own);
        // On macOS the folder that other importers use, too.
        Self::ALL.into_iter().filter(is_own).max()
    }

    /// The platform's folder in `binaries/` in FMI 2.0, its library format, and the processors of its libraries.
    fn row(self) -> (&'static str, Format, &'static [Architecture]) {
        use Architecture::{Aarch64, X86, X86_64};
        match self {
            Self::Aarch64Darwin => ("aarch64-darwin", Format::MachO, &[Aarch64]),
            Self::Aarch64Linux => ("aarch64-linux", Format::Elf, &[Aarch64]),
            Self::Aarch64Windows => ("aarch64-windows", Format::Pe, &[Aarch64]),
            Self::Darwin64 => ("darwin64", Format::MachO, &[X86_64, Aarch64]),
            Self::Linux32 => ("linux32", Format::Elf, &[X86]),
            Self::Linux64 => ("linux64", Format::Elf, &[X86_64]),
            Self::Win32 => ("win32", Format::Pe, &[X86]),
            Self::Win64 => ("win64", Format::Pe, &[X86_64]),
        }
    }

    /// The platform's folder in `binaries/` in FMI 2.0.
    #[must_use]
    pub fn folder(self) -> &'static str {
        self.row().0
    }

    /// The platform's library format.
    #[must_use]
    pub fn format(self) -> Format {
        self.row().1
    }

    /// The processors of the platform's libraries.
    #[must_use]
    pub fn architectures(self) -> &'static [Architecture] {
        self.row().2
    }

    /// The FMI 3.0 folder in `binaries/` (section 2.5.1.4.1) for one of the platform's processors: the platform tuple.
    #[must_use]
    pub fn tuple(self, architecture: Architecture) -> String {
        format!("{}-{}", architecture.tuple(), self.format().row()[3])
    }

    /// The platform of a folder in `binaries/` of an FMU of FMI 2.0 or 3.0.
    #[must_use]
    pub fn of_folder(folder: &str, version: Version) -> Option<Self> {
        Self::ALL.into_iter().find(|platform| match version {
            Version::Two => platform.folder() == folder,
            Version::Three => platform.is_tuple(folder),
        })
    }

    /// Whether a text is the platform tuple for one of its processors.
    fn is_tuple(self, text: &str) -> bool {
        self.architectures().iter().any(|&architecture| self.tuple(architecture) == text)
    }

    /// The path of the library for this program's processor in an FMU of FMI 2.0 or 3.0.
    #[must_use]
    pub fn library_path(self, model_identifier: &str, version: Version) -> String {
        self.path_in(&self.folder_for_host(version), model_identifier)
    }

    /// The platform's folder in `binaries/` of an FMU of FMI 2.0 or 3.0 for this program's processor.
    #[must_use]
    pub fn folder_for_host(self, version: Version) -> String {
        let own = Architecture::host()
            .filter(|own| version == Version::Three && self.architectures().contains(own));
        own.map_or_else(|| self.folder().to_owned(), |own| self.tuple(own))
    }

    /// Whether an importer for this platform has a use for a file of an FMU: any but the libraries for another platform,
    /// the sources and the documentation.
    #[must_use]
    pub fn needs(self, path: &str) -> bool {
        let (top, below) = path.split_once('/').unwrap_or((path, ""));
        let folder = below.split('/').next().unwrap_or_default();
        match top {
            "sources" | "documentation" => false,
            "binaries" => {
                Version::ALL.into_iter().any(|version| self.folder_for_host(version) == folder)
                    || folder.parse::<Self>().is_err()
            }
            _ => true,
        }
    }

    /// The path of a library in a folder of `binaries/`.
    pub(crate) fn path_in(self, folder: &str, model_identifier: &str) -> String {
        format!("binaries/{folder}/{model_identifier}.{}", self.format().suffix())
    }
}

/// Reads a platform from its folder in FMI 2.0, or its platform tuple.
impl FromStr for Platform {
    type Err = io::Error;

    fn from_str(folder: &str) -> io::Result<Self> {
        Version::ALL.into_iter().find_map(|version| Self::of_folder(folder, version)).ok_or_else(|| {
            let known = Self::ALL.map(Self::folder).join(", ");
            let message = format!("FMI 2.0 has no platform '{folder}'; it has {known}");
            io::Error::new(io::ErrorKind::InvalidInput, message)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_platforms_libraries_and_what_is_for_people_are_not_needed() {
        for platform in Platform::ALL {
            for own in Version::ALL.map(|version| platform.library_path("a", version)) {
                assert!(platform.needs(&own), "{own}");
            }
            for path in
                ["modelDescription.xml", "resources/sources/a.c", "extra/a", "binaries/", "binaries/data/a"]
            {
                assert!(platform.needs(path), "{path}");
            }
            for path in ["sources/a.c", "documentation/index.html"] {
                assert!(!platform.needs(path), "{path}");
            }
        }
        for folder in ["win64", "darwin64", "aarch64-darwin"] {
            assert!(!Platform::Linux64.needs(&format!("binaries/{folder}/a")), "{folder}");
        }
    }
}
