//! Scenarios from other files: a single FMU, or a system of SSP with its connections, start values and parameter sets.

mod connected;
mod elements;
mod files;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use fmu_io::terminal::{complain, number};
use fmu_package::{DEFAULT_STRUCTURE, FmuDescription, MODEL_DESCRIPTION, SystemDescription};

use self::elements::{Elements, SystemFmu};
use self::files::Base;
pub use self::files::Unpacked;
use crate::LoadedFmus;
use crate::scenario::{Location, Member, Scenario};

/// The number of steps for an FMU without a step size, the same as in `fmpy simulate`.
const STEPS: f64 = 500.0;

/// The duration of a run whose end nothing defines (s), the same as in `fmpy simulate`.
const DURATION: f64 = 1.0;

/// Start, stop and communication step of a run (s); none if unspecified.
#[derive(Clone, Copy, Debug, Default)]
pub struct Times {
    /// The start; by default 0.
    pub start: Option<f64>,
    /// The end; by default 1 s after the start.
    pub stop: Option<f64>,
    /// The communication step; by default a 500th of the run.
    pub step: Option<f64>,
}

impl Times {
    /// The times, completed by others where unspecified.
    fn or(self, other: Self) -> Self {
        Self {
            start: self.start.or(other.start),
            stop: self.stop.or(other.stop),
            step: self.step.or(other.step),
        }
    }

    fn scenario(self, title: &str) -> Result<Scenario> {
        let start = self.start.unwrap_or(0.0);
        let stop = self.stop.unwrap_or_else(|| {
            let stop = start + DURATION;
            complain(&format!("note: {title} defines no stop time: it runs to {} s", number(stop)));
            stop
        });
        if stop <= start {
            bail!(
                "the stop time, {} s, is not after the start time, {} s; --stop-time and --start-time give others",
                number(stop),
                number(start)
            );
        }
        let step = self.step.unwrap_or((stop - start) / STEPS);
        if step <= 0.0 || !step.is_finite() {
            bail!("the communication step is {} s", number(step));
        }
        let mut scenario = Scenario {
            title: Some(title.to_owned()),
            step,
            start_time: start,
            stop_time: stop,
            ..Scenario::default()
        };
        scenario.end_at(stop)?;
        Ok(scenario)
    }
}

/// One FMU on its own. Times that are not given are those of its default experiment. Its outputs are recorded. `fmus`, which
/// run it, keep its description.
///
/// # Errors
/// When its modelDescription.xml cannot be read, or the run does not end after it starts.
pub fn alone(path: &Path, times: Times, fmus: &mut LoadedFmus) -> Result<Scenario> {
    let description = FmuDescription::read(path)?.scalars();
    let description = description.with_context(|| {
        format!("cannot import {}: its {MODEL_DESCRIPTION} cannot be read", path.display())
    })?;
    let time = |name: &str| {
        let value = description.default_experiment.iter().find(|(known, _)| known == name);
        value.and_then(|(_, text)| text.trim().parse().ok())
    };
    let own = Times { start: time("startTime"), stop: time("stopTime"), step: time("stepSize") };
    let name = description.attribute("modelName");
    let mut scenario = times.or(own).scenario(name).with_context(|| path.display().to_string())?;
    scenario.fmus.push(Member::new(name, path, Location::argument(&path.display().to_string())));
    scenario.files.push(path.to_owned());
    fmus.describe(path, description);
    Ok(scenario)
}

/// The system in an SSP package (`.ssp`, or `.ssp#Variant.ssd` for another structure in it) or in a structure with its files
/// (`.ssd`), and the temporary folders with its FMUs: keep them while the scenario is in use. `fmus`, which run it, keep
/// the FMUs' descriptions.
///
/// # Errors
/// When a file of the system cannot be read, connected units do not convert, a value does not fit, or the run does not
/// end after it starts.
pub fn read(path: &Path, times: Times, fmus: &mut LoadedFmus) -> Result<(Scenario, Unpacked)> {
    let mut unpacked = Unpacked::default();
    let (file, variant) = package_and_structure(path);
    let is_structure = file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("ssd"));
    let (structure, base) = if is_structure {
        let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        (name, Base::of_structure(&file))
    } else {
        (variant.unwrap_or_else(|| DEFAULT_STRUCTURE.to_owned()), Base::of_package(unpacked.add(&file)?))
    };
    let scenario = of_structure(&structure, &base, times, (&mut unpacked, fmus))
        .with_context(|| format!("the system in {}", path.display()));
    let mut scenario = scenario.map_err(|error| unpacked.named(&error))?;
    scenario.files.push(file);
    Ok((scenario, unpacked))
}

/// The package and the structure of a path such as `package.ssp#Variant.ssd`, as in the source of a component; else the file.
fn package_and_structure(path: &Path) -> (PathBuf, Option<String>) {
    let text = path.to_string_lossy();
    let parts = text.rsplit_once('#').filter(|(package, _)| !path.exists() && Path::new(package).is_file());
    match parts {
        Some((package, structure)) => (package.into(), Some(structure.to_owned())),
        None => (path.to_owned(), None),
    }
}

fn of_structure(
    structure: &str,
    base: &Base,
    times: Times,
    (unpacked, fmus): (&mut Unpacked, &mut LoadedFmus),
) -> Result<Scenario> {
    let (description, base) = base.structure(structure)?;
    let SystemDescription { system, start_time, stop_time, step_size, notes } = description;
    for note in notes {
        complain(&format!("note: {structure}: {note}"));
    }
    let own = Times { start: start_time, stop: stop_time, step: step_size };
    let name = system.name.clone();
    let mut scenario = times.or(own).scenario(&name)?;
    let mut elements = Elements::default();
    elements.add(system, None, &base, unpacked)?;
    if elements.fmus.is_empty() {
        complain(&format!("note: {name} has no FMUs: the values of its connectors are recorded"));
    }
    connected::connect(&mut elements, &mut scenario, &name)?;
    for SystemFmu { member, description } in elements.fmus {
        fmus.describe(&member.file, description);
        scenario.fmus.push(member);
    }
    Ok(scenario)
}
