//! `ModelVariables` and `ModelStructure`.

use std::collections::BTreeMap;
use std::io;
use std::slice;

use fmu_terms::Version;
use fmu_terms::{Causality, DataType, Variability};
use fmu_xml::{Attributes, XmlWriter, element, empty, float, given};
use quick_xml::events::{BytesText, Event};

use crate::declaration::{Dimension, RealType, VariableDeclaration};
use crate::dependencies::{self, Structure, Unknown};
use crate::model::{Alias, Model, Place, Scalar, derivative_description, without_subscripts};
use crate::value_type::ValueType;

/// The standard's variables, some of which are arrays in FMI 3.0.
pub(crate) struct Variables<'m, 'a> {
    model: &'m Model<'a>,
    /// Each array's elements, by the position of the first.
    arrays: BTreeMap<usize, Vec<usize>>,
    /// The first element of a position's array.
    first: BTreeMap<usize, usize>,
    /// In FMI 2.0: each position's index, from 1.
    indices: Vec<usize>,
}

impl<'m, 'a> Variables<'m, 'a> {
    pub(crate) fn new(model: &'m Model<'a>) -> Self {
        let arrays = model.arrays();
        let first =
            arrays.iter().flat_map(|array| array.iter().map(|&element| (element, array[0]))).collect();
        let arrays = arrays.into_iter().map(|array| (array[0], array)).collect();
        let exported = model.scalars.iter().map(|scalar| usize::from(model.exports(scalar.place)));
        let indices = exported.scan(0, |last, exported| {
            *last += exported;
            Some(*last)
        });
        Self { model, arrays, first, indices: indices.collect() }
    }

    fn version(&self) -> Version {
        self.model.fmi.version
    }

    /// The position of a scalar's variable.
    fn variable_of(&self, position: usize) -> usize {
        self.first.get(&position).copied().unwrap_or(position)
    }

    /// The number that refers to a position's variable: in FMI 2.0 its index, from 1.
    fn number(&self, position: usize) -> usize {
        match self.version() {
            Version::Two => self.indices[position],
            Version::Three => self.model.scalars[self.variable_of(position)].value_reference as usize,
        }
    }

    fn reference(&self, position: usize) -> String {
        self.number(position).to_string()
    }

    pub(crate) fn write_all(&self, writer: &mut XmlWriter) -> io::Result<()> {
        let positions = 0..self.model.scalars.len();
        positions
            .filter(|&position| {
                self.variable_of(position) == position
                    && self.model.exports(self.model.scalars[position].place)
            })
            .try_for_each(|position| self.write(writer, position))?;
        // Last, so that no index of another variable moves.
        match self.version() {
            Version::Two => self.write_aliases(writer),
            Version::Three => Ok(()),
        }
    }

    /// Writes aliases: in FMI 2.0 variables of the same value reference (section 2.2.7), which an importer can only
    /// read.
    fn write_aliases(&self, writer: &mut XmlWriter) -> io::Result<()> {
        for (position, scalar) in self.model.scalars.iter().enumerate() {
            let is_constant = scalar.variability == Variability::Constant;
            let start = scalar.start.as_ref().filter(|_| is_constant).map(ToString::to_string);
            for alias in &scalar.texts.aliases {
                let common = given([
                    ("name", Some(alias.name.clone())),
                    ("valueReference", Some(scalar.value_reference.to_string())),
                    ("description", alias.description.clone()),
                    ("causality", Some(Causality::Local.to_string())),
                    ("variability", Some(scalar.variability.to_string())),
                ]);
                let own = [self.of_type(scalar, position), given([("start", start.clone())])].concat();
                let name = scalar.data_type.data_type().name(Version::Two);
                element(writer, "ScalarVariable", common, |writer| empty(writer, name, own))?;
            }
        }
        Ok(())
    }

