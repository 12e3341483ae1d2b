//! Proposals for faces: sampling points that depth and geometry allow, in regions ranked by skin
//! colour (P2, section III-A, after Vo-Duc, Masselli and Zell 2012).

use nalgebra::Point2;
use tagalong_core::{DepthImage, Frame, RgbImage};
use tagalong_geometry::{Camera, Rect};
use tagalong_vision::islands;

use crate::Config;

/// Distance of neighbouring sampling points, pixels.
const GRID_PX: usize = 8;
/// Largest difference in depth of neighbours in one region, m.
const SAME_SURFACE_M: f32 = 0.15;

/// Sampling points of a frame; the memory is reused for the next frame.
#[derive(Clone, Debug, Default)]
pub struct Proposals {
    columns: usize,
    rows: usize,
    /// Depth of the possible points; NaN for the others.
    depth: Vec<f32>,
    skin: Vec<bool>,
    /// Points that belong to a region.
    is_taken: Vec<bool>,
    /// Points of the regions, one after the other.
    members: Vec<usize>,
    /// Range of each region in `members`, and the number of its points with the colour of skin.
    regions: Vec<Region>,
    /// Points that are searched, those of the best regions, by depth.
    searched: Vec<usize>,
    /// Windows of the current size may have their centre near these points, ...
    fitting: Vec<usize>,
    /// ... that is, in these cells, ...
    allowed: Vec<bool>,
    /// ... which are in these areas, pixels.
    areas: Vec<Rect>,
}

#[derive(Clone, Copy, Debug)]
struct Region {
    start: usize,
    end: usize,
    skin: usize,
}

impl Region {
    fn points(&self) -> usize {
        self.end - self.start
    }

    fn share(&self) -> f64 {
        self.skin as f64 / self.points().max(1) as f64
    }
}

impl Proposals {
    /// Samples a frame; returns the number of all points, of those that geometry allows, and of
    /// those that are searched.
    pub fn sample(&mut self, frame: &Frame, depth: &DepthImage, config: &Config) -> [u64; 3] {
        let camera = &*frame.camera;
        (self.columns, self.rows) = (camera.width / GRID_PX, camera.height / GRID_PX);
        let colour = frame.colour().ok();
        self.depth.clear();
        self.skin.clear();
        for at in 0..self.columns * self.rows {
            let (x, y) = place(at, self.columns);
            let metres = depth.get(x, y).filter(|m| is_possible(camera, x, y, *m, config));
            self.depth.push(metres.unwrap_or(f32::NAN));
            self.skin.push(metres.is_some() && colour.is_some_and(|image| skin(image, x, y)));
        }
        self.connect();
        let allowed = self.members.len() as u64;
        [self.depth.len() as u64, allowed, self.rank(config.max_points)]
    }

    /// Connects adjacent points of similar depth to regions.
    fn connect(&mut self) {
        self.members.clear();
        self.regions.clear();
        self.is_taken.clear();
        self.is_taken.resize(self.depth.len(), false);
        for seed in 0..self.depth.len() {
            if self.is_taken[seed] || self.depth[seed].is_nan() {
                continue;
            }
            let start = self.members.len();
            self.take(seed);
            let mut next = start;
            while let Some(at) = self.members.get(next).copied() {
                self.neighbours(at);
                next += 1;
            }
            let skin = self.members[start..].iter().filter(|at| self.skin[**at]).count();
            self.regions.push(Region { start, end: self.members.len(), skin });
        }
    }

    fn take(&mut self, at: usize) {
        self.is_taken[at] = true;
        self.members.push(at);
    }

    fn neighbours(&mut self, at: usize) {
        let x = at % self.columns;
        let y = at / self.columns;
        let beside = [
            (x > 0).then(|| at - 1),
            (x + 1 < self.columns).then(|| at + 1),
            (y > 0).then(|| at - self.columns),
            (y + 1 < self.rows).then(|| at + self.columns),
        ];
        for to in beside.into_iter().flatten() {
            let is_near = (self.depth[to] - self.depth[at]).abs() < SAME_SURFACE_M;
            if !self.is_taken[to] && is_near {
                self.take(to);
            }
        }
    }

