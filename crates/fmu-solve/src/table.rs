//! Tables: curves over one variable and surfaces over two, interpolated for any [`Number`], with exact derivatives by
//! the variables, and by knots and values that are parameters.
//!
//! A [`Curve`] and a [`Surface`] borrow their numbers: arrays, a model's fields, or parameters. They are cheap to make,
//! so make them where they are evaluated. [`Table`] reads the numbers from CSV. Check them once, when the model starts:
//!
//! ```
//! # use fmu_solve as fmu_export;
//! use fmu_export::table::{Beyond, Curve};
//! use fmu_export::{Dual, Error};
//!
//! let (speed, torque) = ([0.0, 64.0, 128.0], [50.0, 60.0, 28.0]);
//! let curve = Curve::new(&speed, &torque).beyond(Beyond::Extend);
//! curve.check("the torque curve")?;
//! let at = curve.at(Dual::new(96.0, 1.0));
//! assert_eq!((at.value, at.derivative), (44.0, -0.5));
//! # Ok::<(), Error>(())
//! ```
//!
//! At a knot, value and slope are those of the segment to its right. The slope of linear interpolation jumps there, and
//! so does that of [`Beyond::Hold`] at the edges. The integrator copes with such a kink by shorter steps; make the
//! knot an event if the model crosses it often, or if its states' derivatives jump by more than their usual size.

use core::fmt::Display;

use crate::elementary::Float;
use crate::error::Error;
use crate::number::Number;

#[cfg(not(target_os = "none"))]
mod file;

#[cfg(not(target_os = "none"))]
pub use file::{Grid, ReadResource, Table};

/// What is between knots.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// Straight lines.
    #[default]
    Linear,
    /// Cubic polynomials with continuous slopes that do not overshoot: PCHIP (F. N. Fritsch and J. Butland, SIAM J. Sci.
    /// Stat. Comput. 5, 1984), with the three-point formula at the ends, as in `SciPy` and MATLAB. A surface interpolates
    /// along its rows, then across them, as `SciPy`'s `RegularGridInterpolator` does; unlike a curve, it may overshoot.
    Cubic,
}

/// What is beyond the first and last knot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Beyond {
    /// The value at the edge.
    #[default]
    Hold,
    /// A straight line with the slope at the edge.
    Extend,
    /// The table again, periodically. The values at both edges must be equal.
    Repeat,
    /// NaN, with which no step is accepted: for a variable that must not leave the table.
    Invalid,
}

/// Values over one variable.
#[derive(Clone, Copy, Debug)]
pub struct Curve<'a, V = f64> {
    knots: &'a [V],
    values: &'a [V],
    interpolation: Interpolation,
    beyond: Beyond,
}

impl<'a, V: Number> Curve<'a, V> {
    /// Linear interpolation between as many values as knots; beyond, the value at the edge.
    #[must_use]
    pub fn new(knots: &'a [V], values: &'a [V]) -> Self {
        Self { knots, values, interpolation: Interpolation::Linear, beyond: Beyond::Hold }
    }

    /// The curve with [`Interpolation::Cubic`].
    #[must_use]
    pub fn cubic(self) -> Self {
        Self { interpolation: Interpolation::Cubic, ..self }
    }

    /// The curve with another way of going beyond the edges.
    #[must_use]
    pub fn beyond(self, beyond: Beyond) -> Self {
        Self { beyond, ..self }
    }

    /// The value at a place; NaN if the curve has fewer than two knots or values.
    #[must_use]
    pub fn at<T: Number + From<V>>(self, x: T) -> T {
        let knots = &self.knots[..self.knots.len().min(self.values.len())];
        along(knots, self.interpolation, self.beyond, x, |index| self.values[index].into())
    }

    /// The next knot after a place, where the slope may jump: for a curve over the time,
    /// `Equations::next_event` in one line. There is none beyond the last, unless the curve repeats.
    #[must_use]
    pub fn next_point(self, x: f64) -> Option<f64> {
        let knots = &self.knots[..self.knots.len().min(self.values.len())];
        let after = |knots: &[V], shift: f64| {
            let next = knots.get(knots.partition_point(|knot| knot.value() + shift <= x));
            next.map(|knot| knot.value() + shift)
        };
        match (self.beyond, knots) {
            (Beyond::Repeat, [first, .., last]) => {
                let period = last.value() - first.value();
                let rounds = Float::floor((x - first.value()) / period);
                // The first knot is the last of the round before. Rounding may put the end of this round before the place.
                let rest = &knots[1..];
                after(rest, rounds * period).or_else(|| after(rest, (rounds + 1.0) * period))
            }
            _ => after(knots, 0.0),
        }
    }

