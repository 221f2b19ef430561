//! The hand-written part of a model's documentation: a fragment of HTML, written as XML, included in the generated
//! page.
//!
//! `<var>tank.pressure</var>` becomes a link to the variable, `<img src="loop.svg" alt="…"/>` the picture itself. What
//! would break the page is rejected, with file and line: unknown variable names, dead links, missing pictures, and
//! anything loaded from elsewhere.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use fmu_xml::page::breakable;
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion, escape};

use crate::error::{Error, nearest};
use crate::source::Lines;

/// A fragment ready for the page.
#[derive(Default)]
pub(crate) struct Fragment {
    markup: String,
    /// Where the first section begins in the markup: what precedes it opens the page.
    first_section: Option<usize>,
    /// Each heading's id and text, for the page's contents.
    pub(crate) headings: Vec<(String, String)>,
    /// The file and its pictures.
    pub(crate) files: Vec<PathBuf>,
}

impl Fragment {
    /// The opening, up to the element with the first heading, and the sections.
    pub(crate) fn parts(&self) -> (&str, &str) {
        let (opening, sections) = self.markup.split_at(self.first_section.unwrap_or(self.markup.len()));
        (opening.trim(), sections.trim())
    }
}

/// Prefix of the ids of the page's own sections.
pub(crate) const PAGE_ID: &str = "page-";

/// The elements of a language, HTML outside of `<math>` and `<svg>`: none that load or run anything, or belong only to
/// a whole page.
type Language = &'static [&'static str];

#[rustfmt::skip]
const HTML: Language = &[
    "a", "abbr", "b", "blockquote", "br", "caption", "cite", "code", "col", "colgroup", "dd", "details", "dfn", "div",
    "dl", "dt", "em", "figcaption", "figure", "h3", "h4", "h5", "h6", "hr", "i", "img", "kbd", "li", "mark", "math", "ol",
    "p", "pre", "q", "s", "samp", "section", "small", "span", "strong", "sub", "summary", "sup", "svg", "table", "tbody",
    "td", "tfoot", "th", "thead", "tr", "u", "ul", "var", "wbr",
];
#[rustfmt::skip]
const MATHML: Language = &[
    "annotation", "menclose", "merror", "mfrac", "mi", "mmultiscripts", "mn", "mo", "mover", "mpadded", "mphantom",
    "mprescripts", "mroot", "mrow", "ms", "mspace", "msqrt", "mstyle", "msub", "msubsup", "msup", "mtable", "mtd", "mtext",
    "mtr", "munder", "munderover", "none", "semantics",
];
#[rustfmt::skip]
const SVG: Language = &[
    "a", "circle", "clipPath", "defs", "desc", "ellipse", "g", "image", "line", "linearGradient", "marker", "mask", "path",
    "pattern", "polygon", "polyline", "radialGradient", "rect", "stop", "svg", "switch", "symbol", "text", "textPath",
    "title", "tspan", "use",
];

/// The allowed attributes, besides `aria-…` and `data-…`: an element's appearance and name.
#[rustfmt::skip]
const ATTRIBUTES: [&str; 140] = [
    // All languages.
    "class", "dir", "display", "height", "href", "id", "lang", "role", "style", "width", "xlink:href", "xml:lang",
    "xml:space", "xmlns", "xmlns:xlink",
    // HTML
    "colspan", "headers", "open", "reversed", "rowspan", "scope", "span", "src", "start", "tabindex", "type", "value",
    // MathML
    "accent", "accentunder", "align", "close", "columnalign", "columnlines", "columnspacing", "depth", "displaystyle",
    "encoding", "fence", "form", "frame", "largeop", "linethickness", "lspace", "mathbackground", "mathcolor", "mathsize",
    "mathvariant", "maxsize", "minsize", "movablelimits", "notation", "rowalign", "rowlines", "rowspacing", "rspace",
    "scriptlevel", "separator", "separators", "stretchy", "symmetric", "voffset",
    // SVG
    "alignment-baseline", "baseline-shift", "clip-path", "clip-rule", "clipPathUnits", "color", "cx", "cy", "d",
    "dominant-baseline", "dx", "dy", "fill", "fill-opacity", "fill-rule", "font-family", "font-size", "font-style",
    "font-variant", "font-weight", "fx", "fy", "gradientTransform", "gradientUnits", "letter-spacing", "marker-end",
    "marker-mid", "marker-start", "markerHeight", "markerUnits", "markerWidth", "mask", "maskContentUnits", "maskUnits",
    "offset", "opacity", "orient", "overflow", "paint-order", "pathLength", "patternContentUnits", "patternTransform",
    "patternUnits", "points", "preserveAspectRatio", "r", "refX", "refY", "rotate", "rx", "ry", "shape-rendering",
    "spreadMethod", "startOffset", "stop-color", "stop-opacity", "stroke", "stroke-dasharray", "stroke-dashoffset",
    "stroke-linecap", "stroke-linejoin", "stroke-miterlimit", "stroke-opacity", "stroke-width", "text-anchor",
    "text-decoration", "textLength", "transform", "vector-effect", "version", "viewBox", "visibility", "word-spacing", "x",
    "x1", "x2", "y", "y1", "y2",
];

