//! Monotone interpolation: cubics with slopes limited by Fritsch and Butland (SIAM J. Sci. Stat. Comput. 5, 1984,
//! pp. 300–304), at the ends from three points.

/// A function through points.
#[derive(Clone, Debug)]
pub struct Monotone {
    points: Vec<(f64, f64)>,
    slopes: Vec<f64>,
}

impl Monotone {
    /// Through points with ascending abscissae; none for fewer than two points, or if they do not ascend.
    pub fn through(points: Vec<(f64, f64)>) -> Option<Self> {
        if points.len() < 2 || !points.windows(2).all(|pair| pair[0].0 < pair[1].0) {
            return None;
        }
        let widths: Vec<f64> = points.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
        let secants: Vec<f64> =
            points.windows(2).zip(&widths).map(|(pair, width)| (pair[1].1 - pair[0].1) / width).collect();
        let last = secants.len() - 1;
        let mut slopes = vec![secants[0]; points.len()];
        if last > 0 {
            slopes[0] = end_slope([widths[0], widths[1]], [secants[0], secants[1]]);
            slopes[last + 1] =
                end_slope([widths[last], widths[last - 1]], [secants[last], secants[last - 1]]);
        }
        for index in 1..=last {
            let [before, after] = [secants[index - 1], secants[index]];
            let [near, far] = [widths[index - 1], widths[index]];
            slopes[index] = if before * after > 0.0 {
                let weights = [2.0 * far + near, far + 2.0 * near];
                (weights[0] + weights[1]) / (weights[0] / before + weights[1] / after)
            } else {
                0.0
            };
        }
        Some(Self { points, slopes })
    }

    pub fn last(&self) -> f64 {
        self.points[self.points.len() - 1].0
    }

    /// The value at an abscissa; none outside the points.
    pub fn at(&self, x: f64) -> Option<f64> {
        let after = self.points.partition_point(|&(known, _)| known <= x);
        let index = after.min(self.points.len() - 1).checked_sub(1)?;
        let [(x0, y0), (x1, y1)] = [self.points[index], self.points[index + 1]];
        if !(x0..=x1).contains(&x) {
            return None;
        }
        let width = x1 - x0;
        let t = (x - x0) / width;
        let rest = 1.0 - t;
        Some(
            y0 * (1.0 + 2.0 * t) * rest * rest
                + y1 * (3.0 - 2.0 * t) * t * t
                + width * t * rest * (self.slopes[index] * rest - self.slopes[index + 1] * t),
        )
    }
}

/// The slope of the parabola through three points at an outermost one, limited to what is monotone; widths and
/// secants are from there inwards.
fn end_slope(widths: [f64; 2], secants: [f64; 2]) -> f64 {
    let slope =
        ((2.0 * widths[0] + widths[1]) * secants[0] - widths[0] * secants[1]) / (widths[0] + widths[1]);
    if slope * secants[0] <= 0.0 {
        0.0
    } else if secants[0] * secants[1] < 0.0 && slope.abs() > 3.0 * secants[0].abs() {
        3.0 * secants[0]
    } else {
        slope
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The expected values are those of `PchipInterpolator` of `SciPy` 1.17.
    #[test]
    fn values_are_those_of_another_implementation() {
        let points = vec![(0.0, 100.0), (1.0, 80.0), (3.0, 75.0), (3.5, 40.0), (6.0, 39.0)];
        let function = Monotone::through(points).unwrap();
        let expected = [
            (0.0, 100.0),
            (0.25, 93.470_228_040_540_55),
            (0.9, 80.721_554_054_054_05),
            (1.0, 80.0),
            (1.7, 78.097_169_606_046_73),
            (2.999, 75.005_927_590_203_26),
            (3.2, 62.301_813_394_767_14),
            (3.5, 40.0),
            (4.4, 39.328_713_941_747_57),
            (6.0, 39.0),
        ];
        for (x, y) in expected {
            assert!((function.at(x).unwrap() - y).abs() < 1e-9, "at {x}: {:?}", function.at(x));
        }
    }

    #[test]
    fn nothing_is_extrapolated() {
        let function = Monotone::through(vec![(0.0, 1.0), (2.0, 3.0)]).unwrap();
        let values = [-1e-9, 0.0, 1.0, 2.0, 2.0 + 1e-9].map(|x| function.at(x));
        assert_eq!(values, [None, Some(1.0), Some(2.0), Some(3.0), None]);
        assert_eq!(function.at(f64::NAN), None);
    }

    #[test]
    fn points_that_do_not_ascend_are_refused() {
        assert!(Monotone::through(vec![(0.0, 1.0)]).is_none());
        assert!(Monotone::through(vec![(0.0, 1.0), (0.0, 2.0)]).is_none());
        assert!(Monotone::through(vec![(0.0, 1.0), (f64::NAN, 2.0)]).is_none());
    }
}
