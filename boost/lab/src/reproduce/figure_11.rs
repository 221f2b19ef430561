//! Fig. 11: full load with the low-pressure wastegate shut and open; the high-pressure one limits boost.

use anyhow::Result;

use super::measure::{at, greatest, least};
use super::{Evidence, Laboratory, shipped, steps};
use fmu_master::scenario::{Scenario, Signal};
use fmu_plot::{Figure, Line, Panel, color};
use fmu_record::Record;

/// Full load over engine speed.
struct FullLoad {
    speeds: Vec<f64>,
    torques: Vec<f64>,
    boosts: Vec<f64>,
    back_pressures: Vec<f64>,
}

impl FullLoad {
    /// The values at the end of each step of the speed.
    fn new(scenario: &Scenario, record: &Record) -> Result<Self> {
        let steps = steps(scenario, "engine_speed");
        let read = |name| steps.iter().map(|&(.., end)| at(record, name, end)).collect::<Result<Vec<_>>>();
        Ok(Self {
            speeds: steps.iter().map(|&(_, speed, _)| speed).collect(),
            torques: read("engine_torque")?,
            boosts: read("boost_pressure")?,
            back_pressures: read("exhaust_manifold_pressure")?,
        })
    }

    /// The speed of maximum torque (rpm).
    fn best_speed(&self) -> f64 {
        let points = self.speeds.iter().zip(&self.torques);
        points.max_by(|a, b| a.1.total_cmp(b.1)).map_or(f64::NAN, |(speed, _)| *speed)
    }

    fn value_at(&self, values: &[f64], speed: f64) -> f64 {
        let points = self.speeds.iter().zip(values);
        points.clone().find(|(known, _)| (**known - speed).abs() < 0.5).map_or(f64::NAN, |(_, value)| *value)
    }
}

pub fn reproduce(laboratory: &mut Laboratory) -> Result<Evidence> {
    let scenario = laboratory.scenario(shipped!("figure_11.toml"))?;
    let mut open = scenario.clone();
    open.set_own_input("plant", "lp_wastegate", Signal::Constant(1.0))?;
    let closed = FullLoad::new(&scenario, &laboratory.run(&scenario)?)?;
    let open = FullLoad::new(&open, &laboratory.run(&open)?)?;

    let panel = |label, factor: f64, values: fn(&FullLoad) -> &[f64]| {
        let line = |load: &FullLoad| {
            Line::new(&load.speeds, values(load).iter().map(|value| factor * value).collect::<Vec<_>>())
                .markers()
        };
        Panel::new("engine speed (rpm)", label)
            .height(150)
            .line(line(&closed).label("LP wastegate shut"))
            .line(line(&open).dashed().color(color::VERMILION).label("LP wastegate open"))
    };
    let figure = Figure::new()
        .row([panel("torque (N m)", 1.0, |load| &load.torques)])
        .row([panel("boost pressure (kPa)", 1e-3, |load| &load.boosts)])
        .row([panel("back pressure (kPa)", 1e-3, |load| &load.back_pressures)])
        .shared_x();
    let greatest_torque = greatest(closed.torques.iter().copied());
    let above = closed
        .speeds
        .iter()
        .zip(closed.torques.iter().zip(&open.torques))
        .filter(|(speed, _)| **speed > 2000.0);
    let gained = above.map(|(_, (closed, open))| 100.0 * (open / closed - 1.0));
    let results = vec![
        ("speed_of_greatest_torque", open.best_speed() - closed.best_speed()),
        ("torque_gained", closed.value_at(&closed.torques, 1500.0) - open.value_at(&open.torques, 1500.0)),
        ("torque_lost_at_2000_rpm", greatest_torque - closed.value_at(&closed.torques, 2000.0)),
        ("back_pressure_at_2000_rpm", 1e-3 * closed.value_at(&closed.back_pressures, 2000.0)),
        ("torque_gained_open_above_2000_rpm", least(gained)),
    ];
    let caption = "Torque, boost pressure and pressure upstream of the turbines at full load.";
    Ok(Evidence::new(results).drawing(caption, figure))
}
