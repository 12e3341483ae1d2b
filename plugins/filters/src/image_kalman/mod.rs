//! `image-kalman`: Kalman filter of the box in the image (P2, section III-D).
//!
//! The state is (x, y, vx, vy, s): centre and velocity of the box in pixels, and its width. A state
//! in pixels needs neither depth nor calibration, and it is the quantity that a box measures; but
//! the image moves with the robot. Each prediction therefore projects the state into space, moves
//! it by the odometry, and projects it back: a person at rest has no velocity, however the robot
//! turns.
//!
//! For this purpose, and for the position in metres that every filter must estimate, the range of
//! the head is estimated in addition to the box, with the uncertainty of the detection: a few
//! centimetres from a depth image, a fifth of the distance from the size of a box.

mod config;
mod filter;
mod model;
mod models;
mod reupdate;
mod space;
#[cfg(test)]
mod tests;

pub use config::Config;
pub use filter::ImageKalman;
pub use model::State;
use tagalong_config::Registry;

/// Name of this plugin in configs.
pub const NAME: &str = "image-kalman";

/// Registers the plugin.
pub fn register(registry: &mut Registry) {
    registry.filter(
        NAME,
        "Kalman filter of the box in the image: centre, velocity, scale",
        |config: Config, _| ImageKalman::new(config),
    );
}
