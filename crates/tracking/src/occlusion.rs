//! Occlusion of people by nearer ones (P4, section III-C): silhouettes are rendered at the
//! predicted positions, nearest first.

use std::sync::LazyLock;

use nalgebra::{Matrix3, Point2, Point3, Vector3};
use tagalong_core::{Detection, Estimate, Frame};
use tagalong_geometry::{Camera, Lens, Rect};

use crate::OcclusionSettings;

/// Samples per side of the region of a silhouette.
const SAMPLES: usize = 16;

/// Standard deviation of the range, m, above which the detector gave the direction alone.
const RANGE_UNTOLD_M: f64 = 2.0;

/// A person that may occlude others, as detected or as predicted.
pub(crate) struct Occluder {
    region: Rect,
    range_m: f64,
    sigma_m: f64,
}

/// Visibility of a person at the predicted position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Visibility {
    /// The person can be detected.
    Visible,
    /// Hidden behind a nearer person.
    Hidden,
    /// Outside the image.
    Outside,
}

impl Occluder {
    /// Creates the occluder of a detection.
    pub(crate) fn of(seen: &Detection, camera: &Camera) -> Self {
        Self::new(seen.rect_in(camera), &seen.position, &seen.covariance, camera)
    }

    /// Returns the occluder at the expected position instead, if the detector gave the direction
    /// alone.
    pub(crate) fn or(self, expected: Self) -> Self {
        if self.sigma_m > RANGE_UNTOLD_M { expected } else { self }
    }

    pub(crate) fn new(
        region: Rect,
        position: &Point3<f64>,
        covariance: &Matrix3<f64>,
        camera: &Camera,
    ) -> Self {
        let ray = ray(position, camera);
        // A point at the camera has no direction; the lower limit avoids a division by zero.
        let direction = ray / ray.norm().max(1e-9);
        let variance = (direction.transpose() * covariance * direction).x;
        // Rounding may make the variance slightly negative, which would give a root that is NaN.
        Self { region, range_m: ray.norm(), sigma_m: variance.max(0.0).sqrt() }
    }
}

/// Returns the distance of a point in the robot frame from the camera, m.
pub(crate) fn range_m(position: &Point3<f64>, camera: &Camera) -> f64 {
    ray(position, camera).norm()
}

/// Returns the vector from the camera to a point in the robot frame, m.
pub(crate) fn ray(position: &Point3<f64>, camera: &Camera) -> Vector3<f64> {
    position.coords - camera.robot_from_camera.translation.vector
}

/// Returns the visibility of a person at `position`, expected at `region`.
///
/// The gap in range is compared with the uncertainty of the nearer person only: that of the hidden
/// one grows during the occlusion, which must not end it.
pub(crate) fn visibility(
    region: &Rect,
    position: &Point3<f64>,
    occluders: &[Occluder],
    camera: &Camera,
    settings: &OcclusionSettings,
) -> Visibility {
    if camera.is_blind() {
        // Without an image there is no silhouette; a laser scan does not tell which people are
        // hidden.
        return Visibility::Visible;
    }
    let Shown { all, inside, visible } = shown(region, position, occluders, camera, settings);
    let least = settings.min_visible * f64::from(all);
    match (all > 0 && f64::from(inside) >= least, f64::from(visible) >= least) {
        (false, _) => Visibility::Outside,
        (true, false) => Visibility::Hidden,
        (true, true) => Visibility::Visible,
    }
}

/// Returns the fraction of a person at `position`, expected at `region`, that is not occluded, 0 to
/// 1; the part outside of the image does not count.
pub(crate) fn part_shown(
    region: &Rect,
    position: &Point3<f64>,
    occluders: &[Occluder],
    camera: &Camera,
    settings: &OcclusionSettings,
) -> f64 {
    let Shown { inside, visible, .. } = shown(region, position, occluders, camera, settings);
    if inside > 0 { f64::from(visible) / f64::from(inside) } else { 1.0 }
}

