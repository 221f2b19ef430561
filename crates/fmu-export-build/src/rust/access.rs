//! The part of the typed interface that the runtime sees: access by value reference, and the tables that
//! say what each value reference is.

use std::fmt::Write as _;

use super::super::resolve::{DataType, Role, Variable};
use super::{ALLOW, Generator, Group};

impl Generator<'_, '_> {
    pub(crate) fn inputs_impl(&self) -> String {
        let (mut bounds, mut getters, mut setters) = (String::new(), String::new(), String::new());
        for (place, position) in self.real_inputs().enumerate() {
            let variable = &self.model.variables[position];
            let (min, max) = self.bounds(variable);
            let path = &variable.path;
            let _ = writeln!(bounds, "        ::fmu_export::RealInput {{ min: {min}, max: {max} }},");
            let _ = writeln!(getters, "            {place} => self.{path},");
            let _ = writeln!(setters, "        self.{path} = value({place});");
        }
        format!(
            "
{ALLOW}impl ::fmu_export::Inputs for Inputs {{
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
        let accessors: Vec<_> = [
            ("real", "f64", "f64", "0.0"),
            ("integer", "i32", "i32", "0"),
            ("boolean", "bool", "bool", "false"),
            ("string", "&str", "&str", "\"\""),
        ]
        .into_iter()
        .map(|(name, value_type, argument_type, default)| {
            let (getters, setters) = self.accessors(name);
            format!(
                "
    fn {name}(&self, reference: ::fmu_export::description::ValueReference) -> {value_type} {{
        match reference {{
{getters}            _ => {default},
        }}
    }}

    fn set_{name}(&mut self, reference: ::fmu_export::description::ValueReference, value: {argument_type}) {{
        let _ = value;
        match reference {{
{setters}            _ => {{}}
        }}
    }}
"
            )
        })
        .collect();
        // What goes wrong first is a state; derivatives and outputs follow from it.
        let (mut sums, mut reals) = ([const { String::new() }; 4], String::new());
        for role in [Role::State, Role::Derivative, Role::Output] {
            for position in self.model.of_role(role) {
                let variable = &self.model.variables[position];
                if variable.data_type == DataType::Real {
                    let place = place(variable);
                    let _ = write!(sums[reals.lines().count() % 4], " + self.{place}.abs()");
                    let _ = writeln!(reals, "                ({position}, variables.{place}),");
                }
            }
        }
        format!(
            "
{ALLOW}impl ::fmu_export::Variables for Variables {{
    type Inputs = Inputs;
    const DESCRIPTION: &'static ::fmu_export::description::ModelDescription = &DESCRIPTION;
    const MODEL_DESCRIPTION_XML: &'static str = include_str!(\"modelDescription.xml\");

    fn inputs(&self) -> &Inputs {{
        &self.inputs
    }}
{accessors}
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
        }}
    }}

    fn along_derivatives(&self) -> Self {{
        Self {{ start: self.derivatives, ..Self::zero() }}
    }}

    fn first_non_finite(&self) -> Option<::fmu_export::description::ValueReference> {{
        // Quickly, where their sum is finite; in four parts, which do not wait for each other.
        let sums: [f64; 4] = [
{sums}        ];
        if ((sums[0] + sums[1]) + (sums[2] + sums[3])).is_finite() {{
            return None;
        }}
        #[cold]
        fn find(variables: &Variables) -> Option<::fmu_export::description::ValueReference> {{
            let reals: &[(_, f64)] = &[
{reals}            ];
            reals.iter().find(|(_, value)| !value.is_finite()).map(|&(reference, _)| reference)
        }}
        find(self)
    }}
}}
",
            accessors = accessors.concat(),
            sums = sums.map(|sum| format!("            0.0{sum},\n")).concat(),
            zero_parameters = self.zero(Group::Parameters),
            zero_inputs = self.zero(Group::Inputs),
            zero_states = self.zero(Group::States),
            zero_locals = self.zero(Group::Locals),
            zero_outputs = self.zero(Group::Outputs),
        )
    }

    /// The variables of a group without changes, from its default, which bears the group's name.
    fn zero(&self, group: Group) -> String {
        let name = group.type_name().to_lowercase();
        if self.model.parts.iter().any(|part| group.is_real_in(part)) {
            format!("{name}.map(|_| 0.0)")
        } else {
            name
        }
    }

    /// The arms of the getter and the setter of a type.
    fn accessors(&self, accessor: &str) -> (String, String) {
        let (mut getters, mut setters) = (String::new(), String::new());
        for (position, variable) in self.model.variables.iter().enumerate().skip(1) {
            let of_type = match variable.data_type {
                DataType::Real => "real",
                DataType::Integer | DataType::Enumeration(_) => "integer",
                DataType::Boolean => "boolean",
                DataType::String => "string",
            };
            if of_type != accessor {
                continue;
            }
            let from = place(variable);
            let to = match variable.role {
                Role::State => Some(format!("start.{}", variable.path)),
                Role::Parameter | Role::Input => Some(from.clone()),
                _ => None,
            };
            let (get, set) = match variable.data_type {
                DataType::Enumeration(enumeration) => {
                    let name = &self.model.model.enumerations[enumeration].name;
                    let item = format!("if let Some(item) = {name}::from_value(value)");
                    let set = to.map(|to| format!("{{\n                {item} {{\n                    self.{to} = item;\n                }}\n            }}"));
                    (format!("self.{from} as i32"), set)
                }
                DataType::String => {
                    (format!("&self.{from}"), to.map(|to| format!("value.clone_into(&mut self.{to}),")))
                }
                _ => (format!("self.{from}"), to.map(|to| format!("self.{to} = value,"))),
            };
            let _ = writeln!(getters, "            {position} => {get},");
            if let Some(set) = set {
                let _ = writeln!(setters, "            {position} => {set}");
            }
        }
        (getters, setters)
    }

    /// The tables for the runtime.
    pub(crate) fn description(&self, guid: &str) -> String {
        let model = self.model.model;
        let categories: Vec<_> =
            model.log_categories.iter().map(|category| format!("        {:?},\n", category.name)).collect();
        let mut variables = String::new();
        let mut real_inputs = self.real_inputs().zip(0..).peekable();
        for (position, variable) in self.model.variables.iter().enumerate() {
            let place: Option<(usize, i32)> = real_inputs.next_if(|&(input, _)| input == position);
            let (min, max) = self.bounds(variable);
            let _ = writeln!(
                variables,
                "        VariableDescription {{
            name: {:?},
            data_type: DataType::{},
            causality: Causality::{},
            variability: Variability::{:?},
            initial: Initial::{},
            min: {min},
            max: {max},
            real_input: {:?},
        }},",
                variable.name,
                match variable.data_type {
                    DataType::Real => "Real",
                    DataType::Integer => "Integer",
                    DataType::Boolean => "Boolean",
                    DataType::String => "String",
                    DataType::Enumeration(_) => "Enumeration",
                },
                variable
                    .role
                    .causality()
                    .map_or("Independent".to_owned(), |causality| format!("{causality:?}")),
                variable.variability,
                variable.initial.map_or("None".to_owned(), |initial| format!("{initial:?}")),
                place.map(|(_, place)| place),
            );
        }
        format!(
            "
{ALLOW}static DESCRIPTION: ::fmu_export::description::ModelDescription = {{
    use ::fmu_export::description::{{
        Capabilities, Causality, DataType, Initial, ModelDescription, VariableDescription, Variability,
    }};
    static VARIABLES: [VariableDescription; {}] = [
{variables}    ];
    static LOG_CATEGORIES: [&str; {}] = [
{categories}    ];
    ModelDescription {{
        model_identifier: {:?},
        guid: {guid:?},
        variables: &VARIABLES,
        log_categories: &LOG_CATEGORIES,
        capabilities: Capabilities {{
            interpolate_inputs: {},
            get_and_set_state: {},
            serialize_state: {},
            directional_derivatives: {},
        }},
    }}
}};
",
            self.model.variables.len(),
            model.log_categories.len(),
            model.model_identifier,
            model.capabilities.interpolate_inputs,
            model.capabilities.get_and_set_state,
            model.capabilities.serialize_state,
            model.capabilities.directional_derivatives,
            categories = categories.concat(),
        )
    }

    fn real_inputs(&self) -> impl Iterator<Item = usize> {
        self.model
            .of_role(Role::Input)
            .filter(|&position| self.model.variables[position].data_type == DataType::Real)
    }

    /// The bounds of a variable, as Rust's text.
    fn bounds(&self, variable: &Variable) -> (String, String) {
        let text = |bound: Option<f64>, open: &str| match bound {
            Some(bound) => format!("{bound:?}"),
            None => open.to_owned(),
        };
        match variable.data_type {
            DataType::Enumeration(enumeration) => {
                let items = self.model.model.enumerations[enumeration].items.len();
                ("1.0".to_owned(), format!("{items}.0"))
            }
            _ => (text(variable.min, "f64::NEG_INFINITY"), text(variable.max, "f64::INFINITY")),
        }
    }
}

/// Where a variable is in `Variables`.
fn place(variable: &Variable) -> String {
    let group = match variable.role {
        Role::Parameter => "parameters",
        Role::Input => "inputs",
        Role::State => "states",
        Role::Derivative => "derivatives",
        Role::Output => "outputs",
        Role::CalculatedParameter | Role::Local | Role::Independent => "locals",
    };
    format!("{group}.{}", variable.path)
}