    /// Checks what [`Curve::at`] takes for granted.
    ///
    /// # Errors
    /// When knots do not rise strictly, there are fewer than two, there is another number of values, a number is not
    /// finite, or the edges of a repeated curve differ. The message begins with the name.
    pub fn check(self, name: &str) -> Result<(), Error> {
        check_knots(self.knots).map_err(|reason| refused(name, reason))?;
        check_values(self.knots, self.values, self.beyond).map_err(|reason| refused(name, reason))
    }
}

/// Values over two variables: a row of values for each knot of the first one.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a, R, V = f64> {
    rows: &'a [V],
    columns: &'a [V],
    values: &'a [R],
    interpolation: Interpolation,
    beyond: Beyond,
}

impl<'a, V: Number, R: AsRef<[V]>> Surface<'a, R, V> {
    /// Bilinear interpolation; beyond, the value at the edge.
    #[must_use]
    pub fn new(rows: &'a [V], columns: &'a [V], values: &'a [R]) -> Self {
        Self { rows, columns, values, interpolation: Interpolation::Linear, beyond: Beyond::Hold }
    }

    /// The surface with [`Interpolation::Cubic`].
    #[must_use]
    pub fn cubic(self) -> Self {
        Self { interpolation: Interpolation::Cubic, ..self }
    }

    /// The surface with another way of going beyond the edges, all four.
    #[must_use]
    pub fn beyond(self, beyond: Beyond) -> Self {
        Self { beyond, ..self }
    }

    /// The value at a place, given by what the rows and what the columns stand for; NaN if there are fewer than two.
    #[must_use]
    pub fn at<T: Number + From<V>>(&self, row: T, column: T) -> T {
        let rows = &self.rows[..self.rows.len().min(self.values.len())];
        along(rows, self.interpolation, self.beyond, row, |index| self.row(index).at(column))
    }

    fn row(&self, index: usize) -> Curve<'_, V> {
        let Self { columns, interpolation, beyond, .. } = *self;
        Curve { knots: columns, values: self.values[index].as_ref(), interpolation, beyond }
    }

    /// Checks what [`Surface::at`] takes for granted.
    ///
    /// # Errors
    /// As those of [`Curve::check`], for rows and columns.
    pub fn check(&self, name: &str) -> Result<(), Error> {
        let of = |axis: &'static str| move |reason: Error| refused(name, format_args!("{axis}: {reason}"));
        check_knots(self.rows).map_err(of("rows"))?;
        check_knots(self.columns).map_err(of("columns"))?;
        if self.values.len() != self.rows.len() {
            let (values, rows) = (self.values.len(), self.rows.len());
            return Err(refused(name, format_args!("{values} rows of values for {rows} knots")));
        }
        for (index, values) in self.values.iter().enumerate() {
            check_values(self.columns, values.as_ref(), self.beyond)
                .map_err(|reason| refused(name, format_args!("row {}: {reason}", index + 1)))?;
        }
        let edges = self.values.first().zip(self.values.last());
        match edges.filter(|_| self.beyond == Beyond::Repeat) {
            Some((first, last)) if first.as_ref() != last.as_ref() => {
                Err(refused(name, "the first and the last row differ, although it repeats"))
            }
            _ => Ok(()),
        }
    }
}

/// Interpolates values at knots, of which it asks for two to four.
fn along<V: Number, T: Number + From<V>>(
    knots: &[V],
    interpolation: Interpolation,
    beyond: Beyond,
    x: T,
    value: impl Fn(usize) -> T,
) -> T {
    let Some(last) = knots.len().checked_sub(1).filter(|&last| last > 0) else { return f64::NAN.into() };
    let knot = |index: usize| T::from(knots[index]);
    let x = match beyond {
        Beyond::Repeat => {
            let period = knot(last) - knot(0);
            x - period * Float::floor((x - knot(0)).value() / period.value())
        }
        _ => x,
    };
    let (is_below, is_above) = (x < knot(0), x >= knot(last));
    let edge = if is_below { 0 } else { last };
    match beyond {
        Beyond::Hold if is_below || is_above => return value(edge),
        Beyond::Invalid if is_below || x > knot(last) => return f64::NAN.into(),
        _ => {}
    }
    // The knot before.
    let before = knots.partition_point(|knot| knot.value() <= x.value()).clamp(1, last) - 1;
    let segment = match interpolation {
        Interpolation::Linear => {
            Segment::linear([knot(before), knot(before + 1)], [value(before), value(before + 1)])
        }
        Interpolation::Cubic => {
            let first = before.saturating_sub(1);
            let count = (before + 2).min(last) - first + 1;
            let points: [_; 4] = core::array::from_fn(|index| {
                let index = first + index.min(count - 1);
                (knot(index), value(index))
            });
            Segment::cubic(&points[..count], before - first)
        }
    };
    match beyond {
        Beyond::Extend if is_below || is_above => {
            let end = usize::from(is_above);
            segment.values[end] + segment.slopes[end] * (x - segment.knots[end])
        }
        _ => segment.at(x, interpolation),
    }
}

