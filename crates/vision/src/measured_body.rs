use nalgebra::Point2;
use tagalong_core::DepthImage;
use tagalong_geometry::{
    Camera, HALF_HEAD_M, HEAD_BELOW_TOP_M, HEAD_RADIUS_M, Lens, Rect, UPPER_BODY_SIDE_M,
};
use tagalong_math::median;

/// Distance of a box from the border of the image up to which it may be cut off, pixels.
pub(crate) const CUT_OFF_PX: f64 = 3.0;
/// Depth range of the trunk of a person and the arms in front of it, m.
const TRUNK_DEPTH_M: f64 = 0.4;
/// Fraction of the width of a box, in its middle, that contains the trunk.
const TRUNK_WIDTH: f64 = 0.4;
/// Fractions of the height of a box between which the trunk lies.
const TRUNK_ROWS: (f64, f64) = (0.1, 0.6);
/// Range below the top of the head, m, in which a head is wider than the thin end of long hair.
const HEAD_ROWS_M: (f64, f64) = (0.04, 0.2);
/// Fractions of the height of a box between which the head of a hidden body lies, ...
const HIDDEN_HEAD_ROWS: (f64, f64) = (0.02, 0.12);
/// ... and fraction of the width.
const HIDDEN_HEAD_WIDTH: f64 = 0.3;
/// Height of the tallest people, as a multiple of the assumed height.
const TALLEST: f64 = 1.3;
/// A head fills at least one part in this number of the area below the upper edge of a box.
const HEAD_PART: usize = 8;
/// Width of a head, m.
const HEAD_WIDTH_M: f64 = 0.16;
/// Minimum number of readings on the trunk.
const LEAST_READINGS: usize = 20;
/// Maximum number of readings along each side of an area: more of them add no information.
const SAMPLES: f64 = 40.0;

/// Upper body of a person, measured in the depth image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MeasuredBody {
    /// Square of head and shoulders.
    pub upper_body: Rect,
    /// Depth of the face, m.
    pub face_m: f64,
}

/// Reading of a depth image.
#[derive(Clone, Copy)]
struct Reading {
    column: f64,
    row: f64,
    depth_m: f64,
}

impl MeasuredBody {
    /// Measures the person of this height, m, in the box around a whole body, or around the part of
    /// it that is in the image. `None` without depth on the trunk, and for lenses that are not
    /// perspective.
    ///
    /// The depth of the trunk gives the scale, so that hidden or cut-off feet or legs do not
    /// matter. The head consists of the readings below the upper edge of the box that are as near
    /// as the trunk, or farther if something hides the trunk. A head above the image is placed
    /// where a standing person has it.
    pub fn in_box(
        camera: &Camera,
        depth: &DepthImage,
        whole: &Rect,
        height_m: f64,
    ) -> Option<Self> {
        if !matches!(camera.lens, Lens::Pinhole(_)) || !whole.is_sane() {
            return None;
        }
        let shown = whole.clipped(depth.width(), depth.height());
        let trunk = trunk(&readings(depth, &trunk_area(&shown)))?;
        let trunk_m = median(trunk.iter().map(|reading| reading.depth_m))?;
        if whole.y < CUT_OFF_PX {
            return Self::below_border(camera, &trunk, height_m);
        }
        let head = head_near(camera, depth, whole, trunk_m)
            .or_else(|| head_behind(camera, depth, whole, trunk_m, height_m));
        let face_m = head.map_or(trunk_m, |head| head.depth_m);
        let px_per_m = camera.focal_px() / face_m;
        let side = UPPER_BODY_SIDE_M * px_per_m;
        let top = whole.y - (HEAD_BELOW_TOP_M - HALF_HEAD_M) * px_per_m;
        let left = head.map_or(whole.centre().x, |head| head.column) - 0.5 * side;
        Some(Self { upper_body: Rect::new(left, top, side, side), face_m })
    }

    /// Returns the upper body of a person whose head may be cut off by the upper border of the
    /// image.
    fn below_border(camera: &Camera, trunk: &[Reading], height_m: f64) -> Option<Self> {
        let Reading { column, row, depth_m } = middle(trunk)?;
        let mut head = camera.back_project(Point2::new(column, row), depth_m + HEAD_RADIUS_M);
        head.z = height_m - HALF_HEAD_M;
        let face_m = camera.depth_of(&head) - HEAD_RADIUS_M;
        Some(Self { upper_body: camera.upper_body(&head), face_m })
    }
}

/// Returns the medians of some readings; `None` without readings.
fn middle(readings: &[Reading]) -> Option<Reading> {
    Some(Reading {
        column: median(readings.iter().map(|reading| reading.column))?,
        row: median(readings.iter().map(|reading| reading.row))?,
        depth_m: median(readings.iter().map(|reading| reading.depth_m))?,
    })
}

