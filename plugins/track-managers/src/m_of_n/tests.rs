use nalgebra::{Matrix3, Point3, SMatrix, Vector2};
use tagalong_core::{
    Detection, EgoMotion, Estimate, Initiation, Observation, ObservedTrack, Person, Track,
    TrackChanges, TrackId, TrackManager, Unassociated,
};
use tagalong_geometry::{ImageBox, Rect};

use crate::m_of_n::{Config, MOfN};

/// A person at a place on the floor, whose head is 1.6 m high.
pub(crate) fn person(x: f64, y: f64) -> Detection {
    Detection::new("test", Point3::new(x, y, 1.6), Matrix3::identity() * 0.01, 1.0)
        .with_image(ImageBox::upper_body(Rect::new(0.0, 0.0, 9.0, 9.0)))
}

pub(crate) fn scored(score: f64, detection: Detection) -> Detection {
    detection.with_score(score)
}

/// A manager with the bookkeeping that the tracker does for it.
struct Rig {
    manager: MOfN,
    tracks: Vec<Track>,
    started: u32,
}

const DETECTED: Observation = Observation::Detected { log_odds: 1.0 };

impl Rig {
    fn new(config: Config) -> Self {
        Self { manager: MOfN::new(config).unwrap(), tracks: Vec::new(), started: 0 }
    }

    fn start(&mut self, score: f64, y: f64) -> TrackId {
        let detection = scored(score, person(3.0, y));
        let id = TrackId(self.started + 1);
        let new = Unassociated::new(&detection, score, true);
        let Initiation::Start(health) = self.manager.initiate(id, &new) else {
            panic!("{score} starts no track")
        };
        self.started += 1;
        let person = Person { position: detection.position, velocity: Vector2::zeros() };
        let estimate = Estimate::new(person, SMatrix::identity(), detection.rect().unwrap());
        self.tracks
            .push(Track::new(id, estimate, health.log_odds).with_confirmed(health.confirmed));
        id
    }

    /// An eighth of a second passes, and each track is observed.
    fn step(&mut self, observations: &[Observation]) -> TrackChanges {
        self.manager.predict(&EgoMotion::at_rest(0.125));
        for (track, observation) in self.tracks.iter_mut().zip(observations) {
            track.unseen_s += 0.125;
            if observation.is_supported() {
                track.unseen_s = 0.0;
            }
        }
        self.manage(observations)
    }

    fn manage(&mut self, observations: &[Observation]) -> TrackChanges {
        let pairs = self.tracks.iter().zip(observations);
        let observed: Vec<ObservedTrack<'_>> =
            pairs.map(|(track, observation)| ObservedTrack::new(track, *observation)).collect();
        let changes = self.manager.manage(&observed);
        for (id, health) in &changes.health {
            for track in self.tracks.iter_mut().filter(|track| track.id == *id) {
                (track.confirmed, track.score) = (health.confirmed, health.log_odds);
            }
        }
        changes
    }
}

/// One track of a score: the track afterwards, and the tests by which it would have ended.
fn live(config: Config, score: f64, observations: &[Observation]) -> (Track, Vec<&'static str>) {
    let mut rig = Rig::new(config);
    rig.start(score, 0.0);
    let ends = observations.iter().flat_map(|one| rig.step(&[*one]).ends).map(|(_, test)| test);
    let ends = ends.collect();
    (rig.tracks[0].clone(), ends)
}

fn confirmed(config: Config, score: f64, observations: &[Observation]) -> bool {
    live(config, score, observations).0.confirmed
}

#[test]
fn hits_confirm_only_if_they_are_close_to_each_other() {
    fn config() -> Config {
        Config { confirm_hits: 3, confirm_within: 5, tentative_misses: 9, ..Config::default() }
    }

    fn hits(observations: &[Observation]) -> bool {
        confirmed(config(), 1.0, observations)
    }

    use Observation::{Missed, NotSearched, Occluded, OutOfView};
    assert!(!hits(&[DETECTED]) && hits(&[DETECTED, DETECTED]), "the first detection counts");
    assert!(hits(&[Missed, DETECTED, Missed, DETECTED]), "three of five");
    assert!(!hits(&[Missed, Missed, DETECTED, Missed, DETECTED]), "of six");
    let hidden = [Occluded, OutOfView, NotSearched, Occluded];
    assert!(hits(&[&hidden[..], &[DETECTED, DETECTED]].concat()), "hidden is not missed");
    assert!(confirmed(Config { confirm_hits: 1, ..config() }, 1.0, &[]));
}

