//! Checks whether an FMU can replace the plant or the controller: finds its variable for each variable of the
//! interface, with problems and conversions.

use std::collections::BTreeMap;

use anyhow::Result;
use fmu_io::terminal::number;
use fmu_package::connection::{Connection, Conversion};
use fmu_package::{Causality, Domain, FmuDescription, FmuVariable, Function, Kind, ValueType, Version};

use crate::choice::{Choice, choices};
use crate::likeness::suggestions;
use crate::units::{converted, mismatch, relation};
use crate::{Interface, Port, Role};

/// How an FMU fits the interface as a plant or a controller.
pub struct Compatibility<'a> {
    /// The interface.
    pub interface: &'a Interface,
    /// Which of the two FMUs the FMU under test would replace.
    pub role: Role,
    /// The description of the FMU under test.
    pub fmu: &'a FmuDescription,
    /// What was found for each variable of the interface.
    pub matches: Vec<(Port<'a>, Match<'a>)>,
    /// Problems of the FMU as a whole.
    pub problems: Vec<String>,
    /// What the given connections say, by the interface's names.
    pub(crate) choices: BTreeMap<String, Choice>,
}

/// What was found for a variable of the interface.
pub enum Match<'a> {
    /// No variable has this name.
    Missing {
        /// Similar names, the most similar first.
        suggestions: Vec<&'a str>,
    },
    /// The given connections leave the variable out.
    Unconnected,
    /// A connection names a variable that the FMU does not have.
    Unknown {
        /// The name in the connection.
        name: String,
        /// Similar names, the most similar first.
        suggestions: Vec<&'a str>,
    },
    /// The FMU has the variable; it may still not fit.
    Found {
        /// The FMU's variable.
        variable: &'a FmuVariable,
        /// The conversion from the interface's values to those of an input, from those of an output to the interface's.
        conversion: Function,
        /// The value from which on a Boolean is true, if a connection gives one.
        threshold: Option<f64>,
        /// Why the variable does not fit.
        problems: Vec<String>,
        /// Remarks for the user.
        notes: Vec<String>,
    },
}

/// What a match means for the FMU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The port is connected.
    Fits,
    /// The port is left out, and is not needed.
    LeftOut,
    /// A connection of the loop is left open.
    Open,
    /// The port cannot be connected.
    Wrong,
}

impl<'a> Compatibility<'a> {
    /// Compares an FMU with the interface, by connections of the system, or by name without any.
    ///
    /// # Errors
    /// When a connection is not one of plant and controller.
    pub fn new(
        interface: &'a Interface,
        role: Role,
        fmu: &'a FmuDescription,
        connections: &[Connection],
    ) -> Result<Self> {
        let choices = choices(interface, role, connections)?;
        let is_by_name = connections.is_empty();
        let mut problems = vec![];
        let version = fmu.attribute("fmiVersion");
        if Version::declared(version).is_none() {
            problems.push(format!("it is FMI {version}; only FMI 2.0 and 3.0 can be coupled"));
        }
        if fmu.co_simulation_identifier().is_none() {
            problems.push("it does not support co-simulation".to_owned());
        }
        let mut matches: Vec<(Port<'a>, Match<'a>)> = interface
            .ports(role)
            .map(|port| (port, Match::new(&port, fmu, choices.get(port.name()), is_by_name)))
            .collect();
        suggest(&mut matches, fmu);
        for (index, (port, found)) in matches.iter().enumerate() {
            let twin = matches[..index].iter().find(|(other, same)| {
                other.kind == Kind::Input && port.kind == Kind::Input && found.is_the_same_as(same)
            });
            if let (Some((other, _)), Match::Found { variable, .. }) = (twin, found) {
                let [one, two] = [other.name(), port.name()];
                problems.push(format!("its input {} cannot be both {one} and {two}", variable.name));
            }
        }
        Ok(Self { interface, role, fmu, matches, problems, choices })
    }

