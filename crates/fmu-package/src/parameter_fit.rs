//! Checks and converts a parameter set for an FMU.

use std::io;

use fmu_io::reading::broken;
use fmu_io::terminal;
use fmu_terms::{Causality, Linear, Unit, like};

use crate::model_description::FmuDescription;
use crate::parameter_set::{Parameter, ParameterSet, Value};
use crate::units::unit_conversion;
use crate::variable::{FmuVariable, ValueType};

impl ParameterSet {
    /// The set converted for an FMU: each value with its variable's type and unit, and within its range.
    ///
    /// # Errors
    /// At the first parameter that the FMU does not have, that cannot be set, or whose type, unit or range does not
    /// fit; the message names it and what was expected.
    pub fn fit(&self, fmu: &FmuDescription) -> io::Result<Self> {
        let parameters = self.parameters.iter().map(|parameter| {
            let name = &parameter.name;
            let variable = fmu.variable(name).ok_or_else(|| {
                let settable = fmu.variables.iter().filter(|variable| variable.is_settable());
                let like = like(name, settable.map(|variable| variable.name.as_str()));
                broken(format!("{} has no variable {name}{like}", fmu.attribute("modelName")))
            })?;
            if !variable.is_settable() {
                return Err(broken(format!("{name} cannot be set: its causality is {}", variable.causality)));
            }
            let value = parameter.value.fit(variable, &self.units, fmu)?;
            value.check_range(variable)?;
            Ok(Parameter { value, ..parameter.clone() })
        });
        Ok(Self {
            parameters: parameters.collect::<io::Result<_>>()?,
            units: fmu.units.clone(),
            ..self.clone()
        })
    }
}

/// A value this many times larger or smaller than the start value is probably in another unit.
const FAR: f64 = 100.0;

impl Value {
    /// The value converted to the type and unit of an FMU's variable. Units are those given with the value, else the
    /// FMU's, else those of the [table](fmu_terms::UnitTable). Integers are accepted as Reals; an enumeration's item is a name, even
    /// as a String, or its number. The range is not checked.
    ///
    /// # Errors
    /// When type or unit do not fit; the message names variable, value, and what was expected.
    pub fn fit(&self, variable: &FmuVariable, units: &[Unit], fmu: &FmuDescription) -> io::Result<Self> {
        if !variable.dimensions.is_empty() {
            return Err(self.refused(variable, "it is an array of FMI 3.0"));
        }
        match (variable.value_type(), self) {
            (ValueType::Real, Self::Real(value, unit)) => {
                let value = match unit {
                    Some(unit) if *unit != variable.unit => {
                        let conversion = unit_conversion((unit, units), (&variable.unit, &fmu.units));
                        let conversion = conversion.map_err(|reason| self.refused(variable, &reason))?;
                        variable.of_its_quantity(conversion).apply(*value)
                    }
                    _ => *value,
                };
                Ok(Self::Real(value, Some(variable.unit.clone()).filter(|unit| !unit.is_empty())))
            }
            (ValueType::Real, Self::Integer(value)) => {
                Self::Real(f64::from(*value), None).fit(variable, units, fmu)
            }
            (ValueType::Integer, Self::Integer(_))
            | (ValueType::Boolean, Self::Boolean(_))
            | (ValueType::String, Self::String(_)) => Ok(self.clone()),
            (ValueType::Enumeration, Self::Enumeration(_) | Self::String(_) | Self::Integer(_)) => {
                let enumeration = fmu.enumeration(&variable.declared_type).ok_or_else(|| {
                    self.refused(variable, &format!("its type {} is not defined", variable.declared_type))
                })?;
                let is_meant = |(name, number): &&(String, i32)| match self {
                    Self::Integer(wanted) => number == wanted,
                    Self::Enumeration(wanted) | Self::String(wanted) => name == wanted,
                    _ => false,
                };
                let (item, _) = enumeration.items.iter().find(is_meant).ok_or_else(|| {
                    let items: Vec<_> = enumeration.items.iter().map(|(name, _)| name.as_str()).collect();
                    self.refused(variable, &format!("it is not one of {}", items.join(", ")))
                })?;
                Ok(Self::Enumeration(item.clone()))
            }
            _ => {
                let wanted = &variable.data_type;
                Err(self.refused(variable, &format!("it is of the type {}, not {wanted}", self.type_name())))
            }
        }
    }

    /// Rejects a number outside a variable's range.
    ///
    /// # Errors
    /// When it is outside or not finite; the message names variable and range.
    pub fn check_range(&self, variable: &FmuVariable) -> io::Result<()> {
        let number = match self {
            Self::Real(value, _) => *value,
            Self::Integer(value) => f64::from(*value),
            Self::Boolean(_) | Self::String(_) | Self::Enumeration(_) => return Ok(()),
        };
        let (min, max) = variable.range()?;
        if number.is_finite() && (min..=max).contains(&number) {
            Ok(())
        } else {
            let [min, max] = [min, max].map(terminal::number);
            if variable.causality == Causality::StructuralParameter && min == max {
                let reason = format!("it is fixed at {min} when the FMU is built");
                return Err(self.refused(variable, &reason));
            }
            let unit = if variable.unit.is_empty() { String::new() } else { format!(" {}", variable.unit) };
            Err(self.refused(variable, &format!("{self} is not within {min}..{max}{unit}")))
        }
    }

