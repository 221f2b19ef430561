//! The checksum of serialized states, messages, and the FMUs that instances belong to.

/// The 64-bit FNV-1a hash. Each step is a bijection, so it detects any single changed byte, and misses one in 2^64 of
/// other changes.
pub(crate) const fn checksum(bytes: &[u8]) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325;
    let mut position = 0;
    while position < bytes.len() {
        hash = (hash ^ bytes[position] as u64).wrapping_mul(0x0000_0100_0000_01b3);
        position += 1;
    }
    hash
}
