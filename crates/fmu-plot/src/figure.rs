//! Figures: rows of [`Panel`]s that hold [`Line`]s over their axes. [`interactive`] draws them with plotly in HTML,
//! [`picture`] with plotters as SVG and PNG.
//!
//! The colours are those of the pages' style sheet, distinguishable for the colour-blind.

#[cfg(feature = "html")]
mod interactive;
mod picture;

use std::collections::{BTreeSet, HashSet};

#[cfg(feature = "html")]
pub(crate) use self::interactive::SCRIPTS;
use fmu_io::terminal::printable;
use fmu_terms::Linear;
use fmu_xml::page::STYLE;

/// A colour, named in the style sheet for the light and the dark scheme.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Color(&'static str);

/// The colours of figures, colour-blind safe.
pub mod color {
    use super::Color;

    /// The colour behind the figures.
    pub const PAPER: Color = Color("--paper");
    /// The colour of shaded ranges.
    pub const SHADE: Color = Color("--shade");
    /// The colour of grids and thin borders.
    pub const RULE: Color = Color("--rule");
    /// The colour of secondary texts.
    pub const FAINT: Color = Color("--faint");
    /// The colour of the least value of a map, behind texts.
    pub const LOW: Color = Color("--low");
    /// The colour of the greatest value of a map, behind texts.
    pub const HIGH: Color = Color("--high");
    /// The colour of references and texts.
    pub const INK: Color = Color("--ink");
    /// The colour of secondary curves.
    pub const GRAY: Color = Color("--third");
    /// The colour of the main curve.
    pub const BLUE: Color = Color("--first");
    /// The colour of a curve for comparison.
    pub const VERMILION: Color = Color("--second");
    /// A colour of additional curves.
    pub const GREEN: Color = Color("--green");
    /// A colour of additional curves.
    pub const PURPLE: Color = Color("--purple");
    /// A colour of additional curves.
    pub const SKY: Color = Color("--sky");
    /// A colour of additional curves.
    pub const ORANGE: Color = Color("--orange");
    /// The colours of a panel's curves, in order.
    pub const CYCLE: [Color; 6] = [BLUE, VERMILION, GREEN, PURPLE, SKY, ORANGE];
}

impl Color {
    /// The name of the colour's CSS variable in the style sheet, such as `--first`.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.0
    }

    /// Red, green and blue (sRGB) in light mode, as in pictures.
    ///
    /// # Panics
    /// Never: the style sheet defines each colour.
    #[must_use]
    pub fn day(self) -> [u8; 3] {
        let definition = STYLE.split(&format!("{}: #", self.0)).nth(1);
        let digits = definition.and_then(|text| u32::from_str_radix(text.get(..6)?, 16).ok());
        let [_, color @ ..] = digits.expect("the style sheet defines each colour").to_be_bytes();
        color
    }
}

/// Panels in rows, one below the other; those of a row are side by side. Pictures are 900 CSS pixels wide.
#[derive(Clone, Debug, Default)]
#[must_use]
pub struct Figure {
    title: String,
    rows: Vec<Vec<Panel>>,
    shares_x: bool,
    note: String,
}

/// A frame with its axes and curves.
#[derive(Clone, Debug, Default)]
#[must_use]
pub struct Panel {
    title: String,
    x: Axis,
    y: Axis,
    lines: Vec<Line>,
    lanes: Vec<Lane>,
    bands: Vec<Band>,
    height: u32,
    has_equal_scales: bool,
}

/// The states of a signal over time, as a logic analyser draws them.
#[derive(Clone, Debug)]
pub(crate) struct Lane {
    name: String,
    states: Vec<State>,
}

/// A state and how long it lasts.
#[derive(Clone, Debug, PartialEq)]
struct State {
    from: f64,
    to: f64,
    text: String,
    /// Whether the state is drawn as a line rather than a box.
    is_low: bool,
}

/// The label and range of an axis.
#[derive(Clone, Debug, Default)]
struct Axis {
    label: String,
    range: Option<(f64, f64)>,
    is_logarithmic: bool,
}

