//! Rounding of times.

/// The rounding error that an importer's time (s) may have, after some additions and products.
pub(crate) fn time_rounding(time: f64) -> f64 {
    64.0 * f64::EPSILON * time.abs()
}