/// Returns the head below the upper edge of a box that is as near as the trunk.
fn head_near(camera: &Camera, depth: &DepthImage, whole: &Rect, trunk_m: f64) -> Option<Reading> {
    let area = head_area(whole, camera.focal_px() / trunk_m);
    let all = readings(depth, &area.clipped(depth.width(), depth.height()));
    let mut head = all.clone();
    head.retain(|reading| (reading.depth_m - trunk_m).abs() < 0.5 * TRUNK_DEPTH_M);
    let is_seen = head.len() >= LEAST_READINGS.max(all.len() / HEAD_PART);
    middle(&head).filter(|_| is_seen)
}

/// Returns the head at the upper edge of a box whose middle shows another person or an object.
fn head_behind(
    camera: &Camera,
    depth: &DepthImage,
    whole: &Rect,
    before_m: f64,
    height_m: f64,
) -> Option<Reading> {
    let (first, last) = HIDDEN_HEAD_ROWS;
    let width = HIDDEN_HEAD_WIDTH * whole.width;
    let top = whole.y + first * whole.height;
    let area = Rect::new(whole.centre().x - 0.5 * width, top, width, (last - first) * whole.height);
    let all = readings(depth, &area.clipped(depth.width(), depth.height()));
    let head = trunk(&all)?;
    let middle = middle(&head)?;
    // The wall beside a head is so far away that the person would be a giant.
    let shown_m = whole.height * middle.depth_m / camera.focal_px();
    let is_head = 2 * head.len() > all.len() && shown_m < TALLEST * height_m;
    (is_head && middle.depth_m > before_m).then_some(middle)
}

fn trunk_area(shown: &Rect) -> Rect {
    let (first, last) = TRUNK_ROWS;
    let width = TRUNK_WIDTH * shown.width;
    let left = shown.centre().x - 0.5 * width;
    Rect::new(left, shown.y + first * shown.height, width, (last - first) * shown.height)
}

/// Returns the area below the upper edge of a box that contains the head, whichever way the person
/// leans.
fn head_area(whole: &Rect, px_per_m: f64) -> Rect {
    let (first, last) = HEAD_ROWS_M;
    let beside = 0.5 * HEAD_WIDTH_M * px_per_m;
    let top = whole.y + first * px_per_m;
    Rect::new(whole.x - beside, top, whole.width + 2.0 * beside, (last - first) * px_per_m)
}

/// Returns evenly spaced readings of an area inside of the image.
fn readings(depth: &DepthImage, area: &Rect) -> Vec<Reading> {
    fn step(size: f64) -> usize {
        (size / SAMPLES).ceil().max(1.0) as usize
    }

    let columns = area.x as usize..(area.right() as usize).min(depth.width());
    let rows = area.y as usize..(area.bottom() as usize).min(depth.height());
    let mut found = Vec::new();
    for y in rows.step_by(step(area.height)) {
        let row = depth.row(y);
        for x in columns.clone().step_by(step(area.width)) {
            let depth_m = f64::from(row[x]);
            if depth_m > 0.0 && depth_m.is_finite() {
                found.push(Reading { column: x as f64, row: y as f64, depth_m });
            }
        }
    }
    found
}

