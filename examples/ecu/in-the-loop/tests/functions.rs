//! The functions of `Number` and `Float` on the firmware's processor are those of the standard library here.

#[path = "../../functions.rs"]
mod functions;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use BoostControllerInTheLoop::ecu::Ecu;
use fmu_export::Dual;
use fmu_export::frames::{self, Kind};

use functions::{float, number};

/// How far two libraries' results may be apart, relative to the result: each is within a rounding or two of the exact one, and
/// inverse hyperbolic functions are put together from four such functions.
const APART: f64 = 8.0 * f64::EPSILON;
const APART_IN_SINGLE_PRECISION: f64 = 8.0 * f32::EPSILON as f64;

fn from_here(file: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(file)
}

/// The functions of numbers that a part of a source declares.
fn declared(source: &str, begin: &str, end: &str) -> BTreeSet<String> {
    let source = fs::read_to_string(from_here("../../../crates/fmu-solve/src").join(source)).unwrap();
    let (_, body) = source.split_once(begin).unwrap();
    let (body, _) = body.split_once(end).unwrap();
    let functions = body.lines().filter_map(|line| {
        let (declared, _) = line.split_once("(self")?;
        Some(declared.trim_start().trim_start_matches("fn ").to_owned())
    });
    let is_name = |name: &String| name.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '_');
    functions.filter(|name| !name.is_empty() && is_name(name)).collect()
}

/// The lists here are those of the traits.
#[test]
fn every_function_is_run() {
    let run = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<BTreeSet<_>>();
    assert_eq!(declared("number.rs", "pub trait Number:", "\n}\n"), run(number::NAMES));
    assert_eq!(declared("elementary.rs", "macro_rules! float", "#[cfg(test)]"), run(float::NAMES));
}

#[test]
fn results_are_those_of_the_standard_library() {
    let image = fs::read(env!("FUNCTIONS_IMAGE")).unwrap();
    let mut ecu = Ecu::start_with(&image, 0, &[]).unwrap();
    let numbers = [
        -800.0, -7.25, -1.5, -1.0, -0.4, -1e-9, -0.0, 0.0, 1e-300, 0.3, 0.5, 1.0, 1.75, 3.0, 42.5, 709.0,
        1e17,
    ];
    for x in numbers {
        for y in [-2.5, -0.5, 0.0, 0.75, 3.0] {
            let (x, y) = (Dual::new(x, 1.0), Dual::new(y, -2.0));
            let sent = [x.value, x.derivative, y.value, y.derivative].map(f64::to_bits);
            ecu.send(Kind::Sample, &sent).unwrap();
            let (kind, content) = ecu.receive().unwrap();
            assert_eq!(kind, Kind::Answer);
            let found: Vec<_> = frames::cells(&content).map(f64::from_bits).collect();
            let values = number::all(x.value, y.value);
            let duals = number::all(x, y);
            let singles = float::all(x.value as f32, y.value as f32).map(f64::from);
            let expected = values
                .into_iter()
                .chain(duals.iter().flat_map(|dual| [dual.value, dual.derivative]))
                .chain(singles);
            let names = number::NAMES.iter().chain(number::NAMES.iter().flat_map(|name| [name; 2]));
            let names = names.chain(float::NAMES);
            assert_eq!(found.len(), 3 * number::COUNT + float::COUNT);
            for (position, ((found, expected), name)) in
                found.into_iter().zip(expected).zip(names).enumerate()
            {
                let is_same = found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan();
                let apart = if position < 3 * number::COUNT { APART } else { APART_IN_SINGLE_PRECISION };
                let is_near = (found - expected).abs() <= apart * expected.abs();
                assert!(
                    is_same || is_near,
                    "{name} of {x:?} and {y:?}, {position}: {found:e}, not {expected:e}"
                );
            }
        }
    }
}
