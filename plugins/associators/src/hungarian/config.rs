use crate::{AppearanceFusion, Cost, Fusion, Overlap, PairCost};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of the associator `associate-hungarian`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// `mahalanobis` (metres) or `overlap` (pixels).
    pub cost: Cost,
    /// Mahalanobis: largest squared distance. 11.34 is the 99 % point of
    /// chi-squared with 3 degrees of freedom.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub gate: f64,
    /// Mahalanobis: largest distance on the floor, m, between frames that are
    /// close in time ...
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub gate_m: f64,
    /// ... and by how much it grows with the time between them, m/s.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub gate_speed_mps: f64,
    /// Overlap: smallest overlap.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub min_overlap: f64,
    /// Overlap: `iou` or `dice`.
    pub overlap: Overlap,
    /// Part of the appearance of a pair (`[reidentification] association_weight`): added to the
    /// place (`sum`), or the better of both counts (`minimum`).
    pub fusion: Fusion,
    /// `minimum`: the appearance counts for pairs whose places are at least so similar: the
    /// overlap, or exp(-d²/2) with the Mahalanobis distance d.
    /// BoT-SORT has 0.5.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub fusion_gate: f64,
    /// Cost of leaving a track without a detection, as a multiple of the cost at the gate.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub miss_factor: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            cost: Cost::Mahalanobis,
            gate: 11.34,
            gate_m: 1.0,
            gate_speed_mps: 1.5,
            min_overlap: 0.3,
            overlap: Overlap::Iou,
            fusion: Fusion::Sum,
            fusion_gate: 0.0,
            miss_factor: 1.0,
        }
    }
}

impl Config {
    /// Returns the part that says how well a pair fits.
    pub fn pair_cost(&self) -> PairCost {
        let Self { cost, gate, gate_m, gate_speed_mps, min_overlap, overlap, .. } = *self;
        let fusion = AppearanceFusion { fusion: self.fusion, gate: self.fusion_gate };
        PairCost { cost, gate, gate_m, gate_speed_mps, min_overlap, overlap, fusion }
    }
}
