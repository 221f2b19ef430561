//! A model's library as a file: its platform and requirements.
//!
//! The file is not trusted: only its headers are read, and anything but a library is rejected.

use std::collections::BTreeSet;
use std::fmt::{self, Display};
use std::fs;
use std::io;

use fmu_io::reading::broken;
use fmu_terms::{Interface, Version};
use object::read::NameOrOrdinal;
use object::read::elf::{ElfFile, FileHeader, ProgramHeader};
use object::read::macho::{FatArch, MachHeader, MachOFatFile32, MachOFatFile64, MachOFile};
use object::{Endianness, File, FileKind, Object, ObjectKind, ObjectSegment, ReadCache, ReadRef, elf, macho};

use crate::functions::exported_functions;
use crate::platform::{Architecture, Format, Platform};

/// A library's platform.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Library {
    /// The binary's format, from its header.
    pub format: Format,
    /// The library's processors: several in a universal macOS library.
    pub architectures: Vec<Architecture>,
    /// The oldest version of glibc (ELF) or macOS (Mach-O) that it runs on, if known.
    pub oldest_system: Option<Vec<u32>>,
}

impl Library {
    /// Reads the headers of a library.
    ///
    /// # Errors
    /// When it is not a shared library, or is for unsupported systems and processors.
    pub fn read(bytes: &[u8]) -> io::Result<Self> {
        let slices = slices(bytes).map_err(unreadable)?;
        let mut slices = slices.into_iter().map(Self::read_slice);
        let mut library = slices.next().ok_or_else(|| broken("it is an empty universal library"))??;
        for slice in slices {
            let slice = slice?;
            library.architectures.extend(slice.architectures);
            library.oldest_system = library.oldest_system.max(slice.oldest_system);
        }
        library.architectures.sort();
        Ok(library)
    }

    /// Reads a library for a single processor.
    fn read_slice(bytes: &[u8]) -> io::Result<Self> {
        let file = whole(bytes).map_err(unreadable)?;
        if file.kind() != ObjectKind::Dynamic {
            return Err(broken("it is not a shared library"));
        }
        let architecture = match file.architecture() {
            object::Architecture::Aarch64 => Architecture::Aarch64,
            object::Architecture::I386 => Architecture::X86,
            object::Architecture::X86_64 => Architecture::X86_64,
            other => return Err(broken(format!("its processor {other:?} is not supported"))),
        };
        let (format, oldest_system) = match &file {
            File::Elf32(file) => (Format::Elf, glibc(file)),
            File::Elf64(file) => (Format::Elf, glibc(file)),
            File::MachO32(file) => (Format::MachO, macos(file)),
            File::MachO64(file) => (Format::MachO, macos(file)),
            File::Pe32(_) | File::Pe64(_) => (Format::Pe, Ok(None)),
            _ => return Err(broken("it is not a shared library")),
        };
        let oldest_system = oldest_system.map_err(unreadable)?;
        Ok(Self { format, architectures: vec![architecture], oldest_system })
    }

    /// Rejects a library in the wrong platform's folder.
    ///
    /// # Errors
    /// When its format or a processor differs.
    pub fn fits(&self, platform: Platform) -> io::Result<()> {
        let is_for_it = |architecture| platform.architectures().contains(architecture);
        if self.format == platform.format() && self.architectures.iter().all(is_for_it) {
            return Ok(());
        }
        Err(broken(format!(
            "it is {} for {}; {} requires {} for {}",
            self.format.name(),
            names(&self.architectures, " and "),
            platform.folder(),
            platform.format().name(),
            names(platform.architectures(), " or ")
        )))
    }

    /// The library's folders in `binaries/` of an FMU of FMI 2.0 or 3.0 for a platform: in FMI 3.0 one per processor.
    #[must_use]
    pub fn folders(&self, platform: Platform, version: Version) -> Vec<String> {
        if version == Version::Three {
            self.architectures.iter().map(|&architecture| platform.tuple(architecture)).collect()
        } else {
            vec![platform.folder().to_owned()]
        }
    }
}

/// The library's platform, as in `ELF for x86-64, glibc 2.17 or later`.
impl Display for Library {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} for {}", self.format.name(), names(&self.architectures, " and "))?;
        let Some(numbers) = &self.oldest_system else { return Ok(()) };
        let system = if self.format == Format::MachO { "macOS" } else { "glibc" };
        let version = numbers.iter().map(u32::to_string).collect::<Vec<_>>().join(".");
        write!(formatter, ", {system} {version} or later")
    }
}

