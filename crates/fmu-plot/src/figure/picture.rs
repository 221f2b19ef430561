//! Figures as SVG and PNG, drawn by `plotters` in the light colour scheme. PNG text uses a font from the crate
//! `epaint_default_fonts`, so that pictures are the same on a machine without fonts.

use anyhow::{Context, Result, anyhow, bail};
use epaint_default_fonts::UBUNTU_LIGHT;
use plotters::coord::Shift;
use plotters::data::float::FloatPrettyPrinter;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontStyle, register_font};

use super::{Figure, Line, Marks, Panel, STATE, STATE_FONT, color};

/// The size of a figure, in CSS pixels.
const WIDTH: u32 = 900;
const FONT: &str = "sans-serif";
const FONT_SIZE: u32 = 13;
/// Tick labels and label of the vertical axis, shared by the frames of a column.
const LEFT: u32 = 64;
/// Half the last tick's label.
const RIGHT: u32 = 22;
const TOP: u32 = 10;
const TITLE: u32 = 24;
/// Tick labels, and the axis' label.
const BOTTOM: [u32; 2] = [20, 38];
/// The length of a line's sample in the legend.
const SAMPLE: u32 = 26;
const DASH: u32 = 6;
const TICK: u32 = 4;
/// The gap between a line's sample and its label, and at the left edge.
const GAP: u32 = 10;
/// PNG pixels per CSS pixel, for dense screens and print.
const DENSITY: u32 = 2;
/// SVG units per CSS pixel: plotters draws in whole units, so that lines would otherwise be stairs.
const FINENESS: u32 = 10;
/// The number of pixel columns to which lines are thinned.
const COLUMNS: usize = (DENSITY * WIDTH) as usize;
/// Beyond this number, an axis's ticks would never be found.
const GREATEST: f64 = 1e300;
/// The height of a line of text.
const LINE: u32 = FONT_SIZE + 6;
/// The letters in a line of the figure's width.
const MOST_LETTERS: usize = 120;
/// The share of a range above and below the curves.
const ROOM: f64 = 0.06;

/// The area in which a backend draws.
type Area<B> = DrawingArea<B, Shift>;
/// The result of drawing.
type Drawn<B> = Result<(), DrawingAreaErrorKind<<B as DrawingBackend>::ErrorType>>;

impl Figure {
    /// The figure as the text of an SVG file, in the colours of light mode.
    ///
    /// # Errors
    /// When a finite value exceeds 1e300 in magnitude; the message names panel and line.
    pub fn svg(&self) -> Result<String> {
        let mut text = String::new();
        let [size, fine] = [1, FINENESS].map(|density| self.size(density));
        self.draw(&SVGBackend::with_string(&mut text, fine).into_drawing_area(), FINENESS)?;
        let of = |(width, height)| format!("<svg width=\"{width}\" height=\"{height}\"");
        Ok(text.replacen(&of(fine), &of(size), 1))
    }

