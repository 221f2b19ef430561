//! The flat model: its parts with their variables, and all scalars.
//!
//! All output is printed from the [`Model`], which is complete and consistent.

use std::collections::BTreeMap;
use std::iter;
use std::rc::Rc;

use fmu_terms::{Causality, Initial, Variability};
use fmu_terms::{Unit, Version, is_structured};

use crate::declaration::{ComponentDeclaration, Declaration, Described, OneOrEach, VariableDeclaration};
use crate::interfaces::Fmi;
use crate::start::Start;
use crate::value_type::ValueType;

/// A model ready to be printed.
pub(crate) struct Model<'a> {
    pub(crate) declaration: &'a Declaration,
    pub(crate) fmi: Fmi,
    /// The declared identifier: the library's name.
    pub(crate) library: String,
    /// The FMU's identifier.
    pub(crate) identifier: String,
    pub(crate) description: Option<String>,
    pub(crate) author: Option<String>,
    pub(crate) license: Option<String>,
    pub(crate) version: &'a str,
    pub(crate) log_categories: Vec<Described>,
    /// The units used: those of the file first, in its order.
    pub(crate) units: Vec<Unit>,
    /// The model itself and its components, each before those in it.
    pub(crate) parts: Vec<Part<'a>>,
    /// All scalar variables, in the order of the XML.
    pub(crate) scalars: Vec<Scalar>,
    /// The scalars behind each name of a scalar or an array.
    pub(crate) names: BTreeMap<String, Vec<usize>>,
    /// Whether elements of an array read different variables.
    pub(crate) reads_elements: bool,
    /// Whether the model runs without an operating system, where there is no heap.
    pub(crate) is_bare_metal: bool,
    /// Whether the model computes with `f32`.
    pub(crate) is_single_precision: bool,
}

/// The model itself, or a component at any depth.
#[derive(Default)]
pub(crate) struct Part<'a> {
    /// The component's declaration; none for the model.
    pub(crate) component: Option<&'a ComponentDeclaration>,
    /// The part's name in FMI, such as `outer.inner`; empty for the model.
    pub(crate) name: String,
    /// The part's names without the subscripts of `arrays` from a position on, each with this position.
    pub(crate) general_names: Vec<(usize, String)>,
    /// The part's index from 0 in an array of components.
    pub(crate) index: Option<usize>,
    /// The sizes of the arrays of components around the part, the outermost first, and its indices there.
    pub(crate) arrays: Vec<(usize, usize)>,
    /// How the paths of the part's variables in Rust begin, such as `outer.inner.`; empty for the model.
    pub(crate) path: String,
    /// The part's description with those of the components around it.
    pub(crate) description: Option<String>,
    /// How the names of the part's structs begin.
    pub(crate) type_name: String,
    /// The position of the part around this one.
    pub(crate) around: Option<usize>,
    /// The positions of the components directly in the part.
    pub(crate) components: Vec<usize>,
    pub(crate) fields: Vec<Field<'a>>,
    /// The part's path in the declaration; empty for the model.
    pub(crate) key: String,
}

impl<'a> Part<'a> {
    /// The part's name within the part around it.
    pub(crate) fn own_name(&self) -> &'a str {
        self.component.map_or("", |component| &component.name)
    }

    /// The part's name in Rust.
    pub(crate) fn rust_name(&self) -> String {
        self.component.map(ComponentDeclaration::rust_name).unwrap_or_default()
    }

    /// The part's description without those of the components around it.
    pub(crate) fn own_description(&self) -> Option<&'a str> {
        self.component?.description.as_deref()
    }

    pub(crate) fn component_type(&self) -> Option<&'a str> {
        self.component?.component_type.as_deref()
    }

    /// The group of the part's states, for a component of the model.
    pub(crate) fn state_group(&self) -> Option<&'a str> {
        self.component?.state_group.as_deref()
    }

    /// The name in FMI of one of the part's variables or components.
    pub(crate) fn name_of(&self, inner: &str) -> String {
        name_within(&self.name, inner)
    }

    /// A description with those of the components around.
    pub(crate) fn describe(&self, inner: &str) -> String {
        self.description.as_ref().map_or_else(|| inner.to_owned(), |outer| format!("{outer}: {inner}"))
    }
}

