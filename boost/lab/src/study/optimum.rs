//! The best control with full knowledge: a case's plant is taken out of its loop before boost leaves the reachable
//! reference, and the valve movements that keep boost closest to it are searched.
//!
//! The search is direct: corrections of the controller's commands, linear between a few nodes, by an evolution strategy
//! with one parent whose step grows with success and shrinks otherwise (Rechenberg's (1+1)-ES). What it finds is
//! feasible; the true optimum may be better.

use anyhow::{Context, Result};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

use super::case::{Measures, Rig, Simulated, point};
use super::criteria::{FAST_AT_REST, NEAR};
use super::draw::{Case, Variant};
use super::names::SHAFT;
use super::reach::{OpenLoop, VALVES, Valves};
use super::situation::{SETTLING, STEP};
use fmu_master::measure::greatest;

/// The window: from this time (s) before boost leaves the reachable reference and before the event preceding its worst
/// moment, to this time after that moment.
const BEFORE: f64 = 1.0;
const AFTER: f64 = 0.5;
/// Nodes of the corrections.
const NODES: usize = 6;
const TRIALS: usize = 300;
/// The step factors on success and failure, and the step's bounds, in shares of a valve's range.
const WIDER: f64 = 1.3;
const NARROWER: f64 = 0.96;
const WIDTHS: (f64, f64, f64) = (0.01, 0.2, 0.6);
/// The share of corrections changed by a trial, and the share of trials that move a whole valve instead.
const CHANGED: f64 = 0.3;
const WHOLE: f64 = 0.3;
/// The norm of the deviations to minimize: peaks count most, but lowering one of several counts too.
const NORM: i32 = 6;

/// The best control found.
#[derive(Default)]
pub struct Optimum {
    pub times: Vec<f64>,
    pub boost: Vec<f64>,
    pub shaft: Vec<f64>,
    pub valves: Vec<Valves>,
    /// The largest deviation in the window (Pa), and that of the closed loop.
    pub deviation: f64,
    pub closed_loop: f64,
}

type Corrections = [[f64; NODES]; 3];

/// Searches for the best control of a case around its worst moment.
pub fn search(
    rig: &Rig,
    case: &Case,
    variant: Variant<'_>,
    simulated: &Simulated,
    measures: &Measures,
) -> Result<Optimum> {
    let worst = point(measures.deviation_time);
    let event = simulated.events.iter().rfind(|&&event| event <= worst).copied().unwrap_or(0);
    let boost = simulated.boost()?;
    let is_within = |row: &usize| simulated.distance(*row, boost[*row]).0 < 0.5 * NEAR;
    let left = (0..worst).rfind(is_within).unwrap_or(0);
    let first = event.min(left).min(worst).saturating_sub(point(BEFORE));
    let last = (worst + point(AFTER)).min(simulated.lower.len() - 1);
    let scenario = rig.scenario(case, variant)?;
    let mut master = rig.run_to(&scenario, first)?;
    let mut plant = OpenLoop::new(master.instance("plant")?, case)?;
    let saved = plant.instance().save()?;

    let judged = point(SETTLING).max(first + 1);
    let closed_loop = greatest((judged..=last).map(|row| simulated.distance(row, boost[row]).0));
    let own_shaft =
        simulated.record.get(SHAFT).map_or(0.0, |speeds| greatest(speeds[first..=last].iter().copied()));
    let shaft_limit = own_shaft.max(FAST_AT_REST);
    let mut attempt = |corrections: &Corrections| -> Result<(f64, Optimum)> {
        plant.instance().restore(&saved)?;
        let mut found = Optimum { closed_loop, ..Optimum::default() };
        let (mut sum, mut excess): (f64, f64) = (0.0, 0.0);
        for index in first..last {
            let valves = corrected(
                corrections,
                (index - first) as f64 / (last - first) as f64,
                simulated.valves(index),
            );
            let measured = plant.step(index, valves)?;
            let is_judged = index + 1 >= judged;
            let distance = if is_judged { simulated.distance(index + 1, measured.boost).0 } else { 0.0 };
            found.deviation = found.deviation.max(distance);
            sum += (1e-3 * distance).powi(NORM);
            excess = excess.max(measured.shaft - shaft_limit);
            found.times.push((index + 1) as f64 * STEP);
            found.boost.push(measured.boost);
            found.shaft.push(measured.shaft);
            found.valves.push(valves);
        }
        // 1 Pa for each rpm beyond the limit keeps the shaft below it.
        let norm = 1e3 * (sum / (last - first) as f64).powf(1.0 / f64::from(NORM));
        Ok((norm + excess, found))
    };

    let mut best: Option<(f64, Optimum, Corrections)> = None;
    // Start from the controller's commands, and from all valves at a stop.
    for start in [0.0, -1.0, 1.0] {
        let corrections = [[start; NODES]; 3];
        let (cost, found) = attempt(&corrections)?;
        if best.as_ref().is_none_or(|(least, ..)| cost < *least) {
            best = Some((cost, found, corrections));
        }
    }
    let (mut least, mut optimum, mut corrections) = best.context("nothing was tried")?;
    let mut generator = Pcg64::seed_from_u64(case.number as u64);
    let (narrowest, mut width, widest) = WIDTHS;
    for _ in 0..TRIALS {
        let mut trial = corrections;
        let moved = |value: &mut f64, by: f64| *value = (*value + width * by).clamp(-1.0, 1.0);
        if generator.random::<f64>() < WHOLE {
            let by: f64 = StandardNormal.sample(&mut generator);
            let valve = generator.random_range(0..trial.len());
            trial[valve].iter_mut().for_each(|value| moved(value, by));
        } else {
            for value in trial.iter_mut().flatten() {
                if generator.random::<f64>() < CHANGED {
                    moved(value, StandardNormal.sample(&mut generator));
                }
            }
        }
        let (cost, found) = attempt(&trial)?;
        if cost < least {
            (least, optimum, corrections) = (cost, found, trial);
            width = (width * WIDER).min(widest);
        } else {
            width = (width * NARROWER).max(narrowest);
        }
    }
    Ok(optimum)
}

/// The valves at a share of the window, corrected and within their ranges.
fn corrected(corrections: &Corrections, share: f64, own: Valves) -> Valves {
    let place = share * (NODES - 1) as f64;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // from 0 to the number of nodes
    let node = (place as usize).min(NODES - 2);
    let mut valves = own;
    for (valve, (nodes, (_, most))) in valves.iter_mut().zip(corrections.iter().zip(VALVES)) {
        let correction = nodes[node] + (place - node as f64) * (nodes[node + 1] - nodes[node]);
        *valve = (*valve + most * correction).clamp(0.0, most);
    }
    valves
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corrections_are_lines_between_nodes_within_the_valves_ranges() {
        let corrections = [[0.0, 0.1, 0.1, 0.1, 0.1, 0.1], [0.0; NODES], [-1.0; NODES]];
        let close = |found: Valves, expected: Valves| {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
        };
        close(corrected(&corrections, 0.0, [40.0, 0.5, 0.2]), [40.0, 0.5, 0.0]);
        // Halfway to the second of six nodes.
        close(corrected(&corrections, 0.1, [40.0, 0.5, 0.2]), [45.0, 0.5, 0.0]);
        close(corrected(&corrections, 1.0, [99.0, 0.5, 0.2]), [100.0, 0.5, 0.0]);
    }
}
