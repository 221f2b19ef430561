//! The classical Runge-Kutta method of fourth order, with a fixed step: for following a transient to wherever it
//! leads, where its accuracy on the way does not matter.

use super::moved;

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
    let k2 = derivatives(half, &moved(states, half, [(&k1, 1.0)]));
    let k3 = derivatives(half, &moved(states, half, [(&k2, 1.0)]));
    let k4 = derivatives(duration, &moved(states, duration, [(&k3, 1.0)]));
    for i in 0..N {
        states[i] += duration / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
