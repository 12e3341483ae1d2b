use nalgebra::{Point2, Point3, Vector3};
use tagalong_core::{DepthImage, EgoMotion, GreyImage, Person, Track, TrackId};
use tagalong_geometry::Camera;

use super::CollisionMonitorSettings;
use super::coverage::{Coverage, Look};
use super::footprint::Footprint;
use super::ground::{fall, is_thing};
use super::pixel_rays::PixelRays;

/// Sampled columns of the image.
const COLUMNS: usize = 160;
/// Resolution of the remembered positions, m.
const CELL_M: f64 = 0.05;
/// Points in a cell that are no noise.
const ENOUGH: u16 = 3;
/// Depth beyond which a pixel has none, m: some cameras say so by the largest value of 16 bits,
/// 65.535 m, which is no fall in the floor.
const FARTHEST_M: f64 = 50.0;
/// Time after which a static point is an obstacle to remember, s; a person walking by is not.
const STANDS_S: f64 = 1.0;
/// Time after which a fall is one to remember, s: a floor does not walk away, but a wrong match of a
/// stereo pair on a floor without texture lies below it for an image or two.
const FALLS_S: f64 = 0.3;
/// Distance from the footprint, m, within which a thing that left the image at its edge or below is
/// believed to be there until it is seen that it is not, however short it was seen: that near no
/// camera measures.
const CLOSE_M: f64 = 0.7;
/// Height below which a point is counted to a static obstacle beside it, m. The seat of a chair leaves
/// the image at its lower edge before it was seen for [`STANDS_S`]; the head of a person is higher.
const LOW_M: f64 = 0.6;
/// Greatest distance between such a point and the obstacle, m.
const BESIDE_M: f64 = 0.2;
/// Offset from the torso of a person to the head, m.
const TORSO: Vector3<f64> = Vector3::new(0.0, 0.0, 0.35);
/// Distance from a person within which a point may belong to an object that the person carries, pulls or
/// pushes, m.
pub(super) const CARRIED_M: f64 = 0.8;
/// Speed of the person below which such a point is tested, m/s.
const STAYS_MPS: f64 = 0.25;
/// Distance before a place from which on a nearer surface hides it, m.
const BEFORE_M: f64 = 0.2;
/// Distance behind a place from which on a surface is not that of the thing there, m.
const BEHIND_M: f64 = 0.1;
/// Resolution of the heights, m.
const BAND_M: f64 = 0.1;
/// Part of valid readings below which an image column is dark.
const DARK: f64 = 0.05;
/// Slope of the brightness across a pixel from which on it has texture, grey levels: noise is less.
const TEXTURED: i32 = 6;
/// Part of textured pixels below which a column has too little texture for a stereo pair.
const SMOOTH: f64 = 0.1;
/// Depth that is assumed for an object that hides a column, m.
const HIDES_M: f64 = 0.4;
/// Part of the columns on each side that may be dark from the first image on: the images of some
/// cameras have an empty border.
const BORDER: f64 = 0.125;

/// Memory of the obstacles around the robot: those in the depth image, and those seen lately that
/// are now beside the robot, below the image, too near for the camera, or hidden.
pub(crate) struct ObstacleMemory {
    footprint: Footprint,
    seen: Vec<Point3<f64>>,
    /// Part of the image that has depth; `None` without a depth image.
    with_depth: Option<f64>,
    /// Sampled columns of the image, and the place of their camera.
    columns: Vec<Column>,
    eye: Point2<f64>,
    things: Vec<Obstacle>,
    /// Time since the last image, up to the last frame, s.
    held_s: f64,
    grid: Grid,
    rays: PixelRays,
}

/// Thing that is not in view and believed to be there.
pub(super) struct Remembered {
    /// Place in the robot frame, m.
    pub(super) at: Point2<f64>,
    /// True for a person, which may have walked on.
    pub(super) is_person: bool,
    /// True for a place without a floor.
    pub(super) is_drop: bool,
}

