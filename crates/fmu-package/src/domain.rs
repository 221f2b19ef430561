//! Which numbers a variable takes. All values that come to inputs as numbers follow this rule: those of connections, with
//! what their tables and factors make of them, of signals, and of parameters that get their values from connectors.

use fmu_io::terminal::number;
use fmu_terms::DataType;

use crate::model_description::FmuDescription;
use crate::variable::{FmuVariable, ValueType};

/// The numbers that a variable takes.
#[derive(Clone, Debug, PartialEq)]
pub enum Domain {
    /// Any.
    Real,
    /// Any that does not overflow; it is rounded to 32 bits.
    Single,
    /// Whole numbers from the first to below the second, which is a power of two.
    Whole(f64, f64),
    /// The numbers of an enumeration's items.
    Items(Vec<(String, i32)>),
    /// 0 and 1.
    Truth,
    /// Any: a Boolean is true from this one on.
    Threshold(f64),
}

impl Domain {
    /// The domain of a variable of an FMU.
    #[must_use]
    pub fn of(variable: &FmuVariable, fmu: &FmuDescription) -> Self {
        let signed = |bits: i32| Self::Whole(-(2.0_f64.powi(bits - 1)), 2.0_f64.powi(bits - 1));
        let unsigned = |bits: i32| Self::Whole(0.0, 2.0_f64.powi(bits));
        match variable.data_type.meaning() {
            Some(DataType::Float32) => Self::Single,
            Some(DataType::Int8) => signed(8),
            Some(DataType::UInt8) => unsigned(8),
            Some(DataType::Int16) => signed(16),
            Some(DataType::UInt16) => unsigned(16),
            Some(DataType::Integer) => signed(32),
            Some(DataType::UInt32) => unsigned(32),
            Some(DataType::Int64) => signed(64),
            Some(DataType::UInt64) => unsigned(64),
            Some(DataType::Boolean) => Self::Truth,
            Some(DataType::Enumeration) => match fmu.enumeration(&variable.declared_type) {
                Some(enumeration) => Self::Items(enumeration.items.clone()),
                None => signed(32),
            },
            _ => Self::Real,
        }
    }

    /// The domain of a Boolean that is true from a number on.
    ///
    /// # Errors
    /// When the variable is no Boolean.
    pub fn with_threshold(variable: &FmuVariable, threshold: f64) -> Result<Self, String> {
        if variable.value_type() == ValueType::Boolean {
            return Ok(Self::Threshold(threshold));
        }
        Err(format!("a threshold is for a Boolean; {} is of the type {}", variable.name, variable.data_type))
    }

    /// The number that the variable takes for a value.
    ///
    /// # Errors
    /// When it takes none; the message says why.
    #[allow(clippy::cast_possible_truncation)] // it is rounded
    pub fn take(&self, value: f64) -> Result<f64, String> {
        let refused = |reason: &str| Err(format!("{} {reason}", number(value)));
        match self {
            Self::Real => Ok(value),
            Self::Single => {
                let rounded = f64::from(value as f32);
                if rounded.is_infinite() && value.is_finite() {
                    return refused("overflows a Float32");
                }
                Ok(rounded)
            }
            // Not a number has no whole part.
            Self::Whole(..) if value.fract() != 0.0 => refused("is not a whole number"),
            Self::Whole(least, beyond) if *least <= value && value < *beyond => Ok(value),
            Self::Whole(least, beyond) => {
                refused(&format!("is not within {}..{}", number(*least), number(beyond - 1.0)))
            }
            Self::Items(items) if items.iter().any(|(_, item)| f64::from(*item) - value == 0.0) => Ok(value),
            Self::Items(items) => {
                let items = items.iter().map(|(name, number)| format!("{number} ({name})"));
                refused(&format!("is no item: {}", items.collect::<Vec<_>>().join(", ")))
            }
            Self::Truth if [0.0, 1.0].contains(&value) => Ok(value),
            Self::Truth => {
                refused("is neither 0 nor 1; a connection's threshold makes it true from there on")
            }
            Self::Threshold(_) if value.is_nan() => refused("is neither below the threshold nor above"),
            Self::Threshold(threshold) => Ok(f64::from(value >= *threshold)),
        }
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "the values are exact")]
mod tests {
    use super::*;

    fn domain(kind: &str) -> Domain {
        let xml = format!(
            "<fmiModelDescription fmiVersion=\"3.0\"><TypeDefinitions><EnumerationType name=\"Gear\">\
             <Item name=\"park\" value=\"1\"/><Item name=\"drive\" value=\"7\"/></EnumerationType></TypeDefinitions>\
             <ModelVariables><{kind} name=\"x\" valueReference=\"1\" declaredType=\"Gear\"/></ModelVariables>\
             </fmiModelDescription>"
        );
        let fmu = FmuDescription::parse(&xml).unwrap();
        Domain::of(fmu.variable("x").unwrap(), &fmu)
    }

    #[test]
    fn each_type_takes_its_numbers() {
        let below = |power: i32| 2.0_f64.powi(power) - 2.0_f64.powi((power - 53).max(0));
        for (kind, taken, refused) in [
            ("Float64", vec![2.7, 1e300, f64::INFINITY], vec![]),
            ("Float32", vec![0.0, 0.5, f64::from(f32::MAX), f64::INFINITY], vec![1e39, -3.5e38]),
            ("Int8", vec![-128.0, 127.0], vec![-129.0, 128.0, 0.5]),
            ("UInt8", vec![0.0, 255.0], vec![-1.0, 256.0]),
            ("Int32", vec![-2_147_483_648.0, 2_147_483_647.0], vec![4e9, 2.7, f64::NAN, f64::INFINITY]),
            ("UInt32", vec![4e9], vec![4_294_967_296.0]),
            ("Int64", vec![-(2.0_f64.powi(63)), below(63)], vec![2.0_f64.powi(63)]),
            ("UInt64", vec![below(64)], vec![2.0_f64.powi(64), -1.0]),
            ("Boolean", vec![0.0, 1.0], vec![0.5, 2.0, f64::NAN]),
            ("Enumeration", vec![1.0, 7.0], vec![0.0, 2.0, 1.5, f64::NAN]),
        ] {
            let domain = domain(kind);
            for value in taken {
                assert_eq!(domain.take(value), Ok(value), "{kind}");
            }
            for value in refused {
                assert!(domain.take(value).is_err(), "{kind} takes {value}");
            }
        }
        assert_eq!(domain("Float32").take(0.1), Ok(f64::from(0.1_f32)));
        assert!(domain("Float32").take(f64::NAN).unwrap().is_nan());
        let refusal = |kind, value| domain(kind).take(value).unwrap_err();
        assert_eq!(refusal("Int32", 4e9), "4000000000 is not within -2147483648..2147483647");
        assert_eq!(refusal("Enumeration", 0.0), "0 is no item: 1 (park), 7 (drive)");
    }

    #[test]
    fn a_boolean_is_true_from_its_threshold_on() {
        let variable = |kind: DataType| FmuVariable {
            name: "x".to_owned(),
            data_type: kind.into(),
            ..FmuVariable::default()
        };
        let domain = Domain::with_threshold(&variable(DataType::Boolean), 0.5).unwrap();
        assert_eq!([0.4, 0.5, 7.0].map(|value| domain.take(value).unwrap()), [0.0, 1.0, 1.0]);
        assert!(domain.take(f64::NAN).is_err());
        assert!(Domain::with_threshold(&variable(DataType::Integer), 0.5).is_err());
    }
}
