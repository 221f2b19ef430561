//! Draws records as SVG, in the manner of a journal: panels in rows, one frame each, thin lines, few colours
//! (those of Okabe and Ito, which the colour-blind tell apart), and the units at the axes.
//!
//! A [`Figure`] is rows of [`Panel`]s; a panel holds [`Line`]s over its axes. The text is reproducible.

mod axis;
mod legend;
mod svg;

use self::axis::Scale;
use self::legend::Legend;
pub use self::svg::escaped;
use self::svg::{Anchor, Svg};

pub mod color {
    /// For references and texts.
    pub const BLACK: &str = "#1a1a1a";
    /// For secondary curves.
    pub const GRAY: &str = "#8c8c8c";
    /// For the main curve.
    pub const BLUE: &str = "#0072b2";
    /// For comparison.
    pub const VERMILION: &str = "#d55e00";
    pub const GREEN: &str = "#009e73";
    pub const PURPLE: &str = "#aa4499";
    pub const SKY: &str = "#56b4e9";
    pub const ORANGE: &str = "#e69f00";
    pub const CYCLE: [&str; 7] = [BLUE, VERMILION, GREEN, PURPLE, SKY, ORANGE, BLACK];
}

/// The width of a figure, in CSS pixels.
const WIDTH: f64 = 720.0;
const FONT_SIZE: f64 = 12.0;
/// The mean width of a character, in font sizes: that of digits in Helvetica and its like.
const CHARACTER: f64 = 0.556;
/// Between panels.
const GAP: f64 = 12.0;

/// Panels in rows.
#[derive(Clone, Debug, Default)]
pub struct Figure {
    rows: Vec<Vec<Panel>>,
    shares_x: bool,
}

/// A frame with its axes and what is drawn in it.
#[derive(Clone, Debug)]
pub struct Panel {
    title: Option<String>,
    x: Axis,
    left: Axis,
    right: Option<Axis>,
    lines: Vec<Line>,
    bands: Vec<Band>,
    height: f64,
}

/// The label and range of an axis.
#[derive(Clone, Debug, Default)]
struct Axis {
    label: String,
    range: Option<(f64, f64)>,
}

/// A line through points.
#[derive(Clone, Debug)]
pub struct Line {
    points: Vec<(f64, f64)>,
    label: Option<String>,
    color: &'static str,
    width: f64,
    dashes: Option<&'static str>,
    is_held: bool,
    is_right: bool,
    marks: Marks,
}

/// How a line's points are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Marks {
    Stroke,
    StrokeAndDots,
    Dots,
}

impl Marks {
    fn have_stroke(self) -> bool {
        self != Self::Dots
    }

    fn have_dots(self) -> bool {
        self != Self::Stroke
    }
}

#[derive(Clone, Debug)]
struct Band {
    from: f64,
    to: f64,
    is_of_x: bool,
}

impl Figure {
    pub fn new() -> Self {
        Self::default()
    }

    pub fn row(mut self, panels: impl IntoIterator<Item = Panel>) -> Self {
        self.rows.push(panels.into_iter().collect());
        self
    }

    /// Panels in a column share one horizontal axis, at the lowest.
    pub fn shared_x(mut self) -> Self {
        self.shares_x = true;
        self
    }
}

impl Panel {
    /// A panel with its axes' labels, which include the units.
    pub fn new(x_label: &str, y_label: &str) -> Self {
        Self {
            title: None,
            x: Axis { label: x_label.to_owned(), range: None },
            left: Axis { label: y_label.to_owned(), range: None },
            right: None,
            lines: vec![],
            bands: vec![],
            height: 170.0,
        }
    }

    pub fn title(mut self, title: &str) -> Self {
        self.title = Some(title.to_owned());
        self
    }

    pub fn height(mut self, height: f64) -> Self {
        self.height = height;
        self
    }

    /// The range of the horizontal axis.
    pub fn x_range(mut self, from: f64, to: f64) -> Self {
        self.x.range = Some((from, to));
        self
    }

    /// The range of the left axis.
    pub fn y_range(mut self, from: f64, to: f64) -> Self {
        self.left.range = Some((from, to));
        self
    }

