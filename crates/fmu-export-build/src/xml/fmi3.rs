//! The modelDescription.xml of FMI 3.0, in the order of fmi3ModelDescription.xsd.

use std::collections::BTreeMap;
use std::io;

use super::{
    causality, given, initial, start, variability, write_experiment, write_log_categories, write_units,
};
use crate::declaration::{Causality, Declaration, Dimension, Variability, VariableDeclaration};
use crate::dependencies::{Structure, Unknown};
use crate::model::{DataType, Model, Place, Scalar};
use fmu_xml::{Attributes, XmlWriter, document, element, empty, float};

pub(super) fn write(model: &Model<'_>, structure: &Structure, token: &str) -> String {
    let declaration = model.declaration;
    let attributes = super::identity(model, "3.0", ("instantiationToken", token));
    let variables = Variables::new(model);
    document(|writer| {
        element(writer, "fmiModelDescription", attributes, |writer| {
            write_interfaces(writer, model)?;
            write_units(writer, model)?;
            write_types(writer, declaration)?;
            write_log_categories(writer, model)?;
            write_experiment(writer, declaration)?;
            element(writer, "ModelVariables", vec![], |writer| {
                variables.positions().try_for_each(|position| variables.write(writer, position))
            })?;
            element(writer, "ModelStructure", vec![], |writer| variables.write_structure(writer, structure))
        })
    })
}

fn write_interfaces(writer: &mut XmlWriter, model: &Model<'_>) -> io::Result<()> {
    let capabilities = &model.declaration.capabilities;
    let common = vec![
        ("modelIdentifier", model.identifier.clone()),
        ("needsExecutionTool", false.to_string()),
        ("canBeInstantiatedOnlyOncePerProcess", false.to_string()),
        ("canGetAndSetFMUState", capabilities.get_and_set_state.to_string()),
        ("canSerializeFMUState", capabilities.serializes_state().to_string()),
        ("providesDirectionalDerivatives", capabilities.directional_derivatives.to_string()),
        ("providesAdjointDerivatives", capabilities.adjoint_derivatives.to_string()),
        ("providesPerElementDependencies", false.to_string()),
    ];
    let with = |own: Attributes| [common.clone(), own].concat();
    if model.fmi.interfaces.model_exchange() {
        // The runtime does nothing when a step is completed.
        let own = vec![("needsCompletedIntegratorStep", false.to_string())];
        empty(writer, "ModelExchange", with(own))?;
    }
    if model.fmi.interfaces.co_simulation() {
        let own = vec![
            (
                "canHandleVariableCommunicationStepSize",
                capabilities.variable_communication_step_size.to_string(),
            ),
            ("maxOutputDerivativeOrder", u8::from(capabilities.directional_derivatives).to_string()),
            ("mightReturnEarlyFromDoStep", true.to_string()),
            ("providesIntermediateUpdate", capabilities.event_mode.to_string()),
            ("canReturnEarlyAfterIntermediateUpdate", capabilities.event_mode.to_string()),
            ("hasEventMode", capabilities.event_mode.to_string()),
        ];
        empty(writer, "CoSimulation", with(own))?;
    }
    if model.fmi.interfaces.scheduled_execution() {
        empty(writer, "ScheduledExecution", common)?;
    }
    Ok(())
}

fn write_types(writer: &mut XmlWriter, declaration: &Declaration) -> io::Result<()> {
    if declaration.enumerations.is_empty() {
        return Ok(());
    }
    element(writer, "TypeDefinitions", vec![], |writer| {
        declaration.enumerations.iter().try_for_each(|enumeration| {
            let attributes =
                vec![("name", enumeration.name.clone()), ("description", enumeration.description.clone())];
            element(writer, "EnumerationType", attributes, |writer| super::write_items(writer, enumeration))
        })
    })
}

/// The standard's variables, some of which are arrays.
struct Variables<'m, 'a> {
    model: &'m Model<'a>,
    /// Each array's elements, by the position of the first.
    arrays: BTreeMap<usize, Vec<usize>>,
    /// The first element of a position's array.
    first: BTreeMap<usize, usize>,
}

impl<'m, 'a> Variables<'m, 'a> {
    fn new(model: &'m Model<'a>) -> Self {
        let arrays = model.arrays();
        let first =
            arrays.iter().flat_map(|array| array.iter().map(|&element| (element, array[0]))).collect();
        let arrays = arrays.into_iter().map(|array| (array[0], array)).collect();
        Self { model, arrays, first }
    }

