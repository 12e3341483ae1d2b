use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the robot may do, whatever the controller wishes. The figures are those
/// that makers and users of mobile robots work with; this is no safety function
/// in the sense of the standards.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GovernorSettings {
    /// Largest acceleration, m/s².
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_accel_mps2: f64,
    /// Largest deceleration while somebody is followed, m/s²; a stop is at once.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_decel_mps2: f64,
    /// Largest turn rate, rad/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_turn_radps: f64,
    /// The robot may drive backwards.
    pub reverse: bool,
    /// From an image to wheels that move accordingly, s; for the distance in
    /// which the robot stops.
    #[schemars(range(min = 0.0))]
    pub reaction_s: f64,
    /// Distance that is left when the robot has stopped, m.
    #[schemars(range(min = 0.0))]
    pub margin_m: f64,
    /// A command is good for this long, s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub valid_s: f64,
    /// Half speed after a longer pause between frames, s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub slow_after_s: f64,
    /// Stop after a longer pause between frames, s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub stop_after_s: f64,
    /// Odometry that moves faster has jumped, m/s: a fault until the pipeline is
    /// armed again.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_odometry_mps: f64,
    /// What is looked at in the depth image.
    pub corridor: CorridorSettings,
}

impl Default for GovernorSettings {
    fn default() -> Self {
        Self {
            max_accel_mps2: 0.5,
            max_decel_mps2: 1.0,
            max_turn_radps: 1.5,
            reverse: false,
            reaction_s: 0.5,
            margin_m: 0.3,
            valid_s: 0.25,
            slow_after_s: 0.25,
            stop_after_s: 0.5,
            max_odometry_mps: 3.0,
            corridor: CorridorSettings::default(),
        }
    }
}

impl GovernorSettings {
    /// The distance in which a robot of this speed stops, m: reaction, braking
    /// and margin.
    pub fn stopping_m(&self, speed_mps: f64) -> f64 {
        let braking = speed_mps * speed_mps / (2.0 * self.max_decel_mps2);
        speed_mps * self.reaction_s + braking + self.margin_m
    }
}

/// Where something is in the way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CorridorSettings {
    /// Half the width of what the robot sweeps, m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub half_width_m: f64,
    /// The robot's foremost point, ahead of the point between its wheels, m.
    #[schemars(range(min = 0.0))]
    pub front_m: f64,
    /// What has not stood in its place for a second may step in: for it the robot
    /// sweeps so much more on both sides, m.
    #[schemars(range(min = 0.0))]
    pub steps_in_m: f64,
    /// No movement towards what is nearer to the front than this, m.
    #[schemars(range(min = 0.0))]
    pub stop_m: f64,
    /// What is farther away does not matter, m.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 100))]
    pub range_m: f64,
    /// What is lower is floor, m; at `range_m` three centimetres for each metre
    /// more.
    #[schemars(range(min = 0.0))]
    pub floor_m: f64,
    /// What is higher the robot passes below, m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub top_m: f64,
    /// Points this near to the person who is followed are that person, m.
    #[schemars(range(min = 0.0))]
    pub target_radius_m: f64,
    /// So many points are something, in a grid of 160 columns over the image.
    #[schemars(range(min = 1))]
    pub min_points: u32,
    /// Less than this part of the image with depth is a blind camera.
    #[schemars(range(min = 0.0))]
    pub min_seen: f64,
    /// What was seen and is out of view now, beside the robot or below the image,
    /// is believed to be there for this long, s.
    #[schemars(range(min = 0.0))]
    pub memory_s: f64,
}

impl Default for CorridorSettings {
    fn default() -> Self {
        Self {
            half_width_m: 0.34,
            steps_in_m: 0.25,
            front_m: 0.2,
            stop_m: 0.4,
            range_m: 3.0,
            floor_m: 0.08,
            top_m: 1.5,
            target_radius_m: 0.45,
            min_points: 6,
            min_seen: 0.02,
            memory_s: 20.0,
        }
    }
}

impl CorridorSettings {
    /// So many points of the image a ray of a laser scanner counts for: two rays are
    /// something, one may be dust.
    pub(super) fn ray_points(&self) -> u32 {
        self.min_points.div_ceil(2)
    }
}
