//! Registration of a depth image to the view of the colour camera.

use nalgebra::{Isometry3, Point2, Point3, Vector3};
use tagalong_core::DepthImage;
use tagalong_geometry::{Camera, Lens};

/// Factor by which splats overlap, so that stretching leaves no holes.
const OVERLAP: f64 = 1.1;
/// Maximum side of a splat, pixels.
const MAX_SPLAT_PX: f64 = 8.0;

/// Registration of depth images of one camera to another one. The rays of the depth camera, which
/// are costly for a distorted lens, are computed once.
#[derive(Clone, Debug)]
pub struct Registration {
    rays: Vec<Vector3<f64>>,
    depth_size: (usize, usize),
    colour: Camera,
    colour_from_depth: Isometry3<f64>,
    focal_ratio: f64,
}

impl Registration {
    /// Prepares the registration for the lenses and sizes of both cameras (their poses on the robot
    /// are not used) and for the pose of the depth camera relative to the colour camera.
    pub fn new(depth: &Camera, colour: &Camera, colour_from_depth: Isometry3<f64>) -> Self {
        let pixels = (0..depth.height).flat_map(|y| (0..depth.width).map(move |x| (x, y)));
        Self {
            rays: pixels.map(|(x, y)| depth.ray(Point2::new(x as f64, y as f64))).collect(),
            depth_size: (depth.width, depth.height),
            colour: colour.clone(),
            colour_from_depth,
            focal_ratio: focal(colour) / focal(depth),
        }
    }

    /// Returns true if the relative pose of the two cameras is still this one.
    pub fn is_for(&self, colour_from_depth: &Isometry3<f64>) -> bool {
        self.colour_from_depth == *colour_from_depth
    }

    /// Returns the depth image as seen by the colour camera, with nearer surfaces in front of
    /// farther ones. Each reading covers a square of the size of its pixel in that image, so that a
    /// larger colour image has no holes. `None` if the image does not have the size of the depth
    /// camera.
    pub fn apply(&self, depth: &DepthImage) -> Option<DepthImage> {
        if (depth.width(), depth.height()) != self.depth_size {
            return None;
        }
        let mut out = DepthImage::filled(self.colour.width, self.colour.height, f32::NAN);
        for (ray, reading) in self.rays.iter().zip(depth.pixels()) {
            if reading.is_finite() {
                self.splat(&mut out, ray, f64::from(*reading));
            }
        }
        Some(out)
    }

    fn splat(&self, out: &mut DepthImage, ray: &Vector3<f64>, reading: f64) {
        let point = self.colour_from_depth * Point3::from(ray * reading);
        let Some(pixel) = self.colour.project_from_camera(&point) else { return };
        // The upper limit keeps a reading close to the colour camera from covering the image.
        let side = (self.focal_ratio * reading / point.z * OVERLAP).clamp(1.0, MAX_SPLAT_PX);
        let columns = covered(pixel.x, side, out.width());
        let width = out.width();
        let z = point.z as f32;
        for y in covered(pixel.y, side, out.height()) {
            for old in &mut out.pixels_mut()[y * width..][columns.clone()] {
                // Also if there is no surface yet.
                if old.is_nan() || z < *old {
                    *old = z;
                }
            }
        }
    }
}

fn focal(camera: &Camera) -> f64 {
    let Lens::Pinhole(lens) = &camera.lens else { return camera.focal_px() };
    0.5 * (lens.fx + lens.fy)
}

