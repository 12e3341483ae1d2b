use tagalong_core::{Detection, Reason, TrackId};

use super::doubles::{PLAIN, World, person, scored};
use crate::{FrameReport, LockState};

/// A person with the head at this height, m, confirmed at once.
fn tall(height_m: f64, x: f64, y: f64) -> Detection {
    let mut somebody = scored(5.0, person(x, y));
    somebody.position.z = height_m;
    somebody
}

/// There are no images: people are distinguished by their height.
fn config(target: &str) -> String {
    format!(
        "{PLAIN}\n[controller]\nplugin = 'drive'\n[target]\n{target}\n\
         [target.looks]\nheight = [0.06, 60.0]\n"
    )
}

fn ride(target: &str, frames: i32, people: impl Fn(i32) -> Vec<Detection>) -> Vec<FrameReport> {
    World::of((0..frames).map(people)).run(&config(target), frames as u64, 0.1)
}

fn states(reports: &[FrameReport]) -> Vec<LockState> {
    let mut states: Vec<_> =
        reports.iter().filter_map(|r| r.lock.as_ref()).map(|lock| lock.state).collect();
    states.dedup();
    states
}

fn followed(report: &FrameReport) -> Option<u32> {
    report.target.map(|TrackId(id)| id)
}

#[test]
fn the_nearest_in_front_is_chosen_and_known_well_after_some_sightings() {
    let reports =
        ride("", 30, |_| vec![tall(1.6, 4.0, 0.0), tall(1.6, 2.0, 0.3), tall(1.6, 0.5, 1.5)]);
    let last = &reports[29];
    let target = last.tracks.iter().find(|t| Some(t.id) == last.target).unwrap();
    assert_eq!(target.estimate.person.position.x, 2.0, "the nearest is not in front");
    assert_eq!(states(&reports), [LockState::Training, LockState::Locked]);
}

#[test]
fn who_is_nearest_is_chosen_even_if_seen_second() {
    for (settings, expected_m) in [("", 4.0), ("choose_after_s = 0.5", 2.0)] {
        let reports = ride(settings, 20, |i| match i {
            0..2 => vec![tall(1.6, 4.0, 0.0)],
            _ => vec![tall(1.6, 4.0, 0.0), tall(1.6, 2.0, 0.3)],
        });
        let last = &reports[19];
        let target = last.tracks.iter().find(|t| Some(t.id) == last.target).unwrap();
        assert_eq!(target.estimate.person.position.x, expected_m, "{settings}");
    }
}

#[test]
fn a_nearer_person_takes_over_for_a_while_after_the_choice() {
    let far = ride("", 3, |_| vec![tall(1.6, 4.0, 0.0)])[2].tracks[0].id.0;
    let enrolled = format!("track = {far}\nreconsider_s = 2.0");
    // The other person comes into sight in a frame, and walks past with a speed, m a frame.
    for (settings, first, [ahead, aside], step, target_m, why) in [
        ("reconsider_s = 2.0", 15, [2.0, 0.1], 0.0, 2.0, "nearer"),
        ("reconsider_s = 2.0", 25, [2.0, 0.1], 0.0, 4.0, "too late"),
        ("reconsider_s = 2.0", 15, [2.0, 1.0], 0.0, 4.0, "not in front"),
        ("reconsider_s = 4.0", 8, [2.0, 1.5], 0.1, 4.0, "walks past"),
        ("reconsider_s = 2.0", 15, [3.2, 0.1], 0.0, 4.0, "was in the image all along"),
        ("", 15, [2.0, 0.1], 0.0, 4.0, "off by default"),
        (&enrolled, 15, [2.0, 0.1], 0.0, 4.0, "a person who was named is kept"),
    ] {
        let settings = format!("choose_within_deg = 20.0\n{settings}");
        let reports = ride(&settings, 40, |i| match i {
            _ if i < first => vec![tall(1.6, 4.0, 0.0)],
            _ => vec![tall(1.6, 4.0, 0.0), tall(1.6, ahead, aside - step * f64::from(i - first))],
        });
        let last = &reports[39];
        let target = last.tracks.iter().find(|t| Some(t.id) == last.target).unwrap();
        assert_eq!(last.lock.as_ref().unwrap().state, LockState::Locked, "{settings}");
        assert_eq!(target.estimate.person.position.x, target_m, "{why}");
    }
}

#[test]
fn somebody_can_be_chosen_by_number() {
    fn people(_: i32) -> Vec<Detection> {
        vec![tall(1.6, 2.0, 0.0), tall(1.6, 4.0, 0.0)]
    }

    let far = ride("", 3, people)[2].tracks.iter().map(|t| t.id.0).max().unwrap();
    let reports = ride(&format!("track = {far}"), 5, people);
    assert_eq!(followed(&reports[4]), Some(far));
}

#[test]
fn a_person_who_is_gone_is_lost_and_nobody_else_is_taken() {
    let reports = ride("", 120, |i| match i {
        0..20 => vec![tall(1.6, 2.0, 0.0)],
        20..35 => vec![],
        _ => vec![tall(1.85, 2.0, 0.0)],
    });
    assert_eq!(reports[119].target, None);
    assert!(reports[119].tracks[0].confirmed, "somebody is there");
    assert_eq!(reports[119].command.unwrap().reason, Reason::NoTarget);
    let ends = [LockState::Suspect, LockState::Lost];
    assert!(states(&reports).ends_with(&ends), "{:?}", states(&reports));
}

