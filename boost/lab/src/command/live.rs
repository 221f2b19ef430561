//! `live`: a page that runs both FMUs in a browser.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::Args;
use fmu_io::writing;
use fmu_package::FmuDescription;

use crate::live::{self, LOOP, Module};
use crate::reproduce::{FIGURES, Laboratory};

/// Seconds of simulation that give the plots' quantities and their sizes.
const TRIAL: f64 = 1.0;

#[derive(Args)]
pub struct Arguments {
    /// The plant as a WebAssembly module, written by `boost-fmu export --wasm` [default: from the --fmus folder]
    #[arg(long, value_name = "FILE.wasm")]
    plant: Option<PathBuf>,
    /// The controller as a WebAssembly module [default: from the --fmus folder]
    #[arg(long, value_name = "FILE.wasm")]
    controller: Option<PathBuf>,
    /// The folder with `BoostPlant.fmu` and `BoostController.fmu`, which run the paper's experiments for comparison
    #[arg(long, value_name = "DIR", default_value = super::FMUS)]
    fmus: PathBuf,
    /// Parameters of a plant to offer; may be given several times [default: those in this repository's parameters/]
    #[arg(long, value_name = "FILE.ssv")]
    parameters: Vec<PathBuf>,
    /// The page to write
    #[arg(long, value_name = "FILE.html", default_value = "target/live.html")]
    out: PathBuf,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let in_folder = |name: &str| arguments.fmus.join(name);
    let plant_file = arguments.plant.clone().unwrap_or_else(|| in_folder("BoostPlant.wasm"));
    let controller_file = arguments.controller.clone().unwrap_or_else(|| in_folder("BoostController.wasm"));
    let fmus = ["BoostPlant.fmu", "BoostController.fmu"].map(in_folder);
    let modules = [plant_file, controller_file];
    let inputs: Vec<_> = modules.iter().chain(&fmus).chain(&arguments.parameters).cloned().collect();
    writing::refuse_overlap(std::slice::from_ref(&arguments.out), &inputs)?;

    let [plant, controller] = [0, 1].map(|index| read(&modules[index], &fmus[index]));
    let (plant, controller) = (plant?, controller?);
    let plants = super::plants(&arguments.parameters)?;
    let mut laboratory = Laboratory::new(&arguments.fmus);
    let closed_loop = laboratory.try_out(LOOP, TRIAL)?;
    let bar = super::progress_bar(FIGURES.len() as u64, "{pos} of {len} experiments")?;
    let mut experiments = vec![];
    for figure in &FIGURES {
        experiments.push(laboratory.reproduce(figure)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let html = live::html([&plant, &controller], &plants, &closed_loop, &experiments)?;
    super::write_file(&arguments.out, html.as_bytes())
}

/// Reads a module, which must be of the same model as the FMU it is compared with.
fn read(module: &Path, fmu: &Path) -> Result<Module> {
    let read = Module::read(module)?;
    let description = FmuDescription::read(fmu)?;
    if read.description.guid() != description.guid() {
        bail!("{} and {} are different models: export both again", module.display(), fmu.display());
    }
    Ok(read)
}
