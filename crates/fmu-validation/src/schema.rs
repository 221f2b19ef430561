//! Interprets those parts of the schema language that the standard's schemas use; a test ensures that they use nothing
//! else.
//!
//! A schema is deterministic: an element's name determines its part of the content, so one pass without backtracking
//! suffices.

use std::collections::HashMap;
use std::rc::Rc;

use fmu_terms::Version;
use regex_lite::Regex;
use roxmltree::{Document, Node};

use crate::report::Report;
use crate::rules::{SCHEMA_ATTRIBUTE, SCHEMA_ELEMENT, SCHEMA_VALUE};
use crate::xml::Xml;

type Declaration<'s> = Node<'s, 's>;

macro_rules! schema_files {
    ($folder:literal: $($file:literal)*) => {
        &[$(include_str!(concat!("../schema/", $folder, "/", $file, ".xsd"))),*]
    };
}

const FMI2: &[&str] = schema_files!("fmi2": "fmi2Annotation" "fmi2AttributeGroups" "fmi2ModelDescription"
    "fmi2ScalarVariable" "fmi2Type" "fmi2Unit" "fmi2VariableDependency");
const FMI3: &[&str] = schema_files!("fmi3": "fmi3Annotation" "fmi3AttributeGroups" "fmi3BuildDescription"
    "fmi3InterfaceType" "fmi3ModelDescription" "fmi3Terminal" "fmi3TerminalsAndIcons" "fmi3Type" "fmi3Unit"
    "fmi3Variable" "fmi3VariableDependency");

/// Checks a document against the schema of an FMI version that declares its root.
pub(crate) fn check(version: Version, xml: &Xml<'_>, report: &mut Report) {
    let files = match version {
        Version::Two => FMI2,
        Version::Three => FMI3,
    };
    let documents: Vec<_> = files.iter().map(|text| parsed(text)).collect();
    let mut schema = Schema::new(&documents);
    let root = xml.root();
    match schema.top.get(&("element", root.tag_name().name())) {
        Some(&declaration) => schema.element(declaration, root, xml, report),
        None => report.add(&SCHEMA_ELEMENT, xml.at(root), format!("the schema has no root {}", name(root))),
    }
}

fn parsed(text: &'static str) -> Document<'static> {
    Document::parse(text).expect("the schemas are XML")
}

/// A schema's files.
struct Schema<'s> {
    /// The top-level declarations, by kind and name.
    top: HashMap<(&'s str, &'s str), Declaration<'s>>,
    /// The content of types, once needed.
    types: HashMap<Declaration<'s>, Rc<Type<'s>>>,
    patterns: HashMap<&'s str, Regex>,
}

/// A complex type with everything it inherits and references.
#[derive(Default)]
struct Type<'s> {
    attributes: HashMap<&'s str, Declaration<'s>>,
    has_any_attribute: bool,
    is_mixed: bool,
    /// The type's content, in sequence.
    content: Vec<Declaration<'s>>,
}

