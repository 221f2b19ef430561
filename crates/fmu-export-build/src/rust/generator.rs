//! The generator, and expressions that all of its texts have in common.

use std::collections::{BTreeMap, BTreeSet};

use crate::data_type::DataType;
use crate::declaration::EnumerationDeclaration;
use crate::dependencies::Structure;
use crate::model::{Model, Part, Place, Scalar};
use crate::names::pascal_case;
use crate::start::Start;
use crate::type_names::PLACES;

pub(super) struct Generator<'m, 'a> {
    pub(super) model: &'m Model<'a>,
    pub(super) structure: &'m Structure,
    /// The structs of components with equal start values, which therefore have a default.
    pub(super) with_default: BTreeSet<String>,
}

impl<'m, 'a> Generator<'m, 'a> {
    pub(super) fn new(model: &'m Model<'a>, structure: &'m Structure) -> Self {
        let mut generator = Self { model, structure, with_default: BTreeSet::new() };
        let mut starts: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for place in PLACES {
            for part in model.parts.iter().filter(|part| part.name.is_some() && place.is_in(part)) {
                starts.entry(place.struct_name(part)).or_default().insert(generator.starts(place, part));
            }
        }
        generator.with_default =
            starts.into_iter().filter(|(_, starts)| starts.len() == 1).map(|(name, _)| name).collect();
        generator
    }

    /// The start values of a part's variables.
    pub(super) fn starts(&self, place: Place, part: &Part<'_>) -> String {
        values(place, part, |position| self.start(position))
    }

    /// A variable's start value, or its value until it is calculated.
    fn start(&self, position: usize) -> String {
        let scalar = &self.model.scalars[position];
        match (&scalar.start, scalar.data_type) {
            (Some(Start::String(value)), _) => format!("String::from({value:?})"),
            (Some(Start::Binary(bytes)), _) => format!("Vec::from({bytes:?})"),
            (Some(Start::Item(item)), DataType::Enumeration(enumeration)) => self.item(enumeration, *item),
            (Some(value), _) => value.to_string(),
            (_, DataType::Real | DataType::Float32) => "0.0".to_owned(),
            (_, DataType::Boolean) => "false".to_owned(),
            (_, DataType::String) => "String::new()".to_owned(),
            (_, DataType::Binary) => "Vec::new()".to_owned(),
            (_, DataType::Enumeration(enumeration)) => self.item(enumeration, 0),
            (_, DataType::Clock) => match self.model.field(position).declaration.timing() {
                Some([interval, shift]) => format!("::fmu_export::Clock::periodic({interval:?}, {shift:?})"),
                None => "::fmu_export::Clock::default()".to_owned(),
            },
            _ => "0".to_owned(),
        }
    }

    pub(super) fn item(&self, enumeration: usize, item: usize) -> String {
        let enumeration = &self.model.declaration.enumerations[enumeration];
        format!("{}::{}", enumeration_path(enumeration), pascal_case(&enumeration.items[item].name))
    }

    /// The Rust type of a scalar's value.
    pub(super) fn rust_type(&self, data_type: DataType) -> String {
        if let Some((integer, _)) = data_type.integer() {
            return integer.to_owned();
        }
        let name = match data_type {
            DataType::Enumeration(enumeration) => {
                return enumeration_path(&self.model.declaration.enumerations[enumeration]);
            }
            DataType::Boolean => "bool",
            DataType::String => "String",
            DataType::Float32 => "f32",
            DataType::Binary => "Vec<u8>",
            DataType::Clock => "::fmu_export::Clock",
            _ => "T",
        };
        name.to_owned()
    }

    /// Whether the variables are generic over their number type.
    pub(super) fn has_reals(&self) -> bool {
        PLACES.into_iter().any(|place| self.is_real(place))
    }

    pub(super) fn has_clocks(&self) -> bool {
        self.model.in_place(Place::Clocks).next().is_some()
    }

    /// Whether the struct of a place is generic over its number type.
    pub(super) fn is_real(&self, place: Place) -> bool {
        self.model.parts.iter().any(|part| place.is_real_in(part))
    }

    /// The states, in the order of their arrays.
    pub(super) fn states(&self) -> impl Iterator<Item = &'m Scalar> + use<'_, 'm, 'a> {
        self.model.in_place(Place::States).map(|position| &self.model.scalars[position])
    }

    pub(super) fn value_reference(&self, position: usize) -> u32 {
        self.model.scalars[position].value_reference
    }

    pub(super) fn real_inputs(&self) -> impl Iterator<Item = usize> {
        self.model
            .in_place(Place::Inputs)
            .filter(|&position| self.model.scalars[position].data_type == DataType::Real)
    }

    /// The variables' positions, ordered by value reference.
    pub(super) fn by_value_reference(&self) -> Vec<usize> {
        let mut positions: Vec<_> = (0..self.model.scalars.len()).collect();
        positions.sort_by_key(|&position| self.model.scalars[position].value_reference);
        positions
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

    /// A variable's bounds, as Rust text.
    pub(super) fn bounds(&self, scalar: &Scalar) -> (String, String) {
        match scalar.data_type {
            DataType::Enumeration(enumeration) => {
                let items = self.model.declaration.enumerations[enumeration].items.len();
                ("1.0".to_owned(), format!("{items}.0"))
            }
            _ => (bound(scalar.min, "f64::NEG_INFINITY"), bound(scalar.max, "f64::INFINITY")),
        }
    }
}

/// A bound as Rust text.
pub(super) fn bound(bound: Option<f64>, open: &str) -> String {
    bound.map_or_else(|| open.to_owned(), |bound| format!("{bound:?}"))
}

/// The path of an enumeration, for the rest of the text.
pub(super) fn enumeration_path(enumeration: &EnumerationDeclaration) -> String {
    format!("super::enumerations::{}", enumeration.name)
}

/// A variable's path in `Variables`.
pub(super) fn full_path(scalar: &Scalar) -> String {
    format!("{}.{}", scalar.place.field_name(), scalar.path)
}

/// Each position's place in a list.
pub(super) fn numbered(positions: &[usize]) -> BTreeMap<usize, usize> {
    positions.iter().enumerate().map(|(place, &position)| (position, place)).collect()
}

/// A part's variables as the fields of a struct expression, from their scalars' values.
pub(super) fn values(place: Place, part: &Part<'_>, value: impl Fn(usize) -> String) -> String {
    let fields = place.fields(part).map(|field| {
        let values: Vec<_> = field.positions.iter().map(|&position| value(position)).collect();
        format!("{}: {}", field.name(), nest(&field.declaration.sizes, &values))
    });
    fields.collect::<Vec<_>>().join(", ")
}

/// Likewise for several parts, each component in its own struct.
pub(super) fn nested_values(place: Place, parts: &[&Part<'_>], value: impl Fn(usize) -> String) -> String {
    let parts = parts.iter().map(|part| {
        let values = values(place, part, &value);
        match part.name {
            None => values,
            Some(component) => format!("{component}: {} {{ {values} }}", place.struct_name(part)),
        }
    });
    parts.collect::<Vec<_>>().join(",\n            ")
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
    description.map_or_else(|| format!("`{name}`"), markdown)
}

/// A description for rustdoc: markup is escaped.
pub(super) fn markdown(text: &str) -> String {
    let mut escaped = String::new();
    // Indented or `~~~` text would be code, which rustdoc compiles.
    for character in text.trim().chars() {
        if "\\`*_[]<>~".contains(character) {
            escaped.push('\\');
        }
        escaped.push(character);
    }
    escaped
}
