//! Measurement noise.

use anyhow::{Context, Result};
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;

use crate::scenario::Noise;

/// Draws the noise of one value.
pub struct NoiseSource {
    distribution: Normal<f64>,
    generator: Pcg64,
}

impl NoiseSource {
    pub fn new(noise: &Noise) -> Result<Self> {
        let distribution = Normal::new(0.0, noise.standard_deviation).context("no distribution")?;
        Ok(Self { distribution, generator: Pcg64::seed_from_u64(noise.seed) })
    }

    pub fn draw(&mut self) -> f64 {
        self.distribution.sample(&mut self.generator)
    }
}
