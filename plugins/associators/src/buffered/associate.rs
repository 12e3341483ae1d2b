use crate::{ObservationMemory, Staged, buffered_iou};
use tagalong_config::check_settings;
use tagalong_core::{Associations, Associator, Detection, Gate, Result, Track};
use tagalong_geometry::Rect;

use crate::buffered::{Config, Motion};

/// The associator.
pub struct Buffered {
    config: Config,
    memory: ObservationMemory,
}

/// Enlargement of boxes, and the overlap that they need.
#[derive(Clone, Copy)]
struct Reach {
    buffer: f64,
    min_overlap: f64,
}

impl Buffered {
    /// Creates the associator.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] for numbers that cannot work.
    pub fn new(config: Config) -> Result<Self> {
        check_settings(&config)?;
        let memory = ObservationMemory::new(config.motion_frames);
        Ok(Self { config, memory })
    }

    fn is_strong(&self, detection: &Detection) -> bool {
        self.config.stages.is_strong(detection)
    }

    /// Returns the box at which a track is expected.
    fn expected(&self, track: &Track) -> Rect {
        let observed = match self.config.motion {
            Motion::Observed => self.memory.expected(track.id),
            Motion::Predicted => None,
        };
        observed.unwrap_or(track.estimate.region)
    }

    fn first(&self) -> Reach {
        Reach { buffer: self.config.buffer, min_overlap: self.config.min_overlap }
    }

    fn second(&self) -> Reach {
        Reach { buffer: self.config.second_buffer, min_overlap: self.config.second_overlap }
    }

    fn weak(&self) -> Reach {
        Reach { buffer: self.config.second_buffer, min_overlap: self.config.weak_overlap }
    }

    /// Returns the overlap of the enlarged boxes, if it is enough.
    fn overlap(&self, track: &Track, detection: &Detection, reach: Reach) -> Option<f64> {
        let overlap = buffered_iou(&self.expected(track), &detection.rect()?, reach.buffer);
        (overlap >= reach.min_overlap).then_some(overlap)
    }
}

impl Associator for Buffered {
    fn fits(&self, track: &Track, detection: &Detection, _: &Gate) -> bool {
        let reaches: &[Reach] =
            if self.is_strong(detection) { &[self.first(), self.second()] } else { &[self.weak()] };
        reaches.iter().any(|reach| self.overlap(track, detection, *reach).is_some())
    }

    fn associate(
        &mut self,
        tracks: &[Track],
        detections: &[Detection],
        gate: &Gate,
    ) -> Associations {
        self.memory.begin(tracks, gate.dt_s);
        let mut staged = Staged::new(tracks.len(), detections.len());
        for confirmed in [true, false] {
            for (strong, reach) in
                [(true, self.first()), (true, self.second()), (false, self.weak())]
            {
                let stage = staged.open(
                    |at| !self.config.stages.confirmed_first || tracks[at].confirmed == confirmed,
                    |at| self.is_strong(&detections[at]) == strong,
                );
                staged.assign(&stage, |row, column| {
                    let track = &tracks[row];
                    let detection = &detections[column];
                    let overlap = self.overlap(track, detection, reach)?;
                    let log_ratio = gate.appearance_of(row, column);
                    let counted = self.config.stages.similarity(overlap, detection, log_ratio);
                    gate.admits(track, detection).then_some(counted)
                });
            }
        }
        let spent = staged.left(|at| !self.is_strong(&detections[at]));
        for (track, given) in tracks.iter().zip(staged.given()) {
            if let Some(region) = given.and_then(|given| detections[given].rect()) {
                self.memory.record(track.id, region);
            }
        }
        Associations::one_to_one(staged.given().iter().copied()).with_spent(spent)
    }
}

#[cfg(test)]
mod tests {
    use crate::{Fusion, StageSettings};
    use tagalong_conformance::samples::{GATE, detection_in, pairs, track_in};

    use super::*;

    fn at(x: f64) -> Rect {
        Rect::new(x, 0.0, 20.0, 40.0)
    }

    fn detection(x: f64, score: f64) -> Detection {
        detection_in(at(x)).with_score(score)
    }

    fn track(id: u32, x: f64) -> Track {
        track_in(id, at(x))
    }

    fn answer(config: &Config, tracks: &[Track], found: &[Detection]) -> Associations {
        Buffered::new(config.clone()).unwrap().associate(tracks, found, &GATE)
    }

    /// The boxes touch no more; enlarged by 0.6 widths on each side they share 22 of 66 pixels.
    #[test]
    fn boxes_that_do_not_overlap_are_enlarged() {
        fn with(buffer: f64) -> Vec<(usize, usize)> {
            let config = Config { buffer, second_buffer: buffer, ..Config::default() };
            pairs(&answer(&config, &[track(1, 0.0)], &[detection(21.0, 3.0)]))
        }

        assert_eq!((with(0.1), with(0.6)), (vec![], vec![(0, 0)]));
    }

    /// Both detections are within reach of the first track in the second stage; the nearer one goes
    /// to it in the first stage, the farther one to the other track.
    #[test]
    fn the_wider_stage_gets_those_that_are_left() {
        let config = Config { buffer: 0.1, second_buffer: 0.8, ..Config::default() };
        let tracks = [track(1, 0.0), track(2, 60.0)];
        let found = [detection(3.0, 3.0), detection(38.0, 3.0)];
        assert_eq!(pairs(&answer(&config, &tracks, &found)), [(0, 0), (1, 1)]);
        let one = Config { second_overlap: 1.5, ..config };
        assert_eq!(pairs(&answer(&one, &tracks, &found)), [(0, 0)]);
    }

