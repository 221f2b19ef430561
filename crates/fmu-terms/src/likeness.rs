//! Suggests the nearest known name in messages about an unknown one.

/// The nearest known name, if at most a third of the letters differ; case is ignored.
pub fn nearest<T: AsRef<str>>(name: &str, known: impl IntoIterator<Item = T>) -> Option<T> {
    let distance = |other: &T| {
        let other = other.as_ref();
        let lower = strsim::osa_distance(&name.to_lowercase(), &other.to_lowercase());
        (lower, strsim::osa_distance(name, other), other.len())
    };
    known
        .into_iter()
        .map(|other| (distance(&other), other))
        .filter(|(distance, other)| {
            3 * distance.0 <= name.chars().count().max(other.as_ref().chars().count())
        })
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, other)| other)
}

/// The nearest known name as the end of a message: `; did you mean …?`. Empty if none is near.
pub fn like<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    nearest(name, known).map_or_else(String::new, |name| format!("; did you mean {name}?"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_nearest_only_if_it_is_near() {
        let known = ["reads", "start", "unit", "nominal", "K", "mass_flow", "mass_fraction", "Float32"];
        for (name, meant) in [
            ("reeds", "reads"),
            ("nominals", "nominal"),
            ("massFlow", "mass_flow"),
            ("MASS_FLOW", "mass_flow"),
            ("uint", "unit"),
            ("k", "K"),
            ("Float23", "Float32"),
        ] {
            assert_eq!(nearest(name, known), Some(meant), "{name}");
            assert_eq!(like(name, known), format!("; did you mean {meant}?"));
        }
        for name in ["", "K1", "red", "end", "stop", "mass", "mass_factor_in", "numerical"] {
            assert_eq!(nearest(name, known), None, "{name}");
            assert_eq!(like(name, known), "");
        }
    }
}
