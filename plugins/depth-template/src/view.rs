use std::sync::Arc;

use nalgebra::{Point2, Point3, Vector3};
use tagalong_core::{DepthImage, Derived, Frame, Result};
use tagalong_geometry::{Camera, HEAD_RADIUS_M, Rect};
use tagalong_vision::RowSums;

/// Reduced inverse-depth image of a frame, shared by all plugins that match silhouettes in it.
pub struct Working(pub RowSums);

/// Depth images are reduced by the whole factor that brings their focal length
/// nearest to this: finer ones cost time, coarser ones lose people far away.
const WORKING_FOCAL_PX: f64 = 267.0;

impl Working {
    /// An image without pixels.
    pub fn empty() -> Self {
        Self(RowSums::new(&DepthImage::filled(0, 0, 0.0), 1))
    }
}

impl Derived for Working {
    fn derive(frame: &Frame) -> Result<Self> {
        let scale = (frame.camera.focal_px() / WORKING_FOCAL_PX).round().max(1.0);
        Ok(Self(RowSums::despeckled(frame.depth()?, scale as usize)))
    }
}

/// Reduced pixels in metric terms. Made once per camera pose.
pub struct MetricImage {
    camera: Arc<Camera>,
    scale: f64,
    columns: usize,
    geometry: Vec<Geometry>,
}

/// Properties of a pixel that depend on the viewing ray alone.
#[derive(Clone, Copy, Debug, Default)]
struct Geometry {
    /// Height gained per metre of depth.
    slope: f32,
    pitch_rad: f32,
    roll_rad: f32,
}

/// The neighbourhood of a head in the image.
#[derive(Clone, Copy, Debug)]
pub struct Local {
    /// Reduced pixel of the head centre.
    pub x: i64,
    /// Its row.
    pub y: i64,
    /// Depth of the face, m.
    pub depth_m: f64,
    /// Reduced pixels per metre at that depth.
    pub px_per_m: f64,
    /// Angle of the viewing ray below the horizon, rad.
    pub pitch_rad: f64,
    /// Lean of the upward direction to the right in the image, rad.
    pub roll_rad: f64,
    /// Sine and cosine of `roll_rad`.
    sin_cos: (f64, f64),
}

impl Local {
    /// The same neighbourhood around another pixel close by.
    pub fn moved_to(mut self, x: i64, y: i64) -> Self {
        (self.x, self.y) = (x, y);
        self
    }

    /// Rays to an upright person at the height of the camera.
    #[cfg(test)]
    pub fn upright(x: i64, y: i64, depth_m: f64, px_per_m: f64) -> Self {
        let sin_cos = (0.0, 1.0);
        Self { x, y, depth_m, px_per_m, pitch_rad: 0.0, roll_rad: 0.0, sin_cos }
    }

    /// The reduced pixel that lies `right_m`, `down_m` from the head centre in
    /// the person's own axes, at the head's depth.
    pub fn offset(&self, right_m: f64, down_m: f64) -> (i64, i64) {
        let (sin, cos) = self.sin_cos;
        let x = (right_m * cos - down_m * sin) * self.px_per_m;
        let y = (right_m * sin + down_m * cos) * self.px_per_m;
        (self.x + x.round() as i64, self.y + y.round() as i64)
    }
}

impl MetricImage {
    /// Cells of the image that have a geometry are this many pixels apart.
    pub const GRID: i64 = 2;

    /// The view of `camera`, reduced like `rows`.
    pub fn new(camera: &Arc<Camera>, rows: &RowSums) -> Self {
        let columns = rows.width().div_ceil(Self::GRID as usize);
        let lines = rows.height().div_ceil(Self::GRID as usize);
        let camera = Arc::clone(camera);
        let scale = rows.scale() as f64;
        let mut view = Self { camera, scale, columns, geometry: Vec::new() };
        let up = view.camera.robot_from_camera.rotation.inverse() * Vector3::z();
        let cells = (0..columns * lines).map(|i| (i % columns * 2, i / columns * 2));
        view.geometry = cells.map(|(x, y)| view.geometry_of(x as f64, y as f64, &up)).collect();
        view
    }

    /// True if this is the view of that camera and reduction.
    pub fn is_of(&self, camera: &Camera, rows: &RowSums) -> bool {
        self.scale == rows.scale() as f64 && *self.camera == *camera
    }

    /// Columns of the reduced image, or one more.
    pub fn width(&self) -> i64 {
        self.columns as i64 * Self::GRID
    }

    /// The upward direction in the image is that in which a point moves when
    /// it is raised; it does not depend on the depth.
    fn geometry_of(&self, x: f64, y: f64, up_in_camera: &Vector3<f64>) -> Geometry {
        let ray = self.camera.ray(self.full_pixel(x, y));
        let slope = (self.camera.robot_from_camera.rotation * ray).z;
        let right = up_in_camera.x - ray.x * up_in_camera.z;
        let down = up_in_camera.y - ray.y * up_in_camera.z;
        Geometry {
            slope: slope as f32,
            pitch_rad: -(slope / ray.norm()).asin() as f32,
            roll_rad: right.atan2(-down) as f32,
        }
    }

