//! Frames over a serial line between an ECU that runs a [`Task`](crate::Task) and who feeds it with measurements, such as
//! an FMU that couples a plant with it.
//!
//! A frame is a start byte, its kind, the length of its content in two bytes, the content, and the checksum of all these in
//! eight bytes, numbers little-endian. What does not add up is skipped, byte by byte, up to the next frame that does. Inputs
//! and parameters are [cells](crate::calibration) of eight bytes.

use crate::calibration::CELL;
use crate::checksum::Checksum;
use crate::model::context::EVENT;

/// The byte with which frames begin.
const START: u8 = 0xF5;
/// The bytes before the content.
const HEAD: usize = 4;
/// The bytes after the content.
const TAIL: usize = 8;

/// The most cells of the page in one frame.
pub const MOST_PAGE_CELLS: usize = 64;

/// The longest frame to the ECU, in bytes, of a model with a number of inputs: a part of the page, or the inputs.
#[must_use]
pub const fn longest_frame(inputs: usize) -> usize {
    // Before a part of the page is the number of its first cell.
    let cells = if inputs > MOST_PAGE_CELLS + 1 { inputs } else { MOST_PAGE_CELLS + 1 };
    HEAD + cells * CELL + TAIL
}

/// What a frame is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// To the ECU: the cells of a part of the calibration page, after the number of the first one in a cell.
    Page = b'P',
    /// To the ECU: initialize with the inputs, and answer.
    Initialize = b'I',
    /// To the ECU: execute a sample with the inputs, and answer.
    Sample = b'S',
    /// To the ECU: the inputs of the next samples, which its timer releases.
    Measurements = b'M',
    /// To the ECU: what samples have cost since it was asked last. From the ECU: their number, the ticks of a stopwatch in all
    /// of them and in the longest one, and the bytes of stack that were used.
    Statistics = b'C',
    /// From the ECU: the results of the work that was asked for, as an [`Archive`](crate::persistence::Archive) of them.
    Answer = b'A',
    /// From the ECU: the text of a warning.
    Warning = b'W',
    /// From the ECU: the text of an event.
    Event = b'V',
    /// From the ECU: the text of an error, after which it answers nothing.
    Error = b'E',
}

impl Kind {
    const ALL: [Self; 9] = [
        Self::Page,
        Self::Initialize,
        Self::Sample,
        Self::Measurements,
        Self::Statistics,
        Self::Answer,
        Self::Warning,
        Self::Event,
        Self::Error,
    ];

    /// What a message of a category is sent as.
    #[must_use]
    pub fn of_message(category: &str) -> Self {
        if category == EVENT { Self::Event } else { Self::Warning }
    }

    fn of(byte: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| *kind as u8 == byte)
    }
}

/// Sends a frame byte by byte. A content of more than 65,535 bytes is cut.
pub fn send(kind: Kind, content: impl Iterator<Item = u8> + Clone, mut byte: impl FnMut(u8)) {
    let length = u16::try_from(content.clone().count()).unwrap_or(u16::MAX);
    let mut checksum = Checksum::default();
    let [low, high] = length.to_le_bytes();
    for next in [START, kind as u8, low, high].into_iter().chain(content.take(length.into())) {
        checksum.add(next);
        byte(next);
    }
    checksum.value().to_le_bytes().into_iter().for_each(byte);
}

/// The bytes of cells.
pub fn bytes(cells: impl Iterator<Item = u64> + Clone) -> impl Iterator<Item = u8> + Clone {
    cells.flat_map(u64::to_le_bytes)
}

/// The cells of a frame's content; bytes that are no whole cell are left out.
#[must_use]
pub fn cells(content: &[u8]) -> impl ExactSizeIterator<Item = u64> + Clone + '_ {
    let (cells, _) = content.as_chunks::<CELL>();
    cells.iter().map(|cell| u64::from_le_bytes(*cell))
}

/// Finds frames among the bytes that arrive. Frames of up to `BYTES` bytes, with head and checksum.
#[derive(Clone, Debug)]
pub struct Receiver<const BYTES: usize> {
    bytes: [u8; BYTES],
    /// How many bytes there are.
    length: usize,
    /// The bytes of the frame that was returned last.
    taken: usize,
}

