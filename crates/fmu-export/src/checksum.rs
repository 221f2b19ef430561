//! The checksum of serialized states, frames, messages, and the FMUs that instances belong to.

/// The 64-bit FNV-1a hash. Each step is a bijection, so it detects any single changed byte, and misses one in 2^64 of
/// other changes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Checksum(u64);

impl Checksum {
    /// The checksum of nothing.
    const EMPTY: Self = Self(0xcbf2_9ce4_8422_2325);

    /// Adds a byte.
    pub(crate) const fn add(&mut self, byte: u8) {
        self.0 = (self.0 ^ byte as u64).wrapping_mul(0x0000_0100_0000_01b3);
    }

    /// The checksum of the bytes that were added.
    pub(crate) const fn value(self) -> u64 {
        self.0
    }
}

impl Default for Checksum {
    fn default() -> Self {
        Self::EMPTY
    }
}

/// The checksum of bytes.
pub(crate) const fn checksum(bytes: &[u8]) -> u64 {
    let mut checksum = Checksum::EMPTY;
    let mut position = 0;
    while position < bytes.len() {
        checksum.add(bytes[position]);
        position += 1;
    }
    checksum.value()
}
