use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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

/// Recognition of people by their appearance: a person whose track ended keeps the number when
/// another track starts, and two people who passed each other are told apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct ReidentificationSettings {
    /// Time for which a person without a track is remembered, s. 0: each track has a number of its
    /// own.
    #[schemars(range(min = 0.0))]
    pub remember_s: f64,
    /// Largest difference of two appearances of one person: the mean of the Hellinger distances of
    /// the visible parts, or 1 minus the cosine of the vectors of `[appearance]`.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub max_difference: f64,
    /// Every other remembered person must differ by this much more.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub margin: f64,
    /// Largest difference of the heights of the head, m.
    #[schemars(range(min = 0.0))]
    pub max_height_m: f64,
    /// Speed beyond which a person cannot have got to where a track starts, m/s.
    #[schemars(range(min = 0.0))]
    pub max_speed_mps: f64,
    /// Acceleration beyond which a person cannot have turned to where a track starts, m/s²: one who
    /// walked out of the image is not at the other end of the room soon after. As large as 1,000 it
    /// excludes nothing.
    #[schemars(range(min = 0.0))]
    pub max_acceleration_mps2: f64,
    /// A track may take over a number for this time after its start, s.
    #[schemars(range(min = 0.0))]
    pub decide_s: f64,
    /// Two tracks that come nearer to each other than this, m, may change over, and are compared
    /// after they part.
    #[schemars(range(min = 0.0))]
    pub alone_m: f64,
    /// Weight of the appearance, by which the associator prefers a detection that looks like the
    /// person of a track: a factor of `association_evidence`. With `linear` it is the log-likelihood
    /// ratio of equal appearances, with `half-distance` 1 is BoT-SORT. 0: positions alone decide.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub association_weight: f64,
    /// Log-likelihood ratio that a difference of appearances amounts to: `linear` or
    /// `half-distance`.
    pub association_evidence: AppearanceEvidence,
    /// Number of appearances by which tracks that parted are compared.
    #[schemars(range(min = 1))]
    pub appearances: u32,
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

impl Default for ReidentificationSettings {
    fn default() -> Self {
        Self {
            remember_s: 0.0,
            max_difference: 0.3,
            margin: 0.06,
            max_height_m: 0.15,
            max_speed_mps: 3.0,
            max_acceleration_mps2: 1e3,
            decide_s: 2.0,
            alone_m: 0.6,
            association_weight: 0.0,
            association_evidence: AppearanceEvidence::Linear,
            appearances: 2,
        }
    }
}
