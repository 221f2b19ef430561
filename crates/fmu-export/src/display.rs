//! Numbers as people read them, for the messages of models.

use core::fmt;

/// A value with six significant digits and no long runs of zeros.
///
/// ```
/// use fmu_export::display::Rounded;
///
/// assert_eq!(Rounded(148.904_466_319_720_78).to_string(), "148.904");
/// assert_eq!(Rounded(3.608e-300).to_string(), "3.608e-300");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Rounded(pub f64);

impl fmt::Display for Rounded {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Parsing what was formatted cannot fail.
        short(format!("{:.5e}", self.0).parse().unwrap_or(self.0), formatter)
    }
}

/// A time (s) to the nanosecond, which leaves the round-off of added steps out.
///
/// ```
/// assert_eq!(fmu_export::display::Seconds(6.162_500_000_000_000_5).to_string(), "6.1625");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Seconds(pub f64);

impl fmt::Display for Seconds {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        short(format!("{:.9}", self.0).parse().unwrap_or(self.0), formatter)
    }
}

/// The shortest text that reads back the same, with an exponent instead of many zeros.
fn short(value: f64, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
    let text = format!("{value:?}");
    formatter.write_str(text.strip_suffix(".0").unwrap_or(&text))
}
