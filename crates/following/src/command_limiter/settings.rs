use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{Error, Result};

use super::SourceSettings;
use crate::RobotSettings;

/// Limits on the robot's motion, for any wish of the controller. The figures are those that makers
/// and users of mobile robots work with, and each has a ceiling that no config passes; this is no
/// safety function in the sense of the standards.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CommandLimiterSettings {
    /// Largest acceleration, m/s².
    #[schemars(range(min = 0.05, max = 1.0))]
    pub max_accel_mps2: f64,
    /// Largest deceleration, m/s²; only an emergency brakes harder.
    #[schemars(range(min = 0.2, max = 2.5))]
    pub max_decel_mps2: f64,
    /// Largest turn rate, rad/s.
    #[schemars(range(min = 0.1, max = 2.0))]
    pub max_turn_radps: f64,
    /// Largest change of the turn rate, rad/s².
    #[schemars(range(min = 0.5, max = 10.0))]
    pub max_turn_accel_radps2: f64,
    /// Largest change of the acceleration, m/s³; only an emergency changes it faster.
    #[schemars(range(min = 1.0, max = 50.0))]
    pub max_jerk_mps3: f64,
    /// Largest change of the acceleration of the turn, rad/s³.
    #[schemars(range(min = 5.0, max = 500.0))]
    pub max_turn_jerk_radps3: f64,
    /// The robot may drive backwards, where no camera looks.
    pub reverse: bool,
    /// Delay from an image to wheels that move accordingly, s; part of the stopping distance. At
    /// least `valid_s`, because the robot drives on for that time when images cease.
    #[schemars(range(min = 0.1, max = 2.0))]
    pub reaction_s: f64,
    /// Distance that is left when the robot has stopped, m.
    #[schemars(range(min = 0.3, max = 2.0))]
    pub margin_m: f64,
    /// Validity of a command, s.
    #[schemars(range(min = 0.05, max = 0.5))]
    pub valid_s: f64,
    /// Pause between frames after which the speed is halved, s.
    #[schemars(range(min = 0.05, max = 0.5))]
    pub slow_after_s: f64,
    /// Pause between frames after which the robot stops, s.
    #[schemars(range(min = 0.1, max = 0.5))]
    pub stop_after_s: f64,
    /// Largest believable speed of the odometry, m/s; more is a fault until the pipeline is armed
    /// again.
    #[schemars(range(min = 0.1, max = 5.0))]
    pub max_odometry_mps: f64,
    /// Time for which an enable holds unless it is repeated, s.
    #[schemars(range(min = 0.1, max = 1.0))]
    pub enable_s: f64,
}

impl Default for CommandLimiterSettings {
    fn default() -> Self {
        Self {
            max_accel_mps2: 0.5,
            max_decel_mps2: 1.0,
            max_turn_radps: 1.5,
            max_turn_accel_radps2: 4.0,
            max_jerk_mps3: 5.0,
            max_turn_jerk_radps3: 40.0,
            reverse: false,
            reaction_s: 0.5,
            margin_m: 0.3,
            valid_s: 0.25,
            slow_after_s: 0.25,
            stop_after_s: 0.5,
            max_odometry_mps: 3.0,
            enable_s: 0.5,
        }
    }
}

impl CommandLimiterSettings {
    /// Returns the distance in which a robot of this speed stops, m: reaction, braking with the rise of
    /// the deceleration, and margin.
    pub fn stopping_m(&self, speed_mps: f64) -> f64 {
        let braking = speed_mps * speed_mps / (2.0 * self.max_decel_mps2);
        speed_mps * self.gentle_reaction_s() + braking + self.margin_m
    }

    /// Returns the reaction with the time by which the rise of the deceleration, at the limit of the
    /// jerk, delays the stop, s. A robot that brakes with a from the start needs v²/2a; with the rise
    /// and fall of a at the jerk j it needs v/2 (v/a + a/j), which is v a/2j more.
    fn gentle_reaction_s(&self) -> f64 {
        self.reaction_s + self.max_decel_mps2 / (2.0 * self.max_jerk_mps3)
    }

    /// Returns the largest speed from which the robot stops within this distance, m/s: reaction and
    /// braking at once, without the margin.
    pub(super) fn speed_within(&self, distance_m: f64) -> f64 {
        self.speed_after(self.reaction_s, distance_m)
    }

    /// Returns the largest speed from which it does so within the limit of the jerk, m/s.
    pub(super) fn gentle_within(&self, distance_m: f64) -> f64 {
        self.speed_after(self.gentle_reaction_s(), distance_m)
    }

    fn speed_after(&self, reaction_s: f64, distance_m: f64) -> f64 {
        let decel = self.max_decel_mps2;
        // The positive root of v t + v² / 2 a = s.
        let root = (reaction_s * reaction_s + 2.0 * distance_m.max(0.0) / decel).sqrt();
        decel * (root - reaction_s)
    }

