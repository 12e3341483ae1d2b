//! `associate-observation-centric`: overlap and direction of motion, then overlap with the last
//! observation (OC-SORT: Cao et al., *Observation-Centric SORT: Rethinking SORT for Robust
//! Multi-Object Tracking*, CVPR 2023).
//!
//! A filter that has predicted for a long time is wrong in velocity first. Directions are therefore
//! measured between observations, and a track that overlaps no detection is compared with the box
//! in which it was last observed: a person who stopped behind another one is still there.

mod associate;
mod config;

pub use associate::ObservationCentric;
pub use config::Config;
use tagalong_config::Registry;

/// Registers the associator `associate-observation-centric`.
pub fn register(registry: &mut Registry) {
    registry.associator(
        "associate-observation-centric",
        "overlap and direction of motion, then the last observation (OC-SORT)",
        |config: Config, _| ObservationCentric::new(config),
    );
}
