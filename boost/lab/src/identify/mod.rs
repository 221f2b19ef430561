//! Identifies the wastegate actuation from measured data, as in section 4.2 of the paper: the valve's pressure and
//! leakage over duty, the spring with its friction, and the dynamics.
//!
//! There are four fits: eq. (7) from chamber pressure at rest (`valve`), eq. (6) from tank pressure (`valve`), spring
//! and friction from positions at rest (`rod`), and the valve's areas and delays, mass and damping from the transients
//! after steps (`motion`). Parameters not determined by the data are listed by name and keep the plant's values.

mod data;
mod fit;
mod motion;
mod phases;
mod points;
mod report;
mod rod;
mod statistics;
mod valve;

use std::path::Path;
use std::sync::Arc;

use anyhow::{Result, bail};
use fmu_package::{Parameter, ParameterSet, Value};
use serde::Serialize;

use self::data::Data;
pub use self::data::{Naming, quantities};
pub use self::fit::ParameterEstimate;
use self::fit::{Fit, FitOutcome, Known, Residuals, Unidentified};
use self::phases::MeasurementNoise;
pub use self::report::{html, json};
use fmu_master::Fmu;

/// Larger residuals, relative to the measurement's noise, lead to a note.
const MOST_RESIDUAL: f64 = 1.5;

#[derive(Serialize)]
pub struct Identification {
    #[serde(rename = "data")]
    pub file: String,
    rows: usize,
    duration: f64,
    phases_at_rest: usize,
    noise: Option<MeasurementNoise>,
    /// The parameters not determined by the data.
    pub unidentified: Vec<Unidentified>,
    /// The fits, in order.
    pub fits: Vec<Fit>,
    known: Known,
    /// Notes for readers of the results.
    pub notes: Vec<String>,
}

/// Identifies a plant's actuation from a CSV file. Prior values are the plant's, with the parameter sets applied.
pub fn identify(
    path: &Path,
    naming: &Naming,
    plant: &Arc<Fmu>,
    sets: &[ParameterSet],
    validation_share: f64,
) -> Result<Identification> {
    let mut data = Data::read(path, naming)?;
    let polynomials = valve::PRESSURE.iter().chain(&valve::LEAKAGE).map(|&name| (name, false));
    let positive = rod::NAMES.iter().chain(&motion::NAMES).chain([&valve::PUMP]).map(|&name| (name, true));
    let mut known = Known::read(plant, sets, &polynomials.chain(positive).collect::<Vec<_>>())?;
    let mut notes = vec![];
    for (values, known, name, unit) in [
        (&data.ambient_pressure, &mut known.ambient_pressure, "ambient pressure", "Pa"),
        (&data.ambient_temperature, &mut known.ambient_temperature, "ambient temperature", "K"),
    ] {
        match values {
            Some(values) => *known = statistics::mean(values),
            None => notes.push(format!("The data have no {name}; assumed to be {known} {unit}.")),
        }
    }
    if data.pump.is_none() {
        notes.push("The data have no pump signal; the pump is assumed to be off.".to_owned());
    }
    if data.position_is_relative {
        for position in &mut data.position {
            *position *= known.plant.actuator.stroke;
        }
        notes.push(format!("The position is a fraction of the stroke, {} m.", known.plant.actuator.stroke));
    }
    let phases = phases::phases(&data, &known, validation_share);
    let noise = phases::noise(&data, &phases);
    let rests: Vec<_> = phases.iter().filter_map(|phase| phase.rest.as_ref()).collect();
    let mut identification = Identification {
        file: path.display().to_string(),
        rows: data.time.len(),
        duration: data.time[data.time.len() - 1] - data.time[0],
        phases_at_rest: rests.len(),
        noise,
        fits: vec![],
        unidentified: vec![],
        notes,
        known,
    };
    let known = identification.known.clone();
    identification.take(&valve::PRESSURE, valve::pressure(&rests, &known));
    identification.take(&valve::FROM_TANK, valve::leakage(&data, &phases, &known));
    let (prior, outcome) = rod::identify(&data, &rests, &known, noise);
    identification.take(&rod::NAMES, outcome);
    let pressure = valve::PRESSURE.map(|name| identification.value(name));
    let validates = |index| phases::validates(index, validation_share);
    let outcome = motion::identify(&data, &phases, &known, pressure, noise, &prior, validates);
    identification.take(&motion::NAMES, outcome);
    for (fit, residuals) in
        identification.fits.iter().flat_map(|fit| fit.residuals.iter().map(move |each| (fit, each)))
    {
        let Residuals { name, tuning: Some(tuning), noise: Some(noise), .. } = residuals else { continue };
        if *tuning > MOST_RESIDUAL * noise {
            identification.notes.push(format!(
                "{}: the {name} residuals are {:.1} times the noise at rest. Either the model does not describe the \
                 measurement, or the fit started too far from it; errors may be larger than stated.",
                fit.title,
                tuning / noise
            ));
        }
    }
    if identification.fits.is_empty() {
        let mut reasons: Vec<_> = identification.unidentified.into_iter().map(|each| each.reason).collect();
        reasons.dedup();
        bail!(
            "{}, lines 2 to {}: expected duty steps, each held for more than a second; of {} phases of constant duty, \
             supply and pump, the actuator comes to rest in {}. Nothing can be identified:\n  {}",
            identification.file,
            data.last_line,
            phases.len(),
            rests.len(),
            reasons.join("\n  ")
        );
    }
    Ok(identification)
}

impl Identification {
    fn take(&mut self, names: &[&str], outcome: FitOutcome) {
        match outcome {
            Ok((fit, unidentified)) => {
                self.fits.push(fit);
                self.unidentified.extend(unidentified);
            }
            Err(error) => {
                let reason = format!("{error:#}");
                self.unidentified.extend(names.iter().map(|name| Unidentified::new(name, &reason)));
            }
        }
    }

    /// The identified value of a parameter, else the known one.
    fn value(&self, name: &str) -> f64 {
        let found = self.parameters().find(|estimate| estimate.name == name);
        found.map_or_else(|| self.known.value(name), |estimate| estimate.value)
    }

    pub fn parameters(&self) -> impl Iterator<Item = &ParameterEstimate> {
        self.fits.iter().flat_map(|fit| &fit.parameters)
    }

    /// The parameter set for the plant.
    pub fn parameter_set(&self, plant: &Fmu) -> ParameterSet {
        let parameter = |estimate: &ParameterEstimate| Parameter {
            name: estimate.name.clone(),
            description: format!("standard error {:.2e}", estimate.standard_error),
            value: Value::Real(estimate.value, (!estimate.unit.is_empty()).then(|| estimate.unit.clone())),
        };
        ParameterSet {
            name: "identified_actuator".to_owned(),
            description: format!("identified from {}", self.file),
            parameters: self.parameters().map(parameter).collect(),
            units: plant.description().units.clone(),
        }
    }
}