/// Set of heights above the floor, one bit per decimetre.
#[derive(Clone, Copy, Default)]
struct Heights(u16);

/// Column of the image.
#[derive(Clone)]
struct Column {
    /// Assumed position of an object that hides it, robot frame, m.
    at: Point2<f64>,
    /// Valid readings in it.
    read: u32,
    /// Nearest thing in it, robot frame, m.
    nearest: Option<Point2<f64>>,
    /// Farthest reading in it, robot frame, m.
    farthest: Option<Point2<f64>>,
    /// Squares of their distances from the camera, m².
    nearest_square: f64,
    farthest_square: f64,
    /// Time for which it has been dark, s; infinite if it always was: the images of some cameras
    /// have an empty border.
    dark_s: f64,
}

/// Static obstacle.
struct Obstacle {
    /// Position in the robot frame, m.
    at: Point2<f64>,
    /// Heights at which it was seen above that.
    heights: Heights,
    /// Time for which some of these have been free while it is seen, s: who walks off leaves none.
    free_s: f64,
    /// Time for which it has been seen, s, without `beside_s`.
    seen_s: f64,
    /// Time for which it has been seen while the followed person was there and may have carried it,
    /// or been it, s. It counts as soon as the person has gone and it still stands there: a chair
    /// after its sitter got up.
    beside_s: f64,
    /// True for what was seen only where the followed person was.
    of_target: bool,
    /// Time for which it has not been seen, s.
    unseen_s: f64,
    /// Track of the person that it was, if it is one.
    who: Option<TrackId>,
    /// True for a place without a floor.
    is_drop: bool,
}

impl ObstacleMemory {
    /// Creates an empty memory of a robot.
    pub(crate) fn new(footprint: Footprint) -> Self {
        Self {
            footprint,
            seen: Vec::new(),
            with_depth: None,
            columns: Vec::new(),
            eye: Point2::origin(),
            things: Vec::new(),
            held_s: 0.0,
            grid: Grid::default(),
            rays: PixelRays::default(),
        }
    }

    /// Takes in an image, `motion` after the frame before. Points near the followed person are
    /// remembered only if they stay when the person goes, and moving ones are not.
    pub(crate) fn update(
        &mut self,
        settings: &CollisionMonitorSettings,
        camera: &Camera,
        depth: &DepthImage,
        motion: &EgoMotion,
        target: Option<&Person>,
    ) {
        let dt_s = motion.dt + std::mem::take(&mut self.held_s);
        self.add_depth(settings, camera, depth, dt_s);
        // The order matters: old obstacles are matched with the new points before the rest of these
        // become new obstacles.
        self.grid.count(reach_m(settings, &self.footprint), &self.seen);
        self.propagate(settings, camera, depth, motion, dt_s, target);
        self.remember(settings, target);
    }

    /// Takes in that no new image came with a frame, `motion` after the frame before: the last one
    /// holds, in the robot's new frame.
    pub(crate) fn hold(&mut self, settings: &CollisionMonitorSettings, motion: &EgoMotion) {
        self.held_s += motion.dt;
        self.eye = motion.apply_to_point(self.eye);
        for point in &mut self.seen {
            let at = motion.apply_to_point(point.xy());
            *point = Point3::new(at.x, at.y, point.z);
        }
        for column in &mut self.columns {
            column.advance(motion);
        }
        let footprint = &self.footprint;
        let reach_m = reach_m(settings, footprint);
        self.things.retain_mut(|thing| {
            thing.at = motion.apply_to_point(thing.at);
            // An obstacle in the last image needs no memory, and is not forgotten with the frames
            // between two images. People may be known without an image.
            if thing.unseen_s > 0.0 || thing.who.is_some() {
                thing.unseen_s += motion.dt;
            }
            let is_kept =
                thing.unseen_s == 0.0 || thing.unseen_s <= thing.kept_s(settings, footprint);
            is_kept && thing.at.coords.norm() < reach_m
        });
    }

