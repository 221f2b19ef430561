//! An FMU's XML files, from any source: parsed within limits, with the lines of elements.

use std::cell::OnceCell;

use quick_xml::Reader;
use quick_xml::events::Event;
use roxmltree::{Document, Node};

use super::rules::{LIMIT, XML_DOCTYPE, XML_ENCODING, XML_SYNTAX};
use super::{Place, Report};
use crate::model_description::{DEEPEST, MOST_ATTRIBUTES, MOST_ELEMENTS};

/// The longest attribute value in bytes, unless a list or prose: findings quote them.
const LONGEST_VALUE: usize = 10_000;
const LISTS_AND_PROSE: &[&str] =
    &["clocks", "dependencies", "dependenciesKind", "description", "license", "start"];
/// The most namespaces in a document: each element holds those of all ancestors.
const MOST_NAMESPACES: usize = 1000;

/// A file and its content.
pub(super) struct Xml<'d> {
    /// Its path in the archive.
    pub file: &'d str,
    text: &'d str,
    document: Document<'d>,
    /// Where each line but the first begins.
    lines: OnceCell<Vec<usize>>,
}

impl<'d> Xml<'d> {
    /// Parses a file, or reports why it cannot be parsed.
    pub fn parse(file: &'d str, text: &'d str, report: &mut Report) -> Option<Self> {
        let in_line = |line| Place { line: Some(line), ..Place::file(file) };
        // A byte order mark is allowed.
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        if !is_within_limits(text, file, report) {
            return None;
        }
        match Document::parse(text) {
            Ok(document) => Some(Self { file, text, document, lines: OnceCell::new() }),
            Err(error) => {
                let message = error.to_string();
                let message = message.rsplit_once(" at ").map_or(message.as_str(), |(message, _)| message);
                report.add(&XML_SYNTAX, in_line(error.pos().row as usize), message);
                None
            }
        }
    }

    pub fn root(&self) -> Node<'_, 'd> {
        self.document.root_element()
    }

    pub fn at(&self, node: Node<'_, '_>) -> Place {
        let lines =
            self.lines.get_or_init(|| self.text.match_indices('\n').map(|(place, _)| place + 1).collect());
        let line = 1 + lines.partition_point(|&start| start <= node.range().start);
        Place { line: Some(line), ..Place::file(self.file) }
    }
}

/// Whether a document is safe to parse: the parser has no such limits.
fn is_within_limits(text: &str, file: &str, report: &mut Report) -> bool {
    let mut reader = Reader::from_str(text);
    let (mut depth, mut elements, mut namespaces) = (0, 0, 0);
    let in_line_of = |place: u64| {
        let before = &text.as_bytes()[..usize::try_from(place).unwrap_or(0).min(text.len())];
        Place { line: Some(before.split(|&byte| byte == b'\n').count()), ..Place::file(file) }
    };
    loop {
        let event = match reader.read_event() {
            Ok(event) => event,
            Err(error) => {
                report.add(&XML_SYNTAX, in_line_of(reader.error_position()), error.to_string());
                return false;
            }
        };
        let is_refused = match &event {
            Event::Eof => return true,
            Event::Decl(declaration) => {
                let encoding = declaration.encoding().and_then(Result::ok);
                if let Some(encoding) = encoding.filter(|name| !name.eq_ignore_ascii_case("utf-8")) {
                    let message = format!("it declares the encoding {encoding}");
                    report.add(&XML_ENCODING, in_line_of(0), message);
                }
                false
            }
            Event::DocType(_) => {
                let place = in_line_of(reader.buffer_position());
                report.add(&XML_DOCTYPE, place, "it has a document type definition");
                return false;
            }
            Event::Start(element) | Event::Empty(element) => {
                depth += usize::from(matches!(event, Event::Start(_)));
                elements += 1;
                let (mut attributes, mut is_long) = (0, false);
                for attribute in element.attributes().with_checks(false).take(MOST_ATTRIBUTES + 1).flatten() {
                    attributes += 1;
                    let key = attribute.key.as_ref();
                    namespaces += usize::from(key.starts_with("xmlns"));
                    is_long |= attribute.value.len() > LONGEST_VALUE && !LISTS_AND_PROSE.contains(&key);
                }
                is_long
                    || attributes > MOST_ATTRIBUTES
                    || depth > DEEPEST
                    || elements > MOST_ELEMENTS
                    || namespaces > MOST_NAMESPACES
            }
            Event::End(_) => {
                depth = depth.saturating_sub(1);
                false
            }
            _ => false,
        };
        if is_refused {
            let message = "it has more or longer elements, attributes or namespaces than any description";
            report.add(&LIMIT, in_line_of(reader.buffer_position()), message);
            return false;
        }
    }
}
