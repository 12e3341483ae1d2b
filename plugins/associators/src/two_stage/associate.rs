use crate::{Fit, Pairs};
use tagalong_config::check_settings;
use tagalong_core::{Associations, Associator, Detection, Gate, Result, Track};

use crate::two_stage::Config;

/// The associator.
pub struct TwoStage {
    config: Config,
}

impl TwoStage {
    /// Creates the associator.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] for numbers that cannot work.
    pub fn new(config: Config) -> Result<Self> {
        check_settings(&config)?;
        Ok(Self { config })
    }

    fn is_strong(&self, detection: &Detection) -> bool {
        detection.score >= self.config.strong_log_odds
    }

    fn fit(&self, track: &Track, detection: &Detection, gate: &Gate) -> Option<Fit> {
        let pair_cost = self.config.pairs.pair_cost();
        let fit = pair_cost.fit(track, detection, gate.dt_s)?;
        // The likelihood of a weak detection being clutter is higher, so it has to fit better.
        let part = if self.is_strong(detection) { 1.0 } else { self.config.weak_gate };
        (fit.cost <= part * pair_cost.at_gate()).then_some(fit)
    }

    /// Assigns the detections of one strength to the tracks that have none yet.
    fn assign_stage(
        &self,
        tracks: &[Track],
        detections: &[Detection],
        gate: &Gate,
        strong: bool,
        given: &mut [Option<usize>],
    ) {
        let pairs = Pairs { tracks, detections, gate };
        let mut stage = pairs.all();
        stage.rows.retain(|row| given[*row].is_none());
        stage.columns.retain(|column| self.is_strong(&detections[*column]) == strong);
        let pair_cost = self.config.pairs.pair_cost();
        let miss_factor = self.config.pairs.miss_factor;
        let assigned = pairs
            .assigned(&stage, &pair_cost, miss_factor, |track, found| self.fit(track, found, gate));
        for (row, detection) in stage.rows.into_iter().zip(assigned) {
            given[row] = detection;
        }
    }
}

impl Associator for TwoStage {
    fn fits(&self, track: &Track, detection: &Detection, gate: &Gate) -> bool {
        self.fit(track, detection, gate).is_some()
    }

    fn associate(
        &mut self,
        tracks: &[Track],
        detections: &[Detection],
        gate: &Gate,
    ) -> Associations {
        let mut given = vec![None; tracks.len()];
        self.assign_stage(tracks, detections, gate, true, &mut given);
        self.assign_stage(tracks, detections, gate, false, &mut given);
        let weak = (0..detections.len()).filter(|index| !self.is_strong(&detections[*index]));
        let spent = weak.filter(|index| !given.contains(&Some(*index))).collect();
        Associations::one_to_one(given.iter().copied()).with_spent(spent)
    }
}

#[cfg(test)]
mod tests {
    use tagalong_conformance::samples::{GATE, detection_at, pairs, track_at};

    use super::*;
    use crate::{Fusion, GateSettings, hungarian};

    fn detection(y: f64, score: f64) -> Detection {
        detection_at(3.0, y).with_score(score)
    }

    fn track(id: u32, y: f64) -> Track {
        track_at(id, 3.0, y)
    }

    /// The weak one is nearer; one assignment of all would take it.
    #[test]
    fn a_strong_detection_goes_before_a_nearer_weak_one() {
        let mut two_stage = TwoStage::new(Config::default()).unwrap();
        let detections = [detection(0.05, 0.2), detection(0.2, 3.0)];
        let answer = two_stage.associate(&[track(1, 0.0)], &detections, &GATE);
        assert_eq!(pairs(&answer), [(0, 1)]);
        assert_eq!(answer.spent, [0], "a weak detection starts no track");
    }

    #[test]
    fn a_weak_detection_continues_the_track_that_is_left() {
        let mut two_stage = TwoStage::new(Config::default()).unwrap();
        let tracks = [track(1, 0.0), track(2, 1.0)];
        let detections = [detection(1.05, -0.5), detection(0.05, 3.0)];
        let answer = two_stage.associate(&tracks, &detections, &GATE);
        assert_eq!(pairs(&answer), [(0, 1), (1, 0)]);
        assert_eq!(answer.spent, Vec::<usize>::new());
    }

    /// 0.4 m are a squared distance of 8, which is within the gate and not within half of it.
    #[test]
    fn a_weak_detection_has_to_fit_better() {
        let two_stage = TwoStage::new(Config::default()).unwrap();
        for (score, fits) in [(3.0, true), (0.2, false)] {
            assert_eq!(two_stage.fits(&track(1, 0.0), &detection(0.4, score), &GATE), fits);
        }
    }

    /// The detections are in front of the wrong tracks by 6 cm, and look like the right ones.
    #[test]
    fn the_better_of_place_and_appearance_may_count_in_metres() {
        let tracks = [track(1, 0.0), track(2, 0.2)];
        let found = [detection(0.13, 3.0), detection(0.07, 3.0)];
        let looks = [vec![4.0, -4.0], vec![-4.0, 4.0]];
        for (appearance, fusion_gate, expected, why) in [
            (&[][..], 0.0, [(0, 1), (1, 0)], "places alone"),
            (&looks, 0.0, [(0, 0), (1, 1)], "with looks"),
            (&looks, 0.95, [(0, 1), (1, 0)], "exp(-d²/2) is less than that"),
        ] {
            let fusion = Fusion::Minimum;
            let gating = GateSettings { fusion, fusion_gate, ..GateSettings::default() };
            let settings = hungarian::Config { gating, ..hungarian::Config::default() };
            let config = Config { pairs: settings, ..Config::default() };
            let gate = GATE.with_appearance(appearance);
            let answer = TwoStage::new(config).unwrap().associate(&tracks, &found, &gate);
            assert_eq!(pairs(&answer), expected, "{why}");
        }
    }

    #[test]
    fn settings_that_cannot_work_are_refused() {
        let gating = GateSettings { gate: 0.0, ..GateSettings::default() };
        let settings = hungarian::Config { gating, ..hungarian::Config::default() };
        for config in [
            Config { weak_gate: 1.5, ..Config::default() },
            Config { strong_log_odds: f64::NAN, ..Config::default() },
            Config { pairs: settings, ..Config::default() },
        ] {
            assert!(TwoStage::new(config.clone()).is_err(), "{config:?}");
        }
    }
}
