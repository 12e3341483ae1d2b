use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use nalgebra::{Isometry3, Point2, Point3, Rotation3, UnitQuaternion, Vector3};

use crate::{HEAD_BELOW_TOP_M, HEAD_RADIUS_M, Rect, UPPER_BODY_SIDE_M};

/// A camera that looks up into a conical mirror.
///
/// The **camera frame** is defined as for any camera, with z along the common axis, the pinhole as
/// its origin and -y towards the top of the image. The camera is mounted
/// [`upright`](Self::upright): z points up, the top of the image to the front, and its right side
/// to the left, because it looks at the ceiling from below.
///
/// The cone stands above the pinhole with its apex down. In the half plane of one bearing the
/// mirror is a straight line, so all rays appear to start from the mirror image of the pinhole;
/// over all bearings these mirror images form a ring beyond the axis. There is no single viewpoint.
/// A ray at the angle `phi` from the axis leaves at the elevation `phi + 90 deg - 2 * half_angle`.
///
/// ```
/// use tagalong_geometry::ConicalMirror;
/// let shape = [67.5_f64.to_radians(), 0.05, 8.0, 230.0];
/// let mirror = ConicalMirror::new(170.0, [239.5, 239.5], shape).unwrap();
/// // 20 degrees from the axis, the floor is seen 3.5 m away.
/// let elevation = mirror.elevation(170.0 * 20f64.to_radians().tan());
/// assert!((elevation.to_degrees() + 25.0).abs() < 1e-9);
/// assert!((mirror.floor_range_m(elevation, 1.55).unwrap() - 3.47).abs() < 0.01);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConicalMirror {
    /// Focal length of the camera, pixels.
    pub focal_px: f64,
    /// Pixel of the mirror's axis.
    pub centre_px: Point2<f64>,
    /// Angle between the axis and the mirror's surface, rad; more than 45 degrees.
    pub half_angle_rad: f64,
    /// Height of the apex above the pinhole, m.
    pub apex_m: f64,
    /// Radius of the innermost usable circle, pixels.
    pub inner_px: f64,
    /// Radius of the outermost usable circle, pixels.
    pub outer_px: f64,
}

impl ConicalMirror {
    /// Creates a mirror of this shape: half angle (rad), height of the apex (m), inner and outer
    /// radius (pixels). `None` if the numbers describe no valid mirror.
    pub fn new(focal_px: f64, centre_px: [f64; 2], shape: [f64; 4]) -> Option<Self> {
        let [half_angle_rad, apex_m, inner_px, outer_px] = shape;
        let centre_px = Point2::from(centre_px);
        let mirror = Self { focal_px, centre_px, half_angle_rad, apex_m, inner_px, outer_px };
        mirror.is_sane().then_some(mirror)
    }

    /// Returns true if all numbers are finite, and if every ray between the two circles meets the
    /// mirror.
    pub fn is_sane(&self) -> bool {
        self.centre_px.iter().all(|v| v.is_finite())
            && self.focal_px.is_finite()
            && self.focal_px > 0.0
            && self.apex_m.is_finite()
            && self.apex_m > 0.0
            // Above 45 degrees the rays at the centre point below the horizon.
            && self.half_angle_rad > FRAC_PI_4
            && self.half_angle_rad < FRAC_PI_2
            && self.inner_px >= 0.0
            && self.outer_px > self.inner_px
            && (self.outer_px / self.focal_px).atan() < self.half_angle_rad
    }

