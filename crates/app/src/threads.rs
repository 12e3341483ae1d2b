//! Number of threads.

use std::thread::available_parallelism;

/// Returns the requested number of threads, or otherwise the number of cores.
pub fn threads(asked: Option<u8>) -> usize {
    asked.map_or_else(|| available_parallelism().map_or(1, usize::from), usize::from)
}
