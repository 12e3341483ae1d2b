//! Viewing rays of the pixels of a depth camera.

use nalgebra::{Isometry3, Matrix3, Point2, Point3, Vector3};
use tagalong_geometry::{Camera, Lens};

/// Viewing rays of the sampled pixels of a camera, in its own frame. They are the same in each image,
/// and to remove the distortion of a lens takes longer than all that is done with a reading.
#[derive(Default)]
pub(super) struct PixelRays {
    known: Option<Sampling>,
    /// Rays of depth 1, row by row.
    rays: Vec<Vector3<f64>>,
    /// Starts of the rays; empty for a camera with a single viewpoint.
    starts: Vec<Vector3<f64>>,
}

/// Sampling of the image of a lens.
#[derive(Clone, Copy, PartialEq)]
struct Sampling {
    lens: Lens,
    width: usize,
    height: usize,
    step: usize,
}

/// Pixels of an image with the pose of its camera.
pub(super) struct PosedRays<'a> {
    rays: &'a [Vector3<f64>],
    starts: &'a [Vector3<f64>],
    turn: Matrix3<f64>,
    eye: Vector3<f64>,
}

impl PixelRays {
    /// Returns the rays of each `step`-th pixel of each `step`-th row of an image.
    pub(super) fn of(
        &mut self,
        camera: &Camera,
        [width, height]: [usize; 2],
        step: usize,
    ) -> PosedRays<'_> {
        let sampling = Sampling { lens: camera.lens, width, height, step };
        if self.known != Some(sampling) {
            self.fill(&sampling);
            self.known = Some(sampling);
        }
        PosedRays {
            rays: &self.rays,
            starts: &self.starts,
            turn: camera.robot_from_camera.rotation.to_rotation_matrix().into_inner(),
            eye: camera.robot_from_camera.translation.vector,
        }
    }

    fn fill(&mut self, sampling: &Sampling) {
        let Sampling { lens, width, height, step } = *sampling;
        let camera = Camera { lens, width, height, robot_from_camera: Isometry3::identity() };
        let has_viewpoint = !matches!(lens, Lens::Panorama(_));
        self.rays.clear();
        self.starts.clear();
        for y in (0..height).step_by(step) {
            for x in (0..width).step_by(step) {
                let pixel = Point2::new(x as f64, y as f64);
                self.rays.push(camera.ray(pixel));
                if !has_viewpoint {
                    self.starts.push(camera.back_project(pixel, 0.0).coords);
                }
            }
        }
    }
}

impl PosedRays<'_> {
    /// Returns the point at a depth, m, on the ray of the pixel with this number; robot frame, m.
    pub(super) fn point(&self, pixel: usize, depth_m: f64) -> Point3<f64> {
        let way = self.rays[pixel] * depth_m;
        let in_camera = self.starts.get(pixel).map_or(way, |start| start + way);
        Point3::from(self.turn * in_camera + self.eye)
    }
}

#[cfg(test)]
mod tests {
    use tagalong_geometry::{Distortion, Pinhole};

    use super::*;

    fn assert_as_camera(rays: &mut PixelRays, camera: &Camera) {
        let step = 3;
        let columns = camera.width.div_ceil(step);
        let posed = rays.of(camera, [camera.width, camera.height], step);
        for (row, y) in (0..camera.height).step_by(step).enumerate() {
            for (column, x) in (0..camera.width).step_by(step).enumerate() {
                let expected = camera.back_project(Point2::new(x as f64, y as f64), 1.7);
                let found = posed.point(row * columns + column, 1.7);
                assert!((found - expected).norm() < 1e-12, "{x} {y} {found} {expected}");
            }
        }
    }

    #[test]
    fn points_are_those_of_the_camera_also_after_another_one() {
        let lens = Pinhole { fx: 40.0, fy: 42.0, cx: 19.0, cy: 14.5, distortion: Distortion::None };
        let mut rays = PixelRays::default();
        let camera = Camera::mounted(lens, 40, 30, 1.1, 0.3, 0.05);
        assert_as_camera(&mut rays, &camera);
        assert_as_camera(&mut rays, &Camera::mounted(lens, 40, 30, 0.4, 0.0, 0.0));
        assert_as_camera(&mut rays, &Camera { width: 20, ..camera });
    }
}
