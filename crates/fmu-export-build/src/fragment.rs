//! The author's part of a model's documentation: a fragment of HTML, written as XML, included in the generated page.
//!
//! `<var>tank.pressure</var>` becomes a link to the variable, `<img src="loop.svg" alt="…"/>` the picture itself. What
//! the page would lack is rejected, with file and line: variables, link targets, pictures. Scripts and external content
//! are left to the page's content security policy, under which browsers ignore them
//! ([`Document`](fmu_xml::page::Document)).

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::{fmt, fs};

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

/// The element of a heading that the page's contents list.
const HEADING: &str = "h3";

/// HTML's elements without an end tag.
const VOID: [&str; 12] =
    ["area", "base", "br", "col", "embed", "hr", "img", "input", "link", "source", "track", "wbr"];

/// Reads a fragment; `anchors` maps each name of a variable to its id on the page.
pub(crate) fn read(file: &Path, anchors: &BTreeMap<String, String>) -> Result<Fragment, Error> {
    let mut reading = Reading {
        anchors,
        fragment: Fragment::default(),
        outermost: 0,
        ids: anchors.values().cloned().collect(),
        links: Vec::new(),
    };
    reading.include(file, None)?;
    let Reading { fragment, ids, links, .. } = reading;
    match links.into_iter().find(|(target, _)| !ids.contains(target)) {
        Some((_, refusal)) => Err(refusal),
        None => Ok(fragment),
    }
}

/// A location in a file.
#[derive(Clone, Copy)]
struct Place<'f> {
    file: &'f Path,
    line: usize,
}

impl Place<'_> {
    fn refuse(self, reason: impl fmt::Display) -> Error {
        Error::of_line(self.file, self.line, reason)
    }
}

/// The reading in progress.
struct Reading<'a> {
    anchors: &'a BTreeMap<String, String>,
    fragment: Fragment,
    /// Where the outermost open element begins in the markup.
    outermost: usize,
    /// The ids on the page.
    ids: BTreeSet<String>,
    /// The links within the page: each target, and the error if the page lacks it.
    links: Vec<(String, Error)>,
}

