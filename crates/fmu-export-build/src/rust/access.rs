//! Access by value reference.

use std::fmt::Write as _;

use super::generator::{Generator, enumeration_path, full_path};
use super::tables::repeated;
use crate::data_type::DataType;
use crate::declaration::{Initial, Variability};
use crate::model::{Place, Scalar};

impl Generator<'_, '_> {
    pub(super) fn inputs_impl(&self) -> String {
        let (mut getters, mut setters) = (String::new(), String::new());
        for (first, variable) in self.real_inputs() {
            let path = &self.first(variable).path;
            if variable.is_array() {
                let (end, [flat, flat_mut]) = (
                    first + variable.positions.len(),
                    [false, true].map(|is_mutable| self.flat(variable, is_mutable)),
                );
                let _ = writeln!(getters, "            {first}..{end} => self.{flat}[position - {first}],");
                let _ = writeln!(
                    setters,
                    "        self.{flat_mut}.iter_mut().enumerate().for_each(|(index, input)| *input = value({first} + index));"
                );
            } else {
                let _ = writeln!(getters, "            {first} => self.{path},");
                let _ = writeln!(setters, "        self.{path} = value({first});");
            }
        }
        let bounds = repeated(
            "::fmu_export::RealInput",
            self.real_inputs().map(|(_, variable)| {
                let (min, max) = self.bounds(self.first(variable));
                (variable, format!("::fmu_export::RealInput {{ min: {min}, max: {max} }}"))
            }),
        );
        format!(
            "
impl ::fmu_export::Inputs for Inputs {{
    const REALS: &'static [::fmu_export::RealInput] = {bounds};

    fn real(&self, position: usize) -> f64 {{
        match position {{
{getters}            _ => 0.0,
        }}
    }}

    fn set_reals(&mut self, value: impl Fn(usize) -> f64) {{
        let _ = &value;
{setters}    }}
}}
"
        )
    }

    pub(super) fn variables_impl(&self) -> String {
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
        format!(
            "
impl ::fmu_export::Variables for Variables {{
    type Inputs = Inputs;
    const DESCRIPTION: &'static fmi::ModelDescription = &DESCRIPTION;
    const MODEL_DESCRIPTION_XML: &'static str = include_str!(\"modelDescription.xml\");
    const STATE_NOMINALS: &'static [f64] = {nominals};
{strict_states}{event_indicators}{dependencies}{clock_tables}
    fn inputs(&self) -> &Inputs {{
        &self.inputs
    }}

    fn inputs_mut(&mut self) -> &mut Inputs {{
        &mut self.inputs
    }}

    fn has_parameters_of(&self, other: &Self) -> bool {{
        self.parameters == other.parameters
    }}
{numbers}{accessors}{clocks}{marks}
    fn states_from_start(&mut self) {{
        self.states.clone_from(&self.start);
    }}

    fn swap_states_and_start(&mut self) {{
        ::core::mem::swap(&mut self.states, &mut self.start);
    }}

    fn zero() -> Self {{
        let Self {{ parameters, {calculated}inputs, states, locals, outputs, .. }} = Self::default();
        Self {{
            parameters: {zero_parameters},
{zero_calculated}            inputs: {zero_inputs},
            start: {zero_states},
            states: {zero_states},
            derivatives: {zero_states},
            locals: {zero_locals},
            outputs: {zero_outputs},
{zero_clocks}        }}
    }}

    fn along_derivatives(&self) -> Self {{
        Self {{ start: self.derivatives.clone(), ..Self::zero() }}
    }}

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
}}
",
            nominals = self.nominals(),
            strict_states = self.strict_states(),
            event_indicators = self.event_indicators(),
            dependencies = self.dependencies(),
            numbers = self.numbers(),
            accessors = self.all_accessors(),
            marks = self.marks("mark_calculated", is_evaluated) + &self.calculated_parameters(),
            sums = sums.map(|sum| format!("            0.0{sum},\n")).concat(),
            calculated = self.calculated_field(),
            zero_parameters = self.zero(Place::Parameters),
            zero_calculated = if self.has(Place::CalculatedParameters) {
                format!("            calculated_parameters: {},\n", self.zero(Place::CalculatedParameters))
            } else {
                String::new()
            },
            zero_inputs = self.zero(Place::Inputs),
            zero_states = self.zero(Place::States),
            zero_locals = self.zero(Place::Locals),
            zero_outputs = self.zero(Place::Outputs),
            zero_clocks =
                if self.has(Place::Clocks) { "            clocks: Clocks::default(),\n" } else { "" },
            clock_tables = self.clock_tables(),
            clocks = self.clocks(),
        )
    }