/// A line through points, in the units of its panel's axes. Values that are not finite are gaps.
#[derive(Clone, Debug)]
#[must_use]
pub struct Line {
    points: Vec<(f64, f64)>,
    /// The name in the legend; empty for none.
    label: String,
    color: Color,
    width: f64,
    is_dashed: bool,
    is_held: bool,
    marks: Marks,
    /// The variable of the line and the factor to its values, for a page that draws further points.
    #[cfg_attr(not(feature = "html"), allow(dead_code))]
    source: Option<(String, Linear)>,
}

/// How a line's points are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Marks {
    Stroke,
    StrokeAndDots,
    Dots,
}

/// A shaded range.
#[derive(Clone, Debug)]
struct Band {
    from: f64,
    to: f64,
    is_of_x: bool,
}

impl Figure {
    /// A figure without panels.
    pub fn new() -> Self {
        Self::default()
    }

    /// The title of a picture; on a page it is the heading.
    pub fn title(self, title: &str) -> Self {
        Self { title: title.to_owned(), ..self }
    }

    /// A text below the panels.
    pub fn note(self, note: &str) -> Self {
        Self { note: note.to_owned(), ..self }
    }

    /// Adds a row below the others; ignores a row without panels.
    pub fn row(mut self, panels: impl IntoIterator<Item = Panel>) -> Self {
        let panels: Vec<_> = panels.into_iter().collect();
        if !panels.is_empty() {
            self.rows.push(panels);
        }
        self
    }

    /// Panels in a column share one horizontal axis: only the lowest is labelled, and in HTML they zoom together.
    pub fn shared_x(self) -> Self {
        Self { shares_x: true, ..self }
    }

    /// The figure without its points, for a page whose script adds them; see [`Line::source`].
    pub fn without_points(mut self) -> Self {
        let panels = self.rows.iter_mut().flatten();
        panels.flat_map(|panel| &mut panel.lines).for_each(|line| line.points.clear());
        self
    }

    /// Whether a row shows the label of its horizontal axis.
    fn has_x_label(&self, row: usize) -> bool {
        !self.shares_x || row + 1 == self.rows.len()
    }
}

impl Panel {
    /// An empty panel with its axes' labels, which include the units: `time (s)`. Its axes fit its lines.
    pub fn new(x_label: &str, y_label: &str) -> Self {
        let [x, y] = [x_label, y_label].map(|label| Axis { label: label.to_owned(), ..Axis::default() });
        Self { x, y, height: 170, ..Self::default() }
    }

    /// A panel of lanes, the first at the top.
    pub(crate) fn of_lanes(x_label: &str, lanes: Vec<Lane>) -> Self {
        let count = u32::try_from(lanes.len()).unwrap_or(u32::MAX / LANE);
        Self { lanes, ..Self::new(x_label, "") }.y_range(0.0, f64::from(count)).height(LANE * count)
    }

    /// The title above the frame.
    pub fn title(self, title: &str) -> Self {
        Self { title: title.to_owned(), ..self }
    }

    /// The height of the frame in CSS pixels, by default 170.
    pub fn height(self, height: u32) -> Self {
        Self { height, ..self }
    }

    /// The range of the horizontal axis; points outside are not drawn.
    pub fn x_range(self, from: f64, to: f64) -> Self {
        Self { x: Axis { range: Some((from, to)), ..self.x }, ..self }
    }

    /// The range of the vertical axis.
    pub fn y_range(self, from: f64, to: f64) -> Self {
        Self { y: Axis { range: Some((from, to)), ..self.y }, ..self }
    }

    /// A logarithmic horizontal axis, for lines at positive places.
    pub fn logarithmic_x(self) -> Self {
        Self { x: Axis { is_logarithmic: true, ..self.x }, ..self }
    }

    /// Equal scales on both axes, for a curve in a plane.
    pub fn equal_scales(self) -> Self {
        Self { has_equal_scales: true, ..self }
    }

    /// Adds a line, drawn over the others.
    pub fn line(mut self, line: Line) -> Self {
        self.lines.push(line);
        self
    }

    /// Shades a range of the vertical axis.
    pub fn band(mut self, from: f64, to: f64) -> Self {
        self.bands.push(Band { from, to, is_of_x: false });
        self
    }

    /// Shades a range of the horizontal axis.
    pub fn x_band(mut self, from: f64, to: f64) -> Self {
        self.bands.push(Band { from, to, is_of_x: true });
        self
    }

