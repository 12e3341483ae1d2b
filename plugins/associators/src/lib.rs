//! The associators, each in a module named after it, and their shared parts: the cost of a pair of
//! a track and a detection, its gate, and the global assignment with the least sum of costs.
//!
//! The shared parts are public for associators outside of this repository.

mod assign;
pub mod buffered;
mod fusion;
pub mod hungarian;
pub mod jpda;
pub mod observation_centric;
mod observations;
mod pair;
mod similarity;
pub mod two_stage;

pub use assign::assign;
pub use fusion::{AppearanceFusion, Fusion};
pub use observations::{ObservationMemory, Observed};
pub use pair::{Cost, Fit, GateSettings, Overlap, PairCost, Pairs, assign_fits};
pub use similarity::{Stage, StageSettings, Staged, buffered_iou, probability};
use tagalong_config::Registry;

/// Registers all associators.
pub fn register(registry: &mut Registry) {
    buffered::register(registry);
    hungarian::register(registry);
    jpda::register(registry);
    observation_centric::register(registry);
    two_stage::register(registry);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_promises_of_associators_are_kept() {
        tagalong_conformance::assert_conforms(register);
    }
}
