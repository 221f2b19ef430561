//! The functions of `Number` on the firmware's processor are those of the standard library here.

#[path = "../../functions.rs"]
mod functions;

use std::fs;
use std::path::Path;

use BoostControllerInTheLoop::ecu::Ecu;
use fmu_export::Dual;
use fmu_export::frames::{self, Kind};

use functions::{COUNT, NAMES};

/// How far two libraries' results may be apart, relative to the result: each is within a rounding or two of the exact one, and
/// inverse hyperbolic functions are put together from four such functions.
const APART: f64 = 8.0 * f64::EPSILON;

fn from_here(file: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(file)
}

/// The list here is that of the trait.
#[test]
fn every_function_is_run() {
    let source = fs::read_to_string(from_here("../../../crates/fmu-solve/src/number.rs")).unwrap();
    let (_, body) = source.split_once("pub trait Number:").unwrap();
    let (body, _) = body.split_once("\n}\n").unwrap();
    let mut declared: Vec<_> = body
        .lines()
        .filter_map(|line| line.strip_prefix("    fn ")?.split_once('('))
        .map(|(name, _)| name)
        .collect();
    let mut run = NAMES.to_vec();
    declared.sort_unstable();
    run.sort_unstable();
    assert_eq!(declared, run);
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
            let values = functions::all(x.value, y.value);
            let duals = functions::all(x, y);
            assert_eq!(found.len(), 3 * COUNT);
            let expected =
                values.into_iter().chain(duals.iter().flat_map(|dual| [dual.value, dual.derivative]));
            for (position, (found, expected)) in found.into_iter().zip(expected).enumerate() {
                let name = NAMES[if position < COUNT { position } else { (position - COUNT) / 2 }];
                let is_same = found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan();
                let is_near = (found - expected).abs() <= APART * expected.abs();
                assert!(
                    is_same || is_near,
                    "{name} of {x:?} and {y:?}, {position}: {found:e}, not {expected:e}"
                );
            }
        }
    }
}
