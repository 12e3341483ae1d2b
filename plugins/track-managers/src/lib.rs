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
