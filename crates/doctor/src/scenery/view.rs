use std::ops::Range;

use nalgebra::{Isometry3, Point2, Point3, Vector3};
use tagalong_core::{DepthImage, Stamp, spatial_pose};
use tagalong_geometry::{Camera, Lens, Rect};
use tagalong_log::LogFrame;

/// Least number of columns of a reduced image.
const COLUMNS: usize = 128;

/// Range of depth in which readings are used, m: nearer objects show no shape, and at larger
/// distances the steps of depth are as large as people.
const DEPTH_M: std::ops::RangeInclusive<f32> = 0.3..=6.5;

/// Depth image at reduced size, with the pose of its camera in the odometry frame.
pub struct View {
    /// Index of the frame.
    pub index: u64,
    /// Time of the frame.
    pub stamp: Stamp,
    /// Pixels of the full image per pixel here.
    step: usize,
    columns: usize,
    rows: usize,
    camera: Camera,
    odom_from_camera: Isometry3<f64>,
    camera_from_odom: Isometry3<f64>,
    /// Readings, row by row, m; NaN for no reading.
    depth: Vec<f32>,
    /// Smallest reading within one pixel, m; infinite for no reading.
    nearest: Vec<f32>,
}

/// Result of comparing a point with the reading of a later or earlier view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// The view looks through the point, which was free.
    Through,
    /// The point was occupied.
    Onto,
    /// The point is hidden, outside of the image, or without a reading.
    Unknown,
}

impl View {
    /// Reduces the depth image of a frame; `None` without depth or for a panorama.
    pub fn of(item: &LogFrame) -> Option<Self> {
        let frame = &item.frame;
        let depth = frame.images().depth?;
        let Lens::Pinhole(_) = &frame.camera.lens else { return None };
        let step = (depth.width() / COLUMNS).max(1);
        let columns = depth.width() / step;
        let rows = depth.height() / step;
        let readings = reduced(&depth, step, columns, rows);
        let odom_from_robot = item.odom_from_robot;
        let odom_from_camera = spatial_pose(&odom_from_robot) * frame.camera.robot_from_camera;
        Some(Self {
            index: frame.index,
            stamp: frame.stamp,
            step,
            columns,
            rows,
            camera: Camera::clone(&frame.camera),
            odom_from_camera,
            camera_from_odom: odom_from_camera.inverse(),
            nearest: nearest(&readings, columns, rows),
            depth: readings,
        })
    }

    /// Returns the visible points in the odometry frame, m: z is the height above the floor.
    pub fn points(&self) -> impl Iterator<Item = Point3<f64>> {
        let usable = self.depth.iter().enumerate().filter(|(_, depth)| DEPTH_M.contains(*depth));
        usable.map(|(at, depth)| {
            let pixel = Point2::new(at % self.columns, at / self.columns);
            let full = pixel.map(|v| (v * self.step + self.step / 2) as f64);
            self.odom_from_camera * Point3::from(self.camera.ray(full) * f64::from(*depth))
        })
    }

    /// Compares a point of the odometry frame with the reading at its pixel.
    pub fn look_at(&self, point: &Point3<f64>) -> Look {
        let point = self.camera_from_odom * point;
        let pixel = self.camera.project_from_camera(&point);
        let Some(reading) = pixel.and_then(|pixel| self.reading(pixel)) else {
            return Look::Unknown;
        };
        let margin = MARGIN_M + MARGIN_GROWTH * point.z * point.z;
        if reading > point.z + margin {
            Look::Through
        } else if reading > point.z - margin {
            Look::Onto
        } else {
            Look::Unknown
        }
    }

    /// Returns the smallest reading around a pixel of the full image, m.
    fn reading(&self, pixel: Point2<f64>) -> Option<f64> {
        let cell = pixel.map(|v| (v / self.step as f64).floor());
        if !(0.0..self.columns as f64).contains(&cell.x)
            || !(0.0..self.rows as f64).contains(&cell.y)
        {
            return None;
        }
        let reading = self.nearest[cell.y as usize * self.columns + cell.x as usize];
        reading.is_finite().then_some(f64::from(reading))
    }

    /// Returns the number of pixels per square metre at a distance.
    pub fn pixels_per_square_metre(&self, distance_m: f64) -> f64 {
        (self.camera.focal_px() / self.step as f64 / distance_m.max(0.1)).powi(2)
    }

    /// Returns the position of the camera on the floor, odometry frame, m.
    pub fn eye(&self) -> Point2<f64> {
        self.odom_from_camera.translation.vector.xy().into()
    }

    /// Returns the upper-body square of a person at a position, with the centre of the head at a
    /// height.
    pub fn upper_body(&self, place: Point2<f64>, head_m: f64) -> Rect {
        let in_camera = self.camera_from_odom * Point3::new(place.x, place.y, head_m);
        self.camera.upper_body(&(self.camera.robot_from_camera * in_camera))
    }

    /// Returns the distance and the bearing (positive to the left) of a position from the camera, m
    /// and degrees.
    pub fn bearing_of(&self, place: Point2<f64>) -> (f64, f64) {
        let ahead = (self.odom_from_camera.rotation * Vector3::z()).xy();
        let to = place - self.eye();
        let turn = ahead.perp(&to).atan2(ahead.dot(&to));
        (to.norm(), turn.to_degrees())
    }
}

/// Returns the least significant difference of depths, m, which grows like the noise of depth
/// cameras.
const MARGIN_M: f64 = 0.2;
const MARGIN_GROWTH: f64 = 0.015;

fn reduced(depth: &DepthImage, step: usize, columns: usize, rows: usize) -> Vec<f32> {
    let readings = (0..columns * rows).map(|i| {
        let x = i % columns * step + step / 2;
        let y = i / columns * step + step / 2;
        depth.row(y)[x]
    });
    readings.collect()
}

/// Returns, for each pixel, the smallest reading within one pixel.
fn nearest(depth: &[f32], columns: usize, rows: usize) -> Vec<f32> {
    let smallest = (0..depth.len()).map(|at| {
        let xs = around(at % columns, columns);
        let cells = around(at / columns, rows).flat_map(|y| xs.clone().map(move |x| (x, y)));
        // `min` ignores NaN, which means no reading.
        cells.map(|(x, y)| depth[y * columns + x]).fold(f32::INFINITY, f32::min)
    });
    smallest.collect()
}

/// Returns a column or a row and its neighbours.
fn around(at: usize, count: usize) -> Range<usize> {
    at.saturating_sub(1)..(at + 2).min(count)
}
