//! `documentation/licenses/` of an FMU (FMI 2.0.5, section 2.3): the licenses of the model and of everything linked
//! into its libraries, as reported by cargo for any model.
//!
//! `license.txt`, the standard's entry point, lists the packages and contains their texts. The notices of Rust's
//! standard library, which differ between compilers, are in a separate file.

use std::collections::{BTreeMap, BTreeSet};
use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};
use fmu_io::reading;

use super::compile::Compiled;
use super::metadata::Package;
use super::metadata::cargo;
use super::target::Build;

/// The folder of the licenses in the archive.
const FOLDER: &str = "documentation/licenses";

/// How the names of license files begin, in capital letters.
const NAMES: [&str; 6] = ["COPYING", "COPYRIGHT", "LICENCE", "LICENSE", "NOTICE", "UNLICENSE"];

/// The notices of Rust's standard library in a toolchain's folder `share/doc`: Rust's own, and those of Debian's
/// packages.
const STANDARD_LIBRARY: [&str; 3] =
    ["rust/COPYRIGHT-library.html", "libstd-rust-dev/copyright", "libstd-rust-web-dev/copyright"];

/// A package linked into a library.
#[derive(Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Linked {
    /// The package's name and version.
    name: String,
    /// The terms in the package's manifest.
    terms: String,
    /// Where the package's sources are published, if anywhere.
    repository: String,
}

/// The files for a model's FMU, built from a package.
///
/// # Errors
/// When cargo or rustc fail, or a license cannot be read.
pub fn files(model: &str, package: &Package, built: &[(Build, Compiled)]) -> Result<Vec<(String, Vec<u8>)>> {
    let mut texts = BTreeMap::new();
    for (build, compiled) in built {
        for package in linked(package, build)? {
            let folder = compiled.folder(&package.name);
            let folder = folder.with_context(|| format!("cargo compiled no {}", package.name))?;
            let files = texts_of(folder)?;
            texts.insert(package, files);
        }
    }
    let rust = standard_library()?;
    let license = license(model, &texts, rust.is_some());
    let mut files = vec![(format!("{FOLDER}/license.txt"), license.into_bytes())];
    files.extend(rust.map(|(file, notices)| (format!("{FOLDER}/{file}"), notices)));
    Ok(files)
}

/// What is linked into a package's library: its run-time dependencies, without build dependencies such as build
/// scripts and procedural macros.
fn linked(package: &Package, build: &Build) -> Result<BTreeSet<Linked>> {
    let mut cargo = cargo();
    cargo.args(["tree", "--edges", "normal,no-proc-macro", "--prefix", "none"]);
    cargo.arg("--manifest-path").arg(&package.manifest_path);
    cargo.args(["--format", "{p}\t{l}\t{r}"]);
    if let Some(triple) = build.triple() {
        cargo.args(["--target", triple]);
    }
    let tree = output(cargo)?;
    Ok(tree.lines().filter_map(Linked::parse).collect())
}

impl Linked {
    /// Parses a line of cargo's tree: name, version with a `v`, and other properties of the package; its terms; its
    /// repository.
    fn parse(line: &str) -> Option<Self> {
        let mut columns = line.split('\t');
        let (name, rest) = columns.next()?.split_once(" v")?;
        let version = rest.split(' ').next()?;
        let mut next = || columns.next().unwrap_or_default().trim_end_matches(" (*)").to_owned();
        Some(Self { name: format!("{name} {version}"), terms: next(), repository: next() })
    }
}

/// The licenses in a package's folder, by file name; if none, those of its workspace.
fn texts_of(folder: &Path) -> Result<BTreeMap<String, String>> {
    let texts = texts_in(folder)?;
    if !texts.is_empty() {
        return Ok(texts);
    }
    let mut cargo = cargo();
    cargo.args(["locate-project", "--workspace", "--message-format", "plain", "--manifest-path"]);
    cargo.arg(folder.join("Cargo.toml"));
    let workspace = PathBuf::from(output(cargo)?.trim());
    texts_in(workspace.parent().unwrap_or(folder))
}

/// The licenses in a folder, by file name.
fn texts_in(folder: &Path) -> Result<BTreeMap<String, String>> {
    let failed = || format!("cannot read the folder {}", folder.display());
    let mut texts = BTreeMap::new();
    for entry in fs::read_dir(folder).with_context(failed)? {
        let path = entry.with_context(failed)?.path();
        if let Some(name) = path.file_name().and_then(|name| name.to_str())
            && NAMES.iter().any(|begin| name.to_uppercase().starts_with(begin))
            && path.is_file()
        {
            let bytes = reading::bytes(&path)?;
            // The bytes are the same wherever the sources were checked out.
            let text = String::from_utf8_lossy(&bytes).replace("\r\n", "\n");
            texts.insert(name.to_owned(), text.trim_end().to_owned());
        }
    }
    Ok(texts)
}

