use std::sync::Arc;

use nalgebra::SMatrix;
use tagalong_conformance::target;
use tagalong_core::{Images, Stamp};
use tagalong_geometry::{Camera, Distortion, Pinhole};

use super::*;
use crate::target_lock::settings::LooksSettings;

fn frame(index: u64, t_s: f64) -> Frame {
    let lens = Pinhole { fx: 500.0, fy: 500.0, cx: 319.5, cy: 239.5, distortion: Distortion::None };
    let camera = Arc::new(Camera::mounted(lens, 640, 480, 1.2, 0.0, 0.0));
    let stamp = Stamp::from_nanos(1_000_000_000_000).plus_seconds(t_s);
    Frame::new(index, stamp, camera, EgoMotion::at_rest(0.1), Images::default())
}

/// There are no images: people are distinguished by their height.
fn settings() -> TargetSettings {
    let looks = LooksSettings { height: [0.06, 60.0], ..LooksSettings::default() };
    TargetSettings { looks, ..TargetSettings::default() }
}

fn new_lock(settings: TargetSettings) -> TargetLock {
    TargetLock::new(settings, Describer::default())
}

fn somebody(id: u32, x: f64, y: f64) -> Track {
    let track = target(x, y, Vector2::zeros());
    track.with_id(TrackId(id)).with_seen(true).with_confirmed(true).with_occluded(false)
}

fn tall(height_m: f64) -> Track {
    let mut track = somebody(1, 2.0, 0.0);
    track.estimate.person.position.z = height_m;
    track
}

/// An eighth of a second later.
fn step(lock: &mut TargetLock, tracks: &[Track]) -> LockReport {
    lock.update(&frame(1, 0.0), &EgoMotion::at_rest(0.125), tracks, &[], true).unwrap()
}

fn steps(lock: &mut TargetLock, count: usize, track: &Track) -> Vec<LockState> {
    (0..count).map(|_| step(lock, std::slice::from_ref(track)).state).collect()
}

/// A person 1.6 m tall, seen in twenty frames and missed in `frames` after that.
fn missed(frames: usize) -> (TargetLock, Vec<LockState>) {
    let mut lock = new_lock(settings());
    steps(&mut lock, 20, &tall(1.6));
    let states = steps(&mut lock, frames, &tall(1.6).with_seen(false));
    (lock, states)
}

#[test]
fn the_person_is_known_well_after_fifteen_sightings() {
    let states = steps(&mut new_lock(settings()), 16, &tall(1.6));
    assert!(states[..14].iter().all(|state| *state == LockState::Training), "{states:?}");
    assert_eq!(states[14..], [LockState::Locked; 2]);
}

#[test]
fn out_of_sight_the_person_is_doubted_after_half_a_second_and_lost_after_two() {
    let (lock, states) = missed(17);
    assert_eq!([states[3], states[4]], [LockState::Locked, LockState::Suspect]);
    assert_eq!([states[15], states[16]], [LockState::Suspect, LockState::Lost]);
    assert_eq!((lock.followed(), lock.why), (None, "out of sight"));
    assert!((missed(6).0.belief - logit(0.4)).abs() < 1e-12);
    assert_eq!(missed(6).0.followed(), Some(TrackId(1)), "followed slowly");
}

#[test]
fn who_comes_back_has_to_look_like_the_person_five_times() {
    let (mut lock, _) = missed(6);
    let states = steps(&mut lock, 5, &tall(1.6));
    assert_eq!(states[..4], [LockState::Suspect; 4]);
    assert_eq!((states[4], lock.why), (LockState::Locked, "looks right"));
    let (mut lock, _) = missed(6);
    assert_eq!(steps(&mut lock, 1, &tall(1.9)), [LockState::Lost]);
    assert_eq!(lock.why, "looks like somebody else");
}

#[test]
fn nobody_is_told_apart_from_a_person_who_is_out_of_sight() {
    fn is_known(seen: bool) -> bool {
        let mut lock = new_lock(settings());
        steps(&mut lock, 20, &tall(1.6));
        step(&mut lock, &[tall(1.6).with_seen(seen), somebody(2, 2.0, 1.5)]);
        lock.others.contains(&TrackId(2))
    }

    assert!(is_known(true) && !is_known(false));
}

