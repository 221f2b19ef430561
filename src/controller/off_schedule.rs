//! How far the law of the strategy `split_range` relies on its schedule.
//!
//! At reference conditions the law is as identified: the engine speed feedforward does most of the work. Off reference
//! conditions the converted schedule is less exact, and the plant may differ too, so the feedback does more and the
//! feedforward less. The transition is gradual (`Day::off_reference`), as sensors never measure exactly the reference:
//!
//! - The feedback's λ is shorter. The actuator limits it: boost cannot change for about 0.08 s on the plant model,
//!   while the chamber fills and the rod moves. So the derivative term leads by about that lag, as in a Smith predictor
//!   for an integrating plant, which the shafts are on that time scale. Its filter is slower, or boost noise would move
//!   the wastegate so much that the pump could not hold the vacuum.
//! - The feedforward uses part of the schedule's sensitivity. That was identified with a first-order model, which makes
//!   the wastegate's whole effect as slow as the low-pressure shaft. The high-pressure shaft follows several times
//!   faster, so less duty suffices for ramps of a second, and too much costs that shaft speed when a deceleration ends.
//! - Engine speed is filtered less before its rate is taken, since the filter's delay shows when a ramp ends. In the
//!   feedforward the rate leads by part of the actuator lag, and a deceleration is applied with a lag: holding boost
//!   while engine speed begins to fall slows the high-pressure shaft, and that speed is missing when a short
//!   deceleration ends.
//! - On fast engine speed ramps the [`ramp_term`](super::ramp_term) replaces the integral action.
//! - The high-pressure wastegate duty has lead compensation ([`duty_lead`](super::duty_lead)).
//! - The integral term is rescaled with the engine's gain along the schedule: the map error it corrects is one of
//!   pressure rather than of duty.
//! - The reference model follows its limit faster: where the shaft's limit rises in a deceleration, boost can follow it
//!   as fast as the actuator.
//! - The reference is filtered, so that a step is no faster on a ramp than at constant speed, and slower by as much as
//!   the ambient conditions slow the shafts. For a faster one the wastegate shuts, and opens too late.
//! - The high-pressure shaft may turn slightly faster than at reference conditions, where its limit is exact.
//!
//! The higher feedback gain, the faster model and the rescaling act while engine speed changes and fade within 2 s,
//! since reference steps at constant speed would overshoot more. All except engine speed rate, sensitivity, duty lead
//! and shaft allowance are ramped in with engine speed, below where the low-pressure wastegate takes part. Where the
//! shaft's limit holds the duty, the feedback stays as identified, since it would work against that limit.

use fmu_export::Persistent;

use super::allocation::ramp;
use super::day::Day;
use super::feedback::Firmness;
use super::ramp_term::Ramp;
use super::variables::Parameters;
use crate::elementary::{between, larger};

/// The offset (rpm) below the engine speeds between which the low-pressure wastegate is ramped in.
const EARLIER: f64 = 500.0;

/// The engine speed rates (rpm/s) between which it counts as changing, and the fading time (s) of the higher feedback
/// gain after that.
const MOVES: (f64, f64) = (50.0, 150.0);
const FADES_IN: f64 = 2.0;

/// The rates (rpm/s) between which the ramp term replaces the integral term. A slower ramp lasts so long that the
/// integral term helps.
const FAST: (f64, f64) = (250.0, 1000.0);

/// The time constant (s) with which a deceleration is applied.
const FALLS_IN: f64 = 0.3;

/// The engine speed rate for the feedforward.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct LeadingRate {
    /// The rate at the last sample, and that with a lag (rpm/s).
    before: f64,
    lagged: f64,
}

