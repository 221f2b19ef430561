//! The attributes of variables (FMI 2.0.5, section 2.2.7; FMI 3.0.2, section 2.4.7) and their types.

use core::fmt;

use crate::Version;
use crate::words::words;

words! {
    /// What a variable is for the importer.
    #[derive(Default)]
    pub enum Causality {
        Parameter = "parameter",
        /// An array size, which the build fixes at its start value. FMI 3.0 only.
        StructuralParameter = "structuralParameter",
        CalculatedParameter = "calculatedParameter",
        Input = "input",
        Output = "output",
        #[default]
        Local = "local",
        /// The causality of time only.
        #[cfg_attr(feature = "serde", serde(skip_deserializing))]
        Independent = "independent",
    }
}

words! {
    /// When a variable's value may change.
    #[derive(Default)]
    pub enum Variability {
        Constant = "constant",
        Fixed = "fixed",
        Tunable = "tunable",
        Discrete = "discrete",
        #[default]
        Continuous = "continuous",
    }
}

impl Variability {
    /// The variability of a variable that declares none (FMI 2.0.5, section 2.2.7; FMI 3.0.2, section 2.4.7.4).
    #[must_use]
    pub fn by_default(version: Version, causality: Option<Causality>, is_float: bool) -> Self {
        use Causality::{CalculatedParameter, Parameter, StructuralParameter};
        match (version, causality) {
            (Version::Three, Some(Parameter | CalculatedParameter | StructuralParameter)) => Self::Fixed,
            (Version::Three, _) if !is_float => Self::Discrete,
            _ => Self::Continuous,
        }
    }
}

words! {
    /// How a variable's initial value is defined; inputs and the independent variable have none.
    pub enum Initial {
        Exact = "exact",
        Approx = "approx",
        Calculated = "calculated",
    }
}

impl Initial {
    /// The values that a combination of causality and variability allows, the default first (FMI 2.0.5, section 2.2.7; FMI
    /// 3.0.2, section 2.4.7.5); none if the combination is not allowed.
    #[must_use]
    pub fn allowed(
        version: Version,
        causality: Causality,
        variability: Variability,
    ) -> Option<&'static [Self]> {
        use Causality::{
            CalculatedParameter, Independent, Input, Local, Output, Parameter, StructuralParameter,
        };
        use Initial::{Approx, Calculated, Exact};
        use Variability::{Constant, Continuous, Discrete, Fixed, Tunable};
        Some(match (causality, variability) {
            (Parameter, Fixed | Tunable) | (Output | Local, Constant) => &[Exact],
            (CalculatedParameter | Local, Fixed | Tunable) => &[Calculated, Approx],
            (Output | Local, Discrete | Continuous) => &[Calculated, Exact, Approx],
            (StructuralParameter, Fixed | Tunable) | (Input, Discrete | Continuous)
                if version == Version::Three =>
            {
                &[Exact]
            }
            (Input, Discrete | Continuous) | (Independent, Continuous) => &[],
            _ => return None,
        })
    }
}

words! {
    /// When a clock ticks (FMI 3.0.2, section 2.2.8).
    pub enum IntervalVariability {
        /// Periodically, as declared.
        Constant = "constant",
        /// Periodically, as set by the importer or computed from fixed parameters.
        Fixed = "fixed",
        /// Periodically, as set by the importer or computed from tunable parameters.
        Tunable = "tunable",
        /// After a time that the model determines at each tick for the next one.
        Changing = "changing",
        /// After a time that the model determines at any time.
        Countdown = "countdown",
        /// When something triggers it.
        Triggered = "triggered",
    }
}

impl IntervalVariability {
    /// Whether ticks are equidistant.
    #[must_use]
    #[inline]
    pub fn is_periodic(self) -> bool {
        matches!(self, Self::Constant | Self::Fixed | Self::Tunable)
    }

    /// Whether ticks are equidistant throughout the experiment: initialization sets the interval.
    #[must_use]
    #[inline]
    pub fn is_uniform(self) -> bool {
        matches!(self, Self::Constant | Self::Fixed)
    }
}

words! {
    /// Which members of two connected terminals are connected (FMI 3.0.2, section 2.4.9).
    #[derive(Default)]
    pub enum MatchingRule {
        /// All; both sides must have the same names.
        Plug = "plug",
        /// Those whose names exist on both sides.
        #[default]
        Bus = "bus",
    }
}

/// The type of a variable's values, by its FMI 2.0 name where there is one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs, reason = "the standard defines them")]
pub enum DataType {
    #[default]
    Real,
    Integer,
    Boolean,
    String,
    /// In FMI 2.0 accessed through the functions of Integer, in FMI 3.0 through those of Int64.
    Enumeration,
    // FMI 3.0 only.
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
}

impl DataType {
    /// Every type.
    pub const ALL: [Self; 15] = [
        Self::Real,
        Self::Integer,
        Self::Boolean,
        Self::String,
        Self::Enumeration,
        Self::Float32,
        Self::Int8,
        Self::UInt8,
        Self::Int16,
        Self::UInt16,
        Self::UInt32,
        Self::Int64,
        Self::UInt64,
        Self::Binary,
        Self::Clock,
    ];

    /// The name of the type's element in a version's modelDescription.xml.
    #[must_use]
    pub fn name(self, version: Version) -> &'static str {
        match (self, version) {
            (Self::Real, Version::Two) => "Real",
            (Self::Real, Version::Three) => "Float64",
            (Self::Integer, Version::Two) => "Integer",
            (Self::Integer, Version::Three) => "Int32",
            (Self::Boolean, _) => "Boolean",
            (Self::String, _) => "String",
            (Self::Enumeration, _) => "Enumeration",
            (Self::Float32, _) => "Float32",
            (Self::Int8, _) => "Int8",
            (Self::UInt8, _) => "UInt8",
            (Self::Int16, _) => "Int16",
            (Self::UInt16, _) => "UInt16",
            (Self::UInt32, _) => "UInt32",
            (Self::Int64, _) => "Int64",
            (Self::UInt64, _) => "UInt64",
            (Self::Binary, _) => "Binary",
            (Self::Clock, _) => "Clock",
        }
    }

    /// Whether a version has the type.
    #[must_use]
    pub fn is_of(self, version: Version) -> bool {
        let is_of_both =
            matches!(self, Self::Real | Self::Integer | Self::Boolean | Self::String | Self::Enumeration);
        is_of_both || version == Version::Three
    }

    /// The type of a version with this name.
    #[must_use]
    pub fn of(name: &str, version: Version) -> Option<Self> {
        Self::ALL.into_iter().find(|known| known.is_of(version) && known.name(version) == name)
    }

    /// Whether the type's values are floating-point numbers.
    #[must_use]
    pub fn is_float(self) -> bool {
        matches!(self, Self::Real | Self::Float32)
    }

    /// Whether the type's values are integers.
    #[must_use]
    pub fn is_integer(self) -> bool {
        matches!(
            self,
            Self::Integer
                | Self::Int8
                | Self::UInt8
                | Self::Int16
                | Self::UInt16
                | Self::UInt32
                | Self::Int64
                | Self::UInt64
        )
    }
}

/// The name in FMI 2.0 where there is one.
impl fmt::Display for DataType {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(self.name(Version::Two))
    }
}
