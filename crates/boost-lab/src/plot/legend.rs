//! The position of a panel's legend: in a corner of the frame without lines, or else above the frame.

use super::svg::{Anchor, Svg};
use super::{FONT_SIZE, Frame, Line, Panel};

/// The length of a line's sample.
const SAMPLE: f64 = 26.0;
/// Around samples and texts.
const PADDING: f64 = 6.0;
/// From entry to entry.
const ROW: f64 = 1.35 * FONT_SIZE;
/// The mean width of a letter, in font sizes: generous, since fonts differ.
const LETTER: f64 = 0.56;
/// The least distance of a line from the box.
const CLEARANCE: f64 = 4.0;

pub struct Legend<'a> {
    entries: Vec<(&'a Line, &'a str)>,
    place: LegendPosition,
}

/// Relative to the frame's upper left corner.
enum LegendPosition {
    Inside(f64, f64),
    /// The number of entries in each row.
    Above(Vec<usize>),
}

fn entry_width(label: &str) -> f64 {
    SAMPLE + 3.0 * PADDING + LETTER * FONT_SIZE * label.chars().count() as f64
}

impl<'a> Legend<'a> {
    /// Finds the position; none without labels.
    pub fn new(panel: &'a Panel, frame: &Frame) -> Option<Self> {
        let entries: Vec<_> =
            panel.lines.iter().filter_map(|line| Some((line, line.label.as_deref()?))).collect();
        let width = entries.iter().map(|(_, label)| entry_width(label)).reduce(f64::max)?;
        let height = ROW * entries.len() as f64 + PADDING;
        let points: Vec<_> = panel.lines.iter().flat_map(|line| dense(&line.drawn(frame))).collect();
        let [near, far] = [PADDING, frame.width - width - PADDING];
        let [high, low] = [PADDING, frame.height - height - PADDING];
        let is_free = |&(x, y): &(f64, f64)| {
            let [left, top] = [frame.left + x - CLEARANCE, frame.top + y - CLEARANCE];
            let across = left..left + width + 2.0 * CLEARANCE;
            let down = top..top + height + 2.0 * CLEARANCE;
            x >= PADDING
                && y >= PADDING
                && !points.iter().any(|(x, y)| across.contains(x) && down.contains(y))
        };
        let middle = f64::midpoint(near, far);
        let corners = [(far, high), (near, high), (far, low), (near, low), (middle, high), (middle, low)];
        let place = match corners.into_iter().find(is_free) {
            Some((x, y)) => LegendPosition::Inside(x, y),
            None => LegendPosition::Above(rows(&entries, frame.width)),
        };
        Some(Self { entries, place })
    }

    /// The height that it needs above the frame.
    pub fn height_above(&self) -> f64 {
        match &self.place {
            LegendPosition::Inside(..) => 0.0,
            LegendPosition::Above(rows) => ROW * rows.len() as f64,
        }
    }

    pub fn draw(&self, svg: &mut Svg, frame: &Frame) {
        match &self.place {
            LegendPosition::Inside(x, y) => {
                for (index, entry) in self.entries.iter().enumerate() {
                    let middle = frame.top + y + PADDING / 2.0 + ROW * (index as f64 + 0.5);
                    draw_entry(svg, entry, frame.left + x + PADDING, middle);
                }
            }
            LegendPosition::Above(rows) => {
                let mut entries = self.entries.iter();
                for (index, &count) in rows.iter().enumerate() {
                    let middle = frame.top - ROW * ((rows.len() - index) as f64 - 0.5) - 2.0;
                    let mut left = frame.left;
                    for entry in entries.by_ref().take(count) {
                        draw_entry(svg, entry, left, middle);
                        left += entry_width(entry.1);
                    }
                }
            }
        }
    }
}

/// The number of entries in each row of a width.
fn rows(entries: &[(&Line, &str)], width: f64) -> Vec<usize> {
    let mut rows = vec![];
    let mut used = f64::INFINITY;
    for (_, label) in entries {
        let own = entry_width(label);
        match rows.last_mut() {
            Some(count) if used + own <= width => {
                *count += 1;
                used += own;
            }
            _ => {
                rows.push(1);
                used = own;
            }
        }
    }
    rows
}

fn draw_entry(svg: &mut Svg, (line, label): &(&Line, &str), left: f64, middle: f64) {
    if line.marks.have_stroke() {
        svg.polyline(&[(left, middle), (left + SAMPLE, middle)], line.color, line.width, line.dashes, None);
    }
    if line.marks.have_dots() {
        svg.marker(left + SAMPLE / 2.0, middle, line.color);
    }
    svg.text(left + SAMPLE + PADDING, middle + 0.35 * FONT_SIZE, Anchor::Start, label);
}

/// The points of a line, and some more between distant ones.
fn dense(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    const DISTANCE: f64 = 4.0;
    let mut dense = points.first().copied().into_iter().collect::<Vec<_>>();
    for pair in points.windows(2) {
        let [(x0, y0), (x1, y1)] = [pair[0], pair[1]];
        let parts = ((x1 - x0).hypot(y1 - y0) / DISTANCE).ceil().clamp(1.0, 1e4);
        let mut part = 1.0;
        while part <= parts {
            dense.push((x0 + (x1 - x0) * part / parts, y0 + (y1 - y0) * part / parts));
            part += 1.0;
        }
    }
    dense
}
