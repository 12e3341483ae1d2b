//! Space that a sensor saw free or occupied, to distinguish moving objects from static ones.

use nalgebra::{Isometry2, Point2};
use tagalong_core::EgoMotion;

/// Size of a cell, m.
const CELL_M: f64 = 0.1;
/// Cells along each side: 12.8 m, which the robot takes along.
const SIDE: i32 = 128;
/// Step along a ray, cells: no cell is passed over.
const STEP: f64 = 0.8;
/// Parts of a cell in which places along a ray are counted: whole numbers, which are faster than
/// rounding.
const PARTS_BITS: u32 = 16;
/// Distance from the origin of the odometry up to which there are cells, cells: some 100,000 km.
const FARTHEST: f64 = 1e9;
/// Gap without a reading after which something in a cell has appeared anew, ms: a few frames.
const GAP_MS: u32 = 400;
/// Time after which a thing in a cell stands still, ms: the leg of a walking person is off sooner.
const STANDS_MS: u32 = 1000;
/// Time for which a look at a free place counts, ms.
const FREE_MS: u32 = 3000;
/// Cells around one that were free, of 8, for something in it to have come there: at the border of
/// the view a cell is half free and half a wall.
const FREE_AROUND: usize = 6;
/// Time for which a thing that came by itself and stands may go on, ms.
const PARKED_MS: u32 = 10_000;

/// History of the thing in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Presence {
    /// It has been there for a second.
    Stands,
    /// It has been there for a second, and came by itself.
    Parked,
    /// It appeared where nothing was known.
    New,
    /// It appeared where the sensor had seen that nothing was.
    Appeared,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Cell {
    /// Coordinates: cells far away share a slot.
    tag: (i32, i32),
    /// Times, ms; 0 for never.
    free_ms: u32,
    hit_ms: u32,
    /// Start of the presence of the thing in it.
    since_ms: u32,
    appeared: bool,
}

/// Grid around the robot, fixed in the world as the odometry has it.
pub(super) struct SpaceGrid {
    cells: Vec<Cell>,
    grid_from_robot: Isometry2<f64>,
    now_ms: u32,
    /// Cells that the last ray went through, step by step.
    last_ray: Vec<(i32, i32)>,
}

impl Default for SpaceGrid {
    fn default() -> Self {
        Self {
            cells: vec![Cell::default(); (SIDE * SIDE) as usize],
            grid_from_robot: Isometry2::identity(),
            // Not 0, which stands for never.
            now_ms: 2 * FREE_MS,
            last_ray: Vec::new(),
        }
    }
}

impl SpaceGrid {
    /// Moves on with the robot and the time.
    pub(super) fn advance(&mut self, motion: &EgoMotion) {
        // A step that is no number says nothing; the pipeline stands then.
        if motion.forward.is_finite() && motion.left.is_finite() && motion.turn.is_finite() {
            self.grid_from_robot *= motion.isometry();
        }
        let step_ms = (motion.dt.clamp(0.0, 60.0) * 1e3).round() as u32;
        self.now_ms = self.now_ms.saturating_add(step_ms.max(1));
    }

    /// Takes in the readings of one image or scan: places where rays met something, and ends of the
    /// rays, up to which the way from `eye` was free; robot frame, m.
    pub(super) fn add(
        &mut self,
        eye: Point2<f64>,
        met: impl Iterator<Item = Point2<f64>>,
        free_to: impl Iterator<Item = Point2<f64>>,
    ) {
        // All hits first: a ray that passes by in the same cell does not free it.
        for at in met {
            self.hit(&at);
        }
        let from = self.grid_from_robot * eye;
        self.last_ray.clear();
        for end in free_to {
            self.free(&from, &(self.grid_from_robot * end));
        }
    }