/// Visible part of a silhouette, in samples.
struct Shown {
    all: u32,
    /// Samples inside of the image.
    inside: u32,
    /// Samples inside of the image and not occluded.
    visible: u32,
}

fn shown(
    region: &Rect,
    position: &Point3<f64>,
    occluders: &[Occluder],
    camera: &Camera,
    settings: &OcclusionSettings,
) -> Shown {
    let range = range_m(position, camera);
    let nearer = occluders.iter().filter(|c| {
        range - c.range_m > settings.min_gap_m.max(settings.min_gap_sigmas * c.sigma_m)
    });
    let in_front: Vec<&Occluder> = nearer.filter(|c| may_hide(&c.region, region, camera)).collect();
    let image = Rect::new(0.0, 0.0, camera.width as f64, camera.height as f64);
    // Most people are wholly in the image without another person before them; then no sample needs
    // a look.
    if in_front.is_empty() && is_within(region, &image) && is_plain(region) {
        return Shown { all: *ON_BODY, inside: *ON_BODY, visible: *ON_BODY };
    }
    count(region, &image, &in_front, camera)
}

/// Counts the samples one by one.
fn count(region: &Rect, image: &Rect, in_front: &[&Occluder], camera: &Camera) -> Shown {
    let mut all = 0_u32;
    let mut inside = 0_u32;
    let mut visible = 0_u32;
    for point in silhouette(region) {
        all += 1;
        // A panorama continues beyond its edges.
        let column = camera.column_near(point.x, image.centre().x);
        if !image.contains(Point2::new(column, point.y)) {
            continue;
        }
        inside += 1;
        let is_hidden = in_front.iter().any(|c| {
            let column = camera.column_near(point.x, c.region.centre().x);
            is_on_body(&c.region, Point2::new(column, point.y))
        });
        visible += u32::from(!is_hidden);
    }
    Shown { all, inside, visible }
}

/// Number of samples on the silhouette, which is the same in all regions.
static ON_BODY: LazyLock<u32> =
    LazyLock::new(|| silhouette(&Rect::new(0.0, 0.0, 1.0, 1.0)).count() as u32);

/// Returns true for a region so large that rounding moves no sample across the silhouette's edge.
fn is_plain(region: &Rect) -> bool {
    region.width > 1e-6 * (1.0 + region.x.abs()) && region.height > 1e-6 * (1.0 + region.y.abs())
}

/// Returns true if all samples of a region are inside of the image, with a pixel to spare.
fn is_within(region: &Rect, image: &Rect) -> bool {
    region.x > 1.0
        && region.y > 1.0
        && region.right() < image.right() - 1.0
        && region.bottom() < image.bottom() - 1.0
}

/// Returns false if the body of an occluder lies wholly beside the upper body in `region`.
fn may_hide(occluder: &Rect, region: &Rect, camera: &Camera) -> bool {
    // The trunk reaches down to 2.5 times the height of the square. A pixel more on each side, so
    // that rounding cannot decide.
    let trunk = occluder.y + 2.5 * occluder.height;
    let is_beside = region.x > occluder.right() + 1.0 || occluder.x > region.right() + 1.0;
    let is_above_or_below = region.y > trunk + 1.0 || occluder.y > region.bottom() + 1.0;
    // Columns of a panorama are on both sides of each other.
    let is_beside = is_beside && !matches!(camera.lens, Lens::Panorama(_));
    !(is_beside || is_above_or_below)
}

/// Returns samples spread evenly over head, shoulders and trunk.
fn silhouette(region: &Rect) -> impl Iterator<Item = Point2<f64>> {
    let region = *region;
    let step = 1.0 / SAMPLES as f64;
    let grid = (0..SAMPLES * SAMPLES).map(move |i| {
        let u = (i % SAMPLES) as f64 + 0.5;
        let v = (i / SAMPLES) as f64 + 0.5;
        Point2::new(region.x + u * step * region.width, region.y + v * step * region.height)
    });
    grid.filter(move |point| is_on_body(&region, *point))
}

