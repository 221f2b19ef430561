//! `export`: compiles the models' libraries with cargo and packs each into an .fmu.
//!
//! A model is a workspace member whose library is a `cdylib` named after the model. The description that
//! goes into the FMU is the very file that the build wrote and compiled into the library, as cargo's
//! messages tell, so the two cannot differ. Where both FMUs are exported, the system that they make goes into
//! a package beside them.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use boost_interface::Role;
use cargo_metadata::{CrateType, Metadata, MetadataCommand, Package};
use fmi2_export::package::terminal::print;
use fmi2_export::package::{Fmu, Library, Platform, PlatformList, library, reading, writing};

use super::compile::{Compiled, compile};
use super::target::{Build, Target};
use super::{licenses, ssp};

/// Exports the named models, or all, into a folder; the package of both binds the parameter sets.
pub fn run(
    names: &[String],
    out: Option<PathBuf>,
    parameters: &[PathBuf],
    targets: &[Target],
    binaries: &[(Platform, PathBuf)],
) -> Result<()> {
    let builds = builds(targets)?;
    let given = binaries
        .iter()
        .map(|(platform, file)| ModelLibrary::read(*platform, file))
        .collect::<Result<Vec<_>>>()?;
    let metadata = MetadataCommand::new()
        // Nothing is asked of the dependencies: else cargo would fetch those of members that are not exported.
        .no_deps()
        .exec()
        .context("cargo finds no workspace here; run this in the folder of the repository")?;
    let models = choose(&metadata, names)?;
    let members = [Role::Plant, Role::Controller].map(Role::model_identifier);
    let is_system = members.iter().all(|name| models.contains_key(name));
    if !parameters.is_empty() && !is_system {
        bail!("parameter sets are bound in the system of {}; export both", members.join(" and "));
    }
    let out = out.unwrap_or_else(|| metadata.target_directory.join("fmu").into());
    fs::create_dir_all(&out).with_context(|| format!("cannot create the folder {}", out.display()))?;
    let system = out.join("Boost.ssp");
    let fmus = models.keys().map(|name| out.join(format!("{name}.fmu")));
    let outputs: Vec<_> = fmus.chain(is_system.then(|| system.clone())).collect();
    let libraries_given = binaries.iter().map(|(_, file)| file.clone());
    writing::refuse_overlap(
        &outputs,
        &parameters.iter().cloned().chain(libraries_given).collect::<Vec<_>>(),
    )?;
    let mut built = vec![];
    for build in builds {
        let compiled = compile(&metadata, models.values().copied(), &build)?;
        built.push((build, compiled));
    }
    let descriptions = descriptions(&models, &built)?;
    let mut libraries = libraries(&descriptions, &built, given)?;

    for (&name, description) in &descriptions {
        let libraries = libraries.remove(name).unwrap_or_default();
        let mut files = documentation(&built[0].1.generated(name)?, &libraries)?;
        files.extend(licenses::files(name, &models[name].name, &built)?);
        let fmu = Fmu {
            model_identifier: name,
            model_description: description,
            libraries: libraries.into_iter().collect(),
            files,
        };
        write(&fmu, &out.join(format!("{name}.fmu")))?;
    }
    if is_system {
        let [plant, controller] = members.map(|name| reading::bytes(&out.join(format!("{name}.fmu"))));
        ssp::write(&ssp::own(plant?, controller?, parameters)?, &system)?;
    }
    Ok(())
}

/// The models that are asked for, by name.
fn choose<'a>(metadata: &'a Metadata, names: &'a [String]) -> Result<BTreeMap<&'a str, &'a Package>> {
    let all: BTreeMap<&str, &Package> = metadata
        .workspace_packages()
        .into_iter()
        .flat_map(|package| {
            let libraries =
                package.targets.iter().filter(|target| target.crate_types.contains(&CrateType::CDyLib));
            libraries.map(move |target| (target.name.as_str(), package))
        })
        .collect();
    let known = all.keys().copied().collect::<Vec<_>>().join(", ");
    if all.is_empty() {
        bail!("no member of the workspace {} is a cdylib", metadata.workspace_root);
    }
    if names.is_empty() {
        return Ok(all);
    }
    names
        .iter()
        .map(|name| {
            all.get_key_value(name.as_str())
                .map(|(&name, &package)| (name, package))
                .with_context(|| format!("there is no model {name}; there are {known}"))
        })
        .collect()
}

/// What is to be built, each with its tools at hand.
fn builds(targets: &[Target]) -> Result<Vec<Build>> {
    let mut builds: Vec<Build> = vec![];
    for build in targets.iter().flat_map(Target::builds) {
        if builds.contains(&build) {
            continue;
        }
        if let Some(other) = builds.iter().find(|other| other.platform == build.platform)
            && build.platform != Platform::Darwin64
        {
            bail!("{} and {} are both for {}", other.name(), build.name(), build.platform.folder());
        }
        builds.push(build);
    }
    if builds.is_empty() {
        builds.push(Build::host()?);
    }
    builds.iter().try_for_each(Build::check_tools)?;
    Ok(builds)
}

