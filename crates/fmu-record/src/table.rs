//! Tables of columns with names and units.

use fmu_terms::{DisplayUnit, Linear};

use crate::numbers::{self, number, quantity};

/// A recorded variable.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize))]
pub struct Column {
    /// The name in the CSV header.
    pub name: String,
    /// The unit declared by the FMU; empty if there is none.
    pub unit: String,
    /// The unit that the FMU declares for readers.
    pub display_unit: Option<DisplayUnit>,
    /// Whether each value holds until the next.
    pub is_discrete: bool,
    /// The names of the values of a Boolean or an enumeration, or the texts, from 0.
    pub items: Vec<(String, i32)>,
    /// Whether the values are the numbers of texts.
    pub is_text: bool,
    /// The values, one for each time, in the column's unit.
    pub values: Vec<f64>,
}

impl<Name: Into<String>, Unit: Into<String>> From<(Name, Unit)> for Column {
    /// A column without values, of a name and a unit.
    fn from((name, unit): (Name, Unit)) -> Self {
        Self { name: name.into(), unit: unit.into(), ..Self::default() }
    }
}

impl Column {
    /// The declared display unit's symbol, and the function to it.
    fn display(&self) -> Option<(String, Linear)> {
        let DisplayUnit { name, factor, offset } = self.display_unit.as_ref()?;
        let symbol = if name == "degC" { "\u{b0}C" } else { name };
        Some((symbol.to_owned(), Linear { factor: *factor, offset: *offset }))
    }

    /// The unit for an axis of values up to a size, and the function to it: the declared display unit, else that of
    /// [`numbers::axis`].
    #[must_use]
    pub fn scale(&self, size: f64) -> (String, Linear) {
        self.display().unwrap_or_else(|| {
            let (unit, factor) = numbers::axis(&self.unit, size);
            (unit, Linear { factor, offset: 0.0 })
        })
    }

    /// A column for differences of this one's values: those of temperatures shown in \u{b0}C are in K.
    #[must_use]
    #[allow(clippy::float_cmp)] // as declared
    pub fn of_differences(&self) -> Self {
        let display_unit =
            self.display_unit.clone().filter(|display| display.offset == 0.0 || display.factor != 1.0);
        let display_unit = display_unit.map(|display| DisplayUnit { offset: 0.0, ..display });
        Self { display_unit, ..Self::from((&*self.name, &*self.unit)) }
    }

    /// The name of a value that has one.
    #[must_use]
    #[allow(clippy::float_cmp)] // whole numbers
    pub fn item(&self, value: f64) -> Option<&str> {
        let is_it = |item: &&(String, i32)| f64::from(item.1) == value;
        // Texts, of which there may be many, are in the order of their numbers.
        let item = if self.is_text {
            let place = self.items.partition_point(|item| f64::from(item.1) < value);
            self.items.get(place).filter(is_it)
        } else {
            self.items.iter().find(is_it)
        };
        item.map(|(name, _)| name.as_str())
    }

    /// A value for readers: its name, or in the display unit.
    #[must_use]
    pub fn text(&self, value: f64) -> String {
        match (self.item(value), self.display()) {
            (Some(item), _) => item.to_owned(),
            (None, Some((unit, display))) => format!("{}\u{202f}{unit}", number(display.apply(value))),
            (None, None) => quantity(value, &self.unit),
        }
    }
}

/// Columns with equal numbers of rows.
pub struct Table<'a>(pub Vec<TableColumn<'a>>);

impl Table<'_> {
    /// The table without units, for readers that know none.
    #[must_use]
    pub fn without_units(mut self) -> Self {
        for column in &mut self.0 {
            (column.unit, column.display_unit) = (String::new(), None);
        }
        self
    }
}

/// A column of a [`Table`].
pub struct TableColumn<'a> {
    /// The column's name in the header.
    pub name: String,
    /// The unit of the cells; empty where there is none.
    pub unit: String,
    /// The unit in which to show the cells.
    pub display_unit: Option<DisplayUnit>,
    /// The cells, one for each row.
    pub cells: Cells<'a>,
}

impl<'a> TableColumn<'a> {
    /// Cells under a column's name and units.
    #[must_use]
    pub fn new(column: &Column, cells: Cells<'a>) -> Self {
        let Column { name, unit, display_unit, .. } = column;
        Self { name: name.clone(), unit: unit.clone(), display_unit: display_unit.clone(), cells }
    }
}

/// The cells of a column, all of one type; those that are `None` are missing.
pub enum Cells<'a> {
    /// Numbers, none of which is missing.
    Numbers(&'a [f64]),
    /// Numbers.
    Number(Vec<Option<f64>>),
    /// Whole numbers.
    Whole(Vec<Option<i32>>),
    /// Truth values.
    Truth(Vec<Option<bool>>),
    /// Texts.
    Text(Vec<Option<String>>),
}

impl Cells<'_> {
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Numbers(cells) => cells.len(),
            Self::Number(cells) => cells.len(),
            Self::Whole(cells) => cells.len(),
            Self::Truth(cells) => cells.len(),
            Self::Text(cells) => cells.len(),
        }
    }

    pub(crate) fn text(&self, row: usize) -> String {
        match self {
            Self::Numbers(cells) => Some(format!("{:?}", cells[row])),
            Self::Number(cells) => cells[row].map(|value| format!("{value:?}")),
            Self::Whole(cells) => cells[row].map(|value| value.to_string()),
            Self::Truth(cells) => cells[row].map(|value| value.to_string()),
            Self::Text(cells) => cells[row].clone(),
        }
        .unwrap_or_default()
    }
}