/// A polynomial between two knots, by values and slopes there.
struct Segment<T> {
    knots: [T; 2],
    values: [T; 2],
    slopes: [T; 2],
}

impl<T: Number> Segment<T> {
    fn linear(knots: [T; 2], values: [T; 2]) -> Self {
        let slope = (values[1] - values[0]) / (knots[1] - knots[0]);
        Self { knots, values, slopes: [slope; 2] }
    }

    /// The segment after one of two to four points, which are all neighbours that its slopes depend on.
    fn cubic(points: &[(T, T)], before: usize) -> Self {
        let slopes = [before, before + 1].map(|index| slope(points, index));
        let [(from, low), (to, high)] = [points[before], points[before + 1]];
        Self { knots: [from, to], values: [low, high], slopes }
    }

    fn at(&self, x: T, interpolation: Interpolation) -> T {
        let Self { knots, values, slopes } = self;
        let width = knots[1] - knots[0];
        let share = (x - knots[0]) / width;
        let rest = -share + 1.0;
        // Exact at both ends.
        match interpolation {
            Interpolation::Linear => rest * values[0] + share * values[1],
            Interpolation::Cubic => {
                values[0] * (share * 2.0 + 1.0) * rest * rest
                    + values[1] * (-share * 2.0 + 3.0) * share * share
                    + width * share * rest * (slopes[0] * rest - slopes[1] * share)
            }
        }
    }
}

/// The slope of PCHIP at one of two to four points: at the ends of a table, and of these points, from three of them.
fn slope<T: Number>(points: &[(T, T)], index: usize) -> T {
    let width = |index: usize| points[index + 1].0 - points[index].0;
    let secant = |index: usize| (points[index + 1].1 - points[index].1) / width(index);
    let last = points.len() - 1;
    if last == 1 {
        return secant(0);
    }
    if index == 0 || index == last {
        let (near, far) = if index == 0 { (0, 1) } else { (last - 1, last - 2) };
        return end_slope([width(near), width(far)], [secant(near), secant(far)]);
    }
    let [before, after] = [secant(index - 1), secant(index)];
    let is_extremum = before.value() * after.value() <= 0.0;
    if is_extremum {
        return 0.0.into();
    }
    let (near, far) = (width(index - 1), width(index));
    let weights = [far * 2.0 + near, far + near * 2.0];
    (weights[0] + weights[1]) / (weights[0] / before + weights[1] / after)
}

/// The slope at an end, given widths and secants of the segment there and the next one.
fn end_slope<T: Number>([near, far]: [T; 2], [secant, next]: [T; 2]) -> T {
    let slope = ((near * 2.0 + far) * secant - near * next) / (near + far);
    let limit = secant * 3.0;
    if slope.value() * secant.value() <= 0.0 {
        0.0.into()
    } else if secant.value() * next.value() < 0.0 && slope.abs() > limit.abs() {
        limit
    } else {
        slope
    }
}

fn refused(name: &str, reason: impl Display) -> Error {
    Error::new(format_args!("{name}: {reason}"))
}

fn check_knots<V: Number>(knots: &[V]) -> Result<(), Error> {
    if knots.len() < 2 {
        return Err(Error::new(format_args!("{} knots; it needs two", knots.len())));
    }
    check_finite("knot", knots)?;
    for (index, pair) in knots.windows(2).enumerate() {
        if pair[0] >= pair[1] {
            let [one, next] = [pair[0].value(), pair[1].value()];
            return Err(Error::new(format_args!(
                "knot {} is {next}, not above the one before, {one}",
                index + 2
            )));
        }
    }
    Ok(())
}

fn check_values<V: Number>(knots: &[V], values: &[V], beyond: Beyond) -> Result<(), Error> {
    if values.len() != knots.len() {
        return Err(Error::new(format_args!("{} values for {} knots", values.len(), knots.len())));
    }
    check_finite("value", values)?;
    match (values, beyond) {
        ([first, .., last], Beyond::Repeat) if first != last => {
            let [first, last] = [first.value(), last.value()];
            Err(Error::new(format_args!("it repeats, but the first value is {first}, and the last {last}")))
        }
        _ => Ok(()),
    }
}

fn check_finite<V: Number>(what: &str, numbers: &[V]) -> Result<(), Error> {
    match numbers.iter().position(|number| !number.value().is_finite()) {
        Some(index) => Err(Error::new(format_args!("{what} {} is {}", index + 1, numbers[index].value()))),
        None => Ok(()),
    }
}
