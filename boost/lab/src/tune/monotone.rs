//! A function through points, by monotone interpolation.

use fmu_export::table::{Beyond, Curve};

/// A function through points.
#[derive(Clone, Debug)]
pub struct Monotone {
    abscissae: Vec<f64>,
    values: Vec<f64>,
}

impl Monotone {
    /// Through points with ascending abscissae; none for fewer than two points, or if they do not ascend.
    pub fn through(points: Vec<(f64, f64)>) -> Option<Self> {
        let (abscissae, values) = points.into_iter().unzip();
        let function = Self { abscissae, values };
        function.curve().check("").is_ok().then_some(function)
    }

    fn curve(&self) -> Curve<'_> {
        Curve::new(&self.abscissae, &self.values).cubic().beyond(Beyond::Invalid)
    }

    pub fn last(&self) -> f64 {
        self.abscissae[self.abscissae.len() - 1]
    }

    /// The value at an abscissa; none outside the points.
    pub fn at(&self, x: f64) -> Option<f64> {
        Some(self.curve().at(x)).filter(|value| !value.is_nan())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
