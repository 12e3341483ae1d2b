//! Boxes at the trunk that the depth image shows. The box of a track is placed over the chest,
//! which is assumed straight below the head; a person that leans, turns or carries something has it
//! elsewhere.

use tagalong_core::{DepthImage, Frame, Track};
use tagalong_geometry::Rect;
use tagalong_math::{mean_and_deviation, median};

use crate::SilhouetteSettings;

/// Parts of the height of a box between which the trunk is: below the face, and above the hands.
const ROWS: (f64, f64) = (0.3, 0.9);
/// Of these rows each second one is read.
const ROW_STEP: usize = 2;
/// Half the width of the middle of a box, in widths of the box, in which the trunk gives the depth.
const MIDDLE: f64 = 0.12;
/// A trunk begins this near to the middle of the box, in widths of the box.
const START: f64 = 0.2;
/// Least and largest width of a trunk with its arms, in widths of the box.
const WIDTH: (f64, f64) = (0.4, 1.2);
/// Widest gap in a row, as pixels without depth leave one, in widths of the box.
const GAP: f64 = 0.03;
/// Least number of readings and of rows that show the trunk; fewer may be anything.
const LEAST_READINGS: usize = 20;
const LEAST_ROWS: usize = 5;
/// Least part of the rows that show the trunk.
const LEAST_SHARE: f64 = 0.5;
/// Largest standard deviation of the middle over the rows, in widths of the box.
const MOST_SPREAD: f64 = 0.12;
/// Largest distance of the trunk's middle from that of the box, in widths of the box: beyond it
/// stands another person.
const FARTHEST: f64 = 0.25;
/// Smallest box, pixels.
const SMALLEST_PX: f64 = 24.0;
/// Difference of the trunk's depth from that of the head, up to which it is of this person, m.
const SAME_DEPTH_M: f64 = 0.4;

/// Moves the boxes of the tracks sideways, as far as the depth image shows their trunks. The places in
/// metres, which are those of heads, stay.
pub(crate) fn move_boxes(frame: &Frame, tracks: &mut [Track], settings: &SilhouetteSettings) {
    let Some(depth) = frame.depth().ok().filter(|_| settings.weight > 0.0) else { return };
    for track in tracks {
        let head_m = frame.camera.depth_of(&track.estimate.person.position);
        let region = &mut track.estimate.region;
        if let Some(middle) = trunk_middle(depth, region, head_m, settings.trunk_m) {
            region.x += settings.weight * (middle - region.centre().x);
        }
    }
}

/// Returns the middle column of the trunk in a box: the median over its rows. `None` where the border
/// of the image cuts the box, or the depth image does not show a trunk there.
fn trunk_middle(depth: &DepthImage, region: &Rect, head_m: f64, trunk_m: f64) -> Option<f64> {
    let last = depth.width() as f64 - 1.0;
    let is_inside = region.x > 1.0 && region.right() < last;
    if !is_inside || !region.is_sane() || region.width < SMALLEST_PX {
        return None;
    }
    let first_row = (region.y + ROWS.0 * region.height).max(0.0) as usize;
    let last_row = (region.y + ROWS.1 * region.height).max(0.0) as usize;
    let rows: Vec<&[f32]> = (first_row..last_row.min(depth.height()))
        .step_by(ROW_STEP)
        .map(|row| depth.row(row))
        .collect();
    let near_m = depth_in_middle(&rows, region)?;
    if (near_m - head_m).abs() > SAME_DEPTH_M {
        return None;
    }
    let mut middles = Vec::new();
    for row in &rows {
        middles.extend(middle_of_row(row, region, [near_m - trunk_m, near_m + trunk_m]));
    }
    let least = LEAST_ROWS.max((LEAST_SHARE * rows.len() as f64).ceil() as usize);
    let (_, spread) = mean_and_deviation(&middles).filter(|_| middles.len() >= least)?;
    let middle = median(middles)?;
    let off = (middle - region.centre().x).abs();
    let is_clear = spread <= MOST_SPREAD * region.width && off < FARTHEST * region.width;
    is_clear.then_some(middle)
}

/// Returns the median depth in the middle of a box, m.
fn depth_in_middle(rows: &[&[f32]], region: &Rect) -> Option<f64> {
    let centre = region.centre().x;
    let first = (centre - MIDDLE * region.width).max(0.0) as usize;
    let last = (centre + MIDDLE * region.width) as usize;
    let mut found = Vec::new();
    for row in rows {
        let readings = row[first..last.min(row.len())].iter().copied();
        found.extend(readings.filter(|metres| DepthImage::is_reading(*metres)).map(f64::from));
    }
    if found.len() < LEAST_READINGS { None } else { median(found) }
}

