use nalgebra::Vector2;
use tagalong_conformance::target;
use tagalong_geometry::{Distortion, Pinhole};

use super::super::People;
use super::super::binned::BinnedHazards;
use super::super::coverage::allowed_part;
use super::super::depth_state::add_hazards;
use super::super::footprint::Path;
use super::super::space::SpaceGrid;
use super::super::sweep::{Braking, HazardKind, allowance};
use super::*;

/// Result of a look along an arc.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Ahead {
    Free,
    /// An obstacle at this distance before the front, m.
    Something(f64),
}

/// Settings without the room that people need, which is judged elsewhere.
fn settings() -> CollisionMonitorSettings {
    CollisionMonitorSettings {
        separation: false,
        stop_m: 0.15,
        ..CollisionMonitorSettings::default()
    }
}

fn memory() -> ObstacleMemory {
    ObstacleMemory::new(Footprint::new(&crate::RobotSettings::default().footprint))
}

impl ObstacleMemory {
    /// Returns what is straight ahead after a further image.
    fn ahead_after(
        &mut self,
        depth: &DepthImage,
        forward: f64,
        target: Option<&Person>,
    ) -> Option<Ahead> {
        let settings = settings();
        let motion = EgoMotion { forward, ..EgoMotion::at_rest(0.1) };
        self.update(&settings, &camera(), depth, &motion, target);
        self.ahead(&settings, 0.0, None)
    }

    /// Returns what is ahead on an arc, but for what belongs to the followed person.
    fn ahead(
        &self,
        settings: &CollisionMonitorSettings,
        curvature: f64,
        target: Option<Point2<f64>>,
    ) -> Option<Ahead> {
        let track = target.map(|at| there(at.x, at.y));
        let people = People { settings, tracks: track.as_slice(), target: track.as_ref() };
        let mut hazards = BinnedHazards::default();
        hazards.begin(settings, &self.footprint);
        add_hazards(settings, self, &SpaceGrid::default(), &people, &mut hazards);
        let all: Vec<_> = hazards
            .all()
            .iter()
            .copied()
            .filter(|hazard| !matches!(hazard.kind, HazardKind::Followed(_)))
            .collect();
        let path = Path::Arc { curvature, backwards: false };
        // With this reaction and without a way to brake the speed is the way.
        let braking =
            Braking { reaction_s: 1.0, rise_s: 0.0, decel: 1e12, between_s: 0.0, settle_s: 0.0 };
        let most = allowance(settings, &self.footprint, &all, path, 2.9, &braking).most;
        Some(if most > 2.9 { Ahead::Free } else { Ahead::Something(most + settings.stop_m) })
    }
}

/// A camera 1 m high with a field of view of 90 by 67 degrees.
fn camera() -> Camera {
    let lens = Pinhole { fx: 40.0, fy: 40.0, cx: 39.5, cy: 29.5, distortion: Distortion::None };
    Camera::mounted(lens, 80, 60, 1.0, 0.0, 0.0)
}

/// Frames after which an obstacle is static, at 10 a second.
const WAIT: usize = 12;

/// A wall at 6 m and a box 0.4 m wide and 0.6 m high, its front at (x, y).
fn with_box(x: f64, y: f64) -> DepthImage {
    with_box_of(x, y, 0.6)
}

