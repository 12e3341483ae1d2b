use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Limits on the robot's motion, for any wish of the controller. The figures are those that makers
/// and users of mobile robots work with; this is no safety function in the sense of the standards.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CommandLimiterSettings {
    /// Largest acceleration, m/s².
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_accel_mps2: f64,
    /// Largest deceleration while a target is followed, m/s²; a stop is at once.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_decel_mps2: f64,
    /// Largest turn rate, rad/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_turn_radps: f64,
    /// The robot may drive backwards.
    pub reverse: bool,
    /// Delay from an image to wheels that move accordingly, s; part of the stopping distance.
    #[schemars(range(min = 0.0))]
    pub reaction_s: f64,
    /// Distance that is left when the robot has stopped, m.
    #[schemars(range(min = 0.0))]
    pub margin_m: f64,
    /// Validity of a command, s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub valid_s: f64,
    /// Pause between frames after which the speed is halved, s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub slow_after_s: f64,
    /// Pause between frames after which the robot stops, s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub stop_after_s: f64,
    /// Largest believable speed of the odometry, m/s; more is a fault until the pipeline is armed
    /// again.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_odometry_mps: f64,
}

impl Default for CommandLimiterSettings {
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
        }
    }
}

impl CommandLimiterSettings {
    /// Returns the distance in which a robot of this speed stops, m: reaction, braking and margin.
    pub fn stopping_m(&self, speed_mps: f64) -> f64 {
        let braking = speed_mps * speed_mps / (2.0 * self.max_decel_mps2);
        speed_mps * self.reaction_s + braking + self.margin_m
    }
}

/// Corridor before the robot in which a point counts as an obstacle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CollisionMonitorSettings {
    /// Half the width of the area that the robot sweeps, m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub half_width_m: f64,
    /// Foremost point of the robot, ahead of the point between its wheels, m.
    #[schemars(range(min = 0.0))]
    pub front_m: f64,
    /// Extra half width for points that have not been static for a second and may step in, m.
    #[schemars(range(min = 0.0))]
    pub steps_in_m: f64,
    /// Clearance to an obstacle below which the robot does not move towards it, m.
    #[schemars(range(min = 0.0))]
    pub stop_m: f64,
    /// Distance beyond which obstacles are ignored, m.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 100))]
    pub range_m: f64,
    /// Height up to which points belong to the floor, m; it grows by 3 cm for each metre of
    /// distance.
    #[schemars(range(min = 0.0))]
    pub floor_m: f64,
    /// Height above which points are ignored because the robot passes below, m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub top_m: f64,
    /// Radius around the target within which points belong to it, m.
    #[schemars(range(min = 0.0))]
    pub target_radius_m: f64,
    /// Number of points that make an obstacle, in a grid of 160 columns over the image.
    #[schemars(range(min = 1))]
    pub min_points: u32,
    /// Part of the image with depth below which the camera counts as blind.
    #[schemars(range(min = 0.0))]
    pub min_seen: f64,
    /// Time for which an obstacle is remembered that left the view beside the robot or below the
    /// image, s.
    #[schemars(range(min = 0.0))]
    pub memory_s: f64,
}

impl Default for CollisionMonitorSettings {
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

impl CollisionMonitorSettings {
    /// Returns the number of image points that one ray of a laser scanner counts for: two rays make
    /// an obstacle, one may be dust.
    pub(super) fn ray_points(&self) -> u32 {
        self.min_points.div_ceil(2)
    }
}
