//! `image-kalman`: a Kalman filter of the box in the image (P2, section III-D).
//!
//! The state is (x, y, vx, vy, s): centre and velocity of the box in pixels, and
//! its width. Thinking in pixels needs neither depth nor calibration to work, and
//! it is what a box says; but the picture moves when the robot does. So each
//! prediction takes the belief into space, moves it as the odometry says, and
//! brings it back: a person who stands still has no velocity, however the robot
//! turns.
//!
//! For that, and for the place in metres that every filter owes, the range of the
//! head is believed in beside the box, with as much uncertainty as the detection
//! had: a few centimetres from a depth image, a fifth of the distance from the
//! size of a box.

mod config;
mod filter;
mod model;
mod space;
#[cfg(test)]
mod tests;

pub use config::Config;
pub use filter::ImageKalman;
pub use model::Belief;
use tagalong_config::Registry;

/// The name of this plugin in configs.
pub const NAME: &str = "image-kalman";

/// Registers the plugin.
pub fn register(registry: &mut Registry) {
    registry.filter(
        NAME,
        "Kalman filter of the box in the image: centre, velocity, scale",
        |config: Config, _| ImageKalman::new(config),
    );
}
