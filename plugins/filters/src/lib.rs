//! The filters without a random number, each in a module of its name: they estimate the position of
//! each person from all evidence.

pub mod ekf;
pub mod floor_kalman;
pub mod image_kalman;
pub mod last_seen;

use tagalong_config::Registry;

/// Registers all filters of this crate.
pub fn register(registry: &mut Registry) {
    ekf::register(registry);
    floor_kalman::register(registry);
    image_kalman::register(registry);
    last_seen::register(registry);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_promises_of_filters_are_kept() {
        let mut registry = Registry::default();
        register(&mut registry);
        let failures = tagalong_conformance::check_all(&registry);
        assert!(failures.is_empty(), "{failures:#?}");
    }
}
