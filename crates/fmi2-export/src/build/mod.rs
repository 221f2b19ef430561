//! For build scripts: a model's JSON becomes its modelDescription.xml and its typed Rust interface.
//!
//! A variable is declared once, in JSON, with name, causality, type, unit, bounds, start value and what
//! its equation reads. From that follow the value references, the structs that a model computes with, the
//! accessors by which the runtime reaches them, the XML that importers read, and the dependencies in it.
//! They cannot contradict each other, and what contradicts itself in the JSON, or FMI, fails the build
//! with file, variable and reason.
//!
//! A model's package has a `build.rs`
//!
//! ```no_run
//! fmi2_export::build::generate("modelDescription/tank.json");
//! ```
//!
//! and, for a `"model_identifier": "Tank"`, a module with what was generated:
//! `pub mod variables { fmi2_export::include_variables!("Tank"); }`.
//!
//! # The JSON of a model
//!
//! ```json
//! {
//!   "model_identifier": "Tank",
//!   "description": "A vessel that fills through a valve",
//!   "author": "…", "copyright": "…", "license": "MIT",
//!   "default_experiment": {"start_time": 0, "stop_time": 10, "step_size": 0.01},
//!   "capabilities": {"variable_communication_step_size": true, "interpolate_inputs": true, "get_and_set_state": true, "serialize_state": true},
//!   "log_categories": [
//!     {"name": "logStatusError", "description": "Errors"},
//!     {"name": "logStatusWarning", "description": "Warnings"},
//!     {"name": "logEvents", "description": "Events"}
//!   ],
//!   "units": "units.json",
//!   "variables": [
//!     {"name": "inflow", "causality": "input", "unit": "kg/s", "start": 0, "description": "Flow into the vessel"},
//!     {"name": "level", "causality": "output", "unit": "m", "reads": ["vessel.mass", "vessel.area"], "description": "Level"}
//!   ],
//!   "components": [
//!     {"name": "vessel", "description": "Vessel", "variables": [
//!       {"name": "area", "causality": "parameter", "unit": "m2", "start": 0.5, "min": 0.1, "description": "Cross section"},
//!       {"name": "mass", "causality": "local", "unit": "kg", "start": 10, "initial": "exact", "description": "Contents",
//!        "derivative": {"description": "Rate of change", "reads": ["inflow"]}}
//!     ]}
//!   ]
//! }
//! ```
//!
//! Beside `components` with variables of their own there are `component_types`, whose variables several
//! components share; such a component has a `"type"`, its own `"start"` values, and `"connections"`, by
//! which a `"{placeholder}"` in the type's `reads` stands for a variable of another component.
//! `enumerations` declare types whose items have the values 1, 2, …. A variable with `"dimensions"` is
//! an array; its `"unit"` may be a list, with one for each element. The value reference 0 is `time`; the others follow in the order of declaration, each
//! derivative `der(x)` directly after its state.
//!
//! `reads` names what the equation of a calculated variable reads *directly*; in a component a bare name
//! means the component's own variable first. `initial_reads` is what initialization reads where that
//! differs. The closure of both is computed and written as the dependencies of `ModelStructure`
//! (FMI 2.0.5, section 2.2.8), from which importers know where there is an algebraic loop.
//!
//! # The JSON of units
//!
//! A list such as `[{"name": "Pa", "base": {"kg": 1, "m": -1, "s": -2}, "display_units": [{"name": "bar",
//! "factor": 1e-5}]}]`. A unit's `factor` and `offset` lead to its base unit, a display unit's from the
//! unit to what is displayed. A unit with a fractional exponent has no `base`: FMI has none for it.
//! Every Real needs a unit, which for a number without dimension is a unit named `1`; `time` needs `s`.

mod check;
mod dependencies;
mod error;
mod json;
mod resolve;
mod rust;
mod xml;

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

pub use error::Error;

/// What [`generate_into`] read and wrote.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Generated {
    /// The file of units that the model's JSON names.
    pub units: PathBuf,
    /// The modelDescription.xml.
    pub model_description: PathBuf,
    /// The typed interface, beside it.
    pub variables: PathBuf,
}

/// Generates the interface of a model into the folder of its name in `OUT_DIR`. For build scripts.
///
/// The XML's `version` is that of the package whose build script runs.
///
/// # Panics
/// When the JSON is refused, which fails the build with the reason, or when called outside a build
/// script.
pub fn generate(json: impl AsRef<Path>) {
    let json = json.as_ref();
    println!("cargo::rerun-if-changed={}", json.display());
    let of_cargo = |name| env::var(name).unwrap_or_else(|_| panic!("{name} is set for build scripts only"));
    match generate_into(json, Path::new(&of_cargo("OUT_DIR")), &of_cargo("CARGO_PKG_VERSION")) {
        Ok(generated) => println!("cargo::rerun-if-changed={}", generated.units.display()),
        Err(error) => {
            println!("cargo::error={error}");
            panic!("{error}");
        }
    }
}

/// Generates the interface of a model into the folder of its name in a folder.
///
/// `version` becomes the version in the XML.
///
/// # Errors
/// When the JSON or its file of units cannot be read, or contradicts itself or FMI 2.0.
pub fn generate_into(json: &Path, out_dir: &Path, version: &str) -> Result<Generated, Error> {
    let model: json::Model = json::read(json)?;
    let units_file = json.with_file_name(&model.units);
    let units: Vec<json::Unit> = json::read(&units_file)?;
    check::unit_file(&units).map_err(|refusal| Error::new(&units_file, refusal))?;
    let resolved = resolve::resolve(&model, &units, version).map_err(|refusal| Error::new(json, refusal))?;
    let structure = dependencies::Structure::new(&resolved.variables);
    let description = xml::Description::new(&resolved, &structure);

    let folder = out_dir.join(&model.model_identifier);
    fs::create_dir_all(&folder).map_err(|error| Error::new(&folder, error.to_string()))?;
    let write = |name: &str, text: &str| {
        let file = folder.join(name);
        match fs::write(&file, text) {
            Ok(()) => Ok(file),
            Err(error) => Err(Error::new(&file, error.to_string())),
        }
    };
    Ok(Generated {
        units: units_file,
        model_description: write("modelDescription.xml", &description.text)?,
        variables: write("variables.rs", &rust::generate(&resolved, &description.guid))?,
    })
}