    /// The clocks by position.
    fn clocks(&self) -> String {
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

    /// The variables over other number types, and their states.
    fn numbers(&self) -> String {
        // Without Reals the variables are the same over all number types.
        let [of, evaluation, other, number, combined, collected] = if self.has_reals() {
            let [combined, collected] =
                ["self", "numbers"].map(|numbers| format!("{numbers}.combine(other, &mut number)"));
            ["Variables<T>", "Evaluation<'a, T>", "other", "mut number", &combined, &collected]
                .map(str::to_owned)
        } else {
            ["Self", "Evaluation<'a>", "_other", "_number", "self.clone()", "numbers.clone()"]
                .map(str::to_owned)
        };
        let of = format!(
            "
    type Of<T: ::fmu_export::Number> = {of};
    type Evaluation<'a, T: ::fmu_export::Number + 'a> = {evaluation};

    fn combined<T: ::fmu_export::Number>(&self, {other}: &Self, {number}: impl FnMut(f64, f64) -> T) -> {of} {{
        {combined}
    }}

    fn collected<T: ::fmu_export::Number>(numbers: &{of}, {other}: &Self, {number}: impl FnMut(T, f64) -> f64) -> Self {{
        {collected}
    }}
"
        );
        let has_states = self.is_real(Place::States);
        let each = |name: &str, place: &str| {
            if !has_states {
                return format!(
                    "
    fn {name}<T: ::fmu_export::Number>(_variables: &Self::Of<T>, _function: impl FnMut(usize, T)) {{}}
"
                );
            }
            format!(
                "
    fn {name}<T: ::fmu_export::Number>(variables: &Self::Of<T>, mut function: impl FnMut(usize, T)) {{
        let mut state = 0;
        variables.{place}.for_each(&mut |value| {{
            function(state, value);
            state += 1;
        }});
    }}
"
            )
        };
        let set = if has_states {
            "
    fn set_states<T: ::fmu_export::Number>(variables: &mut Self::Of<T>, state: impl Fn(usize) -> T) {
        let mut position = 0;
        variables.states.for_each_mut(&mut |value| {
            *value = state(position);
            position += 1;
        });
    }
"
        } else {
            "
    fn set_states<T: ::fmu_export::Number>(_variables: &mut Self::Of<T>, _state: impl Fn(usize) -> T) {}
"
        };
        let calculated = self.calculated_field();
        let evaluation = format!(
            "
    fn evaluation<'a, T: ::fmu_export::Number + 'a>(variables: &'a mut Self::Of<T>) -> Self::Evaluation<'a, T> {{
        let Variables {{ parameters, {calculated}inputs, states, derivatives, locals, outputs, .. }} = variables;
        Evaluation {{ parameters, {calculated}inputs, states, derivatives, locals, outputs }}
    }}
"
        );
        [&of, &evaluation, &each("each_state", "states"), &each("each_derivative", "derivatives"), set]
            .concat()
    }

    /// The calculated parameters in a pattern, if there are any.
    fn calculated_field(&self) -> &'static str {
        if self.has(Place::CalculatedParameters) { "calculated_parameters, " } else { "" }
    }

    /// The types of what calculates parameters, and access to both, if there are calculated ones.
    fn calculated_parameters(&self) -> String {
        let type_of = |place: Place| {
            let generic = if self.is_real(place) { "<T>" } else { "" };
            format!("{}{generic}", place.type_name())
        };
        let parameters =
            format!("    type Parameters<T: ::fmu_export::Number> = {};\n", type_of(Place::Parameters));
        let place = Place::CalculatedParameters;
        if !self.has(place) {
            return format!("\n{parameters}    type CalculatedParameters<T: ::fmu_export::Number> = ();\n");
        }
        format!(
            "
{parameters}    type CalculatedParameters<T: ::fmu_export::Number> = {};
    const HAS_CALCULATED_PARAMETERS: bool = true;

    fn calculate_parameters<T: ::fmu_export::Number>(
        variables: &mut Self::Of<T>,
        calculate: impl FnOnce(&Self::Parameters<T>, &mut Self::CalculatedParameters<T>),
    ) {{
        calculate(&variables.parameters, &mut variables.calculated_parameters);
    }}
{}",
            type_of(place),
            self.marks("mark_calculated_parameters", |scalar| scalar.place == Place::CalculatedParameters),
        )
    }

    /// A place's variables without changes, from its default, named after the place.
    fn zero(&self, place: Place) -> String {
        let name = place.field_name();
        if self.is_real(place) { format!("{name}.map(|_| 0.0)") } else { name.to_owned() }
    }

    /// The getters and setters of all types.
    fn all_accessors(&self) -> String {
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
            let (getters, setters) = self.accessors(name);
            // Types of FMI 3.0 only have defaults in the trait.
            if getters.is_empty() && matches!(name, "float32" | "whole" | "binary") {
                return String::new();
            }
            format!(
                "
    fn {name}(&self, reference: fmi::ValueReference) -> {value_type} {{
        match reference {{
{getters}            _ => {default},
        }}
    }}

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

    /// A function by which some calculated variables take one of two values, if there are any.
    fn marks(&self, function: &str, is_marked: fn(&Scalar) -> bool) -> String {
        let mut marks = String::new();
        for variable in self.variables.iter().filter(|variable| is_marked(self.first(variable))) {
            let scalar = self.first(variable);
            let value = match scalar.data_type {
                DataType::Enumeration(enumeration) => {
                    let last = self.model.declaration.enumerations[enumeration].items.len() - 1;
                    let [first, last] = [0, last].map(|item| self.item(enumeration, item));
                    format!("if mark {{ {last} }} else {{ {first} }}")
                }
                DataType::String => "u8::from(mark).to_string()".to_owned(),
                DataType::Binary => "vec![mark.into()]".to_owned(),
                _ => "mark.into()".to_owned(),
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

    /// A type's getter and setter arms.
    fn accessors(&self, accessor: &str) -> (String, String) {
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
                (_, DataType::Enumeration(enumeration)) => {
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
}

/// The functions that exchange a type's values; none for clocks.
fn accessor_of(data_type: DataType) -> Option<&'static str> {
    match data_type {
        DataType::Real => Some("real"),
        DataType::Integer | DataType::Enumeration(_) => Some("integer"),
        DataType::Boolean => Some("boolean"),
        DataType::String => Some("string"),
        DataType::Float32 => Some("float32"),
        DataType::Binary => Some("binary"),
        DataType::Clock => None,
        _ => Some("whole"),
    }
}

/// Whether every evaluation computes a variable: not just events, nor just once.
fn is_evaluated(scalar: &Scalar) -> bool {
    matches!(scalar.place, Place::Derivatives | Place::Locals | Place::Outputs)
        && matches!(scalar.variability, Variability::Continuous | Variability::Discrete)
        && scalar.initial == Some(Initial::Calculated)
}
