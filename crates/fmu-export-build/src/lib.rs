#![doc = include_str!("../README.md")]

mod assembly;
mod calibration;
mod check;
mod declaration;
mod dependencies;
mod error;
mod flatten;
mod fragment;
mod interfaces;
mod model;
mod names;
mod package;
mod page;
mod resolve;
mod resources;
mod rust;
mod source;
mod start;
mod subscripts;
mod texts;
mod type_names;
mod units;
mod value_type;
mod xml;

use std::env;
use std::fs;
use std::path::{self, Path, PathBuf};
use std::process;

use declaration::Declaration;
use error::{Refusal, Refusals};
use resources::Resources;
use source::Source;
use units::declaration::UnitDeclaration;

pub use error::{Error, Finding};
pub use fmu_terms::{
    INTERFACES_VARIABLE, Interfaces, PRECISION_VARIABLE, Precision, VERSION_VARIABLE, Version,
};
pub use interfaces::{Fmi, chosen_precision};
pub use package::Package;

/// The JSON Schema of a model's declaration, for editors: the file `model.schema.json`.
pub const SCHEMA: &str = include_str!("../schema/model.schema.json");

/// The environment variable with the identifier that is declared, for the message of `fmu!` about a library of another
/// name. Any library of a model needs it.
pub const IDENTIFIER_VARIABLE: &str = "FMU_DECLARED";

/// What [`generate_into`] read and wrote.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Generated {
    /// The files read besides the declaration: units, documentation with its pictures, icon; and the resources folder.
    pub sources: Vec<PathBuf>,
    /// The modelDescription.xml.
    pub model_description: PathBuf,
    /// The typed interface, in the folder of the modelDescription.xml.
    pub variables: PathBuf,
    /// The documentation page, `index.html`, in the folder of the modelDescription.xml.
    pub documentation: PathBuf,
    /// The icon, `model.png`, in the folder of the modelDescription.xml, if declared.
    pub icon: Option<PathBuf>,
    /// The icon as a vector drawing, `model.svg`, beside `model.png`, if there is an SVG of the icon's name.
    pub drawing: Option<PathBuf>,
    /// The terminals, `terminalsAndIcons.xml`, beside the modelDescription.xml, if declared; in FMI 3.0 also for an
    /// icon.
    pub terminals: Option<PathBuf>,
    /// The folder of files that the model reads at run time, `resources`, beside the modelDescription.xml, if declared.
    pub resources: Option<PathBuf>,
    /// The first variable whose name is not a structured name of FMI, if any: it makes the naming convention `flat`.
    pub flat_name: Option<String>,
}

/// Generates a model's interface into the folder of its name in `OUT_DIR`. For build scripts. The environment
/// variables
/// [`VERSION_VARIABLE`], [`INTERFACES_VARIABLE`] and [`PRECISION_VARIABLE`] choose the FMI version, interfaces and precision;
/// the default version is 2.0, or 3.0 if a variable's type needs it.
///
/// If the declaration is rejected, the build fails with an error per finding, with file, line and key.
///
/// # Panics
/// Outside a build script.
pub fn generate(declaration: impl AsRef<Path>) {
    let declaration = declaration.as_ref();
    println!("cargo::rerun-if-changed={}", declaration.display());
    println!("cargo::rerun-if-env-changed={VERSION_VARIABLE}");
    println!("cargo::rerun-if-env-changed={INTERFACES_VARIABLE}");
    println!("cargo::rerun-if-env-changed={PRECISION_VARIABLE}");
    let out_dir = env::var("OUT_DIR").expect("OUT_DIR is set for build scripts only");
    let chosen = Fmi::chosen(declaration, None, None).and_then(|fmi| Ok((fmi, chosen_precision(None)?)));
    let (fmi, precision) = chosen.unwrap_or_else(|reason| {
        println!("cargo::error={reason}");
        end_build();
    });
    let package = Package { precision, ..Package::of_build_script() };
    let generated = generate_into(declaration, Path::new(&out_dir), &package, fmi)
        .and_then(|generated| generated.used_in(Path::new(""), declaration));
    match generated {
        Ok(generated) => {
            let (variable, file) = generated.compiler_variable();
            println!("cargo::rustc-env={variable}={file}");
            println!("cargo::rustc-env={IDENTIFIER_VARIABLE}={}", generated.identifier());
            if let Some(warning) = generated.warning(declaration) {
                println!("cargo::warning={warning}");
            }
            for source in generated.sources {
                println!("cargo::rerun-if-changed={}", source.display());
            }
        }
        Err(error) => {
            for finding in error.findings() {
                println!("cargo::error={}", finding.in_one_line());
            }
            end_build();
        }
    }
}