/// Returns the middle of the run of readings between two depths that is in the middle of a box.
fn middle_of_row(row: &[f32], region: &Rect, between_m: [f64; 2]) -> Option<f64> {
    let centre = region.centre().x as usize;
    let reach = (START * region.width) as usize;
    let near = (0..=reach).flat_map(|off| [centre + off, centre.saturating_sub(off)]);
    let start = near.into_iter().find(|column| is_between(row, *column, between_m))?;
    let gap = ((GAP * region.width) as usize).max(2);
    let longest = (WIDTH.1 * region.width) as usize;
    let right = end_of_run(row, start..row.len().min(start + longest), gap, between_m);
    let left = end_of_run(row, (start.saturating_sub(longest)..=start).rev(), gap, between_m);
    let width = (right? - left? + 1) as f64;
    let is_trunk = width > WIDTH.0 * region.width && width < WIDTH.1 * region.width;
    is_trunk.then(|| 0.5 * (left.unwrap_or(0) + right.unwrap_or(0) + 1) as f64)
}

/// Returns the last of some columns before a gap of so many without a reading between two depths.
fn end_of_run(
    row: &[f32],
    columns: impl IntoIterator<Item = usize>,
    gap: usize,
    between_m: [f64; 2],
) -> Option<usize> {
    let mut end = None;
    let mut missing = 0;
    for column in columns {
        if is_between(row, column, between_m) {
            end = Some(column);
            missing = 0;
        } else {
            missing += 1;
        }
        if missing == gap {
            break;
        }
    }
    end
}

fn is_between(row: &[f32], column: usize, [from_m, to_m]: [f64; 2]) -> bool {
    row.get(column).is_some_and(|depth_m| (from_m..to_m).contains(&f64::from(*depth_m)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const WALL_M: f32 = 5.0;
    const TRUNK_M: f32 = 2.5;
    const DEEP_M: f64 = 0.2;

    /// Returns a wall with a trunk before it, between two columns.
    fn shown(left: usize, right: usize) -> DepthImage {
        DepthImage::from_fn(
            320,
            240,
            |x, _| if (left..right).contains(&x) { TRUNK_M } else { WALL_M },
        )
    }

    /// Returns the middle of the trunk in a box of 100 pixels in the middle of the image, of a person
    /// whose head is as near as the trunk.
    fn middle(depth: &DepthImage) -> Option<f64> {
        trunk_middle(depth, &Rect::new(110.0, 60.0, 100.0, 100.0), f64::from(TRUNK_M), DEEP_M)
    }

    #[test]
    fn the_middle_is_that_of_the_edges() {
        assert_eq!(middle(&shown(130, 190)), Some(160.0));
        assert_eq!(middle(&shown(140, 210)), Some(175.0));
        assert_eq!(middle(&shown(112, 192)), Some(152.0));
    }

    #[test]
    fn what_is_no_trunk_of_this_person_moves_nothing() {
        assert_eq!(middle(&shown(140, 178)), None, "too narrow");
        assert_eq!(middle(&shown(90, 230)), None, "too wide, as a wall is");
        assert_eq!(middle(&shown(155, 245)), None, "so far aside that it is somebody else");
        assert_eq!(middle(&shown(0, 0)), None, "a wall far behind the head");
        let hole = DepthImage::filled(320, 240, 0.0);
        assert_eq!(middle(&hole), None, "without depth");
        let seen = shown(130, 190);
        let cut = Rect::new(0.0, 60.0, 320.0, 100.0);
        assert_eq!(trunk_middle(&seen, &cut, 2.5, DEEP_M), None, "cut by the border");
        let small = Rect::new(150.0, 60.0, 20.0, 20.0);
        assert_eq!(trunk_middle(&seen, &small, 2.5, DEEP_M), None, "too small");
        let below = Rect::new(110.0, 500.0, 100.0, 100.0);
        assert_eq!(trunk_middle(&seen, &below, 2.5, DEEP_M), None, "below the image");
        let hidden = Rect::new(110.0, 60.0, 100.0, 100.0);
        assert_eq!(trunk_middle(&seen, &hidden, 3.2, DEEP_M), None, "of somebody nearer");
    }

    #[test]
    fn narrow_gaps_and_single_rows_do_no_harm() {
        let holed = DepthImage::from_fn(320, 240, |x, y| match (x, y) {
            (_, 100) => WALL_M,
            (150..152, _) => 0.0,
            (130..190, _) => TRUNK_M,
            _ => WALL_M,
        });
        assert_eq!(middle(&holed), Some(160.0));
        // Each second row is read, and of those of a shown trunk more than half must show it.
        let half = DepthImage::from_fn(320, 240, |x, y| {
            if (130..190).contains(&x) && y < 118 { TRUNK_M } else { WALL_M }
        });
        assert_eq!(middle(&half), None);
        // An arm that reaches out in some rows is not the middle of the others.
        let waving = DepthImage::from_fn(320, 240, |x, y| {
            let right = if y < 105 { 215 } else { 190 };
            if (130..right).contains(&x) { TRUNK_M } else { WALL_M }
        });
        assert_eq!(middle(&waving), Some(160.0));
    }
}
