//! The rod at rest: spring and friction from the force balance, eq. (4), at its positions.
//!
//! Friction follows Dahl, eq. (5) with α = 1: over the distance x it approaches the Coulomb force of the direction,
//! `F(x) = ±F_c + (F(0) ∓ F_c)·exp(−σ|x|/F_c)`. So the force at a position depends on the rod's path.

use anyhow::{Context, Result, bail};
use boost_fmu::plant::STIFFEST_FRICTION;
use boost_fmu::plant::actuator::Actuator;

use super::data::Data;
use super::phases::{MeasurementNoise, Rest};
use super::points::{ResidualPoint, curve, drawing, residuals};
use super::statistics::{Reliable, Solution, nonlinear};
use super::{Fit, FitOutcome, Known, ParameterEstimate, Residuals, Unidentified};
use fmu_plot::Figure;

const COULOMB: &str = "actuator.coulomb_friction";
pub const NAMES: [&str; 5] = [
    "actuator.spring_preload",
    "actuator.spring_stiffness",
    "actuator.spring_hardening",
    COULOMB,
    "actuator.friction_stiffness",
];

/// The fraction of the stroke at either end in which a stop may hold the rod.
pub const STOPS: f64 = 0.02;
/// After this many lengths `F_c/σ`, friction no longer depends on its initial value.
const FORGOTTEN: f64 = 5.0;
/// The smallest reversal of the rod distinguished from noise, in standard deviations of the position.
const TURN: f64 = 5.0;

/// An actuator with the spring and friction of a fit.
#[derive(Clone, Copy, Debug)]
pub struct Rod {
    pub actuator: Actuator,
    /// `σ/F_c` (1/m).
    rate: f64,
}

/// Input for the fit of the motion: estimates with their covariance, in the fit's units.
pub struct Prior {
    pub free: Vec<usize>,
    pub parameters: Vec<f64>,
    pub solution: Option<Solution>,
}

impl Prior {
    /// A rod with parameters in the fit's units.
    pub fn rod(parameters: &[f64], known: &Known) -> Rod {
        let mut actuator = known.system.actuator;
        let rate = parameters[4].exp();
        let rod = &mut actuator.parameters;
        rod.spring_preload = parameters[0] * SCALES[0];
        rod.spring_stiffness = parameters[1] * SCALES[1];
        rod.spring_hardening = parameters[2] * SCALES[2];
        rod.coulomb_friction = parameters[3].exp();
        rod.friction_stiffness = rod.coulomb_friction * rate;
        Rod { actuator, rate }
    }
}

/// Units in which the spring's parameters are of the order of 1. For friction the logarithms are fitted, to keep it
/// above zero.
const SCALES: [f64; 3] = [10.0, 1e3, 1e15];

/// The rod at rest, with its path from the previous position: its reversals, and the last position.
struct Stand<'a> {
    rest: &'a Rest,
    way: Vec<f64>,
}

/// The friction at each stand as a fraction of the Coulomb force, 0 at the first.
fn friction(stands: &[Stand<'_>], rate: f64) -> Vec<f64> {
    let (mut friction, mut position) = (0.0, None);
    stands
        .iter()
        .map(|stand| {
            for &next in &stand.way {
                if let Some(before) = position.replace(next) {
                    let way: f64 = next - before;
                    let limit = 1.0_f64.copysign(way);
                    friction = limit + (friction - limit) * (-rate * way.abs()).exp();
                }
            }
            friction
        })
        .collect()
}

fn stands<'a>(data: &Data, rests: &[&'a Rest], noise: MeasurementNoise) -> Vec<Stand<'a>> {
    let mut stands: Vec<Stand<'a>> = vec![];
    for &rest in rests {
        let mut way = vec![];
        if let Some(before) = stands.last() {
            let from = before.rest;
            let rows = from.rows.end..rest.rows.start;
            let (low, high) = (from.position.min(rest.position), from.position.max(rest.position));
            let extreme = |sign: f64| {
                rows.clone().max_by(|&a, &b| (sign * data.position[a]).total_cmp(&(sign * data.position[b])))
            };
            let mut turns: Vec<_> = [extreme(1.0), extreme(-1.0)].into_iter().flatten().collect();
            turns.retain(|&row| {
                let position = data.position[row];
                position > high + TURN * noise.position || position < low - TURN * noise.position
            });
            turns.sort_unstable();
            way.extend(turns.into_iter().map(|row| data.position[row]));
        }
        way.push(rest.position);
        stands.push(Stand { rest, way });
    }
    stands
}