    /// Refuses limits that contradict each other or those of the robot.
    ///
    /// # Errors
    /// [`Error::Settings`] names the key and the remedy.
    pub fn check(&self, robot: &RobotSettings) -> Result<()> {
        at_least("reaction_s", self.reaction_s, "valid_s", self.valid_s)?;
        at_least("stop_after_s", self.stop_after_s, "slow_after_s", self.slow_after_s)?;
        at_least("max_decel_mps2", self.max_decel_mps2, "max_accel_mps2", self.max_accel_mps2)?;
        let speed = ("max_speed_mps", robot.max_speed_mps);
        at_least("max_odometry_mps", self.max_odometry_mps, speed.0, speed.1)
    }
}

/// Refuses a value below another setting.
fn at_least(key: &str, value: f64, other: &str, least: f64) -> Result<()> {
    // Written as `>=` so that a value that is no number is refused.
    if value >= least {
        return Ok(());
    }
    Err(Error::setting(key, format!("must be at least {least}, as `{other}`, not {value}")))
}

/// Corridor before the robot in which a point counts as an obstacle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CollisionMonitorSettings {
    /// Sensors of obstacles: "sensed" (depth or laser; without them, or when one of them falls
    /// silent, nothing moves), or "none" for a controller that is to drive without eyes for
    /// obstacles.
    pub obstacles: ObstacleSource,
    /// Half the width of the area that the robot sweeps, m.
    #[schemars(range(min = 0.1, max = 2.0))]
    pub half_width_m: f64,
    /// Foremost point of the robot, ahead of the point between its wheels, m.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub front_m: f64,
    /// Extra half width for points that have not been static for a second and may step in, m.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub steps_in_m: f64,
    /// Clearance to an obstacle below which the robot does not move towards it, m.
    #[schemars(range(min = 0.2, max = 2.0))]
    pub stop_m: f64,
    /// Distance beyond which obstacles are ignored, m.
    #[schemars(range(min = 0.5, max = 10.0))]
    pub range_m: f64,
    /// Height up to which points belong to the floor, m; it grows by 3 cm for each metre of
    /// distance.
    #[schemars(range(min = 0.02, max = 0.2))]
    pub floor_m: f64,
    /// Depth below the floor from which on there is a fall (a stair, a kerb), m; it grows by 3 cm
    /// for each metre of distance.
    #[schemars(range(min = 0.04, max = 0.3))]
    pub drop_m: f64,
    /// Height above which points are ignored because the robot passes below, m.
    #[schemars(range(min = 0.3, max = 3.0))]
    pub top_m: f64,
    /// Radius around the target within which points belong to it, m.
    #[schemars(range(min = 0.0, max = 0.8))]
    pub target_radius_m: f64,
    /// Number of points that make an obstacle, in a grid of 160 columns over the image.
    #[schemars(range(min = 1, max = 100))]
    pub min_points: u32,
    /// Part of the image with depth below which the camera counts as blind.
    #[schemars(range(min = 0.005, max = 1.0))]
    pub min_seen: f64,
    /// Time for which an obstacle is remembered that left the view beside the robot or below the
    /// image, s.
    #[schemars(range(min = 1.0, max = 600.0))]
    pub memory_s: f64,
    /// Further sources of obstacles: laser scanners, depth cameras, range sensors and bumpers.
    pub sources: Vec<SourceSettings>,
}

/// Sensors of obstacles that a controller has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ObstacleSource {
    /// Depth or laser. Without them nothing moves.
    #[default]
    Sensed,
    /// The robot moves without sensors of obstacles.
    None,
}

impl Default for CollisionMonitorSettings {
    fn default() -> Self {
        Self {
            obstacles: ObstacleSource::Sensed,
            half_width_m: 0.34,
            steps_in_m: 0.25,
            front_m: 0.2,
            stop_m: 0.4,
            range_m: 3.0,
            floor_m: 0.08,
            drop_m: 0.08,
            top_m: 1.5,
            target_radius_m: 0.45,
            min_points: 6,
            min_seen: 0.02,
            memory_s: 20.0,
            sources: Vec::new(),
        }
    }
}

impl CollisionMonitorSettings {
    /// Refuses a corridor that is too narrow or too short for the robot.
    ///
    /// # Errors
    /// [`Error::Settings`] names the key and the remedy.
    pub fn check(&self, robot: &RobotSettings, limiter: &CommandLimiterSettings) -> Result<()> {
        SourceSettings::check_all(&self.sources)?;
        let wheels = ("wheel_half_separation_m", robot.wheel_half_separation_m);
        at_least("half_width_m", self.half_width_m, wheels.0, wheels.1)?;
        at_least("top_m", self.top_m, "floor_m", self.floor_m)?;
        let stopping_m = limiter.stopping_m(robot.max_speed_mps) - limiter.margin_m + self.stop_m;
        if self.range_m >= stopping_m {
            return Ok(());
        }
        let speed_mps = robot.max_speed_mps;
        let why = format!(
            "must be at least {stopping_m:.2}, in which a robot at {speed_mps} m/s stops {} m before \
             an obstacle, not {}: raise it or lower `max_speed_mps` in [robot]",
            self.stop_m, self.range_m
        );
        Err(Error::setting("range_m", why))
    }

    /// Returns the number of image points that one ray of a laser scanner counts for: two rays make
    /// an obstacle, one may be dust.
    pub(super) fn ray_points(&self) -> u32 {
        self.min_points.div_ceil(2)
    }
}