/// The exports and imports of a library for a single processor.
#[derive(Clone, Debug, Default)]
pub struct Linkage {
    /// The exported symbols, without macOS's leading underscore.
    pub exports: BTreeSet<String>,
    /// The imported symbols.
    pub imports: BTreeSet<String>,
    /// The libraries on which the library depends.
    pub libraries: BTreeSet<String>,
    /// The reason why hardened loaders reject the library: relocations in the code, or an executable stack (ELF).
    pub is_refused_for: Option<&'static str>,
}

impl Linkage {
    /// Reads the tables of a library, or of each in a universal one.
    ///
    /// # Errors
    /// When it is not a library, or a table is damaged.
    pub fn read(bytes: &[u8]) -> io::Result<Vec<Self>> {
        let slices = slices(bytes).map_err(unreadable)?;
        slices.into_iter().map(|slice| Self::read_slice(slice).map_err(unreadable)).collect()
    }

    /// The functions of a version that it does not export for the interfaces of its model identifier.
    #[must_use]
    pub fn missing_functions(&self, version: Version, interfaces: &[Interface]) -> Vec<&'static str> {
        exported_functions(version, interfaces).filter(|name| !self.exports.contains(*name)).collect()
    }

    fn read_slice(bytes: &[u8]) -> object::Result<Self> {
        let file = File::parse(bytes)?;
        let mut linkage = Self::default();
        let plain = |name: &[u8]| {
            let name = String::from_utf8_lossy(name);
            match &file {
                File::MachO32(_) | File::MachO64(_) => name.strip_prefix('_').unwrap_or(&name).to_owned(),
                _ => name.into_owned(),
            }
        };
        for export in file.exports()? {
            if let NameOrOrdinal::Name(name) = export?.name() {
                linkage.exports.insert(plain(name));
            }
        }
        for import in file.imports()? {
            if let NameOrOrdinal::Name(name) = import?.name() {
                linkage.imports.insert(plain(name));
            }
        }
        for library in file.import_libraries()? {
            linkage.libraries.insert(String::from_utf8_lossy(library?.name()).into_owned());
        }
        linkage.is_refused_for = match &file {
            File::Elf32(file) => refused_for(file)?,
            File::Elf64(file) => refused_for(file)?,
            _ => None,
        };
        Ok(linkage)
    }
}

/// [Missing functions](Linkage::missing_functions) as a message.
#[must_use]
pub fn missing_in_words(missing: &[&str]) -> String {
    const MOST_NAMED: usize = 5;
    let shown = missing[..missing.len().min(MOST_NAMED)].join(", ");
    let more = if missing.len() > MOST_NAMED { " \u{2026}" } else { "" };
    format!("it does not export {} functions: {shown}{more}", missing.len())
}

fn refused_for<Elf>(file: &ElfFile<'_, Elf>) -> object::Result<Option<&'static str>>
where
    Elf: FileHeader<Endian = Endianness>,
{
    let endian = file.endian();
    let table = file.elf_section_table().dynamic_table(endian, file.data())?;
    let has_text_relocations = table.iter().any(|entry| {
        entry.tag == elf::DT_TEXTREL || entry.tag == elf::DT_FLAGS && entry.val & elf::DF_TEXTREL.0 != 0
    });
    let has_executable_stack = file.elf_program_headers().iter().any(|header| {
        header.p_type(endian) == elf::PT_GNU_STACK && header.p_flags(endian).contains(elf::PF_X)
    });
    Ok(match (has_text_relocations, has_executable_stack) {
        (true, _) => Some("text relocations"),
        (_, true) => Some("an executable stack"),
        _ => None,
    })
}

fn names(architectures: &[Architecture], between: &str) -> String {
    architectures.iter().map(|architecture| architecture.name()).collect::<Vec<_>>().join(between)
}

/// Where the libraries in a universal one begin, or the library itself, and their sizes.
fn parts<'a, R: ReadRef<'a>>(library: R) -> object::Result<Vec<(u64, u64)>> {
    fn all(arches: &[impl FatArch]) -> Vec<(u64, u64)> {
        arches.iter().map(FatArch::file_range).collect()
    }
    Ok(match FileKind::parse(library)? {
        FileKind::MachOFat32 => all(MachOFatFile32::parse(library)?.arches()),
        FileKind::MachOFat64 => all(MachOFatFile64::parse(library)?.arches()),
        _ => vec![(0, library.len().unwrap_or_default())],
    })
}

/// The libraries in a universal one, or the library itself; one that is not there is empty.
fn slices(bytes: &[u8]) -> object::Result<Vec<&[u8]>> {
    let slice = |(begin, size)| bytes.read_bytes_at(begin, size).unwrap_or_default();
    Ok(parts(bytes)?.into_iter().map(slice).collect())
}

/// A library, after checking that all loaded parts are present.
fn whole<'a, R: ReadRef<'a>>(library: R) -> Result<File<'a, R>, String> {
    let file = File::parse(library).map_err(|error| error.to_string())?;
    let length = library.len().unwrap_or_default();
    let is_there =
        |(begin, size): (u64, u64)| size == 0 || begin.checked_add(size).is_some_and(|end| end <= length);
    if !file.segments().all(|segment| is_there(segment.file_range())) {
        return Err("a segment is missing".to_owned());
    }
    Ok(file)
}

