//! An FMU's description in the interface's names and units, for coupling and recording.

use std::collections::BTreeMap;

use fmu_io::terminal::number;
use fmu_package::{Causality, FmuDescription, FmuVariable, Function, Unit};

use crate::Port;
use crate::compatibility::{Compatibility, Match};

/// The description of an FMU in the interface's names and units, and the conversion of its values.
#[derive(Clone, Debug)]
pub struct Translation {
    /// The description in these names and units.
    pub description: FmuDescription,
    /// The conversions to an input's values and from those of an output, by name; values of other variables are not
    /// converted.
    pub conversions: BTreeMap<String, Function>,
    /// The values from which on Booleans are true, by name.
    pub thresholds: BTreeMap<String, f64>,
}

impl Compatibility<'_> {
    /// The FMU in the interface's names and units.
    #[must_use]
    pub fn translation(&self) -> Translation {
        let mut description = self.fmu.clone();
        let (mut conversions, mut thresholds) = (BTreeMap::new(), BTreeMap::new());
        let units: Vec<_> = self.matches.iter().map(|(port, _)| port.unit()).collect();
        description.units.clear();
        // Without other variables' units that the interface defines differently.
        for unit in units.iter().chain(&self.fmu.units) {
            if description.units.iter().all(|known| known.name != unit.name) {
                description.units.push(unit.clone());
            }
        }
        let foreign =
            |unit: &&Unit| units.iter().any(|known| known.name == unit.name && known.base != unit.base);
        let foreign: Vec<_> = self.fmu.units.iter().filter(foreign).map(|unit| &unit.name).collect();

        let mut variables = vec![];
        for variable in &self.fmu.variables {
            let connected = self.matches.iter().filter_map(|(port, found)| match found {
                Match::Found { variable: own, conversion, threshold, .. } if own.name == variable.name => {
                    Some((port, conversion, *threshold))
                }
                _ => None,
            });
            let before = variables.len();
            for (port, conversion, threshold) in connected {
                variables.push(translated(variable, port, &port.to_interface(conversion)));
                conversions.insert(port.name().to_owned(), conversion.clone());
                thresholds.extend(threshold.map(|threshold| (port.name().to_owned(), threshold)));
            }
            if variables.len() > before {
                continue;
            }
            let namesake = self.matches.iter().find(|(port, _)| port.name() == variable.name);
            let mut variable = variable.clone();
            if foreign.contains(&&variable.unit) {
                variable.unit.clear();
            }
            match namesake {
                None => variables.push(variable),
                Some((_, Match::Unconnected)) => {
                    variable.causality = Causality::Local.into();
                    variables.push(variable);
                }
                Some(_) => {}
            }
        }
        description.variables = variables.into();
        Translation { description, conversions, thresholds }
    }
}

/// A variable by the interface's name, in its unit.
fn translated(variable: &FmuVariable, port: &Port<'_>, to_interface: &Function) -> FmuVariable {
    let converted = |text: &String| match text.trim().parse::<f64>() {
        Ok(value) => number(to_interface.apply(value)),
        // Empty or not a number.
        Err(_) => text.clone(),
    };
    let [min, max] = match to_interface {
        Function::Linear(linear) if linear.factor < 0.0 => [&variable.max, &variable.min].map(converted),
        Function::Linear(_) => [&variable.min, &variable.max].map(converted),
        Function::Table(_) => [String::new(), String::new()],
    };
    FmuVariable {
        name: port.name().to_owned(),
        unit: port.unit().name,
        start: converted(&variable.start),
        min,
        max,
        ..variable.clone()
    }
}

#[cfg(test)]
mod tests {
    use fmu_package::{FmuDescription, Linear};

    use super::*;
    use crate::Role;
    use crate::tests::{INTERFACE, connected};

    const FMU: &str = r#"<fmiModelDescription fmiVersion="2.0" modelName="Other">
      <CoSimulation modelIdentifier="Other"/>
      <UnitDefinitions>
        <Unit name="bar"><BaseUnit kg="1" m="-1" s="-2" factor="1e5"/></Unit>
        <Unit name="%"><BaseUnit/></Unit>
      </UnitDefinitions>
      <ModelVariables>
        <ScalarVariable name="p" causality="output"><Real unit="bar" start="1.5" min="0" max="3"/></ScalarVariable>
        <ScalarVariable name="shut" causality="input"><Real start="0.25" min="0" max="1"/></ScalarVariable>
        <ScalarVariable name="hp_bypass" causality="input"><Real/></ScalarVariable>
        <ScalarVariable name="boost_pressure" causality="output"><Real unit="bar"/></ScalarVariable>
        <ScalarVariable name="slip" causality="output"><Real unit="%"/></ScalarVariable>
      </ModelVariables></fmiModelDescription>"#;