/// Returns the readings within the depth range of a trunk that contains most of them; `None` if
/// these are too few.
fn trunk(readings: &[Reading]) -> Option<Vec<Reading>> {
    let mut sorted = readings.to_vec();
    sorted.sort_by(|a, b| a.depth_m.total_cmp(&b.depth_m));
    let mut best = 0..0;
    let mut last = 0;
    for (first, nearest) in sorted.iter().enumerate() {
        while last < sorted.len() && sorted[last].depth_m <= nearest.depth_m + TRUNK_DEPTH_M {
            last += 1;
        }
        if last - first > best.len() {
            best = first..last;
        }
    }
    (best.len() >= LEAST_READINGS).then(|| sorted[best].to_vec())
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;
    use tagalong_geometry::{Distortion, Pinhole};

    use super::*;

    fn camera() -> Camera {
        let lens =
            Pinhole { fx: 520.0, fy: 520.0, cx: 319.5, cy: 239.5, distortion: Distortion::None };
        Camera::mounted(lens, 640, 480, 1.2, 0.0, 0.0)
    }

    /// A wall at 6 m, and a person of boards at a depth: a head at a column, and a body below it.
    fn person(depth_m: f64, head_column: f64, top_row: f64) -> DepthImage {
        let px_per_m = 520.0 / depth_m;
        DepthImage::from_fn(640, 480, |x, y| {
            let below_m = (y as f64 - top_row) / px_per_m;
            let aside_m = (x as f64 - head_column).abs() / px_per_m;
            let is_head = (0.0..0.25).contains(&below_m) && aside_m < 0.08;
            let is_body = below_m >= 0.25 && aside_m < 0.25;
            if is_head || is_body { depth_m as f32 } else { 6.0 }
        })
    }

    /// The part of a person that is in the image from the top of the head to a row.
    fn boxed(depth_m: f64, head_column: f64, top_row: f64, bottom_row: f64) -> Rect {
        let half = 0.25 * 520.0 / depth_m;
        Rect::new(head_column - half, top_row, 2.0 * half, bottom_row - top_row)
    }

    #[test]
    fn legs_that_are_not_seen_do_not_change_the_scale() {
        let depth = person(3.0, 320.0, 150.0);
        for bottom in [300.0, 380.0, 450.0] {
            let whole = boxed(3.0, 320.0, 150.0, bottom);
            let found = MeasuredBody::in_box(&camera(), &depth, &whole, 1.7).unwrap();
            assert_eq!(found.face_m, 3.0);
            let expected = Rect::new(320.0 - 49.4, 150.0 - 4.33, 98.8, 98.8);
            assert!(found.upper_body.iou(&expected) > 0.97, "{bottom}: {:?}", found.upper_body);
        }
    }

    #[test]
    fn the_square_is_around_the_head_wherever_it_is_in_the_box() {
        let depth = person(2.5, 280.0, 120.0);
        // An arm to the right makes the box wider.
        let whole = boxed(2.5, 280.0, 120.0, 440.0);
        let wider = Rect { width: whole.width + 60.0, ..whole };
        let found = MeasuredBody::in_box(&camera(), &depth, &wider, 1.7).unwrap();
        assert!((found.upper_body.centre().x - 280.0).abs() < 3.0, "{:?}", found.upper_body);
    }

    #[test]
    fn the_trunk_is_in_the_middle_of_the_box() {
        let area = trunk_area(&Rect::new(100.0, 50.0, 80.0, 200.0));
        assert!((area.centre().x - 140.0).abs() < 1e-9, "{area:?}");
        assert!((area.width - TRUNK_WIDTH * 80.0).abs() < 1e-9, "{area:?}");
        let (first, last) = TRUNK_ROWS;
        assert!((area.y - (50.0 + first * 200.0)).abs() < 1e-9, "{area:?}");
        assert!((area.bottom() - (50.0 + last * 200.0)).abs() < 1e-9, "{area:?}");
    }

    #[test]
    fn a_desk_before_the_legs_is_not_the_person() {
        let mut depth = person(3.0, 320.0, 150.0);
        depth.pixels_mut()[320 * 640..].fill(1.5);
        let whole = boxed(3.0, 320.0, 150.0, 440.0);
        let found = MeasuredBody::in_box(&camera(), &depth, &whole, 1.7).unwrap();
        assert_eq!(found.face_m, 3.0);
    }

    #[test]
    fn a_head_above_the_image_is_where_a_standing_person_has_it() {
        // The camera is at 1.2 m and sees up to 0.46 m higher at 1 m.
        let depth = person(1.0, 200.0, -40.0);
        let whole = boxed(1.0, 200.0, 0.0, 479.0);
        let found = MeasuredBody::in_box(&camera(), &depth, &whole, 1.7).unwrap();
        let expected = camera().upper_body(&Point3::new(1.0 + HEAD_RADIUS_M, 0.2482, 1.585));
        assert!(found.upper_body.iou(&expected) > 0.95, "{:?} {expected:?}", found.upper_body);
        assert!((found.face_m - 1.0).abs() < 1e-6, "{}", found.face_m);
    }

    #[test]
    fn a_head_behind_another_person_is_at_its_own_depth() {
        // A person at 2 m hides all of another one at 3 m but the head.
        let mut depth = person(3.0, 320.0, 150.0);
        for row in 200..480 {
            depth.pixels_mut()[row * 640 + 250..row * 640 + 400].fill(2.0);
        }
        let whole = boxed(3.0, 320.0, 150.0, 440.0);
        let found = MeasuredBody::in_box(&camera(), &depth, &whole, 1.7).unwrap();
        assert_eq!(found.face_m, 3.0);
        // Without the head there is the wall alone.
        let mut hidden = depth.clone();
        hidden.pixels_mut()[..200 * 640].fill(6.0);
        let found = MeasuredBody::in_box(&camera(), &hidden, &whole, 1.7).unwrap();
        assert_eq!(found.face_m, 2.0);
    }

    #[test]
    fn without_depth_on_the_trunk_nothing_is_measured() {
        let nothing = DepthImage::filled(640, 480, f32::NAN);
        let whole = boxed(3.0, 320.0, 150.0, 450.0);
        assert_eq!(MeasuredBody::in_box(&camera(), &nothing, &whole, 1.7), None);
        let beside = Rect::new(700.0, 100.0, 50.0, 170.0);
        let depth = person(3.0, 320.0, 150.0);
        assert_eq!(MeasuredBody::in_box(&camera(), &depth, &beside, 1.7), None);
        let odd = Rect::new(f64::NAN, 100.0, 50.0, f64::INFINITY);
        assert_eq!(MeasuredBody::in_box(&camera(), &depth, &odd, 1.7), None);
    }
}