    /// Whether the FMU fits.
    #[must_use]
    pub fn fits(&self) -> bool {
        self.problems.is_empty()
            && self.matches.iter().all(|(port, found)| found.verdict(port) != Verdict::Wrong)
    }

    /// The FMU's inputs without a connection: they keep their start values.
    pub fn other_inputs(&self) -> impl Iterator<Item = &'a FmuVariable> {
        self.unconnected(Causality::Input)
    }

    /// The FMU's variables of a causality that are none of the interface's.
    pub(crate) fn unconnected(&self, causality: Causality) -> impl Iterator<Item = &'a FmuVariable> {
        self.fmu.of_causality(causality).filter(|variable| !is_found(&self.matches, variable))
    }
}

/// Whether a variable is one of the interface's.
fn is_found(matches: &[(Port<'_>, Match<'_>)], variable: &FmuVariable) -> bool {
    let is_it =
        |found: &Match<'_>| matches!(found, Match::Found { variable: own, .. } if own.name == variable.name);
    matches.iter().any(|(_, found)| is_it(found))
}

/// Fills in the similar names where no variable was found.
fn suggest<'a>(matches: &mut [(Port<'a>, Match<'a>)], fmu: &'a FmuDescription) {
    let wanted = matches.iter().filter_map(|(port, found)| Some((port, found.missing(port)?)));
    let similar = suggestions(&wanted.collect::<Vec<_>>(), fmu, |variable| !is_found(matches, variable));
    let missing = matches.iter_mut().filter_map(|(_, found)| match found {
        Match::Missing { suggestions } | Match::Unknown { suggestions, .. } => Some(suggestions),
        Match::Unconnected | Match::Found { .. } => None,
    });
    missing.zip(similar).for_each(|(suggestions, similar)| *suggestions = similar);
}

impl<'a> Match<'a> {
    fn new(port: &Port<'_>, fmu: &'a FmuDescription, choice: Option<&Choice>, is_by_name: bool) -> Self {
        // Connections lead to inputs only.
        let is_by_name = is_by_name || !port.is_connectable();
        let (name, conversion) = match choice {
            Some(choice) => (choice.name.as_str(), &choice.conversion),
            None if is_by_name => (port.name(), &Conversion::DECLARED),
            None => return Self::Unconnected,
        };
        match (fmu.variable(name), choice) {
            (Some(variable), _) => {
                let threshold = choice.and_then(|choice| choice.threshold);
                Self::found(port, fmu, variable, conversion, threshold)
            }
            (None, Some(_)) => Self::Unknown { name: name.to_owned(), suggestions: vec![] },
            (None, None) => Self::Missing { suggestions: vec![] },
        }
    }

    fn found(
        port: &Port<'_>,
        fmu: &FmuDescription,
        variable: &'a FmuVariable,
        conversion: &Conversion,
        threshold: Option<f64>,
    ) -> Self {
        let mut problems = vec![];
        let mut notes = vec![];
        match (variable.value_type(), threshold) {
            (ValueType::String | ValueType::Other, _) => {
                problems.push(format!("its type is {}, not a number", variable.data_type));
            }
            (_, Some(threshold)) => match Domain::with_threshold(variable, threshold) {
                Ok(_) => notes.push(format!("it is true from {} on", number(threshold))),
                Err(reason) => problems.push(reason),
            },
            (value_type, None) if port.kind == Kind::Input => {
                // A run refuses other numbers.
                let taken = match value_type {
                    ValueType::Boolean => "0 and 1; with a connection's threshold any number",
                    ValueType::Integer => "whole numbers",
                    _ => "the numbers of its items",
                };
                notes.extend((value_type != ValueType::Real).then(|| format!("it takes {taken}")));
            }
            _ => {}
        }
        if !variable.dimensions.is_empty() {
            problems.push("it is an array".to_owned());
        }
        let causality = port.kind.causality();
        if variable.causality != causality {
            let own = Some(variable.causality.text()).filter(|own| !own.is_empty()).unwrap_or("local");
            problems.push(format!("its causality is {own}, not {causality}"));
        }
        let (conversion, is_certain) = converted(port, fmu, variable, conversion).unwrap_or_else(|problem| {
            problems.push(problem);
            (Function::IDENTITY, true)
        });
        let to_interface = port.to_interface(&conversion);
        if to_interface != Function::IDENTITY {
            notes.push(relation(port, &to_interface, &variable.name));
        } else if !is_certain {
            notes.push(format!("it declares no unit; assumed to be {}", port.unit().name));
        }
        match mismatch(port, variable, &to_interface, is_certain) {
            Ok(None) => {}
            Ok(Some(text)) if is_certain => notes.push(text),
            Ok(Some(text)) => {
                problems.push(format!("it declares no unit, and {text}; give its unit in a connection"));
            }
            Err(text) => problems.push(text),
        }
        Self::Found { variable, conversion, threshold, problems, notes }
    }

