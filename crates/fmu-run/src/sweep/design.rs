//! The values of a study's parameters in each run.

use anyhow::Result;
use fmu_io::terminal;
use fmu_package::Value;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use toml::de::DeValue;

use super::Parameter;
use fmu_io::document::{Node, TomlTable};
use fmu_master::scenario::read_value;

/// The maximum number of runs, as a guard against typing errors.
const MOST_RUNS: usize = 1_000_000;

/// The parameters, and for each run their values; none for the scenario's value.
pub struct Design {
    pub parameters: Vec<Parameter>,
    pub points: Vec<Vec<Option<Value>>>,
}

/// The range of a parameter.
#[derive(Clone, Copy, Debug)]
pub struct Range {
    /// The least value.
    pub from: f64,
    /// The greatest value.
    pub to: f64,
    /// Whether values are spread evenly by their logarithms.
    pub is_logarithmic: bool,
}

impl Range {
    fn read(table: &TomlTable<'_>) -> Result<Self> {
        let from = table.required("from", "the least value")?.number("a number")?;
        let end = table.required("to", "the greatest value")?;
        let to = end.number("a number")?;
        if to <= from {
            return Err(end.unexpected(&format!("a number above from, {}", terminal::number(from))));
        }
        let is_logarithmic = match table.optional("spacing") {
            None => false,
            Some(node) => match node.string("\"linear\" or \"logarithmic\"")? {
                "linear" => false,
                "logarithmic" if from > 0.0 => true,
                "logarithmic" => {
                    return Err(node.unexpected("\"linear\", since from is not above 0"));
                }
                _ => return Err(node.unexpected("\"linear\" or \"logarithmic\"")),
            },
        };
        Ok(Self { from, to, is_logarithmic })
    }

    /// The value at a fraction of the range; both ends are exactly as given.
    #[must_use]
    pub fn at(&self, fraction: f64) -> f64 {
        let Self { from, to, is_logarithmic } = *self;
        let between =
            if is_logarithmic { from * (to / from).powf(fraction) } else { from + (to - from) * fraction };
        if fraction >= 1.0 { to } else { between.clamp(from, to) }
    }
}

impl Design {
    /// Reads the one of `grid`, `latin_hypercube` and `list` that a study has.
    pub fn read(root: &TomlTable<'_>) -> Result<Self> {
        let designs = ["grid", "latin_hypercube", "list"].map(|key| root.optional(key));
        let (design, place) = match designs {
            [Some(grid), None, None] => (read_grid(&grid)?, grid),
            [None, Some(hypercube), None] => (read_latin_hypercube(&hypercube)?, hypercube),
            [None, None, Some(list)] => (read_list(&list)?, list),
            _ => return Err(root.location().error("expected one of grid, latin_hypercube and list")),
        };
        if design.points.is_empty() || design.parameters.is_empty() {
            return Err(place.unexpected("at least one parameter and one run"));
        }
        Ok(design)
    }
}

fn parameter(name: &str, node: &Node<'_>, is_logarithmic: bool) -> Result<Parameter> {
    let parameter = Parameter { name: name.to_owned(), is_logarithmic, location: node.location().clone() };
    parameter.parts()?;
    Ok(parameter)
}

/// All combinations of values; the last parameter changes fastest.
fn read_grid(node: &Node<'_>) -> Result<Design> {
    let mut parameters = vec![];
    let mut points: Vec<Vec<Option<Value>>> = vec![vec![]];
    for (name, node) in node.table("a table of values by the names of parameters")?.entries() {
        let (values, is_logarithmic) = read_values(name, &node)?;
        parameters.push(parameter(name, &node, is_logarithmic)?);
        if points.len().saturating_mul(values.len()) > MOST_RUNS {
            return Err(node.location().error(format!("the grid has more than {MOST_RUNS} points")));
        }
        let with = |point: &Vec<Option<Value>>, value: &Value| {
            point.iter().cloned().chain([Some(value.clone())]).collect()
        };
        points = points.iter().flat_map(|point| values.iter().map(move |value| with(point, value))).collect();
    }
    Ok(Design { parameters, points })
}

