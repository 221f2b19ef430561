//! The types of values.

use std::ops::RangeInclusive;

use fmu_terms::{DataType, Version};

use crate::error::nearest;

/// The type of a variable's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ValueType {
    /// A type of the standard but Enumeration.
    Standard(DataType),
    /// The position among the model's enumerations.
    Enumeration(usize),
}

impl ValueType {
    /// The types of the standard that a declaration names, by their names there.
    fn standard() -> impl Iterator<Item = (DataType, &'static str)> {
        let types = DataType::ALL.into_iter().filter(|data_type| *data_type != DataType::Enumeration);
        types.map(|data_type| (data_type, data_type.name(Version::Two)))
    }

    /// A type of the standard.
    pub(crate) fn of_name(name: &str) -> Option<DataType> {
        Self::standard().find(|(_, known)| *known == name).map(|(data_type, _)| data_type)
    }

    /// A type of a model with these enumerations, and with types of Reals that someone may mean.
    pub(crate) fn find(name: &str, enumerations: &[&str], real_types: &[&str]) -> Result<Self, String> {
        let enumeration = || enumerations.iter().position(|known| *known == name).map(Self::Enumeration);
        Self::of_name(name).map(Self::Standard).or_else(enumeration).ok_or_else(|| {
            let types: Vec<_> = Self::standard().map(|(_, name)| name).collect();
            let nearest = match name {
                // Names from FMI 3.0 and programming languages for types that FMI 2.0 also has.
                "Float64" | "f64" | "float" | "double" => "; use 'Real'".to_owned(),
                "Int32" | "i32" | "int" => "; use 'Integer'".to_owned(),
                "bool" => "; use 'Boolean'".to_owned(),
                "str" => "; use 'String'".to_owned(),
                _ => nearest(name, types.iter().chain(enumerations).chain(real_types).copied()),
            };
            format!(
                "'{name}' is not one of {}, the enumerations and the real_types{nearest}",
                types.join(", ")
            )
        })
    }

    /// The standard's type.
    pub(crate) fn data_type(self) -> DataType {
        match self {
            Self::Standard(data_type) => data_type,
            Self::Enumeration(_) => DataType::Enumeration,
        }
    }

    /// An integer's Rust type and bounds.
    pub(crate) fn integer(self) -> Option<(&'static str, RangeInclusive<i128>)> {
        macro_rules! of {
            ($integer:ident) => {
                Some((stringify!($integer), $integer::MIN.into()..=$integer::MAX.into()))
            };
        }
        match self.data_type() {
            DataType::Integer => of!(i32),
            DataType::Int8 => of!(i8),
            DataType::UInt8 => of!(u8),
            DataType::Int16 => of!(i16),
            DataType::UInt16 => of!(u16),
            DataType::UInt32 => of!(u32),
            DataType::Int64 => of!(i64),
            DataType::UInt64 => of!(u64),
            _ => None,
        }
    }
}

impl Default for ValueType {
    fn default() -> Self {
        Self::Standard(DataType::default())
    }
}

impl PartialEq<DataType> for ValueType {
    fn eq(&self, data_type: &DataType) -> bool {
        self.data_type() == *data_type
    }
}
