//! The laws of the papers, and the extensions where they have none.

use super::*;

/// Returns a config of the printed laws only, up to the target itself.
fn bare(path: Path, gain: f64) -> Config {
    Config {
        path,
        path_gain: gain,
        stand_off_m: 0.0,
        max_acceleration: 1e3,
        bearing_gain_per_s: 0.0,
        max_turn_rate: 1e3,
        max_curvature: 1e3,
        min_range_m: 1e-3,
        turn_in_place_deg: [170.0, 175.0],
        latency_s: 0.0,
        ..Config::default()
    }
}

/// Drives to a person that stands 3 m away at 34 degrees, until 0.8 m from them; returns ranges and
/// bearings on the way.
fn approach(config: Config) -> Vec<(f64, f64)> {
    let bearing = 34_f64.to_radians();
    let place = Point2::new(3.0 * bearing.cos(), 3.0 * bearing.sin());
    let mut drive = Drive::new(config, 2e-4, 0);
    let mut way = vec![drive.polar(place)];
    while way[way.len() - 1].0 > 0.8 {
        drive.step(place, Vector2::zeros());
        way.push(drive.polar(place));
        assert!(way.len() < 200_000, "stuck at {:?}", way.last());
    }
    way
}

#[test]
fn a_target_at_rest_keeps_sine_of_bearing_over_a_power_of_range() {
    for (path, gain) in [(Path::A, 1.0), (Path::C, 1.5), (Path::C, 2.0), (Path::C, 2.5)] {
        let way = approach(bare(path, gain));
        let (range, bearing) = way[0];
        for (r, b) in &way {
            let expected = bearing.sin() * (r / range).powf(2.0 * gain - 1.0);
            let error = (b - expected.asin()).to_degrees().abs();
            assert!(error < 0.01, "gain {gain}: {error} degrees off at {r} m");
        }
    }
}

#[test]
fn path_c_faces_the_target_long_before_path_a() {
    fn at_the_end(path: Path) -> f64 {
        approach(bare(path, 2.0)).last().unwrap().1.to_degrees()
    }

    let circle = at_the_end(Path::A);
    let turning = at_the_end(Path::C);
    assert!((circle - 8.6).abs() < 0.1, "{circle}");
    assert!((turning - 0.6).abs() < 0.05, "{turning}");
}

#[test]
fn path_a_ends_on_the_circle_through_the_target() {
    let place = Point2::new(2.0, 1.0);
    let mut drive = Drive::new(bare(Path::A, 1.0), 1e-3, 0);
    let centre = Point2::new(0.0, (2.0_f64.powi(2) + 1.0) / 2.0);
    while drive.polar(place).0 > 0.2 {
        drive.step(place, Vector2::zeros());
        let at = Point2::from(drive.pose.translation.vector);
        assert!(((at - centre).norm() - centre.y).abs() < 1e-3, "{at}");
    }
}

#[test]
fn path_b_turns_first_and_then_drives_straight() {
    let config = Config { path: Path::B, ..Config::default() };
    let mut drive = Drive::new(config, 0.05, 0);
    let place = Point2::new(3.0, 2.0);
    let mut turned = false;
    for _ in 0..300 {
        let wheels = drive.step(place, Vector2::zeros());
        let v = speed(wheels);
        let w = turn_rate(wheels);
        assert!(v == 0.0 || w == 0.0, "drives at {v} and turns at {w}");
        assert!(!turned || w == 0.0, "turns again");
        turned |= v > 0.0;
    }
    let (range, bearing) = drive.polar(place);
    assert!((range - 1.4).abs() < 0.05 && bearing.abs() < 12_f64.to_radians());
}

#[test]
fn the_curvature_is_bounded() {
    let near = target(0.25, 0.1, Vector2::new(0.5, 0.0));
    let config = Config {
        bearing_gain_per_s: 0.0,
        max_turn_rate: 10.0,
        latency_s: 0.0,
        stand_off_m: 0.2,
        ..Config::default()
    };
    let wheels = settled(config, &near);
    let curvature = turn_rate(wheels) / speed(wheels);
    assert!((curvature - 4.0 * 0.1 / 0.25).abs() < 1e-9, "{curvature}");
}

#[test]
fn a_target_at_the_origin_stops_the_robot() {
    let config = Config { stand_off_m: 0.0, latency_s: 0.0, ..Config::default() };
    let wheels = settled(config, &target(0.0, 0.0, Vector2::new(0.5, 0.0)));
    assert!(wheels.left == wheels.right, "{wheels:?}");
    let wheels = settled(Config::default(), &target(0.0, 0.0, Vector2::zeros()));
    assert_eq!(wheels, WheelSpeeds::STOP);
}

