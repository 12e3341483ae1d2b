use std::f64::consts::TAU;

use nalgebra::{Isometry3, Matrix3, Point2, Point3, Vector2, Vector3};

/// Distance below which two pixels count as equal.
const SAME_PIXEL_PX: f64 = 1e-3;

use crate::{Distortion, HEAD_BELOW_TOP_M, HEAD_RADIUS_M, Panorama, Rect, UPPER_BODY_SIDE_M};

/// A perspective lens. Pixel (0, 0) is the **centre** of the upper left pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pinhole {
    /// Focal length along columns, pixels.
    pub fx: f64,
    /// Focal length along rows, pixels.
    pub fy: f64,
    /// Principal point, column.
    pub cx: f64,
    /// Principal point, row.
    pub cy: f64,
    /// Distortion of the image as it is delivered.
    pub distortion: Distortion,
}

impl Pinhole {
    /// Returns a lens without distortion whose optical axis meets the middle of the image.
    pub fn centred(focal_px: f64, width: usize, height: usize) -> Self {
        let cx = 0.5 * (width as f64 - 1.0);
        let cy = 0.5 * (height as f64 - 1.0);
        Self { fx: focal_px, fy: focal_px, cx, cy, distortion: Distortion::None }
    }
}

/// Projection model of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Lens {
    /// Perspective, with optional distortion.
    Pinhole(Pinhole),
    /// Unwrapped image of a conical mirror. Its *depth* is the horizontal distance from the axis of
    /// the mirror, and its columns cover the full circle around the robot.
    Panorama(Panorama),
    /// No lens: for frames without images, for example those of a laser scanner only. No point has
    /// a pixel.
    Blind,
}

/// A camera: its lens, its image size and its pose on the robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// The lens.
    pub lens: Lens,
    /// Image columns.
    pub width: usize,
    /// Image rows.
    pub height: usize,
    /// Pose of the camera (x right, y down, z forward) in the robot frame.
    pub robot_from_camera: Isometry3<f64>,
}

