//! Threads of the bridge.

use std::thread::{Builder, JoinHandle};

use crate::BridgeError;

/// Starts a thread; `purpose` names it in errors and debuggers.
///
/// # Errors
/// [`BridgeError::Thread`] if no further thread can be started, for example because of the limit of
/// a container.
pub(crate) fn start<T: Send + 'static>(
    purpose: &'static str,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<JoinHandle<T>, BridgeError> {
    start_with(Builder::new(), purpose, work)
}

fn start_with<T: Send + 'static>(
    builder: Builder,
    purpose: &'static str,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<JoinHandle<T>, BridgeError> {
    let started = builder.name(purpose.to_owned()).spawn(work);
    started.map_err(|error| BridgeError::Thread(purpose, error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_that_cannot_start_is_an_error_with_the_cause() {
        assert_eq!(start("one", || 7).unwrap().join().unwrap(), 7);
        // No machine has so much memory for a stack.
        let huge = Builder::new().stack_size(1 << 60);
        let why = start_with(huge, "the wheels", || ()).unwrap_err().to_string();
        assert!(why.starts_with("no thread for the wheels can be started: "), "{why}");
        assert!(why.contains("pids limit"), "{why}");
    }
}
