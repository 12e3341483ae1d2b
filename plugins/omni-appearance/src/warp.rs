//! Motion of the background with the robot.

use nalgebra::{Point2, Point3};
use tagalong_core::EgoMotion;
use tagalong_geometry::{Camera, Panorama};

/// Spacing, in columns and rows, of the nodes at which places are computed; between them they are
/// interpolated.
const STEP: usize = 8;
/// Largest motion that is ignored: it moves nothing by half a pixel, m and rad.
const STILL: [f64; 2] = [0.002, 0.001];

/// Returns true if the robot moved enough to move the background.
pub(crate) fn is_moving(motion: &EgoMotion) -> bool {
    motion.forward.hypot(motion.left) > STILL[0] || motion.turn.abs() > STILL[1]
}

/// Displacement of the background by the odometry: the floor as the floor where it is nearer than
/// `wall_m`, all else as if it stood `wall_m` away.
pub(crate) struct Warp {
    columns: usize,
    rows: usize,
    /// Places of the nodes of a grid before the motion: column, unwrapped so that it stays near the
    /// node's own, and row.
    nodes: Vec<[f32; 2]>,
    across: usize,
}

impl Warp {
    pub(crate) fn new(
        camera: &Camera,
        panorama: &Panorama,
        motion: &EgoMotion,
        wall_m: f64,
    ) -> Self {
        let columns = panorama.columns;
        let rows = panorama.rows;
        let across = columns / STEP + 2;
        let down = rows / STEP + 2;
        let mut nodes = Vec::with_capacity(across * down);
        for row in 0..down {
            for column in 0..across {
                let at = Point2::new((column * STEP) as f64, (row * STEP) as f64);
                nodes.push(before(camera, panorama, motion, wall_m, at));
            }
        }
        Self { columns, rows, nodes, across }
    }

    /// Returns the place of a pixel before the motion.
    fn place(&self, column: usize, row: usize) -> [f32; 2] {
        let i = row / STEP * self.across + column / STEP;
        let j = column % STEP;
        let x = j as f32 / STEP as f32;
        let y = (row % STEP) as f32 / STEP as f32;
        let nodes = [0, 1, self.across, self.across + 1].map(|offset| self.nodes[i + offset]);
        [0, 1].map(|axis| {
            let [upper_left, upper_right, left, right] = nodes.map(|node| node[axis]);
            let upper = upper_left + x * (upper_right - upper_left);
            upper + y * (left + x * (right - left) - upper)
        })
    }

    /// Returns the pixel nearest to the place of a pixel before the motion.
    fn nearest(&self, column: usize, row: usize) -> usize {
        let [x, y] = self.place(column, row);
        let column = (x.round() as i64).rem_euclid(self.columns as i64) as usize;
        let row = y.round().clamp(0.0, self.rows as f32 - 1.0) as usize;
        row * self.columns + column
    }

    /// Reads three colours per pixel from their places before the motion; bilinear.
    pub(crate) fn apply(&self, from: &[f32], to: &mut [f32]) {
        for row in 0..self.rows {
            for column in 0..self.columns {
                let [x, y] = self.place(column, row);
                let (left, across) = self.column(x);
                let (top, down) = self.row(y);
                let right = if left + 1 == self.columns { 0 } else { left + 1 };
                let corners = [(top, left), (top, right), (top + 1, left), (top + 1, right)]
                    .map(|(row, column)| 3 * (row * self.columns + column));
                let at = 3 * (row * self.columns + column);
                for (colour, out) in to[at..at + 3].iter_mut().enumerate() {
                    let [a, b, c, d] = corners.map(|corner| from[corner + colour]);
                    let upper = a + across * (b - a);
                    let lower = c + across * (d - c);
                    *out = upper + down * (lower - upper);
                }
            }
        }
    }

    fn column(&self, x: f32) -> (usize, f32) {
        let whole = x.floor();
        ((whole as i64).rem_euclid(self.columns as i64) as usize, x - whole)
    }

    fn row(&self, y: f32) -> (usize, f32) {
        let y = y.clamp(0.0, self.rows as f32 - 1.0);
        // One row short of the end, so that the row below exists.
        let top = (y as usize).min(self.rows.saturating_sub(2));
        (top, y - top as f32)
    }
}

/// Returns the place before the motion of the point that a pixel shows now.
fn before(
    camera: &Camera,
    panorama: &Panorama,
    motion: &EgoMotion,
    wall_m: f64,
    pixel: Point2<f64>,
) -> [f32; 2] {
    let elevation = panorama.elevation(pixel.y);
    let floor = panorama.mirror.floor_range_m(elevation, camera.height_m());
    let range = floor.filter(|range| *range > 0.0).map_or(wall_m, |range| range.min(wall_m));
    let now = camera.back_project(pixel, range);
    let there = motion.isometry() * now.xy();
    let point = Point3::new(there.x, there.y, now.z);
    let seen = panorama.pixel(&camera.robot_from_camera.inverse_transform_point(&point));
    [camera.column_near(seen.x, pixel.x) as f32, seen.y as f32]
}

