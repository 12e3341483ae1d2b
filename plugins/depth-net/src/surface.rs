//! Position and height of a head from the depth image around it.

use std::sync::Arc;

use nalgebra::{Point2, Point3, Vector2, Vector3};
use tagalong_core::{DepthImage, Derived, Frame, Result};
use tagalong_geometry::{Camera, HALF_HEAD_M, HEAD_RADIUS_M, Rect};

/// Half the width of the column around the expected head whose points are taken, m.
const COLUMN_M: f64 = 0.22;
/// Reach of the column above and below the expected centre of the head, m.
const ABOVE_M: f64 = 0.40;
const BELOW_M: f64 = 0.35;
/// Height of a layer of the column, m.
const LAYER_M: f64 = 0.02;
const LAYERS: usize = 38;
/// Least area of the surface in a layer that is part of a head, m²: 8 cm wide.
const LEAST_AREA_M2: f64 = 0.0016;
/// Layers below the top one that must be part of the head, too: 12 cm.
const DEEP_LAYERS: usize = 6;
/// Height of the part of the column whose middle is that of the head, m.
const HEAD_M: f64 = 0.22;
/// Largest number of rows, and of columns, that are read.
const MOST_SAMPLES: usize = 48;
/// A head that is nearer to the camera than this is not measured, m.
const NEAREST_M: f64 = 0.3;
/// Largest difference in depth between the points of a head and its expected surface, m.
const SAME_PERSON_M: f64 = 0.5;
/// A head nearer than this to where the readings of the image end may be cut off, m.
const BORDER_M: f64 = 0.04;

/// Part of a depth image that has readings: registration to a colour image leaves borders without
/// any. It is the same for all queries about a frame.
pub(crate) struct Readings(Rect);

impl Derived for Readings {
    fn derive(frame: &Frame) -> Result<Self> {
        Ok(Self::new(frame.depth()?))
    }
}

impl Readings {
    /// Finds the borders of the readings.
    fn new(depth: &DepthImage) -> Self {
        let width = depth.width();
        let height = depth.height();
        let top = (0..height).find(|y| has_row(depth, *y)).unwrap_or(height);
        let left = (0..width).find(|x| has_column(depth, *x)).unwrap_or(width);
        let right = (left..width).rfind(|x| has_column(depth, *x)).unwrap_or(left);
        Self(Rect::new(left as f64, top as f64, (right - left) as f64, (height - top) as f64))
    }
}

/// Depth image of a frame, with the part of it that has readings.
pub(crate) struct Surface<'a> {
    depth: &'a DepthImage,
    camera: &'a Camera,
    readings: Arc<Readings>,
}

impl<'a> Surface<'a> {
    /// Takes the depth image of a frame.
    ///
    /// # Errors
    /// [`tagalong_core::Error::MissingImage`] for a frame without depth.
    pub(crate) fn new(frame: &'a Frame) -> Result<Self> {
        let readings = frame.derived::<Readings>()?;
        Ok(Self { depth: frame.depth()?, camera: &frame.camera, readings })
    }

    /// Measures the head of a person near `expected`, the centre of the head in the robot frame, m:
    /// its top is the topmost surface of the points around it, and it is a radius behind their
    /// middle. `None` if the points do not show the top of a head: too few, cut off where the
    /// readings end, or continued by something above it.
    pub(crate) fn head(&self, expected: &Point3<f64>) -> Option<Point3<f64>> {
        let window = self.window(expected)?;
        let mut areas = [0.0; LAYERS];
        for sample in self.samples(&window, expected) {
            sample.add_to(&mut areas, expected.z - BELOW_M);
        }
        let top_m = expected.z - BELOW_M + top_of(&areas)?;
        let middle = self.middle(self.samples(&window, expected), top_m)?;
        let place = if self.shows_sides(&middle, top_m) { middle } else { expected.xy() };
        let head = Point3::new(place.x, place.y, top_m - HALF_HEAD_M);
        self.shows_top(&head).then_some(head)
    }

    /// Returns the pixels around an expected head; `None` for one outside of the image.
    fn window(&self, expected: &Point3<f64>) -> Option<Window> {
        let centre = self.camera.project(expected)?;
        let near_m = self.camera.depth_of(expected) - HEAD_RADIUS_M;
        if near_m < NEAREST_M {
            return None;
        }
        let px_per_m = self.camera.focal_px() / near_m;
        // The column leans where the camera does.
        let across = 1.5 * COLUMN_M * px_per_m;
        let top = centre.y - 1.2 * ABOVE_M * px_per_m;
        let bottom = centre.y + 1.2 * BELOW_M * px_per_m;
        Some(Window {
            near_m,
            columns: samples(centre.x - across, centre.x + across, self.depth.width())?,
            rows: samples(top, bottom, self.depth.height())?,
        })
    }

