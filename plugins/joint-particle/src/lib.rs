//! `joint-particle`: a particle filter that weights scenes of overlapping silhouettes (P3).
//!
//! A single person is a cloud of particles. When silhouettes overlap in the image, the clouds
//! become one cloud of joint particles: each is a scene, with the nearer person in front of the
//! farther one, and the detector's likelihood measures how well the scene explains the image. A
//! hidden person has a flat likelihood, and keeps moving as before.
//!
//! P3 samples every component of the state. But 100 or 625 particles in five or ten dimensions are
//! few, and depth and height then diverge as in P3's Figure 9. Only the likelihood of the position
//! across the viewing ray has several peaks (left or right of the nearer person), so only that
//! position is sampled; the rest of each particle is a small Kalman filter, conditioned on the
//! sample (Rao-Blackwellisation; Schön, Gustafsson and Nordlund 2005).
//!
//! The methods of the paper, including its likelihood maps, are settings; other sampling schemes
//! are [`SamplingSteps`].
//!
//! ```
//! use tagalong_conformance::samples::detection_at;
//! use tagalong_core::{EgoMotion, Filter, TrackId};
//! use tagalong_geometry::{Camera, Pinhole};
//! use tagalong_joint_particle::{Config, JointParticle};
//!
//! let camera = Camera::mounted(Pinhole::centred(262.0, 320, 240), 320, 240, 1.2, 0.0, 0.0);
//! let mut filter = JointParticle::new(Config::default(), 1)?;
//! filter.start(TrackId(1), &detection_at(3.0, 0.0), &camera);
//! // The robot drives half a metre towards the person.
//! filter.predict(&EgoMotion { forward: 0.5, ..EgoMotion::at_rest(0.5) }, &camera);
//! let position = filter.estimates(&camera)[&TrackId(1)].person.position;
//! assert!((position.x - 2.5).abs() < 0.3, "{position}");
//! # Ok::<(), tagalong_core::Error>(())
//! ```

mod config;
mod filter;
mod group;
mod identity;
mod maps;
mod overlap;
mod particle;
mod random;
mod resampling;
mod sampling;
mod weighing;

pub use config::{Chosen, Config, Method};
pub use filter::JointParticle;
pub use maps::{LikelihoodMap, PositionPair};
pub use random::Random;
pub use resampling::{heaviest, systematic};
pub use sampling::{Sampling, SamplingSteps};
use tagalong_config::Registry;

/// Registers the filter `joint-particle`.
pub fn register(registry: &mut Registry) {
    registry.filter(
        "joint-particle",
        "particles that weigh scenes of overlapping silhouettes",
        |config: Config, context| JointParticle::new(config, context.seed),
    );
}

#[cfg(test)]
mod tests;
