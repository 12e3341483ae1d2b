use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::settings;

/// Log-likelihood ratio that a difference of two appearances amounts to, for the associator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum AppearanceEvidence {
    /// 1 for equal appearances, falling with the difference to 0 at `max_difference`, and to no less
    /// than -1.
    #[default]
    Linear,
    /// The log-odds of 1 minus half the difference below `max_difference`, and 0 from there on: as
    /// in BoT-SORT (N. Aharon et al., arXiv 2206.14651, section 3.3).
    HalfDistance,
}

settings! {
    /// Recognition of people by their appearance: a person whose track ended keeps the number when
    /// another track starts, and two people who passed each other are told apart.
    #[non_exhaustive]
    pub struct ReidentificationSettings {
        /// Time for which a person without a track is remembered, s. 0: each track has a number of
        /// its own.
        #[schemars(range(min = 0.0))]
        pub remember_s: f64 = 0.0,
        /// Largest difference of two appearances of one person: the mean of the Hellinger distances
        /// of the visible parts, or 1 minus the cosine of the vectors of `[appearance]`.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub max_difference: f64 = 0.3,
        /// Every other remembered person must differ by this much more.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub margin: f64 = 0.06,
        /// Largest difference of the heights of the head, m.
        #[schemars(range(min = 0.0))]
        pub max_height_m: f64 = 0.15,
        /// Speed beyond which a person cannot have got to where a track starts, m/s.
        #[schemars(range(min = 0.0))]
        pub max_speed_mps: f64 = 3.0,
        /// Acceleration beyond which a person cannot have turned to where a track starts, m/s²: one
        /// who walked out of the image is not at the other end of the room soon after. As large as
        /// 1,000 it excludes nothing.
        #[schemars(range(min = 0.0))]
        pub max_acceleration_mps2: f64 = 1e3,
        /// A track may take over a number for this time after its start, s.
        #[schemars(range(min = 0.0))]
        pub decide_s: f64 = 2.0,
        /// Two tracks that come nearer to each other than this, m, may change over, and are
        /// compared after they part.
        #[schemars(range(min = 0.0))]
        pub alone_m: f64 = 0.6,
        /// Weight of the appearance, by which the associator prefers a detection that looks like
        /// the person of a track: a factor of `association_evidence`. With `linear` it is the
        /// log-likelihood ratio of equal appearances, with `half-distance` 1 is BoT-SORT. 0:
        /// positions alone decide.
        #[schemars(range(min = 0.0, max = 100.0))]
        pub association_weight: f64 = 0.0,
        /// Log-likelihood ratio that a difference of appearances amounts to: `linear` or
        /// `half-distance`.
        pub association_evidence: AppearanceEvidence = AppearanceEvidence::Linear,
        /// Number of appearances by which tracks that parted are compared.
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