    /// Whether both are the same variable.
    fn is_the_same_as(&self, other: &Self) -> bool {
        matches!(
            (self, other),
            (Self::Found { variable: one, .. }, Self::Found { variable: two, .. }) if one.name == two.name
        )
    }

    /// What the match means for a port.
    #[must_use]
    pub fn verdict(&self, port: &Port<'_>) -> Verdict {
        match self {
            Self::Found { problems, .. } if problems.is_empty() => Verdict::Fits,
            Self::Unconnected if port.is_required() => Verdict::Open,
            Self::Unconnected => Verdict::LeftOut,
            Self::Missing { .. } if !port.is_required() => Verdict::LeftOut,
            _ => Verdict::Wrong,
        }
    }

    /// The name that is looked for, if the FMU has no variable of this name.
    fn missing<'m>(&'m self, port: &'m Port<'_>) -> Option<&'m str> {
        match self {
            Self::Missing { .. } => Some(port.name()),
            Self::Unknown { name, .. } => Some(name),
            Self::Unconnected | Self::Found { .. } => None,
        }
    }

    /// The most similar name, if the variable is not found.
    pub(crate) fn proposal(&self) -> Option<&'a str> {
        match self {
            Self::Missing { suggestions } | Self::Unknown { suggestions, .. } => suggestions.first().copied(),
            Self::Unconnected | Self::Found { .. } => None,
        }
    }

    /// What to say of the match.
    pub(crate) fn remarks(&self) -> String {
        let like = |suggestions: &[&str]| match suggestions {
            [] => String::new(),
            names => format!("; similar: {}", names.join(", ")),
        };
        match self {
            Self::Missing { suggestions } => format!("missing{}", like(suggestions)),
            Self::Unconnected => "no connection".to_owned(),
            Self::Unknown { name, suggestions } => format!("{name} is missing{}", like(suggestions)),
            Self::Found { problems, notes, .. } => [problems.as_slice(), notes].concat().join("; "),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::INTERFACE;

    fn fmu(variables: &str) -> FmuDescription {
        let xml = format!(
            r#"<fmiModelDescription fmiVersion="2.0" modelName="Other">
              <CoSimulation modelIdentifier="Other"/>
              <UnitDefinitions>
                <Unit name="bar"><BaseUnit kg="1" m="-1" s="-2" factor="1e5"/></Unit>
                <Unit name="V"><BaseUnit kg="1" m="2" s="-3" A="-1"/></Unit>
                <Unit name="odd"/>
              </UnitDefinitions>
              <ModelVariables>{variables}</ModelVariables></fmiModelDescription>"#
        );
        FmuDescription::parse(&xml).unwrap()
    }

    fn real(name: &str, causality: &str, real: &str) -> String {
        format!(r#"<ScalarVariable name="{name}" causality="{causality}"><Real {real}/></ScalarVariable>"#)
    }

    /// The match of a variable of the plant.
    fn found<'a>(fmu: &'a FmuDescription, name: &str) -> Match<'a> {
        let compatibility = Compatibility::new(&INTERFACE, Role::Plant, fmu, &[]).unwrap();
        compatibility.matches.into_iter().find(|(port, _)| port.name() == name).unwrap().1
    }

    #[test]
    fn our_own_fmus_fit_without_remarks() {
        for role in [Role::Plant, Role::Controller] {
            let compatibility =
                Compatibility::new(&INTERFACE, role, INTERFACE.description(role), &[]).unwrap();
            assert!(compatibility.fits() && compatibility.other_inputs().next().is_none());
            for (_, found) in &compatibility.matches {
                assert!(
                    matches!(found, Match::Found { conversion: Function::IDENTITY, notes, .. } if notes.is_empty())
                );
            }
        }
    }

    #[test]
    fn units_convert_or_are_refused() {
        for (unit, expected) in [
            (r#"unit="bar""#, Ok(1e5)),
            (r#"unit="Pa""#, Ok(1.0)),
            ("", Ok(1.0)),
            (r#"unit="V""#, Err("the unit V does not convert to Pa")),
            (r#"unit="odd""#, Err("the unit 'odd' is not known")),
            // Without a definition, in the table.
            (r#"unit="kPa""#, Ok(1e3)),
            (r#"start="1.0""#, Err("it declares no unit, and its start value is 1, the interface's ")),
            (r#"max="3e5""#, Err("")),
        ] {
            let fmu = fmu(&real("boost_pressure", "output", unit));
            let Match::Found { conversion, problems, .. } = found(&fmu, "boost_pressure") else {
                panic!("{unit}: not found")
            };
            match expected {
                Ok(factor) => {
                    assert_eq!((problems, conversion.linear().factor), (vec![], factor), "{unit}");
                }
                Err("") => assert!(problems.is_empty(), "{unit}: {problems:?}"),
                Err(text) => assert!(problems[0].starts_with(text), "{unit}: {problems:?}"),
            }
        }
    }

    #[test]
    fn a_duty_between_0_and_1_is_detected_without_a_unit() {
        let fmu = fmu(&real("hp_wastegate_pwm", "input", r#"min="0" max="1""#));
        let Match::Found { problems, .. } = found(&fmu, "hp_wastegate_pwm") else { panic!("not found") };
        assert_eq!(
            problems,
            [
                "it declares no unit, and its range is 0..1 %, the interface's 0..100 %; give its unit in a connection"
            ]
        );
    }

    #[test]
    fn wrong_causality_and_type_are_reported() {
        let fmu = fmu(&format!(
            r#"{}<ScalarVariable name="vacuum_pump" causality="input"><Boolean/></ScalarVariable>"#,
            real("boost_pressure", "local", "")
        ));
        let problems = |name| match found(&fmu, name) {
            Match::Found { problems, .. } => problems,
            _ => panic!("{name}: not found"),
        };
        assert_eq!(problems("boost_pressure"), ["its causality is local, not output"]);
        assert!(problems("vacuum_pump").is_empty());
        let compatibility = Compatibility::new(&INTERFACE, Role::Plant, &fmu, &[]).unwrap();
        assert!(!compatibility.fits());
    }

    #[test]
    fn only_similar_names_are_suggested() {
        let fmu = fmu(&[
            real("pBoost", "output", r#"unit="bar""#),
            real("boostPressure", "output", r#"unit="V""#),
            real("BoostPressureAbs", "output", ""),
            real("boost.pressure", "input", ""),
            real("temperature", "output", ""),
        ]
        .concat());
        let Match::Missing { suggestions } = found(&fmu, "boost_pressure") else { panic!("found") };
        assert_eq!(suggestions, ["pBoost", "BoostPressureAbs"]);
    }
}