/// The values of a list or a range, and whether they are spread by their logarithms.
fn read_values(name: &str, node: &Node<'_>) -> Result<(Vec<Value>, bool)> {
    const EXPECTED: &str = "a list of values, or a table of from, to, points and spacing";
    if let DeValue::Array(_) = node.value() {
        let list = node.list(EXPECTED)?;
        if list.is_empty() {
            return Err(node.unexpected("at least one value"));
        }
        let values: Result<_> = list.iter().map(|node| Ok(read_value(name, node)?.value)).collect();
        return Ok((values?, false));
    }
    let table = node.table(EXPECTED)?;
    let range = Range::read(&table)?;
    let count_node = table.required("points", "the number of values")?;
    let count: usize = count_node.integer("a whole number from 2 on")?;
    if !(2..=MOST_RUNS).contains(&count) {
        return Err(count_node.unexpected(&format!("a whole number from 2 to {MOST_RUNS}")));
    }
    table.finish()?;
    let values: Vec<_> = (0..count).map(|index| range.at(index as f64 / (count - 1) as f64)).collect();
    // Whole numbers are values of Integers, too.
    let whole: Option<Vec<_>> = values.iter().copied().map(whole).collect();
    let values = match whole {
        Some(whole) => whole.into_iter().map(Value::Integer).collect(),
        None => values.into_iter().map(|value| Value::Real(value, None)).collect(),
    };
    Ok((values, range.is_logarithmic))
}

/// A number as an Integer, if it is one.
#[allow(clippy::cast_possible_truncation)] // it is in range
fn whole(number: f64) -> Option<i32> {
    let is_whole = number.fract() == 0.0 && (f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&number);
    is_whole.then_some(number as i32)
}

/// A column of a Latin hypercube (`McKay`, Beckman and Conover, Technometrics 21, 1979): the range from 0 to 1 is
/// divided into as many parts as there are runs, with one random draw from each.
pub fn latin_fractions(count: usize, generator: &mut Pcg64) -> Vec<f64> {
    let mut parts: Vec<usize> = (0..count).collect();
    parts.shuffle(generator);
    parts.into_iter().map(|part| (part as f64 + generator.random::<f64>()) / count as f64).collect()
}

fn read_latin_hypercube(node: &Node<'_>) -> Result<Design> {
    let table = node.table("a table of runs, seed and ranges")?;
    let count_node = table.required("runs", "the number of runs")?;
    let count: usize = count_node.integer("a whole number above 0")?;
    if !(1..=MOST_RUNS).contains(&count) {
        return Err(count_node.unexpected(&format!("a whole number from 1 to {MOST_RUNS}")));
    }
    let seed = table.optional("seed").map_or(Ok(0), |node| node.integer("a whole number, 0 or more"))?;
    let mut generator = Pcg64::seed_from_u64(seed);
    let mut parameters = vec![];
    let mut points = vec![vec![]; count];
    let ranges = table.required("ranges", "a table of ranges by the names of parameters")?;
    for (name, node) in ranges.table("a table of ranges by the names of parameters")?.entries() {
        let range_table = node.table("a table of from, to and spacing")?;
        let range = Range::read(&range_table)?;
        range_table.finish()?;
        parameters.push(parameter(name, &node, range.is_logarithmic)?);
        for (point, fraction) in points.iter_mut().zip(latin_fractions(count, &mut generator)) {
            point.push(Some(Value::Real(range.at(fraction), None)));
        }
    }
    table.finish()?;
    Ok(Design { parameters, points })
}

