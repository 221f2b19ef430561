//! The Runge-Kutta pair of third and second order by Bogacki and Shampine (A 3(2) pair of Runge-Kutta
//! formulas, Applied Mathematics Letters 2(4), 1989), explicit, with three evaluations a step.
//!
//! Few evaluations for its limit of stability, 2.5 by the fastest eigenvalue, in the directions of damped
//! oscillations too; and a low order, so that a kink within a step costs little.

use super::{Trial, moved};

/// The power with which the estimated error of a step falls.
pub const ERROR_ORDER: u32 = 3;

/// One step from a time and its states, whose derivatives are `slopes`.
///
/// `derivatives` computes dx/dt at a time.
#[inline]
pub fn step<const N: usize>(
    mut derivatives: impl FnMut(f64, &[f64; N]) -> [f64; N],
    time: f64,
    states: &[f64; N],
    slopes: &[f64; N],
    duration: f64,
) -> Trial<N> {
    let k1 = slopes;
    let k2 = derivatives(time + 0.5 * duration, &moved(states, duration, [(k1, 0.5)]));
    let k3 = derivatives(time + 0.75 * duration, &moved(states, duration, [(&k2, 0.75)]));
    let end = moved(states, duration, [(k1, 2.0 / 9.0), (&k2, 1.0 / 3.0), (&k3, 4.0 / 9.0)]);
    let k4 = derivatives(time + duration, &end);
    let error = std::array::from_fn(|i| {
        duration * (-5.0 / 72.0 * k1[i] + 1.0 / 12.0 * k2[i] + 1.0 / 9.0 * k3[i] - 1.0 / 8.0 * k4[i])
    });
    Trial { states: end, slopes: k4, error }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_falls_with_the_third_power_of_the_step() {
        // x' = x·cos t, x(0) = 1: x = exp(sin t).
        let rates = |t: f64, x: &[f64; 1]| [x[0] * t.cos()];
        let error = |steps: u32| {
            let duration = 2.0 / f64::from(steps);
            let (mut states, mut slopes) = ([1.0], [1.0]);
            for n in 0..steps {
                let trial = step(rates, f64::from(n) * duration, &states, &slopes, duration);
                (states, slopes) = (trial.states, trial.slopes);
            }
            states[0] - 2.0_f64.sin().exp()
        };
        let ratio = error(80) / error(160);
        // 8 but for the next order's term.
        assert!((7.0..9.0).contains(&ratio), "the error falls by {ratio}");
    }
}
