//! The most similar known name, for messages about an unknown one.

/// The least similarity of a suggestion, from 0 to 1.
const LIKENESS: f64 = 0.8;

/// The most similar known name, as the end of a message: `; the nearest is …`. Empty if none is similar.
pub fn like<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> String {
    known
        .map(|other| (strsim::jaro_winkler(name, other), other))
        .filter(|(likeness, _)| *likeness > LIKENESS)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map_or_else(String::new, |(_, name)| format!("; the nearest is {name}"))
}
