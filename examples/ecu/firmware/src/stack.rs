//! How deep the stack becomes: it is painted at the start, and looked at later.

use core::ptr;

/// The bytes that are painted below the stack's present end.
const PAINTED: usize = 128 << 10;
const PAINT: u32 = 0xA5A5_A5A5;

/// Where the stack ends at present, roughly.
fn end() -> usize {
    cortex_m::register::msp::read() as usize & !3
}

/// Paints what is below the stack.
#[inline(never)]
pub fn paint() {
    let end = end();
    // Some words are this function's own.
    for address in (end - PAINTED..end - 64).step_by(4) {
        // SAFETY: the stack is at the end of the memory, which has 4 MB more than the statics take, and nothing is below it.
        unsafe { ptr::with_exposed_provenance_mut::<u32>(address).write_volatile(PAINT) }
    }
}

/// The bytes of stack below the present end that were used since they were painted.
#[inline(never)]
pub fn used() -> usize {
    let end = end();
    // SAFETY: as in `paint`.
    let is_painted =
        |address: &usize| unsafe { ptr::with_exposed_provenance::<u32>(*address).read_volatile() == PAINT };
    let first = (end - PAINTED + 4096..end).step_by(4).find(|address| !is_painted(address));
    first.map_or(0, |first| end - first)
}