impl<'s> Schema<'s> {
    fn new(documents: &'s [Document<'static>]) -> Self {
        let declarations = documents.iter().flat_map(|document| document.root_element().children());
        let top = declarations
            .filter_map(|node| Some(((node.tag_name().name(), node.attribute("name")?), node)))
            .collect();
        Self { top, types: HashMap::new(), patterns: HashMap::new() }
    }

    fn resolve(&self, kind: &'static str, name: &'s str) -> Declaration<'s> {
        self.top[&(kind, name)]
    }

    /// The declaration that an element references, or is.
    fn referred(&self, declaration: Declaration<'s>) -> Declaration<'s> {
        declaration.attribute("ref").map_or(declaration, |name| self.resolve("element", name))
    }

    fn type_of(&mut self, complex_type: Declaration<'s>) -> Rc<Type<'s>> {
        if let Some(known) = self.types.get(&complex_type) {
            return Rc::clone(known);
        }
        let mut found = Type { is_mixed: complex_type.attribute("mixed") == Some("true"), ..Type::default() };
        self.collect(complex_type, &mut found);
        let found = Rc::new(found);
        self.types.insert(complex_type, Rc::clone(&found));
        found
    }

    fn collect(&mut self, node: Declaration<'s>, found: &mut Type<'s>) {
        for child in node.children().filter(Node::is_element) {
            let base =
                |schema: &Self| schema.resolve("complexType", child.attribute("base").unwrap_or_default());
            match child.tag_name().name() {
                "attribute" => {
                    found.attributes.insert(child.attribute("name").unwrap_or_default(), child);
                }
                "anyAttribute" => found.has_any_attribute = true,
                "attributeGroup" => {
                    let group = self.resolve("attributeGroup", child.attribute("ref").unwrap_or_default());
                    self.collect(group, found);
                }
                "complexContent" => self.collect(child, found),
                "extension" => {
                    self.collect(base(self), found);
                    self.collect(child, found);
                }
                // It repeats the content, but not the attributes.
                "restriction" => {
                    self.collect(base(self), found);
                    found.content.clear();
                    self.collect(child, found);
                }
                "sequence" | "choice" | "group" => found.content.push(child),
                _ => {}
            }
        }
    }

    /// Checks an element against its declaration.
    fn element(
        &mut self,
        declaration: Declaration<'s>,
        node: Node<'_, '_>,
        xml: &Xml<'_>,
        report: &mut Report,
    ) {
        let declaration = self.referred(declaration);
        let expected = match (declaration.attribute("type"), child(declaration, "complexType")) {
            (Some(name), _) => self.type_of(self.resolve("complexType", name)),
            (None, Some(complex_type)) => self.type_of(complex_type),
            // Without a type, anything is allowed.
            (None, None) => return,
        };
        self.attributes(&expected, node, xml, report);
        self.content(&expected, node, xml, report);
    }

    fn attributes(&mut self, expected: &Type<'s>, node: Node<'_, '_>, xml: &Xml<'_>, report: &mut Report) {
        // Attributes with a namespace, such as `xsi:noNamespaceSchemaLocation`, are not part of the schema.
        for attribute in node.attributes().filter(|attribute| attribute.namespace().is_none()) {
            let (key, value) = (attribute.name(), attribute.value());
            let Some(&declaration) = expected.attributes.get(key) else {
                if !expected.has_any_attribute {
                    let message =
                        format!("{} has the attribute {key}, which the schema does not know", name(node));
                    report.add(&SCHEMA_ATTRIBUTE, xml.at(node), message);
                }
                continue;
            };
            if let Err(wanted) = self.value(declaration, value) {
                let message = format!("the attribute {key} of {} is '{value}', not {wanted}", name(node));
                report.add(&SCHEMA_VALUE, xml.at(node), message);
            }
        }
        let mut missing: Vec<_> = expected
            .attributes
            .iter()
            .filter(|(key, rule)| rule.attribute("use") == Some("required") && !node.has_attribute(**key))
            .map(|(key, _)| *key)
            .collect();
        missing.sort_unstable();
        for key in missing {
            report.add(&SCHEMA_ATTRIBUTE, xml.at(node), format!("{} needs the attribute {key}", name(node)));
        }
    }

    /// Checks an attribute's value against its type; the error says what it should be.
    fn value(&mut self, declaration: Declaration<'s>, value: &str) -> Result<(), String> {
        if let Some(fixed) = declaration.attribute("fixed")
            && value != fixed
        {
            return Err(format!("'{fixed}'"));
        }
        match (declaration.attribute("type"), child(declaration, "simpleType")) {
            (Some(builtin), _) => is_of(builtin, value),
            (None, Some(simple_type)) => self.simple(simple_type, value),
            (None, None) => Ok(()),
        }
    }

    fn simple(&mut self, simple_type: Declaration<'s>, value: &str) -> Result<(), String> {
        if let Some(list) = child(simple_type, "list") {
            return value.split_ascii_whitespace().try_for_each(|item| {
                match (list.attribute("itemType"), child(list, "simpleType")) {
                    (Some(builtin), _) => is_of(builtin, item),
                    (None, Some(simple_type)) => self.simple(simple_type, item),
                    (None, None) => Ok(()),
                }
                .map_err(|wanted| format!("a list of items that are each {wanted}"))
            });
        }
        let Some(restriction) = child(simple_type, "restriction") else { return Ok(()) };
        let facets = |kind: &'static str| {
            let children = restriction.children().filter(move |facet| facet.has_tag_name((XS, kind)));
            children.filter_map(|facet| facet.attribute("value"))
        };
        if let Some(pattern) = facets("pattern").next() {
            let compiled = self.patterns.entry(pattern).or_insert_with(|| {
                Regex::new(&format!("^(?:{pattern})$")).expect("the patterns of the schemas are simple")
            });
            return if compiled.is_match(value) { Ok(()) } else { Err(format!("of the form {pattern}")) };
        }
        if facets("enumeration").any(|allowed| allowed == value) {
            return Ok(());
        }
        Err(format!("one of {}", facets("enumeration").collect::<Vec<_>>().join(", ")))
    }

    fn content(&mut self, expected: &Type<'s>, node: Node<'_, '_>, xml: &Xml<'_>, report: &mut Report) {
        let is_text = |child: &Node<'_, '_>| {
            child.is_text() && child.text().is_some_and(|text| !text.trim().is_empty())
        };
        if let Some(text) = node.children().find(is_text).filter(|_| !expected.is_mixed) {
            report.add(&SCHEMA_ELEMENT, xml.at(text), format!("{} contains text", name(node)));
        }
        let children: Vec<_> = node.children().filter(Node::is_element).collect();
        let mut rest = children.as_slice();
        let found =
            expected.content.iter().try_for_each(|&particle| self.consume(particle, &mut rest, xml, report));
        let message = match (found, rest.first()) {
            (Ok(()), None) => return,
            (Ok(()), Some(&next)) => format!("{} does not belong here in {}", name(next), name(node)),
            (Err(wanted), None) => format!("{} ends where {wanted} is expected", name(node)),
            (Err(wanted), Some(&next)) => {
                format!("{} has {} where {wanted} is expected", name(node), name(next))
            }
        };
        report.add(&SCHEMA_ELEMENT, xml.at(rest.first().copied().unwrap_or(node)), message);
        // The rest is checked as far as it is known.
        for &next in rest {
            if let Some(declaration) =
                expected.content.iter().find_map(|&part| self.declared(part, name(next)))
            {
                self.element(declaration, next, xml, report);
            }
        }
    }

    /// Consumes the elements of a part of the content; the error says what is missing.
    fn consume(
        &mut self,
        particle: Declaration<'s>,
        rest: &mut &[Node<'_, '_>],
        xml: &Xml<'_>,
        report: &mut Report,
    ) -> Result<(), String> {
        let (least, most) = occurrences(particle);
        let mut count = 0;
        while count < most
            && let Some(&next) = rest.first()
            && self.starts(particle, name(next))
        {
            match particle.tag_name().name() {
                "element" => {
                    self.element(particle, next, xml, report);
                    *rest = &rest[1..];
                }
                "choice" => {
                    let parts = self.parts(particle);
                    if let Some(part) = parts.into_iter().find(|&part| self.starts(part, name(next))) {
                        self.consume(part, rest, xml, report)?;
                    }
                }
                "sequence" | "group" => {
                    for part in self.parts(particle) {
                        self.consume(part, rest, xml, report)?;
                    }
                }
                // Anything.
                _ => *rest = &rest[1..],
            }
            count += 1;
        }
        if count < least && !self.is_optional(particle) {
            return Err(self.expected(particle));
        }
        Ok(())
    }

    /// The parts of a sequence, choice or named group.
    fn parts(&self, particle: Declaration<'s>) -> Vec<Declaration<'s>> {
        let particle = particle.attribute("ref").map_or(particle, |name| self.resolve("group", name));
        particle
            .children()
            .filter(|part| part.is_element() && !part.has_tag_name((XS, "annotation")))
            .collect()
    }

    fn starts(&self, particle: Declaration<'s>, name: &str) -> bool {
        match particle.tag_name().name() {
            "element" => self.referred(particle).attribute("name") == Some(name),
            "any" => true,
            "choice" => self.parts(particle).into_iter().any(|part| self.starts(part, name)),
            _ => {
                for part in self.parts(particle) {
                    if self.starts(part, name) {
                        return true;
                    }
                    if occurrences(part).0 > 0 && !self.is_optional(part) {
                        return false;
                    }
                }
                false
            }
        }
    }

    /// Whether a part of the content may be empty, even if it must occur.
    fn is_optional(&self, particle: Declaration<'s>) -> bool {
        let may_be_empty = |part: Declaration<'s>| occurrences(part).0 == 0 || self.is_optional(part);
        match particle.tag_name().name() {
            "element" | "any" => false,
            "choice" => self.parts(particle).into_iter().any(may_be_empty),
            _ => self.parts(particle).into_iter().all(may_be_empty),
        }
    }

    /// The first element of a part of the content.
    fn expected(&self, particle: Declaration<'s>) -> String {
        match particle.tag_name().name() {
            "element" => self.referred(particle).attribute("name").unwrap_or_default().to_owned(),
            "choice" => {
                let parts: Vec<_> =
                    self.parts(particle).into_iter().map(|part| self.expected(part)).collect();
                format!("one of {}", parts.join(", "))
            }
            _ => self.parts(particle).first().map_or_else(String::new, |&part| self.expected(part)),
        }
    }

    /// An element's declaration anywhere in a content.
    fn declared(&self, particle: Declaration<'s>, name: &str) -> Option<Declaration<'s>> {
        if particle.has_tag_name((XS, "element")) {
            return Some(particle).filter(|&particle| self.starts(particle, name));
        }
        self.parts(particle).into_iter().find_map(|part| self.declared(part, name))
    }
}

/// The schema language's namespace.
const XS: &str = "http://www.w3.org/2001/XMLSchema";

fn child<'s>(node: Declaration<'s>, kind: &str) -> Option<Declaration<'s>> {
    node.children().find(|child| child.has_tag_name((XS, kind)))
}

