//! Scales: from values to positions on an axis, with ticks at round numbers.

/// A range of values on an axis.
#[derive(Clone, Debug)]
pub struct Scale {
    from: f64,
    to: f64,
    ticks: Vec<(f64, String)>,
}

impl Scale {
    /// A range with at most so many ticks.
    pub fn exact(from: f64, to: f64, most_ticks: usize) -> Self {
        let (from, to) = proper(from, to);
        Self { from, to, ticks: ticks(from, to, most_ticks) }
    }

    /// With margins around the values.
    pub fn around(from: f64, to: f64, most_ticks: usize) -> Self {
        let (from, to) = proper(from, to);
        let room = 0.06 * (to - from);
        Self::exact(from - room, to + room, most_ticks)
    }

    /// Where a value is: 0 at the beginning, 1 at the end.
    pub fn fraction(&self, value: f64) -> f64 {
        (value - self.from) / (self.to - self.from)
    }

    /// The ticks, as numbers and as texts.
    pub fn ticks(&self) -> &[(f64, String)] {
        &self.ticks
    }
}

/// A range that can be drawn: not empty, and finite. Values equal to six digits are shown as constant.
fn proper(from: f64, to: f64) -> (f64, f64) {
    if !(from.is_finite() && to.is_finite()) {
        return (0.0, 1.0);
    }
    if to - from > 1e-6 * from.abs().max(to.abs()) {
        return (from, to);
    }
    let half = if from == 0.0 { 1.0 } else { 0.05 * from.abs() };
    (from - half, to + half)
}

fn ticks(from: f64, to: f64, most: usize) -> Vec<(f64, String)> {
    let roughest = (to - from) / most as f64;
    let magnitude = 10_f64.powf(roughest.log10().floor());
    let step = [1.0, 2.0, 2.5, 5.0, 10.0].map(|factor| factor * magnitude);
    let step = step.into_iter().find(|step| *step >= roughest * (1.0 - 1e-9)).unwrap_or(10.0 * magnitude);
    // 2.5 needs one decimal more than its magnitude.
    let decimals = (0..10).find(|&decimals| {
        let scaled = step * 10_f64.powi(decimals);
        (scaled - scaled.round()).abs() < 1e-6 * scaled
    });
    let decimals = usize::try_from(decimals.unwrap_or(10)).unwrap_or(10);
    let first = (from / step - 1e-6).ceil();
    let last = (to / step + 1e-6).floor();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // there are at most as many as asked for
    let count = (last - first).max(-1.0) as i64 + 1;
    (0..count)
        .map(|index| {
            let value = (first + index as f64) * step;
            let text = format!("{:.decimals$}", value.abs());
            let is_negative = value < 0.0 && text.chars().any(|digit| ('1'..='9').contains(&digit));
            (value, if is_negative { format!("\u{2212}{text}") } else { text })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(from: f64, to: f64, most: usize) -> Vec<String> {
        Scale::exact(from, to, most).ticks.into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(texts(0.0, 124.0, 8), ["0", "20", "40", "60", "80", "100", "120"]);
        assert_eq!(texts(-0.31, 0.32, 5), ["\u{2212}0.2", "0.0", "0.2"]);
        assert_eq!(texts(76.2, 79.9, 4), ["77", "78", "79"]);
        assert_eq!(texts(0.0, 10.0, 4), ["0.0", "2.5", "5.0", "7.5", "10.0"]);
    }

    #[test]
    fn a_constant_line_is_centred() {
        let scale = Scale::around(12.0, 12.0, 4);
        assert!((scale.fraction(12.0) - 0.5).abs() < 1e-12);
        assert!(!scale.ticks().is_empty());
    }

    #[test]
    fn an_empty_figure_can_be_drawn() {
        assert!(!Scale::around(f64::INFINITY, f64::NEG_INFINITY, 4).ticks().is_empty());
    }
}
