//! `associate-hungarian-as-printed`: the assignment of P2, section III-E.
//!
//! Equation 10 gives a pair that overlaps too little a cost of 0, and the assignment minimises: such
//! pairs come first.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_associators::{Cost, Fit, PairCost, Pairs};
use tagalong_config::{Registry, check_settings};
use tagalong_core::{Associations, Associator, Detection, Gate, Result, Track};

/// Settings of the associator `associate-hungarian-as-printed`: those of `associate-hungarian`. The
/// misprint is that of the cost by overlap.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
// Unknown keys are refused by the flattened struct: of its keys it leaves those in place that it
// flattens itself, and serde would refuse them here.
#[serde(default)]
pub struct Config {
    /// Settings of `associate-hungarian`.
    #[serde(flatten)]
    pub base: tagalong_associators::hungarian::Config,
}

/// The printed associator.
pub struct PrintedHungarian {
    pair_cost: PairCost,
    miss_factor: f64,
}

impl PrintedHungarian {
    /// Creates the associator.
    ///
    /// # Errors
    /// Settings outside their ranges.
    pub fn new(config: &Config) -> Result<Self> {
        check_settings(config)?;
        Ok(Self { pair_cost: config.base.pair_cost(), miss_factor: config.base.miss_factor })
    }

    fn fit(&self, track: &Track, detection: &Detection, gate: &Gate) -> Option<Fit> {
        let outside = Fit { cost: 0.0, log_volume: 0.0 };
        let is_printed = self.pair_cost.cost == Cost::Overlap;
        let fit = self.pair_cost.fit(track, detection, gate.dt_s);
        fit.or(is_printed.then_some(outside))
    }
}

impl Associator for PrintedHungarian {
    fn fits(&self, track: &Track, detection: &Detection, gate: &Gate) -> bool {
        self.fit(track, detection, gate).is_some()
    }

    fn associate(
        &mut self,
        tracks: &[Track],
        detections: &[Detection],
        gate: &Gate,
    ) -> Associations {
        let pairs = Pairs { tracks, detections, gate };
        let all = pairs.all();
        let given = pairs.assigned(&all, &self.pair_cost, self.miss_factor, |track, found| {
            self.fit(track, found, gate)
        });
        Associations::one_to_one(given)
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
    use tagalong_associators::hungarian::Hungarian;
    use tagalong_conformance::samples::{GATE, detection_in, pairs, track_in};
    use tagalong_geometry::Rect;

    use super::*;

    #[test]
    fn a_track_is_given_a_detection_that_does_not_overlap_and_by_the_corrected_cost_one_that_does()
    {
        fn boxed(x: f64) -> Rect {
            Rect::new(x, 0.0, 10.0, 10.0)
        }

        let tracks = [track_in(1, boxed(0.0)), track_in(2, boxed(50.0))];
        let seen = [2.0, 51.0].map(|x| detection_in(boxed(x)));
        let base =
            tagalong_associators::hungarian::Config { cost: Cost::Overlap, ..Default::default() };
        let mut printed = PrintedHungarian::new(&Config { base: base.clone() }).unwrap();
        assert_eq!(pairs(&printed.associate(&tracks, &seen, &GATE)), [(0, 1), (1, 0)]);
        let mut corrected = Hungarian::new(base).unwrap();
        assert_eq!(pairs(&corrected.associate(&tracks, &seen, &GATE)), [(0, 0), (1, 1)]);
    }

    #[test]
    fn an_overlap_of_more_than_one_is_refused() {
        let base =
            tagalong_associators::hungarian::Config { min_overlap: 1.1, ..Default::default() };
        assert!(PrintedHungarian::new(&Config { base }).is_err());
    }
}
