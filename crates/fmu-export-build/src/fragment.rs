//! The part of a model's documentation that is written by hand: a piece of HTML, written as XML, that the
//! generated page takes in.
//!
//! `<var>tank.pressure</var>` becomes a link to the variable, `<img src="loop.svg" alt="…"/>` the picture
//! itself. What would leave the page broken is refused, by file and line: names that no variable has, links
//! to nowhere, pictures that are not there, and whatever is loaded from elsewhere.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion, escape};

use crate::error::{Error, nearest};
use crate::page::breakable;

/// A fragment that is ready for the page.
#[derive(Default)]
pub(crate) struct Fragment {
    markup: String,
    /// Where in the markup the first section begins: what stands before it opens the page.
    first_section: Option<usize>,
    /// Id and text of each heading, for the page's contents.
    pub(crate) headings: Vec<(String, String)>,
    /// The file and the pictures in it.
    pub(crate) files: Vec<PathBuf>,
}

impl Fragment {
    /// The opening, up to the element with the first heading, and the sections.
    pub(crate) fn parts(&self) -> (&str, &str) {
        let (opening, sections) = self.markup.split_at(self.first_section.unwrap_or(self.markup.len()));
        (opening.trim(), sections.trim())
    }
}

/// The ids of the page's own sections begin so.
pub(crate) const PAGE_ID: &str = "page-";

/// Elements that load or run something, or that only a whole page has.
const REFUSED: [&str; 15] = [
    "audio", "base", "body", "embed", "h1", "h2", "head", "html", "iframe", "link", "meta", "object",
    "script", "style", "video",
];

/// HTML's elements without an end tag that may stand in a fragment.
const VOID: [&str; 5] = ["br", "col", "hr", "img", "wbr"];

