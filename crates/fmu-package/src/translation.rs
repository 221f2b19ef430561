//! An FMU under other names and units.

use std::collections::BTreeMap;

use fmu_terms::Linear;

use crate::model_description::FmuDescription;

/// The description of an FMU with other names and units, and the conversion of its values.
#[derive(Clone, Debug)]
pub struct Translation {
    /// The description in these names and units.
    pub description: FmuDescription,
    /// The conversions from the FMU's values, by name; values of other variables are not converted.
    pub conversions: BTreeMap<String, Linear>,
}