/// A quarter of a second out of sight is no reason to doubt a track.
#[test]
fn a_blink_is_no_reason_for_doubt() {
    let (mut lock, _) = missed(2);
    assert_eq!(steps(&mut lock, 9, &tall(1.9)), [LockState::Locked; 9]);
    let (mut lock, _) = missed(3);
    let states = steps(&mut lock, 9, &tall(1.9));
    assert!(states.contains(&LockState::Lost), "{states:?}");
}

#[test]
fn somebody_who_came_near_may_have_been_taken_for_the_person() {
    fn states(away_m: f64) -> Vec<LockState> {
        let mut lock = new_lock(settings());
        steps(&mut lock, 20, &tall(1.6));
        let other = somebody(2, 2.0, away_m);
        step(&mut lock, &[tall(1.6), other.clone()]);
        let gone = other.with_seen(false);
        let states = (0..9).map(|_| step(&mut lock, &[tall(1.9), gone.clone()]).state);
        states.collect::<Vec<_>>()
    }
    assert_eq!(states(0.81), [LockState::Locked; 9]);
    assert!(states(0.79).contains(&LockState::Lost));
}

#[test]
fn in_front_is_what_the_settings_say() {
    fn chosen(track: Track) -> bool {
        let mut lock = new_lock(settings());
        step(&mut lock, &[track]);
        lock.followed().is_some()
    }

    fn at(degrees: f64, range_m: f64) -> bool {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        chosen(somebody(1, range_m * cosine, range_m * sine))
    }

    assert!(at(44.0, 2.0) && at(-44.0, 2.0) && !at(46.0, 2.0) && !at(-46.0, 2.0));
    assert!(at(30.0, 4.9) && !at(30.0, 5.1));
    assert!(!chosen(somebody(1, 2.0, 0.0).with_confirmed(false)));
    let mut lock = new_lock(settings());
    lock.update(&frame(1, 0.0), &EgoMotion::at_rest(0.1), &[somebody(1, 2.0, 0.0)], &[], false)
        .unwrap();
    assert_eq!(lock.state(), LockState::Initial, "not yet");
}

#[test]
fn nobody_is_farther_than_they_can_have_walked() {
    let mut lock = new_lock(settings());
    assert!(lock.is_in_reach(&somebody(1, 99.0, 0.0)), "seen nowhere before");
    let (place, velocity) = (Point2::new(1.0, 1.0), Vector2::zeros());
    lock.last = Some(LastSeen { place, velocity, ago_s: 1.0 });
    for (off_m, variance, is_in_reach, why) in [
        (2.59, 0.0, true, "0.6 m and 2 m/s"),
        (2.61, 0.0, false, "0.6 m and 2 m/s"),
        (3.19, 0.02, true, "three times 0.2 m"),
        (3.21, 0.02, false, "three times 0.2 m"),
    ] {
        let mut track = somebody(1, 1.0, 1.0 + off_m);
        track.estimate.covariance = SMatrix::identity() * variance;
        assert_eq!(lock.is_in_reach(&track), is_in_reach, "{off_m}: {why}");
    }
}

#[test]
fn what_stood_beside_the_person_is_another_for_a_minute() {
    fn is_other(lock: &TargetLock, x: f64) -> bool {
        lock.is_other(&somebody(9, x, 0.0))
    }

    let mut lock = new_lock(settings());
    lock.note_other(&somebody(7, 3.0, 0.0));
    let mut walks = somebody(8, 5.0, 0.0);
    walks.estimate.person.velocity.x = 0.5;
    lock.note_other(&walks);
    assert!(is_other(&lock, 3.39) && !is_other(&lock, 3.41) && !is_other(&lock, 5.0));
    assert!(lock.is_other(&somebody(8, 9.0, 0.0)), "by the number of the track");
    lock.move_along(&EgoMotion { forward: 1.0, ..EgoMotion::at_rest(59.0) });
    assert!(is_other(&lock, 2.0) && !is_other(&lock, 3.0), "it stays where it is");
    lock.move_along(&EgoMotion::at_rest(1.5));
    assert!(!is_other(&lock, 2.0));
}

