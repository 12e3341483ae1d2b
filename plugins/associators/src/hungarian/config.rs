use crate::{Cost, GateSettings, Overlap, PairCost};
use tagalong_core::settings;

settings! {
    /// Settings of the associator `associate-hungarian`.
    pub struct Config {
        /// `mahalanobis` (metres) or `overlap` (pixels).
        pub cost: Cost = Cost::Mahalanobis,
        /// For `overlap`: smallest overlap.
        #[schemars(range(min = 1e-6, max = 1.0))]
        pub min_overlap: f64 = 0.3,
        /// For `overlap`: measure of the overlap, `iou` or `dice`.
        pub overlap: Overlap = Overlap::Iou,
        /// Cost of leaving a track without a detection, as a multiple of the cost at the gate.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub miss_factor: f64 = 1.0,
        /// Gate in metres, and the weight of the appearance.
        #[serde(flatten)]
        pub gating: GateSettings,
    }
}

impl Config {
    /// Returns the part that says how well a pair fits.
    pub fn pair_cost(&self) -> PairCost {
        let Self { cost, min_overlap, overlap, .. } = *self;
        PairCost { cost, min_overlap, overlap, ..self.gating.pair_cost() }
    }
}
