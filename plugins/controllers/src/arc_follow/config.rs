use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};

/// Path to the target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Path {
    /// The circle that leaves along the robot's heading and meets the target.
    A,
    /// Turns in place until the robot faces the target, then drives straight.
    B,
    /// Turns towards the target while driving: the radius of the circle is divided by `path_gain`.
    C,
}

settings! {
    /// Settings of the controller `arc-follow`.
    pub struct Config {
        /// Path to the target: "A" on a circle, "B" first a turn and then straight, "C" turns while
        /// driving.
        pub path: Path = Path::C,
        /// Divisor of the radius of the circle on path C, without unit: 1.5 to 2.5 for usual fields
        /// of view.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub path_gain: f64 = 2.0,
        /// Distance on the floor that the robot keeps from the person, m.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub stand_off_m: f64 = 1.4,
        /// Speed per metre beyond the stand-off, 1/s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub range_gain_per_s: f64 = 0.8,
        /// Largest acceleration, m/s².
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_acceleration: f64 = 0.5,
        /// Largest deceleration, m/s².
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_deceleration: f64 = 1.0,
        /// Turn rate per radian of bearing while the robot is at rest, 1/s; it decreases as the
        /// robot drives faster.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub bearing_gain_per_s: f64 = 1.0,
        /// Largest turn rate, rad/s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_turn_rate: f64 = 1.2,
        /// Largest curvature of the path, 1/m.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub max_curvature: f64 = 3.0,
        /// Least distance with which the steering computes, m: a nearer target steers as if it were
        /// this far away.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub min_range_m: f64 = 0.5,
        /// Bearings below which a turn in place ends and above which it starts, on paths A and C,
        /// degrees.
        pub turn_in_place_deg: [f64; 2] = [30.0, 60.0],
        /// The same for path B, which has no other way to steer, degrees.
        pub align_deg: [f64; 2] = [3.0, 12.0],
        /// Distance ahead, m, of the point on the person's trail to which the robot steers, instead
        /// of straight to the person: through the middle of doors and round corners. 0: off.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub trail_m: f64 = 0.0,
        /// Time after which the robot stops if the person is not seen, s; it drives on for half of
        /// this time, and then slows down.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_unseen_s: f64 = 1.0,
        /// Latency from the capture of an image until the wheels respond to it, s: the target is
        /// predicted over this time.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub latency_s: f64 = 0.1,
    }
}

/// Above this nothing on the floor makes sense, whatever the unit.
pub(crate) const MOST: f64 = 1e6;

impl Config {
    /// Refuses numbers that cannot work.
    pub(crate) fn check(&self) -> Result<()> {
        check_settings(self)?;
        let angles = [("turn_in_place_deg", self.turn_in_place_deg), ("align_deg", self.align_deg)];
        for (key, [off, on]) in angles {
            if !(0.0 < off && off <= on && on < 180.0) {
                return Err(Error::setting(key, "must be two rising angles between 0 and 180"));
            }
        }
        Ok(())
    }

    /// Returns the divisor of the radius: path A is path C with a gain of one; path B drives
    /// straight.
    pub(crate) fn gain(&self) -> f64 {
        match self.path {
            Path::A => 1.0,
            Path::B => 0.0,
            Path::C => self.path_gain,
        }
    }

    /// Bearings at which turning on the spot ends and begins, rad.
    pub(crate) fn turning_bounds(&self) -> [f64; 2] {
        let degrees = if self.path == Path::B { self.align_deg } else { self.turn_in_place_deg };
        degrees.map(f64::to_radians)
    }
}