    /// Returns the pose of a camera in the middle of the robot, `height_m` above the floor, that
    /// looks up with the top of the image to the front.
    pub fn upright(height_m: f64) -> Isometry3<f64> {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), FRAC_PI_2);
        let turn = UnitQuaternion::from_rotation_matrix(&turn);
        Isometry3::from_parts(Vector3::new(0.0, 0.0, height_m).into(), turn)
    }

    /// Returns the radius of the ring of viewpoints, and its height above the pinhole, m.
    pub fn ring_m(&self) -> (f64, f64) {
        let (sine, cosine) = self.half_angle_rad.sin_cos();
        (2.0 * self.apex_m * sine * cosine, 2.0 * self.apex_m * sine * sine)
    }

    /// Returns the elevation of the rays on a circle about the centre, rad; positive above the
    /// horizon.
    pub fn elevation(&self, radius_px: f64) -> f64 {
        (radius_px / self.focal_px).atan() + FRAC_PI_2 - 2.0 * self.half_angle_rad
    }

    /// Returns the radius of the circle of this elevation, pixels: the inverse of
    /// [`elevation`](Self::elevation).
    pub fn radius_px(&self, elevation_rad: f64) -> f64 {
        self.focal_px * (elevation_rad - FRAC_PI_2 + 2.0 * self.half_angle_rad).tan()
    }

    /// Returns the bearing (positive to the left of the image's top) and the elevation of a point
    /// in the camera frame, rad.
    pub fn direction(&self, point_in_camera: &Point3<f64>) -> (f64, f64) {
        let (ring, height) = self.ring_m();
        let p = point_in_camera;
        let bearing = p.x.atan2(-p.y);
        (bearing, (p.z - height).atan2(p.xy().coords.norm() + ring))
    }

    /// Returns the pixel of the raw image in this direction.
    pub fn raw_pixel(&self, bearing_rad: f64, elevation_rad: f64) -> Point2<f64> {
        let (sine, cosine) = bearing_rad.sin_cos();
        let radius = self.radius_px(elevation_rad);
        Point2::new(self.centre_px.x + radius * sine, self.centre_px.y - radius * cosine)
    }

    /// Returns the viewpoint on the ring and the unit vector of a viewing ray, in the camera frame.
    pub fn ray(&self, bearing_rad: f64, elevation_rad: f64) -> (Point3<f64>, Vector3<f64>) {
        let (ring, height) = self.ring_m();
        let outward = Vector3::new(bearing_rad.sin(), -bearing_rad.cos(), 0.0);
        let (up, along) = elevation_rad.sin_cos();
        let from = Point3::from(-ring * outward + Vector3::new(0.0, 0.0, height));
        (from, along * outward + Vector3::new(0.0, 0.0, up))
    }

    /// Returns the distance from the axis at which a ray of this elevation meets the floor, for a
    /// camera `camera_height_m` above it; `None` at and above the horizon.
    pub fn floor_range_m(&self, elevation_rad: f64, camera_height_m: f64) -> Option<f64> {
        let (ring, height) = self.ring_m();
        (elevation_rad < 0.0).then(|| (camera_height_m + height) / (-elevation_rad).tan() - ring)
    }
}

/// Unwrapped image of a [`ConicalMirror`]: one column per bearing and one row per elevation, both
/// evenly spaced.
///
/// The middle column is the front of the robot, columns left of it show the robot's left side, and
/// the seam is behind. Pixel (0, 0) is the **centre** of the upper left pixel.
///
/// **Across the seam.** Columns are counted modulo [`columns`](Self::columns). A region starts at a
/// column from 0 up to that number and keeps its width: across the seam it continues beyond the
/// right edge, and is never cut there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Panorama {
    /// The mirror.
    pub mirror: ConicalMirror,
    /// Columns of the full circle.
    pub columns: usize,
    /// Rows, from the outer circle at the top to the inner one.
    pub rows: usize,
}

impl Panorama {
    /// Returns the highest and the lowest elevation, at the edges of the image, rad.
    pub fn elevations(&self) -> [f64; 2] {
        [self.mirror.outer_px, self.mirror.inner_px].map(|radius| self.mirror.elevation(radius))
    }

    /// Returns the bearing of a column, rad, positive to the left of the front.
    pub fn bearing(&self, column: f64) -> f64 {
        PI - TAU * (column + 0.5) / self.columns as f64
    }

    /// Returns the column of a bearing, from -0.5 up to `columns - 0.5`.
    pub fn column(&self, bearing_rad: f64) -> f64 {
        let turns = ((PI - bearing_rad) / TAU).rem_euclid(1.0);
        turns * self.columns as f64 - 0.5
    }