impl LeadingRate {
    /// The rate (rpm/s) for the feedforward at a sample, by that of engine speed.
    pub fn sample(&mut self, parameters: &Parameters, day: &Day, rate: f64) -> f64 {
        let &Parameters { sample_time, ref off_schedule, .. } = parameters;
        let change = rate - std::mem::replace(&mut self.before, rate);
        self.lagged += sample_time / (FALLS_IN + sample_time) * (rate - self.lagged);
        let to_come = rate - self.lagged;
        let begins_to_fall = rate < 0.0 && to_come < 0.0 && self.lagged < 0.0;
        let held_back = if begins_to_fall { (1.0 - off_schedule.falling_share) * to_come } else { 0.0 };
        rate + day.off_reference * (off_schedule.rate_lead / sample_time * change - held_back)
    }
}

/// Whether engine speed changes or has changed lately.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct Motion {
    /// 1 while it changes; afterwards it fades to 0.
    lately: f64,
    /// 1 while it changes fast, 0 while it changes slowly or not.
    fast: f64,
    /// 1 where it applies.
    counts: f64,
}

impl Motion {
    /// Takes a rate of engine speed (rpm/s) at a sample.
    pub fn sample(&mut self, sample_time: f64, rate: f64) {
        let within = |(from, to)| ramp(rate.abs(), from, to);
        self.fast = within(FAST);
        self.lately = larger(within(MOVES), self.lately - sample_time / FADES_IN);
    }

    /// The same at an engine speed (rpm, at reference conditions), from which it applies.
    pub fn at(self, parameters: &Parameters, day: &Day, engine_speed: f64) -> Self {
        let counts = day.off_reference * parameters.allocation.low_pressure_share(engine_speed + EARLIER);
        Self { lately: counts * self.lately, fast: counts * self.fast, counts }
    }

    /// Whether engine speed has changed lately.
    pub fn changed_lately(self) -> bool {
        self.lately > 0.0
    }

    /// λ of the reference model (s).
    pub fn model_lambda(self, parameters: &Parameters) -> f64 {
        parameters.lambda * between(1.0, parameters.off_schedule.model_lambda_share, self.lately)
    }

    /// The feedback tuning at an engine speed (rpm, at reference conditions).
    pub fn firmness(self, parameters: &Parameters, engine_speed: f64) -> Firmness {
        let &Parameters {
            lambda, feedback_lambda, derivative_filter, ref allocation, ref off_schedule, ..
        } = parameters;
        let identified = between(lambda, feedback_lambda, allocation.low_pressure_share(engine_speed));
        let firm = off_schedule.feedback_lambda_share * feedback_lambda;
        Firmness {
            lambda: between(identified, firm, self.lately),
            lead: off_schedule.actuator_lag * self.lately,
            derivative_filter: derivative_filter
                * between(1.0, off_schedule.derivative_filter_share, self.lately),
            integral_share: 1.0 - self.fast,
        }
    }

    /// The time constant (s) of the filter of the reference.
    pub fn reference_filter_time(self, parameters: &Parameters, day: &Day) -> f64 {
        let &Parameters { lambda, ref off_schedule, .. } = parameters;
        let asked = off_schedule.reference_lambda_share * lambda * day.time_scale();
        self.counts * (asked - self.model_lambda(parameters))
    }

    /// How the integral term is rescaled as the engine's gain changes.
    pub fn integral_exponent(self, parameters: &Parameters) -> f64 {
        parameters.off_schedule.integral_exponent * self.lately
    }

    /// The ramp with a rate of engine speed (rpm/s).
    pub fn ramp(self, rate: f64) -> Ramp {
        Ramp { rate, share: self.fast }
    }
}

/// The reference filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct ReferenceFilter {
    /// None before the first sample.
    filtered: Option<f64>,
}

impl ReferenceFilter {
    /// The filtered reference (Pa) at a sample, with a time constant (s).
    pub fn sample(&mut self, sample_time: f64, time_constant: f64, reference: f64) -> f64 {
        let before = self.filtered.unwrap_or(reference);
        let filtered = if time_constant > sample_time {
            before + sample_time / time_constant * (reference - before)
        } else {
            reference
        };
        self.filtered = Some(filtered);
        filtered
    }
}

