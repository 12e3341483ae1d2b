//! The track managers, each in a module of its name: they decide when a track starts, counts as a
//! person, and ends.

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
        let mut registry = Registry::default();
        register(&mut registry);
        let failures = tagalong_conformance::check_all(&registry);
        assert!(failures.is_empty(), "{failures:#?}");
    }
}