/// The CSS functions allowed in an attribute, besides `url(#…)`.
#[rustfmt::skip]
const FUNCTIONS: [&str; 17] = [
    "calc", "hsl", "hsla", "light-dark", "matrix", "max", "min", "rgb", "rgba", "rotate", "scale", "skewX", "skewY",
    "translate", "translateX", "translateY", "var",
];

/// The allowed HTML elements without an end tag.
const VOID: [&str; 5] = ["br", "col", "hr", "img", "wbr"];

/// Reads a fragment; `anchors` maps each name of a variable to its id on the page.
pub(crate) fn read(file: &Path, anchors: &BTreeMap<String, String>) -> Result<Fragment, Error> {
    let mut reading = Reading {
        anchors,
        taken: anchors.values().map(String::as_str).collect(),
        fragment: Fragment::default(),
        ids: BTreeSet::new(),
        element: 0,
        links: Vec::new(),
    };
    reading.include(file, None)?;
    let known: BTreeSet<&str> = reading.ids.iter().chain(anchors.values()).map(String::as_str).collect();
    match reading.links.iter().find(|(_, target)| !known.contains(target.as_str())) {
        Some((place, target)) => {
            Err(place.refuse(&format!("it links to '#{target}', which is not on the page")))
        }
        None => Ok(reading.fragment),
    }
}

/// A location in a file.
#[derive(Clone)]
struct Place {
    file: PathBuf,
    line: usize,
}

impl Place {
    fn refuse(&self, reason: &str) -> Error {
        Error::of_line(&self.file, self.line, reason)
    }
}

/// An element that has not ended.
struct Open {
    name: String,
    /// The language of its content.
    language: Language,
    in_heading: bool,
}

/// The reading in progress.
struct Reading<'a> {
    anchors: &'a BTreeMap<String, String>,
    /// The ids of the page's own rows.
    taken: BTreeSet<&'a str>,
    fragment: Fragment,
    ids: BTreeSet<String>,
    /// Where the outermost open element begins in the markup.
    element: usize,
    /// The links within the page.
    links: Vec<(Place, String)>,
}

