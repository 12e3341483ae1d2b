use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{Error, Result, settings};

use super::SourceSettings;
use crate::command_limiter::at_least;
use crate::{CommandLimiterSettings, RobotSettings};

settings! {
    /// Obstacles and people before which the robot slows down and stops.
    #[non_exhaustive]
    pub struct CollisionMonitorSettings {
        /// Sensors of obstacles: "sensed" (depth or laser; without them, or when one of them falls
        /// silent, nothing moves), or "none" for a controller that is to drive without eyes for
        /// obstacles.
        pub obstacles: ObstacleSource = ObstacleSource::Sensed,
        /// Clearance beside the footprint, m: a thing that is nearer to the swept area is in the
        /// way.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub side_m: f64 = 0.09,
        /// Distance of the footprint from an obstacle at which the robot stops before it, m.
        #[schemars(range(min = 0.15, max = 2.0))]
        pub stop_m: f64 = 0.35,
        /// Stop polygon: corners `[x, y]` in the robot frame, m. While `min_points` readings are
        /// inside, the robot neither drives nor turns. Left out, there is none.
        pub stop: Vec<[f64; 2]>,
        /// Slowdown polygon, in the same form: while `min_points` readings are inside, the robot
        /// drives and turns at `slowdown_ratio` of its speed.
        pub slowdown: Vec<[f64; 2]>,
        /// Factor of the speed while something is inside `slowdown`.
        #[schemars(range(min = 0.05, max = 1.0))]
        pub slowdown_ratio: f64 = 0.5,
        /// Keeps away from people, and from things that move, so far that the robot stands before
        /// they can reach it; see `people_mps`.
        pub separation: bool = true,
        /// Speed of an approaching person, m/s (1.6 in ISO 13855).
        #[schemars(range(min = 0.5, max = 2.5))]
        pub people_mps: f64 = 1.6,
        /// Acceleration with which a person may begin to come nearer, m/s².
        #[schemars(range(min = 0.5, max = 10.0))]
        pub people_accel_mps2: f64 = 2.0,
        /// Distance that is left between the footprint and a person when the robot stands, m.
        #[schemars(range(min = 0.05, max = 2.0))]
        pub protective_m: f64 = 0.2,
        /// Distance of the footprint from the followed person at which the robot stops, m.
        #[schemars(range(min = 0.1, max = 2.0))]
        pub followed_stop_m: f64 = 0.3,
        /// Distance beyond which people and things that move are ignored, m.
        #[schemars(range(min = 1.0, max = 10.0))]
        pub people_range_m: f64 = 5.0,
        /// Distance beyond which obstacles are ignored, m.
        #[schemars(range(min = 0.5, max = 10.0))]
        pub range_m: f64 = 3.0,
        /// Height up to which points belong to the floor, m; it grows by 3 cm for each metre of
        /// distance.
        #[schemars(range(min = 0.02, max = 0.2))]
        pub floor_m: f64 = 0.08,
        /// Depth below the floor from which on there is a fall (a stair, a kerb), m; it grows by 3
        /// cm for each metre of distance.
        #[schemars(range(min = 0.04, max = 0.3))]
        pub drop_m: f64 = 0.08,
        /// Height above which points are ignored because the robot passes below, m.
        #[schemars(range(min = 0.3, max = 3.0))]
        pub top_m: f64 = 1.5,
        /// Radius around the target within which points belong to it, m.
        #[schemars(range(min = 0.0, max = 0.8))]
        pub target_radius_m: f64 = 0.45,
        /// Number of points that make an obstacle, in a grid of 160 columns over the image.
        #[schemars(range(min = 1, max = 100))]
        pub min_points: u32 = 6,
        /// Part of the image with depth below which the camera counts as blind.
        #[schemars(range(min = 0.005, max = 1.0))]
        pub min_seen: f64 = 0.02,
        /// Least share of valid readings of a sensor in the part of the swept region that it sees;
        /// the robot is slower below twice this share, and stands below it.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub min_share: f64 = 0.3,
        /// Meaning of a laser ray from which nothing came back: "unknown" unless a camera sees the
        /// same region, or "free" for a scanner that misses nothing within its range, alone in
        /// rooms that are larger than that.
        pub no_return: NoReturn = NoReturn::Unknown,
        /// Number of new depth images or scans in a row that repeat the one before, after which the
        /// sensor counts as frozen: real ones have noise. One that comes with several frames is new
        /// once.
        #[schemars(range(min = 2, max = 100))]
        pub identical_frames: u32 = 4,
        /// The sensors are simulated without noise: equal images are not taken to be frozen.
        pub noiseless: bool = false,
        /// Time for which an obstacle is remembered that left the view beside the robot or below
        /// the image, s.
        #[schemars(range(min = 1.0, max = 600.0))]
        pub memory_s: f64 = 20.0,
        /// Further sources of obstacles: laser scanners, depth cameras, range sensors and bumpers.
        pub sources: Vec<SourceSettings>,
    }
}

/// Meaning of a laser ray without a reflection.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum NoReturn {
    /// Nothing is known: a dark or shiny surface reflects nothing either.
    #[default]
    Unknown,
    /// Nothing is there.
    Free,
}

/// Sensors of obstacles that a controller has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum ObstacleSource {
    /// Depth or laser. Without them nothing moves.
    #[default]
    Sensed,
    /// The robot moves without sensors of obstacles.
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
