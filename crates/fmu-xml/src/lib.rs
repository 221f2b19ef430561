//! Writing XML: what the modelDescription.xml of FMI and the files of SSP have in common.
//!
//! The same content gives the same bytes: attributes keep their order, numbers their shortest form.

use std::borrow::Cow;
use std::io;

use quick_xml::events::{BytesDecl, Event};
use quick_xml::writer::Writer;

/// Writes XML to memory.
pub type XmlWriter = Writer<Vec<u8>>;
/// Names and values of attributes, in their order.
pub type Attributes = Vec<(&'static str, String)>;

/// A document with what is written into it.
///
/// # Panics
/// When the content is not written to the end.
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
/// Those of the content.
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

/// The shortest decimal that reads back as the same double.
#[must_use]
pub fn float(value: f64) -> String {
    format!("{value:?}")
}

/// Factor and offset of a unit or a transformation, where they are not the schemas' defaults 1 and 0.
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
