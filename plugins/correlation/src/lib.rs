//! `correlation`: where is this person now, whom one camera of a stereo pair sees and
//! the other does not? By the picture that was remembered of them.
//!
//! Beside whoever stands near the robot lies a strip that the left camera sees and the
//! right one does not. It has no depth, so detectors that look at depth find nobody
//! there, and that is where people come into view again after somebody passed in
//! between. What they look like is known from before: each person's upper body is
//! remembered while depth tells its outline ([`Picture`]), and slid over the image around
//! the expected place, at the scale of the expected distance. Normalised
//! cross-correlation, over what is of the body and not behind something nearer, says how
//! well it fits ([`Strip`]).
//!
//! A picture tells the direction and not the distance: that stays what was expected. It
//! answers only where depth does not know better.

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
use tagalong_config::Registry;

/// The name of this plugin in configs.
pub const NAME: &str = "correlation";

/// Registers the plugin.
pub fn register(registry: &mut Registry) {
    registry.detector(
        NAME,
        "finds known people again by correlation, where stereo has no depth",
        |config: Config, _| Correlation::new(config),
    );
}
