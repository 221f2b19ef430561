//! The checks of what a model calculates: whether it is finite, and whether all of it was set.

use std::fmt::Write as _;

use fmu_terms::{DataType, Initial, Variability};

use super::generator::{Generator, full_path};
use crate::model::{Place, Scalar};
use crate::value_type::ValueType;

impl Generator<'_, '_> {
    /// The search for a result that is not finite.
    pub(super) fn first_non_finite(&self) -> String {
        // States fail first; derivatives and outputs follow from them.
        let (mut sums, mut reals, mut count) = ([const { String::new() }; 4], String::new(), 0);
        let of_place = |place| self.in_place(place).map(|variable| (variable, self.first(variable)));
        let results = [Place::States, Place::Derivatives, Place::Outputs].into_iter().flat_map(of_place);
        for (variable, scalar) in results.filter(|(_, scalar)| scalar.data_type == DataType::Real) {
            let (place, reference, stride) =
                (scalar.place.field_name(), scalar.value_reference, self.stride(variable));
            let numbers = if variable.is_array() {
                let numbers = format!("{place}.{}[..]", self.flat(variable, false));
                let _ = write!(sums[count % 4], " + ::fmu_export::typed::sum_of_magnitudes(&self.{numbers})");
                format!("&variables.{numbers}")
            } else {
                let path = full_path(scalar);
                let _ = write!(sums[count % 4], " + self.{path}.abs()");
                format!("::core::slice::from_ref(&variables.{path})")
            };
            let _ = writeln!(reals, "                ({reference}, {stride}, {numbers}),");
            count += 1;
        }
        let sums = sums.map(|sum| format!("            0.0{sum},\n")).concat();
        format!(
            "
    fn first_non_finite(&self) -> ::core::option::Option<fmi::ValueReference> {{
        // Fast if their sum is finite; in four parts that do not wait for each other.
        let sums: [f64; 4] = [
{sums}        ];
        if ((sums[0] + sums[1]) + (sums[2] + sums[3])).is_finite() {{
            return ::core::option::Option::None;
        }}
        #[cold]
        fn find(variables: &Variables) -> ::core::option::Option<fmi::ValueReference> {{
            let reals: &[(fmi::ValueReference, fmi::ValueReference, &[f64])] = &[
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

/// Whether every evaluation computes a variable: not just events, nor just once.
pub(super) fn is_evaluated(scalar: &Scalar) -> bool {
    matches!(scalar.place, Place::Derivatives | Place::Locals | Place::Outputs)
        && matches!(scalar.variability, Variability::Continuous | Variability::Discrete)
        && scalar.initial == Some(Initial::Calculated)
}
