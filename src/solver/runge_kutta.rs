//! The classical Runge-Kutta method of fourth order with a fixed step.
//!
//! Why a fixed step: it never tries states far off the solution, costs the same in each communication
//! step, and makes results independent of how the master cuts time into steps, as far as these are
//! multiples of it. 1/2400 s is the 30th part of a controller sample at 80 Hz and the 8th of a PWM period
//! at 300 Hz. The fastest modes of the plant, the volumes around the throttle at about 1600 1/s, leave it
//! a quarter of the method's limit of stability.

/// The longest substep in seconds.
pub const LONGEST_STEP: f64 = 1.0 / 2400.0;

/// How many equal substeps, none longer than [`LONGEST_STEP`], an interval of `duration` seconds takes.
///
/// An interval that is a multiple of the longest step but for rounding is cut into that many: 12.5 ms
/// into 30.
#[must_use]
pub fn substeps(duration: f64) -> u64 {
    // The cast saturates; a duration of 1e15 s would not be finished anyway.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let count = (duration / LONGEST_STEP - 1e-6).ceil().max(1.0) as u64;
    count
}

/// Advances `states` by `duration` seconds.
///
/// `derivatives` computes dx/dt at a time after the step's begin.
pub fn step<const N: usize>(
    mut derivatives: impl FnMut(f64, &[f64; N]) -> [f64; N],
    states: &mut [f64; N],
    duration: f64,
) {
    let half = 0.5 * duration;
    let k1 = derivatives(0.0, states);
    let k2 = derivatives(half, &moved(states, &k1, half));
    let k3 = derivatives(half, &moved(states, &k2, half));
    let k4 = derivatives(duration, &moved(states, &k3, duration));
    for i in 0..N {
        states[i] += duration / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
    }
}

/// The states after moving with constant slopes.
fn moved<const N: usize>(states: &[f64; N], slopes: &[f64; N], duration: f64) -> [f64; N] {
    std::array::from_fn(|i| states[i] + duration * slopes[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_is_cut_into_the_fewest_substeps_despite_rounding() {
        assert_eq!(substeps(0.0125), 30);
        assert_eq!(substeps(1.0 / 300.0), 8);
        assert_eq!(substeps(1e-9), 1);
        assert_eq!(substeps(1.01 / 2400.0), 2);
        // The length of a step late in an experiment carries the rounding of its ends.
        assert_eq!(substeps(1000.0125 - 1000.0), 30);
    }

    #[test]
    fn the_error_falls_with_the_fourth_power_of_the_step() {
        // x' = x·cos t, x(0) = 1: x = exp(sin t).
        let error = |steps: u32| {
            let duration = 2.0 / f64::from(steps);
            let mut states = [1.0];
            for n in 0..steps {
                let start = f64::from(n) * duration;
                step(|offset, x| [x[0] * (start + offset).cos()], &mut states, duration);
            }
            (states[0] - 2.0_f64.sin().exp()).abs()
        };
        let ratio = error(40) / error(80);
        // 16 but for the next order's term.
        assert!((15.0..17.5).contains(&ratio), "the error falls by {ratio}");
    }
}
