use std::f64::consts::TAU;

use nalgebra::Point2;
use tagalong_core::{DepthImage, EgoMotion, LaserScan};
use tagalong_geometry::Camera;

/// Directions around the robot.
const DIRECTIONS: usize = 90;
/// Columns and rows of the image that are looked at.
const COLUMNS: usize = 90;
const ROWS: usize = 60;
/// Nothing farther away is remembered, m.
const RANGE_M: f64 = 4.0;

/// The nearest thing in each direction around the robot, seen or remembered.
#[derive(Clone, Debug)]
pub(crate) struct NearestObstacles {
    things: [Option<Obstacle>; DIRECTIONS],
}

/// Nearest things in the sensors of one frame, and the directions that they show.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Look {
    seen: [Option<Obstacle>; DIRECTIONS],
    looked: [bool; DIRECTIONS],
}

#[derive(Clone, Copy, Debug)]
struct Obstacle {
    /// Robot frame, m.
    at: Point2<f64>,
    age_s: f64,
}

impl NearestObstacles {
    pub(crate) fn new() -> Self {
        Self { things: [None; DIRECTIONS] }
    }

    /// The places of all things, robot frame, m.
    pub(crate) fn places(&self) -> impl Iterator<Item = Point2<f64>> {
        self.things.iter().flatten().map(|thing| thing.at)
    }

    /// Moves the memory along with the robot; points older than `memory_s` are forgotten.
    pub(crate) fn move_along(&mut self, motion: &EgoMotion, memory_s: f64) {
        let before = std::mem::replace(&mut self.things, [None; DIRECTIONS]);
        for thing in before.into_iter().flatten() {
            let age_s = thing.age_s + motion.dt;
            if age_s <= memory_s {
                self.add(Obstacle { at: motion.apply_to_point(thing.at), age_s });
            }
        }
    }

    /// Adds a look: its points replace those remembered in the same directions.
    pub(crate) fn add_look(&mut self, look: &Look) {
        // Directions that no sensor showed keep their memory.
        for ((known, seen), looked) in self.things.iter_mut().zip(look.seen).zip(look.looked) {
            if looked {
                *known = seen;
            }
        }
    }

    fn add(&mut self, thing: Obstacle) {
        if let Some(direction) = direction(&thing.at) {
            keep_nearer(&mut self.things[direction], thing);
        }
    }
}

impl Look {
    pub(crate) fn new() -> Self {
        Self { seen: [None; DIRECTIONS], looked: [false; DIRECTIONS] }
    }

    /// Adds a depth image. Points between the `heights`, m, count for which `is_thing` returns true.
    pub(crate) fn add_depth(
        &mut self,
        camera: &Camera,
        depth: &DepthImage,
        heights: [f64; 2],
        is_thing: impl Fn(&Point2<f64>) -> bool,
    ) {
        // A grid of pixels is enough: an obstacle of some size covers many.
        let across = depth.width().div_ceil(COLUMNS).max(1);
        let down = depth.height().div_ceil(ROWS).max(1);
        for y in (0..depth.height()).step_by(down) {
            let row = depth.row(y);
            for x in (0..depth.width()).step_by(across) {
                let z = f64::from(row[x]);
                if !(z > 0.0 && z.is_finite()) {
                    continue;
                }
                let point = camera.back_project(Point2::new(x as f64, y as f64), z);
                self.add_point(point.xy(), (heights[0]..heights[1]).contains(&point.z), &is_thing);
            }
        }
    }

    /// Adds a laser scan likewise: all of its points are things, whatever their height. A ray without a
    /// reflection says nothing, so that its direction keeps its memory; one that ends far away says that
    /// nothing is near.
    pub(crate) fn add_scan(&mut self, scan: &LaserScan, is_thing: impl Fn(&Point2<f64>) -> bool) {
        for point in scan.points.iter() {
            let at = point.xy();
            if at.coords.norm() >= RANGE_M && at.iter().all(|metres| metres.is_finite()) {
                self.looked[direction_of(&at)] = true;
            } else {
                self.add_point(at, true, &is_thing);
            }
        }
    }

    fn add_point(
        &mut self,
        at: Point2<f64>,
        counts: bool,
        is_thing: impl Fn(&Point2<f64>) -> bool,
    ) {
        let Some(direction) = direction(&at) else { return };
        self.looked[direction] = true;
        if counts && is_thing(&at) {
            keep_nearer(&mut self.seen[direction], Obstacle { at, age_s: 0.0 });
        }
    }
}

fn keep_nearer(place: &mut Option<Obstacle>, thing: Obstacle) {
    fn range(thing: &Obstacle) -> f64 {
        thing.at.coords.norm_squared()
    }

    if place.is_none_or(|known| range(&thing) < range(&known)) {
        *place = Some(thing);
    }
}

/// Returns the direction of a place; `None` for a place that is far away or not a number.
fn direction(at: &Point2<f64>) -> Option<usize> {
    // Most points of an image are far away, and the angle costs more than the distance.
    let is_near = at.coords.norm() < RANGE_M;
    if !is_near {
        return None;
    }
    Some(direction_of(at))
}

