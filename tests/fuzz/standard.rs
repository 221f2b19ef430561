//! The standard and the format of serialized states, independent of the implementation.

use std::sync::LazyLock;

/// The table of the functions that are allowed in each state (FMI 2.0.5, section 4.2.4).
static TABLE: LazyLock<Vec<Vec<&str>>> = LazyLock::new(|| {
    include_str!("../../crates/fmu-export/tests/calling_sequence.csv")
        .lines()
        .map(|line| line.split(',').collect())
        .collect()
});

/// The states of a slave that never runs a step in the background and never discards one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    Instantiated,
    InitializationMode,
    StepComplete,
    Terminated,
    Error,
}

/// Whether a function is allowed in a state, at least for some of its arguments.
pub fn allows(function: &str, state: State) -> bool {
    let heading = match state {
        State::Instantiated => "instantiated",
        State::InitializationMode => "Initialization Mode",
        State::StepComplete => "stepComplete",
        State::Terminated => "terminated",
        State::Error => "error",
    };
    let column = TABLE[0].iter().position(|cell| *cell == heading).unwrap();
    let row = TABLE.iter().find(|row| row[0] == function).unwrap();
    !row[column].is_empty()
}

/// Ends bytes with their checksum (64-bit FNV-1a), instead of their last eight.
pub fn put_checksum(bytes: &mut [u8]) {
    let Some(end) = bytes.len().checked_sub(8) else { return };
    let (content, checksum) = bytes.split_at_mut(end);
    let mut hash: u64 = 14_695_981_039_346_656_037;
    for byte in content {
        hash = (hash ^ u64::from(*byte)).wrapping_mul(1_099_511_628_211);
    }
    checksum.copy_from_slice(&hash.to_le_bytes());
}
