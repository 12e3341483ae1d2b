use crate::robot::RobotSettings;
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
