//! The generator, and expressions that all of its texts have in common.

use std::collections::{BTreeMap, BTreeSet};

use fmu_terms::DataType;

use crate::declaration::EnumerationDeclaration;
use crate::dependencies::Structure;
use crate::model::{Field, Model, Part, Place, Scalar, Variable};
use crate::names::variant_name;
use crate::start::Start;
use crate::texts::comment;
use crate::type_names::PLACES;
use crate::value_type::ValueType;

pub(super) struct Generator<'m, 'a> {
    pub(super) model: &'m Model<'a>,
    /// All variables, in order of declaration.
    pub(super) variables: Vec<Variable<'m>>,
    pub(super) structure: &'m Structure,
    /// The structs of components with different start values, which therefore have no default.
    pub(super) without_default: BTreeSet<String>,
}

impl<'m, 'a> Generator<'m, 'a> {
    pub(super) fn new(model: &'m Model<'a>, structure: &'m Structure) -> Self {
        let mut generator =
            Self { model, variables: model.variables(), structure, without_default: BTreeSet::new() };
        let mut starts = BTreeMap::new();
        for place in PLACES {
            for part in &model.parts[1..] {
                let name = place.struct_name(part);
                let own = generator
                    .values(place, &generator.members(place, part), &|field| generator.field_start(field));
                if *starts.entry(name.clone()).or_insert_with(|| own.clone()) != own {
                    generator.without_default.insert(name);
                }
            }
        }
        generator
    }

    /// What the struct of a part in a place contains.
    pub(super) fn members<'p>(&self, place: Place, part: &'p Part<'a>) -> Members<'p, 'a>
    where
        'm: 'p,
    {
        let components = self.model.components(part).filter(|part| !self.model.held(place, part).is_empty());
        Members { fields: place.fields(part).collect(), components: Component::all(components) }
    }

