//! The runtime's part of the typed interface: access by value reference, and the tables that describe each value
//! reference.

use std::fmt::Write as _;

use super::{Generator, numbered};
use crate::declaration::{Declaration, Initial, Variability};
use crate::model::{DataType, Place, Scalar};
use crate::xml;

impl Generator<'_, '_> {
    pub(crate) fn inputs_impl(&self) -> String {
        let (mut bounds, mut getters, mut setters) = (String::new(), String::new(), String::new());
        for (place, position) in self.real_inputs().enumerate() {
            let scalar = &self.model.scalars[position];
            let (min, max) = self.bounds(scalar);
            let path = &scalar.path;
            let _ = writeln!(bounds, "        ::fmu_export::RealInput {{ min: {min}, max: {max} }},");
            let _ = writeln!(getters, "            {place} => self.{path},");
            let _ = writeln!(setters, "        self.{path} = value({place});");
        }
        format!(
            "
impl ::fmu_export::Inputs for Inputs {{
    const REALS: &'static [::fmu_export::RealInput] = &[
{bounds}    ];

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

    pub(crate) fn variables_impl(&self) -> String {
        // States fail first; derivatives and outputs follow from them.
        let (mut sums, mut reals, mut count) = ([const { String::new() }; 4], String::new(), 0);
        for place in [Place::States, Place::Derivatives, Place::Outputs] {
            for position in self.model.in_place(place) {
                let scalar = &self.model.scalars[position];
                if scalar.data_type == DataType::Real {
                    let (path, reference) = (full_path(scalar), scalar.value_reference);
                    let _ = write!(sums[count % 4], " + self.{path}.abs()");
                    count += 1;
                    let _ = writeln!(reals, "                ({reference}, variables.{path}),");
                }
            }
        }
        format!(
            "
impl ::fmu_export::Variables for Variables {{
    type Inputs = Inputs;
    const DESCRIPTION: &'static fmi::ModelDescription = &DESCRIPTION;
    const MODEL_DESCRIPTION_XML: &'static str = include_str!(\"modelDescription.xml\");
    const STATE_NAMES: &'static [&'static str] = &States::NAMES;
    const STATE_NOMINALS: &'static [f64] = &[{nominals}];
{strict_states}{event_indicators}{value_references}{dependencies}{clock_tables}
    fn inputs(&self) -> &Inputs {{
        &self.inputs
    }}

    fn inputs_mut(&mut self) -> &mut Inputs {{
        &mut self.inputs
    }}
{numbers}{accessors}{clocks}{marks}
    fn states_from_start(&mut self) {{
        self.states = self.start;
    }}

    fn zero() -> Self {{
        let Self {{ parameters, inputs, states, locals, outputs, .. }} = Self::default();
        Self {{
            parameters: {zero_parameters},
            inputs: {zero_inputs},
            start: {zero_states},
            states: {zero_states},
            derivatives: {zero_states},
            locals: {zero_locals},
            outputs: {zero_outputs},
{zero_clocks}        }}
    }}

    fn along_derivatives(&self) -> Self {{
        Self {{ start: self.derivatives, ..Self::zero() }}
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
            let reals: &[(_, f64)] = &[
{reals}            ];
            reals.iter().find(|(_, value)| !value.is_finite()).map(|&(reference, _)| reference)
        }}
        find(self)
    }}
}}
",
            nominals = self.nominals(),
            strict_states = self.strict_states(),
            event_indicators = self.event_indicators(),
            value_references = self.value_references(),
            dependencies = self.dependencies(),
            numbers = self.numbers(),
            accessors = self.all_accessors(),
            marks = self.marks(),
            sums = sums.map(|sum| format!("            0.0{sum},\n")).concat(),
            zero_parameters = self.zero(Place::Parameters),
            zero_inputs = self.zero(Place::Inputs),
            zero_states = self.zero(Place::States),
            zero_locals = self.zero(Place::Locals),
            zero_outputs = self.zero(Place::Outputs),
            zero_clocks = if self.has_clocks() { "            clocks: Clocks::default(),\n" } else { "" },
            clock_tables = self.clock_tables(),
            clocks = self.clocks(),
        )
    }

    /// The positions of the clocks: inputs first, by priority, then the others.
    fn clocks_by_priority(&self) -> Vec<usize> {
        let mut clocks: Vec<_> = self.model.in_place(Place::Clocks).collect();
        clocks.sort_by_key(|&clock| {
            let priority = self.model.field(clock).declaration.priority.unwrap_or(u32::MAX);
            (!self.model.scalars[clock].is_input_clock(), priority)
        });
        clocks
    }

