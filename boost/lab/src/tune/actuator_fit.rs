//! Two numbers of the controller from the responses at a point: the actuator's lag, and the share of the engine speed
//! sensitivity that a ramp needs.

use super::speed_fit::SpeedResponse;

/// The duration of the ramp for which the share is the best (s): between the time constant of the response to the
/// reference and its rise time, with which the share is 0.70 and 0.78. Of 1000 random plants and ambient conditions about
/// as many stay within 2 kPa with each.
const RAMP: f64 = 0.8;

/// The time (s) until the rate of change of boost after a duty step has risen to 1 − 1/e of its peak.
///
/// The shafts integrate what the wastegate does, so that the rate follows the actuator. If that were of first order, this
/// would be its time constant.
pub fn actuator_lag(response: &[f64], interval: f64) -> Option<f64> {
    let before = std::iter::once(&0.0).chain(response);
    let rates: Vec<_> = before.zip(response).map(|(before, after)| (after - before).abs()).collect();
    let risen = (1.0 - (-1.0_f64).exp()) * rates.iter().copied().fold(0.0, f64::max);
    let after = rates.iter().position(|rate| risen > 0.0 && *rate >= risen)?;
    let before = if after > 0 { rates[after - 1] } else { 0.0 };
    // Rates are those in the middle of an interval.
    let intervals = after as f64 - 0.5 + (risen - before) / (rates[after] - before);
    Some(intervals.max(0.0) * interval)
}

/// The share of a sensitivity (Pa s/rpm) with which the controller's feedforward leaves the least square error on a
/// ramp of engine speed, from the responses to a duty step (Pa/%) and to an engine speed step (Pa/rpm).
///
/// On a ramp the feedforward follows the map, and adds a constant duty. The sensitivity is that of a model of first order,
/// which makes the wastegate's whole effect as slow as the low-pressure shaft; the high-pressure shaft follows faster, and
/// less duty suffices.
pub fn ramp_share(
    response: &[f64],
    speed: &SpeedResponse,
    gain: f64,
    sensitivity: f64,
    interval: f64,
) -> Option<f64> {
    let (mut of_speed, mut of_map, mut product, mut square) = (0.0, 0.0, 0.0, 0.0);
    for (sample, &of_duty) in (1_u32..).zip(response) {
        let time = f64::from(sample) * interval;
        if time > RAMP {
            break;
        }
        // By 1 rpm/s.
        of_speed += interval * speed.at(time);
        of_map -= interval * speed.gain / gain * of_duty;
        product += of_duty * (of_speed + of_map);
        square += of_duty * of_duty;
    }
    let duty = -product / square;
    Some(duty * gain / sensitivity).filter(|share| share.is_finite())
}

/// The median of values that are none for some points.
pub fn median(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    let mut values: Vec<_> = values.flatten().collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    const INTERVAL: f64 = 0.0125;

    /// An integrator behind a lag: the rate is 1 − exp(−t/lag). Interpolation within an interval is linear.
    #[test]
    fn the_lag_before_an_integrator_is_found() {
        for lag in [0.04, 0.08, 0.15] {
            let at = |time: f64| time - lag * (1.0 - (-time / lag).exp());
            let response: Vec<_> = (1..200).map(|sample| -3.0 * at(f64::from(sample) * INTERVAL)).collect();
            let found = actuator_lag(&response, INTERVAL).unwrap();
            assert!((found - lag).abs() < 0.02 * lag, "{found} s, not {lag} s");
        }
        assert_eq!(actuator_lag(&[0.0; 20], INTERVAL), None);
    }

    /// Where the duty's effect is of first order, with the engine speed's time constant and without a drop, the constant
    /// duty `K_N T / K` cancels the lag of both, and the sensitivity of the first-order model is all that is needed.
    #[test]
    fn a_plant_of_first_order_needs_the_whole_sensitivity() {
        let (gain, time_constant, fall) = (-2000.0, 0.8, 30.0);
        let speed =
            SpeedResponse { fall, fall_time: 1e-6, gain: 0.0, rise_time: time_constant, residual: 0.0 };
        let at = |time: f64| gain * (1.0 - (-time / time_constant).exp());
        let response: Vec<_> = (1..200).map(|sample| at(f64::from(sample) * INTERVAL)).collect();
        let share = ramp_share(&response, &speed, gain, fall * time_constant, INTERVAL).unwrap();
        // Sums over intervals of 1.6 % of the time constant.
        assert!((share - 1.0).abs() < 0.02, "{share}");
    }

    #[test]
    fn the_median_leaves_out_what_is_none() {
        assert_eq!(median([Some(3.0), None, Some(1.0), Some(2.0)].into_iter()), Some(2.0));
        assert_eq!(median(std::iter::empty()), None);
    }
}
