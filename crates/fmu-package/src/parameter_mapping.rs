//! Parameter mappings: the .ssm files of System Structure and Parameterization (SSP, section 7).

use std::io;

use crate::transformation::Transformation;
use crate::xml::{self, Element, check_version, flag, named, required};

/// To which names a system gives the values of a parameter set; it ignores all others.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParameterMapping {
    /// The entries, in file order; several may have one source.
    pub entries: Vec<MappingEntry>,
}

/// A parameter's way from a set to the system.
#[derive(Clone, Debug, PartialEq)]
pub struct MappingEntry {
    /// The name in the set.
    pub source: String,
    /// The name in the system.
    pub target: String,
    /// Whether the value is converted if the units differ.
    pub converts_units: bool,
    /// What happens to the value after that.
    pub transformation: Transformation,
}

impl ParameterMapping {
    /// Reads the text of an .ssm file.
    ///
    /// # Errors
    /// When it is not XML, or not a parameter mapping of SSP; the message names the element.
    pub fn parse(xml: &str) -> io::Result<Self> {
        Self::of(xml::read(&xml::with_prefixes(xml), "ParameterMapping")?.root_element())
    }

    /// The mapping of an element.
    pub(crate) fn of(root: Element<'_>) -> io::Result<Self> {
        check_version(root, "parameter mappings")?;
        let entries = named(root, "MappingEntry").map(|entry| {
            Ok(MappingEntry {
                source: required(entry, "source")?,
                target: required(entry, "target")?,
                converts_units: !flag(entry, "suppressUnitConversion"),
                transformation: Transformation::read(entry)?,
            })
        });
        Ok(Self { entries: entries.collect::<io::Result<_>>()? })
    }
}
