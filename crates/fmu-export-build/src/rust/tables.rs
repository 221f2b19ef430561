//! The tables for the runtime, which describe each value reference.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use fmu_terms::DataType;

use super::generator::{Generator, bound};
use crate::declaration::{Declaration, Warnings};
use crate::dependencies::{Structure, Unknown, known_in_steps};
use crate::model::{Place, Scalar, Variable, without_subscripts};

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
        for variable in self.by_value_reference() {
            let scalar = self.first(variable);
            let of: Vec<_> = scalar.clocked.clocks.iter().map(reference).collect();
            if !of.is_empty() {
                let _ = writeln!(clocked, "        ({}, &{of:?}),", scalar.value_reference);
            }
        }
        if clocks.is_empty() {
            return clocks;
        }
        let has_clocks = self.model.declaration.has_clocks();
        format!(
            "    const HAS_CLOCKS: bool = {has_clocks};
    const CLOCKS: &'static [fmi::ClockDescription] = &[
{clocks}    ];
    const CLOCKED: &'static [(fmi::ValueReference, &'static [fmi::ValueReference])] = &[
{clocked}    ];
"
        )
    }

    /// The tolerance of the default experiment, if it is declared.
    pub(super) fn default_tolerance(&self) -> String {
        let experiment = self.model.declaration.default_experiment.as_ref();
        let tolerance = experiment
            .and_then(|experiment| experiment.tolerance)
            .map(|tolerance| format!("    const DEFAULT_TOLERANCE: Option<f64> = Some({tolerance:?});\n"));
        tolerance.unwrap_or_default()
    }

    /// The states' nominal values.
    pub(super) fn nominals(&self) -> String {
        let nominal =
            |state: &Variable<'_>| format!("{:?}", self.first(state).quantity.nominal.unwrap_or(1.0));
        repeated("f64", self.in_place(Place::States).map(|state| (state, nominal(state))))
    }

    /// The state bounds beyond which the equations are invalid, if any.
    pub(super) fn strict_states(&self) -> String {
        let states = self.numbered_states().map(|(first, variable)| (first, variable, self.first(variable)));
        let strict = states.filter(|(_, _, state)| state.dynamics.strict != [false; 2]).map(
            |(first, variable, state)| {
                let min = bound(state.quantity.min.filter(|_| state.dynamics.strict[0]), "f64::NEG_INFINITY");
                let max = bound(state.quantity.max.filter(|_| state.dynamics.strict[1]), "f64::INFINITY");
                format!("({first}..{}, {min}, {max})", first + variable.positions.len())
            },
        );
        let strict = strict.collect::<Vec<_>>().join(", ");
        if strict.is_empty() {
            return strict;
        }
        format!("    const STRICT_STATES: &'static [(::core::ops::Range<usize>, f64, f64)] = &[{strict}];\n")
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
        let in_steps = || self.structure.outputs.iter().chain(&self.structure.derivatives);
        let mut text = self.dependencies_of("DEPENDENCIES", in_steps());
        if self.model.has_element_dependencies() {
            text += &self.dependencies_of("INITIAL_DEPENDENCIES", self.structure.initial_unknowns.iter());
        }
        if self.depend_on_time(in_steps()) {
            text.push_str("    const DEPENDS_ON_TIME: bool = true;\n");
        }
        text
    }

    /// Whether a Real unknown depends explicitly on time, or may.
    fn depend_on_time<'u>(&self, unknowns: impl Iterator<Item = &'u Unknown>) -> bool {
        let is_time = |known: &usize| self.model.scalars[*known].place == Place::Time;
        self.reals(unknowns).any(|unknown| match &unknown.dependencies {
            Some(knowns) => knowns.iter().any(is_time),
            None => true,
        })
    }

    /// A variable's roles in the equations of initialization and in those of steps: those by which `ModelStructure` lists
    /// it.
    fn roles(&self, scalar: &Scalar) -> [String; 2] {
        let Structure { outputs, derivatives, initial_unknowns, .. } = self.structure;
        let known = |known: bool, unknowns: &[&[Unknown]]| {
            let unknowns = unknowns.iter().copied().flatten();
            known && (scalar.place != Place::Time || self.depend_on_time(unknowns))
        };
        let beside = scalar.unknown_beside_the_lists();
        let in_steps = known_in_steps(self.model.fmi.version)(scalar);
        [
            (
                known(scalar.known_in_initialization(), &[initial_unknowns]),
                scalar.unknown_in_initialization(),
            ),
            (known(in_steps, &[outputs, derivatives]), scalar.unknown_in_steps()),
        ]
        .map(|(known, unknown)| format!("fmi::Roles {{ known: {known}, unknown: {} }}", unknown || beside))
    }

    /// The Real ones of unknowns.
    fn reals<'u>(&self, unknowns: impl Iterator<Item = &'u Unknown>) -> impl Iterator<Item = &'u Unknown> {
        unknowns.filter(|unknown| self.model.scalars[unknown.scalar].data_type == DataType::Real)
    }

    /// The declared dependencies of Real unknowns: the elements of an array that depend alike in one entry.
    fn dependencies_of<'u>(&self, table: &str, unknowns: impl Iterator<Item = &'u Unknown>) -> String {
        let mut runs: Vec<Run> = Vec::new();
        let mut last_field = None;
        for unknown in self.reals(unknowns) {
            let scalar = &self.model.scalars[unknown.scalar];
            let Some(knowns) = unknown.dependencies.as_deref() else { continue };
            let knowns: Vec<_> = knowns.iter().map(|&known| self.value_reference(known)).collect();
            let field = Some((scalar.field, scalar.place));
            let last = runs.last_mut().filter(|_| field == last_field);
            if !last.is_some_and(|run| run.extend(scalar.value_reference, &knowns)) {
                runs.push(Run { unknown: scalar.value_reference, knowns, count: 1, strides: None });
            }
            last_field = field;
        }
        if runs.is_empty() {
            return String::new();
        }
        let lines = runs.iter().map(|run| format!("        {},", run.text())).collect::<Vec<_>>().join("\n");
        format!("    const {table}: &'static [fmi::Dependencies] = &[\n{lines}\n    ];\n")
    }

    /// The tables for the runtime.
    pub(super) fn description(&self, guid: &str) -> String {
        let model = self.model;
        let categories: Vec<_> =
            model.log_categories.iter().map(|category| format!("{:?}", category.name)).collect();
        let mut variables = String::new();
        let by_first = |(number, variable): (usize, &Variable<'_>)| (variable.positions[0], number);
        let real_inputs: BTreeMap<_, _> = self.real_inputs().map(by_first).collect();
        let states: BTreeMap<_, _> = self.numbered_states().map(by_first).collect();
        for variable in self.by_value_reference() {
            let scalar = self.first(variable);
            let (min, max) = self.bounds(scalar);
            let items = self.items(scalar);
            let [in_initialization, in_steps] = self.roles(scalar);
            let name =
                if variable.is_array() { without_subscripts(&scalar.name) } else { scalar.name.clone() };
            let _ = writeln!(
                variables,
                "        fmi::VariableDescription {{ base_name: {name:?}, value_reference: {}, dimensions: &{:?}, elements: {}, \
                 stride: {}, data_type: fmi::DataType::{:?}, causality: fmi::Causality::{:?}, variability: fmi::Variability::{:?}, \
                 initial: {}, min: {min}, max: {max}, items: &[{items}], first_real_input: {:?}, first_state: {:?}, in_initialization: {in_initialization}, \
                 in_steps: {in_steps} }},",
                scalar.value_reference,
                variable.sizes,
                variable.positions.len(),
                self.stride(variable),
                scalar.data_type.data_type(),
                scalar.causality,
                scalar.variability,
                scalar
                    .initial
                    .map_or("None".to_owned(), |initial| format!("Some(fmi::Initial::{initial:?})")),
                real_inputs.get(&variable.positions[0]),
                states.get(&variable.positions[0]),
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
    warns_by_status: {},
    version: fmi::Version::{:?},
    interfaces: fmi::Interfaces::{:?},
    capabilities: fmi::Capabilities {{
        interpolate_inputs: {},
        get_and_set_state: {},
        serialize_state: {},
        directional_derivatives: {},
        adjoint_derivatives: {},
        event_mode: {},
        early_return: {},
        per_element_dependencies: {},
    }},
}};
",
            model.identifier,
            model.declaration.warnings == Warnings::Status,
            model.fmi.version,
            model.fmi.interfaces,
            capabilities.interpolate_inputs,
            capabilities.get_and_set_state,
            capabilities.serializes_state(),
            capabilities.directional_derivatives,
            capabilities.adjoint_derivatives,
            capabilities.event_mode,
            model.declaration.returns_early(),
            model.has_element_dependencies(),
            categories = categories.join(", "),
        )
    }
}

