use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What to do about stamps that jump.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ClockSettings {
    /// A frame that is older than the one before by at most this many seconds
    /// came out of order and is dropped; one that is older by more says that
    /// the clock was set back, and all tracks end.
    #[schemars(range(min = 0.0))]
    pub max_back_s: f64,
    /// A longer pause than this, in seconds, and than three usual frame
    /// periods, is a gap: tracks that are not confirmed end.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_gap_s: f64,
    /// After a pause that is longer than this, in seconds, and than three
    /// usual frame periods, all tracks end.
    pub reset_gap_s: f64,
}

impl Default for ClockSettings {
    fn default() -> Self {
        Self { max_back_s: 0.1, max_gap_s: 0.5, reset_gap_s: 0.9 }
    }
}

/// Which detections, and which tracks, are of one person.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MergeSettings {
    /// Two detections nearer to each other on the floor than this are of one person, m; the
    /// one with the higher score is kept.
    #[schemars(range(min = 0.0))]
    pub same_person_m: f64,
    /// Two detections that overlap by more than this are of one person, unless their
    /// positions contradict it.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub same_person_iou: f64,
    /// Most detections in a frame; the ones with the lowest scores are dropped.
    #[schemars(range(min = 1))]
    pub max_detections: usize,
    /// Two tracks that are nearer to each other on the floor than this, m, in 3 of 5 frames
    /// are of one person, and the older number is kept. A detection so near to a track that
    /// is seen starts no track.
    #[schemars(range(min = 0.0))]
    pub duplicate_m: f64,
    /// Most tracks at a time; the ones with the lowest scores end.
    #[schemars(range(min = 1))]
    pub max_tracks: usize,
}

impl Default for MergeSettings {
    fn default() -> Self {
        Self {
            same_person_m: 0.25,
            same_person_iou: 0.5,
            max_detections: 1024,
            duplicate_m: 0.2,
            max_tracks: 256,
        }
    }
}

/// The tracker's own settings.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrackerSettings {
    /// What to do about stamps that jump.
    pub clock: ClockSettings,
    /// Which detections, and which tracks, are of one person.
    pub merge: MergeSettings,
    /// Which tracks are hidden behind others.
    pub occlusion: OcclusionSettings,
}

/// Who is hidden behind whom.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OcclusionSettings {
    /// A person of whom a smaller part than this is visible behind nearer
    /// people is hidden; one of whom a smaller part is inside the image has
    /// left it.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub min_visible: f64,
    /// Only a person who is nearer by at least this hides another one, m ...
    #[schemars(range(min = 0.0))]
    pub min_gap_m: f64,
    /// ... and by at least this many standard deviations of that person's
    /// range.
    #[schemars(range(min = 0.0))]
    pub min_gap_sigmas: f64,
    /// Width of a body, m. Of somebody half hidden the half that shows is found, and its
    /// middle lies up to half the width of the hidden part aside: the sighting is widened
    /// by that. 0: it is not.
    #[schemars(range(min = 0.0))]
    pub body_width_m: f64,
}

impl Default for OcclusionSettings {
    fn default() -> Self {
        Self { min_visible: 0.4, min_gap_m: 0.3, min_gap_sigmas: 3.0, body_width_m: 0.0 }
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