    fn geometry(&self, x: i64, y: i64) -> Geometry {
        let index = (y / Self::GRID) as usize * self.columns + (x / Self::GRID) as usize;
        self.geometry.get(index).copied().unwrap_or_default()
    }

    /// The full-size pixel of a reduced one: the middle of its block.
    pub fn full_pixel(&self, x: f64, y: f64) -> Point2<f64> {
        let middle = 0.5 * (self.scale - 1.0);
        Point2::new(self.scale * x + middle, self.scale * y + middle)
    }

    /// The pixel of the image that is nearest to a reduced one.
    pub fn nearest_inside(&self, x: i64, y: i64) -> (i64, i64) {
        let lines = self.geometry.len() / self.columns.max(1);
        let [right, bottom] =
            [self.columns, lines].map(|cells| (cells as i64 * Self::GRID - 1).max(0));
        (x.clamp(0, right), y.clamp(0, bottom))
    }

    /// The reduced pixel of a point in the robot frame.
    pub fn reduced_pixel(&self, point: &Point3<f64>) -> Option<Point2<f64>> {
        let middle = 0.5 * (self.scale - 1.0);
        self.camera
            .project(point)
            .map(|p| Point2::new((p.x - middle) / self.scale, (p.y - middle) / self.scale))
    }

    /// Reduced pixels per metre at a depth.
    pub fn px_per_m(&self, depth_m: f64) -> f64 {
        self.camera.focal_px() / self.scale / depth_m
    }

    /// The head centre whose face is seen at a reduced pixel and depth, in the
    /// robot frame.
    pub fn head(&self, x: f64, y: f64, depth_m: f64) -> Point3<f64> {
        self.camera.back_project(self.full_pixel(x, y), depth_m + HEAD_RADIUS_M)
    }

    /// Height of the head centre whose face is seen at a reduced pixel, m.
    pub fn head_height_m(&self, x: i64, y: i64, depth_m: f64) -> f64 {
        self.camera.height_m() + f64::from(self.geometry(x, y).slope) * (depth_m + HEAD_RADIUS_M)
    }

    /// The neighbourhood of a head at a reduced pixel and depth.
    pub fn local(&self, x: i64, y: i64, depth_m: f64) -> Local {
        let Geometry { pitch_rad, roll_rad, .. } = self.geometry(x, y);
        let pitch_rad = f64::from(pitch_rad);
        let roll_rad = f64::from(roll_rad);
        let px_per_m = self.px_per_m(depth_m);
        Local { x, y, depth_m, px_per_m, pitch_rad, roll_rad, sin_cos: roll_rad.sin_cos() }
    }

    /// The full-size pixels of a run in `lines` reduced rows from `line` on.
    pub fn full_run(&self, line: i64, (from, to): (i64, i64), lines: i64) -> Rect {
        let [x, y, width, height] =
            [from, line, to - from, lines].map(|pixels| self.scale * pixels as f64);
        Rect::new(x, y, width, height)
    }

    /// The upper-body square of a head at a reduced pixel and depth.
    pub fn region(&self, x: f64, y: f64, depth_m: f64) -> Rect {
        self.camera.upper_body(&self.head(x, y, depth_m))
    }
}

#[cfg(test)]
mod tests {
    use tagalong_geometry::Pinhole;

    use super::*;

    fn camera(pitch_rad: f64) -> Arc<Camera> {
        Arc::new(Camera::mounted(Pinhole::centred(60.0, 64, 48), 64, 48, 1.2, pitch_rad, 0.1))
    }

    fn rows(scale: usize) -> RowSums {
        RowSums::new(&DepthImage::filled(64, 48, 2.0), scale)
    }

    #[test]
    fn the_height_from_the_table_is_that_of_the_point() {
        let view = MetricImage::new(&camera(0.3), &rows(2));
        for (x, y) in [(0, 0), (30, 2), (4, 22), (16, 12)] {
            let head = view.head(x as f64, y as f64, 2.5);
            assert!((view.head_height_m(x, y, 2.5) - head.z).abs() < 1e-5, "{x} {y}");
        }
    }

    #[test]
    fn a_reduced_pixel_is_the_middle_of_its_block() {
        let view = MetricImage::new(&camera(0.3), &rows(4));
        assert_eq!(view.full_pixel(3.0, 5.0), Point2::new(13.5, 21.5));
        let back = view.reduced_pixel(&view.head(3.0, 5.0, 2.5)).unwrap();
        assert!((back - Point2::new(3.0, 5.0)).norm() < 1e-9, "{back}");
    }

    #[test]
    fn a_view_is_of_one_camera_and_one_reduction() {
        let view = MetricImage::new(&camera(0.3), &rows(2));
        assert!(view.is_of(&camera(0.3), &rows(2)));
        assert!(!view.is_of(&camera(0.2), &rows(2)));
        assert!(!view.is_of(&camera(0.3), &rows(4)));
    }
}
