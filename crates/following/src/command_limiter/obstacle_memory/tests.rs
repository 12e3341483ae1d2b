use nalgebra::Vector2;
use tagalong_conformance::target;
use tagalong_geometry::{Distortion, Pinhole};

use super::*;

/// A camera 1 m high with a field of view of 90 by 67 degrees.
fn camera() -> Camera {
    let lens = Pinhole { fx: 40.0, fy: 40.0, cx: 39.5, cy: 29.5, distortion: Distortion::None };
    Camera::mounted(lens, 80, 60, 1.0, 0.0, 0.0)
}

/// Frames after which an obstacle is static, at 10 a second.
const WAIT: usize = 12;

/// A wall at 6 m and a box 0.4 m wide and 0.6 m high, its front at (x, y).
fn with_box(x: f64, y: f64) -> DepthImage {
    let camera = camera();
    DepthImage::from_fn(80, 60, |u, v| {
        let at = camera.back_project(Point2::new(u as f64, v as f64), x);
        let hit = (at.y - y).abs() < 0.2 && at.z < 0.6;
        let floor = camera.back_project(Point2::new(u as f64, v as f64), 1.0);
        let floor_m = if floor.z < 1.0 { 1.0 / (1.0 - floor.z) } else { 6.0 };
        if hit && x < floor_m { x as f32 } else { floor_m.min(6.0) as f32 }
    })
}

fn person(x: f64, y: f64, forward_mps: f64) -> Person {
    Person { position: Point3::new(x, y, 1.6), velocity: Vector2::new(forward_mps, 0.0) }
}

/// Waits before a box at `from_m`, then drives straight towards it, until it is `to_m` away.
fn approach(y: f64, from_m: f64, to_m: f64, memory_s: f64, someone: bool) -> Option<Ahead> {
    let settings = CollisionMonitorSettings { memory_s, ..CollisionMonitorSettings::default() };
    let mut surroundings = ObstacleMemory::default();
    let steps = ((from_m - to_m) / 0.05).round() as usize;
    for step in (0..WAIT).map(|_| 0).chain(1..=steps) {
        let x = from_m - 0.05 * step as f64;
        let forward = if step == 0 { 0.0 } else { 0.05 };
        let motion = EgoMotion { forward, ..EgoMotion::at_rest(0.1) };
        let people = someone.then(|| person(x, y, 0.0));
        let depth = with_box(x, y);
        surroundings.update(&settings, &camera(), Some(&depth), &motion, people.as_ref());
    }
    surroundings.ahead(&settings, 0.0, None)
}

fn is_at(ahead: Option<Ahead>, metres: f64) -> bool {
    matches!(ahead, Some(Ahead::Something(at)) if (at - metres).abs() < 0.1)
}

#[test]
fn a_low_thing_that_sank_below_the_image_is_still_there() {
    assert!(is_at(approach(0.0, 1.5, 1.2, 8.0, false), 1.0), "in view");
    let near = approach(0.0, 1.5, 0.5, 8.0, false);
    assert!(is_at(near, 0.3), "{near:?}");
    assert_eq!(approach(0.0, 1.5, 0.5, 0.0, false), Some(Ahead::Free), "without memory");
}

#[test]
fn a_thing_beside_the_robot_is_in_the_way_of_a_bend() {
    let settings = CollisionMonitorSettings::default();
    let mut surroundings = ObstacleMemory::default();
    let depth = with_box(1.0, 0.7);
    let still = EgoMotion::at_rest(0.1);
    for _ in 0..WAIT {
        surroundings.update(&settings, &camera(), Some(&depth), &still, None);
    }
    let on = EgoMotion { forward: 0.6, ..still };
    surroundings.update(&settings, &camera(), Some(&with_box(9.0, 0.0)), &on, None);
    assert_eq!(surroundings.ahead(&settings, 0.0, None), Some(Ahead::Free));
    let bend = surroundings.ahead(&settings, 1.2, None);
    assert!(matches!(bend, Some(Ahead::Something(at)) if at < 0.6), "{bend:?}");
}

