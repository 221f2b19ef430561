//! Numbers in messages, as people read them, and texts without an allocator.

use core::fmt::{self, Write as _};
use core::ops::Deref;

/// The bytes of the longest text of a number: the digits of `f64::MAX` before the point, and nine after it.
const LONGEST: usize = 320;

/// A value with six significant digits and no long runs of zeros.
///
/// ```
/// use fmu_solve::display::Rounded;
///
/// assert_eq!(Rounded(148.904_466_319_720_78).to_string(), "148.904");
/// assert_eq!(Rounded(3.608e-300).to_string(), "3.608e-300");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Rounded<T = f64>(pub T);

impl<T: Copy + Into<f64>> fmt::Display for Rounded<T> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = self.0.into();
        Shown(parsed(format_args!("{value:.5e}"), value)).fmt(formatter)
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
        Shown(parsed(format_args!("{:.9}", self.0), self.0)).fmt(formatter)
    }
}

/// A number with all digits and no long runs of zeros.
#[derive(Debug)]
pub struct Shown(pub f64);

impl fmt::Display for Shown {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = Text::<LONGEST>::of(format_args!("{:?}", self.0));
        formatter.write_str(text.strip_suffix(".0").unwrap_or(&text))
    }
}

/// The number that a text says, which is always one: that of a number.
pub(crate) fn parsed(text: fmt::Arguments<'_>, number: f64) -> f64 {
    Text::<LONGEST>::of(text).parse().unwrap_or(number)
}

/// A text in a fixed number of bytes, at which it is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Text<const BYTES: usize> {
    bytes: [u8; BYTES],
    length: usize,
}

impl<const BYTES: usize> Text<BYTES> {
    /// The text of anything that can be shown.
    pub fn of(shown: impl fmt::Display) -> Self {
        let mut text = Self::default();
        // It fails where the bytes end.
        let _ = write!(text, "{shown}");
        text
    }
}

impl<const BYTES: usize> Default for Text<BYTES> {
    fn default() -> Self {
        Self { bytes: [0; BYTES], length: 0 }
    }
}

impl<const BYTES: usize> Deref for Text<BYTES> {
    type Target = str;

    fn deref(&self) -> &str {
        str::from_utf8(self.bytes.get(..self.length).unwrap_or_default()).unwrap_or_default()
    }
}

impl<const BYTES: usize> fmt::Write for Text<BYTES> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let free = self.bytes.get_mut(self.length..).unwrap_or_default();
        let whole = (0..=free.len().min(text.len())).rev().find(|&length| text.is_char_boundary(length));
        let length = whole.unwrap_or_default();
        free.iter_mut().zip(text.bytes().take(length)).for_each(|(free, byte)| *free = byte);
        self.length += length;
        // What follows must not appear without what was cut.
        if length == text.len() { Ok(()) } else { Err(fmt::Error) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_cut_between_characters() {
        assert_eq!(&*Text::<6>::of("20 °C"), "20 °C");
        assert_eq!(&*Text::<5>::of("20 °C"), "20 °");
        assert_eq!(&*Text::<4>::of("20 °C"), "20 ");
        assert_eq!(&*Text::<0>::of("20 °C"), "");
    }

    #[test]
    fn any_number_has_a_text() {
        for number in [f64::MAX, f64::MIN, f64::MIN_POSITIVE, 5e-324, -1.0, 0.0, f64::INFINITY] {
            let shown = Shown(number).to_string().parse::<f64>();
            assert_eq!(shown.map(f64::to_bits), Ok(number.to_bits()), "{number:e}");
            assert_eq!(
                Seconds(number).to_string(),
                Shown(format!("{number:.9}").parse().unwrap()).to_string()
            );
        }
        assert_eq!(Rounded(f64::NAN).to_string(), "NaN");
    }
}