    #[test]
    fn an_fmu_gets_the_names_and_units_of_the_interface() {
        let fmu = FmuDescription::parse(FMU).unwrap();
        let connections = connected(
            r#"{ from = "plant:p", to = "controller:boost_pressure" },
               { from = "controller:hp_wastegate_pwm", to = "plant:shut", factor = -0.01, offset = 1 }"#,
        );
        let compatibility = Compatibility::new(&INTERFACE, Role::Plant, &fmu, &connections).unwrap();
        assert!(compatibility.fits(), "{compatibility}");
        let Translation { description, conversions, .. } = compatibility.translation();
        let seen: Vec<_> = description
            .variables
            .iter()
            .map(|v| {
                let FmuVariable { name, causality, unit, start, min, max, .. } = v;
                [name.as_str(), causality.text(), unit, start, min, max]
            })
            .collect();
        assert_eq!(
            seen,
            [
                ["boost_pressure", "output", "Pa", "150000", "0", "300000"],
                ["hp_wastegate_pwm", "input", "%", "75", "0", "100"],
                ["hp_bypass", "local", "", "", "", ""],
                // Its boost_pressure is not the interface's, and its % is not the interface's hundredth.
                ["slip", "output", "", "", "", ""],
            ]
        );
        let converted = |name: &str, value| conversions[name].apply(value).to_bits();
        assert_eq!(converted("boost_pressure", 1.25), 125_000_f64.to_bits());
        assert_eq!(converted("hp_wastegate_pwm", 25.0), 0.75_f64.to_bits());
        assert_eq!(conversions.len(), 2);
        assert!(description.unit("bar").is_some());
        assert_eq!(description.unit("%").unwrap().base.unwrap().factor.to_bits(), 0.01_f64.to_bits());
    }

    /// Numbers into a Boolean follow one rule, which a run applies.
    #[test]
    fn a_boolean_takes_the_place_of_a_real_with_or_without_a_threshold() {
        let boolean = FMU.replace(
            r#"<ScalarVariable name="hp_bypass" causality="input"><Real/>"#,
            r#"<ScalarVariable name="on" causality="input"><Boolean/>"#,
        );
        let fmu = FmuDescription::parse(&boolean).unwrap();
        // The seen value of true, whose input is 0 where it is exchanged.
        for (more, expected, of_true) in [
            ("", None, 1.0),
            (", threshold = 0.5", Some(0.5), 1.0),
            (", table = [[0, 1], [1, 0]]", None, 0.0),
            (", factor = -1, offset = 1", None, 0.0),
        ] {
            let connections = connected(&format!(
                r#"{{ from = "plant:p", to = "controller:boost_pressure" }},
                   {{ from = "controller:hp_wastegate_pwm", to = "plant:shut", to_unit = "1" }},
                   {{ from = "controller:vacuum_pump", to = "plant:on"{more} }}"#
            ));
            let compatibility = Compatibility::new(&INTERFACE, Role::Plant, &fmu, &connections).unwrap();
            assert!(compatibility.fits(), "{compatibility}");
            let Translation { conversions, thresholds, .. } = compatibility.translation();
            assert_eq!(thresholds.get("vacuum_pump").copied(), expected);
            assert_eq!(conversions["vacuum_pump"].apply(1.0).to_bits(), f64::to_bits(of_true), "{more}");
        }
    }

    /// The whole numbers of an Integer are those of a run, which the inverse of an inverse rounds.
    #[test]
    fn a_conversion_is_the_connections_own() {
        let integer = FMU.replace(
            r#"<ScalarVariable name="hp_bypass" causality="input"><Real/>"#,
            r#"<ScalarVariable name="stage" causality="input"><Integer/>"#,
        );
        let fmu = FmuDescription::parse(&integer).unwrap();
        let connections = connected(
            r#"{ from = "plant:p", to = "controller:boost_pressure", factor = 3, offset = -20 },
               { from = "controller:hp_wastegate_pwm", to = "plant:stage", factor = 3, offset = -20 }"#,
        );
        let compatibility = Compatibility::new(&INTERFACE, Role::Plant, &fmu, &connections).unwrap();
        assert!(compatibility.fits(), "{compatibility}");
        let given = Function::from(Linear { factor: 3.0, offset: -20.0 });
        let Translation { conversions, .. } = compatibility.translation();
        assert_eq!(conversions["hp_wastegate_pwm"], given);
        assert_eq!(conversions["boost_pressure"], given);
    }

    #[test]
    fn an_input_has_one_source() {
        let fmu = FmuDescription::parse(FMU).unwrap();
        let connections = connected(
            r#"{ from = "plant:p", to = "controller:boost_pressure" },
               { from = "throttle", to = "plant:shut", to_unit = "1" },
               { from = "controller:hp_wastegate_pwm", to = "plant:shut", to_unit = "1" }"#,
        );
        let compatibility = Compatibility::new(&INTERFACE, Role::Plant, &fmu, &connections).unwrap();
        assert_eq!(compatibility.problems, ["its input shut cannot be both hp_wastegate_pwm and throttle"]);
        assert!(!compatibility.fits());
    }
}
