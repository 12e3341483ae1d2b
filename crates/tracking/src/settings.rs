use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::settings;

use crate::ReidentificationSettings;

settings! {
    /// Handling of stamps that jump.
    #[non_exhaustive]
    pub struct ClockSettings {
        /// Largest amount by which the stamp of a frame may be older than the previous one, s: such
        /// a frame is out of order and is dropped. If it is older by more, the clock was set back,
        /// and all tracks end.
        #[schemars(range(min = 0.0))]
        pub max_back_s: f64 = 0.1,
        /// Pause after which tentative tracks end, s; it must also exceed three usual frame
        /// periods.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub max_gap_s: f64 = 0.5,
        /// Pause after which all tracks end, s; it must also exceed three usual frame periods.
        pub reset_gap_s: f64 = 0.9,
    }
}

settings! {
    /// Merging of detections, and of tracks, of one person.
    #[non_exhaustive]
    pub struct MergeSettings {
        /// Distance on the floor below which two detections belong to one person, m; the one with
        /// the higher score is kept.
        #[schemars(range(min = 0.0))]
        pub same_person_m: f64 = 0.25,
        /// Overlap (IoU) above which two detections belong to one person, unless their positions
        /// contradict it.
        #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
        pub same_person_iou: f64 = 0.5,
        /// Largest number of detections in a frame; the ones with the lowest scores are dropped.
        #[schemars(range(min = 1))]
        pub max_detections: usize = 1024,
        /// Distance on the floor, m, below which two tracks in 3 of 5 frames belong to one person;
        /// the older one is kept. A detection this near to a supported track starts no track; with
        /// `[births]`, neither does one this near to a track whose prediction is certain.
        #[schemars(range(min = 0.0))]
        pub duplicate_m: f64 = 0.2,
        /// Largest number of tracks; the ones with the lowest scores end.
        #[schemars(range(min = 1))]
        pub max_tracks: usize = 256,
    }
}

/// Settings of the tracker itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrackerSettings {
    /// Handling of stamps that jump.
    pub clock: ClockSettings,
    /// Merging of detections, and of tracks, of one person.
    pub merge: MergeSettings,
    /// Occlusion of tracks by nearer ones.
    pub occlusion: OcclusionSettings,
    /// New people near a track that was lost.
    pub births: BirthSettings,
    /// Recognition of people by their appearance.
    pub reidentification: ReidentificationSettings,
    /// Boxes at the trunk that the depth image shows.
    pub silhouette: SilhouetteSettings,
}

settings! {
    /// Occlusion of people by nearer ones.
    #[non_exhaustive]
    pub struct OcclusionSettings {
        /// A person counts as hidden if a smaller share than this is visible behind nearer people,
        /// and as out of the image if a smaller share is inside it.
        #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
        pub min_visible: f64 = 0.4,
        /// Difference in distance from which a nearer person hides another one, m; `min_gap_sigmas`
        /// applies as well.
        #[schemars(range(min = 0.0))]
        pub min_gap_m: f64 = 0.3,
        /// The same difference in standard deviations of the nearer person's range.
        #[schemars(range(min = 0.0))]
        pub min_gap_sigmas: f64 = 3.0,
        /// Width of a body, m. The detection of a half-hidden person covers the visible half, so
        /// its centre is off by up to half the width of the hidden part, and its covariance is
        /// increased by that. 0: no increase.
        #[schemars(range(min = 0.0))]
        pub body_width_m: f64 = 0.0,
    }
}

settings! {
    /// New people near lost tracks: a detection that was associated with a lost track starts a new
    /// track if a new person is the likelier explanation.
    #[non_exhaustive]
    pub struct BirthSettings {
        /// Density of new people in a frame, per m² of the floor. A track keeps a detection only if
        /// its own density at that position, which falls as the track becomes uncertain, is higher.
        /// 0: each track keeps what the associator assigns to it.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub inside_per_m2: f64 = 0.0,
        /// The same density at the left, right and lower border of the image.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub border_per_m2: f64 = 0.0,
        /// Largest distance of a box from the border at which it counts as at the border, in widths
        /// of the box.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub border_widths: f64 = 0.1,
        /// Weight of the appearance: a factor on its log-likelihood ratio, as the associator uses
        /// it (`[reidentification] association_weight`).
        #[schemars(range(min = 0.0, max = 1e6))]
        pub appearance: f64 = 0.6,
    }
}

settings! {
    /// Boxes at the trunk that the depth image shows.
    #[non_exhaustive]
    pub struct SilhouetteSettings {
        /// Reported boxes are moved sideways towards the middle of the trunk, if the depth image
        /// shows it, by this fraction of the distance; a box that is not moved covers a chest
        /// straight below the head. The position in metres, which is that of the head, does not
        /// change. 0: boxes are not moved.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub weight: f64 = 0.0,
        /// Readings belong to the trunk if their depth differs from that of its middle by at most
        /// this, m.
        #[schemars(range(min = 0.01, max = 1.0))]
        pub trunk_m: f64 = 0.2,
    }
}

impl BirthSettings {
    /// Returns true if all tracks keep what the associator gives them.
    pub(crate) fn are_off(&self) -> bool {
        self.inside_per_m2 == 0.0 && self.border_per_m2 == 0.0
    }
}

/// Role of a detector.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Role {
    /// It finds people that are not tracked yet.
    Discover,
    /// It finds a tracked person again.
    Track,
    /// Its likelihood weighs hypothetical scenes against the image.
    Weigh,
}

settings! {
    /// Keys of a `[[detectors]]` section other than its `config`.
    pub struct DetectorSettings {
        /// The plugin's name.
        pub plugin: String,
        /// Its roles: `discover`, `track`, `weigh`.
        pub roles: Vec<Role> = vec![Role::Discover],
        /// Runs on every n-th frame.
        pub every: u32 = 1,
        /// First frame on which it runs, counted from 0.
        pub offset: u32 = 0,
        /// True if its detections are verified. Turn it off for a detector that recognises tracked
        /// people in views for which the verifiers are not made.
        pub verify: bool = true,
    }
}
