//! Checks whether an FMU can replace the plant or the controller: finds its variable for each variable of the
//! interface, with problems and conversions.

use std::fmt::{self, Display, Formatter};

use anyhow::{Result, bail};
use fmu_io::terminal::{in_line, number};
use fmu_package::{Causality, FmuDescription, FmuVariable, Kind, Linear, ValueType};

use crate::name_map::{Entry, Meaning, NameMap};
use crate::{Interface, Port, Role};

/// The least similarity of a suggestion to the interface's name, from 0 to 1.
const LIKENESS: f64 = 0.6;
/// The number of suggested names.
const SUGGESTIONS: usize = 3;
/// Values that differ by this factor are probably in different units.
const SUSPICIOUS_FACTOR: f64 = 10.0;

/// How an FMU fits the interface as a plant or a controller.
pub struct Compatibility<'a> {
    /// The interface.
    pub interface: &'a Interface,
    /// Which of the two FMUs it would replace.
    pub role: Role,
    /// The description of the FMU under test.
    pub fmu: &'a FmuDescription,
    /// For each variable of the interface.
    pub matches: Vec<(Port<'a>, Match<'a>)>,
    /// Problems of the FMU as a whole.
    pub problems: Vec<String>,
}

/// What was found for a variable of the interface.
pub enum Match<'a> {
    /// No variable has this name.
    Missing {
        /// Similar names, the most similar first.
        suggestions: Vec<&'a str>,
    },
    /// The map leaves it unconnected.
    Unconnected,
    /// The map names a variable that the FMU does not have.
    Unknown {
        /// The name in the map.
        name: String,
        /// Similar names, the most similar first.
        suggestions: Vec<&'a str>,
    },
    /// The FMU has the variable; it may still not fit.
    Found {
        /// The FMU's variable.
        variable: &'a FmuVariable,
        /// The conversion of its values to the interface.
        to_interface: Linear,
        /// Why it does not fit.
        problems: Vec<String>,
        /// Remarks for the user.
        notes: Vec<String>,
    },
}

/// What a match means for the FMU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It is connected.
    Fits,
    /// It is left out, and is not needed.
    LeftOut,
    /// The map leaves a connection of the loop open.
    Open,
    /// It cannot be connected.
    Wrong,
}

impl<'a> Compatibility<'a> {
    /// Compares an FMU with the interface, by name and by a map.
    ///
    /// # Errors
    /// When the map is for the other role or another FMU.
    pub fn new(
        interface: &'a Interface,
        role: Role,
        fmu: &'a FmuDescription,
        map: Option<&NameMap>,
    ) -> Result<Self> {
        if let Some(map) = map {
            if map.role != role {
                bail!("the map is for a {}, not for a {}", map.role.name(), role.name());
            }
            if map.fmu != fmu.attribute("modelName") {
                bail!("the map is for the FMU {}, not for {}", map.fmu, fmu.attribute("modelName"));
            }
        }
        let mut problems = vec![];
        let version = fmu.attribute("fmiVersion");
        if version != "2.0" && !fmu.is_fmi3() {
            problems.push(format!("it is FMI {version}; only FMI 2.0 and 3.0 can be coupled"));
        }
        if fmu.co_simulation_identifier().is_none() {
            problems.push("it does not support co-simulation".to_owned());
        }
        let matches: Vec<(Port<'a>, Match<'a>)> = interface
            .ports(role)
            .map(|port| {
                let entry = map.and_then(|map| map.variables.get(port.name()));
                (port, Match::new(&port, fmu, entry))
            })
            .collect();
        for (index, (port, found)) in matches.iter().enumerate() {
            let twin = matches[..index].iter().find(|(other, same)| {
                other.kind == Kind::Input && port.kind == Kind::Input && found.is_the_same_as(same)
            });
            if let (Some((other, _)), Match::Found { variable, .. }) = (twin, found) {
                let [one, two] = [other.name(), port.name()];
                problems.push(format!("its input {} cannot be both {one} and {two}", variable.name));
            }
        }
        Ok(Self { interface, role, fmu, matches, problems })
    }

    /// Whether the FMU fits.
    #[must_use]
    pub fn fits(&self) -> bool {
        self.problems.is_empty()
            && self.matches.iter().all(|(port, found)| found.verdict(port) != Verdict::Wrong)
    }