    /// Takes in the left image of a stereo pair, whose depth this is. A column without texture is
    /// dark for want of it, and no object hides it.
    pub(crate) fn excuse_smooth(&mut self, left: &GreyImage) {
        let step = left.width().div_ceil(COLUMNS).max(1);
        for (at, column) in self.columns.iter_mut().enumerate() {
            if column.dark_s > 0.0 && is_smooth(left, at * step, step) {
                column.dark_s = f64::INFINITY;
            }
        }
    }

    /// Remembers other people where they were seen last, until the camera sees past that place or
    /// sees them elsewhere: a person in the robot's way is soon too near to be seen.
    pub(crate) fn add_tracks(&mut self, tracks: &[Track], followed: Option<TrackId>) {
        for track in tracks.iter().filter(|track| track.seen) {
            // An older place of the same person is outdated, also that of the target.
            self.things.retain(|thing| thing.who != Some(track.id));
            if Some(track.id) != followed {
                let Point3 { coords: torso } = track.estimate.person.position - TORSO;
                let at = torso.xy().into();
                let heights = Heights::of(torso.z);
                let who = Some(track.id);
                // `STANDS_S` at once: the tracker vouches for a person, so no second of standing is
                // needed.
                let seen_s = STANDS_S;
                self.things.push(Obstacle { seen_s, who, ..Obstacle::new(at, heights) });
            }
        }
    }

    /// Forgets all places, after a jump of the clock.
    pub(crate) fn clear(&mut self) {
        *self = Self::new(self.footprint.clone());
    }

    /// Returns true if the last depth image has too few readings.
    pub(super) fn is_blind(&self, settings: &CollisionMonitorSettings) -> bool {
        self.with_depth.is_some_and(|part| part < settings.min_seen)
    }

    /// Returns the points of things in the image, and of falls, which have no height; robot frame, m.
    pub(super) fn seen(&self) -> &[Point3<f64>] {
        &self.seen
    }

    /// Returns the things that are not in view.
    pub(super) fn remembered(&self) -> impl Iterator<Item = Remembered> {
        let unseen = self.things.iter().filter(|thing| thing.unseen_s > 0.0);
        unseen.map(|thing| Remembered {
            at: thing.at,
            is_person: thing.who.is_some(),
            is_drop: thing.is_drop,
        })
    }

    /// Returns the places of objects that hide columns of the image.
    pub(super) fn hidden(&self) -> impl Iterator<Item = Point2<f64>> {
        self.columns.iter().filter(|column| column.is_hidden()).map(|column| column.at)
    }

    /// Returns the place of the camera, and the ends of the rays up to which the image shows nothing.
    pub(super) fn free_to(&self) -> (Point2<f64>, impl Iterator<Item = Point2<f64>>) {
        (self.eye, self.columns.iter().filter_map(|column| column.nearest.or(column.farthest)))
    }

    /// Returns the nearest thing in each column, also beyond the reach within which things matter: what
    /// stands farther away must not seem to appear when the robot comes nearer.
    pub(super) fn nearest(&self) -> impl Iterator<Item = Point2<f64>> {
        self.columns.iter().filter_map(|column| column.nearest)
    }

    /// Returns the directions in which the last image has depth, if there was one.
    pub(super) fn coverage(&self, min_share: f64) -> Option<Coverage> {
        self.with_depth?;
        let border = BORDER * self.columns.len() as f64;
        let mut looks = Vec::with_capacity(self.columns.len());
        for (at, column) in self.columns.iter().enumerate() {
            let from_side = at.min(self.columns.len() - 1 - at);
            let is_border = (from_side as f64) < border && column.dark_s == f64::INFINITY;
            if !is_border {
                let way = column.at - self.eye;
                let look = if column.dark_s == 0.0 { Look::Seen } else { Look::Unknown };
                looks.push((way.y.atan2(way.x), look));
            }
        }
        Some(Coverage::new(self.eye, looks, min_share))
    }

