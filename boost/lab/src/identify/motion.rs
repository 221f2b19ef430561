//! The dynamics: the valve's areas, proportional band and time constant, and the rod's mass and damping, from the
//! transients after steps of the duty or the supply.
//!
//! Chamber pressure and rod position are computed from eqs. (1) to (5) and (8) with measured duty, supply and tank
//! pressure, and compared with the measurements. Spring and friction are free within the uncertainty of their estimates
//! at rest, which thereby enters the standard errors.

use std::ops::Range;

use anyhow::{Context, Result, bail};
use boost_fmu::plant::system::System;
use boost_fmu::plant::variables::{ActuationStates, ActuatorParameters, ActuatorStates, Inputs};
use nalgebra::{DMatrix, DVector};

use super::data::Data;
use super::phases::{MeasurementNoise, Phase, Rest, is_after_gap, plunger_duty};
use super::points::{ResidualPoint, residual_panel, residuals, with_measured};
use super::rod::{Prior, STOPS};
use super::statistics::{Reliable, Solution, nonlinear};
use super::{Fit, FitOutcome, Known, Residuals, Unidentified};
use fmu_plot::{Figure, Line, Panel, color};
use fmu_record::numbers::quantity;

pub const NAMES: [&str; 6] = [
    "valve.tank_area",
    "valve.ambient_area",
    "valve.proportional_band",
    "valve.time_constant",
    "actuator.damping",
    "actuator.mass",
];
/// The number of these fitted first: the areas and the valve.
const STAGES: [usize; 2] = [2, 4];
/// The part of a transient used (s).
const DURATION: f64 = 0.6;
/// The minimum change of chamber pressure (Pa) in a usable transient.
const LEAST_CHANGE: f64 = 3000.0;
/// The longest step of the integration (s).
const LONGEST_STEP: f64 = 0.6e-3;
/// The largest product of step and fastest eigenvalue: the Runge-Kutta method is stable up to 2.7.
const STABLE: f64 = 2.5;
/// The most halvings of a step: a fit with a rod of a few grams has failed.
const MOST_HALVINGS: f64 = 3.0;
/// The minimum noise: quantization may hide the noise, and the model is not exact.
const LEAST_NOISE: MeasurementNoise = MeasurementNoise { chamber: 10.0, position: 1e-6 };
/// The horizontal axis of the drawing.
const TIME: &str = "time after the step (s)";

struct Transient<'a> {
    before: &'a Rest,
    rows: Range<usize>,
    change: f64,
    validates: bool,
}

/// The plant's actuation with the parameters of a simulation.
struct Model<'a> {
    known: &'a Known,
    system: System,
}