fn read_list(node: &Node<'_>) -> Result<Design> {
    const EXPECTED: &str =
        "a list of tables [[list]], one for each run, of values by the names of parameters";
    let mut parameters: Vec<Parameter> = vec![];
    let mut points: Vec<Vec<Option<Value>>> = vec![];
    for run in node.list(EXPECTED)? {
        let mut point = vec![None; parameters.len()];
        for (name, node) in run.table(EXPECTED)?.entries() {
            let value = Some(read_value(name, &node)?.value);
            if let Some(index) = parameters.iter().position(|known| known.name == name) {
                point[index] = value;
            } else {
                parameters.push(parameter(name, &node, false)?);
                point.push(value);
            }
        }
        points.push(point);
    }
    for point in &mut points {
        point.resize(parameters.len(), None);
    }
    Ok(Design { parameters, points })
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_io::document::Document;

    fn design(text: &str) -> Result<Vec<Vec<f64>>> {
        let document = Document::parse("study", text)?;
        let design = Design::read(&document.root())?;
        let number = |value: &Option<Value>| match value {
            Some(Value::Real(value, _)) => *value,
            Some(Value::Integer(value)) => f64::from(*value),
            _ => f64::NAN,
        };
        Ok(design.points.iter().map(|point| point.iter().map(number).collect()).collect())
    }

    #[test]
    fn a_grid_has_every_combination() -> Result<()> {
        let points = design(
            "[grid]\n\"p:a\" = [1, 2.5]\n\"p:b\" = { from = 1e-3, to = 1e3, points = 3, spacing = \"logarithmic\" }",
        )?;
        let rounded: Vec<Vec<i64>> = points
            .iter()
            .map(|point| {
                #[allow(clippy::cast_possible_truncation)] // they are small
                point.iter().map(|value| (1e4 * value).round() as i64).collect()
            })
            .collect();
        let column = [10, 10_000, 10_000_000];
        let expected: Vec<Vec<i64>> =
            [10_000, 25_000].iter().flat_map(|a| column.iter().map(move |b| vec![*a, *b])).collect();
        assert_eq!(rounded, expected);
        Ok(())
    }

    #[test]
    fn a_range_of_whole_numbers_is_one_of_integers() {
        let values = |text: &str| {
            let document = Document::parse("study", text).unwrap();
            Design::read(&document.root()).unwrap().points.concat()
        };
        let whole = [1, 3, 5].map(|value| Some(Value::Integer(value)));
        assert_eq!(values("[grid]\n\"p:a\" = { from = 1, to = 5, points = 3 }"), whole);
        let others = [1.0, 2.5, 4.0].map(|value| Some(Value::Real(value, None)));
        assert_eq!(values("[grid]\n\"p:a\" = { from = 1, to = 4, points = 3 }"), others);
    }

    #[test]
    fn a_latin_hypercube_draws_from_each_part_once() -> Result<()> {
        let text = "[latin_hypercube]\nruns = 50\nseed = 7\nranges = { \"p:a\" = { from = 0, to = 50 }, \"p:b\" = \
                    { from = -100, to = -50 } }";
        let points = design(text)?;
        for (column, begin) in [(0, 0.0), (1, -100.0)] {
            let mut parts: Vec<_> = points.iter().map(|point| (point[column] - begin).floor()).collect();
            parts.sort_by(f64::total_cmp);
            let expected: Vec<_> = (0..50).map(f64::from).collect();
            assert_eq!(parts, expected);
        }
        // The columns are not in the same order, and another seed is another hypercube.
        assert!(points.iter().any(|point| (point[0].floor() - point[1].floor() - 100.0).abs() > 0.5));
        assert_eq!(points, design(text)?);
        assert_ne!(points, design(&text.replace("seed = 7", "seed = 8"))?);
        Ok(())
    }

    #[test]
    fn a_list_keeps_other_values() -> Result<()> {
        let points = design("list = [{ \"p:a\" = 1 }, { \"p:b\" = 2 }]")?;
        assert_eq!(points.len(), 2);
        assert!((points[0][0] - 1.0).abs() < 1e-15 && points[0][1].is_nan());
        assert!(points[1][0].is_nan() && (points[1][1] - 2.0).abs() < 1e-15);
        Ok(())
    }

    #[test]
    fn errors_are_named() {
        for (text, message) in [
            ("title = 1", "expected one of grid, latin_hypercube and list"),
            ("[grid]\na = [1]", "line 2, grid.a: expected the FMU's name in the scenario, a colon"),
            ("[grid]\n\"p:a\" = []", "line 2, grid.\"p:a\": expected at least one value"),
            ("[grid]\n\"p:a\" = { from = 2, to = 1, points = 3 }", "expected a number above from, 2"),
            ("[latin_hypercube]\nruns = 0", "latin_hypercube.runs: expected a whole number from 1 to"),
            (
                "[grid]\n\"p:a\" = { from = 0, to = 1, points = 3, spacing = \"logarithmic\" }",
                "expected \"linear\", since from is not above 0",
            ),
        ] {
            let error = design(text).map_or_else(|error| error.to_string(), |_| "no error".to_owned());
            assert!(error.contains(message), "{text}: {error}");
        }
    }
}
