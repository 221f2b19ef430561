//! What happens to a value on its way along a connection of a system, or from a parameter set to a parameter (SSP 2.0,
//! section 4.5.2).

use std::io;

use fmu_terms::Linear;

use crate::parameter_set::Value;
use crate::xml::{Element, children, named, number, required, truth, wrong};

/// A function of a number: a Boolean is 0 or 1, an enumeration's item its number.
#[derive(Clone, Debug, PartialEq)]
pub enum Function {
    /// A linear function.
    Linear(Linear),
    /// A table, which leaves other numbers unchanged.
    Table(Vec<(f64, f64)>),
}

impl Function {
    /// The identity.
    pub const IDENTITY: Self = Self::Linear(Linear::IDENTITY);

    /// The value of the function.
    #[must_use]
    pub fn apply(&self, value: f64) -> f64 {
        match self {
            Self::Linear(linear) => linear.apply(value),
            Self::Table(entries) => {
                let entry = entries.iter().find(|(from, _)| from.total_cmp(&value).is_eq());
                entry.map_or(value, |(_, to)| *to)
            }
        }
    }

    /// This function followed by another one; none if that is neither linear nor a table.
    #[must_use]
    pub fn then(self, next: Self) -> Option<Self> {
        match (self, next) {
            (Self::Linear(first), Self::Linear(next)) => Some(Self::Linear(first.then(next))),
            (only, Self::IDENTITY) | (Self::IDENTITY, only) => Some(only),
            (Self::Table(mut entries), Self::Table(more)) => {
                let next = Self::Table(more.clone());
                for (_, to) in &mut entries {
                    *to = next.apply(*to);
                }
                // The first of two entries counts.
                entries.extend(more);
                Some(Self::Table(entries))
            }
            _ => None,
        }
    }

    /// The function's linear part. Values in tables have no unit, so that nothing converts them.
    #[must_use]
    pub fn linear(&self) -> Linear {
        match self {
            Self::Linear(linear) => *linear,
            Self::Table(_) => Linear::IDENTITY,
        }
    }

    /// The inverse function.
    #[must_use]
    pub fn inverse(self) -> Self {
        match self {
            Self::Linear(linear) => Self::Linear(linear.inverse()),
            Self::Table(entries) => Self::Table(entries.into_iter().map(|(from, to)| (to, from)).collect()),
        }
    }
}

impl From<Linear> for Function {
    fn from(linear: Linear) -> Self {
        Self::Linear(linear)
    }
}

/// A transformation, as SSP's files have it.
#[derive(Clone, Debug, PartialEq)]
pub enum Transformation {
    /// A function of Booleans, integers and Reals.
    Function(Function),
    /// A mapping of an enumeration's items, by their names.
    Items(Vec<(String, String)>),
}

impl Transformation {
    /// Reads the transformation of a connection or a mapped parameter; the identity if it has none.
    pub(crate) fn read(parent: Element<'_>) -> io::Result<Self> {
        for element in children(parent) {
            match element.tag_name().name() {
                "LinearTransformation" => {
                    let factor = number(element, "factor")?.unwrap_or(1.0);
                    let offset = number(element, "offset")?.unwrap_or(0.0);
                    return Ok(Self::Function(Linear { factor, offset }.into()));
                }
                "BooleanMappingTransformation" => {
                    return Ok(Self::Function(Function::Table(table(element, truth_as_number)?)));
                }
                "IntegerMappingTransformation" => {
                    return Ok(Self::Function(Function::Table(table(element, integer)?)));
                }
                "EnumerationMappingTransformation" => return table(element, required).map(Self::Items),
                _ => {}
            }
        }
        Ok(Self::Function(Function::IDENTITY))
    }

    /// The function between numbers, for two enumerations with these items. An entry for an item that the first does
    /// not have is ignored.
    ///
    /// # Errors
    /// When the second has no item of a name.
    pub fn function(&self, from: &[(String, i32)], to: &[(String, i32)]) -> Result<Function, String> {
        let entries = match self {
            Self::Function(function) => return Ok(function.clone()),
            Self::Items(entries) => entries,
        };
        let find = |items: &[(String, i32)], name: &str| {
            items.iter().find(|(item, _)| item == name).map(|(_, number)| f64::from(*number))
        };
        let entries = entries.iter().filter_map(|(source, target)| {
            let own = find(from, source)?;
            Some(
                find(to, target)
                    .map(|wanted| (own, wanted))
                    .ok_or_else(|| format!("there is no item {target}")),
            )
        });
        entries.collect::<Result<_, _>>().map(Function::Table)
    }

