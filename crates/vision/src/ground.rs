//! The floor, fitted to the points of a depth image.
//!
//! Planes through three random points are tried (RANSAC; Fischler and Bolles, CACM 1981) in a fixed
//! pseudo-random order, and the best one is refined by least squares over its inliers. The floor is
//! not the largest plane but the *lowest* large one: points below a plane count against it.

use nalgebra::{Matrix3, Point2, Point3, Unit, Vector3};
use tagalong_core::DepthImage;
use tagalong_geometry::Camera;
use tagalong_math::{RandomSource, XorShift64};

/// Settings of the ground estimation.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct GroundSettings {
    /// Minimum and maximum height of the camera, m.
    pub height_m: (f64, f64),
    /// Maximum angle between the image's upward direction and the vertical, rad.
    pub max_tilt_rad: f64,
    /// Inlier distance at a depth of 0 m, m, and its growth with the square of depth.
    pub tolerance_m: (f64, f64),
    /// Maximum depth of a reading that is used, m.
    pub max_depth_m: f64,
    /// Minimum number of inliers, as a fraction of the points.
    pub min_inliers: f64,
    /// Number of planes tried.
    pub trials: usize,
}

impl Default for GroundSettings {
    fn default() -> Self {
        Self {
            height_m: (0.15, 4.0),
            max_tilt_rad: 0.9,
            tolerance_m: (0.015, 0.004),
            max_depth_m: 7.0,
            min_inliers: 0.06,
            trials: 4000,
        }
    }
}

impl GroundSettings {
    fn narrowed(&self, part: f64) -> Self {
        let (near, growth) = self.tolerance_m;
        Self { tolerance_m: (part * near, part * growth), ..self.clone() }
    }
}

/// Pose of the camera relative to the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Upward normal of the floor in the camera frame.
    pub up_in_camera: Vector3<f64>,
    /// Height of the camera above the floor, m.
    pub height_m: f64,
    /// Fraction of the points that lie on the floor.
    pub inliers: f64,
}

impl Ground {
    /// Returns the angle of the optical axis below the horizon, rad.
    pub fn pitch_down_rad(&self) -> f64 {
        (-self.up_in_camera.z).clamp(-1.0, 1.0).asin()
    }

    /// Returns the roll, rad; positive when the camera's right side is higher.
    pub fn roll_rad(&self) -> f64 {
        self.up_in_camera.x.atan2(-self.up_in_camera.y)
    }

    /// Returns true if the tilt of the floor agrees with the mount of the camera.
    pub fn has_tilt_of(&self, camera: &Camera) -> bool {
        let told = camera.robot_from_camera.rotation.inverse() * Vector3::z();
        self.up_in_camera.angle(&told) <= OTHER_TILT_RAD
    }

    /// Returns the height of a point of the camera frame above the floor, m.
    pub fn height_of(&self, point_in_camera: &Point3<f64>) -> f64 {
        self.up_in_camera.dot(&point_in_camera.coords) + self.height_m
    }
}

/// Fits the floor to a depth image of a camera, without using its pose. Returns `None` if no plane
/// qualifies.
pub fn ground_of_depth(
    depth: &DepthImage,
    camera: &Camera,
    settings: &GroundSettings,
) -> Option<Ground> {
    let step = (depth.width() / 160).max(1);
    let pixels = (0..depth.height())
        .step_by(step)
        .flat_map(|y| (0..depth.width()).step_by(step).map(move |x| (x, y)));
    let points: Vec<Point3<f64>> = pixels
        .filter_map(|(x, y)| {
            let reading = f64::from(depth.row(y)[x]);
            let usable = reading > 0.0 && reading < settings.max_depth_m;
            let pixel = Point2::new(x as f64, y as f64);
            usable.then(|| Point3::from(camera.ray(pixel) * reading))
        })
        .collect();
    ground_of_points(&points, settings)
}

/// Minimum sine of the angle below the horizon of a ray that meets the floor.
const LEAST_DOWN: f64 = 0.08;
/// Half the relative width of the window in which readings count as those of one floor.
const ONE_FLOOR: f64 = 0.04;
/// Minimum number of rays that point down.
const LEAST_RAYS: usize = 150;
/// Minimum fraction of the rays that point down which meet the floor.
const LEAST_FLOOR: f64 = 0.1;
/// Maximum fraction of readings that lie clearly below the floor.
const MOST_BELOW: f64 = 0.1;