impl Generated {
    /// The model's identifier.
    #[must_use]
    pub fn identifier(&self) -> &str {
        let folder = self.variables.parent().and_then(Path::file_name);
        folder.and_then(|folder| folder.to_str()).unwrap_or_default()
    }

    /// The environment variable by which `fmu!` finds the interface when the library is compiled: it knows the library's
    /// name, which must equal the identifier.
    #[must_use]
    pub fn compiler_variable(&self) -> (String, String) {
        (format!("FMU_VARIABLES_OF_{}", self.identifier()), self.variables.display().to_string())
    }

    /// What the author should know.
    #[must_use]
    pub fn warning(&self, declaration: &Path) -> Option<String> {
        self.flat_name.as_ref().map(|name| {
            let file = declaration.display();
            format!("{file}: the naming convention is flat, since '{name}' is not a structured name")
        })
    }

    /// This, if the library of a package in a folder uses what a declaration gave: otherwise the compiler would report
    /// every missing type separately.
    ///
    /// # Errors
    /// When no source of the library includes it.
    pub fn used_in(self, package: &Path, declaration: &Path) -> Result<Self, Error> {
        let library = package.join("src/lib.rs");
        if library.is_file() && !uses_generated(&package.join("src")) {
            let reason = format!(
                "nothing uses the variables of {}: write `fmu_export::fmu!(equations NAME);` with the model's type, or \
                 `sampled` or `stepper` instead of `equations`",
                declaration.display()
            );
            return Err(Error::of_file(&library, reason));
        }
        Ok(self)
    }
}

/// Whether a source in a folder includes generated code; true for unreadable ones, which the compiler reports.
fn uses_generated(folder: &Path) -> bool {
    let Ok(entries) = fs::read_dir(folder) else { return true };
    entries.flatten().map(|entry| entry.path()).any(|path| {
        if path.is_dir() {
            return uses_generated(&path);
        }
        path.extension().is_some_and(|extension| extension == "rs")
            && fs::read_to_string(&path).map_or(true, |source| {
                ["fmu!", "include_variables!", "OUT_DIR"].iter().any(|word| source.contains(word))
            })
    })
}

/// Ends the build script after errors, so that cargo fails the build. If the script failed instead, cargo would show
/// its whole output and repeat the errors.
fn end_build() -> ! {
    process::exit(0)
}

