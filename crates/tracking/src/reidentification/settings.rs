use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Recognition of people by their appearance: a person whose track ended keeps the number when
/// another track starts, and two people who passed each other are told apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
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
    /// A track may take over a number for this time after its start, s.
    #[schemars(range(min = 0.0))]
    pub decide_s: f64,
    /// Two tracks that come nearer to each other than this, m, may change over, and are compared
    /// after they part.
    #[schemars(range(min = 0.0))]
    pub alone_m: f64,
    /// Log-likelihood ratio of equal appearances, by which the associator prefers a detection that
    /// looks like the person of a track: it falls with the difference, to 0 at `max_difference`, and
    /// is bounded by minus the same. 0: positions alone decide.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub association_weight: f64,
    /// Number of appearances by which tracks that parted are compared.
    #[schemars(range(min = 1))]
    pub appearances: u32,
}

impl Default for ReidentificationSettings {
    fn default() -> Self {
        Self {
            remember_s: 0.0,
            max_difference: 0.3,
            margin: 0.06,
            max_height_m: 0.15,
            max_speed_mps: 3.0,
            decide_s: 2.0,
            alone_m: 0.6,
            association_weight: 0.0,
            appearances: 2,
        }
    }
}
