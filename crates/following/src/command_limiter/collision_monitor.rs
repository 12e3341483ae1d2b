use nalgebra::{Point2, Point3};

use super::CollisionMonitorSettings;

/// Resolution of obstacle distances, m. The speed before an obstacle follows them; at walking pace
/// steps of 5 cm would be steps of 0.1 m/s.
const BIN_M: f64 = 0.01;
/// Growth of the floor's height limit with the distance, m per m.
const FLOOR_SLOPE: f64 = 0.03;
/// Curvature below which a path is straight, 1/m.
const STRAIGHT: f64 = 1e-4;

/// Result of a look along the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Ahead {
    /// The depth image has nearly no valid pixel.
    Blind,
    /// No obstacle within the range.
    Free,
    /// Obstacle at this distance from the robot's front along its path, m.
    Something(f64),
}

/// Evidence of an obstacle, seen or remembered.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sign {
    /// Position in the robot frame, m.
    pub(super) at: Point2<f64>,
    /// Weight, in points of the image.
    pub(super) points: u32,
    /// Distance by which it may come nearer to the middle of the corridor before the robot is
    /// there, m.
    pub(super) steps_in_m: f64,
    /// True for a fall, which never belongs to the target.
    pub(super) is_drop: bool,
}

/// Returns the nearest obstacle in the corridor that the robot sweeps on an arc of this curvature,
/// 1/m, positive to the left; signs around `target` belong to the followed person.
pub(super) fn ahead(
    settings: &CollisionMonitorSettings,
    signs: impl Iterator<Item = Sign>,
    curvature: f64,
    target: Option<Point2<f64>>,
) -> Ahead {
    let mut bins = vec![0_u32; (settings.range_m / BIN_M).ceil() as usize + 1];
    for sign in signs {
        if let Some(along_m) = in_the_way(settings, &sign, curvature, target) {
            bins[(along_m / BIN_M) as usize] += sign.points;
        }
    }
    nearest(settings, &bins)
}

/// Returns true for a point of an obstacle: above the floor, and low enough for the robot to hit
/// it.
pub(super) fn is_thing(settings: &CollisionMonitorSettings, point: &Point3<f64>) -> bool {
    // Depth noise and errors of the mount's pitch lift far floor points.
    let floor = settings.floor_m + FLOOR_SLOPE * point.xy().coords.norm();
    floor < point.z && point.z < settings.top_m
}

/// Returns the place in which the floor is missing, on the ray from the camera to a point below the
/// floor; `None` for a point above it or one that the roughness of the floor explains.
///
/// The edge of a stair hides the step below it, so that the point itself may be far behind the edge;
/// the ray crosses the floor right behind it.
pub(super) fn fall(
    settings: &CollisionMonitorSettings,
    eye: &Point3<f64>,
    point: &Point3<f64>,
) -> Option<Point3<f64>> {
    let depth = settings.drop_m + FLOOR_SLOPE * point.xy().coords.norm();
    // A camera below the floor has a wrong mount; it sees no falls.
    if !(point.z < -depth && eye.z > 0.0) {
        return None;
    }
    let part = eye.z / (eye.z - point.z);
    let at = eye + part * (point - eye);
    Some(Point3::new(at.x, at.y, 0.0))
}

/// Returns the first bin up to which enough points lie.
fn nearest(settings: &CollisionMonitorSettings, bins: &[u32]) -> Ahead {
    let mut points = 0_u32;
    // Points accumulate over the bins: few of them per bin may still be one slanted obstacle.
    let first = bins.iter().position(|bin| {
        points = points.saturating_add(*bin);
        points >= settings.min_points.max(1)
    });
    first.map_or(Ahead::Free, |bin| Ahead::Something(bin as f64 * BIN_M))
}

/// Returns the distance from the front along the path, m, of a point that the robot would hit.
fn in_the_way(
    settings: &CollisionMonitorSettings,
    sign: &Sign,
    curvature: f64,
    target: Option<Point2<f64>>,
) -> Option<f64> {
    let flat = sign.at;
    let of_target = |t| nalgebra::distance(&flat, &t) < settings.target_radius_m;
    if !sign.is_drop && target.is_some_and(of_target) {
        return None;
    }
    let (along, aside) = on_arc(flat, curvature);
    let from_front = along - settings.front_m;
    let half_width_m = settings.half_width_m + sign.steps_in_m;
    let inside = aside.abs() < half_width_m && along > 0.0 && from_front < settings.range_m;
    // A point beside the front has a negative distance, and is reached at once.
    inside.then_some(from_front.max(0.0))
}