/// Plausible heights of the cameras of robots, m.
pub const ROBOT_HEIGHTS_M: std::ops::RangeInclusive<f64> = 0.1..=2.5;
/// Factors of the depth unit that may be due to a slightly wrong mount.
pub const PLAUSIBLE_FACTORS: std::ops::RangeInclusive<f64> = 0.6..=1.7;
/// Angle between the fitted floor and the floor of the mount beyond which the mount is wrong, rad.
const OTHER_TILT_RAD: f64 = 0.17;

/// Returns the factor by which the readings of a camera of known height and tilt have to be
/// multiplied so that the floor is at its true height. `None` if too little floor is visible, or if
/// the mount is wrong, which moves the floor just as another unit does: the camera's height is not
/// that of a robot, or the floor has another tilt. Along each ray that points down, a reading is at
/// most that of the floor, and over the image the floor is the most frequent one.
pub fn factor_of_depth(depth: &DepthImage, camera: &Camera) -> Option<f64> {
    let pose = &camera.robot_from_camera;
    let height_m = pose.translation.vector.z;
    let step = (depth.width() / 160).max(1);
    let mut ratios = Vec::new();
    for y in (0..depth.height()).step_by(step) {
        for x in (0..depth.width()).step_by(step) {
            let reading = f64::from(depth.row(y)[x]);
            let ray = pose.rotation * camera.ray(Point2::new(x as f64, y as f64));
            if reading > 0.0 && reading.is_finite() && -ray.z > LEAST_DOWN * ray.norm() {
                ratios.push((reading * -ray.z / height_m).ln());
            }
        }
    }
    if ratios.len() < LEAST_RAYS || !ROBOT_HEIGHTS_M.contains(&height_m) {
        return None;
    }
    ratios.sort_by(f64::total_cmp);
    let most = ratios.iter().step_by(4).map(|ratio| count_near(&ratios, *ratio)).max()?;
    // The farthest of the frequent ratios, because objects on the floor are nearer than the floor.
    let farthest =
        *ratios.iter().rev().find(|ratio| count_near(&ratios, **ratio) * 10 >= most * 7)?;
    let floor = farthest - 0.5 * ONE_FLOOR;
    let around = ratios.iter().filter(|ratio| (*ratio - floor).abs() <= 1.5 * ONE_FLOOR);
    let floor = tagalong_math::median(around.copied())?;
    let is_seen = count_near(&ratios, farthest) as f64 >= LEAST_FLOOR * ratios.len() as f64;
    let below = ratios.len() - ratios.partition_point(|ratio| *ratio <= floor + 4.0 * ONE_FLOOR);
    let is_lowest = below as f64 <= MOST_BELOW * ratios.len() as f64;
    let factor = (is_seen && is_lowest).then(|| (-floor).exp())?;
    let is_other_tilt =
        !PLAUSIBLE_FACTORS.contains(&factor) && has_other_tilt(depth, camera, factor);
    (!is_other_tilt).then_some(factor)
}

/// Counts the sorted ratios that may belong to the same floor as this one.
fn count_near(ratios: &[f64], ratio: f64) -> usize {
    let low = ratio - ONE_FLOOR;
    let high = ratio + ONE_FLOOR;
    ratios.partition_point(|v| *v <= high) - ratios.partition_point(|v| *v < low)
}

/// Returns true if the floor, with readings multiplied by a factor, has another tilt than the
/// camera's mount implies.
fn has_other_tilt(depth: &DepthImage, camera: &Camera, factor: f64) -> bool {
    let scaled =
        DepthImage::from_fn(depth.width(), depth.height(), |x, y| depth.row(y)[x] * factor as f32);
    ground_of_depth(&scaled, camera, &GroundSettings::default())
        .is_some_and(|floor| !floor.has_tilt_of(camera))
}

/// Leading digits of the units of depth cameras.
const ROUND_UNITS: [f64; 7] = [1.0, 1.25, 2.0, 2.5, 4.0, 5.0, 8.0];
/// Relative accuracy of a unit that is measured by the floor.
const UNIT_ACCURACY: f64 = 0.03;