#[test]
fn after_a_jump_of_the_clock_the_person_is_lost_or_chosen_anew() {
    let (mut lock, _) = missed(0);
    lock.reset();
    assert_eq!((lock.state(), lock.why), (LockState::Lost, "the stamps jumped"));
    assert_eq!(lock.last_seen(), None);
    let mut lock = new_lock(TargetSettings { remember: false, ..settings() });
    steps(&mut lock, 3, &tall(1.6));
    lock.reset();
    assert_eq!(lock.state(), LockState::Initial);
}

#[test]
fn where_the_person_was_moves_with_the_robot() {
    let (mut lock, _) = missed(0);
    let turn = std::f64::consts::FRAC_PI_2;
    lock.move_along(&EgoMotion { forward: 1.0, turn, ..EgoMotion::at_rest(0.5) });
    let last = lock.last_seen().unwrap();
    assert!((last.place - Point2::new(0.0, -1.0)).norm() < 1e-9, "{last:?}");
    assert_eq!(last.ago_s, 0.5);
}

#[test]
fn states_say_whether_somebody_is_followed_and_doubted() {
    use LockState::*;
    let all = [Initial, Training, Locked, Suspect, Lost, Refound];
    assert_eq!(all.map(LockState::follows), [false, true, true, true, false, true]);
    assert_eq!(all.map(LockState::doubts), [false, false, false, true, false, true]);
    let words = all.map(LockState::name);
    assert_eq!(words, ["initial", "training", "locked", "suspect", "lost", "re-found"]);
}

#[test]
fn probabilities_and_log_odds_are_inverted() {
    for p in [0.01, 0.15, 0.5, 0.85, 0.999] {
        assert!((probability(logit(p)) - p).abs() < 1e-12);
    }
    assert!((logit(0.85) - (0.85_f64 / 0.15).ln()).abs() < 1e-12);
}

/// Lets a lock in this state see the person a head taller than known; returns how far the remembered
/// height is from the known one, m.
fn height_learnt_m(state: LockState, doubtful: bool) -> f64 {
    let (mut lock, _) = missed(0);
    lock.state = state;
    lock.doubtful = doubtful;
    let looks = BTreeMap::from([(TrackId(1), Appearance::in_one_colour(1.85, None))]);
    lock.learn(&[tall(1.85)], looks);
    lock.memory.differences(&Appearance::in_one_colour(1.6, None)).unwrap().height_m
}

#[test]
fn the_appearance_is_learned_without_doubt_alone() {
    use LockState::*;
    for state in [Training, Locked] {
        assert!(height_learnt_m(state, false) > 0.01, "{state:?}");
        assert!(height_learnt_m(state, true) < 1e-9, "{state:?}, in doubt");
    }
    for state in [Initial, Suspect, Lost, Refound] {
        assert!(height_learnt_m(state, false) < 1e-9, "{state:?}");
    }
}

/// For five sightings after three frames out of sight it may be another person.
#[test]
fn a_track_that_was_out_of_sight_teaches_nothing_at_first() {
    let (mut lock, _) = missed(3);
    let off_m: [f64; 14] =
        std::array::from_fn(|_| step(&mut lock, &[tall(1.63)]).likeness[0].differences.height_m);
    assert!(off_m[..5].iter().all(|off_m| (off_m - 0.03).abs() < 1e-9), "{off_m:?}");
    assert!(off_m[13] < 0.025, "then it is learned again: {off_m:?}");
}

#[test]
fn while_a_sensor_is_frozen_the_lock_is_not_known_unless_nobody_is_followed() {
    let report = LockReport {
        state: LockState::Locked,
        why: "known well",
        since_s: 9.0,
        belief: Some(1.0),
        likeness: Vec::new(),
    };
    let told = report.clone().of_frozen_sensor(true, 0.3);
    assert_eq!((told.state.name(), told.belief, told.since_s), ("not known", None, 0.3));
    assert!(told.why.contains("reset") && told.state.follows(), "{told:?}");
    assert!(!report.clone().of_frozen_sensor(false, 0.3).why.contains("reset"));
    let lost = LockReport { state: LockState::Lost, ..report };
    assert_eq!(lost.clone().of_frozen_sensor(true, 0.3), lost);
}