    /// Returns the samples of the depth image in the column around an expected head.
    fn samples(&self, window: &Window, expected: &Point3<f64>) -> impl Iterator<Item = Sample> {
        let Window { near_m, columns, rows } = *window;
        let axis = expected.xy();
        let focal_px = self.camera.focal_px();
        let across = columns.step() as f64 / focal_px;
        let down = rows.step() as f64 / focal_px;
        let pixels = rows.positions().flat_map(move |y| columns.positions().map(move |x| (x, y)));
        pixels.filter_map(move |(x, y)| {
            let depth_m = f64::from(self.depth.row(y)[x]);
            // Points of other things and missing readings are left out before the arithmetic.
            let is_near = (depth_m - near_m).abs() <= SAME_PERSON_M;
            if !is_near {
                return None;
            }
            let point = self.camera.back_project(Point2::new(x as f64, y as f64), depth_m);
            let is_inside = (point.xy() - axis).norm() <= COLUMN_M;
            let size_m = [across * depth_m, down * depth_m];
            is_inside.then_some(Sample { point, size_m })
        })
    }

    /// Returns the middle, on the floor, of a head below its top: a radius behind its surface.
    fn middle(&self, samples: impl Iterator<Item = Sample>, top_m: f64) -> Option<Point2<f64>> {
        let mut sum = Vector2::zeros();
        let mut all_m2 = 0.0;
        for sample in samples {
            let point = sample.point;
            let area_m2 = sample.area_m2();
            if point.z <= top_m + LAYER_M && point.z >= top_m - HEAD_M {
                sum += point.coords.xy() * area_m2;
                all_m2 += area_m2;
            }
        }
        if all_m2 <= 0.0 {
            return None;
        }
        let surface = sum / all_m2;
        let eye = self.camera.robot_from_camera.translation.vector.xy();
        let away = (surface - eye).try_normalize(1e-6)?;
        Some(Point2::from(surface + away * HEAD_RADIUS_M))
    }

    /// Returns true if the image could have readings above a head.
    fn shows_top(&self, head: &Point3<f64>) -> bool {
        let above = head + Vector3::new(0.0, 0.0, HALF_HEAD_M + BORDER_M);
        self.camera.project(&above).is_some_and(|at| at.y >= self.readings.0.y)
    }

    /// Returns true if the image could have readings on both sides of a head.
    fn shows_sides(&self, middle: &Point2<f64>, top_m: f64) -> bool {
        let head = Point3::new(middle.x, middle.y, top_m - HALF_HEAD_M);
        let half_px =
            (HALF_HEAD_M + BORDER_M) * self.camera.focal_px() / self.camera.depth_of(&head);
        self.camera.project(&head).is_some_and(|at| {
            at.x - half_px >= self.readings.0.x && at.x + half_px <= self.readings.0.right()
        })
    }
}

/// Returns whether a row of an image has readings.
fn has_row(depth: &DepthImage, y: usize) -> bool {
    let step = depth.width() / MOST_SAMPLES + 1;
    has_readings(depth.row(y).iter().step_by(step))
}

/// Returns whether a column of an image has readings.
fn has_column(depth: &DepthImage, x: usize) -> bool {
    let step = depth.height() / MOST_SAMPLES + 1;
    has_readings(depth.pixels().iter().skip(x).step_by(step * depth.width()))
}

/// Returns true if at least a twentieth of the pixels of a row or column has readings; noise alone
/// makes no row.
fn has_readings<'a>(pixels: impl Iterator<Item = &'a f32>) -> bool {
    let mut all = 0;
    let mut valid = 0;
    for depth_m in pixels {
        all += 1;
        valid += usize::from(depth_m.is_finite());
    }
    20 * valid >= all.max(1)
}

/// Pixels around an expected head.
struct Window {
    /// Expected depth of the head's surface, m.
    near_m: f64,
    columns: Samples,
    rows: Samples,
}

/// Pixels along one axis of the image, at equal steps.
#[derive(Clone, Copy)]
struct Samples {
    first: usize,
    last: usize,
}

impl Samples {
    fn step(self) -> usize {
        (self.last - self.first) / MOST_SAMPLES + 1
    }

    fn positions(self) -> impl Iterator<Item = usize> {
        (self.first..=self.last).step_by(self.step())
    }
}

/// Returns the pixels between two positions that are inside an image of this size.
fn samples(from: f64, to: f64, size: usize) -> Option<Samples> {
    let last = to.min(size as f64 - 1.0);
    let first = from.max(0.0);
    (first <= last).then_some(Samples { first: first as usize, last: last as usize })
}

