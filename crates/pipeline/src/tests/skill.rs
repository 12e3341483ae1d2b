//! Following as a skill: enroll, status, clear.

use tagalong_core::{Reason, TrackId};

use super::doubles::{PLAIN, World, frame, person, scored};
use crate::{Choice, Enrollment, EnrollmentError, FollowStatus, LockState, Pipeline};

const FOLLOWING: &str = "[controller]\nplugin = 'drive'\n[target]\n";

/// Returns a pipeline that sees a near person aside, one ahead, and from frame 20 on one that walks up
/// to 1.5 m and stands.
fn ride(target: &str) -> Ride {
    fn walker(i: i32) -> f64 {
        1.5 + 0.1 * f64::from((45 - i).max(0))
    }

    let world = World::of((0..200).map(|i| {
        let mut people = vec![(1.2, 0.9), (3.0, -0.5)];
        people.extend((i >= 20).then(|| (walker(i), 0.2)));
        people.into_iter().map(|(x, y)| scored(5.0, person(x, y))).collect()
    }));
    let pipeline = world.pipeline(&format!("{PLAIN}\n{FOLLOWING}{target}"));
    Ride { pipeline, frames: 0 }
}

struct Ride {
    pipeline: Pipeline,
    frames: u64,
}

impl Ride {
    /// Returns the status after so many more frames, a tenth of a second each.
    fn go_on(&mut self, frames: u64) -> FollowStatus {
        for _ in 0..frames {
            self.frames += 1;
            self.pipeline.step(frame(self.frames, self.frames as f64 * 0.1)).unwrap();
        }
        self.pipeline.status().unwrap()
    }

    fn enroll(&mut self, person: Choice) -> Result<(), EnrollmentError> {
        self.pipeline.enroll(&Enrollment::of(person))
    }
}

/// Returns the distance of the person ahead, m.
fn ahead_m() -> f64 {
    3.0_f64.hypot(0.5)
}

#[test]
fn a_robot_that_waits_for_an_enrollment_follows_the_person_of_it() {
    let mut ride = ride("choose = 'none'");
    let status = ride.go_on(10);
    assert_eq!((status.state, status.follows, status.command), ("initial", false, "no-target"));
    assert_eq!(status.people.len(), 2);
    assert!(status.people[0].bearing_deg > 30.0 && status.people[0].distance_m < 1.6);
    let ahead = status.people[1].clone();

    ride.enroll(Choice::Track(ahead.track)).unwrap();
    let status = ride.go_on(2);
    assert_eq!((status.track, status.follows), (Some(ahead.track), true));
    assert!((status.distance_m.unwrap() - ahead_m()).abs() < 1e-6, "{status:?}");
    assert!(status.confidence.unwrap() > 0.9);

    ride.enroll(Choice::Nearest).unwrap();
    assert_eq!(ride.go_on(2).track, Some(status.people[0].track));
    let [left, top, width, height] = ahead.region;
    ride.enroll(Choice::Point([left + 0.5 * width, top + 0.7 * height])).unwrap();
    assert_eq!(ride.go_on(2).track, Some(ahead.track));
}

#[test]
fn a_refused_enrollment_gives_its_reason_and_changes_nothing() {
    let mut ride = ride("");
    assert_eq!(ride.enroll(Choice::Nearest), Err(EnrollmentError::NoFrame));
    let before = ride.go_on(10);
    for wrong in [Choice::Track(TrackId(99)), Choice::Point([639.0, 479.0])] {
        let refusal = ride.enroll(wrong).unwrap_err().to_string();
        assert!(refusal.contains("tracks are"), "{refusal}");
    }
    assert_eq!(ride.go_on(1).track, before.track);
    let mut tracker = World::default().pipeline(PLAIN);
    let refusal = tracker.enroll(&Enrollment::of(Choice::Nearest)).unwrap_err();
    assert_eq!(refusal, EnrollmentError::NoController);
    assert!(tracker.status().is_none());
}

#[test]
fn clear_slows_the_robot_down_and_no_person_is_followed_after_it() {
    // With time to come to rest the robot would stop for the person aside.
    let mut ride = ride("[command_limiter]\nsettle_s = 0.0");
    let status = ride.go_on(15);
    assert_eq!((status.follows, status.command), (true, "limited"), "it wishes for 2 and 4 m/s");
    ride.pipeline.clear();
    let status = ride.go_on(1);
    assert_eq!((status.state, status.reason), (LockState::Initial.name(), "cleared"));
    // The former target is a person like others now: the robot keeps away.
    let gentle = [Reason::Stopping, Reason::Near].map(Reason::name);
    assert!(gentle.contains(&status.command), "no emergency: {}", status.command);
    let status = ride.go_on(30);
    assert_eq!((status.command, status.track), ("no-target", None));
    ride.enroll(Choice::Nearest).unwrap();
    assert!(ride.go_on(2).follows);
}

#[test]
fn a_person_that_walks_up_and_stops_is_followed_by_request_or_by_config() {
    for by_config in [false, true] {
        let mut ride = ride(if by_config { "choose = 'approach'" } else { "choose = 'none'" });
        ride.go_on(15);
        if !by_config {
            ride.enroll(Choice::Approach).unwrap();
        }
        assert!(!ride.go_on(30).follows, "walks still, and the others stood there from the start");
        let status = ride.go_on(25);
        assert!((status.distance_m.unwrap() - 1.5_f64.hypot(0.2)).abs() < 0.05, "{status:?}");
    }
}