    /// Marks the cells on the way from an eye to the end of a ray as free, without the last one; places
    /// in the grid, m.
    fn free(&mut self, from: &Point2<f64>, to: &Point2<f64>) {
        let now_ms = self.now_ms;
        let way = (to - from) / CELL_M;
        let length = way.norm();
        let start = from.coords / CELL_M;
        // Positive comparison, so that a place that is no number frees nothing.
        let is_near = length.is_finite() && start.amax() <= FARTHEST;
        if !is_near {
            return;
        }
        let reach = length.min(0.5 * f64::from(SIDE));
        let steps = ((reach - 1.0) / STEP).max(0.0) as usize;
        let step = way * (STEP / length.max(STEP));
        let mut at = [parts(start.x), parts(start.y)];
        let step = [parts(step.x), parts(step.y)];
        let mut last_ray = std::mem::take(&mut self.last_ray);
        let known = last_ray.len().min(steps);
        last_ray.resize(last_ray.len().max(steps), (0, 0));
        let mut last = None;
        for (number, beside) in last_ray[..steps].iter_mut().enumerate() {
            let place = ((at[0] >> PARTS_BITS) as i32, (at[1] >> PARTS_BITS) as i32);
            at = [at[0] + step[0], at[1] + step[1]];
            // Steps are shorter than cells, and rays lie close together: most places were just marked.
            let is_marked = last == Some(place) || (number < known && *beside == place);
            last = Some(place);
            *beside = place;
            if is_marked {
                continue;
            }
            let cell = self.cell_of(place);
            if cell.hit_ms != now_ms {
                cell.free_ms = now_ms;
            }
        }
        self.last_ray = last_ray;
    }

    /// Returns the history of a thing that was met at a place in this frame.
    pub(super) fn presence(&self, at: &Point2<f64>) -> Presence {
        let place = coordinates(&(self.grid_from_robot * at));
        let Some(cell) = self.at(place) else { return Presence::New };
        // Noise and a wrong angle move the border of a standing thing by a cell. Its new border stands
        // like the rest of it, however long it has been there.
        if self.stands(cell) && !cell.appeared || self.is_beside_standing(place) {
            return Presence::Stands;
        }
        if self.stands(cell) {
            let is_parked = self.now_ms - cell.since_ms <= PARKED_MS;
            return if is_parked { Presence::Parked } else { Presence::Stands };
        }
        if cell.appeared { Presence::Appeared } else { Presence::New }
    }

    /// Returns true if a thing that did not come by itself stands in a cell around one.
    fn is_beside_standing(&self, (x, y): (i32, i32)) -> bool {
        for dx in -1..=1 {
            for dy in -1..=1 {
                let is_middle = dx == 0 && dy == 0;
                let beside =
                    self.at((x.saturating_add(dx), y.saturating_add(dy))).filter(|_| !is_middle);
                if beside.is_some_and(|cell| self.stands(cell) && !cell.appeared) {
                    return true;
                }
            }
        }
        false
    }

    fn stands(&self, cell: &Cell) -> bool {
        cell.hit_ms != 0
            && self.now_ms - cell.hit_ms <= GAP_MS
            && self.now_ms - cell.since_ms >= STANDS_MS
    }

    fn hit(&mut self, at: &Point2<f64>) {
        let now_ms = self.now_ms;
        let place = self.grid_from_robot * at;
        if !(place.x.is_finite() && place.y.is_finite()) {
            return;
        }
        let place = coordinates(&place);
        let cell = self.cell_of(place);
        let is_new = cell.hit_ms == 0 || now_ms - cell.hit_ms > GAP_MS;
        let was_free = cell.free_ms > cell.hit_ms && now_ms - cell.free_ms <= FREE_MS;
        cell.hit_ms = now_ms;
        // Most readings are of things that were there before: the cells around need no look.
        if is_new {
            // The border of a standing thing wanders with the drift of the odometry, cell by cell.
            let appeared = was_free && self.is_amid_free(place) && !self.is_beside_standing(place);
            let cell = self.cell_of(place);
            cell.since_ms = now_ms;
            cell.appeared = appeared;
        }
    }

    /// Returns true if most of the cells around one were seen free lately.
    fn is_amid_free(&self, (x, y): (i32, i32)) -> bool {
        let mut free = 0;
        for dx in -1..=1 {
            for dy in -1..=1 {
                let is_middle = dx == 0 && dy == 0;
                let beside =
                    self.at((x.saturating_add(dx), y.saturating_add(dy))).filter(|_| !is_middle);
                let was_free = beside
                    .is_some_and(|cell| cell.free_ms != 0 && self.now_ms - cell.free_ms <= FREE_MS);
                free += usize::from(was_free);
            }
        }
        free >= FREE_AROUND
    }