/// Piece of the surface that one sample stands for.
#[derive(Clone, Copy)]
struct Sample {
    /// Middle in the robot frame, m.
    point: Point3<f64>,
    /// Width and height, m.
    size_m: [f64; 2],
}

impl Sample {
    fn area_m2(&self) -> f64 {
        self.size_m[0] * self.size_m[1]
    }

    /// Adds the area to the layers above a height, m: far away a pixel is as high as a layer, so it
    /// is shared among those that it touches.
    fn add_to(&self, areas_m2: &mut [f64; LAYERS], lowest_m: f64) {
        let bottom = (self.point.z - 0.5 * self.size_m[1] - lowest_m) / LAYER_M;
        let top = bottom + self.size_m[1] / LAYER_M;
        let first = bottom.max(0.0) as usize;
        let end = (top.max(0.0).ceil() as usize).min(LAYERS);
        for (layer, area_m2) in areas_m2.iter_mut().enumerate().take(end).skip(first) {
            let shared = top.min(layer as f64 + 1.0) - bottom.max(layer as f64);
            *area_m2 += self.size_m[0] * LAYER_M * shared.max(0.0);
        }
    }
}

/// Returns the height of a head's top above the lower end of the column, m, from the area of each
/// layer, m²; `None` if no head ends within the column.
fn top_of(areas: &[f64; LAYERS]) -> Option<f64> {
    let top = (DEEP_LAYERS..LAYERS).rev().find(|top| {
        areas[top - DEEP_LAYERS..=*top].iter().all(|area_m2| *area_m2 >= LEAST_AREA_M2)
    })?;
    // Something goes on above: a wall, a door, a person behind.
    if top + 2 >= LAYERS {
        return None;
    }
    // Hair and noise make the last layer thin, so the top is where its area would end.
    let beyond = (areas[top + 1] / LEAST_AREA_M2).min(1.0);
    Some(LAYER_M * ((top + 1) as f64 + 0.5 * beyond))
}

#[cfg(test)]
mod tests {
    use tagalong_geometry::Pinhole;

    use super::*;

    const WIDTH: usize = 320;
    const HEIGHT: usize = 240;

    fn camera() -> Camera {
        Camera::mounted(Pinhole::centred(260.0, WIDTH, HEIGHT), WIDTH, HEIGHT, 1.2, 0.1, 0.0)
    }

    /// A ball on a pillar, which are a head and a body, in front of a wall at `wall_m`; pixels for
    /// which `is_read` is false have no reading.
    fn person(
        head: &Point3<f64>,
        wall_m: f64,
        is_read: impl Fn(usize, usize) -> bool,
    ) -> DepthImage {
        let camera = camera();
        DepthImage::from_fn(WIDTH, HEIGHT, |x, y| {
            if !is_read(x, y) {
                return f32::NAN;
            }
            let pixel = Point2::new(x as f64, y as f64);
            // Along the ray, nearest first.
            let mut depths_m = (0..120).map(|step| head.x - 0.3 + 0.005 * f64::from(step));
            depths_m
                .find(|depth_m| {
                    let off = camera.back_project(pixel, *depth_m) - head;
                    let is_body = off.z < -0.05 && off.xy().norm() < 0.09;
                    off.norm() < HALF_HEAD_M || is_body
                })
                .unwrap_or(wall_m) as f32
        })
    }

    fn measured(expected: Point3<f64>, depth: &DepthImage) -> Option<Point3<f64>> {
        let readings = Arc::new(Readings::new(depth));
        Surface { depth, camera: &camera(), readings }.head(&expected)
    }

    #[test]
    fn a_head_is_where_its_surface_is_wherever_it_was_expected() {
        for height_m in [1.05, 1.4, 1.75] {
            let head = Point3::new(3.0, 0.2, height_m);
            let depth = person(&head, 8.0, |_, _| true);
            for off in [[0.0, 0.0, 0.0], [0.05, -0.06, 0.12], [-0.05, 0.06, -0.12]] {
                let found = measured(head + Vector3::from(off), &depth).unwrap();
                assert!((found.z - head.z).abs() < 0.025, "{off:?}: {found}, not {head}");
                assert!((found.xy() - head.xy()).norm() < 0.05, "{off:?}: {found}, not {head}");
            }
        }
    }

