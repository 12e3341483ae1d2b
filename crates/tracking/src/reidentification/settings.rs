use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::settings;

/// Log-likelihood ratio of a difference between two appearances, for the associator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum AppearanceEvidence {
    /// 1 for equal appearances; it falls with the difference to 0 at `max_difference`, and not
    /// below -1.
    #[default]
    Linear,
    /// Below `max_difference` the log-odds of 1 minus half the difference, and 0 from there on, as
    /// in BoT-SORT (N. Aharon et al., arXiv 2206.14651, section 3.3).
    HalfDistance,
}

settings! {
    /// Recognition of people by their appearance: a person whose track ended keeps their ID when
    /// another track starts, and so do two people who passed each other.
    #[non_exhaustive]
    pub struct ReidentificationSettings {
        /// Time for which a person without a track is remembered, s. 0: each track has an ID of its
        /// own.
        #[schemars(range(min = 0.0))]
        pub remember_s: f64 = 0.0,
        /// Largest difference between two appearances of one person: the mean of the Hellinger
        /// distances of the visible parts, or 1 minus the cosine of the embeddings of
        /// `[appearance]`.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub max_difference: f64 = 0.3,
        /// Margin by which the difference of every other remembered person must be larger.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub margin: f64 = 0.06,
        /// Largest difference between the heights of the head, m.
        #[schemars(range(min = 0.0))]
        pub max_height_m: f64 = 0.15,
        /// Speed above which a person cannot have reached the start of a track, m/s.
        #[schemars(range(min = 0.0))]
        pub max_speed_mps: f64 = 3.0,
        /// Acceleration above which a person cannot have reached the start of a track, m/s²: one
        /// who walked out of the image is not at the other end of the room soon after. A value as
        /// large as 1,000 excludes nothing.
        #[schemars(range(min = 0.0))]
        pub max_acceleration_mps2: f64 = 1e3,
        /// Time after its start in which a track may take over an ID, s.
        #[schemars(range(min = 0.0))]
        pub decide_s: f64 = 2.0,
        /// Distance below which two tracks may swap their people, m; they are compared after they
        /// part.
        #[schemars(range(min = 0.0))]
        pub alone_m: f64 = 0.6,
        /// Weight of the appearance in the association, which then prefers a detection that looks
        /// like the person of a track: a factor on `association_evidence`. With `linear` it is the
        /// log-likelihood ratio of equal appearances; with `half-distance` a weight of 1 is
        /// BoT-SORT. 0: positions alone decide.
        #[schemars(range(min = 0.0, max = 100.0))]
        pub association_weight: f64 = 0.0,
        /// Log-likelihood ratio of a difference in appearance: `linear` or `half-distance`.
        pub association_evidence: AppearanceEvidence = AppearanceEvidence::Linear,
        /// Number of appearances with which tracks are compared after they parted.
        #[schemars(range(min = 1))]
        pub appearances: u32 = 2,
    }
}

/// Least difference of two appearances in `half-distance`, so that equal ones are not certain beyond
/// all places: odds of 2,000 to 1.
const LEAST_DIFFERENCE: f64 = 1e-3;

impl AppearanceEvidence {
    /// Returns the log-likelihood ratio of two appearances with this difference between them.
    pub(crate) fn log_ratio(self, difference: f64, max_difference: f64) -> f64 {
        match self {
            Self::Linear => (1.0 - difference / max_difference.max(1e-3)).max(-1.0),
            Self::HalfDistance if difference < max_difference => {
                let difference = difference.max(LEAST_DIFFERENCE);
                ((2.0 - difference) / difference).ln()
            }
            Self::HalfDistance => 0.0,
        }
    }
}