/// Spring and friction, with the input for the fit of the motion.
pub fn identify(
    data: &Data,
    rests: &[&Rest],
    known: &Known,
    noise: Option<MeasurementNoise>,
) -> (Prior, FitOutcome) {
    let [preload, stiffness, hardening, coulomb, friction_stiffness] = NAMES.map(|name| known.value(name));
    let start = [
        preload / SCALES[0],
        stiffness / SCALES[1],
        hardening / SCALES[2],
        coulomb.ln(),
        (friction_stiffness / coulomb).ln(),
    ];
    match fit(data, rests, known, noise, &start) {
        Ok((fit, unidentified, prior)) => (prior, Ok((fit, unidentified))),
        Err(error) => (Prior { free: vec![], parameters: start.to_vec(), solution: None }, Err(error)),
    }
}

/// The force balance at the stands between the stops.
struct Balance<'a> {
    known: &'a Known,
    stands: &'a [Stand<'a>],
    /// The fitted stands: between the stops, with known friction.
    used: Vec<usize>,
}

impl<'a> Balance<'a> {
    /// `rate` is the known `σ/F_c` (1/m).
    fn new(known: &'a Known, stands: &'a [Stand<'a>], rate: f64) -> Self {
        let mut travelled = 0.0;
        let mut used = vec![];
        for (index, stand) in stands.iter().enumerate() {
            if let Some(before) = index.checked_sub(1) {
                travelled += (stand.rest.position - stands[before].rest.position).abs();
            }
            let between = STOPS * known.plant.actuator.stroke..(1.0 - STOPS) * known.plant.actuator.stroke;
            if between.contains(&stand.rest.position) && travelled * rate > FORGOTTEN {
                used.push(index);
            }
        }
        Self { known, stands, used }
    }

    fn tuning(&self) -> Vec<usize> {
        self.used.iter().copied().filter(|&index| !self.stands[index].rest.validates).collect()
    }

    /// The opening force at a stand (N).
    fn force(&self, index: usize) -> f64 {
        self.known.plant.actuator.membrane_area
            * (self.known.ambient_pressure - self.stands[index].rest.chamber)
    }

    /// The forces of spring and friction at all stands (N).
    fn held(&self, rod: &Rod) -> Vec<f64> {
        let friction = friction(self.stands, rod.rate);
        let coulomb = rod.actuator.parameters.coulomb_friction;
        let held = |(stand, friction): (&Stand<'_>, f64)| {
            rod.actuator.spring_force(stand.rest.position) + coulomb * friction
        };
        self.stands.iter().zip(friction).map(held).collect()
    }

    /// Fits the parameters determined by the data; the rest keep their known values.
    fn solve(&self, start: &[f64]) -> Result<(Prior, Vec<Unidentified>)> {
        let tuning = self.tuning();
        let (free, mut unidentified) = self.free(start);
        let with = |free: &[usize], values: &[f64]| {
            let mut parameters = start.to_vec();
            for (&index, value) in free.iter().zip(values) {
                parameters[index] = *value;
            }
            parameters
        };
        let fit = |free: &[usize]| {
            let begin: Vec<_> = free.iter().map(|&index| start[index]).collect();
            nonlinear(&begin, &vec![1; tuning.len()], 0.0, |values| {
                let held = self.held(&Prior::rod(&with(free, values), self.known));
                tuning.iter().map(|&index| self.force(index) - held[index]).collect()
            })
        };
        let Reliable { free, solution, left_out } =
            Reliable::fit(free, fit, |solution, place, index| match index {
                // Without preload and stiffness the others are meaningless.
                0 | 1 => 0.0,
                2 => solution.standard_error(place) / solution.parameters[place].abs(),
                // The error of a logarithm is the relative error.
                _ => solution.standard_error(place),
            })?;
        unidentified
            .extend(left_out.iter().map(|&(index, error)| Unidentified::uncertain(NAMES[index], error)));
        let parameters = with(&free, solution.parameters.as_slice());
        Ok((Prior { free, parameters, solution: Some(solution) }, unidentified))
    }

    /// The parameters that can be determined: friction only if the rod moved in both directions.
    fn free(&self, start: &[f64]) -> (Vec<usize>, Vec<Unidentified>) {
        const LEAST_EACH_WAY: usize = 3;
        let tuning = self.tuning();
        let friction = friction(self.stands, Prior::rod(start, self.known).rate);
        let opening = tuning.iter().filter(|&&index| friction[index] > 0.0).count();
        if opening.min(tuning.len() - opening) >= LEAST_EACH_WAY {
            return ((0..NAMES.len()).collect(), vec![]);
        }
        let reason = format!(
            "friction needs {LEAST_EACH_WAY} phases at rest after motion in each direction; of {}, {opening} follow \
             an opening motion",
            tuning.len()
        );
        (vec![0, 1, 2], NAMES[3..].iter().map(|name| Unidentified::new(name, &reason)).collect())
    }

    fn drawing(&self, rod: &Rod) -> (Figure, Residuals) {
        let friction = friction(self.stands, rod.rate);
        let held = self.held(rod);
        let point = |&index: &usize| ResidualPoint {
            place: 1e3 * self.stands[index].rest.position,
            measured: self.force(index) - rod.actuator.parameters.coulomb_friction * friction[index],
            residual: self.force(index) - held[index],
            validates: self.stands[index].rest.validates,
        };
        let points: Vec<_> = self.used.iter().map(point).collect();
        let (x, y) = curve(&points, |place| rod.actuator.spring_force(1e-3 * place));
        let labels = ["position (mm)", "force without friction (N)", "residual (N)"];
        (drawing(labels, &points, (&x, &y)), residuals("force", "N", &points))
    }
}

fn fit(
    data: &Data,
    rests: &[&Rest],
    known: &Known,
    noise: Option<MeasurementNoise>,
    start: &[f64],
) -> Result<(Fit, Vec<Unidentified>, Prior)> {
    const LEAST_POSITIONS: usize = 8;
    let noise = noise.context("the rod is never at rest")?;
    let stands = stands(data, rests, noise);
    let balance = Balance::new(known, &stands, Prior::rod(start, known).rate);
    let count = balance.tuning().len();
    if count < LEAST_POSITIONS {
        bail!(
            "the spring needs {LEAST_POSITIONS} phases at rest with the rod between its stops; the tuning data have \
             {count}"
        );
    }
    let (prior, mut unidentified) = balance.solve(start)?;
    let (drawing, residuals) = balance.drawing(&Prior::rod(&prior.parameters, known));
    let parameters = estimates(&prior, known);
    unidentified.retain(|missing| parameters.iter().all(|estimate| estimate.name != missing.name));
    let fit = Fit {
        title: "Spring and friction, eqs. (4) and (5) at rest".to_owned(),
        method: format!(
            "Nonlinear least squares of the force balance in {count} phases at rest with the rod between its stops. \
             Friction follows Dahl along the rod's path from phase to phase. Forces are pressures times the membrane \
             area, assumed to be {} m\u{b2}.",
            known.plant.actuator.membrane_area
        ),
        residuals: vec![residuals],
        drawing,
        parameters,
    };
    Ok((fit, unidentified, prior))
}

fn estimates(prior: &Prior, known: &Known) -> Vec<ParameterEstimate> {
    let Some(solution) = &prior.solution else { return vec![] };
    let rod = Prior::rod(&prior.parameters, known);
    let coulomb = rod.actuator.parameters.coulomb_friction;
    let mut estimates = vec![];
    // The variance of the logarithm of σ, which is F_c times its rate.
    let mut variance = 0.0;
    for (position, &index) in prior.free.iter().enumerate() {
        let error = solution.standard_error(position);
        if index < 3 {
            let value = prior.parameters[index] * SCALES[index];
            estimates.push(known.estimate(NAMES[index], value, error * SCALES[index]));
            continue;
        }
        if NAMES[index] == COULOMB {
            estimates.push(known.estimate(COULOMB, coulomb, coulomb * error));
        }
        let others = prior.free.iter().enumerate().filter(|&(_, &other)| other >= 3);
        variance += others.map(|(other, _)| solution.covariance[(position, other)]).sum::<f64>();
    }
    // It is proportional to F_c, since the plant rejects one that is too stiff.
    if prior.free.iter().any(|&index| index >= 3) {
        let stiffness = coulomb * rod.rate.min(STIFFEST_FRICTION);
        estimates.push(known.estimate(NAMES[4], stiffness, stiffness * variance.max(0.0).sqrt()));
    }
    estimates
}
