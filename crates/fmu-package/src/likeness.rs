//! The name that is likely meant by one that nothing has.

/// How like each other two names must be for the one to be taken for the other, from 0 to 1.
const LIKENESS: f64 = 0.8;

/// The likeliest of the known names, as the end of a message: `; the nearest is …`. Empty where none is like it.
pub fn like<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> String {
    known
        .map(|other| (strsim::jaro_winkler(name, other), other))
        .filter(|(likeness, _)| *likeness > LIKENESS)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map_or_else(String::new, |(_, name)| format!("; the nearest is {name}"))
}