impl<const BYTES: usize> Default for Receiver<BYTES> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const BYTES: usize> Receiver<BYTES> {
    /// A receiver without bytes.
    #[must_use]
    pub const fn new() -> Self {
        Self { bytes: [0; BYTES], length: 0, taken: 0 }
    }

    /// Takes a byte. Returns the frame that it ends, if it ends one: its kind and content.
    pub fn take(&mut self, byte: u8) -> Option<(Kind, &[u8])> {
        self.skip(self.taken);
        self.taken = 0;
        self.bytes[self.length] = byte;
        self.length += 1;
        loop {
            let start = self.bytes[..self.length].iter().position(|&byte| byte == START);
            self.skip(start.unwrap_or(self.length));
            match self.whole() {
                Whole::NotYet => return None,
                Whole::Never => self.skip(1),
                Whole::Frame(kind, length) => {
                    self.taken = HEAD + length + TAIL;
                    return Some((kind, &self.bytes[HEAD..HEAD + length]));
                }
            }
        }
    }

    /// What the bytes are, which begin with a start byte if there are any.
    fn whole(&self) -> Whole {
        let bytes = &self.bytes[..self.length];
        let [_, kind, low, high, rest @ ..] = bytes else { return Whole::NotYet };
        let length = usize::from(u16::from_le_bytes([*low, *high]));
        let Some(kind) = Kind::of(*kind).filter(|_| HEAD + length + TAIL <= BYTES) else {
            return Whole::Never;
        };
        let Some((_, checksum)) = rest.split_at_checked(length) else { return Whole::NotYet };
        let Ok(checksum) = <[u8; TAIL]>::try_from(checksum) else { return Whole::NotYet };
        let mut expected = Checksum::default();
        bytes[..HEAD + length].iter().for_each(|&byte| expected.add(byte));
        if u64::from_le_bytes(checksum) == expected.value() {
            Whole::Frame(kind, length)
        } else {
            Whole::Never
        }
    }

    /// Skips bytes at the beginning.
    fn skip(&mut self, count: usize) {
        self.bytes.copy_within(count..self.length, 0);
        self.length -= count;
    }
}

/// What the received bytes are.
enum Whole {
    /// The beginning of a frame, perhaps.
    NotYet,
    /// No frame.
    Never,
    /// A frame with the length of its content.
    Frame(Kind, usize),
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(kind: Kind, content: &[u8]) -> Vec<u8> {
        let mut bytes = vec![];
        send(kind, content.iter().copied(), |byte| bytes.push(byte));
        bytes
    }

    /// The frames that a receiver finds.
    fn found(bytes: &[u8]) -> Vec<(Kind, Vec<u8>)> {
        let mut receiver = Receiver::<64>::new();
        bytes
            .iter()
            .filter_map(|&byte| receiver.take(byte).map(|(kind, content)| (kind, content.to_owned())))
            .collect()
    }

    /// Whatever is lost or falsified between two frames, each whole frame after it is found, but for what a falsified length
    /// may swallow.
    #[test]
    fn frames_are_found_after_any_fault() {
        let contents: [&[u8]; 4] = [b"", b"inputs", &[START; 40], &[0; 52]];
        let frames = contents.map(|content| frame(Kind::Sample, content));
        let expected: Vec<_> = contents.iter().map(|content| (Kind::Sample, content.to_vec())).collect();
        assert_eq!(found(&frames.concat()), expected);
        // Knuth's MMIX generator (The Art of Computer Programming, volume 2, section 3.3.4).
        let mut random = 1_u64;
        let mut below = |most: u8| {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 56) as u8 % most
        };
        for _ in 0..2_000 {
            let mut broken = frames[usize::from(below(4))].clone();
            let position = usize::from(below(64)) % broken.len();
            match below(3) {
                0 => drop(broken.remove(position)),
                1 => broken.insert(position, below(255)),
                _ => broken[position] ^= 1 << below(8),
            }
            // What may still belong to the broken frame.
            broken.extend([0; 64]);
            let sent = frames[usize::from(below(4))].clone();
            let received = found(&[broken.clone(), sent.clone()].concat());
            assert!(received.len() <= 2 && received.last() == found(&sent).first(), "{broken:?}");
        }
        assert_eq!(found(&frame(Kind::Page, &[0; 53])), [], "it is too long for this receiver");
    }
}
