//! Where faces can be: sampling points that depth and geometry allow, in
//! regions that are ranked by the colour of skin (P2, section III-A, after
//! Vo-Duc, Masselli and Zell 2012).

use nalgebra::Point2;
use tagalong_core::{Camera, DepthImage, Frame, Rect, RgbImage};
use tagalong_vision::islands;

use crate::Config;

/// Pixels from one sampling point to the next.
const GRID_PX: usize = 8;
/// Neighbours whose depths differ by less belong to one region, m.
const SAME_SURFACE_M: f32 = 0.15;

/// The sampling points of a frame; keeps its memory from one to the next.
#[derive(Clone, Debug, Default)]
pub struct Proposals {
    columns: usize,
    rows: usize,
    /// Depth of the points that are kept; NaN for the others.
    depth: Vec<f32>,
    skin: Vec<bool>,
    /// Points that belong to a region.
    is_taken: Vec<bool>,
    /// The points of the regions, one after the other.
    members: Vec<usize>,
    /// Where each begins, and how many of its points look like skin.
    regions: Vec<Region>,
    /// The points that are searched, those of the best regions, by depth.
    searched: Vec<usize>,
    /// Windows of the size in question may have their centre near these points, ...
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
    /// Samples a frame; returns how many points there were, how many geometry
    /// allows, and how many are searched.
    pub fn sample(&mut self, frame: &Frame, depth: &DepthImage, config: &Config) -> [u64; 3] {
        let camera = &*frame.camera;
        (self.columns, self.rows) = (camera.width / GRID_PX, camera.height / GRID_PX);
        let colour = frame.images().colour.as_deref();
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

    /// Points that touch and are about as far away as each other.
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
        let (x, y) = (at % self.columns, at / self.columns);
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

    /// Keeps the regions with the largest share of skin, as many as the points
    /// that may be searched allow, and always one.
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
        let depth = &self.depth;
        self.searched.sort_unstable_by(|a, b| depth[*a].total_cmp(&depth[*b]).then(a.cmp(b)));
        self.searched.len() as u64
    }

    /// Prepares for windows of `side` pixels: they may be where a face that is as
    /// large would be as far away as a sampling point, or beside that.
    pub fn for_side(&mut self, camera: &Camera, side: f64, config: &Config) {
        let Self { columns, rows, depth, searched, fitting, allowed, areas, .. } = self;
        let metres = |at: &usize| side * f64::from(depth[*at]) / camera.focal_px();
        let first = searched.partition_point(|at| metres(at) < config.min_face_m);
        let end = searched.partition_point(|at| metres(at) <= config.max_face_m);
        fitting.clear();
        fitting.extend(searched.get(first..end).unwrap_or_default());
        allowed.clear();
        allowed.resize(depth.len(), false);
        for at in &*fitting {
            let (x, y) = (at % *columns, at / *columns);
            for row in y.saturating_sub(1)..(y + 2).min(*rows) {
                let start = row * *columns;
                allowed[start + x.saturating_sub(1)..start + (x + 2).min(*columns)].fill(true);
            }
        }
        areas.clear();
        let place = |at: &usize| [(at % *columns) as i64, (at / *columns) as i64];
        // Windows of islands that are this far apart share no pixels.
        let gap = (side / GRID_PX as f64).ceil() as i64 + 3;
        islands(fitting, place, gap, &mut |island| areas.push(around(island.iter().map(place))));
    }

    /// Where the centres of all windows are that [`Proposals::allows`], pixels; the areas
    /// do not overlap.
    pub fn areas(&self) -> &[Rect] {
        &self.areas
    }

    /// True if a window of the size of [`Proposals::for_side`] is worth a look.
    pub fn allows(&self, window: &Rect) -> bool {
        let Point2 { coords } = window.centre();
        let (x, y) = (coords.x as usize / GRID_PX, coords.y as usize / GRID_PX);
        x < self.columns && y < self.rows && self.allowed[y * self.columns + x]
    }
}

/// The cells of sampling points and of their neighbours.
fn around(points: impl Iterator<Item = [i64; 2]>) -> Rect {
    let none = [i64::MAX, i64::MAX, i64::MIN, i64::MIN];
    let [left, top, right, bottom] = points.fold(none, |[left, top, right, bottom], [x, y]| {
        [left.min(x - 1), top.min(y - 1), right.max(x + 2), bottom.max(y + 2)]
    });
    let [x, y, width, height] =
        [left, top, right - left, bottom - top].map(|cells| (cells * GRID_PX as i64) as f64);
    Rect::new(x, y, width, height)
}

/// The pixel of a sampling point: the middle of its cell.
fn place(at: usize, columns: usize) -> (i64, i64) {
    let middle = |cell: usize| (cell * GRID_PX + GRID_PX / 2) as i64;
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

/// Kovac, Peer and Solina's rule for daylight. It fails for many complexions and
/// lamps, so nothing is decided by it alone.
fn skin(image: &RgbImage, x: i64, y: i64) -> bool {
    image.get(x, y).is_some_and(|[r, g, b]| {
        let (most, least) = (r.max(g).max(b), r.min(g).min(b));
        r > 95 && g > 40 && b > 20 && most - least > 15 && r > b && r > g && r - g > 15
    })
}