    pub fn right(mut self, label: &str, range: Option<(f64, f64)>) -> Self {
        self.right = Some(Axis { label: label.to_owned(), range });
        self
    }

    pub fn line(mut self, line: Line) -> Self {
        self.lines.push(line);
        self
    }

    /// Shades a range of the left axis.
    pub fn band(mut self, from: f64, to: f64) -> Self {
        self.bands.push(Band { from, to, is_of_x: false });
        self
    }

    /// Shades a range of the horizontal axis.
    pub fn x_band(mut self, from: f64, to: f64) -> Self {
        self.bands.push(Band { from, to, is_of_x: true });
        self
    }
}

impl Line {
    /// A line through points, in blue.
    pub fn new(x: &[f64], y: impl IntoIterator<Item = f64>) -> Self {
        Self {
            points: x.iter().copied().zip(y).collect(),
            label: None,
            color: color::BLUE,
            width: 1.5,
            dashes: None,
            is_held: false,
            is_right: false,
            marks: Marks::Stroke,
        }
    }

    /// Its entry in the legend.
    pub fn label(mut self, label: &str) -> Self {
        self.label = Some(label.to_owned());
        self
    }

    pub fn color(mut self, color: &'static str) -> Self {
        self.color = color;
        self
    }

    pub fn thin(mut self) -> Self {
        self.width = 1.0;
        self
    }

    pub fn dashed(mut self) -> Self {
        self.dashes = Some("6 3");
        self
    }

    /// Each value holds until the next point.
    pub fn held(mut self) -> Self {
        self.is_held = true;
        self
    }

    pub fn right(mut self) -> Self {
        self.is_right = true;
        self
    }

    /// With a marker at each point.
    pub fn markers(mut self) -> Self {
        self.marks = Marks::StrokeAndDots;
        self
    }

    /// Only a marker at each point.
    pub fn dots(mut self) -> Self {
        self.marks = Marks::Dots;
        self
    }
}

/// A panel's frame and scales.
struct Frame {
    left: f64,
    top: f64,
    width: f64,
    height: f64,
    /// The distance from the frame to the left axis' label.
    label_distance: f64,
    x: Scale,
    y: Scale,
    right: Option<Scale>,
}

impl Frame {
    fn point(&self, (x, y): (f64, f64), is_right: bool) -> (f64, f64) {
        let scale = if is_right { self.right.as_ref().unwrap_or(&self.y) } else { &self.y };
        let across = self.left + self.width * self.x.fraction(x);
        (across, self.top + self.height * (1.0 - scale.fraction(y)))
    }
}

/// The margins of a frame.
#[derive(Clone, Copy, Default)]
struct Margins {
    left: f64,
    right: f64,
}

impl Figure {
    pub fn svg(&self) -> String {
        self.svg_named("figure")
    }