    /// The variables in members, at any depth.
    pub(super) fn all<'p>(&'p self, place: Place, members: &Members<'p, 'a>) -> Vec<&'p Field<'a>> {
        let parts = members.components.iter().flat_map(|component| &component.parts);
        let inner = parts.flat_map(|part| self.model.held(place, part));
        members.fields.iter().copied().chain(inner).collect()
    }

    /// Members as the fields of a struct expression, all components in full.
    pub(super) fn values(
        &self,
        place: Place,
        members: &Members<'_, 'a>,
        value: &dyn Fn(&Field<'_>) -> String,
    ) -> String {
        members.expression(value, |part| {
            format!(
                "{} {{ {} }}",
                place.struct_name(part),
                self.values(place, &self.members(place, part), value)
            )
        })
    }

    /// The start values of members as the fields of a struct expression.
    pub(super) fn starts(&self, place: Place, members: &Members<'_, 'a>) -> String {
        members.expression(&|field| self.field_start(field), |part| {
            let name = place.struct_name(part);
            if self.without_default.contains(&name) {
                format!("{name} {{ {} }}", self.starts(place, &self.members(place, part)))
            } else {
                format!("{name}::default()")
            }
        })
    }

    /// The start value of a field.
    fn field_start(&self, field: &Field<'_>) -> String {
        let starts: Vec<_> = field.positions.iter().map(|&position| self.start(position)).collect();
        let are_equal = starts.iter().all(|start| *start == starts[0]);
        match &field.declaration.sizes[..] {
            sizes if !field.is_boxed && are_equal => filled(sizes, &starts[0], is_copy(field.data_type)),
            sizes if !field.is_boxed => nest(sizes, &starts),
            [size, inner @ ..] if are_equal => {
                let element = filled(inner, &starts[0], is_copy(field.data_type));
                format!("::fmu_export::typed::boxed(::std::vec![{element}; {size}])")
            }
            sizes => format!("::fmu_export::typed::boxed(::std::vec!{})", nest(sizes, &starts)),
        }
    }

    /// A variable's start value, or its value until it is calculated.
    fn start(&self, position: usize) -> String {
        let scalar = &self.model.scalars[position];
        match (&scalar.start, scalar.data_type) {
            (Some(Start::String(value)), _) => format!("String::from({value:?})"),
            (Some(Start::Binary(bytes)), _) => format!("Vec::from({bytes:?})"),
            (Some(Start::Item { position, .. }), ValueType::Enumeration(enumeration)) => {
                self.item(enumeration, *position)
            }
            (Some(value), _) => value.to_string(),
            (_, ValueType::Standard(DataType::Real | DataType::Float32)) => "0.0".to_owned(),
            (_, ValueType::Standard(DataType::Boolean)) => "false".to_owned(),
            (_, ValueType::Standard(DataType::String)) => "String::new()".to_owned(),
            (_, ValueType::Standard(DataType::Binary)) => "Vec::new()".to_owned(),
            (_, ValueType::Enumeration(enumeration)) => self.item(enumeration, 0),
            (_, ValueType::Standard(DataType::Clock)) => {
                match self.model.field(position).declaration.timing() {
                    Some([interval, shift]) => {
                        format!("::fmu_export::Clock::periodic({interval:?}, {shift:?})")
                    }
                    None => "::fmu_export::Clock::default()".to_owned(),
                }
            }
            _ => "0".to_owned(),
        }
    }

    pub(super) fn item(&self, enumeration: usize, item: usize) -> String {
        let enumeration = &self.model.declaration.enumerations[enumeration];
        format!("{}::{}", enumeration_path(enumeration), variant_name(&enumeration.items[item].name))
    }

    /// The Rust type of a scalar's value.
    pub(super) fn rust_type(&self, data_type: ValueType) -> String {
        if let Some((integer, _)) = data_type.integer() {
            return integer.to_owned();
        }
        let name = match data_type {
            ValueType::Enumeration(enumeration) => {
                return enumeration_path(&self.model.declaration.enumerations[enumeration]);
            }
            ValueType::Standard(DataType::Boolean) => "bool",
            ValueType::Standard(DataType::String) => "String",
            ValueType::Standard(DataType::Float32) => "f32",
            ValueType::Standard(DataType::Binary) => "Vec<u8>",
            ValueType::Standard(DataType::Clock) => "::fmu_export::Clock",
            ValueType::Standard(_) => "T",
        };
        name.to_owned()
    }

    /// Whether the variables are generic over their number type.
    pub(super) fn has_reals(&self) -> bool {
        PLACES.into_iter().any(|place| self.is_real(place))
    }

    /// Whether the variables have a field for a place.
    pub(super) fn has(&self, place: Place) -> bool {
        !place.is_optional() || self.model.in_place(place).next().is_some()
    }

    /// Whether the struct of a place is generic over its number type.
    pub(super) fn is_real(&self, place: Place) -> bool {
        self.model.parts.iter().flat_map(|part| place.fields(part)).any(is_real)
    }

    pub(super) fn value_reference(&self, position: usize) -> u32 {
        self.model.scalars[position].value_reference
    }

    /// A variable's first scalar.
    pub(super) fn first(&self, variable: &Variable<'_>) -> &'m Scalar {
        &self.model.scalars[variable.positions[0]]
    }

    /// The difference between the value references of a variable's elements.
    pub(super) fn stride(&self, variable: &Variable<'_>) -> u32 {
        match variable.positions[..] {
            [first, second, ..] => self.value_reference(second) - self.value_reference(first),
            _ => 1,
        }
    }

    /// The pattern of a variable's value references, and the path in a place of the one that is `reference`.
    pub(super) fn pattern(&self, variable: &Variable<'_>, is_mutable: bool) -> (String, String) {
        let scalar = self.first(variable);
        let (first, stride) = (scalar.value_reference, self.stride(variable));
        if !variable.is_array() {
            return (first.to_string(), scalar.path.clone());
        }
        let last = variable.positions.last().map_or(first, |&last| self.value_reference(last));
        let offset = format!("reference - {first}");
        let (guard, index) = match stride {
            1 => (String::new(), format!("({offset}) as usize")),
            _ => (format!(" if ({offset}) % {stride} == 0"), format!("(({offset}) / {stride}) as usize")),
        };
        (format!("{first}..={last}{guard}"), format!("{}[{index}]", self.flat(variable, is_mutable)))
    }

    /// The path in a place of all elements of an array, row by row.
    pub(super) fn flat(&self, variable: &Variable<'_>, is_mutable: bool) -> String {
        let flattened = if is_mutable { ".as_flattened_mut()" } else { ".as_flattened()" };
        // The path of the first element, whose indices are 0.
        let path = &self.first(variable).path;
        let path = path.strip_suffix(&"[0]".repeat(variable.sizes.len())).unwrap_or(path);
        path.to_owned() + &flattened.repeat(variable.sizes.len() - 1)
    }

    /// The variables of a place.
    pub(super) fn in_place(&self, place: Place) -> impl Iterator<Item = &Variable<'m>> {
        self.variables.iter().filter(move |variable| self.first(variable).place == place)
    }

    /// The Real inputs, each with the position of its first element among them.
    pub(super) fn real_inputs(&self) -> impl Iterator<Item = (usize, &Variable<'m>)> {
        let inputs = self.in_place(Place::Inputs);
        numbered(inputs.filter(|variable| self.first(variable).data_type == DataType::Real))
    }

    /// The states, each with the position of its first element among them.
    pub(super) fn numbered_states(&self) -> impl Iterator<Item = (usize, &Variable<'m>)> {
        numbered(self.in_place(Place::States))
    }

    /// The variables, ordered by value reference.
    pub(super) fn by_value_reference(&self) -> Vec<&Variable<'m>> {
        let mut variables: Vec<_> = self.variables.iter().collect();
        variables.sort_by_key(|variable| self.first(variable).value_reference);
        variables
    }

    /// The positions of the clocks: inputs first, by priority, then the others.
    pub(super) fn clocks_by_priority(&self) -> Vec<usize> {
        let mut clocks: Vec<_> = self.model.in_place(Place::Clocks).collect();
        clocks.sort_by_key(|&clock| {
            let priority = self.model.field(clock).declaration.priority.unwrap_or(u32::MAX);
            (!self.model.scalars[clock].is_input_clock(), priority)
        });
        clocks
    }

    /// An enumeration's items by value, as Rust text; empty for other types.
    pub(super) fn items(&self, scalar: &Scalar) -> String {
        let ValueType::Enumeration(enumeration) = scalar.data_type else { return String::new() };
        let items = self.model.declaration.enumerations[enumeration].valued();
        items.map(|(item, value)| format!("({value}, {:?})", item.name)).collect::<Vec<_>>().join(", ")
    }

    /// A variable's bounds, as Rust text.
    #[allow(clippy::cast_possible_truncation, reason = "bounds are rounded as values are")]
    pub(super) fn bounds(&self, scalar: &Scalar) -> (String, String) {
        match scalar.data_type {
            ValueType::Enumeration(enumeration) => {
                let values = || {
                    let enumeration = &self.model.declaration.enumerations[enumeration];
                    enumeration.valued().map(|(_, value)| f64::from(value))
                };
                (bound(values().reduce(f64::min), "0.0"), bound(values().reduce(f64::max), "0.0"))
            }
            ValueType::Standard(DataType::Real) if self.model.is_single_precision => {
                // A bound belongs to the range when it is rounded, and a value beyond `f32` would become infinite.
                let [min, max] =
                    [scalar.quantity.min.unwrap_or(f64::MIN), scalar.quantity.max.unwrap_or(f64::MAX)];
                let [of_min, of_max] = [min, max].map(|bound| f64::from(bound as f32));
                let least = min.min(of_min).max(f32::MIN.into());
                let most = max.max(of_max).min(f32::MAX.into());
                (format!("{least:?}"), format!("{most:?}"))
            }
            ValueType::Standard(_) => {
                (bound(scalar.quantity.min, "f64::NEG_INFINITY"), bound(scalar.quantity.max, "f64::INFINITY"))
            }
        }
    }
}