#[test]
fn it_turns_to_a_person_behind_it() {
    let place = Point2::new(-2.0, 0.01);
    let mut drive = Drive::new(Config::default(), 0.1, 0);
    for _ in 0..150 {
        drive.step(place, Vector2::zeros());
    }
    let (range, bearing) = drive.polar(place);
    assert!((range - 1.4).abs() < 0.05 && bearing.abs() < 0.05, "{range} {bearing}");
}

#[test]
fn it_speeds_up_and_slows_down_no_faster_than_it_may() {
    let config = Config { latency_s: 0.0, ..Config::default() };
    let mut controller = ArcFollow::new(config).unwrap();
    assert_eq!(controller.stand_off_m(), Some(1.4));
    // It slows down by 1 m/s².
    for (x, expected) in [(4.0, 0.05), (4.0, 0.1), (4.0, 0.15), (1.4, 0.05)] {
        let person = target(x, 0.0, Vector2::zeros());
        let wheels = command(&mut controller, EgoMotion::at_rest(0.1), Some(&person));
        assert!((speed(wheels) - expected).abs() < 1e-9, "{x}: {wheels:?}");
    }
}

/// The arc of path A, and on the spot the more the slower it drives, 20 degrees to the side.
#[test]
fn the_turn_is_that_of_the_arc_and_of_the_bearing() {
    let bearing = 20_f64.to_radians();
    let [wheels, near] = [2.0, 0.25].map(|range_m| {
        let config = Config { path: Path::A, latency_s: 0.0, ..Config::default() };
        settled(config, &target(range_m * bearing.cos(), range_m * bearing.sin(), Vector2::zeros()))
    });
    let driven = 0.8 * 0.6 * bearing.cos().powi(2);
    assert!((speed(wheels) - driven).abs() < 1e-9, "{wheels:?}");
    let turned = driven * bearing.sin() + (1.0 - driven / MAX_MPS) * bearing;
    assert!((turn_rate(wheels) - turned).abs() < 1e-9, "{wheels:?}");
    // At half the least range, half the rate.
    assert!((turn_rate(near) - 0.5 * bearing).abs() < 1e-9);
}

#[test]
fn it_goes_on_turning_the_way_it_began() {
    let mut controller = ArcFollow::new(Config::default()).unwrap();
    for y in [0.3, -0.3, 0.1] {
        let person = target(-2.0, y, Vector2::zeros());
        let wheels = command(&mut controller, EgoMotion::at_rest(0.1), Some(&person));
        assert!(turn_rate(wheels) > 0.0, "hesitates at {y}");
    }
}

#[test]
fn turning_in_place_ends_later_than_it_begins() {
    let mut controller = ArcFollow::new(Config { latency_s: 0.0, ..Config::default() }).unwrap();
    for (degrees, drives) in
        [(55.0_f64, true), (65.0, false), (35.0, false), (25.0, true), (55.0, true)]
    {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let person = target(3.0 * cos, 3.0 * sin, Vector2::zeros());
        let steps = (0..20)
            .map(|_| speed(command(&mut controller, EgoMotion::at_rest(0.1), Some(&person))));
        assert_eq!(steps.last().unwrap() > 0.0, drives, "{degrees}");
    }
}

#[test]
fn at_the_stand_off_it_turns_with_a_person_who_walks_around_it() {
    let mut drive = Drive::new(Config::default(), 0.1, 0);
    let bearings = (0..200).map(|i| {
        let (sin, cos) = (0.03 * f64::from(i)).sin_cos();
        drive.step(Point2::new(1.4 * cos, 1.4 * sin), Vector2::new(-sin, cos) * 0.42);
        drive.polar(Point2::new(1.4 * cos, 1.4 * sin)).1.abs()
    });
    let worst_deg = bearings.fold(0.0, f64::max).to_degrees();
    assert!(worst_deg < 25.0, "{worst_deg}");
}

#[test]
fn it_keeps_the_stand_off_to_a_person_who_walks() {
    let mut drive = Drive::new(Config::default(), 0.1, 0);
    for i in 0..200 {
        drive.step(Point2::new(1.6 + 0.07 * f64::from(i), 0.0), Vector2::new(0.7, 0.0));
    }
    let range = drive.polar(Point2::new(1.6 + 0.07 * 199.0, 0.0)).0;
    assert!((range - 1.4).abs() < 0.15, "{range}");
}

