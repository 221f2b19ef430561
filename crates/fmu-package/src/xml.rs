//! XML from any tool, parsed within limits that the parser itself does not have: unbounded entities, deep nesting and
//! huge documents are refused.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::io;
use std::iter;
use std::path::Path;
use std::str::FromStr;

use encoding_rs::{Encoding, UTF_8};
use fmu_io::reading::{self, broken, utf_8};
use quick_xml::Reader;
use quick_xml::events::Event;
use quick_xml::name::QName;
use roxmltree::{Document, Node};

/// The deepest nesting of elements; FMI and SSP schemas need a tenth.
const DEEPEST: usize = 100;
/// The most elements of a document; the largest models have 200,000 variables with three elements each.
const MOST_ELEMENTS: usize = 2_000_000;
/// The most attributes of an element; FMI and SSP schemas need a fifth.
const MOST_ATTRIBUTES: usize = 100;
/// The most namespaces in a document: each element holds those of all ancestors.
const MOST_NAMESPACES: usize = 1000;
/// The most bytes in which an XML declaration is looked for.
const LONGEST_DECLARATION: usize = 1000;
/// Attributes whose values may be long.
const LISTS_AND_PROSE: &[&str] =
    &["clocks", "dependencies", "dependenciesKind", "description", "license", "start"];

/// An element.
pub type Element<'d> = Node<'d, 'd>;

/// Why a document is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Problem {
    /// The document has a document type definition.
    DocumentType,
    /// The document exceeds a limit.
    Limit,
    /// The document is not XML.
    Syntax,
}

/// The text of an XML file, in the encoding that it declares.
///
/// # Errors
/// When it cannot be read, is too large or in another encoding; the message names the file.
pub fn read_xml(file: &Path) -> io::Result<String> {
    reading::text_as(file, decode).map(|(text, _)| text)
}

/// The text of an XML file, and its encoding: UTF-8 if its bytes are, whatever the file declares, else the one of its
/// byte order mark or its declaration (XML 1.0, appendix F).
///
/// # Errors
/// When it is in neither.
pub(crate) fn decode(bytes: Vec<u8>) -> io::Result<(String, &'static Encoding)> {
    let declared = || {
        let beginning = String::from_utf8_lossy(&bytes[..bytes.len().min(LONGEST_DECLARATION)]);
        Encoding::for_label(declared_encoding(&beginning)?.as_bytes())
    };
    let marked = Encoding::for_bom(&bytes).map(|(encoding, _)| encoding);
    if let Some(encoding) = marked.or_else(declared)
        && str::from_utf8(&bytes).is_err()
        && let Some(text) = encoding.decode_without_bom_handling_and_without_replacement(&bytes)
    {
        return Ok((text.into_owned(), encoding));
    }
    Ok((utf_8(bytes)?, UTF_8))
}

/// The encoding that a document declares, if any.
#[must_use]
pub fn declared_encoding(text: &str) -> Option<String> {
    match Reader::from_str(text).read_event() {
        Ok(Event::Decl(declaration)) => Some(declaration.encoding()?.ok()?.into_owned()),
        _ => None,
    }
}

/// A document, or the reason why it is refused, with the line.
///
/// # Errors
/// When it is not XML, has a document type definition, or exceeds a limit.
pub fn parse(text: &str, longest_value: usize) -> Result<Document<'_>, (Problem, usize, String)> {
    scan(text, longest_value).map_err(|(problem, position, message)| {
        let before = &text.as_bytes()[..usize::try_from(position).unwrap_or(0).min(text.len())];
        (problem, before.split(|&byte| byte == b'\n').count(), message)
    })?;
    Document::parse(text).map_err(|error| {
        let message = error.to_string().replace(&format!(" at {}", error.pos()), "");
        (Problem::Syntax, error.pos().row as usize, message)
    })
}