/// An element's name as in the schemas, which have no namespace.
fn name<'d>(node: Node<'d, '_>) -> &'d str {
    if node.tag_name().namespace().is_some() {
        "(an element with a namespace)"
    } else {
        node.tag_name().name()
    }
}

fn occurrences(particle: Declaration<'_>) -> (u32, u32) {
    let number = |key, if_absent| match particle.attribute(key) {
        None => if_absent,
        Some(text) => text.parse().unwrap_or(u32::MAX),
    };
    (number("minOccurs", 1), number("maxOccurs", 1))
}

/// Checks a text against a built-in type; the error says what it should be.
fn is_of(builtin: &str, text: &str) -> Result<(), String> {
    fn integer<T: std::str::FromStr>(text: &str) -> bool {
        text.parse::<T>().is_ok()
    }
    // Surrounding blanks are ignored, and `-0` is an unsigned number.
    let text = text.trim();
    let unsigned = if text.trim_start_matches(['-', '0']).is_empty() && text != "-" {
        text.trim_start_matches('-')
    } else {
        text
    };
    let (is_one, what) = match builtin {
        "xs:boolean" => (matches!(text, "true" | "false" | "1" | "0"), "true or false"),
        "xs:double" | "xs:float" => (number(text).is_some(), "a number"),
        "xs:byte" => (integer::<i8>(text), "an 8-bit integer"),
        "xs:short" => (integer::<i16>(text), "a 16-bit integer"),
        "xs:int" => (integer::<i32>(text), "a 32-bit integer"),
        "xs:long" => (integer::<i64>(text), "a 64-bit integer"),
        "xs:unsignedByte" => (integer::<u8>(unsigned), "an unsigned 8-bit integer"),
        "xs:unsignedShort" => (integer::<u16>(unsigned), "an unsigned 16-bit integer"),
        "xs:unsignedInt" => (integer::<u32>(unsigned), "an unsigned 32-bit integer"),
        "xs:unsignedLong" => (integer::<u64>(unsigned), "an unsigned 64-bit integer"),
        "xs:nonNegativeInteger" => {
            let digits = unsigned.strip_prefix('+').unwrap_or(unsigned);
            (!digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit()), "a nonnegative integer")
        }
        "xs:hexBinary" => {
            let is_hexadecimal =
                text.len().is_multiple_of(2) && text.bytes().all(|byte| byte.is_ascii_hexdigit());
            (is_hexadecimal, "pairs of hexadecimal digits")
        }
        "xs:dateTime" => (is_date_time(text), "a date and time like 2009-12-08T14:33:22Z"),
        // string, normalizedString, anyURI: any text.
        _ => (true, ""),
    };
    if is_one { Ok(()) } else { Err(what.to_owned()) }
}

