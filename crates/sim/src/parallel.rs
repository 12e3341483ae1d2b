//! Work on independent parts of an image, with the same result for any number of threads.

use std::sync::{Mutex, PoisonError};
use std::thread;

/// Processes pieces of `length` values each; the last one may be shorter. `work` gets the index of
/// its piece.
pub fn in_pieces<T: Send>(
    values: &mut [T],
    length: usize,
    threads: usize,
    work: impl Fn(usize, &mut [T]) + Sync,
) {
    let pieces = Mutex::new(values.chunks_mut(length.max(1)).enumerate());
    thread::scope(|scope| {
        for _ in 1..threads {
            // If a thread cannot be started, the running ones do its work.
            let _ = thread::Builder::new().spawn_scoped(scope, || do_pieces(&pieces, &work));
        }
        do_pieces(&pieces, &work);
    });
}

/// Processes pieces until none is left.
fn do_pieces<'a, T: 'a>(
    pieces: &Mutex<impl Iterator<Item = (usize, &'a mut [T])>>,
    work: &impl Fn(usize, &mut [T]),
) {
    while let Some((number, piece)) = next(pieces) {
        work(number, piece);
    }
}

/// Returns the next piece; the lock is held no longer than that.
fn next<T>(work: &Mutex<impl Iterator<Item = T>>) -> Option<T> {
    work.lock().unwrap_or_else(PoisonError::into_inner).next()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_worked_on_once_whatever_the_number_of_threads() {
        for (threads, length) in [(0, 7), (1, 100), (3, 7), (8, 1)] {
            let mut values: Vec<usize> = (0..50).collect();
            in_pieces(&mut values, length, threads, |number, piece| {
                piece.iter_mut().for_each(|v| *v += 100 * number);
            });
            assert!(values.iter().enumerate().all(|(i, v)| *v == 100 * (i / length) + i));
        }
    }
}
