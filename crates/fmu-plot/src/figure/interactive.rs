//! Figures in HTML: plotly.js is embedded and draws them when the page opens; `interactive.js` applies the page's colours
//! and links the axes.

use fmu_terms::Linear;
use serde_json::{Value, json};

use super::{Axis, Band, Color, Figure, Lane, Line, Marks, Panel, STATE, STATE_FONT, State, color, escaped};

/// The basic bundle of plotly.js, for scatter and bar traces: the npm package `plotly.js-basic-dist-min`.
const LIBRARY: &str = include_str!("../../plotly/plotly-basic.min.js");
/// The colours of the style sheet are read by name, since plotly.js does not know them.
const OWN_SCRIPT: &str = include_str!("interactive.js");
/// The total pixel columns of a row's frames, to which lines are thinned.
const COLUMNS: usize = 800;
/// The maximum total columns of a figure's lines: 60 bytes each, so that a figure takes about as much as the library.
const MOST_COLUMNS: usize = 20_000;
/// A panel has this many significant steps on each axis: ten times its pixels.
const STEPS: f64 = 1e4;
/// The frame's distance to the left edge, equal in all panels to align linked axes.
const LEFT: usize = 64;
/// The frame's distance to the right edge: half the last tick's label.
const RIGHT: usize = 24;
/// The number of decades for whose labels a telephone has room.
const MOST_DECADES: f64 = 5.0;
/// The modebar's height.
const TOP: usize = 28;
/// Tick labels, and the axis' label.
const BOTTOM: [usize; 2] = [24, 44];

/// The scripts that draw the figures of a page: plotly.js, and our own.
pub const SCRIPTS: [&str; 2] = [LIBRARY, OWN_SCRIPT];

impl Figure {
    /// The figure in HTML, for a `<figure>` in the body of a [report](crate::Report), which draws it. Lines are thinned
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
        html + &paragraph("caption", &self.note)
    }
}

/// A text, if there is one.
fn paragraph(class: &str, text: &str) -> String {
    if text.is_empty() { String::new() } else { format!("<p class=\"{class}\">{}</p>\n", escaped(text)) }
}

impl Panel {
    fn html(&self, axis: &str, has_x_label: bool, columns: usize) -> String {
        let bottom = BOTTOM[usize::from(has_x_label)];
        let title = paragraph("title", &self.title);
        let entries = self.lines.iter().enumerate().filter_map(|(index, line)| line.entry(index));
        let round = [self.x_extent(), self.y_extent()].map(|(from, to)| rounding(to - from));
        let lines = self.thinned_lines(columns).map(|(line, points)| line.trace(&points, &self.x, round));
        let lanes = self.lanes.iter().rev().enumerate().map(|(place, lane)| lane.trace(place as f64));
        let traces: Vec<_> = lines.chain(lanes).collect();
        let plot = json!({ "data": traces, "layout": self.layout(bottom, has_x_label) }).to_string();
        format!(
            "<div class=\"panel\"{axis}>\n{title}<p class=\"legend\">{}</p>\n<div class=\"plot\" style=\"height:{}px\">\
             </div>\n<script type=\"application/json\">{}</script>\n</div>\n",
            entries.collect::<String>(),
            self.height as usize + TOP + bottom,
            // So that no `<` ends the script.
            plot.replace('<', "\\u003c"),
        )
    }

    fn layout(&self, bottom: usize, has_x_label: bool) -> Value {
        // A curve that turns back has several values at one place.
        let ascends = |line: &Line| line.marks != Marks::Dots && line.points.is_sorted_by(|a, b| a.0 <= b.0);
        let names = self.lanes.iter().rev().enumerate().map(|(place, lane)| {
            json!({
                "text": escaped(&lane.name), "showarrow": false, "xref": "paper", "x": 0, "xanchor": "left",
                "yref": "y", "y": place as f64 + 0.95, "yanchor": "top",
            })
        });
        let (mut x, (from, to)) = (self.x.scale(has_x_label), self.x_extent());
        if self.x.is_logarithmic && to - from > 1.0 {
            // Between decades plotly.js would print small digits.
            let decades = ((to - from) / MOST_DECADES).ceil();
            let minor = if decades > 1.0 { json!(1) } else { json!("D1") };
            x["dtick"] = decades.into();
            x["minor"] = json!({ "dtick": minor, "showgrid": true, "gridcolor": color::RULE.name() });
        }
        let mut y = self.y.scale(true);
        if !self.lanes.is_empty() {
            y["showticklabels"] = false.into();
            y["showgrid"] = false.into();
            y["fixedrange"] = true.into();
        }
        if self.has_equal_scales {
            y["scaleanchor"] = "x".into();
        }
        json!({
            "annotations": names.collect::<Vec<_>>(),
            "barmode": "overlay",
            "uniformtext": { "mode": "hide", "minsize": STATE_FONT },
            "margin": { "l": LEFT, "r": RIGHT, "t": TOP, "b": bottom },
            "showlegend": false,
            "hovermode": if self.lines.iter().all(ascends) { "x unified" } else { "closest" },
            "xaxis": x,
            "yaxis": y,
            "shapes": self.bands.iter().map(Band::shape).collect::<Vec<_>>(),
        })
    }
}