    /// Writes a variable: in FMI 2.0 an element with that of the type in it, otherwise one element.
    fn write(&self, writer: &mut XmlWriter, position: usize) -> io::Result<()> {
        let scalar = &self.model.scalars[position];
        let array = self.arrays.get(&position);
        let name = if array.is_some() { without_subscripts(&scalar.name) } else { scalar.name.clone() };
        let common = given([
            ("name", Some(name)),
            ("valueReference", Some(scalar.value_reference.to_string())),
            ("description", self.description(scalar, array.is_some())),
            ("causality", Some(scalar.causality.to_string())),
            ("variability", Some(scalar.variability.to_string())),
            ("initial", scalar.initial.map(|initial| initial.to_string())),
        ]);
        let mut own = self.of_type(scalar, position);
        let elements = array.map_or(slice::from_ref(&position), Vec::as_slice);
        let starts = elements.iter().map(|&element| self.model.scalars[element].start.as_ref());
        let starts = starts.map(|start| start.map(ToString::to_string)).collect::<Option<Vec<_>>>();
        let has_texts = self.version() == Version::Three
            && matches!(scalar.data_type.data_type(), DataType::String | DataType::Binary);
        let numbers = starts.as_ref().filter(|_| !has_texts);
        let references = |positions: &[usize]| {
            positions.iter().map(|&position| self.reference(position)).collect::<Vec<_>>().join(" ")
        };
        own.extend(given([
            ("start", numbers.map(|numbers| numbers.join(" "))),
            ("derivative", scalar.dynamics.state.map(|state| self.reference(state))),
            ("intermediateUpdate", self.has_intermediate_update(scalar).then(|| true.to_string())),
            ("clocks", Some(references(&scalar.clocked.clocks)).filter(|clocks| !clocks.is_empty())),
            ("previous", scalar.clocked.previous.map(|previous| self.reference(previous))),
            // The standard has it for Model Exchange only (FMI 2.0.5, section 2.2.7).
            (
                "reinit",
                (scalar.dynamics.reinit && self.model.fmi.interfaces.model_exchange())
                    .then(|| true.to_string()),
            ),
        ]));
        let name = scalar.data_type.data_type().name(self.version());
        if self.version() == Version::Two {
            let comment = format!(" index {} ", self.reference(position));
            writer.write_event(Event::Comment(BytesText::new(&comment)))?;
            return element(writer, "ScalarVariable", common, |writer| empty(writer, name, own));
        }
        let attributes = [common, own].concat();
        let texts = starts.filter(|_| has_texts).unwrap_or_default();
        if array.is_none() && texts.is_empty() && scalar.texts.aliases.is_empty() {
            return empty(writer, name, attributes);
        }
        element(writer, name, attributes, |writer| {
            for dimension in array.map_or(&[][..], |_| self.dimensions(position)) {
                let attribute = match dimension {
                    Dimension::Size(size) => ("start", size.to_string()),
                    Dimension::Parameter(name) => {
                        ("valueReference", self.reference(self.model.names[name][0]))
                    }
                };
                empty(writer, "Dimension", vec![attribute])?;
            }
            texts.into_iter().try_for_each(|text| empty(writer, "Start", vec![("value", text)]))?;
            scalar.texts.aliases.iter().try_for_each(|Alias { name, description }| {
                let name = if array.is_some() { without_subscripts(name) } else { name.clone() };
                empty(writer, "Alias", given([("name", Some(name)), ("description", description.clone())]))
            })
        })
    }

    /// A variable's description; by default, that of an array of derivatives names the array of states.
    fn description(&self, scalar: &Scalar, is_array: bool) -> Option<String> {
        let state = scalar.dynamics.state.filter(|_| is_array).filter(|&state| {
            let derivative = self.model.field(state).declaration.derivative.as_ref();
            derivative.is_some_and(|derivative| derivative.description.is_none())
        });
        state.map_or_else(
            || scalar.texts.description.clone(),
            |state| Some(derivative_description(&without_subscripts(&self.model.scalars[state].name))),
        )
    }

