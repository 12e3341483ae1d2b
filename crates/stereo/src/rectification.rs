//! Checks that a pair is rectified and not swapped.
//!
//! A matcher only searches along rows and to one side, so that it cannot detect either mistake.
//! Therefore some distinct points of the left image are searched for in all directions.

use tagalong_core::GreyImage;

/// Half the side of the patch around a point, px.
const RADIUS: usize = 5;
/// Vertical search range, px.
const UP_DOWN: i32 = 4;
/// Columns and rows of cells, from each of which one point is taken.
const CELLS: (usize, usize) = (8, 6);
/// Minimum number of matched points for a result.
const MIN_POINTS: usize = 8;
/// Minimum mean change of brightness across a patch, in both directions.
const MIN_TEXTURE: u32 = 4;
/// Maximum cost of the best match relative to any other one.
const DISTINCT: f32 = 0.7;

/// Relative position of the images of a pair.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Rectification {
    /// Number of points of the left image that were found in the right one.
    pub points: usize,
    /// Median offset downwards in the right image, px; 0 if there are too few points.
    pub vertical_px: f64,
    /// Fraction of the points that are further right in the right image, which is impossible unless
    /// the images are swapped.
    pub reversed: f64,
}

impl Rectification {
    /// Measures a pair of images of the same size.
    pub fn measure(left: &GreyImage, right: &GreyImage, max_disparity: usize) -> Self {
        let found: Vec<Shift> =
            points(left).filter_map(|p| find(left, right, p, max_disparity as i32)).collect();
        if found.len() < MIN_POINTS {
            return Self { points: found.len(), ..Self::default() };
        }
        let mut down: Vec<f64> = found.iter().map(|s| s.down).collect();
        down.sort_by(f64::total_cmp);
        // One pixel of tolerance: points at infinity have disparity 0 and noise.
        let reversed = found.iter().filter(|s| s.left < -1).count();
        Self {
            points: found.len(),
            vertical_px: down[down.len() / 2],
            reversed: reversed as f64 / found.len() as f64,
        }
    }

    /// Returns true if the left image is from the right camera.
    pub fn is_swapped(&self) -> bool {
        self.points >= MIN_POINTS && self.reversed > 0.5
    }
}

/// Position of a point in the right image relative to the left one, px.
struct Shift {
    left: i32,
    down: f64,
}

/// Yields the point with the most texture in both directions, of each cell.
fn points(image: &GreyImage) -> impl Iterator<Item = (usize, usize)> {
    let border = RADIUS + UP_DOWN as usize;
    let width = image.width().saturating_sub(2 * border);
    let height = image.height().saturating_sub(2 * border);
    let columns = CELLS.0.min(width);
    let rows = CELLS.1.min(height);
    (0..columns * rows).filter_map(move |cell| {
        let column = cell % columns;
        let row = cell / columns;
        // Every fourth pixel is enough to find a textured one.
        let xs = (column * width / columns..(column + 1) * width / columns).step_by(4);
        let ys = (row * height / rows..(row + 1) * height / rows).step_by(4);
        let all = ys.flat_map(|y| xs.clone().map(move |x| (x + border, y + border)));
        let best = all.map(|p| (texture(image, p), p)).max_by_key(|(texture, _)| *texture)?;
        (best.0 >= MIN_TEXTURE).then_some(best.1)
    })
}

/// Returns the mean change from pixel to pixel, in the direction with the smaller one.
fn texture(image: &GreyImage, (x, y): (usize, usize)) -> u32 {
    let mut across = 0;
    let mut down = 0;
    for row in y - RADIUS..=y + RADIUS {
        let this = image.row(row);
        let next = image.row(row + 1);
        for column in x - RADIUS..=x + RADIUS {
            across += u32::from(this[column].abs_diff(this[column + 1]));
            down += u32::from(this[column].abs_diff(next[column]));
        }
    }
    across.min(down) / (2 * RADIUS as u32 + 1).pow(2)
}

/// Searches for a point of the left image; `None` unless one match is clearly the best.
fn find(left: &GreyImage, right: &GreyImage, (x, y): (usize, usize), reach: i32) -> Option<Shift> {
    let radius = RADIUS as i32;
    let shifts: Vec<i32> = (-reach..=reach)
        .filter(|s| (radius..right.width() as i32 - radius).contains(&(x as i32 - s)))
        .collect();
    let rows = -UP_DOWN..=UP_DOWN;
    let pair = [left, right];
    let all: Vec<(f32, i32, i32)> = rows
        .flat_map(|down| shifts.iter().map(move |shift| (*shift, down)))
        .map(|(shift, down)| (cost_of_shift(pair, (x, y), shift, down), shift, down))
        .collect();
    let best = *all.iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    // Matches beside the best one belong to the same minimum and are not rivals.
    let rival = all
        .iter()
        .filter(|c| (c.1 - best.1).abs() > 2 || (c.2 - best.2).abs() > 2)
        .map(|c| c.0)
        .fold(f32::INFINITY, f32::min);
    let inside = best.2.abs() < UP_DOWN;
    (inside && best.0 < DISTINCT * rival).then(|| {
        let above = cost_of_shift(pair, (x, y), best.1, best.2 - 1);
        let below = cost_of_shift(pair, (x, y), best.1, best.2 + 1);
        let rise = above.max(below) - best.0;
        let offset = if rise > 0.0 { 0.5 * (above - below) / rise } else { 0.0 };
        Shift { left: best.1, down: f64::from(best.2) + f64::from(offset) }
    })
}

/// Returns the difference between the images if the right one is shifted by a number of pixels.
fn cost_of_shift(
    [left, right]: [&GreyImage; 2],
    (x, y): (usize, usize),
    shift: i32,
    down: i32,
) -> f32 {
    difference(left, right, (x, y), ((x as i32 - shift) as usize, (y as i32 + down) as usize))
}

/// Returns the mean difference of two patches, apart from their mean brightness.
fn difference(a: &GreyImage, b: &GreyImage, at_a: (usize, usize), at_b: (usize, usize)) -> f32 {
    fn rows(image: &GreyImage, (x, y): (usize, usize), row: usize) -> [i32; SIDE] {
        let row = &image.row(y + row - RADIUS)[x - RADIUS..];
        std::array::from_fn(|i| i32::from(row[i]))
    }

    const SIDE: usize = 2 * RADIUS + 1;
    let mut differences = [[0_i32; SIDE]; SIDE];
    for (row, line) in differences.iter_mut().enumerate() {
        let a = rows(a, at_a, row);
        let b = rows(b, at_b, row);
        *line = std::array::from_fn(|i| a[i].wrapping_sub(b[i]));
    }
    let count = (SIDE * SIDE) as f32;
    let mean = differences.as_flattened().iter().sum::<i32>() as f32 / count;
    differences.as_flattened().iter().map(|d| (*d as f32 - mean).abs()).sum::<f32>() / count
}
