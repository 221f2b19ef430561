//! The typed Rust interface, which a model uses instead of value references.
//!
//! The text is included in a module of the model's crate, whose lints should not apply to it: hence an inner module
//! with `#[allow]`. Macros of `fmu-export` implement what all generated structs have in common.

mod access;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use crate::declaration::{Declaration, Described, EnumerationDeclaration, UnitNames};
use crate::dependencies::Structure;
use crate::model::{DataType, Field, Model, Part, Place, Start};

/// The types that are always generated.
pub(crate) const FIXED_NAMES: [&str; 7] =
    ["Parameters", "Inputs", "States", "Locals", "Outputs", "Variables", "Evaluation"];

/// The type that holds all state groups, if any.
const STATE_GROUPS: &str = "StateGroups";

/// The places with their own structs; derivatives use those of the states. Clocks have one if there are any.
const PLACES: [Place; 6] =
    [Place::Parameters, Place::Inputs, Place::States, Place::Locals, Place::Outputs, Place::Clocks];

impl Place {
    pub(crate) fn type_name(self) -> &'static str {
        match self {
            Self::Parameters => "Parameters",
            Self::Inputs => "Inputs",
            Self::States | Self::Derivatives => "States",
            Self::Locals | Self::Time | Self::EventIndicators => "Locals",
            Self::Outputs => "Outputs",
            Self::Clocks => "Clocks",
        }
    }

    fn description(self) -> &'static str {
        match self {
            Self::Parameters => "The parameters",
            Self::Inputs => "The inputs",
            Self::States | Self::Derivatives => "The continuous-time states",
            Self::Locals | Self::Time | Self::EventIndicators => "The local variables other than states",
            Self::Outputs => "The outputs other than states",
            Self::Clocks => "The clocks",
        }
    }

    fn fields<'p, 'a>(self, part: &'p Part<'a>) -> impl Iterator<Item = &'p Field<'a>> {
        part.fields.iter().filter(move |field| field.place == self)
    }

    fn is_in(self, part: &Part<'_>) -> bool {
        self.fields(part).next().is_some()
    }

    /// Whether a part has Real variables in this place.
    fn is_real_in(self, part: &Part<'_>) -> bool {
        self.fields(part).any(|field| field.data_type == DataType::Real)
    }

    /// The struct that holds a part's variables.
    fn struct_name(self, part: &Part<'_>) -> String {
        let prefix = match (part.component_type, part.name) {
            (Some(component_type), _) => component_type.to_owned(),
            (None, name) => pascal_case(name.unwrap_or_default()),
        };
        prefix + self.type_name()
    }
}

