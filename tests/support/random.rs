//! Pseudo-random numbers, the same in every run.

/// The generator `splitmix64`, from a seed.
pub struct Random(pub u64);

impl Random {
    /// Between two bounds.
    pub fn between(&mut self, least: f64, most: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^= bits >> 31;
        least + (most - least) * ((bits >> 11) as f64 / (1_u64 << 53) as f64)
    }
}
