//! The tables for the runtime, which describe each value reference.

use std::fmt::Write as _;

use super::generator::{Generator, bound, numbered};
use crate::data_type::DataType;
use crate::declaration::Declaration;
use crate::model::Place;

impl Generator<'_, '_> {
    /// The clocks, and the variables that belong to them, if any.
    pub(super) fn clock_tables(&self) -> String {
        let reference = |&position: &usize| self.value_reference(position);
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

    /// The states' nominal values.
    pub(super) fn nominals(&self) -> String {
        let nominals = self.states().map(|state| format!("{:?}", state.nominal.unwrap_or(1.0)));
        nominals.collect::<Vec<_>>().join(", ")
    }

    /// The state bounds beyond which the equations are invalid, if any.
    pub(super) fn strict_states(&self) -> String {
        let strict = self.states().enumerate().filter(|(_, state)| state.strict != [false; 2]);
        let strict = strict.map(|(number, state)| {
            let min = bound(state.min.filter(|_| state.strict[0]), "f64::NEG_INFINITY");
            let max = bound(state.max.filter(|_| state.strict[1]), "f64::INFINITY");
            format!("({number}, {min}, {max})")
        });
        let strict = strict.collect::<Vec<_>>().join(", ");
        if strict.is_empty() {
            return strict;
        }
        format!("    const STRICT_STATES: &'static [(usize, f64, f64)] = &[{strict}];\n")
    }

    /// The event indicators' names, if any.
    pub(super) fn event_indicators(&self) -> String {
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

    /// The declared dependencies of Real outputs and derivatives.
    pub(super) fn dependencies(&self) -> String {
        let reference = |&position: &usize| self.value_reference(position);
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

    /// Their value references, unless these are 0, 1, 2, …, and those of arrays.
    pub(super) fn value_references(&self) -> String {
        let positions = self.by_value_reference().into_iter();
        let references: Vec<_> = positions.map(|position| self.value_reference(position)).collect();
        let arrays = self.arrays_of_fmi3();
        if (0..).zip(&references).all(|(position, reference)| position == *reference) {
            return arrays;
        }
        format!("    const VALUE_REFERENCES: &'static [fmi::ValueReference] = &{references:?};\n{arrays}")
    }

    /// The arrays that are one variable each, if any.
    fn arrays_of_fmi3(&self) -> String {
        let reference = |&position: &usize| self.value_reference(position);
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

    /// The tables for the runtime.
    pub(super) fn description(&self, guid: &str) -> String {
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
                "        fmi::VariableDescription {{ name: {:?}, data_type: fmi::DataType::{}, causality: fmi::Causality::{:?}, \
                 variability: fmi::Variability::{:?}, initial: fmi::Initial::{}, min: {min}, max: {max}, real_input: {:?}, state: {:?} }},",
                scalar.name,
                scalar.data_type.name(),
                scalar.causality,
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
}