#[test]
fn it_never_backs_up_and_slows_down_in_bends() {
    fn at(degrees: f64) -> f64 {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let config = Config { latency_s: 0.0, ..Config::default() };
        speed(settled(config, &target(2.0 * cos, 2.0 * sin, Vector2::zeros())))
    }

    let towards = target(0.8, 0.0, Vector2::new(-1.0, 0.0));
    assert_eq!(settled(Config::default(), &towards), WheelSpeeds::STOP);
    assert!((at(45.0) / at(0.0) - 0.5).abs() < 1e-9, "{} {}", at(45.0), at(0.0));
}

#[test]
fn saturated_wheels_keep_the_curvature() {
    let config = Config { bearing_gain_per_s: 0.0, latency_s: 0.0, ..Config::default() };
    let config = Config { path_gain: 6.0, ..config };
    let far = settled(config, &target(6.0, 1.0, Vector2::new(0.9, 0.0)));
    assert!((far.right - MAX_MPS).abs() < 1e-9, "{far:?}");
    assert!((turn_rate(far) / speed(far) - 12.0 / 37.0).abs() < 1e-9, "{far:?}");
}

#[test]
fn somebody_unseen_is_followed_ever_more_slowly_and_then_no_more() {
    fn after(unseen_s: f64) -> WheelSpeeds {
        let person = target(4.0, 1.0, Vector2::zeros()).with_seen(false).with_unseen_s(unseen_s);
        settled(Config::default(), &person)
    }

    assert_eq!(after(0.45), after(0.0));
    assert!(speed(after(0.8)) < 0.5 * speed(after(0.0)) && speed(after(0.8)) > 0.0);
    for unseen_s in [1.0, 30.0, f64::INFINITY, f64::NAN] {
        assert_eq!(after(unseen_s), WheelSpeeds::STOP);
    }
}

#[test]
fn a_robot_that_answers_late_does_the_same_later() {
    let [late, at_once] = [(0.3, 6), (0.0, 0)].map(|(latency_s, delay)| {
        let config = Config { latency_s, ..Config::default() };
        let mut drive = Drive::new(config, 0.05, delay);
        let velocity = Vector2::new(0.4, 0.3);
        let mut commands = Vec::new();
        for i in 0..120 {
            let when_it_answers = 0.05 * (i + 6 - delay) as f64;
            commands.push(drive.step(Point2::new(1.0, 2.0) + velocity * when_it_answers, velocity));
        }
        commands
    });
    for (late, at_once) in late.iter().zip(at_once) {
        assert!((late.left - at_once.left).abs() < 1e-9, "{late:?} {at_once:?}");
        assert!((late.right - at_once.right).abs() < 1e-9, "{late:?} {at_once:?}");
    }
}

#[test]
fn it_turns_too_far_if_it_does_not_know_of_its_latency() {
    fn overshoot(latency_s: f64) -> f64 {
        let config = Config { bearing_gain_per_s: 4.0, latency_s, ..Config::default() };
        let mut drive = Drive::new(config, 0.05, 6);
        let place = Point2::new(0.0, 1.3);
        let bearings = (0..200).map(|_| {
            drive.step(place, Vector2::zeros());
            drive.polar(place).1
        });
        -bearings.fold(0.0, f64::min).to_degrees()
    }

    assert!(overshoot(0.0) > 10.0, "{}", overshoot(0.0));
    assert!(overshoot(0.3) < 1.0, "{}", overshoot(0.3));
}

/// Returns the distance of the robot from its lane 0.4 m before the bend of a person's way some
/// metres ahead.
fn cut_m(trail_m: f64) -> f64 {
    let mut drive = Drive::new(Config { trail_m, ..Config::default() }, 0.1, 1);
    for step in 0..120 {
        let way_m = 2.0 + 0.08 * f64::from(step);
        let after_m = 0.7 * (way_m - 4.0).max(0.0);
        let place = Point2::new(way_m.min(4.0) + after_m, after_m);
        let velocity =
            if after_m > 0.0 { Vector2::new(0.56, 0.56) } else { Vector2::new(0.8, 0.0) };
        drive.step(place, velocity);
        if drive.pose.translation.x >= 3.6 {
            return drive.pose.translation.y;
        }
    }
    panic!("it did not get there: {}", drive.pose);
}

#[test]
fn it_goes_round_a_corner_where_the_person_went() {
    let straight_m = cut_m(0.0);
    let trail_m = cut_m(1.0);
    assert!(straight_m > 0.2 && trail_m < 0.5 * straight_m, "{straight_m} {trail_m}");
}
