use crate::{Fit, Pairs};
use tagalong_config::check_settings;
use tagalong_core::{Associations, Associator, Detection, Gate, Result, Track};

use crate::hungarian::Config;

/// The associator: the assignment of all tracks and detections of a frame with the least sum
/// of costs.
pub struct Hungarian {
    config: Config,
}

impl Hungarian {
    /// Creates the associator.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] for numbers that cannot work.
    pub fn new(config: Config) -> Result<Self> {
        check_settings(&config)?;
        Ok(Self { config })
    }

    fn fit(&self, track: &Track, detection: &Detection, gate: &Gate) -> Option<Fit> {
        self.config.pair_cost().fit(track, detection, gate.dt_s)
    }
}

impl Associator for Hungarian {
    fn fits(&self, track: &Track, detection: &Detection, gate: &Gate) -> bool {
        self.fit(track, detection, gate).is_some()
    }

    fn associate(
        &mut self,
        tracks: &[Track],
        detections: &[Detection],
        gate: &Gate,
    ) -> Associations {
        let pair_cost = self.config.pair_cost();
        let pairs = Pairs { tracks, detections, gate };
        let miss_factor = self.config.miss_factor;
        let given = pairs.assigned(&pairs.all(), &pair_cost, miss_factor, |track, found| {
            self.fit(track, found, gate)
        });
        Associations::one_to_one(given)
    }
}

#[cfg(test)]
mod tests {
    use crate::{Cost, Fusion, GateSettings};
    use tagalong_conformance::samples::{
        GATE, detection_at, detection_in, pairs, track_at, track_in, with_variance,
    };
    use tagalong_geometry::Rect;

    use super::*;

    fn track(x: f64, y: f64, variance_m2: f64) -> Track {
        with_variance(track_at(1, x, y), variance_m2)
    }

    #[test]
    fn pairs_that_are_probably_no_person_are_not_formed() {
        let mut hungarian = Hungarian::new(Config::default()).unwrap();
        let doubtful = detection_at(3.0, 0.0).with_score(-2.0);
        let at = track(3.0, 0.0, 0.01);
        for (score, expected) in [(1.9, 0), (2.1, 1)] {
            let track = at.clone().with_score(score);
            let answer = hungarian.associate(&[track], std::slice::from_ref(&doubtful), &GATE);
            assert_eq!(answer.pairs.len(), expected, "log-odds add up");
        }
    }

    #[test]
    fn appearance_decides_between_detections_that_fit_equally_well() {
        let mut hungarian = Hungarian::new(Config::default()).unwrap();
        let tracks = [0.1, -0.1].map(|y| track(3.0, y, 0.02));
        let seen = [detection_at(3.0, 0.11), detection_at(3.0, -0.11)];
        for (appearance, expected, why) in [
            (vec![], [0, 1], "places alone"),
            (vec![vec![-4.0, 4.0], vec![4.0, -4.0]], [1, 0], "looks differ much"),
            (vec![vec![-0.1, 0.1], vec![0.1, -0.1]], [0, 1], "places still count"),
        ] {
            let answer = hungarian.associate(&tracks, &seen, &GATE.with_appearance(&appearance));
            let given: Vec<_> =
                pairs(&answer).into_iter().map(|(_, detection)| detection).collect();
            assert_eq!(given, expected, "{why}");
        }
    }

    /// Both detections are near the first track, and the farther one looks like it. The second track
    /// looks like nothing that is seen.
    #[test]
    fn the_better_of_place_and_appearance_counts_where_the_settings_say_so() {
        fn boxed(x: f64) -> Rect {
            Rect::new(x, 0.0, 20.0, 40.0)
        }

        let tracks = [track_in(1, boxed(0.0)), track_in(2, boxed(2.0))];
        let seen = [1.0, 4.0].map(|x| detection_in(boxed(x)));
        let looks = [vec![-3.0, 6.0], vec![-3.0, -3.0]];
        for (fusion, fusion_gate, expected, why) in [
            (Fusion::Minimum, 0.5, vec![(0, 1), (1, 0)], "the farther one looks like it"),
            (Fusion::Minimum, 0.9, vec![(0, 0), (1, 1)], "too little overlap"),
            (Fusion::Sum, 0.5, vec![(0, 1)], "other looks speak against the second pair"),
        ] {
            let gating = GateSettings { fusion, fusion_gate, ..GateSettings::default() };
            let config = Config { cost: Cost::Overlap, gating, ..Config::default() };
            let gate = GATE.with_appearance(&looks);
            let mut hungarian = Hungarian::new(config).unwrap();
            assert_eq!(pairs(&hungarian.associate(&tracks, &seen, &gate)), expected, "{why}");
        }
    }

    #[test]
    fn settings_that_cannot_work_are_refused() {
        let mut wrong = vec![
            Config { min_overlap: 1.1, ..Config::default() },
            Config { miss_factor: f64::INFINITY, ..Config::default() },
        ];
        for gating in [
            GateSettings { gate: 0.0, ..GateSettings::default() },
            GateSettings { gate_m: f64::NAN, ..GateSettings::default() },
            GateSettings { gate_speed_mps: -1.0, ..GateSettings::default() },
            GateSettings { fusion_gate: 1.1, ..GateSettings::default() },
        ] {
            wrong.push(Config { gating, ..Config::default() });
        }
        for config in wrong {
            assert!(Hungarian::new(config.clone()).is_err(), "{config:?}");
        }
    }

    #[test]
    fn a_pair_fits_within_the_gate_alone() {
        let hungarian = Hungarian::new(Config::default()).unwrap();
        let track = track(3.0, 0.0, 0.01);
        assert!(hungarian.fits(&track, &detection_at(3.0, 0.1), &GATE));
        assert!(!hungarian.fits(&track, &detection_at(3.0, 4.0), &GATE));
    }

    #[test]
    fn a_track_is_given_the_detection_that_overlaps() {
        fn boxed(x: f64) -> Rect {
            Rect::new(x, 0.0, 10.0, 10.0)
        }

        let tracks = [track_in(1, boxed(0.0)), track_in(2, boxed(50.0))];
        let seen = [2.0, 51.0].map(|x| detection_in(boxed(x)));
        let settings = Config { cost: Cost::Overlap, ..Config::default() };
        let given = Hungarian::new(settings).unwrap().associate(&tracks, &seen, &GATE);
        assert_eq!(pairs(&given), [(0, 0), (1, 1)]);
    }
}