/// The struct names of component variables and state groups, each with the path of its origin.
pub(crate) fn struct_names(declaration: &Declaration, parts: &[Part<'_>]) -> Vec<(String, String)> {
    let mut types = BTreeSet::new();
    let mut is_first =
        |part: &&Part<'_>| part.component_type.is_none_or(|name| types.insert(name.to_owned()));
    let own: Vec<_> = parts.iter().filter(|part| part.name.is_some() && is_first(part)).collect();
    let groups = declaration.state_groups.iter().enumerate();
    own.into_iter()
        .flat_map(|part| {
            let places = PLACES.into_iter().filter(|place| place.is_in(part));
            places.map(|place| (format!("{}.name", part.key), place.struct_name(part)))
        })
        .chain(
            groups.map(|(number, group)| (format!("state_groups[{number}].name"), states_name(&group.name))),
        )
        .chain(
            (!declaration.state_groups.is_empty())
                .then(|| ("state_groups".to_owned(), STATE_GROUPS.to_owned())),
        )
        .collect()
}

/// The struct that holds a group's states.
fn states_name(group: &str) -> String {
    pascal_case(group) + Place::States.type_name()
}

/// `hpCompressor` and `HP compressor` as `hp_compressor`.
pub(crate) fn snake_case(name: &str) -> String {
    let mut snake = String::new();
    let mut after_lower = false;
    for character in name.chars() {
        if character.is_ascii_uppercase() && after_lower {
            snake.push('_');
        }
        after_lower = character.is_ascii_lowercase() || character.is_ascii_digit();
        snake.push(if character == ' ' { '_' } else { character.to_ascii_lowercase() });
    }
    snake
}

/// `hp_compressor` and `hp compressor` as `HpCompressor`.
pub(crate) fn pascal_case(name: &str) -> String {
    name.split(['_', ' '])
        .flat_map(|word| {
            let mut characters = word.chars();
            let first = characters.next().map(|first| first.to_ascii_uppercase());
            first.into_iter().chain(characters)
        })
        .collect()
}

/// The lints that do not apply to generated code.
const LINTS: &str =
    "dead_code, unused_variables, nonstandard_style, clippy::all, clippy::pedantic, rustdoc::bare_urls";

/// The text of `variables.rs`.
pub(crate) fn generate(model: &Model<'_>, structure: &Structure, guid: &str) -> String {
    let mut generator = Generator { model, structure, with_default: BTreeSet::new() };
    generator.with_default = generator.structs_with_default();
    let mut text = format!(
        "// Generated by fmu-export-build from the declaration of {}. Do not edit.

#[allow(unused_imports)]
pub use generated::*;
/// Defines the functions of FMI for a model with these variables.
#[allow(unused_imports)]
pub use ::fmu_export::{} as export_functions;
{enumerations}
#[allow({LINTS})]
mod generated {{
use ::fmu_export::description as fmi;
",
        model.identifier,
        model.fmi.macro_name(model.declaration),
        enumerations = enumerations(&model.declaration.enumerations),
    );
    let mut written = BTreeSet::new();
    for place in PLACES {
        for part in model.parts.iter().filter(|part| part.name.is_some() && place.is_in(part)) {
            if written.insert(place.struct_name(part)) {
                text += &generator.component_struct(place, part);
            }
        }
        let parts: Vec<_> = model.parts.iter().filter(|part| place.is_in(part)).collect();
        if place == Place::Clocks && parts.is_empty() {
            continue;
        }
        let description = format!("{} of the model.", place.description());
        text += &generator.place_struct(place, place.type_name(), &description, &parts);
    }
    text += &generator.states_impl();
    text += &generator.state_groups();
    text += &generator.variables_struct();
    text += &generator.evaluation_struct();
    text += &generator.inputs_impl();
    text += &generator.variables_impl();
    text += &generator.description(guid);
    text + "}\n"
}

/// Whether values of a type are `Copy`.
fn is_copy(data_type: DataType) -> bool {
    !matches!(data_type, DataType::String | DataType::Binary)
}

/// The enumerations, in their own module: their names are free, such as `Vec`, and the rest of the text refers to them
/// by path.
fn enumerations(enumerations: &[EnumerationDeclaration]) -> String {
    if enumerations.is_empty() {
        return String::new();
    }
    let texts: String = enumerations.iter().map(enumeration_text).collect();
    format!(
        "
#[allow(unused_imports)]
pub use enumerations::*;

#[allow({LINTS})]
mod enumerations {{{texts}}}
"
    )
}

/// An enumeration's path, for the rest of the text.
fn enumeration_path(enumeration: &EnumerationDeclaration) -> String {
    format!("super::enumerations::{}", enumeration.name)
}

fn enumeration_text(enumeration: &EnumerationDeclaration) -> String {
    let name = &enumeration.name;
    let (mut items, mut values) = (String::new(), Vec::new());
    for (item, value) in enumeration.items.iter().zip(1..) {
        let value: i32 = value;
        let variant = pascal_case(&item.name);
        let _ = writeln!(items, "    /// {}\n    {variant} = {value},", markdown(&item.description));
        values.push(format!("{variant} = {value}"));
    }
    format!(
        "
/// {}
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum {name} {{
{items}}}

::fmu_export::enumeration!({name} {{ {} }});
",
        markdown(&enumeration.description),
        values.join(", ")
    )
}

struct Generator<'m, 'a> {
    model: &'m Model<'a>,
    structure: &'m Structure,
    /// The structs of components with equal start values, which therefore have a default.
    with_default: BTreeSet<String>,
}

impl Generator<'_, '_> {
    /// The struct for the variables of a component, or of all components of a type.
    fn component_struct(&self, place: Place, part: &Part<'_>) -> String {
        let name = place.struct_name(part);
        let of = match (part.component_type, part.name) {
            (Some(component_type), _) => format!("a `{component_type}`"),
            (None, name) => described(part.description, name.unwrap_or_default()),
        };
        let title = format!("{} of {of}.", place.description());
        let fields = place.fields(part).map(|field| self.field(field)).collect();
        let mut text = structure(&name, &title, fields);
        if self.with_default.contains(&name) {
            text += &default(&name, &values(place, part, |position| self.start(position)));
        }
        text
    }

    fn structs_with_default(&self) -> BTreeSet<String> {
        let mut starts: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for place in PLACES {
            for part in self.model.parts.iter().filter(|part| part.name.is_some() && place.is_in(part)) {
                let values = values(place, part, |position| self.start(position));
                starts.entry(place.struct_name(part)).or_default().insert(values);
            }
        }
        starts.into_iter().filter(|(_, starts)| starts.len() == 1).map(|(name, _)| name).collect()
    }

    /// The struct for some parts' variables.
    fn place_struct(&self, place: Place, name: &str, title: &str, parts: &[&Part<'_>]) -> String {
        let (mut fields, mut starts) = (Vec::new(), Vec::new());
        for part in parts {
            let Some(component) = part.name else {
                fields.extend(place.fields(part).map(|field| self.field(field)));
                starts.push(values(place, part, |position| self.start(position)));
                continue;
            };
            let part_name = place.struct_name(part);
            let is_generic = place.is_real_in(part);
            let generic = if is_generic { "<T>" } else { "" };
            fields.push(StructField {
                name: component.to_owned(),
                description: described(part.description, component),
                data_type: format!("{part_name}{generic}"),
                kind: if is_generic { Kind::Nested } else { Kind::Other },
                is_copy: place.fields(part).all(|field| is_copy(field.data_type)),
            });
            let start = if self.with_default.contains(&part_name) {
                format!("{component}: {part_name}::default()")
            } else {
                format!(
                    "{component}: {part_name} {{ {} }}",
                    values(place, part, |position| self.start(position))
                )
            };
            starts.push(start);
        }
        structure(name, title, fields) + &default(name, &starts.join(",\n            "))
    }

    fn field(&self, field: &Field<'_>) -> StructField {
        let declaration = field.declaration;
        let unit = match &declaration.unit {
            Some(UnitNames::All(unit)) if unit != "1" => format!(" (`{unit}`)"),
            Some(UnitNames::Each(units)) => format!(" (`{}`)", units.join("`, `")),
            _ => String::new(),
        };
        let path;
        let mut data_type = match field.data_type {
            DataType::Real => "T",
            DataType::Integer => "i32",
            DataType::Boolean => "bool",
            DataType::String => "String",
            DataType::Enumeration(enumeration) => {
                path = enumeration_path(&self.model.declaration.enumerations[enumeration]);
                &path
            }
            DataType::Float32 => "f32",
            DataType::Whole(whole) => whole.in_rust().0,
            DataType::Binary => "Vec<u8>",
            DataType::Clock => "::fmu_export::Clock",
        }
        .to_owned();
        for size in declaration.sizes.iter().rev() {
            data_type = format!("[{data_type}; {size}]");
        }
        StructField {
            name: field.name(),
            description: described(declaration.description.as_deref(), &declaration.name) + &unit,
            data_type,
            kind: if field.data_type == DataType::Real {
                Kind::Number(declaration.sizes.clone())
            } else {
                Kind::Other
            },
            is_copy: is_copy(field.data_type),
        }
    }

    /// A variable's start value, or its value until it is calculated.
    fn start(&self, position: usize) -> String {
        let scalar = &self.model.scalars[position];
        match (&scalar.start, scalar.data_type) {
            (Some(Start::Real(value)), _) => format!("{value:?}"),
            (Some(Start::Integer(value)), _) => value.to_string(),
            (Some(Start::Boolean(value)), _) => value.to_string(),
            (Some(Start::String(value)), _) => format!("String::from({value:?})"),
            (Some(Start::Binary(bytes)), _) => format!("Vec::from({bytes:?})"),
            (Some(Start::Item(item)), DataType::Enumeration(enumeration)) => self.item(enumeration, *item),
            (_, DataType::Real | DataType::Float32) => "0.0".to_owned(),
            (_, DataType::Integer | DataType::Whole(_)) => "0".to_owned(),
            (_, DataType::Boolean) => "false".to_owned(),
            (_, DataType::String) => "String::new()".to_owned(),
            (_, DataType::Binary) => "Vec::new()".to_owned(),
            (_, DataType::Enumeration(enumeration)) => self.item(enumeration, 0),
            (_, DataType::Clock) => match self.model.field(position).declaration.timing() {
                Some([interval, shift]) => format!("::fmu_export::Clock::periodic({interval:?}, {shift:?})"),
                None => "::fmu_export::Clock::default()".to_owned(),
            },
        }
    }

    fn item(&self, enumeration: usize, item: usize) -> String {
        let enumeration = &self.model.declaration.enumerations[enumeration];
        format!("{}::{}", enumeration_path(enumeration), pascal_case(&enumeration.items[item].name))
    }

    /// The struct that holds all places.
    fn variables_struct(&self) -> String {
        let fields = [
            ("parameters", "The parameters.", Place::Parameters),
            (
                "inputs",
                "The inputs as set, possibly out of bounds; a model receives them within bounds.",
                Place::Inputs,
            ),
            ("start", "The states' start values, as the importer set them.", Place::States),
            ("states", "The states.", Place::States),
            ("derivatives", "The time derivatives of the states.", Place::States),
            ("locals", "The local variables other than states.", Place::Locals),
            ("outputs", "The outputs other than states.", Place::Outputs),
            ("clocks", "The clocks.", Place::Clocks),
        ];
        let fields = fields.into_iter().take(if self.has_clocks() { 8 } else { 7 });
        let fields = fields.map(|(name, description, place)| {
            let is_generic = self.is_real(place);
            let generic = if is_generic { "<T>" } else { "" };
            StructField {
                name: name.to_owned(),
                description: description.to_owned(),
                data_type: format!("{}{generic}", place.type_name()),
                kind: if is_generic { Kind::Nested } else { Kind::Other },
                is_copy: false,
            }
        });
        let fields: Vec<_> = fields.collect();
        let start = |field: &StructField| format!("{}: ::core::default::Default::default()", field.name);
        let starts: Vec<_> = fields.iter().map(start).collect();
        structure("Variables", "All variables of the model.", fields)
            + &default("Variables", &starts.join(",\n            "))
    }

    /// The struct that equations receive: read-only parts by shared references.
    fn evaluation_struct(&self) -> String {
        let fields = [
            ("parameters", "The parameters.", Place::Parameters, ""),
            ("inputs", "The inputs, within their bounds.", Place::Inputs, ""),
            ("states", "The states.", Place::States, ""),
            ("derivatives", "The time derivatives of the states, to be calculated.", Place::States, "mut "),
            ("locals", "The local variables other than states, to be calculated.", Place::Locals, "mut "),
            ("outputs", "The outputs other than states, to be calculated.", Place::Outputs, "mut "),
        ];
        let fields = fields.map(|(name, description, place, mutable)| {
            let generic = if self.is_real(place) { "<T>" } else { "" };
            format!("    /// {description}\n    pub {name}: &'a {mutable}{}{generic},\n", place.type_name())
        });
        let parameter = if self.has_reals() { ", T = f64" } else { "" };
        format!(
            "
/// What equations read and calculate.
#[derive(Debug)]
pub struct Evaluation<'a{parameter}> {{
{}}}
",
            fields.concat()
        )
    }

    /// Whether the variables are generic over their number type.
    fn has_reals(&self) -> bool {
        PLACES.into_iter().any(|place| self.is_real(place))
    }

    fn has_clocks(&self) -> bool {
        self.model.in_place(Place::Clocks).next().is_some()
    }

    /// Whether the struct of a place is generic over its number type.
    fn is_real(&self, place: Place) -> bool {
        self.model.parts.iter().any(|part| place.is_real_in(part))
    }

    /// All states as an array, for solvers.
    fn states_impl(&self) -> String {
        let parts: Vec<_> = self.model.parts.iter().filter(|part| Place::States.is_in(part)).collect();
        self.arrays(Place::States.type_name(), &parts, "")
    }

    /// The structs that each hold a group's states.
    fn state_groups(&self) -> String {
        let groups = &self.model.declaration.state_groups;
        let mut text = String::new();
        let (mut members, mut fields) = (String::new(), vec![String::new(); self.model.parts.len()]);
        let mut parts_of: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for (position, part) in self.model.parts.iter().enumerate() {
            parts_of.entry(part.state_group).or_default().push((position, part));
        }
        for Described { name: group, description } in groups {
            let name = states_name(group);
            let own = parts_of.remove(&Some(group.as_str())).unwrap_or_default();
            let parts: Vec<_> = own.iter().map(|(_, part)| *part).collect();
            let nominal =
                |position: usize| format!("{:?}", self.model.scalars[position].nominal.unwrap_or(1.0));
            let min = |position: usize| match self.model.scalars[position].min {
                Some(min) => format!("{min:?}"),
                None => "f64::NEG_INFINITY".to_owned(),
            };
            let constants = format!(
                "
    /// The states' nominal values; 1 if undeclared.
    pub const NOMINAL: Self = Self {{
            {}
    }};

    /// The declared minimum values.
    pub const MIN: Self = Self {{
            {}
    }};
",
                nested_values(Place::States, &parts, nominal),
                nested_values(Place::States, &parts, min),
            );
            let title = format!("The states of a group: {}.", markdown(description));
            text += &self.place_struct(Place::States, &name, &title, &parts);
            text += &self.arrays(&name, &parts, &constants);
            let of = parts.iter().filter_map(|part| part.name);
            let of: Vec<_> = of.map(|name| format!("{name}: states.{name}")).collect();
            let _ = write!(
                text,
                "
impl<T: ::core::marker::Copy> {name}<T> {{
    /// This group's states among all states.
    #[must_use]
    pub fn of(states: &States<T>) -> Self {{
        Self {{ {} }}
    }}
}}
",
                of.join(", ")
            );
            let _ = writeln!(members, "    /// {}\n    pub {group}: {name}<T>,", markdown(description));
            for (position, part) in own {
                let component = part.name.unwrap_or_default();
                fields[position] = format!("            {component}: groups.{group}.{component},\n");
            }
        }
        if !groups.is_empty() {
            let _ = write!(
                text,
                "
/// All states by group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct {STATE_GROUPS}<T = f64> {{
{members}}}

impl<T: ::core::marker::Copy> States<T> {{
    /// All states, from their groups.
    #[must_use]
    pub fn from_groups(groups: {STATE_GROUPS}<T>) -> Self {{
        Self {{
{}        }}
    }}
}}
",
                fields.concat()
            );
        }
        text
    }

    /// Some parts' states as an array, with further constants.
    fn arrays(&self, name: &str, parts: &[&Part<'_>], constants: &str) -> String {
        let fields = parts.iter().flat_map(|part| Place::States.fields(part));
        let positions: Vec<_> = fields.flat_map(|field| field.positions.iter().copied()).collect();
        let states: Vec<_> = positions.iter().map(|&position| &self.model.scalars[position]).collect();
        let names: Vec<_> = states.iter().map(|state| format!("{:?}", state.name)).collect();
        let values: Vec<_> = states.iter().map(|state| format!("self.{}", state.path)).collect();
        let places = numbered(&positions);
        let element = |position| format!("values[{}]", places[&position]);
        let fields = nested_values(Place::States, parts, element);
        let argument = if states.is_empty() { "_" } else { "values" };
        let (of, to, real) =
            if states.is_empty() { ("", "", "f64") } else { ("<T: ::core::marker::Copy>", "<T>", "T") };
        let count = states.len();
        format!(
            "
impl {name} {{
    /// The number of states.
    pub const COUNT: usize = {count};

    /// The names of the states, in the order of the arrays.
    pub const NAMES: [&'static str; Self::COUNT] = [{names}];
{constants}}}

impl{of} {name}{to} {{
    /// The states from an array, in the order of declaration.
    #[must_use]
    pub fn from_array({argument}: [{real}; {count}]) -> Self {{
        Self {{
            {fields}
        }}
    }}

    /// The states as an array, in the order of declaration.
    #[must_use]
    pub const fn to_array(&self) -> [{real}; {count}] {{
        [{values}]
    }}
}}
",
            names = names.join(", "),
            values = values.join(", "),
        )
    }
}

/// Each position's place in a list.
fn numbered(positions: &[usize]) -> BTreeMap<usize, usize> {
    positions.iter().enumerate().map(|(place, &position)| (position, place)).collect()
}

/// A part's variables as the fields of a struct expression, from their scalars' values.
fn values(place: Place, part: &Part<'_>, value: impl Fn(usize) -> String) -> String {
    let fields = place.fields(part).map(|field| {
        let values: Vec<_> = field.positions.iter().map(|&position| value(position)).collect();
        format!("{}: {}", field.name(), nest(&field.declaration.sizes, &values))
    });
    fields.collect::<Vec<_>>().join(", ")
}

/// Likewise for several parts, each component in its own struct.
fn nested_values(place: Place, parts: &[&Part<'_>], value: impl Fn(usize) -> String) -> String {
    let parts = parts.iter().map(|part| {
        let values = values(place, part, &value);
        match part.name {
            None => values,
            Some(component) => format!("{component}: {} {{ {values} }}", place.struct_name(part)),
        }
    });
    parts.collect::<Vec<_>>().join(",\n            ")
}

/// A field of a generated struct.
struct StructField {
    name: String,
    description: String,
    data_type: String,
    kind: Kind,
    is_copy: bool,
}

/// A field's kind in the macro `numbers!`.
enum Kind {
    /// A Real, or an array of these sizes.
    Number(Vec<usize>),
    /// A struct generic over the number type.
    Nested,
    Other,
}

/// A struct, generic over its number type if it has Reals, with the functions of its kind.
fn structure(name: &str, title: &str, fields: Vec<StructField>) -> String {
    let generic = fields.iter().any(|field| !matches!(field.kind, Kind::Other));
    let copy = if fields.iter().all(|field| field.is_copy) { "Copy, " } else { "" };
    let parameter = if generic { "<T = f64>" } else { "" };
    let (mut members, mut kinds, mut names) = (String::new(), Vec::new(), Vec::new());
    for StructField { name, description, data_type, kind, .. } in fields {
        let _ = writeln!(members, "    /// {description}\n    pub {name}: {data_type},");
        kinds.push(match kind {
            Kind::Number(sizes) => {
                let sizes = sizes.iter().map(|size| format!("[{size}]"));
                format!("number {name}{}", sizes.collect::<String>())
            }
            Kind::Nested => format!("nested {name}"),
            Kind::Other => format!("other {name}"),
        });
        names.push(name);
    }
    let mut text = format!(
        "
/// {title}
#[derive(Clone, {copy}Debug, PartialEq)]
pub struct {name}{parameter} {{
{members}}}

::fmu_export::persistent!({name} {{ {} }});
",
        names.join(", ")
    );
    if generic {
        let _ = writeln!(text, "::fmu_export::numbers!({name} {{ {} }});", kinds.join(", "));
    }
    text
}

fn default(name: &str, fields: &str) -> String {
    format!(
        "
impl ::core::default::Default for {name} {{
    fn default() -> Self {{
        Self {{
            {fields}
        }}
    }}
}}
"
    )
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
fn described(description: Option<&str>, name: &str) -> String {
    description.map_or_else(|| format!("`{name}`"), markdown)
}

/// A description for rustdoc: markup is escaped.
fn markdown(text: &str) -> String {
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
