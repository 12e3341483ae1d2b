use crate::{Cost, GateSettings, Overlap, PairCost};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of the associator `associate-hungarian`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// `mahalanobis` (metres) or `overlap` (pixels).
    pub cost: Cost,
    /// Overlap: smallest overlap.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub min_overlap: f64,
    /// Overlap: `iou` or `dice`.
    pub overlap: Overlap,
    /// Cost of leaving a track without a detection, as a multiple of the cost at the gate.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub miss_factor: f64,
    /// Gate in metres, and the part of the appearance.
    #[serde(flatten)]
    pub gating: GateSettings,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            cost: Cost::Mahalanobis,
            min_overlap: 0.3,
            overlap: Overlap::Iou,
            miss_factor: 1.0,
            gating: GateSettings::default(),
        }
    }
}

impl Config {
    /// Returns the part that says how well a pair fits.
    pub fn pair_cost(&self) -> PairCost {
        let Self { cost, min_overlap, overlap, .. } = *self;
        PairCost { cost, min_overlap, overlap, ..self.gating.pair_cost() }
    }
}