    /// The figure as the bytes of a PNG file, in the colours of light mode, 1800 pixels wide: two for each CSS pixel.
    ///
    /// # Errors
    /// See [`Figure::svg`].
    pub fn png(&self) -> Result<Vec<u8>> {
        let (width, height) = self.size(DENSITY);
        let mut pixels = vec![0; 3 * width as usize * height as usize];
        self.draw(&BitMapBackend::with_buffer(&mut pixels, (width, height)).into_drawing_area(), DENSITY)?;
        let mut file = vec![];
        let mut encoder = png::Encoder::new(&mut file, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.write_header()?.write_image_data(&pixels)?;
        Ok(file)
    }

    /// The size of the picture in pixels.
    fn size(&self, density: u32) -> (u32, u32) {
        let heights = (0..self.rows.len()).map(|row| self.row_height(row));
        let title = if self.title.is_empty() { 0 } else { TITLE };
        let note = LINE * u32::try_from(self.note_lines().len()).unwrap_or(u32::MAX / LINE / DENSITY);
        (density * WIDTH, density * (TOP + title + heights.sum::<u32>() + note))
    }

    /// The note, whose lines break after commas.
    fn note_lines(&self) -> Vec<String> {
        let mut lines: Vec<String> = vec![];
        for part in self.note.split_inclusive(", ") {
            match lines.last_mut() {
                Some(line) if line.len() + part.len() <= MOST_LETTERS => *line += part,
                _ => lines.push(part.to_owned()),
            }
        }
        lines
    }

    fn row_height(&self, row: usize) -> u32 {
        let height = |panel: &Panel| panel.height + if panel.title.is_empty() { 0 } else { TITLE };
        let bottom = BOTTOM[usize::from(self.has_x_label(row))];
        TOP + bottom + self.rows[row].iter().map(height).max().unwrap_or(0)
    }

    fn draw<B: DrawingBackend>(&self, area: &Area<B>, density: u32) -> Result<()>
    where
        B::ErrorType: 'static,
    {
        self.rows.iter().flatten().try_for_each(Panel::refuse_extremes)?;
        register_font(FONT, FontStyle::Normal, UBUNTU_LIGHT).map_err(|_| anyhow!("the font is damaged"))?;
        self.draw_rows(area, density).context("the figure cannot be drawn")
    }

    fn draw_rows<B: DrawingBackend>(&self, area: &Area<B>, density: u32) -> Drawn<B> {
        area.fill(&rgb(color::PAPER))?;
        let mut rest = area.margin(density * TOP, 0, 0, 0);
        if !self.title.is_empty() {
            rest = rest.titled(&self.title, text(FONT_SIZE + 2, density))?;
        }
        let labels = self.rows.iter().flatten().flat_map(|panel| &panel.lines).map(|line| &line.label);
        let mut legend = 0;
        for label in labels.filter(|label| !label.is_empty()) {
            let width = area.estimate_text_size(label, &text(FONT_SIZE, density))?.0;
            legend = legend.max(width + density * (SAMPLE + 2 * GAP));
        }
        for (index, row) in self.rows.iter().enumerate() {
            let (upper, lower) = rest.split_vertically(density * self.row_height(index));
            rest = lower;
            for (panel, area) in row.iter().zip(upper.split_evenly((1, row.len()))) {
                let width = area.dim_in_pixel().0;
                // Long names are cut rather than the frame.
                let (frame, legend) = area.split_horizontally(width - legend.min(width / 2));
                panel.draw(&frame, density, self.has_x_label(index))?;
                panel.draw_legend(&legend, density)?;
            }
        }
        let (note, faint) = (text(FONT_SIZE, density), rgb(color::FAINT));
        for (line, place) in self.note_lines().iter().zip(0_u32..) {
            let place = [GAP, LINE * place].map(|place| (density * place).cast_signed());
            rest.draw_text(line, &note.color(&faint), place.into())?;
        }
        area.present()
    }
}

impl Panel {
    fn refuse_extremes(&self) -> Result<()> {
        for line in &self.lines {
            let mut values = line.points.iter().flat_map(|&(x, y)| [x, y]);
            if let Some(value) = values.find(|value| value.is_finite() && value.abs() > GREATEST) {
                let names = [self.title.as_str(), &line.label].into_iter().filter(|name| !name.is_empty());
                let names = names.collect::<Vec<_>>().join(", ");
                bail!("{names}: {value:e} is beyond {GREATEST:e}, the greatest number in a picture");
            }
        }
        Ok(())
    }

    fn draw<B: DrawingBackend>(&self, area: &Area<B>, density: u32, has_x_label: bool) -> Drawn<B> {
        let ([x, y], (width, _)) = ([self.x_extent(), self.y_drawn()], area.dim_in_pixel());
        let frame = [width.saturating_sub(density * (LEFT + GAP + RIGHT)), density * self.height];
        let [x, y] = if self.has_equal_scales { equalized([x, y], frame) } else { [x, y] };
        let mut chart = ChartBuilder::on(area);
        chart.margin_top(density * TOP).margin_left(density * GAP).margin_right(density * RIGHT);
        chart.y_label_area_size(density * LEFT).x_label_area_size(density * BOTTOM[usize::from(has_x_label)]);
        if !self.title.is_empty() {
            chart.caption(&self.title, text(FONT_SIZE, density));
        }
        let mut chart = chart.build_cartesian_2d(x.0..x.1, y.0..y.1)?;
        for band in &self.bands {
            let (x, y) = if band.is_of_x { ((band.from, band.to), y) } else { (x, (band.from, band.to)) };
            chart.draw_series([Rectangle::new([(x.0, y.0), (x.1, y.1)], rgb(color::SHADE).filled())])?;
        }
        let mut mesh = chart.configure_mesh();
        let thin = |color| rgb(color).stroke_width(density);
        mesh.axis_style(thin(color::FAINT)).bold_line_style(thin(color::RULE)).light_line_style(TRANSPARENT);
        mesh.set_all_tick_mark_size(density * TICK);
        mesh.label_style(text(FONT_SIZE, density)).y_desc(&self.y.label);
        let x_number = |place: &f64| number(self.x.value(*place));
        mesh.x_label_formatter(&x_number).y_label_formatter(&|value| number(*value));
        mesh.y_labels(if self.height < 130 { 4 } else { 6 });
        if !self.lanes.is_empty() {
            mesh.y_labels(0).disable_y_mesh();
        }
        if has_x_label {
            mesh.x_desc(&self.x.label);
        }
        mesh.draw()?;
        for (lane, place) in self.lanes.iter().rev().zip(0_u32..) {
            let [base, top, above] = [STATE[0], STATE[1], 0.95].map(|height| f64::from(place) + height);
            let name = text(FONT_SIZE, density).pos(Pos::new(HPos::Left, VPos::Top));
            chart.draw_series([Text::new(format!(" {}", lane.name), (x.0, above), name)])?;
            for state in &lane.states {
                let top = if state.is_low { base } else { top };
                let corners = [(state.from, base), (state.to, top)];
                let outline = [corners[0], (state.from, top), corners[1], (state.to, base), corners[0]];
                chart.draw_series([Rectangle::new(corners, rgb(color::LOW).filled())])?;
                chart.draw_series([PathElement::new(outline, thin(color::BLUE))])?;
                let font = text(STATE_FONT.into(), density).pos(Pos::new(HPos::Center, VPos::Center));
                let width = area.estimate_text_size(&state.text, &font)?.0 + density * GAP;
                let [from, to] = [state.from, state.to].map(|time| chart.backend_coord(&(time, base)).0);
                if !state.is_low && from.abs_diff(to) > width {
                    let middle = (f64::midpoint(state.from, state.to), f64::midpoint(base, top));
                    chart.draw_series([Text::new(state.text.clone(), middle, font)])?;
                }
            }
        }
        for (line, points) in self.thinned_lines(COLUMNS) {
            let style = line.style(density);
            let is_inside = |point: &(f64, f64)| (x.0..=x.1).contains(&point.0);
            let points: Vec<_> = points.into_iter().filter(is_inside).collect();
            for part in line.parts(&points) {
                if line.marks != Marks::Stroke {
                    let dots = part.iter().map(|&point| Circle::new(point, 2 * density, style.filled()));
                    chart.draw_series(dots)?;
                }
                if line.marks == Marks::Dots {
                    continue;
                }
                if line.is_dashed {
                    let dash = DASH * density;
                    chart.draw_series(DashedLineSeries::new(part, dash, dash / 2, style))?;
                } else if density != DENSITY {
                    chart.draw_series(LineSeries::new(part, style))?;
                } else {
                    // At a spike, a mitred joint of two segments would be longer than the spike.
                    let segments = part.windows(2).map(|pair| PathElement::new(pair.to_vec(), style));
                    chart.draw_series(segments)?;
                }
            }
        }
        Ok(())
    }