#[test]
fn two_hits_in_a_row_confirm_where_images_are_far_apart() {
    // The frames of the rig are an eighth of a second apart.
    fn hits(confirm_apart_s: f64, observations: &[Observation]) -> bool {
        let config = Config { confirm_hits: 4, confirm_within: 5, ..Config::default() };
        confirmed(Config { confirm_apart_s, ..config }, 1.0, observations)
    }

    use Observation::{Missed, Occluded};
    assert!(hits(0.125, &[DETECTED]) && hits(0.125, &[Occluded, DETECTED]));
    assert!(!hits(0.125, &[Missed, DETECTED]), "not in a row");
    assert!(!hits(0.126, &[DETECTED; 2]) && !hits(0.0, &[DETECTED; 2]));
    let doubtful = Observation::Detected { log_odds: -5.0 };
    assert!(!hits(0.125, &[doubtful]), "hits that are likely people");
}

#[test]
fn hits_that_are_probably_no_person_confirm_no_track() {
    fn config() -> Config {
        Config { drop_score: -9.0, ..Config::default() }
    }

    let doubtful = Observation::Detected { log_odds: -0.5 };
    assert!(!confirmed(config(), 0.1, &[doubtful; 6]));
    assert!(confirmed(config(), 0.1, &[Observation::Updated; 2]), "no score, no doubt");
    let sure = Observation::Detected { log_odds: 4.0 };
    assert!(confirmed(config(), 0.1, &[sure]), "at once");
    assert!(confirmed(config(), 4.0, &[]), "at once");
    let many = Config { confirm_hits: 3, ..config() };
    assert!(confirmed(many, 4.0, &[DETECTED]), "and for good");
}

#[test]
fn scores_are_smoothed_and_misses_speak_against_a_person() {
    fn score(observations: &[Observation]) -> f64 {
        live(Config::default(), 1.0, observations).0.score
    }

    use Observation::{Missed, NotSearched, Occluded, OutOfView, Updated};
    let sure = Observation::Detected { log_odds: 3.0 };
    assert!((score(&[sure]) - 1.6).abs() < 1e-12, "0.3 of the way");
    assert!((score(&[Missed]) - 0.4).abs() < 1e-12, "0.3 of the way to -1");
    assert_eq!(score(&[Updated, Occluded, OutOfView, NotSearched]), 1.0);
    let config = Config { tentative_misses: 99, start_score: -2.0, ..Config::default() };
    assert_eq!(live(config, -1.5, &[Missed]).0.score, -1.5, "a miss never speaks for a person");
}

#[test]
fn a_track_ends_by_its_score_only_below_the_limit() {
    for (log_odds, expected) in [(-2.0, vec![]), (-2.1, vec!["track: score"])] {
        let config = Config { score_weight: 1.0, ..Config::default() };
        let (_, ends) = live(config, 5.0, &[Observation::Detected { log_odds }]);
        assert_eq!(ends, expected, "{log_odds}");
    }
}

#[test]
fn a_track_that_is_not_confirmed_ends_at_its_second_miss() {
    for (score, misses, expected) in
        [(0.5, 1, vec![]), (0.5, 2, vec!["track: not confirmed"]), (5.0, 2, vec![])]
    {
        let (_, ends) = live(Config::default(), score, &vec![Observation::Missed; misses]);
        assert_eq!(ends, expected, "{score} {misses}");
    }
}

#[test]
fn a_hidden_track_is_kept_longer_than_one_that_should_be_seen() {
    for (observation, frames, expected) in [
        (Observation::Missed, 8, vec![]),
        (Observation::Missed, 9, vec!["track: not seen"]),
        (Observation::OutOfView, 16, vec![]),
        (Observation::OutOfView, 17, vec!["track: left the image"]),
        (Observation::Occluded, 24, vec![]),
        (Observation::Occluded, 25, vec!["track: hidden too long"]),
        // It was not missed.
        (Observation::NotSearched, 99, vec![]),
    ] {
        let (_, ends) = live(Config::default(), 5.0, &vec![observation; frames]);
        assert_eq!(ends, expected, "{observation:?} {frames}");
    }
}

#[test]
fn misses_before_an_occlusion_are_cleared() {
    let misses = vec![Observation::Missed; 8];
    let observations = [&misses[..], &[Observation::Occluded], &misses].concat();
    assert_eq!(live(Config::default(), 5.0, &observations).1, Vec::<&str>::new());
    let unbroken = vec![Observation::Missed; 9];
    assert_eq!(live(Config::default(), 5.0, &unbroken).1, ["track: not seen"]);
}

