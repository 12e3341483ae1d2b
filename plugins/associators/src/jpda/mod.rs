//! `associate-jpda`: joint probabilistic data association (Fortmann, Bar-Shalom and Scheffe,
//! *Sonar tracking of multiple targets using joint probabilistic data association*, IEEE J.
//! Oceanic Engineering 1983).
//!
//! When several people are close together, no detection is assigned to one track alone: each track
//! receives every detection within its gate, weighted by the probability of all joint events in
//! which the two are associated. Filters update with the mixture.
//!
//! The marginals are exact. Tracks that share detections form a cluster. Within a cluster, the
//! events are summed over subsets of detections, once from the first track and once from the last,
//! so that the work grows with tracks times detections times 2 to the power of the number of
//! detections. In a cluster with more detections than [`Config::max_detections`] the least likely
//! ones are left out.

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
