//! How the built-in integrator solves the equations of a model.

use crate::integrator::{AUTOMATIC, Method};

/// The relative tolerance if neither importer nor JSON gives one.
pub const DEFAULT_TOLERANCE: f64 = 1e-6;

/// The settings of the built-in integrator, for equations with variables of type `V`.
///
/// ```ignore
/// const INTEGRATION: Integration<Variables> = Integration { longest_step: 0.1, ..Integration::DEFAULT };
/// ```
pub struct Integration<V> {
    /// The method.
    pub method: &'static Method,
    /// The longest internal step in s, for models in which the error estimate may miss something shorter.
    pub longest_step: f64,
    /// The error of each state that a tolerance of 1 allows in a step; by default the sum of the state's magnitude and
    /// its nominal value.
    pub error_scales: Option<&'static [f64]>,
    /// The tolerance; `asked` is the importer's, or that of the JSON if it gives none.
    pub tolerance: fn(variables: &V, asked: Option<f64>) -> f64,
    /// Whether events sample inputs, and the equations use only the samples. If so, an event due at the end of a
    /// communication step belongs to the next step, with its inputs.
    pub samples_inputs: bool,
}

impl<V> Integration<V> {
    /// The method chosen as phases turn out stiff or not, with the tolerance of importer or JSON, or [`DEFAULT_TOLERANCE`].
    pub const DEFAULT: Self = Self {
        method: &AUTOMATIC,
        longest_step: f64::INFINITY,
        error_scales: None,
        tolerance: |_, asked| asked.unwrap_or(DEFAULT_TOLERANCE),
        samples_inputs: false,
    };
}
