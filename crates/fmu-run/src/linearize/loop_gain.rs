//! The gain of a loop, measured while the loop stays closed, and its margins.
//!
//! A sine is added to the signal of a connection to an input, as a frequency response analyser does with an electronic
//! loop (Middlebrook, "Measurement of loop gain in feedback systems", Int. J. Electronics 38, 1975). With U at the
//! input and B from the connection, both at the sine's frequency, the gain of the loop cut open there is L = −B/U. The
//! loop stays closed, and so at its operating point. This works for FMUs of any kind and includes the controller's
//! sampling and the coupling delays; no FMU exposes the states that it keeps between samples.

use std::f64::consts::TAU;

use anyhow::Result;
use fmu_master::Master;
use nalgebra::{Complex, DVector, Matrix4, Vector4};

/// The shortest period, in steps: a sampled sine needs more than two.
const SHORTEST: u32 = 4;
/// The longest period by default, in steps.
const LONGEST: u32 = 1000;
/// The largest ratio of one period to the next.
const RATIO: f64 = 1.15;
/// The least steps of a measurement, in whole periods.
const LEAST_STEPS: u32 = 64;
/// A measurement is accepted once it differs from the previous one by less than this fraction of its terms.
const SETTLED: f64 = 1e-3;
/// Gains below this are as good as none.
const LEAST_GAIN: f64 = 1e-6;
/// Measurements until a frequency is given up.
const MOST_TRIALS: u32 = 50;

/// The gain of a loop at a frequency.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// The frequency (Hz).
    pub frequency: f64,
    /// L, which is -1 at the limit of stability.
    pub gain: Complex<f64>,
    /// Distortion: the connection's signal at other frequencies, relative to the sines in the loop; 0 for a linear
    /// loop.
    pub distortion: f64,
    /// Whether the last two measurements agree.
    pub is_settled: bool,
}

/// The stability margins of a loop, each with its frequency (Hz).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Margins {
    /// The gain margin: the gain factor nearest to 1 that reaches the stability limit.
    pub gain: Option<(f64, f64)>,
    /// The phase margin: the phase lag nearest to 0 that reaches it (degrees).
    pub phase: Option<(f64, f64)>,
}

