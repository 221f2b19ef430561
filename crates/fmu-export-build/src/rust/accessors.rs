//! Access by value reference: a getter and a setter for each type, and the clocks.

use fmu_terms::{DataType, Initial, Variability};

use super::generator::{Generator, enumeration_path, full_path};
use crate::model::Place;
use crate::value_type::ValueType;

impl Generator<'_, '_> {
    /// The getters and setters of all types.
    pub(super) fn accessors(&self) -> String {
        let accessors = [
            ("real", "f64", "0.0"),
            ("integer", "i32", "0"),
            ("boolean", "bool", "false"),
            ("string", "&str", "\"\""),
            ("float32", "f32", "0.0"),
            ("whole", "i128", "0"),
            ("binary", "&[u8]", "&[]"),
        ];
        let accessors = accessors.map(|(name, value_type, default)| {
            let accesses = self.accesses(name);
            // Types of FMI 3.0 only have defaults in the trait.
            if accesses.is_empty() && matches!(name, "float32" | "whole" | "binary") {
                return String::new();
            }
            let getters: String = accesses.iter().map(|access| access.getter("self", 12)).collect();
            let setters: String = accesses.iter().filter_map(Access::setter).collect();
            let copies = if name == "real" { self.copies(&accesses) } else { String::new() };
            format!(
                "
    fn {name}(&self, reference: fmi::ValueReference) -> {value_type} {{
        match reference {{
{getters}            _ => {default},
        }}
    }}
{copies}
    fn set_{name}(&mut self, reference: fmi::ValueReference, value: {value_type}) {{
        let _ = value;
        match reference {{
{setters}            _ => {{}}
        }}
    }}
"
            )
        });
        accessors.concat()
    }

    /// The getter of many Reals at once, which importers use and for which a call each would cost a third more. Without
    /// `black_box`, the addresses of all variables would be computed before the loop.
    fn copies(&self, reals: &[Access]) -> String {
        // Event indicators are computed, not copied.
        let others = [(Place::Time, "time"), (Place::EventIndicators, "0.0")];
        let others = others.iter().flat_map(|&(place, value)| {
            let references = self.in_place(place).map(|variable| self.first(variable).value_reference);
            references.map(move |reference| format!("                {reference} => {value},\n"))
        });
        let others = others.collect::<String>();
        let getters: String = reals.iter().map(|access| access.getter("variables", 16)).collect();
        format!(
            "
    fn copy_reals(&self, time: f64, references: &[fmi::ValueReference], values: &mut [f64]) -> bool {{
        let mut are_finite = true;
        for (value, &reference) in values.iter_mut().zip(references) {{
            let variables = ::core::hint::black_box(self);
            let number = match reference {{
{others}{getters}                _ => f64::NAN,
            }};
            if number.is_finite() {{
                *value = number;
            }} else {{
                are_finite = false;
            }}
        }}
        are_finite
    }}
"
        )
    }

    /// How the variables of an accessor's types are got and set.
    fn accesses(&self, accessor: &str) -> Vec<Access> {
        let of_type = self.variables.iter().filter(|variable| {
            let scalar = self.first(variable);
            !matches!(scalar.place, Place::Time | Place::EventIndicators)
                && accessor_of(scalar.data_type) == Some(accessor)
        });
        of_type
            .map(|variable| {
                let scalar = self.first(variable);
                let ((pattern, from), (_, to)) =
                    (self.pattern(variable, false), self.pattern(variable, true));
                let place = scalar.place.field_name();
                let is_set = match scalar.place {
                    Place::States | Place::Parameters | Place::Inputs => true,
                    _ => {
                        scalar.variability != Variability::Constant && scalar.initial == Some(Initial::Exact)
                    }
                };
                // The start value of a state is set.
                let target = if scalar.place == Place::States { "start" } else { place };
                let conversion = match (accessor, scalar.data_type) {
                    (_, ValueType::Enumeration(enumeration)) => Conversion::Enumeration(enumeration_path(
                        &self.model.declaration.enumerations[enumeration],
                    )),
                    ("whole", _) => Conversion::Whole,
                    ("string" | "binary", _) => Conversion::Owned,
                    ("real", _) => Conversion::Real,
                    _ => Conversion::None,
                };
                Access {
                    pattern,
                    from: format!("{place}.{from}"),
                    to: is_set.then(|| format!("{target}.{to}")),
                    conversion,
                }
            })
            .collect()
    }

