//! The structs that hold the variables.

use std::fmt::Write as _;

use fmu_terms::DataType;

use super::generator::{Generator, Members, described, is_copy, is_real};
use crate::declaration::OneOrEach;
use crate::model::{Field, Part, Place};
use crate::texts::comment;
use crate::value_type::ValueType;

impl Generator<'_, '_> {
    /// The struct for the variables of the model, of a component, or of all components of a type.
    pub(super) fn part_struct(&self, place: Place, part: &Part<'_>) -> String {
        let of = match part.component {
            None => "the model".to_owned(),
            Some(_) => match part.component_type() {
                Some(component_type) => format!("a `{component_type}`"),
                None => described(part.own_description(), part.own_name()),
            },
        };
        let title = format!("{} of {of}.", place.description());
        self.members_struct(place, &place.struct_name(part), &title, &self.members(place, part))
    }

    /// The struct that holds some members.
    pub(super) fn members_struct(
        &self,
        place: Place,
        name: &str,
        title: &str,
        members: &Members<'_, '_>,
    ) -> String {
        let own = members.fields.iter().map(|field| self.field(field));
        let nested = members.components.iter().map(|component| {
            let part = component.first();
            let held = self.model.held(place, part);
            let is_generic = held.iter().any(|field| is_real(field));
            let generic = if is_generic { "<T>" } else { "" };
            let data_type = format!("{}{generic}", place.struct_name(part));
            StructField {
                name: part.rust_name(),
                description: described(part.own_description(), part.own_name()),
                data_type: match component.size() {
                    Some(size) => format!("[{data_type}; {size}]"),
                    None => data_type,
                },
                kind: if is_generic { Kind::Nested { size: component.size() } } else { Kind::Other },
                is_copy: held.into_iter().all(is_copied),
            }
        });
        let mut text = structure(name, title, own.chain(nested).collect());
        if !self.without_default.contains(name) {
            text += &default(name, &self.starts(place, members));
        }
        text
    }

    fn field(&self, field: &Field<'_>) -> StructField {
        let declaration = field.declaration;
        let unit = match &declaration.unit {
            Some(OneOrEach::All(unit)) if unit != "1" => format!(" (`{unit}`)"),
            Some(OneOrEach::Each(units)) => format!(" (`{}`)", units.join("`, `")),
            _ => String::new(),
        };
        let unit = comment(&unit);
        let sizes = declaration.sizes.iter().rev();
        let array =
            sizes.fold(self.rust_type(field.data_type), |data_type, size| format!("[{data_type}; {size}]"));
        let is_boxed = field.is_boxed;
        StructField {
            name: field.name(),
            description: described(declaration.description.as_deref(), &declaration.name) + &unit,
            data_type: if is_boxed { format!("::std::boxed::Box<{array}>") } else { array },
            kind: match field.data_type {
                ValueType::Standard(DataType::Real) => {
                    Kind::Number { sizes: declaration.sizes.clone(), is_boxed }
                }
                _ => Kind::Other,
            },
            is_copy: is_copied(field),
        }
    }

    /// The struct that holds all places.
    pub(super) fn variables_struct(&self) -> String {
        let fields = [
            ("parameters", "The parameters.", Place::Parameters),
            (
                "calculated_parameters",
                "What follows from parameters only, computed by `calculate_parameters`.",
                Place::CalculatedParameters,
            ),
            (
                "inputs",
                "The inputs as set, possibly out of bounds; a model receives them within bounds.",
                Place::Inputs,
            ),
            ("start", "The states' start values, as the importer set them.", Place::States),
            ("states", "The states.", Place::States),
            ("derivatives", "The time derivatives of the states.", Place::States),
            ("locals", "The local variables other than states.", Place::Locals),
            ("outputs", "The outputs other than states.", Place::Outputs),
            ("clocks", "The clocks.", Place::Clocks),
        ];
        let fields = fields.into_iter().filter(|&(_, _, place)| self.has(place));
        let fields = fields.map(|(name, description, place)| {
            let is_generic = self.is_real(place);
            let generic = if is_generic { "<T>" } else { "" };
            StructField {
                name: name.to_owned(),
                description: description.to_owned(),
                data_type: format!("{}{generic}", place.type_name()),
                kind: if is_generic { Kind::Nested { size: None } } else { Kind::Other },
                is_copy: false,
            }
        });
        let fields: Vec<_> = fields.collect();
        let start = |field: &StructField| format!("{}: ::core::default::Default::default()", field.name);
        let starts: Vec<_> = fields.iter().map(start).collect();
        structure("Variables", "All variables of the model.", fields)
            + &default("Variables", &starts.join(",\n            "))
    }

