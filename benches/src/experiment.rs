//! The recorded experiment of 40 s, `tests/data/plant_trace.csv`, and stretches of it; and those of 20 s in which
//! all inputs move at random.
//!
//! The recorded one is closed-loop until 20 s (steps of the reference at 2, 10 and 18 s, of the voltage at 8, 12
//! and 16 s); the speed rises until 30 s, and then the duty steps between its limits.

use std::sync::OnceLock;

use boost_fmu::plant::variables::{Inputs, States};

use crate::bench::{initial_states, inputs_of, numbers};
use crate::random_experiment::RandomExperiment;

/// The experiment's step in s.
pub const STEP: f64 = 0.0125;

/// The whole experiment.
#[derive(Debug)]
pub struct Experiment {
    /// The states at the experiment's start.
    pub states: States,
    /// The inputs during each step.
    pub inputs: Vec<Inputs>,
}

impl Experiment {
    /// The experiment, read once.
    ///
    /// # Panics
    /// When the file has another format.
    pub fn recorded() -> &'static Self {
        static RECORDED: OnceLock<Experiment> = OnceLock::new();
        RECORDED.get_or_init(|| {
            let mut lines = include_str!("../../tests/data/plant_trace.csv").lines();
            let states = initial_states(lines.next());
            // The header.
            let rows = lines.map(|line| numbers(line, ',')).filter(|row| !row.is_empty());
            Self { states, inputs: rows.map(|row| inputs_of(&row[1..11])).collect() }
        })
    }

    /// One of the experiments in which all inputs move at random.
    #[must_use]
    pub fn random(number: u32) -> Self {
        let experiment = RandomExperiment::read(number);
        let states = initial_states(experiment.reference.lines().next());
        Self { states, inputs: (0..RandomExperiment::STEPS).map(|step| experiment.inputs(step)).collect() }
    }

    /// The inputs of a stretch, one for each step of a size in s: those that change.
    #[must_use]
    pub fn changes(&self, stretch: &Stretch, size: f64) -> Vec<Option<Inputs>> {
        let inputs = &self.inputs[stretch.first..stretch.first + stretch.count];
        let mut held = None;
        (0..steps(stretch.count, size))
            .map(|step| {
                // Half a step in, away from rounding at its beginning.
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                let row = ((step as f64 + 0.5) * size / STEP) as usize;
                let changes = held != Some(inputs[row]);
                held = Some(inputs[row]);
                changes.then_some(inputs[row])
            })
            .collect()
    }
}

/// The number of steps of a size in s in a number of the experiment's.
#[must_use]
pub fn steps(count: usize, size: f64) -> usize {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let steps = (count as f64 * STEP / size).round() as usize;
    steps
}

/// A part of the experiment.
#[derive(Clone, Copy, Debug)]
pub struct Stretch {
    /// The stretch's name in the benchmark's.
    pub name: &'static str,
    /// The index of the stretch's first step.
    pub first: usize,
    /// The number of the stretch's steps.
    pub count: usize,
}

impl Stretch {
    /// A second after the last step of the duty; nothing changes.
    pub const QUIET: Self = Self { name: "quiet", first: 2800, count: 80 };
    /// The voltage falls by 0.9 V, and the controller compensates.
    pub const VOLTAGE: Self = Self { name: "voltage", first: 640, count: 20 };
    /// The duty goes from 100 % to 0.
    pub const DUTY: Self = Self { name: "duty", first: 2560, count: 20 };
    /// The throttle shuts to 30 %, and the duty falls.
    pub const LOAD: Self = Self { name: "load", first: 2880, count: 20 };
    /// The whole experiment.
    pub const WHOLE: Self = Self { name: "whole", first: 0, count: 3200 };
}