    /// Returns the elevation of a row, rad.
    pub fn elevation(&self, row: f64) -> f64 {
        let [top, bottom] = self.elevations();
        top + (bottom - top) * (row + 0.5) / self.rows as f64
    }

    /// Returns the row of an elevation; it may lie outside the image.
    pub fn row(&self, elevation_rad: f64) -> f64 {
        let [top, bottom] = self.elevations();
        (elevation_rad - top) / (bottom - top) * self.rows as f64 - 0.5
    }

    /// Returns the pixel of a point in the camera frame.
    pub fn pixel(&self, point_in_camera: &Point3<f64>) -> Point2<f64> {
        let (bearing, elevation) = self.mirror.direction(point_in_camera);
        Point2::new(self.column(bearing), self.row(elevation))
    }

    /// Returns the pixel of the raw image for a pixel of the unwrapped image.
    pub fn raw_pixel(&self, column: f64, row: f64) -> Point2<f64> {
        self.mirror.raw_pixel(self.bearing(column), self.elevation(row))
    }

    /// Returns the viewing ray of a pixel in the camera frame: its point on the axis, and a
    /// direction that goes one metre outwards.
    pub fn ray(&self, pixel: Point2<f64>) -> (Point3<f64>, Vector3<f64>) {
        let (ring, height) = self.mirror.ring_m();
        let bearing = self.bearing(pixel.x);
        let slope = self.elevation(pixel.y).tan();
        let out = Vector3::new(bearing.sin(), -bearing.cos(), slope);
        (Point3::new(0.0, 0.0, height + ring * slope), out)
    }

    /// Returns the head centre, in the camera frame, of the person in an upper-body square, given
    /// the distance of the face from the axis: the inverse of [`upper_body`](Self::upper_body).
    pub fn head_of(&self, upper_body: &Rect, face_range_m: f64) -> Point3<f64> {
        let top = Point2::new(upper_body.centre().x, upper_body.y);
        let (axis, out) = self.ray(top);
        let top_m = axis.z + face_range_m * out.z;
        let range = face_range_m + HEAD_RADIUS_M;
        Point3::new(range * out.x, range * out.y, top_m - HEAD_BELOW_TOP_M)
    }

