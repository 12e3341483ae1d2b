//! The track managers, each in a module named after it: they decide when a track starts, is
//! confirmed, and ends.
//!
//! ```
//! use tagalong_conformance::samples::detection_at;
//! use tagalong_core::{Initiation, TrackId, TrackManager, Unassociated};
//! use tagalong_track_managers::m_of_n::{Config, MOfN};
//!
//! let mut manager = MOfN::new(Config::default())?;
//! let mut detection = detection_at(3.0, 0.0);
//! detection.score = 1.0; // the log-odds that this is a person
//! let new = Unassociated::new(&detection, 1.0, true);
//! let Initiation::Start(health) = manager.initiate(TrackId(1), &new) else { unreachable!() };
//! assert!(!health.confirmed, "one such detection is not enough");
//! # Ok::<(), tagalong_core::Error>(())
//! ```

pub mod m_of_n;
pub mod sprt;

use tagalong_config::Registry;

/// Registers all track managers.
pub fn register(registry: &mut Registry) {
    m_of_n::register(registry);
    sprt::register(registry);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_promises_of_track_managers_are_kept() {
        tagalong_conformance::assert_conforms(register);
    }
}