/// Side of the blocks that are moved as if all in them were equally far away, columns and rows.
const BLOCK: usize = 8;

/// The background after the robot has moved, with unknown distances of walls and furniture: it is
/// moved as if they stood at each of several distances, and each block is taken from the one of
/// these images that is most like the new image there and around it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sweep {
    images: Vec<Vec<f32>>,
    /// Differences to the new image: one row of blocks after the other, for each distance.
    costs: Vec<Vec<f32>>,
    times: Vec<f32>,
}

impl Sweep {
    /// Moves colours, and a number for each pixel or none, by `warps`, one for each distance;
    /// `colours` is the new image.
    pub(crate) fn apply(
        &mut self,
        warps: &[Warp],
        colours: &[u8],
        mean: &mut [f32],
        times: &mut [f32],
    ) {
        let Some(first) = warps.first() else { return };
        let columns = first.columns;
        let rows = first.rows;
        self.images.resize(warps.len(), Vec::new());
        self.costs.resize(warps.len(), Vec::new());
        for ((warp, image), costs) in warps.iter().zip(&mut self.images).zip(&mut self.costs) {
            image.resize(mean.len(), 0.0);
            warp.apply(mean, image);
            differences(image, colours, columns, costs);
        }
        self.times.clear();
        self.times.extend_from_slice(times);
        let blocks = (rows.div_ceil(BLOCK), columns.div_ceil(BLOCK));
        for (row, column) in (0..blocks.0).flat_map(|row| (0..blocks.1).map(move |c| (row, c))) {
            let best = (0..warps.len()).min_by(|a, b| {
                let [of_a, of_b] = [*a, *b].map(|k| around(&self.costs[k], (row, column), blocks));
                of_a.total_cmp(&of_b)
            });
            let best = best.unwrap_or(0);
            let across = column * BLOCK..(column * BLOCK + BLOCK).min(columns);
            for y in row * BLOCK..(row * BLOCK + BLOCK).min(rows) {
                let pixels = 3 * (y * columns + across.start)..3 * (y * columns + across.end);
                mean[pixels.clone()].copy_from_slice(&self.images[best][pixels]);
                // Times are not averages: they are taken from the nearest pixel instead of
                // interpolated.
                for x in across.clone().filter(|_| !self.times.is_empty()) {
                    times[y * columns + x] = self.times[warps[best].nearest(x, y)];
                }
            }
        }
    }
}

/// Sums the absolute differences over blocks.
fn differences(image: &[f32], colours: &[u8], columns: usize, sums: &mut Vec<f32>) {
    let across = columns.div_ceil(BLOCK);
    sums.clear();
    let rows = image.chunks_exact(3 * columns).zip(colours.chunks_exact(3 * columns));
    for (row, (image, colours)) in rows.enumerate() {
        let start = row / BLOCK * across;
        sums.resize(start + across, 0.0);
        let blocks = image.chunks(3 * BLOCK).zip(colours.chunks(3 * BLOCK));
        for (sum, (image, colours)) in sums[start..].iter_mut().zip(blocks) {
            let off = image.iter().zip(colours).map(|(a, b)| (a - f32::from(*b)).abs());
            *sum += off.sum::<f32>();
        }
    }
}

/// Sums over a block and its neighbours; columns are counted modulo their number.
fn around(sums: &[f32], (row, column): (usize, usize), (down, across): (usize, usize)) -> f32 {
    let rows = row.saturating_sub(1)..(row + 2).min(down);
    let columns = [column + across - 1, column, column + 1].map(|c| c % across);
    rows.flat_map(|row| columns.map(|column| sums[row * across + column])).sum()
}

/// Lowest and highest value within some columns and rows, for each colour. A background that is
/// known to within that many pixels lies between them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bounds {
    pub(crate) low: Vec<u8>,
    pub(crate) high: Vec<u8>,
    rows: [Vec<u8>; 2],
}

