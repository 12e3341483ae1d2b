//! Conversion between the image and the robot frame.

use nalgebra::{Matrix2, Matrix3x2, Point2, Point3, SMatrix, Vector2, Vector3};
use tagalong_core::EgoMotion;
use tagalong_geometry::Camera;

/// Least depth of a point that has a pixel, m.
const NEAREST_M: f64 = 0.1;

/// Steps of the derivatives: pixels, pixels/s, m, m/s.
const STEPS: [f64; 6] = [1e-2, 1e-2, 1e-2, 1e-2, 1e-5, 1e-5];

/// A moving point in image coordinates and range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ImagePoint {
    /// Pixel of the point.
    pub(crate) pixel: Point2<f64>,
    /// Velocity of the pixel, pixels/s.
    pub(crate) velocity: Vector2<f64>,
    /// Distance from the camera, m, and its rate, m/s. (Depth would do in the middle of the image;
    /// far from it a small error of the depth is a large error of the position.)
    pub(crate) range: Vector2<f64>,
}

/// A moving point in the robot frame: m, m/s over ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RobotPoint {
    pub(crate) position: Point3<f64>,
    pub(crate) velocity: Vector3<f64>,
}

impl ImagePoint {
    /// Returns the point in space: P = R u r + t and V = R (u r' + u' r), with the viewing ray u of
    /// unit length.
    pub(crate) fn in_space(&self, camera: &Camera) -> RobotPoint {
        let rotation = camera.robot_from_camera.rotation;
        let ray = camera.ray(self.pixel);
        let length = ray.norm();
        let turning = ray_slope(camera, self.pixel) * self.velocity;
        let unit = ray / length;
        // Only the part across the ray turns the unit vector.
        let turning = (turning - unit * unit.dot(&turning)) / length;
        let velocity = unit * self.range.y + turning * self.range.x;
        RobotPoint {
            position: camera.robot_from_camera * Point3::from(unit * self.range.x),
            velocity: rotation * velocity,
        }
    }

    /// Returns the same point after the robot's motion, from one camera to the next; `None` if that
    /// takes it behind the camera.
    pub(crate) fn after(&self, motion: &EgoMotion, [from, to]: [&Camera; 2]) -> Option<Self> {
        self.in_space(from).after(motion).seen(to)
    }

    /// Returns the derivative of (X, Y, Z, VX, VY) in the robot frame with respect to (x, y, vx,
    /// vy) in the image, the range and its rate.
    pub(crate) fn jacobian(&self, camera: &Camera) -> SMatrix<f64, 5, 6> {
        let here = self.in_space(camera);
        let mut jacobian = SMatrix::<f64, 5, 6>::zeros();
        for (column, step) in STEPS.into_iter().enumerate() {
            let there = self.shifted(column, step).in_space(camera);
            let position = (there.position - here.position) / step;
            let velocity = (there.velocity - here.velocity).xy() / step;
            jacobian.fixed_view_mut::<3, 1>(0, column).copy_from(&position);
            jacobian.fixed_view_mut::<2, 1>(3, column).copy_from(&velocity);
        }
        jacobian
    }

    /// Returns the point with one of its six numbers changed.
    fn shifted(&self, number: usize, by: f64) -> Self {
        let mut other = *self;
        match number {
            0 | 1 => other.pixel[number] += by,
            2 | 3 => other.velocity[number - 2] += by,
            _ => other.range[number - 4] += by,
        }
        other
    }
}

impl RobotPoint {
    /// Returns the point after `dt` seconds, the robot standing still.
    pub(crate) fn walked(&self, dt: f64) -> Self {
        Self { position: self.position + self.velocity * dt, ..*self }
    }

    /// Returns the point in the robot's new frame after its motion.
    pub(crate) fn after(&self, motion: &EgoMotion) -> Self {
        let floor = motion.apply_to_point(self.position.xy());
        let velocity = motion.apply_to_velocity(self.velocity.xy());
        Self {
            position: Point3::new(floor.x, floor.y, self.position.z),
            velocity: Vector3::new(velocity.x, velocity.y, self.velocity.z),
        }
    }

    /// Projects the point into the image; `None` behind the camera.
    pub(crate) fn seen(&self, camera: &Camera) -> Option<ImagePoint> {
        let in_camera = camera.robot_from_camera.inverse_transform_point(&self.position);
        let depth = in_camera.z;
        let range = in_camera.coords.norm();
        let pixel = camera.project_from_camera(&in_camera).filter(|_| depth > NEAREST_M)?;
        let velocity = camera.robot_from_camera.rotation.inverse() * self.velocity;
        let turning = (velocity - camera.ray(pixel) * velocity.z) / depth;
        Some(ImagePoint {
            pixel,
            velocity: pixels_per_ray(camera, pixel)? * turning.xy(),
            range: Vector2::new(range, velocity.dot(&in_camera.coords) / range),
        })
    }
}

/// Returns the covariance of the pixel of a point, from that of its position in the robot frame.
pub(crate) fn pixel_covariance(
    camera: &Camera,
    position: &Point3<f64>,
    covariance: &SMatrix<f64, 3, 3>,
) -> Option<Matrix2<f64>> {
    let depth = camera.depth_of(position);
    let pixel = camera.project(position).filter(|_| depth > NEAREST_M)?;
    let ray = camera.ray(pixel);
    let mut across = SMatrix::<f64, 2, 3>::identity();
    across.set_column(2, &-ray.xy());
    let inverse = camera.robot_from_camera.rotation.inverse().to_rotation_matrix();
    let by_place = pixels_per_ray(camera, pixel)? * (across / depth) * inverse.matrix();
    Some(by_place * covariance * by_place.transpose())
}

/// Returns the distance of a point from the camera, m, and its variance, m².
pub(crate) fn range(
    camera: &Camera,
    position: &Point3<f64>,
    covariance: &SMatrix<f64, 3, 3>,
) -> (f64, f64) {
    let ray = position.coords - camera.robot_from_camera.translation.vector;
    let range = ray.norm();
    // At the camera itself the ray has no direction; the floor avoids a division by 0.
    let unit = ray / range.max(NEAREST_M);
    (range, unit.dot(&(covariance * unit)).max(0.0))
}

/// Returns the derivative of the viewing ray with respect to the pixel.
fn ray_slope(camera: &Camera, pixel: Point2<f64>) -> Matrix3x2<f64> {
    let [right, left, below, above] = [(0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5)]
        .map(|(dx, dy)| camera.ray(pixel + Vector2::new(dx, dy)));
    Matrix3x2::from_columns(&[right - left, below - above])
}

fn pixels_per_ray(camera: &Camera, pixel: Point2<f64>) -> Option<Matrix2<f64>> {
    ray_slope(camera, pixel).fixed_rows::<2>(0).try_inverse()
}