    /// Moves the obstacles into the robot's new frame. Forgets those that the camera sees past,
    /// those that were seen too briefly, and those out of view for too long.
    fn propagate(
        &mut self,
        settings: &CollisionMonitorSettings,
        camera: &Camera,
        depth: &DepthImage,
        motion: &EgoMotion,
        dt_s: f64,
        target: Option<&Person>,
    ) {
        let grid = &self.grid;
        let footprint = &self.footprint;
        let reach_m = reach_m(settings, footprint);
        self.things.retain_mut(|thing| {
            thing.at = motion.apply_to_point(thing.at);
            let at = &thing.at;
            if at.coords.norm() >= reach_m {
                return false;
            }
            if grid.has_points(at, ENOUGH) {
                let seen = grid.heights_around(at);
                let free = thing.heights.free(camera, depth, at, seen);
                thing.free_s = if free.0 == 0 { 0.0 } else { thing.free_s + dt_s };
                thing.heights.0 |= seen.0;
                if thing.free_s >= STANDS_S {
                    thing.heights.0 &= !free.0;
                }
                thing.see(settings, dt_s, target);
                return true;
            }
            thing.unseen_s += motion.dt;
            let is_gone = if thing.is_drop {
                shows_floor(settings, camera, depth, at)
            } else {
                // A few points at the edge of the image are not enough to see it, nor that it is gone.
                !grid.has_points(at, 1) && shows_past(camera, depth, at, thing.heights)
            };
            !is_gone && thing.unseen_s <= thing.kept_s(settings, footprint)
        });
    }

    fn add_depth(
        &mut self,
        settings: &CollisionMonitorSettings,
        camera: &Camera,
        depth: &DepthImage,
        dt_s: f64,
    ) {
        self.seen.clear();
        let reach_m = reach_m(settings, &self.footprint);
        let eye: Point3<f64> = camera.robot_from_camera.translation.vector.into();
        self.eye = eye.xy();
        // Large images are sampled, so that `min_points` does not depend on their resolution.
        let step = depth.width().div_ceil(COLUMNS).max(1);
        let rows = depth.height().div_ceil(step);
        self.columns.resize(depth.width().div_ceil(step), Column::NEVER_SEEN);
        self.columns.iter_mut().for_each(Column::begin);
        let rays = self.rays.of(camera, [depth.width(), depth.height()], step);
        let reach_square = reach_m * reach_m;
        for (sampled, y) in (0..depth.height()).step_by(step).enumerate() {
            let row = depth.row(y).iter().step_by(step);
            for (at, (z, column)) in row.zip(&mut self.columns).enumerate() {
                let z = f64::from(*z);
                if !is_reading(z) {
                    continue;
                }
                let point = rays.point(at, sampled, z);
                let is_thing = is_thing(settings, &point);
                column.take(&eye, &point, is_thing);
                let place = if is_thing { Some(point) } else { fall(settings, &eye, &point) };
                self.seen
                    .extend(place.filter(|place| place.xy().coords.norm_squared() < reach_square));
            }
        }
        let read: u32 = self.columns.iter().map(|column| column.read).sum();
        let middle = 0.5 * depth.height() as f64;
        for (at, column) in self.columns.iter_mut().enumerate() {
            let pixel = Point2::new((at * step) as f64, middle);
            column.at = camera.back_project(pixel, HIDES_M).xy();
            column.end(rows, dt_s);
        }
        self.with_depth = Some(f64::from(read) / (rows * self.columns.len()).max(1) as f64);
    }

    fn remember(&mut self, settings: &CollisionMonitorSettings, target: Option<&Person>) {
        for thing in &self.things {
            // Points of a known obstacle must not become a second one below.
            self.grid.clear_around(&thing.at);
        }
        for point in &self.seen {
            let at = point.xy();
            if self.grid.is_full(&at) {
                self.grid.clear_around(&at);
                let heights = self.grid.heights_around(&at);
                let is_drop = point.z <= 0.0;
                let of_target =
                    !is_drop && target.is_some_and(|person| is_of(settings, person, &at));
                let first = Obstacle { of_target, is_drop, ..Obstacle::new(at, heights) };
                self.things.push(first);
            }
        }
        self.join_low_parts();
    }

