//! Lead compensation of the high-pressure wastegate duty, off reference conditions.
//!
//! The actuator lags its duty: its chamber has to fill, and its rod to overcome friction. So while the duty changes,
//! more than the change is commanded, down to zero duty, which fills the chamber faster than the duty at which the
//! wastegate seats. Small changes are ignored, since noise would drain the vacuum.

use fmu_export::Persistent;

use super::day::Day;
use super::rate_filter::RateFilter;
use super::variables::Parameters;
use crate::elementary::{larger, smaller};

/// The time window (s) of the duty change.
const FILTER_TIME: f64 = 0.05;

/// The memory of the lead.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct DutyLead {
    duty: RateFilter,
}

impl DutyLead {
    /// The duty (%) to command at a sample for a wanted one; both at nominal voltage.
    pub fn sample(&mut self, parameters: &Parameters, day: &Day, duty: f64) -> f64 {
        let &Parameters { sample_time, ref off_schedule, .. } = parameters;
        let rate = self.duty.sample(sample_time, FILTER_TIME, duty);
        let small = off_schedule.duty_lead_threshold / FILTER_TIME;
        let counts = rate - smaller(larger(rate, -small), small);
        larger(duty + day.off_reference * off_schedule.duty_lead * counts, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::controller::variables::Inputs;

    /// The duties (%) that are commanded at an ambient pressure (Pa) for some that are asked for.
    fn commanded<const SAMPLES: usize>(ambient_pressure: f64, asked: [f64; SAMPLES]) -> [f64; SAMPLES] {
        let parameters = Parameters::default();
        let day = Day::measured(&parameters, &Inputs { ambient_pressure, ..Inputs::default() });
        let mut lead = DutyLead::default();
        asked.map(|duty| lead.sample(&parameters, &day, duty))
    }

    #[test]
    fn it_leads_a_change_and_ends_with_it() {
        let Parameters { sample_time, off_schedule, .. } = Parameters::default();
        // 20 % less from the third sample on.
        let asked: [f64; 100] = std::array::from_fn(|sample| if sample < 2 { 60.0 } else { 40.0 });
        let commanded = commanded(80e3, asked);
        let decay = FILTER_TIME / (FILTER_TIME + sample_time);
        let gain = off_schedule.duty_lead / FILTER_TIME;
        let lead = |samples: i32| gain * (20.0 * decay.powi(samples) - off_schedule.duty_lead_threshold);
        // The round-off of duties of tens.
        let near =
            |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
        near(commanded[1], 60.0);
        near(commanded[2], 40.0 - lead(1));
        near(commanded[3], 40.0 - lead(2));
        near(commanded[99], 40.0);
    }

    #[test]
    fn it_stays_within_the_range_of_the_duty_and_ignores_small_changes() {
        let [_, commanded_least] = commanded(80e3, [60.0, 10.0]);
        assert!(commanded_least.abs() < f64::MIN_POSITIVE, "{commanded_least}");
        let small = 60.0 + 0.9 * Parameters::default().off_schedule.duty_lead_threshold;
        let [_, of_small] = commanded(80e3, [60.0, small]);
        assert!((of_small - small).abs() < f64::MIN_POSITIVE, "{of_small}");
    }

    #[test]
    fn on_the_schedules_day_the_duty_is_as_asked() {
        let asked = [60.0, 10.0, 90.0];
        let standard = Parameters::default().nominal_ambient_pressure;
        assert_eq!(commanded(standard, asked).map(f64::to_bits), asked.map(f64::to_bits));
    }
}