/// The name in FMI of a variable or component, within a component of a name, or within the model without one.
pub(crate) fn name_within(outer: &str, inner: &str) -> String {
    if outer.is_empty() { inner.to_owned() } else { format!("{outer}.{inner}") }
}

/// The positions of a part and those around it, the model last.
pub(crate) fn outward(parts: &[Part<'_>], part: usize) -> impl Iterator<Item = usize> {
    iter::successors(Some(part), |&part| parts[part].around)
}

/// A declared variable, possibly an array: a field of a generated struct.
pub(crate) struct Field<'a> {
    pub(crate) declaration: &'a VariableDeclaration,
    pub(crate) place: Place,
    pub(crate) data_type: ValueType,
    /// The positions of the variable's scalars, row by row.
    pub(crate) positions: Vec<usize>,
    /// Whether the array is on the heap.
    pub(crate) is_boxed: bool,
}

/// Arrays with more elements are on the heap: the variables of a model are on the stack several times, even as numbers
/// with derivatives, and a thread may have only 1 MB of stack.
pub(crate) const MOST_INLINE: usize = 256;

/// A scalar, or an array whose elements follow a rule.
pub(crate) struct Variable<'m> {
    /// The positions of the variable's elements.
    pub(crate) positions: Vec<usize>,
    /// The array's sizes; empty if it is a scalar.
    pub(crate) sizes: &'m [usize],
}

impl Variable<'_> {
    pub(crate) fn is_array(&self) -> bool {
        !self.sizes.is_empty()
    }
}

impl Field<'_> {
    /// Whether the variable is an array whose elements share a unit.
    pub(crate) fn is_uniform_array(&self) -> bool {
        let declaration = self.declaration;
        !declaration.sizes.is_empty() && !matches!(declaration.unit, Some(OneOrEach::Each(_)))
    }

    /// The field's name in Rust.
    pub(crate) fn name(&self) -> String {
        self.declaration.rust_name()
    }
}

/// The field of the generated `Variables` that holds a value; time and event indicators have none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Place {
    #[default]
    Time,
    Parameters,
    Inputs,
    States,
    Derivatives,
    /// What follows from parameters only: calculated parameters, and locals that change only with parameters.
    CalculatedParameters,
    Locals,
    Outputs,
    EventIndicators,
    Clocks,
}

/// A further name of a scalar variable.
#[derive(Clone)]
pub(crate) struct Alias {
    pub(crate) name: String,
    pub(crate) description: Option<String>,
}

/// A scalar variable: what identifies it, and what each of its readers needs.
#[derive(Default)]
pub(crate) struct Scalar {
    pub(crate) name: String,
    /// The path in the declaration.
    pub(crate) key: String,
    /// The positions of the scalar's part, and of its field in the part; those of a derivative are those of its state.
    pub(crate) field: [usize; 2],
    pub(crate) value_reference: u32,
    pub(crate) place: Place,
    /// Where the value is within its place, such as `tank.pressure` or `gain[0][2]`.
    pub(crate) path: String,
    pub(crate) causality: Causality,
    pub(crate) variability: Variability,
    /// How the initial value is defined; none for inputs and the independent variable.
    pub(crate) initial: Option<Initial>,
    pub(crate) data_type: ValueType,
    pub(crate) start: Option<Start>,
    pub(crate) texts: Texts,
    pub(crate) quantity: Quantity,
    pub(crate) dynamics: Dynamics,
    pub(crate) clocked: Clocked,
    pub(crate) reads: ReadsByMode,
}

/// What people read of a scalar.
#[derive(Default)]
pub(crate) struct Texts {
    pub(crate) description: Option<String>,
    pub(crate) aliases: Vec<Alias>,
}

/// What a scalar's values mean, and their range.
#[derive(Default)]
pub(crate) struct Quantity {
    /// The position among the declaration's `real_types`, if the scalar has one of them.
    pub(crate) real_type: Option<usize>,
    pub(crate) unit: Option<String>,
    pub(crate) display_unit: Option<String>,
    pub(crate) is_relative: bool,
    pub(crate) min: Option<f64>,
    pub(crate) max: Option<f64>,
    pub(crate) nominal: Option<f64>,
}