/// A bound as Rust text.
pub(super) fn bound(bound: Option<f64>, open: &str) -> String {
    bound.map_or_else(|| open.to_owned(), |bound| format!("{bound:?}"))
}

/// The path of an enumeration, for the rest of the text.
pub(super) fn enumeration_path(enumeration: &EnumerationDeclaration) -> String {
    format!("super::enumerations::{}", enumeration.rust_name())
}

/// A variable's path in `Variables`.
pub(super) fn full_path(scalar: &Scalar) -> String {
    format!("{}.{}", scalar.place.field_name(), scalar.path)
}

/// Variables, each with the number of scalars before.
fn numbered<'v, 'm: 'v>(
    variables: impl Iterator<Item = &'v Variable<'m>>,
) -> impl Iterator<Item = (usize, &'v Variable<'m>)> {
    variables.scan(0, |next, variable| {
        let first = *next;
        *next += variable.positions.len();
        Some((first, variable))
    })
}

/// Whether values of a type are `Copy`.
pub(super) fn is_copy(data_type: ValueType) -> bool {
    !matches!(data_type.data_type(), DataType::String | DataType::Binary)
}

/// Whether a field is a number over which its struct is generic.
pub(super) fn is_real(field: &Field<'_>) -> bool {
    field.data_type == DataType::Real
}

