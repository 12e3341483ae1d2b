//! `floor-kalman`: Kalman filter of each person's position on the floor, in room coordinates (P5,
//! section 5).
//!
//! The paper's state is the position alone, and its prediction adds a "nominal velocity" u, which
//! is a displacement, because nothing multiplies it by time. The paper does not say how u is
//! determined. [`Form`] has the possible meanings: zero, the difference of the last posterior
//! positions or, as in most trackers, two more states.
//!
//! The room frame is the robot frame at the start of the run, rotated by `room_heading_deg`;
//! odometry propagates it, so the robot may move.

mod config;
mod filter;
mod state;
#[cfg(test)]
mod tests;

pub use config::{Config, Form, Measurement};
pub use filter::FloorKalman;
use tagalong_config::Registry;

/// The name of this plugin in configs.
pub const NAME: &str = "floor-kalman";

/// Registers the filter `floor-kalman`.
pub fn register(registry: &mut Registry) {
    registry.filter(
        NAME,
        "Kalman filter on the floor plan in room coordinates",
        |config: Config, _| FloorKalman::new(config),
    );
}