/// Returns a measured unit of depth, m, as a number to write in a config: a round one within the
/// accuracy of the measurement, otherwise one with two digits.
pub fn written_unit_m(measured_m: f64) -> f64 {
    let power = measured_m.log10().floor();
    let tens = [power, power + 1.0];
    let round = tens.iter().flat_map(|power| ROUND_UNITS.map(|digits| format!("{digits}e{power}")));
    let round = round.filter_map(|text| text.parse::<f64>().ok());
    let nearest = round
        .map(|unit_m| ((unit_m / measured_m - 1.0).abs(), unit_m))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    match nearest {
        Some((off, unit_m)) if off < UNIT_ACCURACY => unit_m,
        _ => format!("{measured_m:.1e}").parse().unwrap_or(measured_m),
    }
}

/// Fits the floor to points of the camera frame (x right, y down, z forward). Returns `None` if no
/// plane qualifies.
pub fn ground_of_points(points: &[Point3<f64>], settings: &GroundSettings) -> Option<Ground> {
    // A fixed seed: the same image always gives the same floor.
    let mut random = XorShift64::new(0x9e37_79b9_7f4a_7c15);
    let thinned: Vec<_> = points.iter().step_by(points.len() / 1000 + 1).copied().collect();
    let mut best: Option<(f64, Ground)> = None;
    for _ in 0..settings.trials {
        let Some(plane) = random_plane(&mut random, &thinned).filter(|p| plausible(p, settings))
        else {
            continue;
        };
        let score = score(&plane, &thinned, settings);
        if best.as_ref().is_none_or(|(highest, _)| score > *highest) {
            best = Some((score, plane));
        }
    }
    let mut plane = best?.1;
    // The tolerance shrinks each time, because the foot of a wall is also within the full
    // tolerance, and would tilt the floor.
    for part in [1.0, 0.6, 0.4, 0.3, 0.3] {
        plane = refined(&plane, points, &settings.narrowed(part))?;
    }
    let inliers = points.iter().filter(|p| is_inlier(&plane, p, settings)).count();
    plane.inliers = inliers as f64 / points.len() as f64;
    (plausible(&plane, settings) && plane.inliers >= settings.min_inliers).then_some(plane)
}

fn plausible(plane: &Ground, settings: &GroundSettings) -> bool {
    let (low, high) = settings.height_m;
    -plane.up_in_camera.y > settings.max_tilt_rad.cos()
        && low <= plane.height_m
        && plane.height_m <= high
}

fn tolerance(point: &Point3<f64>, settings: &GroundSettings) -> f64 {
    settings.tolerance_m.0 + settings.tolerance_m.1 * point.z * point.z
}

fn is_inlier(plane: &Ground, point: &Point3<f64>, settings: &GroundSettings) -> bool {
    plane.height_of(point).abs() < tolerance(point, settings)
}

/// Scores a plane by the points on it, nearer ones more (MSAC; Torr and Zisserman, CVIU 2000),
/// minus twice the number of points well below it.
fn score(plane: &Ground, points: &[Point3<f64>], settings: &GroundSettings) -> f64 {
    let votes = points.iter().map(|point| {
        let height = plane.height_of(point);
        let near = tolerance(point, settings);
        if height.abs() < near {
            1.0 - (height / near).powi(2)
        // Nothing lies below a floor; three tolerances leave room for noise.
        } else if height < -3.0 * near {
            -2.0
        } else {
            0.0
        }
    });
    votes.sum()
}

/// Returns the least-squares plane through the inliers.
fn refined(plane: &Ground, points: &[Point3<f64>], settings: &GroundSettings) -> Option<Ground> {
    let inliers = points.iter().filter(|p| is_inlier(plane, p, settings));
    let count = inliers.clone().count();
    if count < 3 {
        return None;
    }
    let mean = inliers.clone().map(|p| p.coords).sum::<Vector3<f64>>() / count as f64;
    let scatter: Matrix3<f64> =
        inliers.map(|p| (p.coords - mean) * (p.coords - mean).transpose()).sum();
    let eigen = scatter.symmetric_eigen();
    // The normal is the direction of the smallest scatter.
    let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    through(&mean, normal)
}

/// Returns the plane through a point with the given normal, which is turned upwards.
fn through(point: &Vector3<f64>, normal: Vector3<f64>) -> Option<Ground> {
    let up = Unit::try_new(normal, 1e-9)?.into_inner();
    let up = if up.y > 0.0 { -up } else { up };
    Some(Ground { up_in_camera: up, height_m: -up.dot(point), inliers: 0.0 })
}

