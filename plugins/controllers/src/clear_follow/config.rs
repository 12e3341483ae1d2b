use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};

settings! {
    /// Settings of the controller `clear-follow`.
    pub struct Config {
        /// Distance on the floor that the robot keeps from the person, m.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub stand_off_m: f64 = 1.4,
        /// Speed per metre beyond the stand-off, 1/s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub range_gain_per_s: f64 = 1.0,
        /// Turn rate per radian of bearing, 1/s, added to the rate at which the person walks around
        /// the robot.
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
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub horizon_s: f64 = 1.5,
        /// Radius of the robot, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub radius_m: f64 = 0.25,
        /// Clearance that the plan prefers around the robot, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub room_m: f64 = 0.2,
        /// Heights between which points are obstacles, m: lower ones are floor, and the robot
        /// passes below higher ones.
        pub heights_m: [f64; 2] = [0.1, 1.5],
        /// Time for which obstacles out of view are remembered, s.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub memory_s: f64 = 5.0,
        /// Cost of having no free distance at all; a change of the speed by its whole limit has the
        /// cost one.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub room_weight: f64 = 2.0,
        /// Cost of another person directly in front of the target.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub sight_weight: f64 = 0.05,
        /// Cost of a change of the turn rate, per rad/s.
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