    /// The unit that was probably meant by a number without a unit, which is taken in the variable's unit. If it is
    /// below a hundredth or above a hundred times the start value, this is the display unit in which it comes near the
    /// start value.
    #[must_use]
    pub fn meant_unit(&self, variable: &FmuVariable, fmu: &FmuDescription) -> Option<String> {
        let (Self::Real(value, None), Ok(start)) = (self, variable.start.trim().parse::<f64>()) else {
            return None;
        };
        let is_near = |value: f64| (1.0 / FAR..=FAR).contains(&(value / start));
        let own = fmu.unit(&variable.unit)?.base?;
        let comes_near = |unit: &Unit| {
            unit.base
                .and_then(|unit| unit.to(&own))
                .is_some_and(|conversion| is_near(variable.of_its_quantity(conversion).apply(*value)))
        };
        if is_near(*value) { None } else { units_of(variable, fmu).find(comes_near).map(|unit| unit.name) }
    }

    /// The value as a number, 0 or 1 for a Boolean; none for texts and items.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Real(value, _) => Some(*value),
            Self::Integer(value) => Some(f64::from(*value)),
            Self::Boolean(value) => Some(f64::from(u8::from(*value))),
            Self::String(_) | Self::Enumeration(_) => None,
        }
    }

    fn refused(&self, variable: &FmuVariable, reason: &str) -> io::Error {
        broken(format!("the value {self} of {} cannot be used: {reason}", variable.name))
    }

    fn type_name(&self) -> &'static str {
        match self {
            Self::Real(..) => "Real",
            Self::Integer(_) => "Integer",
            Self::Boolean(_) => "Boolean",
            Self::String(_) => "String",
            Self::Enumeration(_) => "Enumeration",
        }
    }
}

/// The variable's unit and its display units.
fn units_of(variable: &FmuVariable, fmu: &FmuDescription) -> impl Iterator<Item = Unit> {
    let unit = fmu.unit(&variable.unit);
    unit.map(|unit| unit.with_display_units().collect::<Vec<_>>()).into_iter().flatten()
}

impl FmuVariable {
    /// The conversion from a unit to the variable's; none if there is no unit to convert from or to. The unit is one of
    /// the FMU's, or of the [table](fmu_terms::UnitTable).
    ///
    /// # Errors
    /// When the unit is not known, or does not convert.
    pub fn conversion_from(&self, unit: &str, fmu: &FmuDescription) -> Result<Linear, String> {
        if unit.is_empty() || self.unit.is_empty() || unit == self.unit {
            return Ok(Linear::IDENTITY);
        }
        unit_conversion((unit, &fmu.units), (&self.unit, &fmu.units))
            .map(|conversion| self.of_its_quantity(conversion))
    }

    /// A conversion of its values between units: without the offset if they are differences.
    pub(crate) fn of_its_quantity(&self, conversion: Linear) -> Linear {
        if self.relative_quantity { Linear { offset: 0.0, ..conversion } } else { conversion }
    }
}

#[cfg(test)]
mod tests {
    use fmu_terms::DisplayUnit;

    use super::*;

    const FMU: &str = r#"<fmiModelDescription fmiVersion="2.0" modelName="Vessel">
      <UnitDefinitions><Unit name="Pa"><BaseUnit kg="1" m="-1" s="-2"/><DisplayUnit name="kPa" factor="1e-3"/></Unit>
      <Unit name="K"><BaseUnit K="1"/><DisplayUnit name="degC" offset="-273.15"/></Unit></UnitDefinitions>
      <TypeDefinitions><SimpleType name="Warming"><Real unit="K" displayUnit="degC" relativeQuantity="true"/></SimpleType>
      <SimpleType name="Mode"><Enumeration><Item name="off" value="3"/><Item name="on" value="5"/>
      </Enumeration></SimpleType></TypeDefinitions>
      <ModelVariables>
        <ScalarVariable name="pressure" causality="parameter"><Real unit="Pa" min="0" max="2e5" start="101325"/></ScalarVariable>
        <ScalarVariable name="count" causality="parameter"><Integer min="1" max="4"/></ScalarVariable>
        <ScalarVariable name="mode" causality="parameter"><Enumeration declaredType="Mode"/></ScalarVariable>
        <ScalarVariable name="size" causality="structuralParameter" initial="exact"><Integer min="40" max="40"/></ScalarVariable>
        <ScalarVariable name="level" causality="output"><Real/></ScalarVariable>
        <ScalarVariable name="warming" causality="parameter"><Real declaredType="Warming"/></ScalarVariable>
        <ScalarVariable name="excess" causality="parameter"><Real unit="K" relativeQuantity="true"/></ScalarVariable>
        <ScalarVariable name="temperature" causality="parameter"><Real unit="K" displayUnit="degC"/></ScalarVariable>
      </ModelVariables></fmiModelDescription>"#;

