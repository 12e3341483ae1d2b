use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::settings;

use crate::ReidentificationSettings;

settings! {
    /// Handling of stamps that jump.
    #[non_exhaustive]
    pub struct ClockSettings {
        /// A frame that is older than the previous one by at most this many seconds came out of
        /// order and is dropped. If it is older by more, the clock was set back, and all tracks
        /// end.
        #[schemars(range(min = 0.0))]
        pub max_back_s: f64 = 0.1,
        /// A pause longer than this, in seconds, and than three usual frame periods, is a gap:
        /// tentative tracks end.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub max_gap_s: f64 = 0.5,
        /// After a pause longer than this, in seconds, and than three usual frame periods, all
        /// tracks end.
        pub reset_gap_s: f64 = 0.9,
    }
}

settings! {
    /// Merging of detections, and of tracks, of one person.
    #[non_exhaustive]
    pub struct MergeSettings {
        /// Two detections nearer to each other on the floor than this belong to one person, m; the
        /// one with the higher score is kept.
        #[schemars(range(min = 0.0))]
        pub same_person_m: f64 = 0.25,
        /// Two detections that overlap by more than this belong to one person, unless their
        /// positions contradict it.
        #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
        pub same_person_iou: f64 = 0.5,
        /// Most detections in a frame; the ones with the lowest scores are dropped.
        #[schemars(range(min = 1))]
        pub max_detections: usize = 1024,
        /// Two tracks nearer to each other on the floor than this, m, in 3 of 5 frames belong to
        /// one person, and the older one is kept. A detection so near to a supported track starts
        /// no track; with `[births]`, neither does one near a track that is predicted there for sure.
        #[schemars(range(min = 0.0))]
        pub duplicate_m: f64 = 0.2,
        /// Most tracks at a time; the ones with the lowest scores end.
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
        /// A person is hidden if a smaller part than this is visible behind nearer people, and has
        /// left the image if a smaller part is inside.
        #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
        pub min_visible: f64 = 0.4,
        /// A person hides another one only if nearer by at least this, m ...
        #[schemars(range(min = 0.0))]
        pub min_gap_m: f64 = 0.3,
        /// ... and by at least this many standard deviations of the nearer person's range.
        #[schemars(range(min = 0.0))]
        pub min_gap_sigmas: f64 = 3.0,
        /// Width of a body, m. The detection of a half-hidden person covers the visible half, and
        /// its middle is off by up to half the width of the hidden part: its covariance is
        /// increased by that. 0: it is not.
        #[schemars(range(min = 0.0))]
        pub body_width_m: f64 = 0.0,
    }
}

settings! {
    /// New people: a detection whose track was lost starts a new track where a new person is the
    /// likelier explanation of it.
    #[non_exhaustive]
    pub struct BirthSettings {
        /// Density of new people in a frame, per m² of the floor. A track keeps a detection only if
        /// its own density at that place, which falls as the track becomes uncertain, is higher. 0:
        /// each track keeps what the associator gives it.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub inside_per_m2: f64 = 0.0,
        /// The same at the left, right and lower border of the image.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub border_per_m2: f64 = 0.0,
        /// Largest distance of a box at the border from it, in widths of the box.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub border_widths: f64 = 0.1,
        /// Part of the appearance: a factor of its log-likelihood ratio as the associator has it
        /// (`[reidentification] association_weight`).
        #[schemars(range(min = 0.0, max = 1e6))]
        pub appearance: f64 = 0.6,
    }
}

settings! {
    /// Boxes at the trunk that the depth image shows.
    #[non_exhaustive]
    pub struct SilhouetteSettings {
        /// Reported boxes are moved sideways to the middle of the trunk, where the depth image shows it, by
        /// this part of the way; a box that is not moved stands over a chest straight below the head. The
        /// place in metres, which is that of the head, stays. 0: boxes are not moved.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub weight: f64 = 0.0,
        /// Readings belong to the trunk if they are nearer or farther by at most this than its middle, m.
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
    /// A `[[detectors]]` section without its `config`.
    pub struct DetectorSettings {
        /// The plugin's name.
        pub plugin: String,
        /// Its roles: `discover`, `track`, `weigh`.
        pub roles: Vec<Role> = vec![Role::Discover],
        /// It runs on every n-th frame ...
        pub every: u32 = 1,
        /// ... starting with this one, counted from 0.
        pub offset: u32 = 0,
        /// True if its detections are verified. Off for a detector that recognises tracked people
        /// in views for which the verifiers are not made.
        pub verify: bool = true,
    }
}