/// Returns the pixels whose centres are within half a side of `centre`.
fn covered(centre: f64, side: f64, size: usize) -> std::ops::Range<usize> {
    let from = (centre - 0.5 * side).ceil().clamp(0.0, size as f64) as usize;
    let to = ((centre + 0.5 * side).floor() + 1.0).clamp(0.0, size as f64) as usize;
    from..to.max(from)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tagalong_geometry::{Distortion, Pinhole};

    use super::*;

    fn camera(width: usize, height: usize, focal: f64, distortion: Distortion) -> Camera {
        let lens = Pinhole {
            fx: focal,
            fy: focal,
            cx: width as f64 / 2.0 - 0.5,
            cy: height as f64 / 2.0 - 0.5,
            distortion,
        };
        Camera::mounted(lens, width, height, 1.0, 0.0, 0.0)
    }

    /// Renders a wall at z = 4 m and a square board of 1 m at z = 2 m, both in the coordinates of
    /// the depth camera, by ray casting from any camera.
    fn render(camera: &Camera, depth_from_camera: &Isometry3<f64>) -> DepthImage {
        DepthImage::from_fn(camera.width, camera.height, |x, y| {
            let ray = camera.ray(Point2::new(x as f64, y as f64));
            let o = depth_from_camera.translation.vector;
            let d = depth_from_camera.rotation * ray;
            let at = o + d * ((2.0 - o.z) / d.z);
            let on_board = at.x.abs() < 0.5 && at.y.abs() < 0.5;
            let hit_m = if on_board { 2.0 } else { 4.0 };
            ((hit_m - o.z) / d.z) as f32
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn what_the_colour_camera_would_measure(
            x in -0.06..0.06f64, y in -0.02..0.02f64, yaw in -0.05..0.05f64,
            focal in 150.0..320.0f64, k1 in -0.05..0.05f64,
        ) {
            let depth = camera(160, 120, 160.0, Distortion::PlumbBob([k1, 0.0, 0.0, 0.0, 0.0]));
            let colour = camera(200, 150, focal, Distortion::None);
            let colour_from_depth =
                Isometry3::new(Vector3::new(x, y, 0.0), Vector3::new(0.0, yaw, 0.0));
            let seen = render(&depth, &Isometry3::identity());
            let moved = Registration::new(&depth, &colour, colour_from_depth).apply(&seen).unwrap();
            let expected = render(&colour, &colour_from_depth.inverse());
            let pairs = moved.pixels().iter().zip(expected.pixels());
            let inside = pairs.filter(|(got, _)| got.is_finite()).count();
            let wrong = moved.pixels().iter().zip(expected.pixels())
                .filter(|(got, want)| got.is_finite() && (*got - *want).abs() > 0.03)
                .count();
            // Only the outline of the board and the strip that it hides differ.
            prop_assert!(inside > 8000, "{inside} readings");
            prop_assert!(wrong * 12 < inside, "{wrong} of {inside}");
            let board = moved.get(100, 75).unwrap();
            prop_assert!((board - expected.get(100, 75).unwrap()).abs() < 0.02, "hole or wrong: {board}");
        }
    }

    #[test]
    fn the_same_camera_changes_nothing() {
        let both = camera(64, 48, 60.0, Distortion::None);
        let depth =
            DepthImage::from_fn(64, 48, |x, y| if (x + y) % 7 == 0 { f32::NAN } else { 2.0 });
        let same = Registration::new(&both, &both, Isometry3::identity()).apply(&depth).unwrap();
        for (a, b) in same.pixels().iter().zip(depth.pixels()) {
            assert!(a.is_nan() == b.is_nan() && (a.is_nan() || a == b), "{a} {b}");
        }
    }

    #[test]
    fn a_larger_image_has_no_holes() {
        let small = camera(64, 48, 60.0, Distortion::None);
        let large = camera(256, 192, 240.0, Distortion::None);
        let depth = DepthImage::filled(64, 48, 3.0);
        let big = Registration::new(&small, &large, Isometry3::identity()).apply(&depth).unwrap();
        let holes = big.pixels().iter().filter(|d| d.is_nan()).count();
        assert_eq!(holes, 0);
    }

    #[test]
    fn another_size_is_refused() {
        let both = camera(64, 48, 60.0, Distortion::None);
        let registration = Registration::new(&both, &both, Isometry3::identity());
        assert!(registration.apply(&DepthImage::filled(48, 64, 1.0)).is_none());
    }
}