/// The periods (steps) of the measured frequencies, the shortest first; within a range (Hz), if one is given.
pub fn periods(step: f64, range: Option<(f64, f64)>) -> Vec<u32> {
    let (least, most) = range.map_or((f64::from(SHORTEST), f64::from(LONGEST)), |(from, to)| {
        (f64::from(SHORTEST).max(1.0 / (to * step)), 1.0 / (from * step))
    });
    if most < least {
        return vec![];
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
    let whole = |number: f64| number.round() as u32;
    let count = whole(((most / least).ln() / RATIO.ln()).ceil());
    let share = |index: u32| f64::from(index) / f64::from(count.max(1));
    let mut periods: Vec<_> =
        (0..=count).map(|index| whole(least * (most / least).powf(share(index)))).collect();
    periods.dedup();
    periods
}

/// Measures the gain of the loop whose connection is tapped, at periods of so many steps (s), the shortest first. The
/// points ascend.
pub fn measure(
    master: &mut Master<'_>,
    step: f64,
    amplitude: f64,
    periods: &[u32],
    progress: impl Fn(),
) -> Result<Vec<Point>> {
    let mut points = vec![];
    for &period in periods {
        let mut last: Option<Point> = None;
        for _ in 0..MOST_TRIALS {
            let (brought, rest) = window(master, amplitude, period)?;
            let at_input = brought + Complex::new(0.0, -amplitude);
            let gain = -brought / at_input;
            // A large gain is computed from a small difference at the input.
            let size = gain.norm().max(LEAST_GAIN) * (gain + 1.0).norm().max(1.0);
            let is_settled = last.is_some_and(|last| (gain - last.gain).norm() <= SETTLED * size);
            let distortion = rest / brought.norm().max(at_input.norm());
            last = Some(Point { frequency: 1.0 / (f64::from(period) * step), gain, distortion, is_settled });
            if is_settled {
                break;
            }
        }
        points.extend(last);
        progress();
    }
    points.reverse();
    Ok(points)
}

/// Adds whole periods of a sine, and fits a line and a sine to the connection's signal. Returns the sine, as the
/// complex amplitude of a cosine, and the amplitude of the rest.
fn window(master: &mut Master<'_>, amplitude: f64, period: u32) -> Result<(Complex<f64>, f64)> {
    let steps = period * LEAST_STEPS.div_ceil(period);
    let angle = |step: u32| TAU * f64::from(step % period) / f64::from(period);
    let brought = (0..steps).map(|step| master.step_adding(amplitude * angle(step).sin()));
    let brought = DVector::from_vec(brought.collect::<Result<_>>()?);
    let terms = |step: u32| {
        let (sine, cosine) = angle(step).sin_cos();
        Vector4::new(1.0, 2.0 * f64::from(step) / f64::from(steps) - 1.0, cosine, sine)
    };
    let normal: Matrix4<f64> = (0..steps).map(|step| terms(step) * terms(step).transpose()).sum();
    // The fit is to deviations, so that large values lose no digits.
    let mean = brought.mean();
    let right: Vector4<f64> =
        (0..steps).zip(&brought).map(|(step, value)| terms(step) * (value - mean)).sum();
    let fitted = normal.lu().solve(&right).unwrap_or_else(|| Vector4::repeat(f64::NAN));
    let rest =
        (0..steps).zip(&brought).map(|(step, value)| (value - mean - terms(step).dot(&fitted)).powi(2));
    Ok((Complex::new(fitted[2], -fitted[3]), (2.0 * rest.sum::<f64>() / f64::from(steps)).sqrt()))
}

/// The margins of a loop from its gain at ascending frequencies (Hz), with straight lines between points of the Bode
/// plot.
pub fn margins(points: &[(f64, Complex<f64>)]) -> Margins {
    let mut margins = Margins::default();
    let mut phase = points.first().map_or(0.0, |(_, gain)| gain.arg().to_degrees());
    for pair in points.windows(2) {
        let [(one, gain), (other, next)] = [pair[0], pair[1]];
        let [level, next_level] = [gain, next].map(|gain| gain.norm().ln());
        let next_phase = phase + (next / gain).arg().to_degrees();
        let at = |share: f64| one * (other / one).powf(share);
        let between = |from: f64, to: f64, share: f64| from + (to - from) * share;
        // The turns below -180°.
        let [turn, next_turn] = [phase, next_phase].map(|phase| ((phase + 180.0) / 360.0).floor());
        if (turn - next_turn).abs() > 0.5 {
            let limit = 360.0 * turn.max(next_turn) - 180.0;
            let share = (limit - phase) / (next_phase - phase);
            let found = (-between(level, next_level, share)).exp();
            if found < LEAST_GAIN.recip()
                && margins.gain.is_none_or(|(known, _)| found.ln().abs() < known.ln().abs())
            {
                margins.gain = Some((found, at(share)));
            }
        }
        if (level > 0.0) != (next_level > 0.0) {
            let share = level / (level - next_level);
            let found = between(phase, next_phase, share).rem_euclid(360.0) - 180.0;
            if margins.phase.is_none_or(|(known, _)| found.abs() < known.abs()) {
                margins.phase = Some((found, at(share)));
            }
        }
        phase = next_phase;
    }
    margins
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(gain: impl Fn(Complex<f64>) -> Complex<f64>) -> Vec<(f64, Complex<f64>)> {
        let frequencies = (0..400).map(|index| 1e-3 * 10_f64.powf(f64::from(index) / 100.0));
        frequencies.map(|frequency| (frequency, gain(Complex::new(0.0, TAU * frequency)))).collect()
    }

    /// 10/(s·(s+1)·(s+5)): the phase is -180° where 1 = ω²/5, and the gain there 10/30 (Routh's limit is a gain of 30).
    #[test]
    fn margins_are_those_of_a_known_loop() {
        let Margins { gain, phase } =
            margins(&points(|s| Complex::new(10.0, 0.0) / (s * (s + 1.0) * (s + 5.0))));
        let (factor, frequency) = gain.unwrap();
        // Between 100 points a decade, lines are within 1e-4 of the curves.
        assert!((factor - 3.0).abs() < 1e-3, "{factor}");
        assert!((frequency * TAU - 5_f64.sqrt()).abs() < 1e-3, "{frequency}");
        // ω²·(ω²+1)·(ω²+25) = 100 gives ω = 1.2271; the margin is 90° - atan(ω) - atan(ω/5).
        let (angle, frequency) = phase.unwrap();
        let crossing = 1.227_140_f64;
        assert!((frequency * TAU - crossing).abs() < 1e-3, "{}", frequency * TAU);
        let expected = 90.0 - crossing.atan().to_degrees() - (crossing / 5.0).atan().to_degrees();
        assert!((angle - expected).abs() < 1e-2, "{angle} {expected}");
    }

    /// The phase of an integrator with a delay of 0.1 s falls without end: the first of many crossings has the least
    /// margin.
    #[test]
    fn a_phase_beyond_a_turn_keeps_the_nearest_margin() {
        let found = margins(&points(|s| (s * -0.1).exp() / s));
        let (factor, frequency) = found.gain.unwrap();
        // At ω·0.1 = 90° the gain is 0.1/(π/2).
        assert!((factor - std::f64::consts::FRAC_PI_2 / 0.1).abs() < 0.01, "{factor}");
        assert!((frequency - 2.5).abs() < 0.01, "{frequency}");
        let (angle, _) = found.phase.unwrap();
        assert!((angle - (90.0 - 0.1_f64.to_degrees())).abs() < 0.01, "{angle}");
        assert_eq!(margins(&points(|_| Complex::new(0.5, 0.0))), Margins::default());
    }

    #[test]
    fn periods_are_whole_numbers_of_steps() {
        let all = periods(0.0125, None);
        assert!(all[0] == SHORTEST && all.is_sorted() && all[all.len() - 1] == LONGEST, "{all:?}");
        // 1 Hz to 10 Hz.
        let some = periods(0.0125, Some((1.0, 10.0)));
        assert!(some[0] == 8 && some[some.len() - 1] == 80, "{some:?}");
        assert_eq!(periods(0.0125, Some((30.0, 40.0))), [0; 0]);
    }
}
