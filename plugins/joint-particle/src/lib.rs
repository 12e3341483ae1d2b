//! `joint-particle`: a particle filter that weighs scenes of overlapping silhouettes (P3).
//!
//! A single person is a cloud of particles. When silhouettes overlap in the image, the clouds
//! become one of joint particles: each is a scene, with the nearer person in front of the farther
//! one, and the detector's likelihood measures how well the scene explains the image. A hidden
//! person gets a flat likelihood, and moves on as before.
//!
//! P3 samples every number of the state. But 100 or 625 particles in five or ten dimensions are
//! few, and depth and height then get lost as in P3's Figure 9. Only the position across the
//! viewing ray has a likelihood with several peaks (left or right of the nearer person), so only
//! that is sampled; the rest of each particle is a small Kalman filter, conditioned on the sample
//! (Rao-Blackwellisation; Schön, Gustafsson and Nordlund 2005).
//!
//! The methods of the paper, its likelihood maps included, are settings; other schemes of sampling are
//! [`SamplingSteps`].

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
