//! Signals that request a command to stop.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use crate::outcome::Failure;

/// Record of a received stop signal.
///
/// The first SIGINT or SIGTERM is only recorded, so that the current frame and the files can be
/// finished; a second one ends the program at once.
#[derive(Clone, Debug, Default)]
pub struct Signals {
    received: Arc<AtomicUsize>,
}

impl Signals {
    /// Starts listening.
    ///
    /// # Errors
    /// If the system rejects the handler: exit code 1.
    pub fn listen() -> Result<Self, Failure> {
        Self::register()
            .map_err(|error| Failure::failed(format!("cannot listen for signals: {error}")))
    }

    fn register() -> io::Result<Self> {
        let signals = Self::default();
        let impatient = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            // The order matters: at the first signal the flag is not set yet.
            flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&impatient))?;
            flag::register(signal, Arc::clone(&impatient))?;
            flag::register_usize(signal, Arc::clone(&signals.received), signal as usize)?;
        }
        Ok(signals)
    }

    /// Requests a stop, as SIGINT does.
    pub fn interrupt(&self) {
        self.received.store(SIGINT as usize, Ordering::Relaxed);
    }

    /// Returns the signal that requested a stop, if there was one.
    pub fn received(&self) -> Option<u8> {
        u8::try_from(self.received.load(Ordering::Relaxed)).ok().filter(|signal| *signal != 0)
    }
}