    /// Registration leaves the upper rows, or the columns of one side, without readings.
    #[test]
    fn a_head_that_is_cut_off_where_the_readings_end_is_not_measured_there() {
        let head = Point3::new(3.0, 0.2, 1.6);
        let at = camera().project(&head).unwrap();
        let top = camera().project(&(head + Vector3::new(0.0, 0.0, HALF_HEAD_M))).unwrap().y;
        let cut = person(&head, 8.0, |_, y| y as f64 >= top - 1.0);
        assert_eq!(measured(head, &cut), None);
        let below = person(&head, 8.0, |_, y| y as f64 >= top - 8.0);
        assert!(measured(head, &below).is_some());
        let half = person(&head, 8.0, |x, _| x as f64 >= at.x);
        let found = measured(head, &half).unwrap();
        assert_eq!(found.xy(), head.xy(), "half a face is not in the middle");
        // A head and its border reach 13 pixels to each side.
        for is_read in [|x: f64| x >= -10.0, |x: f64| x <= 10.0] {
            let most = person(&head, 8.0, |x, _| is_read(x as f64 - at.x));
            assert_eq!(measured(head, &most).unwrap().xy(), head.xy(), "an ear is cut off");
        }
        assert!((found.z - head.z).abs() < 0.06, "{found}");
    }

    /// The room behind is farther away than the camera measures.
    #[test]
    fn a_head_before_no_readings_is_measured() {
        let head = Point3::new(3.0, 0.2, 1.6);
        let whole = person(&head, 8.0, |_, _| true);
        let alone = whole.map(|depth_m| if depth_m < 7.0 { depth_m } else { f32::NAN });
        // Walls on both sides show that the rows have readings.
        let lit = DepthImage::from_fn(WIDTH, HEIGHT, |x, y| {
            if !(60..260).contains(&x) { 4.0 } else { alone.row(y)[x] }
        });
        assert_eq!(measured(head, &lit), measured(head, &whole));
    }

    #[test]
    fn an_area_is_shared_among_the_layers_that_it_touches() {
        let size_m = [0.02, 1.5 * LAYER_M];
        let sample = Sample { point: Point3::new(2.0, 0.0, 3.0 * LAYER_M), size_m };
        let mut areas_m2 = [0.0; LAYERS];
        sample.add_to(&mut areas_m2, 0.0);
        // From 2.25 to 3.75 layers.
        let parts = [0.0, 0.0, 0.75, 0.75, 0.0].map(|part| part * 0.02 * LAYER_M);
        for (area_m2, expected_m2) in areas_m2.iter().zip(parts) {
            assert!((area_m2 - expected_m2).abs() < 1e-12, "{areas_m2:?}");
        }
        let sum_m2: f64 = areas_m2.iter().sum();
        assert!((sum_m2 - sample.area_m2()).abs() < 1e-12, "nothing of it is lost: {sum_m2}");
    }

    #[test]
    fn a_head_ends_where_its_last_thin_layer_does() {
        fn top(layers: std::ops::Range<usize>, above: f64) -> Option<f64> {
            let mut areas = [0.0; LAYERS];
            areas[layers.clone()].fill(2.0 * LEAST_AREA_M2);
            areas[layers.end] = above * LEAST_AREA_M2;
            top_of(&areas)
        }

        for (above, beyond) in [(0.0, 0.0), (0.4, 0.2), (0.9, 0.45)] {
            let found = top(10..20, above).unwrap() / LAYER_M;
            assert!((found - 20.0 - beyond).abs() < 1e-9, "{above}: {found}");
        }
        assert!(top(10..17, 0.0).is_some(), "12 cm below the top layer");
        assert_eq!(top(10..16, 0.0), None, "too flat");
        assert!(top(10..LAYERS - 2, 0.0).is_some());
        assert_eq!(top(10..LAYERS - 1, 0.0), None, "it may go on above");
    }

    #[test]
    fn the_readings_of_a_small_image_end_where_it_does() {
        let all = Readings::new(&DepthImage::filled(30, 20, 2.0));
        assert_eq!(all.0, Rect::new(0.0, 0.0, 29.0, 20.0));
        let some = DepthImage::from_fn(30, 20, |x, y| {
            if (4..25).contains(&x) && y >= 3 { 2.0 } else { f32::NAN }
        });
        assert_eq!(Readings::new(&some).0, Rect::new(4.0, 3.0, 20.0, 17.0));
    }

    #[test]
    fn what_does_not_end_above_the_head_is_no_head() {
        let wall = DepthImage::filled(WIDTH, HEIGHT, 2.95);
        assert_eq!(measured(Point3::new(3.0, 0.0, 1.4), &wall), None);
        let nothing = DepthImage::filled(WIDTH, HEIGHT, f32::NAN);
        assert_eq!(measured(Point3::new(3.0, 0.0, 1.4), &nothing), None);
        let far = DepthImage::filled(WIDTH, HEIGHT, 8.0);
        assert_eq!(measured(Point3::new(3.0, 0.0, 1.4), &far), None);
        assert_eq!(measured(Point3::new(-3.0, 0.0, 1.4), &far), None, "behind the camera");
        let empty = DepthImage::filled(0, 0, 0.0);
        assert_eq!(measured(Point3::new(3.0, 0.0, 1.4), &empty), None);
    }
}
