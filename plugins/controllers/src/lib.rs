//! The controllers, each in a module named after it, and their shared parts: the commands that the
//! wheels have not executed yet, the time step of a frame, the slower approach to a target that was
//! not seen recently, and the forecast of people.
//!
//! ```
//! use nalgebra::Vector2;
//! use tagalong_conformance::{patch, target};
//! use tagalong_controllers::clear_follow::{ClearFollow, Config};
//! use tagalong_core::{Controller, DiffDrive, Scene};
//!
//! let mut controller = ClearFollow::new(Config::default())?;
//! let frame = patch::frame(patch::picture(true, 1));
//! let person = target(3.0, 1.0, Vector2::zeros()); // ahead, and to the left
//! let tracks = std::slice::from_ref(&person);
//! let wheels = DiffDrive { half_separation_m: 0.2, slip: 0.0 };
//! let scene = Scene::new(&frame, tracks, wheels, 1.0).with_target(Some(&person));
//! let twist = controller.command(&scene);
//! assert!(twist.linear_mps > 0.0 && twist.angular_rps > 0.0);
//! # Ok::<(), tagalong_core::Error>(())
//! ```

pub mod arc_follow;
mod around;
pub mod clear_follow;
mod forecast;
pub mod foresee_follow;
mod history;
mod steps;

pub use forecast::{Forecast, ForecastSettings};
pub use history::CommandHistory;
pub use steps::{coasting_weight, step_s};
use tagalong_config::Registry;

/// Registers all controllers.
pub fn register(registry: &mut Registry) {
    arc_follow::register(registry);
    clear_follow::register(registry);
    foresee_follow::register(registry);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_promises_of_controllers_are_kept() {
        tagalong_conformance::assert_conforms(register);
    }
}
