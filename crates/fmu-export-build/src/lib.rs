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
//! fmu_export_build::generate("modelDescription/tank.json");
//! ```
//!
//! and, for a `"model_identifier": "Tank"`, a module with what was generated:
//! `pub mod variables { fmu_export::include_variables!("Tank"); }`.
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
//! `state_groups`, each with name and description, split the states where a model integrates them apart: a
//! component with states then names its `"state_group"`. For a group `gas_path` there is a struct `GasPathStates`
//! with conversions from all states and arrays, and the constants `NOMINAL` and `MIN`.
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

//!
//! # Documentation and icon
//!
//! Beside modelDescription.xml a page for people is written, `index.html`: what the model is, how to run it,
//! and every variable. It needs nothing but the JSON. What else there is to say its author adds by two fields
//! of the model, both optional, with names of files relative to the JSON's:
//!
//! | field | file |
//! |---|---|
//! | `"documentation"` | a fragment of HTML, written as XML, that the page takes in: prose, equations in MathML, figures |
//! | `"icon"` | the PNG that importers show the FMU with, 100 to 200 pixels wide |
//!
//! In the fragment `<var>vessel.mass</var>` becomes a link to the variable, and a name that no variable has
//! fails the build; `<img src="vessel.svg" alt="…"/>` becomes the picture itself. `<h3 id="…">` is a heading
//! that the page's contents list. The page has styles for `<div class="equation">` (formulas, and their source
//! in a `<span>`) and `<ul class="symbols">` (entries of a symbol and its variable), and colours, by day and by
//! night, for the classes `first`, `second`, `third`, `block` and `grid` of pictures, which draw in
//! `currentColor`. The page is whole by itself: scripts, styles, and what is loaded from elsewhere are refused.
//!
//! The documentation is not part of the interface: it does not enter the GUID.

mod check;
mod dependencies;
mod error;
mod fragment;
mod json;
mod page;
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
    /// The files that were read beside the model's JSON: units, documentation with its pictures, icon.
    pub sources: Vec<PathBuf>,
    /// The modelDescription.xml.
    pub model_description: PathBuf,
    /// The typed interface, beside it.
    pub variables: PathBuf,
    /// The documentation's page, `index.html` beside them.
    pub documentation: PathBuf,
    /// The icon, `model.png` beside them, where the JSON names one.
    pub icon: Option<PathBuf>,
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
        Ok(generated) => {
            for source in generated.sources {
                println!("cargo::rerun-if-changed={}", source.display());
            }
        }
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
/// When the JSON or a file that it names cannot be read, or contradicts itself or FMI 2.0, or when the
/// documentation names what the model does not have.
pub fn generate_into(json: &Path, out_dir: &Path, version: &str) -> Result<Generated, Error> {
    let model: json::Model = json::read(json)?;
    let units_file = json.with_file_name(&model.units);
    let units: Vec<json::Unit> = json::read(&units_file)?;
    check::unit_file(&units).map_err(|refusal| Error::new(&units_file, refusal))?;
    let resolved = resolve::resolve(&model, &units, version).map_err(|refusal| Error::new(json, refusal))?;
    let structure = dependencies::Structure::new(&resolved.variables);
    let description = xml::Description::new(&resolved, &structure);
    let beside = |name: &Option<String>| name.as_ref().map(|name| json.with_file_name(name));
    let read_fragment = |file: PathBuf| fragment::read(&file, &page::anchors(&resolved));
    let fragment = beside(&model.documentation).map(read_fragment).transpose()?;
    let icon_source = beside(&model.icon);
    let icon = icon_source.as_deref().map(read_icon).transpose()?;
    let page = page::write(&resolved, &structure, &description.guid, fragment.as_ref());
    let fragment_sources = fragment.map(|fragment| fragment.files).unwrap_or_default();

    let folder = out_dir.join(&model.model_identifier);
    fs::create_dir_all(&folder).map_err(|error| Error::new(&folder, error.to_string()))?;
    let write = |name: &str, content: &[u8]| {
        let file = folder.join(name);
        match fs::write(&file, content) {
            Ok(()) => Ok(file),
            Err(error) => Err(Error::new(&file, error.to_string())),
        }
    };
    let icon_file = folder.join("model.png");
    if icon.is_none() && icon_file.exists() {
        // Of a build before the icon was taken out of the JSON.
        fs::remove_file(&icon_file).map_err(|error| Error::new(&icon_file, error.to_string()))?;
    }
    Ok(Generated {
        sources: [units_file].into_iter().chain(fragment_sources).chain(icon_source).collect(),
        model_description: write("modelDescription.xml", description.text.as_bytes())?,
        variables: write("variables.rs", rust::generate(&resolved, &description.guid).as_bytes())?,
        documentation: write("index.html", page.as_bytes())?,
        icon: icon.map(|icon| write("model.png", &icon)).transpose()?,
    })
}

/// The picture that importers show, which FMI 2.0.5 wants as a PNG (section 2.3).
fn read_icon(file: &Path) -> Result<Vec<u8>, Error> {
    let picture = fs::read(file).map_err(|error| Error::new(file, error.to_string()))?;
    if picture.starts_with(b"\x89PNG\r\n\x1a\n") {
        Ok(picture)
    } else {
        Err(Error::new(file, "it is not a PNG".to_owned()))
    }
}
/// The JSON Schema.
pub const SCHEMA: &str = "{}";
