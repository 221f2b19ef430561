//! The states that importers have saved, by their handles.
//!
//! A handle (`fmi2FMUstate`) is looked up here and never dereferenced. So one that is not a state, that was
//! freed, or that is another FMU's is an error and not a crash. A state may be set in another instance of
//! the FMU than the one it is of. What an importer does not free is freed with the instance.
//!
//! This table is all that the instances of a library share. None sees another's states through it, unless
//! the importer hands it the handle.

use std::any::Any;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};

use crate::error::Error;
use crate::panics::contain;

/// By handle, the states.
static STATES: Mutex<BTreeMap<usize, Entry>> = Mutex::new(BTreeMap::new());

struct Entry {
    /// The address of the instance with which the state is freed.
    owner: usize,
    /// A `RwLock` of what was saved. The allocation's address is the handle: no other that is alive, of this
    /// library or another, has the same.
    state: Arc<dyn Any + Send + Sync>,
}

/// A state, which several instances may read from at once.
pub(crate) type Saved<T> = Arc<RwLock<T>>;

fn states() -> MutexGuard<'static, BTreeMap<usize, Entry>> {
    // Nothing panics while the table is being changed.
    STATES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps a state for an importer; its handle.
pub(crate) fn keep<T: Send + Sync + 'static>(owner: usize, state: T) -> usize {
    let state = Arc::new(RwLock::new(state));
    let handle = Arc::as_ptr(&state).addr();
    states().insert(handle, Entry { owner, state });
    handle
}

/// The state with a handle.
///
/// # Errors
/// When no state has this handle, or it is of another type.
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
    // Only now is the memory given back: a model's destructor runs outside the lock.
    drop(state);
    Ok(())
}

/// Frees the states that are left of an instance.
pub(crate) fn free_all_of(owner: usize) {
    let mut states = states();
    let handles: Vec<_> =
        states.iter().filter(|(_, entry)| entry.owner == owner).map(|(&handle, _)| handle).collect();
    let removed = remove(&mut states, &handles);
    drop(states);
    for entry in removed {
        // One that panics must not keep the next from being dropped. There is nobody left to tell.
        let _ = contain(|| drop(entry));
    }
}

fn remove(states: &mut BTreeMap<usize, Entry>, handles: &[usize]) -> Vec<Entry> {
    let removed = handles.iter().filter_map(|handle| states.remove(handle)).collect();
    if states.is_empty() {
        // An empty map may keep a node, which would be lost when the library is unloaded.
        *states = BTreeMap::new();
    }
    removed
}