#[test]
fn people_are_not_remembered_and_what_is_gone_is_forgotten() {
    assert_eq!(approach(0.0, 1.5, 0.5, 8.0, true), Some(Ahead::Free));
    let settings = CollisionMonitorSettings::default();
    let mut surroundings = ObstacleMemory::default();
    let mut look = |x| {
        let (depth, still) = (with_box(x, 0.0), EgoMotion::at_rest(0.1));
        surroundings.update(&settings, &camera(), Some(&depth), &still, None);
        surroundings.ahead(&settings, 0.0, None)
    };
    assert!(is_at(look(1.5), 1.3));
    assert_eq!(look(9.0), Some(Ahead::Free));
}

/// A person gets up from a box and walks away, and the robot drives after them.
#[test]
fn what_the_person_sat_on_is_remembered_when_they_have_gone() {
    let settings = CollisionMonitorSettings::default();
    let mut surroundings = ObstacleMemory::default();
    let mut look = |x: f64, forward: f64, person: &Person| {
        let (depth, still) = (with_box(x, 0.0), EgoMotion::at_rest(0.1));
        let motion = EgoMotion { forward, ..still };
        surroundings.update(&settings, &camera(), Some(&depth), &motion, Some(person));
        surroundings.ahead(&settings, 0.0, Some(person.position.xy()))
    };
    for _ in 0..WAIT {
        assert_eq!(look(1.5, 0.0, &person(1.5, 0.0, 0.0)), Some(Ahead::Free), "it is theirs");
    }
    let gone = person(2.9, 0.0, 0.7);
    assert!(is_at(look(1.5, 0.0, &gone), 1.3));
    for step in 1..=7 {
        look(1.5 - 0.15 * f64::from(step), 0.15, &gone);
    }
    let then = (0..60).map(|_| look(9.0, 0.0, &gone)).last();
    assert!(is_at(then.flatten(), 0.25), "{then:?}");
}

/// The seat of a chair, whose back stands beside the path, is in view for two frames.
#[test]
fn a_low_part_of_what_stands_is_remembered_though_it_was_seen_briefly() {
    let settings = CollisionMonitorSettings::default();
    let is_there = |with_back: bool| {
        let mut surroundings = ObstacleMemory::default();
        let mut look = |depth: &DepthImage, forward: f64| {
            let motion = EgoMotion { forward, ..EgoMotion::at_rest(0.1) };
            surroundings.update(&settings, &camera(), Some(depth), &motion, None);
            surroundings.ahead(&settings, 0.0, None) != Some(Ahead::Free)
        };
        let back = with_box(if with_back { 1.4 } else { 9.0 }, 0.6);
        let seat = with_box(1.5, 0.3);
        let both = DepthImage::from_fn(80, 60, |u, v| back.row(v)[u].min(seat.row(v)[u]));
        let images = [vec![&back; WAIT], vec![&both; 2]].concat();
        for image in images {
            look(image, 0.0);
        }
        look(&with_box(9.0, 0.0), 0.9);
        (0..60).map(|_| look(&with_box(9.0, 0.0), 0.0)).last()
    };
    assert_eq!((is_there(true), is_there(false)), (Some(true), Some(false)));
}

/// A person with the head above the image crosses the path a metre before the robot: only the
/// legs were seen, and they are not remembered.
#[test]
fn who_walks_by_is_not_remembered() {
    let settings = CollisionMonitorSettings::default();
    let mut surroundings = ObstacleMemory::default();
    let mut seen = 0;
    for step in 0..=30 {
        let y = -1.5 + 0.1 * f64::from(step);
        let depth = if step < 15 { with_box(1.2, y) } else { with_box(9.0, 0.0) };
        let forward = if step < 15 { 0.0 } else { 0.05 };
        let motion = EgoMotion { forward, ..EgoMotion::at_rest(0.1) };
        surroundings.update(&settings, &camera(), Some(&depth), &motion, None);
        let ahead = surroundings.ahead(&settings, 0.0, None);
        seen += u32::from(matches!(ahead, Some(Ahead::Something(_))));
    }
    assert!(seen >= 3, "{seen}");
    assert_eq!(surroundings.ahead(&settings, 0.0, None), Some(Ahead::Free));
}

