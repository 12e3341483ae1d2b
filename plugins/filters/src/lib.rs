//! The filters without random numbers, each in a module named after it: they estimate the position
//! of each person from all evidence.
//!
//! ```
//! use tagalong_conformance::samples::detection_at;
//! use tagalong_core::{EgoMotion, PersonFilter};
//! use tagalong_filters::ekf::{Config, Ekf};
//! use tagalong_geometry::Camera;
//!
//! let filter = Ekf::new(Config::default())?;
//! let camera = Camera::blind(nalgebra::one());
//! let mut person = filter.start(&detection_at(3.0, 0.0));
//! for step in 1..=10 {
//!     filter.predict(&mut person, &EgoMotion::at_rest(0.1));
//!     filter.correct(&mut person, &detection_at(3.0, 0.1 * f64::from(step)), &camera);
//! }
//! let velocity = filter.estimate(&person, &camera).person.velocity;
//! assert!(velocity.y > 0.5, "the person walks to the left: {velocity}");
//! # Ok::<(), tagalong_core::Error>(())
//! ```

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
        tagalong_conformance::assert_conforms(register);
    }
}
