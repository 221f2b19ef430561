//! The states saved by importers, by handle.
//!
//! A handle (`fmi2FMUstate`) is looked up here and never dereferenced, so an invalid or freed one, or one of another
//! FMU, is an error, not a crash. A state may be set in another instance of the FMU. States that the importer does not
//! free are freed with the instance.
//!
//! This table is the only data shared by a library's instances.

use core::any::Any;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};

use fmu_solve::Error;

use crate::panics::contain;

/// The states by handle.
static STATES: Mutex<BTreeMap<usize, Entry>> = Mutex::new(BTreeMap::new());

struct Entry {
    /// The address of the instance with which the state is freed.
    owner: usize,
    /// A `RwLock` of the saved memory. Its address is the handle, unique in the process.
    state: Arc<dyn Any + Send + Sync>,
}

/// A state, which several instances may read at once.
pub(crate) type Saved<T> = Arc<RwLock<T>>;

fn states() -> MutexGuard<'static, BTreeMap<usize, Entry>> {
    // No code panics while holding the lock.
    STATES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Stores a state for an importer, and returns its handle.
pub(crate) fn keep<T: Send + Sync + 'static>(owner: usize, state: T) -> usize {
    let state = Arc::new(RwLock::new(state));
    let handle = Arc::as_ptr(&state).addr();
    states().insert(handle, Entry { owner, state });
    handle
}

/// The state with a handle.
///
/// # Errors
/// When no state has this handle, or its type differs.
pub(crate) fn find<T: Send + Sync + 'static>(handle: usize) -> Result<Saved<T>, Error> {
    let state = states().get(&handle).map(|entry| Arc::clone(&entry.state));
    state
        .and_then(|state| state.downcast().ok())
        .ok_or_else(|| Error::new("the argument FMUstate is not a state of this FMU, or was freed"))
}

/// Frees the state with a handle.
///
/// # Errors
/// As [`find`].
pub(crate) fn free<T: Send + Sync + 'static>(handle: usize) -> Result<(), Error> {
    let state = find::<T>(handle)?;
    remove(&mut states(), &[handle]);
    // The memory is dropped here, so that a model's destructor runs outside the lock.
    drop(state);
    Ok(())
}

/// Frees the remaining states of an instance.
pub(crate) fn free_all_of(owner: usize) {
    let mut states = states();
    let handles: Vec<_> =
        states.iter().filter(|(_, entry)| entry.owner == owner).map(|(&handle, _)| handle).collect();
    let removed = remove(&mut states, &handles);
    drop(states);
    for entry in removed {
        // A panic must not prevent the next drop, and can no longer be logged.
        let _ = contain(|| drop(entry));
    }
}

fn remove(states: &mut BTreeMap<usize, Entry>, handles: &[usize]) -> Vec<Entry> {
    let removed = handles.iter().filter_map(|handle| states.remove(handle)).collect();
    if states.is_empty() {
        // An empty map may keep a node, which would leak when the library is unloaded.
        *states = BTreeMap::new();
    }
    removed
}
