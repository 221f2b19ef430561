//! The inverse of the actuator: the duty that puts the wastegate at a position (paper, section 5).
//!
//! At rest the vacuum on the membrane balances the spring, paper eq. (4), and the duty sets the vacuum, eq. (7).
//! Exhaust force and friction are neglected, as in the paper.

use fmu_export::Number;

use super::variables::ActuatorInverseParameters;
use crate::elementary::larger;

/// The largest duty (%).
pub(super) const FULL_DUTY: f64 = 100.0;

/// A bound on the steps: bisection alone needs some 55 from the duty range to adjacent floats, Newton's method a
/// handful.
const MOST_STEPS: usize = 128;

/// The duty at nominal voltage (%) that holds the wastegate at an opening from 0 (the duty at which it
/// lifts off) to 1 (full stroke).
#[must_use]
pub fn duty(inverse: &ActuatorInverseParameters, opening: f64) -> f64 {
    root(&inverse.pressure_coefficient, chamber_pressure(inverse, opening))
}

/// The duty (%), or that at which the wastegate lifts off its seat: a smaller one has no more effect.
pub(super) fn effective_duty(inverse: &ActuatorInverseParameters, duty: f64) -> f64 {
    let seated = seated_pressure(inverse);
    if pressure_at(inverse, duty) <= seated {
        duty
    } else {
        larger(duty, root(&inverse.pressure_coefficient, seated))
    }
}

/// The chamber pressure (Pa) at a duty (%): paper, eq. (7).
pub(super) fn pressure_at(inverse: &ActuatorInverseParameters, duty: f64) -> f64 {
    inverse.pressure_coefficient.iter().fold(0.0, |sum, coefficient| sum * duty + coefficient)
}

/// The chamber pressure (Pa) below which the wastegate lifts off its seat.
pub(super) fn seated_pressure(inverse: &ActuatorInverseParameters) -> f64 {
    chamber_pressure(inverse, 0.0)
}

/// The chamber pressure (Pa) at an opening from 0 to 1.
fn chamber_pressure(inverse: &ActuatorInverseParameters, opening: f64) -> f64 {
    let position = opening.clamp(0.0, 1.0) * inverse.stroke;
    let spring = inverse.spring_preload
        + inverse.spring_stiffness * position
        + inverse.spring_hardening * Number::powi(position, 7);
    inverse.ambient_pressure - spring / inverse.membrane_area
}

/// The duty (%) whose chamber pressure is lower by a difference (Pa) than another duty's (%).
pub(super) fn duty_at_lower_pressure(inverse: &ActuatorInverseParameters, duty: f64, difference: f64) -> f64 {
    root(&inverse.pressure_coefficient, pressure_at(inverse, duty) - difference)
}

/// The duty (%) at which the cubic of paper eq. (7) takes a value (Pa).
///
/// Newton's method within a bracket, with bisection if a step would leave it or is more than half the previous one, so
/// it converges for any coefficients. For a value beyond both ends of the range, the result is the nearer end.
fn root(coefficients: &[f64; 4], value: f64) -> f64 {
    let [k1, k2, k3, k4] = *coefficients;
    let excess = |duty: f64| ((k1 * duty + k2) * duty + k3) * duty + k4 - value;
    let slope = |duty: f64| (3.0 * k1 * duty + 2.0 * k2) * duty + k3;
    let (at_zero, at_full) = (excess(0.0), excess(FULL_DUTY));
    if at_zero == 0.0 || at_full == 0.0 || (at_zero > 0.0) == (at_full > 0.0) {
        return if at_zero.abs() <= at_full.abs() { 0.0 } else { FULL_DUTY };
    }
    // Bracket ends by the sign of the excess.
    let (mut above, mut below) = if at_zero > 0.0 { (0.0, FULL_DUTY) } else { (FULL_DUTY, 0.0) };
    let mut duty = FULL_DUTY / 2.0;
    let mut step = FULL_DUTY;
    for _ in 0..MOST_STEPS {
        let here = excess(duty);
        if here == 0.0 {
            break;
        }
        *(if here > 0.0 { &mut above } else { &mut below }) = duty;
        let newton = -here / slope(duty);
        let stays_inside = (duty + newton - above) * (duty + newton - below) < 0.0;
        let bisection = f64::midpoint(above, below) - duty;
        step = if stays_inside && newton.abs() < 0.5 * step.abs() { newton } else { bisection };
        if step.abs() <= f64::EPSILON * duty {
            break;
        }
        duty += step;
    }
    duty
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For a cubic that does not fall, the result stays in the range and is a root if the ends enclose one.
    #[test]
    fn any_coefficients_give_a_duty() {
        let odd = [
            [0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 5e4],
            [0.0, 0.0, 440.0, 4e4],
            [1.0, -150.0, 5000.0, 3e4],
            [-1e6, 1e6, -1e6, 1e6],
            [1e6, 1e6, 1e6, -1e6],
        ];
        for coefficients in odd {
            for value in [-1e9, -1.0, 0.0, 3e4, 5e4, 1e5, 1e9] {
                let duty = root(&coefficients, value);
                assert!((0.0..=FULL_DUTY).contains(&duty), "{coefficients:?} {value}: {duty}");
                let excess = |duty: f64| coefficients.iter().fold(0.0, |sum, k| sum * duty + k) - value;
                if excess(0.0) * excess(FULL_DUTY) < 0.0 {
                    // One ulp of the duty moves the cubic by its slope, at most 3e10 Pa/% here, times
                    // 1.4e-14 %; its terms of 1e12 Pa round to 1e-4 Pa.
                    assert!(excess(duty).abs() < 1e-2, "{coefficients:?} {value}: {duty}");
                }
            }
        }
    }
}
