//! Converts pixels and depths to positions with covariances, which is the last step of every
//! detector.

use nalgebra::{Matrix3, Point2, Point3};

use crate::{Camera, HALF_HEAD_M, HEAD_RADIUS_M, Lens, Rect, UPPER_BODY_SIDE_M};

/// Height that is assumed for a person whose feet are not known, m.
const STANDING_M: f64 = 1.7;
/// Width of the box of a whole person, m: the median of annotated boxes is 0.37 times the height.
const WHOLE_BODY_WIDTH_M: f64 = 0.63;

/// Possible heights of the top of a head above the floor, m: from a crouching child to a tall
/// person.
const HEAD_TOPS_M: std::ops::RangeInclusive<f64> = 0.5..=2.2;

/// Position in the robot frame, m, with its covariance, m².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointEstimate {
    /// Mean, m.
    pub position: Point3<f64>,
    /// Covariance, m².
    pub covariance: Matrix3<f64>,
}

/// Depth of the surface of a face, m, with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaceDepth {
    /// Depth of the surface, m.
    pub depth_m: f64,
    /// Standard deviation, m.
    pub sigma_m: f64,
}

impl FaceDepth {
    /// Returns the depth at which a part of a person that is `size_m` wide appears `size_px` wide.
    /// `sigma_fraction` is its standard deviation as a fraction of the depth, because people differ
    /// in size.
    pub fn by_size(camera: &Camera, size_m: f64, size_px: f64, sigma_fraction: f64) -> Self {
        let depth_m = camera.focal_px() * size_m / size_px;
        Self { depth_m, sigma_m: depth_m * sigma_fraction }
    }

    /// Returns the measured depth with this standard deviation, m, or `self` without a measurement.
    #[must_use]
    pub fn or_measured(self, measured_m: Option<f64>, sigma_m: f64) -> Self {
        measured_m.map_or(self, |depth_m| Self { depth_m, sigma_m })
    }

    /// Returns the depth of the centre of the head, m, which lies behind the surface.
    pub fn head_m(&self) -> f64 {
        self.depth_m + HEAD_RADIUS_M
    }
}

impl Camera {
    /// Returns the point at `depth_m` on the viewing ray of a pixel, for the given standard
    /// deviations of the pixel and of the depth.
    pub fn locate(
        &self,
        pixel: Point2<f64>,
        depth_m: f64,
        sigma_px: f64,
        sigma_depth_m: f64,
    ) -> PointEstimate {
        PointEstimate {
            position: self.back_project(pixel, depth_m),
            covariance: self.covariance(pixel, depth_m, sigma_px, sigma_depth_m),
        }
    }

    /// Returns the centre of the head of the person in an upper-body square, computed as by
    /// [`Camera::head_of`], with the covariance at the centre of the square.
    ///
    /// ```
    /// use nalgebra::Point3;
    /// use tagalong_geometry::{Camera, Distortion, FaceDepth, Pinhole, UPPER_BODY_SIDE_M};
    ///
    /// let lens =
    ///     Pinhole { fx: 500.0, fy: 500.0, cx: 320.0, cy: 240.0, distortion: Distortion::None };
    /// let camera = Camera::mounted(lens, 640, 480, 1.2, 0.0, 0.0);
    /// let square = camera.upper_body(&Point3::new(3.0, 0.2, 1.6));
    /// let face = FaceDepth::by_size(&camera, UPPER_BODY_SIDE_M, square.width, 0.1)
    ///     .or_measured(Some(2.92), 0.05);
    /// let head = camera.locate_head(&square, face, 3.0);
    /// assert!((head.position - Point3::new(3.0, 0.2, 1.6)).norm() < 0.01);
    /// ```
    pub fn locate_head(&self, upper_body: &Rect, face: FaceDepth, sigma_px: f64) -> PointEstimate {
        PointEstimate {
            position: self.head_of(upper_body, face.depth_m),
            covariance: self.covariance(upper_body.centre(), face.head_m(), sigma_px, face.sigma_m),
        }
    }

