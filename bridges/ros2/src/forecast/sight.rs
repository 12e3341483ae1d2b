//! Positions that the sensors of a frame observe.

use std::f64::consts::TAU;

use nalgebra::{Point2, Point3};
use tagalong::core::{DepthImage, Frame, LaserScan, PointCloud, RayReading};
use tagalong::nalgebra;

/// Heights above the floor at which a person is looked for, m: shins, hips, head.
const HEIGHTS_M: [f64; 3] = [0.3, 0.9, 1.6];
/// Distance behind a measured surface within which a position counts as observed, m: the depth of a
/// person.
const BEHIND_M: f64 = 0.4;
/// Maximum distance at which a person is seen without a measured depth, m.
const FAR_M: f64 = 10.0;

/// Visibility for the sensors of a frame.
pub(super) struct Sight<'a> {
    frame: &'a Frame,
    depth: Option<&'a DepthImage>,
    has_points: bool,
}

impl<'a> Sight<'a> {
    pub(super) fn new(frame: &'a Frame) -> Self {
        let size = (frame.camera.width, frame.camera.height);
        let depth = frame.depth().ok().filter(|depth| (depth.width(), depth.height()) == size);
        Self { frame, depth, has_points: frame.sensor::<PointCloud>().is_ok() }
    }

    /// Returns true if a person standing at a position, in the robot frame, would be seen.
    pub(super) fn sees(&self, at: &Point2<f64>) -> bool {
        // A lidar with several layers has a full field of view.
        self.has_points && at.coords.norm() <= FAR_M
            || self.frame.scans().any(|scan| scan_sees(scan, at))
            || HEIGHTS_M.iter().any(|height_m| self.camera_sees(&at.coords.push(*height_m).into()))
    }

    fn camera_sees(&self, at: &Point3<f64>) -> bool {
        let camera = &self.frame.camera;
        let Some(pixel) = camera.project(at) else { return false };
        let column = pixel.x.floor();
        let row = pixel.y.floor();
        let is_inside = (0.0..camera.width as f64).contains(&column)
            && (0.0..camera.height as f64).contains(&row);
        if !is_inside {
            return false;
        }
        let away_m = camera.depth_of(at);
        match self.depth {
            // A pixel without a reading gives no information.
            Some(depth) => depth
                .get(column as i64, row as i64)
                .is_some_and(|surface_m| f64::from(surface_m) + BEHIND_M >= away_m),
            None => away_m <= FAR_M,
        }
    }
}

/// Returns true if a ray of the scan passes a position, or ends there.
fn scan_sees(scan: &LaserScan, at: &Point2<f64>) -> bool {
    let from_scanner = scan.robot_from_scanner.inverse_transform_point(&at.coords.push(0.0).into());
    let direction_rad = from_scanner.y.atan2(from_scanner.x);
    let Some(ray) = ray_towards(scan, direction_rad) else { return false };
    let away_m = from_scanner.xy().coords.norm();
    if let Ok(number) = scan.rays.binary_search(&ray) {
        let end = scan.robot_from_scanner.inverse_transform_point(&scan.points[number]);
        return end.xy().coords.norm() + BEHIND_M >= away_m;
    }
    let unread = scan.unread.binary_search_by_key(&ray, |unread| unread.ray);
    unread.is_ok_and(|number| scan.unread[number].reading == RayReading::NoReturn)
        && away_m <= FAR_M
}

/// Returns the index of the ray in a direction of the scanner's frame.
fn ray_towards(scan: &LaserScan, direction_rad: f64) -> Option<u32> {
    if scan.increment_rad == 0.0 {
        return None;
    }
    let sense = scan.increment_rad.signum();
    let swept_rad = (sense * (direction_rad - scan.first_rad)).rem_euclid(TAU);
    Some((swept_rad / scan.increment_rad.abs()).round() as u32)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Isometry3;
    use tagalong::core::{EgoMotion, Images, Stamp, UnreadRay};
    use tagalong::geometry::Camera;

    use super::*;
    use crate::forecast::tests::frame_at;

    #[test]
    fn a_camera_sees_what_is_in_its_image_and_not_behind_a_surface() {
        let wall = DepthImage::filled(160, 120, 3.0);
        let before = frame_at(0.0, Some(wall.clone()));
        assert!(sees_place(&before, 2.0, 0.0) && sees_place(&before, 3.3, 0.0));
        assert!(!sees_place(&before, 3.5, 0.0), "behind the wall");
        assert!(!sees_place(&before, -2.0, 0.0), "behind the camera");
        assert!(sees_place(&before, 2.0, 1.9), "within the image");
        assert!(!sees_place(&before, 2.0, 2.1), "beside the image");
        let mut dark = wall;
        dark.pixels_mut().fill(f32::NAN);
        assert!(!sees_place(&frame_at(0.0, Some(dark)), 2.0, 0.0), "no reading says nothing");
        let blind = frame_at(0.0, None);
        assert!(sees_place(&blind, 9.0, 0.0), "without depth");
        assert!(!sees_place(&blind, 11.0, 0.0), "without depth, too far");
    }

    /// Whether a place is in sight in a frame.
    fn sees_place(frame: &Frame, x: f64, y: f64) -> bool {
        Sight::new(frame).sees(&Point2::new(x, y))
    }

    #[test]
    fn a_scan_sees_along_its_rays() {
        // Five rays of a quarter turn from right to left, behind a blind camera: the first ends at 2 m,
        // nothing comes back from the middle one, and the others say nothing.
        let robot_from_scanner = Isometry3::translation(0.0, 0.0, 0.2);
        let unread = [(2, RayReading::NoReturn), (3, RayReading::Invalid)];
        let unread: Vec<UnreadRay> =
            unread.into_iter().map(|(ray, reading)| UnreadRay { ray, reading }).collect();
        let scan = LaserScan::of_points(vec![Point3::new(0.0, -2.0, 0.2)])
            .with_scanner(robot_from_scanner)
            .with_rays(-TAU / 4.0, TAU / 8.0, vec![0])
            .with_unread(unread);
        let camera = Arc::new(Camera::blind(robot_from_scanner));
        let motion = EgoMotion::at_rest(0.1);
        let frame = Frame::new(1, Stamp::default(), camera, motion, Images::default());
        let frame = frame.with_laser(Some(scan));
        for (x, y, is_seen) in [
            (0.0, -1.0, true),
            (0.0, -2.3, true),
            (0.0, -2.5, false),
            (5.0, 0.1, true),
            (FAR_M + 1.0, 0.0, false),
            (1.0, 1.0, false),
            (-1.0, 0.0, false),
        ] {
            assert_eq!(sees_place(&frame, x, y), is_seen, "{x} {y}");
        }
    }
}