/// A box half a metre beside the path stands, or moves towards it.
#[test]
fn what_moves_has_a_wider_way_than_what_stands() {
    let settings = CollisionMonitorSettings::default();
    for (step_m, is_in_the_way) in [(0.0, false), (-0.06, true)] {
        let mut surroundings = ObstacleMemory::default();
        for step in 0..=WAIT {
            let y = 0.7 + step_m * (step as f64 - WAIT as f64);
            let depth = with_box(1.0, y);
            surroundings.update(&settings, &camera(), Some(&depth), &EgoMotion::at_rest(0.1), None);
        }
        let ahead = surroundings.ahead(&settings, 0.0, None);
        assert_eq!(is_at(ahead, 0.8), is_in_the_way, "{step_m}: {ahead:?}");
    }
}

/// A person steps close before the robot, and is out of the image at once.
#[test]
fn who_left_the_image_close_before_the_robot_is_believed_there_for_a_while() {
    let settings = CollisionMonitorSettings::default();
    let mut surroundings = ObstacleMemory::default();
    let mut look = |x, y, forward| {
        let motion = EgoMotion { forward, ..EgoMotion::at_rest(0.1) };
        surroundings.update(&settings, &camera(), Some(&with_box(x, y)), &motion, None);
        surroundings.ahead(&settings, 0.0, None)
    };
    look(0.75, 0.3, 0.0);
    look(9.0, 0.0, 0.5);
    let then: Vec<bool> = (0..60).map(|_| look(9.0, 0.0, 0.0) != Some(Ahead::Free)).collect();
    assert!(then[..40].iter().all(|there| *there), "{then:?}");
    assert!(then[55..].iter().all(|there| !there), "{then:?}");
}

/// A suitcase stands behind a person, and is gone with them when the robot is so near that it
/// would be below the image; a box that a person walks past is not.
#[test]
fn what_stands_beside_whoever_stands_may_be_carried_away() {
    let settings = CollisionMonitorSettings::default();
    for (speed_mps, expected_m) in [(0.0, None), (0.6, Some(0.3))] {
        let mut surroundings = ObstacleMemory::default();
        let person = person(1.7, 0.3, speed_mps);
        let mut look = |x: f64, forward, target: Option<&Person>| {
            let motion = EgoMotion { forward, ..EgoMotion::at_rest(0.1) };
            surroundings.update(&settings, &camera(), Some(&with_box(x, 0.0)), &motion, target);
            surroundings.ahead(&settings, 0.0, None)
        };
        (0..WAIT).for_each(|_| _ = look(1.2, 0.0, Some(&person)));
        let near = look(0.5, 0.7, None);
        let gone = (0..60).fold(near, |_, _| look(9.0, 0.0, None));
        match expected_m {
            None => assert_eq!(gone, Some(Ahead::Free), "{near:?}"),
            Some(metres) => assert!(is_at(gone, metres), "{gone:?}"),
        }
    }
}

/// A standing person's legs are below the image when the robot is near; a missing trunk shows
/// that the legs are gone too. A low box may still be there.
#[test]
fn who_stood_and_left_is_gone_down_to_the_feet() {
    let settings = CollisionMonitorSettings::default();
    for (top_m, is_gone) in [(1.4, true), (0.5, false)] {
        let (camera, empty) = (camera(), with_box(9.0, 0.0));
        let seen = |x: f64, stands: bool| {
            DepthImage::from_fn(80, 60, |u, v| {
                let at = camera.back_project(Point2::new(u as f64, v as f64), x);
                let hit = stands && at.y.abs() < 0.2 && 0.1 < at.z && at.z < top_m;
                if hit { x as f32 } else { empty.row(v)[u] }
            })
        };
        let mut surroundings = ObstacleMemory::default();
        let mut look = |x, forward, stands| {
            let motion = EgoMotion { forward, ..EgoMotion::at_rest(0.1) };
            let depth = seen(x, stands);
            surroundings.update(&settings, &camera, Some(&depth), &motion, None);
            surroundings.ahead(&settings, 0.0, None)
        };
        (0..WAIT).for_each(|_| _ = look(1.6, 0.0, true));
        look(0.6, 1.0, true);
        let left = look(0.6, 0.0, false);
        assert_eq!(left == Some(Ahead::Free), is_gone, "{top_m}: {left:?}");
    }
}

fn there(x: f64, y: f64) -> Track {
    target(x, y, Vector2::zeros())
}

