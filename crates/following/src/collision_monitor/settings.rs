use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{Error, Result, settings};

use super::SourceSettings;
use crate::command_limiter::at_least;
use crate::{CommandLimiterSettings, RobotSettings};

settings! {
    /// Obstacles and people for which the robot slows down and stops.
    #[non_exhaustive]
    pub struct CollisionMonitorSettings {
        /// Obstacle sensors: "sensed" (depth or laser; the robot does not move without them, or
        /// when one of them falls silent), or "none" for a controller that may drive without
        /// obstacle sensors.
        pub obstacles: ObstacleSource = ObstacleSource::Sensed,
        /// Clearance beside the footprint, m: an obstacle nearer than this to the swept area is in
        /// the way.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub side_m: f64 = 0.09,
        /// Distance from the footprint to an obstacle at which the robot stops, m.
        #[schemars(range(min = 0.15, max = 2.0))]
        pub stop_m: f64 = 0.35,
        /// Stop polygon: corners `[x, y]` in the robot frame, m. While it contains `min_points`
        /// readings, the robot neither drives nor turns. If left out, there is none.
        pub stop: Vec<[f64; 2]>,
        /// Slowdown polygon, in the same form: while it contains `min_points` readings, the robot
        /// drives and turns at `slowdown_ratio` of its speed.
        pub slowdown: Vec<[f64; 2]>,
        /// Factor on the speed while `slowdown` contains readings.
        #[schemars(range(min = 0.05, max = 1.0))]
        pub slowdown_ratio: f64 = 0.5,
        /// Keeps so much distance from people and moving objects that the robot has stopped before
        /// they can reach it; see `people_mps`.
        pub separation: bool = true,
        /// Speed of an approaching person, m/s (1.6 in ISO 13855).
        #[schemars(range(min = 0.5, max = 2.5))]
        pub people_mps: f64 = 1.6,
        /// Acceleration with which a person may start to approach, m/s².
        #[schemars(range(min = 0.5, max = 10.0))]
        pub people_accel_mps2: f64 = 2.0,
        /// Distance that remains between the footprint and a person when the robot has stopped, m.
        #[schemars(range(min = 0.05, max = 2.0))]
        pub protective_m: f64 = 0.2,
        /// Distance from the footprint to the followed person at which the robot stops, m.
        #[schemars(range(min = 0.1, max = 2.0))]
        pub followed_stop_m: f64 = 0.3,
        /// Distance beyond which people and moving objects are ignored, m.
        #[schemars(range(min = 1.0, max = 10.0))]
        pub people_range_m: f64 = 5.0,
        /// Distance beyond which obstacles are ignored, m.
        #[schemars(range(min = 0.5, max = 10.0))]
        pub range_m: f64 = 3.0,
        /// Height up to which points belong to the floor, m; it grows by 3 cm for each metre of
        /// distance.
        #[schemars(range(min = 0.02, max = 0.2))]
        pub floor_m: f64 = 0.08,
        /// Depth below the floor from which a point counts as a drop (a stair, a kerb), m; it grows
        /// by 3 cm for each metre of distance.
        #[schemars(range(min = 0.04, max = 0.3))]
        pub drop_m: f64 = 0.08,
        /// Height above which points are ignored, because the robot passes below them, m.
        #[schemars(range(min = 0.3, max = 3.0))]
        pub top_m: f64 = 1.5,
        /// Radius around the target within which points belong to the target, m.
        #[schemars(range(min = 0.0, max = 0.8))]
        pub target_radius_m: f64 = 0.45,
        /// Least number of points of an obstacle, in a grid of 160 columns over the image.
        #[schemars(range(min = 1, max = 100))]
        pub min_points: u32 = 6,
        /// Share of the image with depth below which the camera counts as blind.
        #[schemars(range(min = 0.005, max = 1.0))]
        pub min_seen: f64 = 0.02,
        /// Least share of valid readings in the part of the swept region that a sensor sees; the
        /// robot drives more slowly below twice this share, and stops below it.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub min_share: f64 = 0.3,
        /// Meaning of a laser ray without a return: "unknown" unless a camera sees the same region,
        /// or "free" for a scanner that misses nothing within its range, used alone in rooms larger
        /// than its range.
        pub no_return: NoReturn = NoReturn::Unknown,
        /// Number of consecutive new depth images, colour images or scans that equal the one before,
        /// after which the sensor counts as frozen, because real sensors have noise. An image or
        /// scan that is in several frames is new once.
        #[schemars(range(min = 2, max = 100))]
        pub identical_frames: u32 = 4,
        /// The sensors are simulated without noise: equal images do not count as frozen.
        pub noiseless: bool = false,
        /// Time for which an obstacle is remembered after it left the view, beside the robot or
        /// below the image, s.
        #[schemars(range(min = 1.0, max = 600.0))]
        pub memory_s: f64 = 20.0,
        /// Further obstacle sources: laser scanners, depth cameras, range sensors and bumpers.
        pub sources: Vec<SourceSettings>,
    }
}

/// Meaning of a laser ray without a return.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum NoReturn {
    /// Unknown: dark and shiny surfaces return nothing either.
    #[default]
    Unknown,
    /// Free.
    Free,
}

/// Obstacle sensors that a controller requires.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum ObstacleSource {
    /// Depth or laser. The robot does not move without them.
    #[default]
    Sensed,
    /// The robot moves without obstacle sensors.
    None,
}

impl CollisionMonitorSettings {
    /// Refuses distances in which the robot cannot stop, and a robot that is higher than the things
    /// that count.
    ///
    /// # Errors
    /// [`Error::Settings`] names the key and the remedy.
    pub fn check(&self, robot: &RobotSettings, limiter: &CommandLimiterSettings) -> Result<()> {
        SourceSettings::check_all(&self.sources)?;
        self.check_polygon("stop", &self.stop)?;
        self.check_polygon("slowdown", &self.slowdown)?;
        at_least("top_m", self.top_m, "height_m", robot.height_m)?;
        at_least("stop_m", self.stop_m, "side_m", self.side_m)?;
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

    fn check_polygon(&self, key: &'static str, corners: &[[f64; 2]]) -> Result<()> {
        let count = corners.len();
        if count > 0 && !(3..=64).contains(&count) {
            let why = format!("must have 3 to 64 corners [x, y], or none, not {count}");
            return Err(Error::setting(key, why));
        }
        let range_m = self.range_m;
        for [x, y] in corners {
            // Positive comparison, so that NaN is refused.
            let is_seen = x.hypot(*y) <= range_m;
            if !is_seen {
                let why = format!(
                    "has a corner at [{x}, {y}], beyond `range_m` ({range_m} m), where obstacles are \
                     ignored: move it or raise `range_m`"
                );
                return Err(Error::setting(key, why));
            }
        }
        Ok(())
    }

    /// Returns the number of image points that one ray of a laser scanner counts for: two rays make
    /// an obstacle, one may be dust.
    pub(crate) fn ray_points(&self) -> u32 {
        self.min_points.div_ceil(2)
    }
}
