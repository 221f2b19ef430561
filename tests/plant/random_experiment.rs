//! The experiments with random inputs: `tests/data/experiments/`, made by `make.py` there.

use std::fs;
use std::ops::RangeInclusive;
use std::path::Path;

use boost_fmu::plant::variables::Inputs;

use super::bench::{inputs_of, numbers};

/// The communication step in s.
pub const STEP: f64 = 0.0125;

pub struct RandomExperiment {
    /// Points of time and value of each input, in the reference's order.
    inputs: Vec<Vec<(f64, f64)>>,
    /// The text of the reference: initial states, then states and outputs over time.
    pub reference: String,
}

impl RandomExperiment {
    pub const NUMBERS: RangeInclusive<u32> = 1..=10;
    /// Communication steps of each experiment.
    pub const STEPS: u32 = 1600;

    pub fn read(number: u32) -> Self {
        // Packages in different folders of the workspace read them.
        let folders = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
        let folder = folders
            .map(|folder| folder.join("tests/data/experiments"))
            .find(|folder| folder.is_dir())
            .expect("the experiments are in the workspace");
        let read = |what: &str| {
            let file = folder.join(format!("{number:02}_{what}.csv"));
            fs::read_to_string(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()))
        };
        let mut inputs: Vec<(String, Vec<(f64, f64)>)> = Vec::new();
        for line in read("inputs").lines() {
            let (name, point) = line.split_once(',').expect("a name and numbers");
            let [time, value] = *<&[f64; 2]>::try_from(&numbers(point, ',')[..]).expect("time and value");
            match inputs.last_mut().filter(|last| last.0 == name) {
                Some((_, points)) => points.push((time, value)),
                None => inputs.push((name.to_owned(), vec![(time, value)])),
            }
        }
        let inputs = inputs.into_iter().map(|(_, points)| points).collect();
        Self { inputs, reference: read("reference") }
    }

    /// The inputs during a communication step: the values at its start, linear between the points.
    pub fn inputs(&self, step: u32) -> Inputs {
        let time = f64::from(step) * STEP;
        let value = |points: &Vec<(f64, f64)>| {
            let next = points.partition_point(|&(start, _)| start <= time);
            let (start, first) = points[next - 1];
            let (end, last) = points.get(next).copied().unwrap_or((start, first));
            if end > start { first + (last - first) * (time - start) / (end - start) } else { first }
        };
        inputs_of(&self.inputs.iter().map(value).collect::<Vec<_>>())
    }
}