#[test]
fn whoever_stepped_before_the_robot_is_there_until_they_are_seen_elsewhere() {
    let settings = CollisionMonitorSettings::default();
    let mut surroundings = ObstacleMemory::default();
    let mut look = |forward, seen: Option<Track>, followed| {
        let motion = EgoMotion { forward, ..EgoMotion::at_rest(0.1) };
        let depth = with_box(9.0, 0.0);
        surroundings.update(&settings, &camera(), Some(&depth), &motion, None);
        surroundings.add_tracks(seen.as_slice(), followed);
        surroundings.ahead(&settings, 0.0, None)
    };
    look(0.0, Some(there(0.6, 0.1)), None);
    let near = look(0.3, None, None);
    assert!(matches!(near, Some(Ahead::Something(at)) if at < 0.2), "{near:?}");
    assert_eq!(look(0.0, Some(there(0.5, 0.9)), None), Some(Ahead::Free));
    look(0.0, Some(there(0.3, 0.1)), None);
    assert_eq!(look(0.0, Some(there(0.3, 0.1)), Some(TrackId(1))), Some(Ahead::Free));
}

/// A person steps in from the side, nearer than the camera measures.
#[test]
fn where_the_image_went_dark_from_top_to_bottom_somebody_stands() {
    let settings = CollisionMonitorSettings::default();
    let mut surroundings = ObstacleMemory::default();
    let mut look =
        |dark: std::ops::Range<usize>| {
            let seen = with_box(9.0, 0.0);
            let depth = DepthImage::from_fn(80, 60, |u, v| {
                if dark.contains(&u) { f32::NAN } else { seen.row(v)[u] }
            });
            let motion = EgoMotion::at_rest(0.1);
            surroundings.update(&settings, &camera(), Some(&depth), &motion, None);
            surroundings.ahead(&settings, 0.0, None)
        };
    assert_eq!(look(0..20), Some(Ahead::Free), "a border that was always empty");
    assert!(is_at(look(0..50), HIDES_M - settings.front_m));
    assert_eq!(look(0..20), Some(Ahead::Free), "gone");
    assert_eq!(look(0..23), Some(Ahead::Free), "too narrow");
}

/// The columns in the middle lose their depth: of a stereo pair that is an object where the image has
/// texture, and nothing where it is smooth but for the noise of the camera.
#[test]
fn what_a_stereo_pair_cannot_match_for_want_of_texture_is_no_object() {
    let settings = CollisionMonitorSettings::default();
    let seen = with_box(9.0, 0.0);
    let dark =
        DepthImage::from_fn(
            80,
            60,
            |u, v| {
                if (30..50).contains(&u) { f32::NAN } else { seen.row(v)[u] }
            },
        );
    let noisy = |u: usize, v: usize| 100 + ((7 * u + 3 * v) % 5) as u8;
    for (stripes, expected) in [(40, Some(HIDES_M - settings.front_m)), (0, None)] {
        let mut surroundings = ObstacleMemory::default();
        let image =
            GreyImage::from_fn(80, 60, |u, v| noisy(u, v) + if u % 4 < 2 { stripes } else { 0 });
        for depth in [&seen, &dark, &dark] {
            surroundings.update(&settings, &camera(), Some(depth), &EgoMotion::at_rest(0.1), None);
            surroundings.excuse_smooth(&image);
        }
        let found = surroundings.ahead(&settings, 0.0, None);
        match expected {
            Some(metres) => assert!(is_at(found, metres), "{found:?}"),
            None => assert_eq!(found, Some(Ahead::Free)),
        }
    }
}

