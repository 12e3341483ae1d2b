use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of the filter `last-seen`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Account for the robot's own motion: a person stays where last seen in
    /// the room. Otherwise at the same place before the robot, wherever that
    /// goes.
    pub ego_motion: bool,
    /// Random walk of an unobserved person: growth of the standard deviation, metres per square
    /// root of a second.
    #[schemars(range(min = 1e-6, max = 100.0))]
    pub wander: f64,
    /// The velocity that is reported, and used for nothing, is the way between
    /// the last sighting and the first one in this time before it, s.
    #[schemars(range(min = 1e-6, max = 100.0))]
    pub velocity_over_s: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self { ego_motion: true, wander: 0.5, velocity_over_s: 1.0 }
    }
}
