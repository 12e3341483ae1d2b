//! Image that later images are compared with.

use nalgebra::{Isometry2, Point2, Point3, Vector2};
use tagalong_core::{DepthImage, GreyImage};
use tagalong_geometry::Camera;

use crate::odometry::OdometrySettings;
use crate::odometry::patch::Patch;

/// Distance at which the depth around a point is checked, px.
const NEAR: i64 = 3;
/// Maximum relative difference between depths of one surface.
const SAME_SURFACE: f32 = 0.05;

/// Height below which a point lies on the floor, m.
const FLOOR_M: f64 = 0.15;
/// Minimum height of a point, m. A lower one has a wrong depth, which is frequent along horizontal
/// edges, where both images of a stereo pair look alike at any disparity.
const LOWEST_M: f64 = -0.2;

/// Images at full and at half size.
pub type Pyramid<'a> = [&'a GreyImage; 2];

/// Points of an image with known positions.
pub struct Keyframe {
    pub points: Vec<Point>,
}

/// Point with the brightness around it.
pub struct Point {
    /// Position in the robot frame at the time of the image, m.
    pub place: Point3<f64>,
    /// Patches at full and at half size.
    pub patches: [Patch; 2],
    /// Offset from the scaled pixel to the centre of either patch, px.
    pub shifts: [Vector2<f64>; 2],
}

impl Keyframe {
    /// Selects the points of an image. `people` are positions on the floor, robot frame, m.
    pub fn new(
        settings: &OdometrySettings,
        camera: &Camera,
        images: &Pyramid<'_>,
        depth: &DepthImage,
        people: &[Point2<f64>],
    ) -> Self {
        let cell = settings.cell_px;
        let width = images[0].width();
        let height = images[0].height();
        let eye = camera.robot_from_camera.translation.vector.xy().into();
        let corners = (0..height)
            .step_by(cell)
            .flat_map(|top| (0..width).step_by(cell).map(move |left| (left, top)));
        let points = corners
            .filter_map(|corner| point(settings, camera, images, depth, corner))
            // Points on a person and behind one are left out because outlines move with the person,
            // and floor points near a person because of the shadow.
            .filter(|point: &Point| {
                let line = [eye, point.place.xy()];
                let is_on_floor = point.place.z < FLOOR_M;
                people.iter().all(|person| {
                    let apart = (point.place.xy() - person).norm();
                    distance_m(person, line) > settings.person_m
                        && !(is_on_floor && apart < settings.shadow_m)
                })
            })
            .collect();
        Self { points }
    }
}

impl Point {
    /// Returns the position in the robot frame after the robot has moved, m.
    pub fn after(&self, pose: &Isometry2<f64>) -> Point3<f64> {
        let floor = pose.inverse_transform_point(&self.place.xy());
        Point3::new(floor.x, floor.y, self.place.z)
    }
}

/// Returns the distance from a point to a line segment on the floor, m.
fn distance_m(place: &Point2<f64>, [from, to]: [Point2<f64>; 2]) -> f64 {
    let way = to - from;
    let off = place - from;
    // The minimum keeps a segment of zero length from dividing by zero.
    let part = (off.dot(&way) / way.norm_squared().max(1e-9)).clamp(0.0, 1.0);
    (off - way * part).norm()
}

/// Returns the point of a cell with the largest change of brightness and a valid depth.
fn point(
    settings: &OdometrySettings,
    camera: &Camera,
    images: &Pyramid<'_>,
    depth: &DepthImage,
    corner: (usize, usize),
) -> Option<Point> {
    // The centre of a pixel with an odd index is half a pixel off that of its pixel at half size.
    fn odd(at: usize) -> f64 {
        -0.5 * (at % 2) as f64
    }

    let range = settings.min_depth_m as f32..=settings.max_depth_m as f32;
    // `slopes` compares pixels that are two apart; the setting is per pixel.
    let least = (2.0 * settings.min_slope) as f32;
    let mut best = None;
    let mut slope = least;
    for (x, y, steepness) in slopes(images[0], corner, settings.cell_px) {
        if steepness <= slope {
            continue;
        }
        let metres = surface_m(depth, x, y).filter(|metres| range.contains(metres));
        if let Some(metres) = metres {
            (best, slope) = (Some((x, y, metres)), steepness);
        }
    }
    let (x, y, metres) = best?;
    let place = camera.back_project(Point2::new(x as f64, y as f64), f64::from(metres));
    if place.z < LOWEST_M {
        return None;
    }
    Some(Point {
        place,
        patches: [Patch::new(images[0], x, y)?, Patch::new(images[1], x / 2, y / 2)?],
        shifts: [Vector2::zeros(), Vector2::new(odd(x), odd(y))],
    })
}

