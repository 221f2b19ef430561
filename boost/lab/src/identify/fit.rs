//! The results of a fit, and the values of the plant from which fits start.

use std::collections::BTreeMap;
use std::sync::Arc;

use anyhow::{Result, bail};
use boost_fmu::plant::system::System;
use boost_fmu::plant::variables::Parameters;
use fmu_io::terminal::number;
use fmu_master::Fmu;
use fmu_package::ParameterSet;
use fmu_plot::Figure;
use serde::{Serialize, Serializer};

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
    pub fn new(name: &str, reason: &str) -> Self {
        Self { name: name.to_owned(), reason: reason.to_owned() }
    }

    /// A parameter that is left out for a large standard error.
    pub fn uncertain(name: &str, relative_error: f64) -> Self {
        Self::new(name, &format!("its standard error would be {:.0} % of it", 100.0 * relative_error))
    }
}

#[derive(Clone, Debug, Serialize)]
pub struct Fit {
    pub title: String,
    pub method: String,
    /// The residuals of the measurements.
    pub residuals: Vec<Residuals>,
    #[serde(skip)]
    pub drawing: Figure,
    pub parameters: Vec<ParameterEstimate>,
}

/// A fit, with those of its parameters not determined by the data.
pub type FitOutcome = Result<(Fit, Vec<Unidentified>)>;

/// The residuals of a fit.
#[derive(Clone, Debug, Serialize)]
pub struct Residuals {
    pub name: String,
    /// The unit of the three numbers.
    pub unit: String,
    /// The root mean square over the tuning data.
    pub tuning: Option<f64>,
    /// The root mean square over the validation data.
    pub validation: Option<f64>,
    /// The measurement noise, if each residual belongs to a single measurement.
    pub noise: Option<f64>,
}

/// Known values of the plant.
#[derive(Clone, Debug)]
pub struct Known {
    pub plant: Parameters,
    pub ambient_pressure: f64,
    pub ambient_temperature: f64,
    /// The actuation with these parameters.
    pub system: System,
    /// The plant's values of the parameters that are identified, with their units.
    sought: BTreeMap<&'static str, (f64, String)>,
}

/// A parameter's place among the plant's.
type PlaceIn = fn(&mut Parameters) -> &mut f64;

/// The parameters that count as known: names in report.json and in the plant, and places.
const KNOWN: [(&str, &str, PlaceIn); 13] = [
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
    /// The values of a plant with parameter sets; `identified` are the parameters sought, and whether they are positive.
    pub fn read(
        plant: &Arc<Fmu>,
        sets: &[ParameterSet],
        identified: &[(&'static str, bool)],
    ) -> Result<Self> {
        let mut instance = plant.instantiate("plant")?;
        instance.set_up(0.0, None)?;
        for set in sets {
            instance.set_parameters(set)?;
        }
        instance.enter_initialization()?;
        let mut get = |name: &str| instance.get(name);
        let mut sought = BTreeMap::new();
        for &(name, is_positive) in identified {
            let value = get(name)?;
            if is_positive && value <= 0.0 {
                bail!("{name} is {}: must be above 0, since a fit starts from it", number(value));
            }
            sought.insert(name, (value, plant.variable(name)?.unit.clone()));
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
    pub fn value(&self, name: &str) -> f64 {
        self.sought[name].0
    }

    pub fn estimate(&self, name: &str, value: f64, standard_error: f64) -> ParameterEstimate {
        let (plant_value, unit) = self.sought[name].clone();
        ParameterEstimate { name: name.to_owned(), value, standard_error, unit, plant_value }
    }
}