impl Model<'_> {
    /// The longest stable step (s) with the rod in its stops. Found by halving, so that it rarely changes during
    /// numerical differentiation.
    fn longest_step(&self) -> f64 {
        let rod = &self.system.actuator.parameters;
        // No eigenvalue of a damped spring is faster.
        let fastest =
            ((rod.damping + rod.stop_damping) / rod.mass).max((rod.stop_stiffness / rod.mass).sqrt());
        LONGEST_STEP * (STABLE / (fastest * LONGEST_STEP)).log2().floor().clamp(-MOST_HALVINGS, 0.0).exp2()
    }

    /// Chamber pressure and position at the rows after a transient's first.
    fn simulate(&self, data: &Data, transient: &Transient<'_>) -> Vec<(f64, f64)> {
        let Rest { duty, chamber, position, .. } = *transient.before;
        let Known { ambient_pressure, ambient_temperature, .. } = *self.known;
        let ActuatorParameters { membrane_area, stroke, stop_stiffness, .. } = self.known.plant.actuator;
        let actuator = &self.system.actuator;
        let coulomb = actuator.parameters.coulomb_friction;
        let force = (ambient_pressure - chamber) * membrane_area - actuator.spring_force(position);
        // The rest of the balance is friction between the stops, and otherwise the stop's force.
        let friction = force.clamp(-coulomb, coulomb);
        let left = force - friction;
        let position = if position < STOPS * stroke && left < 0.0 {
            left / stop_stiffness
        } else if position > (1.0 - STOPS) * stroke && left > 0.0 {
            stroke + left / stop_stiffness
        } else {
            position
        };
        // The mean, since supply noise would shake the rod and make its friction appear too small.
        let commanded = plunger_duty(data, transient.rows.clone(), self.known);
        let longest = self.longest_step();
        let inputs = Inputs {
            hp_wastegate_pwm: commanded,
            supply_voltage: self.known.plant.valve.nominal_voltage,
            vacuum_pump: 0.0,
            ambient_pressure,
            ambient_temperature,
            ..Inputs::default()
        };
        let rates = |states: &ActuationStates, tank: f64| {
            let mut states = *states;
            states.tank.pressure = tank;
            self.system.actuation(&inputs, &states, 0.0).derivatives
        };
        let mut states = ActuationStates::NOMINAL;
        states.valve.plunger_duty = duty;
        states.actuator =
            ActuatorStates { chamber_pressure: chamber, position, velocity: 0.0, friction_force: friction };
        let mut results = vec![];
        for row in transient.rows.clone().skip(1) {
            let interval = data.time[row] - data.time[row - 1];
            let steps = (interval / longest).ceil().max(1.0);
            let step = interval / steps;
            let tank = |part: f64| data.tank[row - 1] + part * (data.tank[row] - data.tank[row - 1]);
            let mut done = 0.0;
            while done < steps {
                let [begin, middle, end] = [0.0, 0.5, 1.0].map(|part| tank((done + part) / steps));
                let moved = |rates: &ActuationStates, part: f64| {
                    states.combine(rates, &mut |state, rate| state + part * step * rate)
                };
                let k1 = rates(&states, begin);
                let k2 = rates(&moved(&k1, 0.5), middle);
                let k3 = rates(&moved(&k2, 0.5), middle);
                let k4 = rates(&moved(&k3, 1.0), end);
                for (slopes, weight) in [(k1, 1.0), (k2, 2.0), (k3, 2.0), (k4, 1.0)] {
                    states = states.combine(&slopes, &mut |state, slope| state + step / 6.0 * weight * slope);
                }
                done += 1.0;
            }
            results.push((states.actuator.chamber_pressure, states.actuator.position));
        }
        results
    }
}

fn transients<'a>(data: &Data, phases: &'a [Phase], validates: impl Fn(usize) -> bool) -> Vec<Transient<'a>> {
    let mut transients = vec![];
    for pair in phases.windows(2) {
        let [before, after] = pair else { continue };
        // With the tank, chamber pressure would still drift.
        let Some(rest) = before.rest.as_ref().filter(|rest| !rest.is_limited_by_tank) else { continue };
        if is_after_gap(data, after.rows.start) {
            continue;
        }
        let end = data.time[after.rows.start] + DURATION;
        let count = data.time[after.rows.clone()].partition_point(|&time| time <= end);
        let rows = after.rows.start..after.rows.start + count;
        let change = data.chamber[rows.end - 1] - rest.chamber;
        if change.abs() > LEAST_CHANGE && rows.len() > 3 {
            let validates = validates(transients.len());
            transients.push(Transient { before: rest, rows, change, validates });
        }
    }
    transients
}

/// The fit. `pressure` are the coefficients of eq. (7).
pub fn identify(
    data: &Data,
    phases: &[Phase],
    known: &Known,
    pressure: [f64; 4],
    noise: Option<MeasurementNoise>,
    prior: &Prior,
    validates: impl Fn(usize) -> bool,
) -> FitOutcome {
    const LEAST_TRANSIENTS: usize = 4;
    let noise = noise.context("no phase at rest from which a transient could start")?;
    let transients = transients(data, phases, validates);
    let tuning: Vec<_> = transients.iter().filter(|transient| !transient.validates).collect();
    if tuning.len() < LEAST_TRANSIENTS {
        bail!(
            "needs {LEAST_TRANSIENTS} transients: steps from a phase at rest that move the chamber pressure by {} kPa; \
             the tuning data have {}",
            1e-3 * LEAST_CHANGE,
            tuning.len()
        );
    }
    let (free, mut unidentified) = seen(&tuning);
    let noise = MeasurementNoise {
        chamber: noise.chamber.max(LEAST_NOISE.chamber),
        position: noise.position.max(LEAST_NOISE.position),
    };
    let problem = TransientFit { data, known, pressure, noise, prior, whitening: whitening(prior)?, tuning };
    // The error of a logarithm is the relative error.
    let Reliable { free, solution, left_out } =
        Reliable::fit(free, |free| problem.fit(free), |solution, place, _| solution.standard_error(place))?;
    unidentified.extend(left_out.iter().map(|&(index, error)| Unidentified::uncertain(NAMES[index], error)));
    let model = problem.model(&free, solution.parameters.as_slice());
    let parameters = free
        .iter()
        .enumerate()
        .map(|(position, &index)| {
            let value = solution.parameters[position].exp();
            known.estimate(NAMES[index], value, value * solution.standard_error(position))
        })
        .collect();
    let (drawing, residuals) = results(data, &transients, &model, noise);
    Ok((
        Fit {
            title: "Transients: valve, mass and damping, eqs. (1), (3), (4) and (8)".to_owned(),
            method: format!(
                "Nonlinear least squares of chamber pressure and position over {DURATION} s after {} steps, computed \
                 from measured duty, supply and tank pressure and weighted by their noise at rest, {} and {}. The \
                 areas are proportional to the chamber volume, assumed to be {:e} m\u{b3}.",
                problem.tuning.len(),
                quantity(noise.chamber, "Pa"),
                quantity(noise.position, "m"),
                known.plant.actuator.chamber_volume
            ),
            residuals,
            drawing,
            parameters,
        },
        unidentified,
    ))
}