impl Axis {
    fn scale(&self, has_label: bool) -> Value {
        let [faint, rule] = [color::FAINT, color::RULE].map(Color::name);
        let mut scale = json!({
            "showline": true, "mirror": true, "ticks": "inside", "zeroline": false, "spikethickness": 1,
            "spikecolor": faint, "linecolor": faint, "tickcolor": faint, "gridcolor": rule,
        });
        if has_label {
            scale["title"] = json!({ "text": escaped(&self.label) });
        }
        if self.is_logarithmic {
            scale["type"] = "log".into();
            // plotly.js writes the digits between powers of ten by three quarters of this (px).
            scale["tickfont"] = json!({ "size": 14 });
        } else {
            // By default plotly.js writes prefixes apart from the unit, as in −20µ beside %.
            scale["exponentformat"] = "e".into();
        }
        if let Some((from, to)) = self.range {
            scale["range"] = json!([self.place(from), self.place(to)]);
        }
        scale
    }
}

impl Line {
    fn trace(&self, points: &[(f64, f64)], axis: &Axis, [x, y]: [f64; 2]) -> Value {
        let rounded = |value: f64, factor: f64| (value * factor).round() / factor;
        let places = points.iter().map(|point| axis.value(rounded(point.0, x)));
        let values = points.iter().map(|point| rounded(point.1, y));
        let color = self.color.name();
        let mut trace = json!({
            "type": "scatter",
            "x": places.collect::<Vec<_>>(),
            "y": values.collect::<Vec<_>>(),
            "mode": match self.marks {
                Marks::Stroke => "lines",
                Marks::StrokeAndDots => "lines+markers",
                Marks::Dots => "markers",
            },
            "name": escaped(&self.label),
            "line": { "color": color, "width": self.width },
            "marker": { "size": 5, "color": color },
        });
        if self.is_dashed {
            trace["line"]["dash"] = "dash".into();
        }
        if self.is_held {
            trace["line"]["shape"] = "hv".into();
        }
        if let Some((name, Linear { factor, offset })) = &self.source {
            let offset = if *offset == 0.0 { String::new() } else { format!("{offset:+?}") };
            trace["meta"] = format!("{factor:?}{offset} {name}").into();
        }
        trace
    }

    /// The legend entry, which toggles the line.
    fn entry(&self, index: usize) -> Option<String> {
        let label = Some(escaped(&self.label)).filter(|label| !label.is_empty())?;
        let color = self.color.name();
        let sample = match self.marks {
            Marks::Dots => format!("class=\"dot\" style=\"background:var({color})\""),
            _ if self.is_dashed => format!("style=\"border-top:3px dashed var({color})\""),
            _ => format!("style=\"border-top:3px solid var({color})\""),
        };
        Some(format!(
            "<label><input type=\"checkbox\" checked value=\"{index}\"><span {sample}></span>{label}</label>\n"
        ))
    }
}

impl Lane {
    /// The states as bars at a place on the vertical axis, which hide texts that do not fit.
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
    fn shape(&self) -> Value {
        let [across, along] = if self.is_of_x { ["y", "x"] } else { ["x", "y"] };
        json!({
            "type": "rect", "layer": "below", "fillcolor": color::SHADE.name(), "line": { "width": 0 },
            format!("{across}ref"): "paper", format!("{across}0"): 0, format!("{across}1"): 1,
            format!("{along}0"): self.from, format!("{along}1"): self.to,
        })
    }
}

/// The power of ten that makes a range at least this many integers long.
fn rounding(range: f64) -> f64 {
    10_f64.powf((STEPS / range).log10().ceil())
}