    /// The lines, thinned to at most this many pixel columns; on a logarithmic axis, over decades.
    fn thinned_lines(&self, columns: usize) -> impl Iterator<Item = (&Line, Vec<(f64, f64)>)> {
        let cells = [(self.x_extent(), columns), (self.y_extent(), self.height as usize)];
        self.lines.iter().map(move |line| {
            let points: Vec<_> = line.points.iter().map(|point| (self.x.place(point.0), point.1)).collect();
            let points = match line.marks {
                Marks::Dots => distinct(&points, cells),
                // A curve that turns back is kept whole.
                _ if self.has_equal_scales => points,
                Marks::Stroke | Marks::StrokeAndDots => thinned(&points, cells[0]),
            };
            (line, points)
        })
    }

    fn x_extent(&self) -> (f64, f64) {
        let range = self.x.range.map(|(from, to)| (self.x.place(from), self.x.place(to)));
        range.unwrap_or_else(|| extent(&self.lines, |point| self.x.place(point.0)))
    }

    fn y_extent(&self) -> (f64, f64) {
        self.y.range.unwrap_or_else(|| extent(&self.lines, |point| point.1))
    }
}

impl Axis {
    /// The place of a value; on a logarithmic axis, in decades.
    fn place(&self, value: f64) -> f64 {
        if self.is_logarithmic { value.log10() } else { value }
    }

    /// The value at a place.
    fn value(&self, place: f64) -> f64 {
        if self.is_logarithmic { 10_f64.powf(place) } else { place }
    }
}

impl Line {
    /// A solid blue line through the points (x, y), as many as the shorter of the two has.
    pub fn new(x: &[f64], y: impl IntoIterator<Item = f64>) -> Self {
        Self {
            points: x.iter().copied().zip(y).collect(),
            label: String::new(),
            color: color::BLUE,
            width: 1.5,
            is_dashed: false,
            is_held: false,
            marks: Marks::Stroke,
            source: None,
        }
    }

    /// The variable whose values these are, and the function from its unit to the axis'. A page's script finds the line
    /// by plotly's `meta`: `0.001 boost_pressure`, or with an offset `1.0-273.15 charge_temperature`. Pictures ignore
    /// it.
    pub fn source(self, name: &str, function: Linear) -> Self {
        Self { source: Some((name.to_owned(), function)), ..self }
    }

    /// Sets the line's name in the legend, which omits lines without one.
    pub fn label(self, label: &str) -> Self {
        Self { label: label.to_owned(), ..self }
    }

    /// Sets the line's colour.
    pub fn color(self, color: Color) -> Self {
        Self { color, ..self }
    }

    /// Draws the line thinner: 1 CSS pixel instead of 1.5.
    pub fn thin(self) -> Self {
        Self { width: 1.0, ..self }
    }

    /// Draws the line dashed.
    pub fn dashed(self) -> Self {
        Self { is_dashed: true, ..self }
    }

    /// Holds each value until the next point.
    pub fn held(self) -> Self {
        Self { is_held: true, ..self }
    }

    /// Draws a marker at each point, too.
    pub fn markers(self) -> Self {
        Self { marks: Marks::StrokeAndDots, ..self }
    }

    /// Draws a marker at each point instead of the line.
    pub fn dots(self) -> Self {
        Self { marks: Marks::Dots, ..self }
    }
}

impl Lane {
    /// A signal of this name, with the text of its value at each time; a low state is drawn as a line. Changes within a
    /// pixel are drawn as one state, without a text.
    pub(crate) fn new<'a>(name: &str, values: impl IntoIterator<Item = (f64, &'a str, bool)>) -> Self {
        let values: Vec<_> = values.into_iter().collect();
        let [begin, end] = [values.first(), values.last()].map(|value| value.map_or(0.0, |value| value.0));
        let runs: Vec<_> = values.chunk_by(|one, other| (one.1, one.2) == (other.1, other.2)).collect();
        let place = |run: &[(f64, &str, bool)]| pixel(run[0].0, ((begin, end), LANE_COLUMNS));
        let mut states: Vec<State> = vec![];
        for strip in runs.chunk_by(|one, other| place(one) == place(other)) {
            let (from, text, is_low) = strip[0][0];
            let (text, is_low) = if strip.len() == 1 { (text, is_low) } else { ("", false) };
            if let Some(last) = states.last_mut() {
                last.to = from;
            }
            states.push(State { from, to: end, text: text.to_owned(), is_low });
        }
        Self { name: name.to_owned(), states }
    }
}

