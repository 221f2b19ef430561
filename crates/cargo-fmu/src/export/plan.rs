//! What to export: builds the libraries of each FMI version and hands them to the packing.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use fmu_io::terminal::complain;
use fmu_io::{reading, writing};
use fmu_package::{Fmu, MODEL_DESCRIPTION, Platform};
use fmu_terms::{Interfaces, Precision, Version};

use super::packing::{
    ModelLibrary, create_folder_of, custom_section, documentation, libraries_of, resources,
    with_source_files, without_type_descriptions, write, write_file,
};
use crate::compile::{Compiled, GeneratedDescription, compile};
use crate::generation::Choice;
use crate::metadata::{Metadata, Package};
use crate::sources::{self, Module};
use crate::target::{Build, Made, Profile, WebAssembly};
use crate::{licenses, validate};

/// What to export, and the output folder; nothing is built yet.
#[derive(Debug)]
pub struct Plan {
    pub(super) metadata: Metadata,
    pub(super) builds: Vec<Build>,
    /// Whether modules are written instead of FMUs.
    pub(super) wasm: bool,
    /// Whether FMUs have sources.
    pub(super) sources: bool,
    /// Whether the types of FMI 3.0 have descriptions.
    pub(super) describes_types: bool,
    /// The versions of FMI; `None` leaves the version to the environment.
    pub(super) versions: Vec<Option<Version>>,
    pub(super) interfaces: Option<Interfaces>,
    pub(super) precision: Option<Precision>,
    pub(super) profile: Profile,
    pub(super) binaries: Vec<(Platform, PathBuf)>,
    /// The package of each model.
    pub(super) models: BTreeMap<String, Package>,
    /// The folder of the FMUs.
    pub(super) out: PathBuf,
}

impl Plan {
    /// The identifiers of the models.
    pub fn models(&self) -> impl Iterator<Item = &str> {
        self.models.keys().map(String::as_str)
    }

    /// The folders of the FMUs, of FMI 2.0 and 3.0.
    #[must_use]
    pub fn folders(&self) -> [PathBuf; 2] {
        [self.out.clone(), self.folder_of_fmi3()]
    }

    /// The file of a model's FMI 2.0 FMU.
    fn fmu(&self, model: &str) -> PathBuf {
        self.out.join(format!("{model}.fmu"))
    }

    /// The folder of the FMI 3.0 FMUs.
    fn folder_of_fmi3(&self) -> PathBuf {
        self.out.join("fmi3")
    }

    /// The file to which a model's FMU of an FMI version is written.
    fn fmu_of(&self, model: &str, version: Version) -> PathBuf {
        let of_fmi2 = self.fmu(model);
        match of_fmi2.file_name() {
            Some(name) if version == Version::Three => self.folder_of_fmi3().join(name),
            _ => of_fmi2,
        }
    }

    /// Builds and writes the FMUs or modules, reports them, and returns the FMU files. `inputs` and `outputs` are
    /// other files that the command reads and writes: none may be both.
    ///
    /// # Errors
    /// When a library cannot be built or does not fit, or a file cannot be read or written.
    pub fn run(&self, inputs: &[PathBuf], outputs: &[PathBuf]) -> Result<Vec<PathBuf>> {
        let mut given = self
            .binaries
            .iter()
            .map(|(platform, file)| ModelLibrary::read(*platform, file))
            .collect::<Result<Vec<_>>>()?;
        fs::create_dir_all(&self.out)
            .with_context(|| format!("cannot create the folder {}", self.out.display()))?;
        let fmus = self
            .folders()
            .map(|folder| self.models().map(|name| folder.join(format!("{name}.fmu"))).collect::<Vec<_>>());
        // Files in a folder yet to be created overwrite nothing.
        let outputs: Vec<PathBuf> = [fmus.concat(), outputs.to_vec()]
            .concat()
            .into_iter()
            .filter(|file| file.parent().is_some_and(Path::is_dir))
            .collect();
        let inputs: Vec<_> =
            self.binaries.iter().map(|(_, file)| file.clone()).chain(inputs.iter().cloned()).collect();
        writing::refuse_overlap(&outputs, &inputs)?;
        if self.wasm {
            self.versions.iter().try_for_each(|&version| self.write_modules(version))?;
            return Ok(vec![]);
        }

        let mut written = vec![];
        for (number, &version) in self.versions.iter().enumerate() {
            // One by one, because each build overwrites the libraries of the previous one.
            let built = self.compile(version)?;
            let descriptions = descriptions(self.models(), &built)?;
            let (of_these, others) = given.into_iter().partition(|given| given.is_of(&descriptions));
            given = others;
            if number + 1 == self.versions.len()
                && let Some(stray) = given.first()
            {
                let models = self.models().collect::<Vec<_>>().join(" or ");
                bail!("{}: it was not built from the description of {models}", stray.refused());
            }
            let modules = self.sources.then(|| self.compile_for(&WebAssembly, "", version)).transpose()?;
            written.extend(self.pack(&built, modules.as_ref(), &descriptions, of_these)?);
        }
        Ok(written)
    }