    /// The FMU's inputs without a connection: they keep their start values.
    pub fn other_inputs(&self) -> impl Iterator<Item = &'a FmuVariable> {
        self.fmu.of_causality(Causality::Input).filter(|input| {
            !self.matches.iter().any(
                |(_, found)| matches!(found, Match::Found { variable, .. } if variable.name == input.name),
            )
        })
    }

    /// The map that was used, with suggestions for variables that were not found.
    #[must_use]
    pub fn to_map(&self, given: Option<&NameMap>) -> NameMap {
        let variables = self.matches.iter().map(|(port, found)| {
            let given = given.and_then(|map| map.variables.get(port.name()).cloned());
            let entry = given.unwrap_or_else(|| match found {
                Match::Found { variable, .. } => {
                    Some(Entry { name: variable.name.clone(), ..Entry::default() })
                }
                Match::Missing { suggestions } if port.is_required() || !suggestions.is_empty() => {
                    Some(Entry {
                        name: suggestions.first().map(|&name| name.to_owned()).unwrap_or_default(),
                        candidates: suggestions.iter().map(|&name| name.to_owned()).collect(),
                        ..Entry::default()
                    })
                }
                _ => None,
            });
            (port.name().to_owned(), entry)
        });
        NameMap {
            role: self.role,
            fmu: self.fmu.attribute("modelName").to_owned(),
            variables: variables.collect(),
        }
    }
}

impl<'a> Match<'a> {
    fn new(port: &Port<'_>, fmu: &'a FmuDescription, entry: Option<&Option<Entry>>) -> Self {
        match entry {
            Some(None) => Self::Unconnected,
            Some(Some(entry)) => match fmu.variable(&entry.name) {
                Some(variable) => Self::found(port, fmu, variable, entry.meaning(port, fmu)),
                None => Self::Unknown {
                    name: entry.name.clone(),
                    suggestions: suggestions(port, &entry.name, fmu),
                },
            },
            None => match fmu.variable(port.name()) {
                Some(variable) => Self::found(port, fmu, variable, Ok(Meaning::Declared)),
                None => Self::Missing { suggestions: suggestions(port, port.name(), fmu) },
            },
        }
    }

    fn found(
        port: &Port<'_>,
        fmu: &FmuDescription,
        variable: &'a FmuVariable,
        meaning: Result<Meaning, String>,
    ) -> Self {
        let mut problems = vec![];
        let mut notes = vec![];
        if variable.value_type() != ValueType::Real {
            problems.push(format!("its type is {}, not Real", variable.data_type));
        }
        if !variable.dimensions.is_empty() {
            problems.push("it is an array".to_owned());
        }
        let causality = port.kind.causality();
        if variable.causality != causality {
            let own = Some(variable.causality.text()).filter(|own| !own.is_empty()).unwrap_or("local");
            problems.push(format!("its causality is {own}, not {causality}"));
        }
        let (to_interface, is_certain) = conversion(port, fmu, variable, meaning).unwrap_or_else(|problem| {
            problems.push(problem);
            (Linear::IDENTITY, true)
        });
        if to_interface != Linear::IDENTITY {
            notes.push(format!("{} = {}", port.name(), formula(to_interface, &variable.name)));
        } else if !is_certain {
            notes.push(format!("it declares no unit; assumed to be {}", port.unit().name));
        }
        match mismatch(port, variable, to_interface, is_certain) {
            Ok(None) => {}
            Ok(Some(text)) if is_certain => notes.push(text),
            Ok(Some(text)) => {
                problems.push(format!("it declares no unit, and {text}; give its unit in a map"));
            }
            Err(text) => problems.push(text),
        }
        Self::Found { variable, to_interface, problems, notes }
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
}

/// A line for each variable.
impl Display for Compatibility<'_> {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        writeln!(
            formatter,
            "{} as the {}, by the names and units of {}:",
            in_line(self.fmu.attribute("modelName")),
            self.role.name(),
            self.interface.model_identifier(self.role)
        )?;
        for problem in &self.problems {
            writeln!(formatter, "  WRONG  {}", in_line(problem))?;
        }
        let width = self.matches.iter().map(|(port, _)| port.name().len()).max().unwrap_or(0);
        for (port, found) in &self.matches {
            let word = match found.verdict(port) {
                Verdict::Fits => "ok",
                Verdict::LeftOut => "-",
                Verdict::Open => "open",
                Verdict::Wrong => "WRONG",
            };
            let kind = port.kind.name();
            let line = format!("  {word:5}  {kind:6}  {:width$}  {}", port.name(), details(found));
            writeln!(formatter, "{}", in_line(line.trim_end()))?;
        }
        let others: Vec<_> = self.other_inputs().map(|input| input.name.as_str()).collect();
        if !others.is_empty() {
            let others = in_line(&others.join(", "));
            writeln!(formatter, "Unconnected inputs, which keep their start values: {others}")?;
        }
        let open = self.matches.iter().filter(|(port, found)| found.verdict(port) == Verdict::Open);
        let open: Vec<_> = open.map(|(port, _)| port.name()).collect();
        let role = self.role.name();
        match (self.fits(), open.as_slice()) {
            (false, _) => writeln!(formatter, "It cannot replace the {role}."),
            (true, []) => writeln!(formatter, "It can replace the {role}."),
            (true, open) => writeln!(
                formatter,
                "It replaces the {role} only in part: the map leaves {} unconnected.",
                open.join(", ")
            ),
        }
    }
}

