//! Points above the floor, and places where the floor is missing.

use nalgebra::Point3;

use super::CollisionMonitorSettings;

/// Growth of the floor's height limit with the distance, m per m.
const FLOOR_SLOPE: f64 = 0.03;

/// Returns true for a point of an obstacle: above the floor, and low enough for the robot to hit
/// it.
pub(super) fn is_thing(settings: &CollisionMonitorSettings, point: &Point3<f64>) -> bool {
    // Most points of an image are of the floor, at any distance.
    let may_be = settings.floor_m < point.z && point.z < settings.top_m;
    if !may_be {
        return false;
    }
    // Depth noise and errors of the mount's pitch lift far floor points.
    let floor = settings.floor_m + FLOOR_SLOPE * point.xy().coords.norm();
    floor < point.z
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
    if point.z >= -settings.drop_m {
        return None;
    }
    let depth = settings.drop_m + FLOOR_SLOPE * point.xy().coords.norm();
    // A camera below the floor has a wrong mount; it sees no falls.
    if !(point.z < -depth && eye.z > 0.0) {
        return None;
    }
    let part = eye.z / (eye.z - point.z);
    let at = eye + part * (point - eye);
    Some(Point3::new(at.x, at.y, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_floor_grows_rougher_with_the_distance_and_hanging_lamps_are_passed_below() {
        let settings = CollisionMonitorSettings::default();
        for (x, z, expected, why) in [
            (0.0, 0.07, false, "8 cm"),
            (0.0, 0.09, true, "8 cm"),
            (2.0, 0.13, false, "and 3 cm a metre"),
            (2.0, 0.15, true, "and 3 cm a metre"),
            (-2.0, 0.15, true, "and 3 cm a metre"),
            (1.0, 1.49, true, "a lamp that hangs too low"),
            (1.0, 1.51, false, "a lamp that is passed below"),
            (f64::NAN, 0.5, false, "no place"),
        ] {
            let point = Point3::new(x, 0.0, z);
            assert_eq!(is_thing(&settings, &point), expected, "{x} {z}: {why}");
        }
    }
}