/// Returns the distance along an arc that leaves the origin along x, and the distance aside of it,
/// m.
fn on_arc(point: Point2<f64>, curvature: f64) -> (f64, f64) {
    // The radius of a nearly straight arc would be infinite.
    if curvature.abs() < STRAIGHT {
        return (point.x, point.y);
    }
    let radius = 1.0 / curvature;
    let from_centre = radius - point.y;
    let angle = point.x.atan2(from_centre * radius.signum());
    let aside = radius.abs() - point.x.hypot(from_centre);
    (angle * radius.abs(), aside)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_path_has_x_along_and_y_aside() {
        assert_eq!(on_arc(Point2::new(2.0, 0.3), 0.0), (2.0, 0.3));
    }

    #[test]
    fn points_on_the_arc_are_not_aside_of_it() {
        for curvature in [-1.2, -0.3, 0.5, 2.0_f64] {
            for along in [0.1, 0.6, 1.2] {
                let turn: f64 = curvature * along;
                let point = Point2::new(turn.sin() / curvature, (1.0 - turn.cos()) / curvature);
                let (s, aside) = on_arc(point, curvature);
                assert!((s - along).abs() < 1e-9 && aside.abs() < 1e-9, "{curvature} {along}");
            }
        }
    }

    #[test]
    fn floor_target_and_what_is_aside_or_overhead_are_not_in_the_way() {
        let settings = CollisionMonitorSettings::default();
        let way = |x: f64, y: f64, z: f64, target: Option<Point2<f64>>| {
            let (point, at) = (Point3::new(x, y, z), Point2::new(x, y));
            let sign = Sign { at, points: 1, steps_in_m: 0.0, is_drop: false };
            is_thing(&settings, &point).then(|| in_the_way(&settings, &sign, 0.0, target))?
        };
        assert_eq!(way(1.2, 0.0, 0.5, None), Some(1.0));
        assert_eq!(way(1.2, 0.0, 0.05, None), None);
        assert_eq!(way(1.2, 0.0, 1.9, None), None);
        assert_eq!(way(1.2, 0.4, 0.5, None), None);
        assert_eq!(way(-1.0, 0.0, 0.5, None), None);
        assert_eq!(way(1.2, 0.0, 0.5, Some(Point2::new(1.4, 0.1))), None);
        assert_eq!(way(f64::NAN, 0.0, 0.5, None), None);
    }

    #[test]
    fn single_points_are_noise() {
        let settings =
            CollisionMonitorSettings { min_points: 3, ..CollisionMonitorSettings::default() };
        assert_eq!(nearest(&settings, &[0, 1, 0, 1]), Ahead::Free);
        assert_eq!(nearest(&settings, &[0, 1, 0, 2]), Ahead::Something(3.0 * BIN_M));
    }

    #[test]
    fn the_floor_grows_rougher_with_the_distance_and_hanging_lamps_are_passed_below() {
        let settings = CollisionMonitorSettings::default();
        let is = |x: f64, z: f64| is_thing(&settings, &Point3::new(x, 0.0, z));
        assert!(!is(0.0, 0.07) && is(0.0, 0.09), "8 cm");
        assert!(!is(2.0, 0.13) && is(2.0, 0.15) && is(-2.0, 0.15), "and 3 cm a metre");
        assert!(is(1.0, 1.49) && !is(1.0, 1.51));
    }

    #[test]
    fn what_is_beside_the_front_is_reached_at_once_and_what_is_behind_never() {
        let settings = CollisionMonitorSettings::default();
        let at = |x: f64, y: f64, steps_in_m: f64| {
            let sign = Sign { at: Point2::new(x, y), points: 1, steps_in_m, is_drop: false };
            in_the_way(&settings, &sign, 0.0, None)
        };
        assert_eq!((at(0.1, 0.0, 0.0), at(0.0, 0.0, 0.0)), (Some(0.0), None));
        assert!(at(3.19, 0.0, 0.0).is_some() && at(3.21, 0.0, 0.0).is_none(), "3 m from the front");
        assert!(at(1.0, 0.33, 0.0).is_some() && at(1.0, 0.35, 0.0).is_none());
        assert!(at(1.0, -0.58, 0.25).is_some() && at(1.0, -0.6, 0.25).is_none(), "steps in");
    }

    #[test]
    fn what_is_near_the_person_is_the_person() {
        let settings = CollisionMonitorSettings::default();
        let at = |x: f64| {
            let sign = Sign { at: Point2::new(x, 0.0), points: 1, steps_in_m: 0.0, is_drop: false };
            in_the_way(&settings, &sign, 0.0, Some(Point2::new(2.0, 0.0))).is_some()
        };
        assert_eq!([1.54, 1.56, 2.44, 2.46].map(at), [true, false, false, true]);
    }

    #[test]
    fn the_nearest_place_with_enough_points_before_it_is_told() {
        let settings = CollisionMonitorSettings::default();
        let seen = |signs: &[(f64, u32)]| {
            let at = |(x, points): &(f64, u32)| Sign {
                at: Point2::new(*x, 0.0),
                points: *points,
                steps_in_m: 0.0,
                is_drop: false,
            };
            ahead(&settings, signs.iter().map(at), 0.0, None)
        };
        assert_eq!(seen(&[(1.22, 5)]), Ahead::Free);
        assert_eq!(seen(&[(2.02, 9), (1.22, 6)]), Ahead::Something(102.0 * BIN_M));
        assert_eq!(seen(&[(0.72, 3), (1.22, 3)]), Ahead::Something(102.0 * BIN_M), "both together");
        assert_eq!(seen(&[(3.199, 6)]), Ahead::Something(299.0 * BIN_M), "the last one");
        assert_eq!(seen(&[(9.0, 99)]), Ahead::Free);
    }

    #[test]
    fn two_rays_are_something_and_one_may_be_dust() {
        for (min_points, rays) in [(6, 3), (5, 3), (1, 1)] {
            let settings =
                CollisionMonitorSettings { min_points, ..CollisionMonitorSettings::default() };
            assert_eq!(settings.ray_points(), rays);
        }
    }

    /// A bend to the left, with one point a metre to the left of it and one a metre to the right.
    #[test]
    fn what_is_aside_of_a_bend_is_as_far_aside_as_it_is_from_the_path() {
        for (point, aside) in [(Point2::new(0.0, 1.0), 1.0), (Point2::new(3.0, 2.0), -1.0)] {
            let (_, found) = on_arc(point, 0.5);
            assert!((found - aside).abs() < 1e-9, "{point}: {found}");
        }
    }
}