impl Bounds {
    /// Computes the bounds; `slack` is the number of columns and rows to each side.
    pub(crate) fn of(&mut self, level: &[u8], columns: usize, slack: [usize; 2]) {
        let stride = 3 * columns;
        // The extrema of a rectangle: first along the rows, then across them, at the cost of two
        // sides.
        let [low, high] = &mut self.rows;
        low.resize(level.len(), 0);
        high.resize(level.len(), 0);
        let rows = level.chunks_exact(stride);
        let out = low.chunks_exact_mut(stride).zip(high.chunks_exact_mut(stride));
        for (row, (low, high)) in rows.zip(out) {
            along(row, low, slack[0], |a, b| a.min(b));
            along(row, high, slack[0], |a, b| a.max(b));
        }
        down(low, &mut self.low, stride, slack[1], |a, b| a.min(b));
        down(high, &mut self.high, stride, slack[1], |a, b| a.max(b));
    }
}

/// Combines along a row: pixels are counted modulo its length.
fn along(row: &[u8], out: &mut [u8], slack: usize, pick: impl Fn(u8, u8) -> u8 + Copy) {
    out.copy_from_slice(row);
    let width = row.len();
    for shift in (1..=slack).map(|columns| 3 * columns % width.max(1)) {
        let (start, end) = out.split_at_mut(width - shift);
        fold(start, &row[shift..], pick);
        fold(end, &row[..shift], pick);
        let (start, end) = out.split_at_mut(shift);
        fold(start, &row[width - shift..], pick);
        fold(end, &row[..width - shift], pick);
    }
}

fn down(
    from: &[u8],
    out: &mut Vec<u8>,
    stride: usize,
    slack: usize,
    pick: impl Fn(u8, u8) -> u8 + Copy,
) {
    out.clear();
    out.extend_from_slice(from);
    for shift in (1..=slack).map(|rows| rows * stride).filter(|shift| *shift < from.len()) {
        let kept = from.len() - shift;
        fold(&mut out[..kept], &from[shift..], pick);
        fold(&mut out[shift..], &from[..kept], pick);
    }
}