/// The fitted transients. The parameters are the logarithms of the free ones, in the order of [`NAMES`], then the
/// rod's, in the units of their own fit.
struct TransientFit<'a> {
    data: &'a Data,
    known: &'a Known,
    pressure: [f64; 4],
    noise: MeasurementNoise,
    prior: &'a Prior,
    whitening: DMatrix<f64>,
    tuning: Vec<&'a Transient<'a>>,
}

impl<'a> TransientFit<'a> {
    fn model(&self, free: &[usize], values: &[f64]) -> Model<'a> {
        let mut own = NAMES.map(|name| self.known.value(name));
        for (&index, value) in free.iter().zip(values) {
            own[index] = value.exp();
        }
        let mut rod = self.prior.parameters.clone();
        for (&index, value) in self.prior.free.iter().zip(&values[free.len()..]) {
            rod[index] = *value;
        }
        let mut system = self.known.system;
        system.actuator = Prior::rod(&rod, self.known).actuator;
        let (valve, rod) = (&mut system.valve.parameters, &mut system.actuator.parameters);
        valve.pressure_coefficient = self.pressure;
        [
            valve.tank_area,
            valve.ambient_area,
            valve.proportional_band,
            valve.time_constant,
            rod.damping,
            rod.mass,
        ] = own;
        Model { known: self.known, system }
    }

    /// Residuals relative to the noise, and the differences of the rod's parameters from those at rest, relative to
    /// their standard errors.
    fn residuals(&self, free: &[usize], values: &[f64]) -> Vec<f64> {
        let model = self.model(free, values);
        let mut residuals = vec![];
        for transient in &self.tuning {
            let rows = transient.rows.clone().skip(1).zip(model.simulate(self.data, transient));
            for (row, (chamber, position)) in rows {
                residuals.push((self.data.chamber[row] - chamber) / self.noise.chamber);
                residuals.push((self.data.position[row] - position) / self.noise.position);
            }
        }
        let rod = self.prior.free.iter().zip(&values[free.len()..]);
        let differences = rod.map(|(&index, value)| self.prior.parameters[index] - value);
        let differences = DVector::from_iterator(self.prior.free.len(), differences);
        residuals.extend((&self.whitening * differences).iter());
        residuals
    }

    /// Fits the most influential parameters first, since a distant start may end in a local minimum.
    fn fit(&self, free: &[usize]) -> Result<Solution> {
        let mut lengths: Vec<_> =
            self.tuning.iter().map(|transient| 2 * (transient.rows.len() - 1)).collect();
        lengths.extend(self.prior.free.iter().map(|_| 1));
        let own = free.iter().map(|&index| self.known.value(NAMES[index]).ln());
        let rod = self.prior.free.iter().map(|&index| self.prior.parameters[index]);
        let mut begin: Vec<_> = own.chain(rod).collect();
        for stage in STAGES {
            let count = free.iter().filter(|&&index| index < stage).count();
            let with = |values: &[f64]| [values, &begin[count..]].concat();
            // If it does not converge, the next fit starts where this one did.
            if count > 0
                && let Ok(solution) =
                    nonlinear(&begin[..count], &lengths, 1.0, |values| self.residuals(free, &with(values)))
            {
                begin = with(solution.parameters.as_slice());
            }
        }
        // The residuals are relative to the noise, so that their variance is at least 1.
        nonlinear(&begin, &lengths, 1.0, |values| self.residuals(free, values))
    }
}

