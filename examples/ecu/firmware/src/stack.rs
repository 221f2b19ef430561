//! How deep the stack becomes: it is painted, and looked at later.

use core::ptr;

/// The bytes that are painted, up to the stack's beginning at the end of the memory.
const PAINTED: usize = 128 << 10;
const PAINT: u32 = 0xA5A5_A5A5;

unsafe extern "C" {
    /// Where the stack begins, from cortex-m-rt's linker script.
    static _stack_start: u32;
}

/// The lowest address that is painted.
fn bottom() -> usize {
    (&raw const _stack_start).addr() - PAINTED
}

/// Where the stack ends at present.
fn end() -> usize {
    cortex_m::register::msp::read() as usize
}

/// Paints what the stack does not use at present.
#[inline(never)]
pub fn paint() {
    // This function may push some words more.
    for address in (bottom()..end() - 64).step_by(4) {
        // SAFETY: it is below what the stack uses, and above the statics: the memory has 4 MB, of which they take 40 kB.
        unsafe { ptr::with_exposed_provenance_mut::<u32>(address).write_volatile(PAINT) }
    }
}

/// The bytes that the stack has used below its present end since it was painted.
#[inline(never)]
pub fn used() -> usize {
    let end = end();
    // SAFETY: these words are in the memory, as in `paint`.
    let is_painted =
        |address: &usize| unsafe { ptr::with_exposed_provenance::<u32>(*address).read_volatile() == PAINT };
    let first = (bottom()..end).step_by(4).find(|address| !is_painted(address));
    first.map_or(0, |first| end - first)
}
