//! Numbers in messages, as people read them.

use core::fmt;

/// A value with six significant digits and no long runs of zeros.
///
/// ```
/// use fmu_solve::display::Rounded;
///
/// assert_eq!(Rounded(148.904_466_319_720_78).to_string(), "148.904");
/// assert_eq!(Rounded(3.608e-300).to_string(), "3.608e-300");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Rounded(pub f64);

impl fmt::Display for Rounded {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Parsing what was formatted cannot fail.
        Shown(format!("{:.5e}", self.0).parse().unwrap_or(self.0)).fmt(formatter)
    }
}

/// A time (s) to the nanosecond, without the round-off of summed steps.
///
/// ```
/// assert_eq!(fmu_solve::display::Seconds(6.162_500_000_000_000_5).to_string(), "6.1625");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Seconds(pub f64);

impl fmt::Display for Seconds {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        Shown(format!("{:.9}", self.0).parse().unwrap_or(self.0)).fmt(formatter)
    }
}

/// A number with all digits and no long runs of zeros.
#[derive(Debug)]
pub struct Shown(pub f64);

impl fmt::Display for Shown {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = format!("{:?}", self.0);
        formatter.write_str(text.strip_suffix(".0").unwrap_or(&text))
    }
}
