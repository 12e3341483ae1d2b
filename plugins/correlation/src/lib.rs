//! `correlation`: finds a known person in the part of the scene that only one camera of a stereo
//! pair sees, by a remembered picture of them.
//!
//! Beside a person near the robot lies a strip that the left camera sees and the right one does
//! not. It has no depth, so depth detectors find no person there, and it is where people reappear
//! after another person passed in front of them. Their appearance is known from before: each
//! person's upper body is remembered while depth shows its outline ([`Picture`]), and is shifted
//! over the image around the expected position, at the scale of the expected distance. The measure
//! of fit is normalised cross-correlation over the pixels of the body that nothing nearer hides
//! ([`Strip`]).
//!
//! A picture gives the direction but not the distance, which remains the expected one. The plugin
//! reports detections only where there is no depth.
//!
//! ```
//! use tagalong_conformance::figure::{Figure, World};
//! use tagalong_conformance::samples::track_at;
//! use tagalong_core::{Detector, EgoMotion, Frame, Funnel, Query, Stamp};
//! use tagalong_correlation::{Config, Correlation};
//! use tagalong_geometry::{Camera, Pinhole};
//!
//! # fn frame(people: &[Figure]) -> Frame {
//! #     let lens = Pinhole::centred(262.0, 320, 240);
//! #     let camera = Camera::mounted(lens, 320, 240, 1.2, 0.0, 0.0);
//! #     let images = World::with(people).draw(&camera);
//! #     Frame::new(1, Stamp::default(), camera.into(), EgoMotion::at_rest(0.1), images)
//! # }
//! let mut detector = Correlation::new(Config::default())?;
//! let shown = frame(&[Figure::at(2.5, 0.0)]);
//! let track = track_at(1, 2.5, 0.0);
//! detector.learn(&shown, &[track.clone()])?;
//! // Where there is depth, other detectors see the person.
//! let found = detector.detect(&shown, &Query::Track(&track), &mut Funnel::default())?;
//! assert!(found.is_empty());
//! # Ok::<(), tagalong_core::Error>(())
//! ```

mod config;
mod detect;
mod picture;
mod strip;
#[cfg(test)]
mod tests;

pub use config::Config;
pub use detect::Correlation;
pub use picture::Picture;
pub use strip::{Fit, Strip};
use tagalong_config::{Registry, Remedy};

/// The name of this plugin in configs.
pub const NAME: &str = "correlation";

/// Settings of each test of its funnel.
const REMEDIES: &[Remedy] = &[Remedy {
    test: "correlation: *",
    settings: &["min_correlation", "min_lead", "max_known", "memory_s"],
    look: "why a person without depth is not found by their picture; most frames need none",
}];

/// Registers the plugin.
pub fn register(registry: &mut Registry) {
    registry.remedies(NAME, REMEDIES);
    registry.detector(
        NAME,
        "finds known people again by correlation, where stereo has no depth",
        |config: Config, _| Correlation::new(config),
    );
}