    /// The SVG text, with a name that is unique in its page.
    pub fn svg_named(&self, name: &str) -> String {
        let mut svg = Svg::new(name);
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let x_scales: Vec<Vec<Scale>> = self.x_scales();
        // Frames in a column are aligned.
        let mut margins = vec![Margins::default(); columns];
        for row in &self.rows {
            for (margin, panel) in margins.iter_mut().zip(row) {
                let scales = panel.y_scales();
                margin.left = margin.left.max(2.2 * FONT_SIZE + label_width(&scales.0));
                let right = scales.1.as_ref().map_or(10.0, |scale| 2.2 * FONT_SIZE + label_width(scale));
                margin.right = margin.right.max(right);
            }
        }
        let mut top = 2.0;
        for (index, row) in self.rows.iter().enumerate() {
            let is_last = index + 1 == self.rows.len();
            let has_x = is_last || !self.shares_x;
            let width = (WIDTH - GAP * (row.len() as f64 - 1.0)) / row.len() as f64;
            let height = row.iter().map(|panel| panel.height).fold(0.0, f64::max);
            let frame = |(column, panel): (usize, &Panel)| {
                let margin = margins[column];
                let (y, right) = panel.y_scales();
                let left = column as f64 * (width + GAP) + margin.left;
                let width = width - margin.left - margin.right;
                let label_distance = margin.left - 1.1 * FONT_SIZE;
                let x = x_scales[index][column].clone();
                Frame { left, top: 0.0, width, height, label_distance, x, y, right }
            };
            let mut frames: Vec<_> = row.iter().enumerate().map(frame).collect();
            let legends: Vec<_> =
                row.iter().zip(&frames).map(|(panel, frame)| Legend::new(panel, frame)).collect();
            let legend_height = legends.iter().flatten().map(Legend::height_above).fold(0.0, f64::max);
            let has_title = row.iter().any(|panel| panel.title.is_some());
            let title_height = if has_title { 2.0 * FONT_SIZE } else { FONT_SIZE };
            top += title_height + legend_height;
            for ((panel, frame), legend) in row.iter().zip(&mut frames).zip(&legends) {
                frame.top = top;
                panel.draw(&mut svg, frame, has_x);
                if let Some(title) = &panel.title {
                    svg.title(frame.left + frame.width / 2.0, top - legend_height - 0.6 * FONT_SIZE, title);
                }
                if let Some(legend) = legend {
                    legend.draw(&mut svg, frame);
                }
            }
            top += height + if has_x { 3.2 * FONT_SIZE } else { 0.0 };
        }
        svg.finish(WIDTH, top + 4.0)
    }

    fn x_scales(&self) -> Vec<Vec<Scale>> {
        let own: Vec<Vec<_>> =
            self.rows.iter().map(|row| row.iter().map(Panel::x_range_drawn).collect()).collect();
        let shared = |column: usize| {
            let ranges = own.iter().filter_map(|row| row.get(column));
            ranges.copied().reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap_or((0.0, 1.0))
        };
        let scale = |(column, range): (usize, &(f64, f64))| {
            let (from, to) = if self.shares_x { shared(column) } else { *range };
            Scale::exact(from, to, if own.iter().any(|row| row.len() > 1) { 5 } else { 8 })
        };
        own.iter().map(|row| row.iter().enumerate().map(scale).collect()).collect()
    }
}

/// The width that a scale's numbers take.
fn label_width(scale: &Scale) -> f64 {
    let widest = scale.ticks().iter().map(|(_, text)| text.chars().count()).max().unwrap_or(0);
    CHARACTER * FONT_SIZE * widest as f64
}

impl Panel {
    fn x_range_drawn(&self) -> (f64, f64) {
        self.x.range.unwrap_or_else(|| extent(self.lines.iter(), |point| point.0))
    }

    fn y_scales(&self) -> (Scale, Option<Scale>) {
        let ticks = if self.height < 110.0 { 4 } else { 6 };
        let scale = |axis: &Axis, is_right: bool| {
            if let Some((from, to)) = axis.range {
                return Scale::exact(from, to, ticks);
            }
            let lines = self.lines.iter().filter(|line| line.is_right == is_right);
            let (from, to) = extent(lines, |point| point.1);
            Scale::around(from, to, ticks)
        };
        (scale(&self.left, false), self.right.as_ref().map(|axis| scale(axis, true)))
    }

    fn draw(&self, svg: &mut Svg, frame: &Frame, has_x: bool) {
        let Frame { left, top, width, height, .. } = *frame;
        let (bottom, far) = (top + height, left + width);
        let clip = svg.clip(left, top, width, height);
        for band in &self.bands {
            let (x0, y0, x1, y1) = if band.is_of_x {
                let [from, to] = [band.from, band.to].map(|x| frame.point((x, 0.0), false).0);
                (from, top, to, bottom)
            } else {
                let [from, to] = [band.from, band.to].map(|y| frame.point((0.0, y), false).1);
                (left, from.min(to), far, from.max(to))
            };
            svg.shade(x0.max(left), y0.max(top), x1.min(far), y1.min(bottom));
        }
        for (value, _) in frame.y.ticks() {
            let y = frame.point((0.0, *value), false).1;
            svg.grid(left, y, far, y);
        }
        for (value, _) in frame.x.ticks() {
            let x = frame.point((*value, 0.0), false).0;
            svg.grid(x, top, x, bottom);
        }
        for line in &self.lines {
            line.draw(svg, frame, &clip);
        }
        svg.frame(left, top, width, height);
        self.draw_axes(svg, frame, has_x);
    }

