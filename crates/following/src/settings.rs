use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::DiffDrive;

use crate::{CollisionMonitorSettings, CommandLimiterSettings, TargetSettings};

/// Settings of the steering.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FollowSettings {
    /// The robot's drive.
    pub robot: RobotSettings,
    /// Limits of the commands.
    pub command_limiter: CommandLimiterSettings,
    /// Obstacles ahead that stop the robot.
    pub collision_monitor: CollisionMonitorSettings,
    /// Target lock and search.
    pub target: TargetSettings,
}

/// Drive of the robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RobotSettings {
    /// Half the distance between the driven wheels, m.
    #[schemars(range(min = 0.05, max = 1.0))]
    pub wheel_half_separation_m: f64,
    /// Standard deviation of a wheel's travel, as a fraction of it.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub wheel_slip: f64,
    /// Speed limit of a wheel, m/s.
    #[schemars(range(min = 0.05, max = 0.9))]
    pub max_speed_mps: f64,
    /// Source of the robot's motion: "required", or "none" for a controller that is to drive without
    /// odometry, as if the robot were always at rest.
    pub odometry: OdometrySource,
}

/// Source of the robot's motion that a controller has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum OdometrySource {
    /// Without odometry nothing moves.
    #[default]
    Required,
    /// The robot moves without odometry.
    None,
}

impl Default for RobotSettings {
    fn default() -> Self {
        Self {
            wheel_half_separation_m: 0.167,
            wheel_slip: 0.02,
            max_speed_mps: 0.9,
            odometry: OdometrySource::Required,
        }
    }
}

impl RobotSettings {
    /// Returns the drive as the type of the core crate.
    pub fn wheels(&self) -> DiffDrive {
        DiffDrive { half_separation_m: self.wheel_half_separation_m, slip: self.wheel_slip }
    }
}