/// A laser scanner hits a person beside the robot, with and without a depth image: an obstacle
/// in a bend as long as the hits last. Hits high above are no obstacle, nor is the followed
/// person; one ray may be dust.
#[test]
fn what_a_laser_met_is_in_the_way_for_as_long_as_it_meets_it() {
    let settings = CollisionMonitorSettings::default();
    let still = EgoMotion::at_rest(0.1);
    let leg = [Point3::new(0.45, 0.4, 0.2), Point3::new(0.45, 0.42, 0.2)];
    let shelf = leg.map(|point| point + Vector3::z() * 1.5);
    let is_near = |ahead| matches!(ahead, Some(Ahead::Something(at)) if at < 0.6);
    for depth in [Some(with_box(9.0, 0.0)), None] {
        let mut surroundings = ObstacleMemory::default();
        let mut feel = |laser: &[Point3<f64>], curvature, target| {
            surroundings.update(&settings, &camera(), depth.as_ref(), &still, None);
            surroundings.add_scan(&settings, Some(laser), &still);
            surroundings.ahead(&settings, curvature, target)
        };
        assert_eq!(feel(&leg, 0.0, None), Some(Ahead::Free), "beside the way");
        assert!(is_near(feel(&leg, 1.2, None)), "in the way of a bend");
        assert_eq!(feel(&leg, 1.2, Some(Point2::new(0.5, 0.5))), Some(Ahead::Free));
        assert_eq!(feel(&leg[..1], 1.2, None), Some(Ahead::Free), "dust");
        assert_eq!(feel(&shelf, 1.2, None), Some(Ahead::Free), "overhead");
        assert_eq!(feel(&[], 1.2, None), Some(Ahead::Free), "gone");
    }
}

#[test]
fn without_depth_there_is_nothing_to_say_and_an_empty_image_is_blind() {
    let settings = CollisionMonitorSettings::default();
    let mut surroundings = ObstacleMemory::default();
    let still = EgoMotion::at_rest(0.1);
    surroundings.update(&settings, &camera(), None, &still, None);
    assert_eq!(surroundings.ahead(&settings, 0.0, None), None);
    let empty = DepthImage::from_fn(80, 60, |_, _| f32::NAN);
    surroundings.update(&settings, &camera(), Some(&empty), &still, None);
    assert_eq!(surroundings.ahead(&settings, 0.0, None), Some(Ahead::Blind));
}

/// A camera as [`camera`] with as many columns as are sampled of an image.
fn fine_camera() -> Camera {
    let lens = Pinhole { fx: 80.0, fy: 80.0, cx: 79.5, cy: 59.5, distortion: Distortion::None };
    Camera::mounted(lens, 160, 120, 1.0, 0.0, 0.0)
}

/// A floor that lies `drop_m` lower from `edge_m` on, and a wall at 6 m.
fn with_edge(edge_m: f64, drop_m: f64) -> DepthImage {
    let camera = fine_camera();
    DepthImage::from_fn(160, 120, |u, v| {
        // The camera is level and 1 m high: a ray falls by this much for each metre of depth.
        let falls = 1.0 - camera.back_project(Point2::new(u as f64, v as f64), 1.0).z;
        let hits = |height_m: f64| if falls > 0.0 { height_m / falls } else { f64::INFINITY };
        let floor_m = if hits(1.0) < edge_m { hits(1.0) } else { hits(1.0 + drop_m) };
        floor_m.min(6.0) as f32
    })
}

fn before_edge(edge_m: f64, drop_m: f64, target: Option<Point2<f64>>) -> Option<Ahead> {
    let settings = CollisionMonitorSettings::default();
    let mut surroundings = ObstacleMemory::default();
    let (depth, still) = (with_edge(edge_m, drop_m), EgoMotion::at_rest(0.1));
    surroundings.update(&settings, &fine_camera(), Some(&depth), &still, None);
    surroundings.ahead(&settings, 0.0, target)
}

#[test]
fn a_stair_and_a_kerb_that_go_down_are_obstacles_where_the_floor_ends() {
    for (edge_m, drop_m) in [(1.6, 0.17), (2.2, 0.17), (1.6, 0.14), (1.8, 2.5)] {
        let found = before_edge(edge_m, drop_m, None);
        assert!(is_at(found, edge_m - 0.2), "{edge_m} {drop_m}: {found:?}");
    }
    assert_eq!(before_edge(9.0, 0.17, None), Some(Ahead::Free), "a floor without an edge");
    assert_eq!(before_edge(1.6, 0.05, None), Some(Ahead::Free), "a rough floor");
}

#[test]
fn a_fall_beside_the_target_is_none_of_the_target() {
    let target = Some(Point2::new(1.7, 0.0));
    assert!(is_at(before_edge(1.6, 0.17, target), 1.4));
}

