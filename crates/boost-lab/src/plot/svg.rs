//! The SVG text: shapes and texts as elements.

use super::FONT_SIZE;
use super::color::BLACK;
use fmu_package::terminal::printable;

/// The alignment of a text.
#[derive(Clone, Copy)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

impl Anchor {
    fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Middle => "middle",
            Self::End => "end",
        }
    }
}

/// Builds an SVG text.
pub struct Svg {
    name: String,
    body: String,
    clips: usize,
}

impl Svg {
    /// `name` makes identifiers unique in a page.
    pub fn new(name: &str) -> Self {
        Self { name: name.to_owned(), body: String::new(), clips: 0 }
    }

    /// Defines a rectangle for clipping, and returns its name.
    pub fn clip(&mut self, x: f64, y: f64, width: f64, height: f64) -> String {
        self.clips += 1;
        let name = format!("{}-frame-{}", self.name, self.clips);
        self.body += &format!(
            "<clipPath id=\"{name}\"><rect x=\"{x:.2}\" y=\"{y:.2}\" width=\"{width:.2}\" height=\"{height:.2}\"/>\
             </clipPath>\n"
        );
        name
    }

    pub fn polyline(
        &mut self,
        points: &[(f64, f64)],
        color: &str,
        width: f64,
        dashes: Option<&str>,
        clip: Option<&str>,
    ) {
        let mut text = String::new();
        for (x, y) in points.iter().filter(|(x, y)| x.is_finite() && y.is_finite()) {
            text += &format!("{x:.2},{y:.2} ");
        }
        let dashes = dashes.map_or_else(String::new, |dashes| format!(" stroke-dasharray=\"{dashes}\""));
        let clip = clip.map_or_else(String::new, |clip| format!(" clip-path=\"url(#{clip})\""));
        self.body += &format!(
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"{width}\" \
             stroke-linejoin=\"round\"{dashes}{clip}/>\n",
            text.trim_end()
        );
    }

    pub fn marker(&mut self, x: f64, y: f64, color: &str) {
        self.body += &format!("<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"2.4\" fill=\"{color}\"/>\n");
    }

    pub fn shade(&mut self, x0: f64, y0: f64, x1: f64, y1: f64) {
        let (width, height) = ((x1 - x0).max(0.0), (y1 - y0).max(0.0));
        self.body += &format!(
            "<rect x=\"{x0:.2}\" y=\"{y0:.2}\" width=\"{width:.2}\" height=\"{height:.2}\" fill=\"#e8eef3\"/>\n"
        );
    }

    pub fn grid(&mut self, x0: f64, y0: f64, x1: f64, y1: f64) {
        self.stroke(x0, y0, x1, y1, "#e3e3e3", 0.7);
    }

    pub fn tick(&mut self, x0: f64, y0: f64, x1: f64, y1: f64) {
        self.stroke(x0, y0, x1, y1, BLACK, 0.8);
    }

    fn stroke(&mut self, x0: f64, y0: f64, x1: f64, y1: f64, color: &str, width: f64) {
        self.body += &format!(
            "<line x1=\"{x0:.2}\" y1=\"{y0:.2}\" x2=\"{x1:.2}\" y2=\"{y1:.2}\" stroke=\"{color}\" \
             stroke-width=\"{width}\"/>\n"
        );
    }

    pub fn frame(&mut self, x: f64, y: f64, width: f64, height: f64) {
        self.body += &format!(
            "<rect x=\"{x:.2}\" y=\"{y:.2}\" width=\"{width:.2}\" height=\"{height:.2}\" fill=\"none\" \
             stroke=\"{BLACK}\" stroke-width=\"0.8\"/>\n"
        );
    }

    pub fn text(&mut self, x: f64, y: f64, anchor: Anchor, text: &str) {
        let (anchor, text) = (anchor.name(), escaped(text));
        self.body += &format!("<text x=\"{x:.2}\" y=\"{y:.2}\" text-anchor=\"{anchor}\">{text}</text>\n");
    }

    pub fn title(&mut self, x: f64, y: f64, text: &str) {
        let text = escaped(text);
        self.body += &format!(
            "<text x=\"{x:.2}\" y=\"{y:.2}\" text-anchor=\"middle\" font-weight=\"bold\">{text}</text>\n"
        );
    }

    /// A text that reads upwards.
    pub fn upright(&mut self, x: f64, y: f64, text: &str) {
        let text = escaped(text);
        self.body += &format!(
            "<text transform=\"translate({x:.2} {y:.2}) rotate(-90)\" text-anchor=\"middle\">{text}</text>\n"
        );
    }

    /// The complete text of a picture of this size.
    pub fn finish(self, width: f64, height: f64) -> String {
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" \
             height=\"{height:.0}\" font-family=\"Helvetica, Arial, 'Liberation Sans', sans-serif\" \
             font-size=\"{FONT_SIZE}\" fill=\"{BLACK}\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n{}</svg>\n",
            self.body
        )
    }
}

/// A text escaped for XML.
pub fn escaped(text: &str) -> String {
    // Control characters are not allowed in XML.
    printable(text).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