/// A number as written in XML.
pub(crate) fn number(text: &str) -> Option<f64> {
    match text.trim() {
        "INF" => Some(f64::INFINITY),
        "-INF" => Some(f64::NEG_INFINITY),
        "NaN" => Some(f64::NAN),
        // Rust also accepts words such as `infinity`.
        text if text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'+' | b'-' | b'.' | b'e' | b'E')) => {
            text.parse().ok()
        }
        _ => None,
    }
}

fn is_date_time(text: &str) -> bool {
    let form = r"^-?(\d{4,})-(\d\d)-(\d\d)T(([01]\d|2[0-3]):[0-5]\d:[0-5]\d(\.\d+)?|24:00:00(\.0+)?)(Z|[+-](0\d|1[0-3]):[0-5]\d|[+-]14:00)?$";
    let Some(parts) = Regex::new(form).expect("the form is correct").captures(text) else { return false };
    let part = |index| parts.get(index).and_then(|part| part.as_str().parse::<u64>().ok()).unwrap_or(0);
    let (year, month, day) = (part(1), part(2), part(3));
    let days = match month {
        2 if year % 4 == 0 && (year % 100 != 0 || year % 400 == 0) => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        1..=12 => 31,
        _ => 0,
    };
    (1..=days).contains(&day)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_schemas_use_nothing_that_is_not_understood() {
        const KINDS: &[&str] = &[
            "annotation",
            "any",
            "anyAttribute",
            "attribute",
            "attributeGroup",
            "choice",
            "complexContent",
            "complexType",
            "documentation",
            "element",
            "enumeration",
            "extension",
            "group",
            "include",
            "list",
            "pattern",
            "restriction",
            "schema",
            "sequence",
            "simpleType",
        ];
        for files in [FMI2, FMI3] {
            let documents: Vec<_> = files.iter().map(|text| parsed(text)).collect();
            let mut schema = Schema::new(&documents);
            let nodes = documents.iter().flat_map(|document| document.descendants());
            // The schemas' documentation has elements of its own.
            for node in nodes.filter(|node| node.tag_name().namespace() == Some(XS)) {
                let kind = node.tag_name().name();
                assert!(KINDS.contains(&kind), "{kind}");
                if kind == "complexType" {
                    // Panics at undeclared names.
                    schema.type_of(node);
                }
                if let Some(builtin) = node.attribute("type").filter(|name| name.starts_with("xs:")) {
                    let is_text = ["xs:string", "xs:normalizedString", "xs:anyURI"].contains(&builtin);
                    assert!(is_text || is_of(builtin, "neither of the others").is_err(), "{builtin}");
                }
            }
        }
    }

    #[test]
    fn values_are_of_the_types_of_xml_schema() {
        for (builtin, right, wrong) in [
            ("xs:boolean", ["true", "0"], ["yes", ""]),
            ("xs:double", ["-1.5e3", " INF "], ["infinity", "1,5"]),
            ("xs:int", ["-2147483648", "+1"], ["2147483648", "1.0"]),
            ("xs:unsignedInt", ["4294967295", "-0"], ["-1", "-"]),
            ("xs:unsignedLong", ["18446744073709551615", "0"], ["18446744073709551616", ""]),
            ("xs:nonNegativeInteger", ["99999999999999999999999", "+1"], ["-1", ""]),
            ("xs:hexBinary", ["0aF1", ""], ["0", "0g"]),
            (
                "xs:dateTime",
                ["2024-02-29T23:59:59Z", "2009-12-08T14:33:22.5+01:00"],
                ["2023-02-29T00:00:00Z", "2009-12-08"],
            ),
        ] {
            for text in right {
                assert_eq!(is_of(builtin, text), Ok(()), "{builtin} '{text}'");
            }
            for text in wrong {
                assert!(is_of(builtin, text).is_err(), "{builtin} '{text}'");
            }
        }
    }
}
