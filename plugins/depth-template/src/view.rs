use std::sync::Arc;

use nalgebra::{Point2, Point3, Vector3};
use tagalong_core::{Camera, Derived, Frame, HEAD_RADIUS_M, Result};
use tagalong_vision::RowSums;

/// The reduced inverse-depth image of a frame, shared by whoever matches
/// silhouettes in it.
pub struct Working(pub RowSums);

/// Depth images are reduced by the whole factor that brings their focal length
/// nearest to this: finer ones cost time, coarser ones lose people far away.
const WORKING_FOCAL_PX: f64 = 267.0;

impl Derived for Working {
    fn derive(frame: &Frame) -> Result<Self> {
        let scale = (frame.camera.focal_px() / WORKING_FOCAL_PX).round().max(1.0);
        Ok(Self(RowSums::new(frame.depth()?, scale as usize)))
    }
}

/// Reduced pixels in metric terms.
pub struct View {
    camera: Arc<Camera>,
    scale: f64,
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
    /// How far the viewing ray points below the horizon, rad.
    pub pitch_rad: f64,
    /// How far the upward direction leans to the right in the image, rad.
    pub roll_rad: f64,
}

impl Local {
    /// The reduced pixel that lies `right_m`, `down_m` from the head centre in
    /// the person's own axes, at the head's depth.
    pub fn offset(&self, right_m: f64, down_m: f64) -> (i64, i64) {
        let (sin, cos) = self.roll_rad.sin_cos();
        let x = (right_m * cos - down_m * sin) * self.px_per_m;
        let y = (right_m * sin + down_m * cos) * self.px_per_m;
        (self.x + x.round() as i64, self.y + y.round() as i64)
    }
}

impl View {
    /// The view of `camera` reduced by `scale`.
    pub fn new(camera: &Arc<Camera>, scale: usize) -> Self {
        Self { camera: Arc::clone(camera), scale: scale as f64 }
    }

    /// The full-size pixel of a reduced one: the middle of its block.
    pub fn full_pixel(&self, x: f64, y: f64) -> Point2<f64> {
        let middle = 0.5 * (self.scale - 1.0);
        Point2::new(self.scale * x + middle, self.scale * y + middle)
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

    /// How fast the height grows with depth along the ray of a reduced pixel.
    pub fn slope(&self, x: i64, y: i64) -> f64 {
        let ray = self.camera.ray(self.full_pixel(x as f64, y as f64));
        (self.camera.robot_from_camera.rotation * ray).z
    }

    /// Height of the camera, m.
    pub fn height_m(&self) -> f64 {
        self.camera.height_m()
    }

    /// The neighbourhood of a head at a reduced pixel and depth.
    pub fn local(&self, x: i64, y: i64, depth_m: f64) -> Local {
        let head = self.head(x as f64, y as f64, depth_m);
        let above = self.reduced_pixel(&(head + Vector3::new(0.0, 0.0, 0.1)));
        let roll_rad = above.map_or(0.0, |p| (p.x - x as f64).atan2(y as f64 - p.y));
        let ray = head - Point3::from(self.camera.robot_from_camera.translation.vector);
        let pitch_rad = -(ray.z / ray.norm()).asin();
        Local { x, y, depth_m, px_per_m: self.px_per_m(depth_m), pitch_rad, roll_rad }
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }
}