    /// Lets low things that are seen beside standing ones stand, too.
    fn join_low_parts(&mut self) {
        let mut standing = Vec::new();
        for thing in &self.things {
            if thing.is_static() && !thing.is_drop && thing.who.is_none() {
                standing.push(thing.at);
            }
        }
        for thing in &mut self.things {
            if thing.may_be_low_part()
                && standing.iter().any(|at| nalgebra::distance(at, &thing.at) < BESIDE_M)
            {
                thing.seen_s = thing.seen_s.max(STANDS_S);
            }
        }
    }
}

impl Obstacle {
    fn new(at: Point2<f64>, heights: Heights) -> Self {
        Self {
            at,
            heights,
            free_s: 0.0,
            seen_s: 0.0,
            beside_s: 0.0,
            unseen_s: 0.0,
            of_target: false,
            who: None,
            is_drop: false,
        }
    }

    /// Takes in that it is seen, `dt_s` after the image before.
    fn see(&mut self, settings: &CollisionMonitorSettings, dt_s: f64, target: Option<&Person>) {
        self.unseen_s = 0.0;
        let target = target.filter(|_| !self.is_drop);
        let of_target = target.is_some_and(|person| is_of(settings, person, &self.at));
        if of_target || target.is_some_and(|person| may_carry(person, &self.at)) {
            self.beside_s += dt_s;
            return;
        }
        self.seen_s += dt_s;
        self.of_target = false;
        if target.is_some_and(|person| far_m(person, &self.at) > CARRIED_M) {
            self.seen_s += std::mem::take(&mut self.beside_s);
        }
    }

    /// Returns true for a low thing in view, which may be a part of a standing one.
    fn may_be_low_part(&self) -> bool {
        self.unseen_s == 0.0 && !self.of_target && !self.is_drop && self.heights.are_low()
    }

    /// Returns true if it was seen for long enough to be remembered.
    fn is_static(&self) -> bool {
        self.seen_s >= if self.is_drop { FALLS_S } else { STANDS_S }
    }

    /// Returns the time for which it is remembered out of view, s: until it is seen to be gone if it
    /// was close, and for long if it stood for a second.
    fn kept_s(&self, settings: &CollisionMonitorSettings, footprint: &Footprint) -> f64 {
        if !self.of_target && footprint.distance_m(&self.at) < CLOSE_M {
            f64::INFINITY
        } else if self.is_static() {
            settings.memory_s
        } else {
            0.0
        }
    }
}

impl Heights {
    /// Returns the set of the one height nearest to `height_m`.
    fn of(height_m: f64) -> Self {
        Self(1 << (height_m / BAND_M).clamp(0.0, 15.0) as u16)
    }

    fn are_low(self) -> bool {
        self.metres().all(|height_m| height_m < LOW_M)
    }

    /// Returns the lower end of each height, m.
    fn metres(self) -> impl Iterator<Item = f64> {
        (0..16).filter(move |bit| self.0 & (1 << bit) != 0).map(|bit| f64::from(bit) * BAND_M)
    }

    /// Returns those of these heights that are free while something is `seen` at others: those of a
    /// person who got up from a chair, by which it would seem to be gone when it is below the image.
    fn free(self, camera: &Camera, depth: &DepthImage, at: &Point2<f64>, seen: Self) -> Self {
        let mut free = Self::default();
        for height_m in Self(self.0 & !seen.0).metres() {
            let behind_m = behind_m(camera, depth, at, height_m);
            if behind_m.is_some_and(|behind_m| behind_m > BEHIND_M) {
                free.0 |= Self::of(height_m + 0.5 * BAND_M).0;
            }
        }
        free
    }
}

impl Column {
    const NEVER_SEEN: Self = Self {
        at: Point2::new(0.0, 0.0),
        read: 0,
        nearest: None,
        farthest: None,
        nearest_square: f64::INFINITY,
        farthest_square: f64::NEG_INFINITY,
        dark_s: f64::INFINITY,
    };