/// Turns differences of the rod's parameters from the prior into units of its standard errors.
fn whitening(prior: &Prior) -> Result<DMatrix<f64>> {
    const INDEFINITE: &str = "the covariance of the rod's errors is not positive definite";
    let Some(solution) = &prior.solution else { return Ok(DMatrix::zeros(0, 0)) };
    let factor = solution.covariance.clone().cholesky().context(INDEFINITE)?;
    factor.l().try_inverse().context(INDEFINITE)
}

/// The parameters that act in the transients: each valve port opens in only one direction.
fn seen(transients: &[&Transient<'_>]) -> (Vec<usize>, Vec<Unidentified>) {
    let mut free: Vec<usize> = (0..NAMES.len()).collect();
    let mut unidentified = vec![];
    for (index, sign, what) in [(0, -1.0, "falls"), (1, 1.0, "rises")] {
        if !transients.iter().any(|transient| sign * transient.change > 0.0) {
            free.retain(|&other| other != index);
            let reason = format!("the tuning data have no transient in which the chamber pressure {what}");
            unidentified.push(Unidentified::new(NAMES[index], &reason));
        }
    }
    (free, unidentified)
}

/// The largest transients in each direction, of the tuning and of the validation data, and the residuals of all.
fn results(
    data: &Data,
    transients: &[Transient<'_>],
    model: &Model<'_>,
    noise: MeasurementNoise,
) -> (Figure, Vec<Residuals>) {
    let simulated: Vec<_> = transients.iter().map(|transient| model.simulate(data, transient)).collect();
    let points = |measured: fn(&Data, usize) -> f64, computed: fn(&(f64, f64)) -> f64| {
        let of_one = |(transient, results): (&Transient<'_>, &Vec<(f64, f64)>)| {
            let begin = data.time[transient.rows.start];
            let rows = transient.rows.clone().skip(1).zip(results);
            rows.map(|(row, result)| {
                let measured = measured(data, row);
                let residual = measured - computed(result);
                ResidualPoint {
                    place: data.time[row] - begin,
                    measured,
                    residual,
                    validates: transient.validates,
                }
            })
            .collect::<Vec<_>>()
        };
        transients.iter().zip(&simulated).map(of_one).collect::<Vec<_>>()
    };
    let pressure = points(|data, row| data.chamber[row], |result| result.0);
    let position = points(|data, row| 1e3 * data.position[row], |result| 1e3 * result.1);

    let drawn: Vec<usize> = [(false, -1.0), (false, 1.0), (true, -1.0), (true, 1.0)]
        .into_iter()
        .filter_map(|(validates, sign)| {
            let change = |index: &usize| sign * transients[*index].change;
            let chosen = (0..transients.len()).filter(|&index| transients[index].validates == validates);
            chosen.filter(|index| change(index) > 0.0).max_by(|a, b| change(a).total_cmp(&change(b)))
        })
        .collect();
    let panel = |all: &[Vec<ResidualPoint>], factor: f64, label: &str| {
        let mut panel = Panel::new(TIME, label).height(190);
        for (number, &index) in drawn.iter().enumerate() {
            let time: Vec<_> = all[index].iter().map(|point| point.place).collect();
            let computed = all[index].iter().map(|point| factor * (point.measured - point.residual));
            let line = Line::new(&time, computed).color(color::INK).thin();
            panel = panel.line(if number == 0 { line.label("computed") } else { line });
        }
        let scaled = |point: &ResidualPoint| ResidualPoint { measured: factor * point.measured, ..*point };
        let points: Vec<_> = drawn.iter().flat_map(|&index| all[index].iter().map(scaled)).collect();
        with_measured(panel, &points)
    };
    let [all_pressures, all_positions] = [pressure.concat(), position.concat()];
    let figure = Figure::new()
        .row([panel(&pressure, 1e-3, "chamber pressure (kPa)"), panel(&position, 1.0, "position (mm)")])
        .row([
            residual_panel(&all_pressures, TIME, "residual (Pa)").height(100),
            residual_panel(&all_positions, TIME, "residual (mm)").height(100),
        ])
        .shared_x();
    let residuals = vec![
        Residuals { noise: Some(noise.chamber), ..residuals("chamber pressure", "Pa", &all_pressures) },
        Residuals { noise: Some(1e3 * noise.position), ..residuals("position", "mm", &all_positions) },
    ];
    (figure, residuals)
}