    /// Returns the centre of the head, in the robot frame, of the person in a box around the whole
    /// body: its lower edge is where the feet touch the floor, its upper edge the top of the head
    /// at any height. `None` if the box reaches the lower edge of the image, where the feet may be
    /// cut off, if no person is that tall, and for lenses that are not perspective.
    ///
    /// ```
    /// use tagalong_geometry::{Camera, Distortion, Pinhole, Rect};
    ///
    /// let lens =
    ///     Pinhole { fx: 500.0, fy: 500.0, cx: 320.0, cy: 240.0, distortion: Distortion::None };
    /// let camera = Camera::mounted(lens, 640, 480, 1.2, 0.0, 0.0);
    /// // Feet 200 rows below the horizon are 3 m away; 1.2 m of height are as many rows there.
    /// let head = camera.head_above_floor(&Rect::new(270.0, 180.0, 100.0, 260.0)).unwrap();
    /// assert!((head.x - 3.0).abs() < 1e-9 && (head.z - 1.45).abs() < 0.05);
    /// ```
    pub fn head_above_floor(&self, whole_body: &Rect) -> Option<Point3<f64>> {
        let column = whole_body.centre().x;
        let lowest = whole_body.y + whole_body.height;
        if !matches!(self.lens, Lens::Pinhole(_)) || lowest >= self.height as f64 - 1.0 {
            return None;
        }
        let eye = self.robot_from_camera.translation.vector;
        let rotation = self.robot_from_camera.rotation;
        let to_feet = rotation * self.ray(Point2::new(column, lowest));
        let to_top = rotation * self.ray(Point2::new(column, whole_body.y));
        let away_m = (to_feet.z < 0.0).then(|| eye.z / -to_feet.z * to_feet.xy().norm())?;
        // The head is above the feet, so its ray is followed to the horizontal distance of the
        // feet.
        let top = eye + to_top * (away_m / to_top.xy().norm());
        HEAD_TOPS_M.contains(&top.z).then(|| Point3::new(top.x, top.y, top.z - HALF_HEAD_M))
    }