    /// Keeps the regions with the largest share of skin, while their points do not exceed the
    /// limit, and always one.
    fn rank(&mut self, max_points: usize) -> u64 {
        self.regions.sort_by(|a, b| b.share().total_cmp(&a.share()).then(a.start.cmp(&b.start)));
        self.searched.clear();
        for region in &self.regions {
            let points = &self.members[region.start..region.end];
            if !self.searched.is_empty() && self.searched.len() + points.len() > max_points {
                break;
            }
            self.searched.extend(points);
        }
        // Sorted by depth, the points of one size are a range that is found by bisection.
        let depth = &self.depth;
        self.searched.sort_unstable_by(|a, b| depth[*a].total_cmp(&depth[*b]).then(a.cmp(b)));
        self.searched.len() as u64
    }

    /// Prepares for windows of `side` pixels: they are allowed at and beside sampling points at the
    /// distance of a face of this size.
    pub fn for_side(&mut self, camera: &Camera, side: f64, config: &Config) {
        let Self { columns, rows, depth, searched, fitting, allowed, areas, .. } = self;
        let columns = *columns;
        let first =
            searched.partition_point(|at| width_m(camera, side, depth[*at]) < config.min_face_m);
        let end =
            searched.partition_point(|at| width_m(camera, side, depth[*at]) <= config.max_face_m);
        fitting.clear();
        fitting.extend(searched.get(first..end).unwrap_or_default());
        allowed.clear();
        allowed.resize(depth.len(), false);
        for at in &*fitting {
            let x = at % columns;
            let y = at / columns;
            for row in y.saturating_sub(1)..(y + 2).min(*rows) {
                let start = row * columns;
                allowed[start + x.saturating_sub(1)..start + (x + 2).min(columns)].fill(true);
            }
        }
        areas.clear();
        // Windows of islands at this distance share no pixels.
        let gap = (side / GRID_PX as f64).ceil() as i64 + 3;
        islands(fitting, |at| place_of(*at, columns), gap, &mut |island| {
            areas.push(around(island.iter().map(|at| place_of(*at, columns))));
        });
    }

    /// Returns the areas that contain the centres of all windows that [`Proposals::allows`],
    /// pixels; they do not overlap.
    pub fn areas(&self) -> &[Rect] {
        &self.areas
    }

    /// Returns true if a window of the size of [`Proposals::for_side`] is to be scanned.
    pub fn allows(&self, window: &Rect) -> bool {
        let Point2 { coords } = window.centre();
        let x = coords.x as usize / GRID_PX;
        let y = coords.y as usize / GRID_PX;
        x < self.columns && y < self.rows && self.allowed[y * self.columns + x]
    }
}

/// Returns the rectangle of the cells of sampling points and of their neighbours.
fn around(points: impl Iterator<Item = [i64; 2]>) -> Rect {
    let none = [i64::MAX, i64::MAX, i64::MIN, i64::MIN];
    let [left, top, right, bottom] = points.fold(none, |[left, top, right, bottom], [x, y]| {
        [left.min(x - 1), top.min(y - 1), right.max(x + 2), bottom.max(y + 2)]
    });
    let [x, y, width, height] =
        [left, top, right - left, bottom - top].map(|cells| (cells * GRID_PX as i64) as f64);
    Rect::new(x, y, width, height)
}

/// Returns the pixel of a sampling point: the middle of its cell.
fn place(at: usize, columns: usize) -> (i64, i64) {
    fn middle(cell: usize) -> i64 {
        (cell * GRID_PX + GRID_PX / 2) as i64
    }

    (middle(at % columns), middle(at / columns))
}

fn is_possible(camera: &Camera, x: i64, y: i64, metres: f32, config: &Config) -> bool {
    let metres = f64::from(metres);
    if !(config.min_depth_m..=config.max_depth_m).contains(&metres) {
        return false;
    }
    let pixel = Point2::new(x as f64 + 0.5, y as f64 + 0.5);
    let height_m = camera.back_project(pixel, metres).z;
    (config.min_height_m..=config.max_height_m).contains(&height_m)
}

/// Tests for skin by Kovac, Peer and Solina's rule for daylight. It fails for many complexions and
/// lamps, so it only ranks regions and decides nothing alone.
fn skin(image: &RgbImage, x: i64, y: i64) -> bool {
    image.get(x, y).is_some_and(|[r, g, b]| {
        let most = r.max(g).max(b);
        let least = r.min(g).min(b);
        // `r > g` stands before `r - g`, which would otherwise overflow.
        r > 95 && g > 40 && b > 20 && most - least > 15 && r > b && r > g && r - g > 15
    })
}

/// Returns the width of something that is so many pixels wide at this depth, m.
#[inline]
fn width_m(camera: &Camera, side: f64, depth_m: f32) -> f64 {
    side * f64::from(depth_m) / camera.focal_px()
}

