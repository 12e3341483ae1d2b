use std::f64::consts::PI;

use crate::{ObservationMemory, Staged, buffered_iou, probability};
use tagalong_config::check_settings;
use tagalong_core::{Associations, Associator, Detection, Gate, Result, Track};
use tagalong_geometry::Rect;

use crate::observation_centric::Config;

/// The associator.
pub struct ObservationCentric {
    config: Config,
    memory: ObservationMemory,
}

/// Assignments, in their order.
#[derive(Clone, Copy, PartialEq)]
enum Round {
    /// Strong detections, to the tracks that go first.
    Early,
    /// Weak detections, to the tracks that are left of them.
    Weak,
    /// Strong detections, by the boxes at which the tracks were last observed.
    Recovery,
    /// Strong detections, to all other tracks.
    Late,
}

/// Tracks and detections of one frame.
struct Scene<'a> {
    tracks: &'a [Track],
    detections: &'a [Detection],
    gate: &'a Gate<'a>,
}

impl ObservationCentric {
    /// Creates the associator.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] for numbers that cannot work.
    pub fn new(config: Config) -> Result<Self> {
        check_settings(&config)?;
        let memory = ObservationMemory::new(config.direction_frames);
        Ok(Self { config, memory })
    }

    /// Returns the overlap of the predicted box and a detection, if it is enough.
    fn overlap(&self, track: &Track, detection: &Detection) -> Option<f64> {
        let strong = self.config.stages.is_strong(detection);
        let least = if strong { self.config.min_overlap } else { self.config.weak_overlap };
        let overlap = track.estimate.region.iou(&detection.rect()?);
        (overlap >= least).then_some(overlap)
    }

    /// Returns the overlap of the last observation and a strong detection, if it is enough.
    fn recovered(&self, track: &Track, detection: &Detection) -> Option<f64> {
        if !self.config.stages.is_strong(detection) {
            return None;
        }
        let last = self.memory.last(track.id)?;
        let overlap = buffered_iou(&last.region, &detection.rect()?, self.config.recovery_buffer);
        (overlap >= self.config.recovery_overlap).then_some(overlap)
    }

    /// Returns the consistency of the direction toward a detection with that in which the track
    /// moved between its observations (OCM): 0.5 - Δθ / π, 0 for an unknown direction.
    fn consistency(&self, track: &Track, seen: &Rect) -> f64 {
        let Some((from, moved)) = self.memory.direction(track.id) else { return 0.0 };
        let way = seen.centre() - from.centre();
        let Some(toward) = way.try_normalize(1e-9) else { return 0.0 };
        0.5 - moved.dot(&toward).clamp(-1.0, 1.0).acos() / PI
    }

    /// Returns the similarity of a pair by the predicted box, in the first stages.
    fn similarity(&self, scene: &Scene<'_>, row: usize, column: usize) -> Option<f64> {
        let (track, detection) = scene.pair(row, column)?;
        let overlap = self.overlap(track, detection)?;
        let log_ratio = scene.gate.appearance_of(row, column);
        let similarity = self.config.stages.similarity(overlap, detection, log_ratio);
        let consistency = self.consistency(track, &detection.rect()?);
        let bonus = self.config.direction_weight * probability(detection.score) * consistency;
        Some(similarity + bonus)
    }
}

impl<'a> Scene<'a> {
    /// Returns a track and a detection, unless the pair is probably no person.
    fn pair(&self, row: usize, column: usize) -> Option<(&'a Track, &'a Detection)> {
        let track = &self.tracks[row];
        let detection = &self.detections[column];
        self.gate.admits(track, detection).then_some((track, detection))
    }
}

impl Associator for ObservationCentric {
    fn fits(&self, track: &Track, detection: &Detection, _: &Gate) -> bool {
        self.overlap(track, detection).or_else(|| self.recovered(track, detection)).is_some()
    }

    fn associate(
        &mut self,
        tracks: &[Track],
        detections: &[Detection],
        gate: &Gate,
    ) -> Associations {
        self.memory.begin(tracks, gate.dt_s);
        let scene = Scene { tracks, detections, gate };
        let stages = self.config.stages;
        let mut staged = Staged::new(tracks.len(), detections.len());
        for round in [Round::Early, Round::Weak, Round::Recovery, Round::Late] {
            let stage = staged.open(
                |at| round == Round::Late || tracks[at].confirmed || !stages.confirmed_first,
                |at| stages.is_strong(&detections[at]) == (round != Round::Weak),
            );
            staged.assign(&stage, |row, column| {
                if round == Round::Recovery {
                    let (track, detection) = scene.pair(row, column)?;
                    return self.recovered(track, detection);
                }
                self.similarity(&scene, row, column)
            });
        }
        for (track, given) in tracks.iter().zip(staged.given()) {
            if let Some(region) = given.and_then(|given| detections[given].rect()) {
                self.memory.record(track.id, region);
            }
        }
        let spent = staged.left(|at| !stages.is_strong(&detections[at]));
        Associations::one_to_one(staged.given().iter().copied()).with_spent(spent)
    }
}

