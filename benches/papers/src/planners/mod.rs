//! Planners of Follow-Bench, to ride beside ours with the same seeds.
//!
//! Ye et al., *Follow-Bench: A Unified Motion Planning Benchmark for Socially-Aware Robot Person
//! Following*, arXiv 2509.10796; equations and settings are those of its code (MedlarTea/follow-bench
//! at 7284e8e, MIT). There a planner commands the robot directly; here the command limiter and the
//! collision monitor of the config come after it, as after every controller.

mod dynamic_window;
mod obstacles;
mod planner;
mod social_force;

use tagalong_config::Registry;

/// Registers the planners.
pub(crate) fn register(registry: &mut Registry) {
    dynamic_window::register(registry);
    social_force::register(registry);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_planners_keep_the_promises_of_controllers() {
        let mut registry = Registry::default();
        register(&mut registry);
        let failures = tagalong_conformance::check_all(&registry);
        assert!(failures.is_empty(), "{failures:#?}");
    }
}