/// A scalar's part in the integration.
#[derive(Default)]
pub(crate) struct Dynamics {
    /// For a derivative: the position of its state.
    pub(crate) state: Option<usize>,
    /// For a state: whether events may set it.
    pub(crate) reinit: bool,
    /// For a state: whether the equations are invalid below `min`, and above `max`.
    pub(crate) strict: [bool; 2],
}

/// A scalar's relation to clocks.
#[derive(Default)]
pub(crate) struct Clocked {
    /// The positions of the clocks at whose ticks the scalar changes; none if it changes at any time.
    pub(crate) clocks: Vec<usize>,
    /// For a clocked state: the position of its previous value.
    pub(crate) previous: Option<usize>,
    /// Whether the scalar is the previous value of a clocked state.
    pub(crate) is_previous: bool,
}

/// What the equation of a scalar reads, between steps and in initialization.
#[derive(Default)]
pub(crate) struct ReadsByMode {
    pub(crate) in_steps: Reads,
    pub(crate) in_initialization: Reads,
}

/// The positions of the variables that an equation reads, one list for all elements of an array that read alike; none if
/// it may read everything.
pub(crate) type Reads = Option<Rc<[usize]>>;

impl Scalar {
    /// The independent variable, on which others are based: it reads nothing.
    pub(crate) fn time() -> Self {
        Self {
            name: "time".to_owned(),
            causality: Causality::Independent,
            texts: Texts { description: Some("Time".to_owned()), aliases: vec![] },
            quantity: Quantity { unit: Some("s".to_owned()), ..Quantity::default() },
            reads: ReadsByMode { in_steps: Some([].into()), in_initialization: Some([].into()) },
            ..Self::default()
        }
    }

    /// Whether the scalar is given between steps.
    pub(crate) fn known_in_steps(&self) -> bool {
        matches!(self.place, Place::Inputs | Place::States | Place::Time) || self.is_input_clock()
    }

    /// Whether the scalar is a clock that the importer activates.
    pub(crate) fn is_input_clock(&self) -> bool {
        self.place == Place::Clocks && self.causality == Causality::Input
    }

    /// Whether the scalar is given in initialization.
    pub(crate) fn known_in_initialization(&self) -> bool {
        matches!(self.place, Place::Inputs | Place::Time) || self.initial == Some(Initial::Exact)
    }

    /// Whether the scalar belongs to the `InitialUnknowns`. Before the first tick of its clock there are only start
    /// values.
    pub(crate) fn unknown_in_initialization(&self) -> bool {
        !self.known_in_initialization()
            && self.clocked.clocks.is_empty()
            && (matches!(self.place, Place::Outputs | Place::States | Place::Derivatives)
                || self.place == Place::Clocks && self.causality == Causality::Output
                || self.causality == Causality::CalculatedParameter)
    }

    /// Whether the scalar is an unknown between steps.
    pub(crate) fn unknown_in_steps(&self) -> bool {
        self.causality == Causality::Output
            || self.place == Place::Derivatives
            || self.clocked.previous.is_some()
    }

    /// Whether the scalar is an unknown that no list of `ModelStructure` needs: in initialization, an output with an
    /// exact start value; or a local.
    pub(crate) fn unknown_beside_the_lists(&self) -> bool {
        let is_calculated = matches!(self.place, Place::Locals | Place::CalculatedParameters)
            && self.initial == Some(Initial::Calculated);
        self.causality == Causality::Output || self.causality == Causality::Local && is_calculated
    }
}

