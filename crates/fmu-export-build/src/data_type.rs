//! The types of values.

use std::ops::RangeInclusive;

use crate::error::nearest;

/// The type of a variable's values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum DataType {
    #[default]
    Real,
    Integer,
    Boolean,
    String,
    Float32,
    Int8,
    UInt8,
    Int16,
    UInt16,
    UInt32,
    Int64,
    UInt64,
    Binary,
    Clock,
    /// The position among the model's enumerations.
    Enumeration(usize),
}

impl DataType {
    const BUILT_IN: [(&'static str, Self); 14] = [
        ("Real", Self::Real),
        ("Integer", Self::Integer),
        ("Boolean", Self::Boolean),
        ("String", Self::String),
        ("Float32", Self::Float32),
        ("Int8", Self::Int8),
        ("UInt8", Self::UInt8),
        ("Int16", Self::Int16),
        ("UInt16", Self::UInt16),
        ("UInt32", Self::UInt32),
        ("Int64", Self::Int64),
        ("UInt64", Self::UInt64),
        ("Binary", Self::Binary),
        ("Clock", Self::Clock),
    ];

    /// The name in a declaration; all enumerations share one.
    pub(crate) fn name(self) -> &'static str {
        Self::BUILT_IN.iter().find(|(_, known)| *known == self).map_or("Enumeration", |(name, _)| name)
    }

    /// A built-in type.
    pub(crate) fn of_name(name: &str) -> Option<Self> {
        Self::BUILT_IN.iter().find(|(known, _)| *known == name).map(|(_, data_type)| *data_type)
    }

    /// A type of a model with these enumerations.
    pub(crate) fn find(name: &str, enumerations: &[&str]) -> Result<Self, String> {
        let enumeration = || enumerations.iter().position(|known| *known == name).map(Self::Enumeration);
        Self::of_name(name).or_else(enumeration).ok_or_else(|| {
            let types = Self::BUILT_IN.map(|(name, _)| name);
            let nearest = match name {
                // Names from FMI 3.0 and programming languages for types that FMI 2.0 also has.
                "Float64" | "f64" | "float" | "double" => "; use 'Real'".to_owned(),
                "Int32" | "i32" | "int" => "; use 'Integer'".to_owned(),
                "bool" => "; use 'Boolean'".to_owned(),
                "str" => "; use 'String'".to_owned(),
                _ => nearest(name, types.iter().chain(enumerations).copied()),
            };
            format!("'{name}' is not one of {} and the enumerations{nearest}", types.join(", "))
        })
    }

    /// Whether FMI 2.0 has it.
    pub(crate) fn is_of_fmi2(self) -> bool {
        matches!(self, Self::Real | Self::Integer | Self::Boolean | Self::String | Self::Enumeration(_))
    }

    pub(crate) fn is_float(self) -> bool {
        matches!(self, Self::Real | Self::Float32)
    }

    /// An integer's Rust type and bounds.
    pub(crate) fn integer(self) -> Option<(&'static str, RangeInclusive<i128>)> {
        macro_rules! of {
            ($integer:ident) => {
                Some((stringify!($integer), $integer::MIN.into()..=$integer::MAX.into()))
            };
        }
        match self {
            Self::Integer => of!(i32),
            Self::Int8 => of!(i8),
            Self::UInt8 => of!(u8),
            Self::Int16 => of!(i16),
            Self::UInt16 => of!(u16),
            Self::UInt32 => of!(u32),
            Self::Int64 => of!(i64),
            Self::UInt64 => of!(u64),
            _ => None,
        }
    }
}
