//! Work in several threads.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;

use anyhow::{Result, anyhow};

/// The content of a mutex, whatever happened to a thread that held it.
pub fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Does each of some jobs, in at most this many threads; after an error, only those that have begun.
///
/// # Errors
/// The first of a job, or when a thread has panicked.
pub fn each<J: Send>(threads: usize, jobs: VecDeque<J>, act: impl Fn(J) -> Result<()> + Sync) -> Result<()> {
    let threads = threads.min(jobs.len());
    let jobs = Mutex::new(jobs);
    let next = || locked(&jobs).pop_front();
    let work = || {
        while let Some(job) = next() {
            if let Err(error) = act(job) {
                locked(&jobs).clear();
                return Err(error);
            }
        }
        Ok(())
    };
    thread::scope(|scope| {
        let threads: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        threads.into_iter().try_for_each(|thread| thread.join().map_err(|_| anyhow!("a thread panicked"))?)
    })
}