/// Returns the plane through three random points; `None` for fewer points, or if they are
/// collinear.
fn random_plane(random: &mut XorShift64, points: &[Point3<f64>]) -> Option<Ground> {
    if points.len() < 3 {
        return None;
    }
    let [a, b, c] = [(); 3].map(|()| random.pick(points).coords);
    through(&a, (b - a).cross(&(c - a)))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tagalong_geometry::{Distortion, Pinhole};

    use super::*;

    /// Renders the depth of a scene by ray casting: floor, a wall at 5 m, a table top 0.75 m high.
    fn room(camera: &Camera) -> DepthImage {
        DepthImage::from_fn(camera.width, camera.height, |x, y| {
            let pixel = Point2::new(x as f64, y as f64);
            let eye = camera.back_project(pixel, 0.0);
            let to = camera.back_project(pixel, 1.0);
            let ray = to - eye;
            let floor = Some(-eye.z / ray.z);
            let wall = Some((5.0 - eye.x) / ray.x);
            let table = Some((0.75 - eye.z) / ray.z).filter(|t| {
                let at = eye + ray * *t;
                (1.5..2.8).contains(&at.x) && (-0.2..1.2).contains(&at.y)
            });
            let hits = [floor, wall, table].into_iter().flatten().filter(|t| *t > 0.1);
            let nearest = hits.fold(f64::INFINITY, f64::min);
            let noise = 1.0 + 0.002 * (((x * 7 + y * 13) % 11) as f64 / 5.0 - 1.0);
            if nearest < 8.0 { (nearest * noise) as f32 } else { f32::NAN }
        })
    }

    fn scaled(depth: &DepthImage, factor: f32) -> DepthImage {
        DepthImage::from_fn(depth.width(), depth.height(), |x, y| factor * depth.row(y)[x])
    }

    #[test]
    fn any_unit_is_measured_by_the_floor_and_a_known_height() {
        let lens =
            Pinhole { fx: 130.0, fy: 130.0, cx: 79.5, cy: 59.5, distortion: Distortion::None };
        for (height_m, pitch_rad) in [(1.2, 0.0), (0.4, 0.1), (1.6, 0.4), (1.0, 0.2), (2.2, 0.5)] {
            let camera = Camera::mounted(lens, 160, 120, height_m, pitch_rad, 0.0);
            let depth = room(&camera);
            for factor in [1.0, 0.25, 0.1, 4.0, 10.0, 1000.0, 0.7] {
                let found = factor_of_depth(&scaled(&depth, factor), &camera).unwrap();
                let error = (found * f64::from(factor) - 1.0).abs();
                assert!(error < 0.03, "{height_m} {pitch_rad} {factor}: {found}");
            }
        }
    }

    #[test]
    fn some_readings_below_the_floor_are_mistakes_and_many_are_another_floor() {
        let lens =
            Pinhole { fx: 130.0, fy: 130.0, cx: 79.5, cy: 59.5, distortion: Distortion::None };
        let camera = Camera::mounted(lens, 160, 120, 1.2, 0.4, 0.0);
        let depth = room(&camera);
        // Each n-th column has readings twice as far as they may be.
        let [few, many] = [80, 3].map(|every| {
            let with_holes = DepthImage::from_fn(160, 120, |x, y| {
                depth.row(y)[x] * if x % every == 0 { 2.0 } else { 1.0 }
            });
            factor_of_depth(&with_holes, &camera)
        });
        assert!((few.unwrap() - 1.0).abs() < 0.03, "{few:?}");
        assert_eq!(many, None);
    }

    #[test]
    fn a_mount_at_the_height_of_no_robot_tells_no_unit() {
        let lens =
            Pinhole { fx: 130.0, fy: 130.0, cx: 79.5, cy: 59.5, distortion: Distortion::None };
        let depth = room(&Camera::mounted(lens, 160, 120, 1.2, 0.3, 0.0));
        for height_m in [120.0, 0.0, -1.2] {
            let told = Camera::mounted(lens, 160, 120, height_m, 0.3, 0.0);
            assert_eq!(factor_of_depth(&depth, &told), None, "{height_m}");
        }
    }

    #[test]
    fn a_mount_with_another_tilt_tells_no_unit() {
        let lens =
            Pinhole { fx: 130.0, fy: 130.0, cx: 79.5, cy: 59.5, distortion: Distortion::None };
        let depth = room(&Camera::mounted(lens, 160, 120, 1.2, 0.3, 0.0));
        let half_pi = std::f64::consts::FRAC_PI_2;
        for (pitch_rad, roll_rad) in [(0.3, half_pi), (0.3, -half_pi), (0.0, half_pi), (1.2, 0.0)] {
            let told = Camera::mounted(lens, 160, 120, 1.2, pitch_rad, roll_rad);
            let found = factor_of_depth(&depth, &told);
            let is_told = found.is_some_and(|factor| !PLAUSIBLE_FACTORS.contains(&factor));
            assert!(!is_told, "{pitch_rad} {roll_rad}: {found:?}");
        }
    }

    #[test]
    fn a_measured_unit_is_written_as_a_round_number_near_it() {
        for (measured_m, written_m) in [
            (0.000_099_5, 0.0001),
            (0.000_252, 0.00025),
            (0.001_01, 0.001),
            (0.000_123_9, 0.000125),
            (0.000_333, 0.00033),
            (0.98, 1.0),
        ] {
            assert_eq!(written_unit_m(measured_m), written_m, "{measured_m}");
        }
    }

    #[test]
    fn no_unit_is_measured_without_a_floor() {
        let lens =
            Pinhole { fx: 130.0, fy: 130.0, cx: 79.5, cy: 59.5, distortion: Distortion::None };
        let level = Camera::mounted(lens, 160, 120, 1.2, 0.0, 0.0);
        // A wall at 2 m, right before the camera.
        assert_eq!(factor_of_depth(&DepthImage::filled(160, 120, 2.0), &level), None);
        assert_eq!(factor_of_depth(&DepthImage::filled(160, 120, f32::NAN), &level), None);
        let up = Camera::mounted(lens, 160, 120, 1.2, -0.6, 0.0);
        assert_eq!(factor_of_depth(&room(&up), &up), None);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(100))]
        #[test]
        fn the_floor_is_found_beside_tables_and_walls(
            height in 0.9..2.5f64, pitch in 0.05..0.5f64, roll in -0.2..0.2f64,
        ) {
            let lens = Pinhole { fx: 130.0, fy: 130.0, cx: 79.5, cy: 59.5, distortion: Distortion::None };
            let camera = Camera::mounted(lens, 160, 120, height, pitch, roll);
            let depth = room(&camera);
            let mut on_floor = 0;
            for (x, y) in (0..120).flat_map(|y| (0..160).map(move |x| (x, y))) {
                let pixel = Point2::new(x as f64, y as f64);
                let at = camera.back_project(pixel, depth.row(y)[x].into());
                on_floor += usize::from(at.z < 0.05);
            }
            let part = on_floor as f64 / 19_200.0;
            // A strip of floor at the lower border is too small for a reliable fit.
            prop_assume!(part > 0.2);
            let found = ground_of_depth(&depth, &camera, &GroundSettings::default()).unwrap();
            prop_assert!((found.height_m - height).abs() < 0.03, "{found:?} {height}");
            prop_assert!((found.pitch_down_rad() - pitch).abs() < 0.015, "{found:?} {pitch}");
            prop_assert!((found.roll_rad() - roll).abs() < 0.015, "{found:?} {roll}");
        }
    }

    #[test]
    fn without_a_floor_nothing_is_found() {
        let settings = GroundSettings::default();
        assert_eq!(ground_of_points(&[], &settings), None);
        let wall: Vec<_> = (0..400)
            .map(|i| Point3::new(f64::from(i % 20) * 0.1 - 1.0, f64::from(i / 20) * 0.1 - 1.0, 3.0))
            .collect();
        assert_eq!(ground_of_points(&wall, &settings), None);
    }

    #[test]
    fn the_same_points_give_the_same_floor() {
        let lens =
            Pinhole { fx: 130.0, fy: 130.0, cx: 79.5, cy: 59.5, distortion: Distortion::None };
        let camera = Camera::mounted(lens, 160, 120, 1.2, 0.3, 0.0);
        let [first, second] =
            [0, 1].map(|_| ground_of_depth(&room(&camera), &camera, &GroundSettings::default()));
        assert_eq!(first, second);
    }
}