    fn at(&self, place: (i32, i32)) -> Option<&Cell> {
        let cell = &self.cells[slot(place)];
        (cell.tag == place).then_some(cell)
    }

    fn cell_of(&mut self, place: (i32, i32)) -> &mut Cell {
        let cell = &mut self.cells[slot(place)];
        if cell.tag != place {
            *cell = Cell { tag: place, ..Cell::default() };
        }
        cell
    }
}

fn coordinates(at: &Point2<f64>) -> (i32, i32) {
    (line(at.x), line(at.y))
}

/// Returns the row or the column of cells at a coordinate, m.
fn line(metres: f64) -> i32 {
    let cells = metres / CELL_M;
    let towards_zero = cells as i32;
    // Rounds down, as `floor`, which is a call of a library on most targets.
    towards_zero.saturating_sub(i32::from(f64::from(towards_zero) > cells))
}

/// Returns a number of cells in parts of a cell.
fn parts(cells: f64) -> i64 {
    (cells * f64::from(1_u32 << PARTS_BITS)).floor() as i64
}

fn slot((x, y): (i32, i32)) -> usize {
    (x.rem_euclid(SIDE) * SIDE + y.rem_euclid(SIDE)) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    const EYE: Point2<f64> = Point2::new(0.0, 0.0);

    /// A wall from (3, -1) to (3, 1), and a thing before it at `at`, if any.
    fn look(grid: &mut SpaceGrid, forward: f64, robot_m: f64, at: Option<f64>) -> Option<Presence> {
        grid.advance(&EgoMotion { forward, ..EgoMotion::at_rest(0.1) });
        let wall = (-10..=10).map(|y| Point2::new(3.0 - robot_m, 0.1 * f64::from(y) + 0.05));
        let thing = at.map(|x| Point2::new(x - robot_m, 0.05));
        let met: Vec<Point2<f64>> =
            wall.filter(|place| thing.is_none() || place.y.abs() > 0.1).chain(thing).collect();
        grid.add(EYE, met.iter().copied(), met.iter().copied());
        thing.map(|thing| grid.presence(&thing))
    }

    #[test]
    fn what_appears_in_a_free_place_moves_until_it_stood_for_a_second() {
        let mut grid = SpaceGrid::default();
        for _ in 0..12 {
            look(&mut grid, 0.0, 0.0, None);
        }
        assert_eq!(grid.presence(&Point2::new(3.0, 0.35)), Presence::Stands, "the wall");
        let seen: Vec<_> = (0..12).map(|_| look(&mut grid, 0.0, 0.0, Some(1.5)).unwrap()).collect();
        assert!(seen[..9].iter().all(|presence| *presence == Presence::Appeared), "{seen:?}");
        assert_eq!(seen[11], Presence::Parked);
        let last = (0..100).map(|_| look(&mut grid, 0.0, 0.0, Some(1.5)).unwrap()).last();
        assert_eq!(last, Some(Presence::Stands), "for good");
    }

    #[test]
    fn what_comes_nearer_is_seen_to_move_all_the_time() {
        let mut grid = SpaceGrid::default();
        for _ in 0..12 {
            look(&mut grid, 0.0, 0.0, None);
        }
        for step in 0..15 {
            let at = 2.5 - 0.15 * f64::from(step);
            assert_eq!(look(&mut grid, 0.0, 0.0, Some(at)), Some(Presence::Appeared), "{at}");
        }
    }

    #[test]
    fn what_was_never_looked_at_is_new_and_a_wall_stands_while_the_robot_drives() {
        let mut grid = SpaceGrid::default();
        look(&mut grid, 0.0, 0.0, None);
        assert_eq!(grid.presence(&Point2::new(3.0, 0.35)), Presence::New);
        let mut robot_m = 0.0;
        for _ in 0..25 {
            robot_m += 0.05;
            look(&mut grid, 0.05, robot_m, None);
        }
        assert_eq!(grid.presence(&Point2::new(3.0 - robot_m, 0.35)), Presence::Stands);
    }

    /// A post of a door at 3 m, with the opening to its right, as the robot sees it.
    fn look_at_door(grid: &mut SpaceGrid, left_m: f64) -> Presence {
        grid.advance(&EgoMotion { left: left_m, ..EgoMotion::at_rest(0.1) });
        let post = [0.05, 0.15].map(|y| Point2::new(3.05, y));
        let beyond = (-10..10).filter(|y| !(0..3).contains(y));
        let beyond = beyond.map(|y| Point2::new(5.05, 0.1 * f64::from(y) + 0.05));
        let met: Vec<Point2<f64>> = post.into_iter().chain(beyond).collect();
        grid.add(EYE, met.iter().copied(), met.iter().copied());
        grid.presence(&Point2::new(3.05, 0.05))
    }

    #[test]
    fn the_edge_of_a_door_that_wanders_with_the_odometry_stands() {
        let mut grid = SpaceGrid::default();
        for _ in 0..20 {
            look_at_door(&mut grid, 0.0);
        }
        // The odometry drifts, and the post with it: soon none of its cells is one of the first.
        for drift in 0..5 {
            for step in 0..15 {
                let drift_m = if step == 0 { -0.1 } else { 0.0 };
                assert_eq!(look_at_door(&mut grid, drift_m), Presence::Stands, "{drift} {step}");
            }
        }
    }

    #[test]
    fn a_person_who_comes_through_a_door_moves() {
        let mut grid = SpaceGrid::default();
        for _ in 0..20 {
            look_at_door(&mut grid, 0.0);
        }
        let mut seen = Vec::new();
        for step in 0..8 {
            grid.advance(&EgoMotion::at_rest(0.1));
            // From behind the post into the opening, along it, and on.
            let y = 0.05 - 0.06 * f64::from(step);
            let person = [-0.1, 0.0, 0.1].map(|aside| Point2::new(3.05, y + aside));
            let post = [0.05, 0.15].map(|y| Point2::new(3.05, y));
            let met: Vec<Point2<f64>> = post.into_iter().chain(person).collect();
            grid.add(EYE, met.iter().copied(), met.iter().copied());
            seen.push(grid.presence(&person[0]));
        }
        assert!(seen[1..].iter().all(|presence| *presence == Presence::Appeared), "{seen:?}");
    }

    #[test]
    fn rays_side_by_side_free_the_same_places_as_one_at_a_time() {
        let eye = Point2::new(0.2, -0.1);
        // Rays of very different lengths beside each other.
        let ends: Vec<Point2<f64>> = (0..720)
            .map(|ray| {
                let angle = f64::from(ray) * 0.0087;
                let length_m = 0.3 + f64::from(ray * 37 % 101) * 0.09;
                eye + length_m * nalgebra::Vector2::new(angle.cos(), angle.sin())
            })
            .collect();
        let mut together = SpaceGrid::default();
        let mut single = SpaceGrid::default();
        for step in 0..3 {
            for grid in [&mut together, &mut single] {
                grid.advance(&EgoMotion { forward: 0.3, turn: 0.4, ..EgoMotion::at_rest(0.1) });
            }
            let met = ends.iter().copied().skip(step).step_by(3);
            together.add(eye, met.clone(), ends.iter().copied());
            single.add(eye, met, std::iter::empty());
            for end in &ends {
                single.add(eye, std::iter::empty(), std::iter::once(*end));
            }
        }
        assert!(
            together.cells.iter().filter(|cell| cell.free_ms == together.now_ms).count() > 3000
        );
        assert!(together.cells == single.cells);
    }

    #[test]
    fn places_that_are_no_numbers_and_far_away_are_harmless() {
        let mut grid = SpaceGrid::default();
        grid.advance(&EgoMotion { forward: f64::NAN, ..EgoMotion::at_rest(f64::NAN) });
        let odd =
            [Point2::new(f64::NAN, 1.0), Point2::new(f64::INFINITY, 0.0), Point2::new(1e9, 0.0)];
        grid.add(EYE, odd.into_iter(), odd.into_iter());
        assert_eq!(grid.presence(&Point2::new(1.0, 0.0)), Presence::New);
    }
}