/// Returns the direction of a place, however far away.
fn direction_of(at: &Point2<f64>) -> usize {
    let part = at.y.atan2(at.x).rem_euclid(TAU) / TAU;
    (part * DIRECTIONS as f64) as usize % DIRECTIONS
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    #[test]
    fn things_stay_where_they_are_while_the_robot_moves_and_are_forgotten() {
        let mut around = NearestObstacles::new();
        around.add(Obstacle { at: Point2::new(1.0, 0.5), age_s: 0.0 });
        let step = EgoMotion { forward: 0.5, ..EgoMotion::at_rest(1.0) };
        around.move_along(&step, 2.5);
        let places: Vec<_> = around.places().collect();
        assert_eq!(places, [Point2::new(0.5, 0.5)]);
        around.move_along(&step, 2.5);
        around.move_along(&step, 2.5);
        assert_eq!(around.places().count(), 0);
    }

    #[test]
    fn the_nearer_of_two_things_in_a_direction_counts() {
        let mut around = NearestObstacles::new();
        for x in [2.0, 1.0, 3.0, f64::NAN, 9.0] {
            around.add(Obstacle { at: Point2::new(x, 0.01 * x), age_s: 0.0 });
        }
        assert_eq!(around.places().map(|p| p.x).collect::<Vec<_>>(), [1.0]);
    }

    #[test]
    fn each_thing_has_its_direction_all_around() {
        let all = [(1.0, 0.01), (0.01, 1.0), (-1.0, 0.01), (-0.01, -1.0), (1.0, -0.01)];
        let found = all.map(|(x, y)| direction(&Point2::new(x, y)));
        assert_eq!(found, [Some(0), Some(22), Some(44), Some(67), Some(89)]);
        assert_eq!(direction(&Point2::new(2.0, 3.0)), Some(14));
        assert_eq!(direction(&Point2::new(2.4, 3.3)), None, "too far away");
    }

    /// A camera 1 m above the floor that sees a board 1 m ahead, to the left.
    #[test]
    fn what_is_looked_at_replaces_what_was_remembered_there() {
        /// Returns a board that ends at a column, before a wall.
        fn board_up_to(column: usize) -> DepthImage {
            DepthImage::from_fn(40, 30, |x, _| if x < column { 1.0 } else { 3.0 })
        }

        use tagalong_geometry::Pinhole;
        let camera = Camera::mounted(Pinhole::centred(30.0, 40, 30), 40, 30, 1.0, 0.0, 0.0);
        let mut around = NearestObstacles::new();
        let board_m = 1.0_f64.hypot(0.35);
        let low = [0.1, 1.5];
        let unknown = DepthImage::filled(40, 30, f32::NAN);
        let wall = DepthImage::filled(40, 30, 1.0);
        let looks = [
            (&board_up_to(10), low, true),
            (&board_up_to(0), low, true),
            (&board_up_to(10), low, true),
            (&unknown, low, true),
            (&wall, [1.6, 1.9], true),
            (&wall, low, false),
        ];
        let [board, gone, back, unseen, overhead, people] =
            looks.map(|(depth, heights, is_thing)| {
                let mut look = Look::new();
                look.add_depth(&camera, depth, heights, |_| is_thing);
                around.add_look(&look);
                around.places().map(|at| at.coords.norm()).fold(9.0, f64::min)
            });
        assert!((board - board_m).abs() < 0.1, "{board}");
        assert!((gone - 3.0).abs() < 0.1, "the board is gone: {gone}");
        assert!((back - board_m).abs() < 0.1, "{back}");
        assert!((unseen - board_m).abs() < 0.1, "nothing is seen, so it is still there: {unseen}");
        assert_eq!(overhead, 9.0, "overhead");
        assert_eq!(people, 9.0, "people");
    }

    #[test]
    fn a_scan_is_looked_at_all_around_and_the_nearer_of_two_sensors_counts() {
        fn all(_: &Point2<f64>) -> bool {
            true
        }

        let mut around = NearestObstacles::new();
        let points = vec![Point3::new(-2.0, 0.1, 0.2), Point3::new(2.0, 0.05, 0.2)];
        let scan = LaserScan::of_points(points);
        let mut look = Look::new();
        look.add_scan(&scan, all);
        look.add_scan(&LaserScan::of_points(vec![Point3::new(1.0, 0.02, 0.2)]), all);
        around.add_look(&look);
        let places: Vec<_> = around.places().collect();
        assert_eq!(places, [Point2::new(1.0, 0.02), Point2::new(-2.0, 0.1)]);
        let mut people = Look::new();
        people.add_scan(&scan, |_| false);
        around.add_look(&people);
        assert_eq!(around.places().count(), 0, "both directions show people alone");
        around.add_look(&look);
        let mut far = Look::new();
        far.add_scan(&LaserScan::of_points(vec![Point3::new(9.0, 0.3, 0.2)]), all);
        around.add_look(&far);
        assert_eq!(around.places().count(), 1, "nothing is ahead any more");
    }
}