    /// The value in the place of one, by a table; otherwise the same one.
    #[must_use]
    pub fn tabulated(&self, value: Value) -> Value {
        match (self, value) {
            (Self::Items(entries), Value::Enumeration(item) | Value::String(item)) => {
                let entry = entries.iter().find(|(source, _)| *source == item);
                Value::Enumeration(entry.map_or(item, |(_, target)| target.clone()))
            }
            (Self::Function(table @ Function::Table(_)), Value::Boolean(value)) => {
                Value::Boolean(table.apply(f64::from(u8::from(value))) != 0.0)
            }
            #[expect(clippy::cast_possible_truncation, reason = "the table's numbers are of this type")]
            (Self::Function(table @ Function::Table(_)), Value::Integer(value)) => {
                Value::Integer(table.apply(f64::from(value)) as i32)
            }
            (_, value) => value,
        }
    }

    /// The function, if it is linear.
    #[must_use]
    pub fn linear(&self) -> Linear {
        match self {
            Self::Function(function) => function.linear(),
            Self::Items(_) => Linear::IDENTITY,
        }
    }
}

/// The entries of a table.
fn table<T>(element: Element<'_>, read: fn(Element<'_>, &str) -> io::Result<T>) -> io::Result<Vec<(T, T)>> {
    named(element, "MapEntry").map(|entry| Ok((read(entry, "source")?, read(entry, "target")?))).collect()
}

fn truth_as_number(entry: Element<'_>, name: &str) -> io::Result<f64> {
    truth(entry, name).map(|is_true| f64::from(u8::from(is_true)))
}

fn integer(entry: Element<'_>, name: &str) -> io::Result<f64> {
    let number: Option<i32> = number(entry, name)?;
    number.map(f64::from).ok_or_else(|| wrong(entry, &format!("it has no {name}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(entries: &[(f64, f64)]) -> Function {
        Function::Table(entries.to_vec())
    }

    #[test]
    fn a_table_leaves_other_values_unchanged_and_combines() {
        let swap = table(&[(0.0, 1.0), (1.0, 0.0)]);
        assert_eq!(
            [0.0, 1.0, 2.0].map(|value| swap.apply(value).to_bits()),
            [1.0, 0.0, 2.0].map(f64::to_bits)
        );
        let raise = table(&[(1.0, 5.0), (2.0, 6.0)]);
        let both = swap.clone().then(raise).unwrap();
        assert_eq!(
            [0.0, 1.0, 2.0].map(|value| both.apply(value).to_bits()),
            [5.0, 0.0, 6.0].map(f64::to_bits)
        );
        let double = Function::from(Linear { factor: 2.0, offset: 0.0 });
        assert_eq!(swap.clone().then(Function::IDENTITY), Some(swap.clone()));
        assert_eq!(swap.then(double), None);
    }

    #[test]
    fn items_are_mapped_by_name_between_two_enumerations() {
        let items = |names: &[(&str, i32)]| -> Vec<_> {
            names.iter().map(|(name, number)| ((*name).to_owned(), *number)).collect()
        };
        let entries = [("off", "idle"), ("on", "run"), ("unknown", "run")];
        let map = Transformation::Items(entries.map(|(from, to)| (from.to_owned(), to.to_owned())).to_vec());
        let from = items(&[("on", 1), ("off", 2)]);
        let function = map.function(&from, &items(&[("idle", 7), ("run", 9)])).unwrap();
        assert_eq!(function, table(&[(2.0, 7.0), (1.0, 9.0)]));
        assert_eq!(map.function(&from, &items(&[("idle", 7)])), Err("there is no item run".to_owned()));
        assert_eq!(map.tabulated(Value::Enumeration("off".into())), Value::Enumeration("idle".into()));
        assert_eq!(map.tabulated(Value::Enumeration("other".into())), Value::Enumeration("other".into()));
    }
}