impl Camera {
    /// Returns a pinhole camera `height_m` above the robot's origin on the floor. It looks forward
    /// and `pitch_down_rad` downwards, and its right side is raised by `roll_rad`.
    ///
    /// ```
    /// use nalgebra::{Point2, Point3};
    /// use tagalong_geometry::{Camera, Pinhole};
    /// let lens = Pinhole::centred(500.0, 640, 480);
    /// let camera = Camera::mounted(lens, 640, 480, 1.2, 0.0, 0.0);
    /// let pixel = camera.project(&Point3::new(2.0, 0.0, 1.2)).unwrap();
    /// assert!((pixel - Point2::new(319.5, 239.5)).norm() < 1e-9);
    /// ```
    pub fn mounted(
        lens: Pinhole,
        width: usize,
        height: usize,
        height_m: f64,
        pitch_down_rad: f64,
        roll_rad: f64,
    ) -> Self {
        // The columns are the camera's x (right), y (down) and z (forward) in robot axes.
        let level = nalgebra::Rotation3::from_matrix_unchecked(Matrix3::new(
            0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0,
        ));
        // Pitch acts about the horizontal axis of the levelled camera, then roll about the optical
        // axis.
        let pitch = nalgebra::Rotation3::from_axis_angle(&Vector3::x_axis(), -pitch_down_rad);
        let roll = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), -roll_rad);
        let rotation = nalgebra::UnitQuaternion::from_rotation_matrix(&(level * pitch * roll));
        Self {
            lens: Lens::Pinhole(lens),
            width,
            height,
            robot_from_camera: Isometry3::from_parts(
                Vector3::new(0.0, 0.0, height_m).into(),
                rotation,
            ),
        }
    }

    /// Returns a placeholder camera for frames without images, at the pose of another sensor.
    /// Tracks and detections have no box in its image ([`Rect::default`]).
    pub fn blind(robot_from_sensor: Isometry3<f64>) -> Self {
        let any = Pinhole { fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0, distortion: Distortion::None };
        let level = Self::mounted(any, 0, 0, 0.0, 0.0, 0.0).robot_from_camera;
        let robot_from_camera = robot_from_sensor * level;
        Self { lens: Lens::Blind, width: 0, height: 0, robot_from_camera }
    }

    /// Returns true for a camera without an image.
    pub fn is_blind(&self) -> bool {
        matches!(self.lens, Lens::Blind)
    }

    /// Returns the pixels per metre at one metre of depth, along columns; for a panorama the pixels
    /// per radian; 0 without an image.
    pub fn focal_px(&self) -> f64 {
        match &self.lens {
            Lens::Pinhole(lens) => lens.fx,
            Lens::Panorama(lens) => lens.columns as f64 / TAU,
            Lens::Blind => 0.0,
        }
    }

    /// Returns the panorama of a camera that has one.
    pub fn panorama(&self) -> Option<&Panorama> {
        match &self.lens {
            Lens::Panorama(lens) => Some(lens),
            Lens::Pinhole(_) | Lens::Blind => None,
        }
    }

    /// Returns the column equivalent to `column` that is nearest to `to`. Columns of a panorama are
    /// counted modulo its width; in other images `column` itself is returned.
    pub fn column_near(&self, column: f64, to: f64) -> f64 {
        self.panorama().map_or(column, |lens| {
            let around = lens.columns as f64;
            column - around * ((column - to) / around).round()
        })
    }

    /// Returns the pixel of a point in the robot frame; `None` behind the camera. The pixel may lie
    /// outside the image.
    pub fn project(&self, point_in_robot: &Point3<f64>) -> Option<Point2<f64>> {
        self.project_from_camera(&self.robot_from_camera.inverse_transform_point(point_in_robot))
    }

    /// Returns the pixel of a point in the camera frame; `None` behind the camera. No point lies
    /// behind a panorama.
    pub fn project_from_camera(&self, point_in_camera: &Point3<f64>) -> Option<Point2<f64>> {
        let lens = match &self.lens {
            Lens::Panorama(lens) => return Some(lens.pixel(point_in_camera)),
            Lens::Pinhole(lens) => lens,
            Lens::Blind => return None,
        };
        // The division by z below diverges for points in the plane of the lens.
        if point_in_camera.z <= 1e-6 {
            return None;
        }
        let (x, y) = lens
            .distortion
            .apply(point_in_camera.x / point_in_camera.z, point_in_camera.y / point_in_camera.z);
        Some(Point2::new(lens.fx * x + lens.cx, lens.fy * y + lens.cy))
    }

    /// Returns the viewing ray of a pixel in the camera frame, scaled to depth 1.
    pub fn ray(&self, pixel: Point2<f64>) -> Vector3<f64> {
        match &self.lens {
            Lens::Pinhole(lens) => {
                let x = (pixel.x - lens.cx) / lens.fx;
                let y = (pixel.y - lens.cy) / lens.fy;
                let (x, y) = lens.distortion.remove(x, y);
                Vector3::new(x, y, 1.0)
            }
            Lens::Panorama(lens) => lens.ray(pixel).1,
            Lens::Blind => Vector3::z(),
        }
    }

    /// Returns the point of the viewing ray at depth 0, in the camera frame: the origin, except for
    /// a panorama, which has no single viewpoint.
    fn viewpoint(&self, pixel: Point2<f64>) -> Point3<f64> {
        match &self.lens {
            Lens::Pinhole(_) | Lens::Blind => Point3::origin(),
            Lens::Panorama(lens) => lens.ray(pixel).0,
        }
    }

    /// Returns the point in the robot frame that lies at `depth_m` on the viewing ray of a pixel.
    pub fn back_project(&self, pixel: Point2<f64>, depth_m: f64) -> Point3<f64> {
        self.robot_from_camera * (self.viewpoint(pixel) + self.ray(pixel) * depth_m)
    }

    /// Returns the depth of a point in the robot frame, metres: the distance along the optical
    /// axis, or from the axis in a panorama.
    pub fn depth_of(&self, point_in_robot: &Point3<f64>) -> f64 {
        let point = self.robot_from_camera.inverse_transform_point(point_in_robot);
        match &self.lens {
            Lens::Pinhole(_) | Lens::Blind => point.z,
            Lens::Panorama(_) => point.xy().coords.norm(),
        }
    }

    /// Returns the height of the camera above the floor, metres.
    pub fn height_m(&self) -> f64 {
        self.robot_from_camera.translation.z
    }

    /// Returns the angle of the optical axis below the horizon, radians.
    pub fn pitch_down_rad(&self) -> f64 {
        let forward = self.robot_from_camera.rotation * Vector3::z();
        // Rounding may leave the sine slightly outside of [-1, 1], where `asin` returns NaN.
        (-forward.z).clamp(-1.0, 1.0).asin()
    }

    /// Returns the angle between the image's upward direction and the projected vertical,
    /// radians; positive when the camera's right side is higher.
    pub fn roll_rad(&self) -> f64 {
        let up = self.robot_from_camera.rotation.inverse() * Vector3::z();
        up.x.atan2(-up.y)
    }

    /// Returns the upper-body square of a person with the head centre `head`: its side is
    /// [`UPPER_BODY_SIDE_M`] at the depth of the face, its upper edge [`HEAD_BELOW_TOP_M`] above
    /// the head centre, and its middle column is that of the shoulders. The square is amodal and
    /// may extend beyond the image; it is empty if the head is behind the camera.
    ///
    /// In a panorama it may continue beyond the right edge (see [`Panorama`]).
    pub fn upper_body(&self, head: &Point3<f64>) -> Rect {
        if let Some(lens) = self.panorama() {
            return lens.upper_body(&self.robot_from_camera.inverse_transform_point(head));
        }
        // The square has its size at the face, which is nearer than the centre of the head.
        let depth = self.depth_of(head) - HEAD_RADIUS_M;
        let chest = head - Vector3::new(0.0, 0.0, SHOULDERS_BELOW_HEAD_M);
        let (Some(centre), Some(chest)) = (self.project(head), self.project(&chest)) else {
            return Rect::default();
        };
        // The scale below diverges as the depth approaches zero.
        if depth <= 0.05 {
            return Rect::default();
        }
        let scale = self.focal_px() / depth;
        let side = UPPER_BODY_SIDE_M * scale;
        Rect::new(chest.x - 0.5 * side, centre.y - HEAD_BELOW_TOP_M * scale, side, side)
    }

    /// Returns the head centre of the person in an upper-body square, given the depth of the face:
    /// the inverse of [`Camera::upper_body`], by fixed-point iteration.
    pub fn head_of(&self, upper_body: &Rect, face_depth_m: f64) -> Point3<f64> {
        if let Some(lens) = self.panorama() {
            return self.robot_from_camera * lens.head_of(upper_body, face_depth_m);
        }
        let depth = face_depth_m + HEAD_RADIUS_M;
        // The column of the square depends on the shoulders, which depend on the head that is
        // sought, so the inverse is iterated.
        let mut pixel = upper_body.centre();
        for _ in 0..8 {
            let shown = self.upper_body(&self.back_project(pixel, depth));
            let off = Vector2::new(upper_body.x - shown.x, upper_body.y - shown.y);
            pixel += off;
            if off.amax() < SAME_PIXEL_PX {
                break;
            }
        }
        self.back_project(pixel, depth)
    }

    /// Returns the covariance in the robot frame of a point at `pixel` and `depth_m` with the given
    /// standard deviations (first order, `algorithms`: stereo covariance with depth in place of
    /// disparity).
    pub fn covariance(
        &self,
        pixel: Point2<f64>,
        depth_m: f64,
        sigma_px: f64,
        sigma_depth_m: f64,
    ) -> Matrix3<f64> {
        let ray = self.ray(pixel);
        // A pixel subtends an angle, so its error in metres grows with depth.
        let lateral = (depth_m * sigma_px / self.focal_px()).powi(2);
        let across = match &self.lens {
            Lens::Pinhole(_) | Lens::Blind => {
                Matrix3::from_diagonal(&Vector3::new(lateral, lateral, 0.0))
            }
            Lens::Panorama(_) => {
                // The depth of a panorama is horizontal, so pixel noise acts on the two directions
                // perpendicular to the horizontal part of the ray.
                let out = Vector3::new(ray.x, ray.y, 0.0);
                (Matrix3::identity() - out * out.transpose()) * lateral
            }
        };
        let in_camera = across + ray * ray.transpose() * (sigma_depth_m * sigma_depth_m);
        let rotation = self.robot_from_camera.rotation.to_rotation_matrix();
        let in_robot = rotation.matrix() * in_camera * rotation.matrix().transpose();
        // The mean with the transpose removes the asymmetry that rounding leaves.
        0.5 * (in_robot + in_robot.transpose())
    }
}

