use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{Input, Wheels};
use tagalong_odometry::OdometrySettings;
use tagalong_stereo::StereoSettings;

use tagalong_tracking::{ClockSettings, MergeSettings, OcclusionSettings, TrackerSettings};

use crate::{GovernorSettings, TargetSettings};

/// The pipeline's own keys. Beside them a config has the plugin sections
/// `[[detectors]]`, `[[verifiers]]`, `[filter]` and `[controller]`, each with
/// the name of a `plugin` and its settings in the sub-table `config`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PipelineSettings {
    /// Seed of everything random. The same log, config and seed give the same
    /// bytes.
    pub seed: u64,
    /// Inputs that the pipeline does without, even where the log has them: `colour`,
    /// `depth`, `right`, `laser`, `detections`.
    pub without: Vec<Input>,
    /// The robot.
    pub robot: RobotSettings,
    /// Depth from a stereo pair, for frames that have none. Left out: the log
    /// carries depth, or nobody needs it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stereo: Option<StereoSettings>,
    /// Odometry that is corrected by what stands still in the images. Left out: the
    /// odometry of the log is believed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub odometry: Option<OdometrySettings>,
    /// What to do about stamps that jump.
    pub clock: ClockSettings,
    /// Which detections, and which tracks, are of one person.
    pub merge: MergeSettings,
    /// Who is hidden behind whom.
    pub occlusion: OcclusionSettings,
    /// Who is followed.
    pub target: TargetSettings,
    /// What the robot may do, whatever the controller wishes.
    pub governor: GovernorSettings,
}

impl PipelineSettings {
    /// Returns the settings of the tracker.
    pub(crate) fn tracker(&self) -> TrackerSettings {
        let Self { clock, merge, occlusion, .. } = self.clone();
        TrackerSettings { clock, merge, occlusion }
    }
}

/// The robot's drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RobotSettings {
    /// Half the distance between the driven wheels, m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub wheel_half_separation_m: f64,
    /// Standard deviation of a wheel's travel, as a fraction of it.
    #[schemars(range(min = 0.0))]
    pub wheel_slip: f64,
    /// Speed limit of a wheel, m/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_speed_mps: f64,
}

impl Default for RobotSettings {
    fn default() -> Self {
        Self { wheel_half_separation_m: 0.167, wheel_slip: 0.02, max_speed_mps: 0.9 }
    }
}

impl RobotSettings {
    /// The drive in the words of core.
    pub fn wheels(&self) -> Wheels {
        Wheels { half_separation_m: self.wheel_half_separation_m, slip: self.wheel_slip }
    }
}

/// A `[[verifiers]]`, `[filter]` or `[controller]` section without its `config`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PluginSettings {
    /// The plugin's name.
    pub plugin: String,
}