    /// Returns true if an object nearer than the camera measures may hide the column: it had readings
    /// once and has none now, from the floor to the top of the image. It stays so until it has
    /// readings again.
    fn is_hidden(&self) -> bool {
        0.0 < self.dark_s && self.dark_s.is_finite()
    }

    /// Moves its places into the robot's new frame.
    fn advance(&mut self, motion: &EgoMotion) {
        self.at = motion.apply_to_point(self.at);
        self.nearest = self.nearest.map(|at| motion.apply_to_point(at));
        self.farthest = self.farthest.map(|at| motion.apply_to_point(at));
    }

    /// Begins an image.
    fn begin(&mut self) {
        self.nearest = None;
        self.farthest = None;
        self.nearest_square = f64::INFINITY;
        self.farthest_square = f64::NEG_INFINITY;
    }

    /// Takes in a reading.
    fn take(&mut self, eye: &Point3<f64>, point: &Point3<f64>, is_thing: bool) {
        self.read += 1;
        let at = point.xy();
        let square = (at - eye.xy()).norm_squared();
        if is_thing && square < self.nearest_square {
            self.nearest_square = square;
            self.nearest = Some(at);
        }
        if square > self.farthest_square {
            self.farthest_square = square;
            self.farthest = Some(at);
        }
    }

    /// Ends an image of so many rows, after all its readings were counted.
    fn end(&mut self, rows: usize, dt_s: f64) {
        let is_dark = f64::from(self.read) < DARK * rows as f64;
        self.dark_s = if is_dark { self.dark_s + dt_s } else { 0.0 };
        self.read = 0;
    }
}

/// Number of points in each cell of a grid around the robot, with a border of one cell.
#[derive(Default)]
struct Grid {
    points: Vec<u16>,
    /// Heights of the points above each cell.
    heights: Vec<Heights>,
    side: usize,
}

impl Grid {
    fn count(&mut self, reach_m: f64, seen: &[Point3<f64>]) {
        // One cell for the middle and one of border on each side, so that neighbours always exist.
        self.side = 2 * (reach_m / CELL_M).ceil() as usize + 3;
        self.points.clear();
        self.points.resize(self.side * self.side, 0);
        self.heights.clear();
        self.heights.resize(self.side * self.side, Heights::default());
        for point in seen {
            let cell = self.cell(&point.xy());
            self.points[cell] = self.points[cell].saturating_add(1);
            self.heights[cell].0 |= Heights::of(point.z).0;
        }
    }

    /// Returns the cell of a place within reach.
    fn cell(&self, at: &Point2<f64>) -> usize {
        self.line(at.x) * self.side + self.line(at.y)
    }

    /// Returns the row or the column of cells at a coordinate, m.
    fn line(&self, metres: f64) -> usize {
        let line = (metres / CELL_M + self.side as f64 / 2.0) as usize;
        line.clamp(1, self.side - 2)
    }

    fn around(&self, at: &Point2<f64>) -> [usize; 9] {
        let cell = self.cell(at);
        let side = self.side;
        std::array::from_fn(|i| cell + (i / 3) * side + i % 3 - side - 1)
    }

    fn is_full(&self, at: &Point2<f64>) -> bool {
        self.points[self.cell(at)] >= ENOUGH
    }

    /// Returns the heights here and one cell away.
    fn heights_around(&self, at: &Point2<f64>) -> Heights {
        Heights(self.around(at).iter().fold(0, |all, cell| all | self.heights[*cell].0))
    }

    /// Returns true if there are at least so many points here, or in a cell beside it.
    fn has_points(&self, at: &Point2<f64>, least: u16) -> bool {
        self.around(at).iter().any(|cell| self.points[*cell] >= least)
    }

    fn clear_around(&mut self, at: &Point2<f64>) {
        self.around(at).iter().for_each(|cell| self.points[*cell] = 0);
    }
}

