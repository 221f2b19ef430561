//! The inverse of the actuator: the duty that puts the wastegate at a position (paper, section 5).
//!
//! At rest the vacuum on the membrane balances the spring, paper eq. (4), and the duty sets the vacuum, eq. (7).
//! Exhaust force and friction are neglected, as in the paper.

use fmu_export::Float;

use super::variables::{ActuatorInverseParameters, Real};
use crate::elementary::larger;

/// The largest duty (%).
pub(super) const FULL_DUTY: Real = 100.0;

/// A bound on the steps: bisection alone needs some 55 from the duty range to adjacent doubles, Newton's method a
/// handful.
const MOST_STEPS: usize = 128;

/// The duty at nominal voltage (%) that holds the wastegate at an opening from 0 (the duty at which it
/// lifts off) to 1 (full stroke).
#[must_use]
pub fn duty(inverse: &ActuatorInverseParameters, opening: Real) -> Real {
    root(&inverse.pressure_coefficient, chamber_pressure(inverse, opening))
}

/// The duty (%), or that at which the wastegate lifts off its seat: a smaller one has no more effect.
pub(super) fn effective_duty(inverse: &ActuatorInverseParameters, duty: Real) -> Real {
    let seated = seated_pressure(inverse);
    if pressure_at(inverse, duty) <= seated {
        duty
    } else {
        larger(duty, root(&inverse.pressure_coefficient, seated))
    }
}

/// The chamber pressure (Pa) at a duty (%): paper, eq. (7).
pub(super) fn pressure_at(inverse: &ActuatorInverseParameters, duty: Real) -> Real {
    inverse.pressure_coefficient.iter().fold(0.0, |sum, coefficient| sum * duty + coefficient)
}

/// The chamber pressure (Pa) below which the wastegate lifts off its seat.
pub(super) fn seated_pressure(inverse: &ActuatorInverseParameters) -> Real {
    chamber_pressure(inverse, 0.0)
}

/// The chamber pressure (Pa) at an opening from 0 to 1.
fn chamber_pressure(inverse: &ActuatorInverseParameters, opening: Real) -> Real {
    let position = opening.clamp(0.0, 1.0) * inverse.stroke;
    let spring = inverse.spring_preload
        + inverse.spring_stiffness * position
        + inverse.spring_hardening * Float::powi(position, 7);
    inverse.ambient_pressure - spring / inverse.membrane_area
}

/// The duty (%) whose chamber pressure is lower by a difference (Pa) than another duty's (%).
pub(super) fn duty_at_lower_pressure(
    inverse: &ActuatorInverseParameters,
    duty: Real,
    difference: Real,
) -> Real {
    root(&inverse.pressure_coefficient, pressure_at(inverse, duty) - difference)
}

/// The duty (%) at which the cubic of paper eq. (7) takes a value (Pa).
///
/// Newton's method within a bracket, with bisection if a step would leave it or is more than half the previous one, so
/// it converges for any coefficients. For a value beyond both ends of the range, the result is the nearer end.
fn root(coefficients: &[Real; 4], value: Real) -> Real {
    let [k1, k2, k3, k4] = *coefficients;
    let excess = |duty: Real| ((k1 * duty + k2) * duty + k3) * duty + k4 - value;
    let slope = |duty: Real| (3.0 * k1 * duty + 2.0 * k2) * duty + k3;
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
        let bisection = Real::midpoint(above, below) - duty;
        step = if stays_inside && newton.abs() < 0.5 * step.abs() { newton } else { bisection };
        if step.abs() <= Real::EPSILON * duty {
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
                let excess = |duty: Real| coefficients.iter().fold(0.0, |sum, k| sum * duty + k) - value;
                if excess(0.0) * excess(FULL_DUTY) < 0.0 {
                    // One ulp of the duty moves the cubic by its slope, at most 3e10 Pa/% here, times
                    // 1.4e-14 %; its terms of 1e12 Pa round to 1e-4 Pa.
                    assert!(excess(duty).abs() < 1e-2, "{coefficients:?} {value}: {duty}");
                }
            }
        }
    }
}