#[test]
fn time_without_a_search_counts_once_there_are_misses() {
    use Observation::{Missed, NotSearched};
    let few = [&[Missed; 2][..], &[NotSearched; 20]].concat();
    assert_eq!(live(Config::default(), 5.0, &few).1, Vec::<&str>::new(), "three are needed");
    let enough = [&[Missed; 2][..], &[NotSearched; 9], &[Missed]].concat();
    assert_eq!(live(Config::default(), 5.0, &enough).1, ["track: not seen"]);
}

#[test]
fn candidates_are_dropped_by_the_test_that_they_fail() {
    fn test(score: f64, detector_log_odds: f64, discovered: bool) -> &'static str {
        let mut manager = MOfN::new(Config { doubt_s: 3.0, ..Config::default() }).unwrap();
        let seen = scored(score, person(3.0, 0.0));
        let new = Unassociated::new(&seen, detector_log_odds, discovered);
        match manager.initiate(TrackId(1), &new) {
            Initiation::Start(_) => "started",
            Initiation::Drop(test) => test,
        }
    }
    assert_eq!(test(1.0, 1.0, true), "started");
    assert_eq!(test(-1.0, -1.0, true), "score");
    assert_eq!(test(-1.0, 1.0, true), "verifier");
    assert_eq!(test(1.0, 1.0, false), "no track fits");
    // The bound itself is enough.
    assert_eq!(test(0.0, 0.0, true), "started");
    assert_eq!(test(-1.0, 0.0, true), "verifier");
    let manager = MOfN::new(Config { start_score: 0.5, ..Config::default() }).unwrap();
    assert_eq!(manager.start_log_odds(), 0.5);
}

#[test]
fn a_place_that_was_rejected_is_doubted_until_a_reset() {
    fn initiate(manager: &mut MOfN, score: f64) -> Initiation {
        let seen = scored(score, person(3.0, 0.0));
        let new = Unassociated::new(&seen, 5.0, true);
        manager.initiate(TrackId(1), &new)
    }

    let mut manager = MOfN::new(Config { doubt_s: 3.0, ..Config::default() }).unwrap();
    assert_eq!(initiate(&mut manager, -4.0), Initiation::Drop("verifier"));
    assert_eq!(initiate(&mut manager, 1.0), Initiation::Drop("doubt"));
    assert_eq!(initiate(&mut manager, 0.0), Initiation::Drop("doubt"));
    manager.reset();
    assert!(matches!(initiate(&mut manager, 1.0), Initiation::Start(_)));
}

#[test]
fn settings_that_cannot_work_are_refused() {
    fn refusal(config: Config) -> Option<String> {
        MOfN::new(config).err().map(|error| error.to_string())
    }

    let default = Config::default;
    assert_eq!(refusal(default()), None);
    for (config, key) in [
        (Config { confirm_hits: 9, ..default() }, "`confirm_within` must be at least 9"),
        (Config { confirm_within: 40, ..default() }, "`confirm_within`"),
        (Config { confirm_hits: 0, ..default() }, "`confirm_hits`"),
        (Config { confirm_apart_s: -0.1, ..default() }, "`confirm_apart_s`"),
        (Config { miss_score: f64::NEG_INFINITY, ..default() }, "`miss_score`"),
        (Config { drop_score: 0.1, ..default() }, "`drop_score` must be at most 0"),
        (Config { drop_score: f64::NAN, ..default() }, "`drop_score`"),
        (Config { confirm_score: f64::NAN, ..default() }, "`confirm_score`"),
        (Config { confirm_score: f64::INFINITY, ..default() }, "`confirm_score`"),
    ] {
        let message = refusal(config).unwrap_or_default();
        assert!(message.contains(key), "{key}: {message}");
    }
    assert_eq!(refusal(Config { confirm_hits: 3, confirm_within: 3, ..default() }), None);
    let lenient = Config { drop_score: -1e9, confirm_score: 1e9, ..default() };
    assert_eq!(refusal(lenient), None);
}

#[test]
fn the_older_of_two_takes_over_the_confirmation() {
    let mut rig = Rig::new(Config::default());
    let older = rig.start(1.0, 0.0);
    let younger = rig.start(4.5, 0.0);
    assert!(!rig.tracks[0].confirmed && rig.tracks[1].confirmed);
    assert!(rig.manager.merge(older, younger).unwrap().confirmed);
    rig.manager.stop(younger);
    assert_eq!(rig.manager.merge(older, younger), None);
}
