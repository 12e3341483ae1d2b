use tagalong_core::{Error, Result, settings};

use crate::RobotSettings;
use crate::collision_monitor::Braking;

settings! {
    /// Limits on the robot's motion, whatever the controller requests. The values are those that
    /// makers and users of mobile robots work with, and each has a ceiling that no config can
    /// exceed; this is not a safety function in the sense of the standards.
    #[non_exhaustive]
    pub struct CommandLimiterSettings {
        /// Largest acceleration, m/s².
        #[schemars(range(min = 0.05, max = 1.0))]
        pub max_accel_mps2: f64 = 0.5,
        /// Largest deceleration, m/s²; only an emergency stop brakes harder.
        #[schemars(range(min = 0.2, max = 2.5))]
        pub max_decel_mps2: f64 = 1.0,
        /// Largest turn rate, rad/s.
        #[schemars(range(min = 0.1, max = 2.0))]
        pub max_turn_radps: f64 = 1.5,
        /// Largest change of the turn rate, rad/s².
        #[schemars(range(min = 0.5, max = 10.0))]
        pub max_turn_accel_radps2: f64 = 4.0,
        /// Largest change of the acceleration, m/s³; only an emergency stop changes it faster.
        #[schemars(range(min = 1.0, max = 50.0))]
        pub max_jerk_mps3: f64 = 5.0,
        /// Largest change of the angular acceleration, rad/s³.
        #[schemars(range(min = 5.0, max = 500.0))]
        pub max_turn_jerk_radps3: f64 = 40.0,
        /// Lets the robot drive backwards, where no camera looks.
        pub reverse: bool = false,
        /// Delay from an image until the wheels respond to it, s; part of the stopping distance. At
        /// least `valid_s`, because the robot drives on for that time when images stop arriving.
        #[schemars(range(min = 0.1, max = 2.0))]
        pub reaction_s: f64 = 0.5,
        /// Time from the end of braking until the wheels are at rest, s; a person may come nearer
        /// meanwhile. Bases with slow motor control take some tenths of a second.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub settle_s: f64 = 0.25,
        /// Distance that remains ahead when the robot has stopped, m.
        #[schemars(range(min = 0.3, max = 2.0))]
        pub margin_m: f64 = 0.3,
        /// Validity of a command, s.
        #[schemars(range(min = 0.05, max = 0.5))]
        pub valid_s: f64 = 0.25,
        /// Gap between frames after which the speed is halved, s.
        #[schemars(range(min = 0.05, max = 0.5))]
        pub slow_after_s: f64 = 0.25,
        /// Gap between frames after which the robot stops, s.
        #[schemars(range(min = 0.1, max = 0.5))]
        pub stop_after_s: f64 = 0.5,
        /// Largest plausible speed of the odometry, m/s; a larger one is a fault until the pipeline
        /// is armed again.
        #[schemars(range(min = 0.1, max = 5.0))]
        pub max_odometry_mps: f64 = 3.0,
        /// Largest plausible turn rate of the odometry, rad/s, as `max_odometry_mps`: about one turn
        /// a second, which no mobile robot reaches.
        #[schemars(range(min = 0.5, max = 12.0))]
        pub max_odometry_radps: f64 = 6.3,
        /// Compares the odometry with the commands while the base executes them: a base that does
        /// something else, or responds too late, is a fault. Turn it off only if the odometry is
        /// not that of the base, as in a test with a recorded drive.
        pub check_response: bool = true,
        /// Time for which an enable holds unless it is repeated, s.
        #[schemars(range(min = 0.1, max = 1.0))]
        pub enable_s: f64 = 0.5,
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

    /// Returns how the robot stops on its way, if it reacts after `reaction_s` to images that are
    /// `between_s` apart.
    pub(crate) fn braking(&self, reaction_s: f64, between_s: f64) -> Braking {
        let decel = self.max_decel_mps2;
        let rise_s = decel / (2.0 * self.max_jerk_mps3);
        Braking { reaction_s, rise_s, decel, between_s, settle_s: self.settle_s }
    }

    /// Returns how a turn stops, as [`CommandLimiterSettings::braking`].
    pub(crate) fn turn_braking(&self, reaction_s: f64, between_s: f64) -> Braking {
        let decel = self.max_turn_accel_radps2;
        let rise_s = decel / (2.0 * self.max_turn_jerk_radps3);
        Braking { reaction_s, rise_s, decel, between_s, settle_s: self.settle_s }
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
        at_least("max_odometry_mps", self.max_odometry_mps, speed.0, speed.1)?;
        let turn = ("max_turn_radps", self.max_turn_radps);
        at_least("max_odometry_radps", self.max_odometry_radps, turn.0, turn.1)
    }
}

/// Refuses a value below another setting.
pub(crate) fn at_least(key: &str, value: f64, other: &str, least: f64) -> Result<()> {
    // Written as `>=` so that a value that is no number is refused.
    if value >= least {
        return Ok(());
    }
    Err(Error::setting(key, format!("must be at least {least}, as `{other}`, not {value}")))
}