/// The height of a lane, in CSS pixels.
const LANE: u32 = 44;
/// Where the states are drawn, as fractions of the height of a lane; the name is above them.
const STATE: [f64; 2] = [0.07, 0.6];
/// The font size of a state's text, in CSS pixels.
const STATE_FONT: u16 = 11;
/// The pixel columns that separate the states of a lane.
const LANE_COLUMNS: usize = 1600;

/// The column of pixels, or the row, of a value.
#[allow(clippy::cast_possible_truncation)] // saturates outside of the axis
fn pixel(value: f64, ((from, to), count): ((f64, f64), usize)) -> i64 {
    (count as f64 * (value - from) / (to - from)).floor() as i64
}

/// Keeps the first, lowest, highest and last of the points in a column of pixels, which look the same.
fn thinned(points: &[(f64, f64)], columns: ((f64, f64), usize)) -> Vec<(f64, f64)> {
    let mut thinned = vec![];
    for strip in points.chunk_by(|a, b| pixel(a.0, columns) == pixel(b.0, columns)) {
        let finite = || strip.iter().enumerate().filter(|(_, point)| point.1.is_finite());
        let least = finite().min_by(|(_, a), (_, b)| a.1.total_cmp(&b.1));
        let greatest = finite().max_by(|(_, a), (_, b)| a.1.total_cmp(&b.1));
        let extremes = least.into_iter().chain(greatest).map(|(index, _)| index);
        let kept: BTreeSet<_> = [0, strip.len() - 1].into_iter().chain(extremes).collect();
        thinned.extend(kept.into_iter().map(|index| strip[index]));
    }
    thinned
}

/// Keeps one of the points in a pixel.
fn distinct(points: &[(f64, f64)], [columns, rows]: [((f64, f64), usize); 2]) -> Vec<(f64, f64)> {
    let mut seen = HashSet::new();
    let mut is_new = |point: &&(f64, f64)| seen.insert((pixel(point.0, columns), pixel(point.1, rows)));
    points.iter().filter(&mut is_new).copied().collect()
}

/// Magnitudes below this are shown as 0, because such a range has no ticks.
const LEAST: f64 = 1e-300;

/// The smallest and the largest finite value, distinct from each other.
fn extent(lines: &[Line], value: impl Fn(&(f64, f64)) -> f64) -> (f64, f64) {
    let (least, most) = range(lines.iter().flat_map(|line| &line.points).map(value));
    // Values equal to six digits are shown as constant.
    match least.abs().max(most.abs()) {
        _ if least > most => (-1.0, 1.0),
        size if size < LEAST => (least - 1.0, most + 1.0),
        size if most - least > 1e-6 * size => (least, most),
        size => (least - 0.05 * size, most + 0.05 * size),
    }
}

/// The smallest and the largest finite value; infinities in the wrong order if there is none.
pub(crate) fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let finite = values.filter(|value| value.is_finite());
    finite
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| (least.min(value), most.max(value)))
}

/// A label with its unit in brackets, if there is one.
#[must_use]
pub fn labelled(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.to_owned() } else { format!("{name} ({unit})") }
}