/// The description of each model, which is the same in all builds.
fn descriptions<'a>(
    models: &BTreeMap<&'a str, &Package>,
    built: &[(Build, Compiled)],
) -> Result<BTreeMap<&'a str, String>> {
    let mut descriptions = BTreeMap::new();
    for &name in models.keys() {
        for (build, compiled) in built {
            let description = compiled.description(name)?;
            if *descriptions.entry(name).or_insert_with(|| description.clone()) != description {
                bail!("the build for {} made another description of {name}", build.platform.folder());
            }
        }
    }
    Ok(descriptions)
}

/// A library that is to be packed.
struct ModelLibrary<'a> {
    platform: Platform,
    file: &'a Path,
    bytes: Vec<u8>,
}

impl<'a> ModelLibrary<'a> {
    /// Reads a library, which must be one for its platform.
    fn read(platform: Platform, file: &'a Path) -> Result<Self> {
        let given = Self { platform, file, bytes: reading::bytes(file)? };
        Library::read(&given.bytes)
            .and_then(|library| library.fits(platform))
            .with_context(|| given.refused())?;
        Ok(given)
    }

    fn refused(&self) -> String {
        format!("{} cannot be the library for {}", self.file.display(), self.platform.folder())
    }
}

/// The libraries of each model: those that were compiled, and those that were built elsewhere. By its GUID,
/// each knows the description that it was built from.
fn libraries<'a>(
    descriptions: &BTreeMap<&'a str, String>,
    built: &[(Build, Compiled)],
    given: Vec<ModelLibrary<'_>>,
) -> Result<BTreeMap<&'a str, BTreeMap<Platform, Vec<u8>>>> {
    let mut all = vec![];
    for &name in descriptions.keys() {
        for (build, compiled) in built {
            all.push(ModelLibrary::read(build.platform, compiled.library(name)?)?);
        }
    }
    all.extend(given);

    let mut libraries: BTreeMap<&str, BTreeMap<Platform, Vec<u8>>> = BTreeMap::new();
    for given in all {
        let model = descriptions.iter().find(|(_, description)| {
            guid(description).is_some_and(|guid| holds(&given.bytes, guid.as_bytes()))
        });
        let Some((&name, _)) = model else {
            let models = descriptions.keys().copied().collect::<Vec<_>>().join(" or ");
            bail!("{}: it was built from another description than {models}", given.refused());
        };
        let of_model = libraries.entry(name).or_default();
        let bytes = match of_model.get(&given.platform) {
            None => given.bytes,
            Some(other) if given.platform == Platform::Darwin64 => {
                library::join(&[other, &given.bytes]).with_context(|| given.refused())?
            }
            Some(_) => bail!("{}: {name} has one already", given.refused()),
        };
        of_model.insert(given.platform, bytes);
    }
    Ok(libraries)
}

/// A description's GUID.
fn guid(model_description: &str) -> Option<&str> {
    model_description.split("guid=\"").nth(1).and_then(|rest| rest.split('"').next())
}

/// Whether bytes hold a text.
fn holds(bytes: &[u8], text: &[u8]) -> bool {
    bytes.windows(text.len()).any(|window| window == text)
}

/// The page that the build generated in a folder, the list of the platforms that the FMU has libraries for, and
/// the icon where the model has one.
fn documentation(
    generated: &Path,
    libraries: &BTreeMap<Platform, Vec<u8>>,
) -> Result<Vec<(String, Vec<u8>)>> {
    let mut platforms = PlatformList::default();
    for (platform, library) in libraries {
        platforms.libraries.insert(*platform, Library::read(library)?);
    }
    let mut files = vec![
        ("documentation/index.html".to_owned(), reading::bytes(&generated.join("index.html"))?),
        (PlatformList::PATH.to_owned(), platforms.to_string().into_bytes()),
    ];
    let icon = generated.join("model.png");
    if icon.is_file() {
        files.push(("model.png".to_owned(), reading::bytes(&icon)?));
    }
    Ok(files)
}

/// Writes an FMU and says so.
fn write(fmu: &Fmu<'_>, path: &Path) -> Result<()> {
    writing::write(path, |writer| fmu.write(writer))?;
    let size = fs::metadata(path).with_context(|| format!("cannot read {}", path.display()))?.len();
    let guid = guid(fmu.model_description).unwrap_or("no GUID");
    Ok(print(&format!("{}  {} kB  {guid}\n", path.display(), size.div_ceil(1000)))?)
}
