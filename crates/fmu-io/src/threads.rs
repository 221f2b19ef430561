//! Work in several threads.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;

use anyhow::{Result, anyhow};

/// The content of a mutex, whatever happened to a thread that held it.
pub fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Does each of some jobs, in at most this many threads, and returns their results in the order of the jobs; after an
/// error, only those are done that have begun.
///
/// # Errors
/// The first of a job, or when a thread has panicked.
pub fn each<J: Send, T: Send>(
    threads: usize,
    jobs: impl IntoIterator<Item = J>,
    act: impl Fn(J) -> Result<T> + Sync,
) -> Result<Vec<T>> {
    let jobs: VecDeque<_> = jobs.into_iter().enumerate().collect();
    let (threads, results) = (threads.min(jobs.len()), Mutex::new(BTreeMap::new()));
    let jobs = Mutex::new(jobs);
    let next = || locked(&jobs).pop_front();
    let work = || {
        while let Some((place, job)) = next() {
            match act(job) {
                Ok(result) => drop(locked(&results).insert(place, result)),
                Err(error) => {
                    locked(&jobs).clear();
                    return Err(error);
                }
            }
        }
        Ok(())
    };
    thread::scope(|scope| {
        let threads: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        threads.into_iter().try_for_each(|thread| thread.join().map_err(|_| anyhow!("a thread panicked"))?)
    })?;
    Ok(results.into_inner().unwrap_or_else(PoisonError::into_inner).into_values().collect())
}

/// How many threads or processes to use: the number wanted, or one per core.
#[must_use]
pub fn number(wanted: Option<u16>) -> usize {
    wanted.map_or_else(|| thread::available_parallelism().map_or(1, usize::from), usize::from)
}
