//! `ekf`: extended Kalman filter of one person in the moving robot frame (P1, section 2.3; P4,
//! section III-B).
//!
//! The state is (x, y, z, vx, vy): the centre of the head in the robot frame and the velocity
//! **over ground** in robot axes. The prediction moves it by the person's velocity and by the
//! robot's own motion. Both are affine in the state, so the filter is exact and not only a
//! linearisation.
//!
//! The papers' equations subtract the robot's velocity from the person's in every frame although
//! the position rows already account for it; this is corrected here.

mod config;
mod filter;
#[cfg(test)]
mod tests;

pub use config::Config;
pub use filter::{Ekf, State};
use tagalong_config::Registry;
use tagalong_core::PerPerson;

/// Registers the filter `ekf`.
pub fn register(registry: &mut Registry) {
    registry.filter(
        "ekf",
        "Kalman filter in the moving robot frame, position and ground velocity",
        |config: Config, _| Ok(PerPerson::new(Ekf::new(config)?)),
    );
}