    /// Returns the upper body of a person with the head centre `head` in the camera frame, defined
    /// as in [`Camera::upper_body`](crate::Camera::upper_body): [`UPPER_BODY_SIDE_M`] wide and high
    /// at the distance of the face. It is not cut at the seam or at the upper and lower edges, and
    /// it is empty if the head touches the axis.
    pub fn upper_body(&self, head: &Point3<f64>) -> Rect {
        let range = head.xy().coords.norm() - HEAD_RADIUS_M;
        if range <= 0.05 {
            return Rect::default();
        }
        let (bearing, _) = self.mirror.direction(head);
        // Rays start on the ring of viewpoints, not on the axis, hence `range + ring`.
        let (ring, height) = self.mirror.ring_m();
        let top = head.z + HEAD_BELOW_TOP_M;
        let bottom = head.z + HEAD_BELOW_TOP_M - UPPER_BODY_SIDE_M;
        let [top, bottom] = [top, bottom].map(|z| self.row((z - height).atan2(range + ring)));
        let half_angle = (0.5 * UPPER_BODY_SIDE_M / range).atan();
        let width = 2.0 * half_angle / TAU * self.columns as f64;
        // A region starts within the image, and continues across the seam.
        let left = (self.column(bearing) - 0.5 * width).rem_euclid(self.columns as f64);
        Rect::new(left, top, width, bottom - top)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn mirror(half_angle_deg: f64) -> ConicalMirror {
        let d = [half_angle_deg.to_radians(), 0.05, 8.0, 230.0];
        ConicalMirror::new(175.0, [241.3, 238.0], d).unwrap()
    }

    fn panorama() -> Panorama {
        Panorama { mirror: mirror(67.5), columns: 480, rows: 120 }
    }

    #[test]
    fn the_floor_is_seen_as_far_away_as_the_geometry_says() {
        // phi in degrees, range in metres: half angle 67.5 degrees, 1.55 m high.
        for (phi, range) in [(2.0_f64, 1.7), (20.0, 3.5), (35.0, 9.2)] {
            let mirror = mirror(67.5);
            let elevation = mirror.elevation(175.0 * phi.to_radians().tan());
            let seen = mirror.floor_range_m(elevation, 1.55).unwrap();
            assert!((seen - range).abs() < 0.05, "{phi}: {seen}");
        }
        assert_eq!(mirror(67.5).floor_range_m(0.0, 1.55), None);
    }

    #[test]
    fn front_is_the_middle_left_is_left_and_the_seam_is_behind() {
        let panorama = panorama();
        assert!((pixel_of(&panorama, [2.0, 0.0, 1.0]).x - 239.5).abs() < 1e-9);
        assert!((pixel_of(&panorama, [0.0, 2.0, 1.0]).x - 119.5).abs() < 1e-9);
        assert!(pixel_of(&panorama, [-2.0, 0.01, 1.0]).x < 1.0);
        assert!(pixel_of(&panorama, [-2.0, -0.01, 1.0]).x > 478.0);
        let mount = ConicalMirror::upright(1.5).inverse();
        let [front, left] = [[2.0, 0.0, 1.0], [0.0, 2.0, 1.0]].map(|point| {
            let (bearing, elevation) = panorama.mirror.direction(&(mount * Point3::from(point)));
            panorama.mirror.raw_pixel(bearing, elevation) - panorama.mirror.centre_px
        });
        assert!(front.y < -20.0 && left.x > 20.0);
    }

    /// Returns the pixel of a point on the robot.
    fn pixel_of(panorama: &Panorama, point: [f64; 3]) -> Point2<f64> {
        panorama.pixel(&(ConicalMirror::upright(1.5).inverse() * Point3::from(point)))
    }

    #[test]
    fn a_region_across_the_seam_keeps_its_width() {
        let head = ConicalMirror::upright(1.5).inverse() * Point3::new(-2.0, 0.05, 1.6);
        let region = panorama().upper_body(&head);
        assert!(region.x > 440.0 && region.right() > 480.0 && region.width < 40.0, "{region:?}");
        assert!(region.y > -10.0 && region.bottom() < 60.0, "{region:?}");
        assert_eq!(panorama().upper_body(&Point3::new(0.05, 0.0, 0.1)), Rect::default());
    }

    #[test]
    fn what_is_no_mirror_is_refused() {
        for d in [[0.5, 0.05, 8.0, 230.0], [1.2, 0.05, 230.0, 8.0], [1.2, f64::NAN, 8.0, 230.0]] {
            assert_eq!(ConicalMirror::new(175.0, [0.0, 0.0], d), None, "{d:?}");
        }
        assert_eq!(ConicalMirror::new(0.0, [0.0, 0.0], [1.2, 0.05, 8.0, 230.0]), None);
    }

    proptest! {
        #[test]
        fn a_point_lies_on_the_ray_of_its_direction(
            x in -6.0..6.0f64, y in -6.0..6.0f64, z in -1.6..0.6f64, half in 50.0..80.0f64,
        ) {
            let point = Point3::new(x, y, z);
            let mirror = mirror(half.max(54.0));
            let (bearing, elevation) = mirror.direction(&point);
            let (from, along) = mirror.ray(bearing, elevation);
            prop_assert!((point - from).cross(&along).norm() < 1e-9);
            prop_assert!((point - from).dot(&along) > 0.0);
        }

        #[test]
        fn columns_and_rows_are_inverted(column in -0.5..479.4f64, row in -5.0..125.0f64) {
            let panorama = panorama();
            prop_assert!((panorama.column(panorama.bearing(column)) - column).abs() < 1e-9);
            prop_assert!((panorama.row(panorama.elevation(row)) - row).abs() < 1e-9);
        }
    }

    #[test]
    fn each_number_of_a_mirror_has_its_bounds() {
        let fine = mirror(67.5);
        assert!(fine.is_sane());
        assert!(ConicalMirror { inner_px: 0.0, ..fine }.is_sane());
        // Light that leaves the cone along its side does not reach the camera.
        let outermost = fine.focal_px * fine.half_angle_rad.tan();
        for broken in [
            ConicalMirror { focal_px: 0.0, ..fine },
            ConicalMirror { focal_px: f64::INFINITY, ..fine },
            ConicalMirror { centre_px: Point2::new(f64::NAN, 0.0), ..fine },
            ConicalMirror { apex_m: 0.0, ..fine },
            ConicalMirror { apex_m: f64::INFINITY, ..fine },
            ConicalMirror { half_angle_rad: FRAC_PI_4, ..fine },
            ConicalMirror { half_angle_rad: FRAC_PI_2, ..fine },
            ConicalMirror { inner_px: -1.0, ..fine },
            ConicalMirror { outer_px: fine.inner_px, ..fine },
            ConicalMirror { outer_px: 1.01 * outermost, ..fine },
        ] {
            assert!(!broken.is_sane(), "{broken:?}");
        }
        assert!(ConicalMirror { outer_px: 0.99 * outermost, ..fine }.is_sane());
    }

    /// At a half angle of 45 degrees the mirror images of the pinhole lie on a ring as high as the
    /// apex and as wide.
    #[test]
    fn the_ring_of_viewpoints_is_the_mirror_image_of_the_pinhole() {
        let mirror = ConicalMirror { half_angle_rad: FRAC_PI_4, ..mirror(67.5) };
        let (ring, height) = mirror.ring_m();
        assert!((ring - 0.05).abs() < 1e-12 && (height - 0.05).abs() < 1e-12, "{ring} {height}");
        let steep = ConicalMirror { half_angle_rad: 60_f64.to_radians(), ..mirror };
        let (ring, height) = steep.ring_m();
        assert!((ring - 0.05 * 0.75_f64.sqrt()).abs() < 1e-12, "{ring}");
        assert!((height - 0.075).abs() < 1e-12, "{height}");
    }

    #[test]
    fn circles_and_elevations_are_inverted() {
        let mirror = mirror(67.5);
        for radius in [8.0, 60.0, 120.0, 230.0] {
            let elevation = mirror.elevation(radius);
            assert!((mirror.radius_px(elevation) - radius).abs() < 1e-9);
            assert!((elevation - ((radius / 175.0).atan() - FRAC_PI_4)).abs() < 1e-12);
        }
    }

    #[test]
    fn the_top_of_the_unwrapped_image_is_the_outer_circle() {
        let panorama = panorama();
        let [top, bottom] = panorama.elevations();
        assert!(top > bottom);
        assert!((panorama.elevation(-0.5) - top).abs() < 1e-12);
        assert!((panorama.elevation(119.5) - bottom).abs() < 1e-12);
        let pixel = panorama.raw_pixel(239.5, -0.5);
        assert!((pixel - Point2::new(241.3, 238.0 - 230.0)).norm() < 1e-9, "{pixel}");
        let pixel = panorama.raw_pixel(119.5, 119.5);
        assert!((pixel - Point2::new(241.3 + 8.0, 238.0)).norm() < 1e-9, "{pixel}");
    }

    /// The face of a person 2.08 m away is at 2 m, where the square is 0.57 m wide.
    #[test]
    fn the_square_is_as_wide_as_the_template_at_the_face() {
        let panorama = panorama();
        let head = ConicalMirror::upright(1.5).inverse() * Point3::new(2.08, 0.0, 1.6);
        let square = panorama.upper_body(&head);
        let width = 2.0 * (0.285_f64 / 2.0).atan() / TAU * 480.0;
        assert!((square.width - width).abs() < 1e-9, "{square:?}");
        assert!((square.centre().x - 239.5).abs() < 1e-9, "{square:?}");
        let top = pixel_of(&panorama, [2.0, 0.0, 1.74]).y;
        let bottom = pixel_of(&panorama, [2.0, 0.0, 1.17]).y;
        assert!((square.y - top).abs() < 1e-9, "{square:?}");
        assert!((square.bottom() - bottom).abs() < 1e-9, "{square:?}");
    }
}