/// Generates a model's interface into the folder of its name in another folder.
///
/// # Errors
/// If the declaration or a file that it names cannot be read, if it contradicts itself or FMI, or if the documentation
/// names something that the model does not have.
pub fn generate_into(
    declaration: &Path,
    out_dir: &Path,
    package: &Package,
    fmi: impl Into<Fmi>,
) -> Result<Generated, Error> {
    let file = declaration;
    let fmi = fmi.into().check().map_err(|reason| Error::of_file(file, reason))?;
    let (mut declaration, source) = Source::read::<Declaration>(file)?;
    declaration.complete().map_err(|refusal| source.error([refusal]))?;
    let beside = |key: &str, name: &Option<String>| match name.as_ref().map(|name| file.with_file_name(name))
    {
        Some(named) if !named.is_file() => {
            Err(source.error([Refusal::new(key, format!("there is no file {}", named.display()))]))
        }
        named => Ok(named),
    };
    let units_file = beside("units", &declaration.units)?;
    let units = units_file.as_deref().map(read_units).transpose()?.unwrap_or_default();
    let model =
        assembly::model(&declaration, &units, package, fmi).map_err(|refusals| source.error(refusals))?;
    let structure = dependencies::Structure::new(&model.scalars, model.fmi.version)
        .map_err(|refusal| source.error([refusal]))?;
    let description = xml::Description::new(&model, &structure);
    let read_fragment = |file: PathBuf| fragment::read(&file, &page::variables::anchors(&model));
    let fragment = beside("documentation", &declaration.documentation)?.map(read_fragment).transpose()?;
    let icon_source = beside("icon", &declaration.icon)?;
    let icon = icon_source.as_deref().map(read_icon).transpose()?;
    let drawing_source =
        icon_source.as_ref().map(|icon| icon.with_extension("svg")).filter(|drawing| drawing.is_file());
    let read = |file: &PathBuf| fs::read(file).map_err(|error| Error::of_file(file, error));
    let drawing = drawing_source.as_ref().map(read).transpose()?;
    let resources =
        declaration.resources.as_ref().map(|name| Resources::find(file.with_file_name(name), file));
    let resources =
        resources.transpose().map_err(|reason| source.error([Refusal::new("resources", reason)]))?;
    let page = page::write(&model, &structure, &description.guid, fragment.as_ref());
    let fragment_sources = fragment.map(|fragment| fragment.files).unwrap_or_default();

    let folder = out_dir.join(&model.library);
    fs::create_dir_all(&folder).map_err(|error| Error::of_file(&folder, error))?;
    // Writes a file, or removes that of a previous build. Cargo compiles again what reads a file that was written again.
    let put = |name: &str, content: Option<&[u8]>| {
        let file = folder.join(name);
        let done = match content {
            Some(content) if fs::read(&file).is_ok_and(|written| written == content) => Ok(()),
            Some(content) => fs::write(&file, content),
            None if file.exists() => fs::remove_file(&file),
            None => Ok(()),
        };
        done.map_err(|error| Error::of_file(&file, error)).map(|()| content.map(|_| file))
    };
    let write = |name: &str, content: &str| put(name, Some(content.as_bytes())).map(|_| folder.join(name));
    let shows_icon = icon.is_some() && model.fmi.version == Version::Three;
    let has_terminals = shows_icon || !model.declaration.terminals.is_empty();
    let terminals = has_terminals.then(|| xml::terminals::write(&model));
    let resources_folder = folder.join("resources");
    if resources_folder.exists() {
        // A previous build may have left other files.
        fs::remove_dir_all(&resources_folder).map_err(|error| Error::of_file(&resources_folder, error))?;
    }
    if let Some(resources) = &resources {
        resources.copy_to(&resources_folder)?;
    }
    // Tests read them from any folder.
    let absolute = resources.is_some().then(|| path::absolute(&resources_folder)).transpose();
    let absolute = absolute.map_err(|error| Error::of_file(&resources_folder, error))?;
    let a2l = if model.is_bare_metal {
        let [parameters, measurements] = calibration::cells(&model);
        let a2l = calibration::a2l::write(&model, &parameters, &measurements);
        put("model.a2l", Some(a2l.as_bytes()))?;
        put("start.page", Some(&calibration::start_page(&model, &parameters)))?;
        Some(a2l)
    } else {
        None
    };
    let variables =
        rust::generate(&model, &structure, &description.guid, absolute.as_deref(), a2l.as_deref());
    Ok(Generated {
        model_description: write("modelDescription.xml", &description.text)?,
        variables: write("variables.rs", &variables)?,
        documentation: write("index.html", &page)?,
        icon: put("model.png", icon.as_deref())?,
        drawing: put("model.svg", drawing.as_deref())?,
        terminals: put("terminalsAndIcons.xml", terminals.as_ref().map(String::as_bytes))?,
        resources: resources.is_some().then_some(resources_folder),
        flat_name: model.flat_name().map(str::to_owned),
        sources: units_file
            .into_iter()
            .chain(fragment_sources)
            .chain(icon_source)
            .chain(drawing_source)
            .chain(resources.map(|resources| resources.folder))
            .collect(),
    })
}

fn read_units(file: &Path) -> Result<Vec<UnitDeclaration>, Error> {
    let (units, source) = Source::read::<Vec<UnitDeclaration>>(file)?;
    let mut refusals = Refusals::default();
    check::units::all(&units, &mut refusals);
    refusals.check().map_err(|refusals| source.error(refusals))?;
    Ok(units)
}

/// The picture that importers show, a PNG by FMI 2.0.5, section 2.3.
fn read_icon(file: &Path) -> Result<Vec<u8>, Error> {
    let picture = fs::read(file).map_err(|error| Error::of_file(file, error))?;
    if picture.starts_with(b"\x89PNG\r\n\x1a\n") {
        Ok(picture)
    } else {
        Err(Error::of_file(file, "it is not a PNG"))
    }
}
