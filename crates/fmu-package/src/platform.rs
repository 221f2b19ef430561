//! The platforms of an FMU's libraries: their folders and formats (FMI 2.0.5, section 2.3).
//!
//! The standard names folders for x86. For other processors it refers to FMI 3.0's platform tuples (section 2.5.1.4.1
//! there).

use std::io;
use std::str::FromStr;

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
    /// The suffix of a library's file.
    #[must_use]
    pub fn suffix(self) -> &'static str {
        match self {
            Self::Elf => "so",
            Self::MachO => "dylib",
            Self::Pe => "dll",
        }
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Elf => "ELF",
            Self::MachO => "Mach-O",
            Self::Pe => "PE",
        }
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
        match std::env::consts::ARCH {
            "aarch64" => Some(Self::Aarch64),
            "x86" => Some(Self::X86),
            "x86_64" => Some(Self::X86_64),
            _ => None,
        }
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Aarch64 => "aarch64",
            Self::X86 => "x86",
            Self::X86_64 => "x86-64",
        }
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
        match (std::env::consts::OS, std::env::consts::ARCH) {
            ("macos", "x86_64" | "aarch64") => Some(Self::Darwin64),
            ("linux", "aarch64") => Some(Self::Aarch64Linux),
            ("linux", "x86") => Some(Self::Linux32),
            ("linux", "x86_64") => Some(Self::Linux64),
            ("windows", "aarch64") => Some(Self::Aarch64Windows),
            ("windows", "x86") => Some(Self::Win32),
            ("windows", "x86_64") => Some(Self::Win64),
            _ => None,
        }
    }

    /// Its folder in `binaries/` in FMI 2.0.
    #[must_use]
    pub fn folder(self) -> &'static str {
        match self {
            Self::Aarch64Darwin => "aarch64-darwin",
            Self::Aarch64Linux => "aarch64-linux",
            Self::Aarch64Windows => "aarch64-windows",
            Self::Darwin64 => "darwin64",
            Self::Linux32 => "linux32",
            Self::Linux64 => "linux64",
            Self::Win32 => "win32",
            Self::Win64 => "win64",
        }
    }

    /// Its folder in `binaries/` in FMI 3.0 (section 2.5.1.4.1), for one of its processors: the platform tuple.
    #[must_use]
    pub fn tuple(self, architecture: Architecture) -> String {
        let processor = match architecture {
            Architecture::Aarch64 => "aarch64",
            Architecture::X86 => "x86",
            Architecture::X86_64 => "x86_64",
        };
        let system = match self.format() {
            Format::MachO => "darwin",
            Format::Elf => "linux",
            Format::Pe => "windows",
        };
        format!("{processor}-{system}")
    }

    /// The platform of a folder in `binaries/` of an FMU of FMI 2.0 or 3.0.
    #[must_use]
    pub fn of_folder(folder: &str, is_fmi3: bool) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|platform| if is_fmi3 { platform.is_tuple(folder) } else { platform.folder() == folder })
    }

    /// Whether a text is the platform tuple for one of its processors.
    fn is_tuple(self, text: &str) -> bool {
        self.architectures().iter().any(|&architecture| self.tuple(architecture) == text)
    }

    /// Its library format.
    #[must_use]
    pub fn format(self) -> Format {
        match self {
            Self::Aarch64Darwin | Self::Darwin64 => Format::MachO,
            Self::Aarch64Linux | Self::Linux32 | Self::Linux64 => Format::Elf,
            Self::Aarch64Windows | Self::Win32 | Self::Win64 => Format::Pe,
        }
    }

    /// The processors of its libraries.
    #[must_use]
    pub fn architectures(self) -> &'static [Architecture] {
        match self {
            Self::Aarch64Darwin | Self::Aarch64Linux | Self::Aarch64Windows => &[Architecture::Aarch64],
            Self::Darwin64 => &[Architecture::X86_64, Architecture::Aarch64],
            Self::Linux32 | Self::Win32 => &[Architecture::X86],
            Self::Linux64 | Self::Win64 => &[Architecture::X86_64],
        }
    }

    /// The path of the library for this program's processor in an FMU of FMI 2.0 or 3.0.
    #[must_use]
    pub fn library_path(self, model_identifier: &str, is_fmi3: bool) -> String {
        let own = Architecture::host().filter(|own| is_fmi3 && self.architectures().contains(own));
        let folder = own.map_or_else(|| self.folder().to_owned(), |own| self.tuple(own));
        self.path_in(&folder, model_identifier)
    }

    /// The path of a library in a folder of `binaries/`.
    pub(crate) fn path_in(self, folder: &str, model_identifier: &str) -> String {
        format!("binaries/{folder}/{model_identifier}.{}", self.format().suffix())
    }
}

/// From its folder in FMI 2.0, or its platform tuple.
impl FromStr for Platform {
    type Err = io::Error;

    fn from_str(folder: &str) -> io::Result<Self> {
        [false, true].into_iter().find_map(|is_fmi3| Self::of_folder(folder, is_fmi3)).ok_or_else(|| {
            let known = Self::ALL.map(Self::folder).join(", ");
            let message = format!("FMI 2.0 has no platform '{folder}'; it has {known}");
            io::Error::new(io::ErrorKind::InvalidInput, message)
        })
    }
}