#[cfg(test)]
mod tests {
    use crate::{Fusion, StageSettings};
    use tagalong_conformance::samples::{GATE, detection_in, pairs, track_in};

    use super::*;

    fn at(x: f64, y: f64) -> Rect {
        Rect::new(x, y, 20.0, 40.0)
    }

    fn detection(region: Rect, score: f64) -> Detection {
        detection_in(region).with_score(score)
    }

    fn associator(config: Config) -> ObservationCentric {
        ObservationCentric::new(config).unwrap()
    }

    /// Takes an associator over three frames in which a track goes 4 pixels to the right in each.
    fn walking(config: Config) -> ObservationCentric {
        let mut associator = associator(config);
        for frame in 1..=3 {
            let region = at(4.0 * f64::from(frame), 0.0);
            associator.associate(&[track_in(1, region)], &[detection(region, 3.0)], &GATE);
        }
        associator
    }

    /// The detection beside the way of the track overlaps its predicted box a little more.
    #[test]
    fn a_detection_straight_ahead_goes_before_one_beside_the_way() {
        let detections = [detection(at(14.0, 10.0), 3.0), detection(at(23.0, 0.0), 3.0)];
        for (direction_weight, expected) in [(0.0, (0, 0)), (0.2, (0, 1))] {
            let mut associator = walking(Config { direction_weight, ..Config::default() });
            let answer = associator.associate(&[track_in(1, at(16.0, 0.0))], &detections, &GATE);
            assert_eq!(pairs(&answer), [expected]);
        }
    }

    /// The direction speaks for the left one of equal overlap only as far as the detection is sure.
    #[test]
    fn the_direction_counts_by_the_certainty_of_the_detection() {
        fn ahead(score: f64) -> [Detection; 2] {
            [detection(at(14.0, 6.0), 3.0), detection(at(21.0, 0.0), score)]
        }

        fn with(score: f64) -> Vec<(usize, usize)> {
            let stages = StageSettings { strong_log_odds: -9.0, ..StageSettings::default() };
            let config = Config { stages, direction_weight: 0.35, ..Config::default() };
            let track = [track_in(1, at(16.0, 0.0))];
            pairs(&walking(config).associate(&track, &ahead(score), &GATE))
        }

        assert_eq!((with(3.0), with(-2.0)), (vec![(0, 1)], vec![(0, 0)]));
    }

    #[test]
    fn a_tentative_track_gets_what_the_confirmed_ones_leave() {
        let stages = StageSettings { confirmed_first: true, ..StageSettings::default() };
        let config = Config { stages, ..Config::default() };
        let tentative = track_in(1, at(0.0, 0.0)).with_confirmed(false);
        let mut associator = associator(config);
        let found = [detection(at(1.0, 0.0), 3.0)];
        assert_eq!(pairs(&associator.associate(&[tentative], &found, &GATE)), [(0, 0)]);
    }

    #[test]
    fn a_weak_detection_does_not_recover_a_track() {
        let associator = walking(Config::default());
        let lost = track_in(1, at(60.0, 0.0));
        let there = at(12.0, 0.0);
        assert!(associator.fits(&lost, &detection(there, 3.0), &GATE));
        assert!(!associator.fits(&lost, &detection(there, -3.0), &GATE));
    }

    #[test]
    fn directions_are_compared_as_the_paper_has_them() {
        let associator = walking(Config::default());
        // The direction is taken from the observation three frames ago, at x = 4.
        let track = track_in(1, at(0.0, 0.0));
        for (x, y, expected, way) in [
            (14.0, 0.0, 0.5, "straight ahead"),
            (-6.0, 0.0, -0.5, "straight behind"),
            (4.0, 10.0, 0.0, "across"),
        ] {
            let found = associator.consistency(&track, &at(x, y));
            assert!((found - expected).abs() < 1e-9, "{way}: {found}");
        }
        let from_there = associator.consistency(&track, &at(4.0, 0.0));
        assert_eq!(from_there, 0.0, "from where it was there is no direction");
        assert_eq!(associator.consistency(&track_in(2, at(0.0, 0.0)), &at(9.0, 0.0)), 0.0);
    }

