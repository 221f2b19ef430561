//! Figures in HTML: the crate `plotly` describes them and ships plotly.js, which is embedded and draws them when the
//! page opens; `interactive.js` applies the page's colours and links the axes.

use fmu_terms::Linear;
use plotly::common::{Anchor, DashType, Line as Stroke, LineShape, Marker, Mode, Title};
use plotly::layout::{
    Annotation, Axis as Scale, AxisType, BarMode, HoverMode, Layout, Margin, Shape, ShapeLayer, ShapeLine,
    ShapeType, TicksDirection, UniformText, UniformTextMode,
};
use plotly::{Plot, Scatter, Trace};
use serde_json::{Value, json};

use super::{Axis, Band, Figure, Lane, Line, Marks, Panel, STATE, STATE_FONT, State, color, escaped};

/// The colours of the style sheet are read by name, since plotly.js does not know them.
const OWN_SCRIPT: &str = include_str!("interactive.js");
/// The total pixel columns of a row's frames, to which lines are thinned.
const COLUMNS: usize = 800;
/// The maximum total columns of a figure's lines: 60 bytes each, to keep the page below 6 MB.
const MOST_COLUMNS: usize = 20_000;
/// A panel has this many significant steps on each axis: ten times its pixels.
const STEPS: f64 = 1e4;
/// The frame's distance to the left edge, equal in all panels to align linked axes.
const LEFT: usize = 64;
/// Half the last tick's label.
const RIGHT: usize = 24;
/// The modebar's height.
const TOP: usize = 28;
/// Tick labels, and the axis' label.
const BOTTOM: [usize; 2] = [24, 44];

/// The scripts that draw the figures of a page.
pub fn script() -> String {
    // The second script is MathJax, which no figure needs.
    let sources = Plot::offline_js_sources();
    let library = sources.split_inclusive("</script>").next().unwrap_or_default();
    format!("{library}\n<script>{OWN_SCRIPT}</script>\n")
}

impl Figure {
    /// The figure in HTML, for a `<figure>` in the body of a [`page`](crate::page), which draws it. Lines are thinned
    /// to what the screen shows.
    #[must_use]
    pub fn html(&self) -> String {
        let mut html = String::new();
        let lines: usize = self.rows.iter().flatten().map(|panel| panel.lines.len()).sum();
        for (index, row) in self.rows.iter().enumerate() {
            html += "<div class=\"row\">\n";
            let columns = (COLUMNS / row.len()).min(MOST_COLUMNS / lines.max(1)).max(1);
            for (column, panel) in row.iter().enumerate() {
                let axis = if self.shares_x { format!(" data-axis=\"{column}\"") } else { String::new() };
                html += &panel.html(&axis, self.has_x_label(index), columns);
            }
            html += "</div>\n";
        }
        if !self.note.is_empty() {
            html += &format!("<p class=\"caption\">{}</p>\n", escaped(&self.note));
        }
        html
    }
}

impl Panel {
    fn html(&self, axis: &str, has_x_label: bool, columns: usize) -> String {
        let bottom = BOTTOM[usize::from(has_x_label)];
        let title = self
            .title
            .as_deref()
            .map_or_else(String::new, |title| format!("<p class=\"title\">{}</p>\n", escaped(title)));
        let entries = self.lines.iter().enumerate().filter_map(|(index, line)| line.entry(index));
        let round = [self.x_extent(), self.y_extent()].map(|(from, to)| rounding(to - from));
        let lines =
            self.thinned_lines(columns).map(|(line, points)| line.trace(&points, &self.x, round).to_json());
        let lanes =
            self.lanes.iter().rev().enumerate().map(|(place, lane)| lane.trace(place as f64).to_string());
        let traces: Vec<_> = lines.chain(lanes).collect();
        // Escaped so that no `<` ends the script.
        let plot =
            format!("{{\"data\":[{}],\"layout\":{}}}", traces.join(","), self.layout(bottom, has_x_label));
        format!(
            "<div class=\"panel\"{axis}>\n{title}<p class=\"legend\">{}</p>\n<div class=\"plot\" style=\"height:{}px\">\
             </div>\n<script type=\"application/json\">{}</script>\n</div>\n",
            entries.collect::<String>(),
            self.height as usize + TOP + bottom,
            plot.replace('<', "\\u003c"),
        )
    }

    fn layout(&self, bottom: usize, has_x_label: bool) -> String {
        // Along a curve that turns back, one place has several values.
        let ascends = |line: &Line| line.marks != Marks::Dots && line.points.is_sorted_by(|a, b| a.0 <= b.0);
        let hover = if self.lines.iter().all(ascends) { HoverMode::XUnified } else { HoverMode::Closest };
        let names = self.lanes.iter().rev().enumerate().map(|(place, lane)| {
            let top = place as f64 + 0.95;
            let text = Annotation::new().text(escaped(&lane.name)).show_arrow(false);
            text.x_ref("paper").x(0.0).x_anchor(Anchor::Left).y_ref("y").y(top).y_anchor(Anchor::Top)
        });
        let y = self.y.scale(true);
        let y = if self.lanes.is_empty() {
            y
        } else {
            y.show_tick_labels(false).show_grid(false).fixed_range(true)
        };
        Layout::new()
            .annotations(names.collect())
            .bar_mode(BarMode::Overlay)
            .uniform_text(UniformText::new().mode(UniformTextMode::Hide).min_size(STATE_FONT.into()))
            .margin(Margin::new().left(LEFT).right(RIGHT).top(TOP).bottom(bottom))
            .show_legend(false)
            .hover_mode(hover)
            .x_axis(self.x.scale(has_x_label))
            .y_axis(if self.has_equal_scales { y.scale_anchor("x") } else { y })
            .shapes(self.bands.iter().map(Band::shape).collect())
            .to_json()
    }
}

