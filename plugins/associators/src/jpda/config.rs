use crate::{AppearanceFusion, Cost, Fusion, Overlap, PairCost};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of the associator `associate-jpda`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Largest squared Mahalanobis distance. 11.34 is the 99 % point of chi-squared with 3
    /// degrees of freedom.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub gate: f64,
    /// Largest distance on the floor, m, between frames that are close in time ...
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub gate_m: f64,
    /// ... and by how much it grows with the time between them, m/s.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub gate_speed_mps: f64,
    /// Part of the appearance of a pair (`[reidentification] association_weight`): added to the
    /// place (`sum`), or the better of both counts (`minimum`).
    pub fusion: Fusion,
    /// `minimum`: the appearance counts for pairs whose places are at least so similar: exp(-d²/2)
    /// with the Mahalanobis distance d.
    /// BoT-SORT has 0.5.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub fusion_gate: f64,
    /// Probability that a visible person is detected in a frame.
    #[schemars(range(min = 0.01, max = 0.999))]
    pub detection_probability: f64,
    /// False detections in a cubic metre and a frame.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub clutter_per_m3: f64,
    /// Pairs that are less probable are left out.
    #[schemars(range(min = 1e-6, max = 0.5))]
    pub min_weight: f64,
    /// Most detections in a cluster of tracks; 1 to 16. The work doubles with each.
    #[schemars(range(min = 1, max = 16))]
    pub max_detections: u32,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            gate: 11.34,
            gate_m: 1.0,
            gate_speed_mps: 1.5,
            fusion: Fusion::Sum,
            fusion_gate: 0.0,
            detection_probability: 0.9,
            clutter_per_m3: 0.05,
            min_weight: 0.05,
            max_detections: 12,
        }
    }
}

impl Config {
    /// Returns the part that says how well a pair fits.
    pub(crate) fn pair_cost(&self) -> PairCost {
        let Self { gate, gate_m, gate_speed_mps, .. } = *self;
        let fusion = AppearanceFusion { fusion: self.fusion, gate: self.fusion_gate };
        let cost = Cost::Mahalanobis;
        let overlap = Overlap::Iou;
        PairCost { cost, gate, gate_m, gate_speed_mps, min_overlap: 1.0, overlap, fusion }
    }
}
