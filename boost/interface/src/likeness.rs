//! Which of an FMU's variables is probably meant: by names and units.

use fmu_package::{FmuDescription, FmuVariable, Unit, ValueType};

use crate::Port;

/// The least similarity of a suggestion to the interface's name, from 0 to 1.
const LIKENESS: f64 = 0.6;
/// The number of suggested names.
const SUGGESTIONS: usize = 3;

/// For each port with the name by which it was looked for, the names of similar variables, most likely first. Each free
/// variable is suggested for one port, so that all suggestions can be connected together: the port that it is most like,
/// of those that can be connected if it is like any of them.
pub fn suggestions<'a>(
    wanted: &[(&Port<'_>, &str)],
    fmu: &'a FmuDescription,
    is_free: impl Fn(&FmuVariable) -> bool,
) -> Vec<Vec<&'a str>> {
    let mut suggestions = vec![vec![]; wanted.len()];
    let candidates = fmu.variables.iter().filter(|variable| {
        !matches!(variable.value_type(), ValueType::String | ValueType::Other)
            && variable.dimensions.is_empty()
            && is_free(variable)
    });
    for variable in candidates {
        let ports =
            wanted.iter().enumerate().filter(|(_, (port, _))| variable.causality == port.kind.causality());
        let likenesses = ports.map(|(index, (port, name))| {
            (port.is_connectable(), likeness_to(port, name, variable, fmu), index)
        });
        let best = likenesses
            .filter(|(_, likeness, _)| *likeness >= LIKENESS)
            .max_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        if let Some((_, likeness, index)) = best {
            suggestions[index].push((likeness, variable.name.as_str()));
        }
    }
    let names = |mut similar: Vec<(f64, &'a str)>| {
        similar.sort_by(|a, b| b.0.total_cmp(&a.0));
        similar.truncate(SUGGESTIONS);
        similar.into_iter().map(|(_, name)| name).collect()
    };
    suggestions.into_iter().map(names).collect()
}

/// The similarity of a variable to a port, from 0 to 1, and more where their dimensions agree, which is stronger evidence
/// than a similar name.
fn likeness_to(port: &Port<'_>, name: &str, variable: &FmuVariable, fmu: &FmuDescription) -> f64 {
    let wanted = port.unit();
    let likeness = likeness(name, &variable.name);
    let is_alike =
        |unit: Unit| unit.base.zip(wanted.base).is_some_and(|(own, wanted)| own.to(&wanted).is_some());
    match fmu.unit(&variable.unit) {
        Some(unit) if unit.base.is_some() && !is_alike(unit.clone()) => 0.0,
        Some(_) => likeness + 0.1,
        None => likeness,
    }
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

    #[test]
    fn names_are_split_into_words() {
        for name in ["hp_wastegate_pwm", "hp.wastegatePwm", "HpWastegatePWM", "hp wastegate pwm"] {
            assert_eq!(words(name), ["hp", "wastegate", "pwm"], "{name}");
        }
    }
}