    /// The clocks by position.
    pub(super) fn clocks(&self) -> String {
        let clocks = self.clocks_by_priority();
        if clocks.is_empty() {
            return String::new();
        }
        let arms = |to: &str| {
            let arm = |(place, &clock): (usize, &usize)| {
                let path = full_path(&self.model.scalars[clock]);
                format!("            {place} => ::core::option::Option::Some({to}self.{path}),\n")
            };
            clocks.iter().enumerate().map(arm).collect::<String>()
        };
        format!(
            "
    fn clock(&self, position: usize) -> ::core::option::Option<&::fmu_export::Clock> {{
        match position {{
{}            _ => ::core::option::Option::None,
        }}
    }}

    fn clock_mut(&mut self, position: usize) -> ::core::option::Option<&mut ::fmu_export::Clock> {{
        match position {{
{}            _ => ::core::option::Option::None,
        }}
    }}
",
            arms("&"),
            arms("&mut "),
        )
    }
}

/// How a variable is got and set.
struct Access {
    /// The value references.
    pattern: String,
    /// The field in the variables.
    from: String,
    /// The field that is set, if the variable may be.
    to: Option<String>,
    conversion: Conversion,
}

/// What lies between a field and the value that is exchanged.
enum Conversion {
    None,
    /// Reals, of the precision in which the model computes.
    Real,
    /// Items of the enumeration with a path.
    Enumeration(String),
    /// Integers of another size.
    Whole,
    /// Strings and bytes, which are lent.
    Owned,
}

impl Access {
    /// The getter's arm, indented: from variables of a name.
    fn getter(&self, variables: &str, indent: usize) -> String {
        let Self { pattern, from, conversion, .. } = self;
        let (before, after) = match conversion {
            Conversion::None => ("", ""),
            Conversion::Real => ("f64::from(", ")"),
            Conversion::Enumeration(_) => ("", " as i32"),
            Conversion::Whole => ("", ".into()"),
            Conversion::Owned => ("&", ""),
        };
        format!("{:indent$}{pattern} => {before}{variables}.{from}{after},\n", "")
    }

    /// The setter's arm.
    fn setter(&self) -> Option<String> {
        let Self { pattern, conversion, .. } = self;
        let to = self.to.as_ref()?;
        let set_if = |found: &str, value: &str| {
            format!(
                "{{\n                if let {found} {{\n                    self.{to} = {value};\n                }}\n            }}"
            )
        };
        let set = match conversion {
            Conversion::None => format!("self.{to} = value,"),
            Conversion::Real => format!("self.{to} = value as Real,"),
            Conversion::Enumeration(path) => {
                set_if(&format!("Some(item) = {path}::from_value(value)"), "item")
            }
            Conversion::Whole => set_if("Ok(value) = value.try_into()", "value"),
            Conversion::Owned => format!("value.clone_into(&mut self.{to}),"),
        };
        Some(format!("            {pattern} => {set}\n"))
    }
}

/// The functions that exchange a type's values; none for clocks.
fn accessor_of(data_type: ValueType) -> Option<&'static str> {
    match data_type.data_type() {
        DataType::Real => Some("real"),
        DataType::Integer | DataType::Enumeration => Some("integer"),
        DataType::Boolean => Some("boolean"),
        DataType::String => Some("string"),
        DataType::Float32 => Some("float32"),
        DataType::Binary => Some("binary"),
        DataType::Clock => None,
        _ => Some("whole"),
    }
}