impl Reading<'_> {
    /// Appends a file's content: the fragment itself, or a picture with its alternative text.
    fn include(&mut self, file: &Path, picture: Option<&str>) -> Result<(), Error> {
        let text = fs::read_to_string(file).map_err(|error| Error::of_file(file, error))?;
        self.fragment.files.push(file.to_owned());
        let mut reader = Reader::from_str(&text);
        reader.config_mut().expand_empty_elements = true;
        let mut open: Vec<Open> = Vec::new();
        let lines = Lines::new(&text);
        loop {
            let event = reader.read_event();
            let read = usize::try_from(reader.buffer_position()).unwrap_or(text.len());
            let place = Place { file: file.to_owned(), line: lines.of(read) };
            match event.map_err(|error| place.refuse(&error.to_string()))? {
                Event::Start(element) => {
                    let name = element.name().as_ref().to_owned();
                    if picture.is_none() && open.is_empty() {
                        self.element = self.fragment.markup.len();
                    }
                    let around = open.last();
                    let language = around.map_or(HTML, |open| open.language);
                    let is_picture = picture.is_some() && open.is_empty();
                    if !is_picture && !language.contains(&name.as_str()) {
                        let within = match language {
                            HTML => "a fragment",
                            MATHML => "<math>",
                            _ => "<svg>",
                        };
                        return Err(place.refuse(&format!("<{name}> is not allowed in {within}")));
                    }
                    let in_heading = name == "h3" || around.is_some_and(|open| open.in_heading);
                    let language = match name.as_str() {
                        "math" => MATHML,
                        "svg" => SVG,
                        _ => language,
                    };
                    match picture {
                        Some(called) if is_picture => self.begin_picture(&element, called, &place)?,
                        _ if name == "var" => self.begin_variable(reader.read_event(), in_heading, &place)?,
                        _ => self.begin(&element, &place)?,
                    }
                    open.push(Open { name, language, in_heading });
                }
                Event::End(_) => {
                    let name = open.pop().map(|open| open.name).unwrap_or_default();
                    if name == "var" {
                        self.fragment.markup += "</var></a>";
                    } else if !VOID.contains(&name.as_str()) {
                        self.fragment.markup += &format!("</{name}>");
                    }
                }
                Event::Text(text) => self.text(&text, open.last().is_some_and(|open| open.in_heading)),
                Event::GeneralRef(reference) => {
                    let reference = format!("&{};", &*reference);
                    // XML has five names; it does not know HTML's others.
                    escape::unescape(&reference)
                        .map_err(|_| place.refuse(&format!("write the character itself, not {reference}")))?;
                    self.text(&reference, open.last().is_some_and(|open| open.in_heading));
                }
                Event::CData(_) => return Err(place.refuse("HTML has no CDATA")),
                Event::Empty(_) | Event::Comment(_) | Event::Decl(_) | Event::PI(_) | Event::DocType(_) => {}
                Event::Eof => {
                    return match open.last() {
                        Some(Open { name, .. }) => Err(place.refuse(&format!("it ends within <{name}>"))),
                        None => Ok(()),
                    };
                }
            }
        }
    }

    fn text(&mut self, escaped: &str, in_heading: bool) {
        // Single-letter identifiers are italic, words are not; a style sheet cannot count letters.
        if escaped.chars().count() > 1 && self.fragment.markup.ends_with("<mi>") {
            self.fragment.markup.truncate(self.fragment.markup.len() - ">".len());
            self.fragment.markup += " class=\"word\">";
        }
        self.fragment.markup += escaped;
        if in_heading && let Some((_, heading)) = self.fragment.headings.last_mut() {
            *heading += escaped;
        }
    }

    /// A variable's name, the content of `<var>`.
    fn begin_variable(
        &mut self,
        content: quick_xml::Result<Event<'_>>,
        in_heading: bool,
        place: &Place,
    ) -> Result<(), Error> {
        let Ok(Event::Text(name)) = content else {
            return Err(place.refuse("<var> must contain a variable's name"));
        };
        let anchor = self.anchors.get(&*name).ok_or_else(|| {
            let nearest = nearest(&name, self.anchors.keys());
            place.refuse(&format!("the model has no variable '{}'{nearest}", &*name))
        })?;
        self.fragment.markup += &format!("<a href=\"#{anchor}\"><var>");
        self.text(&breakable(&name), in_heading);
        Ok(())
    }

    fn begin(&mut self, element: &BytesStart<'_>, place: &Place) -> Result<(), Error> {
        let name = element.name();
        let name = name.as_ref();
        let attributes = attributes(element, place)?;
        let value = |key: &str| attributes.iter().find(|(known, _)| known == key).map(|(_, value)| value);
        if name == "img"
            && let Some(picture) = value("src").map(Path::new)
            && picture.extension().is_some_and(|suffix| suffix == "svg")
        {
            let called = value("alt").ok_or_else(|| place.refuse("<img> needs an alt"))?;
            let folder = place.file.parent().unwrap_or(Path::new(""));
            return self.include(&folder.join(picture), Some(called));
        }
        self.check_attributes(name, &attributes, place)?;
        if name == "h3" {
            let id = value("id").ok_or_else(|| place.refuse("<h3> needs an id, for the page's contents"))?;
            self.fragment.headings.push((id.clone(), String::new()));
            self.fragment.first_section.get_or_insert(self.element);
        }
        let end = if VOID.contains(&name) { "/" } else { "" };
        self.fragment.markup += &format!("<{}{end}>", element.trim_end());
        Ok(())
    }

    fn begin_picture(&mut self, element: &BytesStart<'_>, called: &str, place: &Place) -> Result<(), Error> {
        if element.name().as_ref() != "svg" {
            return Err(place.refuse("it is not an SVG"));
        }
        self.check_attributes("svg", &attributes(element, place)?, place)?;
        let called = escape::escape(called);
        self.fragment.markup += &format!("<{} role=\"img\" aria-label=\"{called}\">", element.trim_end());
        Ok(())
    }

    fn check_attributes(
        &mut self,
        element: &str,
        attributes: &[(String, String)],
        place: &Place,
    ) -> Result<(), Error> {
        for (key, value) in attributes {
            let is_text =
                key.starts_with("aria-") || key.starts_with("data-") || key == "alt" || key == "title";
            if !is_text && !ATTRIBUTES.contains(&key.as_str()) {
                return Err(place.refuse(&format!("{key} of <{element}> is not allowed in a fragment")));
            }
            let is_link = matches!(key.as_str(), "href" | "xlink:href");
            let beginnings: &[&str] = match element {
                "a" => &["#", "https:", "http:", "mailto:"],
                "img" | "image" => &["data:image/"],
                _ => &["#"],
            };
            let begins = |beginning: &&str| {
                value.get(..beginning.len()).is_some_and(|own| own.eq_ignore_ascii_case(beginning))
            };
            let is_address = is_link || key == "src";
            if is_address && !beginnings.iter().any(begins) {
                let reason = format!("{key}=\"{value}\" does not begin with {}", beginnings.join(", "));
                return Err(place.refuse(&format!("{reason}, as that of <{element}> must")));
            }
            if !is_address && !is_text && !is_harmless_css(value) {
                return Err(place.refuse(&format!("{key}=\"{value}\" may load from elsewhere")));
            }
            if is_link && let Some(target) = value.strip_prefix('#') {
                self.links.push((place.clone(), target.to_owned()));
            }
            if key == "id" {
                let taken = value.starts_with(PAGE_ID) || self.taken.contains(value.as_str());
                if taken || !self.ids.insert(value.clone()) {
                    return Err(place.refuse(&format!("another element has the id '{value}'")));
                }
            }
        }
        Ok(())
    }
}

