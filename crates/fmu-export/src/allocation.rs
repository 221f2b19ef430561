//! Memory is known to be there before it is allocated.

use core::hint;

use fmu_solve::Error;

/// The bytes that a call allocates in addition, for messages and other small items.
const SMALL_ALLOCATIONS: usize = 64 << 10;

/// Checks that memory is available before it is allocated: a failed allocation aborts the importer's process.
///
/// # Errors
/// When this many bytes are not available.
pub(crate) fn check_memory(bytes: usize) -> Result<(), Error> {
    let mut trial = Vec::<u8>::new();
    let reserved = trial.try_reserve_exact(bytes.saturating_add(SMALL_ALLOCATIONS));
    // Without this, the compiler assumes that an unused allocation succeeds.
    hint::black_box(&trial);
    reserved.map_err(|_| Error::new(format!("out of memory: {bytes} bytes are not available")))
}
