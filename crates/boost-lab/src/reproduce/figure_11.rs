//! Fig. 11: full load with the low-pressure wastegate shut and open; the high-pressure one limits boost.

use anyhow::Result;

use super::measure::{at, greatest, least};
use super::{Claim, Evidence, Laboratory, shipped, steps};
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
    Ok(Evidence {
        drawings: vec![(
            "Torque, boost pressure and pressure upstream of the turbines at full load.".into(),
            figure.into(),
        )],
        claims: vec![
            Claim::prediction(
                "speed_of_greatest_torque",
                open.best_speed() - closed.best_speed(),
                "rpm",
                125.0..,
            )
            .paper("The LP wastegate fully closed gives maximum torque at lower engine speed.")
            .how(
                "Speed of maximum engine_torque with the LP wastegate open, minus that with it \
                     shut. The bound is one step of the speed grid, 125 rpm.",
            ),
            Claim::prediction(
                "torque_gained",
                closed.value_at(&closed.torques, 1500.0) - open.value_at(&open.torques, 1500.0),
                "N m",
                1.0..,
            )
            .paper("The same: more torque at low speed.")
            .how("Torque at 1500 rpm, shut minus open. The bound requires a gain."),
            Claim::prediction(
                "torque_lost_at_2000_rpm",
                greatest_torque - closed.value_at(&closed.torques, 2000.0),
                "N m",
                1.0..,
            )
            .paper("Up to 2000 rpm, where the torque begins to decrease.")
            .how(
                "Maximum torque with the LP wastegate shut, minus that at 2000 rpm. The bound \
                     requires a loss.",
            ),
            Claim::prediction(
                "back_pressure_at_2000_rpm",
                1e-3 * closed.value_at(&closed.back_pressures, 2000.0),
                "kPa",
                250.0..,
            )
            .paper("At 2000 rpm the back pressure reaches too high values.")
            .how(
                "exhaust_manifold_pressure with the LP wastegate shut. The paper prints no number; \
                     the bound puts it above the boost limit of 240 kPa, so that the engine pumps \
                     against it.",
            ),
            Claim::prediction("torque_gained_open_above_2000_rpm", least(gained), "%", 0.0..)
                .paper("Above 2000 rpm the open LP wastegate gives more torque.")
                .how("Smallest gain of torque at engine speeds above 2000 rpm, open over shut.")
                .differs(
                    "the turbocharger maps are not published; here the shut wastegate gives more, at higher back \
                     pressure",
                ),
        ],
        notes: vec![],
    })
}
