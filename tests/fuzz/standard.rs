//! The standard and the format of serialized states, independent of the implementation.

use std::sync::LazyLock;

use super::importer::Interface;

type Table = Vec<Vec<&'static str>>;

fn table(text: &'static str) -> Table {
    text.lines().map(|line| line.split(',').collect()).collect()
}

/// The tables of the functions that are allowed in each state (FMI 2.0.5, sections 4.2.4 and 3.2.3).
static CO_SIMULATION: LazyLock<Table> =
    LazyLock::new(|| table(include_str!("../../crates/fmu-export/tests/calling_sequence.csv")));
static MODEL_EXCHANGE: LazyLock<Table> = LazyLock::new(|| {
    table(include_str!("../../crates/fmu-export/tests/calling_sequence_model_exchange.csv"))
});

/// The states of an instance that never runs a step in the background.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    Instantiated,
    InitializationMode,
    StepComplete,
    StepFailed,
    EventMode,
    ContinuousTimeMode,
    Terminated,
    Error,
}

/// Whether a function is allowed in a state of an interface, at least for some of its arguments.
pub fn allows(interface: Interface, function: &str, state: State) -> bool {
    let table = match interface {
        Interface::CoSimulation => &*CO_SIMULATION,
        Interface::ModelExchange => &*MODEL_EXCHANGE,
    };
    let heading = match state {
        State::Instantiated => "instantiated",
        State::InitializationMode => "Initialization Mode",
        State::StepComplete => "stepComplete",
        State::StepFailed => "stepFailed",
        State::EventMode => "Event Mode",
        State::ContinuousTimeMode => "Continuous-Time Mode",
        State::Terminated => "terminated",
        State::Error => "error",
    };
    let column = table[0].iter().position(|cell| *cell == heading).unwrap();
    // A function of the other interface is not in the table.
    table.iter().find(|row| row[0] == function).is_some_and(|row| !row[column].is_empty())
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
