mod arithmetic;

use nalgebra::{Matrix3, Point3, SMatrix, Vector2};
use tagalong_core::{
    Detection, EgoMotion, Estimate, Initiation, Observation, ObservedTrack, Person, Track, TrackId,
    TrackManager, Unassociated,
};
use tagalong_geometry::{ImageBox, Rect};

use crate::sprt::{Config, Sprt};

const DT_S: f64 = 0.1;

fn detection(x: f64, log_odds: f64) -> Detection {
    Detection::new("test", Point3::new(x, 0.0, 1.6), Matrix3::identity() * 0.01, log_odds)
        .with_image(ImageBox::upper_body(Rect::new(0.0, 0.0, 9.0, 9.0)))
}

/// One place, looked at in each frame: starts a track whenever it may.
struct Scene {
    manager: Sprt,
    track: Option<Track>,
    started: u32,
    ends: Vec<(f64, &'static str)>,
    dropped: Vec<&'static str>,
    now_s: f64,
    confirmed_s: f64,
}

impl Scene {
    fn new(config: Config) -> Self {
        let manager = Sprt::new(config).unwrap();
        let ends = Vec::new();
        let dropped = Vec::new();
        Self { manager, track: None, started: 0, ends, dropped, now_s: 0.0, confirmed_s: 0.0 }
    }

    fn offer(&mut self, seen: &Detection) {
        let id = TrackId(self.started + 1);
        let new = Unassociated::new(seen, seen.score, true);
        match self.manager.initiate(id, &new) {
            Initiation::Drop(test) => self.dropped.push(test),
            Initiation::Start(health) => {
                self.started += 1;
                let person = Person { position: seen.position, velocity: Vector2::zeros() };
                let covariance = SMatrix::identity() * 0.0025;
                self.track = Some(
                    Track::new(
                        id,
                        Estimate::new(person, covariance, seen.rect().unwrap()),
                        health.log_odds,
                    )
                    .with_confirmed(health.confirmed),
                );
            }
        }
    }