    /// The prediction ran on, but the person stopped.
    #[test]
    fn a_track_that_no_detection_overlaps_is_found_where_it_was_last_observed() {
        let there = [detection(at(12.0, 0.0), 3.0)];
        for (recovery_overlap, expected) in
            [(Config::default().recovery_overlap, vec![(0, 0)]), (1.5, vec![])]
        {
            let mut associator = walking(Config { recovery_overlap, ..Config::default() });
            let answer = associator.associate(&[track_in(1, at(60.0, 0.0))], &there, &GATE);
            assert_eq!(pairs(&answer), expected);
        }
        let near = [detection(at(36.0, 0.0), 3.0)];
        for (recovery_buffer, expected) in [(0.0, vec![]), (1.0, vec![(0, 0)])] {
            let mut associator = walking(Config { recovery_buffer, ..Config::default() });
            let answer = associator.associate(&[track_in(1, at(80.0, 0.0))], &near, &GATE);
            assert_eq!(pairs(&answer), expected);
        }
    }

    #[test]
    fn a_weak_detection_continues_a_track_and_starts_none() {
        let weak = [detection(at(13.0, 0.0), 0.1), detection(at(90.0, 0.0), 0.1)];
        for (weak_overlap, expected, spent) in
            [(0.5, vec![(0, 0)], vec![1]), (1.5, vec![], vec![0, 1])]
        {
            let mut associator = walking(Config { weak_overlap, ..Config::default() });
            let answer = associator.associate(&[track_in(1, at(12.0, 0.0))], &weak, &GATE);
            assert_eq!((pairs(&answer), answer.spent), (expected, spent));
        }
    }

    #[test]
    fn confirmed_tracks_may_go_first() {
        let tracks = [track_in(1, at(6.0, 0.0)), track_in(2, at(0.0, 0.0)).with_confirmed(false)];
        let found = [detection(at(0.0, 0.0), 3.0)];
        for (confirmed_first, expected) in [(false, (1, 0)), (true, (0, 0))] {
            let stages = StageSettings { confirmed_first, ..StageSettings::default() };
            let config = Config { stages, ..Config::default() };
            assert_eq!(pairs(&associator(config).associate(&tracks, &found, &GATE)), [expected]);
        }
    }

    #[test]
    fn overlap_may_count_by_the_score() {
        let found = [detection(at(0.0, 0.0), 0.5), detection(at(2.0, 0.0), 5.0)];
        for (weigh_by_score, expected) in [(false, (0, 0)), (true, (0, 1))] {
            let stages = StageSettings { weigh_by_score, ..StageSettings::default() };
            let mut associator = associator(Config { stages, ..Config::default() });
            let answer = associator.associate(&[track_in(1, at(0.0, 0.0))], &found, &GATE);
            assert_eq!(pairs(&answer), [expected]);
        }
    }

    #[test]
    fn appearance_helps_a_pair_within_the_gate() {
        let found = [detection(at(0.0, 0.0), 3.0), detection(at(5.0, 0.0), 3.0)];
        let appearance = [vec![-2.0, 4.0]];
        for (gate, expected) in [(GATE, (0, 0)), (GATE.with_appearance(&appearance), (0, 1))] {
            let mut associator = associator(Config::default());
            let answer = associator.associate(&[track_in(1, at(1.0, 0.0))], &found, &gate);
            assert_eq!(pairs(&answer), [expected]);
        }
    }

    #[test]
    fn a_sum_lets_the_appearance_speak_against_a_pair() {
        let found = [detection(at(0.0, 0.0), 3.0), detection(at(5.0, 0.0), 3.0)];
        let appearance = [vec![-4.0, 0.0]];
        for (fusion, expected) in [(Fusion::Minimum, (0, 0)), (Fusion::Sum, (0, 1))] {
            let stages = StageSettings { fusion, ..StageSettings::default() };
            let mut associator = associator(Config { stages, ..Config::default() });
            let gate = GATE.with_appearance(&appearance);
            let answer = associator.associate(&[track_in(1, at(1.0, 0.0))], &found, &gate);
            assert_eq!(pairs(&answer), [expected]);
        }
    }

    #[test]
    fn settings_that_cannot_work_are_refused() {
        let undefined = StageSettings { strong_log_odds: f64::NAN, ..StageSettings::default() };
        let beyond = StageSettings { fusion_gate: 2.0, ..StageSettings::default() };
        for config in [
            Config { min_overlap: 0.0, ..Config::default() },
            Config { direction_weight: -0.1, ..Config::default() },
            Config { direction_frames: 0, ..Config::default() },
            Config { recovery_overlap: f64::NAN, ..Config::default() },
            Config { recovery_buffer: -0.1, ..Config::default() },
            Config { stages: undefined, ..Config::default() },
            Config { weak_overlap: 3.0, ..Config::default() },
            Config { stages: beyond, ..Config::default() },
        ] {
            assert!(ObservationCentric::new(config.clone()).is_err(), "{config:?}");
        }
    }
}
