//! `associate-hungarian-as-printed`: the assignment of P2, section III-E.
//!
//! Equation 10 gives a pair that overlaps too little a cost of 0, and the assignment minimises: such
//! pairs come first.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_assignment::{
    AppearanceFusion, Cost, Fit, Fusion, Overlap, PairCost, Pairs, assign_fits,
};
use tagalong_config::{Registry, check_settings};
use tagalong_core::{Associations, Associator, Detection, Gate, Result, Track};

/// Settings of the associator `associate-hungarian-as-printed`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Measure of the overlap.
    pub overlap: Overlap,
    /// Smallest overlap (R_min).
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub min_overlap: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self { overlap: Overlap::Dice, min_overlap: 0.4 }
    }
}

/// The printed associator.
pub struct PrintedHungarian(PairCost);

impl PrintedHungarian {
    /// Creates the associator.
    ///
    /// # Errors
    /// Settings outside their ranges.
    pub fn new(config: &Config) -> Result<Self> {
        check_settings(config)?;
        Ok(Self(PairCost {
            cost: Cost::Overlap,
            // Of the cost by distance, which is not used.
            gate: 11.34,
            gate_m: 1.0,
            gate_speed_mps: 1.5,
            min_overlap: config.min_overlap,
            overlap: config.overlap,
            fusion: AppearanceFusion { fusion: Fusion::Sum, gate: 0.0 },
        }))
    }

    fn fit(&self, track: &Track, detection: &Detection, gate: &Gate) -> Fit {
        let outside = Fit { cost: 0.0, log_volume: 0.0 };
        self.0.fit(track, detection, gate.dt_s).unwrap_or(outside)
    }
}

impl Associator for PrintedHungarian {
    fn fits(&self, _: &Track, _: &Detection, _: &Gate) -> bool {
        true
    }

    fn associate(
        &mut self,
        tracks: &[Track],
        detections: &[Detection],
        gate: &Gate,
    ) -> Associations {
        let pairs = Pairs { tracks, detections, gate };
        let fits = pairs.fits(&pairs.rows(), &pairs.columns(), &self.0, |track, found| {
            Some(self.fit(track, found, gate))
        });
        Associations::one_to_one(assign_fits(&fits, detections.len(), self.0.at_gate(), 1.0))
    }
}

/// Registers the associator.
pub fn register(registry: &mut Registry) {
    registry.associator(
        "associate-hungarian-as-printed",
        "assignment in which pairs that do not overlap come first (P2, equation 10)",
        |config: Config, _| PrintedHungarian::new(&config),
    );
}

#[cfg(test)]
mod tests {
    use tagalong_associate_hungarian::Hungarian;
    use tagalong_conformance::samples::{GATE, detection_in, pairs, track_in};
    use tagalong_geometry::Rect;

    use super::*;

    #[test]
    fn a_track_is_given_a_detection_that_does_not_overlap_and_by_the_corrected_cost_one_that_does()
    {
        let boxed = |x: f64| Rect::new(x, 0.0, 10.0, 10.0);
        let tracks = [track_in(1, boxed(0.0)), track_in(2, boxed(50.0))];
        let seen = [2.0, 51.0].map(|x| detection_in(boxed(x)));
        let mut printed = PrintedHungarian::new(&Config::default()).unwrap();
        assert_eq!(pairs(&printed.associate(&tracks, &seen, &GATE)), [(0, 1), (1, 0)]);
        let settings =
            tagalong_associate_hungarian::Config { cost: Cost::Overlap, ..Default::default() };
        let mut corrected = Hungarian::new(settings).unwrap();
        assert_eq!(pairs(&corrected.associate(&tracks, &seen, &GATE)), [(0, 0), (1, 1)]);
    }

    #[test]
    fn an_overlap_of_more_than_one_is_refused() {
        assert!(PrintedHungarian::new(&Config { min_overlap: 1.1, ..Config::default() }).is_err());
    }
}