    /// Next to the frame, where it hides no line.
    fn draw_legend<B: DrawingBackend>(&self, area: &Area<B>, density: u32) -> Drawn<B> {
        let [sample, gap, row] = [SAMPLE, GAP, LINE].map(|size| (density * size).cast_signed());
        let mut middle = (density * TOP).cast_signed() + row / 2;
        for line in self.lines.iter().filter(|line| !line.label.is_empty()) {
            let style = line.style(density);
            if line.marks == Marks::Dots {
                area.draw(&Circle::new((sample / 2, middle), 2 * density, style.filled()))?;
            } else {
                let (dash, space) = if line.is_dashed { (DASH, DASH / 2) } else { (SAMPLE, 0) };
                let ends = [(0, middle), (sample, middle)];
                area.draw(&DashedPathElement::new(ends, density * dash, density * space, style))?;
            }
            let font = text(FONT_SIZE, density).pos(Pos::new(HPos::Left, VPos::Center));
            area.draw(&Text::new(line.label.as_str(), (sample + gap / 2, middle), font))?;
            middle += row;
        }
        Ok(())
    }

    /// The vertical range, with room around the curves if it is not given.
    fn y_drawn(&self) -> (f64, f64) {
        let (from, to) = self.y_extent();
        let room = if self.y.range.is_some() { 0.0 } else { ROOM * (to - from) };
        (from - room, to + room)
    }
}

impl Line {
    fn style(&self, density: u32) -> ShapeStyle {
        rgb(self.color).stroke_width((density * if self.width < 1.5 { 2 } else { 3 }).div_ceil(2))
    }

    /// The unbroken parts of the line through points, with the corners of held values.
    fn parts(&self, points: &[(f64, f64)]) -> Vec<Vec<(f64, f64)>> {
        let is_finite = |point: &(f64, f64)| point.0.is_finite() && point.1.is_finite();
        let parts = points.split(|point| !is_finite(point)).filter(|part| !part.is_empty());
        let with_corners = |part: &[(f64, f64)]| {
            let first = part.first().copied();
            let rest = part.windows(2).flat_map(|pair| [(pair[1].0, pair[0].1), pair[1]]);
            first.into_iter().chain(rest).collect()
        };
        parts.map(|part| if self.is_held { with_corners(part) } else { part.to_vec() }).collect()
    }
}

/// Two ranges, one of which is widened about its middle, so that a unit has as many pixels on both axes.
fn equalized(ranges: [(f64, f64); 2], pixels: [u32; 2]) -> [(f64, f64); 2] {
    let of_pixel = |index: usize| (ranges[index].1 - ranges[index].0) / f64::from(pixels[index].max(1));
    let most = of_pixel(0).max(of_pixel(1));
    [0, 1].map(|index| {
        let (from, to) = ranges[index];
        let more = (most * f64::from(pixels[index]) - (to - from)) / 2.0;
        (from - more, to + more)
    })
}

/// A tick's number.
fn number(value: f64) -> String {
    let allow_scientific = !(1e-3..1e6).contains(&value.abs());
    let printer = FloatPrettyPrinter { allow_scientific, min_decimal: 0, max_decimal: 6 };
    printer.print(value).replace('-', "\u{2212}")
}

fn text(size: u32, density: u32) -> TextStyle<'static> {
    (FONT, density * size).into_font().color(&rgb(color::INK))
}

fn rgb(color: super::Color) -> RGBColor {
    let [red, green, blue] = color.day();
    RGBColor(red, green, blue)
}
