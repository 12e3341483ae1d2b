//! Distances that `tagalong check` prints for a robot: stopping, separation from people, turning.

use std::fmt;

use nalgebra::Point2;
use serde::Serialize;
use tagalong_geometry::Camera;

use crate::FollowSettings;
use crate::collision_monitor::{Footprint, reach_m};

/// Distances that follow from the settings of a robot, to be put beside the robot itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SafetyDistances {
    /// Largest speed, m/s.
    pub speed_mps: f64,
    /// Way from full speed until the robot stands, m: reaction and braking.
    pub stopping_m: f64,
    /// Distance of a thing ahead from the footprint at which a robot at full speed begins to brake, m.
    pub before_things_m: f64,
    /// Distance from the footprint to an approaching person at full speed, for a robot at full
    /// speed, m: after ISO 13855, the stopping distance + v_h (t + v / a + `settle_s`) + C, for a person
    /// at speed v_h and a robot at speed v that reacts after t and brakes with a.
    pub separation_m: f64,
    /// The same for a robot that has nearly stopped: nearer it stands, m.
    pub least_separation_m: f64,
    /// Distance of the footprint from the followed person at which the robot stops, m.
    pub followed_m: f64,
    /// Radius of the area that the footprint sweeps in a turn, m.
    pub turning_radius_m: f64,
    /// Distance from the middle of the robot to the foremost corner of the stop polygon, m; `None`
    /// without one.
    pub stop_polygon_m: Option<f64>,
    /// The same of the slowdown polygon, m.
    pub slowdown_polygon_m: Option<f64>,
    /// Factor of the speed while something is inside the slowdown polygon.
    pub slowdown_ratio: f64,
    /// Time after the last image for which its command holds, s: then zero is commanded.
    pub holds_s: f64,
    /// Time after the last image until the robot stands, for a base that brakes from full speed as the
    /// command limiter does, s.
    pub stands_after_s: f64,
    /// Way in that time, m.
    pub stands_after_m: f64,
}

impl SafetyDistances {
    /// Returns the distances of these settings.
    pub fn of(settings: &FollowSettings) -> Self {
        let FollowSettings { robot, command_limiter, collision_monitor, .. } = settings;
        let speed_mps = robot.max_speed_mps;
        let stopping_m = command_limiter.stopping_m(speed_mps) - command_limiter.margin_m;
        let least_s = command_limiter.reaction_s + command_limiter.settle_s;
        let braking_s = speed_mps / command_limiter.max_decel_mps2;
        let stopping_s = least_s + braking_s;
        let [comes_m, least_comes_m] = [stopping_s, least_s]
            .map(|time_s| reach_m(collision_monitor, collision_monitor.people_mps, time_s));
        let protective_m = collision_monitor.protective_m;
        let holds_s = command_limiter.valid_s;
        Self {
            speed_mps,
            stopping_m,
            before_things_m: stopping_m + collision_monitor.stop_m,
            separation_m: comes_m + stopping_m + protective_m,
            least_separation_m: least_comes_m + protective_m,
            followed_m: collision_monitor.followed_stop_m,
            turning_radius_m: Footprint::new(&robot.footprint).radius_m(),
            stop_polygon_m: foremost_m(&collision_monitor.stop),
            slowdown_polygon_m: foremost_m(&collision_monitor.slowdown),
            slowdown_ratio: collision_monitor.slowdown_ratio,
            holds_s,
            stands_after_s: holds_s + braking_s,
            stands_after_m: speed_mps * (holds_s + 0.5 * braking_s),
        }
    }
}

/// In lines, each with a line break at its end.
impl fmt::Display for SafetyDistances {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            speed_mps,
            stopping_m,
            before_things_m,
            separation_m,
            least_separation_m,
            followed_m,
            turning_radius_m,
            stop_polygon_m,
            slowdown_polygon_m,
            slowdown_ratio,
            holds_s,
            stands_after_s,
            stands_after_m,
        } = self;
        write!(
            f,
            "  distances from the edge of the footprint (see docs/safety.md):\n  \
             at {speed_mps} m/s it stops within {stopping_m:.2} m, and brakes for obstacles nearer \
             than {before_things_m:.2} m\n  \
             near people it drives at {speed_mps} m/s only while they are {separation_m:.2} m away; it is \
             slower if they are nearer, and stands below {least_separation_m:.2} m\n  \
             it stops {followed_m:.2} m in front of the followed person, and earlier if they come nearer\n  \
             when it turns, its corners sweep a circle with a radius of {turning_radius_m:.2} m around \
             the middle of the robot\n  \
             after the last image or scan its command holds for {holds_s:.2} s, then zero is commanded, and the robot \
             stands after {stands_after_s:.2} s and {stands_after_m:.2} m in all\n"
        )?;
        if let Some(ahead_m) = stop_polygon_m {
            writeln!(
                f,
                "  it neither drives nor turns while something is in the stop polygon, which reaches \
                 {ahead_m:.2} m ahead"
            )?;
        }
        if let Some(ahead_m) = slowdown_polygon_m {
            writeln!(
                f,
                "  it drives at {slowdown_ratio} of its speed while something is in the slowdown polygon, \
                 which reaches {ahead_m:.2} m ahead"
            )?;
        }
        Ok(())
    }
}

