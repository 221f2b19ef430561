//! Suggests the nearest known name in messages about an unknown one.

/// The nearest known name, as the end of a message: `; the nearest is …`. Empty if more than a third of the letters
/// differ in all of them; case is ignored.
pub fn like<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> String {
    let distance = |other: &str| strsim::osa_distance(&name.to_lowercase(), &other.to_lowercase());
    known
        .map(|other| (distance(other), other))
        .filter(|(distance, other)| 3 * distance <= name.chars().count().max(other.chars().count()))
        .min_by_key(|(distance, _)| *distance)
        .map_or_else(String::new, |(_, name)| format!("; the nearest is {name}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_nearest_only_if_it_is_near() {
        let nearest = |name| like(name, ["level", "mass_fraction", "P_in"].into_iter());
        for (name, meant) in
            [("levle", "level"), ("Levels", "level"), ("p_in", "P_in"), ("massFraction", "mass_fraction")]
        {
            assert_eq!(nearest(name), format!("; the nearest is {meant}"));
        }
        for name in ["", "eve", "leverage", "mass_flow", "P_out"] {
            assert_eq!(nearest(name), "", "{name}");
        }
    }
}