#[test]
fn a_person_who_comes_back_is_known_again_after_several_sightings() {
    let reports = ride("", 90, |i| match i {
        0..20 => vec![tall(1.6, 2.0, 0.0)],
        20..40 => vec![tall(1.85, 4.0, 2.0)],
        _ => vec![tall(1.6, 2.5, 0.5), tall(1.85, 4.0, 2.0)],
    });
    let found = reports.iter().position(|r| r.lock.as_ref().unwrap().state == LockState::Refound);
    assert!((44..50).contains(&found.unwrap()), "{found:?}");
    let last = &reports[89];
    let target = last.tracks.iter().find(|t| Some(t.id) == last.target).unwrap();
    assert_eq!(target.estimate.person.position.z, 1.6);
    assert_eq!(last.lock.as_ref().unwrap().state, LockState::Locked);
    assert_eq!(reports[found.unwrap() + 19].command.unwrap().reason, Reason::Unsure);
}

/// A coat stand looks like the person; it was seen beside them, and out of sight since.
#[test]
fn what_stood_beside_the_person_is_never_taken_for_them() {
    for (back, is_taken) in [((3.0, -1.5), false), ((3.0, -0.8), true)] {
        let reports = ride("", 100, |i| match i {
            0..20 => vec![tall(1.6, 2.0, 0.0), tall(1.6, 3.0, -1.5)],
            20..40 => vec![tall(1.6, 3.0, -1.5)],
            40..60 => vec![],
            _ => vec![tall(1.6, back.0, back.1)],
        });
        assert!(reports[..20].iter().all(|r| r.target.is_some()));
        assert!(reports[45..60].iter().all(|r| r.target.is_none()), "{:?}", states(&reports));
        assert_eq!(reports[99].target.is_some(), is_taken, "{:?}", states(&reports));
    }
}

/// Another person walks beside the target, and goes on alone.
#[test]
fn who_walked_beside_the_person_is_not_taken_for_them_while_in_sight() {
    let reports = ride("", 90, |i| {
        let along_m = 2.0 + 0.05 * f64::from(i);
        let mut seen = vec![tall(1.6, along_m, -1.0)];
        seen.extend((i < 20).then(|| tall(1.6, along_m, 0.5)));
        seen
    });
    assert!(reports[45..].iter().all(|r| r.target.is_none()), "{:?}", states(&reports));
}

#[test]
fn nobody_comes_back_from_farther_than_they_can_have_got() {
    fn people(i: i32) -> Vec<Detection> {
        match i {
            0..20 => vec![tall(1.6, 1.5, 0.0)],
            20..33 => vec![],
            _ => vec![tall(1.6, 9.5, 0.0)],
        }
    }

    let reports = ride("", 45, people);
    assert_eq!(reports[44].target, None, "8 m in less than three seconds");
    let reports = ride("reach_mps = 9.0", 45, people);
    assert!(reports[44].target.is_some());
}

#[test]
fn a_track_that_changes_over_to_somebody_else_is_doubted_and_left() {
    // The other person comes near, and the target is gone.
    let reports = ride("", 60, |i| match i {
        0..20 => vec![tall(1.6, 3.0, 0.0)],
        20..24 => vec![tall(1.6, 3.0, 0.0), tall(1.9, 3.0, 0.5)],
        _ => vec![tall(1.9, 3.0, 0.1)],
    });
    assert!(reports[30..].iter().all(|r| r.target.is_none()), "{:?}", states(&reports));
}

#[test]
fn nobody_came_near_so_it_is_the_same_person_whatever_they_look_like() {
    let reports = ride("", 60, |i| vec![tall(if i < 20 { 1.6 } else { 1.3 }, 3.0, 0.0)]);
    assert_eq!(followed(&reports[59]), followed(&reports[0]));
    assert_eq!(states(&reports), [LockState::Training, LockState::Locked]);
}

#[test]
fn without_a_memory_a_track_is_followed_while_it_lives() {
    let reports = ride("remember = false", 80, |i| match i {
        0..20 => vec![tall(1.6, 2.0, 0.0)],
        20..40 => vec![],
        _ => vec![tall(1.6, 2.0, 0.0)],
    });
    assert_eq!(followed(&reports[10]), Some(1));
    assert!(reports[40..].iter().all(|r| r.target.is_none()));
}

#[test]
fn the_robot_looks_for_whoever_is_lost_where_it_may_and_gives_up() {
    fn people(i: i32) -> Vec<Detection> {
        if i < 20 { vec![tall(1.6, 3.0, 0.0)] } else { vec![] }
    }

    fn moves(r: &FrameReport) -> bool {
        r.command.unwrap().wheels != tagalong_core::WheelSpeeds::STOP
    }

    let search = "search = { enabled = true, give_up_s = 4.0 }";
    let reports = ride(search, 120, people);
    assert!(reports[55..65].iter().all(moves), "looks for them");
    assert!(reports[100..].iter().all(|r| !moves(r)), "has given up");
    assert!(ride("", 120, people)[45..].iter().all(|r| !moves(r)), "not allowed to");
}
