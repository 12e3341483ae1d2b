//! `associate-hungarian`: one detection for each track, by the global assignment with the
//! least sum of costs (Kuhn 1955; solved by shortest augmenting paths).
//!
//! The cost of a pair is the negative log-likelihood d² + ln |S| of the innovation in the robot
//! frame, or -ln of the overlap in the image. A track may stay without a detection at a fixed cost,
//! so that a bad pair is not forced.

mod associate;
mod config;

pub use associate::Hungarian;
pub use config::Config;
use tagalong_config::{Kind, Registry};

/// Name of this plugin in configs.
const NAME: &str = "associate-hungarian";

/// Registers the associator `associate-hungarian`, which is that of a config that names none.
pub fn register(registry: &mut Registry) {
    registry.associator(
        NAME,
        "one detection a track, by the assignment with the least sum of costs",
        |config: Config, _| Hungarian::new(config),
    );
    registry.default_plugin(Kind::Associator, NAME);
}
