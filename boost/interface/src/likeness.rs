//! Which of an FMU's variables is probably meant: by names and units.

use fmu_package::{FmuDescription, FmuVariable, Unit, ValueType};

use crate::Port;

/// The least similarity of a suggestion to the interface's name, from 0 to 1.
const LIKENESS: f64 = 0.6;
/// The number of suggested names.
const SUGGESTIONS: usize = 3;

/// Names of similar variables, most likely first.
pub fn suggestions<'a>(port: &Port<'_>, name: &str, fmu: &'a FmuDescription) -> Vec<&'a str> {
    let wanted = port.unit();
    let likeness = |variable: &FmuVariable| {
        let likeness = likeness(name, &variable.name);
        // The same dimension is stronger evidence than a similar name.
        let is_alike =
            |unit: Unit| unit.base.zip(wanted.base).is_some_and(|(own, wanted)| own.to(&wanted).is_some());
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

    #[test]
    fn names_are_split_into_words() {
        for name in ["hp_wastegate_pwm", "hp.wastegatePwm", "HpWastegatePWM", "hp wastegate pwm"] {
            assert_eq!(words(name), ["hp", "wastegate", "pwm"], "{name}");
        }
    }
}
