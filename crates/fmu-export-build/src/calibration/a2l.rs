//! The A2L of a model (ASAM MCD-2 MC, version 1.7.1): its parameters and measurements for calibration tools, from the model's
//! JSON.
//!
//! Addresses are 0 until `cargo fmu a2l` takes them from the firmware's image: `SYMBOL_LINK` names a symbol there and the
//! distance from it.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use fmu_terms::{DataType, Linear, Variability};

use super::Cells;
use crate::model::{Model, Part, Scalar, Variable, without_subscripts};
use crate::value_type::ValueType;

/// The symbol of the page that calibration tools write.
const WORKING_PAGE: &str = "CALIBRATION_PAGE";
/// The symbol of what they read.
const MEASUREMENTS: &str = "MEASUREMENTS";

/// Writes the A2L.
pub(crate) fn write(model: &Model<'_>, parameters: &[Cells<'_>], measurements: &[Cells<'_>]) -> String {
    let mut writer = Writer {
        model,
        names: names(model, parameters.iter().chain(measurements)),
        conversions: BTreeMap::new(),
        layouts: BTreeMap::new(),
        items: String::new(),
    };
    for cells in parameters {
        writer.parameter(cells);
    }
    for cells in measurements {
        writer.measurement(cells);
    }
    let groups = writer.groups(parameters, measurements);
    let Writer { conversions, layouts, items, .. } = writer;
    let name = identifier(&model.identifier);
    let description = quoted(model.description.as_deref().unwrap_or(&model.identifier));
    let conversions: String = conversions.into_values().collect();
    let layouts: String = layouts.into_values().collect();
    format!(
        "ASAP2_VERSION 1 71

/begin PROJECT {name} {description}
  /begin HEADER {description}
    VERSION {version}
  /end HEADER
  /begin MODULE {name} {description}
    /begin MOD_COMMON \"\"
      DEPOSIT ABSOLUTE
      BYTE_ORDER MSB_LAST
      ALIGNMENT_BYTE 1
      ALIGNMENT_WORD 2
      ALIGNMENT_LONG 4
      ALIGNMENT_INT64 8
      ALIGNMENT_FLOAT32_IEEE 4
      ALIGNMENT_FLOAT64_IEEE 8
    /end MOD_COMMON
{conversions}{layouts}{items}{groups}  /end MODULE
/end PROJECT
",
        version = quoted(model.version),
    )
}

struct Writer<'m, 'a> {
    model: &'m Model<'a>,
    /// The identifiers of the variables, by the positions of their first scalars.
    names: BTreeMap<usize, String>,
    /// The conversions by their names.
    conversions: BTreeMap<String, String>,
    /// The record layouts by their names.
    layouts: BTreeMap<String, String>,
    items: String,
}

impl Writer<'_, '_> {
    /// A parameter: an axis, a value, a curve, a map, or a block of values.
    fn parameter(&mut self, cells: &Cells<'_>) {
        let Common { name, description, data_type, conversion, lower, upper, link } =
            self.common(cells, WORKING_PAGE);
        let variable = &cells.variable;
        let scalar = &self.model.scalars[variable.positions[0]];
        // What is fixed changes at the next start.
        let access = if scalar.variability == Variability::Fixed { "\n      READ_ONLY" } else { "" };
        if self.is_axis(variable) {
            let layout = format!("AXIS_{data_type}");
            let record = format!("AXIS_PTS_X 1 {data_type} INDEX_INCR DIRECT");
            self.layout(&layout, &record);
            let points = variable.positions.len();
            let _ = write!(
                self.items,
                "    /begin AXIS_PTS {name} {description} 0x0 NO_INPUT_QUANTITY {layout} 0 {conversion} {points} {lower} \
                 {upper}{access}
      {link}
    /end AXIS_PTS
"
            );
            return;
        }
        let layout = format!("VALUES_{data_type}");
        self.layout(&layout, &format!("FNC_VALUES 1 {data_type} ROW_DIR DIRECT"));
        // In an A2L the first axis is the one along a row, which is the last dimension.
        let part = &self.model.parts[scalar.field[0]];
        let declared = if variable.is_array() {
            &self.model.field(variable.positions[0]).declaration.axes[..]
        } else {
            &[]
        };
        let kind = match (variable.sizes.len(), declared.len()) {
            (0, _) => "VALUE",
            (1, 1) => "CURVE",
            (2, 2) => "MAP",
            _ => "VAL_BLK",
        };
        let of_map = if kind == "VAL_BLK" { &[] } else { declared };
        let axes: String = of_map.iter().rev().map(|axis| self.axis(part, axis)).collect();
        let sizes = if kind == "VAL_BLK" { matrix(variable) } else { String::new() };
        let _ = write!(
            self.items,
            "    /begin CHARACTERISTIC {name} {description} {kind} 0x0 {layout} 0 {conversion} {lower} {upper}{axes}{sizes}{access}
      {link}
    /end CHARACTERISTIC
"
        );
    }

