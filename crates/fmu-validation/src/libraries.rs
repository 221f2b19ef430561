//! Rules on an FMU's libraries. They are read, never loaded.

use std::collections::BTreeSet;

use fmu_package::archive::Files;
use fmu_package::library::{Library, Linkage, missing_in_words};
use fmu_package::{Architecture, Format, Platform};
use fmu_terms::{Interface, Version, Word};

use crate::model::Model;
use crate::report::{Place, Report};
use crate::rules::{
    LIBRARY_DEPENDENCY, LIBRARY_FORMAT, LIBRARY_FUNCTION, LIBRARY_GUID, LIBRARY_LOADING, LIBRARY_MISSING,
    LIBRARY_NAME, LIBRARY_PLATFORM, LIBRARY_PYTHON,
};

/// The libraries of Linux systems: those of glibc and GCC.
const OF_LINUX: &[&str] = &[
    "ld-linux",
    "libc.so",
    "libdl.so",
    "libgcc_s.so",
    "libm.so",
    "libpthread.so",
    "librt.so",
    "libstdc++.so",
    "linux-vdso",
    "libatomic.so",
    "libgomp.so",
    "libmvec.so",
    "libresolv.so",
    "libutil.so",
];

pub(crate) fn check(model: &Model<'_>, files: &mut Files, report: &mut Report) {
    let paths: Vec<_> =
        files.paths().filter(|path| path.starts_with("binaries/")).map(str::to_owned).collect();
    let is_library =
        |path: &str| [".so", ".dll", ".dylib", ".a", ".lib"].iter().any(|suffix| path.ends_with(suffix));
    let has_sources = files.paths().any(|path| path.starts_with("sources/"));
    if !has_sources && !paths.iter().any(|path| is_library(path)) {
        report.add(&LIBRARY_MISSING, Place::default(), "it has neither libraries nor sources");
    }
    let folders: BTreeSet<_> =
        paths.iter().filter_map(|path| Some(path.split_once('/')?.1.split_once('/')?.0)).collect();
    for folder in folders {
        let below = format!("binaries/{folder}/");
        let Some((format, architecture)) = platform(folder, model.version) else {
            report.add(&LIBRARY_PLATFORM, Place::file(below), "the standard has no platform of this name");
            continue;
        };
        let inside: Vec<_> = paths.iter().filter_map(|path| path.strip_prefix(&below)).collect();
        // Libraries for static linking have other names.
        if !inside.iter().any(|name| name.ends_with(format.suffix()))
            && inside.iter().any(|name| is_library(name))
        {
            continue;
        }
        for identifier in model.identifiers() {
            let path = format!("{below}{identifier}.{}", format.suffix());
            if let Some(bytes) = files.bytes(&path) {
                library(model, identifier, &bytes, &path, (format, architecture), &inside, report);
            } else if !files.contains(&path) {
                let message =
                    format!("there is no {identifier}.{}, but {}", format.suffix(), inside.join(", "));
                report.add(&LIBRARY_NAME, Place::file(&*below), message);
            }
        }
    }
}

/// A platform folder's format, and its processor, if known here.
fn platform(folder: &str, version: Version) -> Option<(Format, Option<&'static [Architecture]>)> {
    let of_fmi2 = Platform::of_folder(folder, Version::Two)
        .filter(|_| version < Version::Three || folder.contains('-'));
    if let Some(platform) = of_fmi2 {
        return Some((platform.format(), Some(platform.architectures())));
    }
    let (processor, system) = folder.split_once('-')?;
    let format = match system.split('-').next()? {
        "linux" => Format::Elf,
        "darwin" => Format::MachO,
        "windows" => Format::Pe,
        _ => return None,
    };
    let architecture: Option<&[Architecture]> = match processor {
        "x86" => Some(&[Architecture::X86]),
        "x86_64" => Some(&[Architecture::X86_64]),
        "aarch64" => Some(&[Architecture::Aarch64]),
        _ => None,
    };
    Some((format, architecture))
}

fn library(
    model: &Model<'_>,
    identifier: &str,
    bytes: &[u8],
    path: &str,
    (format, architectures): (Format, Option<&[Architecture]>),
    beside: &[&str],
    report: &mut Report,
) {
    let mut wrong = |rule, message: String| report.add(rule, Place::file(path), message);
    if let Some(architectures) = architectures {
        match Library::read(bytes) {
            Err(error) => return wrong(&LIBRARY_FORMAT, error.to_string()),
            Ok(library)
                if library.format != format
                    || !library.architectures.iter().any(|processor| architectures.contains(processor)) =>
            {
                return wrong(&LIBRARY_FORMAT, format!("it is {library}, which is not for this folder"));
            }
            Ok(_) => {}
        }
    }
    let slices = match Linkage::read(bytes) {
        Ok(slices) => slices,
        Err(error) => return wrong(&LIBRARY_FORMAT, error.to_string()),
    };
    let interfaces =
        model.interfaces.iter().filter(|own| own.attribute("modelIdentifier") == Some(identifier));
    let interfaces: Vec<_> = interfaces.filter_map(|own| Interface::of(own.tag_name().name())).collect();
    for linkage in slices {
        let missing = linkage.missing_functions(model.version, &interfaces);
        if !missing.is_empty() {
            wrong(&LIBRARY_FUNCTION, missing_in_words(&missing));
        }
        if let Some(reason) = linkage.is_refused_for {
            wrong(&LIBRARY_LOADING, format!("it has {reason}"));
        }
        let links_to_python = linkage.libraries.iter().any(|name| name.to_lowercase().contains("python"));
        let python = linkage.imports.iter().find(|name| name.starts_with("_Py") || name.starts_with("Py"));
        if let Some(symbol) = python.filter(|_| !links_to_python) {
            wrong(&LIBRARY_PYTHON, format!("it needs {symbol}, which no library it depends on has"));
        }
        for name in linkage.libraries.iter().filter(|_| format == Format::Elf) {
            let is_of_system = OF_LINUX.iter().any(|known| name.starts_with(known));
            if !is_of_system && !beside.contains(&name.as_str()) {
                wrong(&LIBRARY_DEPENDENCY, format!("it depends on {name}"));
            }
        }
    }
    let guid = model
        .root
        .attribute("guid")
        .or_else(|| model.root.attribute("instantiationToken"))
        .unwrap_or_default();
    let is_ours = model.root.attribute("generationTool").is_some_and(|tool| tool.starts_with("fmu-export"));
    if is_ours && !guid.is_empty() && !bytes.windows(guid.len()).any(|window| window == guid.as_bytes()) {
        wrong(&LIBRARY_GUID, format!("it does not contain the GUID {guid}"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_named_as_in_each_version() {
        let known = |folder, version| platform(folder, version).is_some();
        for (folder, versions) in [
            ("linux64", [true, false]),
            ("x86_64-linux", [true, true]),
            ("aarch64-darwin", [true, true]),
            ("riscv64-linux", [true, true]),
            ("x86_64-windows-msvc140mt", [true, true]),
            ("windows", [false, false]),
        ] {
            let found = Version::ALL.map(|version| known(folder, version));
            assert_eq!(found, versions, "{folder}");
        }
    }
}