/// The camera sees no floor nearer than 1.4 m.
#[test]
fn a_fall_below_the_image_is_remembered() {
    let settings = CollisionMonitorSettings::default();
    let mut surroundings = ObstacleMemory::default();
    for step in 0..40 {
        let driven_m = 0.05 * f64::from((step - 20).max(0));
        let forward = if step > 20 { 0.05 } else { 0.0 };
        let motion = EgoMotion { forward, ..EgoMotion::at_rest(0.1) };
        let depth = with_edge(1.8 - driven_m, 0.17);
        surroundings.update(&settings, &fine_camera(), Some(&depth), &motion, None);
    }
    let found = surroundings.ahead(&settings, 0.0, None);
    assert!(is_at(found, 1.8 - 0.95 - 0.2), "{found:?}");
}

/// A wrong match of a stereo pair lies below the floor in two images, and then there is no depth.
#[test]
fn a_fall_that_was_seen_too_briefly_is_not_remembered() {
    let settings = CollisionMonitorSettings::default();
    let (fall, floor) = (with_edge(1.6, 0.17), with_edge(9.0, 0.0));
    let nothing = DepthImage::from_fn(160, 120, |u, v| match floor.row(v)[u] {
        z if z == fall.row(v)[u] => z,
        _ => f32::NAN,
    });
    for (images, is_remembered) in [(2, false), (6, true)] {
        let mut surroundings = ObstacleMemory::default();
        let mut look = |depth: &DepthImage| {
            let still = EgoMotion::at_rest(0.1);
            surroundings.update(&settings, &fine_camera(), Some(depth), &still, None);
            surroundings.ahead(&settings, 0.0, None)
        };
        for _ in 0..images {
            assert!(is_at(look(&fall), 1.4), "it counts at once");
        }
        assert_eq!(look(&nothing) != Some(Ahead::Free), is_remembered, "{images}");
    }
}

#[test]
fn a_sensor_that_falls_silent_and_the_lack_of_all_sensors_are_no_eyes() {
    let settings = CollisionMonitorSettings::default();
    let still = EgoMotion::at_rest(0.1);
    let depth = with_edge(9.0, 0.0);
    let mut surroundings = ObstacleMemory::default();
    let mut sees = |has_depth: bool, has_laser: bool, frames: u32| {
        for _ in 0..frames {
            let depth = has_depth.then_some(&depth);
            surroundings.update(&settings, &fine_camera(), depth, &still, None);
            surroundings.add_scan(&settings, has_laser.then_some(&[]), &still);
        }
        surroundings.is_sighted(&settings, 0.45)
    };
    assert!(!sees(false, false, 1), "no sensor at all");
    assert!(sees(true, false, 20), "there never was a laser");
    assert!(!sees(false, false, 1), "not even a frame without depth");
    assert!(sees(true, true, 1));
    assert!(sees(true, false, 4), "a scan is late");
    assert!(!sees(true, false, 1), "the laser is silent");
    assert!(sees(true, true, 1) && sees(false, true, 4));
    assert!(!sees(false, true, 1), "the camera is silent");
    let without = CollisionMonitorSettings { obstacles: ObstacleSource::None, ..settings };
    assert!(ObstacleMemory::default().is_sighted(&without, 0.5), "in those words");
}

#[test]
fn a_jump_of_the_clock_does_not_forget_which_sensors_there_were() {
    let settings = CollisionMonitorSettings::default();
    let still = EgoMotion::at_rest(0.3);
    let mut surroundings = ObstacleMemory::default();
    surroundings.add_scan(&settings, Some(&[]), &still);
    surroundings.clear();
    for _ in 0..2 {
        surroundings.update(&settings, &fine_camera(), Some(&with_edge(9.0, 0.0)), &still, None);
        surroundings.add_scan(&settings, None, &still);
    }
    assert!(!surroundings.is_sighted(&settings, 0.5));
}

/// Between two scans the robot moves towards what the last one met.
#[test]
fn the_last_scan_holds_until_the_next_one() {
    let settings = CollisionMonitorSettings::default();
    let mut surroundings = ObstacleMemory::default();
    let leg = [Point3::new(1.2, 0.0, 0.2); 2];
    surroundings.add_scan(&settings, Some(&leg), &EgoMotion::at_rest(0.1));
    let motion = EgoMotion { forward: 0.5, ..EgoMotion::at_rest(0.1) };
    surroundings.add_scan(&settings, None, &motion);
    assert!(is_at(surroundings.ahead(&settings, 0.0, None), 0.5));
}