/// The time constant (s) with which engine speed is filtered for its rate.
pub fn filter_time(parameters: &Parameters, day: &Day) -> f64 {
    let time = parameters.speed_feedforward.filter_time;
    between(time, parameters.off_schedule.filter_time_share * time, day.off_reference)
}

/// The allowed excess of the high-pressure shaft over its maximum speed (rpm).
pub fn shaft_speed_allowance(parameters: &Parameters, day: &Day) -> f64 {
    day.off_reference * parameters.off_schedule.shaft_speed_allowance
}

/// The share of the schedule's engine speed sensitivity used.
pub fn sensitivity_share(parameters: &Parameters, day: &Day) -> f64 {
    let of_schedule = parameters.speed_feedforward.share;
    between(of_schedule, parameters.off_schedule.sensitivity_share * of_schedule, day.off_reference)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::controller::variables::Inputs;

    const SAMPLE_TIME: f64 = 0.0125;

    /// After a second with a rate of engine speed (rpm/s) and some time without (s), at an engine speed (rpm) and an
    /// ambient pressure (Pa).
    fn motion(rate: f64, rests_for: f64, engine_speed: f64, ambient_pressure: f64) -> Motion {
        let parameters = Parameters::default();
        let day = Day::measured(&parameters, &Inputs { ambient_pressure, ..Inputs::default() });
        let mut motion = Motion::default();
        let samples =
            |time: f64| (0..).take_while(move |&sample| f64::from(sample) * SAMPLE_TIME < time - 1e-9);
        samples(1.0).for_each(|_| motion.sample(SAMPLE_TIME, rate));
        samples(rests_for).for_each(|_| motion.sample(SAMPLE_TIME, 0.0));
        motion.at(&parameters, &day, engine_speed)
    }

    #[test]
    fn a_rate_leads_and_a_fall_comes_in_with_a_lag_on_other_days() {
        let parameters = Parameters::default();
        // The rates that the feedforward takes, from the first sample with a rate on and from the first without.
        let rates = |ambient_pressure, rate: f64| {
            let day = Day::measured(&parameters, &Inputs { ambient_pressure, ..Inputs::default() });
            let mut leading = LeadingRate::default();
            let mut sample = |rate| leading.sample(&parameters, &day, rate);
            let ramp: Vec<_> = (0..800).map(|_| sample(rate)).collect();
            let rest = [sample(0.0), sample(0.0)];
            [ramp[0], ramp[1], ramp[799], rest[0], rest[1]]
        };
        // The round-off of rates of thousands.
        let near = |found: [f64; 5], expected: [f64; 5]| {
            assert!(
                found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9),
                "{found:?}, not {expected:?}"
            );
        };
        let lead = 1000.0 * parameters.off_schedule.rate_lead / SAMPLE_TIME;
        near(rates(80e3, 1000.0), [1000.0 + lead, 1000.0, 1000.0, -lead, 0.0]);
        // What of a fall is to come after a sample, and after two.
        let lag = 1.0 - SAMPLE_TIME / (FALLS_IN + SAMPLE_TIME);
        let held_back =
            |samples: i32| 1000.0 * (1.0 - parameters.off_schedule.falling_share) * lag.powi(samples);
        near(rates(80e3, -1000.0), [held_back(1) - 1000.0 - lead, held_back(2) - 1000.0, -1000.0, lead, 0.0]);
        let standard = parameters.nominal_ambient_pressure;
        near(rates(standard, -1000.0), [-1000.0, -1000.0, -1000.0, 0.0, 0.0]);
    }

    /// λ, lead, filter and share of the integral gain of the feedback, and λ of the reference model.
    fn settings(motion: Motion, engine_speed: f64) -> [f64; 5] {
        let parameters = Parameters::default();
        let firmness = motion.firmness(&parameters, engine_speed);
        let Firmness { lambda, lead, derivative_filter, integral_share } = firmness;
        [lambda, lead, derivative_filter, integral_share, motion.model_lambda(&parameters)]
    }

    fn assert_near(found: [f64; 5], expected: [f64; 5]) {
        // Sums of up to 160 samples.
        assert!(
            found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12),
            "{found:?}, not {expected:?}"
        );
    }

    #[test]
    fn the_feedback_is_firmer_along_and_after_ramps_of_other_days() {
        let altitude = 80e3;
        let identified = [0.1, 0.0, 8.0, 1.0, 0.3];
        for rate in [2000.0, -2000.0] {
            assert_near(
                settings(motion(rate, 0.0, 3000.0, altitude), 3000.0),
                [0.072, 0.09, 5.6, 0.0, 0.171],
            );
        }
        // Half of it is left after half of 2 s, and the integral term moves on.
        assert_near(
            settings(motion(2000.0, 1.0, 3000.0, altitude), 3000.0),
            [0.086, 0.045, 6.8, 1.0, 0.2355],
        );
        assert_near(settings(motion(2000.0, 2.0, 3000.0, altitude), 3000.0), identified);
        // Along a slow ramp the integral term moves as well.
        assert_near(settings(motion(250.0, 0.0, 3000.0, altitude), 3000.0), [0.072, 0.09, 5.6, 1.0, 0.171]);
        assert_near(settings(motion(50.0, 0.0, 3000.0, altitude), 3000.0), identified);
    }

    #[test]
    fn the_feedback_is_as_identified_on_the_schedules_day_and_at_low_speed() {
        let standard = Parameters::default().nominal_ambient_pressure;
        assert_near(settings(motion(2000.0, 0.0, 3000.0, standard), 3000.0), [0.1, 0.0, 8.0, 1.0, 0.3]);
        assert_near(settings(motion(2000.0, 0.0, 1500.0, 80e3), 1500.0), [0.3, 0.0, 8.0, 1.0, 0.3]);
        // Half way between, at the ambient pressure with half the deviation.
        let nearby = (1.0 - 0.01 / 0.7) * standard;
        assert_near(settings(motion(2000.0, 0.0, 3000.0, nearby), 3000.0), [0.086, 0.045, 6.8, 0.5, 0.2355]);
        // At 2000 rpm with full gain, though the low-pressure wastegate is shut.
        assert_near(settings(motion(2000.0, 0.0, 2000.0, 80e3), 2000.0), [0.072, 0.09, 5.6, 0.0, 0.171]);
    }

    #[test]
    fn a_step_of_the_reference_is_filtered_on_other_days_alone() {
        let parameters = Parameters::default();
        let time_constant = |engine_speed, ambient_pressure, rate| {
            let day = Day::measured(&parameters, &Inputs { ambient_pressure, ..Inputs::default() });
            motion(rate, 0.0, engine_speed, ambient_pressure).reference_filter_time(&parameters, &day)
        };
        let passes = |time_constant| {
            let mut filter = ReferenceFilter::default();
            [150e3, 160e3].map(|reference| filter.sample(SAMPLE_TIME, time_constant, reference))
        };
        let near = |found: [f64; 2], expected: f64| {
            assert!((found[0] - 150e3).abs() < 1e-6 && (found[1] - expected).abs() < 1e-6, "{found:?}");
        };
        near(passes(time_constant(3000.0, parameters.nominal_ambient_pressure, 0.0)), 160e3);
        near(passes(time_constant(1500.0, 80e3, 0.0)), 160e3);
        // With the model's it is 1.6 λ, by how much slower the shafts are; along a ramp the model's is 0.57 λ.
        let day = Day::measured(&parameters, &Inputs { ambient_pressure: 80e3, ..Inputs::default() });
        let slow = 1.6 * 0.3 * day.time_scale();
        assert!(slow > 0.4);
        near(passes(time_constant(3000.0, 80e3, 0.0)), 150e3 + 10e3 * SAMPLE_TIME / (slow - 0.3));
        near(passes(time_constant(3000.0, 80e3, 2000.0)), 150e3 + 10e3 * SAMPLE_TIME / (slow - 0.171));
    }
}