    /// The clocks, and the variables that belong to them, if any.
    fn clock_tables(&self) -> String {
        let reference = |&position: &usize| self.model.scalars[position].value_reference;
        let (mut clocks, mut clocked) = (String::new(), String::new());
        for position in self.clocks_by_priority() {
            let declaration = self.model.field(position).declaration;
            let _ = writeln!(
                clocks,
                "        fmi::ClockDescription {{ value_reference: {}, is_input: {}, interval_variability: \
                 fmi::IntervalVariability::{:?}, has_interval: {}, supports_fraction: {}, can_be_deactivated: {} }},",
                reference(&position),
                self.model.scalars[position].is_input_clock(),
                declaration.ticks(),
                declaration.timing().is_some(),
                declaration.has_fractions(),
                declaration.can_be_deactivated,
            );
        }
        for position in self.by_value_reference() {
            let of: Vec<_> = self.model.scalars[position].clocks.iter().map(reference).collect();
            if !of.is_empty() {
                let _ = writeln!(clocked, "        ({}, &{of:?}),", reference(&position));
            }
        }
        if clocks.is_empty() {
            return clocks;
        }
        format!(
            "    const CLOCKS: &'static [fmi::ClockDescription] = &[
{clocks}    ];
    const CLOCKED: &'static [(fmi::ValueReference, &'static [fmi::ValueReference])] = &[
{clocked}    ];
"
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

    /// The states' nominal values, in the order of their arrays.
    fn nominals(&self) -> String {
        let fields = self.model.parts.iter().flat_map(|part| Place::States.fields(part));
        let positions = fields.flat_map(|field| field.positions.iter().copied());
        let nominals =
            positions.map(|position| format!("{:?}", self.model.scalars[position].nominal.unwrap_or(1.0)));
        nominals.collect::<Vec<_>>().join(", ")
    }

    /// The state bounds beyond which the equations are invalid, if any.
    fn strict_states(&self) -> String {
        let fields = self.model.parts.iter().flat_map(|part| Place::States.fields(part));
        let positions = fields.flat_map(|field| field.positions.iter().copied());
        let bound = |is_strict: bool, bound: Option<f64>, none: &str| {
            bound.filter(|_| is_strict).map_or_else(|| none.to_owned(), |bound| format!("{bound:?}"))
        };
        let strict: Vec<_> = positions
            .enumerate()
            .map(|(state, position)| (state, &self.model.scalars[position]))
            .filter(|(_, scalar)| scalar.strict != [false; 2])
            .map(|(state, scalar)| {
                let min = bound(scalar.strict[0], scalar.min, "f64::NEG_INFINITY");
                let max = bound(scalar.strict[1], scalar.max, "f64::INFINITY");
                format!("({state}, {min}, {max})")
            })
            .collect();
        if strict.is_empty() {
            return String::new();
        }
        format!("    const STRICT_STATES: &'static [(usize, f64, f64)] = &[{}];\n", strict.join(", "))
    }

    /// The event indicators' names, if any.
    fn event_indicators(&self) -> String {
        let Declaration { event_indicators: names, limits, .. } = self.model.declaration;
        if names.is_empty() {
            return String::new();
        }
        let mut text = format!("    const EVENT_INDICATORS: &'static [&'static str] = &{names:?};\n");
        if !limits.is_empty() {
            let limits: Vec<_> = (0..names.len()).filter(|&number| limits.contains(&names[number])).collect();
            let _ = writeln!(text, "    const LIMITS: &'static [usize] = &{limits:?};");
        }
        if let Some(first) = self.model.in_place(Place::EventIndicators).next() {
            let first = self.model.scalars[first].value_reference;
            let _ = writeln!(text, "    const FIRST_EVENT_INDICATOR: fmi::ValueReference = {first};");
        }
        text
    }

    /// The arrays that are one variable each, if any.
    fn arrays_of_fmi3(&self) -> String {
        let reference = |&position: &usize| self.model.scalars[position].value_reference;
        let arrays = self.model.arrays();
        if arrays.is_empty() {
            return String::new();
        }
        let arrays: Vec<Vec<_>> = arrays.iter().map(|array| array.iter().map(reference).collect()).collect();
        let mut inner: Vec<_> = arrays.iter().flat_map(|array| &array[1..]).collect();
        inner.sort_unstable();
        let arrays: Vec<_> = arrays.iter().map(|array| format!("&{array:?}")).collect();
        format!(
            "    const ARRAYS: &'static [&'static [fmi::ValueReference]] = &[{}];
    const INNER_ELEMENTS: &'static [fmi::ValueReference] = &{inner:?};\n",
            arrays.join(", ")
        )
    }

    /// The declared dependencies of Real outputs and derivatives.
    fn dependencies(&self) -> String {
        let reference = |&position: &usize| self.model.scalars[position].value_reference;
        let is_real = |position: usize| self.model.scalars[position].data_type == DataType::Real;
        let structure = self.structure.outputs.iter().chain(&self.structure.derivatives);
        let (mut lines, mut depends_on_time) = (String::new(), false);
        for unknown in structure.filter(|unknown| is_real(unknown.scalar)) {
            if let Some(knowns) = &unknown.dependencies {
                depends_on_time |= knowns.iter().any(|&known| self.model.scalars[known].place == Place::Time);
                let knowns: Vec<_> = knowns.iter().map(reference).collect();
                let _ = writeln!(lines, "        ({}, &{knowns:?}),", reference(&unknown.scalar));
            } else {
                depends_on_time = true;
            }
        }
        if !lines.is_empty() {
            lines = format!(
                "    const DEPENDENCIES: &'static [(fmi::ValueReference, &'static [fmi::ValueReference])] = &[\n{lines}    ];\n"
            );
        }
        if depends_on_time && self.model.declaration.capabilities.directional_derivatives {
            lines.push_str("    const DEPENDS_ON_TIME: bool = true;\n");
        }
        lines
    }

    /// The variables over other number types, and their states.
    fn numbers(&self) -> String {
        let of = if self.has_reals() {
            "
    type Of<T: ::fmu_export::Number> = Variables<T>;
    type Evaluation<'a, T: ::fmu_export::Number + 'a> = Evaluation<'a, T>;

    fn combined<T: ::fmu_export::Number>(&self, other: &Self, mut number: impl FnMut(f64, f64) -> T) -> Variables<T> {
        self.combine(other, &mut number)
    }

    fn collected<T: ::fmu_export::Number>(numbers: &Variables<T>, other: &Self, mut number: impl FnMut(T, f64) -> f64) -> Self {
        numbers.combine(other, &mut number)
    }
"
        } else {
            "
    type Of<T: ::fmu_export::Number> = Self;
    type Evaluation<'a, T: ::fmu_export::Number + 'a> = Evaluation<'a>;

    fn combined<T: ::fmu_export::Number>(&self, _other: &Self, _number: impl FnMut(f64, f64) -> T) -> Self {
        self.clone()
    }

    fn collected<T: ::fmu_export::Number>(numbers: &Self, _other: &Self, _number: impl FnMut(T, f64) -> f64) -> Self {
        numbers.clone()
    }
"
        };
        let has_states = self.is_real(Place::States);
        let each = |name: &str, place: &str| {
            let (function, body) = if has_states {
                let each = format!(
                    "variables.{place}.to_array().into_iter().enumerate().for_each(|(state, value)| function(state, value));"
                );
                ("mut function", each)
            } else {
                ("_function", String::new())
            };
            let variables = if has_states { "variables" } else { "_variables" };
            format!(
                "
    fn {name}<T: ::fmu_export::Number>({variables}: &Self::Of<T>, {function}: impl FnMut(usize, T)) {{
        {body}
    }}
"
            )
        };
        let set = if has_states {
            "
    fn set_states<T: ::fmu_export::Number>(variables: &mut Self::Of<T>, state: impl Fn(usize) -> T) {
        variables.states = States::from_array(::core::array::from_fn(state));
    }
"
        } else {
            "
    fn set_states<T: ::fmu_export::Number>(_variables: &mut Self::Of<T>, _state: impl Fn(usize) -> T) {}
"
        };
        let evaluation = "
    fn evaluation<'a, T: ::fmu_export::Number + 'a>(variables: &'a mut Self::Of<T>) -> Self::Evaluation<'a, T> {
        let Variables { parameters, inputs, states, derivatives, locals, outputs, .. } = variables;
        Evaluation { parameters, inputs, states, derivatives, locals, outputs }
    }
";
        [of, evaluation, &each("each_state", "states"), &each("each_derivative", "derivatives"), set].concat()
    }

    /// A place's variables without changes, from its default, named after the place.
    fn zero(&self, place: Place) -> String {
        let name = place.type_name().to_lowercase();
        if self.is_real(place) { format!("{name}.map(|_| 0.0)") } else { name }
    }

    /// The getters and setters of all types.
    fn all_accessors(&self) -> String {
        let accessors: Vec<_> = [
            ("real", "f64", "f64", "0.0"),
            ("integer", "i32", "i32", "0"),
            ("boolean", "bool", "bool", "false"),
            ("string", "&str", "&str", "\"\""),
            ("float32", "f32", "f32", "0.0"),
            ("whole", "i128", "i128", "0"),
            ("binary", "&[u8]", "&[u8]", "&[]"),
        ]
        .into_iter()
        .map(|(name, value_type, argument_type, default)| {
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

    fn set_{name}(&mut self, reference: fmi::ValueReference, value: {argument_type}) {{
        let _ = value;
        match reference {{
{setters}            _ => {{}}
        }}
    }}
"
            )
        })
        .collect();
        accessors.concat()
    }

    /// How calculated variables take one of two values, if there are any.
    fn marks(&self) -> String {
        let mut marks = String::new();
        for scalar in self.model.scalars.iter().filter(|scalar| is_evaluated(scalar)) {
            let path = full_path(scalar);
            let _ = match scalar.data_type {
                DataType::Enumeration(enumeration) => {
                    let last = self.model.declaration.enumerations[enumeration].items.len() - 1;
                    let [first, last] = [0, last].map(|item| self.item(enumeration, item));
                    writeln!(marks, "        self.{path} = if mark {{ {last} }} else {{ {first} }};")
                }
                DataType::String => writeln!(marks, "        self.{path} = u8::from(mark).to_string();"),
                DataType::Binary => writeln!(marks, "        self.{path} = vec![mark.into()];"),
                _ => writeln!(marks, "        self.{path} = mark.into();"),
            };
        }
        if marks.is_empty() {
            return marks;
        }
        format!(
            "
    fn mark_calculated(&mut self, mark: bool) {{
{marks}    }}
"
        )
    }

    /// A type's getter and setter arms.
    fn accessors(&self, accessor: &str) -> (String, String) {
        let (mut getters, mut setters) = (String::new(), String::new());
        let is_held = |scalar: &&Scalar| !matches!(scalar.place, Place::Time | Place::EventIndicators);
        for scalar in self.model.scalars.iter().filter(is_held) {
            let of_type = match scalar.data_type {
                DataType::Real => "real",
                DataType::Integer | DataType::Enumeration(_) => "integer",
                DataType::Boolean => "boolean",
                DataType::String => "string",
                DataType::Float32 => "float32",
                DataType::Whole(_) => "whole",
                DataType::Binary => "binary",
                DataType::Clock => continue,
            };
            if of_type != accessor {
                continue;
            }
            let reference = scalar.value_reference;
            let from = full_path(scalar);
            let to = match scalar.place {
                Place::States => Some(format!("start.{}", scalar.path)),
                Place::Parameters | Place::Inputs => Some(from.clone()),
                _ if scalar.variability == Variability::Constant => None,
                _ if scalar.initial == Some(Initial::Exact) => Some(from.clone()),
                _ => None,
            };
            let (get, set) = match scalar.data_type {
                DataType::Enumeration(enumeration) => {
                    let name = super::enumeration_path(&self.model.declaration.enumerations[enumeration]);
                    let item = format!("if let Some(item) = {name}::from_value(value)");
                    let set = to.map(|to| format!("{{\n                {item} {{\n                    self.{to} = item;\n                }}\n            }}"));
                    (format!("self.{from} as i32"), set)
                }
                DataType::Whole(_) => {
                    let set = to.map(|to| format!("{{\n                if let Ok(value) = value.try_into() {{\n                    self.{to} = value;\n                }}\n            }}"));
                    (format!("self.{from}.into()"), set)
                }
                DataType::String | DataType::Binary => {
                    (format!("&self.{from}"), to.map(|to| format!("value.clone_into(&mut self.{to}),")))
                }
                _ => (format!("self.{from}"), to.map(|to| format!("self.{to} = value,"))),
            };
            let _ = writeln!(getters, "            {reference} => {get},");
            if let Some(set) = set {
                let _ = writeln!(setters, "            {reference} => {set}");
            }
        }
        (getters, setters)
    }

    /// The tables for the runtime.
    pub(crate) fn description(&self, guid: &str) -> String {
        let model = self.model;
        let categories: Vec<_> =
            model.log_categories.iter().map(|category| format!("{:?}", category.name)).collect();
        let mut variables = String::new();
        let real_inputs = numbered(&self.real_inputs().collect::<Vec<_>>());
        let states = numbered(&model.in_place(Place::States).collect::<Vec<_>>());
        for position in self.by_value_reference() {
            let scalar = &model.scalars[position];
            let (min, max) = self.bounds(scalar);
            let _ = writeln!(
                variables,
                "        fmi::VariableDescription {{ name: {:?}, data_type: fmi::DataType::{}, causality: fmi::Causality::{}, \
                 variability: fmi::Variability::{:?}, initial: fmi::Initial::{}, min: {min}, max: {max}, real_input: {:?}, state: {:?} }},",
                scalar.name,
                match scalar.data_type {
                    DataType::Real => "Real",
                    DataType::Integer => "Integer",
                    DataType::Boolean => "Boolean",
                    DataType::String => "String",
                    DataType::Enumeration(_) => "Enumeration",
                    DataType::Float32 => "Float32",
                    DataType::Whole(whole) => whole.name(),
                    DataType::Binary => "Binary",
                    DataType::Clock => "Clock",
                },
                super::pascal_case(xml::causality(scalar.causality)),
                scalar.variability,
                scalar.initial.map_or("None".to_owned(), |initial| format!("{initial:?}")),
                real_inputs.get(&position),
                states.get(&position),
            );
        }
        let capabilities = &model.declaration.capabilities;
        format!(
            "
static DESCRIPTION: fmi::ModelDescription = fmi::ModelDescription {{
    model_identifier: {:?},
    guid: {guid:?},
    variables: &[
{variables}    ],
    log_categories: &[{categories}],
    version: fmi::Version::{:?},
    interfaces: fmi::Interfaces {{ co_simulation: {}, model_exchange: {}, scheduled_execution: {} }},
    has_resources: {},
    capabilities: fmi::Capabilities {{
        interpolate_inputs: {},
        get_and_set_state: {},
        serialize_state: {},
        directional_derivatives: {},
        adjoint_derivatives: {},
        event_mode: {},
    }},
}};
",
            model.identifier,
            model.fmi.version,
            model.fmi.interfaces.co_simulation(),
            model.fmi.interfaces.model_exchange(),
            model.fmi.interfaces.scheduled_execution(),
            model.declaration.resources.is_some(),
            capabilities.interpolate_inputs,
            capabilities.get_and_set_state,
            capabilities.serializes_state(),
            capabilities.directional_derivatives,
            capabilities.adjoint_derivatives,
            capabilities.event_mode,
            categories = categories.join(", "),
        )
    }

    /// The variables' positions, ordered by value reference.
    fn by_value_reference(&self) -> Vec<usize> {
        let mut positions: Vec<_> = (0..self.model.scalars.len()).collect();
        positions.sort_by_key(|&position| self.model.scalars[position].value_reference);
        positions
    }

    /// Their value references, unless these are 0, 1, 2, …, and those of arrays.
    fn value_references(&self) -> String {
        let scalars = self.by_value_reference().into_iter().map(|position| &self.model.scalars[position]);
        let references: Vec<_> = scalars.map(|scalar| scalar.value_reference).collect();
        if (0..).zip(&references).all(|(position, reference)| position == *reference) {
            return self.arrays_of_fmi3();
        }
        let arrays = self.arrays_of_fmi3();
        format!("    const VALUE_REFERENCES: &'static [fmi::ValueReference] = &{references:?};\n{arrays}")
    }

    fn real_inputs(&self) -> impl Iterator<Item = usize> {
        self.model
            .in_place(Place::Inputs)
            .filter(|&position| self.model.scalars[position].data_type == DataType::Real)
    }

    /// A variable's bounds, as Rust text.
    fn bounds(&self, scalar: &Scalar) -> (String, String) {
        let text = |bound: Option<f64>, open: &str| match bound {
            Some(bound) => format!("{bound:?}"),
            None => open.to_owned(),
        };
        match scalar.data_type {
            DataType::Enumeration(enumeration) => {
                let items = self.model.declaration.enumerations[enumeration].items.len();
                ("1.0".to_owned(), format!("{items}.0"))
            }
            _ => (text(scalar.min, "f64::NEG_INFINITY"), text(scalar.max, "f64::INFINITY")),
        }
    }
}

/// Whether every evaluation computes a variable: not just events, nor just once.
fn is_evaluated(scalar: &Scalar) -> bool {
    matches!(scalar.place, Place::Derivatives | Place::Locals | Place::Outputs)
        && matches!(scalar.variability, Variability::Continuous | Variability::Discrete)
        && scalar.initial == Some(Initial::Calculated)
}

/// A variable's path in `Variables`.
fn full_path(scalar: &Scalar) -> String {
    let place = match scalar.place {
        Place::Parameters => "parameters",
        Place::Inputs => "inputs",
        Place::States => "states",
        Place::Derivatives => "derivatives",
        Place::Outputs => "outputs",
        Place::Clocks => "clocks",
        Place::Locals | Place::Time | Place::EventIndicators => "locals",
    };
    format!("{place}.{}", scalar.path)
}
