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