    /// The position of a scalar's variable.
    fn variable_of(&self, position: usize) -> usize {
        self.first.get(&position).copied().unwrap_or(position)
    }

    /// The positions of the variables.
    fn positions(&self) -> impl Iterator<Item = usize> {
        (0..self.model.scalars.len()).filter(|&position| self.variable_of(position) == position)
    }

    fn reference(&self, position: usize) -> String {
        self.model.scalars[position].value_reference.to_string()
    }

    fn write(&self, writer: &mut XmlWriter, position: usize) -> io::Result<()> {
        let scalar = &self.model.scalars[position];
        let array = self.arrays.get(&position);
        let elements = array.map_or(std::slice::from_ref(&position), Vec::as_slice);
        let common = given([
            (
                "name",
                Some(if array.is_some() { without_subscripts(&scalar.name) } else { scalar.name.clone() }),
            ),
            ("valueReference", Some(scalar.value_reference.to_string())),
            ("description", scalar.description.clone()),
            ("causality", Some(causality(scalar.causality).to_owned())),
            ("variability", Some(variability(scalar.variability).to_owned())),
            ("initial", scalar.initial.map(|value| initial(value).to_owned())),
        ]);
        let (name, own) = self.type_element(scalar, position);
        let mut attributes = [common, own].concat();
        let starts = elements.iter().map(|&element| self.model.scalars[element].start.as_ref().map(start));
        let starts: Option<Vec<_>> = starts.collect();
        let is_text = matches!(scalar.data_type, DataType::String | DataType::Binary);
        if let Some(starts) = &starts
            && !is_text
        {
            attributes.push(("start", starts.join(" ")));
        }
        if let Some(state) = scalar.state {
            attributes.push(("derivative", self.reference(self.variable_of(state))));
        }
        if self.has_intermediate_update(scalar) {
            attributes.push(("intermediateUpdate", true.to_string()));
        }
        if !scalar.clocks.is_empty() {
            let clocks = scalar.clocks.iter().map(|&clock| self.reference(clock));
            attributes.push(("clocks", clocks.collect::<Vec<_>>().join(" ")));
        }
        if let Some(previous) = scalar.previous {
            attributes.push(("previous", self.reference(previous)));
        }
        if scalar.reinit && self.model.fmi.interfaces.model_exchange() {
            attributes.push(("reinit", true.to_string()));
        }
        let texts = starts.filter(|_| is_text).unwrap_or_default();
        if array.is_none() && texts.is_empty() {
            return empty(writer, name, attributes);
        }
        element(writer, name, attributes, |writer| {
            if array.is_some() {
                for dimension in self.dimensions(position) {
                    let attribute = match dimension {
                        Dimension::Size(size) => ("start", size.to_string()),
                        Dimension::Parameter(name) => {
                            ("valueReference", self.reference(self.model.names[name][0]))
                        }
                    };
                    empty(writer, "Dimension", vec![attribute])?;
                }
            }
            texts.into_iter().try_for_each(|text| empty(writer, "Start", vec![("value", text)]))
        })
    }

