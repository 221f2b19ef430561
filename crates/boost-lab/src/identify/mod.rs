//! Identifies the wastegate actuation from measured data, as in section 4.2 of the paper: the valve's pressure and
//! leakage over duty, the spring with its friction, and the dynamics.
//!
//! There are four fits: eq. (7) from chamber pressure at rest (`valve`), eq. (6) from tank pressure (`valve`), spring
//! and friction from positions at rest (`rod`), and the valve's areas and delays, mass and damping from the transients
//! after steps (`motion`). Parameters not determined by the data are listed by name and keep the plant's values.

mod data;
mod motion;
mod phases;
mod points;
mod report;
mod rod;
mod statistics;
mod valve;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Result, bail};
use boost_fmu::plant::system::System;
use boost_fmu::plant::variables::Parameters;
use fmu_package::terminal::number;
use fmu_package::{Parameter, ParameterSet, Value};
use serde::{Serialize, Serializer};

use self::data::Data;
pub use self::data::{Naming, quantities};
use self::phases::MeasurementNoise;
pub use self::report::{html, json};
use fmu_master::Fmu;
use fmu_plot::Figure;

/// Larger residuals, relative to the measurement's noise, lead to a note.
const MOST_RESIDUAL: f64 = 1.5;

/// A plant parameter determined by the data.
#[derive(Clone, Debug, Serialize)]
pub struct ParameterEstimate {
    pub name: String,
    /// The estimate, in `unit`.
    pub value: f64,
    pub standard_error: f64,
    /// The unit, the plant's.
    pub unit: String,
    /// The plant's value without the identification.
    pub plant_value: f64,
}

/// A parameter not determined by the data.
#[derive(Clone, Debug, Serialize)]
pub struct Unidentified {
    pub name: String,
    pub reason: String,
}

impl Unidentified {
    fn new(name: &str, reason: &str) -> Self {
        Self { name: name.to_owned(), reason: reason.to_owned() }
    }

    /// For a large standard error.
    fn uncertain(name: &str, relative_error: f64) -> Self {
        Self::new(name, &format!("its standard error would be {:.0} % of it", 100.0 * relative_error))
    }
}

#[derive(Clone, Debug, Serialize)]
pub struct Fit {
    pub title: String,
    pub method: String,
    /// Of the measurements.
    pub residuals: Vec<Residuals>,
    #[serde(skip)]
    drawing: Figure,
    pub parameters: Vec<ParameterEstimate>,
}

/// A fit, with those of its parameters not determined by the data.
type FitOutcome = Result<(Fit, Vec<Unidentified>)>;

/// The residuals of a fit.
#[derive(Clone, Debug, Serialize)]
pub struct Residuals {
    pub name: String,
    /// The unit of the three numbers.
    pub unit: String,
    /// The root mean square over the tuning data.
    pub tuning: Option<f64>,
    /// The same over the validation data.
    pub validation: Option<f64>,
    /// The measurement noise, if each residual belongs to a single measurement.
    pub noise: Option<f64>,
}

/// Known values of the plant.
#[derive(Clone, Debug)]
pub struct Known {
    plant: Parameters,
    ambient_pressure: f64,
    ambient_temperature: f64,
    /// The actuation with these parameters.
    system: System,
    /// The plant's values of the parameters that are identified, with their units.
    sought: BTreeMap<&'static str, (f64, String)>,
}

/// The parameters that count as known: names in report.json and in the plant, and places.
const KNOWN: [(&str, &str, fn(&mut Parameters) -> &mut f64); 13] = [
    ("gas_constant", "air.gas_constant", |plant| &mut plant.air.gas_constant),
    ("heat_capacity_ratio", "air.heat_capacity_ratio", |plant| &mut plant.air.heat_capacity_ratio),
    ("linear_pressure_ratio", "valve.linear_pressure_ratio", |plant| &mut plant.valve.linear_pressure_ratio),
    ("nominal_voltage", "valve.nominal_voltage", |plant| &mut plant.valve.nominal_voltage),
    ("voltage_exponent", "valve.voltage_exponent", |plant| &mut plant.valve.voltage_exponent),
    ("leakage_area_scale", "valve.leakage_area_scale", |plant| &mut plant.valve.leakage_area_scale),
    ("tank_volume", "tank.volume", |plant| &mut plant.tank.volume),
    ("membrane_area", "actuator.membrane_area", |plant| &mut plant.actuator.membrane_area),
    ("chamber_volume", "actuator.chamber_volume", |plant| &mut plant.actuator.chamber_volume),
    ("stroke", "actuator.stroke", |plant| &mut plant.actuator.stroke),
    ("stop_stiffness", "actuator.stop_stiffness", |plant| &mut plant.actuator.stop_stiffness),
    ("stop_damping", "actuator.stop_damping", |plant| &mut plant.actuator.stop_damping),
    ("stop_damping_depth", "actuator.stop_damping_depth", |plant| &mut plant.actuator.stop_damping_depth),
];

impl Serialize for Known {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut plant = self.plant;
        let parameters = KNOWN.map(|(name, _, place)| (name, *place(&mut plant)));
        let ambient =
            [("ambient_pressure", self.ambient_pressure), ("ambient_temperature", self.ambient_temperature)];
        serializer.collect_map(parameters.into_iter().chain(ambient))
    }
}

impl Known {
    fn read(plant: &Arc<Fmu>, sets: &[ParameterSet]) -> Result<Self> {
        let mut instance = plant.instantiate("plant")?;
        instance.set_up(0.0, None)?;
        for set in sets {
            instance.set_parameters(set)?;
        }
        instance.enter_initialization()?;
        let mut get = |name: &str| instance.number(name);
        let mut sought = BTreeMap::new();
        let polynomials = valve::PRESSURE.iter().chain(&valve::LEAKAGE);
        let positive = rod::NAMES.iter().chain(&motion::NAMES).chain([&valve::PUMP]);
        for (name, is_positive) in
            polynomials.map(|name| (name, false)).chain(positive.map(|name| (name, true)))
        {
            let value = get(name)?;
            if is_positive && value <= 0.0 {
                bail!("{name} is {}: must be above 0, since a fit starts from it", number(value));
            }
            sought.insert(*name, (value, plant.variable(name)?.unit.clone()));
        }
        let mut parameters = Parameters::default();
        for (_, name, place) in KNOWN {
            *place(&mut parameters) = get(name)?;
        }
        // The friction is Dahl's with α = 1, and the exhaust does not push.
        parameters.actuator.friction_exponent = 1.0;
        parameters.actuator.exhaust_area = 0.0;
        Ok(Self {
            ambient_pressure: get("ambient_pressure")?,
            ambient_temperature: get("ambient_temperature")?,
            system: System::new(&parameters),
            plant: parameters,
            sought,
        })
    }

    /// The plant's value of a parameter that is identified.
    fn value(&self, name: &str) -> f64 {
        self.sought[name].0
    }

    fn estimate(&self, name: &str, value: f64, standard_error: f64) -> ParameterEstimate {
        let (plant_value, unit) = self.sought[name].clone();
        ParameterEstimate { name: name.to_owned(), value, standard_error, unit, plant_value }
    }
}

pub struct Identification {
    pub file: String,
    rows: usize,
    duration: f64,
    known: Known,
    noise: Option<MeasurementNoise>,
    phases_at_rest: usize,
    /// The fits, in order.
    pub fits: Vec<Fit>,
    /// The parameters not determined by the data.
    pub unidentified: Vec<Unidentified>,
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
    let mut known = Known::read(plant, sets)?;
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
