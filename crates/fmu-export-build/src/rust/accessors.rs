//! Access by value reference: a getter and a setter for each type, and the clocks.

use std::fmt::Write as _;

use fmu_terms::{DataType, Initial, Variability};

use super::generator::{Generator, enumeration_path, full_path};
use crate::model::{Place, Scalar};
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
            let (getters, setters) = self.arms(name);
            // Types of FMI 3.0 only have defaults in the trait.
            if getters.is_empty() && matches!(name, "float32" | "whole" | "binary") {
                return String::new();
            }
            // Importers get many Reals at once, for which a call each would cost a third more. Without `black_box`, the addresses
            // of all variables would be computed before the loop.
            let copies = if name == "real" {
                // Event indicators are computed, not copied.
                let others = [(Place::Time, "time"), (Place::EventIndicators, "0.0")];
                let others = others.iter().flat_map(|&(place, value)| {
                    let references =
                        self.in_place(place).map(|variable| self.first(variable).value_reference);
                    references.map(move |reference| format!("                {reference} => {value},\n"))
                });
                let others = others.collect::<String>();
                format!(
                    "
    fn copy_reals(&self, time: f64, references: &[fmi::ValueReference], values: &mut [f64]) -> bool {{
        let mut are_finite = true;
        for (value, &reference) in values.iter_mut().zip(references) {{
            let variables = ::core::hint::black_box(self);
            let number = match reference {{
{others}{}                _ => f64::NAN,
            }};
            if number.is_finite() {{
                *value = number;
            }} else {{
                are_finite = false;
            }}
        }}
        are_finite
    }}
",
                    getters.replace("            ", "                ").replace("self.", "variables.")
                )
            } else {
                String::new()
            };
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

    /// A type's getter and setter arms.
    fn arms(&self, accessor: &str) -> (String, String) {
        let (mut getters, mut setters) = (String::new(), String::new());
        let is_of_type = |scalar: &Scalar| {
            !matches!(scalar.place, Place::Time | Place::EventIndicators)
                && accessor_of(scalar.data_type) == Some(accessor)
        };
        for variable in &self.variables {
            let scalar = self.first(variable);
            if !is_of_type(scalar) {
                continue;
            }
            let ((pattern, from), (_, to)) = (self.pattern(variable, false), self.pattern(variable, true));
            let place = scalar.place.field_name();
            let from = format!("{place}.{from}");
            let to = match scalar.place {
                Place::States => Some(format!("start.{to}")),
                Place::Parameters | Place::Inputs => Some(format!("{place}.{to}")),
                _ if scalar.variability == Variability::Constant => None,
                _ if scalar.initial == Some(Initial::Exact) => Some(format!("{place}.{to}")),
                _ => None,
            };
            let if_let = |pattern: &str, to: &str| {
                format!(
                    "{{\n                if let {pattern} {{\n                    self.{to};\n                }}\n            }}"
                )
            };
            let (get, set): (_, &dyn Fn(String) -> String) = match (accessor, scalar.data_type) {
                (_, ValueType::Enumeration(enumeration)) => {
                    let name = enumeration_path(&self.model.declaration.enumerations[enumeration]);
                    let item = format!("Some(item) = {name}::from_value(value)");
                    (format!("self.{from} as i32"), &move |to| if_let(&item, &format!("{to} = item")))
                }
                ("whole", _) => (format!("self.{from}.into()"), &|to| {
                    if_let("Ok(value) = value.try_into()", &format!("{to} = value"))
                }),
                ("string" | "binary", _) => {
                    (format!("&self.{from}"), &|to| format!("value.clone_into(&mut self.{to}),"))
                }
                _ => (format!("self.{from}"), &|to| format!("self.{to} = value,")),
            };
            let _ = writeln!(getters, "            {pattern} => {get},");
            if let Some(to) = to {
                let _ = writeln!(setters, "            {pattern} => {}", set(to));
            }
        }
        (getters, setters)
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