    /// Returns the box of the whole person with this tracked box and this head centre in the robot
    /// frame, m: from the top of the head to the floor below it. A tracked box that is not square
    /// already encloses the whole person. If the position of the floor is unclear (no head can be
    /// at this height, or the lens is not perspective), the person is assumed to stand.
    ///
    /// ```
    /// use nalgebra::Point3;
    /// use tagalong_geometry::{Camera, Distortion, Pinhole};
    ///
    /// let lens =
    ///     Pinhole { fx: 500.0, fy: 500.0, cx: 320.0, cy: 240.0, distortion: Distortion::None };
    /// let camera = Camera::mounted(lens, 640, 480, 1.2, 0.0, 0.0);
    /// let head = Point3::new(4.0, 0.0, 1.6);
    /// let whole = camera.whole_body(&camera.upper_body(&head), &head);
    /// // Feet 1.2 m below the horizon, 4 m away.
    /// assert!((whole.bottom() - 390.0).abs() < 1e-9 && (whole.height - 215.0).abs() < 3.0);
    /// ```
    pub fn whole_body(&self, tracked: &Rect, head: &Point3<f64>) -> Rect {
        if tracked.is_whole_body() {
            return *tracked;
        }
        let standing = tracked.standing_of_upper_body(STANDING_M);
        let px_per_m = tracked.height / UPPER_BODY_SIDE_M;
        let width = WHOLE_BODY_WIDTH_M * px_per_m;
        let is_known =
            matches!(self.lens, Lens::Pinhole(_)) && HEAD_TOPS_M.contains(&(head.z + HALF_HEAD_M));
        let feet = self.project(&Point3::new(head.x, head.y, 0.0)).filter(|_| is_known);
        let (middle, bottom) = match feet {
            // The body lies between the shoulders and the feet, which are not in the same column if
            // the camera rolls.
            Some(feet) if feet.y > standing.y => (0.5 * (tracked.centre().x + feet.x), feet.y),
            _ => (tracked.centre().x, standing.bottom()),
        };
        Rect::new(middle - 0.5 * width, standing.y, width, bottom - standing.y)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::{Distortion, Pinhole, UPPER_BODY_SIDE_M};

    fn camera() -> Camera {
        let lens =
            Pinhole { fx: 500.0, fy: 400.0, cx: 320.0, cy: 240.0, distortion: Distortion::None };
        Camera::mounted(lens, 640, 480, 1.2, 0.1, 0.0)
    }

    #[test]
    fn a_head_is_found_above_the_feet_whatever_the_posture() {
        let camera = camera();
        for (x, y, top) in [(3.0, 0.0, 1.7), (3.2, 0.3, 1.2), (5.0, -0.8, 1.9), (2.5, 0.1, 0.6)] {
            let [feet, head] = [0.0, top].map(|z| camera.project(&Point3::new(x, y, z)).unwrap());
            let whole = Rect::new(feet.x - 40.0, head.y, 80.0, feet.y - head.y);
            let found = camera.head_above_floor(&whole).unwrap();
            let true_head = Point3::new(x, y, top - HALF_HEAD_M);
            assert!((found - true_head).norm() < 0.03, "{found} {true_head}");
        }
    }

    #[test]
    fn a_box_that_cannot_stand_on_the_floor_has_no_head() {
        let camera = camera();
        for (y, width, height, why) in [
            (100.0, 80.0, 379.5, "cut off below"),
            (10.0, 80.0, 100.0, "above the horizon"),
            (300.0, 20.0, 30.0, "no person is so small"),
            (0.0, 80.0, 310.0, "no person is so tall"),
        ] {
            let whole_body = Rect::new(300.0, y, width, height);
            assert_eq!(camera.head_above_floor(&whole_body), None, "{why}");
        }
    }

    proptest! {
        #[test]
        fn a_located_head_is_that_of_its_square(
            x in 1.5..6.0f64, y in -0.6..0.6f64, z in 1.2..1.9f64, sigma_m in 0.01..0.5f64,
        ) {
            let camera = camera();
            let head = Point3::new(x, y, z);
            let square = camera.upper_body(&head);
            let face = FaceDepth { depth_m: camera.depth_of(&head) - HEAD_RADIUS_M, sigma_m };
            let found = camera.locate_head(&square, face, 2.0);
            prop_assert!((found.position - head).norm() < 0.002);
            // Along the ray the error is that of the depth.
            let along = camera.back_project(square.centre(), face.head_m() + 1.0)
                - camera.back_project(square.centre(), face.head_m());
            let information = found.covariance.try_inverse().unwrap();
            let variance = 1.0 / (along.transpose() * information * along)[0];
            prop_assert!((variance - sigma_m * sigma_m).abs() < 1e-9 + 1e-6 * variance);
        }
    }

    #[test]
    fn a_measured_depth_replaces_that_by_size() {
        let camera = camera();
        let by_size = FaceDepth::by_size(&camera, UPPER_BODY_SIDE_M, 57.0, 0.2);
        assert!((by_size.depth_m - 0.01 * camera.focal_px()).abs() < 1e-9, "{by_size:?}");
        assert!((by_size.sigma_m - 0.2 * by_size.depth_m).abs() < 1e-9);
        assert_eq!(by_size.or_measured(None, 0.05), by_size);
        let measured = by_size.or_measured(Some(3.0), 0.05);
        assert_eq!((measured.depth_m, measured.sigma_m), (3.0, 0.05));
        assert_eq!(measured.head_m(), 3.0 + HEAD_RADIUS_M);
    }

    #[test]
    fn a_located_point_lies_on_the_ray_of_its_pixel() {
        let camera = camera();
        let pixel = Point2::new(200.0, 100.0);
        let found = camera.locate(pixel, 4.0, 2.0, 0.3);
        assert!((camera.project(&found.position).unwrap() - pixel).norm() < 1e-9);
        assert!((camera.depth_of(&found.position) - 4.0).abs() < 1e-9);
        assert_eq!(found.covariance, camera.covariance(pixel, 4.0, 2.0, 0.3));
    }

    #[test]
    fn a_whole_body_reaches_from_the_head_to_the_floor() {
        let camera = camera();
        for (away, top) in [(3.0, 1.7), (5.0, 1.2), (2.0, 0.9)] {
            let head = Point3::new(away, 0.3, top - HALF_HEAD_M);
            let whole = camera.whole_body(&camera.upper_body(&head), &head);
            let feet = camera.project(&Point3::new(away, 0.3, 0.0)).unwrap();
            assert!((whole.bottom() - feet.y).abs() < 1e-9, "{whole:?}");
            let crown = camera.project(&Point3::new(away, 0.3, top)).unwrap();
            assert!((whole.y - crown.y).abs() < 0.06 * whole.height, "{whole:?} {crown}");
            // A person who crouches is not told from an upper body.
            if top > 1.0 {
                assert_eq!(camera.whole_body(&whole, &head), whole, "it is whole already");
            }
        }
    }

    #[test]
    fn a_person_of_unknown_feet_stands() {
        let camera = camera();
        let square = Rect::new(300.0, 100.0, 57.0, 57.0);
        for height_m in [-1.0, 5.0] {
            let whole = camera.whole_body(&square, &Point3::new(3.0, 0.0, height_m));
            assert!((whole.height - 170.0).abs() < 1e-9 && (whole.width - 63.0).abs() < 1e-9);
            assert_eq!(whole.centre().x, square.centre().x);
        }
    }
}