    /// Builds and writes the modules of an FMI version.
    fn write_modules(&self, version: Option<Version>) -> Result<()> {
        let compiled = self.compile_for(&WebAssembly, "", version)?;
        for model in self.models() {
            let GeneratedDescription { mut xml, content } = compiled.description(model)?;
            if !self.describes_types {
                xml = without_type_descriptions(&xml);
            }
            let mut module = reading::bytes(compiled.library(model)?)?;
            module.extend(custom_section(MODEL_DESCRIPTION, xml.as_bytes()));
            write_file(&self.fmu_of(model, content.version()).with_extension("wasm"), &module)?;
        }
        Ok(())
    }

    /// The files of the folder `sources` in a model's FMU.
    fn sources_of(
        &self,
        model: &str,
        identifier: &str,
        modules: &Compiled,
        description: &GeneratedDescription,
    ) -> Result<Vec<(String, Vec<u8>)>> {
        let GeneratedDescription { xml, content } = description;
        if modules.description(model)?.xml != *xml {
            bail!("the WebAssembly build gave a different description of {model}");
        }
        let bytes = reading::bytes(modules.library(model)?)?;
        let folder = self.metadata.target_directory.join("fmu-sources");
        let module =
            Module { model: identifier, version: content.version(), description: xml, bytes: &bytes };
        sources::files(&module, &folder)
    }

    /// Builds the libraries of an FMI version.
    fn compile(&self, version: Option<Version>) -> Result<Vec<(Build, Compiled)>> {
        let compile = |(number, build): (usize, &Build)| {
            let of = match self.builds.len() {
                1 => String::new(),
                builds => format!(" ({} of {builds})", number + 1),
            };
            Ok((build.clone(), self.compile_for(build, &of, version)?))
        };
        self.builds.iter().enumerate().map(compile).collect()
    }

    /// Builds an FMI version for one target; `of` is its number among all targets.
    fn compile_for(&self, build: &dyn Made, of: &str, version: Option<Version>) -> Result<Compiled> {
        // Cargo reports progress, and waiting for another cargo, on the shared standard error.
        complain(&format!(
            "Compiling {} for {}{of}, a minute or more the first time; cargo shows its progress:",
            self.models().collect::<Vec<_>>().join(", "),
            build.name()
        ));
        let choice = Choice { version, interfaces: self.interfaces, precision: self.precision };
        compile(&self.metadata, self.models.values(), build, &self.profile, choice).with_context(|| {
            match version {
                Some(version) if self.versions.first() != Some(&Some(version)) => {
                    format!("nothing was exported as FMI {version}.0")
                }
                _ => "nothing was exported".to_owned(),
            }
        })
    }

    /// Writes the FMUs from the build and from libraries built elsewhere, reports them, and returns their files.
    fn pack(
        &self,
        built: &[(Build, Compiled)],
        modules: Option<&Compiled>,
        descriptions: &BTreeMap<&str, GeneratedDescription>,
        given: Vec<ModelLibrary<'_>>,
    ) -> Result<Vec<PathBuf>> {
        let mut libraries = libraries_of(descriptions, built, given)?;
        let mut written = vec![];
        for (&name, description) in descriptions {
            let libraries = libraries.remove(name).unwrap_or_default();
            let GeneratedDescription { xml, content } = description;
            let version = content.version();
            // Differs from the library's for Scheduled Execution.
            let identifier = content.interfaces.first();
            let identifier = identifier.and_then(|(interface, _)| content.identifier(*interface));
            let identifier = identifier.unwrap_or(name);
            let generated = built[0].1.generated(name)?;
            let mut files = documentation(&generated, version, &libraries)?;
            files.extend(resources(&generated)?);
            files.extend(licenses::files(name, &self.models[name], built)?);
            let mut xml = Cow::Borrowed(xml.as_str());
            if let Some(modules) = modules {
                let sources = self.sources_of(name, identifier, modules, description)?;
                // FMI 3.0 lists them in a separate file.
                if version == Version::Two {
                    xml = with_source_files(&xml, &sources::compiled(&sources))?.into();
                }
                files.extend(sources);
            }
            if !self.describes_types {
                xml = without_type_descriptions(&xml).into();
            }
            let fmu = Fmu {
                model_identifier: identifier,
                model_description: &xml,
                version,
                libraries: libraries.into_iter().collect(),
                files,
            };
            let file = self.fmu_of(identifier, version);
            create_folder_of(&file)?;
            write(&fmu, content.guid(), &file)?;
            validate::check(&file)?;
            written.push(file);
        }
        Ok(written)
    }
}

/// Each model's description, which is the same in all builds.
fn descriptions<'a>(
    models: impl Iterator<Item = &'a str>,
    built: &[(Build, Compiled)],
) -> Result<BTreeMap<&'a str, GeneratedDescription>> {
    let mut descriptions = BTreeMap::<_, GeneratedDescription>::new();
    for name in models {
        for (build, compiled) in built {
            let description = compiled.description(name)?;
            if let Some(first) = descriptions.get(name)
                && first.xml != description.xml
            {
                bail!("the build for {} gave a different description of {name}", build.platform.folder());
            }
            descriptions.insert(name, description);
        }
    }
    Ok(descriptions)
}