impl Reading<'_> {
    /// Appends a file's content: the fragment itself, or a picture with its alternative text.
    fn include(&mut self, file: &Path, alternative: Option<&str>) -> Result<(), Error> {
        let text = fs::read_to_string(file).map_err(|error| Error::of_file(file, error))?;
        self.fragment.files.push(file.to_owned());
        let lines = Lines::new(&text);
        let mut reader = Reader::from_str(&text);
        reader.config_mut().expand_empty_elements = true;
        let mut open: Vec<String> = Vec::new();
        loop {
            let event = reader.read_event();
            let position = usize::try_from(reader.buffer_position()).unwrap_or(text.len());
            let place = Place { file, line: lines.of(position) };
            let in_heading = open.iter().any(|name| name == HEADING);
            match event.map_err(|error| place.refuse(error))? {
                Event::Start(element) => {
                    let name = element.name().as_ref().to_owned();
                    if alternative.is_none() && open.is_empty() {
                        self.outermost = self.fragment.markup.len();
                    }
                    match (name.as_str(), alternative) {
                        (_, Some(alternative)) if open.is_empty() => {
                            self.begin_picture(&element, alternative, place)?;
                        }
                        ("var", _) => self.begin_variable(reader.read_event(), in_heading, place)?,
                        // Not in a picture, which might include itself.
                        ("img", None) => self.begin_image(&element, place)?,
                        _ => self.begin(&element, place)?,
                    }
                    open.push(name);
                }
                Event::End(_) => match open.pop().unwrap_or_default().as_str() {
                    "var" => self.fragment.markup += "</var></a>",
                    name if VOID.contains(&name) => {}
                    name => self.fragment.markup += &format!("</{name}>"),
                },
                Event::Text(text) => self.text(&text, in_heading),
                Event::GeneralRef(reference) => {
                    let reference = format!("&{};", &*reference);
                    // XML has five names; it does not know HTML's others.
                    escape::unescape(&reference)
                        .map_err(|_| place.refuse(format!("write the character itself, not {reference}")))?;
                    self.text(&reference, in_heading);
                }
                Event::CData(_) => return Err(place.refuse("HTML has no CDATA")),
                Event::Empty(_) | Event::Comment(_) | Event::Decl(_) | Event::PI(_) | Event::DocType(_) => {}
                Event::Eof => {
                    return match open.last() {
                        Some(name) => Err(place.refuse(format!("it ends within <{name}>"))),
                        None => Ok(()),
                    };
                }
            }
        }
    }

    fn text(&mut self, escaped: &str, in_heading: bool) {
        let Fragment { markup, headings, .. } = &mut self.fragment;
        // Single-letter identifiers are italic, words are not; a style sheet cannot count letters.
        if escaped.chars().count() > 1 && markup.ends_with("<mi>") {
            markup.truncate(markup.len() - ">".len());
            *markup += " class=\"word\">";
        }
        *markup += escaped;
        if in_heading && let Some((_, heading)) = headings.last_mut() {
            *heading += escaped;
        }
    }

    /// A variable's name, the content of `<var>`.
    fn begin_variable(
        &mut self,
        content: quick_xml::Result<Event<'_>>,
        in_heading: bool,
        place: Place<'_>,
    ) -> Result<(), Error> {
        let Ok(Event::Text(name)) = content else {
            return Err(place.refuse("<var> must contain a variable's name"));
        };
        let anchor = self.anchors.get(&*name).ok_or_else(|| {
            let nearest = nearest(&name, self.anchors.keys());
            place.refuse(format!("the model has no variable '{}'{nearest}", &*name))
        })?;
        self.fragment.markup += &format!("<a href=\"#{}\"><var>", escape::escape(anchor));
        self.text(&breakable(&name), in_heading);
        Ok(())
    }

    /// Begins an `<img>`, or the SVG that it shows.
    fn begin_image(&mut self, element: &BytesStart<'_>, place: Place<'_>) -> Result<(), Error> {
        let attributes = attributes(element, place)?;
        let source = attributes.get("src").map(Path::new);
        let Some(picture) = source.filter(|path| path.extension().is_some_and(|suffix| suffix == "svg"))
        else {
            return self.begin(element, place);
        };
        let alternative = attributes.get("alt").ok_or_else(|| place.refuse("<img> needs an alt"))?;
        let folder = place.file.parent().unwrap_or(Path::new(""));
        self.include(&folder.join(picture), Some(alternative))
    }

    /// The outermost element of a picture.
    fn begin_picture(
        &mut self,
        element: &BytesStart<'_>,
        alternative: &str,
        place: Place<'_>,
    ) -> Result<(), Error> {
        if element.name().as_ref() != "svg" {
            return Err(place.refuse("it is not an SVG"));
        }
        self.check("svg", &attributes(element, place)?, place)?;
        let alternative = escape::escape(alternative);
        self.fragment.markup +=
            &format!("<{} role=\"img\" aria-label=\"{alternative}\">", element.trim_end());
        Ok(())
    }

    /// Any other element.
    fn begin(&mut self, element: &BytesStart<'_>, place: Place<'_>) -> Result<(), Error> {
        let name = element.name();
        let name = name.as_ref();
        if name.eq_ignore_ascii_case("meta") {
            // It might lead to another page (`refresh`), which no policy prevents.
            return Err(place.refuse("<meta> is not allowed in a fragment"));
        }
        let attributes = attributes(element, place)?;
        self.check(name, &attributes, place)?;
        if name == HEADING {
            let id = attributes.get("id");
            let id = id.ok_or_else(|| place.refuse("<h3> needs an id, for the page's contents"))?;
            self.fragment.headings.push((id.clone(), String::new()));
            self.fragment.first_section.get_or_insert(self.outermost);
        }
        let end = if VOID.contains(&name) { "/" } else { "" };
        self.fragment.markup += &format!("<{}{end}>", element.trim_end());
        Ok(())
    }

    /// Checks an element's id, link and picture.
    fn check(
        &mut self,
        element: &str,
        attributes: &BTreeMap<String, String>,
        place: Place<'_>,
    ) -> Result<(), Error> {
        for (key, value) in attributes {
            match (key.as_str(), element) {
                ("id", _) if value.starts_with(PAGE_ID) || !self.ids.insert(value.clone()) => {
                    return Err(place.refuse(format!("another element has the id '{value}'")));
                }
                ("src", "img") | ("href" | "xlink:href", "image") if !value.starts_with("data:") => {
                    let reason = "pictures are SVG files in <img>, or begin with data:";
                    return Err(place.refuse(format!("{key}=\"{value}\": {reason}")));
                }
                ("href" | "xlink:href", _) => {
                    if let Some(target) = value.strip_prefix('#') {
                        let refusal =
                            place.refuse(format!("it links to '#{target}', which is not on the page"));
                        self.links.push((target.to_owned(), refusal));
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }
}

fn attributes(element: &BytesStart<'_>, place: Place<'_>) -> Result<BTreeMap<String, String>, Error> {
    let mut attributes = BTreeMap::new();
    for attribute in element.attributes() {
        let attribute = attribute.map_err(|error| place.refuse(error))?;
        if attribute.value.contains('<') {
            return Err(place.refuse("write &lt; in an attribute"));
        }
        let value = attribute.normalized_value(XmlVersion::default()).map_err(|error| place.refuse(error))?;
        attributes.insert(attribute.key.as_ref().to_owned(), value.into_owned());
    }
    Ok(attributes)
}
