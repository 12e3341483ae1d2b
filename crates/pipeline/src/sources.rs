use tagalong_config::ConfigError;
use tagalong_following::{ObstacleSource, OdometrySource};

use crate::Pipeline;

/// Data that a frame source has for a controller, beside that of the tracker.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sources {
    /// Depth images.
    pub depth: bool,
    /// Right images of a stereo pair.
    pub right: bool,
    /// Scans of a laser.
    pub laser: bool,
    /// Motion of the robot.
    pub odometry: bool,
}

/// A controller is to drive without a source that it needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MissingSource {
    /// Nothing shows obstacles.
    #[error(
        "the controller has no sensor of obstacles: there is neither depth nor a laser scan that the \
         pipeline uses; add one; or leave the controller out, by `plugin = \"none\"` in [controller]; or, \
         for a robot that is to drive without eyes, set `obstacles = \"none\"` in [collision_monitor]"
    )]
    Obstacles,
    /// Nothing shows the robot's motion.
    #[error(
        "the controller has no odometry: add a topic of it or a transform from the odometry frame to \
         the robot; or leave the controller out, by `plugin = \"none\"` in [controller]; or, for a robot \
         that is to drive without, set `odometry = \"none\"` in [robot]"
    )]
    Odometry,
}

impl Pipeline {
    /// Refuses a frame source without the data that the controller needs, unless the config does
    /// without in so many words. A pipeline without a controller takes every source.
    ///
    /// # Errors
    /// [`MissingSource`], with the remedy.
    pub fn check_sources(&self, sources: Sources) -> Result<(), MissingSource> {
        if !self.has_controller() {
            return Ok(());
        }
        let needs_eyes = self.settings.collision_monitor.obstacles == ObstacleSource::Sensed;
        let from_pair = sources.right && self.settings.stereo.is_some();
        if needs_eyes && !(sources.depth || from_pair || sources.laser) {
            return Err(MissingSource::Obstacles);
        }
        let needs_odometry = self.settings.robot.odometry == OdometrySource::Required;
        if needs_odometry && !sources.odometry {
            return Err(MissingSource::Odometry);
        }
        Ok(())
    }

    /// Leaves the controller out, to track the people of a source without the data that it needs.
    ///
    /// # Errors
    /// A config that cannot be written as TOML any more.
    pub fn without_controller(mut self) -> Result<Self, ConfigError> {
        self.steering = None;
        self.config.remove("controller")?;
        Ok(self)
    }
}