fn fold(out: &mut [u8], with: &[u8], pick: impl Fn(u8, u8) -> u8 + Copy) {
    for (out, value) in out.iter_mut().zip(with) {
        *out = pick(*out, *value);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;
    use proptest::prelude::*;
    use tagalong_geometry::{ConicalMirror, Lens};

    use super::*;

    const COLUMNS: usize = 480;
    const ROWS: usize = 120;

    fn camera() -> Camera {
        let d = [67.5_f64.to_radians(), 0.05, 8.0, 230.0];
        let mirror = ConicalMirror::new(175.0, [240.0; 2], d).unwrap();
        Camera {
            lens: Lens::Panorama(Panorama { mirror, columns: COLUMNS, rows: ROWS }),
            width: COLUMNS,
            height: ROWS,
            robot_from_camera: ConicalMirror::upright(1.5),
        }
    }

    /// Renders a pattern on the floor and on a round wall about the place of the first image.
    fn room(camera: &Camera, pose: &nalgebra::Isometry2<f64>, wall_m: f64) -> Vec<f32> {
        let panorama = camera.panorama().unwrap();
        let pixels = (0..ROWS).flat_map(|row| (0..COLUMNS).map(move |column| (column, row)));
        let colours = pixels.flat_map(|(column, row)| {
            let at = Point2::new(column as f64, row as f64);
            let elevation = panorama.elevation(at.y);
            let floor = panorama.mirror.floor_range_m(elevation, 1.5);
            let range = floor.filter(|r| *r > 0.0).map_or(wall_m, |r| r.min(wall_m));
            let point = pose * camera.back_project(at, range).xy();
            let value = 100.0 + 60.0 * (1.3 * point.x).sin() + 40.0 * (1.1 * point.y).cos();
            [value as f32; 3]
        });
        colours.collect()
    }

    /// Returns the mean difference of two images.
    fn mean_off(a: &[f32], b: &[f32]) -> f32 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>() / a.len() as f32
    }

    #[test]
    fn the_floor_is_where_the_odometry_says() {
        let camera = camera();
        let motion = EgoMotion {
            dt: 0.3,
            forward: 0.15,
            left: -0.05,
            turn: 0.2,
            covariance: Matrix3::zeros(),
        };
        assert!(is_moving(&motion) && !is_moving(&EgoMotion::at_rest(0.3)));
        let before = room(&camera, &nalgebra::Isometry2::identity(), 3.5);
        let after = room(&camera, &motion.isometry(), 3.5);
        let mut moved = vec![0.0; before.len()];
        let panorama = camera.panorama().unwrap();
        Warp::new(&camera, panorama, &motion, 3.5).apply(&before, &mut moved);
        // The wall is at a fixed distance from the robot, which no real wall is; only the floor is
        // compared.
        let near = (0..ROWS).position(|row| {
            let elevation = panorama.elevation(row as f64);
            panorama.mirror.floor_range_m(elevation, 1.5).is_some_and(|r| (0.0..3.0).contains(&r))
        });
        let first = 3 * COLUMNS * near.unwrap();
        let [warped, unmoved] =
            [&moved, &before].map(|image| mean_off(&image[first..], &after[first..]));
        assert!(warped < 2.0 && unmoved > 10.0, "{warped} {unmoved}");
    }

    #[test]
    fn a_robot_moves_that_goes_by_two_millimetres_or_turns_by_one_milliradian() {
        for (forward, left, turn, expected) in [
            (0.0019, 0.0, 0.0009, false),
            (0.0021, 0.0, 0.0, true),
            (0.0, -0.0021, 0.0, true),
            (0.0015, 0.0015, 0.0, true),
            (0.0, 0.0, -0.0011, true),
        ] {
            let motion = EgoMotion { forward, left, turn, ..EgoMotion::at_rest(0.1) };
            assert_eq!(is_moving(&motion), expected, "{forward} {left} {turn}");
        }
    }

    /// Half a column to the right and a quarter of a row down, in an image of 8 by 4 pixels.
    #[test]
    fn a_pixel_is_the_mean_of_four_around_its_place_also_across_the_seam() {
        /// Returns the mean of a colour of two pixels side by side.
        fn both(image: &[f32], row: usize, column: usize, colour: usize) -> f32 {
            let sum: f32 =
                [column, (column + 1) % 8].map(|x| image[24 * row + 3 * x + colour]).iter().sum();
            0.5 * sum
        }

        let places =
            [[0.5, 0.25], [8.5, 0.25], [16.5, 0.25], [0.5, 8.25], [8.5, 8.25], [16.5, 8.25]];
        let warp = Warp { columns: 8, rows: 4, nodes: places.into(), across: 3 };
        let image: Vec<f32> = (0..8 * 4 * 3).map(|at| (37 * at % 101) as f32).collect();
        let mut moved = vec![0.0; image.len()];
        warp.apply(&image, &mut moved);
        for (at, found) in moved.iter().enumerate() {
            let row = at / 24;
            let column = at % 24 / 3;
            // Below the last row there is none: it stays where it is.
            let down = if row == 3 { 0.0 } else { 0.25 };
            let upper = both(&image, row, column, at % 3);
            let lower = both(&image, (row + 1).min(3), column, at % 3);
            let expected = upper + down * (lower - upper);
            assert!((found - expected).abs() < 1e-4, "{row} {column}: {found} {expected}");
        }
    }

    #[test]
    fn a_wall_is_found_at_its_distance() {
        let camera = camera();
        let panorama = camera.panorama().unwrap();
        let motion = EgoMotion {
            dt: 0.3,
            forward: 0.2,
            left: 0.0,
            turn: 0.05,
            covariance: Matrix3::zeros(),
        };
        let before = room(&camera, &nalgebra::Isometry2::identity(), 2.0);
        let warps = [1.2, 2.0, 6.0].map(|wall| Warp::new(&camera, panorama, &motion, wall));
        // The new image if the wall is at the middle distance.
        let mut now = vec![0.0; before.len()];
        warps[1].apply(&before, &mut now);
        let colours: Vec<u8> = now.iter().map(|value| value.round() as u8).collect();
        let mut moved = before.clone();
        let mut times: Vec<f32> = (0..COLUMNS * ROWS).map(|pixel| pixel as f32).collect();
        Sweep::default().apply(&warps, &colours, &mut moved, &mut times);
        let off = mean_off(&moved, &now);
        assert!(off < 0.05, "{off}");
        assert_eq!(times[40 * COLUMNS + 90] as usize, warps[1].nearest(90, 40));
        warps[2].apply(&before, &mut moved);
        let off = mean_off(&moved, &now);
        assert!(off > 1.0, "{off}");
    }

    proptest! {
        #[test]
        fn bounds_are_those_of_the_neighbourhood(
            level in prop::collection::vec(any::<u8>(), 3 * 9 * 5),
            across in 0..4usize, rows in 0..3usize,
        ) {
            let mut bounds = Bounds::default();
            bounds.of(&level, 9, [across, rows]);
            for at in 0..level.len() {
                let row = at / 27;
                let column = at % 27 / 3;
                let colour = at % 3;
                let near = (row.saturating_sub(rows)..(row + rows + 1).min(5)).flat_map(|r| {
                    (0..=2 * across).map(move |c| (r, (column + 9 + c - across) % 9))
                });
                let values: Vec<u8> = near.map(|(r, c)| level[27 * r + 3 * c + colour]).collect();
                prop_assert_eq!(Some(&bounds.low[at]), values.iter().min());
                prop_assert_eq!(Some(&bounds.high[at]), values.iter().max());
            }
        }
    }
}