/// Returns true if a column of an image has nearly no texture, by the pixels of every so many rows.
fn is_smooth(image: &GreyImage, x: usize, step: usize) -> bool {
    // The border has no slope: it has no neighbours.
    if x == 0 || x + 1 >= image.width() || image.height() < 3 {
        return true;
    }
    let rows = (1..image.height() - 1).step_by(step);
    let textured =
        rows.clone().filter(|y| slope_at(image, x as i64, *y as i64) >= TEXTURED).count();
    (textured as f64) < SMOOTH * rows.len() as f64
}

/// Returns the slope of the brightness across a pixel, smoothed over its rows.
fn slope_at(image: &GreyImage, x: i64, y: i64) -> i32 {
    let sum = across_at(image, x, y - 1) + 2 * across_at(image, x, y) + across_at(image, x, y + 1);
    (sum / 4).abs()
}

/// Returns the difference of the brightness to the right and to the left of a pixel.
fn across_at(image: &GreyImage, x: i64, y: i64) -> i32 {
    let right = image.get(x + 1, y).map_or(0, i32::from);
    right - image.get(x - 1, y).map_or(0, i32::from)
}

/// Returns true for a depth that was measured, m.
fn is_reading(depth_m: f64) -> bool {
    0.0 < depth_m && depth_m < FARTHEST_M
}

/// Returns true if the image shows a surface behind a place at one of the heights. Out of the image
/// and at pixels without depth it shows nothing.
fn shows_past(camera: &Camera, depth: &DepthImage, at: &Point2<f64>, heights: Heights) -> bool {
    // Both ends of a height: at the edge of the image a thing in between may be out of view.
    heights.metres().any(|low_m| {
        [low_m, low_m + BAND_M].into_iter().all(|height_m| {
            behind_m(camera, depth, at, height_m).is_some_and(|behind_m| behind_m > -BEFORE_M)
        })
    })
}

/// Returns how far behind a place at a height the surface is that the image shows there, m; `None` out
/// of the image and at pixels without depth.
fn behind_m(camera: &Camera, depth: &DepthImage, at: &Point2<f64>, height_m: f64) -> Option<f64> {
    let place = Point3::new(at.x, at.y, height_m);
    let pixel = camera.project(&place)?;
    let z = f64::from(depth.get(pixel.x.round() as i64, pixel.y.round() as i64)?);
    is_reading(z).then(|| z - camera.depth_of(&place))
}

/// Returns true if the image shows a surface at a place of the floor that is no fall.
fn shows_floor(
    settings: &CollisionMonitorSettings,
    camera: &Camera,
    depth: &DepthImage,
    at: &Point2<f64>,
) -> bool {
    let eye = camera.robot_from_camera.translation.vector.into();
    let Some(pixel) = camera.project(&Point3::new(at.x, at.y, 0.0)) else { return false };
    let pixel = Point2::new(pixel.x.round(), pixel.y.round());
    let seen_m = depth.get(pixel.x as i64, pixel.y as i64).map(f64::from);
    seen_m.is_some_and(|z| {
        is_reading(z) && fall(settings, &eye, &camera.back_project(pixel, z)).is_none()
    })
}

fn far_m(person: &Person, at: &Point2<f64>) -> f64 {
    nalgebra::distance(&person.position.xy(), at)
}

/// Returns true for a place that belongs to the person.
fn is_of(settings: &CollisionMonitorSettings, person: &Person, at: &Point2<f64>) -> bool {
    far_m(person, at) < settings.target_radius_m
}

fn may_carry(person: &Person, at: &Point2<f64>) -> bool {
    far_m(person, at) < CARRIED_M && person.velocity.norm() < STAYS_MPS
}

/// Returns the distance from the middle of the robot within which things matter, m.
fn reach_m(settings: &CollisionMonitorSettings, footprint: &Footprint) -> f64 {
    settings.range_m + footprint.front_m()
}

#[cfg(test)]
mod tests;
