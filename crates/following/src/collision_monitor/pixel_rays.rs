//! Viewing rays of the pixels of a depth camera.

use nalgebra::{Isometry3, Matrix3, Point2, Point3, Vector3};
use tagalong_geometry::{Camera, Distortion, Lens};

/// Viewing rays of the sampled pixels of a camera, in its own frame. They are the same in each image,
/// and to remove the distortion of a lens takes longer than all that is done with a reading.
#[derive(Default)]
pub(super) struct PixelRays {
    known: Option<Sampling>,
    table: Table,
}

/// Rays of depth 1.
#[derive(Default)]
enum Table {
    /// Of no camera yet.
    #[default]
    Empty,
    /// Of a lens without distortion: the x of each column and the y of each row. They stay in the cache
    /// of the processor.
    Straight { columns: Vec<f64>, rows: Vec<f64> },
    /// Row by row, with the starts of the rays; these are empty for a camera with a single viewpoint.
    Any { rays: Vec<Vector3<f64>>, starts: Vec<Vector3<f64>> },
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
    table: &'a Table,
    /// Sampled columns of the image.
    across: usize,
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
            self.table = table(&sampling);
            self.known = Some(sampling);
        }
        PosedRays {
            table: &self.table,
            across: width.div_ceil(step),
            turn: camera.robot_from_camera.rotation.to_rotation_matrix().into_inner(),
            eye: camera.robot_from_camera.translation.vector,
        }
    }
}

/// Returns the rays of the sampled pixels.
fn table(sampling: &Sampling) -> Table {
    let Sampling { lens, width, height, step } = *sampling;
    let camera = Camera { lens, width, height, robot_from_camera: Isometry3::identity() };
    if matches!(&lens, Lens::Pinhole(lens) if lens.distortion == Distortion::None) {
        return Table::Straight {
            columns: (0..width)
                .step_by(step)
                .map(|x| camera.ray(Point2::new(x as f64, 0.0)).x)
                .collect(),
            rows: (0..height)
                .step_by(step)
                .map(|y| camera.ray(Point2::new(0.0, y as f64)).y)
                .collect(),
        };
    }
    let has_viewpoint = !matches!(lens, Lens::Panorama(_));
    let mut rays = Vec::new();
    let mut starts = Vec::new();
    for y in (0..height).step_by(step) {
        for x in (0..width).step_by(step) {
            let pixel = Point2::new(x as f64, y as f64);
            rays.push(camera.ray(pixel));
            if !has_viewpoint {
                starts.push(camera.back_project(pixel, 0.0).coords);
            }
        }
    }
    Table::Any { rays, starts }
}

impl PosedRays<'_> {
    /// Returns the point at a depth, m, on the ray of the pixel in a sampled column and row; robot
    /// frame, m.
    pub(super) fn point(&self, column: usize, row: usize, depth_m: f64) -> Point3<f64> {
        let in_camera = match self.table {
            Table::Empty => return Point3::from(self.eye),
            Table::Straight { columns, rows } => {
                Vector3::new(columns[column], rows[row], 1.0) * depth_m
            }
            Table::Any { rays, starts } => {
                let pixel = row * self.across + column;
                let way = rays[pixel] * depth_m;
                starts.get(pixel).map_or(way, |start| start + way)
            }
        };
        Point3::from(self.turn * in_camera + self.eye)
    }
}

#[cfg(test)]
mod tests {
    use tagalong_geometry::Pinhole;

    use super::*;

    fn assert_as_camera(rays: &mut PixelRays, camera: &Camera) {
        let step = 3;
        let posed = rays.of(camera, [camera.width, camera.height], step);
        for (row, y) in (0..camera.height).step_by(step).enumerate() {
            for (column, x) in (0..camera.width).step_by(step).enumerate() {
                let expected = camera.back_project(Point2::new(x as f64, y as f64), 1.7);
                let found = posed.point(column, row, 1.7);
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
        let bent =
            Pinhole { distortion: Distortion::PlumbBob([-0.2, 0.05, 0.001, 0.0, 0.0]), ..lens };
        assert_as_camera(&mut rays, &Camera::mounted(bent, 40, 30, 0.4, 0.2, 0.0));
    }
}
