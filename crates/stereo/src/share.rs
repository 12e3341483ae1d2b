//! Distribution of work over several threads.

use std::sync::{Mutex, PoisonError};
use std::thread;
use std::vec::IntoIter;

/// Returns the rows of a band of an image, of which there is one for each thread.
pub fn band_rows(height: usize, threads: usize) -> usize {
    height.div_ceil(threads).max(1)
}

/// Runs all jobs at once, each on its own thread, and one on this thread. If the system starts no
/// more threads, those that run do the remaining jobs.
pub fn share<J: Send>(jobs: impl IntoIterator<Item = J>, work: impl Fn(J) + Sync) {
    let jobs: Vec<J> = jobs.into_iter().collect();
    let count = jobs.len();
    let queue = Mutex::new(jobs.into_iter());
    thread::scope(|scope| {
        for _ in 1..count {
            let _ = thread::Builder::new().spawn_scoped(scope, || do_jobs(&queue, &work));
        }
        do_jobs(&queue, &work);
    });
}

/// Runs jobs until none is left.
fn do_jobs<J>(queue: &Mutex<IntoIter<J>>, work: &impl Fn(J)) {
    while let Some(job) = next(queue) {
        work(job);
    }
}

/// Takes the next job; the lock is only held meanwhile.
fn next<J>(queue: &Mutex<impl Iterator<Item = J>>) -> Option<J> {
    queue.lock().unwrap_or_else(PoisonError::into_inner).next()
}