/// Returns the foremost corner of a polygon, m; `None` without corners.
fn foremost_m(corners: &[[f64; 2]]) -> Option<f64> {
    corners.iter().map(|[x, _]| *x).reduce(f64::max)
}

/// Region around the robot that its camera does not see.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct BlindZone {
    /// Distance ahead of the footprint up to which the camera sees no floor, m; `None` for a camera that
    /// sees no floor at all.
    pub floor_m: Option<f64>,
    /// Width of the view, degrees: what is beside it is not seen.
    pub field_of_view_deg: f64,
}

impl BlindZone {
    /// Returns what a camera does not see.
    pub fn of(settings: &FollowSettings, camera: &Camera) -> Self {
        let eye = camera.robot_from_camera.translation.vector;
        let middle = Point2::new(0.5 * (camera.width as f64 - 1.0), camera.height as f64 - 1.0);
        let down = camera.back_project(middle, 1.0).coords - eye;
        // The ray of the lowest row meets the floor, if it falls.
        let meets_m = (down.z < 0.0).then(|| eye.x - down.x * eye.z / down.z);
        let front_m = Footprint::new(&settings.robot.footprint).front_m();
        let height = 0.5 * (camera.height as f64 - 1.0);
        let [left, right] = [0.0, camera.width as f64 - 1.0]
            .map(|x| camera.back_project(Point2::new(x, height), 1.0).coords - eye);
        let field_of_view = left.angle(&right);
        Self {
            floor_m: meets_m.map(|at_m| (at_m - front_m).max(0.0)),
            field_of_view_deg: field_of_view.to_degrees(),
        }
    }
}

#[cfg(test)]
mod tests {
    use tagalong_geometry::{Distortion, Pinhole};

    use super::*;

    #[test]
    fn the_separation_is_that_of_the_standard() {
        let settings = FollowSettings::default();
        let found = SafetyDistances::of(&settings);
        // (1.6 + 0.9) 0.5 + 1.6 0.9 + 0.9² / 2 + 0.2, the rise of the deceleration, and the
        // quarter of a second until the wheels stand.
        let stated = 2.5 * 0.5 + 1.6 * 0.9 + 0.405 + 0.2 + 0.9 * 0.1 + 1.6 * 0.25;
        assert!((found.separation_m - stated).abs() < 1e-9, "{found:?}");
        assert!((found.least_separation_m - 1.4).abs() < 1e-9);
        assert!(found.stopping_m < found.before_things_m);
        assert!((found.turning_radius_m - 0.25_f64.hypot(0.1)).abs() < 1e-12);
        // A quarter of a second at 0.9 m/s, and 0.9 s of braking by 1 m/s².
        assert_eq!(found.holds_s, 0.25);
        assert!((found.stands_after_s - 1.15).abs() < 1e-9);
        assert!((found.stands_after_m - (0.9 * 0.25 + 0.405)).abs() < 1e-9);
    }

    #[test]
    fn distances_say_from_where_they_are() {
        let distances = SafetyDistances {
            speed_mps: 0.5,
            stopping_m: 0.4,
            before_things_m: 0.6,
            separation_m: 3.0,
            least_separation_m: 0.9,
            followed_m: 0.8,
            turning_radius_m: 0.25,
            stop_polygon_m: None,
            slowdown_polygon_m: None,
            slowdown_ratio: 1.0,
            holds_s: 0.25,
            stands_after_s: 0.75,
            stands_after_m: 0.3,
        };
        let lines = distances.to_string();
        for part in [
            "distances from the edge of the footprint",
            "only while they are 3.00 m away",
            "stands below 0.90 m",
            "a radius of 0.25 m around the middle of the robot",
            "holds for 0.25 s, then zero is commanded, and the robot stands after 0.75 s and 0.30 m",
        ] {
            assert!(lines.contains(part), "{part}: {lines}");
        }
    }

    #[test]
    fn a_level_camera_sees_the_floor_where_its_lowest_ray_meets_it() {
        let lens =
            Pinhole { fx: 100.0, fy: 100.0, cx: 99.5, cy: 49.5, distortion: Distortion::None };
        let camera = Camera::mounted(lens, 200, 100, 1.0, 0.0, 0.0);
        let zone = BlindZone::of(&FollowSettings::default(), &camera);
        let expected = 1.0 / 0.495 - 0.25;
        assert!((zone.floor_m.unwrap() - expected).abs() < 1e-6, "{zone:?}");
        assert!((zone.field_of_view_deg - 2.0 * 0.995_f64.atan().to_degrees()).abs() < 1e-6);
        let up = Camera::mounted(lens, 200, 100, 1.0, -0.6, 0.0);
        let down = Camera::mounted(lens, 200, 100, 1.0, 0.6, 0.0);
        let seen =
            [up, down].map(|camera| BlindZone::of(&FollowSettings::default(), &camera).floor_m);
        assert!(seen.contains(&None) && seen.iter().any(Option::is_some), "{seen:?}");
    }
}