    /// An array's sizes, from its first element's position; a derivative has its state's.
    fn dimensions(&self, position: usize) -> &'m [Dimension] {
        let position = self.model.scalars[position].state.unwrap_or(position);
        &self.model.field(position).declaration.dimensions
    }

    /// The element named after a variable's type, with all attributes but the start value.
    fn type_element(&self, scalar: &Scalar, position: usize) -> (&'static str, Attributes) {
        let whole = |bound: f64| bound.to_string();
        match scalar.data_type {
            DataType::Real | DataType::Float32 => {
                let attributes = [
                    ("unit", scalar.unit.clone()),
                    ("displayUnit", scalar.display_unit.clone()),
                    ("min", scalar.min.map(float)),
                    ("max", scalar.max.map(float)),
                    ("nominal", scalar.nominal.map(float)),
                ];
                let name = if scalar.data_type == DataType::Real { "Float64" } else { "Float32" };
                (name, given(attributes))
            }
            DataType::Integer | DataType::Whole(_) => {
                let name = match scalar.data_type {
                    DataType::Whole(whole) => whole.name(),
                    _ => "Int32",
                };
                (name, given([("min", scalar.min.map(whole)), ("max", scalar.max.map(whole))]))
            }
            DataType::Clock => ("Clock", clock_attributes(self.model.field(position).declaration)),
            DataType::Boolean => ("Boolean", vec![]),
            DataType::String => ("String", vec![]),
            DataType::Binary => ("Binary", vec![]),
            DataType::Enumeration(enumeration) => {
                let name = self.model.declaration.enumerations[enumeration].name.clone();
                ("Enumeration", vec![("declaredType", name)])
            }
        }
    }

    /// Whether a variable can be exchanged between two internal steps of co-simulation, as in `fmu_export`'s runtime.
    fn has_intermediate_update(&self, scalar: &Scalar) -> bool {
        self.model.declaration.capabilities.event_mode
            && self.model.fmi.interfaces.co_simulation()
            && scalar.data_type == DataType::Real
            && scalar.variability == Variability::Continuous
            && matches!(scalar.causality, Some(Causality::Input | Causality::Output))
    }

    fn write_structure(&self, writer: &mut XmlWriter, structure: &Structure) -> io::Result<()> {
        let lists = [
            ("Output", &structure.outputs),
            ("ContinuousStateDerivative", &structure.derivatives),
            ("ClockedState", &structure.clocked_states),
            ("InitialUnknown", &structure.initial_unknowns),
        ];
        for (name, unknowns) in lists {
            self.write_unknowns(writer, name, unknowns)?;
        }
        // Their dependencies are for debugging only, and omitted.
        self.model.in_place(Place::EventIndicators).try_for_each(|position| {
            empty(writer, "EventIndicator", vec![("valueReference", self.reference(position))])
        })
    }

    /// Unknowns with the variables on which they, or any of their elements, depend. An empty list is written, too:
    /// without one the variable depends on everything.
    fn write_unknowns(
        &self,
        writer: &mut XmlWriter,
        name: &'static str,
        unknowns: &[Unknown],
    ) -> io::Result<()> {
        // Before the first tick of their clock there are only start values.
        let is_listed = |unknown: &Unknown| {
            name != "InitialUnknown" || self.model.scalars[unknown.scalar].clocks.is_empty()
        };
        let mut variables: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for unknown in unknowns.iter().filter(|unknown| is_listed(unknown)) {
            variables.entry(self.variable_of(unknown.scalar)).or_default().push(unknown);
        }
        variables.into_iter().try_for_each(|(variable, elements)| {
            let dependencies: Option<Vec<_>> =
                elements.iter().map(|element| element.dependencies.as_deref()).collect();
            let dependencies = dependencies.map(|lists| {
                let mut knowns: Vec<_> = lists
                    .into_iter()
                    .flatten()
                    .map(|&known| self.model.scalars[self.variable_of(known)].value_reference)
                    .collect();
                knowns.sort_unstable();
                knowns.dedup();
                knowns.iter().map(u32::to_string).collect::<Vec<_>>().join(" ")
            });
            let attributes =
                [("valueReference", Some(self.reference(variable))), ("dependencies", dependencies)];
            empty(writer, name, given(attributes))
        })
    }
}

/// The attributes of clocks only. An interval declared in one form is also written in the other: importers read the
/// decimal number.
fn clock_attributes(clock: &VariableDeclaration) -> Attributes {
    let [interval, shift] = clock.timing().map_or([None; 2], |timing| timing.map(Some));
    given([
        ("canBeDeactivated", clock.can_be_deactivated.then(|| true.to_string())),
        ("priority", clock.priority.map(|priority| priority.to_string())),
        ("intervalVariability", Some(clock.ticks().as_str().to_owned())),
        ("intervalDecimal", interval.map(float)),
        ("shiftDecimal", shift.filter(|shift| *shift > 0.0).map(float)),
        ("supportsFraction", clock.has_fractions().then(|| true.to_string())),
        ("resolution", clock.resolution.map(|resolution| resolution.to_string())),
        ("intervalCounter", clock.interval_counter.map(|counter| counter.to_string())),
        ("shiftCounter", clock.shift_counter.map(|counter| counter.to_string())),
    ])
}

/// An array's name, from that of its first element: `gain` from `gain[1,1]`, `der(x)` from `der(x[1])`.
fn without_subscripts(name: &str) -> String {
    match (name.rfind('['), name.rfind(']')) {
        (Some(open), Some(close)) => format!("{}{}", &name[..open], &name[close + 1..]),
        _ => name.to_owned(),
    }
}
