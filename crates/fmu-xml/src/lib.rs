//! Writes XML: what FMI's modelDescription.xml and SSP's files share.
//!
//! The same content gives the same bytes: attributes keep their order, numbers their shortest form.

pub mod page;

use std::borrow::Cow;
use std::io;

use quick_xml::events::{BytesDecl, Event};
use quick_xml::writer::Writer;

/// Writes XML to memory.
pub type XmlWriter = Writer<Vec<u8>>;
/// Names and values of attributes, in their order.
pub type Attributes = Vec<(&'static str, String)>;

/// A document with the content that is written into it.
///
/// # Panics
/// When the content is incomplete.
#[must_use]
pub fn document(content: impl FnOnce(&mut XmlWriter) -> io::Result<()>) -> String {
    let mut writer = Writer::new_with_indent(Vec::new(), b' ', 2);
    let declaration = Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None));
    writer.write_event(declaration).and_then(|()| content(&mut writer)).expect("a Vec takes every write");
    let mut text = String::from_utf8(writer.into_inner()).expect("only UTF-8 was written");
    text.push('\n');
    text
}

/// An element with content.
///
/// # Errors
/// When the content cannot be written.
pub fn element(
    writer: &mut XmlWriter,
    name: &'static str,
    attributes: Attributes,
    content: impl FnOnce(&mut XmlWriter) -> io::Result<()>,
) -> io::Result<()> {
    let attributes = attributes.into_iter().map(|(name, value)| (name, Cow::Owned(value)));
    writer.create_element(name).with_attributes(attributes).write_inner_content(content)?;
    Ok(())
}

/// An element without content.
///
/// # Errors
/// None: memory takes every write.
pub fn empty(writer: &mut XmlWriter, name: &'static str, attributes: Attributes) -> io::Result<()> {
    let attributes = attributes.into_iter().map(|(name, value)| (name, Cow::Owned(value)));
    writer.create_element(name).with_attributes(attributes).write_empty()?;
    Ok(())
}

/// The attributes that have a value.
#[must_use]
pub fn given<const N: usize>(attributes: [(&'static str, Option<String>); N]) -> Attributes {
    attributes.into_iter().filter_map(|(name, value)| Some((name, value?))).collect()
}

/// The shortest decimal that reads back as the same double.
#[must_use]
pub fn float(value: f64) -> String {
    format!("{value:?}")
}

/// The attributes of a `BaseUnit`: its powers, and its conversion. The unit 1 has its factor, since some tools, such as
/// ospx, cannot read the element without attributes.
#[must_use]
pub fn base_unit(powers: impl Iterator<Item = (&'static str, i32)>, factor: f64, offset: f64) -> Attributes {
    let mut attributes: Attributes = powers.map(|(name, exponent)| (name, exponent.to_string())).collect();
    attributes.extend(conversion(factor, offset));
    if attributes.is_empty() {
        attributes.push(("factor", float(factor)));
    }
    attributes
}

/// A unit's factor and offset, unless they are the schemas' defaults 1 and 0.
#[must_use]
pub fn conversion(factor: f64, offset: f64) -> Attributes {
    let mut attributes = Vec::new();
    if factor.to_bits() != 1.0_f64.to_bits() {
        attributes.push(("factor", float(factor)));
    }
    if offset != 0.0 {
        attributes.push(("offset", float(offset)));
    }
    attributes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_document_is_indented_and_escaped() {
        let text = document(|writer| {
            element(writer, "Unit", vec![("name", "a<\"b\"".to_owned())], |writer| {
                empty(writer, "BaseUnit", conversion(1000.0, 0.0))
            })
        });
        let expected = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
                        <Unit name=\"a&lt;&quot;b&quot;\">\n  <BaseUnit factor=\"1000.0\"/>\n</Unit>\n";
        assert_eq!(text, expected);
    }

    #[test]
    fn numbers_are_short_and_read_back() {
        for (value, text) in
            [(0.1, "0.1"), (1.0, "1.0"), (1e-9, "1e-9"), (f64::MAX, "1.7976931348623157e308")]
        {
            assert_eq!(float(value), text);
            assert_eq!(float(value).parse::<f64>().unwrap().to_bits(), value.to_bits());
        }
        assert_eq!(conversion(1.0, 0.0), []);
        assert_eq!(conversion(1.0, 273.15), [("offset", "273.15".to_owned())]);
    }
}