    fn draw_axes(&self, svg: &mut Svg, frame: &Frame, has_x: bool) {
        const TICK: f64 = 4.0;
        let Frame { left, top, width, height, .. } = *frame;
        let (bottom, far) = (top + height, left + width);
        let middle = FONT_SIZE * 0.35;
        for (value, text) in frame.y.ticks() {
            let y = frame.point((0.0, *value), false).1;
            svg.tick(left, y, left + TICK, y);
            svg.text(left - 5.0, y + middle, Anchor::End, text);
        }
        if let Some(right) = &frame.right {
            for (value, text) in right.ticks() {
                let y = frame.point((0.0, *value), true).1;
                svg.tick(far, y, far - TICK, y);
                svg.text(far + 5.0, y + middle, Anchor::Start, text);
            }
        }
        for (value, text) in frame.x.ticks() {
            let x = frame.point((*value, 0.0), false).0;
            svg.tick(x, bottom, x, bottom - TICK);
            if has_x {
                svg.text(x, bottom + 1.3 * FONT_SIZE, Anchor::Middle, text);
            }
        }
        if has_x {
            svg.text(left + width / 2.0, bottom + 2.7 * FONT_SIZE, Anchor::Middle, &self.x.label);
        }
        let center = top + height / 2.0;
        svg.upright(left - frame.label_distance, center, &self.left.label);
        if let (Some(axis), Some(scale)) = (&self.right, &frame.right) {
            svg.upright(far + 5.0 + label_width(scale) + 1.3 * FONT_SIZE, center, &axis.label);
        }
    }
}

impl Line {
    /// The points in the drawing, with the corners of held values.
    fn drawn(&self, frame: &Frame) -> Vec<(f64, f64)> {
        let mut drawn: Vec<(f64, f64)> = vec![];
        for &point in &self.points {
            let point = frame.point(point, self.is_right);
            if self.is_held
                && let Some(&(_, before)) = drawn.last()
                && (before - point.1).abs() > 0.0
            {
                drawn.push((point.0, before));
            }
            drawn.push(point);
        }
        drawn
    }

    fn draw(&self, svg: &mut Svg, frame: &Frame, clip: &str) {
        if self.marks.have_stroke() {
            svg.polyline(&thinned(&self.drawn(frame)), self.color, self.width, self.dashes, Some(clip));
        }
        if self.marks.have_dots() {
            for &point in &self.points {
                let (x, y) = frame.point(point, self.is_right);
                svg.marker(x, y, self.color);
            }
        }
    }
}

/// Keeps the first, lowest, highest and last of many points in a strip, which look the same.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    const STRIP: f64 = 0.5;
    let mut thinned: Vec<(f64, f64)> = vec![];
    for strip in points.chunk_by(|a, b| (a.0 / STRIP).floor().total_cmp(&(b.0 / STRIP).floor()).is_eq()) {
        let extreme = |sign: f64| {
            let signed = |&(_, a): &(usize, (f64, f64)), &(_, b): &(usize, (f64, f64))| {
                (sign * a.1).total_cmp(&(sign * b.1))
            };
            strip
                .iter()
                .enumerate()
                .map(|(index, &point)| (index, point))
                .min_by(signed)
                .map(|(index, _)| index)
        };
        let mut kept: Vec<_> = [Some(0), extreme(1.0), extreme(-1.0), strip.len().checked_sub(1)]
            .into_iter()
            .flatten()
            .collect();
        kept.sort_unstable();
        kept.dedup();
        thinned.extend(kept.into_iter().map(|index| strip[index]));
    }
    thinned
}

/// The least and the greatest of the values that are drawn.
fn extent<'a>(lines: impl Iterator<Item = &'a Line>, value: impl Fn(&(f64, f64)) -> f64) -> (f64, f64) {
    let values = lines.flat_map(|line| &line.points).map(value).filter(|value| value.is_finite());
    values
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| (least.min(value), most.max(value)))
}
