//! Static tables of a model's variables, generated from the model's JSON together with the modelDescription.xml (FMI
//! 2.0.5, section 2.2).

use core::fmt::{self, Write as _};
use core::ops::Deref;

use fmu_solve::display::Shown;

pub use fmu_abi::ValueReference;
pub use fmu_terms::{Causality, DataType, Initial, Interfaces, IntervalVariability, Variability, Version};

/// A model as its modelDescription.xml describes it.
#[derive(Debug)]
pub struct ModelDescription {
    /// `modelName` and `modelIdentifier`.
    pub model_identifier: &'static str,
    /// The hash of the XML's content that the importer passes to `fmi2Instantiate`.
    pub guid: &'static str,
    /// All variables and arrays, ordered by value reference.
    pub variables: &'static [VariableDescription],
    /// The declared log categories.
    pub log_categories: &'static [&'static str],
    /// Whether a call that causes a warning returns the status fmi2Warning; otherwise only the message has it.
    pub warns_by_status: bool,
    /// The version of the standard.
    pub version: Version,
    /// The interfaces that the FMU offers.
    pub interfaces: Interfaces,
    /// The optional functions that this model supports.
    pub capabilities: Capabilities,
}

/// Optional functions of FMI 2.0 co-simulation (section 4.3.1) that depend on the model.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::struct_excessive_bools, reason = "they are the standard's flags")]
pub struct Capabilities {
    /// `canInterpolateInputs`: fmi2SetRealInputDerivatives.
    pub interpolate_inputs: bool,
    /// `canGetAndSetFMUstate`.
    pub get_and_set_state: bool,
    /// `canSerializeFMUstate`.
    pub serialize_state: bool,
    /// `providesDirectionalDerivative`, and a `maxOutputDerivativeOrder` of 1.
    pub directional_derivatives: bool,
    /// `providesAdjointDerivatives` of FMI 3.0.
    pub adjoint_derivatives: bool,
    /// `hasEventMode` of FMI 3.0.
    pub event_mode: bool,
    /// `mightReturnEarlyFromDoStep` of FMI 3.0.
    pub early_return: bool,
    /// `providesPerElementDependencies` of FMI 3.0.
    pub per_element_dependencies: bool,
}

/// The attributes of a variable (FMI 2.0.5, section 2.2.7), or of all elements of an array, whose differences follow a
/// rule.
#[derive(Debug)]
pub struct VariableDescription {
    /// The structured name; for an array, without subscripts.
    pub base_name: &'static str,
    /// The value reference; for an array, that of its first element.
    pub value_reference: ValueReference,
    /// An array's sizes; empty if it is a scalar.
    pub dimensions: &'static [usize],
    /// The number of elements; 1 of a scalar.
    pub elements: u32,
    /// The difference between the value references of two consecutive elements, row by row.
    pub stride: ValueReference,
    /// The data type.
    pub data_type: DataType,
    /// The variable's role.
    pub causality: Causality,
    /// When the value may change.
    pub variability: Variability,
    /// How the initial value is defined; inputs and the independent variable have none.
    pub initial: Option<Initial>,
    /// The smallest accepted value.
    pub min: f64,
    /// The largest accepted value.
    pub max: f64,
    /// An enumeration's items, the only accepted values, with their names; empty for other types.
    pub items: &'static [(i32, &'static str)],
    /// The position of a Real input among the Real inputs; for an array, that of its first element.
    pub first_real_input: Option<usize>,
    /// The position of a continuous-time state among the states; for an array, that of its first element.
    pub first_state: Option<usize>,
    /// The variable's roles in the equations of initialization.
    pub in_initialization: Roles,
    /// The variable's roles in the equations of steps and events.
    pub in_steps: Roles,
}

/// The role of a variable in equations (FMI 2.0.5, section 2.2.8). Dependencies in `ModelStructure` name knowns; its
/// entries are unknowns, as are outputs and locals that it need not list. A state that is an output is both.
#[derive(Clone, Copy, Debug)]
pub struct Roles {
    /// Whether the variable is given.
    pub known: bool,
    /// Whether the variable is computed.
    pub unknown: bool,
}

impl VariableDescription {
    /// Whether a value, as a number, is one of the items, or within the range.
    pub(crate) fn accepts(&self, value: f64) -> bool {
        if self.items.is_empty() {
            (self.min..=self.max).contains(&value)
        } else {
            self.items.iter().any(|(item, _)| f64::from(*item).total_cmp(&value).is_eq())
        }
    }

    /// All elements with their value references.
    pub(crate) fn scalars(&'static self) -> impl Iterator<Item = (ValueReference, ScalarVariable)> + Clone {
        let numbered = (0..).zip(0..self.elements as usize);
        numbered.map(move |(number, element)| {
            (self.value_reference + number * self.stride, ScalarVariable { description: self, element })
        })
    }
}

/// A scalar variable: an element of an array, or a variable that is not an array.
#[derive(Clone, Copy, Debug)]
pub struct ScalarVariable {
    pub(crate) description: &'static VariableDescription,
    /// The number of the element, from 0.
    pub(crate) element: usize,
}

impl ScalarVariable {
    /// The structured name, such as `gain[1,2]`.
    #[must_use]
    pub fn name(self) -> Name {
        Name(self)
    }

    /// A Real input's position among the Real inputs.
    #[must_use]
    #[inline]
    pub fn real_input(self) -> Option<usize> {
        self.description.first_real_input.map(|first| first + self.element)
    }