/// A table with an element for each scalar of some variables.
pub(super) fn repeated<'v>(of: &str, variables: impl Iterator<Item = (&'v Variable<'v>, String)>) -> String {
    let runs: Vec<_> = variables.map(|(variable, element)| (variable.positions.len(), element)).collect();
    let elements: Vec<_> = runs.iter().map(|(_, element)| element.as_str()).collect();
    let count: usize = runs.iter().map(|(length, _)| length).sum();
    if count == runs.len() {
        return format!("&[{}]", elements.join(", "));
    }
    let runs: Vec<_> = runs.iter().map(|(length, element)| format!("({length}, {element})")).collect();
    format!("&::fmu_export::typed::repeated::<{of}, {count}>(&[{}])", runs.join(", "))
}

/// Unknowns at a fixed distance, each of which depends on the first one's knowns, at fixed distances.
struct Run {
    unknown: u32,
    knowns: Vec<u32>,
    count: u32,
    /// The distances, once there are two.
    strides: Option<(u32, Vec<u32>)>,
}

impl Run {
    /// Adds an unknown if it is the next one.
    fn extend(&mut self, unknown: u32, knowns: &[u32]) -> bool {
        if knowns.len() != self.knowns.len() {
            return false;
        }
        if self.strides.is_none() {
            let distances = self.knowns.iter().zip(knowns).map(|(first, second)| second.checked_sub(*first));
            self.strides = unknown.checked_sub(self.unknown).zip(distances.collect());
        }
        let Some((stride, strides)) = &self.strides else { return false };
        let at = |first: u32, stride: u32| first + self.count * stride;
        let expected = self.knowns.iter().zip(strides).map(|(&first, &stride)| at(first, stride));
        let is_next = unknown == at(self.unknown, *stride) && expected.eq(knowns.iter().copied());
        if is_next {
            self.count += 1;
        } else if self.count == 1 {
            self.strides = None;
        }
        is_next
    }

    fn text(&self) -> String {
        let Self { unknown, knowns, count, strides } = self;
        let none = (1, vec![0; knowns.len()]);
        let (stride, strides) = strides.as_ref().unwrap_or(&none);
        // Knowns at equal distances are one entry.
        let mut runs: Vec<[u32; 4]> = Vec::new();
        for (&known, &stride) in knowns.iter().zip(strides) {
            match runs.last_mut() {
                Some([first, count @ 1, step, same]) if *same == stride && known > *first => {
                    (*count, *step) = (2, known - *first);
                }
                Some([first, count, step, same]) if *same == stride && known == *first + *count * *step => {
                    *count += 1;
                }
                _ => runs.push([known, 1, 1, stride]),
            }
        }
        let runs = runs.iter().map(|[first, count, step, stride]| {
            format!("fmi::Knowns {{ first: {first}, count: {count}, step: {step}, stride: {stride} }}")
        });
        let knowns = runs.collect::<Vec<_>>().join(", ");
        format!(
            "fmi::Dependencies {{ unknown: {unknown}, count: {count}, stride: {stride}, knowns: &[{knowns}] }}"
        )
    }
}