/// Distance below the head centre of the body point that determines the column of the upper-body
/// square. Measured: with it, squares of a camera rolled by 11 degrees agree with hand-annotated
/// ones to about a pixel.
const SHOULDERS_BELOW_HEAD_M: f64 = 0.25;

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::ConicalMirror;

    fn tilted(pitch: f64, roll: f64, distortion: Distortion) -> Camera {
        let lens = Pinhole { fx: 530.0, fy: 528.0, cx: 310.0, cy: 243.0, distortion };
        Camera::mounted(lens, 640, 480, 2.4, pitch, roll)
    }

    #[test]
    fn a_blind_camera_sits_where_the_sensor_does_and_shows_nothing() {
        let pose = Isometry3::from_parts(Vector3::new(0.8, 0.2, 0.4).into(), nalgebra::one());
        let blind = Camera::blind(pose);
        assert!(blind.is_blind() && blind.height_m() == 0.4);
        assert_eq!(blind.project(&Point3::new(3.0, 0.0, 1.0)), None);
        assert_eq!(blind.upper_body(&Point3::new(3.0, 0.0, 1.6)), Rect::default());
        assert!(
            (blind.depth_of(&Point3::new(3.0, 0.0, 0.4)) - 2.2).abs() < 1e-12,
            "it looks ahead"
        );
        assert!(!tilted(0.1, 0.0, Distortion::None).is_blind());
    }

    #[test]
    fn mounting_angles_are_recovered() {
        let camera = tilted(0.48, 0.19, Distortion::None);
        assert!((camera.pitch_down_rad() - 0.48).abs() < 1e-12);
        assert!((camera.roll_rad() - 0.19).abs() < 1e-9, "{}", camera.roll_rad());
        let right_side = camera.robot_from_camera.rotation * Vector3::x();
        assert!(right_side.z > 0.0, "positive roll raises the right side");
    }

    fn around() -> Camera {
        let d = [67.5_f64.to_radians(), 0.05, 8.0, 230.0];
        let mirror = ConicalMirror::new(175.0, [241.3, 238.0], d).unwrap();
        Camera {
            lens: Lens::Panorama(Panorama { mirror, columns: 480, rows: 120 }),
            width: 480,
            height: 120,
            robot_from_camera: ConicalMirror::upright(1.5),
        }
    }

    #[test]
    fn columns_are_counted_around() {
        assert_eq!(around().column_near(3.0, 479.0), 483.0);
        assert_eq!(around().column_near(478.0, 1.0), -2.0);
        assert_eq!(tilted(0.0, 0.0, Distortion::None).column_near(3.0, 639.0), 3.0);
    }

    proptest! {
        #[test]
        fn a_panorama_projects_and_back_projects_all_around(
            range in 0.5..8.0f64, bearing in -3.1..3.1f64, z in 0.0..2.0f64,
        ) {
            let (camera, (sine, cosine)) = (around(), bearing.sin_cos());
            let point = Point3::new(range * cosine, range * sine, z);
            let pixel = camera.project(&point).unwrap();
            prop_assert!((camera.depth_of(&point) - range).abs() < 1e-9);
            prop_assert!((camera.back_project(pixel, range) - point).norm() < 1e-9);
            let head = camera.head_of(&camera.upper_body(&point), range - HEAD_RADIUS_M);
            prop_assert!((head - point).norm() < 1e-6, "{head} {point}");
        }

        #[test]
        fn the_covariance_of_a_panorama_points_outwards(bearing in -3.1..3.1f64, z in 0.0..1.5f64) {
            let (camera, (sine, cosine)) = (around(), bearing.sin_cos());
            let out = Vector3::new(cosine, sine, 0.0);
            let point = Point3::from(out * 4.0) + Vector3::z() * z;
            let c = camera.covariance(camera.project(&point).unwrap(), 4.0, 2.0, 0.3);
            let aside = Vector3::new(-sine, cosine, 0.0);
            prop_assert_eq!(c, c.transpose());
            prop_assert!(c.cholesky().is_some());
            prop_assert!((out.dot(&(c * out)).sqrt() - 0.3).abs() < 1e-6);
            prop_assert!((aside.dot(&(c * aside)).sqrt() - 8.0 / camera.focal_px()).abs() < 1e-6);
        }

        #[test]
        fn projecting_and_back_projecting_agree(
            x in 1.0..6.0f64, y in -2.0..2.0f64, z in 0.0..2.0f64,
            pitch in -0.5..0.6f64, roll in -0.3..0.3f64, k1 in -0.1..0.1f64,
        ) {
            let camera = tilted(pitch, roll, Distortion::PlumbBob([k1, 0.01, 1e-3, -1e-3, 0.0]));
            let point = Point3::new(x, y, z);
            if let Some(pixel) = camera.project(&point) {
                let inside = Rect::new(0.0, 0.0, 640.0, 480.0).contains(pixel);
                let back = camera.back_project(pixel, camera.depth_of(&point));
                prop_assert!(!inside || (back - point).norm() < 1e-6);
            }
        }

        #[test]
        fn head_of_inverts_upper_body(
            x in 1.5..6.0f64, y in -0.6..0.6f64, z in 1.0..1.9f64, roll in -0.2..0.2f64,
        ) {
            let camera = tilted(0.1, roll, Distortion::None);
            let head = Point3::new(x, y, z);
            let region = camera.upper_body(&head);
            let back = camera.head_of(&region, camera.depth_of(&head) - HEAD_RADIUS_M);
            prop_assert!((back - head).norm() < 0.002, "{back} {head}");
        }

        #[test]
        fn covariance_is_symmetric_and_positive(u in 0.0..640.0f64, v in 0.0..480.0f64, d in 0.5..8.0f64) {
            let c = tilted(0.4, 0.1, Distortion::None).covariance(Point2::new(u, v), d, 2.0, 0.05);
            prop_assert_eq!(c, c.transpose());
            prop_assert!(c.cholesky().is_some());
        }
    }

    fn level(height_m: f64) -> Camera {
        let lens =
            Pinhole { fx: 500.0, fy: 400.0, cx: 320.0, cy: 240.0, distortion: Distortion::None };
        Camera::mounted(lens, 640, 480, height_m, 0.0, 0.0)
    }

    #[test]
    fn left_is_left_and_up_is_up_in_the_image() {
        let camera = level(1.2);
        let pixel = camera.project(&Point3::new(2.0, 0.4, 1.7)).unwrap();
        assert!((pixel - Point2::new(220.0, 140.0)).norm() < 1e-9, "{pixel}");
        assert_eq!(camera.project(&Point3::new(-2.0, 0.0, 1.2)), None, "behind");
        assert_eq!(camera.project(&Point3::new(0.0, 0.0, 1.2)), None, "in the lens");
        assert_eq!((camera.focal_px(), camera.height_m()), (500.0, 1.2));
        assert_eq!(camera.panorama(), None);
    }

    /// A head 3.08 m ahead has its face at 3 m, where a metre is 500 / 3 pixels wide.
    #[test]
    fn the_upper_body_square_is_that_of_the_template() {
        let camera = level(1.6);
        let square = camera.upper_body(&Point3::new(3.0 + HEAD_RADIUS_M, 0.0, 1.6));
        let px_per_m = 500.0 / 3.0;
        assert!((square.width - 0.57 * px_per_m).abs() < 1e-9 && square.width == square.height);
        assert!((square.centre().x - 320.0).abs() < 1e-9, "{square:?}");
        assert!((square.y - (240.0 - 0.14 * px_per_m)).abs() < 1e-9, "{square:?}");
        for too_near in [Point3::new(0.1, 0.0, 1.6), Point3::new(-1.0, 0.0, 1.6)] {
            assert_eq!(camera.upper_body(&too_near), Rect::default());
        }
        let just_far_enough = camera.upper_body(&Point3::new(0.14, 0.0, 1.6));
        assert!(just_far_enough.area() > 0.0);
    }

    /// The square is centred on the middle of the shoulders, not on the head.
    #[test]
    fn in_a_rolled_camera_the_square_is_above_the_shoulders() {
        let camera = tilted(0.0, 0.2, Distortion::None);
        let head = Point3::new(3.0, 0.0, 1.6);
        let chest = Point3::new(3.0, 0.0, 1.35);
        let middle = camera.upper_body(&head).centre().x;
        assert!((middle - camera.project(&chest).unwrap().x).abs() < 1e-9);
        assert!((middle - camera.project(&head).unwrap().x).abs() > 3.0);
    }

    #[test]
    fn a_sighting_is_uncertain_along_the_ray_by_its_depth_and_across_by_its_pixels() {
        let camera = level(1.2);
        let c = camera.covariance(Point2::new(320.0, 240.0), 4.0, 2.0, 0.3);
        let across = 4.0 * 2.0 / 500.0_f64;
        let along = 0.3;
        for (axis, sigma) in [(0, along), (1, across), (2, across)] {
            assert!((c[(axis, axis)].sqrt() - sigma).abs() < 1e-9, "{c}");
        }
        // The ray goes one metre to the left for each two metres ahead.
        let aside = camera.covariance(Point2::new(70.0, 240.0), 4.0, 0.0, 0.3);
        assert!((aside[(0, 1)] - 0.5 * 0.09).abs() < 1e-9, "{aside}");
        assert!((aside[(1, 1)] - 0.25 * 0.09).abs() < 1e-9, "{aside}");
    }

    #[test]
    fn a_panorama_sees_all_around_and_has_pixels_for_each_radian() {
        let camera = around();
        assert!((camera.focal_px() - 480.0 / TAU).abs() < 1e-9);
        assert_eq!(camera.panorama().map(|lens| lens.columns), Some(480));
        assert!(camera.project(&Point3::new(-3.0, 0.1, 1.0)).is_some());
    }
}
