//! Combination of the position and the appearance of a pair, the same for all associators.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::probability;

/// Combination of the position and the appearance of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Fusion {
    /// The log-likelihood ratio of the appearances is added: it may support a pair or contradict
    /// it.
    #[default]
    Sum,
    /// The better of the two counts, so that an appearance may support a pair but never contradicts
    /// it (N. Aharon, R. Orfaig and B. Bobrovsky, *BoT-SORT: Robust Associations Multi-Pedestrian
    /// Tracking*, arXiv 2206.14651, section 3.3: the smaller of two distances).
    Minimum,
}

/// Combination of place and appearance with its gate.
///
/// A place has a similarity from 0 to 1: the overlap of the boxes, or exp(-d²/2) with the
/// Mahalanobis distance d. An appearance has the probability p with its log-odds.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct AppearanceFusion {
    /// The combination.
    pub fusion: Fusion,
    /// `minimum`: smallest similarity of the places of a pair whose appearance counts.
    pub gate: f64,
}

impl AppearanceFusion {
    /// Returns the similarity of a pair, 0 to 1, from that of its places and the log-likelihood
    /// ratio of its appearances; 0 stands for an unknown appearance.
    ///
    /// ```
    /// use tagalong_associators::{AppearanceFusion, Fusion};
    /// let smaller = AppearanceFusion { fusion: Fusion::Minimum, gate: 0.5 };
    /// let sum = AppearanceFusion { fusion: Fusion::Sum, ..smaller };
    /// // Appearances with 0.4 between them: the probability is 1 - 0.4 / 2.
    /// let log_ratio = (0.8_f64 / 0.2).ln();
    /// assert!((smaller.similarity(0.6, log_ratio) - 0.8).abs() < 1e-12);
    /// assert_eq!(smaller.similarity(0.6, -log_ratio), 0.6);
    /// assert!(sum.similarity(0.6, -log_ratio) < 0.3);
    /// ```
    pub fn similarity(&self, place: f64, log_ratio: f64) -> f64 {
        match self.fusion {
            _ if log_ratio == 0.0 => place,
            // Odds multiply; a similarity of 0 or 1 has infinite log-odds and stays as it is.
            Fusion::Sum => probability((place / (1.0 - place)).ln() + log_ratio),
            Fusion::Minimum if self.helps(place, log_ratio) => place.max(probability(log_ratio)),
            Fusion::Minimum => place,
        }
    }

    /// Returns the cost of a pair, which is -`unit` times the logarithm of the similarity of its
    /// places, with the appearance taken into account.
    pub fn cost(&self, place: f64, unit: f64, log_ratio: f64) -> f64 {
        match self.fusion {
            Fusion::Sum => place - unit * log_ratio,
            Fusion::Minimum if self.helps((-place / unit).exp(), log_ratio) => {
                place.min(-unit * probability(log_ratio).ln())
            }
            Fusion::Minimum => place,
        }
    }

    /// Returns true for an appearance that speaks for the pair, near enough.
    fn helps(&self, place: f64, log_ratio: f64) -> bool {
        log_ratio > 0.0 && place >= self.gate
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SUM: AppearanceFusion = AppearanceFusion { fusion: Fusion::Sum, gate: 0.0 };
    const MINIMUM: AppearanceFusion = AppearanceFusion { fusion: Fusion::Minimum, gate: 0.5 };

    /// Cost of the paper: min(d_iou, d_cos), with d_cos = 1 unless both are near, and else half the
    /// cosine distance.
    fn as_printed(overlap: f64, cosine_distance: f64, max_difference: f64) -> f64 {
        let is_near = 1.0 - overlap <= 0.5 && cosine_distance < max_difference;
        let gated = if is_near { 0.5 * cosine_distance } else { 1.0 };
        gated.min(1.0 - overlap)
    }

    /// Log-odds of the probability 1 - d/2, as `[reidentification]` gives them.
    fn log_ratio(cosine_distance: f64, max_difference: f64) -> f64 {
        let near = cosine_distance < max_difference;
        if near { ((2.0 - cosine_distance) / cosine_distance).ln() } else { 0.0 }
    }

    proptest! {
        #[test]
        fn the_smaller_distance_is_that_of_the_paper(
            overlap in 0.01..0.99f64, distance in 0.001..1.0f64,
        ) {
            let log_ratio = log_ratio(distance, 0.25);
            let expected = as_printed(overlap, distance, 0.25);
            prop_assert!((1.0 - MINIMUM.similarity(overlap, log_ratio) - expected).abs() < 1e-9);
            for unit in [1.0, 2.0] {
                let cost = MINIMUM.cost(-unit * overlap.ln(), unit, log_ratio);
                prop_assert!((cost + unit * (1.0 - expected).ln()).abs() < 1e-9);
            }
        }

        #[test]
        fn a_sum_multiplies_odds(overlap in 0.01..0.99f64, log_ratio in -5.0..5.0f64) {
            fn odds(p: f64) -> f64 {
                p / (1.0 - p)
            }

            let both = SUM.similarity(overlap, log_ratio);
            let expected = odds(overlap) * log_ratio.exp();
            prop_assert!((odds(both) / expected - 1.0).abs() < 1e-6, "{both}");
        }
    }

    #[test]
    fn only_a_sum_lets_an_appearance_speak_against_a_pair() {
        assert_eq!(MINIMUM.similarity(0.7, -3.0), 0.7);
        assert_eq!(MINIMUM.cost(1.0, 2.0, -3.0), 1.0);
        assert!(SUM.similarity(0.7, -3.0) < 0.2);
        assert_eq!(SUM.cost(1.0, 2.0, -3.0), 7.0);
    }

    #[test]
    fn an_unknown_appearance_changes_nothing() {
        for fusion in [SUM, MINIMUM] {
            for place in [0.0, 0.3, 1.0] {
                assert_eq!(fusion.similarity(place, 0.0), place);
            }
            assert_eq!(fusion.cost(1.5, 2.0, 0.0), 1.5);
        }
    }

    #[test]
    fn a_certain_place_stays_finite() {
        assert_eq!(SUM.similarity(1.0, -4.0), 1.0);
        assert_eq!(SUM.similarity(0.0, 4.0), 0.0);
    }
}