    /// One frame, in which the robot moves and something is seen `x` ahead, or hidden.
    fn frame(&mut self, motion: EgoMotion, seen: Option<Detection>) {
        self.now_s += DT_S;
        self.manager.predict(&motion);
        let Some(mut track) = self.track.take() else {
            if let Some(seen) = seen {
                self.offer(&seen);
            }
            return;
        };
        let floor = motion.apply_to_point(track.estimate.person.position.xy());
        track.estimate.person.position = Point3::new(floor.x, floor.y, 1.6);
        track.unseen_s += DT_S;
        track.seen = seen.is_some();
        let observation = match &seen {
            Some(seen) => {
                track.estimate.person.position = seen.position;
                track.unseen_s = 0.0;
                Observation::Detected { log_odds: seen.score }
            }
            None => Observation::Missed,
        };
        let changes = self.manager.manage(&[ObservedTrack::new(&track, observation)]);
        (track.confirmed, track.score) =
            (changes.health[0].1.confirmed, changes.health[0].1.log_odds);
        self.confirmed_s += if track.confirmed { DT_S } else { 0.0 };
        match changes.ends.first() {
            Some((id, test)) => {
                self.manager.stop(*id);
                self.ends.push((self.now_s, test));
            }
            None => self.track = Some(track),
        }
    }
}

fn still() -> EgoMotion {
    EgoMotion::at_rest(DT_S)
}

/// A blanket over a chair: the detector believes in it a little, in every frame.
#[test]
fn a_thing_that_never_moves_is_gone_within_two_seconds_and_does_not_come_back() {
    let mut scene = Scene::new(Config::default());
    for _ in 0..300 {
        scene.frame(still(), Some(detection(3.0, 1.0)));
    }
    let (ended_s, test) = scene.ends[0];
    assert!(ended_s < 2.3 && test == "track: never moved", "{:?}", scene.ends);
    assert_eq!((scene.ends.len(), scene.confirmed_s), (1, 0.0), "and for half a minute");
    assert!(scene.dropped.iter().all(|test| *test == "clutter"));
}

#[test]
fn a_person_who_walked_in_and_stands_stays() {
    let mut scene = Scene::new(Config::default());
    for i in 0..400 {
        let x = 5.0 - 0.1 * f64::from(i.min(20));
        scene.frame(still(), Some(detection(x, 1.0)));
    }
    assert_eq!(scene.ends, []);
    assert!(scene.confirmed_s > 37.0, "{}", scene.confirmed_s);
}

/// A verifier that is sure in every frame speaks up enough although the looks are the same.
#[test]
fn a_person_who_stands_from_the_first_frame_is_kept_by_sure_looks() {
    let mut scene = Scene::new(Config::default());
    for _ in 0..200 {
        scene.frame(still(), Some(detection(3.0, 3.0)));
    }
    assert_eq!(scene.ends, []);
    assert!(scene.confirmed_s > 18.0, "{}", scene.confirmed_s);
}

/// The robot drives past: each view is a look of its own.
#[test]
fn looks_from_elsewhere_count_in_full() {
    fn confirmed_s(drives: bool) -> f64 {
        let mut scene = Scene::new(Config::default());
        for i in 0..15 {
            let forward = if drives { 0.1 } else { 0.0 };
            let x = 4.0 - forward * f64::from(i);
            scene.frame(EgoMotion { forward, ..still() }, Some(detection(x, 1.5)));
        }
        scene.confirmed_s
    }

    assert!(confirmed_s(true) > 0.5 && confirmed_s(false) == 0.0);
}

#[test]
fn a_thing_stays_clutter_while_the_robot_drives() {
    let mut scene = Scene::new(Config::default());
    for _ in 0..40 {
        scene.frame(still(), Some(detection(4.0, 1.0)));
    }
    assert_eq!(scene.ends.len(), 1);
    scene.dropped.clear();
    for i in 0..20 {
        let x = 4.0 - 0.1 * f64::from(i + 1);
        scene.frame(EgoMotion { forward: 0.1, ..still() }, Some(detection(x, 1.0)));
    }
    assert_eq!(scene.dropped, ["clutter"; 20]);
}

/// 0.5 m beside the place it is no clutter, and at it neither after two minutes or a reset.
#[test]
fn clutter_is_of_its_place_and_time() {
    fn starts(manager: &mut Sprt, x: f64) -> bool {
        let seen = detection(x, 1.0);
        let new = Unassociated::new(&seen, 1.0, true);
        matches!(manager.initiate(TrackId(9), &new), Initiation::Start(_))
    }

    let mut scene = Scene::new(Config::default());
    for _ in 0..40 {
        scene.frame(still(), Some(detection(4.0, 1.0)));
    }
    assert!(!starts(&mut scene.manager, 4.0) && starts(&mut scene.manager, 4.5));
    scene.manager.predict(&EgoMotion::at_rest(120.0));
    assert!(starts(&mut scene.manager, 4.0));
    for _ in 0..40 {
        scene.frame(still(), Some(detection(4.0, 1.0)));
    }
    scene.manager.reset();
    assert!(starts(&mut scene.manager, 4.0));
}

#[test]
fn settings_that_cannot_work_are_refused() {
    for config in [
        Config { confirm_log_odds: -1.0, ..Config::default() },
        Config { end_log_odds: 0.5, ..Config::default() },
        Config { end_log_odds: 0.0, ..Config::default() },
        Config { max_log_odds: 1.0, ..Config::default() },
        Config { usual: 1.1, ..Config::default() },
        Config { miss_log_odds: 0.1, ..Config::default() },
        Config { clutter_s: f64::NAN, ..Config::default() },
    ] {
        assert!(Sprt::new(config.clone()).is_err(), "{config:?}");
    }
}

/// The settings for verifiers that are sure at the first look.
fn verified() -> Config {
    Config { repeated: 1.0, still_log_odds: -4.5, max_still: -9.0, ..Config::default() }
}

/// The detector finds now one end of a blanket and now the other, and verifiers believe it a little.
#[test]
fn a_thing_that_is_found_at_two_places_has_not_moved() {
    let mut scene = Scene::new(verified());
    for i in 0..300 {
        let x = if i / 7 % 2 == 0 { 3.0 } else { 3.55 };
        scene.frame(still(), Some(detection(x, 3.0)));
    }
    assert!(scene.ends[0].0 < 2.3, "{:?}", scene.ends);
    assert!(scene.confirmed_s < 2.3 && scene.ends.len() == 1, "{:?}", scene.ends);
}

#[test]
fn verifiers_keep_a_person_who_stands_from_the_first_frame_and_no_thing() {
    fn confirmed_s(score: f64) -> f64 {
        let mut scene = Scene::new(verified());
        (0..300).for_each(|_| scene.frame(still(), Some(detection(3.0, score))));
        scene.confirmed_s
    }

    assert!(confirmed_s(10.0) > 29.0 && confirmed_s(6.0) < 2.3);
}

/// A track that was sure at first, and is less likely a person than not from then on without moving,
/// is a thing: the bound of an end alone would leave it for ever.
#[test]
fn a_thing_that_was_believed_once_ends_when_it_is_doubted() {
    let mut scene = Scene::new(verified());
    for i in 0..300 {
        let score = if i < 5 { 9.0 } else { 5.0 };
        scene.frame(still(), Some(detection(3.0, score)));
    }
    let (ended_s, test) = scene.ends[0];
    assert!(ended_s < 11.0 && test == "track: never moved", "{:?}", scene.ends);
    assert!(scene.confirmed_s < 11.0, "{}", scene.confirmed_s);
}

/// A person walks to a wall and out of sight, and the detector goes on finding the wall.
#[test]
fn a_track_that_changes_over_to_a_thing_ends() {
    fn confirmed_s(score: f64) -> f64 {
        let mut scene = Scene::new(verified());
        for i in 0..200 {
            let x = 5.0 - 0.1 * f64::from(i.min(20));
            let score = if i <= 20 { 10.0 } else { score };
            scene.frame(still(), Some(detection(x, score)));
        }
        scene.confirmed_s
    }

    assert!(confirmed_s(-2.0) < 9.0, "{}", confirmed_s(-2.0));
    assert!(confirmed_s(6.0) > 19.0, "a person who stops is less clear, and stays");
}

/// Past looks are bounded, so that a few bad ones count.
#[test]
fn looks_against_a_person_end_a_track_in_time() {
    let mut scene = Scene::new(verified());
    for i in 0..60 {
        let x = 9.0 - 0.1 * f64::from(i);
        scene.frame(still(), Some(detection(x, if i < 40 { 10.0 } else { -5.0 })));
    }
    let (ended_s, test) = scene.ends[0];
    assert!(ended_s < 5.5 && test == "track: evidence", "{:?}", scene.ends);
}