/// A text escaped for HTML, in elements and attributes; control characters are made visible.
#[must_use]
pub fn escaped(text: &str) -> String {
    // Control characters are not allowed.
    printable(text).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sine with a spike of one row, upwards and downwards, and a gap.
    fn long(rows: u32) -> Vec<(f64, f64)> {
        let value = |row: u32| match row {
            _ if row == rows / 3 => 7.0,
            _ if row == rows / 2 => -9.0,
            _ if (rows / 4..rows / 4 + rows / 50).contains(&row) => f64::NAN,
            _ => (0.001 * f64::from(row)).sin(),
        };
        (0..rows).map(|row| (0.01 * f64::from(row), value(row))).collect()
    }

    #[test]
    fn thinning_keeps_the_extremes_of_each_column_the_ends_and_the_gaps() {
        let points = long(100_000);
        let columns = ((0.0, 1000.0), 500);
        let few = thinned(&points, columns);
        assert!(few.len() <= 4 * 501, "{}", few.len());
        for column in 0..500 {
            let of = |points: &[(f64, f64)]| {
                let values = points.iter().filter(|point| pixel(point.0, columns) == column);
                let values = values.map(|point| point.1);
                (values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max))
            };
            assert_eq!(of(&few), of(&points), "column {column}");
        }
        assert_eq!((few[0], few[few.len() - 1]), (points[0], points[99_999]));
        assert!(few.iter().any(|point| point.1.is_nan()));
        assert!(few.is_sorted_by(|a, b| a.0 < b.0));
    }

    #[test]
    fn short_lines_are_drawn_whole() {
        let points = [(0.0, 1.0), (0.5, 2.0), (1.0, 1.0)];
        assert_eq!(thinned(&points, ((0.0, 1.0), 100)), points);
    }

    #[test]
    fn dots_in_one_pixel_are_drawn_once() {
        let points = [(0.0, 0.0), (0.001, 0.001), (0.5, 0.5), (0.5, 1.0)];
        assert_eq!(
            distinct(&points, [((0.0, 1.0), 100), ((0.0, 1.0), 100)]),
            [(0.0, 0.0), (0.5, 0.5), (0.5, 1.0)]
        );
    }

    fn figure() -> Figure {
        let x: Vec<_> = (0..200_000).map(|row| 0.01 * f64::from(row)).collect();
        let values = long(200_000).into_iter().map(|point| point.1);
        let panel = Panel::new("time (s)", "pressure (kPa)").title("</script>").band(-1.0, 1.0);
        let steps =
            Line::new(&x[..3], [0.0, 5.0, 2.0]).held().dashed().color(color::INK).label("steps & <more>");
        let panels = [panel.line(Line::new(&x, values).label("long")).line(steps)];
        let dots = Line::new(&[1.0, 2.0], [f64::NAN, 1e-7]).dots();
        Figure::new().title("Title").row(panels).row([Panel::new("time (s)", "").line(dots)]).shared_x()
    }

    /// The data of a panel in HTML.
    #[cfg(feature = "html")]
    fn data(html: &str, panel: usize) -> serde_json::Value {
        let text = html.split("<script type=\"application/json\">").nth(panel + 1).unwrap();
        let plot: serde_json::Value = serde_json::from_str(text.split("</script>").next().unwrap()).unwrap();
        plot["data"].clone()
    }

    #[cfg(feature = "html")]
    #[test]
    fn html_has_the_numbers_of_the_lines_with_their_extremes() {
        let html = figure().html();
        let lines = data(&html, 0);
        let values: Vec<_> =
            lines[0]["y"].as_array().unwrap().iter().map(serde_json::Value::as_f64).collect();
        assert!((800..=3204).contains(&values.len()), "{}", values.len());
        let finite = || values.iter().flatten().copied();
        assert_eq!((finite().fold(0.0, f64::min), finite().fold(0.0, f64::max)), (-9.0, 7.0));
        // The gap.
        assert!(values.contains(&None));
        assert_eq!(lines[1]["y"], serde_json::json!([0.0, 5.0, 2.0]));
        assert_eq!((&lines[1]["line"]["shape"], &lines[1]["line"]["dash"]), (&"hv".into(), &"dash".into()));
        assert_eq!(lines[1]["name"], "steps &amp; &lt;more&gt;");
        assert_eq!(data(&html, 1)[0]["y"], serde_json::json!([null, 1e-7]));
        assert_eq!(data(&html, 1)[0]["mode"], "markers");
        assert_eq!(html.matches("data-axis=\"0\"").count(), 2);
    }

    /// Every colour by its name in the style sheet, since it differs by night.
    #[cfg(feature = "html")]
    #[test]
    fn html_names_colours_that_the_style_sheet_has() {
        let html = figure().html();
        for part in html.split("\"--").skip(1) {
            let name = part.split('"').next().unwrap();
            assert_eq!(STYLE.matches(&format!("--{name}: #")).count(), 2, "{name}");
        }
        assert!(html.contains("\"--ink\"") && !html.contains("\"#"));
    }

    /// Our own script has no addresses; the library has those of services that figures do not use.
    #[cfg(feature = "html")]
    #[test]
    fn the_scripts_are_one_library_and_our_own() {
        let [library, own] = SCRIPTS;
        assert!(library.starts_with("/**\n* plotly.js (basic - minified) v"));
        // What would end or nest the element that holds it.
        assert!(!library.contains("</script") && !library.contains("<!--"));
        assert!(own.starts_with("\"use strict\"") && !own.contains("http"));
    }

    #[test]
    fn svg_has_lines_dashes_bands_and_texts() {
        let svg = figure().svg().unwrap();
        for text in ["Title", "pressure (kPa)", "time (s)", "steps &amp; &lt;more&gt;", "\u{2212}5", "2000"] {
            assert!(svg.contains(text), "{text}");
        }
        // Two parts of the line around its gap at least, and a thin rectangle across the frame.
        assert!(svg.matches("<polyline").count() >= 3, "{svg}");
        let [red, green, blue] = color::SHADE.day();
        assert!(svg.contains(&format!("#{red:02X}{green:02X}{blue:02X}")));
    }

    #[test]
    fn png_has_the_stated_size_and_each_colour() {
        let png = figure().png().unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width, info.height), (1800, 2 * (10 + 24 + 10 + 170 + 24 + 20 + 10 + 170 + 38)));
        for color in [color::INK, color::BLUE, color::SHADE, color::PAPER, color::RULE] {
            assert!(pixels.chunks(3).any(|pixel| pixel == color.day()), "{}", color.name());
        }
        // The tick labels and the vertical label left of the frames show that the font draws.
        let is_dark = |pixel: &[u8]| pixel.iter().all(|&value| value < 128);
        let left = pixels.chunks(3 * 1800).flat_map(|row| row[..3 * 100].chunks(3));
        assert!(left.filter(|pixel| is_dark(pixel)).count() > 500);
    }

    #[test]
    fn figures_without_panels_and_with_endless_names_are_drawn() {
        let line = Line::new(&[], []).label(&"long_name_".repeat(50));
        let figures = [
            Figure::new().title("Empty"),
            Figure::new().row([]),
            Figure::new().row([Panel::new("x", "y").line(line)]),
        ];
        for figure in figures {
            assert!(figure.svg().unwrap().starts_with("<svg"));
            assert!(figure.png().unwrap().len() > 100);
            #[cfg(feature = "html")]
            assert_eq!(figure.html().matches("<div class=\"panel\"").count(), figure.rows.len());
        }
    }

    /// Beyond these, the drawing library never finds the ticks of an axis.
    #[test]
    fn pictures_of_the_greatest_and_least_numbers_are_drawn_or_refused_by_name() {
        let figure = |x: f64, y: f64| {
            let line = Line::new(&[0.0, x], [0.0, y]).label("b");
            Figure::new().row([Panel::new("x", "y").title("p").line(line)])
        };
        for size in [5e-324, 1e-305, 1e-299, 1e299] {
            assert!(figure(size, -size).svg().unwrap().contains("polyline"), "{size}");
        }
        for figure in [figure(1.0, -1e301), figure(f64::MAX, 1.0)] {
            for refusal in [figure.svg().unwrap_err(), figure.png().unwrap_err()] {
                assert!(refusal.to_string().starts_with("p, b: "), "{refusal}");
            }
        }
    }

    #[test]
    fn constant_and_empty_lines_have_an_extent() {
        let extent = |y: &[f64]| extent(&[Line::new(&[0.0, 1.0], y.iter().copied())], |point| point.1);
        assert_eq!(extent(&[12.0, 12.0]), (11.4, 12.6));
        assert_eq!(extent(&[0.0, 0.0]), (-1.0, 1.0));
        assert_eq!(extent(&[0.0, 1e-310]), (-1.0, 1.0));
        assert_eq!(extent(&[f64::NAN, f64::INFINITY]), (-1.0, 1.0));
        assert_eq!(extent(&[-3.0, 5.0]), (-3.0, 5.0));
    }
}
