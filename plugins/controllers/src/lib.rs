//! The controllers, each in a module of its name, and their shared parts: the commands that the
//! wheels have not executed yet, the time step of a frame, and the caution towards a target that was
//! not seen lately.

pub mod arc_follow;
pub mod clear_follow;
mod history;
mod steps;

pub use history::CommandHistory;
pub use steps::{coasting_weight, step_s};
use tagalong_config::Registry;

/// Registers all controllers.
pub fn register(registry: &mut Registry) {
    arc_follow::register(registry);
    clear_follow::register(registry);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_promises_of_controllers_are_kept() {
        let mut registry = Registry::default();
        register(&mut registry);
        let failures = tagalong_conformance::check_all(&registry);
        assert!(failures.is_empty(), "{failures:#?}");
    }
}