    /// A variable that is not a parameter.
    fn measurement(&mut self, cells: &Cells<'_>) {
        let Common { name, description, data_type, conversion, lower, upper, link } =
            self.common(cells, MEASUREMENTS);
        let sizes = matrix(&cells.variable);
        let _ = write!(
            self.items,
            "    /begin MEASUREMENT {name} {description} {data_type} {conversion} 0 0 {lower} {upper}
      ECU_ADDRESS 0x0{sizes}
      {link}
    /end MEASUREMENT
"
        );
    }

    /// A reference to the points of an axis.
    fn axis(&mut self, part: &Part<'_>, axis: &str) -> String {
        let Some(field) = self.model.axis(part, axis) else { return String::new() };
        let positions = field.positions.clone();
        let scalar = &self.model.scalars[positions[0]];
        let (conversion, [lower, upper]) = self.conversion(scalar);
        let name = &self.names[&positions[0]];
        let points = positions.len();
        format!(
            "
      /begin AXIS_DESCR COM_AXIS NO_INPUT_QUANTITY {conversion} {points} {lower} {upper}
        AXIS_PTS_REF {name}
      /end AXIS_DESCR"
        )
    }

    /// Whether any map has a variable as an axis.
    fn is_axis(&self, variable: &Variable<'_>) -> bool {
        let first = variable.positions[0];
        self.model.parts.iter().any(|part| {
            let axes = part.fields.iter().flat_map(|field| &field.declaration.axes);
            axes.filter_map(|axis| self.model.axis(part, axis))
                .any(|axis| axis.positions.first() == Some(&first))
        })
    }

    fn common(&mut self, cells: &Cells<'_>, symbol: &str) -> Common {
        let scalar = &self.model.scalars[cells.variable.positions[0]];
        let (conversion, [lower, upper]) = self.conversion(scalar);
        Common {
            name: self.names[&cells.variable.positions[0]].clone(),
            description: quoted(scalar.texts.description.as_deref().unwrap_or(&scalar.name)),
            data_type: data_type(scalar.data_type),
            conversion,
            lower,
            upper,
            link: format!("SYMBOL_LINK \"{symbol}\" {}", cells.offset()),
        }
    }

    /// The name of the conversion of a scalar to what people see, and its limits there.
    fn conversion(&mut self, scalar: &Scalar) -> (String, [f64; 2]) {
        let (name, items, limits) = match scalar.data_type {
            ValueType::Enumeration(position) => {
                let enumeration = &self.model.declaration.enumerations[position];
                let items: Vec<_> =
                    enumeration.valued().map(|(item, value)| (value, item.name.as_str())).collect();
                let values = || items.iter().map(|(value, _)| f64::from(*value));
                let limits = [values().fold(f64::MAX, f64::min), values().fold(f64::MIN, f64::max)];
                (format!("VERBAL.{}", identifier(&enumeration.name)), items, limits)
            }
            ValueType::Standard(DataType::Boolean) => {
                ("BOOLEAN".to_owned(), vec![(0, "false"), (1, "true")], [0.0, 1.0])
            }
            ValueType::Standard(_) => return self.physical(scalar),
        };
        let texts: Vec<_> =
            items.iter().map(|(value, name)| format!("      {value} {}\n", quoted(name))).collect();
        let (count, texts) = (texts.len(), texts.concat());
        let text = |name: &str| {
            format!(
                "    /begin COMPU_METHOD {name} \"\" TAB_VERB \"%8.4\" \"\"
      COMPU_TAB_REF {name}.texts
    /end COMPU_METHOD
    /begin COMPU_VTAB {name}.texts \"\" TAB_VERB {count}
{texts}    /end COMPU_VTAB
"
            )
        };
        (self.named(&name, text), limits)
    }

