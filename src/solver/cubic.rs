//! Interpolation between the steps of an integrator: a cubic through values and slopes at both ends (Hermite),
//! whose error falls with the fourth power of the step.

/// A cubic between two points with known slopes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cubic {
    begin: f64,
    duration: f64,
    /// Coefficients of the powers of the time relative to the duration.
    coefficients: [f64; 4],
}

impl Cubic {
    /// The cubic over `duration` from a time, through values and slopes at start and end.
    pub fn new(begin: f64, duration: f64, values: [f64; 2], slopes: [f64; 2]) -> Self {
        let rise = values[1] - values[0];
        let [first, second] = slopes.map(|slope| slope * duration);
        let coefficients = [values[0], first, 3.0 * rise - 2.0 * first - second, first + second - 2.0 * rise];
        Self { begin, duration, coefficients }
    }

    /// The time at which it ends.
    pub fn end(&self) -> f64 {
        self.begin + self.duration
    }

    /// Its value at a time.
    pub fn at(&self, time: f64) -> f64 {
        let [c0, c1, c2, c3] = self.coefficients;
        let share = (time - self.begin) / self.duration;
        c0 + share * (c1 + share * (c2 + share * c3))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_is_interpolated_exactly() {
        // t³ − 2·t from 1 to 3.
        let cubic = Cubic::new(1.0, 2.0, [-1.0, 21.0], [1.0, 25.0]);
        for t in [1.0_f64, 1.3, 2.0, 2.9, 3.0] {
            // Rounding of numbers up to 30.
            assert!((cubic.at(t) - (t.powi(3) - 2.0 * t)).abs() < 1e-13);
        }
        assert!((cubic.end() - 3.0).abs() < f64::EPSILON);
    }
}