/// Rejects a truncated library: loading it kills the process at the first access to the missing part (SIGBUS on Unix).
/// Reads the headers only.
///
/// # Errors
/// When it is truncated. The system itself rejects files that are not libraries.
pub fn refuse_cut_short(library: fs::File) -> io::Result<()> {
    let library = ReadCache::new(library);
    let is_library =
        FileKind::parse(&library).is_ok_and(|kind| !matches!(kind, FileKind::Coff | FileKind::CoffBig));
    if !is_library {
        return Ok(());
    }
    parts(&library)
        .map_err(|error| error.to_string())
        .and_then(|parts| {
            parts.into_iter().try_for_each(|(begin, size)| whole(library.range(begin, size)).map(drop))
        })
        .map_err(|error| broken(format!("it is damaged or cut short: {error}")))
}

/// The oldest glibc version with all imported symbols.
fn glibc<Elf>(file: &ElfFile<'_, Elf>) -> object::Result<Option<Vec<u32>>>
where
    Elf: FileHeader<Endian = Endianness>,
{
    let (endian, sections) = (file.endian(), file.elf_section_table());
    let Some((mut files, strings)) = sections.gnu_verneed(endian, file.data())? else { return Ok(None) };
    let strings = sections.strings(endian, file.data(), strings)?;
    let mut newest: Option<Vec<u32>> = None;
    while let Some((_, mut versions)) = files.next()? {
        while let Some(version) = versions.next()? {
            let name = String::from_utf8_lossy(version.name(endian, strings)?);
            let numbers = name.strip_prefix("GLIBC_").map(|version| version.split('.').map(str::parse));
            // Private versions have no numbers.
            if let Some(Ok(numbers)) = numbers.map(Iterator::collect) {
                newest = newest.max(Some(numbers));
            }
        }
    }
    Ok(newest)
}

/// The macOS version for which a library was linked.
fn macos<Mach: MachHeader>(file: &MachOFile<'_, Mach>) -> object::Result<Option<Vec<u32>>> {
    let mut commands = file.macho_load_commands()?;
    while let Some(command) = commands.next()? {
        if let Some((build, _)) = command.build_version(file.endian())?
            && build.platform.get(file.endian()) == macho::PLATFORM_MACOS
        {
            let macho::Version(version) = build.minos.get(file.endian());
            return Ok(Some(vec![version >> 16, version >> 8 & 0xff]));
        }
    }
    Ok(None)
}

/// Joins macOS libraries for different processors into a universal one.
///
/// # Errors
/// When one is not such a library, or two are for the same processor.
pub fn join(libraries: &[&[u8]]) -> io::Result<Vec<u8>> {
    // Each begins at a page of arm64, the larger ones.
    const PAGE: u32 = 1 << 14;
    let mut parts = vec![];
    for &library in libraries {
        for part in slices(library).map_err(unreadable)? {
            let &[0xce | 0xcf, 0xfa, 0xed, 0xfe, a, b, c, d, e, f, g, h, ..] = part else {
                return Err(broken("they cannot be joined: one is no library of macOS"));
            };
            parts.push((u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]), part));
        }
    }
    parts.sort();
    if parts.windows(2).any(|pair| pair[0].0 == pair[1].0 && pair[0].1 == pair[1].1) {
        return Err(broken("they cannot be joined: two are for the same processor"));
    }
    let too_large = |_| broken("they cannot be joined: they are too large");
    let number_of = |count: usize| u32::try_from(count).map_err(too_large);
    let mut header = [macho::FAT_MAGIC, number_of(parts.len())?].map(u32::to_be_bytes).concat();
    let mut content = vec![];
    for (processor, kind, part) in parts {
        content.resize(content.len().next_multiple_of(PAGE as usize), 0);
        let begin = number_of(PAGE as usize + content.len())?;
        let entry = [processor, kind, begin, number_of(part.len())?, PAGE.trailing_zeros()];
        header.extend(entry.map(u32::to_be_bytes).concat());
        content.extend(part);
    }
    header.resize(PAGE as usize, 0);
    Ok([header, content].concat())
}

fn unreadable(error: impl Display) -> io::Error {
    broken(format!("it is not a shared library: {error}"))
}
