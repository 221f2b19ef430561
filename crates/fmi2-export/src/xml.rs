//! Writing XML: what modelDescription.xml and the files of SSP have in common.
//!
//! The same content gives the same bytes: attributes keep their order, numbers their shortest form.

use std::borrow::Cow;
use std::io;

use quick_xml::events::{BytesDecl, Event};
use quick_xml::writer::Writer;

pub(crate) type XmlWriter = Writer<Vec<u8>>;
pub(crate) type Attributes = Vec<(&'static str, String)>;

/// A document with what is written into it.
pub(crate) fn document(content: impl FnOnce(&mut XmlWriter) -> io::Result<()>) -> String {
    let mut writer = Writer::new_with_indent(Vec::new(), b' ', 2);
    let declaration = Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None));
    writer.write_event(declaration).and_then(|()| content(&mut writer)).expect("a Vec takes every write");
    let mut text = String::from_utf8(writer.into_inner()).expect("only UTF-8 was written");
    text.push('\n');
    text
}

/// An element with content.
pub(crate) fn element(
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
pub(crate) fn empty(writer: &mut XmlWriter, name: &'static str, attributes: Attributes) -> io::Result<()> {
    let attributes = attributes.into_iter().map(|(name, value)| (name, Cow::Owned(value)));
    writer.create_element(name).with_attributes(attributes).write_empty()?;
    Ok(())
}

/// The shortest decimal that reads back as the same double.
pub(crate) fn float(value: f64) -> String {
    format!("{value:?}")
}

/// Factor and offset of a unit or a transformation, where they are not the schemas' defaults 1 and 0.
pub(crate) fn conversion(factor: f64, offset: f64) -> Attributes {
    let mut attributes = Vec::new();
    if factor.to_bits() != 1.0_f64.to_bits() {
        attributes.push(("factor", float(factor)));
    }
    if offset != 0.0 {
        attributes.push(("offset", float(offset)));
    }
    attributes
}
