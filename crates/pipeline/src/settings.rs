use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{Input, Wheels};
use tagalong_odometry::OdometrySettings;
use tagalong_stereo::StereoSettings;

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
    /// Which detection belongs to which track.
    pub association: AssociationSettings,
    /// Who is hidden behind whom.
    pub occlusion: OcclusionSettings,
    /// When tracks start, count as confirmed, and end.
    pub lifecycle: LifecycleSettings,
    /// Who is followed.
    pub target: TargetSettings,
    /// What the robot may do, whatever the controller wishes.
    pub governor: GovernorSettings,
}

/// The robot's drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RobotSettings {
    /// Half the distance between the driven wheels, m.
    pub wheel_half_separation_m: f64,
    /// Standard deviation of a wheel's travel, as a fraction of it.
    pub wheel_slip: f64,
    /// Speed limit of a wheel, m/s.
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

/// What to do about stamps that jump.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ClockSettings {
    /// A frame that is older than the one before by at most this many seconds
    /// came out of order and is dropped; one that is older by more says that
    /// the clock was set back, and all tracks end.
    pub max_back_s: f64,
    /// A longer pause than this, in seconds, and than three usual frame
    /// periods, is a gap: tracks that are not confirmed end.
    pub max_gap_s: f64,
    /// After a pause that is longer than this, in seconds, and than three
    /// usual frame periods, all tracks end.
    pub reset_gap_s: f64,
}

impl Default for ClockSettings {
    fn default() -> Self {
        Self { max_back_s: 0.1, max_gap_s: 0.5, reset_gap_s: 5.0 }
    }
}

/// What makes a detection and a track fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Cost {
    /// Distance in the robot frame, in units of its uncertainty.
    #[default]
    Mahalanobis,
    /// Overlap of the regions in the image.
    Overlap,
}

/// How overlap is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Overlap {
    /// Intersection over union.
    #[default]
    Iou,
    /// Twice the intersection over the sum of the areas.
    Dice,
}

/// Which detection belongs to which track.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AssociationSettings {
    /// `mahalanobis` (metres) or `overlap` (pixels).
    pub cost: Cost,
    /// Mahalanobis: largest squared distance. 11.34 is the 99 % point of
    /// chi-squared with 3 degrees of freedom.
    pub gate: f64,
    /// Mahalanobis: largest distance on the floor, m, between frames that are
    /// close in time ...
    pub gate_m: f64,
    /// ... and by how much it grows with the time between them, m/s.
    pub gate_speed_mps: f64,
    /// Overlap: smallest overlap.
    pub min_overlap: f64,
    /// Overlap: `iou` or `dice`.
    pub overlap: Overlap,
    /// Overlap, as P2 prints it (eq. 10): a pair that overlaps less costs nothing, and
    /// so comes first.
    pub compat_printed_cost: bool,
    /// What it costs to leave a track without a detection, as a multiple of
    /// the cost at the gate.
    pub miss_factor: f64,
    /// Two sightings nearer to each other on the floor than this are of one
    /// person, m; the better one is kept.
    pub same_person_m: f64,
    /// Two sightings that overlap by more than this are of one person, unless
    /// their positions contradict it.
    pub same_person_iou: f64,
    /// Most detections in a frame; the ones with the lowest scores are dropped.
    pub max_detections: usize,
}

impl Default for AssociationSettings {
    fn default() -> Self {
        Self {
            cost: Cost::Mahalanobis,
            gate: 11.34,
            gate_m: 1.0,
            gate_speed_mps: 1.5,
            min_overlap: 0.3,
            overlap: Overlap::Iou,
            compat_printed_cost: false,
            miss_factor: 1.0,
            same_person_m: 0.25,
            same_person_iou: 0.5,
            max_detections: 1024,
        }
    }
}

/// Who is hidden behind whom.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OcclusionSettings {
    /// A person of whom a smaller part than this is visible behind nearer
    /// people is hidden; one of whom a smaller part is inside the image has
    /// left it.
    pub min_visible: f64,
    /// Only a person who is nearer by at least this hides another one, m ...
    pub min_gap_m: f64,
    /// ... and by at least this many standard deviations of that person's
    /// range.
    pub min_gap_sigmas: f64,
    /// Width of a body, m. Of somebody half hidden the half that shows is found, and its
    /// middle lies up to half the width of the hidden part aside: the sighting is widened
    /// by that. 0: it is not.
    pub body_width_m: f64,
}

