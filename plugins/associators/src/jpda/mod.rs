//! `associate-jpda`: joint probabilistic data association (Fortmann, Bar-Shalom and Scheffe,
//! *Sonar tracking of multiple targets using joint probabilistic data association*, IEEE J.
//! Oceanic Engineering 1983).
//!
//! Where several people stand close to each other, no detection is given to one track alone:
//! each track receives every detection within its gate with the probability of all joint events
//! in which they belong together. Filters update by the mixture.
//!
//! The marginals are exact. Tracks that share detections form a cluster; within one, the events
//! are summed over subsets of detections, once from the first track and once from the last, so
//! that the work grows with tracks times detections times 2 to the number of detections. In a
//! cluster with more detections than [`Config::max_detections`] the least likely ones are left
//! out.

mod associate;
mod cluster;
mod config;
mod marginals;

pub use associate::Jpda;
pub use config::Config;
use tagalong_config::Registry;

/// Registers the associator `associate-jpda`.
pub fn register(registry: &mut Registry) {
    registry.associator(
        "associate-jpda",
        "each detection near a track, with its probability (JPDA)",
        |config: Config, _| Jpda::new(config),
    );
}