/// Checks the limits; the error has a position in the text.
fn scan(text: &str, longest_value: usize) -> Result<(), (Problem, u64, String)> {
    let mut reader = Reader::from_str(text);
    let (mut open, mut elements, mut namespaces) = (vec![], 0, 0);
    loop {
        let event = reader.read_event();
        let event = event.map_err(|error| (Problem::Syntax, reader.error_position(), error.to_string()))?;
        let refuse = |problem, message: String| Err((problem, reader.buffer_position(), message));
        match &event {
            Event::DocType(_) => {
                return refuse(Problem::DocumentType, "it has a document type definition".to_owned());
            }
            Event::Start(element) | Event::Empty(element) => {
                elements += 1;
                let (mut attributes, mut longest) = (0, 0);
                for attribute in element.attributes().with_checks(false).take(MOST_ATTRIBUTES + 1).flatten() {
                    attributes += 1;
                    let key = attribute.key.as_ref();
                    namespaces += usize::from(key.starts_with("xmlns"));
                    let is_limited = !LISTS_AND_PROSE.contains(&key);
                    longest = longest.max(if is_limited { attribute.value.len() } else { 0 });
                }
                if matches!(event, Event::Start(_)) {
                    open.push(element.local_name().as_ref().to_owned());
                }
                for (count, most, what) in [
                    (attributes, MOST_ATTRIBUTES, "attributes"),
                    (longest, longest_value, "bytes in an attribute"),
                    (open.len(), DEEPEST, "nested elements"),
                    (elements, MOST_ELEMENTS, "elements"),
                    (namespaces, MOST_NAMESPACES, "namespaces"),
                ] {
                    if count > most {
                        return refuse(Problem::Limit, format!("it has more than {most} {what}"));
                    }
                }
            }
            Event::End(_) => drop(open.pop()),
            Event::Eof => {
                return match open.last() {
                    Some(open) => refuse(Problem::Syntax, format!("it ends within the element {open}")),
                    None if elements == 0 => refuse(Problem::Syntax, "it has no root element".to_owned()),
                    None => Ok(()),
                };
            }
            _ => {}
        }
    }
}

/// A document in which the root declares each namespace prefix that nothing declares, as some tools forget those of
/// annotations.
pub(crate) fn with_prefixes(text: &str) -> Cow<'_, str> {
    let mut reader = Reader::from_str(text);
    let (mut used, mut declared) = (BTreeSet::new(), BTreeSet::from(["xml".to_owned()]));
    let mut end_of_root_name = None;
    loop {
        let begin = reader.buffer_position();
        let Ok(event) = reader.read_event() else { break };
        let element = match &event {
            Event::Start(element) | Event::Empty(element) => element,
            Event::Eof => break,
            _ => continue,
        };
        let name = element.name();
        end_of_root_name.get_or_insert(begin + 1 + name.as_ref().len() as u64);
        let attributes: Vec<_> =
            element.attributes().with_checks(false).flatten().map(|each| each.key).collect();
        for (prefix, local) in iter::once(name).chain(attributes).map(split) {
            if prefix == "xmlns" {
                declared.insert(local);
            } else {
                used.insert(prefix);
            }
        }
    }
    used.remove("");
    let missing = used.difference(&declared).map(|prefix| format!(" xmlns:{prefix}=\"undeclared\""));
    let missing = missing.collect::<Vec<_>>().concat();
    match end_of_root_name.and_then(|end| text.split_at_checked(usize::try_from(end).ok()?)) {
        Some((before, after)) if !missing.is_empty() => format!("{before}{missing}{after}").into(),
        _ => text.into(),
    }
}

/// The prefix and the local part of a name.
fn split(name: QName<'_>) -> (String, String) {
    let (local, prefix) = name.decompose();
    (prefix.map_or("", |prefix| prefix.into_inner()).to_owned(), local.into_inner().to_owned())
}

/// Reads a document with a root of this name.
pub(crate) fn read<'d>(text: &'d str, root: &str) -> io::Result<Document<'d>> {
    let document = parse(text.strip_prefix('\u{feff}').unwrap_or(text), usize::MAX)
        .map_err(|(_, line, message)| broken(format!("in line {line}: {message}")))?;
    match document.root_element().tag_name().name() {
        name if name == root => Ok(document),
        name => Err(broken(format!("the root element is {name}, not {root}"))),
    }
}

/// An error in an element.
pub(crate) fn wrong(element: Element<'_>, message: &str) -> io::Error {
    let line = element.document().text_pos_at(element.range().start).row;
    broken(format!("in line {line}, in the element {}: {message}", element.tag_name().name()))
}