    fn fit(name: &str, value: Value) -> Result<Value, String> {
        let base = FmuDescription::parse(FMU).unwrap().unit("Pa").and_then(|unit| unit.base);
        let base = base.map(|base| super::super::BaseUnit { factor: 100.0, ..base });
        let set = ParameterSet {
            parameters: vec![Parameter { name: name.to_owned(), description: String::new(), value }],
            units: vec![Unit { name: "atm".to_owned(), base, display_units: vec![] }],
            ..ParameterSet::default()
        };
        let fitted = set.fit(&FmuDescription::parse(FMU).unwrap()).map_err(|error| error.to_string())?;
        Ok(fitted.parameters[0].value.clone())
    }

    fn pressure(value: f64, unit: &str) -> Result<Value, String> {
        fit("pressure", Value::Real(value, Some(unit.to_owned())))
    }

    #[test]
    fn values_become_those_of_the_variable() {
        let pascal = |value| Ok(Value::Real(value, Some("Pa".to_owned())));
        assert_eq!(pressure(1.5, "kPa"), pascal(1500.0));
        // A unit that the set defines, and one of the table.
        assert_eq!(pressure(1.5, "atm"), pascal(150.0));
        assert_eq!(pressure(1.5, "bar"), pascal(150_000.0));
        assert_eq!(fit("pressure", Value::Integer(7)), pascal(7.0));
        assert_eq!(fit("count", Value::Integer(4)), Ok(Value::Integer(4)));
        for value in [Value::Enumeration("on".into()), Value::String("on".into()), Value::Integer(5)] {
            assert_eq!(fit("mode", value), Ok(Value::Enumeration("on".to_owned())));
        }
    }

    /// FMI 2.0.5, section 2.2.3: a difference of 10 degC is one of 10 K.
    #[test]
    fn differences_are_converted_without_offsets() {
        let fmu = FmuDescription::parse(FMU).unwrap();
        // Of a variable or its type.
        for (name, offset) in [("temperature", 273.15), ("warming", 0.0), ("excess", 0.0)] {
            let variable = fmu.variable(name).unwrap();
            let degrees = Value::Real(10.0, Some("degC".to_owned()));
            assert_eq!(fit(name, degrees), Ok(Value::Real(10.0 + offset, Some("K".to_owned()))));
            assert_eq!(variable.conversion_from("degC", &fmu), Ok(Linear { factor: 1.0, offset }));
            let degrees = DisplayUnit { name: "degC".to_owned(), factor: 1.0, offset: -offset };
            assert_eq!(fmu.display_unit(variable), (name != "excess").then_some(degrees));
        }
    }

    #[test]
    fn the_unit_that_was_meant_brings_a_value_near_the_start_value() {
        let fmu = FmuDescription::parse(FMU).unwrap();
        let meant = |value| Value::Real(value, None).meant_unit(fmu.variable("pressure").unwrap(), &fmu);
        assert_eq!(
            [150.0, 0.5, 1100.0, 2e7, -150.0, 0.0].map(meant),
            [Some("kPa".to_owned()), None, None, None, None, None]
        );
        let with_unit = Value::Real(150.0, Some("Pa".to_owned()));
        assert_eq!(with_unit.meant_unit(fmu.variable("pressure").unwrap(), &fmu), None);
    }

    #[test]
    fn parameters_that_do_not_fit_are_refused_by_name() {
        let refusal = |name: &str, value| fit(name, value).unwrap_err();
        assert_eq!(
            pressure(1.0, "N").unwrap_err(),
            "the value 1 N of pressure cannot be used: the unit N does not convert to Pa"
        );
        assert_eq!(
            pressure(1.0, "psy").unwrap_err(),
            "the value 1 psy of pressure cannot be used: the unit 'psy' is not known; did you mean 'psi'?"
        );
        assert_eq!(
            pressure(201.0, "kPa").unwrap_err(),
            "the value 201000 Pa of pressure cannot be used: 201000 Pa is not within 0..200000 Pa"
        );
        // Without the number's 309 digits.
        assert_eq!(
            pressure(1e308, "Pa").unwrap_err(),
            "the value 1e308 Pa of pressure cannot be used: 1e308 Pa is not within 0..200000 Pa"
        );
        assert_eq!(
            refusal("count", Value::Integer(5)),
            "the value 5 of count cannot be used: 5 is not within 1..4"
        );
        assert_eq!(
            refusal("size", Value::Integer(20)),
            "the value 20 of size cannot be used: it is fixed at 40 when the FMU is built"
        );
        assert_eq!(fit("size", Value::Integer(40)), Ok(Value::Integer(40)));
        assert_eq!(
            refusal("count", Value::Real(1.0, None)),
            "the value 1 of count cannot be used: it is of the type Real, not Integer"
        );
        assert_eq!(
            refusal("mode", Value::Integer(1)),
            "the value 1 of mode cannot be used: it is not one of off, on"
        );
        assert_eq!(
            refusal("presure", Value::Integer(1)),
            "Vessel has no variable presure; did you mean pressure?"
        );
        assert_eq!(refusal("level", Value::Integer(1)), "level cannot be set: its causality is output");
    }
}
