use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};

use crate::ForecastSettings;

/// Above this nothing on the floor makes sense, whatever the unit.
pub(super) const MOST: f64 = 1e6;

/// Side of the person on which the robot drives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Behind the person, facing them.
    #[default]
    Behind,
    /// To the left of the person.
    Left,
    /// To the right of the person.
    Right,
    /// Ahead of the person.
    Ahead,
}

settings! {
    /// Settings of the controller `foresee-follow`.
    pub struct Config {
        /// Side of the person on which the robot drives: "behind", "left", "right" or "ahead".
        /// Beside and ahead of the person it needs a sensor that sees them there, such as a laser
        /// scanner with a view all around.
        pub side: Side = Side::Behind,
        /// Angle of the robot's position around the person, instead of `side`: from the direction
        /// in which the person walks, degrees, positive to the left; 90 is to the left.
        #[schemars(range(min = -180.0, max = 180.0))]
        pub angle_deg: Option<f64>,
        /// Distance on the floor that the robot keeps from the person, m.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub stand_off_m: f64 = 1.4,
        /// Speed per metre of distance from where the robot should be, 1/s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub range_gain_per_s: f64 = 1.0,
        /// Turn rate per radian of bearing, 1/s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub bearing_gain_per_s: f64 = 1.0,
        /// Largest turn rate, rad/s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_turn_rate: f64 = 1.2,
        /// Largest acceleration, m/s².
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_acceleration: f64 = 0.5,
        /// Largest deceleration, m/s².
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_deceleration: f64 = 0.6,
        /// Time after which the robot stops if the person is not seen, s; it drives on for half of
        /// this time, and then slows down.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_unseen_s: f64 = 1.0,
        /// Latency from the capture of an image until the wheels respond to it, s.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub latency_s: f64 = 0.2,
        /// Planning horizon, s.
        #[schemars(range(min = 0.1, max = 20.0))]
        pub horizon_s: f64 = 4.0,
        /// Radius of the robot, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub radius_m: f64 = 0.25,
        /// Clearance that the plan prefers around the robot, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub room_m: f64 = 0.2,
        /// Distance from which the plan avoids other people, m, between their centre and that of
        /// the robot.
        #[schemars(range(min = 1e-3, max = 1e6))]
        pub people_m: f64 = 0.6,
        /// Heights between which points are obstacles, m: lower ones are floor, and the robot
        /// passes below higher ones.
        pub heights_m: [f64; 2] = [0.1, 1.5],
        /// Time for which obstacles out of view are remembered, s.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub memory_s: f64 = 5.0,
        /// Cost of having no free distance at all; a metre from the desired position around the
        /// person has the cost one.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub room_weight: f64 = 2.0,
        /// Cost of one second at the position of another person.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub people_weight: f64 = 1.0,
        /// Cost of losing sight of the person.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub sight_weight: f64 = 0.2,
        /// Cost of a turn rate that differs from that of the control law, per rad/s.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub turn_weight: f64 = 0.25,
        /// Motion that is expected of people.
        pub forecast: ForecastSettings,
    }
}

impl Config {
    /// Refuses numbers that cannot work.
    pub(super) fn check(&self) -> Result<()> {
        check_settings(self)?;
        let [low, high] = self.heights_m;
        if !(0.0 <= low && low < high && high <= MOST) {
            return Err(Error::setting("heights_m", "must be two rising heights"));
        }
        Ok(())
    }

    /// Returns the angle of the place from the direction in which the person walks, rad; `None` for a
    /// robot that goes behind the person and faces them.
    pub(super) fn angle_rad(&self) -> Option<f64> {
        if let Some(angle_deg) = self.angle_deg {
            return Some(angle_deg.to_radians());
        }
        match self.side {
            Side::Behind => None,
            Side::Left => Some(90_f64.to_radians()),
            Side::Right => Some(-90_f64.to_radians()),
            Side::Ahead => Some(0.0),
        }
    }
}
