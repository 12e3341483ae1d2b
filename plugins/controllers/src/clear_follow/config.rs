use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};

settings! {
    /// Settings of the controller `clear-follow`.
    pub struct Config {
        /// Distance kept from the person, m, on the floor.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub stand_off_m: f64 = 1.4,
        /// Speed for each metre beyond the stand-off, 1/s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub range_gain_per_s: f64 = 1.0,
        /// Turning for each radian of bearing, 1/s, beside as much as the person
        /// walks around the robot.
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
        /// Looks ahead for this long, s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub horizon_s: f64 = 1.5,
        /// Radius of the robot, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub radius_m: f64 = 0.25,
        /// Wants this much room around itself, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub room_m: f64 = 0.2,
        /// Things lower than this are floor, and higher ones are passed below, m.
        pub heights_m: [f64; 2] = [0.1, 1.5],
        /// Remembers things out of sight for this long, s.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub memory_s: f64 = 5.0,
        /// Cost of having no free distance at all; a change of the speed by its whole limit costs
        /// one.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub room_weight: f64 = 2.0,
        /// Cost of another person right before the target.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub sight_weight: f64 = 0.05,
        /// Cost of a different turn rate, for each rad/s.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub turn_weight: f64 = 0.25,
    }
}

/// Above this nothing on the floor makes sense, whatever the unit.
pub(crate) const MOST: f64 = 1e6;

impl Config {
    /// Refuses numbers that cannot work.
    pub(crate) fn check(&self) -> Result<()> {
        check_settings(self)?;
        let [low, high] = self.heights_m;
        if !(0.0 <= low && low < high && high <= MOST) {
            return Err(Error::setting("heights_m", "must be two rising heights"));
        }
        Ok(())
    }
}