    /// The conversion of a number to its display unit, or to its unit.
    fn physical(&mut self, scalar: &Scalar) -> (String, [f64; 2]) {
        let unit = scalar.quantity.unit.as_deref().filter(|unit| *unit != "1");
        let shown = unit.and_then(|unit| {
            let unit = self.model.units.iter().find(|known| known.name == unit)?;
            let wanted = scalar.quantity.display_unit.as_ref()?;
            unit.display_units.iter().find(|shown| shown.name == *wanted)
        });
        let linear = shown.map_or(Linear::IDENTITY, |shown| {
            let offset = if scalar.quantity.is_relative { 0.0 } else { shown.offset };
            Linear { factor: shown.factor, offset }
        });
        let unit = shown.map_or(unit, |shown| Some(shown.name.as_str())).unwrap_or_default();
        let kind = if linear == Linear::IDENTITY { "IDENTICAL" } else { "LINEAR" };
        let coefficients = match kind {
            "IDENTICAL" => String::new(),
            _ => format!("\n      COEFFS_LINEAR {:?} {:?}", linear.factor, linear.offset),
        };
        let suffix = if unit.is_empty() { "none".to_owned() } else { part_of_identifier(unit) };
        let text = |name: &str| {
            format!(
                "    /begin COMPU_METHOD {name} \"\" {kind} \"%12.6\" {}{coefficients}
    /end COMPU_METHOD
",
                quoted(unit)
            )
        };
        let name = self.named(&format!("{kind}.{suffix}"), text);
        let range = scalar.data_type.integer().map(|(_, range)| [*range.start() as f64, *range.end() as f64]);
        let [least, most] = match scalar.data_type.data_type() {
            DataType::Float32 => [f32::MIN.into(), f32::MAX.into()],
            _ => range.unwrap_or([f64::MIN, f64::MAX]),
        };
        // What no unit can show is no number.
        let limit = |declared: Option<f64>, widest: f64| {
            linear.apply(declared.unwrap_or(widest)).clamp(f64::MIN, f64::MAX)
        };
        let limits = [limit(scalar.quantity.min, least), limit(scalar.quantity.max, most)];
        (name, if linear.factor < 0.0 { [limits[1], limits[0]] } else { limits })
    }

    /// The name of a conversion with a text, this one or the first with a number that no other has: units such as Pa/% and
    /// Pa.% have the same letters, as enumerations may, and differences of a unit with an offset have none.
    fn named(&mut self, name: &str, text: impl Fn(&str) -> String) -> String {
        let (mut free, mut number) = (name.to_owned(), 1);
        while self.conversions.get(&free).is_some_and(|known| *known != text(&free)) {
            number += 1;
            free = format!("{name}_{number}");
        }
        self.conversions.entry(free.clone()).or_insert_with(|| text(&free));
        free
    }

    /// The model's components as groups.
    fn groups(&self, parameters: &[Cells<'_>], measurements: &[Cells<'_>]) -> String {
        let model = self.model;
        let of = |part: usize, list: &[Cells<'_>]| {
            let firsts = list.iter().map(|cells| cells.variable.positions[0]);
            let own = firsts.filter(|&first| model.scalars[first].field[0] == part);
            own.map(|first| format!(" {}", self.names[&first])).collect::<Vec<_>>().concat()
        };
        let mut taken = BTreeSet::new();
        let name = |part: &Part<'_>| match part.name.as_str() {
            "" => "model".to_owned(),
            name => free(&format!("component.{}", identifier(name)), &mut taken),
        };
        let names: Vec<_> = model.parts.iter().map(name).collect();
        let mut text = String::new();
        for (position, part) in model.parts.iter().enumerate() {
            let reference = |kind: &str, names: String| {
                if names.is_empty() { names } else { format!("      /begin {kind}{names} /end {kind}\n") }
            };
            let inner = part.components.iter().map(|&inner| format!(" {}", names[inner]));
            let inner = inner.collect::<Vec<_>>().concat();
            let root = if part.around.is_none() { "      ROOT\n" } else { "" };
            let _ = write!(
                text,
                "    /begin GROUP {} {}
{root}{}{}{}    /end GROUP
",
                names[position],
                quoted(part.description.as_deref().unwrap_or_default()),
                reference("REF_CHARACTERISTIC", of(position, parameters)),
                reference("REF_MEASUREMENT", of(position, measurements)),
                reference("SUB_GROUP", inner),
            );
        }
        text
    }

    fn layout(&mut self, name: &str, record: &str) {
        self.layouts.entry(name.to_owned()).or_insert_with(|| {
            format!(
                "    /begin RECORD_LAYOUT {name}
      {record}
    /end RECORD_LAYOUT
"
            )
        });
    }
}