/// The text of `license.txt`. Texts shared by several packages appear once.
fn license(
    model: &str,
    packages: &BTreeMap<Linked, BTreeMap<String, String>>,
    has_notices_of_rust: bool,
) -> String {
    let mut license = format!("The licenses of {model} and of everything linked into its libraries\n\n");
    for (Linked { name, terms, repository }, texts) in packages {
        let terms = if terms.is_empty() { "no terms given" } else { terms };
        license += &format!("- {name}: {terms}");
        if !repository.is_empty() {
            license += &format!(", {repository}");
        }
        license += if texts.is_empty() { "; no license text included\n" } else { "\n" };
    }
    license += "- the standard library of Rust: MIT OR Apache-2.0; its notices are ";
    license += if has_notices_of_rust {
        "in the same folder, named after the compiler\n"
    } else {
        "at https://github.com/rust-lang/rust\n"
    };

    let mut owners: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for (package, texts) in packages {
        for (file, text) in texts {
            owners.entry(text).or_default().push(format!("{}, {file}", package.name));
        }
    }
    let mut owners: Vec<_> = owners.into_iter().collect();
    owners.sort_by(|(_, first), (_, second)| first.cmp(second));
    let line = "-".repeat(80);
    for (text, owners) in owners {
        license += &format!("\n{line}\n{}\n{line}\n\n{text}\n", owners.join("\n"));
    }
    license
}

/// The notices of the standard library and their file name, as shipped with the compiler.
fn standard_library() -> Result<Option<(String, Vec<u8>)>> {
    let rustc = || Command::new(env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()));
    let (mut version, mut sysroot) = (rustc(), rustc());
    version.arg("--version");
    sysroot.args(["--print", "sysroot"]);
    let version = output(version)?;
    let version = version.split(' ').nth(1).context("rustc does not report its version")?;
    let documents = Path::new(output(sysroot)?.trim()).join("share/doc");
    let Some(file) = STANDARD_LIBRARY.iter().map(|file| documents.join(file)).find(|file| file.is_file())
    else {
        return Ok(None);
    };
    let extension = if file.extension().is_some() { "html" } else { "txt" };
    let notices = reading::bytes(&file)?;
    Ok(Some((format!("rust-{version}.{extension}"), notices)))
}

/// A command's output.
fn output(mut command: Command) -> Result<String> {
    let name = command.get_program().display().to_string();
    let output = command.output().with_context(|| format!("cannot run {name}"))?;
    if !output.status.success() {
        bail!("{name} fails: {}", String::from_utf8_lossy(&output.stderr).trim());
    }
    String::from_utf8(output.stdout).with_context(|| format!("the output of {name} is not text"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn package(name: &str, terms: &str) -> Linked {
        Linked { name: name.to_owned(), terms: terms.to_owned(), repository: String::new() }
    }

    #[test]
    fn lines_of_the_tree_are_packages() {
        let line = "lag v0.1.0 (/home/lag)\tMIT\t";
        assert_eq!(Linked::parse(line), Some(package("lag 0.1.0", "MIT")));
        let line = "num-dual v0.15.1\tMIT OR Apache-2.0\thttps://github.com/itt-ustutt/num-dual (*)";
        let repository = "https://github.com/itt-ustutt/num-dual".to_owned();
        assert_eq!(
            Linked::parse(line),
            Some(Linked { repository, ..package("num-dual 0.15.1", "MIT OR Apache-2.0") })
        );
        assert_eq!(Linked::parse(""), None);
    }

    #[test]
    fn a_license_of_several_packages_is_listed_once() {
        let texts = |files: &[(&str, &str)]| {
            files.iter().map(|&(file, text)| (file.to_owned(), text.to_owned())).collect()
        };
        let packages = BTreeMap::from([
            (package("lag 0.1.0", ""), texts(&[])),
            (
                package("one 1.0.0", "MIT OR Apache-2.0"),
                texts(&[("LICENSE-A", "apache"), ("LICENSE-M", "mit")]),
            ),
            (package("two 2.0.0", "Apache-2.0"), texts(&[("COPYING", "apache")])),
        ]);
        let line = "-".repeat(80);
        let expected = format!(
            "The licenses of Lag and of everything linked into its libraries\n\n\
             - lag 0.1.0: no terms given; no license text included\n\
             - one 1.0.0: MIT OR Apache-2.0\n\
             - two 2.0.0: Apache-2.0\n\
             - the standard library of Rust: MIT OR Apache-2.0; its notices are in the same folder, named after \
             the compiler\n\n\
             {line}\none 1.0.0, LICENSE-A\ntwo 2.0.0, COPYING\n{line}\n\napache\n\n\
             {line}\none 1.0.0, LICENSE-M\n{line}\n\nmit\n"
        );
        assert_eq!(license("Lag", &packages, true), expected);
    }
}
