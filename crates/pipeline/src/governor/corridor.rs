use nalgebra::{Point2, Point3};

use super::CorridorSettings;

/// Obstacles are told apart to this, m.
const BIN_M: f64 = 0.05;
/// The floor's roughness grows by this, m for each metre.
const FLOOR_SLOPE: f64 = 0.03;
/// Weaker curvatures are straight, 1/m.
const STRAIGHT: f64 = 1e-4;

/// What is ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Ahead {
    /// The depth image shows next to nothing.
    Blind,
    /// Nothing within the range.
    Free,
    /// Something, at this distance from the robot's front along its path, m.
    Something(f64),
}

/// Something that is seen or remembered.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sign {
    /// Robot frame, m.
    pub(super) at: Point2<f64>,
    /// As many points of the image count like it.
    pub(super) points: u32,
    /// It may come nearer to the middle of the corridor by this until the robot is
    /// there, m.
    pub(super) steps_in_m: f64,
}

/// The nearest thing in the corridor that the robot sweeps on an arc of this
/// curvature, 1/m, to the left positive; signs around `target` are the person who is
/// followed.
pub(super) fn ahead(
    settings: &CorridorSettings,
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

/// True for what stands on the floor, or hangs so low that the robot would hit it.
pub(super) fn is_thing(settings: &CorridorSettings, point: &Point3<f64>) -> bool {
    let floor = settings.floor_m + FLOOR_SLOPE * point.xy().coords.norm();
    floor < point.z && point.z < settings.top_m
}

/// The first bin with which enough points are nearer.
fn nearest(settings: &CorridorSettings, bins: &[u32]) -> Ahead {
    let mut points = 0_u32;
    let first = bins.iter().position(|bin| {
        points = points.saturating_add(*bin);
        points >= settings.min_points.max(1)
    });
    first.map_or(Ahead::Free, |bin| Ahead::Something(bin as f64 * BIN_M))
}

/// Distance from the front along the path, m, of what the robot would hit.
fn in_the_way(
    settings: &CorridorSettings,
    sign: &Sign,
    curvature: f64,
    target: Option<Point2<f64>>,
) -> Option<f64> {
    let flat = sign.at;
    let of_target = |t| nalgebra::distance(&flat, &t) < settings.target_radius_m;
    if target.is_some_and(of_target) {
        return None;
    }
    let (along, aside) = on_arc(flat, curvature);
    let from_front = along - settings.front_m;
    let half_width_m = settings.half_width_m + sign.steps_in_m;
    let inside = aside.abs() < half_width_m && along > 0.0 && from_front < settings.range_m;
    inside.then_some(from_front.max(0.0))
}

/// Distance along an arc that leaves the origin along x, and distance aside of
/// it, m.
fn on_arc(point: Point2<f64>, curvature: f64) -> (f64, f64) {
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
        let settings = CorridorSettings::default();
        let way = |x: f64, y: f64, z: f64, target: Option<Point2<f64>>| {
            let (point, at) = (Point3::new(x, y, z), Point2::new(x, y));
            let sign = Sign { at, points: 1, steps_in_m: 0.0 };
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
        let settings = CorridorSettings { min_points: 3, ..CorridorSettings::default() };
        assert_eq!(nearest(&settings, &[0, 1, 0, 1]), Ahead::Free);
        assert_eq!(nearest(&settings, &[0, 1, 0, 2]), Ahead::Something(3.0 * BIN_M));
    }
}
