//! What a thread allocates.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

struct Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

thread_local! {
    /// The number of allocations, and the bytes that they hold.
    static ALLOCATIONS: Cell<(u64, isize)> = const { Cell::new((0, 0)) };
}

fn count(allocations: u64, bytes: isize) {
    ALLOCATIONS.with(|counts| counts.set((counts.get().0 + allocations, counts.get().1 + bytes)));
}

// SAFETY: the system's allocator does all; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(1, layout.size().cast_signed());
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(0, -(layout.size().cast_signed()));
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// Runs a function. Returns its result, the number of allocations and the bytes that are left of them.
pub fn counted<T>(function: impl FnOnce() -> T) -> (T, u64, isize) {
    let (allocations, bytes) = ALLOCATIONS.get();
    let result = function();
    let (allocations_after, bytes_after) = ALLOCATIONS.get();
    (result, allocations_after - allocations, bytes_after - bytes)
}