impl Axis {
    fn scale(&self, has_label: bool) -> Scale {
        let scale = Scale::new()
            .show_line(true)
            .mirror(true)
            .ticks(TicksDirection::Inside)
            .zero_line(false)
            .spike_thickness(1)
            .spike_color(color::FAINT.name())
            .line_color(color::FAINT.name())
            .tick_color(color::FAINT.name())
            .grid_color(color::RULE.name());
        let scale = if has_label { scale.title(Title::with_text(escaped(&self.label))) } else { scale };
        let scale = if self.is_logarithmic { scale.type_(AxisType::Log) } else { scale };
        match self.range {
            Some((from, to)) => scale.range(vec![self.place(from), self.place(to)]),
            None => scale,
        }
    }
}

impl Line {
    fn trace(&self, points: &[(f64, f64)], axis: &Axis, [x, y]: [f64; 2]) -> Box<Scatter<f64, f64>> {
        let rounded = |value: f64, factor: f64| (value * factor).round() / factor;
        let (x, y) =
            points.iter().map(|point| (axis.value(rounded(point.0, x)), rounded(point.1, y))).unzip();
        let mut stroke = Stroke::new().color(self.color.name()).width(self.width);
        if self.is_dashed {
            stroke = stroke.dash(DashType::Dash);
        }
        if self.is_held {
            stroke = stroke.shape(LineShape::Hv);
        }
        let mode = match self.marks {
            Marks::Stroke => Mode::Lines,
            Marks::StrokeAndDots => Mode::LinesMarkers,
            Marks::Dots => Mode::Markers,
        };
        let trace = Scatter::new(x, y).mode(mode).line(stroke);
        let trace = trace.marker(Marker::new().size(5).color(self.color.name()));
        let trace = match &self.source {
            // One text, as the crate has it.
            Some((name, Linear { factor, offset: 0.0 })) => trace.meta(format!("{factor:?} {name}")),
            Some((name, Linear { factor, offset })) => trace.meta(format!("{factor:?}{offset:+?} {name}")),
            None => trace,
        };
        match &self.label {
            Some(label) => trace.name(escaped(label)),
            None => trace.name(""),
        }
    }

    /// The legend entry, which toggles the line.
    fn entry(&self, index: usize) -> Option<String> {
        let label = escaped(self.label.as_deref()?);
        let look = match self.marks {
            Marks::Dots => "dotted",
            _ if self.is_dashed => "dashed",
            _ => "solid",
        };
        Some(format!(
            "<label><input type=\"checkbox\" checked value=\"{index}\"><span style=\"border-top:3px {look} \
             var({})\"></span>{label}</label>\n",
            self.color.name()
        ))
    }
}

impl Lane {
    /// The states as bars at a place on the vertical axis, which hide texts that do not fit. The crate's bars have no
    /// base.
    fn trace(&self, place: f64) -> Value {
        let each = |value: fn(&State) -> Value| self.states.iter().map(value).collect::<Vec<_>>();
        let [base, top] = STATE.map(|height| place + height);
        json!({
            "type": "bar", "orientation": "h", "name": escaped(&self.name),
            "base": each(|state| json!(state.from)), "x": each(|state| json!(state.to - state.from)),
            "y": self.states.iter().map(|state| if state.is_low { base } else { f64::midpoint(base, top) }).collect::<Vec<_>>(),
            "width": each(|state| json!(if state.is_low { 0.0 } else { STATE[1] - STATE[0] })),
            "text": each(|state| json!(escaped(&state.text))), "textposition": "inside", "textangle": 0,
            "insidetextanchor": "middle", "insidetextfont": { "size": STATE_FONT, "color": color::INK.name() },
            "marker": { "color": color::LOW.name(), "line": { "color": color::BLUE.name(), "width": 1 } },
            "hovertemplate": "%{fullData.name} %{text}<br>from %{base} s<extra></extra>",
        })
    }
}

impl Band {
    fn shape(&self) -> Shape {
        let shape = Shape::new()
            .shape_type(ShapeType::Rect)
            .layer(ShapeLayer::Below)
            .fill_color(color::SHADE.name())
            .line(ShapeLine::new().width(0.0));
        if self.is_of_x {
            shape.y_ref("paper").x0(self.from).x1(self.to).y0(0).y1(1)
        } else {
            shape.x_ref("paper").x0(0).x1(1).y0(self.from).y1(self.to)
        }
    }
}

/// The power of ten that makes a range at least this many integers long.
fn rounding(range: f64) -> f64 {
    10_f64.powf((STEPS / range).log10().ceil())
}