impl<'a> Model<'a> {
    /// All variables, in order of declaration. If the elements of an array have different units, they are scalars.
    pub(crate) fn variables(&self) -> Vec<Variable<'_>> {
        let others = [Place::Time, Place::EventIndicators].into_iter().flat_map(|place| self.in_place(place));
        let mut variables: Vec<_> =
            others.map(|position| Variable { positions: vec![position], sizes: &[] }).collect();
        for field in self.parts.iter().flat_map(|part| &part.fields) {
            for offset in 0..if field.place == Place::States { 2 } else { 1 } {
                let positions: Vec<_> = field.positions.iter().map(|position| position + offset).collect();
                if field.is_uniform_array() {
                    variables.push(Variable { positions, sizes: &field.declaration.sizes });
                } else {
                    let each = positions
                        .into_iter()
                        .map(|position| Variable { positions: vec![position], sizes: &[] });
                    variables.extend(each);
                }
            }
        }
        variables.sort_by_key(|variable| variable.positions[0]);
        variables
    }

    /// The variable that an axis of a map in a part names: in the part, or by its full name.
    pub(crate) fn axis(&self, part: &Part<'_>, axis: &str) -> Option<&Field<'a>> {
        let positions = self.names.get(&part.name_of(axis)).or_else(|| self.names.get(axis))?;
        Some(self.field(*positions.first()?))
    }

    /// The first variable whose name is not of the convention `structured`, if any: then all are `flat`.
    pub(crate) fn flat_name(&self) -> Option<&str> {
        let names = self.scalars.iter().flat_map(|scalar| {
            [&scalar.name].into_iter().chain(scalar.texts.aliases.iter().map(|alias| &alias.name))
        });
        names.map(String::as_str).find(|name| !is_structured(name))
    }

    /// The arrays that are one variable each, by their elements' positions: in FMI 3.0 those whose elements share a
    /// unit, and the derivatives of states. None in FMI 2.0.
    pub(crate) fn arrays(&self) -> Vec<Vec<usize>> {
        let mut arrays = Vec::new();
        let fields = self.parts.iter().flat_map(|part| &part.fields);
        for field in fields.filter(|field| self.is_one_variable(field)) {
            arrays.push(field.positions.clone());
            if field.place == Place::States {
                arrays.push(field.positions.iter().map(|position| position + 1).collect());
            }
        }
        arrays.sort_by_key(|array| self.scalars[array[0]].value_reference);
        arrays
    }

    /// Whether a field is an array that is one variable.
    pub(crate) fn is_one_variable(&self, field: &Field<'_>) -> bool {
        self.fmi.version == Version::Three && field.is_uniform_array()
    }

    /// Whether importers may ask for the dependencies of each element (FMI 3.0.2, section 2.2.9): in FMI 2.0 they are in
    /// the description.
    pub(crate) fn has_element_dependencies(&self) -> bool {
        self.fmi.version == Version::Three && self.reads_elements
    }

    /// Whether the FMU has a place's variables. In FMI 2.0 it has no clocks: their ticks are time events.
    pub(crate) fn exports(&self, place: Place) -> bool {
        place != Place::Clocks || self.fmi.version == Version::Three
    }

    /// The components directly in a part.
    pub(crate) fn components(&self, part: &Part<'a>) -> impl Iterator<Item = &Part<'a>> {
        part.components.iter().map(|&position| &self.parts[position])
    }

    /// The variables in a place of a part and of the components in it, at any depth.
    pub(crate) fn held<'m>(&'m self, place: Place, part: &'m Part<'a>) -> Vec<&'m Field<'a>> {
        let inner = self.components(part).flat_map(|component| self.held(place, component));
        place.fields(part).chain(inner).collect()
    }

    /// The declared variable of a position.
    pub(crate) fn field(&self, position: usize) -> &Field<'a> {
        let [part, field] = self.scalars[position].field;
        &self.parts[part].fields[field]
    }

    /// The positions of a place's variables.
    pub(crate) fn in_place(&self, place: Place) -> impl Iterator<Item = usize> {
        (0..self.scalars.len()).filter(move |&position| self.scalars[position].place == place)
    }
}

/// A derivative's description unless declared.
pub(crate) fn derivative_description(state: &str) -> String {
    format!("Time derivative of {state}")
}

/// An array's name, from that of its first element: `gain` from `gain[1,1]`, `der(x)` from `der(x[1])`.
pub(crate) fn without_subscripts(name: &str) -> String {
    match (name.rfind('['), name.rfind(']')) {
        (Some(open), Some(close)) => format!("{}{}", &name[..open], &name[close + 1..]),
        _ => name.to_owned(),
    }
}