/// An element's children.
pub fn children(element: Element<'_>) -> impl Iterator<Item = Element<'_>> {
    element.children().filter(Node::is_element)
}

/// An element's children of a name.
pub fn named<'d>(element: Element<'d>, name: &'static str) -> impl Iterator<Item = Element<'d>> {
    children(element).filter(move |child| child.tag_name().name() == name)
}

/// The children of an element's children of a name.
pub fn listed<'d>(element: Element<'d>, list: &'static str) -> impl Iterator<Item = Element<'d>> {
    named(element, list).flat_map(children)
}

/// Whether an attribute is a true XML boolean.
pub fn flag(element: Element<'_>, name: &str) -> bool {
    element.attribute(name).and_then(boolean) == Some(true)
}

/// The value of an XML boolean, a word or a digit.
#[must_use]
pub fn boolean(text: &str) -> Option<bool> {
    match text.trim() {
        "true" | "1" => Some(true),
        "false" | "0" => Some(false),
        _ => None,
    }
}

/// A required XML boolean.
pub(crate) fn truth(element: Element<'_>, name: &str) -> io::Result<bool> {
    let text = required(element, name)?;
    boolean(&text)
        .ok_or_else(|| wrong(element, &format!("the attribute {name} is '{text}', which is not a Boolean")))
}

/// A required attribute.
pub(crate) fn required(element: Element<'_>, name: &str) -> io::Result<String> {
    element.attribute(name).map(str::to_owned).ok_or_else(|| wrong(element, &format!("it has no {name}")))
}

/// Refuses files of SSP, named in the plural, that are of another version than 1 and 2.
pub(crate) fn check_version(root: Element<'_>, what: &str) -> io::Result<()> {
    match text(root, "version") {
        version if version.starts_with("1.") || version.starts_with("2.") => Ok(()),
        version => Err(wrong(root, &format!("{what} of version '{version}' are not supported"))),
    }
}

/// An attribute; empty if missing.
pub(crate) fn text(element: Element<'_>, name: &str) -> String {
    element.attribute(name).unwrap_or_default().to_owned()
}

/// All attributes, in file order.
pub(crate) fn attributes(element: Element<'_>) -> Vec<(String, String)> {
    element
        .attributes()
        .map(|attribute| (attribute.name().to_owned(), attribute.value().to_owned()))
        .collect()
}

/// A numeric attribute, if there is one.
pub(crate) fn number<T: FromStr>(element: Element<'_>, name: &str) -> io::Result<Option<T>> {
    let parsed = element.attribute(name).map(|text| {
        let refuse =
            |_| wrong(element, &format!("the attribute {name} is '{text}', which is not a valid number"));
        text.trim().parse().map_err(refuse)
    });
    parsed.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prefixes_that_nothing_declares_are_declared() {
        let text = "<?xml version=\"1.0\"?><!-- <c/> --><a:b\n xmlns:a=\"a\"><c:d xml:e=\"\" f:g=\"h\"/><c:i/></a:b>";
        let declared = with_prefixes(text);
        let wanted = "<a:b xmlns:c=\"undeclared\" xmlns:f=\"undeclared\"\n xmlns:a=\"a\">";
        assert!(declared.contains(wanted), "{declared}");
        assert!(read(text, "b").is_err() && read(&declared, "b").is_ok());
        assert_eq!(with_prefixes("<a/>"), "<a/>");
    }

    #[test]
    fn what_exceeds_a_limit_is_refused() {
        let refusal = |text: &str| parse(text, 10).unwrap_err();
        let attributes = (0..200).map(|index| format!(r#"a{index}="" "#)).collect::<Vec<_>>().concat();
        let namespaces = r#"<b xmlns:c="d"/>"#.repeat(1001);
        for (text, message) in [
            (format!("<a {attributes}/>"), "100 attributes"),
            ("<a>".repeat(200), "100 nested elements"),
            (format!("<a>{}</a>", "<b/>".repeat(MOST_ELEMENTS)), "2000000 elements"),
            (format!("<a>{namespaces}</a>"), "1000 namespaces"),
            (r#"<a b="01234567890"/>"#.to_owned(), "10 bytes in an attribute"),
        ] {
            assert_eq!(refusal(&text), (Problem::Limit, 1, format!("it has more than {message}")));
        }
        assert!(parse(r#"<a start="01234567890"/>"#, 10).is_ok());
        let cut = (Problem::Syntax, 2, "it ends within the element b".to_owned());
        assert_eq!(refusal("<a>\n<b>"), cut);
        let message = "it has a document type definition".to_owned();
        assert_eq!(refusal("<!DOCTYPE a><a/>"), (Problem::DocumentType, 1, message));
    }

    fn decoded(bytes: &[u8]) -> (String, &'static str) {
        let (text, encoding) = decode(bytes.to_vec()).unwrap();
        (text, encoding.name())
    }

    #[test]
    fn texts_are_decoded_as_they_declare_unless_they_are_utf_8() {
        let latin = "<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?><unit name=\"°C\"/>";
        let bytes: Vec<_> = latin.chars().map(|character| u8::try_from(character).unwrap()).collect();
        assert_eq!(decoded(&bytes), (latin.to_owned(), "windows-1252"));
        assert_eq!(decoded(latin.as_bytes()), (latin.to_owned(), "UTF-8"));
        let utf_16: Vec<_> =
            "\u{feff}<unit name=\"°C\"/>".encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_eq!(decoded(&utf_16), ("\u{feff}<unit name=\"°C\"/>".to_owned(), "UTF-16LE"));
    }

    #[test]
    fn texts_in_no_known_encoding_are_refused_with_their_line() {
        for declaration in
            ["", "<?xml version=\"1.0\" encoding=\"UTF-8\"?>", "<?xml version=\"1.0\" encoding=\"X\"?>"]
        {
            let bytes = [declaration.as_bytes(), b"\n<unit name=\"\xb0C\"/>"].concat();
            assert_eq!(decode(bytes).unwrap_err().to_string(), "its line 2 is not UTF-8");
        }
    }
}
