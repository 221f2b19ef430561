//! `ssp`: the coupled system of any plant and controller, as an SSP package (System Structure and Parameterization).

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use boost_interface::{Compatibility, Interface, Match, Role};
use clap::Args;
use fmu_io::{reading, writing};
use fmu_package::{FmuDescription, Kind, ParameterSet, SystemPackage, SystemStructure, connection};

use super::check::Candidate;
use super::coupling::{Member, couple, linear};

/// The system's name.
pub const SYSTEM: &str = "Boost";

/// What is coupled, and how.
#[derive(Args)]
pub struct Arguments {
    /// The plant
    #[arg(long, value_name = "FILE.fmu")]
    pub plant: PathBuf,
    /// The controller
    #[arg(long, value_name = "FILE.fmu")]
    pub controller: PathBuf,
    /// Connections for FMUs with other names or units, written by `check --write-connections`; may be given several
    /// times
    #[arg(long, value_name = "FILE.toml")]
    pub connections: Vec<PathBuf>,
    /// Parameter sets, each bound to the FMU that has its parameters
    #[arg(long, value_name = "FILE.ssv")]
    pub parameters: Vec<PathBuf>,
    /// The system's only inputs, for masters that set unconnected inputs to zero; the FMUs keep the start values of
    /// the others [default: all]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub inputs: Option<Vec<String>>,
    /// The file to write [default: Boost.ssp]
    #[arg(long, value_name = "FILE.ssp")]
    pub out: Option<PathBuf>,
}

/// Writes the package of two FMUs.
pub fn run(interface: &Interface, arguments: &Arguments) -> Result<()> {
    let Arguments { plant, controller, connections, parameters, inputs: exposed, out } = arguments;
    let out = out.clone().unwrap_or_else(|| PathBuf::from(format!("{SYSTEM}.ssp")));
    let fmus = [plant, controller].map(PathBuf::clone);
    let inputs = [&fmus, &connections[..], &parameters[..]].concat();
    writing::refuse_overlap(std::slice::from_ref(&out), &inputs)?;
    let connections = connection::read_all(connections)?;
    let [of_plant, of_controller] = [Candidate::read(plant)?, Candidate::read(controller)?];
    let fits = [
        of_plant.compare(interface, Role::Plant, &connections)?,
        of_controller.compare(interface, Role::Controller, &connections)?,
    ];
    if let Some(compatibility) = fits.iter().find(|compatibility| !compatibility.fits()) {
        bail!(
            "{compatibility}Give connections: `boost-fmu check FILE.fmu --as {} --write-connections FILE.toml` writes \
             them to edit.",
            compatibility.role.name()
        );
    }
    for (port, found) in fits.iter().flat_map(|compatibility| &compatibility.matches) {
        let Match::Found { variable, conversion, threshold, .. } = found else { continue };
        if threshold.is_some() {
            bail!("{}: a system has no threshold; have the FMU compare the value", port.name());
        }
        if variable.element.is_some() {
            bail!(
                "{}: a system connects whole variables, and {} is an array's element",
                port.name(),
                variable.name
            );
        }
        if linear(variable, conversion).is_none() {
            bail!("{}: a system has no table from or to a Real; give factor and offset", port.name());
        }
    }
    let mut package = package(&fits, [reading::bytes(plant)?, reading::bytes(controller)?], parameters)?;
    if let Some(exposed) = exposed {
        refuse_unknown(exposed, &package.structure)?;
        package.structure = package.structure.with_inputs(exposed);
    }
    writing::write(&out, |writer| package.write(writer))?;
    cargo_fmu::say(&out, "")
}

/// Rejects names that are no inputs of the system.
fn refuse_unknown(names: &[String], structure: &SystemStructure) -> Result<()> {
    let inputs = structure.system.connectors.iter().filter(|connector| connector.kind == Kind::Input);
    let inputs: Vec<_> = inputs.map(|connector| connector.name.as_str()).collect();
    match names.iter().find(|name| !inputs.contains(&name.as_str())) {
        None => Ok(()),
        Some(name) => bail!("--inputs {name}: the system has no such input; it has {}", inputs.join(", ")),
    }
}

fn package(
    fits: &[Compatibility<'_>; 2],
    fmus: [Vec<u8>; 2],
    parameter_files: &[PathBuf],
) -> Result<SystemPackage> {
    let [plant, controller] = fmus;
    let mut plant = Member { compatibility: &fits[0], fmu: plant, parameter_sets: vec![] };
    let mut controller = Member { compatibility: &fits[1], fmu: controller, parameter_sets: vec![] };
    for path in parameter_files {
        let set = ParameterSet::read(path)?;
        let place = place(&set, plant.compatibility.fmu, controller.compatibility.fmu)
            .with_context(|| format!("the parameter set {} cannot be bound", path.display()))?;
        let member = match place {
            Role::Plant => &mut plant,
            Role::Controller => &mut controller,
        };
        let set = set
            .fit(member.compatibility.fmu)
            .with_context(|| format!("the parameter set {} cannot be bound", path.display()))?;
        let file = path.file_name().and_then(|name| name.to_str()).context("the file's name is not text")?;
        member.parameter_sets.push((file.to_owned(), set.to_xml()));
    }
    Ok(couple(SYSTEM, plant, controller))
}

/// The FMU that has a set's parameters.
fn place(set: &ParameterSet, plant: &FmuDescription, controller: &FmuDescription) -> Result<Role> {
    let has = |fmu: &FmuDescription, name: &str| fmu.variable(name).is_some();
    let Some(first) = set.parameters.first() else { bail!("it has no parameters") };
    let role = if has(plant, &first.name) { Role::Plant } else { Role::Controller };
    let (own, other) = match role {
        Role::Plant => (plant, controller),
        Role::Controller => (controller, plant),
    };
    // Parameters of neither FMU are refused when the set is compared with this one.
    if let Some(stray) =
        set.parameters.iter().find(|parameter| !has(own, &parameter.name) && has(other, &parameter.name))
    {
        bail!(
            "{} is {}'s and {} is {}'s; a set is for one of them",
            first.name,
            own.attribute("modelName"),
            stray.name,
            other.attribute("modelName")
        );
    }
    Ok(role)
}