fn details(found: &Match<'_>) -> String {
    let like = |suggestions: &[&str]| match suggestions {
        [] => String::new(),
        names => format!("; similar: {}", names.join(", ")),
    };
    match found {
        Match::Missing { suggestions } => format!("missing{}", like(suggestions)),
        Match::Unconnected => "left unconnected by the map".to_owned(),
        Match::Unknown { name, suggestions } => {
            format!("the map's {name} is missing{}", like(suggestions))
        }
        Match::Found { variable, problems, notes, .. } => {
            let remarks: Vec<_> = problems.iter().chain(notes).map(String::as_str).collect();
            match remarks.join("; ") {
                remarks if remarks.is_empty() => variable.name.clone(),
                remarks => format!("{}: {remarks}", variable.name),
            }
        }
    }
}

/// A variable's conversion to the interface, and whether a unit or a map declares it.
fn conversion(
    port: &Port<'_>,
    fmu: &FmuDescription,
    variable: &FmuVariable,
    meaning: Result<Meaning, String>,
) -> Result<(Linear, bool), String> {
    let unit = match meaning? {
        Meaning::Function(function) => return Ok((function, true)),
        Meaning::Unit(unit) => unit,
        Meaning::Declared if variable.unit.is_empty() => return Ok((Linear::IDENTITY, false)),
        Meaning::Declared => match fmu.unit(&variable.unit) {
            Some(unit) if unit.base.is_some() => unit,
            // Units without an SI definition are equal if their names are.
            _ if variable.unit == port.unit().name => return Ok((Linear::IDENTITY, true)),
            _ => {
                return Err(format!(
                    "its unit {} is not defined in SI units; give its conversion in a map",
                    variable.unit
                ));
            }
        },
    };
    let wanted = port.unit();
    let (Some(own), Some(other)) = (unit.base, wanted.base) else {
        return if unit.name == wanted.name {
            Ok((Linear::IDENTITY, true))
        } else {
            Err(format!("its unit is {}, not {}", unit.name, wanted.name))
        };
    };
    own.to(&other)
        .map(|conversion| (conversion, true))
        .ok_or_else(|| format!("its unit {} has another dimension than {}", unit.name, wanted.name))
}

/// A linear function as text.
fn formula(Linear { factor, offset }: Linear, variable: &str) -> String {
    let product = format!("{} · {variable}", number(factor));
    match offset {
        0.0 => product,
        offset if offset < 0.0 => format!("{product} - {}", number(-offset)),
        offset => format!("{product} + {}", number(offset)),
    }
}

/// A note if the range or start value is implausible compared with the interface's; an error if one is not a number.
fn mismatch(
    port: &Port<'_>,
    variable: &FmuVariable,
    to_interface: Linear,
    is_certain: bool,
) -> Result<Option<String>, String> {
    let unit = &port.unit().name;
    let (min, max) = variable.range().map_err(|error| error.to_string())?;
    let (min, max) = (to_interface.apply(min), to_interface.apply(max));
    let own = (min.min(max), min.max(max));
    let wanted = expected(port, |ours| ours.range().ok().filter(|&range| is_bounded(range)));
    // An input's range must contain the range of the output connected to it.
    if let Some(wanted) = wanted.filter(|_| is_bounded(own)) {
        let (taker, giver) = match port.kind {
            Kind::Input => (own, wanted),
            Kind::Output => (wanted, own),
        };
        // Undeclared bounds are not compared.
        let is_below = giver.0.is_finite() && giver.0 < taker.0;
        let is_above = giver.1.is_finite() && giver.1 > taker.1;
        if is_below || is_above {
            let [own, wanted] =
                [own, wanted].map(|(min, max)| format!("{}..{} {unit}", number(min), number(max)));
            return Ok(Some(format!("its range is {own}, the interface's {wanted}")));
        }
    }
    let start =
        |variable: &FmuVariable| variable.start.trim().parse::<f64>().ok().filter(|start| *start != 0.0);
    if !is_certain
        && let (Some(own), Some(wanted)) = (start(variable), expected(port, start))
        && !(SUSPICIOUS_FACTOR.recip()..=SUSPICIOUS_FACTOR).contains(&(own / wanted))
    {
        let [own, wanted] = [own, wanted].map(number);
        return Ok(Some(format!("its start value is {own}, the interface's {wanted} {unit}")));
    }
    Ok(None)
}

