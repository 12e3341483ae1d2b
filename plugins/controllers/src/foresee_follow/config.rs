use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};

use crate::ForecastSettings;

/// Above this nothing on the floor makes sense, whatever the unit.
pub(super) const MOST: f64 = 1e6;

/// Side of a person on which the robot goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Behind the person, facing them.
    #[default]
    Behind,
    /// At the left of the person.
    Left,
    /// At the right of the person.
    Right,
    /// Ahead of the person.
    Ahead,
}

settings! {
    /// Settings of the controller `foresee-follow`.
    pub struct Config {
        /// Side of the person on which the robot goes: "behind", "left", "right" or "ahead". Beside
        /// and ahead of a person it needs a sensor that sees them there, as a laser scanner all
        /// around does.
        pub side: Side = Side::Behind,
        /// Place beside the person by its angle instead: from the direction in which the person
        /// walks, degrees, positive to the left; 90 is at the left.
        #[schemars(range(min = -180.0, max = 180.0))]
        pub angle_deg: Option<f64>,
        /// Distance kept from the person, m, on the floor.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub stand_off_m: f64 = 1.4,
        /// Speed for each metre of distance from where the robot should be, 1/s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub range_gain_per_s: f64 = 1.0,
        /// Turning for each radian of bearing, 1/s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub bearing_gain_per_s: f64 = 1.0,
        /// Turns no faster than this, rad/s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_turn_rate: f64 = 1.2,
        /// Speeds up by at most this much, m/s².
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_acceleration: f64 = 0.5,
        /// Slows down by at most this much, m/s².
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_deceleration: f64 = 0.6,
        /// Drives after a person that is not seen for half of this time, then slows down, and
        /// stands still at the end of it, s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_unseen_s: f64 = 1.0,
        /// From the capture of an image until the wheels answer to it, s.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub latency_s: f64 = 0.2,
        /// Plans this long ahead, s.
        #[schemars(range(min = 0.1, max = 20.0))]
        pub horizon_s: f64 = 4.0,
        /// Radius of the robot, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub radius_m: f64 = 0.25,
        /// Wants this much room around itself, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub room_m: f64 = 0.2,
        /// Distance at which it minds other people, m, between their middle and its own.
        #[schemars(range(min = 1e-3, max = 1e6))]
        pub people_m: f64 = 0.6,
        /// Things lower than this are floor, and higher ones are passed below, m.
        pub heights_m: [f64; 2] = [0.1, 1.5],
        /// Remembers things out of sight for this long, s.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub memory_s: f64 = 5.0,
        /// Cost of having no free distance at all; a metre off the place beside the person costs
        /// one.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub room_weight: f64 = 2.0,
        /// Cost of a second at the place of another person.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub people_weight: f64 = 1.0,
        /// Cost of a person that is hidden.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub sight_weight: f64 = 0.2,
        /// Cost of another turn rate than that of the law, for each rad/s.
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