/// The same with a box of another height, m.
fn with_box_of(x: f64, y: f64, top_m: f64) -> DepthImage {
    let camera = camera();
    DepthImage::from_fn(80, 60, |u, v| {
        let at = camera.back_project(Point2::new(u as f64, v as f64), x);
        let hit = (at.y - y).abs() < 0.2 && at.z < top_m;
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
    let settings = CollisionMonitorSettings { memory_s, ..settings() };
    let mut surroundings = memory();
    let steps = ((from_m - to_m) / 0.05).round() as usize;
    for step in (0..WAIT).map(|_| 0).chain(1..=steps) {
        let x = from_m - 0.05 * step as f64;
        let forward = if step == 0 { 0.0 } else { 0.05 };
        let motion = EgoMotion { forward, ..EgoMotion::at_rest(0.1) };
        let people = someone.then(|| person(x, y, 0.0));
        let depth = with_box(x, y);
        surroundings.update(&settings, &camera(), &depth, &motion, people.as_ref());
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
    let forgetful = approach(0.0, 1.5, 0.5, 0.0, false);
    assert!(is_at(forgetful, 0.3), "as near as that until it is seen to be gone: {forgetful:?}");
}

#[test]
fn a_thing_beside_the_robot_is_in_the_way_of_a_bend() {
    let settings = settings();
    let mut surroundings = memory();
    let depth = with_box(1.0, 0.7);
    let still = EgoMotion::at_rest(0.1);
    for _ in 0..WAIT {
        surroundings.update(&settings, &camera(), &depth, &still, None);
    }
    let on = EgoMotion { forward: 0.6, ..still };
    surroundings.update(&settings, &camera(), &with_box(9.0, 0.0), &on, None);
    assert_eq!(surroundings.ahead(&settings, 0.0, None), Some(Ahead::Free));
    let bend = surroundings.ahead(&settings, 1.2, None);
    assert!(matches!(bend, Some(Ahead::Something(at)) if at < 0.7), "{bend:?}");
}

#[test]
fn people_are_not_remembered_and_what_is_gone_is_forgotten() {
    assert_eq!(approach(0.0, 1.5, 0.5, 8.0, true), Some(Ahead::Free));
    let mut surroundings = memory();
    assert!(is_at(surroundings.ahead_after(&with_box(1.5, 0.0), 0.0, None), 1.3));
    let gone = surroundings.ahead_after(&with_box(9.0, 0.0), 0.0, None);
    assert_eq!(gone, Some(Ahead::Free));
}

/// A person gets up from a box and walks away, and the robot drives after them.
#[test]
fn what_the_person_sat_on_is_remembered_when_they_have_gone() {
    let settings = settings();
    let mut surroundings = memory();
    let sitting = person(1.5, 0.0, 0.0);
    for _ in 0..WAIT {
        surroundings.ahead_after(&with_box(1.5, 0.0), 0.0, Some(&sitting));
        let ahead = surroundings.ahead(&settings, 0.0, Some(sitting.position.xy()));
        assert_eq!(ahead, Some(Ahead::Free), "it is theirs");
    }
    let gone = person(2.9, 0.0, 0.7);
    surroundings.ahead_after(&with_box(1.5, 0.0), 0.0, Some(&gone));
    assert!(is_at(surroundings.ahead(&settings, 0.0, Some(gone.position.xy())), 1.3));
    for step in 1..=7 {
        let depth = with_box(1.5 - 0.15 * f64::from(step), 0.0);
        surroundings.ahead_after(&depth, 0.15, Some(&gone));
    }
    for _ in 0..60 {
        surroundings.ahead_after(&with_box(9.0, 0.0), 0.0, Some(&gone));
    }
    let then = surroundings.ahead(&settings, 0.0, Some(gone.position.xy()));
    assert!(is_at(then, 0.25), "{then:?}");
}

/// A box sinks below the image: with its last decimetre not filled, and after a person got up from it.
#[test]
fn what_sinks_below_the_image_is_not_gone_by_the_heights_above_it() {
    for (top_m, sitter_m) in [(0.62, None), (0.58, Some(1.4))] {
        let mut surroundings = memory();
        let both = with_box_of(1.5, 0.0, sitter_m.unwrap_or(top_m));
        for _ in 0..WAIT {
            surroundings.ahead_after(&both, 0.0, None);
        }
        let mut then = None;
        for step in 0..=20 {
            let driven_m = 0.05 * f64::from(step);
            let forward = if step == 0 { 0.0 } else { 0.05 };
            let depth = with_box_of(1.5 - driven_m, 0.0, top_m);
            then = surroundings.ahead_after(&depth, forward, None);
        }
        assert!(is_at(then, 0.25), "{top_m}: {then:?}");
    }
}

/// The seat of a chair, whose back stands beside the path, is in view for two frames.
#[test]
fn a_low_part_of_what_stands_is_remembered_though_it_was_seen_briefly() {
    let nothing = with_box(9.0, 0.0);
    for (back_m, is_there) in [(1.4, true), (9.0, false)] {
        let mut surroundings = memory();
        let back = with_box(back_m, 0.6);
        let seat = with_box_of(1.5, 0.3, 0.2);
        let both = DepthImage::from_fn(80, 60, |u, v| back.row(v)[u].min(seat.row(v)[u]));
        for image in [vec![&back; WAIT], vec![&both; 2]].concat() {
            surroundings.ahead_after(image, 0.0, None);
        }
        surroundings.ahead_after(&nothing, 0.45, None);
        let mut then = None;
        for _ in 0..60 {
            then = surroundings.ahead_after(&nothing, 0.0, None);
        }
        assert_eq!(then != Some(Ahead::Free), is_there, "{back_m}: {then:?}");
    }
}

/// A person with the head above the image crosses the path a metre before the robot: only the
/// legs were seen, and they are not remembered.
#[test]
fn who_walks_by_is_not_remembered() {
    let settings = settings();
    let mut surroundings = memory();
    let mut seen = 0;
    for step in 0..=30 {
        let y = -1.5 + 0.1 * f64::from(step);
        let depth = if step < 15 { with_box(1.2, y) } else { with_box(9.0, 0.0) };
        let forward = if step < 15 { 0.0 } else { 0.05 };
        let motion = EgoMotion { forward, ..EgoMotion::at_rest(0.1) };
        surroundings.update(&settings, &camera(), &depth, &motion, None);
        let ahead = surroundings.ahead(&settings, 0.0, None);
        seen += u32::from(matches!(ahead, Some(Ahead::Something(_))));
    }
    assert!(seen >= 3, "{seen}");
    assert_eq!(surroundings.ahead(&settings, 0.0, None), Some(Ahead::Free));
}

/// A person steps close before the robot, and is out of the image at once.
#[test]
fn what_left_the_image_close_before_the_robot_is_there_until_it_is_seen_to_be_gone() {
    let mut surroundings = memory();
    let nothing = with_box(9.0, 0.0);
    surroundings.ahead_after(&with_box(0.75, 0.3), 0.0, None);
    surroundings.ahead_after(&nothing, 0.5, None);
    for step in 0..600 {
        let then = surroundings.ahead_after(&nothing, 0.0, None);
        assert_ne!(then, Some(Ahead::Free), "{step}");
    }
    surroundings.ahead_after(&nothing, -0.9, None);
    let then = surroundings.ahead_after(&nothing, 0.0, None);
    assert_eq!(then, Some(Ahead::Free), "in view again, and nothing is there");
}

/// A suitcase stands behind a person, and is gone with them when the robot is so near that it
/// would be below the image; a box that a person walks past is not.
#[test]
fn what_stands_beside_whoever_stands_may_be_carried_away() {
    for (speed_mps, expected_m) in [(0.0, None), (0.6, Some(0.75))] {
        let mut surroundings = memory();
        let person = person(1.7, 0.3, speed_mps);
        for _ in 0..WAIT {
            surroundings.ahead_after(&with_box_of(1.2, 0.0, 0.2), 0.0, Some(&person));
        }
        let near = surroundings.ahead_after(&with_box_of(1.0, 0.0, 0.2), 0.2, None);
        let mut gone = near;
        for _ in 0..60 {
            gone = surroundings.ahead_after(&with_box_of(9.0, 0.0, 0.2), 0.0, None);
        }
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
    let camera = camera();
    let empty = with_box(9.0, 0.0);
    for (top_m, is_gone) in [(1.4, true), (0.5, false)] {
        let [far, near] = [1.6, 0.6].map(|x| {
            DepthImage::from_fn(80, 60, |u, v| {
                let at = camera.back_project(Point2::new(u as f64, v as f64), x);
                let hit = at.y.abs() < 0.2 && 0.1 < at.z && at.z < top_m;
                if hit { x as f32 } else { empty.row(v)[u] }
            })
        });
        let mut surroundings = memory();
        for _ in 0..WAIT {
            surroundings.ahead_after(&far, 0.0, None);
        }
        surroundings.ahead_after(&near, 1.0, None);
        let left = surroundings.ahead_after(&empty, 0.0, None);
        assert_eq!(left == Some(Ahead::Free), is_gone, "{top_m}: {left:?}");
    }
}

fn there(x: f64, y: f64) -> Track {
    target(x, y, Vector2::zeros())
}

#[test]
fn whoever_stepped_before_the_robot_is_there_until_they_are_seen_elsewhere() {
    let settings = settings();
    let mut surroundings = memory();
    let steps = [
        (0.0, Some(there(0.6, 0.1)), None),
        (0.3, None, None),
        (0.0, Some(there(0.5, 0.9)), None),
        (0.0, Some(there(0.3, 0.1)), None),
        (0.0, Some(there(0.3, 0.1)), Some(TrackId(1))),
    ];
    let [_, near, elsewhere, _, followed] = steps.map(|(forward, seen, followed)| {
        surroundings.ahead_after(&with_box(9.0, 0.0), forward, None);
        surroundings.add_tracks(seen.as_slice(), followed);
        surroundings.ahead(&settings, 0.0, None)
    });
    assert!(matches!(near, Some(Ahead::Something(at)) if at < 0.2), "{near:?}");
    assert_eq!(elsewhere, Some(Ahead::Free));
    assert_eq!(followed, Some(Ahead::Free));
}

/// A person steps in from the side, nearer than the camera measures.
#[test]
fn an_eighth_of_the_image_on_each_side_may_be_dark_from_the_start() {
    /// Returns the part of the speed that is allowed with so many dark columns on each side.
    fn allowed_with(dark: usize) -> f64 {
        let depth = DepthImage::from_fn(80, 60, |u, _| {
            if (dark..80 - dark).contains(&u) { 3.0 } else { f32::NAN }
        });
        let mut surroundings = memory();
        surroundings.ahead_after(&depth, 0.0, None);
        let coverage = surroundings.coverage(0.5).expect("an image with depth");
        allowed_part(&[coverage], &surroundings.footprint, Path::Turn { left: true }, 1.0)
    }

    assert_eq!([0, 9, 10].map(allowed_with), [1.0; 3]);
    let with_one_more = allowed_with(11);
    assert!((with_one_more - (58.0 / 60.0 / 0.5 - 1.0)).abs() < 1e-12, "{with_one_more}");
}

#[test]
fn where_the_image_went_dark_from_top_to_bottom_somebody_stands() {
    let seen = with_box(9.0, 0.0);
    let mut surroundings = memory();
    let [border, somebody, gone, narrow] =
        [0..20, 0..50, 0..20, 0..23].map(|dark| {
            let depth = DepthImage::from_fn(80, 60, |u, v| {
                if dark.contains(&u) { f32::NAN } else { seen.row(v)[u] }
            });
            surroundings.ahead_after(&depth, 0.0, None)
        });
    assert_eq!(border, Some(Ahead::Free), "a border that was always empty");
    assert!(is_at(somebody, HIDES_M - 0.25), "{somebody:?}");
    assert_eq!(gone, Some(Ahead::Free), "gone");
    assert_eq!(narrow, Some(Ahead::Free), "too narrow");
}

/// The columns in the middle lose their depth: of a stereo pair that is an object where the image has
/// texture, and nothing where it is smooth but for the noise of the camera.
#[test]
fn what_a_stereo_pair_cannot_match_for_want_of_texture_is_no_object() {
    fn noisy(u: usize, v: usize) -> u8 {
        100 + ((7 * u + 3 * v) % 5) as u8
    }

    let settings = settings();
    let seen = with_box(9.0, 0.0);
    let dark =
        DepthImage::from_fn(
            80,
            60,
            |u, v| {
                if (30..50).contains(&u) { f32::NAN } else { seen.row(v)[u] }
            },
        );
    for (stripes, expected) in [(40, Some(HIDES_M - 0.25)), (0, None)] {
        let mut surroundings = memory();
        let image =
            GreyImage::from_fn(80, 60, |u, v| noisy(u, v) + if u % 4 < 2 { stripes } else { 0 });
        for depth in [&seen, &dark, &dark] {
            surroundings.update(&settings, &camera(), depth, &EgoMotion::at_rest(0.1), None);
            surroundings.excuse_smooth(&image);
        }
        let found = surroundings.ahead(&settings, 0.0, None);
        match expected {
            Some(metres) => assert!(is_at(found, metres), "{found:?}"),
            None => assert_eq!(found, Some(Ahead::Free)),
        }
    }
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
        let [upper_m, lower_m] = [1.0, 1.0 + drop_m]
            .map(|height_m| if falls > 0.0 { height_m / falls } else { f64::INFINITY });
        let floor_m = if upper_m < edge_m { upper_m } else { lower_m };
        floor_m.min(6.0) as f32
    })
}

fn before_edge(edge_m: f64, drop_m: f64, target: Option<Point2<f64>>) -> Option<Ahead> {
    let settings = settings();
    let mut surroundings = memory();
    let depth = with_edge(edge_m, drop_m);
    let still = EgoMotion::at_rest(0.1);
    surroundings.update(&settings, &fine_camera(), &depth, &still, None);
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
    let settings = settings();
    let mut surroundings = memory();
    for step in 0..40 {
        let driven_m = 0.05 * f64::from((step - 20).max(0));
        let forward = if step > 20 { 0.05 } else { 0.0 };
        let motion = EgoMotion { forward, ..EgoMotion::at_rest(0.1) };
        let depth = with_edge(1.8 - driven_m, 0.17);
        surroundings.update(&settings, &fine_camera(), &depth, &motion, None);
    }
    let found = surroundings.ahead(&settings, 0.0, None);
    assert!(is_at(found, 1.8 - 0.95 - 0.2), "{found:?}");
}

/// A wrong match of a stereo pair lies below the floor in two images, and then there is no depth.
#[test]
fn a_fall_that_was_seen_too_briefly_is_not_remembered() {
    let settings = settings();
    let fall = with_edge(1.6, 0.17);
    let floor = with_edge(9.0, 0.0);
    let nothing = DepthImage::from_fn(160, 120, |u, v| match floor.row(v)[u] {
        z if z == fall.row(v)[u] => z,
        _ => f32::NAN,
    });
    for (images, is_remembered) in [(2, false), (6, true)] {
        let mut surroundings = memory();
        let still = EgoMotion::at_rest(0.1);
        for _ in 0..images {
            surroundings.update(&settings, &fine_camera(), &fall, &still, None);
            let ahead = surroundings.ahead(&settings, 0.0, None);
            assert!(is_at(ahead, 1.4), "it counts at once: {ahead:?}");
        }
        surroundings.update(&settings, &fine_camera(), &nothing, &still, None);
        let ahead = surroundings.ahead(&settings, 0.0, None);
        assert_eq!(ahead != Some(Ahead::Free), is_remembered, "{images}");
    }
}

#[test]
fn without_a_new_image_what_is_old_and_what_is_far_away_are_forgotten() {
    let settings = CollisionMonitorSettings { memory_s: 2.0, ..settings() };
    let far_m = settings.range_m + 5.0;
    for (x, unseen_s, is_kept) in
        [(2.0, 0.5, true), (2.0, 1.95, false), (far_m, 0.5, false), (far_m, 1.95, false)]
    {
        let mut surroundings = memory();
        let thing = Obstacle::new(Point2::new(x, 0.0), Heights::of(0.5));
        surroundings.things.push(Obstacle { seen_s: STANDS_S, unseen_s, ..thing });
        surroundings.hold(&settings, &EgoMotion::at_rest(0.1));
        assert_eq!(surroundings.things.len(), usize::from(is_kept), "{x} m, {unseen_s} s");
    }
}

#[test]
fn a_slope_is_the_mean_of_three_rows_of_which_the_middle_counts_twice() {
    for (differences, slope) in [([8, 8, 8], 8), ([0, 20, 0], 10), ([20, 0, 0], 5), ([0; 3], 0)] {
        let image = GreyImage::from_fn(3, 3, |x, y| differences[y] * (x / 2) as u8);
        assert_eq!(slope_at(&image, 1, 1), slope, "{differences:?}");
    }
}