/// Returns the column and the row of a point of the grid.
#[inline]
fn place_of(at: usize, columns: usize) -> [i64; 2] {
    [(at % columns) as i64, (at / columns) as i64]
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use tagalong_core::{EgoMotion, Images, Stamp};
    use tagalong_geometry::Pinhole;

    use super::*;

    /// Columns and rows of sampling points.
    const POINTS: (usize, usize) = (20, 15);
    const FOCAL_PX: f64 = 131.0;
    const SKIN: [u8; 3] = [200, 140, 110];

    fn camera() -> Camera {
        Camera::mounted(Pinhole::centred(FOCAL_PX, 160, 120), 160, 120, 1.3, 0.0, 0.0)
    }

    /// Sampling points with an object, by their columns and rows.
    struct Block {
        columns: std::ops::Range<usize>,
        rows: std::ops::Range<usize>,
        metres: f32,
        is_skin: bool,
    }

    fn block(columns: std::ops::Range<usize>, metres: f32, is_skin: bool) -> Block {
        Block { columns, rows: 6..9, metres, is_skin }
    }

    /// Returns the block that covers a pixel.
    fn block_at(blocks: &[Block], x: usize, y: usize) -> Option<&Block> {
        blocks
            .iter()
            .find(|b| b.columns.contains(&(x / GRID_PX)) && b.rows.contains(&(y / GRID_PX)))
    }

    fn frame(blocks: &[Block]) -> Frame {
        let depth = DepthImage::from_fn(160, 120, |x, y| {
            block_at(blocks, x, y).map_or(f32::NAN, |block| block.metres)
        });
        let colour = RgbImage::from_fn(160, 120, |x, y| match block_at(blocks, x, y) {
            Some(block) if block.is_skin => SKIN,
            _ => [90, 90, 90],
        });
        let images = Images {
            colour: Some(Arc::new(colour)),
            depth: Some(Arc::new(depth)),
            ..Images::default()
        };
        Frame::new(1, Stamp::default(), Arc::new(camera()), EgoMotion::at_rest(0.1), images)
    }

    fn sampled(blocks: &[Block], config: &Config) -> (Proposals, [u64; 3]) {
        let mut proposals = Proposals::default();
        let frame = frame(blocks);
        let counts = proposals.sample(&frame, frame.depth().unwrap(), config);
        (proposals, counts)
    }

    /// The cells in which windows of a size may have their centre.
    fn allowed(proposals: &Proposals) -> Vec<(usize, usize)> {
        fn window((x, y): &(usize, usize)) -> Rect {
            fn corner(cell: usize) -> f64 {
                (cell * GRID_PX) as f64
            }
            Rect::new(corner(*x), corner(*y), GRID_PX as f64, GRID_PX as f64)
        }

        let cells = (0..POINTS.1).flat_map(|y| (0..POINTS.0).map(move |x| (x, y)));
        cells.filter(|cell| proposals.allows(&window(cell))).collect()
    }

    fn cells(columns: std::ops::Range<usize>, rows: std::ops::Range<usize>) -> Vec<(usize, usize)> {
        rows.flat_map(|y| columns.clone().map(move |x| (x, y))).collect()
    }

    #[test]
    fn windows_may_be_where_a_face_would_be_so_large_and_beside_that() {
        fn side(metres: f64) -> f64 {
            metres * FOCAL_PX / 2.0
        }

        let config = Config::default();
        let (mut proposals, counts) = sampled(&[block(5..9, 2.0, false)], &config);
        assert_eq!(counts, [(POINTS.0 * POINTS.1) as u64, 12, 12]);
        for metres in [config.min_face_m + 0.001, config.max_face_m - 0.001] {
            proposals.for_side(&camera(), side(metres), &config);
            assert_eq!(allowed(&proposals), cells(4..10, 5..10), "{metres}");
            assert_eq!(proposals.areas(), [Rect::new(32.0, 40.0, 48.0, 40.0)]);
        }
        for metres in [config.min_face_m - 0.001, config.max_face_m + 0.001] {
            proposals.for_side(&camera(), side(metres), &config);
            assert!(allowed(&proposals).is_empty() && proposals.areas().is_empty(), "{metres}");
        }
        // At the borders of the image there are fewer neighbours.
        let corner = Block { rows: 0..1, ..block(0..1, 2.0, false) };
        let low = Config { max_height_m: 9.0, ..config };
        let (mut proposals, _) = sampled(&[corner], &low);
        proposals.for_side(&camera(), side(0.15), &low);
        assert_eq!(allowed(&proposals), cells(0..2, 0..2));
        let corner = Block { rows: 14..15, ..block(19..20, 2.0, false) };
        let (mut proposals, _) = sampled(&[corner], &Config { min_height_m: -9.0, ..low.clone() });
        proposals.for_side(&camera(), side(0.15), &low);
        assert_eq!(allowed(&proposals), cells(18..20, 13..15));
        let outside = Rect::new(400.0, 100.0, 8.0, 8.0);
        let below = Rect::new(100.0, 400.0, 8.0, 8.0);
        assert!(!proposals.allows(&outside) && !proposals.allows(&below));
    }

    #[test]
    fn regions_with_skin_are_searched_first_and_one_always() {
        fn blocks() -> [Block; 3] {
            [block(2..6, 2.0, false), block(8..12, 2.0, true), block(14..18, 2.0, false)]
        }

        fn searched(max_points: usize) -> (u64, Vec<bool>) {
            let config = Config { max_points, ..Config::default() };
            let (mut proposals, counts) = sampled(&blocks(), &config);
            assert_eq!(counts[1], 36);
            proposals.for_side(&camera(), 0.15 * FOCAL_PX / 2.0, &config);
            let columns: Vec<bool> =
                [3, 9, 15].map(|column| allowed(&proposals).contains(&(column, 7))).to_vec();
            (counts[2], columns)
        }

        assert_eq!(searched(36), (36, vec![true, true, true]));
        assert_eq!(searched(35), (24, vec![true, true, false]), "of equals the first");
        assert_eq!(searched(24), (24, vec![true, true, false]));
        assert_eq!(searched(23), (12, vec![false, true, false]));
        assert_eq!(searched(1), (12, vec![false, true, false]));
    }

    #[test]
    fn regions_end_where_depth_jumps() {
        fn counts(apart_m: f32) -> [u64; 3] {
            let config = Config { max_points: 1, ..Config::default() };
            sampled(&[block(4..8, 2.0, true), block(8..12, 2.0 + apart_m, false)], &config).1
        }

        assert_eq!(counts(0.1), [300, 24, 24], "one surface");
        assert_eq!(counts(0.2), [300, 24, 12], "two");
        // Points one above the other are one surface as well.
        let above = Block { rows: 3..6, ..block(4..8, 2.05, false) };
        let config = Config { max_points: 1, ..Config::default() };
        assert_eq!(sampled(&[above, block(4..8, 2.0, true)], &config).1, [300, 24, 24]);
    }

    #[test]
    fn points_are_possible_by_their_distance_and_height() {
        let config = Config { min_depth_m: 1.0, max_depth_m: 3.0, ..Config::default() };
        let near_and_far = [(0.98, false), (1.02, true), (2.98, true), (3.02, false)]
            .map(|(metres, is)| (metres, 1.3, is));
        let low_and_high = [(0.75, false), (0.85, true), (2.05, true), (2.15, false)]
            .map(|(height_m, is)| (2.0, height_m, is));
        let unknown = [(f32::NAN, 1.3, false)];
        for (metres, height_m, is) in near_and_far.into_iter().chain(low_and_high).chain(unknown) {
            let row = 59.5 - (height_m - 1.3) * FOCAL_PX / f64::from(metres);
            let found = is_possible(&camera(), 80, row.round() as i64, metres, &config);
            assert_eq!(found, is, "{metres} m away, {height_m} m high");
        }
    }

    #[test]
    fn skin_is_that_of_the_rule() {
        fn is_skin(colour: [u8; 3]) -> bool {
            skin(&RgbImage::filled(1, 1, colour), 0, 0)
        }

        let cases = [
            (SKIN, true),
            ([96, 41, 21], true),
            ([95, 41, 21], false),
            ([96, 40, 21], false),
            ([96, 41, 20], false),
            ([120, 110, 100], false),
            ([120, 104, 100], true),
            ([120, 105, 100], false),
            ([200, 60, 200], false),
            ([200, 210, 100], false),
            ([116, 100, 101], true),
            ([115, 100, 100], false),
        ];
        for (colour, is) in cases {
            assert_eq!(is_skin(colour), is, "{colour:?}");
        }
        assert!(!skin(&RgbImage::filled(1, 1, SKIN), 1, 0), "outside of the image");
    }
}