/// What a generated struct contains in a place: variables, and components, each with its own struct.
pub(super) struct Members<'m, 'a> {
    pub(super) fields: Vec<&'m Field<'a>>,
    pub(super) components: Vec<Component<'m, 'a>>,
}

/// A component, or an array of them.
pub(super) struct Component<'m, 'a> {
    /// The component, or the array's elements.
    pub(super) parts: Vec<&'m Part<'a>>,
    pub(super) is_array: bool,
}

impl<'m, 'a> Component<'m, 'a> {
    /// All components of a list, in which elements of arrays follow each other.
    pub(super) fn all(parts: impl Iterator<Item = &'m Part<'a>>) -> Vec<Self> {
        let mut components: Vec<Self> = Vec::new();
        for part in parts {
            match components.last_mut().filter(|_| part.index.is_some_and(|index| index > 0)) {
                Some(array) => array.parts.push(part),
                None => components.push(Self { parts: vec![part], is_array: part.index.is_some() }),
            }
        }
        components
    }

    pub(super) fn first(&self) -> &'m Part<'a> {
        self.parts[0]
    }

    /// The array's size; none for a single component.
    pub(super) fn size(&self) -> Option<usize> {
        self.is_array.then_some(self.parts.len())
    }
}

impl<'a> Members<'_, 'a> {
    /// The fields of a struct expression.
    fn expression(
        &self,
        value: &dyn Fn(&Field<'_>) -> String,
        component: impl Fn(&Part<'a>) -> String,
    ) -> String {
        let fields: Vec<_> =
            self.fields.iter().map(|field| format!("{}: {}", field.name(), value(field))).collect();
        let own = (!fields.is_empty()).then(|| fields.join(", "));
        let nested = self.components.iter().map(|known| {
            let each: Vec<_> = known.parts.iter().map(|part| component(part)).collect();
            let value = match known.size() {
                None => each.concat(),
                Some(size) if each.iter().all(|value| *value == each[0]) => filled(&[size], &each[0], false),
                Some(_) => format!("[{}]", each.join(", ")),
            };
            format!("{}: {value}", known.first().rust_name())
        });
        own.into_iter().chain(nested).collect::<Vec<_>>().join(",\n            ")
    }
}

/// An array expression of equal elements.
pub(super) fn filled(sizes: &[usize], element: &str, is_copy: bool) -> String {
    sizes.iter().rev().fold(element.to_owned(), |inner, size| {
        if is_copy { format!("[{inner}; {size}]") } else { format!("::core::array::from_fn(|_| {inner})") }
    })
}

/// An array expression from its elements' expressions, row by row.
fn nest(dimensions: &[usize], elements: &[String]) -> String {
    match dimensions {
        [] => elements.concat(),
        [_] => format!("[{}]", elements.join(", ")),
        [size, inner @ ..] => {
            let rows: Vec<_> =
                elements.chunks(elements.len() / size).map(|elements| nest(inner, elements)).collect();
            format!("[{}]", rows.join(", "))
        }
    }
}

/// A description for rustdoc; without one, the name.
pub(super) fn described(description: Option<&str>, name: &str) -> String {
    description.map_or_else(|| format!("`{}`", comment(name)), markdown)
}

/// A description for rustdoc: markup is escaped.
pub(super) fn markdown(text: &str) -> String {
    let mut escaped = String::new();
    // Indented or `~~~` text would be code, which rustdoc compiles.
    for character in comment(text.trim()).chars() {
        if "\\`*_[]<>~".contains(character) {
            escaped.push('\\');
        }
        // A comment is one line.
        escaped.push(if character.is_whitespace() { ' ' } else { character });
    }
    escaped
}