/// Returns true on the silhouette of the person with the upper-body square `region`: head and
/// shoulders as wide as the upper-body template of Jafari et al. (ICRA 2014), and the trunk below
/// them.
fn is_on_body(region: &Rect, point: Point2<f64>) -> bool {
    let across = ((point.x - region.x) / region.width - 0.5).abs();
    let down = (point.y - region.y) / region.height;
    let half_width = match down {
        d if d < 0.05 => 0.0,
        d if d < 0.50 => 0.165,
        d if d < 0.80 => 0.165 + (d - 0.50) * 0.85,
        d if d < 2.50 => 0.42,
        _ => 0.0,
    };
    across < half_width
}

/// Returns the occluder of a person at the estimated position.
pub(crate) fn occluder_of_estimate(estimate: &Estimate, frame: &Frame) -> Occluder {
    let covariance = estimate.covariance.fixed_view::<3, 3>(0, 0).into_owned();
    Occluder::new(estimate.region, &estimate.person.position, &covariance, &frame.camera)
}

/// Returns the occluder of a detected person with a known estimate.
pub(crate) fn occluder_of_detection(
    seen: &Detection,
    expected: &Estimate,
    frame: &Frame,
) -> Occluder {
    Occluder::of(seen, &frame.camera).or(occluder_of_estimate(expected, frame))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tagalong_geometry::{ConicalMirror, Panorama, Pinhole};

    use super::*;

    fn camera() -> Camera {
        Camera::mounted(Pinhole::centred(500.0, 640, 480), 640, 480, 1.2, 0.0, 0.0)
    }

    proptest! {
        #[test]
        fn what_shows_is_counted_as_sample_by_sample(
            boxes in prop::collection::vec(
                (prop::array::uniform2(-200.0..800.0f64), 0.0..300.0f64, 0.5..9.0f64), 1..9),
        ) {
            fn at(ahead_m: f64) -> Point3<f64> {
                Point3::new(ahead_m, 0.0, 1.2)
            }

            let camera = camera();
            fn region(([x, y], side, _): &([f64; 2], f64, f64)) -> Rect {
                Rect::new(*x, *y, *side, *side)
            }
            let mut occluders: Vec<Occluder> = Vec::new();
            for b in &boxes[1..] {
                occluders.push(Occluder::new(region(b), &at(b.2), &Matrix3::zeros(), &camera));
            }
            let settings = OcclusionSettings::default();
            let region = region(&boxes[0]);
            let range_m = boxes[0].2;
            let fast = shown(&region, &at(range_m), &occluders, &camera, &settings);
            let nearer = occluders.iter().filter(|c| range_m - c.range_m > settings.min_gap_m);
            let image = Rect::new(0.0, 0.0, 640.0, 480.0);
            let slow = count(&region, &image, &nearer.collect::<Vec<_>>(), &camera);
            prop_assert_eq!(
                [fast.all, fast.inside, fast.visible], [slow.all, slow.inside, slow.visible]
            );
        }
    }

    fn behind(near: Point3<f64>, sigma_m: f64, far: Point3<f64>) -> Visibility {
        let camera = camera();
        let covariance = Matrix3::identity() * (sigma_m * sigma_m);
        let cover = Occluder::new(camera.upper_body(&near), &near, &covariance, &camera);
        let region = camera.upper_body(&far);
        visibility(&region, &far, &[cover], &camera, &OcclusionSettings::default())
    }

    #[test]
    fn a_person_behind_another_is_hidden_and_one_beside_is_not() {
        let near = Point3::new(2.0, 0.0, 1.6);
        assert_eq!(behind(near, 0.05, Point3::new(3.5, 0.0, 1.6)), Visibility::Hidden);
        assert_eq!(behind(near, 0.05, Point3::new(3.5, 1.2, 1.6)), Visibility::Visible);
    }

    #[test]
    fn who_was_seen_without_a_range_hides_from_where_they_are_expected() {
        let near = Point3::new(2.0, 0.0, 1.6);
        let far = Point3::new(3.5, 0.0, 1.6);
        let camera = camera();
        let region = camera.upper_body(&far);
        for (sigmas_m, seen, why) in [
            (&[3.0_f64][..], Visibility::Visible, "the range may be another"),
            (&[3.0, 0.1], Visibility::Hidden, "the second tells the range"),
            (&[0.1, 3.0], Visibility::Hidden, "its own range is told"),
        ] {
            let covers = sigmas_m.iter().map(|sigma_m| {
                let covariance = Matrix3::identity() * (sigma_m * sigma_m);
                Occluder::new(camera.upper_body(&near), &near, &covariance, &camera)
            });
            let cover = covers.reduce(Occluder::or).unwrap();
            let settings = OcclusionSettings::default();
            let found = visibility(&region, &far, &[cover], &camera, &settings);
            assert_eq!(found, seen, "{why}");
        }
    }

    #[test]
    fn nobody_hides_a_person_at_the_same_range_or_nearer() {
        let near = Point3::new(2.0, 0.0, 1.6);
        assert_eq!(behind(near, 0.05, Point3::new(2.2, 0.0, 1.6)), Visibility::Visible);
        assert_eq!(behind(near, 0.05, Point3::new(1.5, 0.0, 1.5)), Visibility::Visible);
        assert_eq!(behind(near, 0.6, Point3::new(3.5, 0.0, 1.6)), Visibility::Visible);
    }

    #[test]
    fn people_hide_each_other_across_the_seam_of_a_panorama() {
        let d = [67.5_f64.to_radians(), 0.05, 8.0, 230.0];
        let mirror = ConicalMirror::new(175.0, [240.0; 2], d).unwrap();
        let camera = Camera {
            lens: Lens::Panorama(Panorama { mirror, columns: 480, rows: 120 }),
            width: 480,
            height: 120,
            robot_from_camera: ConicalMirror::upright(1.3),
        };
        let left = Point3::new(-2.0, 0.02, 1.5);
        let right = Point3::new(-4.0, -0.02, 1.5);
        let starts = [left, right].map(|head| camera.upper_body(&head));
        assert!(starts.iter().all(|region| region.right() > 480.0), "{starts:?}");
        // One starts left of the seam, the other right of it.
        let aside = Point3::new(-4.0, 0.5, 1.5);
        assert!(camera.upper_body(&aside).x < 40.0);
        for (near, far, seen) in [
            (left, right, Visibility::Hidden),
            (left, Point3::new(4.0, 0.0, 1.5), Visibility::Visible),
            (Point3::new(-2.0, 0.18, 1.5), aside, Visibility::Hidden),
        ] {
            let cover = Occluder::new(camera.upper_body(&near), &near, &Matrix3::zeros(), &camera);
            let region = camera.upper_body(&far);
            let settings = OcclusionSettings::default();
            assert_eq!(visibility(&region, &far, &[cover], &camera, &settings), seen, "{far}");
        }
    }

    #[test]
    fn who_left_the_image_is_outside() {
        let near = Point3::new(2.0, 0.0, 1.6);
        assert_eq!(behind(near, 0.05, Point3::new(3.0, 3.0, 1.6)), Visibility::Outside);
        assert_eq!(behind(near, 0.05, Point3::new(-2.0, 0.0, 1.6)), Visibility::Outside);
    }

    /// The expected widths are those of head, neck, shoulders and trunk of a square one unit wide.
    #[test]
    fn a_silhouette_is_a_head_on_shoulders_over_a_trunk() {
        let square = Rect::new(10.0, 20.0, 1.0, 1.0);
        for (across, down, is_on, part) in [
            (0.0, -0.1, false, "air above the head"),
            (0.0, 0.04, false, "air above the head"),
            (0.0, 0.06, true, "the top of the head"),
            (0.16, 0.3, true, "the head"),
            (0.17, 0.3, false, "beside the head"),
            (0.24, 0.6, true, "a shoulder"),
            (0.26, 0.6, false, "shoulders fall away"),
            (0.41, 0.9, true, "the trunk"),
            (0.43, 0.9, false, "beside the trunk"),
            (0.41, 2.4, true, "the end of the trunk"),
            (0.0, 2.6, false, "below the trunk"),
        ] {
            for x in [10.5 + across, 10.5 - across] {
                assert_eq!(is_on_body(&square, Point2::new(x, 20.0 + down)), is_on, "{part}");
            }
        }
    }

    /// Returns the visible part of a person 4 m ahead behind an occluder that begins at a column.
    fn half_hidden(from_column: f64) -> (f64, Visibility) {
        let camera = camera();
        let far = Point3::new(4.0, 0.0, 1.6);
        let region = camera.upper_body(&far);
        let near = Point3::new(2.0, 0.0, 1.6);
        let screen = Rect::new(from_column, region.y - 900.0, 900.0, 900.0);
        let covers = [Occluder::new(screen, &near, &Matrix3::zeros(), &camera)];
        let settings = OcclusionSettings::default();
        (
            part_shown(&region, &far, &covers, &camera, &settings),
            visibility(&region, &far, &covers, &camera, &settings),
        )
    }

    #[test]
    fn of_whom_enough_shows_is_visible() {
        let camera = camera();
        let square = camera.upper_body(&Point3::new(4.0, 0.0, 1.6));
        // The silhouette of the occluder is its trunk: 0.42 of its width to both sides.
        let [(half, seen), (little, hidden), (all, _), (none, _)] = [0.5, 0.4, 2.0, -0.2]
            .map(|part| half_hidden(square.x + part * square.width - 0.08 * 900.0));
        assert!((half - 0.5).abs() < 0.05, "{half}");
        assert_eq!(seen, Visibility::Visible);
        assert!((0.2..0.4).contains(&little), "{little}");
        assert_eq!(hidden, Visibility::Hidden);
        assert_eq!((all, none), (1.0, 0.0));
    }

    #[test]
    fn what_is_outside_of_the_image_is_not_hidden() {
        let camera = camera();
        let settings = OcclusionSettings::default();
        let head = Point3::new(2.0, 1.28, 1.6);
        let region = camera.upper_body(&head);
        assert!(region.x < 0.0 && region.right() > 0.0, "half of them is outside: {region:?}");
        assert_eq!(part_shown(&region, &head, &[], &camera, &settings), 1.0);
        let gone = Rect::new(-500.0, 0.0, 100.0, 100.0);
        assert_eq!(part_shown(&gone, &head, &[], &camera, &settings), 1.0);
        for (x, seen) in [
            (-0.5 * region.width, Visibility::Visible),
            (-0.7 * region.width, Visibility::Outside),
            (640.0 - 0.3 * region.width, Visibility::Outside),
        ] {
            let region = Rect { x, ..region };
            assert_eq!(visibility(&region, &head, &[], &camera, &settings), seen, "{x}");
        }
    }

    #[test]
    fn who_hides_somebody_is_nearer_by_a_gap() {
        fn hides(gap_m: f64, sigma_m: f64) -> bool {
            let near = Point3::new(2.0, 0.0, 1.2);
            behind(near, sigma_m, Point3::new(2.0 + gap_m, 0.0, 1.2)) == Visibility::Hidden
        }

        assert!(hides(0.31, 0.0) && !hides(0.29, 0.0), "0.3 m");
        assert!(hides(0.61, 0.2) && !hides(0.59, 0.2), "three standard deviations");
    }

    #[test]
    fn a_region_without_a_size_shows_nobody() {
        let camera = camera();
        let settings = OcclusionSettings::default();
        let head = Point3::new(3.0, 0.0, 1.6);
        for (width, height, seen) in [
            (50.0, 50.0, Visibility::Visible),
            (0.0, 50.0, Visibility::Outside),
            (50.0, 0.0, Visibility::Outside),
        ] {
            let region = Rect::new(300.0, 100.0, width, height);
            let found = visibility(&region, &head, &[], &camera, &settings);
            assert_eq!(found, seen, "{width} x {height}");
        }
    }

    #[test]
    fn ranges_are_those_from_the_camera() {
        assert!((range_m(&Point3::new(3.0, 0.0, 5.2), &camera()) - 5.0).abs() < 1e-12);
    }
}