/// Reads a fragment; `anchors` has the id on the page of each name that a variable goes by.
pub(crate) fn read(file: &Path, anchors: &BTreeMap<String, String>) -> Result<Fragment, Error> {
    let mut reading = Reading {
        anchors,
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

/// Where in a file something stands.
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

/// The work in progress.
struct Reading<'a> {
    anchors: &'a BTreeMap<String, String>,
    fragment: Fragment,
    ids: BTreeSet<String>,
    /// Where in the markup the outermost open element begins.
    element: usize,
    /// The links within the page.
    links: Vec<(Place, String)>,
}

impl Reading<'_> {
    /// Appends the content of a file: the fragment itself, or a picture with what it is called.
    fn include(&mut self, file: &Path, picture: Option<&str>) -> Result<(), Error> {
        let text = fs::read_to_string(file).map_err(|error| Error::of_file(file, error))?;
        self.fragment.files.push(file.to_owned());
        let mut reader = Reader::from_str(&text);
        reader.config_mut().expand_empty_elements = true;
        let mut open: Vec<String> = Vec::new();
        loop {
            let event = reader.read_event();
            let read = usize::try_from(reader.buffer_position()).unwrap_or(text.len());
            let line = 1 + text.bytes().take(read).filter(|&byte| byte == b'\n').count();
            let place = Place { file: file.to_owned(), line };
            match event.map_err(|error| place.refuse(&error.to_string()))? {
                Event::Start(element) => {
                    let name = element.name().as_ref().to_owned();
                    if picture.is_none() && open.is_empty() {
                        self.element = self.fragment.markup.len();
                    }
                    match picture {
                        Some(called) if open.is_empty() => self.begin_picture(&element, called, &place)?,
                        _ if name == "var" => self.begin_variable(reader.read_event(), &open, &place)?,
                        _ => self.begin(&element, &place)?,
                    }
                    open.push(name);
                }
                Event::End(_) => {
                    let name = open.pop().unwrap_or_default();
                    if name == "var" {
                        self.fragment.markup += "</var></a>";
                    } else if !VOID.contains(&name.as_str()) {
                        self.fragment.markup += &format!("</{name}>");
                    }
                }
                Event::Text(text) => self.text(&text, &open),
                Event::GeneralRef(reference) => {
                    let reference = format!("&{};", &*reference);
                    // XML has five names; HTML's others are unknown to it.
                    escape::unescape(&reference)
                        .map_err(|_| place.refuse(&format!("write the character itself, not {reference}")))?;
                    self.text(&reference, &open);
                }
                Event::CData(_) => return Err(place.refuse("HTML has no CDATA")),
                Event::Empty(_) | Event::Comment(_) | Event::Decl(_) | Event::PI(_) | Event::DocType(_) => {}
                Event::Eof => {
                    return match open.last() {
                        Some(name) => Err(place.refuse(&format!("it ends within <{name}>"))),
                        None => Ok(()),
                    };
                }
            }
        }
    }

    fn text(&mut self, escaped: &str, open: &[String]) {
        // Identifiers of one letter are italic, words are not; the style sheet cannot count letters.
        if escaped.chars().count() > 1 && self.fragment.markup.ends_with("<mi>") {
            self.fragment.markup.truncate(self.fragment.markup.len() - ">".len());
            self.fragment.markup += " class=\"word\">";
        }
        self.fragment.markup += escaped;
        if open.iter().any(|name| name == "h3")
            && let Some((_, heading)) = self.fragment.headings.last_mut()
        {
            *heading += escaped;
        }
    }

    /// A variable's name, which is the content of `<var>`.
    fn begin_variable(
        &mut self,
        content: quick_xml::Result<Event<'_>>,
        open: &[String],
        place: &Place,
    ) -> Result<(), Error> {
        let Ok(Event::Text(name)) = content else {
            return Err(place.refuse("<var> is for the name of a variable"));
        };
        let anchor = self.anchors.get(&*name).ok_or_else(|| {
            let nearest = nearest(&name, self.anchors.keys().cloned());
            place.refuse(&format!("the model has no variable '{}'{nearest}", &*name))
        })?;
        self.fragment.markup += &format!("<a href=\"#{anchor}\"><var>");
        self.text(&breakable(&name), open);
        Ok(())
    }

    fn begin(&mut self, element: &BytesStart<'_>, place: &Place) -> Result<(), Error> {
        let name = element.name();
        let name = name.as_ref();
        if REFUSED.contains(&name) {
            return Err(place.refuse(&format!("<{name}> has no place within a page that is whole by itself")));
        }
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
            let is_link = matches!(key.as_str(), "href" | "xlink:href");
            let loads = matches!(key.as_str(), "src" | "srcset") || is_link && element != "a";
            let elsewhere = loads && !value.starts_with(['#']) && !value.starts_with("data:")
                || value.contains("url(") && !value.contains("url(#");
            if elsewhere {
                return Err(place.refuse(&format!("{key}=\"{value}\" is loaded from elsewhere")));
            }
            if key.starts_with("on") {
                return Err(place.refuse(&format!("{key} is a script")));
            }
            if is_link && let Some(target) = value.strip_prefix('#') {
                self.links.push((place.clone(), target.to_owned()));
            }
            if key == "id" {
                let taken = value.starts_with(PAGE_ID) || self.anchors.values().any(|anchor| anchor == value);
                if taken || !self.ids.insert(value.clone()) {
                    return Err(place.refuse(&format!("another element has the id '{value}'")));
                }
            }
        }
        Ok(())
    }
}

fn attributes(element: &BytesStart<'_>, place: &Place) -> Result<Vec<(String, String)>, Error> {
    let attribute = |attribute: Result<quick_xml::events::attributes::Attribute<'_>, _>| {
        let attribute = attribute.map_err(quick_xml::Error::from)?;
        let value = attribute.normalized_value(XmlVersion::default())?;
        Ok((attribute.key.as_ref().to_owned(), value.into_owned()))
    };
    element
        .attributes()
        .map(attribute)
        .collect::<quick_xml::Result<_>>()
        .map_err(|error| place.refuse(&error.to_string()))
}
