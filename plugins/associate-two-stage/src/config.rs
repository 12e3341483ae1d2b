use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_assignment::{Cost, Overlap, PairCost};
use tagalong_core::{ANY, NOT_NEGATIVE, POSITIVE, Result, check_ranges};

/// Settings of the associator `associate-two-stage`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// `mahalanobis` (metres) or `overlap` (pixels).
    pub cost: Cost,
    /// Mahalanobis: largest squared distance. 11.34 is the 99 % point of chi-squared with 3
    /// degrees of freedom.
    pub gate: f64,
    /// Mahalanobis: largest distance on the floor, m, between frames that are close in time ...
    pub gate_m: f64,
    /// ... and by how much it grows with the time between them, m/s.
    pub gate_speed_mps: f64,
    /// Overlap: smallest overlap.
    pub min_overlap: f64,
    /// Overlap: `iou` or `dice`.
    pub overlap: Overlap,
    /// What it costs to leave a track without a detection, as a multiple of the cost at the
    /// gate.
    pub miss_factor: f64,
    /// Detections from these log-odds on are strong.
    pub strong_log_odds: f64,
    /// A weak detection continues a track only within this part of the gate, 0 to 1.
    pub weak_gate: f64,
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
            miss_factor: 1.0,
            strong_log_odds: 0.5,
            weak_gate: 0.5,
        }
    }
}

impl Config {
    /// Returns the part that says how well a pair fits.
    pub(crate) fn pair_cost(&self) -> PairCost {
        let Self { cost, gate, gate_m, gate_speed_mps, min_overlap, overlap, .. } = *self;
        PairCost { cost, gate, gate_m, gate_speed_mps, min_overlap, overlap }
    }

    /// Refuses numbers that cannot work.
    pub(crate) fn check(&self) -> Result<()> {
        check_ranges(&[
            ("gate", self.gate, POSITIVE),
            ("gate_m", self.gate_m, POSITIVE),
            ("gate_speed_mps", self.gate_speed_mps, NOT_NEGATIVE),
            ("min_overlap", self.min_overlap, 1e-6..=1.0),
            ("miss_factor", self.miss_factor, POSITIVE),
            ("strong_log_odds", self.strong_log_odds, ANY),
            ("weak_gate", self.weak_gate, 0.0..=1.0),
        ])
    }
}