impl Default for OcclusionSettings {
    fn default() -> Self {
        Self { min_visible: 0.4, min_gap_m: 0.3, min_gap_sigmas: 3.0, body_width_m: 0.0 }
    }
}

/// When tracks start, count as confirmed, and end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LifecycleSettings {
    /// A detection that belongs to no track starts one from this score on
    /// (log-odds, verifiers included).
    pub start_score: f64,
    /// Newcomers who were rejected at the same place count, too, and are forgotten
    /// with this time constant, s; 0: each newcomer is judged alone.
    pub doubt_s: f64,
    /// A place is the same within this, m.
    pub doubt_m: f64,
    /// No place is doubted more than this, log-odds.
    pub doubt_limit: f64,
    /// A track is confirmed when it was seen this often ...
    pub confirm_hits: u32,
    /// ... in so many frames in which it could have been seen (at most 32), ...
    pub confirm_within: u32,
    /// ... or at once by a detection with at least this score.
    pub confirm_score: f64,
    /// A track that is not confirmed ends after this many misses in a row.
    pub tentative_misses: u32,
    /// A track ends when it should have been visible and was not seen for
    /// longer than this, s, ...
    pub drop_after_s: f64,
    /// ... and missed at least this often in a row.
    pub drop_after_misses: u32,
    /// A track that left the image ends when it was not seen for longer, s.
    pub left_drop_after_s: f64,
    /// A track that is hidden behind another one ends when it was not seen for
    /// longer, s.
    pub occluded_drop_after_s: f64,
    /// Weight of a frame in the score of a track, 0 to 1.
    pub score_weight: f64,
    /// What a miss says: the score that a track tends to while it should be
    /// visible and is not.
    pub miss_score: f64,
    /// A track with a lower score ends. It takes several doubtful sightings
    /// to get there.
    pub drop_score: f64,
    /// Two tracks that are nearer to each other on the floor than this, m, in
    /// 3 of 5 frames are of one person; the older number is kept.
    pub duplicate_m: f64,
    /// Most tracks at a time; the ones with the lowest scores end.
    pub max_tracks: usize,
}

impl Default for LifecycleSettings {
    fn default() -> Self {
        Self {
            start_score: 0.0,
            doubt_s: 0.0,
            doubt_m: 0.3,
            doubt_limit: 6.0,
            confirm_hits: 3,
            confirm_within: 5,
            confirm_score: 4.0,
            tentative_misses: 2,
            drop_after_s: 1.0,
            drop_after_misses: 3,
            left_drop_after_s: 2.0,
            occluded_drop_after_s: 3.0,
            score_weight: 0.3,
            miss_score: -1.0,
            drop_score: -2.0,
            duplicate_m: 0.2,
            max_tracks: 256,
        }
    }
}

/// What a detector is used for.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Who is here that is not known yet?
    Discover,
    /// Where is this one now?
    Follow,
    /// How well does an imagined scene explain the image?
    Weigh,
}

/// A `[[detectors]]` section without its `config`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DetectorSettings {
    /// The plugin's name.
    pub plugin: String,
    /// What it is used for: `discover`, `follow`, `weigh`.
    pub roles: Vec<Role>,
    /// It works on every n-th frame ...
    pub every: u32,
    /// ... starting with this one, counted from 0.
    pub offset: u32,
    /// Verifiers are asked about its sightings. Off for a detector that knows somebody
    /// again where verifiers cannot look.
    pub verify: bool,
}

impl Default for DetectorSettings {
    fn default() -> Self {
        Self {
            plugin: String::new(),
            roles: vec![Role::Discover],
            every: 1,
            offset: 0,
            verify: true,
        }
    }
}

/// A `[[verifiers]]`, `[filter]` or `[controller]` section without its `config`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PluginSettings {
    /// The plugin's name.
    pub plugin: String,
}