    /// An array's sizes, from its first element's position; a derivative has its state's.
    fn dimensions(&self, position: usize) -> &'m [Dimension] {
        let position = self.model.scalars[position].dynamics.state.unwrap_or(position);
        &self.model.field(position).declaration.dimensions
    }

    /// The attributes that a type has, in the order of the schema.
    fn of_type(&self, scalar: &Scalar, position: usize) -> Attributes {
        match scalar.data_type {
            ValueType::Enumeration(enumeration) => {
                let name = self.model.declaration.enumerations[enumeration].name.clone();
                vec![("declaredType", name)]
            }
            ValueType::Standard(DataType::Clock) => {
                let has_priority = self.model.fmi.interfaces.scheduled_execution();
                clock_attributes(self.model.field(position).declaration, has_priority)
            }
            ValueType::Standard(data_type) => {
                // Of an integer the checks allow only integers, and `Display` prints them without a fraction.
                let bound = |bound: f64| if data_type.is_float() { float(bound) } else { bound.to_string() };
                let own = given([
                    ("unit", scalar.quantity.unit.clone()),
                    ("displayUnit", scalar.quantity.display_unit.clone()),
                    ("relativeQuantity", scalar.quantity.is_relative.then(|| true.to_string())),
                    ("min", scalar.quantity.min.map(bound)),
                    ("max", scalar.quantity.max.map(bound)),
                    ("nominal", scalar.quantity.nominal.map(float)),
                ]);
                let Some(known) = scalar.quantity.real_type else { return own };
                let known = &self.model.declaration.real_types[known];
                let inherited = real_type_attributes(known);
                let own = own.into_iter().filter(|attribute| !inherited.contains(attribute));
                [("declaredType", known.name.clone())].into_iter().chain(own).collect()
            }
        }
    }

    /// Whether a variable can be exchanged between two internal steps of co-simulation, as in `fmu_export`'s runtime.
    fn has_intermediate_update(&self, scalar: &Scalar) -> bool {
        self.version() == Version::Three
            && self.model.declaration.has_intermediate_updates()
            && self.model.fmi.interfaces.co_simulation()
            && scalar.data_type == DataType::Real
            && scalar.variability == Variability::Continuous
            && matches!(scalar.causality, Causality::Input | Causality::Output)
    }

    /// Writes unknowns: in FMI 2.0 in lists, which are not empty, otherwise as elements named after their list.
    pub(crate) fn write_structure(&self, writer: &mut XmlWriter, structure: &Structure) -> io::Result<()> {
        if self.version() == Version::Two {
            let lists = [
                ("Outputs", &structure.outputs),
                ("Derivatives", &structure.derivatives),
                ("InitialUnknowns", &structure.initial_unknowns),
            ];
            return lists.into_iter().filter(|(_, unknowns)| !unknowns.is_empty()).try_for_each(
                |(list, unknowns)| {
                    element(writer, list, vec![], |writer| {
                        self.write_unknowns(writer, ("Unknown", "index"), unknowns)
                    })
                },
            );
        }
        for (name, unknowns) in [
            ("Output", &structure.outputs),
            ("ContinuousStateDerivative", &structure.derivatives),
            ("ClockedState", &structure.clocked_states),
            ("InitialUnknown", &structure.initial_unknowns),
        ] {
            self.write_unknowns(writer, (name, "valueReference"), unknowns)?;
        }
        // Event indicators' dependencies are for debugging only, and omitted.
        self.model.in_place(Place::EventIndicators).try_for_each(|position| {
            empty(writer, "EventIndicator", vec![("valueReference", self.reference(position))])
        })
    }

    /// Unknowns with the variables on which they, or any of their elements, depend. An empty list is written, too:
    /// without one the variable depends on everything. Where all would be too many, none is written for unknowns that share
    /// theirs.
    fn write_unknowns(
        &self,
        writer: &mut XmlWriter,
        (name, key): (&'static str, &'static str),
        unknowns: &[Unknown],
    ) -> io::Result<()> {
        let mut variables: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for unknown in unknowns {
            variables.entry(self.variable_of(unknown.scalar)).or_default().push(&unknown.dependencies);
        }
        let variables: Vec<_> = variables
            .into_iter()
            .map(|(variable, elements)| (variable, dependencies::lists(elements)))
            .collect();
        let all = || variables.iter().filter_map(|(_, lists)| lists.as_ref()).flatten();
        let are_too_many = all().map(|list| list.len()).sum::<usize>() > dependencies::MOST;
        let mut uses = BTreeMap::new();
        all().for_each(|list| *uses.entry(list.as_ptr()).or_insert(0) += 1);
        variables.iter().try_for_each(|(variable, lists)| {
            let written = lists
                .as_ref()
                .filter(|lists| !are_too_many || lists.iter().all(|list| uses[&list.as_ptr()] == 1));
            let dependencies = written.map(|lists| {
                let mut knowns: Vec<_> = lists.concat().into_iter().map(|known| self.number(known)).collect();
                knowns.sort_unstable();
                knowns.dedup();
                knowns.iter().map(usize::to_string).collect::<Vec<_>>().join(" ")
            });
            let attributes = [(key, Some(self.reference(*variable))), ("dependencies", dependencies)];
            empty(writer, name, given(attributes))
        })
    }
}

/// What variables of a type inherit.
pub(super) fn real_type_attributes(known: &RealType) -> Attributes {
    given([
        ("quantity", known.quantity.clone()),
        ("unit", known.unit.clone()),
        ("displayUnit", known.display_unit.clone()),
        ("relativeQuantity", known.relative_quantity.then(|| true.to_string())),
        ("min", known.min.map(float)),
        ("max", known.max.map(float)),
        ("nominal", known.nominal.map(float)),
        ("unbounded", known.unbounded.then(|| true.to_string())),
    ])
}

/// The attributes of clocks only. An interval declared in one form is also written in the other: importers read the
/// decimal number. Priorities are those of Scheduled Execution (FMI 3.0.2, section 2.4.4).
fn clock_attributes(clock: &VariableDeclaration, has_priority: bool) -> Attributes {
    let [interval, shift] = clock.timing().map_or([None; 2], |timing| timing.map(Some));
    given([
        ("canBeDeactivated", clock.can_be_deactivated.then(|| true.to_string())),
        ("priority", clock.priority.filter(|_| has_priority).map(|priority| priority.to_string())),
        ("intervalVariability", Some(clock.ticks().to_string())),
        ("intervalDecimal", interval.map(float)),
        ("shiftDecimal", shift.filter(|shift| *shift > 0.0).map(float)),
        ("supportsFraction", clock.has_fractions().then(|| true.to_string())),
        ("resolution", clock.resolution.map(|resolution| resolution.to_string())),
        ("intervalCounter", clock.interval_counter.map(|counter| counter.to_string())),
        ("shiftCounter", clock.shift_counter.map(|counter| counter.to_string())),
    ])
}
