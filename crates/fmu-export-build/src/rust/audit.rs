//! The checks of what a model calculates: whether it is finite, and whether all of it was set.

use std::fmt;
use std::fmt::Write as _;

use fmu_terms::{DataType, Initial, Variability};

use super::generator::{Generator, full_path};
use crate::model::{Place, Scalar};
use crate::value_type::ValueType;

impl Generator<'_, '_> {
    /// The search for a result that is not finite.
    pub(super) fn first_non_finite(&self) -> String {
        // States fail first; derivatives and outputs follow from them.
        let (mut sums, mut reals) = (Sums::default(), String::new());
        let of_place = |place| self.in_place(place).map(|variable| (variable, self.first(variable)));
        let results = [Place::States, Place::Derivatives, Place::Outputs].into_iter().flat_map(of_place);
        for (variable, scalar) in results.filter(|(_, scalar)| scalar.data_type == DataType::Real) {
            let (place, reference, stride) =
                (scalar.place.field_name(), scalar.value_reference, self.stride(variable));
            let numbers = if variable.is_array() {
                let numbers = format!("{place}.{}[..]", self.flat(variable, false));
                sums.add_all(&numbers);
                format!("&variables.{numbers}")
            } else {
                let path = full_path(scalar);
                sums.add(&path);
                format!("::core::slice::from_ref(&variables.{path})")
            };
            let _ = writeln!(reals, "                ({reference}, {stride}, {numbers}),");
        }
        format!(
            "
    fn first_non_finite(&self) -> ::core::option::Option<fmi::ValueReference> {{
        // Fast if their sum is finite.
{sums}        if ((sums[0] + sums[1]) + (sums[2] + sums[3])).is_finite() {{
            return ::core::option::Option::None;
        }}
        #[cold]
        fn find(variables: &Variables) -> ::core::option::Option<fmi::ValueReference> {{
            let reals: &[(fmi::ValueReference, fmi::ValueReference, &[Real])] = &[
{reals}            ];
            reals.iter().find_map(|(first, stride, values)| {{
                let element = values.iter().position(|value| !value.is_finite())?;
                ::core::option::Option::Some(first + stride * element as fmi::ValueReference)
            }})
        }}
        find(self)
    }}
"
        )
    }

    /// Makes what an evaluation calculates continuously NaN, and tells whether it still is.
    pub(super) fn forgetting(&self) -> String {
        let (mut forget, mut sums) = (String::new(), Sums::default());
        for variable in &self.variables {
            let scalar = self.first(variable);
            let number = match scalar.data_type.data_type() {
                DataType::Real => "Real",
                DataType::Float32 => "f32",
                _ => continue,
            };
            if !is_evaluated(scalar) || scalar.variability != Variability::Continuous {
                continue;
            }
            let place = scalar.place.field_name();
            if variable.is_array() {
                let _ = writeln!(
                    forget,
                    "        self.{place}.{}.fill({number}::NAN);",
                    self.flat(variable, true)
                );
                sums.add_all(&format!("{place}.{}[..]", self.flat(variable, false)));
            } else {
                let path = full_path(scalar);
                let _ = writeln!(forget, "        self.{path} = {number}::NAN;");
                sums.add(&path);
            }
        }
        if forget.is_empty() {
            return forget;
        }
        format!(
            "
    fn forget_continuous(&mut self) {{
{forget}    }}

    fn has_finite_results(&self) -> bool {{
{sums}        ((sums[0] + sums[1]) + (sums[2] + sums[3])).is_finite()
    }}
"
        )
    }

    /// A function by which some calculated variables take one of two values, if there are any.
    pub(super) fn marks(&self, function: &str, is_marked: fn(&Scalar) -> bool) -> String {
        let mut marks = String::new();
        for variable in self.variables.iter().filter(|variable| is_marked(self.first(variable))) {
            let scalar = self.first(variable);
            let value = match scalar.data_type {
                ValueType::Enumeration(enumeration) => {
                    let last = self.model.declaration.enumerations[enumeration].items.len() - 1;
                    let [first, last] = [0, last].map(|item| self.item(enumeration, item));
                    format!("if mark {{ {last} }} else {{ {first} }}")
                }
                ValueType::Standard(DataType::String) => "u8::from(mark).to_string()".to_owned(),
                ValueType::Standard(DataType::Binary) => "vec![mark.into()]".to_owned(),
                ValueType::Standard(_) => "mark.into()".to_owned(),
            };
            let _ = if variable.is_array() {
                let (place, flat) = (scalar.place.field_name(), self.flat(variable, true));
                writeln!(marks, "        self.{place}.{flat}.fill({value});")
            } else {
                writeln!(marks, "        self.{} = {value};", full_path(scalar))
            };
        }
        if marks.is_empty() {
            return marks;
        }
        format!(
            "
    fn {function}(&mut self, mark: bool) {{
{marks}    }}
"
        )
    }
}

/// The sum of magnitudes, in four parts that do not wait for each other.
#[derive(Default)]
struct Sums {
    parts: [String; 4],
    count: usize,
}

impl Sums {
    /// Adds the magnitude of the number at a path in the variables.
    fn add(&mut self, path: &str) {
        self.add_term(&format!("f64::from(self.{path}.abs())"));
    }

    /// Adds the magnitudes of the numbers in a slice.
    fn add_all(&mut self, slice: &str) {
        self.add_term(&format!("::fmu_export::typed::sum_of_magnitudes(&self.{slice})"));
    }

    fn add_term(&mut self, term: &str) {
        let _ = write!(self.parts[self.count % 4], " + {term}");
        self.count += 1;
    }
}

/// Writes the sums as the variable `sums`.
impl fmt::Display for Sums {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("        let sums: [f64; 4] = [\n")?;
        for part in &self.parts {
            writeln!(formatter, "            0.0{part},")?;
        }
        formatter.write_str("        ];\n")
    }
}

/// Whether every evaluation computes a variable: not just events, nor just once.
pub(super) fn is_evaluated(scalar: &Scalar) -> bool {
    matches!(scalar.place, Place::Derivatives | Place::Locals | Place::Outputs)
        && matches!(scalar.variability, Variability::Continuous | Variability::Discrete)
        && scalar.initial == Some(Initial::Calculated)
}