/// Whether a value, read as CSS, references nothing outside the page: only known functions, and no escapes, which
/// could disguise others.
fn is_harmless_css(value: &str) -> bool {
    let is_name = |letter: char| letter.is_alphanumeric() || matches!(letter, '-' | '_');
    let parts: Vec<_> = value.split('(').collect();
    let is_harmless = |parts: &[&str]| {
        let function = parts[0].rsplit(|letter| !is_name(letter)).next().unwrap_or_default();
        let is_within = || parts[1].trim_start_matches([' ', '"', '\'']).starts_with('#');
        function.is_empty() || FUNCTIONS.contains(&function) || function == "url" && is_within()
    };
    !value.contains('\\') && parts.windows(2).all(is_harmless)
}

fn attributes(element: &BytesStart<'_>, place: &Place) -> Result<Vec<(String, String)>, Error> {
    let unreadable = |error: quick_xml::Error| place.refuse(&error.to_string());
    let mut attributes = Vec::new();
    for attribute in element.attributes() {
        let attribute = attribute.map_err(|error| unreadable(error.into()))?;
        let value = attribute.normalized_value(XmlVersion::default()).map_err(unreadable)?;
        if attribute.value.contains('<') {
            return Err(place.refuse("write &lt; in an attribute"));
        }
        attributes.push((attribute.key.as_ref().to_owned(), value.into_owned()));
    }
    Ok(attributes)
}