/// Yields the pixels of a cell and the change of brightness over two pixels.
fn slopes(
    image: &GreyImage,
    (left, top): (usize, usize),
    cell: usize,
) -> impl Iterator<Item = (usize, usize, f32)> {
    let columns = left.max(1)..(left + cell).min(image.width() - 1);
    let rows = top.max(1)..(top + cell).min(image.height() - 1);
    rows.flat_map(move |y| {
        let [above, here, below] = [y - 1, y, y + 1].map(|y| image.row(y));
        columns.clone().map(move |x| {
            let along = here[x + 1].abs_diff(here[x - 1]);
            (x, y, f32::from(along.max(below[x].abs_diff(above[x]))))
        })
    })
}

/// Returns the depth of a pixel, m, unless it is at the border of a surface.
fn surface_m(depth: &DepthImage, x: usize, y: usize) -> Option<f32> {
    let x = x as i64;
    let y = y as i64;
    let here = depth.get(x, y)?;
    let around = [(x - NEAR, y), (x + NEAR, y), (x, y - NEAR), (x, y + NEAR)];
    let is_border = around.into_iter().any(|(x, y)| {
        depth.get(x, y).is_none_or(|there| (there - here).abs() >= SAME_SURFACE * here)
    });
    (here.is_finite() && !is_border).then_some(here)
}

#[cfg(test)]
mod tests {
    use tagalong_geometry::{Distortion, Pinhole};

    use super::*;

    #[test]
    fn what_a_person_hides_is_no_point() {
        let line = [Point2::origin(), Point2::new(4.0, 0.0)];
        assert!((distance_m(&Point2::new(2.0, 0.5), line) - 0.5).abs() < 1e-12, "before it");
        assert!((distance_m(&Point2::new(7.0, 4.0), line) - 5.0).abs() < 1e-12, "behind it");
        assert!((distance_m(&Point2::new(-3.0, 4.0), line) - 5.0).abs() < 1e-12, "behind the eye");
    }

    /// Returns the points of a chequered floor with a depth of `scale` times the true one.
    fn points_of_floor(
        settings: &OdometrySettings,
        people: &[Point2<f64>],
        scale: f64,
    ) -> Keyframe {
        let lens =
            Pinhole { fx: 300.0, fy: 300.0, cx: 159.5, cy: 119.5, distortion: Distortion::None };
        let camera = Camera::mounted(lens, 320, 240, 1.0, 0.4, 0.0);
        let depth = DepthImage::from_fn(320, 240, |x: usize, y: usize| {
            let eye_m = camera.height_m();
            let drop_m = eye_m - camera.back_project(Point2::new(x as f64, y as f64), 1.0).z;
            if drop_m > 0.0 { (scale * eye_m / drop_m) as f32 } else { f32::NAN }
        });
        let image = GreyImage::from_fn(320, 240, |x, y| ((x / 8 + y / 8) % 2 * 200) as u8);
        let half = GreyImage::from_fn(160, 120, |x, y| ((x / 4 + y / 4) % 2 * 200) as u8);
        Keyframe::new(settings, &camera, &[&image, &half], &depth, people)
    }

    #[test]
    fn a_shadow_walks_with_somebody_and_is_no_landmark() {
        let somebody = Point2::new(2.5, 1.2);
        let [shadowless, far] = [0.0, 1.5].map(|shadow_m| {
            let settings = OdometrySettings { shadow_m, ..OdometrySettings::default() };
            let points = points_of_floor(&settings, &[somebody], 1.0).points;
            assert!(points.len() > 8, "{}", points.len());
            let apart = points.iter().map(|point| (point.place.xy() - somebody).norm());
            apart.fold(f64::INFINITY, f64::min)
        });
        assert!(shadowless < 0.7, "{shadowless}");
        assert!(far > 1.5, "{far}");
    }

    #[test]
    fn nothing_is_below_the_floor() {
        fn points(scale: f64) -> usize {
            points_of_floor(&OdometrySettings::default(), &[], scale).points.len()
        }

        assert!(points(1.0) > 20 && points(1.1) > 20);
        assert_eq!(points(1.4), 0);
    }

    #[test]
    fn borders_of_surfaces_and_holes_are_no_points() {
        let depth = DepthImage::from_fn(40, 30, |x, y| match (x, y) {
            (0..20, _) => 2.0,
            (_, 0..10) => f32::NAN,
            _ => 3.0,
        });
        assert_eq!(surface_m(&depth, 10, 20), Some(2.0));
        assert_eq!(surface_m(&depth, 18, 20), None, "two surfaces");
        assert_eq!(surface_m(&depth, 25, 5), None, "no reading");
        assert_eq!(surface_m(&depth, 18, 5), Some(2.0), "nothing is known to be beside it");
        assert_eq!(surface_m(&depth, 1, 20), None, "the image ends");
    }
}