    /// A continuous-time state's position among the states.
    #[must_use]
    #[inline]
    pub fn state(self) -> Option<usize> {
        self.description.first_state.map(|first| first + self.element)
    }
}

/// Why a variable does not accept a number.
pub(crate) struct Refused {
    pub(crate) variable: ScalarVariable,
    pub(crate) value: f64,
}

impl fmt::Display for Refused {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { variable, value } = self;
        let (name, shown) = (variable.name(), Shown(*value));
        if !value.is_finite() {
            return write!(formatter, "{shown} for the variable {name}");
        }
        if let [(first, first_name), others @ ..] = variable.items {
            write!(
                formatter,
                "{shown} for the variable {name} is not one of its items {first} ({first_name})"
            )?;
            return others.iter().try_for_each(|(item, name)| write!(formatter, ", {item} ({name})"));
        }
        let [min, max] = [variable.min, variable.max].map(Shown);
        write!(formatter, "{shown} for the variable {name} is outside its range {min} to {max}")
    }
}

/// What all elements of an array have in common.
impl Deref for ScalarVariable {
    type Target = VariableDescription;

    #[inline]
    fn deref(&self) -> &VariableDescription {
        self.description
    }
}

/// A scalar variable's name: `gain[1,2]`, or `der(x[3])` of an element of the array `der(x)`.
#[derive(Clone, Copy)]
pub struct Name(ScalarVariable);

impl fmt::Display for Name {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ScalarVariable { description, element } = self.0;
        let VariableDescription { base_name, dimensions, .. } = description;
        if dimensions.is_empty() {
            return formatter.pad(base_name);
        }
        let (array, rest) = base_name.strip_suffix(')').map_or((*base_name, ""), |array| (array, ")"));
        formatter.write_str(array)?;
        let mut inner = description.elements as usize;
        for (position, size) in dimensions.iter().enumerate() {
            // No size is 0. Firmware must not panic, and the compiler cannot know that.
            inner = inner.checked_div(*size).unwrap_or(1);
            let index = element.checked_div(inner).and_then(|index| index.checked_rem(*size)).unwrap_or(0);
            let separator = if position == 0 { '[' } else { ',' };
            write!(formatter, "{separator}{}", index + 1)?;
        }
        write!(formatter, "]{rest}")
    }
}

impl fmt::Debug for Name {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "\"{self}\"")
    }
}

impl PartialEq<str> for Name {
    fn eq(&self, other: &str) -> bool {
        let mut expected = Expected(other);
        write!(expected, "{self}").is_ok() && expected.0.is_empty()
    }
}

#[cfg(not(target_os = "none"))]
impl PartialEq<String> for Name {
    fn eq(&self, other: &String) -> bool {
        *self == **other
    }
}

/// What is left of a text that is expected to be written.
struct Expected<'a>(&'a str);

impl fmt::Write for Expected<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0 = self.0.strip_prefix(text).ok_or(fmt::Error)?;
        Ok(())
    }
}

impl PartialEq<&str> for Name {
    fn eq(&self, other: &&str) -> bool {
        *self == **other
    }
}

/// Scalar unknowns with the same pattern of dependencies: the knowns of each are those of the first, advanced with it.
/// In an array whose elements read their neighbors, all but the first and last elements are one entry.
#[derive(Clone, Copy, Debug)]
pub struct Dependencies {
    /// The first unknown.
    pub unknown: ValueReference,
    /// The number of unknowns.
    pub count: u32,
    /// The difference between the value references of two consecutive unknowns.
    pub stride: ValueReference,
    /// The first unknown's knowns.
    pub knowns: &'static [Knowns],
}

/// Known variables, such as neighboring elements of an array.
#[derive(Clone, Copy, Debug)]
pub struct Knowns {
    /// The first known of the first unknown.
    pub first: ValueReference,
    /// The number of knowns.
    pub count: u32,
    /// The difference between the value references of two consecutive knowns.
    pub step: ValueReference,
    /// The difference between the first knowns of two consecutive unknowns.
    pub stride: ValueReference,
}

impl Dependencies {
    /// Each unknown with its knowns.
    pub(crate) fn each(
        &self,
    ) -> impl Iterator<Item = (ValueReference, impl Iterator<Item = ValueReference>)> {
        let Self { unknown, count, stride, knowns } = *self;
        (0..count).map(move |number| {
            let knowns = knowns.iter().flat_map(move |knowns| {
                let first = knowns.first + number * knowns.stride;
                (0..knowns.count).map(move |known| first + known * knowns.step)
            });
            (unknown + number * stride, knowns)
        })
    }
}

/// A clock's attributes (FMI 3.0.2, section 2.4.4).
#[derive(Clone, Copy, Debug)]
#[allow(clippy::struct_excessive_bools, reason = "they are the standard's attributes")]
pub struct ClockDescription {
    /// The value reference.
    pub value_reference: ValueReference,
    /// Whether the importer activates the clock; otherwise the model does.
    pub is_input: bool,
    /// When the clock ticks.
    pub interval_variability: IntervalVariability,
    /// Whether the clock's interval is declared; if so, importers may set the interval of a fixed or tunable clock.
    pub has_interval: bool,
    /// Whether the clock's interval may be exchanged as a fraction.
    pub supports_fraction: bool,
    /// Whether the importer may revoke a tick.
    pub can_be_deactivated: bool,
}
