use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::Input;
use tagalong_following::{
    CollisionMonitorSettings, CommandLimiterSettings, FollowSettings, RobotSettings, TargetSettings,
};
use tagalong_stereo::StereoSettings;
use tagalong_vision::odometry::OdometrySettings;

use crate::AppearanceSettings;

use tagalong_tracking::{
    BirthSettings, ClockSettings, MergeSettings, OcclusionSettings, ReidentificationSettings,
    SilhouetteSettings, TrackerSettings,
};

/// Keys of the pipeline itself. A config also has the plugin sections `[[detectors]]`,
/// `[[verifiers]]`, `[associator]`, `[filter]`, `[manager]` and `[controller]`, each with the name
/// of a `plugin` and its settings in the sub-table `config`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct PipelineSettings {
    /// Seed of all random numbers. The same log, config and seed give the same bytes.
    pub seed: u64,
    /// Inputs that the pipeline ignores, even where the log has them: `colour`, `depth`, `right`,
    /// `laser`, `detections`.
    pub without: Vec<Input>,
    /// The robot.
    pub robot: RobotSettings,
    /// Depth from a stereo pair, for frames that have none. If left out, the log must carry depth,
    /// or no plugin may need it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stereo: Option<StereoSettings>,
    /// Odometry corrected by static structure in the images, or from the images alone. If left out,
    /// the odometry of the log is used unchanged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub odometry: Option<OdometrySettings>,
    /// Handling of stamps that jump.
    pub clock: ClockSettings,
    /// Merging of detections, and of tracks, of one person.
    pub merge: MergeSettings,
    /// Occlusion of people by nearer ones.
    pub occlusion: OcclusionSettings,
    /// New people near lost tracks.
    pub births: BirthSettings,
    /// Network that describes people by their appearance.
    pub appearance: AppearanceSettings,
    /// Recognition of people by their appearance.
    pub reidentification: ReidentificationSettings,
    /// Reported boxes at the trunk that the depth image shows.
    pub silhouette: SilhouetteSettings,
    /// Choice and confirmation of the person to follow.
    pub target: TargetSettings,
    /// Limits on the robot's motion, whatever the controller requests.
    pub command_limiter: CommandLimiterSettings,
    /// Obstacles and people for which the robot slows down and stops.
    pub collision_monitor: CollisionMonitorSettings,
}

impl PipelineSettings {
    /// Returns the settings of the steering.
    pub(crate) fn following(&self) -> FollowSettings {
        let Self { robot, command_limiter, collision_monitor, target, .. } = self.clone();
        FollowSettings { robot, command_limiter, collision_monitor, target }
    }

    /// Returns the settings of the tracker.
    pub(crate) fn tracker(&self) -> TrackerSettings {
        let Self { clock, merge, occlusion, births, reidentification, silhouette, .. } =
            self.clone();
        TrackerSettings { clock, merge, occlusion, births, reidentification, silhouette }
    }
}

/// Keys of a `[[verifiers]]`, `[associator]`, `[filter]`, `[manager]` or `[controller]` section
/// other than its `config`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct PluginSettings {
    /// The plugin's name.
    pub plugin: String,
}