/// Our FMUs' declarations of a port; that of the other role comes first.
fn expected<T>(port: &Port<'_>, declared: impl Fn(&FmuVariable) -> Option<T>) -> Option<T> {
    port.counterpart.and_then(&declared).or_else(|| declared(port.variable))
}

fn is_bounded((min, max): (f64, f64)) -> bool {
    min.is_finite() || max.is_finite()
}

/// Names of similar variables, most likely first.
fn suggestions<'a>(port: &Port<'_>, name: &str, fmu: &'a FmuDescription) -> Vec<&'a str> {
    let wanted = port.unit();
    let likeness = |variable: &FmuVariable| {
        let likeness = likeness(name, &variable.name);
        // The same dimension is stronger evidence than a similar name.
        let is_alike = |unit: fmu_package::Unit| {
            unit.base.zip(wanted.base).is_some_and(|(own, wanted)| own.to(&wanted).is_some())
        };
        match fmu.unit(&variable.unit) {
            Some(unit) if unit.base.is_some() && !is_alike(unit.clone()) => 0.0,
            Some(_) => likeness + 0.1,
            None => likeness,
        }
    };
    let mut candidates: Vec<_> = fmu
        .of_causality(port.kind.causality())
        .filter(|variable| variable.value_type() == ValueType::Real && variable.dimensions.is_empty())
        .map(|variable| (likeness(variable), variable.name.as_str()))
        .filter(|(likeness, _)| *likeness >= LIKENESS)
        .collect();
    candidates.sort_by(|a, b| b.0.total_cmp(&a.0));
    candidates.truncate(SUGGESTIONS);
    candidates.into_iter().map(|(_, name)| name).collect()
}

/// The similarity of two names, from 0 to 1, by their words in any order and style.
fn likeness(a: &str, b: &str) -> f64 {
    let (a, b) = (words(a), words(b));
    let best = |word: &String, others: &[String]| {
        others.iter().map(|other| strsim::jaro_winkler(word, other)).fold(0.0, f64::max)
    };
    let mean = |words: &[String], others: &[String]| {
        words.iter().map(|word| best(word, others)).sum::<f64>() / words.len().max(1) as f64
    };
    0.5 * (mean(&a, &b) + mean(&b, &a))
}

/// A name's words in lower case, the same for `hp_wastegate_pwm`, `HPWastegatePwm` and `hp.wastegatePWM`.
fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut before = ' ';
    for character in name.chars() {
        let begins = !character.is_alphanumeric() || (character.is_uppercase() && before.is_lowercase());
        if begins {
            words.push(String::new());
        }
        if character.is_alphanumeric()
            && let Some(word) = words.last_mut()
        {
            word.extend(character.to_lowercase());
        }
        before = character;
    }
    words.retain(|word| !word.is_empty());
    words
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
        let compatibility = Compatibility::new(&INTERFACE, Role::Plant, fmu, None).unwrap();
        compatibility.matches.into_iter().find(|(port, _)| port.name() == name).unwrap().1
    }

    #[test]
    fn our_own_fmus_fit_without_remarks() {
        for role in [Role::Plant, Role::Controller] {
            let compatibility =
                Compatibility::new(&INTERFACE, role, INTERFACE.description(role), None).unwrap();
            assert!(compatibility.fits() && compatibility.other_inputs().next().is_none());
            for (_, found) in &compatibility.matches {
                assert!(
                    matches!(found, Match::Found { to_interface: Linear::IDENTITY, notes, .. } if notes.is_empty())
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
            (r#"unit="V""#, Err("its unit V has another dimension than Pa")),
            (r#"unit="odd""#, Err("its unit odd is not defined in SI units; give its conversion in a map")),
            (r#"unit="psi""#, Err("its unit psi is not defined in SI units; give its conversion in a map")),
            (r#"start="1.0""#, Err("it declares no unit, and its start value is 1, the interface's ")),
            (r#"max="3e5""#, Err("")),
        ] {
            let fmu = fmu(&real("boost_pressure", "output", unit));
            let Match::Found { to_interface, problems, .. } = found(&fmu, "boost_pressure") else {
                panic!("{unit}: not found")
            };
            match expected {
                Ok(factor) => assert_eq!((problems, to_interface.factor), (vec![], factor), "{unit}"),
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
                "it declares no unit, and its range is 0..1 %, the interface's 0..100 %; give its unit in a map"
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
        assert_eq!(problems("vacuum_pump"), ["its type is Boolean, not Real"]);
        let compatibility = Compatibility::new(&INTERFACE, Role::Plant, &fmu, None).unwrap();
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

    #[test]
    fn names_are_split_into_words() {
        for name in ["hp_wastegate_pwm", "hp.wastegatePwm", "HpWastegatePWM", "hp wastegate pwm"] {
            assert_eq!(words(name), ["hp", "wastegate", "pwm"], "{name}");
        }
    }
}