    #[test]
    fn a_detection_within_the_wider_reach_fits() {
        let config = Config { buffer: 0.0, second_buffer: 0.8, ..Config::default() };
        let associator = Buffered::new(config).unwrap();
        assert!(associator.fits(&track(1, 0.0), &detection(22.0, 3.0), &GATE));
        assert!(!associator.fits(&track(1, 0.0), &detection(90.0, 3.0), &GATE));
    }

    /// The farther detection looks like the track.
    #[test]
    fn the_better_of_overlap_and_appearance_counts() {
        let found = [detection(2.0, 3.0), detection(8.0, 3.0)];
        let looks = [vec![0.0, 6.0]];
        for (appearance, expected) in [(&[][..], (0, 0)), (&looks, (0, 1))] {
            let gate = GATE.with_appearance(appearance);
            let mut associator = Buffered::new(Config::default()).unwrap();
            assert_eq!(pairs(&associator.associate(&[track(1, 0.0)], &found, &gate)), [expected]);
        }
    }

    /// The nearer detection looks like another person.
    #[test]
    fn a_sum_lets_the_appearance_speak_against_a_pair() {
        let found = [detection(2.0, 3.0), detection(8.0, 3.0)];
        let appearance = [vec![-6.0, 0.0]];
        for (fusion, expected) in [(Fusion::Minimum, (0, 0)), (Fusion::Sum, (0, 1))] {
            let gate = GATE.with_appearance(&appearance);
            let stages = StageSettings { fusion, ..StageSettings::default() };
            let config = Config { stages, ..Config::default() };
            let mut associator = Buffered::new(config).unwrap();
            assert_eq!(pairs(&associator.associate(&[track(1, 0.0)], &found, &gate)), [expected]);
        }
    }

    #[test]
    fn the_appearance_counts_for_boxes_that_overlap_enough() {
        let found = [detection(2.0, 3.0), detection(8.0, 3.0)];
        let appearance = [vec![0.0, 6.0]];
        for (fusion_gate, expected) in [(0.5, (0, 1)), (0.9, (0, 0))] {
            let gate = GATE.with_appearance(&appearance);
            let stages = StageSettings { fusion_gate, ..StageSettings::default() };
            let config = Config { stages, ..Config::default() };
            let mut associator = Buffered::new(config).unwrap();
            assert_eq!(pairs(&associator.associate(&[track(1, 0.0)], &found, &gate)), [expected]);
        }
    }

    /// The track goes 8 pixels a frame; the filter has not noticed.
    #[test]
    fn a_track_is_expected_by_the_mean_velocity_of_its_observations() {
        fn after(motion: Motion) -> Vec<(usize, usize)> {
            let config = Config { motion, buffer: 0.0, second_buffer: 0.0, ..Config::default() };
            let mut associator = Buffered::new(config).unwrap();
            for frame in 1..=3 {
                let x = 8.0 * f64::from(frame);
                associator.associate(&[track(1, x - 8.0)], &[detection(x, 3.0)], &GATE);
            }
            associator.associate(&[track(1, 0.0)], &[], &GATE);
            pairs(&associator.associate(&[track(1, 0.0)], &[detection(40.0, 3.0)], &GATE))
        }

        assert_eq!(after(Motion::Observed), [(0, 0)]);
        assert_eq!(after(Motion::Predicted), []);
    }

    #[test]
    fn a_weak_detection_continues_a_track_and_starts_none() {
        let found = [detection(1.0, 0.1), detection(90.0, 0.1)];
        for (weak_overlap, expected, spent) in
            [(0.5, vec![(0, 0)], vec![1]), (1.5, vec![], vec![0, 1])]
        {
            let config = Config { weak_overlap, ..Config::default() };
            let answer = answer(&config, &[track(1, 0.0)], &found);
            assert_eq!((pairs(&answer), answer.spent), (expected, spent));
        }
    }

    #[test]
    fn confirmed_tracks_may_go_first() {
        let tracks = [track(1, 6.0), track(2, 0.0).with_confirmed(false)];
        for (confirmed_first, expected) in [(false, (1, 0)), (true, (0, 0))] {
            let stages = StageSettings { confirmed_first, ..StageSettings::default() };
            let config = Config { stages, ..Config::default() };
            assert_eq!(pairs(&answer(&config, &tracks, &[detection(0.0, 3.0)])), [expected]);
        }
    }

    #[test]
    fn overlap_may_count_by_the_score() {
        let found = [detection(0.0, 0.5), detection(2.0, 5.0)];
        for (weigh_by_score, expected) in [(false, (0, 0)), (true, (0, 1))] {
            let stages = StageSettings { weigh_by_score, ..StageSettings::default() };
            let config = Config { stages, ..Config::default() };
            assert_eq!(pairs(&answer(&config, &[track(1, 0.0)], &found)), [expected]);
        }
    }

    #[test]
    fn settings_that_cannot_work_are_refused() {
        let undefined = StageSettings { strong_log_odds: f64::NAN, ..StageSettings::default() };
        let negative = StageSettings { fusion_gate: -0.1, ..StageSettings::default() };
        for config in [
            Config { buffer: -0.1, ..Config::default() },
            Config { min_overlap: 0.0, ..Config::default() },
            Config { second_buffer: f64::NAN, ..Config::default() },
            Config { second_overlap: 3.0, ..Config::default() },
            Config { motion_frames: 0, ..Config::default() },
            Config { stages: undefined, ..Config::default() },
            Config { weak_overlap: 0.0, ..Config::default() },
            Config { stages: negative, ..Config::default() },
        ] {
            assert!(Buffered::new(config.clone()).is_err(), "{config:?}");
        }
    }
}