    /// The struct that equations receive: read-only parts by shared references.
    pub(super) fn evaluation_struct(&self) -> String {
        let fields = [
            ("parameters", "The parameters.", Place::Parameters, ""),
            (
                "calculated_parameters",
                "What follows from parameters only, computed by `calculate_parameters`.",
                Place::CalculatedParameters,
                "",
            ),
            ("inputs", "The inputs, within their bounds.", Place::Inputs, ""),
            ("states", "The states.", Place::States, ""),
            ("derivatives", "The time derivatives of the states, to be calculated.", Place::States, "mut "),
            ("locals", "The local variables other than states, to be calculated.", Place::Locals, "mut "),
            ("outputs", "The outputs other than states, to be calculated.", Place::Outputs, "mut "),
        ];
        let fields = fields.into_iter().filter(|&(_, _, place, _)| self.has(place));
        let fields = fields.map(|(name, description, place, mutable)| {
            let generic = if self.is_real(place) { "<T>" } else { "" };
            format!("    /// {description}\n    pub {name}: &'a {mutable}{}{generic},\n", place.type_name())
        });
        let fields = fields.collect::<String>();
        if self.has_reals() {
            return format!("{EVALUATION}pub struct Evaluation<'a, T = f64> {{\n{fields}}}\n");
        }
        // `Evaluation` over all number types. Equations name one, as those of other models do.
        format!(
            "
/// What equations read and calculate, over any number type.
pub type Evaluation<'a, T = f64> =
    <without_reals::Evaluation<'a> as ::fmu_export::typed::OverAny<fn(T)>>::Type;

mod without_reals {{
use super::*;
{EVALUATION}pub struct Evaluation<'a> {{
{fields}}}
}}
"
        )
    }
}

/// The head of the struct of an evaluation.
const EVALUATION: &str = "
/// What equations read and calculate.
#[derive(Debug)]
";

/// Whether a field is `Copy`.
pub(super) fn is_copied(field: &Field<'_>) -> bool {
    is_copy(field.data_type) && !field.is_boxed
}

/// A field of a generated struct.
struct StructField {
    name: String,
    description: String,
    data_type: String,
    kind: Kind,
    is_copy: bool,
}

/// A field's kind in the macro `numbers!`.
enum Kind {
    /// A Real, or an array of these sizes.
    Number {
        sizes: Vec<usize>,
        is_boxed: bool,
    },
    /// A struct generic over the number type, or an array of them.
    Nested {
        size: Option<usize>,
    },
    Other,
}

/// A struct, generic over its number type if it has Reals, with the functions of its kind.
fn structure(name: &str, title: &str, fields: Vec<StructField>) -> String {
    let generic = fields.iter().any(|field| !matches!(field.kind, Kind::Other));
    let is_copy = fields.iter().all(|field| field.is_copy);
    let parameter = if generic { "<T = f64>" } else { "" };
    let (mut members, mut kinds, mut names) = (String::new(), Vec::new(), Vec::new());
    for StructField { name, description, data_type, kind, .. } in fields {
        let _ = writeln!(members, "    /// {description}\n    pub {name}: {data_type},");
        kinds.push(match kind {
            Kind::Number { sizes, is_boxed } => {
                let sizes = sizes.iter().map(|size| format!("[{size}]"));
                let kind = if is_boxed { "boxed" } else { "number" };
                format!("{kind} {name}{}", sizes.collect::<String>())
            }
            Kind::Nested { size } => {
                let size = size.map(|size| format!("[{size}]")).unwrap_or_default();
                format!("nested {name}{size}")
            }
            Kind::Other => format!("other {name}"),
        });
        names.push(name);
    }
    let mut text = format!(
        "
/// {title}
#[derive({copy}Debug, PartialEq)]
pub struct {name}{parameter} {{
{members}}}

::fmu_export::persistent!({name} {{ {} }});
",
        names.join(", "),
        copy = if is_copy { "Clone, Copy, " } else { "" },
    );
    if !is_copy {
        let parameter = if generic { "<T>" } else { "" };
        let _ = writeln!(text, "::fmu_export::cloned!({name}{parameter} {{ {} }});", names.join(", "));
    }
    if generic {
        let _ = writeln!(text, "::fmu_export::numbers!({name} {{ {} }});", kinds.join(", "));
    }
    text
}

fn default(name: &str, fields: &str) -> String {
    format!(
        "
impl ::core::default::Default for {name} {{
    fn default() -> Self {{
        Self {{
            {fields}
        }}
    }}
}}
"
    )
}