/// The identifiers of variables, each of its own, by the positions of their first scalars.
fn names<'c>(model: &Model<'_>, cells: impl Iterator<Item = &'c Cells<'c>>) -> BTreeMap<usize, String> {
    let mut taken = BTreeSet::new();
    cells
        .map(|Cells { variable, .. }| {
            let first = variable.positions[0];
            let name = &model.scalars[first].name;
            let name = identifier(&if variable.is_array() { without_subscripts(name) } else { name.clone() });
            (first, free(&name, &mut taken))
        })
        .collect()
}

/// What parameters and measurements have in common.
struct Common {
    name: String,
    description: String,
    data_type: &'static str,
    conversion: String,
    lower: f64,
    upper: f64,
    link: String,
}

/// The sizes of an array, that along a row first; nothing of a scalar.
fn matrix(variable: &Variable<'_>) -> String {
    let sizes: Vec<_> = variable.sizes.iter().rev().map(usize::to_string).collect();
    if sizes.is_empty() { String::new() } else { format!("\n      MATRIX_DIM {}", sizes.join(" ")) }
}

/// A name, or if it is taken the name with the first free number: names of FMI may differ in letters that an A2L has not.
fn free(name: &str, taken: &mut BTreeSet<String>) -> String {
    let (mut free, mut number) = (name.to_owned(), 1);
    while !taken.insert(free.clone()) {
        number += 1;
        free = format!("{name}_{number}");
    }
    free
}

/// A data type's name in an A2L.
fn data_type(data_type: ValueType) -> &'static str {
    match data_type.data_type() {
        DataType::Float32 => "FLOAT32_IEEE",
        DataType::Boolean | DataType::UInt8 => "UBYTE",
        DataType::Int8 => "SBYTE",
        DataType::Int16 => "SWORD",
        DataType::UInt16 => "UWORD",
        DataType::Integer | DataType::Enumeration => "SLONG",
        DataType::UInt32 => "ULONG",
        DataType::Int64 => "A_INT64",
        DataType::UInt64 => "A_UINT64",
        _ => "FLOAT64_IEEE",
    }
}

/// A name as an A2L's identifier: parts of letters, digits and `_`, between dots.
fn identifier(name: &str) -> String {
    name.split('.').map(part_of_identifier).collect::<Vec<_>>().join(".")
}

/// A part of an identifier, which keeps a whole number in brackets at its end.
fn part_of_identifier(part: &str) -> String {
    let subscript = part.strip_suffix(']').and_then(|part| part.split_once('['));
    if let Some((name, number)) = subscript
        && !number.is_empty()
        && number.bytes().all(|byte| byte.is_ascii_digit())
    {
        return format!("{}[{number}]", part_of_identifier(name));
    }
    let letters: String =
        part.chars().map(|letter| if letter.is_ascii_alphanumeric() { letter } else { '_' }).collect();
    if letters.starts_with(|first: char| first.is_ascii_digit()) || letters.is_empty() {
        format!("_{letters}")
    } else {
        letters
    }
}

/// A text in quotes.
fn quoted(text: &str) -> String {
    let text = text.replace('\\', "\\\\").replace('"', "\\\"").replace(['\n', '\r'], " ");
    format!("\"{text}\"")
}
